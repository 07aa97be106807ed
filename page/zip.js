// A ZIP file of files as they are, not compressed (PKWARE APPNOTE 6.3: local headers, central directory, its end).

import { crc32 } from "./mcap.js";

/** Files and bytes of an archive without the 64-bit extension. */
const MOST_FILES = 0xffff;
const MOST_BYTES = 0xffffffff;

/** 1 January 1980, the first day that a ZIP file knows: the same files make the same bytes. */
const DATE = (1 << 5) | 1;

/**
 * Numbers of 2 or 4 bytes, little-endian.
 * @param {[number, 2 | 4][]} numbers
 */
function packed(numbers) {
  const bytes = new Uint8Array(numbers.reduce((sum, [, size]) => sum + size, 0));
  const view = new DataView(bytes.buffer);
  let at = 0;
  for (const [value, size] of numbers) {
    if (size === 2) {
      view.setUint16(at, value, true);
    } else {
      view.setUint32(at, value, true);
    }
    at += size;
  }
  return bytes;
}

/**
 * The archive in parts. Names are ASCII.
 * @param {{ name: string, bytes: Uint8Array }[]} files
 * @returns {Uint8Array[]}
 */
export function zipOf(files) {
  /** @type {Uint8Array[]} */
  const parts = [];
  /** @type {Uint8Array[]} */
  const directory = [];
  let at = 0;
  const encoder = new TextEncoder();
  for (const { name, bytes } of files) {
    const written = encoder.encode(name);
    const [short, long] = [/** @type {const} */ (2), /** @type {const} */ (4)];
    /** @type {[number, 2 | 4][]} version, flags, method, time, date; CRC, both sizes; length of the name, no extra field */
    const common = [
      [20, short],
      [0, short],
      [0, short],
      [0, short],
      [DATE, short],
      [crc32(bytes), long],
      [bytes.length, long],
      [bytes.length, long],
      [written.length, short],
      [0, short],
    ];
    parts.push(packed([[0x04034b50, 4], ...common]), written, bytes);
    // no comment, disk 0, no attributes, where the local header is
    const place = packed([[0x02014b50, 4], [20, 2], ...common, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]]);
    directory.push(place, written);
    at += 30 + written.length + bytes.length;
  }
  const length = directory.reduce((sum, part) => sum + part.length, 0);
  if (files.length > MOST_FILES || at + length > MOST_BYTES) {
    throw new Error(`${files.length} files of ${at} bytes are more than a ZIP file holds.`);
  }
  const count = files.length;
  return [...parts, ...directory, packed([[0x06054b50, 4], [0, 2], [0, 2], [count, 2], [count, 2], [length, 4], [at, 4], [0, 2]])];
}

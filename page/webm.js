// A WebM file of pictures that the browser has encoded, each shown for the same time (RFC 8794 EBML, RFC 9559 Matroska).

/** @typedef {{ bytes: Uint8Array, isKey: boolean }} Picture */

/**
 * An element: its ID, the length of what is in it, and that.
 * @param {number} id
 * @param {(Uint8Array | number[])[]} parts
 */
function element(id, ...parts) {
  const length = parts.reduce((sum, part) => sum + part.length, 0);
  const head = [];
  for (let left = id; left > 0; left = Math.floor(left / 256)) {
    head.unshift(left % 256);
  }
  // lengths have eight bytes, of which the first one says so
  head.push(1, ...bigEndian(length, 7));
  const bytes = new Uint8Array(head.length + length);
  bytes.set(head);
  let at = head.length;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** @param {number} value @param {number} count */
function bigEndian(value, count) {
  return Array.from({ length: count }, (_, i) => Math.floor(value / 256 ** (count - 1 - i)) % 256);
}

const whole = (/** @type {number} */ id, /** @type {number} */ value) => element(id, bigEndian(value, 6));
const text = (/** @type {number} */ id, /** @type {string} */ value) => element(id, new TextEncoder().encode(value));

/** @param {number} id @param {number} value */
function real(id, value) {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return element(id, bytes);
}

/**
 * The file. The first picture is a key, as are others again and again, at most a minute apart.
 * @param {Picture[]} pictures
 * @param {{ codec: string, width: number, height: number, pictureMs: number }} look
 */
export function webmOf(pictures, { codec, width, height, pictureMs }) {
  const head = element(
    0x1a45dfa3,
    ...[whole(0x4286, 1), whole(0x42f7, 1), whole(0x42f2, 4), whole(0x42f3, 8)],
    ...[text(0x4282, "webm"), whole(0x4287, 4), whole(0x4285, 2)],
  );
  const about = element(
    0x1549a966,
    whole(0x2ad7b1, 1e6), // times are milliseconds
    real(0x4489, pictures.length * pictureMs),
    text(0x4d80, "beadline"),
    text(0x5741, "beadline"),
  );
  const video = element(0xe0, whole(0xb0, width), whole(0xba, height));
  const track = element(
    0xae,
    ...[whole(0xd7, 1), whole(0x73c5, 1), whole(0x83, 1), text(0x86, codec)],
    ...[whole(0x23e383, pictureMs * 1e6), video],
  );
  /** @type {Uint8Array[]} */
  const clusters = [];
  for (let first = 0; first < pictures.length; ) {
    let end = first + 1;
    while (end < pictures.length && !pictures[end].isKey) {
      end += 1;
    }
    const blocks = pictures
      .slice(first, end)
      .map(({ bytes, isKey }, i) => element(0xa3, [0x81, ...bigEndian(i * pictureMs, 2), isKey ? 0x80 : 0], bytes));
    clusters.push(element(0x1f43b675, whole(0xe7, first * pictureMs), ...blocks));
    first = end;
  }
  return [head, element(0x18538067, about, element(0x1654ae6b, track), ...clusters)];
}

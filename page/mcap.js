// The bytes of MCAP: ranges of a file, records within their bounds, checksums, and the protobuf of our messages.
// docs/FORMAT.md describes the contents of a recording.

/** @import { Bytes, Chain, Term, Wall } from "./types.js" */

const HEAD_BYTES = 1 << 16;

/** @param {Uint8Array} bytes @returns {Bytes} */
export function bytesOfArray(bytes) {
  return { size: bytes.length, read: async (offset, length) => bytes.subarray(offset, offset + length) };
}

/** @param {Blob} file @returns {Bytes} */
export function bytesOfFile(file) {
  return {
    size: file.size,
    read: async (offset, length) => new Uint8Array(await file.slice(offset, offset + length).arrayBuffer()),
  };
}

/** A file at a server that has ranges; of another one, all of it. @param {string} url @returns {Promise<Bytes>} */
export async function bytesOfUrl(url) {
  const ask = async (/** @type {number} */ offset, /** @type {number} */ length) => {
    const answer = await fetch(url, { headers: { Range: `bytes=${offset}-${offset + length - 1}` } });
    if (!answer.ok) {
      throw new Error(`the server has no bytes of the recording: ${answer.status} ${answer.statusText}`);
    }
    return { answer, bytes: new Uint8Array(await answer.arrayBuffer()) };
  };
  const { answer, bytes: head } = await ask(0, HEAD_BYTES);
  if (answer.status !== 206) {
    return bytesOfArray(head);
  }
  const size = Number(/\/(\d+)$/.exec(answer.headers.get("Content-Range") ?? "")?.[1]);
  if (!Number.isSafeInteger(size)) {
    throw new Error("the server does not say how long the recording is");
  }
  return {
    size,
    read: async (offset, length) =>
      offset + length <= head.length
        ? head.subarray(offset, offset + length)
        : (await ask(offset, length)).bytes,
  };
}

/** Exactly these bytes of a file. @param {Bytes} file @param {number} offset @param {number} length */
export async function readExactly(file, offset, length) {
  if (offset + length > file.size) {
    throw new Error(`the file ends at byte ${file.size}, before byte ${offset + length}`);
  }
  const bytes = length === 0 ? new Uint8Array(0) : await file.read(offset, length);
  if (bytes.length !== length) {
    throw new Error(`${bytes.length} bytes at byte ${offset}, where ${length} were asked for: has the file changed?`);
  }
  return bytes;
}

/** Sixteen tables, so that sixteen bytes are taken at a time. */
const CRC_TABLES = new Int32Array(16 * 256);
for (let i = 0; i < CRC_TABLES.length; i += 1) {
  let crc = i < 256 ? i : CRC_TABLES[i - 256];
  for (let bit = 0; bit < 8; bit += 1) {
    crc = (crc & 1) !== 0 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  }
  CRC_TABLES[i] = crc;
}

/** CRC-32 as of zlib and PNG. @param {Uint8Array} bytes */
export function crc32(bytes) {
  const t = CRC_TABLES;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  let crc = -1;
  let at = 0;
  for (const last = bytes.length - 16; at <= last; at += 16) {
    const a = crc ^ view.getInt32(at, true);
    const b = view.getInt32(at + 4, true);
    const c = view.getInt32(at + 8, true);
    const d = view.getInt32(at + 12, true);
    crc =
      t[3840 + (a & 255)] ^ t[3584 + ((a >>> 8) & 255)] ^ t[3328 + ((a >>> 16) & 255)] ^ t[3072 + (a >>> 24)] ^
      t[2816 + (b & 255)] ^ t[2560 + ((b >>> 8) & 255)] ^ t[2304 + ((b >>> 16) & 255)] ^ t[2048 + (b >>> 24)] ^
      t[1792 + (c & 255)] ^ t[1536 + ((c >>> 8) & 255)] ^ t[1280 + ((c >>> 16) & 255)] ^ t[1024 + (c >>> 24)] ^
      t[768 + (d & 255)] ^ t[512 + ((d >>> 8) & 255)] ^ t[256 + ((d >>> 16) & 255)] ^ t[d >>> 24];
  }
  for (; at < bytes.length; at += 1) {
    crc = (crc >>> 8) ^ t[(crc ^ bytes[at]) & 255];
  }
  return ~crc >>> 0;
}

/** The first 32 bits of the fraction. @param {number} x */
const fraction = (x) => ((x - Math.floor(x)) * 2 ** 32) | 0;
const PRIMES = Array.from({ length: 310 }, (_, i) => i + 2).filter((n) => {
  let divisor = 2;
  for (; n % divisor !== 0; divisor += 1);
  return divisor === n;
});
const SHA_ROOTS = Int32Array.from(PRIMES, (prime) => fraction(Math.cbrt(prime)));

/**
 * SHA-256 in hexadecimal digits: browsers have theirs only where a page comes from a server.
 * @param {Uint8Array} bytes
 */
export function sha256(bytes) {
  const padded = new Uint8Array(((bytes.length + 72) >> 6) << 6);
  padded.set(bytes);
  padded[bytes.length] = 128;
  const view = new DataView(padded.buffer);
  view.setUint32(padded.length - 8, Math.floor(bytes.length / 2 ** 29));
  view.setUint32(padded.length - 4, bytes.length << 3);
  const hash = Int32Array.from(PRIMES.slice(0, 8), (prime) => fraction(Math.sqrt(prime)));
  const w = new Int32Array(64);
  const turn = (/** @type {number} */ x, /** @type {number} */ n) => (x >>> n) | (x << (32 - n));
  for (let block = 0; block < padded.length; block += 64) {
    let [a, b, c, d, e, f, g, h] = hash;
    for (let i = 0; i < 64; i += 1) {
      if (i < 16) {
        w[i] = view.getInt32(block + 4 * i);
      } else {
        const [x, y] = [w[i - 15], w[i - 2]];
        const s0 = turn(x, 7) ^ turn(x, 18) ^ (x >>> 3);
        const s1 = turn(y, 17) ^ turn(y, 19) ^ (y >>> 10);
        w[i] = w[i - 16] + s0 + w[i - 7] + s1;
      }
      const t1 = h + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) + ((e & f) ^ (~e & g)) + SHA_ROOTS[i] + w[i];
      const t2 = (turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
      [h, g, f, e, d, c, b, a] = [g, f, e, (d + t1) | 0, c, b, a, (t1 + t2) | 0];
    }
    [a, b, c, d, e, f, g, h].forEach((value, i) => (hash[i] += value));
  }
  return Array.from(hash, (word) => (word >>> 0).toString(16).padStart(8, "0")).join("");
}

const utf8 = new TextDecoder("utf-8", { fatal: true });

/** Takes fields from a record, one after the other; throws an Error where the record ends too early. */
export class Fields {
  /** @param {Uint8Array} bytes @param {string} what they are, for messages */
  constructor(bytes, what) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    this.what = what;
    this.at = 0;
  }

  get left() {
    return this.bytes.length - this.at;
  }

  /** Passes `length` bytes, and returns the place of the first. @param {number} length */
  pass(length) {
    if (length > this.left) {
      throw new Error(`${this.what} ends within a field: ${this.left} bytes, where ${length} belong`);
    }
    this.at += length;
    return this.at - length;
  }

  u8() {
    return this.view.getUint8(this.pass(1));
  }

  u16() {
    return this.view.getUint16(this.pass(2), true);
  }

  u32() {
    return this.view.getUint32(this.pass(4), true);
  }

  /** To the nearest double: for times, which are hints only. */
  roughU64() {
    return this.u32() + this.u32() * 2 ** 32;
  }

  u64() {
    const value = this.roughU64();
    if (!Number.isSafeInteger(value)) {
      throw new Error(`${this.what} has a length or an offset beyond 2^53`);
    }
    return value;
  }

  /** @param {number} length */
  take(length) {
    const start = this.pass(length);
    return this.bytes.subarray(start, start + length);
  }

  text() {
    const bytes = this.take(this.u32());
    try {
      return utf8.decode(bytes);
    } catch {
      throw new Error(`${this.what} has a text that is no UTF-8`);
    }
  }

  /** Pairs of texts. */
  texts() {
    const pairs = new Fields(this.take(this.u32()), this.what);
    /** @type {Map<string, string>} */
    const entries = new Map();
    while (pairs.left > 0) {
      const key = pairs.text();
      if (entries.has(key)) {
        throw new Error(`${this.what} has "${key}" twice`);
      }
      entries.set(key, pairs.text());
    }
    return entries;
  }
}

/** A field of a protobuf message: `value` of a varint, to the nearest double; else the range of its bytes.
 * @typedef {(number: number, start: number, end: number, value: number) => void} OnField */

/** @param {Uint8Array} bytes @param {number} start @param {number} end @param {OnField} onfield */
function walk(bytes, start, end, onfield) {
  let at = start;
  const varint = () => {
    let value = 0;
    for (let place = 0; place < 10; place += 1) {
      if (at >= end) {
        break;
      }
      const byte = bytes[at];
      at += 1;
      value += (byte & 127) * 2 ** (7 * place);
      if (byte < 128) {
        return value;
      }
    }
    throw new Error("a message has an integer without an end");
  };
  while (at < end) {
    const key = varint();
    const [number, kind] = [Math.floor(key / 8), key % 8];
    const value = kind === 0 || kind === 2 ? varint() : 0;
    const length = kind === 0 ? 0 : kind === 1 ? 8 : kind === 2 ? value : kind === 5 ? 4 : NaN;
    if (!(length <= end - at)) {
      throw new Error("a message ends within a field");
    }
    onfield(number, kind === 0 ? -1 : at, at + length, value);
    at += length;
  }
}

/** @param {number} value */
function exact(value) {
  if (!Number.isSafeInteger(value)) {
    throw new Error("a message has an integer beyond 2^53");
  }
  return value;
}

/**
 * The arrays of doubles with these field numbers, packed or not; `others` gets the other fields.
 * @param {Uint8Array} bytes @param {number} start @param {number} end @param {number[]} numbers @param {OnField} others
 */
function arrays(bytes, start, end, numbers, others) {
  const lengths = new Map(numbers.map((number) => [number, 0]));
  walk(bytes, start, end, (number, from, to, value) => {
    const length = lengths.get(number);
    if (length === undefined) {
      others(number, from, to, value);
    } else if (from < 0 || (to - from) % 8 !== 0) {
      throw new Error("a message has an array that is none of doubles");
    } else {
      lengths.set(number, length + to - from);
    }
  });
  const all = numbers.map((number) => new Uint8Array(lengths.get(number) ?? 0));
  const written = numbers.map(() => 0);
  walk(bytes, start, end, (number, from, to) => {
    const which = numbers.indexOf(number);
    if (which >= 0) {
      all[which].set(bytes.subarray(from, to), written[which]);
      written[which] += to - from;
    }
  });
  return all.map((array) => new Float64Array(array.buffer));
}

/** @param {Uint8Array} bytes @param {number} from @param {number} to */
function double(bytes, from, to) {
  if (from < 0 || to - from !== 8) {
    throw new Error("a message has a number that is no double");
  }
  return new DataView(bytes.buffer, bytes.byteOffset).getFloat64(from, true);
}

/** The step of a `ChainState`. @param {Uint8Array} bytes @param {number} start @param {number} end */
export function stepOf(bytes, start, end) {
  let step = 0;
  walk(bytes, start, end, (number, from, _to, value) => {
    if (number === 2 && from < 0) {
      step = exact(value);
    }
  });
  return step;
}

/** A `ChainState`, without its frame. @param {Uint8Array} bytes @param {number} start @param {number} end */
export function stateOf(bytes, start, end) {
  let [step, time_s] = [0, 0];
  const [u, v, extra] = arrays(bytes, start, end, [4, 5, 6], (number, from, to, value) => {
    if (number === 2 && from < 0) {
      step = exact(value);
    } else if (number === 3) {
      time_s = double(bytes, from, to);
    }
  });
  return { step, time_s, u, v, extra };
}

/** A `Chain`. @param {Uint8Array} bytes @param {number} start @param {number} end @returns {Chain} */
export function chainOf(bytes, start, end) {
  /** @type {(Wall | undefined)[]} */
  const walls = [];
  /** @type {Term[]} */
  const terms = [];
  let dampingPower = 0;
  /** @type {OnField} */
  const others = (number, from, to) => {
    if (number === 17) {
      dampingPower = double(bytes, from, to);
    } else if (number === 10 && from >= 0) {
      terms.push(termOf(bytes, from, to));
    } else if ((number === 6 || number === 7 || number === 16) && from >= 0) {
      const wall = [0, 0, 0, 0];
      walk(bytes, from, to, (field, first, last) => {
        if (field >= 1 && field <= 4) {
          wall[field - 1] = double(bytes, first, last);
        }
      });
      const [wallStiffness, overlap, force, wallDamping] = wall;
      walls[number] = { stiffness: wallStiffness, restOverlap: overlap, restForce: force, damping: wallDamping };
    }
  };
  const all = arrays(bytes, start, end, [1, 2, 3, 5, 8, 11, 12, 13, 14, 15], others);
  const [mass, stiffness, restOverlap, restForce, damping, onSite, onSiteCubic, drag, ...resonators] = all;
  const [resonatorMass, resonatorStiffness] = resonators;
  const [leftWall, rightWall, ring] = [walls[6], walls[7], walls[16]];
  return {
    ...{ mass, stiffness, restOverlap, restForce, damping, leftWall, rightWall, ring, terms, dampingPower },
    ...{ onSite, onSiteCubic, drag, resonatorMass, resonatorStiffness },
  };
}

/** A `Term` of a `Chain`. @param {Uint8Array} bytes @param {number} start @param {number} end @returns {Term} */
function termOf(bytes, start, end) {
  let kind = "";
  const numbers = [0, 0, 0, 0, 0, 0, 0];
  const [stiffness] = arrays(bytes, start, end, [3], (number, from, to) => {
    if (number === 1 && from >= 0) {
      kind = new TextDecoder().decode(bytes.subarray(from, to));
    } else if ([2, 4, 5, 6].includes(number)) {
      numbers[number] = double(bytes, from, to);
    }
  });
  const [, , parameter, , leftWall, rightWall, ring] = numbers;
  return { kind, parameter, stiffness, leftWall, rightWall, ring };
}

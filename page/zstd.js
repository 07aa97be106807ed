// Zstandard decompression, written from RFC 8878. Not done: dictionaries, which are refused, and the checksum of a
// frame's content, because whoever calls this has a CRC of the same bytes.
//
//     import { decompress } from "./zstd.js";
//     const records = decompress(chunk, 1048576);    // exactly so many bytes, or an Error

const MAX_BLOCK = 1 << 17; // bytes of a block, before compression and after
const PADDING = 16; // bytes before and after the input, so that bits are read four bytes at a time
const HUFFMAN_BITS = 11;

/**
 * Extra bits and smallest value of each code: `plain` codes without extra bits, then those listed.
 * @param {number} first the value of code 0
 * @param {number} plain
 * @param {number[]} more
 */
function codes(first, plain, more) {
  const extra = Uint8Array.from([...new Array(plain).fill(0), ...more]);
  const base = new Int32Array(extra.length);
  base[0] = first;
  for (let code = 1; code < base.length; code += 1) {
    base[code] = base[code - 1] + (1 << extra[code - 1]);
  }
  return { base, extra };
}
const LITERAL_LENGTHS = codes(0, 16, [1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);
const MATCH_LENGTHS = codes(3, 32, [1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);

/**
 * Kind of a table of states: the most bits of a state, the last symbol, and the table for the case that none is sent.
 * @typedef {{ name: string, maxLog: number, lastSymbol: number, predefined: StateTable | undefined }} Kind
 */

/**
 * A table of states (FSE): log2 of their number, and of each its symbol, the bits to be read for the next state (from
 * bit 8 on) and what these are added to (from bit 16 on).
 * @typedef {{ log: number, states: Int32Array }} StateTable
 */

/**
 * @param {number} log
 * @param {ArrayLike<number>} counts of each symbol, −1 for "less than 1"
 * @returns {StateTable}
 */
function stateTable(log, counts) {
  const size = 1 << log;
  const states = new Int32Array(size);
  const next = new Int32Array(counts.length);
  let high = size;
  for (let symbol = 0; symbol < counts.length; symbol += 1) {
    next[symbol] = Math.abs(counts[symbol]);
    if (counts[symbol] < 0) {
      high -= 1;
      states[high] = symbol;
    }
  }
  const stride = (size >> 1) + (size >> 3) + 3;
  let place = 0;
  for (let symbol = 0; symbol < counts.length; symbol += 1) {
    for (let i = 0; i < counts[symbol]; i += 1) {
      states[place] = symbol;
      do {
        place = (place + stride) & (size - 1);
      } while (place >= high);
    }
  }
  for (let state = 0; state < size; state += 1) {
    const symbol = states[state];
    const x = next[symbol];
    next[symbol] += 1;
    const bits = log - highestBit(x);
    states[state] = symbol | (bits << 8) | (((x << bits) - size) << 16);
  }
  return { log, states };
}

/** @param {number} x */
function highestBit(x) {
  return 31 - Math.clz32(x);
}

/** @param {number} count @param {number} value */
const times = (count, value) => new Array(count).fill(value);
/** @type {Kind} */
const LITERAL_LENGTH_KIND = {
  ...{ name: "literal lengths", maxLog: 9, lastSymbol: 35 },
  predefined: stateTable(6, [4, 3, ...times(11, 2), 1, 1, 1, ...times(9, 2), 3, 2, ...times(5, 1), ...times(4, -1)]),
};
/** @type {Kind} */
const OFFSET_KIND = {
  ...{ name: "offsets", maxLog: 8, lastSymbol: 31 },
  predefined: stateTable(5, [...times(6, 1), 2, 2, 2, ...times(15, 1), ...times(5, -1)]),
};
/** @type {Kind} */
const MATCH_LENGTH_KIND = {
  ...{ name: "match lengths", maxLog: 9, lastSymbol: 52 },
  predefined: stateTable(6, [1, 4, 3, ...times(6, 2), ...times(37, 1), ...times(7, -1)]),
};
/** @type {Kind} */
const WEIGHT_KIND = { name: "weights", maxLog: 6, lastSymbol: 255, predefined: undefined };

/**
 * `n` bits, up to 25, of a stream that begins at `from`.
 * @param {DataView} view @param {number} from @param {number} at @param {number} n
 */
function bitsAt(view, from, at, n) {
  return (view.getInt32(from + (at >> 3), true) >>> (at & 7)) & ((1 << n) - 1);
}

/** @param {string} what @returns {never} */
function corrupt(what) {
  throw new Error(`compressed data are damaged: ${what}`);
}

/** @param {number} size of what a block holds */
function limit(size) {
  if (size > MAX_BLOCK) {
    corrupt(`a block of ${size} bytes`);
  }
}

class Decoder {
  /** @param {Uint8Array} bytes @param {number} size */
  constructor(bytes, size) {
    this.input = new Uint8Array(bytes.length + 2 * PADDING);
    this.input.set(bytes, PADDING);
    this.view = new DataView(this.input.buffer);
    this.at = PADDING;
    this.end = PADDING + bytes.length;
    this.output = new Uint8Array(size);
    this.written = 0;
    /** Begin of the present frame in the output: no offset leads farther back. */
    this.frameStart = 0;
    /** @type {[number, number, number]} */
    this.recent = [1, 4, 8];
    /** @type {(StateTable | undefined)[]} */
    this.tables = [];
    /** Symbol (from bit 4 on) and length of each code. */
    this.huffman = new Uint16Array(1 << HUFFMAN_BITS);
    this.huffmanBits = 0; // 0: there is no tree
    this.ownLiterals = new Uint8Array(MAX_BLOCK);
    // the literals of the present block: where, from, up to
    this.literals = this.ownLiterals;
    this.literalAt = 0;
    this.literalEnd = 0;
  }

  /** The next `count` bytes as an integer. @param {number} count up to 4 */
  integer(count) {
    if (this.at + count > this.end) {
      corrupt("they end too early");
    }
    const whole = this.view.getUint32(this.at, true);
    this.at += count;
    return count === 4 ? whole : whole & ((1 << (8 * count)) - 1);
  }

  /** Passes `length` bytes, and returns the place of the first. @param {number} length @param {number} end */
  pass(length, end) {
    const start = this.at;
    if (length > end - start) {
      corrupt("they end too early");
    }
    this.at += length;
    return start;
  }

  frames() {
    while (this.at < this.end) {
      const magic = this.integer(4);
      if (magic >>> 4 === 0x184d2a5) {
        this.pass(this.integer(4), this.end);
      } else if (magic === 0xfd2fb528) {
        this.frame();
      } else {
        corrupt(`no Zstandard frame, but ${magic.toString(16).padStart(8, "0")}`);
      }
    }
    if (this.written !== this.output.length) {
      corrupt(`${this.written} bytes, where ${this.output.length} were expected`);
    }
  }

  frame() {
    const flags = this.integer(1);
    if ((flags & 8) !== 0) {
      corrupt("a frame of an unknown kind");
    }
    const isOneSegment = (flags & 32) !== 0;
    this.integer(isOneSegment ? 0 : 1); // the window does not matter: all of the output is there
    if (this.integer([0, 1, 2, 4][flags & 3]) !== 0) {
      throw new Error("compressed data need a dictionary, which is not supported");
    }
    const digits = [isOneSegment ? 1 : 0, 2, 4, 8][flags >> 6];
    const low = this.integer(Math.min(digits, 4)) + (digits === 2 ? 256 : 0);
    const size = digits === 0 ? -1 : low + this.integer(Math.max(digits - 4, 0)) * 2 ** 32;
    this.frameStart = this.written;
    if (size > this.output.length - this.written) {
      corrupt(`a frame of ${size} bytes, where at most ${this.output.length - this.written} were expected`);
    }
    this.recent = [1, 4, 8];
    this.tables = [];
    this.huffmanBits = 0;
    for (let isLast = false; !isLast; ) {
      const header = this.integer(3);
      isLast = (header & 1) !== 0;
      this.block((header >> 1) & 3, header >> 3);
    }
    if (size >= 0 && this.written - this.frameStart !== size) {
      corrupt(`a frame of ${this.written - this.frameStart} bytes that says ${size}`);
    }
    this.integer((flags & 4) !== 0 ? 4 : 0); // the checksum
  }

  /** @param {number} kind @param {number} size in bytes */
  block(kind, size) {
    limit(size);
    if (kind < 2 && size > this.output.length - this.written) {
      corrupt("more bytes than were expected");
    }
    if (kind === 0) {
      const start = this.pass(size, this.end);
      this.output.set(this.input.subarray(start, this.at), this.written);
      this.written += size;
    } else if (kind === 1) {
      this.output.fill(this.integer(1), this.written, this.written + size);
      this.written += size;
    } else if (kind === 2) {
      const end = this.pass(size, this.end) + size;
      this.at = end - size;
      this.readLiterals(end);
      this.readSequences(end);
    } else {
      corrupt("a block of an unknown kind");
    }
  }

  /** The literals section of a block that ends at `end`. @param {number} end */
  readLiterals(end) {
    const start = this.pass(1, end);
    const first = this.input[start];
    const [kind, form] = [first & 3, (first >> 2) & 3];
    if (kind < 2) {
      const header = [1, 2, 1, 3][form];
      this.at = start;
      this.pass(header, end);
      const size = (this.view.getUint32(start, true) & (2 ** (8 * header) - 1)) >>> (header === 1 ? 3 : 4);
      limit(size);
      if (kind === 0) {
        this.literals = this.input;
        this.literalAt = this.pass(size, end);
      } else {
        this.literals = this.ownLiterals;
        this.literalAt = 0;
        this.literals.fill(this.input[this.pass(1, end)], 0, size);
      }
      this.literalEnd = this.literalAt + size;
      return;
    }
    const bits = [10, 10, 14, 18][form];
    this.at = start;
    this.pass([3, 3, 4, 5][form], end);
    const size = (this.view.getUint32(start, true) >>> 4) & ((1 << bits) - 1);
    const lower = this.view.getUint32(start + 1, true); // from bit 8 on
    const compressed = (lower >>> (bits - 4)) & ((1 << bits) - 1);
    limit(size);
    const streamsEnd = this.pass(compressed, end) + compressed;
    this.at = streamsEnd - compressed;
    if (kind === 2) {
      this.readTree(streamsEnd);
    } else if (this.huffmanBits === 0) {
      corrupt("literals without a tree");
    }
    this.literals = this.ownLiterals;
    this.literalAt = 0;
    this.literalEnd = size;
    if (form === 0) {
      this.readStream(this.at, streamsEnd, 0, size);
    } else {
      const jump = this.pass(6, streamsEnd);
      const part = (size + 3) >> 2;
      if (3 * part > size) {
        corrupt("four streams of too few literals");
      }
      for (let i = 0; i < 4; i += 1) {
        const length = i < 3 ? this.view.getUint16(jump + 2 * i, true) : streamsEnd - this.at;
        const from = this.pass(length, streamsEnd);
        this.readStream(from, this.at, i * part, i < 3 ? (i + 1) * part : size);
      }
    }
    this.at = streamsEnd;
  }

  /**
   * The number of bits of a stream that is read from its end: what is before the last 1.
   * @param {number} from @param {number} to
   */
  bitsOf(from, to) {
    if (to <= from || this.input[to - 1] === 0) {
      corrupt("a stream of bits without an end");
    }
    return 8 * (to - 1 - from) + highestBit(this.input[to - 1]);
  }

  /**
   * One stream of Huffman codes: literals `first` up to `last`.
   * @param {number} from @param {number} to @param {number} first @param {number} last
   */
  readStream(from, to, first, last) {
    const { view, huffman, huffmanBits, ownLiterals: literals } = this;
    const mask = (1 << huffmanBits) - 1;
    let bits = this.bitsOf(from, to);
    let i = first;
    // two codes of at most 11 bits from 25 or more; what is before the stream is read where bits are lacking
    for (const pairs = last - 1; i < pairs && bits >= 0; i += 2) {
      const low = bits - 25;
      const word = view.getInt32(from + (low >> 3), true) >>> (low & 7);
      const code = huffman[(word >>> (25 - huffmanBits)) & mask];
      const used = code & 15;
      const other = huffman[(word >>> (25 - huffmanBits - used)) & mask];
      literals[i] = code >> 4;
      literals[i + 1] = other >> 4;
      bits -= used + (other & 15);
    }
    if (i < last && bits >= 0) {
      const low = bits - 25;
      const code = huffman[(view.getInt32(from + (low >> 3), true) >>> ((low & 7) + 25 - huffmanBits)) & mask];
      literals[i] = code >> 4;
      bits -= code & 15;
    }
    if (bits !== 0) {
      corrupt("a stream of literals does not end where it should");
    }
  }

  /** A Huffman tree, of which the weights stand there. @param {number} end */
  readTree(end) {
    const weights = new Uint8Array(256);
    const header = this.input[this.pass(1, end)];
    let count = 0;
    if (header >= 128) {
      count = header - 127;
      const start = this.pass((count + 1) >> 1, end);
      for (let i = 0; i < count; i += 1) {
        weights[i] = (this.input[start + (i >> 1)] >> (i % 2 === 0 ? 4 : 0)) & 15;
      }
    } else {
      const stop = this.pass(header, end) + header;
      this.at = stop - header;
      count = this.readWeights(stop, weights);
    }
    let sum = 0;
    for (let i = 0; i < count; i += 1) {
      if (weights[i] > HUFFMAN_BITS) {
        corrupt("a code of too many bits");
      }
      sum += (1 << weights[i]) >> 1;
    }
    // the last weight is what fills up the next power of two
    const bits = sum === 0 ? 0 : highestBit(sum) + 1;
    const left = (1 << bits) - sum;
    if (bits === 0 || bits > HUFFMAN_BITS || (left & (left - 1)) !== 0) {
      corrupt("a tree that is none");
    }
    weights[count] = highestBit(left) + 1;
    let place = 0;
    for (let weight = 1; weight <= bits; weight += 1) {
      for (let symbol = 0; symbol <= count; symbol += 1) {
        if (weights[symbol] === weight) {
          const next = place + (1 << (weight - 1));
          this.huffman.fill((symbol << 4) | (bits + 1 - weight), place, next);
          place = next;
        }
      }
    }
    this.huffmanBits = bits;
  }

  /** Weights in two turns of states; how many. @param {number} end @param {Uint8Array} weights */
  readWeights(end, weights) {
    const { log, states } = this.readTable(WEIGHT_KIND, end);
    const from = this.at;
    let bits = this.bitsOf(from, end);
    const read = (/** @type {number} */ n) => {
      bits -= n;
      return bitsAt(this.view, from, bits, n);
    };
    let state = read(log);
    let other = read(log);
    if (bits < 0) {
      corrupt("weights end too early");
    }
    this.at = end;
    for (let count = 0; count < 254; count += 1) {
      const entry = states[state];
      weights[count] = entry & 255;
      const next = (entry >>> 16) + read((entry >> 8) & 255);
      if (bits < 0) {
        weights[count + 1] = states[other] & 255;
        return count + 2;
      }
      state = other;
      other = next;
    }
    return corrupt("too many weights");
  }

  /**
   * A table of states, of which the counts stand there.
   * @param {Kind} kind @param {number} end @returns {StateTable}
   */
  readTable(kind, end) {
    const { view, at: start } = this;
    let bit = 0;
    const peek = () => {
      if (start + (bit >> 3) >= end) {
        corrupt(`the table of ${kind.name} ends too early`);
      }
      return view.getUint32(start + (bit >> 3), true) >>> (bit & 7);
    };
    const log = (peek() & 15) + 5;
    bit += 4;
    if (log > kind.maxLog) {
      corrupt(`a table of ${kind.name} that is too large`);
    }
    const counts = [];
    for (let left = 1 << log; left > 0; ) {
      const bits = highestBit(left + 1) + 1;
      const short = (1 << bits) - 2 - left; // values below this have a bit less
      const value = peek() & ((1 << bits) - 1);
      const low = value & ((1 << (bits - 1)) - 1);
      let count = value;
      if (low < short) {
        count = low;
        bit += bits - 1;
      } else {
        count = value === low ? value : value - short;
        bit += bits;
      }
      count -= 1;
      left -= Math.abs(count);
      counts.push(count);
      for (let zeros = count === 0 ? 3 : 0; zeros === 3; ) {
        zeros = peek() & 3;
        bit += 2;
        counts.push(...new Array(zeros).fill(0));
      }
      if (left < 0 || counts.length > kind.lastSymbol + 1) {
        corrupt(`a table of ${kind.name} that is none`);
      }
    }
    this.pass((bit + 7) >> 3, end);
    return stateTable(log, counts);
  }

  /**
   * The table that the sequences of this block use.
   * @param {number} mode @param {Kind} kind @param {number} index @param {number} end
   */
  tableOf(mode, kind, index, end) {
    let table = this.tables[index];
    if (mode === 0) {
      table = kind.predefined;
    } else if (mode === 1) {
      const symbol = this.input[this.pass(1, end)];
      if (symbol > kind.lastSymbol) {
        corrupt(`an unknown code of ${kind.name}`);
      }
      table = { log: 0, states: Int32Array.of(symbol) };
    } else if (mode === 2) {
      table = this.readTable(kind, end);
    }
    this.tables[index] = table;
    return table ?? corrupt(`no table of ${kind.name} to repeat`);
  }

  /** The sequences section of a block that ends at `end`, and what they make. @param {number} end */
  readSequences(end) {
    let count = this.input[this.pass(1, end)];
    if (count === 255) {
      count = this.view.getUint16(this.pass(2, end), true) + 0x7f00;
    } else if (count >= 128) {
      count = ((count - 128) << 8) + this.input[this.pass(1, end)];
    }
    if (count > 0) {
      const modes = this.input[this.pass(1, end)];
      if ((modes & 3) !== 0) {
        corrupt("sequences of an unknown kind");
      }
      const literalLengths = this.tableOf(modes >> 6, LITERAL_LENGTH_KIND, 0, end);
      const offsets = this.tableOf((modes >> 4) & 3, OFFSET_KIND, 1, end);
      const matchLengths = this.tableOf((modes >> 2) & 3, MATCH_LENGTH_KIND, 2, end);
      this.run(count, end, literalLengths, offsets, matchLengths);
    } else if (this.at !== end) {
      corrupt("a block goes on after its end");
    }
    this.at = end;
    const rest = this.literalEnd - this.literalAt;
    if (rest > this.output.length - this.written) {
      corrupt("more bytes than were expected");
    }
    this.output.set(this.literals.subarray(this.literalAt, this.literalEnd), this.written);
    this.written += rest;
  }

  /**
   * Runs `count` sequences, from the bits between here and `end`.
   * @param {number} count @param {number} end
   * @param {StateTable} literalLengths @param {StateTable} offsets @param {StateTable} matchLengths
   */
  run(count, end, literalLengths, offsets, matchLengths) {
    const { view, at: from, output, literals, literalEnd, frameStart } = this;
    const { states: llStates } = literalLengths;
    const { states: ofStates } = offsets;
    const { states: mlStates } = matchLengths;
    const { base: llBase, extra: llExtra } = LITERAL_LENGTHS;
    const { base: mlBase, extra: mlExtra } = MATCH_LENGTHS;
    let { written, literalAt } = this;
    let [recent, second, third] = this.recent;
    let bits = this.bitsOf(from, end);
    bits -= literalLengths.log;
    let ll = bitsAt(view, from, bits, literalLengths.log);
    bits -= offsets.log;
    let of = bitsAt(view, from, bits, offsets.log);
    bits -= matchLengths.log;
    let ml = bitsAt(view, from, bits, matchLengths.log);
    for (let left = count; left > 0; left -= 1) {
      const [llEntry, ofEntry, mlEntry] = [llStates[ll], ofStates[of], mlStates[ml]];
      const [llCode, ofCode, mlCode] = [llEntry & 255, ofEntry & 255, mlEntry & 255];
      if (ofCode > 30) {
        corrupt("an offset that is too large");
      }
      let value = 1;
      let more = ofCode;
      if (more > 24) {
        bits -= 16;
        value = (value << 16) | bitsAt(view, from, bits, 16);
        more -= 16;
      }
      bits -= more;
      value = (value << more) | bitsAt(view, from, bits, more);
      let matchLength = mlBase[mlCode];
      let literalLength = llBase[llCode];
      if (mlCode > 31) {
        bits -= mlExtra[mlCode];
        matchLength += bitsAt(view, from, bits, mlExtra[mlCode]);
      }
      if (llCode > 15) {
        bits -= llExtra[llCode];
        literalLength += bitsAt(view, from, bits, llExtra[llCode]);
      }
      if (left > 1) {
        let n = (llEntry >> 8) & 255;
        bits -= n;
        ll = (llEntry >>> 16) + bitsAt(view, from, bits, n);
        n = (mlEntry >> 8) & 255;
        bits -= n;
        ml = (mlEntry >>> 16) + bitsAt(view, from, bits, n);
        n = (ofEntry >> 8) & 255;
        bits -= n;
        of = (ofEntry >>> 16) + bitsAt(view, from, bits, n);
      }
      if (bits < 0) {
        corrupt("sequences end too early");
      }

      let offset = value - 3;
      if (value > 3) {
        third = second;
        second = recent;
        recent = offset;
      } else {
        const which = value + (literalLength === 0 ? 1 : 0);
        offset = which === 1 ? recent : which === 2 ? second : which === 3 ? third : recent - 1;
        if (which > 1) {
          third = which === 2 ? third : second;
          second = recent;
          recent = offset;
        }
      }
      const literalsEnd = literalAt + literalLength;
      const matchStart = written + literalLength;
      const matchEnd = matchStart + matchLength;
      if (literalsEnd > literalEnd || matchEnd > output.length) {
        corrupt("more bytes than were expected");
      }
      if (offset <= 0 || offset > matchStart - frameStart) {
        corrupt("an offset to before the beginning");
      }
      if (literalLength > 64) {
        output.set(literals.subarray(literalAt, literalsEnd), written);
        literalAt = literalsEnd;
      } else {
        while (literalAt < literalsEnd) {
          output[written] = literals[literalAt];
          written += 1;
          literalAt += 1;
        }
      }
      written = matchStart;
      if (matchLength > 64) {
        // what is copied may overlap what is written: twice as much each time
        for (let copied = 0, step = offset; copied < matchLength; copied += step, step += step) {
          const length = Math.min(step, matchLength - copied);
          output.copyWithin(matchStart + copied, matchStart - offset, matchStart - offset + length);
        }
        written = matchEnd;
      } else {
        while (written < matchEnd) {
          output[written] = output[written - offset];
          written += 1;
        }
      }
    }
    if (bits !== 0) {
      corrupt("sequences do not end where they should");
    }
    this.written = written;
    this.literalAt = literalAt;
    this.recent = [recent, second, third];
  }
}

/**
 * Contents of Zstandard frames, one after the other: exactly `size` bytes.
 * @param {Uint8Array} bytes
 * @param {number} size
 * @returns {Uint8Array}
 */
export function decompress(bytes, size) {
  // four bytes are a block of the same byte, of 128 KiB at most: a claim of more must not take memory
  if (size > bytes.length * (MAX_BLOCK / 4)) {
    corrupt(`${bytes.length} bytes cannot hold ${size}`);
  }
  const decoder = new Decoder(bytes, size);
  decoder.frames();
  return decoder.output;
}

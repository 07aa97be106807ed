// A recording: its manifest, its chain and its states, read by ranges as they are needed. docs/FORMAT.md, "In a file",
// says what is where. Whatever the bytes are, reading ends with a value or an Error whose message is for the user.

import { Fields, chainOf, crc32, readExactly, sha256, stateOf, stepOf } from "./mcap.js";
import { shown } from "./elements.js";
import { METHODS, RUNGE, extraNamesOf } from "./kernel.js";
import { beyondPlain, unknownKey, unknownPhysics } from "./keys.js";
import { checkPhysics, checkProvenance } from "./manifest.js";
import { decompress } from "./zstd.js";

/** @import { Bytes, Chain, End, Manifest, Physics, Provenance, State } from "./types.js" */

const MAGIC = "137,77,67,65,80,48,13,10";
const [HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK] = [1, 2, 3, 4, 5, 6];
const [CHUNK_INDEX, STATISTICS, METADATA, METADATA_INDEX, DATA_END] = [8, 11, 12, 13, 15];
const RECORD_HEADER = 9; // bytes: opcode and length
const MIB = 1 << 20;
const MAX_RECORD = 1024 * MIB;
const MAX_OTHER = 64 * MIB; // bytes of a record that is no chunk, and of a chunk before compression
const MAX_SUMMARY = 256 * MIB;
const CACHE_BYTES = 256 * MIB;
const WINDOW = 1 << 16;
const MINOR = 1; // of the schema version, the latest that is known here
/** Arrays of a number for each bead in a state, at most. */
const MOST_ARRAYS = 7;
/** Notes that are told, of what may be a fault of every chunk. */
const MOST_NOTES = 100;
/** Ends after which nothing more was to come. */
const ORDERLY = ["complete", "interrupted", "continued", "detached"];
const SALVAGE = "`beadline recover` saves what can be saved";

const PROVENANCE_KEYS = {
  ...{ name: 0, run_id: 0, program: 0, host: 0, started_unix_ns: 0 },
  ...{ publish_every_steps: 0, record_every_steps: 0 },
  ...{ author: 0, orcid: 0, licence: 0, doi: 0 },
};

/** @param {string} what @returns {never} */
function damaged(what) {
  throw new Error(`the recording is damaged: ${what}; ${SALVAGE}`);
}

/** @param {string} text @param {string} what @returns {any} */
function parsed(text, what) {
  let value;
  try {
    value = JSON.parse(text);
  } catch {
    // said below
  }
  const isObject = typeof value === "object" && value !== null && !Array.isArray(value);
  return isObject ? value : damaged(`${what} is no JSON object`);
}

/** True if an integer is in these bounds. @param {unknown} value @param {number} least @param {number} most */
const isCount = (value, least, most) =>
  typeof value === "number" && Number.isSafeInteger(value) && value >= least && value <= most;

/**
 * Text that the checksum of a metadata record covers, if the checksum is right.
 * @param {Map<string, string>} entries @param {string} name @param {string[]} keys
 */
function checkSum(entries, name, keys) {
  const values = keys.map((key) => entries.get(key) ?? damaged(`the metadata record ${name} has no ${key}`));
  const text = [name, ...values].map((line) => `${line}\n`).join("");
  if (sha256(new TextEncoder().encode(text)) !== entries.get("checksum")) {
    damaged(`the checksum of the metadata record ${name} is wrong`);
  }
  return values;
}

/** @param {Map<string, string>} entries of `beadline.run` @param {string[]} notes @returns {Manifest} */
export function manifestOf(entries, notes) {
  const version = entries.get("schema_version") ?? "";
  if (!/^1\.\d{1,9}$/.test(version)) {
    const found = version === "" ? "no schema version" : `schema version ${version}`;
    throw new Error(`the recording has ${found}, and this page reads version 1: use a page of that version`);
  }
  const keys = ["schema_version", "physics", "provenance"];
  const [, physicsText, provenanceText] = checkSum(entries, "beadline.run", keys);
  /** @type {Physics} */
  const physics = parsed(physicsText, "physics in the manifest");
  /** @type {Provenance} */
  const provenance = parsed(provenanceText, "provenance in the manifest");
  const unknown = unknownPhysics(physics);
  if (unknown !== "") {
    const why = "which this page does not know and which may decide bits: use a newer page";
    throw new Error(`physics in the manifest has the key "${unknown}", ${why}`);
  }
  const further = unknownKey(provenance, PROVENANCE_KEYS);
  const isNewer = Number(version.slice(2)) > MINOR;
  if (further !== "" && !isNewer) {
    damaged(`provenance in the manifest has an unknown key, "${further}"`);
  }
  if (isNewer) {
    notes.push(`The recording has schema version ${version}; what is newer than version 1.${MINOR} in it is not shown.`);
  }
  checkPhysics(physics);
  const later = version === "1.0" ? beyondPlain(physics) || (physics.method === RUNGE ? "method" : "") : "";
  if (later !== "") {
    damaged(`the manifest has schema version 1.0 and "${later}", which came with 1.1`);
  }
  checkProvenance(provenance, isNewer);
  return { schema_version: version, physics, provenance };
}

/** @param {Chain} chain @param {number} beads */
function checkChain(chain, beads) {
  const { mass, stiffness, restOverlap, restForce, damping } = chain;
  const contacts = [stiffness, restOverlap, restForce];
  if (mass.length !== beads || contacts.some((array) => array.length !== beads - 1)) {
    damaged(`/chain is not one of ${beads} beads`);
  }
  if (damping.length !== 0 && damping.length !== beads - 1) {
    damaged(`/chain has ${damping.length} coefficients of damping, not ${beads - 1}`);
  }
  const terms = chain.terms ?? [];
  const further = [chain.onSite, chain.onSiteCubic, chain.drag, chain.resonatorMass, chain.resonatorStiffness].flatMap(
    (array) => (array === undefined || array.length === 0 ? [] : [array]),
  );
  if (terms.some((term) => term.stiffness.length !== beads - 1) || further.some((array) => array.length !== beads)) {
    damaged(`/chain has arrays of terms, springs, drag or resonators that are not those of ${beads} beads`);
  }
  const walls = [chain.leftWall, chain.rightWall, chain.ring].flatMap((wall) => Object.values(wall ?? {}));
  const ofTerms = terms.flatMap(({ parameter, leftWall = 0, rightWall = 0, ring = 0 }) => [
    ...[parameter, leftWall, rightWall, ring],
  ]);
  const all = [mass, ...contacts, damping, walls, ...terms.map(({ stiffness: k }) => k), ofTerms, ...further];
  const isFinite = all.every((array) => array.every((x) => Number.isFinite(x)));
  if (!isFinite || !mass.every((m) => m > 0)) {
    damaged("/chain has impossible values");
  }
}

/**
 * Place of a chunk: offset and length of its record. `time` (ns) is not after that of its first state; its steps are
 * known once it was read: the first one, undefined if it has no states.
 * @typedef {{ offset: number, length: number, time: number, isRead: boolean, first: number | undefined }} Place
 */

/** A chunk's records, and in them its states: three numbers each, step and where its message begins and ends.
 * @typedef {{ records: Uint8Array, states: number[], chain: Chain | undefined }} Chunk */

/** A recording that is open. */
export class Recording {
  /** @param {Bytes} bytes @param {Manifest} manifest @param {string[]} notes */
  constructor(bytes, manifest, notes) {
    this.bytes = bytes;
    this.manifest = manifest;
    /** Damages of the file, as sentences; more may come as chunks are read. */
    this.notes = notes;
    /** @type {End | undefined} */
    this.end = undefined;
    /** True if the file was closed properly. */
    this.isFinished = false;
    /** @type {Chain | undefined} */
    this.foundChain = undefined;
    /** Steps of the first and last state, and how many there are. */
    this.firstStep = 0;
    this.lastStep = 0;
    this.stateCount = 0;
    /** @type {Place[]} */
    this.places = [];
    /** Topics by the numbers of their channels. @type {Map<number, string>} */
    this.topics = new Map();
    /** Chunks in memory, the least recently used one first. @type {Map<Place, Chunk>} */
    this.cache = new Map();
    this.cachedBytes = 0;
    /** Bytes that may be decompressed to open it: little more than a real recording needs. */
    this.budget = 4096 * MIB + 64 * bytes.size;
  }

  /** Why it is not whole; "" if it is. */
  get lacks() {
    const { reason } = this.end ?? { reason: "" };
    return !this.isFinished ? "it was not closed" : ORDERLY.includes(reason) ? "" : `its end is "${shown(reason)}"`;
  }

  /** @param {string} what */
  note(what) {
    if (this.notes.length < MOST_NOTES) {
      this.notes.push(this.notes.length < MOST_NOTES - 1 ? what : "More is wrong than is told here: `beadline verify` tells all.");
    }
  }

  /** @returns {Chain} */
  get chain() {
    return this.foundChain ?? damaged("it has no /chain");
  }

  /**
   * Opens a recording; rejects with an Error whose message is for the user.
   * @param {Bytes} bytes @returns {Promise<Recording>}
   */
  static async open(bytes) {
    if (bytes.size < 8 || String(await readExactly(bytes, 0, 8)) !== MAGIC) {
      throw new Error("this is no recording: it does not begin as an MCAP file does");
    }
    const header = await recordAt(bytes, 8);
    const profile = header?.opcode === HEADER ? new Fields(header.contents, "the header").text() : "";
    if (header === undefined || profile !== "beadline") {
      throw new Error(`this is no recording of Beadline: the profile of its header is "${profile}", not "beadline"`);
    }
    const run = await recordAt(bytes, header.next);
    const fields = run?.opcode === METADATA ? new Fields(run.contents, "the manifest") : undefined;
    if (run === undefined || fields === undefined || fields.text() !== "beadline.run") {
      throw new Error("this is no recording of Beadline: its second record is not the manifest");
    }
    /** @type {string[]} */
    const notes = [];
    const recording = new Recording(bytes, manifestOf(fields.texts(), notes), notes);
    const why = await recording.readSummary();
    if (why !== "") {
      await recording.readAll(run.next, why);
    }
    await recording.findEnds();
    recording.budget = Infinity;
    return recording;
  }

  /** Reads the summary section: places, topics, the end. Returns why it cannot be used, or "". */
  async readSummary() {
    const { bytes } = this;
    const footerStart = bytes.size - 37;
    const tail = footerStart < 8 ? new Uint8Array(37) : await readExactly(bytes, footerStart, 37);
    if (String(tail.subarray(29)) !== MAGIC || tail[0] !== FOOTER) {
      return "it was not closed, or was cut short";
    }
    const footer = new Fields(tail.subarray(RECORD_HEADER, 29), "the footer");
    const start = footer.u64();
    const crc = (footer.u64(), footer.u32());
    if (start === 0) {
      return "it has no summary section";
    }
    // the record Data End stands before it
    if (start < 21 || start > footerStart || footerStart - start > MAX_SUMMARY) {
      return "its summary section is not where its footer says";
    }
    const section = await readExactly(bytes, start - 13, footerStart - start + 13 + 25);
    if (section[0] !== DATA_END || (crc !== 0 && crc32(section.subarray(13)) !== crc)) {
      return "the checksum of its summary section is wrong";
    }
    /** @type {Map<string, [number, number]>} */
    const metadata = new Map();
    let [chunkCount, at] = [-1, start - 13];
    /** @type {Map<number, number>} */
    const counts = new Map();
    try {
      for (const { opcode, fields } of recordsOf(section, 13, section.length - 25, "the summary section")) {
        if (opcode === CHANNEL) {
          this.addChannel(fields);
        } else if (opcode === METADATA_INDEX) {
          const place = /** @type {[number, number]} */ ([fields.u64(), fields.u64()]);
          metadata.set(fields.text(), place);
        } else if (opcode === STATISTICS) {
          fields.pass(8 + 2 + 4 + 4 + 4);
          chunkCount = fields.u32();
          fields.pass(16);
          for (const pairs = new Fields(fields.take(fields.u32()), "the statistics"); pairs.left > 0; ) {
            counts.set(pairs.u16(), pairs.u64());
          }
        } else if (opcode === CHUNK_INDEX) {
          const first = fields.roughU64();
          const place = (fields.pass(8), this.placeAt(fields.u64(), fields.u64(), first));
          if (place.offset < (this.places.at(-1)?.offset ?? 0) + (this.places.at(-1)?.length ?? 0)) {
            return "the chunks of its summary section are not in order";
          }
          at = place.offset + place.length;
          this.places.push(place);
        }
      }
    } catch (error) {
      return String(/** @type {Error} */ (error).message);
    }
    if (chunkCount !== this.places.length || at > start) {
      return "its summary section does not fit together";
    }
    const begin = metadata.get("beadline.begin");
    if (begin !== undefined) {
      this.onBegin(await this.metadataAt(begin[0], "beadline.begin"));
    }
    const end = metadata.get("beadline.end");
    if (end !== undefined) {
      this.onEnd(await this.metadataAt(end[0], "beadline.end"));
      this.isFinished = true;
    }
    for (const [channel, topic] of this.topics) {
      this.stateCount += topic === "/state" ? counts.get(channel) ?? 0 : 0;
    }
    return "";
  }

  /** @param {number} offset @param {number} length @param {number} time @returns {Place} */
  placeAt(offset, length, time) {
    return { offset, length, time, isRead: false, first: undefined };
  }

  /** @param {number} offset @param {string} name */
  async metadataAt(offset, name) {
    const record = await recordAt(this.bytes, offset);
    const fields = record?.opcode === METADATA ? new Fields(record.contents, name) : undefined;
    return fields?.text() === name ? fields.texts() : damaged(`${name} is not where the summary section says`);
  }

  /** @param {Fields} fields of a channel */
  addChannel(fields) {
    const number = fields.u16();
    fields.pass(2);
    const topic = fields.text();
    if ((this.topics.get(number) ?? topic) !== topic) {
      damaged(`channel ${number} has two topics`);
    }
    this.topics.set(number, topic);
  }

  /** @param {Map<string, string>} entries */
  onBegin(entries) {
    checkSum(entries, "beadline.begin", ["first_step", "part", "previous_state_hash"]);
    const part = Number(entries.get("part"));
    if (part > 1) {
      this.notes.push(`This is part ${part} of a recording; what was before is in the parts before.`);
    }
  }

  /** @param {Map<string, string>} entries */
  onEnd(entries) {
    const step = (/** @type {string} */ key) => {
      const text = entries.get(key) ?? "";
      const value = Number(text);
      if (text === "") {
        return undefined;
      }
      return isCount(value, 0, 2 ** 52) ? value : damaged(`beadline.end has an impossible ${key}`);
    };
    const reason = entries.get("reason") ?? damaged("beadline.end has no reason");
    this.end = { reason, firstStep: step("first_step"), lastStep: step("last_step") };
  }

  /**
   * Reads a recording without a summary section from its beginning, up to the last whole record.
   * @param {number} start @param {string} why
   */
  async readAll(start, why) {
    this.places = [];
    this.topics.clear();
    this.stateCount = 0;
    this.end = undefined;
    const pieces = windowed(this.bytes);
    let isData = true;
    let at = start;
    let stop = `the file ends at byte ${this.bytes.size}`;
    while (isData && at < this.bytes.size) {
      const head = await headerAt(pieces, at);
      if (head === undefined || head.opcode === 0) {
        stop = head === undefined ? stop : `there are zeros from byte ${at} on`;
        break;
      }
      const { opcode, length, next } = head;
      if (opcode === CHUNK) {
        const place = this.placeAt(at, next - at, 0);
        this.places.push(place);
        const chunk = await this.load(place);
        this.stateCount += chunk.states.length / 3;
      } else if (opcode === METADATA && length <= MAX_OTHER) {
        const record = await recordAt(this.bytes, at);
        const fields = new Fields(record?.contents ?? new Uint8Array(0), "a metadata record");
        const name = fields.text();
        if (name === "beadline.begin") {
          this.onBegin(fields.texts());
        } else if (name === "beadline.end") {
          this.onEnd(fields.texts());
        }
      } else if (opcode === MESSAGE || opcode === SCHEMA || opcode === CHANNEL) {
        throw new Error(`the recording has messages outside of chunks, at byte ${at}, which this page does not read`);
      }
      isData = opcode !== DATA_END;
      at = next;
    }
    this.isFinished = !isData && this.end !== undefined && why.startsWith("it has no summary");
    if (!this.isFinished) {
      const upTo = isData ? `, up to byte ${at}: ${stop}` : "";
      this.notes.push(`The recording is unfinished or damaged (${why}); what is whole in it is shown${upTo}.`);
    }
  }

  /** Finds the chain, and the first and the last state. */
  async findEnds() {
    let first;
    for (const place of this.places) {
      first = (await this.load(place)).states[0];
      if (first !== undefined) {
        break;
      }
    }
    if (first === undefined) {
      const isMap = [...this.topics.values()].includes("/contacts");
      throw new Error(
        isMap
          ? "this is a map of contacts, which has no states (/state) to show; open the recording that it was made from"
          : "the recording has no states: nothing was recorded before it ended",
      );
    }
    checkChain(this.chain, this.manifest.physics.beads);
    for (let i = this.places.length - 1, last; last === undefined; i -= 1) {
      last = (await this.load(this.places[i])).states.at(-3);
      this.lastStep = last ?? 0;
    }
    this.firstStep = first;
    if (this.end?.lastStep !== undefined && this.end.lastStep !== this.lastStep) {
      this.notes.push(`Its end says that the last step is ${this.end.lastStep}, and it is ${this.lastStep}.`);
    }
    let time = 0;
    for (const place of this.places) {
      time = Math.max(time, place.time); // rows of results come late, so a chunk can begin earlier than the one before
      place.time = time;
    }
  }

  /** The records of a chunk, from memory or from the file. @param {Place} place @returns {Promise<Chunk>} */
  async load(place) {
    const cached = this.fromMemory(place);
    if (cached !== undefined) {
      return cached;
    }
    if (place.length > MAX_RECORD || place.length < RECORD_HEADER) {
      damaged(`the chunk at byte ${place.offset} has an impossible length`);
    }
    const bytes = await readExactly(this.bytes, place.offset, place.length);
    const chunk = this.unpack(place, bytes);
    if (this.fromMemory(place) === undefined) {
      this.cache.set(place, chunk);
      this.cachedBytes += chunk.records.length;
    }
    for (const [other, { records }] of this.cache) {
      if (this.cachedBytes <= CACHE_BYTES || other === place) {
        break;
      }
      this.cache.delete(other);
      this.cachedBytes -= records.length;
    }
    return chunk;
  }

  /** @param {Place} place */
  fromMemory(place) {
    const chunk = this.cache.get(place);
    if (chunk !== undefined) {
      this.cache.delete(place);
      this.cache.set(place, chunk);
    }
    return chunk;
  }

  /** @param {Place} place @param {Uint8Array} bytes of the record @returns {Chunk} */
  unpack(place, bytes) {
    const where = `the chunk at byte ${place.offset}`;
    /** @type {Chunk} */
    const chunk = { records: new Uint8Array(0), states: [], chain: undefined };
    try {
      const fields = new Fields(bytes, where);
      if (fields.u8() !== CHUNK || fields.u64() !== bytes.length - RECORD_HEADER) {
        throw new Error("there is no chunk");
      }
      fields.pass(16);
      const [size, crc, compression] = [fields.u64(), fields.u32(), fields.text()];
      const data = fields.take(fields.u64());
      const { beads } = this.manifest.physics;
      const most = Math.max(MAX_OTHER, 2 * (beads * MOST_ARRAYS * 8 + 1024));
      if (compression === "zstd" && size <= most) {
        chunk.records = decompress(data, size);
      } else if (compression === "" && size === data.length) {
        chunk.records = data.slice();
      } else {
        const expected = `what is read is "zstd" up to ${most} bytes, or uncompressed`;
        throw new Error(`it says ${size} bytes by "${compression}", and ${expected}`);
      }
      this.budget -= chunk.records.length;
      if (this.budget < 0) {
        throw new Error("the file has far more chunks without states than a recording has");
      }
      if (crc !== 0 && crc32(chunk.records) !== crc && !place.isRead) {
        this.note(`The checksum of ${where} is wrong, so its states may be, too; ${SALVAGE}.`);
      }
      this.readChunk(chunk);
    } catch (error) {
      damaged(`${where}: ${/** @type {Error} */ (error).message}`);
    }
    place.isRead = true;
    place.first = chunk.states[0];
    return chunk;
  }

  /** Finds the states in a chunk. @param {Chunk} chunk */
  readChunk(chunk) {
    for (const { opcode, fields, start } of recordsOf(chunk.records, 0, chunk.records.length, "the chunk")) {
      if (opcode === CHANNEL) {
        this.addChannel(fields);
      } else if (opcode === MESSAGE) {
        const topic = this.topics.get(fields.u16());
        fields.pass(4 + 8 + 8);
        const [from, to] = [start + fields.at, start + fields.bytes.length];
        if (topic === "/chain") {
          this.foundChain ??= chainOf(chunk.records, from, to);
        } else if (topic === "/state") {
          const step = stepOf(chunk.records, from, to);
          const before = chunk.states.at(-3) ?? -1;
          if (step <= before || step > this.manifest.physics.step_count) {
            throw new Error(`step ${step} after step ${before}, of ${this.manifest.physics.step_count}`);
          }
          chunk.states.push(step, from, to);
        }
      }
    }
  }

  /** The state number `i` of a chunk. @param {Chunk} chunk @param {number} i @returns {State} */
  stateAt({ records, states }, i) {
    const state = stateOf(records, states[3 * i + 1], states[3 * i + 2]);
    const { physics } = this.manifest;
    const { beads, dt_s, method } = physics;
    const { step, time_s, u, v, extra } = state;
    const extraFits = METHODS.includes(method)
      ? extra.length === beads * extraNamesOf(physics, this.chain).length
      : extra.length % beads === 0;
    if (u.length !== beads || v.length !== beads || !extraFits) {
      const lengths = `${u.length}, ${v.length} and ${extra.length} values`;
      damaged(`the state of step ${step} has ${lengths}, of ${beads} beads`);
    }
    if (time_s !== step * dt_s) {
      damaged(`the state of step ${step} is at ${time_s} s, not ${step * dt_s} s`);
    }
    return state;
  }

  /**
   * The chunk that has the last state at or before a step, as far as that is known: the chunk, or one that has to be
   * read first, or undefined. Times are hints only: where they mislead, a state farther back is found.
   * @param {number} step
   */
  placeBefore(step) {
    const { places } = this;
    const time = Math.round(step * this.manifest.physics.dt_s * 1e9) + 1;
    let [low, high] = [0, places.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      [low, high] = places[middle].time <= time ? [middle + 1, high] : [low, middle];
    }
    for (let i = low - 1; i >= 0; i -= 1) {
      const { isRead, first } = places[i];
      if (!isRead || (first !== undefined && first <= step)) {
        return places[i];
      }
    }
    return undefined;
  }

  /** @param {Chunk} chunk @param {number} step @returns {State} the last state at or before it */
  lastIn(chunk, step) {
    let [low, high] = [0, chunk.states.length / 3];
    while (low < high) {
      const middle = (low + high) >> 1;
      [low, high] = chunk.states[3 * middle] <= step ? [middle + 1, high] : [low, middle];
    }
    return this.stateAt(chunk, low - 1);
  }

  /**
   * The last stored state at or before a step; undefined if there is none.
   * @param {number} step @returns {Promise<State | undefined>}
   */
  async before(step) {
    for (;;) {
      const place = this.placeBefore(step);
      const chunk = place === undefined ? undefined : await this.load(place);
      if (chunk === undefined) {
        return undefined;
      }
      if (chunk.states.length > 0 && chunk.states[0] <= step) {
        return this.lastIn(chunk, step);
      }
    }
  }

  /**
   * The same at once, or undefined if the file would have to be read.
   * @param {number} step @returns {State | undefined}
   */
  cachedBefore(step) {
    const place = this.placeBefore(step);
    const chunk = place === undefined || !place.isRead ? undefined : this.fromMemory(place);
    return chunk === undefined ? undefined : this.lastIn(chunk, step);
  }

  /**
   * Reads every chunk that was not read, and tells what is wrong with one.
   * @param {(note: string) => void} tell
   */
  async *check(tell) {
    let told = this.notes.length;
    for (const place of this.places.filter(({ isRead }) => !isRead)) {
      const known = this.notes.length;
      try {
        this.unpack(place, await readExactly(this.bytes, place.offset, place.length));
        this.notes.slice(known).forEach(tell);
      } catch (error) {
        told += 1;
        if (told < MOST_NOTES) {
          tell(/** @type {Error} */ (error).message);
        }
      }
      yield;
    }
  }

  /** All states, in order, or those from the chunk on in which a step is. @param {number} [from] */
  async *states(from = -1) {
    let before = -1;
    const begin = Math.max(0, this.places.findIndex((place) => place === this.placeBefore(from)));
    let coming = this.load(this.places[begin]);
    for (let i = begin; i < this.places.length; i += 1) {
      const chunk = await coming;
      if (i + 1 < this.places.length) {
        coming = this.load(this.places[i + 1]);
        coming.catch(() => {}); // told when it is waited for, which may be never
      }
      for (let j = 0; j < chunk.states.length / 3; j += 1) {
        const state = this.stateAt(chunk, j);
        if (state.step <= before) {
          damaged(`step ${state.step} after step ${before}`);
        }
        before = state.step;
        yield state;
      }
    }
  }
}

/**
 * The same bytes by larger pieces, because there may be as many records as the file has room for.
 * @param {Bytes} file @returns {Bytes}
 */
function windowed(file) {
  let start = 0;
  /** @type {Uint8Array} */
  let piece = new Uint8Array(0);
  return {
    size: file.size,
    read: async (offset, length) => {
      if (offset < start || offset + length > start + piece.length) {
        piece = await readExactly(file, offset, Math.min(Math.max(length, WINDOW), file.size - offset));
        start = offset;
      }
      return piece.subarray(offset - start, offset - start + length);
    },
  };
}

/**
 * The header of the record at an offset; undefined if the record is not whole.
 * @param {Bytes} bytes @param {number} offset
 */
async function headerAt(bytes, offset) {
  if (offset + RECORD_HEADER > bytes.size) {
    return undefined;
  }
  const fields = new Fields(await readExactly(bytes, offset, RECORD_HEADER), "a record");
  const [opcode, length] = [fields.u8(), fields.roughU64()];
  const next = offset + RECORD_HEADER + length;
  return next > bytes.size ? undefined : { opcode, length, next };
}

/** The record at an offset, not a chunk; undefined if it is not whole. @param {Bytes} bytes @param {number} offset */
async function recordAt(bytes, offset) {
  const head = await headerAt(bytes, offset);
  if (head === undefined) {
    return undefined;
  }
  if (head.length > MAX_OTHER) {
    damaged(`the record at byte ${offset} has ${head.length} bytes, and at most ${MAX_OTHER} are read`);
  }
  return { ...head, contents: await readExactly(bytes, offset + RECORD_HEADER, head.length) };
}

const KNOWN = [CHANNEL, MESSAGE, CHUNK_INDEX, STATISTICS, METADATA_INDEX];

/**
 * The records between two places that are of a kind that matters there.
 * @param {Uint8Array} bytes @param {number} start @param {number} end @param {string} what
 */
function* recordsOf(bytes, start, end, what) {
  const fields = new Fields(bytes.subarray(start, end), what);
  while (fields.left > 0) {
    const [opcode, length] = [fields.u8(), fields.u64()];
    const contents = fields.pass(length) + start;
    if (KNOWN.includes(opcode)) {
      yield { opcode, fields: new Fields(bytes.subarray(contents, contents + length), what), start: contents };
    }
  }
}

// Recomputes recordings with page/kernel.js, which was written from docs/KERNEL.md alone, and compares every bit.
//
//     node tests/node/check_kernel.mjs RECORDING...           # after tests/setup
//     node tests/node/check_kernel.mjs --page docs/KERNEL.md  # the test vectors of the page
//     node tests/node/check_kernel.mjs --hash ALPHA           # FNV-1a of the table of this alpha
//
// The state at step 0 is made anew, but if it was given, every further one from the one before it in the file; u, v and extra have to
// have the same bits, and so have the kinetic, potential and dissipated energy in /summary. (NaN is NaN, whatever its
// payload.) Exit code 0 if all is equal; 1 at the first number that differs; 2 if a file is no recording or damaged; 3
// for another kernel version, or keys of `physics` that are not known here. Of several files the least of 1, 2, 3 counts.

import crypto from "node:crypto";
import fs from "node:fs";
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

import { stepperOf } from "../../page/chains.js";
import { KERNEL_VERSION, Power, fromHex, isKnown, retired, toHex } from "../../page/kernel.js";
import { unknownPhysics } from "../../page/keys.js";

const PIECE_BYTES = 1 << 20;
const DRIVEN = 11; // the field of /summary

/** What ends the reading of a file, with its exit code. */
class Stop extends Error {
  constructor(exitCode, message) {
    super(message);
    this.exitCode = exitCode;
  }
}
const damaged = (message) => new Stop(2, message);
const differs = (message) => new Stop(1, message);

/** A package of tests/node/package.json: found as usual, or where tests/setup puts it. */
function load(name) {
  const places = [import.meta.url, new URL("../../target/check/node/", import.meta.url)];
  for (const place of places) {
    try {
      return createRequire(place)(name);
    } catch (error) {
      if (error.code !== "MODULE_NOT_FOUND") {
        throw error;
      }
    }
  }
  throw new Error(`no ${name}: run tests/setup, or set NODE_PATH`);
}

/** The fields of a protobuf message, each a list of its values: varints as numbers, everything else as bytes. */
function fieldsOf(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const fields = new Map();
  let at = 0;
  const varint = () => {
    let value = 0n;
    for (let shift = 0n; ; shift += 7n) {
      const byte = view.getUint8(at);
      at += 1;
      value |= BigInt(byte & 0x7f) << shift;
      if (byte < 0x80) {
        return BigInt.asUintN(64, value);
      }
    }
  };
  const skip = (length) => {
    const start = at;
    at += length;
    if (at > bytes.length) {
      throw damaged("a message ends within a field");
    }
    return bytes.subarray(start, at);
  };
  while (at < bytes.length) {
    const key = Number(varint());
    const values = fields.get(key >> 3) ?? [];
    fields.set(key >> 3, values);
    switch (key & 7) {
      case 0:
        values.push(varint());
        break;
      case 1:
        values.push(skip(8));
        break;
      case 2:
        values.push(skip(Number(varint())));
        break;
      case 5:
        values.push(skip(4));
        break;
      default:
        throw damaged("a message that is no protobuf");
    }
  }
  return fields;
}

/** All values of a repeated double, packed or not. */
function doubles(fields, number) {
  const pieces = fields.get(number) ?? [];
  const bytes = new Uint8Array(pieces.reduce((length, piece) => length + piece.length, 0));
  let at = 0;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  if (bytes.length % 8 !== 0) {
    throw damaged("an array that does not end with a double");
  }
  return new Float64Array(bytes.buffer);
}
/** A double, 0 if it was left out. */
const number = (fields, n) => doubles(fields, n).at(-1) ?? 0;
const integer = (fields, n) => Number(fields.get(n)?.at(-1) ?? 0n);

function readChain(bytes) {
  const fields = fieldsOf(bytes);
  const wall = (n) => {
    if (!fields.has(n)) {
      return undefined;
    }
    const its = fieldsOf(fields.get(n).at(-1));
    const [stiffness, restOverlap, restForce, damping] = [1, 2, 3, 4].map((field) => number(its, field));
    return { stiffness, restOverlap, restForce, damping };
  };
  return {
    mass: doubles(fields, 1),
    stiffness: doubles(fields, 2),
    restOverlap: doubles(fields, 3),
    restForce: doubles(fields, 5),
    damping: doubles(fields, 8),
    leftWall: wall(6),
    rightWall: wall(7),
    terms: (fields.get(10) ?? []).map(readTerm),
    onSite: doubles(fields, 11),
    onSiteCubic: doubles(fields, 12),
    drag: doubles(fields, 13),
    resonatorMass: doubles(fields, 14),
    resonatorStiffness: doubles(fields, 15),
    ring: wall(16),
    dampingPower: number(fields, 17),
  };
}

function readTerm(bytes) {
  const its = fieldsOf(bytes);
  const kind = new TextDecoder().decode(its.get(1)?.at(-1));
  const [parameter, leftWall, rightWall, ring] = [2, 4, 5, 6].map((field) => number(its, field));
  return { kind, parameter, stiffness: doubles(its, 3), leftWall, rightWall, ring };
}

/** `physics` of the metadata record beadline.run. */
function readManifest(metadata) {
  const [version, physics, provenance] = ["schema_version", "physics", "provenance"].map((key) => metadata.get(key) ?? "");
  const text = ["beadline.run", version, physics, provenance].map((line) => `${line}\n`).join("");
  if (crypto.createHash("sha256").update(text).digest("hex") !== metadata.get("checksum")) {
    throw damaged("the checksum of the manifest is wrong");
  }
  if (!version.startsWith("1.")) {
    throw damaged(`schema version ${version}, not 1`);
  }
  const values = JSON.parse(physics);
  if (!isKnown(values.kernel_version)) {
    throw new Stop(3, `kernel version ${values.kernel_version}: this recomputes versions 2 to ${KERNEL_VERSION}`);
  }
  if (retired(values)) {
    throw new Stop(3, `${retired(values)}: no kernel computes that any more`);
  }
  const unknown = unknownPhysics(values);
  if (unknown !== "") {
    throw new Stop(3, `physics has a key that is not known here: ${unknown}`);
  }
  return values;
}

/** The records of a file as it is read; the last one is null if the file was closed. */
function* recordsOf(path, decompressHandlers) {
  const { McapStreamReader } = load("@mcap/core");
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  const file = fs.openSync(path);
  try {
    const piece = new Uint8Array(PIECE_BYTES);
    for (let length; (length = fs.readSync(file, piece)) > 0; ) {
      reader.append(piece.subarray(0, length));
      for (let record; (record = reader.nextRecord()); ) {
        yield record;
      }
    }
  } finally {
    fs.closeSync(file);
  }
  if (reader.done()) {
    yield null;
  }
}

/** What is compared: all bits, but that NaN is NaN. */
function compare(step, what, found, expected) {
  if (!Object.is(found, expected)) {
    throw differs(`step ${step}: ${what} is ${toHex(found)}, not ${toHex(expected)} (${found}, ${expected})`);
  }
}

/** Compares every number of two states, bead by bead: a wrong bit spreads from its bead on. */
function compareStates(step, found, expected, extraNames) {
  const n = expected.u.length;
  for (let bead = 0; bead < n; bead += 1) {
    compare(step, `u of bead ${bead}`, found.u[bead], expected.u[bead]);
    compare(step, `v of bead ${bead}`, found.v[bead], expected.v[bead]);
    extraNames.forEach((name, j) => compare(step, `${name} of bead ${bead}`, found.extra[j * n + bead], expected.extra[j * n + bead]));
  }
}

/** Follows a recording. */
class Follower {
  constructor(physics) {
    this.physics = physics;
    this.states = 0;
  }

  onChain(bytes) {
    this.stepper = stepperOf(this.physics, readChain(bytes));
  }

  onState(bytes) {
    if (this.stepper === undefined) {
      throw damaged("a state before /chain");
    }
    const fields = fieldsOf(bytes);
    const step = integer(fields, 2);
    const state = { u: doubles(fields, 4), v: doubles(fields, 5), extra: doubles(fields, 6), step };
    const { beads, extraNames } = this.stepper;
    if (state.u.length !== beads || state.v.length !== beads || state.extra.length !== extraNames.length * beads) {
      throw damaged(`step ${step}: arrays of another length than the chain's`);
    }
    if (this.states > 0) {
      if (step <= this.step) {
        throw damaged(`step ${step} after step ${this.step}`);
      }
      this.stepper.step(this.state, step - this.step);
      compareStates(step, state, this.state, extraNames);
    } else if (step === 0 && this.physics.initial === undefined) {
      compareStates(step, state, this.stepper.initialState(), extraNames);
    } else {
      this.believed = step; // a later part, or a state that was given
    }
    this.state = state;
    this.step = step;
    this.states += 1;
  }

  onSummary(bytes) {
    const fields = fieldsOf(bytes);
    const step = integer(fields, 2);
    if (step !== this.step) {
      throw damaged(`a summary of step ${step} does not follow its state`);
    }
    const energies = this.stepper.energies(this.state);
    for (const [name, field] of [["kinetic", 4], ["potential", 5], ["dissipated", 10], ["driven", DRIVEN]]) {
      compare(step, `${name} energy`, number(fields, field), energies[name] + 0); // −0 is written as 0
    }
  }
}

/** Checks a recording, and says what it is. */
function checkRecording(path, decompressHandlers) {
  let follower;
  let finished = false;
  let stated = false;
  const topics = new Map();
  for (const record of recordsOf(path, decompressHandlers)) {
    if (record === null) {
      finished = stated;
    } else if (record.type === "Header" && record.profile !== "beadline") {
      throw damaged(`not a recording: its profile is "${record.profile}"`);
    } else if (record.type === "Metadata" && record.name === "beadline.run") {
      follower ??= new Follower(readManifest(record.metadata));
    } else if (record.type === "Metadata" && record.name === "beadline.end") {
      stated = true;
    } else if (record.type === "Channel") {
      topics.set(record.id, record.topic);
    } else if (record.type === "Message") {
      if (follower === undefined) {
        throw damaged("a message before the manifest");
      }
      const topic = topics.get(record.channelId);
      if (topic === "/chain") {
        follower.onChain(record.data);
      } else if (topic === "/state") {
        follower.onState(record.data);
      } else if (topic === "/summary") {
        follower.onSummary(record.data);
      }
    }
  }
  if (follower === undefined) {
    throw damaged("not a recording: it has no manifest");
  }
  const begin = follower.believed === undefined ? "" : `, from step ${follower.believed} on, which is believed`;
  const note = `${begin}${finished ? "" : " (an unfinished recording)"}`;
  return (follower.states === 0 ? "no states" : `${follower.states} states, equal`) + note;
}

/** FNV-1a (64 bit, a double at a time) of H and L of every interval of a table. */
function hashOf(alpha) {
  const power = new Power(alpha);
  if (power.form >= 0) {
    throw new Error(`alpha ${alpha} has no table`);
  }
  const view = new DataView(new ArrayBuffer(8));
  let hash = 0xcbf29ce484222325n;
  for (let i = 0; i < power.intervals; i += 1) {
    const [, h, l] = power.entry(i);
    for (const x of [h, l]) {
      view.setFloat64(0, x);
      hash = BigInt.asUintN(64, (hash ^ view.getBigUint64(0)) * 0x100000001b3n);
    }
  }
  return hash.toString(16).padStart(16, "0");
}

/** Checks the test vectors of a page: the ```json block after <!-- vectors -->. */
function checkPage(path) {
  const block = /<!-- vectors -->\s*```json\n([^]*?)```/.exec(fs.readFileSync(path, "utf8"));
  if (block === null) {
    throw damaged("no test vectors");
  }
  const array = (texts) => Float64Array.from(texts ?? [], fromHex);
  const wall = (texts) => {
    if (!texts) {
      return undefined;
    }
    const [stiffness, restOverlap, restForce, damping] = array(texts);
    return { stiffness, restOverlap, restForce, damping };
  };
  const vectors = JSON.parse(block[1]);
  for (const [index, of] of vectors.entries()) {
    const physics = { kernel_version: 2, beads: of.m.length, ...of };
    physics.damping = of.damping === null ? undefined : { [of.damping]: {} };
    const chain = {
      ...{ mass: array(of.m), stiffness: array(of.k), restOverlap: array(of.rho), restForce: array(of.R) },
      ...{ damping: array(of.eta), leftWall: wall(of.left_wall), rightWall: wall(of.right_wall), ring: wall(of.ring) },
      terms: (of.terms ?? []).map(({ kind, parameter, k }) => {
        const [left, ...rest] = array(k); // those of both ends, too
        const right = rest.pop();
        return { kind, parameter, stiffness: rest, leftWall: left, rightWall: right, ring: left };
      }),
      ...{ onSite: array(of.on_site), onSiteCubic: array(of.on_site_cubic), drag: array(of.drag), dampingPower: of.q },
      ...{ resonatorMass: array(of.resonator_mass), resonatorStiffness: array(of.resonator_stiffness) },
    };
    const stepper = stepperOf(physics, chain);
    const state = { ...stepper.initialState(), step: 0 };
    of.states.forEach(([u, v, ...extra], step) => {
      if (step > 0) {
        stepper.step(state);
        state.step = step;
      }
      try {
        compareStates(step, { u: array(u), v: array(v), extra: array(extra.flat()) }, state, stepper.extraNames);
      } catch (error) {
        throw differs(`chain ${index} (${of.method}), ${error.message}`);
      }
    });
  }
  return `${vectors.length} chains, equal`;
}

/** Checks files one after the other; the exit code. */
function checkEach(paths, check) {
  const codes = new Set();
  for (const path of paths) {
    try {
      console.log(`${path}: ${check(path)}`);
    } catch (error) {
      // whatever a damaged file makes of a reader is one line
      codes.add(error.exitCode ?? 2);
      console.log(`${path}: ${String(error.message).split("\n")[0]}`);
    }
  }
  return [1, 2, 3].find((code) => codes.has(code)) ?? 0;
}

async function main(args) {
  if (args[0] === "--hash" && args.length === 2) {
    console.log(hashOf(Number(args[1])));
    return 0;
  }
  if (args[0] === "--page" && args.length === 2) {
    return checkEach([args[1]], checkPage);
  }
  if (args.length === 0 || args[0].startsWith("--")) {
    console.error(`usage: node ${fileURLToPath(import.meta.url)} RECORDING... | --page docs/KERNEL.md | --hash ALPHA`);
    return 2;
  }
  const decompressHandlers = await load("@mcap/support").loadDecompressHandlers();
  return checkEach(args, (path) => checkRecording(path, decompressHandlers));
}

process.exitCode = await main(process.argv.slice(2));

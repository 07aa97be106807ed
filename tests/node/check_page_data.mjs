// Reads recordings with the modules of page/, and compares every bit of their states and chains with what others read:
// @mcap/core and protobufjs.
//
//     node tests/node/check_page_data.mjs RECORDING...             # after tests/setup
//     node tests/node/check_page_data.mjs --zstd                   # our decompression against zstd's and fzstd's
//     node tests/node/check_page_data.mjs --made                   # small files made here, right and wrong
//     node tests/node/check_page_data.mjs --manifests FILE         # manifests, and why the command refuses them
//     node tests/node/check_page_data.mjs --damage RECORDING...    # every byte changed, every length: a small file
//
// Exit code 0 if all is as it should be.

import assert from "node:assert/strict";
import crypto from "node:crypto";
import fs from "node:fs";
import { createRequire } from "node:module";
import zlib from "node:zlib";

import { stepperOf } from "../../page/chains.js";
import { changed, configuration, whyNotChanged, whyNothingChanged } from "../../page/change.js";
import { between } from "../../page/difference.js";
import { Fields, scalesOf, whyNotRecomputed } from "../../page/fields.js";
import { bytesOfArray, bytesOfFile, crc32, sha256 } from "../../page/mcap.js";
import { Recording, manifestOf } from "../../page/recording.js";
import { decompress } from "../../page/zstd.js";

/** A package of tests/node/package.json, where tests/setup puts it. */
const load = createRequire(new URL("../../target/check/node/", import.meta.url));
const { McapStreamReader } = load("@mcap/core");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = load("@mcap/support");
const fzstd = load("fzstd");

/** Numbers from 0 to 1, the same ones each time. */
function numbers(seed) {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

/** Bytes of many kinds: noise, skewed, repeating near and far, runs, doubles. */
function* samples() {
  const random = numbers(1);
  for (let i = 0; i < 90; i += 1) {
    const bytes = new Uint8Array(Math.floor(random() ** 3 * 500_000));
    const [letters, far] = [1 + random() * 255, 1 + Math.floor(random() ** 2 * 100_000)];
    const kinds = [
      () => random() * 256,
      () => random() ** 4 * letters,
      (at) => (at > 20 && random() < 0.97 ? bytes[at - 1 - Math.floor(random() * 19)] : random() * letters),
      (at) => at >> 7,
      (at) => (at % 8 < 4 ? 0 : random() ** 2 * letters),
      (at) => (at > far && random() < 0.999 ? bytes[at - far] : random() * 256),
    ];
    for (let at = 0; at < bytes.length; at += 1) {
      bytes[at] = kinds[i % kinds.length](at);
    }
    yield bytes;
  }
}

function compressed(bytes, level, checksum) {
  const { ZSTD_c_compressionLevel, ZSTD_c_checksumFlag } = zlib.constants;
  const params = { [ZSTD_c_compressionLevel]: level, [ZSTD_c_checksumFlag]: checksum };
  return new Uint8Array(zlib.zstdCompressSync(bytes, { params }));
}

const isEqual = (a, b) => Buffer.compare(a, b) === 0;

/** What it returns, or the Error of ours that it throws: one with a sentence, and none that JavaScript makes. */
async function outcome(call) {
  try {
    return await call();
  } catch (error) {
    if (error.constructor !== Error) {
      throw error;
    }
    assert.ok(error.message.length > 20, error.message);
    return error;
  }
}

async function checkZstd() {
  let [frames, damaged, accepted] = [0, 0, 0];
  for (const bytes of samples()) {
    for (const level of [-5, 1, 3, 9, 19]) {
      const frame = compressed(bytes, level, frames % 2);
      assert.ok(isEqual(decompress(frame, bytes.length), bytes), `level ${level}`);
      assert.ok(isEqual(fzstd.decompress(frame), bytes), `fzstd, level ${level}`);
      frames += 1;
    }
    const skipped = Uint8Array.of(0x53, 0x2a, 0x4d, 0x18, 2, 0, 0, 0, 7, 7);
    const several = Buffer.concat([compressed(bytes, 1, 1), skipped, compressed(bytes, 3, 0), skipped]);
    assert.ok(isEqual(decompress(several, 2 * bytes.length), Buffer.concat([bytes, bytes])));
    assert.throws(() => decompress(several, 2 * bytes.length + 1), /compressed data are damaged/);
    assert.throws(() => decompress(several.subarray(0, -11), 2 * bytes.length), /compressed data are damaged/);
  }
  // every byte of small frames changed, by one bit and by all, and every length
  for (const bytes of samples()) {
    const piece = bytes.length > 0 ? bytes.subarray(0, 3000) : Uint8Array.of(1);
    const frame = compressed(piece, damaged % 2 === 0 ? 1 : 19, 0);
    for (let at = 0; at < frame.length; at += 1 + (frame.length >> 8)) {
      for (const change of [1 << at % 8, 255]) {
        const wrong = frame.slice();
        wrong[at] ^= change;
        const found = await outcome(() => decompress(wrong, piece.length));
        assert.ok(found instanceof Error || found.length === piece.length);
        let expected;
        try {
          expected = zlib.zstdDecompressSync(wrong);
        } catch {
          // damaged for zstd, too
        }
        if (found instanceof Error) {
          // zstd lets some streams of literals pass that do not end with their last code
          assert.ok(expected?.length !== piece.length || / a stream of /.test(found.message), found.message);
        } else if (expected?.length === piece.length) {
          assert.ok(isEqual(found, expected), "other bytes than zstd's");
          accepted += 1;
        }
        damaged += 1;
      }
      assert.ok((await outcome(() => decompress(frame.subarray(0, at), piece.length || 1))) instanceof Error);
    }
  }
  assert.throws(() => decompress(Uint8Array.of(1, 2, 3, 4), 2 ** 40), /cannot hold/);
  console.log(`${frames} frames, equal; ${damaged} damaged ones, ${accepted} of them readable and equal`);
}

/** States and chain as others read them. */
function expectedOf(path, decompressHandlers) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(fs.readFileSync(path));
  const [schemas, channels, found] = [new Map(), new Map(), { states: [], chain: undefined }];
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema") {
      schemas.set(record.id, protobufFromBinaryDescriptor(record.data).lookupType(record.name));
    } else if (record.type === "Channel") {
      channels.set(record.id, { topic: record.topic, type: schemas.get(record.schemaId) });
    } else if (record.type === "Message") {
      const { topic, type } = channels.get(record.channelId);
      if (topic === "/chain" || topic === "/state") {
        const message = type.toObject(type.decode(record.data), { defaults: true, longs: Number });
        found.states.push(...(topic === "/state" ? [message] : []));
        found.chain = topic === "/chain" ? message : found.chain;
      }
    }
  }
  return found;
}

function sameDoubles(ours, theirs, what) {
  assert.equal(ours.length, theirs.length, what);
  const expected = Float64Array.from(theirs);
  assert.ok(isEqual(Buffer.from(ours.buffer, ours.byteOffset, ours.byteLength), Buffer.from(expected.buffer)), what);
}

function sameState(ours, theirs) {
  const what = `step ${theirs.step}`;
  assert.equal(ours.step, theirs.step);
  assert.equal(ours.time_s, theirs.time_s);
  sameDoubles(ours.u, theirs.displacement_m, what);
  sameDoubles(ours.v, theirs.velocity_m_s, what);
  sameDoubles(ours.extra, theirs.extra, what);
}

function sameChain(ours, theirs) {
  const wall = (its) =>
    its && [its.stiffness, its.rest_overlap_m ?? its.restOverlap, its.rest_force_n ?? its.restForce, its.damping];
  const pairs = [
    [ours.mass, theirs.mass_kg],
    [ours.stiffness, theirs.stiffness],
    [ours.restOverlap, theirs.rest_overlap_m],
    [ours.restForce, theirs.rest_force_n],
    [ours.damping, theirs.damping],
  ];
  pairs.forEach(([a, b], i) => sameDoubles(a, b, `array ${i} of the chain`));
  assert.deepEqual(wall(ours.leftWall), wall(theirs.left_wall ?? undefined));
  assert.deepEqual(wall(ours.rightWall), wall(theirs.right_wall ?? undefined));
  // of older recordings, whose schemas do not have these, there is nothing
  assert.deepEqual(wall(ours.ring), wall(theirs.ring ?? undefined));
  assert.equal(ours.dampingPower, theirs.damping_power ?? 0);
  const further = [
    [ours.onSite, theirs.on_site],
    [ours.onSiteCubic, theirs.on_site_cubic],
    [ours.drag, theirs.drag],
    [ours.resonatorMass, theirs.resonator_mass_kg],
    [ours.resonatorStiffness, theirs.resonator_stiffness],
  ];
  further.forEach(([a, b], i) => sameDoubles(a, b ?? [], `array ${i} of the beads`));
  assert.equal(ours.terms.length, (theirs.terms ?? []).length);
  ours.terms.forEach((term, i) => {
    const its = theirs.terms[i];
    sameDoubles(term.stiffness, its.stiffness, `term ${i}`);
    const numbers = [its.kind, its.parameter, its.left_wall, its.right_wall, its.ring];
    assert.deepEqual([term.kind, term.parameter, term.leftWall, term.rightWall, term.ring], numbers);
  });
}

/** The energy of a state is that of all beads, each with its share of its contacts. */
function sharedEnergies(fields, state) {
  const [beads, energies] = [state.u.length, new Float64Array(8)];
  const row = new Float32Array(beads);
  fields.row("energy", state, [0, beads - 1], beads, row);
  fields.energies(state, energies, 0);
  const sum = row.reduce((sum, energy) => sum + energy, 0);
  assert.ok(Math.abs(sum - energies[7]) <= 1e-6 * Math.abs(energies[7]) + 1e-30, `step ${state.step}: ${sum} J of ${energies[7]}`);
}

async function checkRecording(path, decompressHandlers) {
  const expected = expectedOf(path, decompressHandlers);
  const sources = [bytesOfArray(new Uint8Array(fs.readFileSync(path))), bytesOfFile(await fs.openAsBlob(path))];
  for (const source of sources) {
    const recording = await outcome(() => Recording.open(source));
    if (expected.states.length === 0) {
      assert.match(recording.message, /has no states/);
      continue;
    }
    assert.ok(recording instanceof Recording, recording.message);
    assert.equal(recording.isFinished, path.endsWith(".mcap"));
    assert.equal(recording.notes.some((note) => note.includes("unfinished")), !recording.isFinished);
    assert.equal(recording.stateCount, expected.states.length);
    assert.equal(recording.firstStep, expected.states[0].step);
    assert.equal(recording.lastStep, expected.states.at(-1).step);
    sameChain(recording.chain, expected.chain);
    const { manifest, chain } = recording;
    const fields = whyNotRecomputed(manifest.physics, chain) ? undefined : new Fields(manifest, chain);
    let next = 0;
    for await (const state of recording.states()) {
      sameState(state, expected.states[next]);
      if (fields && next % 50 === 0) {
        sharedEnergies(fields, state);
      }
      next += 1;
    }
    assert.equal(next, expected.states.length);
    const random = numbers(7);
    for (let i = 0; i < 300; i += 1) {
      const step = recording.firstStep + Math.floor(random() * (recording.lastStep + 5 - recording.firstStep));
      sameState(await recording.before(step), expected.states.findLast((state) => state.step <= step));
      assert.equal(recording.cachedBefore(step).step, (await recording.before(step)).step);
    }
    assert.equal(await recording.before(recording.firstStep - 1), undefined);
  }
  return expected.states.length === 0 ? "no states, as it says" : `${expected.states.length} states, equal`;
}

/** All states of these bytes, and the notes; or the Error. */
function readAll(bytes) {
  return outcome(async () => {
    const recording = await Recording.open(bytesOfArray(bytes));
    const states = [];
    for await (const state of recording.states()) {
      states.push(state);
    }
    return { states, recording };
  });
}

/** Nothing but an Error, or notes, or the same states. */
async function checkDamage(path) {
  const whole = new Uint8Array(fs.readFileSync(path));
  const { states: expected } = await readAll(whole);
  const counts = { errors: 0, notes: 0, same: 0 };
  const check = (found, what) => {
    if (found instanceof Error) {
      counts.errors += 1;
    } else if (found.recording.notes.length > 0) {
      counts.notes += 1;
    } else {
      assert.deepEqual(found.states, expected, what);
      counts.same += 1;
    }
  };
  const random = numbers(3);
  for (let at = 0; at < whole.length; at += 1) {
    const wrong = whole.slice();
    wrong[at] ^= at % 2 === 0 ? 255 : 1 << Math.floor(random() * 8);
    check(await readAll(wrong), `byte ${at} changed`);
    const cut = await readAll(whole.subarray(0, at));
    assert.ok(cut instanceof Error || cut.recording.notes.length > 0, `cut at ${at}`);
    assert.ok(cut instanceof Error || cut.states.length <= expected.length);
    if (at + 8 <= whole.length) {
      // whatever is a length or a count there becomes a huge one
      wrong.set(whole);
      new DataView(wrong.buffer).setBigUint64(at, [2n ** 62n, 2n ** 52n, 2n ** 31n - 1n, 2n ** 64n - 1n][at % 4], true);
      check(await readAll(wrong), `eight bytes from ${at} on changed`);
    }
  }
  return `${counts.errors} errors, ${counts.notes} with notes, ${counts.same} the same`;
}

const u16 = (value) => Buffer.from(Uint16Array.of(value).buffer);
const u32 = (value) => Buffer.from(Uint32Array.of(value).buffer);
const u64 = (value) => Buffer.from(BigUint64Array.of(BigInt(value)).buffer);
const double = (value) => Buffer.from(Float64Array.of(value).buffer);
const text = (value) => Buffer.concat([u32(Buffer.byteLength(value)), Buffer.from(value)]);
const record = (opcode, ...parts) => {
  const contents = Buffer.concat(parts);
  return Buffer.concat([Buffer.from([opcode]), u64(contents.length), contents]);
};
const metadata = (name, entries) => {
  const pairs = Buffer.concat(Object.entries(entries).flatMap(([key, value]) => [text(key), text(value)]));
  return record(12, text(name), u32(pairs.length), pairs);
};

/** A recording of two beads, in an encoding that nobody writes: uncompressed, no array packed, fields backwards. */
function made({ version = "1.0", physics, provenance, mass = 1, step = [3], time_s = 3, u = [1, 2], size } = {}) {
  const allPhysics = {
    ...{ kernel_version: 2, beads: 2, bead_mass_kg: 1, alpha: 1.5, stiffness: 1, impurities: [] },
    ...{ striker: { bead: 0, velocity_m_s: 5 }, method: "rkn4", dt_s: 1, step_count: 9, ...physics },
  };
  const allProvenance = {
    ...{ name: "made", run_id: "01234567-89ab-4def-8123-456789abcdef", program: "", host: "", started_unix_ns: 0 },
    ...{ publish_every_steps: 1, record_every_steps: 1, ...provenance },
  };
  const values = [version, JSON.stringify(allPhysics), JSON.stringify(allProvenance)];
  const checksum = crypto.hash("sha256", ["beadline.run", ...values].map((line) => `${line}\n`).join(""));
  const [schema_version, physicsText, provenanceText] = values;
  const run = { checksum, provenance: provenanceText, physics: physicsText, schema_version };
  const field = (number, value) => [Buffer.from([number * 8 + 1]), double(value)];
  // fields 33 and 34, of a byte more in their tags
  const unknown = [Buffer.from([136, 2, ...new Array(9).fill(255), 1]), Buffer.from([149, 2, 1, 2, 3, 4])];
  const states = [...u.flatMap((x) => field(4, x)), ...field(3, time_s)];
  const message = (channel, ...parts) => record(5, u16(channel), u32(0), u64(0), u64(0), ...parts);
  const channel = (number, topic) => record(4, u16(number), u16(0), text(topic), text("protobuf"), u32(0));
  const records = Buffer.concat([
    ...[channel(7, "/state"), channel(8, "/chain"), record(200, u64(0))],
    message(8, ...field(5, 0), ...field(3, 0), ...field(2, 1), ...field(1, mass), ...unknown, ...field(1, 2)),
    message(7, ...[u[0], 9].flatMap((x) => field(5, x)), ...unknown, ...states, Buffer.from([16, ...step])),
  ]);
  const bytes = size ?? records.length;
  const chunk = record(6, u64(0), u64(0), u64(bytes), u32(0), text(""), u64(records.length), records);
  const magic = Buffer.from([0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]);
  const end = metadata("beadline.end", { reason: "detached", first_step: "3", last_step: "3" });
  const footer = record(2, u64(0), u64(0), u32(0));
  const head = [magic, record(1, text("beadline"), text("")), metadata("beadline.run", run)];
  return new Uint8Array(Buffer.concat([...head, chunk, end, record(15, u32(0)), footer, magic]));
}

/** Two equal beads: with α = 1 T is 1 s, and L the largest speed or overlap. */
const TWO = {
  ...{ kernel_version: 2, beads: 2, bead_mass_kg: 1, alpha: 1, stiffness: 1, impurities: [], method: "rk5" },
  ...{ striker: { bead: 0, velocity_m_s: 0 }, dt_s: 0.01, step_count: 100 },
};
const NONE = Float64Array.of(0);
const CHAIN_OF_TWO = {
  ...{ mass: Float64Array.of(1, 1), stiffness: Float64Array.of(1), restOverlap: NONE, restForce: NONE, damping: NONE },
};

/** L and T as the command has them, whatever moves a chain. */
function checkScales() {
  const sine = { amplitude: -0.3, frequency_hz: 1 };
  const hump = { times_s: [0, 1, 2], values: [0, 1, 0], interpolation: "cubic" };
  const ends = { left: "fixed", right: "free" };
  for (const [more, length] of [
    [{ strikers: [{ bead: 1, velocity_m_s: -0.5 }], load: { precompression_n: 9 } }, 0.5],
    [{ initial: { velocities_m_s: [0, -0.7], displacements_m: [9, 0] } }, 0.7],
    [{ initial: { displacements_m: [0.1, -0.2] } }, 0.3],
    [{ initial: { displacements_m: [0.4, 0.2] }, ends }, 0.4],
    [{ initial: { thermal: { energy_j: 0.02 } } }, 0.6],
    [{ baths: [{ beads: "0..2", temperature_j: { constant: 0.01 }, friction_per_s: 1 }] }, 0.3],
    [{ drives: [{ bead: 0, displacement_m: { sine } }] }, 0.3],
    [{ drives: [{ bead: 0, velocity_m_s: { sine } }] }, 0.3],
    [{ drives: [{ bead: 0, force_n: { table: hump } }] }, 1 + 8 / 27], // slopes 2, 0, −2
    [{ load: { precompression_n: 0.4 }, contacts: [{ contact: 0, stiffness: 0.5 }] }, 0.8],
    [{ load: { precompression_n: 0.4 }, ends: { ...ends, left_stiffness: 0.25 } }, 1.6],
    [{ load: { gravity_m_s2: -0.4 }, impurities: [{ bead: 1, mass_kg: 2 }], ends }, 1.6],
  ]) {
    const found = scalesOf({ ...TWO, ...more }, CHAIN_OF_TWO);
    assert.ok(Math.abs(found.length_m - length) < 1e-12 && Math.abs(found.time_s - 1) < 1e-12, JSON.stringify([more, found]));
  }
}

/** Between two steps all that moves is where a step of half the length leads, walls and resonators among it. */
function checkBetween() {
  const sine = { amplitude: 0.1, frequency_hz: 0.3, phase_rad: 0.7 };
  const drives = [{ wall: "left", displacement_m: { sine } }];
  const wall = { stiffness: 1, restOverlap: 0.1, restForce: 0.1, damping: 0 };
  const [resonatorMass, resonatorStiffness] = [Float64Array.of(1, 2), Float64Array.of(3, 1)];
  const chain = { ...CHAIN_OF_TWO, leftWall: wall, resonatorMass, resonatorStiffness };
  const [whole, half] = [0.02, 0.01].map((dt_s) => stepperOf({ ...TWO, striker: { bead: 1, velocity_m_s: 1 }, drives, dt_s }, chain));
  const states = [whole, whole, half].map((stepper) => ({ ...stepper.initialState(), step: 0, time_s: 0 }));
  [undefined, whole, half].forEach((stepper, i) => stepper?.step(states[i]));
  states[1].step = 1;
  const found = between(states[0], states[1], 0.5, whole);
  for (const array of ["u", "v", "extra"]) {
    found[array].forEach((x, i) => {
      const isWork = array === "extra" && i === whole.atDrives;
      assert.ok(Math.abs(x - states[2][array][i]) < (isWork ? 1e-4 : 1e-6), `${array} ${i}: ${x}, not ${states[2][array][i]}`);
    });
  }
}

/** A mass is changed in chains where nothing else follows from it, a speed in all but those whose beginning is given. */
function checkChanges() {
  const plain = { ...TWO, alpha: 1.5, ends: { left: "free", right: "fixed" }, striker: { bead: 0, velocity_m_s: 5 } };
  assert.equal(whyNothingChanged(plain), "");
  const [mass, speed, alpha] = [["mass", 1e-3], ["speed", 1], ["alpha", 2]].map(([what, value]) => ({ what, bead: 0, value }));
  for (const [more, massIs, speedIs] of [
    [{ drives: [] }, /^$/, /^$/],
    [{ bonds: { linear: 1 } }, /^$/, /^$/],
    [{ strikers: [] }, /^$/, /^$/],
    [{ spheres: { radius_m: 1, density_kg_m3: 1, young_pa: 1, poisson: 0 } }, /spheres/, /^$/],
    [{ disorder: [], seed: 3 }, /seed|disorder/, /^$/],
    [{ beads: 3, ends: { left: "periodic", right: "periodic" } }, /periodic/, /^$/],
    [{ damping: { kuwabara_kono_s: 1 } }, /damping\.kuwabara_kono_s/, /^$/],
    [{ initial: {} }, /initial/, /initial/],
    [{ seed: 2 ** 62 }, /seed/, /seed/],
    [{ drives: [{ bead: 0, velocity_m_s: { constant: 1 } }] }, /^$/, /not struck/],
    [{ weather: 1 }, /weather/, /weather/],
  ]) {
    assert.match(whyNotChanged(mass, { ...plain, ...more }), massIs);
    assert.match(whyNotChanged(speed, { ...plain, ...more }), speedIs);
    assert.notEqual(whyNotChanged(alpha, { ...plain, ...more }), "");
  }
  const drives = [{ bead: 1, force_n: { sine: { amplitude: 1, frequency_hz: 1 } } }];
  const bound = { ...plain, alpha: 1, bonds: { linear: 1 }, drives };
  for (const [what, part, value, says] of [
    ["drive", "force_n.sine.frequency_hz", -1, /frequency_hz: found -1; allowed: a positive number/],
    ["drive", "force_n.sine.frequency_hz", 5.1, /5\.1 Hz"; allowed: a period of at least 20 steps/],
    ["drive", "force_n.sine.frequency_hz", 4.9, /^$/],
    ["drive", "force_n.sine.amplitude", -1, /^$/],
    ["drive", "force_n.sine.amplitude", NaN, /Expected a number/],
    ["bond", "linear", -1, /stiffness: found -1/],
    ["bond", "linear", 2, /^$/],
  ]) {
    assert.match(whyNotChanged({ what, bead: 0, part, value }, bound), says);
  }
  // a drive that presses harder has a shorter step, as the command asks for it
  const pushed = { ...plain, striker: { bead: 0, velocity_m_s: 0 }, drives };
  const harder = { what: "drive", bead: 0, part: "force_n.sine.amplitude", value: 1e6 };
  const { physics } = changed(harder, { physics: pushed, provenance: { name: "one" } }, CHAIN_OF_TWO).manifest;
  assert.ok(Math.abs(physics.dt_s - 0.1 * pushed.dt_s) < 1e-12 * pushed.dt_s, `${physics.dt_s} s`);
  assert.ok(Math.abs(physics.dt_s * physics.step_count - pushed.dt_s * pushed.step_count) < 1e-9);
  // cubic bonds have the scales of their power, and half of the step with 16 times the stiffness; a linear part takes these over
  const cubic = { ...plain, alpha: 3, stiffness: 1, bonds: { linear: 0, quadratic: -0.1, cubic: 1 } };
  const spring = (power) => ({ kind: "spring", parameter: power, stiffness: Float64Array.of(1) });
  const bonded = { ...CHAIN_OF_TWO, terms: [1, 2, 3].map(spring) };
  const bondChanged = (part, value) => changed({ what: "bond", bead: 0, part, value }, { physics: cubic, provenance: { name: "one" } }, bonded).manifest.physics;
  const [harderBond, held] = [bondChanged("cubic", 16), bondChanged("linear", 4)];
  assert.deepEqual([harderBond.alpha, harderBond.stiffness, held.alpha, held.stiffness], [3, 16, 1, 4]);
  assert.ok(harderBond.dt_s < 0.6 * cubic.dt_s && harderBond.dt_s > 0.4 * cubic.dt_s && held.dt_s > 0, `${harderBond.dt_s} ${held.dt_s}`);
  // the drag of an absorbing end stays, in the configuration, too: by default it follows T
  const absorbing = { ...TWO, ends: { left: "free", right: "absorbing" }, striker: { bead: 0, velocity_m_s: 1 } };
  const chain = { ...CHAIN_OF_TWO, drag: Float64Array.of(0, 0.005) };
  const other = changed({ ...speed, value: 2 }, { physics: { ...absorbing, alpha: 2 }, provenance: { name: "one" } }, chain);
  assert.equal(other.manifest.physics.ends.absorbing_drag_n_s_per_m, 0.005);
  assert.match(configuration(other.manifest), /^absorbing_drag_n_s_per_m = 0\.005$/m);
  assert.equal(absorbing.ends.absorbing_drag_n_s_per_m, undefined);
  // what TOML would take for too large a whole number has an exponent
  const stiff = { ...other.manifest, physics: { ...other.manifest.physics, stiffness: 1e19, second: { alpha: 2, stiffness: [2 ** 53, 5e10] } } };
  assert.match(configuration(stiff), /^stiffness = 1e\+19$[^]*^second = .*stiffness = \[9\.007199254740992e\+15, 50000000000\]/m);
}

async function checkMade() {
  const { states, recording } = await readAll(made());
  assert.deepEqual(recording.notes, []);
  assert.ok(recording.isFinished);
  assert.deepEqual(recording.end, { reason: "detached", firstStep: 3, lastStep: 3 });
  assert.deepEqual(recording.chain.mass, Float64Array.of(1, 2));
  assert.deepEqual(states, [
    { step: 3, time_s: 3, u: Float64Array.of(1, 2), v: Float64Array.of(1, 9), extra: new Float64Array(0) },
  ]);
  checkChanges();
  checkScales();
  checkBetween();
  const credit = { author: "Josiah Carberry", orcid: "0000-0002-1825-0097", licence: "CC-BY-4.0", doi: "10.5281/zenodo.1" };
  const signed = await readAll(made({ provenance: credit }));
  assert.partialDeepStrictEqual(signed.recording.manifest.provenance, credit);
  const later = await readAll(made({ version: "1.7", provenance: { weather: 1 } }));
  assert.match(later.recording.notes[0], /1\.7/);
  const wrong = [
    [{ version: "2.0" }, /schema version 2\.0/],
    [{ provenance: { weather: 1 } }, /"weather"/],
    [{ provenance: { author: 7 } }, /author/],
    [{ physics: { weather: 1 } }, /"weather"/],
    [{ version: "1.7", physics: { striker: { bead: 0, velocity_m_s: 5, spin: 1 } } }, /"striker\.spin"/],
    [{ physics: { drives: [{ wall: "left", force_n: { sawtooth: { amplitude: 1 } } }] } }, /"drives\.force_n\.sawtooth"/],
    [{ physics: { damping: { weather: 1 } } }, /"damping\.weather"/],
    [{ physics: { beads: 3 } }, /not one of 3 beads/],
    [{ physics: { beads: 1e9 } }, /impossible beads/],
    [{ physics: { dt_s: "1" } }, /impossible dt_s/],
    [{ physics: { striker: { bead: 2, velocity_m_s: 5 } } }, /impossible striker/],
    [{ mass: NaN }, /impossible values/],
    [{ mass: -1 }, /impossible values/],
    [{ step: [10] }, /step 10 after/],
    [{ step: [255, 255, 255, 255, 255, 255, 255, 255, 255, 1] }, /beyond 2\^53/],
    [{ step: [255, 255, 255, 255, 255, 255, 255, 255, 255, 255, 255] }, /without an end/],
    [{ time_s: 4 }, /is at 4 s, not 3 s/],
    [{ u: [1, 2, 3] }, /3, 2 and 0 values/],
    [{ size: 2 ** 40 }, /it says 1099511627776 bytes/],
  ];
  for (const [how, says] of wrong) {
    const found = await readAll(made(how));
    assert.match(String(found.message), says, JSON.stringify(how));
  }
  console.log(`${wrong.length + 3} files made, each as it should be`);
}

/** Refusals of the command that take a resolved chain to know; the page leaves them to `verify`. */
const NEEDS_A_CHAIN = [
  ...[/^time\.dt_s: .*a quarter of the collision time/, /with scales L and T that doubles can hold/, /m·v0²\/k/, /load\/k/],
  ...[/^disorder\[\d+\]: found seed/, /that ends at/],
];

/** What only the page refuses: lists in the place of objects, as no program writes them, and walls of impossible materials. */
const STRICTER = [/found \[1\]; allowed: an object/, /impossible ends\.(left|right)_material\./];

/** Every manifest is refused by the page as by the command. @param {string} path */
function checkManifests(path) {
  const wrong = new Map();
  let [count, refused, left] = [0, 0, 0];
  for (const line of fs.readFileSync(path, "utf8").split("\n")) {
    const { manifest, refused: why } = JSON.parse(line);
    const values = ["1.1", JSON.stringify(manifest.physics, minusZero), JSON.stringify(manifest.provenance)];
    const checksum = crypto.hash("sha256", ["beadline.run", ...values.map(unquoted)].map((text) => `${text}\n`).join(""));
    const [schema_version, physics, provenance] = values.map(unquoted);
    let said = "";
    try {
      manifestOf(new Map(Object.entries({ schema_version, physics, provenance, checksum })), []);
    } catch (error) {
      said = error.message;
    }
    count += 1;
    refused += Number(why !== null);
    if ((why === null) !== (said === "")) {
      if (said === "" ? NEEDS_A_CHAIN.some((form) => form.test(why)) : STRICTER.some((form) => form.test(said))) {
        left += Number(said === "");
        continue;
      }
      const kind = (said || `accepted; the command: ${why}`).replace(/-?\d[\d.e+-]*/g, "#").slice(0, 160);
      wrong.set(kind, wrong.get(kind) ?? line.slice(0, 1500));
    }
  }
  assert.equal(wrong.size, 0, [...wrong].map(([kind, line]) => `${kind}\n    ${line}`).join("\n"));
  console.log(`${count} manifests, ${refused} refused by the command: all by the page, but for ${left} that take a chain to know`);
}

/** JSON has −0 and loses it. */
const minusZero = (/** @type {string} */ _, /** @type {unknown} */ value) => (Object.is(value, -0) ? "<-0.0>" : value);
const unquoted = (/** @type {string} */ text) => text.replaceAll('"<-0.0>"', "-0.0");

async function main(words) {
  for (const size of [0, 1, 55, 56, 63, 64, 65, 1000]) {
    const bytes = new Uint8Array(size).map((_, i) => i * 37);
    assert.equal(sha256(bytes), crypto.hash("sha256", bytes));
    assert.equal(crc32(bytes), zlib.crc32(bytes));
  }
  if (words[0] === "--zstd") {
    await checkZstd();
    return;
  }
  if (words[0] === "--made") {
    await checkMade();
    return;
  }
  if (words[0] === "--manifests") {
    checkManifests(words[1]);
    return;
  }
  const decompressHandlers = await loadDecompressHandlers();
  const check = words[0] === "--damage" ? checkDamage : checkRecording;
  for (const path of words.filter((word) => !word.startsWith("--"))) {
    console.log(`${path}: ${await check(path, decompressHandlers)}`);
  }
}

await main(process.argv.slice(2));

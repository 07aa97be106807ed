// What the page draws, as far as it is numbers and text: ticks, amounts, colours, SVG.
//
//     node tests/node/check_page_drawing.mjs

import assert from "node:assert/strict";

import { amount, labelled, ticks } from "../../page/axes.js";
import { ColourScale, diverging, sequential, theme } from "../../page/colours.js";
import { curvePlot } from "../../page/curves.js";
import { mapCsv } from "../../page/exporting.js";
import { beadsOf, mapScales } from "../../page/map.js";
import { Page } from "../../page/page.js";
import { drawProfile } from "../../page/profile.js";
import { measured, rulerWords } from "../../page/ruler.js";
import { Run } from "../../page/run.js";
import { Spectrum } from "../../page/spectrum.js";
import { SvgSurface, escaped } from "../../page/surface.js";
import { Timeline } from "../../page/timeline.js";
import { passes, title, unclear } from "../../page/compare.js";
import { leftOut } from "../../page/curves.js";
import { Fields } from "../../page/fields.js";
import { History } from "../../page/history.js";
import { RowTable, stepsShown } from "../../page/rows.js";

// Ticks are round, and written as our figures write them.
const shown = (from, to, count, more = {}) => ticks({ from, to, name: "x", ...more }, count);
assert.deepEqual(shown(-0.13, 0.31, 5).labels, ["−0.1", "0.0", "0.1", "0.2", "0.3"]);
assert.deepEqual(shown(-0.5, 999.5, 2, { whole: true }).labels, ["0", "500", "1000"]);
const times = shown(0, 0.08, 8, { unit: "s", prefixed: true });
assert.deepEqual([times.label, times.labels.at(-1), times.values.at(-1)], ["x (ms)", "80", 0.08]);
assert.deepEqual(shown(498.6, 501.3, 20, { whole: true }).labels, ["499", "500", "501"]);
const close = shown(0.0434871, 0.0434977, 5, { unit: "s", prefixed: true });
assert.deepEqual([close.label, close.labels[0]], ["x − 43.4 ms (µs)", "88"]);
assert.deepEqual([1e5, 2e7, 1e16].map((to) => shown(0, to, 2, { unit: "s" }).label), ["x (s)", "x (10⁶ s)", "x (10¹⁵ s)"]);
for (const [from, to] of [[0, 0], [NaN, 1], [0, Infinity], [1e-308, 2e-308], [-1e300, 1e300], [1e15, 1e15 + 1], [5, 4]]) {
  const { values, labels } = shown(from, to, 5);
  assert.ok(values.length <= 13 && labels.length === values.length, `${from} to ${to}: ${values}`);
}
assert.equal(labelled("speed", "beads/s", 3), "speed (10³ beads/s)");

// An amount has the digits of its value, moved by a prefix.
assert.equal(amount(0.04406595760101468, "s"), "44.06595760101468 ms");
assert.equal(amount(-3.4e-7, "m"), "−340 nm");
assert.equal(amount(0.0006, "kg"), "0.6 g");
assert.equal(amount(0.001, "kg"), "1 g");
assert.equal(amount(1e7, "N m^-α"), "10⁷ N m^-α");
assert.equal(amount(12345.678, "s", 3), "12300 s");
assert.equal(amount(0, "m/s"), "0 m/s");
assert.equal(amount(NaN, "J"), "not a number J");
const powers = { f: -15, p: -12, n: -9, µ: -6, m: -3, "": 0, k: 3, M: 6, G: 9 };
for (let i = 0; i < 1000; i += 1) {
  const value = (i % 2 === 0 ? 1 : -1) * 10 ** (-14 + 20 * Math.random());
  const [, number, prefix] = /^(.*) ([fpnµmkMG]?)m$/.exec(amount(value, "m"));
  assert.equal(Number(`${number.replace("−", "-")}e${powers[prefix]}`), value);
}

// Colours: white is 0, both ends differ, and what is painted is what the scale says.
assert.deepEqual(diverging(0), [255, 255, 255]);
assert.deepEqual(sequential(0), [255, 255, 255]);
const scale = new ColourScale({ from: -1, to: 5, log: 5e-3 }, theme(false).shade);
const cells = Float32Array.of(0, -0, 5, -1, 0.05, 1e9, NaN);
const pixels = new Uint32Array(cells.length);
scale.paint(cells, pixels);
const bytes = new Uint8Array(pixels.buffer);
const expected = [0, 0, 1, scale.shade(-1), scale.shade(0.05), 1, 0];
expected.forEach((shade, i) => {
  const colour = diverging(shade);
  colour.forEach((byte, part) => assert.ok(Math.abs(byte - bytes[4 * i + part]) <= 2, `${cells[i]}`));
  assert.equal(bytes[4 * i + 3], 255);
});
for (const size of [9e40, 5e-48]) {
  const vast = new Uint32Array(2);
  new ColourScale({ from: -5 * size, to: 5 * size }, theme(false).shade).paint([5 * size, 0], vast);
  assert.deepEqual([...vast], [pixels[2], pixels[0]], "beyond single precision");
}
assert.equal(new ColourScale({ from: -1, to: 3 }, diverging).place(0), 0.25);
assert.equal(new ColourScale({ from: NaN, to: Infinity }, diverging).to, 1);

// A place in the map and back.
const box = { x: 0, y: 0, width: 800, height: 600 };
const scales = mapScales(box, { places: [-0.5, 999.5], steps: [0, 55190] });
assert.ok(Math.abs(scales.place(scales.x(123)) - 123) < 1e-9 && Math.abs(scales.step(scales.y(777)) - 777) < 1e-9);
assert.ok(curvePlot({ x: 0, y: 0, width: 10, height: 10 }).width > 0);

// Contacts in view are of one bead more, all of a chain of two, too.
assert.deepEqual(beadsOf({ places: [-0.5, 0.5], field: "force" }), [0, 1]);
assert.deepEqual(beadsOf({ places: [-0.5, 1.5], field: "energy" }), [-0.5, 1.5]);

// Beads of a loaded chain stand over their numbers, and overlap.
{
  const [beads, rest] = [12, 2e-6];
  const chain = { mass: new Float64Array(beads).fill(1), restOverlap: new Float64Array(beads - 1).fill(rest) };
  const state = { step: 0, time_s: 0, u: new Float64Array(beads), v: new Float64Array(beads), extra: new Float64Array(0) };
  const view = { places: [-0.5, beads - 0.5], steps: [0, 1], field: "velocity" };
  const [drawn, room] = [new SvgSurface(800, 300), { x: 0, y: 0, width: 800, height: 300 }];
  drawProfile(drawn, room, { state, chain }, view, theme(false));
  const circles = [...drawn.toString().matchAll(/<circle cx="([\d.]+)" cy="[\d.]+" r="([\d.]+)"/g)].slice(beads);
  const { x } = mapScales(room, view);
  assert.equal(circles.length, beads);
  circles.forEach(([, at, radius], bead) => {
    assert.ok(Math.abs(at - x(bead)) < 0.02 && (bead % (beads - 1) === 0 || radius > 0.6 * (x(1) - x(0))), `bead ${bead} at ${at}`);
  });
}

// A table of a map names the first place of each column: 36 places in 28 columns are 9 in 7, four times.
{
  const request = { field: "velocity", places: [0, 35] };
  const names = mapCsv({ rows: { request, columns: 28, count: 0 }, physics: {} }).trim().split(",").slice(2);
  const expected = [0, 9, 18, 27].flatMap((begin) => [0, 2, 3, 4, 6, 7, 8].map((place) => `velocity_${begin + place}`));
  assert.deepEqual(names, expected);
}

// Beside a ring an open chain has no contact that closes it.
{
  const chain = { mass: Float64Array.of(1, 1, 1), restOverlap: new Float64Array(2) };
  const state = { step: 0, time_s: 0, u: Float64Array.of(1, 2, 4), v: new Float64Array(3), extra: new Float64Array(0) };
  const data = { state, chain: { ...chain, ring: {} }, second: state, secondFields: { chain } };
  const drawn = new SvgSurface(800, 100);
  drawProfile(drawn, { x: 0, y: 0, width: 800, height: 100 }, data, { places: [-0.5, 2.5], steps: [0, 1], field: "overlap" }, theme(false));
  assert.equal([...drawn.toString().matchAll(/<circle/g)].length, 5);
}

// A gap may lie beyond the frame; a loaded contact that is less pressed does not.
{
  const u = Float64Array.of(0, -1e-6, 1e-4);
  const state = { step: 0, time_s: 0, u, v: new Float64Array(3), extra: new Float64Array(0) };
  const [stiffness, mass, restOverlap] = [Float64Array.of(1, 1), Float64Array.of(1, 1, 1), new Float64Array(2)];
  const beyond = (restForce) => {
    const [drawn, chain] = [new SvgSurface(800, 100), { mass, stiffness, restOverlap, restForce: Float64Array.of(restForce, restForce) }];
    drawProfile(drawn, { x: 0, y: 0, width: 800, height: 100 }, { state, chain }, { places: [-0.5, 1.5], steps: [0, 1], field: "overlap" }, theme(false));
    return drawn.toString().includes("beyond the frame");
  };
  assert.deepEqual([0, 5].map(beyond), [true, false]);
}

// The speed along a ruler is that of the radii that a seed has made, and where they are not known that is said.
{
  const spheres = { radius_m: 5e-3, density_kg_m3: 8000 };
  const physics = { beads: 3, spheres, dt_s: 1, disorder: [{ of: "radii" }] };
  const mass = [5e-3, 1e-2, 5e-3].map((radius) => (4 / 3) * Math.PI * 8000 * radius ** 3);
  assert.ok(Math.abs(measured([0, 0, 2, 1], physics, mass).m_per_s - 0.03) < 1e-12);
  assert.equal(rulerWords([0, 0, 2, 1], physics, mass)[0], "2 beads/s = 30 mm/s");
  physics.disorder.push({ of: "masses" });
  assert.match(rulerWords([0, 0, 2, 1], physics, mass)[0], /^2 beads\/s = ≈ 20 mm\/s$/);
}

// The cursor goes from stored state to stored state, from the end, too.
for (const [step, direction, expected] of [[6805, -1, 6800], [6800, -1, 6700], [6805, 1, 6900], [0, 1, 100], [0, -1, -100]]) {
  const by = (steps) => assert.equal(step + steps, expected);
  Timeline.prototype.byFrame.call({ step, frameSteps: 100, by }, direction);
}

// Beyond the end of the other run nothing of it is shown; a ring has a contact more.
{
  const run = (dt_s, lastStep, ring) =>
    Object.assign(Object.create(Run.prototype), { physics: { dt_s, beads: 40 }, info: { firstStep: 0, lastStep, chain: { ring } }, state: {} });
  const at = (step) => Object.assign(Object.create(Page.prototype), { run: run(1, 100), second: run(0.5, 120), view: { step } }).secondState;
  assert.deepEqual([0, 60, 61, 100].map((step) => at(step) !== undefined), [true, true, false, false]);
  for (const [ring, bead] of [[{}, 39], [undefined, 38]]) {
    const spectrum = new Spectrum({ run: run(1, 100, ring), bead: 39, window: () => ({ steps: [0, 100] }) });
    spectrum.of = "force";
    assert.equal(spectrum.request().bead, bead);
  }
}

// Text stays text.
assert.equal(escaped("<b a=\"1\" c='2'>&\u0000\ud800"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;\ufffd\ufffd");
const svg = new SvgSurface(10, 10);
svg.text(1, 2, "</svg><script>", { colour: "\"><script>" });
svg.lines([0, 0, NaN, 0, 1, 1, 2, 2], { colour: "red" });
assert.ok(!svg.toString().includes("<script>") && svg.toString().includes('d="M0 0M1 1L2 2"'));
// Names of columns say their units; a filter chooses.
assert.deepEqual(
  ["chain.impurities[0].mass_kg", "forward_energy_j", "forward_v_peak_m_s", "forward_speed_beads_per_s", "alpha"].map(title),
  ["impurities mass (kg)", "forward energy (J)", "forward v peak (m/s)", "forward speed (beads/s)", "alpha"],
);
assert.deepEqual(
  ["resonators.stiffness_n_per_m", "lyapunov.exponent_per_s", "forces.peak_n@right", "forces.impulse_n_s@12"].map(title),
  ["resonators stiffness (N/m)", "lyapunov exponent (1/s)", "forces peak at right (N)", "forces impulse at 12 (N·s)"],
);
const compared = { name: "walls", traits: { "chain.alpha": 1.8, end: "complete" }, open() {} };
assert.ok(["", "walls", "alpha>1.7 alpha<=1.8", "end=complete", "COMPL", "alpha!=2"].every((one) => passes(one, compared)));
assert.ok(["gap", "alpha>1.8", "walls alpha=2", "beta=1"].every((one) => !passes(one, compared)));
const masses = { ...compared, traits: { bead_mass_kg: 1, "impurities.0.mass_kg": 2 } };
assert.ok(!passes("mass_kg>0", masses) && passes("bead_mass>0", masses) && passes("impurities.0.mass_kg=2", masses));
assert.equal(
  unclear("mass_kg>0", Object.keys(masses.traits)),
  "mass_kg is in the names of 2 columns: write all of one (bead_mass_kg, impurities.0.mass_kg).",
);
assert.deepEqual(["mass", "beta=1", "bead_mass>0"].map((one) => unclear(one, Object.keys(masses.traits))), ["", "No column has beta in its name.", ""]);

// Rows of many steps show the extremes of every step, where samples would show a slow swing.
{
  const beads = 12;
  const physics = {
    ...{ kernel_version: 2, beads, bead_mass_kg: 1e-3, alpha: 1.5, stiffness: 1e7, impurities: [] },
    ...{ striker: { bead: 0, velocity_m_s: 5 }, method: "rkn4", dt_s: 1.45e-6, step_count: 5000 },
  };
  const chain = {
    ...{ mass: new Float64Array(beads).fill(1e-3), stiffness: new Float64Array(beads - 1).fill(1e7) },
    ...{ restOverlap: new Float64Array(beads - 1), restForce: new Float64Array(beads - 1), damping: new Float64Array(0) },
  };
  const manifest = { schema_version: "1.1", physics, provenance: {} };
  const [fields, history] = [new Fields(manifest, chain), new History(manifest, chain, undefined, 0, 5000)];
  const request = { field: "velocity", places: [0, beads - 1], columns: 4, steps: [0, 5000], rows: 40, follow: [3] };
  const done = async (work) => {
    for await (const _ of work);
  };
  const valueOf = async (work) => {
    for (;;) {
      const { done: isDone, value } = await work.next();
      if (isDone) {
        return value;
      }
    }
  };
  const table = new RowTable(fields, request);
  const { stride, shown } = stepsShown(request.steps, request.rows);
  assert.equal(stride, 128);
  for (const step of shown) {
    table.insert(await valueOf(history.at(step)));
  }
  const sampled = table.packed(0);
  await done(history.each([0, 5000], (state) => table.widen(state)));
  const all = [];
  await done(history.each([0, 5000], (state) => all.push(table.rowOf(state))));
  assert.equal(all.length, 5001);
  table.rows.forEach((row, i) => {
    const steps = all.filter(({ step }) => step >= row.step && step < (shown[i + 1] ?? Infinity));
    row.lows.forEach((low, column) => {
      assert.equal(low, Math.min(...steps.map(({ lows }) => lows[column])));
      assert.equal(row.highs[column], Math.max(...steps.map(({ highs }) => highs[column])));
    });
    row.cells.forEach((cell, column) => {
      assert.equal(Math.abs(cell), Math.max(...steps.map(({ cells }) => Math.abs(cells[column]))));
    });
  });
  const swing = ({ lows, highs }) => Math.max(...highs) - Math.min(...lows);
  assert.ok(table.rows.some((row) => row.highs[0] - row.lows[0] > 1e-3), "a swing within a row");
  assert.ok(swing(table.packed(0)) > swing(sampled), "that samples do not show");
  const rows = { ...sampled, request, count: shown.length };
  assert.match(leftOut(rows, { recomputes: true }), /^a sample every 12\d steps$/);
  assert.equal(leftOut({ ...rows, seen: 5000 }, { recomputes: true }), "");
  // a live run that is thinned keeps what it was shown
  const live = new RowTable(fields, { ...request, rows: 16 });
  await done(history.each([0, 3000], (state) => live.append(state)));
  assert.ok(live.rows.length <= 16);
  const most = Math.max(...all.slice(0, 3001).map(({ highs }) => highs[0]));
  assert.equal(Math.max(...live.rows.map(({ highs }) => highs[0])), most);
}

console.log("drawing: ticks, amounts, colours, scales and SVG are right");

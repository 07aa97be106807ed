// What the page draws, as far as it is numbers and text: ticks, amounts, colours, SVG.
//
//     node tests/node/check_page_drawing.mjs

import assert from "node:assert/strict";

import { amount, labelled, ticks } from "../../page/axes.js";
import { ColourScale, diverging, sequential, theme } from "../../page/colours.js";
import { curvePlot } from "../../page/curves.js";
import { mapScales } from "../../page/map.js";
import { SvgSurface, escaped } from "../../page/surface.js";

// Ticks are round, and written as our figures write them.
const shown = (from, to, count, more = {}) => ticks({ from, to, name: "x", ...more }, count);
assert.deepEqual(shown(-0.13, 0.31, 5).labels, ["−0.1", "0.0", "0.1", "0.2", "0.3"]);
assert.deepEqual(shown(-0.5, 999.5, 2, { whole: true }).labels, ["0", "500", "1000"]);
const times = shown(0, 0.08, 8, { unit: "s", prefixed: true });
assert.deepEqual([times.label, times.labels.at(-1), times.values.at(-1)], ["x (ms)", "80", 0.08]);
assert.deepEqual(shown(498.6, 501.3, 20, { whole: true }).labels, ["499", "500", "501"]);
const close = shown(0.0434871, 0.0434977, 5, { unit: "s", prefixed: true });
assert.deepEqual([close.label, close.labels[0]], ["x − 43.4 ms (µs)", "88"]);
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
assert.equal(new ColourScale({ from: -1, to: 3 }, diverging).place(0), 0.25);
assert.equal(new ColourScale({ from: NaN, to: Infinity }, diverging).to, 1);

// A place in the map and back.
const box = { x: 0, y: 0, width: 800, height: 600 };
const scales = mapScales(box, { places: [-0.5, 999.5], steps: [0, 55190] });
assert.ok(Math.abs(scales.place(scales.x(123)) - 123) < 1e-9 && Math.abs(scales.step(scales.y(777)) - 777) < 1e-9);
assert.ok(curvePlot({ x: 0, y: 0, width: 10, height: 10 }).width > 0);

// Text stays text.
assert.equal(escaped("<b a=\"1\" c='2'>&\u0000\ud800"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;\ufffd\ufffd");
const svg = new SvgSurface(10, 10);
svg.text(1, 2, "</svg><script>", { colour: "\"><script>" });
svg.lines([0, 0, NaN, 0, 1, 1, 2, 2], { colour: "red" });
assert.ok(!svg.toString().includes("<script>") && svg.toString().includes('d="M0 0M1 1L2 2"'));
console.log("drawing: ticks, amounts, colours, scales and SVG are right");

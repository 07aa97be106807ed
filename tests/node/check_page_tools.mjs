// What a person measures, notes, compares and takes away in the page. Called by tests/e2e/page_tools.rs.
//
//     node tests/node/check_page_tools.mjs BEADLINE SCENARIO ARGUMENTS...   # after tests/setup
//
// Exit code 0 if all is as it should be; 1 with what is not. What was measured is printed.

import assert from "node:assert/strict";
import fs from "node:fs";
import http from "node:http";
import zlib from "node:zlib";

import { cleanUp, csv, exported, openPage, ready, sameStates, saved, say, shared } from "./browser.mjs";
import { start, textOf, textUntil, told, until, viewOf, viewed } from "./browser.mjs";

const [scenario, ...rest] = process.argv.slice(3);

/** Where the plot of the map is on the screen, found by its read-out: places and steps at its edges are in the view. */
async function plotOf(page) {
  const { x, y, width, height } = await page.locator("#map").boundingBox();
  // as map.js has it for a wide page
  return { x: x + 58, y: y + 12, width: width - 58 - 104, height: height - 12 - 42 };
}
const hashUntil = (page, pattern) =>
  until(`${pattern} in the address`, async () => pattern.exec(await page.evaluate(() => location.hash)));
/** The texts of the page as it is exported. */
const drawnTexts = async (page) =>
  [...String((await exported(page, "SVG")).bytes).matchAll(/<text [^>]*>([^<]*)</g)].map(([, text]) => text);
/** The mean of the bytes of the map's plot: how bright it is. */
const brightness = (page) =>
  page.evaluate(() => {
    const canvas = document.getElementById("map");
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(60, 20, canvas.width - 180, canvas.height - 80);
    return data.reduce((sum, byte) => sum + byte, 0) / data.length;
  });

const scenarios = {
  /** The recording inside, and that of a server. */
  async taken(file, html) {
    const page = await shared(html);
    const { name, bytes } = await exported(page, "MCAP");
    const [, packed] = /id="recording">([^<]*)</.exec(fs.readFileSync(html, "utf8"));
    assert.ok(bytes.equals(zlib.gunzipSync(Buffer.from(packed, "base64"))), "the bytes that the page carries");
    fs.writeFileSync("taken.mcap", bytes);
    await told("verify", "taken.mcap");
    await told("expand", "taken.mcap", "--out", "taken-whole.mcap");
    const count = await sameStates(page, "taken-whole.mcap");
    say(`${name}: ${bytes.length} bytes verify, and expand to ${count} states`);
    await page.over();

    const served = await viewed(file);
    assert.ok((await exported(served, "MCAP")).bytes.equals(fs.readFileSync(file)), "the file itself");
    await served.over();
  },

  /** Laid by the pointer along the pulse, by keys, kept in the address, taken away. */
  async ruler(html) {
    const page = await shared(html);
    await page.keyboard.press("r");
    const { x, y, width, height } = await plotOf(page);
    const { places, steps } = await viewOf(page);
    const at = (bead, step) => [
      x + ((bead - places[0]) / (places[1] - places[0])) * width,
      y + ((step - steps[0]) / (steps[1] - steps[0])) * height,
    ];
    // the steps at which the two beads are fastest lie on the pulse
    const { dt, fastest } = await page.evaluate(async () => {
      const { lastStep, manifest } = window.beadline.info;
      const best = [0, 0].map(() => ({ v: 0, step: 0 }));
      for (let step = 0; step <= lastStep; step += 5) {
        const { v } = await window.beadline.state(step);
        [10, 50].forEach((bead, i) => {
          best[i] = v[bead] > best[i].v ? { v: v[bead], step } : best[i];
        });
      }
      return { dt: manifest.physics.dt_s, fastest: best.map(({ step }) => step) };
    });
    await page.mouse.move(...at(10, fastest[0]));
    await page.mouse.down();
    await page.mouse.move(...at(30, fastest[1]), { steps: 3 });
    await page.mouse.move(...at(50, fastest[1]), { steps: 3 });
    await page.mouse.up();
    const { ruler, places: after } = await viewOf(page);
    assert.deepEqual(after, places, "nothing was moved");
    const pixel = (steps[1] - steps[0]) / height;
    [10, fastest[0], 50, fastest[1]].forEach((expected, i) => {
      const near = i % 2 === 0 ? 0.2 : 2 * pixel;
      assert.ok(Math.abs(ruler[i] - expected) < near, `end ${i}: ${ruler[i]}, expected ${expected}`);
    });
    const expected = 40 / ((fastest[1] - fastest[0]) * dt);
    const texts = await drawnTexts(page);
    const words = texts.find((text) => text.includes("beads/s"));
    const [, rate, speed] = /^(\d+) beads\/s = ([\d.]+) m\/s$/.exec(words);
    assert.ok(Math.abs(rate / expected - 1) < 0.02, `${words}, where the pulse has ${expected} beads/s`);
    assert.ok(Math.abs(speed / (rate * 0.01) - 1) < 0.01, `${words}, with 10 mm a bead`);
    await hashUntil(page, new RegExp(`ruler=${ruler.map((end) => Number(end.toFixed(3))).join(",")}`));
    await page.reload();
    await ready(page);
    assert.ok((await viewOf(page)).ruler.every((end, i) => Math.abs(end - ruler[i]) < 1e-3), "after a reload");
    for (const [field, place] of [["overlap", "contact"], ["velocity", "bead"]]) {
      await page.selectOption("#field", field);
      assert.ok((await drawnTexts(page)).includes(words), `over ${place}s`);
    }
    await page.keyboard.press("r");
    assert.equal((await viewOf(page)).ruler, undefined);
    await page.keyboard.press("Home");
    await textUntil(page, "#at", /^step 0 of/);
    await page.keyboard.press("r");
    await page.keyboard.press("End");
    await page.keyboard.press("]");
    await page.keyboard.press("R");
    const byKeys = (await viewOf(page)).ruler;
    assert.deepEqual(byKeys, [30, 0, 31, (await page.evaluate(() => window.beadline.info)).lastStep]);
    say(`along the pulse: ${words}`);
    await page.over();
  },

  /** Fixed by hand, kept while zooming and in the address, refused where 0 would have no colour, let go. */
  async colours(html) {
    const page = await shared(html);
    await until("the map", () => page.evaluate(() => !document.querySelector("#map-panel.busy")));
    const before = await until("colours", () => brightness(page));
    await page.keyboard.press("k");
    await page.fill("#colours-least", "1");
    await page.fill("#colours-largest", "2");
    await page.click('#dialog button:text-is("Fix")');
    await textUntil(page, "#dialog", /0 has a colour of its own/);
    await page.fill("#colours-least", "-1000");
    await page.fill("#colours-largest", "1e3");
    await page.click('#dialog button:text-is("Fix")');
    await page.waitForSelector("#dialog", { state: "hidden" });
    await page.keyboard.press("l");
    const pale = await until("paler colours", async () => (await brightness(page)) > before + 3 && brightness(page));
    await page.keyboard.press("+");
    assert.deepEqual((await viewOf(page)).colours, [-1000, 1000]);
    await hashUntil(page, /colours=-1000\.\.1000/);
    await page.reload();
    await ready(page);
    assert.deepEqual((await viewOf(page)).colours, [-1000, 1000]);
    assert.equal(await page.getAttribute("#colours", "aria-pressed"), "true");
    await page.keyboard.press("2");
    assert.equal((await viewOf(page)).colours, undefined, "metres are no m/s");
    await page.keyboard.press("1");
    await page.keyboard.press("k");
    await page.click('#dialog button:text-is("As what is seen")');
    assert.equal((await viewOf(page)).colours, undefined);
    say(`brightness ${before.toFixed(1)}, with fixed ends ${pale.toFixed(1)}`);
    await page.over();
  },

  /** Notes go into a copy, come out of it as text, and a copy of the copy is the same file. */
  async notes(html, expanded) {
    const page = await shared(html, {});
    const text = "</script><img src=x onerror=alert(1)><!-- here & there\n\u2028second line";
    await page.click("#tab-notes");
    await page.evaluate(() => window.beadline.seek(300));
    await page.keyboard.press("[");
    await textUntil(page, "#note-where", /bead 49/);
    await page.fill("#note-text", text);
    await page.click('#tab button:text-is("Add")');
    await textUntil(page, "#tab", /here & there/);
    const copy = await saved(page, () => page.click('#tab button:text-is("Save a copy")'));
    fs.writeFileSync("copy.html", copy.bytes);
    await page.over();

    const again = await shared("copy.html");
    await again.click("#tab-notes");
    await again.waitForSelector(".notes p");
    assert.equal(await textOf(again, ".notes p"), text);
    assert.equal(await again.evaluate(() => document.querySelectorAll("img").length), 0);
    const count = await sameStates(again, expanded);
    const { bytes } = await saved(again, () => again.click('#tab button:text-is("Save a copy")'));
    assert.ok(bytes.equals(copy.bytes), "a copy of the copy");
    await again.click(".notes button.link");
    await textUntil(again, "#at", /^step 300 of/);
    await again.click(".notes button.quiet");
    await again.waitForSelector(".notes li", { state: "detached" });
    say(`${copy.name}: ${copy.bytes.length} bytes, of ${fs.statSync(html).size}; ${count} states equal`);
    await again.over();
  },

  /** A video and a series of pictures. */
  async film(html) {
    const page = await openPage(new URL(`file://${fs.realpathSync(html)}`).href + "#steps=500..600&speed=frame", { isOffline: true });
    await page.selectOption("#speed", "step");
    await page.click("#export");
    const [, count] = await textUntil(page, "#dialog", /: (\d+) pictures/);
    await page.keyboard.press("Escape");
    assert.equal(Number(count), 101);
    const zip = await exported(page, "PNG series");
    fs.writeFileSync("film.zip", zip.bytes);
    const pictures = [];
    for (let at = 0; zip.bytes.readUInt32LE(at) === 0x04034b50; ) {
      const [crc, size, name] = [zip.bytes.readUInt32LE(at + 14), zip.bytes.readUInt32LE(at + 18), zip.bytes.readUInt16LE(at + 26)];
      const bytes = zip.bytes.subarray(at + 30 + name, at + 30 + name + size);
      assert.deepEqual([...bytes.subarray(0, 4)], [137, 80, 78, 71]);
      assert.equal(zlib.crc32?.(bytes) ?? crc, crc);
      pictures.push(bytes);
      at += 30 + name + size;
    }
    assert.equal(pictures.length, 101);
    assert.ok(!pictures[0].equals(pictures[100]), "pictures that differ");
    const webm = await exported(page, "WebM");
    assert.equal((await viewOf(page)).step, undefined, "the cursor is where it was");
    await page.over();

    const { ms, width, height, differs } = await player(webm.bytes);
    assert.deepEqual([ms, differs], [101 * 40, true]);
    say(`${webm.name}: ${webm.bytes.length} bytes, ${width} × ${height}, ${ms} ms; ${zip.name}: ${pictures.length} pictures`);
  },

  /** Side by side and the difference below, in the address, with steps of another length, of a shared file with a chosen one. */
  async compare(light, heavy, fine, html) {
    const url = await start("view", light, heavy).line;
    const page = await openPage(url);
    await page.waitForSelector("#second-panel:not([hidden])");
    const titles = await until("both titles", async () => {
      const drawn = await drawnTexts(page);
      return drawn.includes("light") && drawn.includes(heavy) && drawn;
    });
    await page.click("#tab-compare");
    const subtracted = (one, steps) =>
      one.evaluate(async (all) => {
        const found = [];
        for (const step of all) {
          const [a, d] = [await window.beadline.state(step), await window.beadline.difference.state(step)];
          found.push({ a: [...a.u, ...a.v], d: [...d.u, ...d.v], most: Math.max(...a.v.map(Math.abs)) });
        }
        return found;
      }, steps);
    const isThere = (one) => until("the difference", () => one.evaluate(() => window.beadline.difference !== undefined));
    await isThere(page);
    const others = await page.evaluate(async () => {
      const found = [];
      for (const step of [0, 777, 2500]) {
        const { u, v } = await window.beadline.changed.state(step);
        found.push([...u, ...v]);
      }
      return found;
    });
    const found = await subtracted(page, [0, 777, 2500]);
    found.forEach(({ a, d }, i) => d.forEach((value, j) => assert.equal(value, a[j] - others[i][j])));
    assert.ok(found[2].d.some((value) => Math.abs(value) > 0.1), "runs that differ");
    assert.ok((await drawnTexts(page)).includes(`light − ${heavy}`));
    await hashUntil(page, /tab=compare&with=1&difference=1/);
    // both maps beside each other, and the difference below; a click on any of them moves the cursor of all
    const [map, second, below] = await Promise.all(
      ["map", "second", "difference"].map((id) => page.locator(`#${id}`).boundingBox()),
    );
    assert.deepEqual([second.x, second.y, second.height], [map.x + map.width, map.y, map.height]);
    assert.deepEqual([below.x, below.y, below.width], [map.x, map.y + map.height, map.width + second.width]);
    const marks = () => page.evaluate(() => [document.getElementById("readout").dataset.step, window.beadline.view.bead]);
    for (const { x, y, width, height } of [second, below, map]) {
      const before = await marks();
      await page.mouse.click(x + (0.3 + y / 3000) * width, y + (0.5 + x / 9000) * height);
      await until("another step and bead", async () => (await marks()).every((mark, i) => mark !== before[i]));
    }
    await page.reload();
    await ready(page);
    await isThere(page);
    await page.click('#tab button:text-is("Take back")');
    await page.waitForSelector("#second-panel", { state: "hidden" });
    await page.over();

    // the same chain with other steps: nothing but the errors of both runs is left
    const file = await shared(html);
    await file.click("#tab-compare");
    await file.check("#compare-difference");
    const [chooser] = await Promise.all([
      file.waitForEvent("filechooser"),
      file.click('#tab button:text-is("Choose a file")'),
    ]);
    await chooser.setFiles(fine);
    await isThere(file);
    await textUntil(file, "#tab", /time steps differ/);
    const [{ d, most }] = await subtracted(file, [2501]);
    const left = Math.max(...d.map(Math.abs));
    assert.ok(left > 0 && left < 2e-5 * most, `${left} of ${most} m/s`);
    say(`${titles.length} texts; with steps of another length ${left.toExponential(1)} m/s of ${most.toFixed(2)} are left`);
    await file.over();
  },

  /** The widget of the Python package, by the interface of anywidget: a page with a model and the module, as in a notebook. */
  async widget(html) {
    const server = http.createServer((_, answer) => answer.end("<!doctype html><link rel=icon href=data:,><div id=cell></div>"));
    await new Promise((done) => server.listen(0, "127.0.0.1", done));
    const page = await openPage(`http://127.0.0.1:${server.address().port}/`, { isEmpty: true });
    const esm = fs.readFileSync(new URL("../../python/beadline/widget.js", import.meta.url), "utf8");
    const given = { _page: fs.readFileSync(html, "utf8"), step: 700, bead: null, field: "force", window_s: null, height_px: 500 };
    await page.evaluate(
      async ([text, values]) => {
        const listeners = new Map();
        const all = (event) => listeners.get(event) ?? listeners.set(event, new Set()).get(event);
        window.saved = [];
        window.model = {
          get: (name) => values[name],
          set: (name, value) => {
            const isNew = values[name] !== value;
            values[name] = value;
            isNew && all(`change:${name}`).forEach((listener) => listener());
          },
          save_changes: () => window.saved.push({ ...values, _page: "" }),
          on: (event, listener) => all(event).add(listener),
          off: (event, listener) => all(event).delete(listener),
          count: () => [...listeners.values()].reduce((sum, { size }) => sum + size, 0),
        };
        const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
        const { default: widget } = await import(url);
        window.end = widget.render({ model: window.model, el: document.getElementById("cell") });
      },
      [esm, given],
    );
    const frame = await (await page.waitForSelector("iframe")).contentFrame();
    const view = () => frame.evaluate(() => window.beadline?.view ?? {}).catch(() => ({}));
    const viewUntil = (what, is) => until(what, async () => is(await view()));
    // Python moves the page
    await viewUntil("the view of the model", ({ step, field }) => step === 700 && field === "force");
    const set = (name, value) => page.evaluate(([key, to]) => window.model.set(key, to), [name, value]);
    await set("step", 900);
    await set("bead", 7);
    await set("field", "displacement");
    const dt = await frame.evaluate(() => window.beadline.info.manifest.physics.dt_s);
    await set("window_s", [600 * dt, 1200 * dt]);
    const isNear = (a, b) => Math.abs(a - b) < 1e-6;
    await viewUntil("step 900", ({ step, bead, field, steps }) => {
      return step === 900 && bead === 7 && field === "displacement" && isNear(steps[0], 600) && isNear(steps[1], 1200);
    });
    await textUntil(frame, "#readout", /bead 7.*step 900/);
    assert.deepEqual(await page.evaluate(() => window.saved), [], "no echo of what Python said");
    // the pointer moves Python
    const { x, y, width, height } = await frame.locator("#map").boundingBox();
    await page.mouse.click(x + width / 2, y + height / 2);
    const saved = await until("a click in the model", () => page.evaluate(() => window.saved.at(-1)));
    const { step, bead } = await view();
    assert.deepEqual([saved.step, saved.bead, saved.field], [step, bead, "displacement"]);
    assert.ok(step !== 900 && bead !== 7);
    assert.deepEqual(saved.window_s, [600 * dt, 1200 * dt], "a window that nobody moved");
    await frame.click("#whole");
    await until("the whole run in the model", () => page.evaluate(() => window.saved.at(-1).window_s === null));
    await page.evaluate(() => window.end());
    assert.deepEqual(await page.evaluate(() => [document.querySelector("iframe"), window.model.count()]), [null, 0]);
    server.close();
    await page.over();
  },

  /** Spectra, modes and forces beside those of the commands. */
  async waves(file, html) {
    const page = await shared(html);
    await page.evaluate(() => window.beadline.seek(1200));
    const chosen = () => page.evaluate(() => Number(document.getElementById("readout").dataset.place));
    await until("bead 20", async () => {
      const bead = await chosen();
      await page.keyboard.press(bead < 20 ? "]" : bead > 20 ? "[" : "Shift");
      return bead === 20;
    });
    await page.click("#tab-spectrum");
    for (const [of, at] of [["velocity", "bead:20"], ["force", "contact:20"]]) {
      await page.selectOption("#spectrum-of", of);
      const place = of === "force" ? "contact 20" : "bead 20";
      const [, segments, length] = await textUntil(page, "#tab", new RegExp(`${place},.*view, (\\d+) segments of (\\d+)`));
      const found = csv((await saved(page, () => page.click('#tab button:text-is("CSV")'))).bytes);
      const words = ["--at", at, "--of", of, "--every-step", "--segment", length, "--out", `${of}.csv`];
      await told("spectrum", file, ...words);
      const expected = csv(fs.readFileSync(`${of}.csv`));
      assert.equal(found.count, expected.count);
      const [, column] = found.columns;
      const theirs = expected.columns.find((name) => name.endsWith(column.replace("density", "")));
      let [most, worst] = [0, 0];
      for (let line = 0; line < found.count; line += 1) {
        const [own, other] = [found.numbers(line), expected.numbers(line)];
        assert.ok(Math.abs(own.frequency_hz - other.frequency_hz) <= 1e-9 * own.frequency_hz);
        most = Math.max(most, other[theirs]);
        worst = Math.max(worst, Math.abs(own[column] - other[theirs]));
      }
      assert.ok(most > 0 && worst < 1e-12 * most, `${of}: ${worst} of ${most}`);
      say(`${of}: ${found.count} frequencies, ${segments} segments, apart by ${(worst / most).toExponential(1)} of the largest`);
    }
    await told("modes", file, "--out", "modes.csv");
    const modes = csv(fs.readFileSync("modes.csv"));
    const rows = await page.$$eval("#tab tbody tr", (all) => all.map((row) => [...row.cells].map((cell) => cell.textContent)));
    assert.equal(rows.length, modes.count);
    const column = modes.columns.find((name) => name === "frequency_hz");
    for (const line of [1, 20, modes.count - 1]) {
      const [, number, prefix] = /^([\d.]+) (k?)Hz$/.exec(rows[line][1]);
      const shown = Number(number) * (prefix ? 1000 : 1);
      assert.ok(Math.abs(shown / modes.numbers(line)[column] - 1) < 1e-5, `mode ${line}: ${rows[line]}`);
    }
    await page.keyboard.press("6");
    const { k, alpha, overlap, rest } = await page.evaluate(async () => {
      const { manifest, chain } = window.beadline.info;
      const { u } = await window.beadline.state(1200);
      const overlap = u[20] - u[21] + chain.restOverlap[20];
      return { k: chain.stiffness[20], alpha: manifest.physics.alpha, overlap, rest: chain.restForce[20] };
    });
    await textUntil(page, "#readout", /^contact 20.*step 1200force from rest/);
    const force = await page.evaluate(() => Number(document.getElementById("readout").dataset.value));
    assert.ok(Math.abs(force - (k * overlap ** alpha - rest)) < 1e-12 * rest && Math.abs(force) > 1e-5 * rest, `${force} N`);
    await page.over();
  },

  /** A slow run: its whole duration is on the axis. */
  async axis() {
    const words = "run --beads 100 --impurity 50=0.6e-3 --duration 0.2 --pace 0.003 --no-record";
    start(...words.split(" "), "--name", "slow");
    const step = async () => JSON.parse(await told("ls", "--json")).find(({ name }) => name === "slow")?.step ?? 0;
    await until("a late page", async () => (await step()) > 1000);
    const page = await viewed("live:slow");
    const { step_count: all } = await page.evaluate(() => window.beadline.info.manifest.physics);
    await until("the end of its duration", async () => (await viewOf(page)).steps[1] === all);
    assert.ok((await drawnTexts(page)).includes("200"), "200 ms on the axis");
    // rows from before the page came and after are equally far apart
    const came = (await page.evaluate(() => window.beadline.info)).lastStep;
    const stepsShown = async () => {
      const { count, numbers } = csv((await exported(page, "CSV: map")).bytes);
      return Array.from({ length: count }, (_, line) => numbers(line).step);
    };
    const widest = await until("rows equally far apart", async () => {
      const shown = await stepsShown();
      assert.ok(shown.length === 0 || shown[0] === 0, `rows from step ${shown[0]} on`);
      const old = shown.filter((at) => at < came + 1000);
      const gaps = old.slice(1).map((at, i) => at - old[i]).sort((a, b) => a - b);
      const ratio = gaps.length > 10 ? gaps.at(-1) / gaps[gaps.length >> 1] : Infinity;
      return shown.at(-1) > came + 3000 && ratio <= 1.5 && ratio;
    });
    await until("every step looked at", async () => !(await drawnTexts(page)).some((text) => /sample every/.test(text)));
    say(`the widest gap is ${widest} times the usual one`);
    await page.over();
  },
};

/** A video in a page of its own. */
async function player(bytes) {
  const page = await openPage("data:text/html,<video muted></video>", { isEmpty: true });
  const found = await page.evaluate(async (text) => {
    const video = document.querySelector("video");
    const loaded = new Promise((done, failed) => {
      video.addEventListener("loadeddata", done);
      video.addEventListener("error", () => failed(new Error("no video")));
    });
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    video.src = URL.createObjectURL(new Blob([bytes], { type: "video/webm" }));
    await loaded;
    const pixels = async (time) => {
      video.currentTime = time;
      await new Promise((done) => video.addEventListener("seeked", done, { once: true }));
      const canvas = new OffscreenCanvas(video.videoWidth, video.videoHeight).getContext("2d");
      canvas.drawImage(video, 0, 0);
      return canvas.getImageData(0, 0, video.videoWidth, video.videoHeight).data;
    };
    const [first, last] = [await pixels(0.1), await pixels(3.9)];
    const differs = first.some((byte, i) => Math.abs(byte - last[i]) > 64);
    return { width: video.videoWidth, height: video.videoHeight, ms: Math.round(1000 * video.duration), differs };
  }, bytes.toString("base64"));
  await page.over();
  return found;
}

try {
  await scenarios[scenario](...rest);
} catch (error) {
  console.error(error.stack ?? error);
  process.exitCode = 1;
} finally {
  await cleanUp();
}

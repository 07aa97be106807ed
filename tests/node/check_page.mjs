// The page in a browser: what it shows, recomputes and proves, and what it refuses. Called by tests/e2e/page.rs.
//
//     node tests/node/check_page.mjs BEADLINE SCENARIO ARGUMENTS...   # after tests/setup
//
// Exit code 0 if all is as it should be; 1 with what is not. What was measured is printed.

import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";

import { cleanUp, csv, exported, median, openInFirefox, openPage, ready, sameStates, say } from "./browser.mjs";
import { shared, start, textOf, textUntil, told, until, viewOf, viewed } from "./browser.mjs";

const [scenario, ...rest] = process.argv.slice(3);

const prove = (page) => page.evaluate(() => window.beadline.prove());
const middleOf = async (page, selector) => {
  const { x, y, width, height } = await page.locator(selector).boundingBox();
  return { x: x + width / 2, y: y + height / 2, width, height };
};
/** What is read out, once it is not of one of these places and steps. */
const readOut = (page, others) =>
  until("the read-out", () =>
    page.evaluate((known) => {
      const { dataset, textContent } = document.getElementById("readout");
      return known.includes(`${dataset.place} ${dataset.step}`) ? undefined : { ...dataset, text: textContent };
    }, others),
  );

/** Lets go of a file over the page. */
const drop = (page, name, bytes) =>
  page.evaluate(
    ([called, text]) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(text), (one) => one.charCodeAt(0))], called));
      document.body.dispatchEvent(new DragEvent("drop", { bubbles: true, cancelable: true, dataTransfer: transfer }));
    },
    [name, bytes.toString("base64")],
  );

const scenarios = {
  /** Recordings and what `beadline expand` makes of them, in turns. */
  async states(...files) {
    for (let i = 0; i < files.length; i += 2) {
      const page = await viewed(files[i]);
      const count = await sameStates(page, files[i + 1]);
      const proof = await prove(page);
      assert.equal(proof.first, undefined);
      assert.ok(proof.states > 1, "nothing was compared");
      say(`${path.basename(files[i])}: ${count} states equal, ${proof.states} proven`);
      await page.over();
      page.server.kill();
    }
  },

  /** A shared file, the network cut, from the disk. */
  async shared(file, expanded) {
    const page = await shared(file);
    const count = await sameStates(page, expanded);
    await page.click("#prove");
    const [said, proven] = await textUntil(page, "#notes", /Proven: (\d+) states, .*each bit the same/);
    assert.equal(Number(proven), (await page.evaluate(() => window.beadline.info)).storedCount, said);
    say(`${count} states equal, ${proven} proven; open after ${page.openMs.toFixed(0)} ms`);
    await page.over();
  },

  /** The same in the other browser. */
  async firefox(file, expanded) {
    const page = await openInFirefox(file);
    await ready(page);
    const count = await sameStates(page, expanded);
    await page.click("#prove");
    const [, proven] = await textUntil(page, "#notes", /Proven: (\d+) states, .*each bit the same/);
    say(`${page.version}: ${count} states equal, ${proven} proven`);
    await page.over();
  },

  /** A recording in which one value was changed, under checksums that hold. */
  async changed(file, step, bead) {
    const page = await viewed(file);
    const { first } = await prove(page);
    assert.deepEqual([first.step, first.bead], [Number(step), Number(bead)]);
    await textUntil(page, "#notes", new RegExp(`Not proven: at step ${step}, bead ${bead}, v is`));
    await page.over();
  },

  /** What a proof takes as given, and recordings that lack something: said in the words of `verify`. */
  async proofs(whole, missing, failed) {
    for (const [file, says] of [
      [whole, /^Proven: \d+ states, .* The first state is the manifest's initial condition\. Not known: `\/chain`.*`run\.toml`.*who made it, where and when: name, run id, program, host and start; whose it is: author, ORCID, licence and DOI\.$/],
      [missing, /^Not proven: states are missing at 1 place/],
      [failed, /^Proven as far as it goes, but it is NOT WHOLE \(its end is "failed"\): \d+ states/],
    ]) {
      const page = await viewed(file);
      await prove(page);
      assert.match((await textOf(page, "#notes .proof")).trim(), says, file);
      await page.over();
      page.server.kill();
    }
  },

  /** A text of five million bytes: its beginning and its length. */
  async long(file) {
    const page = await viewed(file);
    const told = await textUntil(page, "#tab", /p… \(5,000,000 bytes\)/);
    assert.ok(told.input.length < 100_000, `${told.input.length} characters`);
    await page.over();
  },

  /** A folder of so many recordings that not all have a row. */
  async crowded(folder) {
    const page = await viewed(folder, { isEmpty: true });
    await page.waitForSelector("#list tbody tr");
    const rows = () => page.$$eval("#list tbody tr", (all) => all.map((row) => row.cells[1].textContent));
    const first = await rows();
    assert.equal(first.length, 500);
    await textUntil(page, "#list", /700 more rows/);
    await page.fill("#list input[type=search]", "run-1199");
    await until("the row that was not shown", async () => (await rows()).join() === "run-1199.mcap");
    await page.fill("#list input[type=search]", "");
    await until("the first ones again", async () => (await rows()).join() === first.join());
    await page.over();
  },

  /** A recording with a chunk that is damaged, far from its ends: said without anybody looking there. */
  async damaged(file) {
    const page = await viewed(file);
    await textUntil(page, "#notes", /checksum of the chunk at byte \d+ is wrong|the recording is damaged/i);
    await page.over();
  },

  /** What the pointer reads out is what `beadline export` writes of every step, to the last digit. */
  async readout(file, table) {
    const { numbers } = csv(fs.readFileSync(table));
    const expected = {
      velocity: ({ step, place }) => numbers(step)[`v_${place}_m_s`],
      displacement: ({ step, place }) => numbers(step)[`u_${place}_m`],
      overlap: ({ step, place }) => numbers(step)[`u_${place}_m`] - numbers(step)[`u_${Number(place) + 1}_m`],
    };
    const page = await viewed(file, { fragment: "#bead=1&at=1500&digits=all" });
    const cursor = "1 1500";
    let before = cursor;
    const values = new Set();
    for (const [i, field] of ["velocity", "displacement", "overlap"].entries()) {
      await page.selectOption("#field", field);
      for (const [selector, dx, dy] of [["#map", 0, 0], ["#map", -0.2, 0.2], ["#profile", 0.03 * i, 0]]) {
        const { x, y, width, height } = await middleOf(page, selector);
        await page.mouse.move(x + dx * width, y + dy * height);
        const found = await readOut(page, [cursor, before]);
        before = `${found.place} ${found.step}`;
        const [, shown] = new RegExp(`${field}(?: from rest)? (\\S+) m`).exec(found.text);
        assert.equal(Number(shown), expected[field](found), `${field}: ${found.text}`);
        assert.equal(selector === "#profile", found.step === "1500", found.text);
        values.add(Number(shown));
      }
    }
    assert.equal(values.size, 9, "values that say something");
    await page.keyboard.press("g");
    const digits = async () => /(\d[\d.]*)(e\S+)? m$/.exec(await textOf(page, "#readout b"))?.[1].replace(/^[0.]+|\./g, "");
    await until("six digits", async () => (await digits())?.length <= 6);
    await page.keyboard.press("g");
    await until("all digits", async () => (await digits())?.length > 6);
    say(`read out and exported: ${[...values].join(", ")}`);
    await page.over();
  },

  /** Wheel, drag and box; down to single steps; the same view after a reload. */
  async gestures(file) {
    const page = await viewed(file, { fragment: "#at=300" });
    const { x, y, width } = await middleOf(page, "#map");
    const span = async (which) => {
      const [from, to] = (await viewOf(page))[which];
      return to - from;
    };
    await page.mouse.move(x, y);
    await page.keyboard.down("Shift");
    await page.mouse.wheel(0, -240);
    await until("fewer beads", async () => (await span("places")) < 70);
    await page.keyboard.up("Shift");
    await until("single steps", async () => {
      await page.mouse.wheel(0, -240);
      return (await span("steps")) <= 12;
    });
    const before = await viewOf(page);
    await page.mouse.down();
    await page.mouse.move(x + width / 4, y, { steps: 4 });
    await page.mouse.up();
    const after = await viewOf(page);
    const moved = (before.places[0] - after.places[0]) / (before.places[1] - before.places[0]);
    assert.ok(moved > 0.2 && moved < 0.4, `moved by ${moved} of the window`);
    assert.equal(after.step, 300, "a drag is no click");

    const rows = await until("a row for each step", async () => {
      const { bytes } = await exported(page, "CSV: map");
      const { count, numbers } = csv(bytes);
      const steps = Array.from({ length: count }, (_, line) => numbers(line).step);
      const [from, to] = after.steps;
      const whole = steps[0] <= Math.ceil(from) && steps.at(-1) >= Math.floor(to) && count <= 14;
      return whole && steps.every((step, i) => i === 0 || step === steps[i - 1] + 1) && count;
    });
    const fragment = () => page.evaluate(() => location.hash);
    const near = (a, b) => a.every((end, i) => Math.abs(end - b[i]) <= 1e-3);
    // the address follows a little later than the view
    const isWritten = async () => {
      const found = /beads=([-\d.]+?)\.\.([-\d.]+)&steps=([-\d.]+?)\.\.([-\d.]+)&at=300/.exec(await fragment());
      return found && near(found.slice(1).map(Number), [...after.places, ...after.steps]) && found.input;
    };
    const hash = await until("the view in the address", isWritten);
    await page.reload();
    await ready(page);
    assert.equal(await fragment(), hash);
    const { places, steps, step, field } = await viewOf(page);
    assert.ok(near(places, after.places) && near(steps, after.steps) && step === 300 && field === "velocity");
    await textUntil(page, "#at", /^step 300 of/);
    await page.dblclick("#map");
    await until("all of it", async () => (await span("places")) > 90 && (await span("steps")) > 600);
    say(`${rows} rows, one a step; ${hash}`);
    await page.over();
  },

  /** Everything by keys; names for those who hear the page. */
  async keyboard(file) {
    const page = await viewed(file, { fragment: "#at=0" });
    const at = (step) => textUntil(page, "#at", new RegExp(`^step ${step} of`));
    const press = async (...keys) => {
      for (const key of keys) {
        await page.keyboard.press(key);
      }
    };
    await press("?");
    assert.match(await textOf(page, "#dialog"), /play, pause/);
    await press("Escape");
    await page.waitForSelector("#dialog", { state: "hidden" });
    await press("ArrowRight");
    await at(1);
    await press("ArrowRight");
    await at(2);
    await press("ArrowLeft");
    await at(1);
    await press("End");
    const { lastStep } = await page.evaluate(() => window.beadline.info);
    await at(lastStep);
    await press("Home");
    await at(0);
    await press(" ");
    await until("play", async () => Number((await textUntil(page, "#at", /step (\d+)/))[1]) > 0);
    await press(" ");
    assert.equal(await page.getAttribute("#play", "aria-label"), "play");
    await press("3", "]", "+", "i", "t", "l");
    const view = await viewOf(page);
    assert.deepEqual([view.field, view.bead, view.log], ["overlap", 51, false]);
    assert.ok(view.steps[1] - view.steps[0] < lastStep && view.places[1] - view.places[0] < 60);
    const nameless = await page.evaluate(() => {
      const named = (element) =>
        element.closest("[hidden], [aria-hidden=true]") ||
        element.labels?.length > 0 ||
        element.getAttribute("aria-label")?.trim() ||
        (element.tagName !== "CANVAS" && element.textContent.trim());
      const all = [...document.querySelectorAll("button, canvas, input, select, [role=img], [role=tabpanel]")];
      return all.filter((element) => !named(element)).map((element) => element.outerHTML.slice(0, 120));
    });
    assert.deepEqual(nameless, []);
    await page.over();
  },

  /** A run as it goes: shown, paused in the page, scrolled back, ended. */
  async live() {
    const words = "run --beads 100 --impurity 50=0.6e-3 --duration 1 --pace 0.003 --record-every-steps 100";
    const run = start(...words.split(" "), "--name", "going", "--out", "going.mcap");
    const now = async () => JSON.parse(await told("ls", "--json")).find(({ name }) => name === "going") ?? { step: 0 };
    await until("a late page", async () => (await now()).step > 500);
    const page = await viewed("live:going");
    const { kind } = await page.evaluate(() => window.beadline.info);
    assert.equal(kind, "live");
    const at = async () => /step (\d+) of (\d+)/.exec(await textOf(page, "#at"))?.slice(1).map(Number) ?? [0, 0];
    const goesOn = async (which) => {
      const before = (await at())[which];
      await until("the run goes on", async () => (await at())[which] > before + 200);
    };
    await goesOn(0);
    const lastRow = async () => {
      const { count, numbers } = csv((await exported(page, "CSV: map")).bytes);
      return count > 1 ? numbers(count - 1).step : 0;
    };
    const first = await until("rows", lastRow);
    await until("the map grows", async () => (await lastRow()) > first);

    await page.click("#play");
    const paused = await until("a cursor that rests", async () => (await viewOf(page)).step);
    await goesOn(1);
    const run0 = await now();
    await until("the run itself", async () => (await now()).step > run0.step);
    assert.equal((await at())[0], paused);
    const start0 = await page.evaluate(async () => {
      await window.beadline.seek(0);
      const { step, u, v } = await window.beadline.state(0);
      return { step, u: [...u], v: [...v] };
    });
    assert.deepEqual(start0, { step: 0, u: Array(100).fill(0), v: [5, ...Array(99).fill(0)] });
    await textUntil(page, "#at", /^step 0 of/);
    await page.click("#follow");
    await goesOn(0);

    await page.click("#tab-live");
    await textUntil(page, "#tab", /frames seen\d+frames skipped\d+.*lag.*view.*latest/s);
    run.child.kill("SIGINT");
    await run.text;
    await textUntil(page, "#notes", /The run has ended: interrupted/);
    await told("expand", "going.mcap", "--out", "whole.mcap");
    const { lastStep } = await page.evaluate(() => window.beadline.info);
    const count = await sameStates(page, "whole.mcap", Math.min(lastStep, 3000));
    say(`live: ${count} states equal, of a page that came after step 500`);
    await page.over();
  },

  /** A run at its full rate, with a page and without, in turns of some seconds. */
  async rate(turns = "2", seconds = "0.5", beads = "1000") {
    const words = "run --duration 1000 --no-record --json --impurity 50=0.6e-3 --name fast --beads";
    const run = start(...words.split(" "), beads);
    const now = async () => {
      const found = JSON.parse(await told("ls", "--json")).find(({ name }) => name === "fast");
      return { step: found?.step ?? 0, at: Date.now() / 1e3 - (found?.age_s ?? 0) };
    };
    await until("the run", async () => (await now()).step > 0);
    const rate = async () => {
      const began = await now();
      await new Promise((done) => setTimeout(done, Number(seconds) * 1000)); // what is measured, not waited for
      const ended = await now();
      return (ended.step - began.step) / (ended.at - began.at);
    };
    const [ratios, updates] = [[], []];
    for (let turn = 0; turn < Number(turns); turn += 1) {
      const without = await rate();
      const page = await viewed("live:fast");
      await page.evaluate(() => {
        globalThis.updates = 0;
        let before = "";
        const look = () => {
          const { step } = document.getElementById("readout").dataset;
          globalThis.updates += Number(step !== before);
          before = step;
          requestAnimationFrame(look);
        };
        look();
      });
      const began = performance.now();
      const shown = await rate();
      ratios.push(shown / without);
      updates.push((1000 * (await page.evaluate(() => globalThis.updates))) / (performance.now() - began));
      await page.over();
      page.server.kill();
    }
    run.child.kill("SIGINT");
    const { held_back_s: held, consumers_dropped: dropped } = JSON.parse(await run.text);
    assert.deepEqual([held, dropped], [0, []], "the page held the run back");
    say(
      `live, ${beads} beads: ${median(updates).toFixed(0)} updates/s; the run goes on at ${median(ratios).toFixed(3)} ` +
        `of its rate without the page (${ratios.map((ratio) => ratio.toFixed(3)).join(", ")})`,
    );
  },

  /** Recordings that are dropped onto an empty page, or chosen; the second one of an older kernel. */
  async dropped(empty, file, expanded, older) {
    const page = await openPage(pathToFileURL(empty).href, { isOffline: true, isEmpty: true });
    await page.waitForSelector("#drop");
    await drop(page, "run.mcap", fs.readFileSync(file));
    await ready(page);
    await sameStates(page, expanded);
    const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.click("#open")]);
    await chooser.setFiles(older);
    await textUntil(page, "#notes", /kernel.*The recorded states are shown/i);
    const { info, state } = await page.evaluate(async () => {
      const { firstStep, lastStep } = await window.beadline.ready;
      const { info } = window.beadline;
      const { step, u } = await window.beadline.state(lastStep);
      return { info: { recomputes: info.recomputes, firstStep, lastStep }, state: { step, u: [...u] } };
    });
    assert.ok(!info.recomputes && state.step === info.lastStep && state.u.some((u) => u !== 0));
    const { whyNot } = await prove(page);
    assert.match(whyNot, /kernel/);
    await page.over();
  },

  /** Files that are no recordings, damaged, or have markup for names: a sentence, or the run and its names as text. */
  async hostile(empty, page_, folder) {
    const page = await openPage(pathToFileURL(empty).href, { isOffline: true, isEmpty: true });
    const elements = (one) =>
      one.evaluate(() => [document.scripts.length, document.querySelectorAll("img, iframe").length]);
    const before = await elements(page);
    for (const name of fs.readdirSync(folder).filter((one) => one.endsWith(".mcap"))) {
      await drop(page, name, fs.readFileSync(path.join(folder, name)));
      const said = await until(`an end for ${name}`, () =>
        page.evaluate(async () => {
          const bad = document.querySelector("#waiting:not([hidden]).bad #waiting-text")?.textContent;
          const opened = async () => {
            const proof = window.beadline.prove();
            const { whyNot, first, states } = await proof.catch(({ message }) => ({ whyNot: message }));
            return `opened. ${document.getElementById("notes").textContent} ${whyNot || (first ? "" : states)}`;
          };
          return bad ?? (window.beadline.info && opened());
        }),
      );
      say(`${name.replace(/[^\w .-]/g, "?")}: ${said}`);
      if (name.startsWith("bad")) {
        assert.match(said, /^[A-Z].*[.!?]$/s, name);
      }
      await page.evaluate(() => document.getElementById("waiting").classList.remove("bad"));
    }
    assert.deepEqual(await elements(page), before);
    await page.over();

    const inside = await shared(page_);
    assert.match(await textOf(inside, "#tab"), /<script>.*<img src=x onerror=/s);
    assert.deepEqual((await elements(inside))[1], 0);
    await inside.over();

    const listed = await viewed(folder, { isEmpty: true });
    await listed.waitForSelector("#list tbody tr");
    await textUntil(listed, "#list", /<img src=x onerror=/);
    assert.deepEqual((await elements(listed))[1], 0);
    await listed.over();
  },

  /** A folder, and a sweep with recordings or without: a table with pictures; a click opens, back returns. */
  async folder(...sources) {
    for (const source of sources) {
      const page = await viewed(source, { isEmpty: true });
      await page.waitForSelector("#list tbody tr");
      const names = () => page.$$eval("#list tbody button", (all) => all.map((one) => one.textContent));
      const heads = await page.$$eval("#list thead tr > *", (all) => all.map((one) => one.textContent));
      const index = heads.findIndex((head) => head.endsWith("alpha"));
      const head = page.locator("#list thead tr > *").nth(index);
      const sorted = async (direction) => {
        await head.locator("button").click();
        assert.equal(await head.getAttribute("aria-sort"), direction);
        return page.$$eval("#list tbody tr", (all, at) => all.map((row) => Number(row.cells[at].textContent)), index);
      };
      const up = await sorted("ascending");
      assert.ok(up.length > 1 && up.every((value, i) => i === 0 || value >= up[i - 1]), `${up}`);
      assert.deepEqual(await sorted("descending"), up.toReversed());
      const swept = await page.evaluate(() => document.querySelector("#list th:nth-child(3)").textContent);
      assert.match(swept, source.endsWith("recordings") ? /./ : /^(alpha|impurities)/, `${heads}: what was swept stands first`);
      const plot = page.locator("#list canvas.comparison");
      await until("a plot of all runs", async () =>
        (await plot.getAttribute("aria-label"))?.includes(`: ${up.length} runs`),
      );
      await page.fill("#list input[type=search]", "alpha>1.7");
      const visible = () => page.$$eval("#list tbody tr", (rows) => rows.filter((row) => !row.hidden).length);
      assert.equal(await visible(), up.filter((value) => value > 1.7).length);
      await until("a plot of those", async () => (await plot.getAttribute("aria-label"))?.includes(`: ${await visible()} runs`));
      await page.fill("#list input[type=search]", "");
      await until("pictures", () =>
        page.$$eval("#list tbody canvas", (all) =>
          all.every((canvas) => {
            const copy = new OffscreenCanvas(144, 96).getContext("2d", { willReadFrequently: true });
            copy.drawImage(canvas, 0, 0);
            return copy.getImageData(0, 0, 144, 96).data.some((byte) => byte !== 0);
          }),
        ),
      );
      const [first, ...others] = await names();
      await page.locator("#list tbody button").first().click();
      await ready(page);
      assert.equal(await textOf(page, "#name"), first);
      const hash = await until("its name in the address", async () =>
        page.evaluate(() => /run=/.exec(location.hash)?.input),
      );
      await page.reload();
      await ready(page);
      assert.equal(await textOf(page, "#name"), first, `${hash} after a reload`);
      await page.click("#list-back");
      await page.waitForSelector("#list tbody tr");
      assert.equal((await names()).length, others.length + 1);
      say(`${path.basename(source)}: ${up.length} runs by ${heads[index]}`);
      await page.over();
      page.server.kill();
    }
  },

  /** The chain with one thing changed, beside the recording; its configuration gives what the page shows. */
  async change(file, ...changes) {
    for (const [what, value] of changes.map((words) => words.split("="))) {
      const page = await viewed(file);
      await page.keyboard.press("c");
      await page.selectOption("#change-what", { label: what });
      await page.fill("#change-value", value);
      await page.click('#tab button:text-is("Simulate beside it")');
      await page.waitForSelector("#second-panel:not([hidden])");
      // the panel is there before the chain is at its step, and only then is the tab drawn anew
      await page.waitForSelector("#tab pre");
      fs.writeFileSync("changed.toml", await textOf(page, "#tab pre"));
      await told("run", "changed.toml", "--out", "changed.mcap", "--force");
      const { info, last } = await page.evaluate(async () => {
        const { info, state } = window.beadline.changed;
        const { step, u, v } = await state(info.lastStep);
        return { info: { lastStep: info.lastStep }, last: { step, u: [...u], v: [...v] } };
      });
      await told("export", "changed.mcap", "--to", "csv", "--out", "changed.csv", "--force");
      const { count, numbers } = csv(fs.readFileSync("changed.csv"));
      const run = numbers(count - 1);
      assert.equal(run.step, info.lastStep, what);
      last.u.forEach((u, bead) => assert.equal(u, run[`u_${bead}_m`], `${what}: u of bead ${bead}`));
      last.v.forEach((v, bead) => assert.equal(v, run[`v_${bead}_m_s`], `${what}: v of bead ${bead}`));
      const { bytes: svg } = await exported(page, "SVG");
      const words = [...String(svg).matchAll(/>([^<>]+)<\/text>/g)].map(([, text]) => text).join("\n");
      assert.match(words, new RegExp(`^recorded: ${what} `, "m"), `the map above says which it is: ${words}`);
      assert.match(words, new RegExp(`^changed: ${what} \\d`, "m"), "and the map below");
      assert.match(words, new RegExp(`changed, dashed: ${what}: .*recorded`), "and the caption");
      const hash = await until("the change in the address", () =>
        page.evaluate(() => /change=/.exec(location.hash)?.input),
      );
      await page.reload();
      await ready(page);
      await page.waitForSelector("#second-panel:not([hidden])");
      say(`${what} ${value}: the last of ${info.lastStep} steps is equal; ${hash}`);
      await page.click('#tab button:text-is("Take back")');
      await page.waitForSelector("#second-panel", { state: "hidden" });
      await page.over();
      page.server.kill();
    }
  },

  /** Files of what is seen. */
  async exports(file) {
    const page = await viewed(file, { fragment: "#at=333&beads=20..60" });
    const { u, v } = await page.evaluate(async () => {
      const { u, v } = await window.beadline.state(333);
      return { u: [...u], v: [...v] };
    });
    const profile = csv((await exported(page, "CSV: profile")).bytes);
    assert.ok(profile.count >= 40 && profile.count <= 42);
    for (let line = 0; line < profile.count; line += 1) {
      const row = profile.numbers(line);
      assert.deepEqual([row.step, row.displacement_m, row.velocity_m_s], [333, u[row.bead], v[row.bead]]);
    }
    const { bytes: text } = await exported(page, "CSV: curves");
    assert.match(String(text), /^# \S+: beads 100 of 1 g; .*impurities bead 50 of 0.6 g; .*\n# .*step 333/);
    const curves = csv(text);
    const { lastStep } = await page.evaluate(() => window.beadline.info);
    assert.equal(curves.count, lastStep + 1, "every step");
    assert.ok([0, 1, 777, lastStep].every((step) => curves.numbers(step).step === step));
    for (const line of [0, curves.count >> 1, curves.count - 1]) {
      const row = curves.numbers(line);
      const [u50, v50] = await page.evaluate(async (step) => {
        const { u, v } = await window.beadline.state(step);
        return [u[50], v[50]];
      }, row.step);
      assert.deepEqual([row.u_50_m, row.v_50_m_s], [u50, v50]);
      const total = row.kinetic_J + row.potential_J;
      assert.ok(Math.abs(total - (row.left_J + row.split_bead_J + row.right_J)) < 1e-12 * total);
      assert.ok(Math.abs(total - 0.0125) < 1e-5, `${total} J of the striker's 12.5 mJ`);
    }
    const png = await exported(page, "PNG");
    assert.deepEqual([...png.bytes.subarray(0, 8)], [137, 80, 78, 71, 13, 10, 26, 10]);
    assert.match(png.name, /\.png$/);
    const svg = await exported(page, "SVG");
    const root = await page.evaluate((text) => {
      const parsed = new DOMParser().parseFromString(text, "image/svg+xml");
      return [parsed.documentElement.localName, parsed.querySelectorAll("parsererror, script").length];
    }, String(svg.bytes));
    assert.deepEqual(root, ["svg", 0]);
    const { run_id: id } = await page.evaluate(() => window.beadline.info.manifest.provenance);
    assert.ok(String(svg.bytes).includes(id), "the caption names the run");
    assert.match(String(svg.bytes), /impurities bead 50 of 0.6 g/);
    say(`png ${png.bytes.length} bytes, svg ${svg.bytes.length} bytes, ${curves.count} rows of curves`);
    await page.over();
  },

  /** Figures to be compared with what is promised: of a recording and of what it is shared as, or else in full. */
  async speed(whole, page_) {
    const files = { whole, page: page_ };
    if (whole === undefined) {
      files.whole = "speed.mcap";
      files.page = "speed.html";
      await told(..."run --preset light-impurity --out speed.mcap --force".split(" "));
      await told(..."share speed.mcap --out speed.html --force".split(" "));
    }
    const size = (file) => `${(fs.statSync(file).size / 1e6).toFixed(1)} MB`;
    const view = await viewed(files.whole);
    say(`a recording of ${size(files.whole)} is open after ${(view.openMs / 1e3).toFixed(2)} s`);
    const anyStep = async (page, what) => {
      await until("the map", () => page.evaluate(() => !document.querySelector("#map-panel.busy")));
      const times = await page.evaluate(async () => {
        const { lastStep } = window.beadline.info;
        const found = [];
        for (let i = 0; i < 100; i += 1) {
          const began = performance.now();
          await window.beadline.state(Math.floor(Math.random() * (lastStep + 1)));
          found.push(performance.now() - began);
        }
        return found;
      });
      say(`a random step of ${what}: median ${median(times).toFixed(1)} ms, most ${Math.max(...times).toFixed(1)} ms`);
    };
    await anyStep(view, "it");
    const proof = async (page, what) => {
      const [ms, { states, steps, first }] = await page.evaluate(async () => {
        const began = performance.now();
        const proof = await window.beadline.prove();
        return [performance.now() - began, proof];
      });
      assert.equal(first, undefined);
      say(`${what}: ${states} states, ${steps} steps proven in ${(ms / 1e3).toFixed(2)} s`);
    };
    await proof(view, "one to one");
    await view.over();
    view.server.kill();
    await told("thin", files.whole, "--every-steps", "100", "--out", "hundredth.mcap", "--force");
    const sparse = await viewed("hundredth.mcap");
    await anyStep(sparse, `a 1:100 log (${size("hundredth.mcap")})`);
    await sparse.over();
    sparse.server.kill();
    const page = await shared(files.page);
    say(`a shared file of ${size(files.page)} is open after ${(page.openMs / 1e3).toFixed(2)} s`);
    await proof(page, "shared");
    await page.over();
    if (whole === undefined) {
      await scenarios.rate("5", "4", "1000");
      await scenarios.rate("3", "4", "100000");
    }
  },
};

try {
  await scenarios[scenario](...rest);
} catch (error) {
  console.error(error.stack ?? error);
  process.exitCode = 1;
} finally {
  await cleanUp();
}

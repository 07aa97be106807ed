// The page in a browser: what it shows, recomputes and proves, and what it refuses. Called by tests/e2e/page.rs.
//
//     node tests/node/check_page.mjs BEADLINE SCENARIO ARGUMENTS...   # after tests/setup
//
// Exit code 0 if all is as it should be; 1 with what is not. What was measured is printed.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { pathToFileURL } from "node:url";

import { Recording } from "../../page/recording.js";

const require = createRequire(new URL("../../target/check/node/", import.meta.url));
const { chromium } = require("playwright-core");

const [beadline, scenario, ...rest] = process.argv.slice(2);
const cleanups = [];

/** `beadline` with these words; `url` is the first line that it prints. */
async function start(...words) {
  const child = spawn(beadline, words, { stdio: ["ignore", "pipe", "inherit"] });
  cleanups.push(() => child.kill());
  const url = await new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (data) => {
      text += data;
      if (text.includes("\n")) {
        resolve(text.split("\n")[0]);
      }
    });
    child.on("exit", (code) => reject(new Error(`beadline ${words.join(" ")} ended with ${code}`)));
  });
  return { child, url };
}

/** A page of a browser that must not ask anybody but `origin`, nor complain. */
async function openPage(url, { origin = "", isOffline = false, mayComplain = false, ...options } = {}) {
  const browser = await chromium.launch({
    executablePath: process.env.BEADLINE_CHECK_BROWSER ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--disable-dev-shm-usage"],
  });
  cleanups.push(() => browser.close());
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, acceptDownloads: true, ...options });
  await context.setOffline(isOffline);
  const page = await context.newPage();
  page.complaints = [];
  page.asked = [];
  const note = (request) => page.asked.push(request.url());
  page.on("request", note);
  page.on("websocket", note);
  page.on("pageerror", (error) => page.complaints.push(`error: ${error.message}`));
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && page.complaints.push(message.text()));
  page.on("dialog", (dialog) => page.complaints.push(`dialog: ${dialog.message()}`));
  page.over = async () => {
    if (!mayComplain) {
      assert.deepEqual(page.complaints, []);
    }
    const own = (asked) => asked.startsWith("blob:") || asked.startsWith("data:") || asked.startsWith(url.split("#")[0]);
    const strangers = page.asked.filter((asked) => !own(asked) && !(origin !== "" && asked.replace(/^ws/, "http").startsWith(origin)));
    assert.deepEqual(strangers, [], "the page asked somebody else");
    await browser.close();
  };
  const began = performance.now();
  await page.goto(url);
  if (options.isReady !== false) {
    page.info = await page.evaluate(() => window.beadline.ready.then(() => window.beadline.info));
    page.openMs = performance.now() - began;
  }
  return page;
}

const originOf = (url) => new URL(url).origin;

/** A file for the reader of the page. */
function bytesOf(file) {
  const handle = fs.openSync(file);
  return {
    size: fs.fstatSync(handle).size,
    async read(offset, length) {
      const bytes = new Uint8Array(length);
      assert.equal(fs.readSync(handle, bytes, 0, length, offset), length);
      return bytes;
    },
  };
}

/** A number made of every bit of u and v; the same text runs in the page and here. */
const MIX = `(arrays) => {
  let mixed = 0x811c9dc5;
  for (const array of arrays) {
    for (const word of new Uint32Array(array.buffer, array.byteOffset, 2 * array.length)) {
      mixed = Math.imul(mixed ^ word, 0x01000193) ^ (mixed >>> 15);
    }
  }
  return mixed;
}`;
const mix = eval(MIX);

/** Every state of the page has the bits of the expanded recording. */
async function sameStates(page, expanded) {
  const recording = await Recording.open(bytesOf(expanded));
  const [steps, expected] = [[], []];
  for await (const { step, u, v } of recording.states()) {
    steps.push(step);
    expected.push(mix([u, v]));
  }
  const found = await page.evaluate(
    async ([source, all]) => {
      const mixed = eval(source);
      const numbers = [];
      for (const step of all) {
        const state = await window.beadline.state(step);
        numbers.push(state.step === step ? mixed([state.u, state.v]) : undefined);
      }
      return numbers;
    },
    [MIX, steps],
  );
  steps.forEach((step, i) => assert.equal(found[i], expected[i], `the state of step ${step}`));
  return steps.length;
}

const median = (numbers) => numbers.sort((a, b) => a - b)[numbers.length >> 1];
const say = (text) => console.log(text);

const scenarios = {
  /** recordings and what `beadline expand` makes of them, in turns. */
  async states(...files) {
    for (let i = 0; i < files.length; i += 2) {
      const { child, url } = await start("view", files[i]);
      const page = await openPage(url, { origin: originOf(url), bypassCSP: true });
      const count = await sameStates(page, files[i + 1]);
      const proof = await page.evaluate(() => window.beadline.prove());
      assert.equal(proof.first, undefined);
      assert.ok(proof.states > 1, "nothing was compared");
      say(`${path.basename(files[i])}: ${count} states equal, ${proof.states} proven`);
      await page.over();
      child.kill();
    }
  },

  /** A shared file, the network cut, from the disk. */
  async shared(file, expanded) {
    const page = await openPage(pathToFileURL(file).href, { isOffline: true, bypassCSP: true });
    const count = await sameStates(page, expanded);
    const proof = await page.evaluate(() => window.beadline.prove());
    assert.equal(proof.first, undefined);
    say(`${count} states equal, ${proof.states} proven; open after ${page.openMs.toFixed(0)} ms`);
    await page.over();
  },

  /** A recording in which one value was changed, under checksums that hold. */
  async changed(file, step, bead) {
    const { url } = await start("view", file);
    const page = await openPage(url, { origin: originOf(url) });
    const { first } = await page.evaluate(() => window.beadline.prove());
    assert.deepEqual([first.step, first.bead], [Number(step), Number(bead)]);
    await page.over();
  },
};

try {
  await scenarios[scenario](...rest);
} catch (error) {
  console.error(error.stack ?? error);
  process.exitCode = 1;
} finally {
  for (const cleanup of cleanups.reverse()) {
    await cleanup();
  }
}

// A browser with pages in it that must not complain nor ask strangers, and `beadline` beside it.

import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { promisify } from "node:util";

import { Recording } from "../../page/recording.js";

const require = createRequire(new URL("../../target/check/node/", import.meta.url));
const { chromium } = require("playwright-core");

/** Nothing here takes this long unless it hangs (ms). */
const WATCHDOG = 60_000;
const beadline = process.argv[2];
const cleanups = [];

export const median = (numbers) => [...numbers].sort((a, b) => a - b)[numbers.length >> 1];
export const say = (text) => console.log(text);

/** Ends what was begun, the newest first. */
export async function cleanUp() {
  for (const cleanup of cleanups.reverse()) {
    await cleanup();
  }
}

/** What `beadline` with these words prints. */
export async function told(...words) {
  const { stdout } = await promisify(execFile)(beadline, words);
  return stdout;
}

/** Starts `beadline` with these words; `line` is the first line that it prints, `text` all of them at its end. */
export function start(...words) {
  const child = spawn(beadline, words, { stdio: ["ignore", "pipe", "ignore"] });
  cleanups.push(() => child.kill());
  let printed = "";
  const line = new Promise((done, failed) => {
    child.stdout.on("data", (data) => {
      printed += data;
      if (printed.includes("\n")) {
        done(printed.split("\n")[0]);
      }
    });
    child.on("close", (code) => failed(new Error(`beadline ${words.join(" ")} ended with ${code}`)));
  });
  line.catch(() => {}); // asked of those only that print a line
  const text = new Promise((done) => child.on("close", () => done(printed)));
  return { child, line, text };
}

/** Polls `look` until it gives something. */
export async function until(what, look) {
  const began = performance.now();
  for (;;) {
    const found = await look();
    if (found) {
      return found;
    }
    assert.ok(performance.now() - began < WATCHDOG, `${what}: waited in vain`);
    await new Promise((done) => setTimeout(done, 10));
  }
}

let browser;

/** A page at `url` that must not ask anybody else, nor complain; `isEmpty` if no run opens by itself. */
export async function openPage(url, { isOffline = false, isEmpty = false, ...options } = {}) {
  if (browser === undefined) {
    browser = await chromium.launch({
      executablePath: process.env.BEADLINE_CHECK_BROWSER ?? "/usr/bin/chromium",
      args: ["--no-sandbox", "--disable-dev-shm-usage"],
    });
    cleanups.push(() => browser.close());
  }
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, ...options });
  await context.setOffline(isOffline);
  const page = await context.newPage();
  const [complaints, asked] = [[], []];
  page.on("request", (request) => asked.push(request.url()));
  page.on("websocket", (socket) => asked.push(socket.url().replace(/^ws/, "http")));
  page.on("pageerror", (error) => complaints.push(`error: ${error.message}`));
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && complaints.push(message.text()));
  page.on("dialog", (dialog) => {
    complaints.push(`dialog: ${dialog.message()}`);
    dialog.dismiss();
  });
  const home = url.split("#")[0];
  page.over = async () => {
    assert.deepEqual(complaints, [], "the page complains");
    const strangers = asked.filter((address) => !["blob:", "data:", home].some((own) => address.startsWith(own)));
    assert.deepEqual(strangers, [], "the page asked somebody else");
    await context.close();
  };
  const began = performance.now();
  await page.goto(url);
  if (!isEmpty) {
    await ready(page);
    page.openMs = performance.now() - began;
  }
  return page;
}

/** A file, opened from the disk in Firefox, which another driver drives as it is. */
export async function openInFirefox(file) {
  const { default: puppeteer } = await import(require.resolve("puppeteer-core"));
  const firefox = await puppeteer.launch({
    browser: "firefox",
    executablePath: process.env.BEADLINE_CHECK_FIREFOX ?? "/usr/bin/firefox-esr",
  });
  cleanups.push(() => firefox.close());
  const page = await firefox.newPage();
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(`error: ${error.message}`));
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && complaints.push(message.text()));
  await page.goto(pathToFileURL(path.resolve(file)).href);
  const over = () => assert.deepEqual(complaints, [], "the page complains");
  return Object.assign(page, { over, version: await firefox.version() });
}

/** `beadline view` of a source, and a page of it. */
export async function viewed(source, { fragment = "", ...options } = {}) {
  const server = start("view", source);
  const url = await server.line;
  return Object.assign(await openPage(url + fragment, options), { server: server.child, home: url });
}

/** `beadline share` of a recording, opened from the disk without a network. */
export function shared(file, options) {
  return openPage(pathToFileURL(path.resolve(file)).href, { isOffline: true, ...options });
}

export const ready = (page) => page.evaluate(() => window.beadline.ready.then(({ kind }) => kind));
export const viewOf = (page) => page.evaluate(() => window.beadline.view);
export const textOf = (page, selector) => page.evaluate((css) => document.querySelector(css).textContent, selector);
export const textUntil = (page, selector, pattern) =>
  until(`${selector} with ${pattern}`, async () => pattern.exec(await textOf(page, selector)));

/** The bytes of what the page offers to save when something is done. */
export async function saved(page, doing) {
  const [download] = await Promise.all([page.waitForEvent("download"), doing()]);
  return { name: download.suggestedFilename(), bytes: fs.readFileSync(await download.path()) };
}

/** The bytes of one of the page's exports. */
export async function exported(page, button) {
  await page.click("#export");
  const file = await saved(page, () => page.click(`#dialog button:text-is("${button}")`));
  await page.keyboard.press("Escape");
  return file;
}

/** The columns of a table in CSV, and a function that gives the numbers of a line. */
export function csv(text) {
  const [head, ...lines] = String(text).trim().split("\n").filter((line) => !line.startsWith("#"));
  const columns = head.split(",");
  const numbers = (line) => Object.fromEntries(lines[line].split(",").map((cell, i) => [columns[i], Number(cell)]));
  return { columns, count: lines.length, numbers };
}

/** A file for the reader of the page. */
export function bytesOf(file) {
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

/** A number made of every bit of u and v; the same function runs in the page and here. */
function mix(arrays) {
  let mixed = 0x811c9dc5;
  for (const array of arrays) {
    for (const word of new Uint32Array(array.buffer, array.byteOffset, 2 * array.length)) {
      mixed = Math.imul(mixed ^ word, 0x01000193) ^ (mixed >>> 15);
    }
  }
  return mixed;
}

/** Every state of the page, up to a step, has the bits of the expanded recording; gives how many there are. */
export async function sameStates(page, expanded, lastStep = Infinity) {
  const recording = await Recording.open(bytesOf(expanded));
  const [steps, expected] = [[], []];
  for await (const { step, u, v } of recording.states()) {
    if (step <= lastStep) {
      steps.push(step);
      expected.push(mix([u, v]));
    }
  }
  // by the protocol of the browser: the policy of the page allows no eval
  await page.evaluate(`globalThis.mix = ${mix}`);
  const found = await page.evaluate(async (all) => {
    const numbers = [];
    for (const step of all) {
      const state = await window.beadline.state(step);
      numbers.push(state.step === step ? globalThis.mix([state.u, state.v]) : undefined);
    }
    return numbers;
  }, steps);
  steps.forEach((step, i) => assert.equal(found[i], expected[i], `the state of step ${step}`));
  return steps.length;
}

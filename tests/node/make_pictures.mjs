// Makes the pictures of the page that README and guide show.
//
//     node tests/node/make_pictures.mjs BEADLINE docs/img/watch    # after tests/setup

import { execFileSync, spawn } from "node:child_process";
import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { pathToFileURL } from "node:url";

const { chromium } = createRequire(new URL("../../target/check/node/", import.meta.url))("playwright-core");

const [beadline, out] = process.argv.slice(2).map((word) => path.resolve(word));
const place = fs.mkdtempSync(path.join(os.tmpdir(), "bl"));
process.env.BEADLINE_ROOT = path.join(place, "bus");
const run = (...words) => execFileSync(beadline, words, { cwd: place, stdio: "ignore" });

/** `beadline view` of something, and its address. */
async function view(...words) {
  const child = spawn(beadline, ["view", ...words], { cwd: place, stdio: ["ignore", "pipe", "ignore"] });
  const [line] = await new Promise((resolve) => child.stdout.once("data", (data) => resolve(String(data).split("\n"))));
  return { child, url: line };
}

const WIDE = { viewport: { width: 1280, height: 800 } };
const PHONE = { viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true };

const browser = await chromium.launch({
  executablePath: process.env.BEADLINE_CHECK_BROWSER ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});

/** A picture of what is at an address once `act` is done and nothing is computed any more. */
async function picture(name, url, { options = WIDE, colorScheme = "light", act = async () => {} } = {}) {
  const context = await browser.newContext({ ...options, colorScheme });
  const page = await context.newPage();
  await page.goto(url);
  await act(page);
  await page.waitForTimeout(4000);
  await page.waitForFunction(() => !document.querySelector(".busy"), undefined, { timeout: 120_000 });
  await page.waitForTimeout(500);
  await page.screenshot({ path: path.join(out, `${name}.png`) });
  await context.close();
}

run("run", "--preset", "light-impurity");
run("share", "light-impurity.mcap");
const shared = pathToFileURL(path.join(place, "light-impurity.html")).href;
await picture("page", `${shared}#at=45000`);
await picture("collision", `${shared}#beads=480..520&steps=29400..31000&at=30100`, { colorScheme: "dark" });
await picture("phone", `${shared}#field=energy&at=45000`, { options: PHONE });
await picture("changed", `${shared}#tab=change&at=45000`, {
  act: async (page) => {
    await page.getByRole("button", { name: "Simulate beside it" }).waitFor();
    const mass = page.locator("[role=tabpanel] input").first();
    await mass.fill("0.002");
    await page.waitForTimeout(4000);
    await mass.press("Enter");
    await page.waitForTimeout(6000);
  },
});

run("run", "--preset", "light-impurity", "--impurity", "500=0.9e-3", "--name", "heavier", "--out", "heavier.mcap");
const pair = await view("light-impurity.mcap", "heavier.mcap");
await picture("pair", `${pair.url}#at=45000&tab=compare`);
pair.child.kill();

fs.mkdirSync(path.join(place, "runs"));
for (const preset of ["dimer", "precompressed", "striker-10g", "tapered", "walls"]) {
  run("run", "--preset", preset, "--record-every-steps", "50", "--out", `runs/${preset}.mcap`);
}
const folder = await view("runs");
await picture("folder", folder.url);
folder.child.kill();

const live = spawn(beadline, ["run", "--preset", "heavy-impurity", "--no-record", "--pace", "0.003"], { cwd: place, stdio: "ignore" });
const watched = await view("live:heavy-impurity");
await picture("live", `${watched.url}#tab=live`, {
  colorScheme: "dark",
  act: async (page) => {
    await page.waitForFunction(() => window.beadline?.info?.lastStep > 36_000);
  },
});
watched.child.kill();
live.kill();
await browser.close();
fs.rmSync(place, { recursive: true });

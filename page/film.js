// A film of the view while the cursor goes through the time in view: a video, or a series of pictures.

import { captionOf } from "./caption.js";
import { byId, make, save } from "./elements.js";
import { CanvasSurface } from "./surface.js";
import { webmOf } from "./webm.js";
import { zipOf } from "./zip.js";

/** @typedef {import("./page.js").Page} Page */

const PER_SECOND = 25;
const FRAME_MS = 1000 / PER_SECOND;
/** Pictures of a film: two minutes. */
const MOST_FRAMES = 3000;
const BITS_PER_S = 6e6;
/** From a picture that stands for itself to the next one, so that one can go to any place of the film. */
const KEY_EVERY = 2 * PER_SECOND;
const QUEUE = 10;
/** The codecs by their names in the browser and in the file, the preferred one first. */
const CODECS = [
  ["vp09.00.40.08", "V_VP9"],
  ["vp8", "V_VP8"],
];

/**
 * The steps of a film's pictures: through a window at the pace of the line of time, the last step at the end.
 * @param {[number, number]} window
 * @param {number} perFrame steps from a picture to the next one
 */
export function filmSteps([first, last], perFrame) {
  const count = Math.max(1, Math.ceil((last - first) / perFrame - 1e-9));
  return Array.from({ length: count + 1 }, (_, i) => Math.min(Math.round(first + i * perFrame), last));
}

/** The steps of a film of this page. @param {Page} page */
function stepsOf(page) {
  const { steps } = page.window();
  const run = /** @type {import("./run.js").Run} */ (page.run);
  return filmSteps([run.clamp(steps[0]), run.clamp(steps[1])], page.timeline.stepsIn(1 / PER_SECOND));
}

/**
 * Draws all panels at each step, one after the other, and waits for `take` of each.
 * @param {Page} page
 * @param {number[]} steps
 * @param {number} ratio pixels to each pixel of the page
 * @param {(canvas: HTMLCanvasElement) => Promise<void>} take
 * @param {(part: number) => boolean} goesOn told how much is done
 */
async function roll(page, steps, ratio, take, goesOn) {
  const canvas = document.createElement("canvas");
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const { step: before } = page.view;
  for (const [i, step] of steps.entries()) {
    if (!goesOn(i / steps.length)) {
      break;
    }
    await page.seek(step);
    page.board.compose((width, height) => {
      if (i === 0) {
        // all pictures have the size of the first one; some encoders want it even
        [canvas.width, canvas.height] = [width, height].map((size) => 2 * Math.ceil((size * ratio) / 2));
      }
      return new CanvasSurface(context, width, height, ratio);
    }, captionOf(page));
    await take(canvas);
  }
  page.look({ step: before });
  if (before !== undefined) {
    await page.seek(before);
  }
}

/** The encoder's settings that this browser has, for pictures of this size. @param {number} width @param {number} height */
async function codecFor(width, height) {
  for (const [codec, name] of CODECS) {
    const config = { codec, width, height, bitrate: BITS_PER_S, framerate: PER_SECOND };
    const { supported } = await VideoEncoder.isConfigSupported(config).catch(() => ({ supported: false }));
    if (supported) {
      return { config, name };
    }
  }
  throw new Error("this browser encodes no video of this size; take the PNG series.");
}

/**
 * A video in WebM, encoded by the browser, whose pace does not depend on how fast that is.
 * @param {Page} page
 * @param {(part: number) => boolean} goesOn
 * @returns {Promise<Blob>}
 */
async function video(page, goesOn) {
  /** @type {import("./webm.js").Picture[]} */
  const pictures = [];
  /** @type {VideoEncoder | undefined} */
  let encoder;
  /** @type {Error | undefined} */
  let wrong;
  let [codec, width, height, count] = ["", 0, 0, 0];
  const take = async (/** @type {HTMLCanvasElement} */ canvas) => {
    if (encoder === undefined) {
      [width, height] = [canvas.width, canvas.height];
      const { config, name } = await codecFor(width, height);
      codec = name;
      encoder = new VideoEncoder({
        output: (chunk) => {
          const bytes = new Uint8Array(chunk.byteLength);
          chunk.copyTo(bytes);
          pictures.push({ bytes, isKey: chunk.type === "key" });
        },
        error: (error) => {
          wrong = error;
        },
      });
      encoder.configure(config);
    }
    const frame = new VideoFrame(canvas, { timestamp: count * FRAME_MS * 1000, duration: FRAME_MS * 1000 });
    encoder.encode(frame, { keyFrame: count % KEY_EVERY === 0 });
    frame.close();
    count += 1;
    if (count % QUEUE === 0) {
      await encoder.flush(); // so that few pictures wait in memory
    }
    if (wrong) {
      throw wrong;
    }
  };
  await roll(page, stepsOf(page), 1, take, goesOn);
  await encoder?.flush();
  encoder?.close();
  const parts = webmOf(pictures, { codec, width, height, pictureMs: FRAME_MS });
  return new Blob(/** @type {any[]} */ (parts), { type: "video/webm" });
}

/**
 * Pictures as PNG in a ZIP file, numbered from 1 on.
 * @param {Page} page
 * @param {(part: number) => boolean} goesOn
 * @param {string} name
 */
async function series(page, goesOn, name) {
  /** @type {{ name: string, bytes: Uint8Array }[]} */
  const files = [];
  await roll(
    page,
    stepsOf(page),
    2,
    async (canvas) => {
      const blob = await new Promise((/** @type {(blob: Blob | null) => void} */ done) => canvas.toBlob(done));
      if (blob) {
        const number = String(files.length + 1).padStart(4, "0");
        files.push({ name: `${name}-${number}.png`, bytes: new Uint8Array(await blob.arrayBuffer()) });
      }
    },
    goesOn,
  );
  return new Blob(/** @type {any[]} */ (zipOf(files)), { type: "application/zip" });
}

/** The course and length of a film, in words. @param {Page} page */
export function filmWords(page) {
  const count = stepsOf(page).length;
  const words = `the cursor goes through the time in view at the pace of the line of time: ${count} pictures, ${(count / PER_SECOND).toFixed(1)} s`;
  if (typeof VideoEncoder !== "function") {
    return "this browser encodes no video here; take the PNG series";
  }
  return count > MOST_FRAMES ? `${words}; at most ${MOST_FRAMES}: choose a faster pace, or zoom in` : words;
}

/** True if there is a film of a kind: one that is not too long, and that the browser encodes. @param {Page} page @param {"webm" | "png"} kind */
export function hasFilm(page, kind) {
  return stepsOf(page).length <= MOST_FRAMES && (kind === "png" || typeof VideoEncoder === "function");
}

/**
 * Makes a film, with its progress in the dialog; closing that stops it, and then there is no file.
 * @param {Page} page
 * @param {"webm" | "png"} kind
 * @param {string} name of the file, without its ending
 */
export async function makeFilm(page, kind, name) {
  const dialog = /** @type {HTMLDialogElement} */ (byId("dialog"));
  const bar = make("progress", { max: 1, value: 0, "aria-label": "progress" });
  const stop = make("button", { onclick: () => dialog.close() }, "Stop");
  page.timeline.pause();
  page.dialog("Making the film", make("div", { class: "row" }, bar, stop));
  const run = page.run;
  const goesOn = (/** @type {number} */ part) => {
    bar.value = part;
    return dialog.open && bar.isConnected && page.run === run;
  };
  try {
    const blob = await (kind === "webm" ? video(page, goesOn) : series(page, goesOn, name));
    if (goesOn(1)) {
      save(kind === "webm" ? `${name}.webm` : `${name}-png.zip`, blob);
      dialog.close();
    }
  } catch (error) {
    dialog.close();
    page.note(`No film was made: ${error instanceof Error ? error.message : error}`);
  }
}

// Sources of runs: the runs that the page carries, those of its server, a file that was chosen or dropped.

import { shown } from "./elements.js";

/** @typedef {import("./types.d.ts").Source} Source */
/** @typedef {import("./types.d.ts").Entry} Entry */
/** @typedef {import("./types.d.ts").Listing} Listing */
/** @typedef {import("./types.d.ts").Results} Results */

const PIECE = 1 << 20; // a multiple of 4: base64 is decoded so many characters at a time

/**
 * Kind of the page: `kind` is "server", "embedded" or "empty".
 * @returns {{ kind: string, title: string }}
 */
export function carried() {
  const said = JSON.parse(document.getElementById("carried")?.textContent || "{}");
  return { kind: said.kind ?? "empty", title: shown(said.title ?? "") };
}

/**
 * The bytes of a gzipped text in base64 that the page carries; undefined if it does not.
 * @param {string} id
 * @returns {Promise<Uint8Array | undefined>}
 */
async function unpacked(id) {
  const text = document.getElementById(id)?.textContent?.trim();
  if (!text) {
    return undefined;
  }
  let at = 0;
  const pieces = new ReadableStream({
    pull(controller) {
      if (at >= text.length) {
        controller.close();
        return;
      }
      const characters = atob(text.slice(at, at + PIECE));
      controller.enqueue(Uint8Array.from(characters, (character) => character.charCodeAt(0)));
      at += PIECE;
    },
  });
  const stream = pieces.pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The recording inside. @returns {Promise<Source>} */
export async function carriedRecording() {
  const bytes = await unpacked("recording").catch(() => {
    throw new Error("The recording inside this page is damaged: part of the file may be missing. Get it again.");
  });
  if (!bytes) {
    throw new Error("There is no recording inside this page. Drop one here.");
  }
  return { kind: "bytes", bytes };
}

/** The results inside, if there are any. @returns {Promise<Results | undefined>} */
export async function carriedResults() {
  try {
    const bytes = await unpacked("results");
    return bytes && JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    return undefined; // the recording is there without them
  }
}

/**
 * The server's answer.
 * @param {string} url
 */
async function answer(url) {
  let response;
  try {
    response = await fetch(url, { headers: { Accept: "application/json" } });
  } catch {
    throw new Error("The server of this page does not answer: `beadline view` has ended. Start it again.");
  }
  if (!response.ok) {
    const said = await response.json().catch(() => ({}));
    throw new Error(String(said.error ?? `The server does not give ${url}: ${response.status}.`));
  }
  return response.json();
}

/** @returns {Promise<Listing>} */
export async function listing() {
  const list = await answer("list");
  // what is not there may be null in JSON
  const entryOf = (/** @type {any} */ entry) =>
    Object.fromEntries(Object.entries(entry).filter(([, value]) => value !== null));
  return { ...list, entries: list.entries.map(entryOf) };
}

/**
 * @param {Entry} entry
 * @returns {Promise<Results | undefined>}
 */
export async function resultsOf(entry) {
  return entry.results === undefined ? undefined : answer(entry.results);
}

/**
 * The source of an entry.
 * @param {Entry} entry
 * @returns {Promise<Source>}
 */
export async function sourceOf({ error, kind, url, values }) {
  if (error !== undefined) {
    throw new Error(error);
  }
  if (kind === "start") {
    const { manifest, chain } = await answer(url);
    // a point is computed as far as its row says that it went
    return { kind, manifest, chain, lastStep: typeof values.steps === "number" ? values.steps : undefined };
  }
  return { kind: kind === "live" ? "live" : "url", url };
}

/**
 * Calls with each file that is dropped anywhere on the page.
 * @param {(file: File) => void} onfile
 */
export function watchDrops(onfile) {
  const body = document.body;
  addEventListener("dragover", (event) => {
    event.preventDefault(); // or the browser would leave the page for the file
    body.classList.add("dropping");
  });
  addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) {
      body.classList.remove("dropping");
    }
  });
  addEventListener("drop", (event) => {
    event.preventDefault();
    body.classList.remove("dropping");
    const file = event.dataTransfer?.files[0];
    if (file) {
      onfile(file);
    }
  });
}

/**
 * Lets the user choose a file.
 * @param {(file: File) => void} onfile
 */
export function chooseFile(onfile) {
  const input = document.createElement("input");
  input.type = "file";
  input.accept = ".mcap,.partial";
  input.addEventListener("change", () => input.files?.[0] && onfile(input.files[0]));
  input.click();
}

/** Makes workers: their text is the page's own. */
export function workerMaker() {
  const text = document.getElementById("code")?.textContent ?? "";
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  return () => new Worker(url);
}

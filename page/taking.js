// The recording that a page has as a file: out of a shared page as it is carried, from the server as it is.

import { carriedRecording } from "./carried.js";
import { make, save } from "./elements.js";

/** @typedef {import("./types.d.ts").Source} Source */

/**
 * The recording of a source as a file; undefined for runs that have none, and for files that are here anyway.
 * @param {Source | undefined} source
 * @param {import("./types.d.ts").Info} info
 */
export function fileWords(source, { storedCount, recomputes, manifest }) {
  if (source?.kind === "url") {
    return "the recording itself, byte for byte";
  }
  if (source?.kind !== "bytes") {
    return undefined;
  }
  const { step_count: steps } = manifest.physics;
  const isThinned = storedCount < steps + 1;
  const between = recomputes ? "; `beadline expand` recomputes all others" : "";
  return `the recording as this file carries it, with ${storedCount} states${isThinned ? between : ""}`;
}

/**
 * Saves the recording of a source.
 * @param {Source} source
 * @param {string} name of the file, without its ending
 */
export async function takeRecording(source, name) {
  if (source.kind === "url") {
    make("a", { href: source.url, download: `${name}.mcap` }).click();
    return;
  }
  // read again rather than kept: a worker has its own
  const inside = await carriedRecording();
  if (inside.kind === "bytes") {
    save(`${name}.mcap`, new Blob([/** @type {any} */ (inside.bytes)], { type: "application/octet-stream" }));
  }
}

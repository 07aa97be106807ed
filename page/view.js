// The view: all of it stands in the fragment of the page's address, so that a link shows the same view.

/** @typedef {import("./types.d.ts").Field} Field */
/** @typedef {import("./types.d.ts").Info} Info */

/**
 * `run` is an entry of the server's list. `places` are beads, `steps` steps, both of real numbers; undefined is all of
 * them. `step` is the cursor; undefined follows a live run. `beads`: those that are followed besides the impurity,
 * `bead` the chosen one. `colours` are the numbers at the ends of the colours; undefined takes those of what is seen.
 * `ruler` lies from a bead and a step to another bead and step.
 * @typedef {object} View
 * @property {string} run
 * @property {Field} field
 * @property {boolean} log
 * @property {[number, number] | undefined} colours
 * @property {import("./ruler.js").Ruler | undefined} ruler
 * @property {string} theme "", "light" or "dark"
 * @property {[number, number] | undefined} places
 * @property {[number, number] | undefined} steps
 * @property {number | undefined} step
 * @property {number | undefined} bead
 * @property {number[]} beads
 * @property {string} tab
 * @property {string} speed
 * @property {string} change
 * @property {string} other entry that is compared
 * @property {boolean} difference
 * @property {boolean} digits whether numbers are read out with all of their digits
 */

/** @type {[Field, string][]} */
export const FIELDS = [
  ["velocity", "velocity"],
  ["displacement", "displacement"],
  ["overlap", "overlap from rest"],
  ["energy", "energy density"],
  ["contacts", "contacts"],
  ["force", "force from rest"],
];

export const TABS = ["run", "pulses", "events", "notes", "live", "change", "compare", "spectrum"];

/** Least numbers of steps and places in a window. */
export const LEAST_STEPS = 4;
export const LEAST_PLACES = 2;

/** @returns {View} */
export function freshView() {
  return {
    run: "",
    field: "velocity",
    log: true,
    colours: undefined,
    ruler: undefined,
    theme: "",
    places: undefined,
    steps: undefined,
    step: undefined,
    bead: undefined,
    beads: [],
    tab: "run",
    speed: "",
    change: "",
    other: "",
    difference: false,
    digits: false,
  };
}

/** @param {string | null} text */
function range(text) {
  const ends = (text ?? "").split("..").map(Number);
  const isRange = ends.length === 2 && ends.every(Number.isFinite) && ends[0] < ends[1];
  return isRange ? /** @type {[number, number]} */ ([ends[0], ends[1]]) : undefined;
}

/** A range of colours, which 0 is in. @param {string | null} text */
function colours(text) {
  const ends = range(text);
  return ends && ends[0] <= 0 && ends[1] >= 0 ? ends : undefined;
}

/** @param {string | null} text @returns {import("./ruler.js").Ruler | undefined} */
function rulerOf(text) {
  const numbers = (text ?? "").split(",").map(Number);
  return text && numbers.length === 4 && numbers.every(Number.isFinite)
    ? [numbers[0], numbers[1], numbers[2], numbers[3]]
    : undefined;
}

/** @param {string | null} text */
function whole(text) {
  return text && /^\d{1,15}$/.test(text) ? Number(text) : undefined;
}

/**
 * View of a fragment; values that are missing or wrong are those of a fresh view.
 * @param {string} fragment
 * @returns {View}
 */
export function readView(fragment) {
  const view = freshView();
  const parts = new URLSearchParams(fragment.replace(/^#/, ""));
  const field = FIELDS.find(([name]) => name === parts.get("field"));
  const theme = parts.get("theme") ?? "";
  const tab = parts.get("tab") ?? "";
  return {
    ...view,
    run: parts.get("run") ?? "",
    field: field ? field[0] : view.field,
    log: parts.get("log") !== "0",
    colours: colours(parts.get("colours")),
    ruler: rulerOf(parts.get("ruler")),
    theme: theme === "light" || theme === "dark" ? theme : "",
    places: range(parts.get("beads")),
    steps: range(parts.get("steps")),
    step: whole(parts.get("at")),
    bead: whole(parts.get("bead")),
    beads: (parts.get("follow") ?? "")
      .split(",")
      .map(whole)
      .filter((bead) => bead !== undefined)
      .slice(0, 4),
    tab: TABS.includes(tab) ? tab : view.tab,
    speed: parts.get("speed") ?? "",
    change: parts.get("change") ?? "",
    other: parts.get("with") ?? "",
    difference: parts.get("difference") === "1",
    digits: parts.get("digits") === "all",
  };
}

/**
 * The fragment of a view.
 * @param {View} view
 */
export function writeView(view) {
  const fresh = freshView();
  /** @param {[number, number] | undefined} ends */
  const span = (ends) => (ends ? ends.map((end) => Number(end.toFixed(3))).join("..") : "");
  const parts = {
    run: view.run,
    field: view.field === fresh.field ? "" : view.field,
    log: view.log ? "" : "0",
    colours: view.colours?.join("..") ?? "",
    ruler: view.ruler?.map((number) => Number(number.toFixed(3))).join(",") ?? "",
    theme: view.theme,
    beads: span(view.places),
    steps: span(view.steps),
    at: view.step === undefined ? "" : `${view.step}`,
    bead: view.bead === undefined ? "" : `${view.bead}`,
    follow: view.beads.join(","),
    tab: view.tab === fresh.tab ? "" : view.tab,
    speed: view.speed,
    change: view.change,
    with: view.other,
    difference: view.difference ? "1" : "",
    digits: view.digits ? "all" : "",
  };
  return Object.entries(parts)
    .filter(([, value]) => value)
    .map(([key, value]) => `${key}=${encodeURIComponent(value).replace(/%2C/g, ",")}`)
    .join("&");
}

/**
 * A window moved and stretched so that it lies within limits and is no narrower than `least`; undefined if it is all.
 * @param {[number, number]} window
 * @param {[number, number]} limits
 * @param {number} least
 * @returns {[number, number] | undefined}
 */
export function within([from, to], [first, last], least) {
  const width = Math.max(to - from, Math.min(least, last - first));
  if (width >= (last - first) * (1 - 1e-9)) {
    return undefined;
  }
  const middle = (from + to) / 2;
  const start = Math.min(Math.max(middle - width / 2, first), last - width);
  return [start, start + width];
}

// A folder of recordings, a sweep, live runs: a table with a picture of each, sorted by whatever differs.

import { comparison, passes, title, unclear } from "./compare.js";
import { make } from "./elements.js";

/** @typedef {import("./types.d.ts").Entry} Entry */

/**
 * Comparable values of an entry: paths of physics and columns of results, with numbers or short texts as values.
 * @param {Entry} entry
 * @returns {Record<string, number | string>}
 */
function traits({ manifest, values, bytes }) {
  /** @type {Record<string, number | string>} */
  const found = {};
  const visit = (/** @type {unknown} */ value, /** @type {string} */ path) => {
    if (typeof value === "number" || typeof value === "string") {
      found[path] = value;
    } else if (typeof value === "object" && value !== null && !(Array.isArray(value) && value.length > 4)) {
      Object.entries(value).forEach(([key, part]) => visit(part, path ? `${path}.${key}` : key));
    }
  };
  visit(manifest?.physics ?? {}, "");
  visit(values, "");
  if (bytes !== undefined) {
    found.bytes = bytes;
  }
  return found;
}

/** A number to be read in a table, of five digits. @param {number} value */
function short(value) {
  const size = Math.abs(value);
  if (Number.isInteger(value)) {
    return `${value}`;
  }
  return size < 1e-3 ? Number(value.toPrecision(5)).toExponential() : `${Number(value.toPrecision(5))}`;
}

/**
 * @param {number | string | undefined} a
 * @param {number | string | undefined} b
 * @param {number} direction 1 or −1
 */
function order(a, b, direction) {
  if (a === undefined || b === undefined) {
    return Number(a === undefined) - Number(b === undefined); // what is not known comes last
  }
  const isNumber = typeof a === "number" && typeof b === "number";
  return direction * (isNumber ? a - b : String(a).localeCompare(String(b), undefined, { numeric: true }));
}

/** Columns that are left out first where there is no room. */
const isMinor = (/** @type {string} */ name) => /uncertainty|sha256/.test(name);
/** Columns of a table. */
const MOST_COLUMNS = 24;
/** Rows that are there at once: each has a picture, and a tab does not bear 10,000 of them. */
const MOST_ROWS = 500;

/**
 * The table under a plot of any two columns; what was swept stands first. `paint` draws a picture of an entry when it comes
 * into sight, one after the other.
 * @param {Entry[]} entries
 * @param {{ keys: string[], isDark: () => boolean, more: number }} look what was swept, and how many entries are not listed
 * @param {(entry: Entry) => void} onopen
 * @param {(entry: Entry, canvas: HTMLCanvasElement) => Promise<void>} paint
 */
export function folderTable(entries, { keys, isDark, more }, onopen, paint) {
  const rows = entries.map((entry) => ({ entry, traits: traits(entry) }));
  const names = [...new Set(rows.flatMap((row) => Object.keys(row.traits)))];
  const shown = rows.filter(({ entry }) => entry.error === undefined);
  const differing = names.filter((name) => new Set(shown.map((row) => row.traits[name])).size > 1);
  const swept = keys.filter((key) => names.includes(key));
  const others = differing.filter((name) => !swept.includes(name));
  others.sort((a, b) => Number(isMinor(a)) - Number(isMinor(b)));
  const known = [...swept, ...others];
  const columns = (known.length > 0 ? known : ["beads", "step_count"]).slice(0, MOST_COLUMNS);
  let sortedBy = "";
  let direction = 1;

  /** @type {[Entry, HTMLCanvasElement][]} */
  const toPaint = [];
  let isPainting = false;
  const paintAll = async () => {
    if (isPainting) {
      return;
    }
    isPainting = true;
    for (let next = toPaint.shift(); next; next = toPaint.shift()) {
      const [entry, canvas] = next;
      if (canvas.isConnected) {
        await paint(entry, canvas).catch(() => canvas.classList.add("blank"));
      } else {
        sight.observe(canvas); // its row was filtered out, and may come back
      }
    }
    isPainting = false;
  };
  const byId = new Map(entries.map((entry) => [entry.id, entry]));
  const sight = new IntersectionObserver((seen) => {
    for (const { target, isIntersecting } of seen) {
      const entry = isIntersecting && byId.get(/** @type {HTMLElement} */ (target).dataset.id ?? "");
      if (entry) {
        sight.unobserve(target);
        toPaint.push([entry, /** @type {HTMLCanvasElement} */ (target)]);
      }
    }
    paintAll();
  });

  /** @type {Map<typeof rows[0], HTMLElement>} */
  const lines = new Map();
  /** The line of a row, made when it is first shown. @param {typeof rows[0]} row */
  const lineOf = (row) => {
    const known = lines.get(row);
    if (known !== undefined) {
      return known;
    }
    const { entry } = row;
    const canvas = make("canvas", { width: 144, height: 96, "data-id": entry.id, "aria-hidden": "true" });
    const name =
      entry.error === undefined
        ? make("button", { class: "link", onclick: () => onopen(entry) }, entry.name)
        : make("span", {}, entry.name);
    const damage = entry.damage === undefined ? [] : [make("div", { class: "bad" }, entry.damage)];
    const cells =
      entry.error === undefined
        ? columns.map((column) => {
            const value = row.traits[column];
            const words = `${value ?? ""}`;
            const cut = words.length > 24 ? `${words.slice(0, 12)} …` : words;
            const text = typeof value === "number" ? short(value) : cut;
            return make("td", { class: typeof value === "number" ? "number" : undefined, title: value }, text);
          })
        : [make("td", { class: "bad", colspan: columns.length }, entry.error)];
    const line = make("tr", {}, make("td", {}, canvas), make("td", {}, name, ...damage), ...cells);
    if (entry.error === undefined) {
      line.addEventListener("click", (event) => {
        if (!(/** @type {HTMLElement} */ (event.target).closest("button"))) {
          onopen(entry);
        }
      });
      sight.observe(canvas);
    } else {
      canvas.classList.add("blank");
    }
    lines.set(row, line);
    return line;
  };
  const body = make("tbody");
  const rest = make("p", { class: "words" });
  const heads = ["name", ...columns].map((column) => {
    const head = make("th", { scope: "col" });
    head.append(
      make(
        "button",
        {
          class: "link",
          onclick: () => {
            direction = sortedBy === column ? -direction : 1;
            sortedBy = column;
            const value = (/** @type {typeof rows[0]} */ row) =>
              column === "name" ? row.entry.name : row.traits[column];
            rows.sort((a, b) => order(value(a), value(b), direction));
            look();
            heads.forEach((other) => other.removeAttribute("aria-sort"));
            head.setAttribute("aria-sort", direction > 0 ? "ascending" : "descending");
          },
        },
        title(column),
      ),
    );
    return head;
  });
  const table = make("table", { "aria-label": "runs" }, make("thead", {}, make("tr", {}, make("td"), ...heads)), body);
  const numbers = known.filter((name) => shown.some((row) => typeof row.traits[name] === "number"));
  const plot = numbers.length > 1 && shown.length > 1 ? comparison(numbers, swept, isDark) : undefined;
  const filter = make("input", {
    type: "search",
    placeholder: "filter: a word, or alpha>=1.5",
    "aria-label": "filter: words, and comparisons such as alpha>=1.5",
  });
  const look = () => {
    const all = rows.map((row) => ({ ...row, row, name: row.entry.name, open: () => onopen(row.entry) }));
    const looked = all.filter((one) => passes(filter.value, one, names));
    body.replaceChildren(...looked.slice(0, MOST_ROWS).map(({ row }) => lineOf(row)));
    const left = [
      unclear(filter.value, names),
      looked.length > MOST_ROWS ? `${looked.length - MOST_ROWS} more rows: filter, or sort by another column.` : "",
      known.length > columns.length ? `${known.length - columns.length} more columns have no room here: a filter can name them.` : "",
      more > 0 ? `${more} more files are here, which are not listed: view a part of them by their names.` : "",
    ];
    rest.textContent = left.filter(Boolean).join(" ");
    plot?.show(looked.filter(({ entry }) => entry.error === undefined));
  };
  filter.addEventListener("input", look);
  look();
  const tools = rows.length > 1 ? [make("div", { class: "row" }, filter)] : [];
  return make("div", {}, ...(plot ? [plot.element] : []), ...tools, table, rest);
}

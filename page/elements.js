// Elements of the document. Text is always text: nothing here reads markup.

/** Longest text that is shown (bytes), as in schemas/src/text.rs. */
const MAX_TEXT_BYTES = 1 << 16;

/** Room for the note about its length, so that a text is cut once. */
const LENGTH_BYTES = 40;

/** A text as it is shown: of a long one its beginning and its length. @param {string} text */
export function shown(text) {
  if (3 * text.length <= MAX_TEXT_BYTES) {
    return text;
  }
  const bytes = new TextEncoder().encode(text);
  // a character that is cut in two is no character
  const kept = new TextDecoder().decode(bytes.subarray(0, MAX_TEXT_BYTES - LENGTH_BYTES)).replace(/\uFFFD$/, "");
  return bytes.length <= MAX_TEXT_BYTES ? text : `${kept}… (${bytes.length.toLocaleString("en")} bytes)`;
}

/**
 * An element with attributes, listeners (keys that begin with "on") and children.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, any>} [attributes]
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) {
      element.addEventListener(name.slice(2), value);
    } else if (value === true) {
      element.setAttribute(name, "");
    } else if (value !== undefined && value !== false) {
      element.setAttribute(name, shown(String(value)));
    }
  }
  element.append(...children.map((child) => (typeof child === "string" ? shown(child) : child)));
  return element;
}

/**
 * The element with this id, which the page has.
 * @param {string} id
 * @returns {HTMLElement}
 */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) {
    throw new Error(`the page has no #${id}`);
  }
  return element;
}

/**
 * A table: the first row is its head. Cells are texts or nodes; numbers stand at the right.
 * @param {string} label
 * @param {string[]} head
 * @param {(string | number | Node)[][]} rows
 * @param {(row: number) => void} [onchoose] makes rows buttons
 */
export function table(label, head, rows, onchoose) {
  const body = rows.map((cells, row) => {
    const line = make(
      "tr",
      {},
      ...cells.map((cell) =>
        make(
          "td",
          { class: typeof cell === "number" ? "number" : undefined },
          typeof cell === "number" ? `${cell}` : cell,
        ),
      ),
    );
    if (onchoose) {
      line.tabIndex = 0;
      line.addEventListener("click", () => onchoose(row));
      line.addEventListener("keydown", (event) => {
        if (event.key === "Enter") {
          onchoose(row);
        }
      });
    }
    return line;
  });
  const titles = make("tr", {}, ...head.map((title) => make("th", { scope: "col" }, title)));
  return make("table", { "aria-label": label }, make("thead", {}, titles), make("tbody", {}, ...body));
}

/**
 * Offers bytes or text as a file to be saved.
 * @param {string} name
 * @param {Blob} blob
 */
export function save(name, blob) {
  const url = URL.createObjectURL(blob);
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000); // time for a browser that asks where to
}

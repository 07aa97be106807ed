// A widget of anywidget: the shared page of a recording in a frame, whose view and the model's follow each other.

/** @typedef {{ seek: (step: number) => Promise<void>, look: (change: object) => void, ready: Promise<any>, info: any, view: any }} Page */
/** @typedef {{ get: (name: string) => any, set: (name: string, value: any) => void, save_changes: () => void,
 *   on: (event: string, listener: () => void) => void, off: (event: string, listener: () => void) => void }} Model */

/** Time between two messages to Python (ms): a run that plays moves 60 times a second. */
const PERIOD_MS = 100;

/** Parts of a step by which a window differs from the same one, in seconds and back. */
const SAME = 1e-3;

/** Python's values that differ from those of the page. @param {Page} page @param {Model} model */
function news({ info, view }, model) {
  const dt = info.manifest.physics.dt_s;
  const [steps, all, asked] = [view.steps, view.allSteps, model.get("window_s")];
  const isAll = steps[0] === all[0] && steps[1] === all[1];
  const isSame = asked ? steps.every((/** @type {number} */ step, /** @type {number} */ i) => Math.abs(step - asked[i] / dt) < SAME) : isAll;
  const found = {
    step: view.step ?? info.lastStep,
    bead: view.bead ?? null,
    field: view.field,
    window_s: isSame ? asked : isAll ? null : steps.map((/** @type {number} */ step) => step * dt),
  };
  return Object.entries(found).filter(([name, value]) => value !== model.get(name));
}

/** @param {{ model: Model, el: HTMLElement }} place */
function render({ model, el }) {
  const url = URL.createObjectURL(new Blob([model.get("_page")], { type: "text/html" }));
  const frame = document.createElement("iframe");
  frame.title = "recording";
  frame.src = url;
  frame.style.cssText = "width: 100%; border: 0; display: block";
  const size = () => {
    frame.style.height = `${model.get("height_px")}px`;
  };
  /** The page, once it shows the recording. @type {Page | undefined} */
  let page;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let waiting;
  let isTelling = false;
  const tell = () => {
    [waiting, isTelling] = [undefined, true];
    const found = page ? news(page, model) : [];
    found.forEach(([name, value]) => model.set(name, value));
    isTelling = false;
    if (found.length > 0) {
      model.save_changes();
    }
  };
  const hear = (/** @type {string} */ name) => {
    if (!page || isTelling || !news(page, model).some(([one]) => one === name)) {
      return;
    }
    const value = model.get(name) ?? undefined;
    if (name === "step") {
      void page.seek(value);
    } else if (name === "window_s") {
      const dt = page.info.manifest.physics.dt_s;
      page.look({ steps: value?.map((/** @type {number} */ time_s) => time_s / dt) });
    } else {
      page.look({ [name]: value });
    }
  };
  const names = ["field", "bead", "window_s", "step"];
  frame.addEventListener("load", async () => {
    const inside = /** @type {any} */ (frame.contentWindow);
    if (await inside.beadline.ready.catch(() => undefined)) {
      page = inside.beadline;
      names.forEach(hear);
      inside.addEventListener("look", () => {
        waiting ??= setTimeout(tell, PERIOD_MS);
      });
    } // else the page says why
  });
  /** @type {[string, () => void][]} */
  const events = names.map((name) => [`change:${name}`, () => hear(name)]);
  events.push(["change:height_px", size]);
  events.forEach(([event, listener]) => model.on(event, listener));
  size();
  el.append(frame);
  return () => {
    clearTimeout(waiting);
    events.forEach(([event, listener]) => model.off(event, listener));
    URL.revokeObjectURL(url);
    frame.remove();
  };
}

export default { render };

// The tables of a run, one at a time.

import { changeForm, readChange } from "./changing.js";
import { compareForm } from "./comparing.js";
import { byId, make } from "./elements.js";
import { noteList } from "./notes.js";
import { spectrumPanel } from "./spectrum.js";
import { eventTable, liveTable, pulseTable, runTable } from "./tables.js";
import { TABS } from "./view.js";

/** @typedef {import("./page.js").Page} Page */
/** @typedef {import("./run.js").Run} Run */

export class Tabs {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    /** Source of the table; the table is made anew when this changes. */
    this.shown = "";
  }

  /** Makes the buttons, for another run. */
  open() {
    const { page } = this;
    const tabs = TABS.filter((name) => {
      const { kind } = page.run?.info ?? {};
      return (name !== "live" || kind === "live") && (name !== "notes" || page.source?.kind === "bytes");
    });
    const buttons = tabs.map((name) => {
      const onclick = () => page.look({ tab: name });
      const onkeydown = (/** @type {KeyboardEvent} */ event) => {
        const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (by) {
          const next = tabs[(tabs.indexOf(name) + by + tabs.length) % tabs.length];
          page.look({ tab: next });
          byId(`tab-${next}`).focus();
        }
      };
      return make("button", { role: "tab", id: `tab-${name}`, "aria-controls": "tab", onclick, onkeydown }, name);
    });
    byId("tabs").replaceChildren(...buttons);
    this.shown = "";
  }

  /** Makes the table anew the next time. */
  forget() {
    this.shown = "";
  }

  show() {
    const { page } = this;
    const run = /** @type {Run} */ (page.run);
    const { tab } = page.view;
    const events = run.events.get(page.bead);
    const state = {
      run: "",
      pulses: run.pulses.length,
      live: `${run.ended}${run.status?.step}${run.status?.frames_seen}`,
      events: `${page.bead} ${events?.events.length} ${events?.isDone} ${run.ended}`,
      notes: `${page.notes.length} ${page.bead} ${page.timeline.isPlaying ? "" : page.step}`,
      compare: `${page.comparison.other?.name} ${page.view.difference} ${run.state?.step} ${page.second?.state?.step}`,
      spectrum: `${page.spectrum.key} ${page.spectrum.words} ${page.spectrum.found?.segments} ${run.modes.length} ${page.isDark}`,
      change: `${page.view.change} ${page.second !== undefined}`,
    };
    const shown = `${tab} ${state[/** @type {keyof typeof state} */ (tab)]}`;
    if (shown === this.shown) {
      return;
    }
    const isOther = !this.shown.startsWith(`${tab} `);
    this.shown = shown;
    for (const button of byId("tabs").children) {
      const isChosen = button.id === `tab-${tab}`;
      button.setAttribute("aria-selected", String(isChosen));
      /** @type {HTMLElement} */ (button).tabIndex = isChosen ? 0 : -1;
    }
    const panel = byId("tab");
    panel.setAttribute("aria-labelledby", `tab-${tab}`);
    const top = isOther ? 0 : panel.scrollTop;
    const seek = (/** @type {number} */ step) => void page.seek(step);
    const change = (/** @type {import("./change.js").Change | undefined} */ wanted) => page.change(wanted);
    /** @type {Record<string, () => Node[]>} */
    const contents = {
      run: () => runTable(run, page.view.digits ? undefined : 6),
      pulses: () => pulseTable(run, seek),
      events: () => eventTable(run, page.bead, seek),
      live: () => liveTable(run),
      notes: () => noteList(page),
      compare: () => compareForm(page),
      spectrum: () => spectrumPanel(page),
      change: () => changeForm(run, page.second, readChange(page.view.change), change),
    };
    panel.replaceChildren(...contents[tab]());
    panel.scrollTop = top;
  }
}

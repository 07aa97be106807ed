// The line of time: where the cursor is, how it moves by itself, and marks to jump to.

import { byId, make } from "./elements.js";
import { amount } from "./axes.js";

/** @typedef {import("./run.js").Run} Run */

/** @param {number} value the next of 1, 2, 5 · 10^n below */
function round(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return ([5, 2, 1].find((digit) => digit * power <= value * (1 + 1e-9)) ?? 1) * power;
}

/** Moves the cursor. The page is told by `onseek(step)`, of the pace by `onspeed`. */
export class Timeline {
  /**
   * @param {{ onseek: (step: number) => Promise<unknown>, onspeed: (speed: string) => void, onlive: () => void }} on
   */
  constructor(on) {
    this.on = on;
    this.isPlaying = false;
    this.step = 0;
    this.isFollowing = false;
    this.speed = "";
    /** @type {Run | undefined} */
    this.run = undefined;
    this.slider = /** @type {HTMLInputElement} */ (byId("step"));
    this.select = /** @type {HTMLSelectElement} */ (byId("speed"));
    this.slider.addEventListener("input", () => {
      this.pause();
      on.onseek(Number(this.slider.value));
    });
    this.select.addEventListener("change", () => {
      this.speed = this.select.value;
      on.onspeed(this.speed);
    });
    byId("play").addEventListener("click", () => this.toggle());
    byId("follow").addEventListener("click", () => on.onlive());
    for (const [id, by] of /** @type {[string, number][]} */ ([
      ["back", -1],
      ["on", 1],
    ])) {
      byId(id).addEventListener("click", (event) => (event.shiftKey ? this.byFrame(by) : this.by(by)));
    }
  }

  /** Steps from one stored state to the next. */
  get frameSteps() {
    return Math.max(1, this.run?.info.manifest.provenance.record_every_steps ?? 1);
  }

  /**
   * @param {Run} run
   * @param {string} speed
   */
  open(run, speed) {
    this.pause();
    this.run = run;
    this.speed = speed;
    const { dt_s: dt, step_count: count } = run.physics;
    const base = (dt * Math.max(count, 1)) / 10;
    const rates = [0.01, 0.03, 0.1, 0.3, 1, 3].map((factor) => String(round(base * factor)));
    this.defaultSpeed = rates[4];
    if (speed && Number(speed) > 0 && !rates.includes(speed)) {
      rates.push(speed);
    }
    this.select.replaceChildren(
      make("option", { value: "step" }, "every step"),
      make("option", { value: "frame" }, "every frame"),
      ...rates
        .sort((a, b) => Number(a) - Number(b))
        .map((rate) => make("option", { value: rate }, `${amount(Number(rate), "s", 3)}/s`)),
    );
    this.select.value = speed || this.defaultSpeed;
  }

  /** Steps that the cursor goes in some seconds of playing; in a picture, where it shows every step or frame. @param {number} seconds */
  stepsIn(seconds) {
    const { value } = this.select;
    const dt = this.run?.physics.dt_s ?? 1;
    return value === "step" ? 1 : value === "frame" ? this.frameSteps : (Number(value) * seconds) / dt;
  }

  /** Moves by some steps. @param {number} steps */
  by(steps) {
    this.pause();
    this.on.onseek(this.step + steps);
  }

  /** Moves to the next stored state, or the one before. @param {number} direction 1 or −1 */
  byFrame(direction) {
    const at = direction * (this.step / this.frameSteps);
    this.by(direction * (Math.floor(at) + 1) * this.frameSteps - this.step);
  }

  toggle() {
    if (this.isPlaying) {
      this.pause();
    } else if (this.isFollowing) {
      this.on.onseek(this.step); // a live run is paused here; it goes on
    } else {
      this.play();
    }
  }

  pause() {
    this.isPlaying = false;
    this.showButton();
  }

  async play() {
    const { run } = this;
    if (!run || this.isPlaying) {
      return;
    }
    this.isPlaying = true;
    this.showButton();
    const { firstStep } = run.info;
    if (this.step >= run.info.lastStep && run.info.kind !== "live") {
      await this.on.onseek(firstStep);
    }
    let at = this.step;
    let before = performance.now();
    while (this.isPlaying && this.run === run) {
      const now = await new Promise(requestAnimationFrame);
      const rate = Number(this.select.value);
      // a slow machine leaves steps out at a rate, never at "every step"
      at +=
        this.select.value === "step"
          ? 1
          : this.select.value === "frame"
            ? this.frameSteps
            : (rate * Math.min(Math.max(now - before, 0), 250)) / 1000 / run.physics.dt_s;
      before = now;
      if (!this.isPlaying || this.run !== run) {
        return;
      }
      if (at >= run.info.lastStep) {
        this.pause();
        if (run.info.kind === "live" && run.ended === "") {
          this.on.onlive();
        } else {
          await this.on.onseek(run.info.lastStep);
        }
        return;
      }
      await this.on.onseek(Math.floor(at));
    }
  }

  showButton() {
    const button = byId("play");
    const goes = this.isPlaying || this.isFollowing;
    button.textContent = goes ? "❚❚" : "▶\uFE0E";
    button.setAttribute("aria-label", goes ? "pause" : "play");
    byId("follow").setAttribute("aria-pressed", String(this.isFollowing));
  }

  /**
   * Shows where the cursor is.
   * @param {number} step
   * @param {boolean} isFollowing
   * @param {number} bead the chosen one
   */
  show(step, isFollowing, bead) {
    const { run, slider } = this;
    if (!run) {
      return;
    }
    this.step = step;
    if (isFollowing !== this.isFollowing) {
      this.isFollowing = isFollowing;
      this.showButton();
    }
    const time = amount(step * run.physics.dt_s, "s", 6);
    byId("follow").hidden = run.info.kind !== "live" || run.ended !== "";
    slider.min = String(run.info.firstStep);
    slider.max = String(run.info.lastStep);
    slider.value = String(step);
    slider.setAttribute("aria-valuetext", `${time}, step ${step}`);
    byId("time").textContent = time;
    const { events, births } = this.marks(bead);
    const ticks = [
      births.length > 0 ? `upper ticks: ${births.length} ${births.length === 1 ? "pulse begins" : "pulses begin"}` : "",
      events.length > 0 ? `lower ticks: ${events.length} ${events.length === 1 ? "event" : "events"} of bead ${bead}` : "",
    ];
    byId("ticks").textContent = ticks.filter(Boolean).join("; ");
    byId("at").textContent = `step ${step} of ${run.info.lastStep}`;
  }

  /** Steps to jump to. @param {number} bead the chosen one */
  marks(bead) {
    const { run } = this;
    const events = run?.events.get(bead)?.events.map(({ step }) => step) ?? [];
    const births = run?.pulses.map(({ birth_time_s: time }) => run.clamp(time / run.physics.dt_s)) ?? [];
    return { events, births };
  }

  /**
   * Jumps to the next mark, or the one before.
   * @param {number[]} steps
   * @param {number} direction 1 or −1
   */
  jump(steps, direction) {
    const ahead = steps.filter((step) => (step - this.step) * direction > 0);
    if (ahead.length > 0) {
      this.pause();
      this.on.onseek(direction > 0 ? Math.min(...ahead) : Math.max(...ahead));
    }
  }
}

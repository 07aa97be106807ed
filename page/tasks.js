// Work that is done in pieces, the most urgent first.

/** @typedef {AsyncGenerator<unknown, unknown> } Work */

export class Tasks {
  constructor() {
    /** @type {{ urgency: number, work: Work, done: (value: any) => void, failed: (error: unknown) => void }[]} */
    this.waiting = [];
    this.isBusy = false;
    const { port1, port2 } = new MessageChannel();
    this.breath = port2;
    /** @type {() => void} */
    this.breathed = () => {};
    port1.onmessage = () => this.breathed();
  }

  /**
   * Does `work` when nothing more urgent is left to do; of the same urgency the newest comes first. Its value, or
   * undefined if it was dropped.
   * @template T
   * @param {number} urgency
   * @param {AsyncGenerator<unknown, T>} work
   * @returns {Promise<T | undefined>}
   */
  add(urgency, work) {
    return new Promise((done, failed) => {
      this.waiting.push({ urgency, work, done, failed });
      if (!this.isBusy) {
        this.isBusy = true;
        void this.run();
      }
    });
  }

  /**
   * Drops all work of an urgency; its promises resolve to undefined.
   * @param {number} urgency
   */
  drop(urgency) {
    const dropped = this.waiting.filter((task) => task.urgency === urgency);
    this.waiting = this.waiting.filter((task) => task.urgency !== urgency);
    dropped.forEach((task) => task.done(undefined));
  }

  async run() {
    while (this.waiting.length > 0) {
      const task = this.waiting.reduce((best, one) => (one.urgency >= best.urgency ? one : best));
      try {
        const { done, value } = await task.work.next();
        if (done) {
          task.done(value);
        } else {
          // messages that came meanwhile, such as a more urgent wish
          await new Promise((breathed) => {
            this.breathed = () => breathed(undefined);
            this.breath.postMessage(0);
          });
          continue;
        }
      } catch (error) {
        task.failed(error);
      }
      this.waiting = this.waiting.filter((one) => one !== task);
    }
    this.isBusy = false;
  }
}

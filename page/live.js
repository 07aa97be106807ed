// A live run over a WebSocket: the newest frame whenever there is time for one, never held back.

/** Doubles before u: version, beads, extra values a bead, frame, step, time (s), frames seen, frames skipped. */
const HEADER = 8;
const VERSION = 1;

/**
 * @typedef {object} Listener
 * @property {(run: { manifest: import("./types.d.ts").Manifest, chain: any }) => void} onrun
 * @property {(state: import("./types.d.ts").State) => void} onframe
 * @property {(status: import("./types.d.ts").LiveStatus) => void} onstatus
 * @property {(reason: string, step: number | undefined) => void} onend with the last step, if that is known
 * @property {(message: string) => void} onfault
 */

/**
 * A state from the bytes of a frame.
 * @param {ArrayBuffer} buffer
 * @returns {import("./types.d.ts").State}
 */
export function frameOf(buffer) {
  const all = buffer.byteLength % 8 === 0 ? new Float64Array(buffer) : new Float64Array(0);
  const [version, beads, extra, , step, time_s] = all;
  if (all.length < HEADER || version !== VERSION || all.length !== HEADER + (2 + extra) * beads) {
    throw new Error(`A frame of ${buffer.byteLength} bytes and version ${version} is not one of this page.`);
  }
  const [u, v] = [HEADER, HEADER + beads];
  return { step, time_s, u: all.subarray(u, v), v: all.subarray(v, v + beads), extra: all.subarray(v + beads) };
}

/** Attaches to the run at `url`, and reports its messages. */
export class Live {
  /**
   * @param {string} url
   * @param {Listener} listener
   */
  constructor(url, listener) {
    let isOver = false;
    const end = (/** @type {() => void} */ tell) => {
      if (!isOver) {
        isOver = true;
        tell();
      }
    };
    this.socket = new WebSocket(url);
    this.socket.binaryType = "arraybuffer";
    this.socket.onmessage = ({ data }) => {
      try {
        if (typeof data !== "string") {
          listener.onframe(frameOf(data));
          this.socket.send("ack");
          return;
        }
        const message = JSON.parse(data);
        if (message.run !== undefined) {
          listener.onrun(message.run);
        } else if (message.status !== undefined) {
          listener.onstatus(message.status);
        } else if (message.end !== undefined) {
          end(() => listener.onend(String(message.end), message.step ?? undefined));
        } else if (message.error !== undefined) {
          end(() => listener.onfault(String(message.error)));
        }
      } catch (error) {
        end(() => listener.onfault(error instanceof Error ? error.message : String(error)));
        this.socket.close();
      }
    };
    this.socket.onclose = () => end(() => listener.onfault("The connection to `beadline view` is gone."));
  }

  close() {
    this.socket.onclose = null;
    this.socket.close();
  }
}

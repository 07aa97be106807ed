import { stateBytes } from "./kernel.js";
export function serve() {
  self.onmessage = async (e) => {
    if (e.data) {
      const list = await (await fetch(e.data)).json();
      self.postMessage("list " + list.entries.length);
      const live = list.entries.find((x) => x.kind === "live");
      if (live) {
        const ws = new WebSocket(new URL(live.url, e.data.replace("http", "ws")));
        ws.binaryType = "arraybuffer";
        let n = 0;
        ws.onmessage = (m) => {
          if (typeof m.data === "string") { if (!m.data.includes("run\"")) self.postMessage("text " + m.data); }
          else { n++; ws.send("ack"); if (n === 100) self.postMessage("frames " + n); }
        };
        ws.onerror = () => self.postMessage("ws error");
        ws.onclose = () => self.postMessage("ws closed after " + n);
      }
    } else {
      self.postMessage("ready");
    }
  };
}

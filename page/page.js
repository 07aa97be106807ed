export function start() {
  const text = document.getElementById("code").textContent;
  const url = URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
  const worker = new Worker(url);
  const say = (what) => {
    document.title += " " + what;
    const p = document.createElement("p");
    p.textContent = what;
    document.body.append(p);
  };
  worker.onmessage = (e) => say("worker:" + e.data);
  worker.onerror = (e) => say("worker-error:" + e.message);
  worker.postMessage(location.protocol === "file:" ? "" : new URL("list", location.href).href);
  say(JSON.parse(document.getElementById("carried").textContent).kind);
}

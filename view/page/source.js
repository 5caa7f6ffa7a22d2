// Where frames come from: the program over a WebSocket, or an engine in a worker of this page.
// Both have `send(command)` and call `onframe(DataView)` and `onstate(text)`; nothing else differs.

export function openSource(handlers) {
  const token = new URLSearchParams(location.search).get("token");
  return token ? socket(token, handlers) : worker(handlers);
}

function socket(token, { onframe, onstate }) {
  let open = null;
  const connect = () => {
    const ws = new WebSocket(`ws://${location.host}/socket?token=${encodeURIComponent(token)}`);
    ws.binaryType = "arraybuffer";
    ws.onopen = () => { open = ws; onstate("open"); };
    ws.onmessage = message => onframe(new DataView(message.data));
    ws.onclose = () => { open = null; onstate("closed"); setTimeout(connect, 1000); };
  };
  connect();
  return { send: command => open?.send(JSON.stringify(command)) };
}

function worker({ onframe, onstate }) {
  const engine = new Worker("./worker.js", { type: "module" });
  engine.onmessage = ({ data }) => {
    if (data instanceof ArrayBuffer) onframe(new DataView(data));
    else if (data.state) onstate(data.state);
  };
  // Only this source opens files of the visitor.
  import("./drop.js").then(files => files.begin(engine));
  engine.onerror = event => onstate(`failed: ${event.message}`);
  return { send: command => engine.postMessage(command), worker: engine };
}

// The engine in a worker of the page: commands in, frames out. Nothing leaves the machine.
//
// In: a command of `view/src/command.rs`; {open: {name, bytes}} for a file; {press: true} for the embedded press.
// Out: an ArrayBuffer, a frame; {state}, "open" or an error; {opened} or {refused} for a file, as text;
// {slip}, classes over readings of electrodes.

import init, { Electrodes, Viewer } from "./meissner_wasm.js";

/** Time that the engine may take before the page gets a frame. */
const BUDGET_US = 12_000;
/** Time until the next step when the engine has no frame. */
const IDLE_MS = 8;
const NETWORK = "tactigraph-past", SLIP = "slip-best";

let viewer = null, network = NETWORK, facts = -1;

function show(next) {
  viewer?.free();
  [viewer, facts] = [next, -1];
  viewer.command('{"do": "show"}');
}

function open({ name, bytes }) {
  try {
    show(new Viewer(name, bytes, network));
    postMessage({ opened: name });
  } catch (noRecording) {
    try {
      slip(name, Electrodes.decode(bytes));
    } catch {
      postMessage({ refused: `${name}: ${noRecording.message}` });
    }
  }
}

/** Logits of each window of readings, from the reading that completes it. */
function slip(name, readings) {
  const engine = new Electrodes(SLIP), width = 24, count = readings.length / width, began = performance.now();
  const classes = engine.classes, logits = new Float32Array(count * classes.length).fill(NaN);
  for (let i = 0; i < count; i++) {
    const of = engine.push(readings.subarray(i * width, (i + 1) * width));
    if (of) logits.set(of, i * classes.length);
  }
  const tookMs = performance.now() - began;
  engine.free();
  viewer.command('{"do": "pause"}');
  postMessage({ slip: { name, network: SLIP, classes, readings, logits, tookMs } });
}

function step() {
  let pause = IDLE_MS;
  const frame = viewer?.step(BUDGET_US);
  if (frame) {
    pause = 0;
    if (facts !== viewer.factsVersion) {
      facts = viewer.factsVersion;
      const bytes = viewer.facts();
      postMessage(bytes.buffer, [bytes.buffer]);
    }
    postMessage(frame.buffer, [frame.buffer]);
  }
  setTimeout(step, pause);
}

const ready = init();
onmessage = async ({ data }) => {
  await ready;
  try {
    if (data.open) open(data.open);
    else if (data.press) show(Viewer.press(network));
    else {
      viewer?.command(JSON.stringify(data));
      if (data.do === "network") network = data.name;
    }
  } catch (error) {
    postMessage({ state: error.message });
  }
};
try {
  await ready;
  show(Viewer.press(network));
  postMessage({ state: "open" });
  step();
} catch (error) {
  postMessage({ state: `the module cannot run here: ${error.message}` });
}

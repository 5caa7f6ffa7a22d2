// The page: frames in, commands out, one cursor for all panels.

import { begin, colour, fit, forget } from "./colours.js";
import { overlay, painter, viewOf } from "./events.js";
import { decode } from "./frame.js";
import { drawInput, drawLayers, inputText } from "./frames.js";
import * as panels from "./panels.js";
import { drawCells, drawLatency, drawPrediction, timeAt } from "./plots.js";
import { drawSensors } from "./sensors.js";
import { openSource } from "./source.js";
import * as state from "./state.js";
import { drawWave, workText } from "./wave.js";

const $ = id => document.getElementById(id);
const SPEEDS = [0.0001, 0.001, 0.01, 0.03, 0.1, 0.3, 1, 2, 5];
const still = matchMedia("(prefers-reduced-motion: reduce)");
const paint = painter($("events"));
let asked = state.read();
let facts = null, frame = null, drawn = null, waveBegan = 0, waveOf = -1, begun = false, dirty = true;

const source = openSource({
  onframe(view) {
    const next = decode(view);
    if (next.FACT) return take(next.FACT);
    if (!facts) return;
    frame = next;
    dirty = true;
  },
  onstate(text) {
    if (text === "open") { tell(""); begun = false; } else tell(text === "closed" ? "Not connected: the program has ended, or the page is too slow. Trying again…" : text, true);
  },
});
const send = command => { if (facts?.controls) source.send(command); };
// For tests and for people who inspect the page.
window.meissner = { send, get frame() { return frame; }, get facts() { return facts; } };

const select = sensor => source.send({ do: "select", sensor: Math.max(0, Math.min(facts.sensors.length - 1, sensor)) });

function tell(text, bad = false) {
  panels.say("state", text);
  $("state").className = bad ? "bad" : "";
}

/** New facts: another network, or a page that has just opened. */
function take(next) {
  facts = next;
  panels.describeInput(facts);
  panels.showKind(facts.kind);
  $("network").replaceChildren(...facts.networks.map(name => new Option(name, name, false, name === facts.network)));
  $("network").value = facts.network;
  for (const part of document.querySelectorAll("footer > :not(#state, #clock), #compare")) part.hidden = !facts.controls;
  if (begun) return;
  begun = true;
  asked = state.read();
  if (facts.sensors && asked.sensor) select(Number(asked.sensor));
  if (!facts.controls) return tell(facts.sensors ? "" : "Another program runs this engine; the page only watches.");
  if (asked.network && asked.network !== facts.network) send({ do: "network", name: asked.network });
  if (asked.speed) send({ do: "speed", times: Number(asked.speed) });
  if (asked.compare === "1") send({ do: "compare", on: true });
  if (asked.event) send({ do: "seek_event", event: Number(asked.event) });
  if (asked.playing === "0" || (still.matches && !facts.live)) send({ do: "pause" });
  else if (asked.playing === "1") send({ do: "play" });
  send({ do: "show" });
}

function render(now) {
  requestAnimationFrame(render);
  if (!facts || !frame?.TIME) return;
  const phase = phaseAt(now);
  if (!dirty && phase === drawn) return;
  const whole = dirty;
  [dirty, drawn] = [false, phase];
  // The sensors are drawn first, because they decide how much room the rest has.
  if (frame.TIPS && whole) drawSensors($("sensors"), facts, frame.TIPS, select);
  if (frame.EVNT) {
    const size = facts.sensors ? facts.sensors[frame.TIPS.selected].size : facts.sensor;
    const { width, height } = fit($("overlay")), view = viewOf(size, facts.span_us, width, height);
    overlay($("overlay"), frame, view, { graph: $("graph").checked, grid: $("grid").checked, phase });
    if (whole) paint(frame.EVNT, view);
  } else if (whole) {
    drawInput($("overlay"), facts, frame, { contact: $("graph").checked });
  }
  if (frame.WAVE) drawWave($("wave"), facts, frame.WAVE, phase);
  if (frame.LAYR) drawLayers($("wave"), facts, frame.LAYR, phase);
  if (!whole) return;
  panels.describeWindow(facts, frame, inputText);
  panels.describeValues(facts, frame);
  panels.describeClock(facts, frame);
  panels.describeCounts(facts, frame);
  panels.describeComparison(facts, frame.INFO);
  panels.say("work", frame.WORK ? workText(facts, frame.WORK) : "");
  drawPrediction($("prediction"), facts, frame);
  drawLatency($("latency"), frame.LATE);
  if (frame.CELL) drawCells($("cells"), facts, frame);
  if ($("speed").value !== `${+frame.TIME.speed.toPrecision(4)}`) $("speed").value = `${+frame.TIME.speed.toPrecision(4)}`;
  if (frame.INFO.error) tell(frame.INFO.error, true); else if (frame.TIME.seeking) tell("Going there…"); else if (facts.controls && $("state").textContent) tell("");
  remember();
}

/** How many layers the wave of the newest event has reached. */
function phaseAt(now) {
  const layers = (frame.WAVE ?? frame.LAYR ?? []).length, { taken, playing } = frame.TIME;
  // All layers of frames together take as long as four layers of events.
  const slowness = Number($("slowness").value) * (frame.LAYR ? 4 / layers : 1);
  if (taken !== waveOf) [waveOf, waveBegan] = [taken, now];
  // If playback is faster than a wave, the whole wave is shown.
  const fast = playing && (frame.LAYR || frame.TIME.speed > 0.002);
  if (still.matches || !slowness || fast) return layers;
  return Math.min(layers, (now - waveBegan) / slowness);
}

function remember() {
  const { taken, playing, speed, live } = frame.TIME;
  state.write({
    sensor: frame.TIPS?.selected || undefined, event: playing || live ? undefined : taken, network: facts.network, speed: +speed.toPrecision(4),
    playing: playing ? undefined : 0, theme: document.documentElement.dataset.theme, compare: frame.INFO.comparing ? 1 : undefined,
    grid: $("grid").checked ? 1 : undefined, graph: $("graph").checked ? undefined : 0,
    slowness: $("slowness").value === "300" ? undefined : $("slowness").value,
  });
}

function theme(name) {
  if (name) document.documentElement.dataset.theme = name; else delete document.documentElement.dataset.theme;
  $("theme").setAttribute("aria-pressed", name === "dark");
  forget();
  dirty = true;
}

const actions = {
  play: () => send({ do: frame?.TIME.playing ? "pause" : "play" }),
  step: (by, far) => facts.sensors ? select(frame.TIPS.selected + by) : send({ do: "step", events: by * (far ? panels.far(facts) : 1) }),
  compare: () => send({ do: "compare", on: !frame?.INFO.comparing }),
  theme: () => theme(document.documentElement.dataset.theme === "dark" ? undefined : "dark"),
  again() { waveBegan = performance.now(); dirty = true; },
  help: () => $("keys").open ? $("keys").close() : $("keys").showModal(),
  toggle(id) { $(id).checked = !$(id).checked; dirty = true; },
  speed(by) {
    const at = SPEEDS.findIndex(speed => speed >= frame.TIME.speed * 0.999);
    send({ do: "speed", times: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, (at < 0 ? SPEEDS.length - 1 : at) + by))] });
  },
  shot: () => picture().toBlob(blob => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `meissner-${facts.network}-${frame.TIME.taken}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }),
};

/** The page as a canvas: its panels, canvases and texts, without the controls. */
function picture() {
  const ratio = window.devicePixelRatio || 1, canvas = document.createElement("canvas"), box = document.querySelector("main").getBoundingClientRect();
  const head = 34;
  [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round((box.height + head) * ratio)];
  const to = canvas.getContext("2d");
  to.scale(ratio, ratio);
  to.fillStyle = colour("ground");
  to.fillRect(0, 0, box.width, box.height + head);
  to.fillStyle = colour("ink");
  to.font = `600 14px ${colour("sans")}`;
  to.fillText(`Meissner · ${facts.network} · ${$("input").textContent} · ${$("clock").textContent}`, 14, 23);
  to.translate(-box.left, head - box.top);
  for (const section of document.querySelectorAll("main > section:not([hidden])")) {
    const { left, top, width, height } = section.getBoundingClientRect();
    [to.fillStyle, to.strokeStyle, to.lineWidth] = [colour("panel"), colour("line"), 1];
    to.beginPath();
    to.roundRect(left, top, width, height, 9);
    to.fill();
    to.stroke();
    for (const part of section.querySelectorAll(".tip")) {
      const at = part.getBoundingClientRect(), chosen = part.getAttribute("aria-pressed") === "true";
      to.beginPath();
      to.roundRect(at.left, at.top, at.width, at.height, 6);
      [to.strokeStyle, to.lineWidth] = [colour(chosen ? "ink" : "line"), chosen ? 2 : 1];
      to.stroke();
    }
    for (const part of section.querySelectorAll("canvas")) {
      const at = part.getBoundingClientRect();
      to.drawImage(part, at.left, at.top, at.width, at.height);
    }
    for (const mark of section.querySelectorAll(".dot, .square, .ring, .tick, .values i")) {
      const at = mark.getBoundingClientRect(), style = getComputedStyle(mark), border = parseFloat(style.borderTopWidth);
      to.beginPath();
      to.roundRect(at.left, at.top, at.width, Math.max(at.height, 1), style.borderRadius === "50%" ? at.width / 2 : 0);
      [to.fillStyle, to.strokeStyle, to.lineWidth] = [style.backgroundColor, style.borderTopColor, border];
      to.fill();
      if (border) to.stroke();
    }
    const texts = document.createTreeWalker(section, NodeFilter.SHOW_TEXT);
    for (let text = texts.nextNode(); text; text = texts.nextNode()) {
      const parent = text.parentElement, style = getComputedStyle(parent);
      if (!text.data.trim() || parent.closest("button:not(.tip), label, [hidden]")) continue;
      [to.font, to.fillStyle, to.textBaseline] = [`${style.fontWeight} ${style.fontSize} ${style.fontFamily}`, style.color, "middle"];
      const range = document.createRange(), room = parent.closest(".tip") ? parent.clientWidth : undefined;
      let line = "", at = null;
      const flush = () => { if (line.trim()) to.fillText(line, at.left, at.top + at.height / 2, room); };
      for (let i = 0; i < text.length; i++) {
        range.setStart(text, i);
        range.setEnd(text, i + 1);
        const place = range.getBoundingClientRect();
        if (at && Math.abs(place.top - at.top) > 2 && place.width) { flush(); [line, at] = ["", place]; }
        at ??= place;
        line += text.data[i];
      }
      flush();
    }
  }
  return canvas;
}

$("speed").append(...SPEEDS.map(speed => new Option(speed < 1 ? `1/${Math.round(1 / speed).toLocaleString("en-US")}` : `${speed}`, `${speed}`)));
$("play").onclick = actions.play;
$("back").onclick = event => actions.step(-1, event.shiftKey);
$("forth").onclick = event => actions.step(1, event.shiftKey);
$("compare").onclick = actions.compare;
$("theme").onclick = actions.theme;
$("shot").onclick = actions.shot;
$("help").onclick = actions.help;
$("again").onclick = actions.again;
$("network").onchange = event => send({ do: "network", name: event.target.value });
$("speed").onchange = event => send({ do: "speed", times: Number(event.target.value) });
$("scrubber").oninput = event => send({ do: "seek_event", event: Number(event.target.value) });
for (const id of ["graph", "grid", "slowness"]) $(id).oninput = () => { dirty = true; };
$("prediction").onpointerdown = event => { event.target.setPointerCapture(event.pointerId); drag(event); };
$("prediction").onpointermove = event => { if (event.buttons) drag(event); };
const drag = event => frame && send({ do: "seek", t_us: timeAt(event.target, frame, event.clientX) });

addEventListener("keydown", event => {
  const on = event.target, typing = on.matches?.("select, dialog[open] *") || event.ctrlKey || event.metaKey || event.altKey;
  if (typing && !(event.key === "?" && !on.matches("select"))) return;
  const keys = {
    " ": () => actions.play(), ArrowLeft: () => actions.step(-1, event.shiftKey), ArrowRight: () => actions.step(1, event.shiftKey),
    Home: () => send({ do: "seek_event", event: 0 }), End: () => send({ do: "seek_event", event: frame.TIME.events }),
    ",": () => actions.speed(-1), ".": () => actions.speed(1), w: actions.again, b: actions.compare, d: actions.theme, s: actions.shot,
    g: () => actions.toggle("graph"), c: () => actions.toggle("grid"), n: () => $("network").focus(), "?": actions.help,
  };
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, act = keys[key];
  // Buttons and checkboxes handle Space themselves; the slider of the slowness handles arrow keys.
  if (!act || (key === " " && on.matches("button, input[type=checkbox]")) || (on.id === "slowness" && key.startsWith("Arrow"))) return;
  event.preventDefault();
  if (frame || key === "?") act();
});
addEventListener("resize", () => { dirty = true; });
still.addEventListener("change", () => { dirty = true; });
theme(asked.theme);
if (asked.grid === "1") $("grid").checked = true;
if (asked.graph === "0") $("graph").checked = false;
if (asked.slowness) $("slowness").value = asked.slowness;
requestAnimationFrame(render);

// Several sensors side by side: the events of each sensor, its prediction, the time that took and
// the dropped events. One sensor is selected, and the other panels show it.

import { begin, colour, grouped, short, time } from "./colours.js";
import { softmax } from "./plots.js";

const STATES = ["fresh", "behind", "old"];
let made = 0;

/** Draws all sensors into `box`, with a button for each. */
export function drawSensors(box, facts, tips, select) {
  if (made !== tips.list.length || box.childElementCount !== made) {
    made = tips.list.length;
    box.replaceChildren(...tips.list.map((_, i) => tip(facts, i, select)));
  }
  // Draws canvases before texts, so that the page is laid out once.
  const canvases = box.querySelectorAll("canvas");
  tips.list.forEach((of, i) => drawEvents(canvases[i], facts.sensors[i].size, facts.span_us, of.events));
  tips.list.forEach((of, i) => {
    const button = box.children[i], [value, late, lost] = button.querySelectorAll(".value, .late, .lost");
    const chosen = i === tips.selected;
    if (button.getAttribute("aria-pressed") !== `${chosen}`) button.setAttribute("aria-pressed", chosen);
    set(value, valueText(facts, of));
    set(late, pair(time(of.took), time(of.p99)));
    const drops = of.dropped + of.lost;
    set(lost, drops ? `${grouped(drops)} dropped` : `${grouped(of.taken)} events`);
    lost.title = `${grouped(of.taken)} events came, the queue dropped ${grouped(of.dropped)}, the engine ${grouped(of.lost)}`;
    lost.classList.toggle("bad", drops > 0);
    set(button.querySelector(".name"), `${facts.sensors[i].name}${of.state ? ` · ${STATES[of.state]}` : ""}`);
  });
}

/** Two times, with the unit once if it is the same. */
function pair(a, b) {
  const [value, unit] = a.split(" ");
  return b.endsWith(` ${unit}`) ? `${value} / ${b}` : `${a} / ${b}`;
}

function set(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function tip(facts, i, select) {
  const button = document.createElement("button"), [columns, rows] = facts.sensors[i].size;
  button.type = "button";
  button.className = "tip";
  button.title = `Show ${facts.sensors[i].name} in detail`;
  button.onclick = () => select(i);
  for (const [tag, name] of [["span", "name"], ["canvas", ""], ["span", "value"], ["span", "late"], ["span", "lost"]]) {
    const part = document.createElement(tag);
    part.className = name;
    if (tag === "canvas") part.style.aspectRatio = `${columns} / ${rows}`;
    button.append(part);
  }
  return button;
}

/** The prediction as a short text. */
function valueText(facts, { values }) {
  if (values.some(value => !Number.isFinite(value))) return "–";
  if (facts.classes) {
    const all = softmax(values), best = all.indexOf(Math.max(...all));
    return `${facts.outputs[best]} ${(all[best] * 100).toFixed(0)} %`;
  }
  return Array.from(values).slice(0, 2).map((value, i) => `${facts.outputs[i]} ${Math.abs(value) < 1 ? value.toFixed(2) : short(value)} ${facts.units[i]}`.replace("-", "−")).join("\n");
}

function drawEvents(canvas, [columns, rows], span, events) {
  const { to, width, height } = begin(canvas), scale = Math.min(width / columns, height / rows), size = Math.max(1.6, scale * 1.2);
  for (let i = 0; i < events.length; i += 2) {
    const place = events[i], word = events[i + 1];
    to.globalAlpha = 0.15 + 0.85 * Math.exp(-5 * (word >>> 1) / span);
    to.fillStyle = colour(word & 1 ? "on" : "off");
    to.fillRect((place & 0xffff) * scale - size / 2, (place >>> 16) * scale - size / 2, size, size);
  }
  to.globalAlpha = 1;
}

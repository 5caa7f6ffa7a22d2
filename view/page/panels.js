// The texts of the page, from a frame.

import { colour, grouped, short, time } from "./colours.js";
import { LINES, best, softmax } from "./plots.js";

const $ = id => document.getElementById(id);

/** Replaces the text of an element where it differs: the page is laid out less often. */
export function say(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

export function describeInput(facts) {
  const [columns, rows] = facts.sensor;
  say("input", `${facts.input} · ${columns} × ${rows} pixels${facts.live ? " · live" : ""}`);
  document.title = `${facts.network} · Meissner`;
}

export function describeWindow(facts, frame) {
  const { EVNT: events, NEAR: near } = frame, span = time(facts.span_us);
  say("window", events.count ? `${grouped(events.count)} events of the last ${span}; the newest reads ${near.length} of at most ${facts.neighbours} neighbours (${{ all: "any event of the window", past: "earlier events", frozen: "earlier events, and rows never change" }[facts.candidates]}).` : "");
  $("empty").hidden = events.count > 0;
  $("overlay").setAttribute("aria-label", `${events.count} events of the window`);
}

export function describeValues(facts, { PRED: of, TIME: now }) {
  const values = facts.classes ? softmax(of.values) : of.values;
  const shown = facts.classes ? best(values, 3) : Array.from(values.keys()).slice(0, 4);
  const none = !now.taken || of.values.some(value => !Number.isFinite(value));
  $("values").replaceChildren(...shown.map((output, k) => {
    const box = document.createElement("div"), [name, value, mark] = ["small", "b", "i"].map(tag => document.createElement(tag));
    mark.style.borderColor = colour(LINES[facts.classes ? k : output]);
    mark.style.borderTopStyle = ["solid", "dashed", "dotted", "dashed"][facts.classes ? k : output];
    name.append(mark, facts.outputs[output]);
    value.textContent = none ? "–" : facts.classes ? `${(values[output] * 100).toFixed(1)} %` : `${short(values[output])} ${facts.units[output]}`.replace("-", "−");
    box.append(name, value);
    if (facts.truth.some(truth => truth.output === output)) {
      const truth = document.createElement("small");
      truth.textContent = Number.isFinite(of.truth[output]) ? `true: ${short(of.truth[output])} ${facts.units[output]}`.replace("-", "−") : "true: not known here";
      box.append(truth);
    }
    return box;
  }));
  say("unlike", Number.isFinite(of.unlike) ? `${of.unlike > 1 ? "unlike" : "like"} the training (${short(of.unlike)}; above 1: fewer than 1 of 1,000 windows)` : facts.truth.length ? "wide, pale line: what is true" : "");
  $("prediction").setAttribute("aria-label", `Prediction over time. ${$("values").textContent}`);
}

export function describeClock({ TIME: now }) {
  const digits = now.end < 1e7 ? 3 : 1, ms = us => (us / 1e3).toFixed(digits);
  say("clock", now.live ? `${ms(now.now)} ms · event ${grouped(now.taken)}` : `${ms(now.now)} of ${(now.end / 1e3).toFixed(0)} ms · event ${grouped(now.taken)} of ${grouped(now.events)}`);
  const scrubber = $("scrubber");
  scrubber.max = now.events;
  if (document.activeElement !== scrubber || !scrubber.matches(":active")) scrubber.value = now.taken;
  scrubber.setAttribute("aria-valuetext", `event ${now.taken}, ${ms(now.now)} ms`);
  $("play").setAttribute("aria-label", now.playing ? "Pause" : "Play");
  $("play-icon").setAttribute("d", now.playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M4 2v12l9-6z");
}

export function describeCounts({ LATE: late, INFO: info, PRED: prediction }) {
  say("rate", late.measured ? `${grouped(late.rate)} events a second on one core` : "");
  const counts = [["newest", time(prediction.took)], ["p50", time(late.p50)], ["p99", time(late.p99)], ["largest", time(late.most)], ["expired", grouped(info.expired)]];
  if (info.evicted) counts.push(["evicted: the window was full", grouped(info.evicted)]);
  for (const [reason, count] of Object.entries(info.dropped)) counts.push([`dropped: ${reason.replaceAll("_", " ")}`, grouped(count)]);
  if (info.queue) counts.push(["waiting", grouped(info.queue[0])], ["lost in the queue", grouped(info.queue[1])]);
  if (info.forgotten) counts.push(["forgotten", grouped(info.forgotten)]);
  const texts = counts.map(pair => pair.join(" ")).join();
  if ($("counts").dataset.texts === texts) return;
  $("counts").dataset.texts = texts;
  $("counts").replaceChildren(...counts.map(([name, value]) => {
    const box = document.createElement("div"), dt = document.createElement("dt"), dd = document.createElement("dd");
    [dt.textContent, dd.textContent] = [name, value];
    box.append(dt, dd);
    return box;
  }));
}

export function describeComparison(info) {
  $("compare").setAttribute("aria-pressed", info.comparing);
  $("compare-panel").hidden = !info.comparing;
  if (!info.comparing) return;
  const { compared } = info, verdict = $("verdict");
  const differ = compared?.layers.reduce((sum, layer) => sum + layer.differ, 0);
  const rows = compared?.layers.reduce((sum, layer) => sum + layer.rows, 0);
  verdict.className = `verdict ${!compared ? "" : compared.error || differ ? "bad" : "good"}`;
  say("verdict", !compared ? "Comparing…" : compared.error ? compared.error : differ ? `✗ ${grouped(differ)} of ${grouped(rows)} rows differ at event ${grouped(compared.event)}.` : `✓ All bits of ${grouped(rows)} rows agree at event ${grouped(compared.event)}. Full recomputation took ${time(compared.batch_us)}.`);
  $("compared").tBodies[0].replaceChildren(...(compared?.layers ?? []).map(layer => {
    const row = document.createElement("tr");
    [layer.name, grouped(layer.rows), layer.differ ? `${grouped(layer.differ)} differ` : "equal"].forEach((text, i) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      if (i === 2 && layer.differ) cell.className = "bad";
      row.append(cell);
    });
    return row;
  }));
}

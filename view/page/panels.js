// The texts of the page, from a frame.

import { colour, grouped, short, time } from "./colours.js";
import { LINES, best, softmax } from "./plots.js";

const $ = id => document.getElementById(id);

/** Replaces the text of an element only if it differs, so that the page is laid out less often. */
export function say(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

const KINDS = {
  events: { one: "event", many: "events", title: "Events", empty: "No events yet.", changed: "What the newest event changed" },
  pictures: { one: "picture", many: "pictures", title: "Picture and pressure", empty: "No picture yet.", changed: "What this picture recomputed" },
  electrodes: { one: "reading", many: "readings", title: "Electrodes", empty: "No reading yet.", changed: "What this window recomputed" },
  sensors: { one: "report", many: "reports", title: "Events", empty: "No events yet.", changed: "" },
  frames: { one: "frame", many: "frames", title: "Frame of events", empty: "No frame yet.", changed: "What this frame recomputed" },
};

/** Shows what a network of this kind has, and hides the rest. */
export function showKind(kind) {
  document.body.dataset.kind = kind;
  for (const part of document.querySelectorAll("[data-kinds]")) part.hidden = !part.dataset.kinds.split(" ").includes(kind);
  const { title, changed, empty, one } = KINDS[kind];
  say("events-title", title);
  say("wave-title", changed);
  say("empty", empty);
  say("latency-title", `Latency of ${/^[aeiou]/.test(one) ? "an" : "a"} ${one}`);
  say("graph-text", kind === "pictures" ? "outline" : "neighbours");
  // Clears the content of the previous kind.
  $("work").textContent = "";
  for (const id of ["overlay", "wave"]) $(id).width = $(id).width;
}

/** How far a step with Shift goes. */
export const far = facts => facts.frames ? 10 : 100;

export function describeInput(facts) {
  if (facts.sensors) {
    say("input", `${facts.input} · live`);
    document.title = `${facts.network} · Meissner`;
    return;
  }
  const [columns, rows] = facts.sensor;
  say("input", `${facts.input} · ${facts.kind === "electrodes" ? `${facts.frames.electrodes.length} electrodes` : `${columns} × ${rows} pixels`}${facts.live ? " · live" : ""}`);
  document.title = `${facts.network} · Meissner`;
}

export function describeWindow(facts, frame, inputText) {
  if (!frame.EVNT) {
    say("window", inputText(facts, frame));
    $("empty").hidden = !!(frame.PICT ?? frame.ELEC ?? frame.SPAR);
    $("overlay").setAttribute("aria-label", `${KINDS[facts.kind].title}. ${$("window").textContent}`);
    return;
  }
  const { EVNT: events, NEAR: near = [] } = frame, span = time(facts.span_us);
  if (facts.sensors) {
    const { name, size: [columns, rows] } = facts.sensors[frame.TIPS.selected];
    say("events-title", `Events of ${name}`);
    say("window", `The newest ${grouped(events.count)} events on ${columns} × ${rows} pixels.`);
  } else say("window", events.count ? `${grouped(events.count)} events of the last ${span}; the newest reads ${near.length} of at most ${facts.neighbours} neighbours (${{ all: "any event of the window", past: "earlier events", frozen: "earlier events, and rows never change" }[facts.candidates]}).` : "");
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
  say("unlike", Number.isFinite(of.unlike) ? `${of.unlike > 1 ? "unlike" : "like"} the training (${short(of.unlike)}; above 1: fewer than 1 of 1,000 ${facts.frames ? KINDS[facts.kind].many : "windows"})` : facts.truth.length ? "wide, pale line: what is true" : "");
  $("prediction").setAttribute("aria-label", `Prediction over time. ${$("values").textContent}`);
}

export function describeClock(facts, { TIME: now }) {
  const one = facts.sensors ? "event" : KINDS[facts.kind].one;
  const digits = now.end < 1e7 ? 3 : 1, ms = us => (us / 1e3).toFixed(digits);
  say("clock", now.live ? `${ms(now.now)} ms · ${one} ${grouped(now.taken)}` : `${ms(now.now)} of ${(now.end / 1e3).toFixed(0)} ms · ${one} ${grouped(now.taken)} of ${grouped(now.events)}`);
  const scrubber = $("scrubber");
  scrubber.max = now.events;
  if (document.activeElement !== scrubber || !scrubber.matches(":active")) scrubber.value = now.taken;
  scrubber.setAttribute("aria-valuetext", `${one} ${now.taken}, ${ms(now.now)} ms`);
  for (const [id, way] of [["back", "back"], ["forth", "on"]]) {
    $(id).setAttribute("aria-label", `One ${one} ${way}`);
    $(id).title = `One ${one} ${way} (${way === "on" ? "→" : "←"}; with Shift, ${far(facts)})`;
  }
  $("play").setAttribute("aria-label", now.playing ? "Pause" : "Play");
  $("play-icon").setAttribute("d", now.playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M4 2v12l9-6z");
}

export function describeCounts(facts, { LATE: late, INFO: info, PRED: prediction }) {
  say("rate", facts.sensors ? "from the request to the prediction" : late.measured ? `${late.rate < 10 ? late.rate.toFixed(1) : grouped(late.rate)} ${KINDS[facts.kind].many} a second on one core` : "");
  const counts = [["newest", time(prediction.took)], ["p50", time(late.p50)], ["p99", time(late.p99)], ["largest", time(late.most)]];
  if (facts.kind === "events") counts.push(["expired", grouped(info.expired)]);
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

export function describeComparison(facts, info) {
  const { one } = KINDS[facts.kind], what = facts.frames ? "values" : "rows";
  $("compare").setAttribute("aria-pressed", info.comparing);
  $("compare-panel").hidden = !info.comparing;
  if (!info.comparing) return;
  const { compared } = info, verdict = $("verdict");
  const differ = compared?.layers.reduce((sum, layer) => sum + layer.differ, 0);
  const rows = compared?.layers.reduce((sum, layer) => sum + layer.rows, 0);
  verdict.className = `verdict ${!compared ? "" : compared.error || differ ? "bad" : "good"}`;
  say("verdict", !compared ? "Comparing…" : compared.error ? compared.error : differ ? `✗ ${grouped(differ)} of ${grouped(rows)} ${what} differ at ${one} ${grouped(compared.event)}.` : `✓ All bits of ${grouped(rows)} ${what} agree at ${one} ${grouped(compared.event)}. Full recomputation took ${time(compared.batch_us)}.`);
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

// Direction of slip over a recording of electrodes: the readings, and the classes that the network gives.

const WORDS = { aw: "anticlockwise", cw: "clockwise", e: "east", n: "north", s: "south", t: "touch", w: "west" };
const ELECTRODES = 24;
let panel = null, shown = null;

/** Shows a run of a slip network, or the events again if there is no run. */
export function showSlip(run) {
  const main = document.querySelector("main"), foot = document.querySelector("footer");
  if (!run && !panel) return;
  panel ??= build(main);
  shown = run;
  panel.hidden = !run;
  for (const part of [main, foot, ...document.querySelectorAll("#input, header label, #compare, #shot")]) part.hidden = Boolean(run);
  if (run) draw();
}

function build(main) {
  const section = document.createElement("section");
  section.id = "slip-panel";
  section.setAttribute("aria-labelledby", "slip-title");
  section.innerHTML = `<div class="head"><h2 id="slip-title">Direction of slip</h2><p id="slip-about" class="quiet"></p></div>
    <canvas id="slip-readings" role="img" aria-label="Values of the electrodes over time"></canvas>
    <p class="caption">Electrodes, each between its own least and largest value; below, the probability of each class.</p>
    <canvas id="slip-classes" role="img" aria-label="Probability of each class over time"></canvas>
    <p id="slip-answer" class="caption" role="status"></p>`;
  Object.assign(section.style, { margin: "12px" });
  for (const canvas of section.querySelectorAll("canvas")) Object.assign(canvas.style, { display: "block", width: "100%", height: "14rem" });
  main.after(section);
  addEventListener("resize", () => shown && draw());
  return section;
}

/** Softmax of the logits of a reading; NaN before the first window. */
function probabilities(logits) {
  const most = Math.max(...logits), parts = [...logits].map(value => Math.exp(value - most)), sum = parts.reduce((a, b) => a + b);
  return parts.map(part => part / sum);
}

function draw() {
  const { name, network, classes, readings, logits, tookMs } = shown, count = readings.length / ELECTRODES;
  const all = Array.from({ length: count }, (_, i) => probabilities(logits.subarray(i * classes.length, (i + 1) * classes.length)));
  const wins = classes.map(() => 0);
  for (const row of all) if (!Number.isNaN(row[0])) wins[row.indexOf(Math.max(...row))]++;
  const best = wins.indexOf(Math.max(...wins)), windows = wins.reduce((a, b) => a + b);
  const word = index => WORDS[classes[index]] ?? classes[index];
  document.getElementById("slip-about").textContent = `${name} · ${network} · ${count} readings`;
  document.getElementById("slip-answer").textContent = windows
    ? `${word(best)}: the most probable class of ${wins[best]} of ${windows} windows; ${(tookMs / windows).toFixed(1)} ms a window.`
    : "Too few readings for a window.";
  // Each electrode between its own minimum and maximum: this shows its changes, not its value at rest.
  const ranges = Array.from({ length: ELECTRODES }, () => [Infinity, -Infinity]);
  readings.forEach((value, i) => { const of = ranges[i % ELECTRODES]; of[0] = Math.min(of[0], value); of[1] = Math.max(of[1], value); });
  const share = (i, e) => { const [low, high] = ranges[e]; return (readings[i * ELECTRODES + e] - low) / (high - low || 1); };
  heat("slip-readings", count, ELECTRODES, share, e => `e${e + 1}`);
  heat("slip-classes", count, classes.length, (i, c) => all[i][c], word);
}

/** Rows over time, dark where the value is 1; nothing where there is no value. */
function heat(id, columns, rows, value, label) {
  const canvas = document.getElementById(id), ratio = devicePixelRatio || 1, style = getComputedStyle(document.body);
  const width = canvas.clientWidth, height = canvas.clientHeight, left = 96, to = canvas.getContext("2d");
  [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
  to.scale(ratio, ratio);
  to.clearRect(0, 0, width, height);
  const [w, h] = [(width - left) / Math.max(columns, 1), height / rows];
  to.font = `12px ${style.fontFamily}`;
  to.textBaseline = "middle";
  for (let r = 0; r < rows; r++) {
    to.fillStyle = style.color;
    if (rows <= 12 || r % 4 === 0) to.fillText(label(r), 0, (r + 0.5) * h);
    for (let c = 0; c < columns; c++) {
      const of = value(c, r);
      if (Number.isNaN(of)) continue;
      to.fillStyle = `rgba(31, 95, 168, ${(0.06 + 0.94 * Math.max(0, Math.min(1, of))).toFixed(3)})`;
      const from = Math.floor(left + c * w);
      to.fillRect(from, r * h + 0.5, Math.max(Math.floor(left + (c + 1) * w) - from, 1), h - 1);
    }
  }
}

// The rows that the newest event changed, a lane for each layer, the lowest layer first: rows
// from the oldest to the newest, computed rows as ticks, and the kept rows, with the reason.

import { begin, colour, grouped } from "./colours.js";

/** Draws the lanes up to `phase` layers; returns what was kept and why, as text for each layer. */
export function drawWave(canvas, facts, layers, phase) {
  const lane = 34;
  canvas.style.height = `${Math.max(1, layers.length) * lane + 4}px`;
  const { to, width } = begin(canvas), left = 0, right = width;
  layers.forEach((layer, i) => {
    const [top, shown] = [i * lane + 2, Math.max(0, Math.min(1, phase - i))], fact = facts.layers[i] ?? { name: "" };
    to.fillStyle = colour("ink");
    to.textAlign = "left";
    to.fillText(fact.name + (fact.pooling ? " (pooling)" : ""), left, top + 8);
    to.fillStyle = colour("quiet");
    to.textAlign = "right";
    to.fillText(shown ? reason(facts, layer) : "", right, top + 8);
    to.fillStyle = colour("kept");
    to.globalAlpha = 0.55;
    if (layer.rows) to.fillRect(left, top + 20, width, 6);
    to.globalAlpha = shown;
    for (const { row, changed } of layer.list) {
      const x = left + (row + 0.5) / Math.max(1, layer.rows) * (width - 6);
      if (changed) { to.fillStyle = colour("changed"); to.fillRect(x, top + 17, 4, 12); }
      else { to.strokeStyle = colour("equal"); to.lineWidth = 1.5; to.strokeRect(x + 0.5, top + 17.5, 4, 11); }
    }
    to.globalAlpha = 1;
  });
}

function reason(facts, layer) {
  const kept = layer.rows - layer.computed, changed = layer.computed - layer.unchanged;
  const parts = [`${grouped(layer.computed)} of ${grouped(layer.rows)}`];
  if (layer.unchanged) parts.push(`${grouped(layer.unchanged)} equal${changed ? "" : ": the wave ends"}`);
  if (kept > 0) parts.push(layer.level === 0 && facts.candidates === "frozen" ? "the rest is frozen" : "no path to the rest");
  return parts.join(" · ");
}

/** All work so far, compared with full recomputation at each prediction. */
export function workText(facts, work) {
  const sum = of => work.layers.reduce((total, layer) => total + layer[of], 0);
  const [computed, kept, unchanged] = [sum("computed"), sum("kept"), sum("unchanged")];
  if (!computed) return "";
  const share = computed / (computed + kept) * 100;
  if (facts.frames) return `Since the start: ${grouped(computed)} pixels of layers, ${share < 0.1 ? share.toFixed(3) : share.toFixed(1)} % of full recomputation.`;
  return `Since the start: ${grouped(computed)} rows, ${share < 0.1 ? share.toFixed(3) : share.toFixed(1)} % of full recomputation; ${grouped(unchanged)} came out equal; ${grouped(work.reused)} predictions needed nothing.`;
}

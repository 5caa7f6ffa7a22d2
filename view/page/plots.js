// Plots over one time axis and of latencies, and heat maps of cells.

import { begin, colour, grouped, short, time } from "./colours.js";

export const LINES = ["first", "second", "third", "fourth"];
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
const LEFT = 44, BOTTOM = 18, RIGHT = 8;

/** The times in ms at the ends of the axis. */
export function extent(frame) {
  const { now, end, live } = frame.TIME;
  return live ? [Math.max(0, end / 1e3 - 20_000), Math.max(1, end / 1e3)] : [0, Math.max(1, end / 1e3)];
}

/** The time in us at a position on the plot. */
export function timeAt(canvas, frame, clientX) {
  const { left, width } = canvas.getBoundingClientRect(), [from, to] = extent(frame);
  const share = (clientX - left - LEFT) / (width - LEFT - RIGHT);
  return 1e3 * (from + (to - from) * Math.max(0, Math.min(1, share)));
}

/** Predictions over time with the truth; for classes, their probabilities. */
export function drawPrediction(canvas, facts, frame) {
  const { to, width, height } = begin(canvas), { outputs, points, numbers } = frame.SERS, stride = 1 + outputs;
  const values = i => facts.classes ? softmax(numbers.subarray(i * stride + 1, (i + 1) * stride)) : numbers.subarray(i * stride + 1, (i + 1) * stride);
  const rows = Array.from({ length: points }, (_, i) => [numbers[i * stride], values(i)]);
  const shown = facts.classes ? best(softmax(frame.PRED.values), 3) : Array.from({ length: Math.min(outputs, 4) }, (_, i) => i);
  // Each unit has its own axis.
  const units = facts.classes ? [""] : [...new Set(shown.map(output => facts.units[output]))], deep = height / units.length;
  units.forEach((unit, at) => {
    const own = facts.classes ? shown : shown.filter(output => facts.units[output] === unit), truths = facts.truth.filter(of => own.includes(of.output));
    let [low, high] = facts.classes ? [0, 1] : [Infinity, -Infinity];
    if (!facts.classes) {
      const all = rows.flatMap(([, v]) => own.map(i => v[i])).concat(truths.flatMap(t => t.points.map(([, v]) => v)));
      for (const v of all) if (Number.isFinite(v) && v !== null) [low, high] = [Math.min(low, v), Math.max(high, v)];
      if (low > high) [low, high] = [-1, 1];
      const margin = (high - low || 1) * 0.08;
      [low, high] = [low - margin, high + margin];
    }
    const [from, until] = extent(frame), top = at * deep + 6, bottom = (at + 1) * deep - BOTTOM, last = at + 1 === units.length;
    const x = t => LEFT + (t - from) / (until - from) * (width - LEFT - RIGHT), y = v => top + (high - v) / (high - low) * (bottom - top);
    axes(to, width, bottom, [low, high], y, [from, until], x, units.length > 1 ? 3 : 4, last);
    if (units.length > 1) {
      to.textAlign = "left";
      to.fillText(unit, LEFT + 5, top + 5);
    }
    to.save();
    to.beginPath();
    to.rect(LEFT, top - 6, width - LEFT - RIGHT, bottom - top + 6);
    to.clip();
    for (const { output, points } of truths) {
      [to.strokeStyle, to.lineWidth, to.globalAlpha] = [colour(LINES[output]), 5, 0.28];
      path(to, points, x, y);
    }
    to.globalAlpha = 1;
    for (const output of own) {
      const line = facts.classes ? shown.indexOf(output) : output;
      to.strokeStyle = colour(LINES[line]);
      to.lineWidth = 1.8;
      to.setLineDash(DASHES[line]);
      path(to, rows.map(([t, v]) => [t, v[output]]), x, y);
    }
    to.restore();
    cursor(to, x(frame.TIME.now / 1e3), top - 6, bottom);
  });
}

function path(to, points, x, y) {
  to.beginPath();
  let pen = false;
  for (const [t, v] of points) {
    if (v === null || !Number.isFinite(v)) { pen = false; continue; }
    if (pen) to.lineTo(x(t), y(v)); else to.moveTo(x(t), y(v));
    pen = true;
  }
  to.stroke();
}

function axes(to, width, bottom, [low, high], y, [from, until], x, count, times) {
  to.strokeStyle = colour("line");
  to.fillStyle = colour("quiet");
  to.lineWidth = 1;
  for (const v of ticks(low, high, count)) {
    const at = Math.round(y(v)) + 0.5;
    to.beginPath(); to.moveTo(LEFT, at); to.lineTo(width - RIGHT, at); to.stroke();
    to.textAlign = "right";
    to.fillText(tickText(v), LEFT - 6, at);
  }
  to.textAlign = "center";
  for (const t of !times ? [] : ticks(from, until, Math.max(2, width / 110))) {
    const text = until - from >= 4000 ? `${+(t / 1e3).toFixed(2)} s` : `${Math.round(t)} ms`;
    to.fillText(text, Math.min(Math.max(x(t), LEFT + 14), width - 22), bottom + 10);
  }
}

const tickText = v => Math.abs(v) < 1e-9 ? "0" : `${+v.toPrecision(3)}`.replace("-", "−");

function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find(factor => factor * power >= raw) * power, all = [];
  for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-6; v += step) all.push(v);
  return all;
}

function cursor(to, x, top, bottom) {
  [to.strokeStyle, to.lineWidth] = [colour("ink"), 1.2];
  to.setLineDash([]);
  to.beginPath(); to.moveTo(x, top); to.lineTo(x, bottom); to.stroke();
}

/** The histogram of latencies over a logarithmic axis, with p50 and p99. */
export function drawLatency(canvas, late) {
  const { to, width, height } = begin(canvas), bottom = height - BOTTOM, { buckets } = late;
  const used = [...buckets.keys()].filter(i => buckets[i]);
  if (!used.length) {
    to.fillStyle = colour("quiet");
    to.textAlign = "center";
    return to.fillText("Step or play to measure.", width / 2, height / 2);
  }
  const first = Math.max(0, Math.floor(Math.min(used[0], used.at(-1) - 12) / 4) * 4), last = Math.ceil((used.at(-1) + 1) / 4) * 4 + 4;
  const most = Math.max(...buckets), x = us => 4 + (Math.log2(us / 0.1) * 4 - first) / (last - first) * (width - 8);
  to.fillStyle = colour("fourth");
  to.globalAlpha = 0.75;
  for (const i of used) {
    const [a, b] = [x(0.1 * 2 ** (i / 4)), x(0.1 * 2 ** ((i + 1) / 4))], tall = Math.max(1.5, buckets[i] / most * (bottom - 20));
    to.fillRect(a + 0.5, bottom - tall, b - a - 1, tall);
  }
  to.globalAlpha = 1;
  to.fillStyle = colour("quiet");
  to.textAlign = "center";
  for (let i = first; i <= last; i++) {
    const us = 0.1 * 2 ** (i / 4), decade = 10 ** Math.round(Math.log10(us));
    if (Math.abs(Math.log2(us / decade)) < 0.125 && x(decade) > 12 && x(decade) < width - 20) to.fillText(time(decade).replace(/\.0+ /, " "), x(decade), bottom + 10);
  }
  let taken = -Infinity;
  for (const [name, us] of [["p50", late.p50], ["p99", late.p99]]) {
    const at = x(us), text = `${name} ${time(us)}`, half = to.measureText(text).width / 2;
    const label = Math.max(Math.min(Math.max(at, half + 2), width - half - 2), taken + half + 8);
    taken = label + half;
    to.strokeStyle = to.fillStyle = colour("ink");
    to.lineWidth = 1.2;
    to.beginPath(); to.moveTo(at, 15); to.lineTo(at, bottom); to.stroke();
    to.fillText(text, label, 7);
  }
}

/** A heat map for each pooled level, newest cells over older ones, and the readout. */
export function drawCells(canvas, facts, frame) {
  const maps = frame.CELL.map((level, i) => {
    const values = new Float32Array(level.columns * level.rows);
    for (const cell of level.cells) { const at = cell.y * level.columns + cell.x; values[at] = Math.max(values[at], cell.value); }
    const pooling = facts.layers.find(layer => layer.level === i + 1 && layer.pooling);
    return { name: `${pooling?.name ?? "cells"}: ${grouped(level.cells.length)} cells`, columns: level.columns, rows: level.rows, values };
  });
  const { grids, columns, rows, values } = frame.READ;
  for (let g = 0; g < Math.min(grids, 4); g++) maps.push({ name: grids > 1 ? `readout, ${g ? `${g} older` : "newest"}` : `readout: ${columns} × ${rows}`, columns, rows, values: values.subarray(g * columns * rows, (g + 1) * columns * rows) });
  const { to, width, height } = begin(canvas), gap = 14, room = (width - gap * (maps.length - 1)) / maps.length;
  const aspect = facts.sensor[0] / facts.sensor[1], tall = Math.min(height - 20, room / aspect), wide = tall * aspect;
  const ink = colour("changed");
  maps.forEach((map, i) => {
    const left = i * (Math.min(room, wide) + gap), most = Math.max(...map.values, 1e-9);
    to.fillStyle = colour("quiet");
    to.textAlign = "left";
    to.fillText(map.name, left, 7, Math.max(40, wide));
    to.strokeStyle = colour("line");
    to.lineWidth = 1;
    to.strokeRect(left + 0.5, 18.5, wide - 1, tall - 1);
    to.fillStyle = ink;
    const [w, h] = [wide / map.columns, tall / map.rows];
    map.values.forEach((value, at) => {
      if (!value) return;
      to.globalAlpha = 0.08 + 0.92 * Math.sqrt(value / most);
      to.fillRect(left + at % map.columns * w + 0.5, 18 + Math.floor(at / map.columns) * h + 0.5, Math.max(1, w - 1), Math.max(1, h - 1));
    });
    to.globalAlpha = 1;
  });
}

/** Probabilities of logits. */
export function softmax(values) {
  const most = Math.max(...values), powers = Array.from(values, value => Math.exp(value - most));
  const sum = powers.reduce((a, b) => a + b, 0);
  return powers.map(power => power / sum);
}

/** The indices of the largest values, largest first. */
export function best(values, count) {
  return [...values.keys()].sort((a, b) => values[b] - values[a]).slice(0, count);
}

export { short };

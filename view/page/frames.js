// What frame networks read and predict: pictures with the contact and its pressure, electrodes with
// what changed, frames of events; and which pixels of each layer were computed.

import { begin, colour, grouped, rgb, short } from "./colours.js";

const TITLE = 18, GAP = 14;
// viridis (Smith and van der Walt, 2015), at equal distances: colour-blind people see its order.
const VIRIDIS = [[68, 1, 84], [65, 68, 135], [42, 120, 142], [34, 168, 132], [122, 209, 81], [253, 231, 37]];
const ramp = Array.from({ length: 256 }, (_, i) => {
  const at = i / 255 * (VIRIDIS.length - 1), low = Math.min(VIRIDIS.length - 2, Math.floor(at));
  return VIRIDIS[low].map((value, c) => Math.round(value + (VIRIDIS[low + 1][c] - value) * (at - low)));
});

/** Draws the input of the network, and its prediction for pixels. */
export function drawInput(canvas, facts, frame, { contact }) {
  const { to, width, height } = begin(canvas);
  if (frame.PICT) pictures(to, width, height, frame, contact);
  else if (frame.ELEC) electrodes(to, width, height, facts, frame.ELEC);
  else if (frame.SPAR) spikes(to, width, height, frame);
}

/** The text below the input. */
export function inputText(facts, frame) {
  const changed = frame.DIFF && `${grouped(frame.DIFF.set.length)} of ${grouped(frame.DIFF.columns * frame.DIFF.rows)} pixels differ from the one before`;
  if (frame.FORC) {
    const { centre, pixels, threshold } = frame.FORC;
    const where = pixels ? `In contact: ${grouped(pixels)} pixels with more than ${short(threshold * 1e3)} mN, centre at column ${short(centre[0])}, row ${short(centre[1])}` : "No contact";
    return `${where}; ${changed}.`;
  }
  if (frame.ELEC) {
    const steps = facts.frames.steps;
    return `Against the median of each electrode over the ${frame.ELEC.length} readings shown. The network reads the last ${steps} (outlined).`;
  }
  if (frame.SPAR) return `${grouped(frame.SPAR.list.length)} values of ${frame.SPAR.channels} × ${frame.SPAR.columns} × ${frame.SPAR.rows} are not 0; ${changed}.`;
  return "";
}

/** Positions of views with this aspect: as large as possible, side by side or below each other. */
function places(count, aspect, width, height) {
  let found = { scale: 0 };
  for (let columns = 1; columns <= count; columns++) {
    const rows = Math.ceil(count / columns);
    const wide = Math.min((width - GAP * (columns - 1)) / columns, ((height - GAP * (rows - 1)) / rows - TITLE) * aspect);
    if (wide > found.scale) found = { scale: wide, columns };
  }
  const { scale: wide, columns } = found, tall = wide / aspect;
  return Array.from({ length: count }, (_, i) => [i % columns * (wide + GAP), Math.floor(i / columns) * (tall + TITLE + GAP) + TITLE, wide, tall]);
}

function title(to, text, left, top, wide) {
  to.fillStyle = colour("quiet");
  to.textAlign = "left";
  to.fillText(text, left, top - TITLE / 2 - 1, wide);
}

function border(to, left, top, wide, tall) {
  to.strokeStyle = colour("line");
  to.lineWidth = 1;
  to.strokeRect(left + 0.5, top + 0.5, wide - 1, tall - 1);
}

/** Draws pixels, each given by `paint(index, out)`, into a place. */
function pixels(to, columns, rows, paint, [left, top, wide, tall]) {
  const image = new ImageData(columns, rows), out = image.data;
  for (let i = 0; i < columns * rows; i++) paint(i, out, 4 * i);
  const small = document.createElement("canvas");
  [small.width, small.height] = [columns, rows];
  small.getContext("2d").putImageData(image, 0, 0);
  to.imageSmoothingEnabled = wide < columns;
  to.drawImage(small, left, top, wide, tall);
}

/** The next of 1, 2, 5, 10 and so on, so that scales seldom change. */
function ceiling(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find(factor => factor * power >= value * 0.9999) * power;
}

function pictures(to, width, height, { PICT: picture, FORC: force, DIFF: changed }, outline) {
  const { columns, rows } = picture, [first, second, third] = places(3, columns / rows, width, height);
  title(to, outline && force?.pixels ? "Picture, with the outline and the centre of the contact" : "Picture", first[0], first[1], first[2]);
  pixels(to, columns, rows, (i, out, at) => { out[at] = picture.rgb[3 * i]; out[at + 1] = picture.rgb[3 * i + 1]; out[at + 2] = picture.rgb[3 * i + 2]; out[at + 3] = 255; }, first);
  if (force) {
    // N on a pixel over mm² of a pixel is MPa.
    const kpa = 1e3 / force.area, most = ceiling(Math.max(force.most * kpa, 1)), [left, top, wide, tall] = second;
    pixels(to, columns, rows, (i, out, at) => {
      const shade = ramp[Math.max(0, Math.min(255, Math.round(force.values[i] * kpa / most * 255)))];
      [out[at], out[at + 1], out[at + 2], out[at + 3]] = [...shade, 255];
    }, second);
    const bar = Math.min(110, wide * 0.3), label = `${most} kPa`, room = to.measureText(label).width;
    title(to, "Normal pressure", left, top, wide - bar - room - 24);
    const from = left + wide - bar - room - 6;
    for (let i = 0; i < bar; i++) { to.fillStyle = `rgb(${ramp[Math.floor(i / bar * 256)]})`; to.fillRect(from + i, top - 15, 1.5, 9); }
    to.fillStyle = colour("quiet");
    to.textAlign = "right";
    to.fillText("0", from - 4, top - TITLE / 2 - 1);
    to.fillText(label, left + wide, top - TITLE / 2 - 1);
    border(to, left, top, wide, tall);
    if (outline) for (const place of [first, second]) contour(to, force, columns, rows, place);
  }
  if (changed) differing(to, changed, third);
  border(to, ...first);
}

/** The edge of the contact, and a cross at its centre. */
function contour(to, { values, threshold, centre }, columns, rows, [left, top, wide, tall]) {
  const scale = wide / columns, inside = (x, y) => x >= 0 && y >= 0 && x < columns && y < rows && values[y * columns + x] > threshold;
  const edge = new Path2D();
  for (let y = 0; y < rows; y++) {
    for (let x = 0; x < columns; x++) {
      if (!inside(x, y)) continue;
      const [u, v] = [left + x * scale, top + y * scale];
      if (!inside(x - 1, y)) { edge.moveTo(u, v); edge.lineTo(u, v + scale); }
      if (!inside(x + 1, y)) { edge.moveTo(u + scale, v); edge.lineTo(u + scale, v + scale); }
      if (!inside(x, y - 1)) { edge.moveTo(u, v); edge.lineTo(u + scale, v); }
      if (!inside(x, y + 1)) { edge.moveTo(u, v + scale); edge.lineTo(u + scale, v + scale); }
    }
  }
  const cross = new Path2D(), [u, v] = [left + (centre[0] + 0.5) * scale, top + (centre[1] + 0.5) * scale];
  if (Number.isFinite(u)) { cross.moveTo(u - 7, v); cross.lineTo(u + 7, v); cross.moveTo(u, v - 7); cross.lineTo(u, v + 7); }
  to.save();
  to.beginPath();
  to.rect(left, top, wide, tall);
  to.clip();
  for (const [width, stroke] of [[3.4, "#000000"], [1.4, "#ffffff"]]) {
    [to.lineWidth, to.strokeStyle] = [width, stroke];
    to.stroke(edge);
    to.stroke(cross);
  }
  to.restore();
}

function differing(to, changed, place) {
  const [left, top, wide, tall] = place, share = changed.set.length / (changed.columns * changed.rows) * 100;
  title(to, `Changed since the one before: ${share < 0.1 && share ? share.toFixed(2) : share.toFixed(1)} %`, left, top, wide);
  const [r, g, b] = rgb("changed").map(value => 255 * value), set = new Set(changed.set);
  pixels(to, changed.columns, changed.rows, (i, out, at) => { if (set.has(i)) [out[at], out[at + 1], out[at + 2], out[at + 3]] = [r, g, b, 255]; }, place);
  border(to, left, top, wide, tall);
}

function spikes(to, width, height, { SPAR: of, DIFF: changed }) {
  const [first, second] = places(2, of.columns / of.rows, width, height), most = Math.max(...of.list.map(([, value]) => Math.abs(value)), 1e-9);
  title(to, of.channels > 1 ? "Frame: on and off events of each pixel" : "Frame: the sign of each pixel", first[0], first[1], first[2]);
  const shades = { on: rgb("on"), off: rgb("off") }, pixel = of.columns * of.rows, strength = new Float32Array(pixel), on = new Uint8Array(pixel);
  for (const [index, value] of of.list) {
    const at = index % pixel, size = Math.sqrt(Math.abs(value) / most);
    if (size > strength[at]) [strength[at], on[at]] = [size, of.channels > 1 ? Math.floor(index / pixel) : value > 0];
  }
  pixels(to, of.columns, of.rows, (i, out, at) => {
    if (!strength[i]) return;
    const shade = shades[on[i] ? "on" : "off"];
    [out[at], out[at + 1], out[at + 2], out[at + 3]] = [255 * shade[0], 255 * shade[1], 255 * shade[2], 70 + 185 * strength[i]];
  }, first);
  border(to, ...first);
  if (changed) differing(to, changed, second);
}

/** Red above and blue below the median, stronger for a larger difference. */
function deviation(to, value, most, draw, strongest = 1) {
  to.fillStyle = colour(value > 0 ? "on" : "off");
  to.globalAlpha = strongest * Math.min(1, Math.sqrt(Math.abs(value) / most));
  draw();
  to.globalAlpha = 1;
}

function electrodes(to, width, height, facts, readings) {
  const places = facts.frames.electrodes, count = places.length, steps = facts.frames.steps;
  const medians = Array.from({ length: count }, (_, e) => { const all = Float32Array.from(readings, reading => reading.values[e]).sort(); return all[all.length >> 1]; });
  const from = (reading, e) => reading.values[e] - medians[e];
  let widest = 1;
  for (const reading of readings) for (let e = 0; e < count; e++) widest = Math.max(widest, Math.abs(from(reading, e)));
  const most = ceiling(widest), beside = width > 520, [left, top] = [0, TITLE];
  // The fingertip: 11 columns and 12 rows of places.
  const room = beside ? width * 0.46 : width, tall = beside ? height - TITLE - 26 : Math.min(height * 0.5, width * 1.05) - TITLE, cell = Math.min(room / 11, tall / 12);
  const [x, y] = [left + (room - cell * 11) / 2, top + (beside ? Math.max(0, (tall - cell * 12) / 2) : 0)], newest = readings.at(-1);
  title(to, "Electrodes now: counts above or below", left, top, room);
  places.forEach(([column, row], e) => {
    const [u, v] = [x + (column + 0.5) * cell, y + (row + 0.5) * cell], value = newest ? from(newest, e) : 0, radius = cell * 0.47;
    to.beginPath();
    to.arc(u, v, radius, 0, 7);
    to.fillStyle = colour("panel");
    to.fill();
    // Pale enough for the number on it to be read.
    deviation(to, value, most, () => to.fill(), 0.5);
    [to.strokeStyle, to.lineWidth] = [colour("quiet"), 1];
    to.stroke();
    if (cell < 22) return;
    to.fillStyle = colour("ink");
    to.textAlign = "center";
    to.fillText(`${value > 0 ? "+" : value < 0 ? "−" : ""}${Math.round(Math.abs(value))}`, u, v, 2 * radius - 3);
  });
  // The newest readings, one row for each electrode.
  const [a, b] = beside ? [room + 24, TITLE] : [0, top + cell * 12 + TITLE + 22], names = 26, wide = width - a - names, deep = height - b - 24;
  const [w, h] = [wide / Math.max(readings.length, 40), deep / count];
  title(to, `The last ${(readings.length / 100).toFixed(1)} s`, a, b, wide);
  readings.forEach((reading, i) => {
    const u = a + names + wide - (readings.length - i) * w;
    for (let e = 0; e < count; e++) deviation(to, from(reading, e), most, () => to.fillRect(u, b + e * h, Math.max(w, 0.8), Math.max(1, h - 1)));
    if (reading.begins && i) { to.fillStyle = colour("ink"); to.fillRect(u, b, 1, deep); }
  });
  to.fillStyle = colour("quiet");
  to.textAlign = "right";
  for (let e = 0; e < count; e += h < 13 ? 2 : 1) to.fillText(`e${e + 1}`, a + names - 5, b + (e + 0.5) * h);
  [to.strokeStyle, to.lineWidth] = [colour("ink"), 1.5];
  to.strokeRect(a + names + wide - Math.min(steps, readings.length) * w, b - 1, Math.min(steps, readings.length) * w, deep + 1);
  // The scale.
  const bar = Math.min(180, wide * 0.6), start = a + names, under = b + deep + 12;
  to.textAlign = "left";
  for (let i = 0; i < bar; i += 2) deviation(to, (i / bar * 2 - 1) * most, most, () => to.fillRect(start + i, under - 4, 2, 8));
  to.fillStyle = colour("quiet");
  to.fillText(`−${most} to +${most} counts`, start + bar + 8, under);
}

const NEEDS = { squeeze_excite: "needs all pixels", lstm: "steps each time", conv_lstm: "steps each time" };

/** A bar for each layer: what was computed, what came from the output for zeros, what was kept. */
export function drawLayers(canvas, facts, layers, phase) {
  const lane = 17;
  canvas.style.height = `${Math.max(1, layers.length) * lane + 4}px`;
  const { to, width } = begin(canvas), names = Math.min(110, width * 0.24), texts = Math.min(205, width * 0.42), wide = width - names - texts - 12;
  layers.forEach(({ computed, kept, absorbed }, i) => {
    const all = computed + kept + absorbed, top = i * lane + 2, fact = facts.layers[i] ?? { name: "" }, shown = Math.max(0, Math.min(1, phase - i));
    to.fillStyle = colour("ink");
    to.textAlign = "left";
    to.fillText(fact.name, 0, top + lane / 2, names - 6);
    to.fillStyle = colour("kept");
    to.globalAlpha = 0.55;
    to.fillRect(names, top + 5, wide, 6);
    to.globalAlpha = shown;
    const [a, b] = all ? [wide * computed / all, wide * absorbed / all] : [0, 0];
    to.fillStyle = colour("changed");
    to.fillRect(names, top + 3, computed ? Math.max(1.5, a) : 0, 10);
    [to.strokeStyle, to.lineWidth] = [colour("equal"), 1.5];
    if (b > 2) to.strokeRect(names + a + 0.75, top + 3.75, b - 1.5, 8.5);
    to.fillStyle = colour("quiet");
    to.textAlign = "right";
    const why = computed && NEEDS[fact.word];
    to.fillText(all ? `${grouped(computed)} of ${grouped(all)}${why && width > 430 ? ` · ${why}` : ""}` : "in place", width, top + lane / 2, texts);
    to.globalAlpha = 1;
  });
}

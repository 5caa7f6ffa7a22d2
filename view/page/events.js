// The events of the window: red on, blue off, fading with age, larger than their pixels so that a
// single event is visible. Uses WebGL2, or a plain canvas without it. An overlay shows the newest
// event, its neighbourhood, the rows of the wave and the cells.

import { begin, colour, fit, rgb } from "./colours.js";

const VERTEX = `#version 300 es
layout(location = 0) in uvec2 event;
uniform vec2 sensor, offset, scale, canvas;
uniform float size, span;
uniform vec3 on, off;
out vec4 shade;
void main() {
  vec2 pixel = vec2(event.x & 0xffffu, event.x >> 16) + 0.5;
  vec2 place = (offset + pixel * scale) / canvas * 2.0 - 1.0;
  gl_Position = vec4(place.x, -place.y, 0, 1);
  gl_PointSize = size;
  float age = float(event.y >> 1) / span;
  shade = vec4((event.y & 1u) == 1u ? on : off, 0.06 + 0.94 * exp(-5.0 * age));
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec4 shade;
out vec4 pixel;
void main() { pixel = vec4(shade.rgb * shade.a, shade.a); }`;

/** A painter of events on a canvas of its own. */
export function painter(canvas) {
  // The drawing buffer is kept for screenshots.
  const gl = canvas.getContext("webgl2", { premultipliedAlpha: true, preserveDrawingBuffer: true, antialias: false });
  return gl && webgl(canvas, gl) || plain(canvas);
}

function webgl(canvas, gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
  const at = Object.fromEntries(["offset", "scale", "canvas", "size", "span", "on", "off"].map(name => [name, gl.getUniformLocation(program, name)]));
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.enableVertexAttribArray(0);
  gl.vertexAttribIPointer(0, 2, gl.UNSIGNED_INT, 0, 0);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.useProgram(program);
  return (events, view) => {
    const { ratio } = fit(canvas);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (!events.count) return;
    gl.uniform2f(at.offset, view.left * ratio, view.top * ratio);
    gl.uniform2f(at.scale, view.scale * ratio, view.scale * ratio);
    gl.uniform2f(at.canvas, canvas.width, canvas.height);
    gl.uniform1f(at.size, view.size * ratio);
    gl.uniform1f(at.span, view.span);
    gl.uniform3f(at.on, ...rgb("on"));
    gl.uniform3f(at.off, ...rgb("off"));
    gl.bufferData(gl.ARRAY_BUFFER, events.words, gl.STREAM_DRAW);
    gl.drawArrays(gl.POINTS, 0, events.count);
  };
}

function plain(canvas) {
  return (events, view) => {
    const { to } = begin(canvas), { size } = view;
    for (let i = 0; i < events.count; i++) {
      to.globalAlpha = 0.06 + 0.94 * Math.exp(-5 * events.age(i) / view.span);
      to.fillStyle = colour(events.on(i) ? "on" : "off");
      const [x, y] = view.place(events.x(i), events.y(i));
      to.fillRect(x - size / 2, y - size / 2, size, size);
    }
    to.globalAlpha = 1;
  };
}

/** Where the pixels of a sensor lie on a canvas of this size. */
export function viewOf([columns, rows], span, width, height) {
  const scale = Math.min(width / columns, height / rows);
  const [left, top] = [(width - columns * scale) / 2, (height - rows * scale) / 2];
  const place = (x, y) => [left + (x + 0.5) * scale, top + (y + 0.5) * scale];
  // Enlarged, because a pixel of the sensor may be smaller than one of the screen.
  return { scale, left, top, span, place, size: Math.max(scale * 1.1, 2.4), width: columns * scale, height: rows * scale };
}

/** The newest event with its neighbours, the wave up to `phase` layers, and the cells. */
export function overlay(canvas, frame, view, { graph, grid, phase }) {
  const { to } = begin(canvas), events = frame.EVNT;
  to.lineWidth = 1;
  to.strokeStyle = colour("line");
  to.strokeRect(view.left + 0.5, view.top + 0.5, view.width - 1, view.height - 1);
  const near = frame.NEAR ?? [], wave = frame.WAVE ?? [];
  if (grid && frame.READ) lines(to, view, frame.CELL.at(0) ?? frame.READ);
  if (!events.count) return;
  const newest = events.count - 1, place = i => view.place(events.x(i), events.y(i)), [x, y] = place(newest);
  if (graph) {
    for (const [width, stroke] of [[4, "panel"], [1.5, "ink"]]) {
      to.beginPath();
      for (const i of near) { to.moveTo(x, y); to.lineTo(...place(i)); }
      [to.lineWidth, to.strokeStyle] = [width, colour(stroke)];
      to.stroke();
    }
    to.fillStyle = colour("ink");
    for (const i of near) { const [u, v] = place(i); to.beginPath(); to.arc(u, v, 3, 0, 7); to.fill(); }
  }
  // The last layer of events that the wave has reached.
  const reached = wave.slice(0, Math.ceil(phase)).filter(layer => layer.level === 0).at(-1);
  if (reached && reached.list.length < 2000) {
    to.lineWidth = 1.5;
    for (const { row, changed } of reached.list) {
      to.strokeStyle = colour(changed ? "changed" : "equal");
      const [u, v] = place(row);
      to.strokeRect(u - 4, v - 4, 8, 8);
    }
  }
  if (graph && near.length && view.width > 260) lens(to, frame, view, [x, y]);
  for (const [width, stroke] of [[6, "panel"], [2.5, "ink"]]) {
    to.beginPath();
    to.arc(x, y, 9, 0, 7);
    [to.lineWidth, to.strokeStyle] = [width, colour(stroke)];
    to.stroke();
  }
  to.fillStyle = colour(events.on(newest) ? "on" : "off");
  to.beginPath();
  to.arc(x, y, 4.5, 0, 7);
  to.fill();
}

// The neighbourhood of the newest event, enlarged, in the corner that is farthest from it.
function lens(to, { EVNT: events, NEAR: near }, view, [x, y]) {
  const newest = events.count - 1, [u, v] = [events.x(newest), events.y(newest)], size = Math.min(150, view.width * 0.3);
  const reach = 2.5 + Math.max(2, ...Array.from(near, i => Math.max(Math.abs(events.x(i) - u), Math.abs(events.y(i) - v))));
  if (reach > 60) return;
  const left = x < view.left + view.width / 2 ? view.left + view.width - size - 6 : view.left + 6;
  const top = y < view.top + view.height / 2 ? view.top + view.height - size - 6 : view.top + 6;
  const pixel = size / (2 * reach), place = i => [left + size / 2 + (events.x(i) - u) * pixel, top + size / 2 + (events.y(i) - v) * pixel];
  to.save();
  to.beginPath();
  to.roundRect(left, top, size, size, 6);
  to.fillStyle = colour("panel");
  to.fill();
  [to.strokeStyle, to.lineWidth] = [colour("quiet"), 1];
  to.stroke();
  to.clip();
  for (let i = 0; i < events.count; i++) {
    if (Math.abs(events.x(i) - u) > reach || Math.abs(events.y(i) - v) > reach) continue;
    to.globalAlpha = 0.06 + 0.8 * Math.exp(-5 * events.age(i) / view.span);
    to.fillStyle = colour(events.on(i) ? "on" : "off");
    const [a, b] = place(i);
    to.fillRect(a - pixel / 2, b - pixel / 2, pixel, pixel);
  }
  to.globalAlpha = 1;
  [to.strokeStyle, to.lineWidth] = [colour("ink"), 1.5];
  to.beginPath();
  for (const i of near) { to.moveTo(left + size / 2, top + size / 2); to.lineTo(...place(i)); }
  to.stroke();
  to.fillStyle = colour("ink");
  for (const i of near) { const [a, b] = place(i); to.beginPath(); to.arc(a, b, 3, 0, 7); to.fill(); }
  to.beginPath();
  to.arc(left + size / 2, top + size / 2, 5, 0, 7);
  [to.fillStyle, to.strokeStyle, to.lineWidth] = [colour(events.on(newest) ? "on" : "off"), colour("ink"), 2];
  to.fill();
  to.stroke();
  to.restore();
}

function lines(to, view, { columns, rows }) {
  to.beginPath();
  for (let i = 1; i < columns; i++) { const x = Math.round(view.left + view.width * i / columns) + 0.5; to.moveTo(x, view.top); to.lineTo(x, view.top + view.height); }
  for (let i = 1; i < rows; i++) { const y = Math.round(view.top + view.height * i / rows) + 0.5; to.moveTo(view.left, y); to.lineTo(view.left + view.width, y); }
  [to.lineWidth, to.strokeStyle, to.globalAlpha] = [1, colour("quiet"), 0.35];
  to.stroke();
  to.globalAlpha = 1;
}

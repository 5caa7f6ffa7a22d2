// The colours of the style sheet for canvases, and canvases in the pixels of the screen.

let known = {};

/** Forgets the colours, because the theme has changed. */
export function forget() { known = {}; }

/** A colour by its name in the style sheet. */
export function colour(name) {
  return known[name] ??= getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** "#rrggbb" as numbers from 0 to 1. */
export function rgb(name) {
  const number = parseInt(colour(name).slice(1), 16);
  return [number >> 16 & 255, number >> 8 & 255, number & 255].map(value => value / 255);
}

/** Sets a canvas's bitmap to the screen's resolution; returns the canvas's size on the page. */
export function fit(canvas) {
  const { width, height } = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  const [columns, rows] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
  return { width, height, ratio };
}

/** A cleared canvas to draw on in units of the page. */
export function begin(canvas) {
  const { width, height, ratio } = fit(canvas), to = canvas.getContext("2d");
  to.setTransform(ratio, 0, 0, ratio, 0, 0);
  to.clearRect(0, 0, width, height);
  to.font = `12px ${colour("sans")}`;
  to.textBaseline = "middle";
  return { to, width, height };
}

/** A number with thousands separated. */
export const grouped = number => Math.round(number).toLocaleString("en-US");

/** A number with about three digits. */
export function short(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  return value.toFixed(size >= 100 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3);
}

/** Microseconds with a fitting unit. */
export function time(us) {
  if (!Number.isFinite(us)) return "–";
  return us < 1000 ? `${short(us)} µs` : us < 1e6 ? `${short(us / 1e3)} ms` : `${short(us / 1e6)} s`;
}

// What the address holds after the #, so that a copied address shows the same.

const KEYS = ["event", "network", "speed", "theme", "compare", "grid", "graph", "slowness", "playing", "sensor"];
let written = "", wanted = "", waiting = 0;

/** The state of the address: texts by key. */
export function read() {
  const parameters = new URLSearchParams(location.hash.slice(1));
  return Object.fromEntries(KEYS.filter(key => parameters.has(key)).map(key => [key, parameters.get(key)]));
}

/** Writes the state into the address, at most a few times a second: browsers refuse more. */
export function write(state) {
  wanted = `#${new URLSearchParams(Object.entries(state).filter(([, value]) => value !== undefined && value !== null))}`;
  if (waiting || wanted === written) return;
  replace();
  waiting = setTimeout(() => { waiting = 0; if (wanted !== written) replace(); }, 400);
}

function replace() {
  written = wanted;
  history.replaceState(null, "", written);
}

// A recording from the visitor's own disk: dropped on the page, or chosen. It stays in the page.

import { showSlip } from "./slip.js";

/** Largest file that is read into the page's memory. */
const MAX_BYTES = 512 * 2 ** 20;

const HINT = "Drop a recording here: events in any format, or readings of electrodes. It stays on this machine.";

/** Lets people open files and sends them to `engine`, the worker. */
export function begin(engine) {
  const input = Object.assign(document.createElement("input"), { type: "file", hidden: true, id: "file" });
  const button = (id, text, title, act) => Object.assign(document.createElement("button"), { id, textContent: text, title, onclick: act });
  const choose = button("open", "Open…", "Open a recording from this machine; it stays in this page (O)", () => input.click());
  const press = button("press", "Press", "Show the embedded press again", () => { showSlip(null); engine.postMessage({ press: true }); });
  const buttons = document.querySelector("header .buttons");
  buttons.prepend(choose, press, input);
  buttons.style.flexWrap = "wrap";
  const hint = Object.assign(document.createElement("p"), { className: "quiet", id: "drop-hint", textContent: HINT });
  hint.setAttribute("role", "status");
  const say = (text, bad = false) => { hint.textContent = text; hint.style.color = bad ? "var(--bad)" : ""; };
  document.querySelector("main").before(hint);
  Object.assign(hint.style, { padding: "8px 12px 0", textAlign: "center", fontSize: "12.5px" });

  const open = async file => {
    if (!file) return;
    if (file.size > MAX_BYTES) return say(`${file.name}: expected at most ${MAX_BYTES} bytes, found ${file.size}`, true);
    say(`Reading ${file.name}…`);
    const bytes = new Uint8Array(await file.arrayBuffer());
    engine.postMessage({ open: { name: file.name, bytes } }, [bytes.buffer]);
  };
  input.onchange = () => { open(input.files[0]); input.value = ""; };
  addEventListener("dragover", event => { event.preventDefault(); document.body.style.outline = "3px solid var(--off)"; document.body.style.outlineOffset = "-3px"; });
  const still = () => { document.body.style.outline = ""; };
  addEventListener("dragleave", still);
  addEventListener("drop", event => { event.preventDefault(); still(); open(event.dataTransfer.files[0]); });
  addEventListener("keydown", event => {
    if (event.key.toLowerCase() === "o" && !event.ctrlKey && !event.metaKey && !event.altKey && !event.target.matches?.("select, input, dialog *")) choose.click();
  });
  engine.addEventListener("message", ({ data }) => {
    if (data.refused) return say(data.refused, true);
    if (!data.opened && !data.slip) return;
    say(HINT);
    showSlip(data.slip ?? null);
  });
}

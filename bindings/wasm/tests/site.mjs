// Tests the page and its module: node tests/site.mjs SITE HASH TOOLS [SCREENSHOTS].
// HASH is that of the press in the fixed run, in 16 digits; TOOLS has node_modules.
import { existsSync } from "node:fs";
import { readdir, readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { extname, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";

const [site, hash, tools, screenshots] = process.argv.slice(2);
const MAX_BYTES = 4e6;

function check(right, text) {
  if (!right) throw new Error(`expected ${text}`);
  console.log(text);
}

// What a visitor loads.
const sizes = { raw: 0, gzip: 0, brotli: 0 };
for (const file of (await readdir(site)).filter(file => !file.endsWith(".d.ts"))) {
  const bytes = await readFile(join(site, file));
  sizes.raw += bytes.length;
  sizes.gzip += gzipSync(bytes, { level: 9 }).length;
  sizes.brotli += brotliCompressSync(bytes, { params: { [constants.BROTLI_PARAM_QUALITY]: 9 } }).length;
}
check(sizes.gzip < MAX_BYTES, `at most ${MAX_BYTES} bytes by gzip: ${JSON.stringify(sizes)}`);

// The module in Node.js, as programs use it.
const module = await import(pathToFileURL(join(resolve(site), "meissner_wasm.js")));
await module.default({ module_or_path: await readFile(join(site, "meissner_wasm_bg.wasm")) });
check(module.pressHash() === hash, `Node.js: the press gives ${hash}, as the native build does`);
calls();

/** What the module promises to programs. */
function calls() {
  const press = module.press(), [t, x, y, on] = [press.t_us, press.x, press.y, press.on];
  const engine = new module.Engine("tactigraph-past", press.width, press.height);
  const head = [t, x, y, on].map(values => values.subarray(0, 2000));
  engine.pushArrays(...head);
  const state = engine.snapshot(), before = engine.predict();
  const other = new module.Engine("tactigraph-past", press.width, press.height);
  for (let i = 0; i < 2000; i++) other.push(t[i], x[i], y[i], on[i] === 1);
  check(`${other.predict()}` === `${before}`, "one by one as in arrays");
  engine.push(t[2000], x[2000], y[2000], true);
  engine.restore(state);
  check(`${engine.predict()}` === `${before}`, "a restored state gives its prediction");
  const refused = (text, call) => {
    let message = "nothing";
    try { call(); } catch (error) { message = error.message; }
    check(message.includes(text), `a refusal that says ${JSON.stringify(text)}: ${message.slice(0, 160)}`);
  };
  refused("expected", () => engine.restore(new Uint8Array(8)));
  refused("one length", () => engine.pushArrays(t, x, y, new Uint8Array(1)));
  refused('the feature "canf"', () => new module.Electrodes("canf"));
  refused('the feature "tactigraph"', () => new module.Engine("tactigraph", 346, 260));
  refused("expected", () => new module.Recording(new TextEncoder().encode("no recording at all")));
  refused("24 values", () => new module.Electrodes("slip-best").push(new Float32Array(3)));
  const text = `${Array.from({ length: 24 }, (_, i) => `e${i + 1}`)}\n${`${Array.from({ length: 24 }, (_, i) => 3000 + 20 * i)}\n`.repeat(6)}`;
  const readings = module.Electrodes.decode(new TextEncoder().encode(text)), slip = new module.Electrodes("slip-best");
  const given = Array.from({ length: 6 }, (_, i) => slip.push(readings.subarray(24 * i, 24 * i + 24)));
  check(given.slice(0, 4).every(logits => logits === undefined) && given[5].length === 7, "slip: a class from five readings on");
}

const executablePath = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
const playwright = tools && existsSync(join(tools, "node_modules/playwright-core"));
if (!executablePath || !playwright) {
  console.log("skipped: no Chromium, or no playwright-core");
  process.exit(0);
}
const { chromium } = createRequire(join(resolve(tools), "package.json"))("playwright-core");
const types = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".wasm": "application/wasm" };
// The headers of docs/browser.md.
const headers = {
  "content-security-policy": "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'",
  "cross-origin-embedder-policy": "require-corp", "cross-origin-opener-policy": "same-origin",
};
const server = createServer(async (request, response) => {
  const path = new URL(request.url, "http://localhost").pathname, file = path === "/" ? "/index.html" : path;
  try {
    const bytes = await readFile(join(site, file));
    response.writeHead(200, { ...headers, "content-type": types[extname(file)] ?? "application/octet-stream" }).end(bytes);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise(done => server.listen(0, "127.0.0.1", done));
const address = `http://127.0.0.1:${server.address().port}`;
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"] });
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } }), faults = [];
  // Bits and speed, without anything to draw.
  await page.goto(`${address}/icon.svg`);
  const found = await page.evaluate(async () => {
    const module = await import("/meissner_wasm.js");
    await module.default();
    const press = module.press(), all = [press.t_us, press.x, press.y, press.on], mins = [], SLICE = 200;
    const engine = new module.Engine("tactigraph-past", press.width, press.height);
    // The least time of each slice: other programs of the machine do not count.
    for (let round = 0; round < 10; round++) {
      engine.reset();
      for (let i = 0, k = 0; i < press.length; i += SLICE, k++) {
        const slice = all.map(values => values.subarray(i, i + SLICE)), began = performance.now();
        engine.predictEach(...slice);
        mins[k] = Math.min(mins[k] ?? Infinity, performance.now() - began);
      }
    }
    return { hash: module.pressHash(), us: mins.reduce((a, b) => a + b) * 1e3 / press.length };
  });
  check(found.hash === hash, `Chromium ${browser.version()}: the press gives ${hash}`);
  console.log(`tactigraph-past: ${found.us.toFixed(2)} us an event with its prediction, ${Math.round(1e6 / found.us)} a second`);
  // How fast a machine is depends on the machine: a bound is asked for.
  const least = Number(process.env.MEISSNER_WASM_RATE ?? 0);
  check(1e6 / found.us >= least, `at least ${least} events a second`);

  // The page with the press.
  page.on("console", message => { if (message.type() === "error") faults.push(message.text()); });
  page.on("pageerror", error => faults.push(error.message));
  await page.goto(address);
  await page.waitForFunction(() => window.meissner?.frame?.TIME?.taken > 100, null, { timeout: 60_000 });
  // On a slow machine it may have come to its end by itself.
  if (await page.evaluate(() => window.meissner.frame.TIME.playing)) await page.keyboard.press("Space");
  await page.waitForFunction(() => !window.meissner.frame.TIME.playing);
  await page.evaluate(() => window.meissner.send({ do: "seek_event", event: 5000 }));
  await page.waitForFunction(() => window.meissner.frame.TIME.taken === 5000);
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => window.meissner.frame.TIME.taken === 5001);
  console.log("the page plays the press, pauses and steps");
  await page.selectOption("#network", "digits-past");
  await page.waitForFunction(() => window.meissner.facts.network === "digits-past" && !window.meissner.frame.TIME.seeking);
  await page.selectOption("#network", "tactigraph-past");
  await page.evaluate(() => window.meissner.send({ do: "seek_event", event: 20_000 }));
  await page.waitForFunction(() => window.meissner.frame.TIME.taken === 20_000);
  if (screenshots) await page.screenshot({ path: join(screenshots, "browser-1280.png") });
  // A file of the visitor.
  const csv = `t_us,x,y,p\n${Array.from({ length: 500 }, (_, i) => `${1000 * i},${100 + i % 60},${80 + i % 40},${i % 2}`).join("\n")}\n`;
  await page.setInputFiles("#file", { name: "own.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
  await page.waitForFunction(() => document.getElementById("input").textContent.includes("own.csv"));
  console.log("the page opens a file");
  await page.setInputFiles("#file", { name: "broken.bin", mimeType: "application/octet-stream", buffer: Buffer.from([1, 2, 3, 4]) });
  await page.waitForFunction(() => document.getElementById("drop-hint").textContent.includes("broken.bin"));
  console.log(`a broken one: ${await page.textContent("#drop-hint")}`);
  const header = Array.from({ length: 24 }, (_, i) => `ff_e${i + 1}`).join(",");
  const row = i => Array.from({ length: 24 }, (_, e) => 3000 + 20 * e + Math.round(200 * Math.sin((i + e) / 7))).join(",");
  const grasp = process.env.MEISSNER_GRASP ? await readFile(process.env.MEISSNER_GRASP) : Buffer.from(`${header}\n${Array.from({ length: 60 }, (_, i) => row(i)).join("\n")}\n`);
  await page.setInputFiles("#file", { name: "grasp.csv", mimeType: "text/csv", buffer: grasp });
  await page.waitForSelector("#slip-panel:not([hidden])");
  console.log(`slip: ${await page.textContent("#slip-answer")}`);
  if (screenshots) await page.screenshot({ path: join(screenshots, "browser-slip-1280.png") });
  await page.setViewportSize({ width: 390, height: 800 });
  await page.click("#press");
  await page.waitForFunction(() => window.meissner.frame.TIME.taken > 50 && !document.querySelector("main").hidden);
  if (screenshots) await page.screenshot({ path: join(screenshots, "browser-390.png"), fullPage: true });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  check(wide <= 390, "no scrolling sideways at 390 pixels");
  check(faults.length === 0, `no errors in the console: ${faults.join("; ")}`);
} finally {
  await browser.close();
  server.close();
}

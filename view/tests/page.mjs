// The page in a browser. `.ci/view` runs it; it ends with the first claim that does not hold.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { createRequire } from "node:module";
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { chromium } = createRequire(new URL("../../target/view/", import.meta.url))("playwright-core");
const pictures = new URL("../../target/view/pictures/", import.meta.url).pathname;
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
// Machado, Oliveira and Fernandes (2009), severity 1, over linear light.
const matrix = rows => colour => rows.map(row => row.reduce((sum, share, i) => sum + share * colour[i], 0));
const blindness = {
  protanopia: matrix([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]),
  deuteranopia: matrix([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]),
  tritanopia: matrix([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]]),
};
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox", "--enable-unsafe-swiftshader"] });
const programs = [], folder = mkdtempSync(join(tmpdir(), "meissner-view-"));
// Also where a claim does not hold.
process.on("exit", () => { for (const program of programs) program.kill("SIGINT"); });

/** The address that a new program prints. */
async function view(...options) {
  const program = spawn(process.env.MEISSNER, ["view", "--no-browser", "--json", ...options], { stdio: ["pipe", "pipe", "ignore"] });
  programs.push(program);
  let printed = "";
  return new Promise((found, failed) => {
    program.on("exit", code => failed(new Error(`the program ended with ${code}: ${printed}`)));
    program.stdout.on("data", data => { printed += data; if (printed.includes("\n")) found(JSON.parse(printed).url); });
  });
}

/** What a new program says of itself. */
async function started(options, pattern) {
  const program = spawn(process.env.MEISSNER, options, { stdio: ["ignore", "ignore", "pipe"] });
  programs.push(program);
  let printed = "";
  return new Promise((found, failed) => {
    program.on("exit", code => failed(new Error(`the program ended with ${code}: ${printed}`)));
    program.stderr.on("data", data => { printed += data; const match = pattern.exec(printed); if (match) found(match[1]); });
  });
}

/** A page of this width, and what it complained about. */
async function open(url, { width = 1280, height = 900, init, ...options } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, acceptDownloads: true, ...options });
  const page = await context.newPage(), complaints = [];
  page.on("console", message => { if (message.type() === "error") complaints.push(message.text()); });
  page.on("pageerror", error => complaints.push(error.message));
  page.on("request", request => { if (!/^(blob:|data:)/.test(request.url()) && new URL(request.url()).hostname !== "127.0.0.1") complaints.push(`left the machine: ${request.url()}`); });
  if (init) await page.addInitScript(init);
  await page.goto(url);
  await page.waitForFunction(() => window.meissner?.frame?.TIME && !window.meissner.frame.TIME.seeking);
  return { page, complaints, close: () => context.close() };
}

const time = page => page.evaluate(() => window.meissner.frame.TIME);
const until = (page, what, argument) => page.waitForFunction(what, argument, { timeout: 60_000 });
const taken = (page, event) => until(page, event => window.meissner.frame.TIME.taken === event && !window.meissner.frame.TIME.seeking, event);

async function claim(name, check) {
  await check();
  console.log(`ok: ${name}`);
}

const url = await view();

await claim("it plays the press, and shows events, a wave and a prediction", async () => {
  const { page, complaints, close } = await open(url);
  await until(page, () => window.meissner.frame.TIME.taken > 200 && window.meissner.frame.TIME.playing);
  await page.keyboard.press("Space");
  await until(page, () => !window.meissner.frame.TIME.playing);
  const shown = await page.evaluate(() => ({
    events: window.meissner.frame.EVNT.count, wave: window.meissner.frame.WAVE.map(layer => layer.computed),
    values: [...window.meissner.frame.PRED.values], points: window.meissner.frame.SERS.points,
    texts: document.getElementById("values").textContent,
  }));
  assert.ok(shown.events > 200 && shown.points > 1 && shown.values.every(Number.isFinite), JSON.stringify(shown));
  assert.deepEqual(shown.wave, [1, 1, 1]);
  assert.match(shown.texts, /roll.*rad.*pitch.*rad/);
  assert.ok(await coloured(page) > 100, "events are drawn");
  await page.locator("#scrubber").fill("14000");
  await taken(page, 14000);
  const before = await time(page);
  await page.keyboard.press("ArrowRight");
  await taken(page, 14001);
  await page.keyboard.press("Shift+ArrowLeft");
  await taken(page, 13901);
  await page.keyboard.press("End");
  await taken(page, before.events);
  await page.keyboard.press("Home");
  await taken(page, 0);
  // Drag over the prediction: one cursor for all panels.
  const plot = await page.locator("#prediction").boundingBox();
  await page.mouse.move(plot.x + plot.width * 0.3, plot.y + 50);
  await page.mouse.down();
  await page.mouse.move(plot.x + plot.width * 0.6, plot.y + 50, { steps: 4 });
  await page.mouse.up();
  // The places on the way are sought as well.
  await until(page, () => {
    const { now, seeking, taken } = window.meissner.frame.TIME;
    return now > 150_000 && !seeking && Number(document.getElementById("scrubber").value) === taken;
  });
  assert.deepEqual(complaints, []);
  await close();
});

await claim("the address brings one back to the same place, and the bits agree with full recomputation", async () => {
  const { page, complaints, close } = await open(`${url}#event=9000&playing=0&compare=1&network=tactigraph-past&grid=1`);
  await taken(page, 9000);
  await page.locator("#verdict.good").waitFor({ timeout: 60_000 });
  assert.match(await page.locator("#verdict").textContent(), /All bits of [\d,]+ rows agree at event 9,000/);
  await page.waitForTimeout(1000);
  assert.match(page.url(), /event=9000/);
  await page.keyboard.press("b");
  await until(page, () => document.getElementById("compare-panel").hidden);
  await page.locator("#network").selectOption("digits-past");
  await until(page, () => window.meissner.facts.network === "digits-past" && window.meissner.frame.CELL.length === 1 && window.meissner.frame.TIME.taken === 9000);
  assert.equal(await page.locator("#values div").count(), 3, "the best three classes");
  await page.locator("#network").selectOption("tactigraph-past");
  await until(page, () => window.meissner.facts.network === "tactigraph-past");
  assert.deepEqual(complaints, []);
  await close();
});

await claim("keys, help and the screenshot work", async () => {
  const { page, complaints, close } = await open(`${url}#event=12000&playing=0`);
  await taken(page, 12000);
  await page.keyboard.press("?");
  assert.ok(await page.locator("#keys").isVisible());
  await page.keyboard.press("Escape");
  assert.ok(!await page.locator("#keys").isVisible());
  await page.keyboard.press("d");
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await page.keyboard.press("d");
  const { speed } = await time(page);
  await page.keyboard.press(".");
  await until(page, speed => window.meissner.frame.TIME.speed > speed, speed);
  await page.keyboard.press(",");
  const [picture] = await Promise.all([page.waitForEvent("download"), page.keyboard.press("s")]);
  await picture.saveAs(`${pictures}button.png`);
  assert.ok(readFileSync(`${pictures}button.png`).length > 20_000);
  const reached = new Set();
  for (let i = 0; i < 40; i++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => document.activeElement.id));
  }
  for (const id of ["network", "compare", "theme", "shot", "help", "graph", "grid", "slowness", "again", "back", "play", "forth", "scrubber", "speed"]) assert.ok(reached.has(id), `Tab reaches ${id}`);
  assert.deepEqual(complaints, []);
  await close();
});

await claim("text has a contrast of 4.5, and the colour-blind tell the colours apart, light and dark", async () => {
  const { page, close } = await open(`${url}#event=12000&playing=0&compare=1`);
  await page.locator("#verdict.good").waitFor({ timeout: 60_000 });
  for (const theme of ["light", "dark"]) {
    if (theme === "dark") await page.keyboard.press("d");
    await page.waitForTimeout(400);
    const weak = await page.evaluate(() => {
      const parse = text => text.match(/[\d.]+/g).map(Number), channel = v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
      const luminance = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
      const ground = element => { for (let at = element; at; at = at.parentElement) { const c = parse(getComputedStyle(at).backgroundColor); if (c.length === 3 || c[3] === 1) return c; } return [255, 255, 255]; };
      const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
      for (let text = texts.nextNode(); text; text = texts.nextNode()) {
        const element = text.parentElement;
        if (!text.data.trim() || !element.checkVisibility() || element.closest("script, option")) continue;
        const [a, b] = [luminance(parse(getComputedStyle(element).color)), luminance(ground(element))].sort((x, y) => y - x);
        if ((a + 0.05) / (b + 0.05) < 4.5) found.push(`${text.data.trim()}: ${((a + 0.05) / (b + 0.05)).toFixed(2)}`);
      }
      return found;
    });
    assert.deepEqual(weak, [], theme);
    const colours = await page.evaluate(() => Object.fromEntries(["on", "off", "changed", "equal", "panel", "first", "second"].map(name => [name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim()])));
    for (const [kind, see] of Object.entries(blindness)) {
      for (const [a, b] of [["on", "off"], ["changed", "equal"], ["on", "panel"], ["off", "panel"], ["first", "second"]]) {
        const distance = Math.hypot(...see(linear(colours[a])).map((v, i) => 255 * (gamma(v) - gamma(see(linear(colours[b]))[i]))));
        assert.ok(distance > 60, `${theme}, ${kind}: ${a} and ${b} are ${distance.toFixed(0)} apart`);
      }
    }
  }
  await close();
});

await claim("with reduced motion it waits, and a wave is there at once", async () => {
  const { page, close } = await open(url, { reducedMotion: "reduce" });
  await until(page, () => !window.meissner.frame.TIME.playing);
  await page.keyboard.press("ArrowRight");
  const { taken: at } = await time(page);
  await page.waitForTimeout(500);
  assert.ok((await time(page)).taken <= at + 1);
  await close();
});

await claim("without WebGL it draws on a canvas", async () => {
  const init = () => { const own = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = function (kind, ...rest) { return kind === "webgl2" ? null : own.call(this, kind, ...rest); }; };
  const { page, complaints, close } = await open(`${url}#event=12000&playing=0`, { init });
  await taken(page, 12000);
  assert.ok(await coloured(page) > 100);
  assert.deepEqual(complaints, []);
  await close();
});

// Pictures of a ball that comes and goes, as raw video. It only has to be a contact.
const video = join(folder, "ball.rgb"), clip = Buffer.alloc(12 * 320 * 240 * 3);
for (let n = 0; n < 12; n++) {
  const radius = 34 * Math.sin(Math.PI * n / 11);
  for (let i = 0; i < 320 * 240; i++) {
    const [x, y] = [i % 320 - 150 - 2 * n, Math.floor(i / 320) - 110], far = Math.hypot(x, y) / Math.max(radius, 1e-3);
    const slope = far < 1 ? 60 * far * Math.exp(-2 * (far - 0.6) ** 2) : 0, away = Math.atan2(y, x);
    [0, 2.1, 4.2].forEach((light, c) => { clip[(n * 320 * 240 + i) * 3 + c] = 110 + slope * Math.cos(away - light); });
  }
}
writeFileSync(video, clip);

await claim("pictures show the contact, its pressure, and what was recomputed", async () => {
  const { page, complaints, close } = await open(`${await view(video, "--network", "canf-plain", "--video", "320x240@25")}#event=6&playing=0`);
  await taken(page, 6);
  const shown = await page.evaluate(() => {
    const { PICT, FORC, DIFF, LAYR, PRED } = window.meissner.frame;
    return { picture: [PICT.columns, PICT.rows, PICT.rgb.length], forces: FORC.values.every(Number.isFinite), changed: DIFF.set.length, layers: LAYR.length, kept: LAYR.reduce((sum, layer) => sum + layer.kept, 0), values: [...PRED.values] };
  });
  assert.deepEqual(shown.picture, [320, 240, 3 * 320 * 240]);
  assert.ok(shown.forces && shown.changed > 100 && shown.layers > 10 && shown.kept > 10_000 && shown.values.every(Number.isFinite), JSON.stringify(shown));
  assert.match(await page.locator("#values").textContent(), /area.*mm².*force.*N/);
  assert.match(await page.locator("#clock").textContent(), /picture 6 of 12/);
  assert.ok(await page.locator("#cells-panel").isHidden() && await page.locator("#grid").isHidden());
  assert.ok(await coloured(page, "overlay") > 10_000, "pictures are drawn");
  await page.keyboard.press("ArrowRight");
  await taken(page, 7);
  await page.keyboard.press("Shift+ArrowLeft");
  await taken(page, 0);
  await page.keyboard.press("End");
  await taken(page, 12);
  await page.keyboard.press("b");
  await page.locator("#verdict.good").waitFor({ timeout: 60_000 });
  assert.match(await page.locator("#verdict").textContent(), /All bits of 76,800 values agree at picture 12/);
  await page.locator("#network").selectOption("canf");
  await until(page, () => window.meissner.facts.network === "canf" && window.meissner.frame.TIME.taken === 12 && !window.meissner.frame.TIME.seeking);
  assert.deepEqual(complaints, []);
  await close();
});

// Readings of 24 electrodes, which turn at the half and have a line that is none.
const csv = join(folder, "readings.csv"), names = Array.from({ length: 24 }, (_, e) => `ff_e${e + 1}`);
const reading = n => names.map((_, e) => Math.round(3000 + 40 * Math.sin(e + (n < 100 ? n / 15 : n / 3))));
writeFileSync(csv, [names, ...Array.from({ length: 200 }, (_, n) => n === 50 ? ["a line that is none"] : reading(n))].map(row => row.join(",")).join("\n"));
const slip = await view(csv, "--network", "slip-lstm");

await claim("electrodes show their newest readings, and the classes over time", async () => {
  const { page, complaints, close } = await open(`${slip}#event=150&playing=0`);
  await taken(page, 150);
  const shown = await page.evaluate(() => ({ readings: window.meissner.frame.ELEC.length, gaps: window.meissner.frame.ELEC.filter(reading => reading.begins).length, steps: window.meissner.facts.frames.steps, layers: window.meissner.frame.LAYR.length }));
  assert.deepEqual(shown, { readings: 150, gaps: 2, steps: 5, layers: 6 });
  assert.equal(await page.locator("#values div").count(), 3, "the best three classes");
  assert.match(await page.locator("#clock").textContent(), /reading 150 of 199/);
  assert.ok(await coloured(page, "overlay") > 10_000, "electrodes are drawn");
  await page.keyboard.press("b");
  await page.locator("#verdict.good").waitFor({ timeout: 60_000 });
  await page.locator("#network").selectOption("slip-best");
  await until(page, () => window.meissner.facts.network === "slip-best" && window.meissner.frame.TIME.taken === 150);
  await page.keyboard.press("Home");
  await taken(page, 0);
  await page.locator("#empty").waitFor();
  const plot = await page.locator("#prediction").boundingBox();
  await page.mouse.click(plot.x + plot.width * 0.5, plot.y + 40);
  await until(page, () => window.meissner.frame.TIME.taken > 60 && !window.meissner.frame.TIME.seeking);
  await page.keyboard.press("Space");
  await until(page, () => window.meissner.frame.TIME.playing);
  assert.deepEqual(complaints, []);
  await close();
});

await claim("frames of events show what the network reads", async () => {
  const { page, complaints, close } = await open(`${await view("--network", "force-lstm")}#event=20&playing=0`);
  await taken(page, 20);
  const shown = await page.evaluate(() => ({ channels: window.meissner.frame.SPAR.channels, set: window.meissner.frame.SPAR.list.length, values: [...window.meissner.frame.PRED.values] }));
  assert.ok(shown.channels === 2 && shown.set > 10 && shown.values.every(Number.isFinite), JSON.stringify(shown));
  assert.ok(await coloured(page, "overlay") > 100, "the frame is drawn");
  await page.keyboard.press("b");
  await page.locator("#verdict.good").waitFor({ timeout: 60_000 });
  assert.deepEqual(complaints, []);
  await close();
});

await claim("at 1280 and 390 pixels nothing of a frame network is cut off", async () => {
  for (const [kind, address, event] of [["electrodes", slip, 150], ["pictures", await view(video, "--network", "canf", "--video", "320x240@25"), 6]]) {
    for (const [width, height] of [[1280, 900], [390, 844]]) {
      const { page, complaints, close } = await open(`${address}#event=${event}&playing=0`, { width, height });
      await taken(page, event);
      await page.waitForTimeout(2000);
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${kind}, ${width} pixels`);
      await page.screenshot({ path: `${pictures}${kind}-${width}.png`, fullPage: true });
      assert.deepEqual(complaints, []);
      await close();
    }
  }
});

await claim("at 1280 and 390 pixels nothing is cut off", async () => {
  for (const [width, height] of [[1280, 900], [390, 844]]) {
    for (const theme of ["", "&theme=dark"]) {
      const { page, complaints, close } = await open(`${url}#event=14000&playing=0&network=tactigraph-past${theme}`, { width, height, deviceScaleFactor: 1 });
      await taken(page, 14000);
      await page.waitForTimeout(1500);
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${width} pixels`);
      await page.screenshot({ path: `${pictures}page-${width}${theme ? "-dark" : ""}.png` });
      await page.screenshot({ path: `${pictures}page-${width}${theme ? "-dark" : ""}-whole.png`, fullPage: true });
      assert.deepEqual(complaints, []);
      await close();
    }
  }
});

// Twenty fingertips: the press, over and over, and one sensor on which too much happens.
const press = new URL("../../run/assets/dome_press.evt3", import.meta.url).pathname;
const fingertips = Array.from({ length: 20 }, (_, i) => join(folder, `${i}.csv`));
for (const [i, path] of fingertips.entries()) {
  const events = Array.from({ length: 6000 }, (_, n) => { const turn = n / 300 + i; return [100 * n, Math.round(173 + (30 + 3 * i) * Math.cos(turn) + n % 7), Math.round(130 + (30 + 3 * i) * Math.sin(turn) + n % 5), n % 2]; });
  writeFileSync(path, `# sensor 346x260\n${events.map(event => event.join(",")).join("\n")}\n`);
}

await claim("twenty fingertips are side by side, and one of them in detail", async () => {
  const play = await started(["play", press, ...fingertips.slice(1), "--sensor", "346x260", "--repeat", "1000", "--speed", "0.2", "--report-every", "10ms", "--json", "--view"], /page: (\S+)/);
  const { page, complaints, close } = await open(play);
  await until(page, () => window.meissner.frame.TIPS?.list.every(tip => tip.taken > 500 && tip.values.every(Number.isFinite)));
  assert.equal(await page.locator(".tip").count(), 20);
  assert.match(await page.locator(".tip").first().textContent(), /dome_press.*rad.*s.*(events|dropped)/s);
  await page.locator(".tip").nth(7).click();
  await until(page, () => window.meissner.frame.TIPS.selected === 7 && document.querySelectorAll(".tip")[7].getAttribute("aria-pressed") === "true");
  assert.match(await page.locator("#events-title").textContent(), /Events of 7/);
  await page.keyboard.press("ArrowRight");
  await until(page, () => window.meissner.frame.TIPS.selected === 8);
  await page.locator(".tip").nth(3).focus();
  await page.keyboard.press("Enter");
  await until(page, () => window.meissner.frame.TIPS.selected === 3);
  assert.match(page.url(), /sensor=/);
  assert.ok(await page.locator("#wave-panel").isHidden() && await page.locator("#scrubber").isHidden());
  assert.ok(await coloured(page) > 100, "events are drawn");
  for (const [width, height] of [[1280, 900], [390, 844]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(800);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${width} pixels`);
    await page.screenshot({ path: `${pictures}sensors-${width}.png`, fullPage: true });
  }
  assert.deepEqual(complaints, []);
  await close();
  programs.at(-1).kill("SIGINT");
});

await claim("live events arrive", async () => {
  const live = view("-", "--sensor", "346x260"), { stdin } = programs.at(-1);
  let t = 0;
  const send = setInterval(() => { for (let i = 0; i < 50; i++) stdin.write(`${t += 100},${60 + t / 100 % 200},${80 + Math.floor(t / 700) % 90},${t / 100 % 2}\n`); }, 20);
  const { page, complaints, close } = await open(await live);
  await until(page, () => window.meissner.facts.live && window.meissner.frame.EVNT.count > 300);
  await page.keyboard.press("Space");
  await until(page, () => !window.meissner.frame.TIME.playing);
  const { taken: at } = await time(page);
  await page.keyboard.press("ArrowLeft");
  await taken(page, at - 1);
  clearInterval(send);
  assert.deepEqual(complaints, []);
  await close();
});

await browser.close();
for (const program of programs) program.removeAllListeners("exit");
process.exit(0);

/** Pixels of a canvas that are no ground. */
function coloured(page, id = "events") {
  return page.evaluate(async id => {
    await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)));
    const canvas = document.getElementById(id), copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const to = copy.getContext("2d");
    to.drawImage(canvas, 0, 0);
    return to.getImageData(0, 0, copy.width, copy.height).data.filter((value, i) => i % 4 === 3 && value > 40).length;
  }, id);
}

function linear(hex) {
  const number = parseInt(hex.slice(1), 16);
  return [number >> 16 & 255, number >> 8 & 255, number & 255].map(v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
}

function gamma(v) {
  v = Math.max(0, Math.min(1, v));
  return v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
}

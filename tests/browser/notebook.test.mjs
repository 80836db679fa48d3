// The viewer embedded as in a saved notebook: an iframe with a srcdoc attribute, from disk, offline. With $NOTEBOOKS, a
// folder of executed notebooks as pages (python/notebooks/run.sh), these are tested instead; screenshots go to
// $PICTURES.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { browser, prepare, work } from "./common.mjs";

const require = createRequire(new URL("../../web/package.json", import.meta.url));
const puppeteer = require("puppeteer-core");
const notebooks = process.env.NOTEBOOKS;
const pictures = process.env.PICTURES;
const size = { width: 1280, height: 900 };

/** As Python's html.escape. */
const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;").replaceAll("'", "&#x27;");

before(() => {
  if (notebooks) return;
  prepare();
  const page = escaped(readFileSync(path.join(work, "page.html"), "utf8"));
  writeFileSync(path.join(work, "saved.html"), `<!doctype html><html lang="en"><meta charset="utf-8"><title>A saved notebook</title>
    <body><h1>A saved notebook</h1><iframe title="particlegs viewer" style="width:100%;height:520px;border:0" srcdoc="${page}"></iframe>`);
});

const saved = () => notebooks
  ? readdirSync(notebooks).filter((f) => f.endsWith(".html")).map((f) => path.resolve(notebooks, f))
  : [path.join(work, "saved.html")];

/** The state of a viewer: whether it failed, and the lit share of its picture. */
const drawn = () => {
  const pane = globalThis.particlegs.page.panes[0];
  const canvas = pane.drew === "GPU" ? pane.gpu : pane.cpu;
  const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
  copy.drawImage(canvas, 0, 0);
  const pixels = copy.getImageData(0, 0, canvas.width, canvas.height).data;
  let lit = 0;
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i] > 2) lit++;
  return { failed: document.documentElement.dataset.failed ?? null, lit: lit / (pixels.length / 4) };
};
const finished = () => document.documentElement.dataset.full || document.documentElement.dataset.failed;
const changed = (before) => document.documentElement.dataset.full !== before;
const full = () => document.documentElement.dataset.full;
/** Addresses of images that did not load. */
const missing = () => [...document.images].filter((i) => i.naturalWidth === 0).map((i) => i.src.slice(0, 80));

/** Waits until a function returns true in a frame. */
async function until(frame, says, ...given) {
  while (!await frame.evaluate(says, ...given)) await new Promise((r) => setTimeout(r, 50));
}

/** Opens a page, checks every viewer in it and changes its style; returns the number of viewers. */
async function look(tab, file, name) {
  const [said, asked] = [[], []];
  tab.on("console", (m) => ["error", "warn", "warning"].includes(m.type()) && said.push(m.text()));
  tab.on("pageerror", (e) => said.push(e.message));
  tab.on("request", (r) => /^(https?|wss?):/.test(r.url()) && asked.push(r.url()));
  await tab.goto(pathToFileURL(file).href);
  const viewers = await tab.$$('iframe[title="particlegs viewer"]');
  for (const viewer of viewers) {
    const frame = await viewer.contentFrame();
    await until(frame, finished);
    const seen = await frame.evaluate(drawn);
    assert.equal(seen.failed, null, `${file}: ${await frame.evaluate(() => document.getElementById("status").textContent)}`);
    assert.ok(seen.lit > 0.01, `${file}: ${seen.lit} of the picture is lit`);
    const before = await frame.evaluate(full);
    await frame.evaluate(() => globalThis.particlegs.change({ look: "density" }));
    await until(frame, changed, before);
    // Time for the page to try to update its address.
    await new Promise((r) => setTimeout(r, 800));
  }
  assert.deepEqual(await tab.evaluate(missing), [], file);
  if (pictures) {
    mkdirSync(pictures, { recursive: true });
    await tab.screenshot({ path: path.join(pictures, `${path.basename(file, ".html")}-${name}.png`), fullPage: true });
  }
  assert.deepEqual(said, [], file);
  assert.deepEqual(asked, [], file);
  return viewers.length;
}

test("in Chromium: a saved notebook shows its viewer, offline", { timeout: 120_000 }, async () => {
  const chromium = await browser();
  try {
    let viewers = 0;
    for (const file of saved()) {
      const tab = await chromium.newPage({ viewport: size, offline: true });
      viewers += await look(tab, file, "chromium");
      await tab.close();
    }
    assert.ok(viewers > 0, "no page has a viewer");
  } finally {
    await chromium.close();
  }
});

test("in Firefox: a saved notebook shows its viewer, offline", { timeout: 240_000 }, async () => {
  const firefox = await puppeteer.launch({
    browser: "firefox", executablePath: process.env.FIREFOX ?? "/usr/bin/firefox-esr", headless: true, defaultViewport: size,
  });
  try {
    let viewers = 0;
    for (const file of saved()) {
      const tab = await firefox.newPage();
      viewers += await look(tab, file, "firefox");
      await tab.close();
    }
    assert.ok(viewers > 0, "no page has a viewer");
  } finally {
    await firefox.close();
  }
});

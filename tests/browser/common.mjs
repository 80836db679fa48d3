// Shared by the tests of the page: the browser, the program, models, and comparison of pictures.
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";

const require = createRequire(new URL("../../web/package.json", import.meta.url));
const { chromium } = require("playwright-core");
export const axe = require.resolve("axe-core/axe.min.js");

const root = fileURLToPath(new URL("../..", import.meta.url));
const program = path.resolve(root, process.env.PARTICLEGS ?? "target/debug/particlegs");
export const sample = path.join(root, "samples/nbody64");
export const work = mkdtempSync(path.join(tmpdir(), "particlegs-browser-"));
process.on("exit", () => rmSync(work, { recursive: true, force: true }));

/** Runs the program; throws its error message if it fails. */
export function run(...args) {
  const r = spawnSync(program, args, { encoding: "utf8", cwd: work });
  if (r.status !== 0) throw new Error(`particlegs ${args.join(" ")}: ${r.stderr}`);
  return r.stdout;
}

/** Makes models and a page. */
export function prepare() {
  run("compress", sample, "-o", "m.pgs", "--ratio", "300", "--quiet");
  run("compress", sample, "-o", "n.pgs", "--ratio", "1000", "--certificate", "none", "--quiet");
  run("export", "m.pgs", "-o", "page.html", "--quiet");
}

export const page = (query = "", hash = "") => `${pathToFileURL(path.join(work, "page.html"))}${query}${hash}`;

/** Serves models until `stop` is called. */
export async function serve(...args) {
  const child = spawn(program, ["view", "--no-open", "--port", "0", ...args], { cwd: work, stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (d) => {
      text += d;
      const found = /http:\/\/\S+/.exec(text);
      if (found) resolve(found[0]);
    });
    child.on("exit", (code) => reject(new Error(`view ended with ${code}`)));
  });
  const stop = () => new Promise((resolve) => {
    child.on("exit", resolve);
    child.kill("SIGINT");
  });
  return { url, stop };
}

/** Chromium with a GPU emulated in software, or without one. */
export function browser(gpu = true) {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--no-sandbox", ...(gpu ? ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"] : ["--disable-gpu"])],
  });
}

/**
 * Opens a page and waits for its picture. `said` collects warnings and errors of the console, `asked` the requested
 * addresses.
 */
export async function open(b, url, options = {}) {
  const tab = await b.newPage({ viewport: { width: 1280, height: 720 }, colorScheme: "dark", ...options });
  const [said, asked] = [[], []];
  tab.on("console", (m) => ["error", "warning"].includes(m.type()) && said.push(m.text()));
  tab.on("pageerror", (e) => said.push(e.message));
  tab.on("request", (r) => asked.push(r.url()));
  await tab.goto(url);
  await tab.waitForFunction(() => document.documentElement.dataset.full || document.documentElement.dataset.failed);
  return { tab, said, asked };
}

/** Waits until the GPU draws. */
export const onGpu = (tab) => tab.waitForFunction(() => document.documentElement.dataset.by === "GPU");

/** Changes the state, waits for the full picture, and compares it with the CPU's. */
export async function pictures(tab, part) {
  return tab.evaluate(async (part) => {
    const { page, change, pixels } = globalThis.particlegs;
    const full = () => document.documentElement.dataset.full;
    const before = full();
    change(typeof part === "string" ? {} : part);
    while (full() === before) await new Promise((r) => setTimeout(r, 20));
    const pane = page.panes[0];
    // The colour bar may have made the picture narrower; it is then drawn again.
    const rests = () => !pane.busy && pane.drawn === pane.changed
      && (pane.drew === "GPU" ? pane.gpu : pane.cpu).width === pane.size.width;
    for (let calm = 0; calm < 15; calm = rests() ? calm + 1 : 0) await new Promise((r) => setTimeout(r, 20));
    const { width, height } = pane.size;
    const canvas = pane.drew === "GPU" ? pane.gpu : pane.cpu;
    const copy = new OffscreenCanvas(width, height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const shown = copy.getImageData(0, 0, width, height).data;
    const state = { ...page.state, range: page.state.range ?? pane.range };
    const cpu = await pixels(state);
    let [sum, lit, beyond, worst] = [0, 0, 0, 0];
    for (let i = 0; i < shown.length; i += 4) {
      const isLit = shown[i] > 2 || cpu[i] > 2 || shown[i + 1] > 2 || cpu[i + 1] > 2;
      for (let k = 0; k < 3; k++) {
        const e = Math.abs(shown[i + k] - cpu[i + k]);
        worst = Math.max(worst, e);
        if (e > 2) beyond++;
        if (isLit) [sum, lit] = [sum + e * e, lit + 1];
      }
    }
    const psnr = sum === 0 ? Infinity : 10 * Math.log10(255 ** 2 / (sum / lit));
    return { psnr, worst, within: 1 - beyond / (0.75 * shown.length), lit: lit / (0.75 * shown.length) };
  }, part);
}

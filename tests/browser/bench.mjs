// Times the page without a GPU: node tests/browser/bench.mjs MODEL... prints a table. Starting Chromium is not included.
import { spawn } from "node:child_process";
import path from "node:path";
import { browser } from "./common.mjs";

const program = path.resolve(process.env.PARTICLEGS ?? "target/release/particlegs");
const RUNS = Number(process.env.RUNS ?? 5);
const median = (all) => all.toSorted((a, b) => a - b)[Math.floor(all.length / 2)];

/** In the page: records the first frames and their times. */
function keepFrames() {
  globalThis.kept = [];
  new MutationObserver(() => {
    if (globalThis.kept.length === 30 || document.documentElement.dataset.full > 1) return;
    const shown = document.querySelector("canvas.picture:not([hidden])");
    const copy = new OffscreenCanvas(shown.width, shown.height);
    copy.getContext("2d").drawImage(shown, 0, 0);
    globalThis.kept.push({ at: performance.timeOrigin + performance.now(), copy });
  }).observe(document, { attributes: true, subtree: true, attributeFilter: ["data-frames"] });
}

/** In the page: the time of each frame, and its masked PSNR in dB against the last, full picture. */
function scored() {
  const full = globalThis.kept.at(-1).copy;
  const pixels = (of) => {
    const c = new OffscreenCanvas(full.width, full.height).getContext("2d");
    c.drawImage(of, 0, 0, full.width, full.height);
    return c.getImageData(0, 0, full.width, full.height).data;
  };
  const last = pixels(full);
  return globalThis.kept.map(({ at, copy }) => {
    const now = pixels(copy);
    let [sum, lit] = [0, 0];
    for (let i = 0; i < now.length; i += 4) {
      if (last[i] <= 2.5 && now[i] <= 2.5) continue;
      [sum, lit] = [sum + (last[i] - now[i]) ** 2, lit + 1];
    }
    return { at, psnr: sum ? 10 * Math.log10(255 ** 2 / (sum / lit)) : 99 };
  });
}

/** In the page: rotates for four seconds. */
async function turned() {
  const { page, change } = globalThis.particlegs;
  const pane = page.panes[0];
  const still = pane.milliseconds;
  const { width, height } = pane.size;
  const [frames, start] = [pane.frames, performance.now()];
  while (performance.now() - start < 4000) {
    change({ orbit: { ...page.state.orbit, azimuth: page.state.orbit.azimuth + 1 } });
    const now = pane.frames;
    while (pane.frames === now) await new Promise((r) => setTimeout(r, 1));
  }
  return { size: `${width}x${height}`, rate: (1000 * (pane.frames - frames)) / (performance.now() - start), still };
}

/** Milliseconds from the command to the first picture, the first with 35 dB against the full one, and the full one. */
async function once(b, model) {
  const tab = await b.newPage({ viewport: { width: 1580, height: 804 } });
  await tab.addInitScript(keepFrames);
  const began = Date.now();
  const server = spawn(program, ["view", "--no-open", "--port", "0", model], { stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((resolve) => server.stdout.on("data", (d) => /http\S+/.exec(d) && resolve(/http\S+/.exec(d)[0])));
  await tab.goto(`${url}?draw=cpu`);
  await tab.waitForFunction(() => document.documentElement.dataset.full, { timeout: 120_000 });
  const frames = await tab.evaluate(scored);
  if (process.env.MARKS) {
    const marks = await tab.evaluate(() => performance.getEntriesByType("mark").map((m) => [m.name, performance.timeOrigin + m.startTime]));
    console.error(marks.map(([name, at]) => `${name} ${(at - began).toFixed(0)}`).join(", "), frames.map((f) => `${(f.at - began).toFixed(0)} ms ${f.psnr.toFixed(1)} dB`).join(", "));
  }
  const motion = await tab.evaluate(turned);
  await tab.close();
  server.kill("SIGINT");
  const [first, alike, full] = [frames[0], frames.find((f) => f.psnr >= 35), frames.at(-1)].map((f) => f.at - began);
  return { first, psnr: frames[0].psnr, alike, full, ...motion };
}

const b = await browser(false);
console.log("| model | picture | first picture, ms | against the full one, dB | of 35 dB, ms | full picture, ms | frames/s turning | still, ms |\n|---|---|---|---|---|---|---|---|");
for (const model of process.argv.slice(2)) {
  const all = [];
  for (let i = 0; i < RUNS; i++) all.push(await once(b, model));
  const of = (name) => median(all.map((r) => r[name]));
  const range = (name) => `${of(name).toFixed(0)} (${Math.min(...all.map((r) => r[name])).toFixed(0)}-${Math.max(...all.map((r) => r[name])).toFixed(0)})`;
  const psnr = of("psnr") === 99 ? "the same" : of("psnr").toFixed(1);
  console.log(`| ${path.basename(model)} | ${all[0].size} | ${range("first")} | ${psnr} | ${range("alike")} | ${range("full")} | ${of("rate").toFixed(1)} | ${of("still").toFixed(0)} |`);
}
await b.close();

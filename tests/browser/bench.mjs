// How fast the page is: node tests/browser/bench.mjs MODEL... prints a table. No graphics card; Chromium is started before the clock.
import { spawn } from "node:child_process";
import path from "node:path";
import { browser } from "./common.mjs";

const program = path.resolve(process.env.PARTICLEGS ?? "target/release/particlegs");
const RUNS = Number(process.env.RUNS ?? 5);
const median = (all) => all.toSorted((a, b) => a - b)[Math.floor(all.length / 2)];

/** Milliseconds from the command to the first and to the full picture; then frames a second while turning. */
async function once(b, model) {
  const tab = await b.newPage({ viewport: { width: 1580, height: 804 } });
  const began = Date.now();
  const server = spawn(program, ["view", "--no-open", "--port", "0", model], { stdio: ["ignore", "pipe", "inherit"] });
  const url = await new Promise((resolve) => server.stdout.on("data", (d) => /http\S+/.exec(d) && resolve(/http\S+/.exec(d)[0])));
  await tab.goto(`${url}?draw=cpu`);
  await tab.waitForFunction(() => document.documentElement.dataset.full, { timeout: 120_000 });
  if (process.env.MARKS) console.error(await tab.evaluate(() => performance.getEntriesByType("mark").map((m) => `${m.name} ${m.startTime.toFixed(0)}`).join(", ") + ` from ${performance.timeOrigin}`), began);
  const marks = await tab.evaluate(() => ["first-picture", "full-picture"].map((n) => performance.timeOrigin + performance.getEntriesByName(n)[0].startTime));
  const found = await tab.evaluate(async () => {
    const { page, change } = globalThis.particlegs;
    const pane = page.panes[0];
    const { width, height } = pane.size;
    // The first picture against the full one: coarse where the model is large.
    const paint = { look: "paraview", white: false, colormap: "inferno", range: null, exposure: 0 };
    const scene = { size: { width, height }, camera: globalThis.particlegs.camera(), radius: page.state.radius, opacity: page.state.opacity };
    const [full, coarse] = [new Uint8Array((await pane.picture(scene, paint)).numbers), new Uint8Array((await pane.picture({ ...scene, coarse: true }, paint)).numbers)];
    let [sum, lit] = [0, 0];
    for (let i = 0; i < full.length; i += 4) {
      if (full[i] <= 2.5 && coarse[i] <= 2.5) continue;
      [sum, lit] = [sum + (full[i] - coarse[i]) ** 2, lit + 1];
    }
    const frames = pane.frames;
    const start = performance.now();
    let turned = 0;
    while (performance.now() - start < 4000) {
      change({ orbit: { ...page.state.orbit, azimuth: page.state.orbit.azimuth + 1 } });
      const now = pane.frames;
      while (pane.frames === now) await new Promise((r) => setTimeout(r, 1));
      turned++;
    }
    const seconds = (performance.now() - start) / 1000;
    return { size: `${width}x${height}`, psnr: sum ? 10 * Math.log10(255 ** 2 / (sum / lit)) : Infinity, rate: (pane.frames - frames) / seconds, still: pane.milliseconds, turned };
  });
  await tab.close();
  server.kill("SIGINT");
  return { first: marks[0] - began, full: marks[1] - began, ...found };
}

const b = await browser(false);
console.log("| model | picture | first picture, ms | against the full one, dB | full picture, ms | frames/s turning | still, ms |\n|---|---|---|---|---|---|---|");
for (const model of process.argv.slice(2)) {
  const all = [];
  for (let i = 0; i < RUNS; i++) all.push(await once(b, model));
  const of = (name) => median(all.map((r) => r[name]));
  const range = (name) => `${of(name).toFixed(0)} (${Math.min(...all.map((r) => r[name])).toFixed(0)}-${Math.max(...all.map((r) => r[name])).toFixed(0)})`;
  // Small models are drawn in full at once.
  const psnr = of("full") - of("first") < 20 ? Infinity : of("psnr");
  console.log(`| ${path.basename(model)} | ${all[0].size} | ${range("first")} | ${Number.isFinite(psnr) ? psnr.toFixed(1) : "the same"} | ${range("full")} | ${of("rate").toFixed(1)} | ${of("still").toFixed(0)} |`);
}
await b.close();

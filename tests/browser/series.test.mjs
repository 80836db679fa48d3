// Series in the page: frames, playing, and what is requested of a web server.
import { after, before, describe, test } from "node:test";
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { axe, browser, open, run, serve, work } from "./common.mjs";

const FRAMES = 7;

/** Snapshots of clumps that drift through a periodic box. */
function snapshots() {
  const names = [];
  for (let frame = 0; frame < FRAMES; frame++) {
    const name = `snap-${frame}`;
    mkdirSync(path.join(work, name), { recursive: true });
    ["xx", "yy", "zz"].forEach((axis, k) => {
      const place = (i) => {
        const [u, v] = [1, 2].map((n) => (Math.sin((3 * i + k) * n * 12.9898) * 43758.5453) % 1);
        return ((i % 25) * (3 + k) * 0.37 + u * v * (1 + (i % 4)) + 0.05 * frame * (k + 1) + 20) % 10;
      };
      writeFileSync(path.join(work, name, `${axis}.f32`), Float32Array.from({ length: 12000 }, (_, i) => place(i)));
    });
    const about = { box: 10, periodic: true, length_unit: "Mpc/h", redshift: 1 / (0.5 + 0.05 * frame) - 1 };
    writeFileSync(path.join(work, name, "meta.json"), JSON.stringify(about));
    names.push(name);
  }
  return names;
}

/** A plain web server for the work folder, with or without HTTP Range; `sent` lists what it sent. */
async function plainServer(ranges) {
  const sent = [];
  const server = createServer((request, response) => {
    const name = path.basename(decodeURIComponent(request.url));
    const data = readFileSync(path.join(work, name));
    const [, first, last] = (ranges && /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? "")) || [];
    const part = first === undefined ? data : data.subarray(Number(first), Number(last) + 1);
    if (part !== data) response.writeHead(206, { "content-range": `bytes ${first}-${last}/${data.length}` });
    else response.setHeader("content-type", name.endsWith(".html") ? "text/html" : "application/octet-stream");
    if (name.endsWith(".pgs")) sent.push({ first: Number(first ?? 0), bytes: part.length });
    response.end(part);
  });
  await new Promise((done) => server.listen(0, "127.0.0.1", done));
  return { url: `http://127.0.0.1:${server.address().port}`, sent, stop: () => server.close() && server.closeAllConnections() };
}

/** Grey levels of the picture at a time, or of a page without series, from the first view of the series. */
const pixels = (tab, time) => tab.evaluate(async (time) => {
  const { page, change } = globalThis.particlegs;
  const [pane] = page.panes;
  if (time !== null) {
    change({ time });
    do await new Promise((r) => setTimeout(r, 20));
    while (pane.drawing);
  }
  const camera = { position: [5, 5, 25], focal_point: [5, 5, 5], view_up: [0, 1, 0], fov_deg: 30 };
  const scene = { size: { width: 320, height: 240 }, camera, radius: 0.05, opacity: 0.3 };
  const paint = { look: "expected", white: false, colormap: "", range: null, exposure: 0, by_layer: false, field: null };
  const { numbers } = await pane.picture(scene, paint);
  return [...new Uint8Array(numbers)].filter((_, i) => i % 4 === 0);
}, time);

/** Root mean square difference of two pictures, in grey levels. */
const difference = (a, b) => {
  assert.equal(a.length, b.length);
  return Math.sqrt(a.reduce((sum, v, i) => sum + (v - b[i]) ** 2, 0) / a.length);
};
const moment = (tab) => tab.evaluate(() => globalThis.particlegs.page.panes[0].moment);
const loaded = (tab) => tab.waitForFunction((n) => globalThis.particlegs.page.panes[0].series.count === n, FRAMES);

describe("series in the page", () => {
  let b, offline;
  before(async () => {
    run("series", ...snapshots(), "-o", "my run.pgs", "--gaussians", "1000", "--certificate", "none", "--keyframe-interval", "3", "--quiet");
    run("export", "my run.pgs", "-o", "run.html", "--quiet");
    run("export", "my run.pgs", "-o", "link.html", "--link", "--quiet");
    b = await browser();
    offline = pathToFileURL(path.join(work, "run.html")).href;
  });
  after(() => b.close());

  test("shows each frame as a page of the extracted frame does, also back in time", async () => {
    const { tab, said } = await open(b, offline);
    for (const frame of [5, 3, 1]) {
      run("extract", "my run.pgs", "--frame", String(frame), "-o", "frame.pgs", "--quiet", "--force");
      run("export", "frame.pgs", "-o", "frame.html", "--quiet", "--force");
      const single = await open(b, pathToFileURL(path.join(work, "frame.html")).href);
      const [shown, alone] = [await pixels(tab, 0.5 + 0.05 * frame), await pixels(single.tab, null)];
      assert.ok(shown.some((v) => v > 100));
      // Frames between keyframes are coded anew when they are extracted.
      assert.ok(difference(shown, alone) <= (frame === 3 ? 0 : 2), `frame ${frame}: ${difference(shown, alone)}`);
      await single.tab.close();
    }
    assert.deepEqual(said, []);
    await tab.close();
  });

  test("keys and slider move from frame to frame, and the picture names the time", async () => {
    const { tab } = await open(b, offline, { bypassCSP: true });
    const text = () => tab.textContent("#timeline output");
    assert.equal(await text(), "frame 0, z = 1.000");
    await tab.keyboard.press(">");
    await tab.waitForFunction(() => document.querySelector("#timeline output").textContent === "frame 1, z = 0.818");
    await tab.keyboard.press("<");
    await tab.keyboard.press("<");
    await tab.waitForFunction(() => document.querySelector("#timeline output").textContent === "frame 0, z = 1.000");
    await tab.focus("#timeline input[type=range]");
    await tab.keyboard.press("End");
    await tab.waitForFunction(() => document.querySelector("#timeline output").textContent === "frame 6, z = 0.250");
    const between = await pixels(tab, 0.525);
    assert.deepEqual(await moment(tab), { time: 0.525, text: "z = 0.905", interpolated: true });
    const ends = [await pixels(tab, 0.5), await pixels(tab, 0.55)];
    assert.ok(ends.every((end) => difference(end, between) > 3));
    await tab.addScriptTag({ path: axe });
    const faults = await tab.evaluate(async () => (await globalThis.axe.run()).violations.map((v) => `${v.id}: ${v.nodes[0].html}`));
    assert.deepEqual(faults, []);
    await tab.close();
  });

  test("plays with one range of colours, and stops at the end without loop", async () => {
    const { tab } = await open(b, offline);
    await tab.selectOption("#timeline select", "4");
    await tab.keyboard.press("u");
    await tab.keyboard.press(" ");
    const seen = new Set();
    const ranges = new Set();
    for (const began = Date.now(); Date.now() - began < 20_000;) {
      const [time, range, playing] = await tab.evaluate(() => {
        const [pane] = globalThis.particlegs.page.panes;
        return [pane.last.state.time, String(pane.last.answer.range), pane.playing];
      });
      seen.add(time);
      if (time > 0.5) ranges.add(range);
      if (!playing) break;
      await new Promise((r) => setTimeout(r, 50));
    }
    // However few pictures a busy machine draws: frames are 0.05 apart, and it also shows what is between.
    const between = [...seen].filter((time) => Math.abs(20 * time - Math.round(20 * time)) > 1e-6);
    assert.ok(between.length > 0, `${[...seen].join(" ")}`);
    // The picture of the last moment may still be drawn.
    await tab.waitForFunction(() => Math.abs(globalThis.particlegs.page.panes[0].last.state.time - 0.8) < 1e-9);
    assert.equal(ranges.size, 1, [...ranges].join("; "));
    assert.equal(await tab.getAttribute("#timeline button", "aria-label"), "Play");
    await tab.close();
  });

  test("a link restores the moment", async () => {
    const { tab } = await open(b, `${offline}#time=0.65`);
    assert.equal((await moment(tab)).text, "z = 0.538");
    assert.match(await tab.evaluate(() => globalThis.particlegs.toLink()), /time=0\.65/);
    await tab.close();
  });

  test("the first picture needs the index and one frame of a plain server, and the rest follows", async (t) => {
    const server = await plainServer(true);
    t.after(server.stop);
    const { tab, said } = await open(b, `${server.url}/link.html`);
    await loaded(tab);
    assert.deepEqual(said, []);
    const size = statSync(path.join(work, "my run.pgs")).size;
    const frames = await tab.evaluate(() => globalThis.particlegs.page.panes[0].series.frames.map((f) => f.start));
    assert.ok(server.sent[0].bytes <= 16384 && server.sent.every((s) => s.bytes < size));
    assert.ok(server.sent.slice(1).every((s) => s.first >= frames[0]));
    const whole = await open(b, offline);
    assert.equal(difference(await pixels(tab, 0.8), await pixels(whole.tab, 0.8)), 0);
    await tab.close();
    await whole.tab.close();
  });

  test("a server without HTTP Range sends the file once", async (t) => {
    const server = await plainServer(false);
    t.after(server.stop);
    const { tab, said } = await open(b, `${server.url}/link.html`);
    await loaded(tab);
    assert.deepEqual([said, server.sent.length], [[], 1]);
    await tab.close();
  });

  test("`view` serves frames by range", async (t) => {
    const server = await serve("my run.pgs");
    t.after(server.stop);
    const { tab, said } = await open(b, server.url);
    await loaded(tab);
    assert.deepEqual(said, []);
    const part = await tab.evaluate(async () => {
      const answer = await fetch("model/0", { headers: { Range: "bytes=8-15" } });
      return [answer.status, answer.headers.get("content-range"), (await answer.arrayBuffer()).byteLength];
    });
    const size = statSync(path.join(work, "my run.pgs")).size;
    assert.deepEqual(part, [206, `bytes 8-15/${size}`, 8]);
    await tab.close();
  });
});

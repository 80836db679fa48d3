// Tests of the page in Chromium.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { axe, browser, onGpu, open, page, pictures, prepare, run, sample, serve, work } from "./common.mjs";

let b;
before(async () => {
  prepare();
  b = await browser();
});
after(() => b?.close());

/** Five cameras, the last from inside. */
const CAMERAS = [
  { azimuth: 0, elevation: 0, distance: 1 }, { azimuth: 40, elevation: 25, distance: 1 },
  { azimuth: -120, elevation: -50, distance: 0.5 }, { azimuth: 75, elevation: 10, distance: 0.25 },
  { azimuth: 200, elevation: 5, distance: 0.04 },
];
/** Required masked PSNR in dB of the GPU's picture against the CPU's at distances 1, 0.5, 0.25 and inside. */
const LEAST = (distance) => (distance >= 1 ? 70 : distance >= 0.5 ? 62 : distance >= 0.25 ? 58 : 55);

/** The page's orbit for a camera of `CAMERAS`. */
const orbitOf = (tab, c) => tab.evaluate((c) => {
  const { page } = globalThis.particlegs;
  const home = page.panes[0].about.metadata.bounds;
  const focal = home.min.map((v, k) => (v + home.max[k]) / 2);
  const base = (globalThis.particlegs.base ??= page.state.orbit.distance);
  return { ...page.state.orbit, focal, azimuth: c.azimuth, elevation: c.elevation, distance: base * c.distance };
}, c);

/** The first channel of a PNG, as the browser decodes it. */
const greys = (tab, png) => tab.evaluate(async (base64) => {
  const image = new Image();
  image.src = `data:image/png;base64,${base64}`;
  await image.decode();
  const c = new OffscreenCanvas(image.width, image.height).getContext("2d");
  c.drawImage(image, 0, 0);
  return [...c.getImageData(0, 0, image.width, image.height).data].filter((_, i) => i % 4 === 0);
}, png.toString("base64"));

/** Number of pixels in which two PNGs differ. */
async function differing(tab, a, b) {
  const [x, y] = [await greys(tab, a), await greys(tab, b)];
  return x.length === y.length ? x.reduce((n, v, i) => n + (v === y[i] ? 0 : 1), 0) : Infinity;
}

test("from disk: one file of the documented size, no request, no warning", async () => {
  const { tab, said, asked } = await open(b, page());
  assert.deepEqual(said, []);
  assert.deepEqual(asked.filter((u) => !u.startsWith("file:") && !u.startsWith("blob:") && !u.startsWith("data:")), []);
  const [html, model] = ["page.html", "m.pgs"].map((f) => readFileSync(path.join(work, f)).length);
  assert.ok(html - 1.35 * model < 770_000, `${html} bytes`);
  assert.match(await tab.textContent("#subtitle"), /262\u2009144 particles/);
  await tab.close();
});

/** Mean luminance of the first picture, and the share of occupied pixels that are visible. */
const firstPicture = (tab) => tab.evaluate(async () => {
  const { page } = globalThis.particlegs;
  const pane = page.panes[0];
  const { data } = pane.cpu.getContext("2d").getImageData(0, 0, pane.cpu.width, pane.cpu.height);
  const scene = { size: pane.size, camera: globalThis.particlegs.camera(), radius: page.state.radius, opacity: page.state.opacity };
  const densities = new Float32Array((await pane.values(scene, "density")).numbers);
  let [light, occupied, seen] = [0, 0, 0];
  densities.forEach((v, i) => {
    const [r, g, b] = data.subarray(4 * i, 4 * i + 3);
    light += 0.2126 * r + 0.7152 * g + 0.0722 * b;
    occupied += v > 0;
    seen += v > 0 && Math.max(r, g, b) >= 10;
  });
  return { light: light / densities.length, seen: seen / occupied };
});

test("the first picture is visible, for clustered and for nearly uniform particles", async () => {
  let text = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n8000\nITEM: BOX BOUNDS pp pp pp\n0 20\n0 20\n0 20\nITEM: ATOMS id type x y z\n";
  for (let i = 0; i < 8000; i++) text += `${i} 1 ${[1, 20, 400].map((d, k) => (Math.floor(i / d) % 20) + 0.5 + 0.4 * Math.sin(i * (k + 1.7)))}\n`.replaceAll(",", " ");
  writeFileSync(path.join(work, "melt.dump"), text);
  run("compress", "melt.dump", "-o", "melt.pgs", "--gaussians", "800", "--effort", "fast", "--certificate", "none", "--quiet");
  run("export", "melt.pgs", "-o", "melt.html", "--quiet");
  for (const name of ["page.html", "melt.html"]) {
    const { tab } = await open(b, page("?draw=cpu").replace("page.html", name));
    await pictures(tab, {});
    const { light, seen } = await firstPicture(tab);
    assert.ok(light > 25 && light < 120 && seen > 0.5, `${name}: ${light}, ${seen}`);
    await tab.close();
  }
});

test("the CPU's picture in the page equals the command's, bit for bit", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  assert.equal(await tab.evaluate(() => globalThis.particlegs.page.state.look), "density");
  const views = await tab.evaluate(() => {
    const { position, focal_point, view_up } = globalThis.particlegs.camera();
    const { page } = globalThis.particlegs;
    const { width, height } = page.panes[0].size;
    return { width, height, fov_deg: 30, views: [{ name: "view", position, focal_point, view_up, radius: page.state.radius, opacity: page.state.opacity }] };
  });
  writeFileSync(path.join(work, "views.json"), JSON.stringify(views));
  for (const look of ["paraview", "expected"]) {
    run("render", "m.pgs", "--views", "views.json", "--style", look, "-o", "command.png", "--quiet");
    const ours = await tab.evaluate(async (look) => {
      const { page, pixels } = globalThis.particlegs;
      return [...(await pixels({ ...page.state, look }))].filter((_, i) => i % 4 === 0);
    }, look);
    const command = await greys(tab, readFileSync(path.join(work, "command.png")));
    const other = ours.reduce((n, v, i) => n + (v === command[i] ? 0 : 1), 0);
    assert.equal(other, 0, look);
  }
  await tab.close();
});

test("a large model is drawn during decoding once the view moves, and the final picture is the same", async () => {
  run("compress", path.resolve("samples/nbody64"), "-o", "large.pgs", "--gaussians", "120000", "--effort", "fast", "--certificate", "none", "--quiet");
  run("export", "large.pgs", "-o", "large.html", "--quiet");
  const tab = await b.newPage({ viewport: { width: 1280, height: 720 } });
  // Holds back decode queries until the test releases them.
  await tab.addInitScript(() => {
    const held = [];
    globalThis.goOn = (all) => {
      if (all) globalThis.free = true;
      held.splice(0, all ? Infinity : 1).forEach((send) => send());
    };
    const post = Worker.prototype.postMessage;
    Worker.prototype.postMessage = function (message, transfer) {
      const send = () => post.call(this, message, transfer);
      if (message.question?.ask === "decode" && !globalThis.free) held.push(send);
      else send();
    };
  });
  await tab.goto(page().replace("page.html", "large.html") + "?draw=cpu");
  const status = (text) => tab.waitForFunction((t) => document.getElementById("status")?.textContent === t, text);
  await tab.waitForFunction(() => /^Decoding: [1-9]0 %$/.test(document.getElementById("status")?.textContent));
  const seen = () => tab.evaluate(() => {
    const { page } = globalThis.particlegs;
    const { cpu, frames } = page.panes[0];
    const data = cpu.getContext("2d").getImageData(0, 0, cpu.width, cpu.height).data;
    let lit = 0;
    for (let i = 0; i < data.length; i += 4) if (data[i] > 2) lit++;
    const { full } = document.documentElement.dataset;
    return { frames, full, lit: lit / (cpu.width * cpu.height), poster: !!document.getElementById("poster") };
  });
  // The poster stays until the view moves.
  assert.deepEqual(await seen(), { frames: 0, full: undefined, lit: 0, poster: true });
  await tab.keyboard.press("ArrowLeft");
  await tab.waitForFunction(() => document.documentElement.dataset.frames >= 1);
  const early = await seen();
  assert.ok(!early.full && !early.poster && early.lit > 0.02, JSON.stringify(early));
  await tab.evaluate(() => globalThis.goOn(false));
  await tab.keyboard.press("ArrowLeft");
  await tab.evaluate(() => globalThis.goOn(true));
  await tab.waitForFunction(() => document.documentElement.dataset.full);
  await status("");
  const r = await pictures(tab, {});
  assert.ok(r.worst === 0 && r.lit > 0.02, JSON.stringify(r));
  await tab.close();
});

test("the GPU's picture equals the CPU's", { timeout: 240_000 }, async () => {
  const { tab, said } = await open(b, page("?draw=gpu"));
  await onGpu(tab);
  const radius = await tab.evaluate(() => globalThis.particlegs.page.state.radius);
  for (const look of ["paraview", "expected", "density"]) {
    for (const camera of CAMERAS) {
      for (const times of camera.distance === 1 ? [1, 4, 32] : [1]) {
        const orbit = await orbitOf(tab, camera);
        const r = await pictures(tab, { look, orbit, radius: radius * times, range: null });
        const what = `${look} ${JSON.stringify(camera)} radius x ${times}: ${JSON.stringify(r)}`;
        assert.ok(r.lit > 0.02, what);
        assert.ok(r.psnr >= LEAST(camera.distance), what);
        assert.ok(r.within >= 0.999, what);
      }
    }
  }
  assert.deepEqual(said, []);
  await tab.close();
});

test("the GPU's densities equal the CPU's to 0.01 dex", async () => {
  const { tab } = await open(b, page("?draw=gpu", "#look=density"));
  await onGpu(tab);
  await pictures(tab, { orbit: await orbitOf(tab, CAMERAS[1]) });
  const worst = await tab.evaluate(async () => {
    const pane = globalThis.particlegs.page.panes[0];
    const { page } = globalThis.particlegs;
    const scene = { size: pane.size, camera: globalThis.particlegs.camera(), radius: page.state.radius, opacity: page.state.opacity };
    const [gpu, cpu] = [pane.startGpu().values(), new Float32Array((await pane.values(scene, "density")).numbers)];
    // Densities below the range are invisible.
    let [worst, lit] = [0, 0];
    for (let i = 0; i < cpu.length; i++) {
      if (cpu[i] < pane.range[0]) continue;
      lit++;
      worst = Math.max(worst, Math.abs(Math.log10(gpu[i] / cpu[i])));
    }
    return { worst, lit: lit / cpu.length };
  });
  assert.ok(worst.lit > 0.1 && worst.worst < 0.01, JSON.stringify(worst));
  await tab.close();
});

test("if the GPU fails, the CPU draws", async () => {
  const { tab } = await open(b, page("?draw=gpu"));
  await onGpu(tab);
  await tab.evaluate(() => globalThis.particlegs.page.panes[0].gpu.getContext("webgl2").getExtension("WEBGL_lose_context").loseContext());
  // At once, without a change of state.
  await tab.waitForFunction(() => globalThis.particlegs.page.panes[0].drew === "CPU");
  const r = await pictures(tab, { opacity: 0.1 });
  assert.equal(r.worst, 0);
  assert.ok(r.lit > 0.02);
  assert.match(await tab.textContent("#status"), /drawing on the CPU/);
  await tab.close();
});

test("the GPU draws slabs, clip boxes, periodic images and white backgrounds as the CPU does", async () => {
  const { tab } = await open(b, page("?draw=gpu", "#look=paraview"));
  await onGpu(tab);
  const bounds = await tab.evaluate(() => globalThis.particlegs.page.panes[0].about.metadata.bounds);
  const middle = 0.5 * (bounds.min[2] + bounds.max[2]);
  const long = bounds.max[2] - bounds.min[2];
  for (const part of [
    { slab: { axis: "z", middle, thickness: 0.2 * long } }, { slab: { axis: "view", middle: 0, thickness: 0.2 * long } },
    { slab: null, clip: { min: bounds.min, max: [bounds.max[0], middle, middle] } }, { clip: null, images: true },
    { images: false, white: true }, { exposure: 1.5 },
  ]) {
    const r = await pictures(tab, part);
    assert.ok(r.lit > 0.005 && r.psnr >= 60 && r.within >= 0.999, `${JSON.stringify(part)}: ${JSON.stringify(r)}`);
  }
  await tab.close();
});

test("controls and keys change the picture, and a link restores it", async () => {
  const { tab } = await open(b, page("?draw=cpu", "#look=paraview"));
  const state = () => tab.evaluate(() => structuredClone(globalThis.particlegs.page.state));
  const before = await state();
  await tab.fill("input[aria-label^='Radius in']", String(2 * before.radius));
  await tab.press("input[aria-label^='Radius in']", "Enter");
  await tab.keyboard.press("Escape");
  await tab.click("button:has-text('Density')");
  await tab.selectOption("label:has-text('Colour map') select", "viridis");
  await tab.focus(".pane");
  for (const key of ["ArrowLeft", "+", "o", "b", "]", "Shift+X"]) await tab.keyboard.press(key);
  // The density style has no radius: the key says so, and the slider is hidden.
  assert.match(await tab.textContent("#status"), /the density style has no radius/);
  assert.equal(await tab.locator("#slider-radius").isVisible(), false);
  const now = await state();
  assert.ok(Math.abs(now.radius / before.radius - 2) < 1e-6, `${now.radius}`);
  assert.equal(now.look, "density");
  assert.equal(now.colormap, "viridis");
  assert.equal(now.orbit.azimuth, -90);
  assert.ok(now.orbit.orthographic && now.box && now.orbit.distance < before.orbit.distance);
  const r = await pictures(tab, {});
  assert.equal(r.worst, 0);
  const link = await tab.evaluate(() => globalThis.particlegs.toLink());
  await tab.close();
  const again = await open(b, page("", `#${link}`));
  assert.equal(await again.tab.evaluate(() => globalThis.particlegs.toLink()), link);
  await again.tab.close();
});

test("an orthographic view shows the whole box from any direction until it is moved", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  const share = (orbit) => tab.evaluate(async (part) => {
    const { page, change, camera } = globalThis.particlegs;
    const [pane] = page.panes;
    change({ orbit: { ...page.state.orbit, ...part } });
    // The engine answers in order, so the page's own query is answered first.
    await pane.window(page.state);
    const scene = { size: pane.size, camera: camera(), radius: page.state.radius, opacity: page.state.opacity };
    const { numbers } = await pane.values(scene, "density");
    const per = scene.camera.height_world / scene.size.height;
    return new Float32Array(numbers).reduce((sum, v) => sum + v, 0) * per ** 2 / (pane.about.mass ?? pane.about.metadata.count);
  }, orbit);
  for (const [azimuth, elevation] of [[0, 0], [90, 0], [0, 90], [30, 20], [-145, -50]]) {
    const held = await share({ orthographic: true, azimuth, elevation });
    assert.ok(Math.abs(held - 1) < 1e-5, `${azimuth} ${elevation}: ${held - 1}`);
  }
  const orbit = () => tab.evaluate(() => structuredClone(globalThis.particlegs.page.state.orbit));
  const whole = await orbit();
  assert.ok(await share({ distance: 0.25 * whole.distance }) < 0.9);
  assert.ok(await share({ azimuth: 60 }) < 0.9);
  assert.equal((await orbit()).distance, 0.25 * whole.distance);
  await tab.close();
});

test("circles follow the camera and clipping, and a key and a link hide them", async () => {
  const circles = [[12.5, 12.5, 12.5, 1.5], [20, 15, 20, 1], [5, 5, 5, 1e-4]];
  writeFileSync(path.join(work, "list.csv"), `x,y,z,radius\n${circles.map((c) => c.join()).join("\n")}\n`);
  run("export", "m.pgs", "--overlay", "list.csv", "-o", "circles.html", "--quiet");
  const at = page("?draw=cpu").replace("page.html", "circles.html");
  const { tab, said } = await open(b, at);
  // Of each circle, where the camera of the scene places it: the share of its rim that is drawn, and of one half as large.
  const drawn = (part) => tab.evaluate(({ part, circles }) => {
    const { page, change, camera } = globalThis.particlegs;
    change({ axes: false, scale: false, ...part });
    const [pane] = page.panes;
    const { width, height } = pane.size;
    const { data } = pane.overlay.getContext("2d").getImageData(0, 0, width, height);
    const { position, focal_point, view_up, height_world, fov_deg } = camera();
    const minus = (a, b) => a.map((v, k) => v - b[k]);
    const dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
    const sight = minus(focal_point, position);
    const ahead = sight.map((v) => v / Math.hypot(...sight));
    const right = [0, 1, 2].map((k) => ahead[(k + 1) % 3] * view_up[(k + 2) % 3] - ahead[(k + 2) % 3] * view_up[(k + 1) % 3]);
    return circles.map(([x, y, z, r]) => {
      const d = minus([x, y, z], position);
      const per = height / (height_world ?? 2 * dot(d, ahead) * Math.tan((fov_deg * Math.PI) / 360));
      const share = (radius) => {
        let lit = 0;
        for (let i = 0; i < 360; i++) {
          const [u, v] = [dot(d, right) + radius * Math.cos(i), dot(d, view_up) + radius * Math.sin(i)];
          const [px, py] = [Math.floor(width / 2 + u * per), Math.floor(height / 2 - v * per)];
          if (data[4 * (py * width + px) + 3] > 100) lit++;
        }
        return lit / 360;
      };
      return [share(r), share(r / 2)].map((v) => Math.round(v)).join("");
    });
  }, { part, circles });
  const orbit = await tab.evaluate(() => globalThis.particlegs.page.state.orbit);
  const slab = { axis: "view", middle: 0, thickness: 4 };
  for (const [part, expected] of [
    [{}, ["10", "10", "00"]],
    [{ orbit: { ...orbit, azimuth: 40, elevation: 25, roll: 10 } }, ["10", "10", "00"]],
    [{ orbit: { ...orbit, orthographic: true }, white: true }, ["10", "10", "00"]],
    [{ orbit, slab }, ["10", "00", "00"]],
    [{ slab: { ...slab, axis: "z", middle: 20 } }, ["00", "10", "00"]],
    [{ slab: null, clip: { min: [0, 0, 0], max: [15, 25, 25] } }, ["10", "00", "00"]],
    [{ clip: null, orbit: { ...orbit, distance: 6 } }, ["10", "00", "00"]],
    [{ orbit, circles: false }, ["00", "00", "00"]],
  ]) {
    assert.deepEqual(await drawn(part), expected, JSON.stringify(part));
  }
  const link = await tab.evaluate(() => globalThis.particlegs.toLink());
  await tab.focus(".pane");
  await tab.keyboard.press("e");
  assert.equal((await drawn({}))[0], "10");
  assert.deepEqual(said, []);
  await tab.close();
  const again = await open(b, `${at}#${link}`);
  const shown = (t) => t.evaluate(() => [...document.querySelectorAll("label")].find((l) => l.textContent === "Circles")?.firstChild.checked);
  assert.equal(await shown(again.tab), false);
  await again.tab.close();
  const without = await open(b, page("?draw=cpu"));
  assert.equal(await shown(without.tab), undefined);
  await without.tab.close();
});

test("a link in an open page restores the view, and an open dialog gets all keys", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  const link = await tab.evaluate(() => globalThis.particlegs.toLink());
  const now = await tab.evaluate(async (link) => {
    const { change, toLink } = globalThis.particlegs;
    change({ exposure: 2, range: [1, 10], hidden: ["none"], slab: { axis: "x", middle: 1, thickness: 2 } });
    await new Promise((r) => setTimeout(r, 600));
    location.hash = link;
    await new Promise((r) => setTimeout(r, 600));
    return toLink();
  }, link);
  assert.equal(now, link);
  for (const key of ["?", "?", "p", "w"]) await tab.keyboard.press(key);
  assert.equal(await tab.locator("dialog[open]").count(), 1);
  assert.equal(await tab.evaluate(() => globalThis.particlegs.page.state.white), false);
  await tab.close();
});

test("exports can be read: PNG with its camera, NPY, and views.json for render", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  const saved = async (act, name) => {
    const [download] = await Promise.all([tab.waitForEvent("download"), act()]);
    await download.saveAs(path.join(work, name));
    return readFileSync(path.join(work, name));
  };
  await tab.focus(".pane");
  const png = await saved(async () => {
    await tab.keyboard.press("p");
    await tab.selectOption("dialog select", "1");
    await tab.uncheck("dialog input[name=bar]");
    await tab.click("dialog button[value=yes]");
  }, "saved.png");
  assert.equal(png.readUInt32BE(16), 1920);
  const barred = await saved(async () => {
    await tab.focus(".pane");
    await tab.keyboard.press("p");
    await tab.selectOption("dialog select", "1");
    await tab.click("dialog button[value=yes]");
  }, "barred.png");
  assert.ok(barred.readUInt32BE(16) > 2000 && barred.toString("latin1").includes("particles Mpc"));
  // A page made from the PNG opens with the same view.
  run("export", "m.pgs", "--like", "saved.png", "-o", "again.html", "--quiet");
  const again = await open(b, page("?draw=cpu").replace("page.html", "again.html"));
  const looked = (t) => t.evaluate(() => {
    const { look, colormap, range, white, orbit } = globalThis.particlegs.page.state;
    return JSON.stringify([look, colormap, range, white, orbit.focal, orbit.azimuth.toFixed(6), orbit.distance.toPrecision(6)]);
  });
  const range = await tab.evaluate(() => globalThis.particlegs.page.panes[0].range);
  await tab.evaluate((range) => globalThis.particlegs.change({ range }), range);
  assert.equal(await looked(again.tab), await looked(tab));
  await again.tab.close();
  // From the PNG the command draws the same picture, bit for bit.
  run("render", "m.pgs", "--like", "saved.png", "-o", "like.png", "--no-annotations", "--quiet");
  assert.equal(await differing(tab, png, readFileSync(path.join(work, "like.png"))), 0);
  await tab.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  const npy = await saved(() => tab.click("text=NPY"), "values.npy");
  const head = npy.subarray(10, 10 + npy.readUInt16LE(8)).toString();
  const [, h, w] = /\((\d+), (\d+)\)/.exec(head).map(Number);
  assert.equal(npy.length, 10 + npy.readUInt16LE(8) + 4 * w * h);
  const views = JSON.parse((await saved(() => tab.click("text=Save views.json"), "taken.json")).toString());
  assert.equal(views.views.length, 1);
  run("render", "m.pgs", "--views", "taken.json", "-o", "again.png", "--quiet");
  await tab.close();
});

test("a click describes the point, and a sphere about it counts the particles", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  await tab.mouse.click(480, 360);
  await tab.waitForFunction(() => /within/.test(document.getElementById("status").textContent));
  assert.match(await tab.textContent("#status"), /density .* Gaussian #\d+ with .* particles; .* within/);
  const whole = await tab.evaluate(async () => {
    const { page } = globalThis.particlegs;
    const { bounds, count } = page.panes[0].about.metadata;
    const center = bounds.min.map((v, k) => (v + bounds.max[k]) / 2);
    const { json } = await page.remote.ask({ ask: "sphere", model: 0, center, radius: 1e3 });
    return json.count / count;
  });
  assert.ok(Math.abs(whole - 1) < 1e-6, `${whole}`);
  await tab.close();
});

test("served: comparison with all particles, two models with one camera, no request to other sites", { timeout: 120_000 }, async () => {
  const server = await serve("m.pgs", "n.pgs", "--snapshot", path.resolve("samples/nbody64"));
  try {
    const { tab, said, asked } = await open(b, server.url);
    assert.equal(await tab.locator(".pane").count(), 2);
    await tab.focus(".pane");
    await tab.keyboard.press("t");
    await tab.waitForFunction(() => /RMS/.test(document.documentElement.dataset.compared ?? ""));
    const rms = Number(/RMS ([\d.]+) dex/.exec(await tab.evaluate(() => document.documentElement.dataset.compared))[1]);
    assert.ok(rms > 0.01 && rms < 0.35, `${rms}`);
    await tab.click("button:has-text('ParaView')");
    await tab.waitForFunction(() => /PSNR/.test(document.documentElement.dataset.compared ?? ""));
    const psnr = Number(/([\d.]+) dB/.exec(await tab.evaluate(() => document.documentElement.dataset.compared))[1]);
    assert.ok(psnr > 25 && psnr < 60, `${psnr}`);
    await tab.focus(".divider");
    await tab.keyboard.press("ArrowRight");
    assert.equal(await tab.getAttribute(".divider", "aria-valuenow"), "52");
    const origin = new URL(server.url).origin;
    assert.deepEqual(asked.filter((u) => !u.startsWith(origin) && !u.startsWith("blob:") && !u.startsWith("data:")), []);
    assert.deepEqual(said, []);
    await tab.close();
  } finally {
    await server.stop();
  }
});

test("without float textures the CPU draws, and the page says so", async () => {
  const tab = await b.newPage();
  await tab.addInitScript(() => {
    const own = WebGL2RenderingContext.prototype.getExtension;
    WebGL2RenderingContext.prototype.getExtension = function (name) {
      return name === "EXT_color_buffer_float" ? null : own.call(this, name);
    };
  });
  await tab.goto(page());
  await tab.waitForFunction(() => /drawing on the CPU/.test(document.getElementById("status")?.textContent ?? ""));
  const r = await pictures(tab, {});
  assert.equal(r.worst, 0);
  await tab.close();
});

test("axe finds no serious accessibility problem", async () => {
  for (const colorScheme of ["dark", "light"]) {
    for (const viewport of [{ width: 1280, height: 720 }, { width: 390, height: 844 }]) {
      const { tab } = await open(b, page("?draw=cpu", "#look=density"), { colorScheme, viewport });
      await tab.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
      await tab.evaluate(readFileSync(axe, "utf8"));
      const found = await tab.evaluate(async () => (await globalThis.axe.run()).violations
        .filter((v) => ["serious", "critical"].includes(v.impact)).map((v) => `${v.id}: ${v.nodes.map((n) => n.html).join(" ")}`));
      assert.deepEqual(found, [], `${colorScheme} ${viewport.width}`);
      await tab.close();
    }
  }
});

test("Tab reaches every control", async () => {
  const { tab } = await open(b, page("?draw=cpu"));
  await tab.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  const all = await tab.evaluate(() => [...document.querySelectorAll("button, input, select, summary, .pane")]
    .filter((e) => e.checkVisibility()).length);
  const seen = await tab.evaluate(() => (document.activeElement?.blur(), 0));
  const reached = new Set([seen]);
  for (let i = 0; i < all + 5; i++) {
    await tab.keyboard.press("Tab");
    reached.add(await tab.evaluate(() => {
      const e = document.activeElement;
      e.dataset.reached = "true";
      return 0;
    }));
  }
  const missed = await tab.evaluate(() => [...document.querySelectorAll("button, input, select, summary, .pane")]
    .filter((e) => e.checkVisibility() && !e.dataset.reached).map((e) => e.outerHTML.slice(0, 120)));
  assert.deepEqual(missed, []);
  await tab.close();
});

test("an invalid model is reported, and nothing is drawn", async () => {
  const html = readFileSync(path.join(work, "page.html"), "utf8");
  const broken = html.replace(/(id="model-0">.{200})..../, "$1AAAA");
  assert.notEqual(broken, html);
  writeFileSync(path.join(work, "broken.html"), broken);
  const tab = await b.newPage();
  await tab.goto(page().replace("page.html", "broken.html"));
  await tab.waitForFunction(() => document.documentElement.dataset.failed);
  assert.match(await tab.textContent("#status"), /the model/);
  await tab.close();
});

test("the layers and the style of the opening stay without a link, and a link replaces them", async () => {
  const species = path.join(sample, "../../crates/particlegs-formats/tests/fixtures/species.hdf5");
  run("compress", species, "-o", "two.pgs", "--gaussians", "12", "--certificate=none", "--quiet");
  run("export", "two.pgs", "-o", "two.html", "--layer", "gas", "--style", "paraview", "--radius", "0.5", "--opacity", "0.25", "--quiet");
  const two = (hash = "") => page("?draw=cpu", hash).replace("page.html", "two.html");
  const first = await open(b, two());
  const { hidden, look, radius, opacity } = await first.tab.evaluate(() => globalThis.particlegs.page.state);
  assert.deepEqual([hidden, look, radius, opacity], [["PartType1"], "paraview", 0.5, 0.25]);
  const link = await first.tab.evaluate(() => {
    globalThis.particlegs.change({ hidden: [], slab: null });
    return globalThis.particlegs.toLink();
  });
  await first.tab.close();
  const second = await open(b, two(`#${link}`));
  assert.deepEqual(await second.tab.evaluate(() => globalThis.particlegs.page.state.hidden), []);
  await second.tab.close();
});

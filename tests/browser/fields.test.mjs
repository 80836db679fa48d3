// Tests of fields in the page, in Chromium: the menu, pictures against `render --field`, the probe, links and saved pictures.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { browser, open, page, pictures, run, work } from "./common.mjs";

let b;
before(async () => {
  // A flow that turns about z and is hot in the middle, as raw columns.
  const folder = path.join(work, "flow");
  mkdirSync(folder);
  const random = (i) => Math.abs(Math.sin(12.9898 * (i + 1)) * 43758.5453) % 1;
  const columns = { xx: [], yy: [], zz: [], vx: [], vy: [], vz: [], temperature: [] };
  for (let i = 0; i < 4000; i++) {
    const [x, y, z, noise] = [0, 1, 2, 3].map((k) => 10 * random(4 * i + k));
    const own = [x, y, z, 60 * (y - 5) + 9 * noise, -60 * (x - 5), 20 + 30 * noise, Math.exp(10 - 0.2 * ((x - 5) ** 2 + (y - 5) ** 2))];
    Object.values(columns).forEach((column, k) => column.push(own[k]));
  }
  for (const [name, column] of Object.entries(columns)) {
    writeFileSync(path.join(folder, `${name}.f32`), Buffer.from(new Float32Array(column).buffer));
  }
  run("compress", "flow", "-o", "flow.pgs", "--gaussians", "150", "--effort", "fast", "--certificate", "none", "--fields", "all", "--quiet");
  run("export", "flow.pgs", "-o", "flow.html", "--quiet");
  b = await browser();
});
after(() => b?.close());

const openFlow = (hash = "", file = "flow.html") =>
  open(b, page("?draw=cpu", hash).replace("page.html", file), { viewport: { width: 720, height: 360 } });

const field = (name, part = {}) => ({ name, bulk: false, scale: "", shade: false, colormap: "", ...part });

/** The largest difference between the page's picture of a field and a PNG, and the number of levels that occur. */
const compared = (tab, field, png) => tab.evaluate(async ([field, base64]) => {
  const image = new Image();
  image.src = `data:image/png;base64,${base64}`;
  await image.decode();
  const c = new OffscreenCanvas(image.width, image.height).getContext("2d");
  c.drawImage(image, 0, 0);
  const { page, pixels } = globalThis.particlegs;
  const [command, ours] = [c.getImageData(0, 0, image.width, image.height).data, await pixels({ ...page.state, field, range: null })];
  const worst = command.length === ours.length ? ours.reduce((most, v, i) => Math.max(most, Math.abs(v - command[i])), 0) : Infinity;
  return { worst, levels: new Set(ours).size };
}, [field, png.toString("base64")]);

test("the menu lists all maps of the model's fields, and a choice replaces the style", async () => {
  const { tab, said } = await openFlow();
  const listed = await tab.evaluate(() => [...document.querySelectorAll("#colour-by option")].map((o) => o.value));
  assert.deepEqual([...listed].sort(), ["", "dispersion.temperature", "dispersion.velocity.los", "temperature", "velocity.los",
    "velocity.x", "velocity.y", "velocity.z"]);
  const shown = (text) => tab.locator(`#panel label:has-text("${text}")`).isVisible();
  assert.ok(await tab.locator("button:has-text('ParaView')").isVisible() && !(await shown("Subtract bulk motion")));
  await tab.selectOption("#colour-by", "velocity.los");
  await tab.waitForFunction(() => /velocity along the line of sight/.test(document.querySelector("#colorbar .bar-title").textContent));
  assert.ok(!(await tab.locator("button:has-text('ParaView')").isVisible()) && await shown("Subtract bulk motion"));
  await tab.selectOption("#colour-by", "dispersion.temperature");
  assert.ok(!(await shown("Subtract bulk motion")));
  await tab.waitForFunction(() => /dispersion of temperature/.test(document.querySelector("#colorbar .bar-title").textContent));
  assert.deepEqual(said, []);
  await tab.close();
});

test("a field's picture is that of `render --field`, with the same defaults", async () => {
  const { tab } = await openFlow();
  const views = await tab.evaluate(() => {
    const { position, focal_point, view_up } = globalThis.particlegs.camera();
    const { page } = globalThis.particlegs;
    const view = { name: "view", position, focal_point, view_up, radius: page.state.radius, opacity: page.state.opacity };
    return { ...page.panes[0].size, fov_deg: 30, views: [view] };
  });
  writeFileSync(path.join(work, "flow.json"), JSON.stringify(views));
  const cases = [
    [field("velocity.los"), []], [field("velocity.x", { bulk: true, shade: true }), ["--bulk", "mean", "--shade"]],
    [field("dispersion.velocity.los", { colormap: "magma" }), ["--colormap", "magma"]], [field("temperature"), []],
    [field("temperature", { scale: "linear" }), ["--scale", "linear"]],
  ];
  for (const [chosen, options] of cases) {
    run("render", "flow.pgs", "--views", "flow.json", "--field", chosen.name, ...options, "--no-annotations", "-o", "field.png", "--quiet");
    const { worst, levels } = await compared(tab, chosen, readFileSync(path.join(work, "field.png")));
    assert.ok(worst <= 1 && levels > 50, `${JSON.stringify(chosen)}: ${worst}, ${levels}`);
  }
  const r = await pictures(tab, { field: cases[1][0], range: null });
  assert.equal(r.worst, 0);
  await tab.close();
});

test("a click shows mean and dispersion of each field", async () => {
  const { tab } = await openFlow();
  await tab.mouse.click(150, 200);
  await tab.waitForFunction(() => /within/.test(document.getElementById("status").textContent));
  const lines = (await tab.textContent("#status")).split("\n");
  const [velocity, temperature] = ["velocity", "temperature"].map((name) => lines.find((l) => l.startsWith(name)));
  const number = "−?[\\d.]+(?: × 10.+)?";
  assert.match(velocity, new RegExp(`^velocity: mean \\(${number}, ${number}, ${number}\\), along the line of sight ${number}; dispersion \\(`));
  assert.match(temperature, new RegExp(`^temperature: mean ${number}; dispersion ${number} dex$`));
  // z is along the line of sight here, towards the observer.
  const [, z, sight] = new RegExp(`mean \\(.*, (${number})\\), along the line of sight (${number});`).exec(velocity).map((t) => Number(t.replace("−", "-")));
  assert.ok(z > 20 && z < 320 && Math.abs(sight + z) < 0.2 * z, velocity);
  await tab.close();
});

test("links and saved pictures keep the field", async () => {
  const { tab } = await openFlow();
  const chosen = field("velocity.y", { bulk: true, shade: true, scale: "linear", colormap: "viridis" });
  await pictures(tab, { field: chosen, range: [-200, 150] });
  const link = await tab.evaluate(() => globalThis.particlegs.toLink());
  const again = await openFlow(`#${link}`);
  const state = (t) => t.evaluate(() => [globalThis.particlegs.page.state.field, globalThis.particlegs.page.state.range]);
  assert.deepEqual(await state(again.tab), [chosen, [-200, 150]]);
  assert.equal(await again.tab.evaluate(() => globalThis.particlegs.toLink()), link);
  await again.tab.close();
  await tab.focus(".pane");
  await tab.keyboard.press("p");
  const [download] = await Promise.all([tab.waitForEvent("download"), tab.click("dialog button[value=yes]")]);
  await download.saveAs(path.join(work, "flow-saved.png"));
  run("export", "flow.pgs", "--like", "flow-saved.png", "-o", "flow-like.html", "--quiet");
  const like = await openFlow("", "flow-like.html");
  assert.deepEqual(await state(like.tab), [field("velocity.y"), [-200, 150]]);
  await like.tab.close();
  await tab.close();
});

test("a link to a field that the model lacks shows the density", async () => {
  const { tab } = await openFlow("#at=5,5,5&from=0,0,0,30&look=density&field=heat&range=-5,5");
  assert.deepEqual(await tab.evaluate(() => [globalThis.particlegs.page.state.field, globalThis.particlegs.page.state.range]), [null, null]);
  assert.match(await tab.textContent("#colorbar .bar-title"), /Σ/);
  await tab.close();
});

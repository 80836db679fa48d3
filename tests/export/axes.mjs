// Three rods along x, y and z, exported as PLY, in SuperSplat's viewer: y is up, and nothing is mirrored.
//
//     node axes.mjs SPLAT_TRANSFORM FOLDER
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { writeFileSync } from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { browser, run } from "../browser/common.mjs";

const [transform, folder] = process.argv.slice(2).map((name) => path.resolve(name));
const file = (name) => path.join(folder, name);

/** 1000 particles along each axis, of three types. */
function rods() {
  const rows = Array.from({ length: 3000 }, (_, i) => {
    const axis = Math.floor(i / 1000);
    const place = [0, 1, 2].map((k) => 0.05 * Math.sin(i * (1.7 + k)) + (k === axis ? (i % 1000) / 1000 : 0));
    return `${i + 1} ${axis + 1} ${place.join(" ")}`;
  });
  const bounds = "-1 1\n".repeat(3);
  return `ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n3000\nITEM: BOX BOUNDS ff ff ff\n${bounds}ITEM: ATOMS id type x y z\n${rows.join("\n")}\n`;
}

/** The middle of the pixels that are close to a colour, from the left and from the top. */
const middle = (tab, png, color) => tab.evaluate(async ([base64, color]) => {
  const image = new Image();
  image.src = `data:image/png;base64,${base64}`;
  await image.decode();
  const c = new OffscreenCanvas(image.width, image.height).getContext("2d");
  c.drawImage(image, 0, 0);
  const { data } = c.getImageData(0, 0, image.width, image.height);
  let [x, y, n] = [0, 0, 0];
  for (let i = 0; i < data.length; i += 4) {
    if (color.some((v, k) => Math.abs(data[i + k] - v) > 30)) continue;
    [x, y, n] = [x + (i / 4) % image.width, y + Math.floor(i / 4 / image.width), n + 1];
  }
  return n > 200 ? [x / n, y / n] : null;
}, [png.toString("base64"), color]);

writeFileSync(file("axes.dump"), rods());
run("compress", file("axes.dump"), "-o", file("axes.pgs"), "--gaussians", "60", "--effort", "fast", "--certificate", "none", "-q");
run("export", file("axes.pgs"), "-o", file("axes.ply"), "--color", "layer", "--opacity", "1", "--radius", "0.05", "-q");
const made = spawnSync(process.execPath, [transform, "-q", "-w", "-g", "cpu", file("axes.ply"), file("axes.html")], { encoding: "utf8" });
assert.equal(made.status, 0, made.stderr);
const b = await browser();
try {
  const tab = await b.newPage({ viewport: { width: 640, height: 480 } });
  await tab.goto(pathToFileURL(file("axes.html")).href);
  const other = await b.newPage();
  // The colours of the first three layers.
  const colors = [[0x56, 0xb4, 0xe9], [0xe6, 0x9f, 0x00], [0x00, 0x9e, 0x73]];
  let places = [];
  for (let tries = 0; tries < 60 && !(places.length === 3 && places.every((p) => p)); tries++) {
    await tab.waitForTimeout(1000);
    const png = await tab.screenshot();
    places = await Promise.all(colors.map((c) => middle(other, png, c)));
  }
  const [x, y, z] = places;
  assert.ok(x && y && z, `not all rods are seen: ${JSON.stringify(places)}`);
  assert.ok(y[1] < x[1] && y[1] < z[1], `y is not up: ${JSON.stringify(places)}`);
  // From above, x turns clockwise into z.
  const turn = (x[0] - y[0]) * (z[1] - y[1]) - (x[1] - y[1]) * (z[0] - y[0]);
  assert.ok(turn > 0, `mirrored: ${JSON.stringify(places)}`);
  console.log(`axes: SuperSplat's viewer has y up, at ${JSON.stringify(places.map((p) => p.map(Math.round)))}`);
} finally {
  await b.close();
}

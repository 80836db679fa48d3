// Bundles the page's sources into the given folder; with a second argument, the engine's module, compressed as well.
import { gzipAsync } from "@gfx/zopfli";
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { readFile, writeFile } from "node:fs/promises";

const [out, engine] = process.argv.slice(2);
for (const [name, entry] of [["viewer", "main"], ["worker", "worker"]]) {
  await build({
    entryPoints: [`src/${entry}.ts`], outfile: `${out}/${name}.js`, bundle: true, minify: true, format: "iife",
    target: ["chrome109", "firefox115", "safari16.4"], legalComments: "none", charset: "utf8",
  });
}
await build({ stdin: { contents: await readFile("src/viewer.css", "utf8"), loader: "css" }, outfile: `${out}/viewer.css`, minify: true });
// Hashes for the page's security policy.
for (const name of ["viewer.js", "viewer.css"]) {
  await writeFile(`${out}/${name}.sha256`, createHash("sha256").update(await readFile(`${out}/${name}`)).digest("base64"));
}
// A twentieth smaller than by gzip -9, and opened by the same browsers.
if (engine) await writeFile(`${out}/engine.wasm.gz`, await gzipAsync(await readFile(engine), { numiterations: 5 }));

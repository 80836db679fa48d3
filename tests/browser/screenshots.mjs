// Screenshots of the page with the bundled sample: node tests/browser/screenshots.mjs DIR.
import path from "node:path";
import { browser, open, run, sample, serve } from "./common.mjs";

const dir = path.resolve(process.argv[2]);
run("compress", sample, "-o", "nbody64.pgs", "--quiet");
const [b, server] = [await browser(), await serve("nbody64.pgs", "--snapshot", sample)];

/** Opens the page, acts, waits until it is drawn, and saves a screenshot. */
async function shot(name, hash, options, act = async () => {}) {
  const { tab, said } = await open(b, `${server.url}?draw=cpu#${hash}`, options);
  await act(tab);
  await tab.waitForTimeout(1200);
  await tab.screenshot({ path: path.join(dir, `${name}.png`) });
  if (said.length) console.log(name, said);
  await tab.close();
}

const at = (azimuth, elevation, distance) => `at=12.5,12.5,12.5&from=${azimuth},${elevation},0,${distance}`;
await shot("page-density", `${at(35, 20, 46)}&look=density&box=1`, { colorScheme: "dark" }, async (tab) => {
  await tab.click("summary:has-text('Model and certificate')");
  await tab.evaluate(() => document.querySelector(".facts").scrollIntoView());
});
await shot("page-split", at(20, 10, 42), { colorScheme: "light" }, async (tab) => {
  await tab.keyboard.press("t");
  await tab.waitForFunction(() => document.documentElement.dataset.compared);
});
await b.close();
await server.stop();

// The page from disk in Firefox: it draws and writes nothing to the console.
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { before, test } from "node:test";
import { page, prepare } from "./common.mjs";

const require = createRequire(new URL("../../web/package.json", import.meta.url));
const puppeteer = require("puppeteer-core");

before(prepare);

test("in Firefox: the page shows the CPU's picture, and a link restores a view", { timeout: 120_000 }, async () => {
  const firefox = await puppeteer.launch({
    browser: "firefox", executablePath: process.env.FIREFOX ?? "/usr/bin/firefox-esr", headless: true,
  });
  try {
    const tab = await firefox.newPage();
    const said = [];
    tab.on("console", (m) => ["error", "warn"].includes(m.type()) && said.push(m.text()));
    tab.on("pageerror", (e) => said.push(e.message));
    await tab.goto(page("?draw=cpu", "#look=expected"));
    await tab.waitForFunction(() => document.documentElement.dataset.full || document.documentElement.dataset.failed);
    const found = await tab.evaluate(async () => {
      const { page, pixels } = globalThis.particlegs;
      const { width, height } = page.panes[0].size;
      const shown = page.panes[0].cpu.getContext("2d").getImageData(0, 0, width, height).data;
      const cpu = await pixels(page.state);
      let [differing, lit] = [0, 0];
      for (let i = 0; i < shown.length; i++) {
        if (shown[i] !== cpu[i]) differing++;
        if (i % 4 === 0 && shown[i] > 2) lit++;
      }
      return { differing, lit: lit / (width * height), look: page.state.look };
    });
    assert.equal(found.differing, 0);
    assert.equal(found.look, "expected");
    assert.ok(found.lit > 0.02, `${found.lit}`);
    assert.deepEqual(said, []);
  } finally {
    await firefox.close();
  }
});

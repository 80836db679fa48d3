// Exports of the page, and the import of views files.

import { download, h } from "./dom";
import { asWide } from "./camera";
import { askForm, field } from "./dialog";
import { withColorBar } from "./colorbar";
import { drawOverlay } from "./overlay";
import type { Page } from "./page";
import type { Size } from "./protocol";
import type { SeriesFrames } from "./series";
import { fromViewsFile, hasColorBar, mapOf, paintOf, sceneOf, toLink, viewsFile, type State } from "./state";
import { canvasOf, encodeNpy, encodePng, encodeZip } from "./encode";

const SIZES: [string, Size][] = [
  ["screen size", { width: 0, height: 0 }], ["1920 × 1080", { width: 1920, height: 1080 }],
  ["3840 × 2160 (4K)", { width: 3840, height: 2160 }], ["7680 × 4320 (8K)", { width: 7680, height: 4320 }],
];

const stem = (page: Page): string => page.panes[0].name.replace(/\.pgs$/, "");

/** Texts for the PNG: the view settings, as `render --like` reads them, and the link. */
function pngTexts(page: Page, size: Size, range: [number, number] | null): Record<string, string> {
  const { state: s, panes: [pane], setup: { version } } = page;
  const shown = hasColorBar(s);
  const field = s.field && {
    field: s.field.name, range, unit: mapOf(s.field.name, pane.about)?.unit, shade: s.field.shade,
    ...(s.field.scale ? { scale: s.field.scale } : {}), ...(s.field.bulk ? { bulk: "mean" } : {}),
    ...(s.field.colormap ? { colormap: s.field.colormap } : {}),
  };
  const density = { colormap: s.colormap, range, unit: pane.about.units.surface };
  const provenance = {
    particlegs: version, of: [{ name: pane.name, blake3: pane.about.blake3 }], ...(pane.moment ? { moment: pane.moment.text } : {}), style: shown ? "density" : s.look,
    layers: s.hidden.length > 0 ? pane.about.layers.map((l) => l.name).filter((n) => !s.hidden.includes(n)) : [],
    color_by_layer: s.byLayer && !shown,
    ...(shown ? field ?? density : {}),
    ...(s.white ? { background: "white" } : {}),
    views: JSON.parse(viewsFile(s, pane.about, size)) as unknown,
  };
  return { Software: `particlegs ${version}`, particlegs: JSON.stringify(provenance), "particlegs:link": toLink(s) };
}

/** What is drawn over a picture and beside it. */
interface Annotations { lines: boolean; bar: boolean }

/** A picture as PNG; for densities and fields with the colour bar, if wanted. */
async function renderPng(page: Page, state: State, size: Size, { lines, bar }: Annotations): Promise<Uint8Array<ArrayBuffer>> {
  const pane = page.panes[0];
  state = { ...state, orbit: asWide(state.orbit, pane.size, size) };
  const range = state.range ?? pane.answerFor(state)?.range ?? null;
  const { json, numbers } = await pane.picture(sceneOf(state, pane.about, size), paintOf({ ...state, range }));
  const canvas = canvasOf(numbers, size);
  if (lines) {
    const over = new OffscreenCanvas(size.width, size.height);
    drawOverlay(over.getContext("2d", { willReadFrequently: true })!, state, pane, size, size.height / 720);
    canvas.getContext("2d")!.drawImage(over, 0, 0);
  }
  const content = bar ? await pane.bar(state, json) : null;
  return encodePng(content ? withColorBar(canvas, content, state.white) : canvas, pngTexts({ ...page, state }, size, json.range));
}

export async function exportPng(page: Page): Promise<void> {
  const sizes = h("select", { name: "size" }, ...SIZES.map(([text], i) => h("option", { value: i, text })));
  const lines = h("input", { type: "checkbox", name: "lines" });
  const bar = h("input", { type: "checkbox", name: "bar", checked: true });
  const form = await askForm("Save a picture", "Save", field("Size", sizes), h("label", { class: "check" }, lines, "with time, box, circles, axes and scale bar, if shown"),
    h("label", { class: "check", hidden: !hasColorBar(page.state) }, bar, "with colour bar"));
  if (!form) return;
  const asked = SIZES[Number(sizes.value)][1];
  const size = asked.width ? asked : page.panes[0].size;
  page.say(`drawing ${size.width} × ${size.height} …`);
  const bytes = await renderPng(page, page.state, size, { lines: lines.checked, bar: bar.checked });
  download(`${stem(page)}.png`, [bytes], "image/png");
  page.say("saved; the PNG also stores the camera");
}

export async function exportNpy(page: Page): Promise<void> {
  const pane = page.panes[0];
  const { field, look } = page.state;
  const style = look === "density" ? "density" : "depth";
  const { numbers } = await pane.values(sceneOf(page.state, pane.about, pane.size), style, field);
  download(`${stem(page)}-${field?.name ?? style}.npy`, encodeNpy(numbers, pane.size), "application/octet-stream");
  const map = mapOf(field?.name, pane.about);
  const what = map ? `${map.title}${map.unit ? ` in ${map.unit}` : ""}, NaN where there is no mass`
    : style === "density" ? "surface densities" : "optical depths";
  page.say(`saved ${what}; row 0 is the top`);
}

export function exportViews(page: Page): void {
  const pane = page.panes[0];
  download("views.json", [viewsFile(page.state, pane.about, pane.size)], "application/json");
}

export function importViews(page: Page): void {
  const input = h("input", { type: "file", accept: ".json,application/json" });
  input.addEventListener("change", () => {
    void input.files?.[0]?.text().then((text) => page.change(fromViewsFile(text, page.state, page.panes[0].about)))
      .catch((error: Error) => page.say(`${input.files?.[0]?.name}: ${error.message}`));
  });
  input.click();
}

/** Copies a text; where the browser refuses, shows it for the user to copy. */
async function copyText(page: Page, what: string, text: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    page.say(`copied ${what}`);
  } catch {
    const area = h("textarea", { rows: 4, readonly: true, "aria-label": what });
    area.value = text;
    await askForm(`Copy ${what}`, "Done", area);
  }
}

export function copyLink(page: Page): Promise<void> {
  if (location.protocol === "about:") {
    return Promise.reject(new Error("this page is embedded in another and has no address: save it as a separate page first"));
  }
  return copyText(page, "a link to this view", `${location.href.split("#")[0]}#${toLink(page.state)}`);
}

/** Quotes a word for a shell: names come from files and may contain anything. */
const shellQuote = (word: string): string => (/^[\w./,][\w./,-]*$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

/** The options of `render` that name a moment of a series: the nearest frame where its clock has no words for it. */
function momentOption(series: SeriesFrames, time: number): string {
  const position = series.positionOf(time);
  const word = position % 1 === 0 ? undefined : { "scale factor": "a", "time step": "step" }[series.clock];
  return word ? `--time ${word}=${Number(time.toPrecision(9))}` : `--frame ${series.frames[Math.round(position)].number}`;
}

/** The command that draws the picture on the screen, given the exported views.json. */
export function commandFor(page: Page): string {
  const { state: s } = page;
  const [{ name, about, series }] = page.panes;
  const parts = [`particlegs render ${shellQuote(name.startsWith("-") ? `./${name}` : name)} --views views.json`];
  if (s.field) {
    parts.push(`--field ${shellQuote(s.field.name)}`);
    if (s.field.bulk && mapOf(s.field.name, about)?.moves) parts.push("--bulk mean");
    if (s.field.scale) parts.push(`--scale ${s.field.scale}`);
    if (s.field.shade) parts.push("--shade");
    if (s.field.colormap) parts.push(`--colormap ${s.field.colormap}`);
  } else {
    parts.push(`--style ${s.look}`);
    if (s.look === "density") parts.push(`--colormap ${s.colormap}`);
  }
  const range = hasColorBar(s) && (s.range ?? page.panes[0].answerFor(s)?.range);
  if (range) parts.push(`--range=${range.map((v) => Number(v.toPrecision(6))).join(",")}`);
  const shown = about.layers.map((l) => l.name).filter((n) => !s.hidden.includes(n));
  if (shown.length < about.layers.length) parts.push(`--layer ${shellQuote(shown.join(","))}`);
  if (s.byLayer && !hasColorBar(s)) parts.push("--color-by-layer");
  if (s.white) parts.push("--background white");
  if (series) parts.push(momentOption(series, s.time ?? 0));
  const left = [s.clip && "the clip box", s.slab && s.slab.axis !== "view" && "the slab", s.images && "periodic images",
    s.exposure !== 0 && "the exposure", page.setup.opening.circles && s.circles && "the circles"].filter((t) => t);
  const note = left.length > 0 ? `   # without ${left.join(", ")}` : "";
  return `${parts.join(" ")} --no-annotations -o picture.png${note}`;
}

export async function copyCommand(page: Page): Promise<void> {
  exportViews(page);
  await copyText(page, "the command (it needs the saved views.json)", commandFor(page));
}

export async function exportTurn(page: Page): Promise<void> {
  const frames = h("input", { type: "number", min: 2, max: 720, value: 72 });
  const sizes = h("select", {}, ...SIZES.slice(0, 3).map(([text], i) => h("option", { value: i, text })));
  const form = await askForm("Export a turntable", "Export", field("Frames", frames), field("Size", sizes));
  if (!form) return;
  const asked = SIZES[Number(sizes.value)][1];
  const size = asked.width ? asked : page.panes[0].size;
  const count = Math.max(2, Math.min(720, Math.round(Number(frames.value)) || 72));
  const files: { name: string; bytes: Uint8Array<ArrayBuffer> }[] = [];
  const start = page.state;
  const turned = (i: number) => ({ ...start.orbit, azimuth: start.orbit.azimuth + (360 * i) / count });
  let { distance } = start.orbit;
  if (start.orbit.orthographic) {
    // If the window shows the whole box now, it shows it in every frame.
    const whole: number[] = [];
    for (let i = 0; i < count; i++) whole.push((await page.panes[0].window({ ...start, orbit: turned(i) })).distance);
    if (distance > 0.999999 * whole[0]) distance = Math.max(distance, ...whole);
  }
  for (let i = 0; i < count; i++) {
    const orbit = { ...turned(i), distance };
    files.push({ name: `frame_${String(i).padStart(4, "0")}.png`, bytes: await renderPng(page, { ...start, orbit }, size, { lines: false, bar: true }) });
    page.say(`frame ${i + 1} of ${count}`);
  }
  download(`${stem(page)}-turn.zip`, encodeZip(files), "application/zip");
  page.say("saved; to make a video: ffmpeg -framerate 30 -i frame_%04d.png -pix_fmt yuv420p turn.mp4");
}

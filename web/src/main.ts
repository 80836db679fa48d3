// The page: starts the engine, opens the models, and connects panes, panel, pointer and keys to one state.

import { ColorBar } from "./colorbar";
import type { Orbit } from "./camera";
import { h } from "./dom";
import { showKeys } from "./dialog";
import { summaryTable, summaryLine, probeText, probeFieldsTexts } from "./summary";
import { listenToPointer, listenToKeys } from "./input";
import { keyBindings } from "./keys";
import { Pane } from "./pane";
import type { Page } from "./page";
import { panel, preset, parseTarget, type Action, type PanelContext } from "./panel";
import type { ProbeHit, Setup, Vec3 } from "./protocol";
import { EngineClient } from "./engine";
import { Comparison } from "./compare";
import { SeriesFrames } from "./series";
import { cameraFor, densityDiffers, fromLink, hasColorBar, initialState, mapOf, withOpening, paintOf, sceneOf, toLink, withKnownField, type State } from "./state";
import { copyCommand, copyLink, exportNpy, exportPng, exportTurn, exportViews, importViews } from "./export";
import { Timeline } from "./timeline";
import { lengthUnit, formatNumber, formatWhole } from "./units";

const setup = JSON.parse(document.getElementById("setup")!.textContent!) as Setup;
const app = document.getElementById("app")!;
const poster = document.getElementById("poster");
const status = h("p", { id: "status", role: "status", text: "Decoding …" });
const timing = h("p", { id: "timing" });
const stage = h("div", { id: "stage" });
const bar = new ColorBar();
const title = h("h1", { text: setup.models.map((m) => m.name).join(" | ") });
const subtitle = h("p", { id: "subtitle" });
const fold = h("button", { type: "button", text: "Controls", "aria-expanded": "true", "aria-controls": "panel", click: () => togglePanel() });
const help = h("button", { type: "button", text: "?", "aria-label": "Keys and mouse", click: () => showKeys(keys) });
const theme = h("button", { type: "button", text: "◐", "aria-label": "Switch between dark and light", click: () => toggleTheme() });
const head = h("header", {}, h("div", { class: "name" }, title, subtitle), h("div", { class: "buttons" }, fold, theme, help));
const shell = h("aside", { id: "panel", "aria-label": "Controls" });
if (poster) stage.append(poster);
app.append(head, h("div", { id: "view" }, stage, bar.element, shell), h("footer", {}, status, timing));

let keys: ReturnType<typeof keyBindings> = [];

function togglePanel(): void {
  const open = document.body.classList.toggle("folded");
  fold.setAttribute("aria-expanded", String(!open));
}

function toggleTheme(): void {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
}

/** If decoding takes longer, in milliseconds, pictures are shown meanwhile. */
const LONG = 500;

/** Shows a line in the status bar until the next one. */
function say(text: string): void {
  status.textContent = text;
}

async function start(): Promise<void> {
  if (matchMedia("(max-width: 700px)").matches) togglePanel();
  performance.mark("script");
  const remote = await EngineClient.start(setup);
  performance.mark("engine");
  const panes: Pane[] = [];
  for (const [i, model] of setup.models.entries()) {
    const { json: { about, decoded, series }, milliseconds, start } = model.series
      ? await remote.openSeries(model) : { ...await remote.open(model), start: 0 };
    // A poster, or a short wait, is better than a partly decoded model.
    const waits = poster !== null || milliseconds / decoded < LONG;
    const pane = new Pane(remote, i, model.name, about, decoded, waits, series ? new SeriesFrames(remote, i, model, series, start) : null);
    pane.circles = setup.opening.circles ?? [];
    stage.append(pane.element);
    panes.push(pane);
  }
  performance.mark("opened");
  stage.classList.toggle("many", panes.length > 1);
  const about = panes[0].about;
  subtitle.textContent = panes.map((p, i) => summaryLine(p.about, setup.models[i].bytes, p.series)).join(" | ");
  const named = panes.flatMap((p) => p.about.layers).filter((l, i, all) => all.findIndex((o) => o.name === l.name) === i);
  const series = panes.map((p) => p.series).filter((s) => s !== null);
  const first = (home: Orbit) => withOpening(setup.opening, initialState(about, home, series[0]?.frames[0].time ?? null), about, named.map((l) => l.name));
  const home = await panes[0].home();
  const page: Page = { setup, remote, panes, layers: named.length, state: first(home), change, say };
  page.state = fromLink(location.hash.slice(1), page.state);
  const compare = setup.truth ? new Comparison(page, setup.truth) : null;
  const context: PanelContext = {
    about, layers: named, circles: setup.opening.circles !== undefined, state: () => page.state, change, range: rangeNow, act, goTo,
    logarithmic: () => !page.state.field || panes[0].answerFor(page.state)?.scale === "log",
  };
  const controls = panel(context);
  controls.element.append(...panes.map((p, i) => summaryTable(p, setup.models[i].bytes, setup.models[i].verdict, panes.length > 1)));
  if (compare) controls.element.prepend(compare.element);
  shell.replaceWith(controls.element);
  const timeline = series[0] ? new Timeline(page, series[0]) : null;
  if (timeline) app.lastElementChild!.before(timeline.element);
  keys = keyBindings(page, act, timeline, (which) => change({ orbit: preset(page.state, which) }));
  listenToKeys(keys);

  /** The range of the state, or of the last picture. */
  function rangeNow(): [number, number] | null {
    return page.state.range ?? panes[0].answerFor(page.state)?.range ?? null;
  }

  /** Draws all panes with the range of the first, which the colour bar shows. */
  function showAll(): void {
    panes[0].show(page.state);
    showOthers();
  }

  function showOthers(): void {
    const first = panes[0].answerFor(page.state);
    const { field } = page.state;
    const own = mapOf(field?.name, about);
    for (const p of panes.slice(1)) {
      const map = mapOf(field?.name, p.about);
      const density = field || page.state.look !== "density" ? "" : densityDiffers(p.about, about);
      const lacks = density ? `${p.name}: ${density}` : !own || map?.unit === own.unit ? ""
        : map ? `${p.name} has the field in another unit` : `${p.name} has no ${own.title}`;
      p.show({ ...page.state, field: field && { ...field, scale: first?.scale ?? field.scale }, range: rangeNow() }, lacks);
    }
  }

  let linked: ReturnType<typeof setTimeout> | undefined;
  function change(part: Partial<State>): void {
    page.state = { ...page.state, ...part };
    if (!about.colormaps.includes(page.state.colormap)) page.state.colormap = "inferno";
    // Alpha-blend models have only this style.
    if (!panes.every((p) => p.about.adds_up)) page.state.look = "paraview";
    page.state = withKnownField(page.state, about);
    document.body.classList.toggle("white", page.state.white);
    showAll();
    controls.refresh(page.state);
    timeline?.refresh();
    compare?.moved();
    void fit().catch(sayError);
    // Browsers refuse more than 100 changes of address in ten seconds.
    clearTimeout(linked);
    // A page embedded in another, such as a notebook, has no address of its own.
    if (location.protocol === "about:") return;
    linked = setTimeout(() => history.replaceState(null, "", `#${toLink(page.state)}`), 300);
  }

  /** The camera position that was last set by `fit`. */
  let usual: Pick<Orbit, "focal" | "distance"> = home;
  const viewKey = ({ azimuth, elevation, roll, orthographic }: Orbit) =>
    JSON.stringify([azimuth, elevation, roll, orthographic, panes[0].size]);
  /** The view that `fit` has handled; a link's camera needs no fit. */
  let fitted = location.hash.length > 1 ? viewKey(page.state.orbit) : "";
  let fitting = false;

  /** Moves the camera to show the whole box (orthographic) or to its default place, unless the user moved it. */
  async function fit(): Promise<void> {
    if (fitting || !panes[0].whole) return;
    fitting = true;
    try {
      while (fitted !== viewKey(page.state.orbit)) {
        fitted = viewKey(page.state.orbit);
        // Both queries are sent at once, so that a script's next query is answered after the fit.
        const wanted = page.state.orbit.orthographic ? panes[0].window(page.state) : null;
        const [first, window] = await Promise.all([panes[0].home(), wanted]);
        const free = (k: "focal" | "distance", o: Orbit) => [usual, first].some((own) => String(own[k]) === String(o[k]));
        if (!free("focal", page.state.orbit) && !free("distance", page.state.orbit)) continue;
        const to = window ?? first;
        const now = page.state.orbit;
        const orbit = {
          ...now, focal: free("focal", now) ? to.focal : now.focal, distance: free("distance", now) ? to.distance : now.distance,
        };
        usual = to;
        change({ orbit });
      }
    } finally {
      fitting = false;
    }
  }

  function act(name: Action): void {
    const acts: Record<Action, () => void | Promise<void>> = {
      reset: async () => {
        const orbit = await panes[0].home();
        fitted = "";
        change({ orbit: { ...orbit, orthographic: page.state.orbit.orthographic } });
      },
      png: () => exportPng(page), npy: () => exportNpy(page), views: () => exportViews(page), load: () => importViews(page),
      link: () => copyLink(page), command: () => copyCommand(page), turn: () => exportTurn(page),
      compare: () => compare?.toggle("split"), difference: () => compare?.toggle("difference"), help: () => showKeys(keys),
    };
    const exports = ["png", "npy", "views", "link", "command", "turn"].includes(name);
    const done = exports && timeline ? timeline.pause().then(acts[name]) : Promise.resolve(acts[name]());
    done.catch((error: unknown) => say(error instanceof Error ? error.message : String(error)));
  }

  function goTo(text: string): string | null {
    const to = parseTarget(text);
    if (!to) return "enter a point as x, y, z or a Gaussian as #number";
    if ("point" in to) {
      lookAt(to.point);
      return null;
    }
    remote.ask<{ position: Vec3; extent: number }>({ ask: "gaussian", model: 0, index: to.gaussian })
      .then(({ json }) => lookAt(json.position), (error: Error) => say(error.message));
    return null;
  }

  function lookAt(point: Vec3): void {
    change({ orbit: { ...page.state.orbit, focal: point } });
  }

  async function probe(pane: Pane, pixel: [number, number]): Promise<ProbeHit | null> {
    const { width } = pane.size;
    const per = width / pane.element.clientWidth;
    const scene = sceneOf(page.state, pane.about, pane.size);
    const at: [number, number] = [pixel[0] * per - 0.5, pixel[1] * per - 0.5];
    return (await remote.ask<ProbeHit | null>({ ask: "probe", model: pane.model, scene, pixel: at })).json;
  }

  async function reportProbe(pane: Pane, pixel: [number, number]): Promise<void> {
    const found = await probe(pane, pixel);
    pane.marker = null;
    if (!found) {
      pane.lines();
      return say("there is nothing here");
    }
    // The sphere's radius is 2 % of the picture's height.
    const radius = 0.04 * page.state.orbit.distance * Math.tan((15 * Math.PI) / 180) * 2;
    pane.marker = { position: found.position, sphere: radius };
    pane.lines();
    const { layers, clip } = sceneOf(page.state, pane.about, pane.size);
    const { json } = await remote.ask<{ count: number; mass: number | null }>(
      { ask: "sphere", model: pane.model, center: found.in_box, radius, layers, clip });
    const held = json.mass !== null ? `${formatNumber(json.mass)} ${pane.about.units.mass}` : `${formatWhole(json.count)} particles`;
    const lines = [`${probeText(found, pane.about)}; ${held} within ${`${formatNumber(radius)} ${lengthUnit(pane.about)}`.trim()}`];
    say([...lines, ...probeFieldsTexts(found, pane.about)].join("\n"));
  }

  const sayError = (error: unknown) => say(error instanceof Error ? error.message : String(error));
  for (const pane of panes) {
    listenToPointer(pane.element, {
      orbit: () => page.state.orbit,
      moved: (orbit) => change({ orbit }),
      clicked: (pixel) => void reportProbe(pane, pixel).catch(sayError),
      centred: (pixel) => void probe(pane, pixel).then((s) => s && lookAt(s.position), sayError),
    });
    pane.onerror = say;
    pane.onframe = (full) => void reportFrame(pane, full).catch(sayError);
  }

  async function reportFrame(pane: Pane, full: boolean): Promise<void> {
    if (poster) poster.remove();
    // Pictures during decoding are not timed.
    if (pane === panes[0] && pane.milliseconds > 0) timing.textContent = `${pane.milliseconds.toFixed(0)} ms on the ${pane.drew}`;
    timeline?.refresh();
    if (pane !== panes[0]) return;
    document.documentElement.dataset.frames = String(pane.frames);
    if (pane.frames === 1) performance.mark("first-picture");
    if (full && !document.documentElement.dataset.full) {
      performance.mark("full-picture");
      setTimeout(() => void chooseProcessor(panes, () => change({})), 200);
    }
    if (full) document.documentElement.dataset.full = String(Number(document.documentElement.dataset.full ?? 0) + 1);
    const shared = panes[1]?.shownRange;
    if ((full || pane.playing) && shared !== undefined && hasColorBar(page.state) && String(shared) !== String(pane.range)) showOthers();
    const content = await pane.lastBar();
    if (content) bar.show(content);
    else bar.hide();
    if (content && full) controls.refresh(page.state);
  }

  let sizes = panes.map((p) => `${p.size.width}x${p.size.height}`).join();
  new ResizeObserver(() => {
    const now = panes.map((p) => `${p.size.width}x${p.size.height}`).join();
    if (now !== sizes) change({});
    sizes = now;
  }).observe(stage);
  addEventListener("hashchange", () => {
    const text = location.hash.slice(1);
    if (text === toLink(page.state)) return;
    void panes[0].home().then((home) => {
      const linked = fromLink(text, first(home));
      fitted = viewKey(linked.orbit);
      change(linked);
    }, sayError);
  });
  // An interface for scripts.
  const pixels = async (state: State) =>
    new Uint8Array((await panes[0].picture(sceneOf(state, about, panes[0].size), paintOf(state))).numbers);
  const camera = () => cameraFor(page.state, about);
  Object.assign(globalThis, { particlegs: { page, change, pixels, camera, toLink: () => toLink(page.state) } });
  change({});
  for (const pane of panes) await pane.decode((share) => reportDecoding(pane, share));
  await fit();
  for (const s of series) await s.loadAll(() => timeline?.refresh());

  /** Reports progress in steps of 10 %, which a screen reader can follow; other messages are kept. */
  function reportDecoding(pane: Pane, share: number): void {
    const text = share < 1 ? `Decoding${panes.length > 1 ? ` ${pane.name}` : ""}: ${10 * Math.floor(10 * share)} %` : "";
    const ours = status.textContent === "" || status.textContent!.startsWith("Decoding");
    if (ours && status.textContent !== text) say(text);
  }
}

/** Uses the GPU if it is faster than the CPU; reports if it cannot be used. */
async function chooseProcessor(panes: Pane[], redraw: () => void): Promise<void> {
  const asked = new URLSearchParams(location.search).get("draw");
  for (const pane of panes) {
    try {
      if (asked === "cpu") continue;
      const gpu = pane.startGpu();
      if (asked === "gpu") pane.by = "GPU";
      // A GPU emulated in software is slower than the CPU renderer.
      else if (!gpu.software) await pane.measure();
    } catch (error) {
      pane.by = "CPU";
      say(`drawing on the CPU: ${error instanceof Error ? error.message : String(error)}`);
    }
  }
  document.documentElement.dataset.by = panes[0].by;
  // `measure` draws by itself.
  if (asked === "gpu") redraw();
}

start().catch((error: unknown) => {
  say(error instanceof Error ? error.message : String(error));
  document.documentElement.dataset.failed = "true";
});

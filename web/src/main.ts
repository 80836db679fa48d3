// The page: starts the engine, opens the models, wires panes, panel, hand and keys to one state.

import { ColorBar } from "./colorbar";
import type { Orbit } from "./camera";
import { h } from "./dom";
import { showKeys } from "./dialog";
import { summaryTable, summaryLine, probeText } from "./summary";
import { listenToPointer, listenToKeys } from "./input";
import { keyBindings } from "./keys";
import { Pane } from "./pane";
import { panel, preset, parseTarget, type Action, type PanelContext } from "./panel";
import type { ProbeHit, Setup, Vec3 } from "./protocol";
import { EngineClient } from "./engine";
import { Comparison } from "./compare";
import { cameraFor, fromLink, initialState, withOpening, paintOf, sceneOf, toLink, type State } from "./state";
import { copyCommand, copyLink, exportNpy, exportPng, exportTurn, exportViews, importViews } from "./export";
import { lengthUnit, formatNumber, formatWhole } from "./units";

/** The page as its parts see it; `layers`: how many names of layers the models have. */
export interface Page {
  setup: Setup; remote: EngineClient; panes: Pane[]; layers: number; state: State; change(part: Partial<State>): void; say(text: string): void;
}

const setup = JSON.parse(document.getElementById("setup")!.textContent!) as Setup;
const app = document.getElementById("app")!;
const poster = document.getElementById("poster");
const status = h("p", { id: "status", role: "status", text: "Decoding …" });
const timing = h("p", { id: "timing" });
const stage = h("div", { id: "stage" });
const bar = new ColorBar();
const title = h("h1", { text: setup.models.map((m) => m.name).join(" | ") });
const subtitle = h("p", { id: "subtitle" });
const fold = h("button", { type: "button", text: "Dials", "aria-expanded": "true", "aria-controls": "panel", click: () => togglePanel() });
const help = h("button", { type: "button", text: "?", "aria-label": "Keys and mouse", click: () => showKeys(keys) });
const theme = h("button", { type: "button", text: "◐", "aria-label": "Dark or light page", click: () => toggleTheme() });
const head = h("header", {}, h("div", { class: "name" }, title, subtitle), h("div", { class: "buttons" }, fold, theme, help));
const shell = h("aside", { id: "panel", "aria-label": "Dials" });
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

/** Milliseconds of decoding from which on a picture is shown before it ends. */
const LONG = 500;

/** One line that stays until the next. */
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
    const { json: { about, decoded }, milliseconds } = await remote.open(model);
    // A poster, or a moment, is better than what there is by now.
    const waits = poster !== null || milliseconds / decoded < LONG;
    const pane = new Pane(remote, i, model.name, about, decoded, waits);
    stage.append(pane.element);
    panes.push(pane);
  }
  performance.mark("opened");
  stage.classList.toggle("many", panes.length > 1);
  const about = panes[0].about;
  subtitle.textContent = panes.map((p, i) => summaryLine(p.about, setup.models[i].bytes)).join(" | ");
  const named = panes.flatMap((p) => p.about.layers).filter((l, i, all) => all.findIndex((o) => o.name === l.name) === i);
  const first = (home: Orbit) => withOpening(setup.opening, initialState(about, home), about);
  const home = await panes[0].home();
  const page: Page = { setup, remote, panes, layers: named.length, state: first(home), change, say };
  page.state = fromLink(location.hash.slice(1), page.state);
  const compare = setup.truth ? new Comparison(page, setup.truth) : null;
  const context: PanelContext = {
    about, layers: named, state: () => page.state, change, range: () => panes[0].range, act, goTo,
  };
  const dials = panel(context);
  dials.element.append(...panes.map((p, i) => summaryTable(p.name, p.about, setup.models[i].bytes, setup.models[i].verdict, panes.length > 1)));
  if (compare) dials.element.prepend(compare.element);
  shell.replaceWith(dials.element);
  keys = keyBindings(page, act, (which) => change({ orbit: preset(page.state, which) }));
  listenToKeys(keys);

  /** All panes in the range of the first, which the colour bar has. */
  function showAll(): void {
    panes[0].show(page.state);
    panes.slice(1).forEach((p) => p.show({ ...page.state, range: page.state.range ?? panes[0].range }));
  }

  let linked: ReturnType<typeof setTimeout> | undefined;
  function change(part: Partial<State>): void {
    page.state = { ...page.state, ...part };
    if (!about.colormaps.includes(page.state.colormap)) page.state.colormap = "inferno";
    // The alpha-blend law has one look, and no masses.
    if (!panes.every((p) => p.about.adds_up)) page.state.look = "paraview";
    document.body.classList.toggle("white", page.state.white);
    showAll();
    dials.refresh(page.state);
    compare?.moved();
    void fit().catch(sayError);
    // Browsers refuse addresses that change a hundred times in ten seconds.
    clearTimeout(linked);
    // A page within another, such as a notebook's, has no address of its own.
    if (location.protocol === "about:") return;
    linked = setTimeout(() => history.replaceState(null, "", `#${toLink(page.state)}`), 300);
  }

  /** Where a camera stands that nobody moved, and the view that it was found for. */
  let usual: Pick<Orbit, "focal" | "distance"> = home;
  const viewKey = ({ azimuth, elevation, roll, orthographic }: Orbit) =>
    JSON.stringify([azimuth, elevation, roll, orthographic, panes[0].size]);
  // The camera of a link was chosen.
  let fitted = location.hash.length > 1 ? viewKey(page.state.orbit) : "";
  let fitting = false;

  /** Lets an orthographic view show the whole box, and a perspective one stand where it first does, unless moved. */
  async function fit(): Promise<void> {
    if (fitting || !panes[0].whole) return;
    fitting = true;
    try {
      while (fitted !== viewKey(page.state.orbit)) {
        fitted = viewKey(page.state.orbit);
        // Both are asked at once: what anybody asks after this view is answered when it is fitted.
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
    Promise.resolve(acts[name]()).catch((error: unknown) => say(error instanceof Error ? error.message : String(error)));
  }

  function goTo(text: string): string | null {
    const to = parseTarget(text);
    if (!to) return "give a point as x, y, z or a Gaussian as #number";
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
      return say("nothing is here");
    }
    // A sphere that is easy to see: a fiftieth of the picture's height.
    const radius = 0.04 * page.state.orbit.distance * Math.tan((15 * Math.PI) / 180) * 2;
    pane.marker = { position: found.position, sphere: radius };
    pane.lines();
    const { layers, clip } = sceneOf(page.state, pane.about, pane.size);
    const { json } = await remote.ask<{ count: number; mass: number | null }>(
      { ask: "sphere", model: pane.model, center: found.in_box, radius, layers, clip });
    const held = json.mass !== null ? `${formatNumber(json.mass)} ${pane.about.units.mass}` : `${formatWhole(json.count)} particles`;
    say(`${probeText(found, pane.about)}; ${held} within ${`${formatNumber(radius)} ${lengthUnit(pane.about)}`.trim()}`);
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
    // Pictures of what is decoded by now are not timed.
    if (pane === panes[0] && pane.milliseconds > 0) timing.textContent = `${pane.milliseconds.toFixed(0)} ms by ${pane.drew}`;
    if (pane !== panes[0]) return;
    document.documentElement.dataset.frames = String(pane.frames);
    if (pane.frames === 1) performance.mark("first-picture");
    if (full && !document.documentElement.dataset.full) {
      performance.mark("full-picture");
      setTimeout(() => void chooseProcessor(panes, () => change({})), 200);
    }
    if (full) document.documentElement.dataset.full = String(Number(document.documentElement.dataset.full ?? 0) + 1);
    const shared = panes[1]?.shownRange;
    if (full && shared !== undefined && page.state.look === "density" && String(shared) !== String(pane.range)) {
      panes.slice(1).forEach((p) => p.show({ ...page.state, range: page.state.range ?? pane.range }));
    }
    if (page.state.look === "density" && pane.range) {
      bar.show(pane.range, await pane.mapColors(page.state.colormap, page.state.white), about.units.surface);
      if (full) dials.refresh(page.state);
    } else {
      bar.hide();
    }
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
  // For scripts: the page, and the CPU's picture of a state.
  const pixels = async (state: State) =>
    new Uint8Array((await panes[0].picture(sceneOf(state, about, panes[0].size), paintOf(state))).numbers);
  const camera = () => cameraFor(page.state, about);
  Object.assign(globalThis, { particlegs: { page, change, pixels, camera, toLink: () => toLink(page.state) } });
  change({});
  for (const pane of panes) await pane.decode((share) => reportDecoding(pane, share));
  await fit();

  /** Says how far a pane is, in steps that a reader's voice can follow; what was said meanwhile stays. */
  function reportDecoding(pane: Pane, share: number): void {
    const text = share < 1 ? `Decoding${panes.length > 1 ? ` ${pane.name}` : ""}: ${10 * Math.floor(10 * share)} %` : "";
    const ours = status.textContent === "" || status.textContent!.startsWith("Decoding");
    if (ours && status.textContent !== text) say(text);
  }
}

/** Takes the graphics card where it is faster than the CPU; says so where there is none that can. */
async function chooseProcessor(panes: Pane[], redraw: () => void): Promise<void> {
  const asked = new URLSearchParams(location.search).get("draw");
  for (const pane of panes) {
    try {
      if (asked === "cpu") continue;
      const card = pane.startCard();
      if (asked === "gpu") pane.by = "GPU";
      // Software that plays a graphics card is slower than the CPU's own renderer.
      else if (!card.software) await pane.measure();
    } catch (error) {
      pane.by = "CPU";
      say(`drawn by the CPU: ${error instanceof Error ? error.message : String(error)}`);
    }
  }
  document.documentElement.dataset.by = panes[0].by;
  // The processor has drawn already; who is measured draws.
  if (asked === "gpu") redraw();
}

start().catch((error: unknown) => {
  say(error instanceof Error ? error.message : String(error));
  document.documentElement.dataset.failed = "true";
});

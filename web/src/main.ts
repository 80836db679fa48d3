// The page: starts the engine, opens the models, wires panes, panel, hand and keys to one state.

import { ColorBar } from "./bar";
import type { Orbit } from "./camera";
import { h } from "./dom";
import { showKeys } from "./dialog";
import { facts, line, seenText } from "./facts";
import { listen, listenToKeys } from "./hand";
import { keysOf } from "./keys";
import { Pane } from "./pane";
import { panel, preset, target, type Action, type Desk } from "./panel";
import type { Seen, Setup, Vec3 } from "./protocol";
import { Remote } from "./remote";
import { Compare } from "./compare";
import { cameraFor, fromLink, initial, opened, paintOf, sceneOf, toLink, type State } from "./state";
import { giveCommand, giveLink, giveNpy, givePng, giveTurn, giveViews, takeViews } from "./give";
import { lengthUnit, number, whole } from "./units";

/** The page as its parts see it. */
/** `layers`: how many names of layers the models have. */
export interface Page {
  setup: Setup; remote: Remote; panes: Pane[]; layers: number; state: State; change(part: Partial<State>): void; say(text: string): void;
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
const fold = h("button", { type: "button", text: "Dials", "aria-expanded": "true", "aria-controls": "panel", click: () => folded() });
const help = h("button", { type: "button", text: "?", "aria-label": "Keys and mouse", click: () => showKeys(keys) });
const theme = h("button", { type: "button", text: "◐", "aria-label": "Dark or light page", click: () => turnTheme() });
const head = h("header", {}, h("div", { class: "name" }, title, subtitle), h("div", { class: "buttons" }, fold, theme, help));
const shell = h("aside", { id: "panel", "aria-label": "Dials" });
if (poster) stage.append(poster);
app.append(head, h("div", { id: "view" }, stage, bar.element, shell), h("footer", {}, status, timing));

let keys: ReturnType<typeof keysOf> = [];

function folded(): void {
  const open = document.body.classList.toggle("folded");
  fold.setAttribute("aria-expanded", String(!open));
}

function turnTheme(): void {
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
  if (matchMedia("(max-width: 700px)").matches) folded();
  performance.mark("script");
  const remote = await Remote.start(setup);
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
  subtitle.textContent = panes.map((p, i) => line(p.about, setup.models[i].bytes)).join(" | ");
  const named = panes.flatMap((p) => p.about.layers).filter((l, i, all) => all.findIndex((o) => o.name === l.name) === i);
  const first = (home: Orbit) => opened(setup.opening, initial(about, home), about);
  const home = await panes[0].home();
  const page: Page = { setup, remote, panes, layers: named.length, state: first(home), change, say };
  page.state = fromLink(location.hash.slice(1), page.state);
  const compare = setup.truth ? new Compare(page, setup.truth) : null;
  const desk: Desk = {
    about, layers: named, state: () => page.state, change, range: () => panes[0].range, act, goTo,
  };
  const dials = panel(desk);
  dials.element.append(...panes.map((p, i) => facts(p.name, p.about, setup.models[i].bytes, setup.models[i].verdict, panes.length > 1)));
  if (compare) dials.element.prepend(compare.element);
  shell.replaceWith(dials.element);
  keys = keysOf(page, act, (which) => change({ orbit: preset(page.state, which) }));
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
    void fit().catch(failed);
    // Browsers refuse addresses that change a hundred times in ten seconds.
    clearTimeout(linked);
    // A page within another, such as a notebook's, has no address of its own.
    if (location.protocol === "about:") return;
    linked = setTimeout(() => history.replaceState(null, "", `#${toLink(page.state)}`), 300);
  }

  /** Where a camera stands that nobody moved, and the view that it was found for. */
  let usual: Pick<Orbit, "focal" | "distance"> = home;
  const seenBy = ({ azimuth, elevation, roll, orthographic }: Orbit) =>
    JSON.stringify([azimuth, elevation, roll, orthographic, panes[0].size]);
  // The camera of a link was chosen.
  let fitted = location.hash.length > 1 ? seenBy(page.state.orbit) : "";
  let fitting = false;

  /** Lets an orthographic view show the whole box, and a perspective one stand where it first does, unless moved. */
  async function fit(): Promise<void> {
    if (fitting || !panes[0].whole) return;
    fitting = true;
    try {
      while (fitted !== seenBy(page.state.orbit)) {
        fitted = seenBy(page.state.orbit);
        const first = await panes[0].home();
        const free = (k: "focal" | "distance", o: Orbit) => [usual, first].some((own) => String(own[k]) === String(o[k]));
        if (!free("focal", page.state.orbit) && !free("distance", page.state.orbit)) continue;
        const to = page.state.orbit.orthographic ? await panes[0].window(page.state) : first;
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
      png: () => givePng(page), npy: () => giveNpy(page), views: () => giveViews(page), load: () => takeViews(page),
      link: () => giveLink(page), command: () => giveCommand(page), turn: () => giveTurn(page),
      compare: () => compare?.toggle("split"), difference: () => compare?.toggle("difference"), help: () => showKeys(keys),
    };
    Promise.resolve(acts[name]()).catch((error: unknown) => say(error instanceof Error ? error.message : String(error)));
  }

  function goTo(text: string): string | null {
    const to = target(text);
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

  async function seen(pane: Pane, pixel: [number, number]): Promise<Seen | null> {
    const { width } = pane.size;
    const per = width / pane.element.clientWidth;
    const scene = sceneOf(page.state, pane.about, pane.size);
    const at: [number, number] = [pixel[0] * per - 0.5, pixel[1] * per - 0.5];
    return (await remote.ask<Seen | null>({ ask: "probe", model: pane.model, scene, pixel: at })).json;
  }

  async function clicked(pane: Pane, pixel: [number, number]): Promise<void> {
    const found = await seen(pane, pixel);
    pane.marked = null;
    if (!found) {
      pane.lines();
      return say("nothing is here");
    }
    // A sphere that is easy to see: a fiftieth of the picture's height.
    const radius = 0.04 * page.state.orbit.distance * Math.tan((15 * Math.PI) / 180) * 2;
    pane.marked = { position: found.position, sphere: radius };
    pane.lines();
    const { layers, clip } = sceneOf(page.state, pane.about, pane.size);
    const { json } = await remote.ask<{ count: number; mass: number | null }>(
      { ask: "sphere", model: pane.model, center: found.in_box, radius, layers, clip });
    const held = json.mass !== null ? `${number(json.mass)} ${pane.about.units.mass}` : `${whole(json.count)} particles`;
    say(`${seenText(found, pane.about)}; ${held} within ${`${number(radius)} ${lengthUnit(pane.about)}`.trim()}`);
  }

  const failed = (error: unknown) => say(error instanceof Error ? error.message : String(error));
  for (const pane of panes) {
    listen(pane.element, {
      orbit: () => page.state.orbit,
      moved: (orbit) => change({ orbit }),
      clicked: (pixel) => void clicked(pane, pixel).catch(failed),
      centred: (pixel) => void seen(pane, pixel).then((s) => s && lookAt(s.position), failed),
    });
    pane.onerror = say;
    pane.onframe = (full) => void framed(pane, full).catch(failed);
  }

  async function framed(pane: Pane, full: boolean): Promise<void> {
    if (poster) poster.remove();
    // Pictures of what is decoded by now are not timed.
    if (pane === panes[0] && pane.milliseconds > 0) timing.textContent = `${pane.milliseconds.toFixed(0)} ms by ${pane.drew}`;
    if (pane !== panes[0]) return;
    document.documentElement.dataset.frames = String(pane.frames);
    if (pane.frames === 1) performance.mark("first-picture");
    if (full && !document.documentElement.dataset.full) {
      performance.mark("full-picture");
      setTimeout(() => void chooseBy(panes, () => change({})), 200);
    }
    if (full) document.documentElement.dataset.full = String(Number(document.documentElement.dataset.full ?? 0) + 1);
    const shared = panes[1]?.shownRange;
    if (full && shared !== undefined && page.state.look === "density" && String(shared) !== String(pane.range)) {
      panes.slice(1).forEach((p) => p.show({ ...page.state, range: page.state.range ?? pane.range }));
    }
    if (page.state.look === "density" && pane.range) {
      bar.show(pane.range, await pane.map(page.state.colormap, page.state.white), about.units.surface);
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
      fitted = seenBy(linked.orbit);
      change(linked);
    }, failed);
  });
  // For scripts: the page, and the CPU's picture of a state.
  const pixels = async (state: State) =>
    new Uint8Array((await panes[0].picture(sceneOf(state, about, panes[0].size), paintOf(state))).numbers);
  const camera = () => cameraFor(page.state, about);
  Object.assign(globalThis, { particlegs: { page, change, pixels, camera, toLink: () => toLink(page.state) } });
  change({});
  for (const pane of panes) await pane.decode((share) => decoding(pane, share));
  await fit();

  /** Says how far a pane is, in steps that a reader's voice can follow; what was said meanwhile stays. */
  function decoding(pane: Pane, share: number): void {
    const text = share < 1 ? `Decoding${panes.length > 1 ? ` ${pane.name}` : ""}: ${10 * Math.floor(10 * share)} %` : "";
    const ours = status.textContent === "" || status.textContent!.startsWith("Decoding");
    if (ours && status.textContent !== text) say(text);
  }
}

/** Takes the graphics card where it is faster than the CPU; says so where there is none that can. */
async function chooseBy(panes: Pane[], redraw: () => void): Promise<void> {
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

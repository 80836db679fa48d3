// The key bindings.

import { panned, turned, zoomed } from "./camera";
import type { KeyBinding } from "./input";
import type { Page } from "./page";
import type { Action } from "./panel";
import type { Timeline } from "./timeline";
import { LOOKS } from "./protocol";
import { idleReason, nextField, type Control, type State } from "./state";

/** All keys of a page; `look(i)` views from +x, -x, +y, -y, +z or -z. */
export function keyBindings(
  page: Page, act: (name: Action) => void, timeline: Timeline | null, look: (which: number) => void,
): KeyBinding[] {
  const size = () => page.panes[0].size;
  const orbit = (o: State["orbit"]) => page.change({ orbit: o });
  const step = (event: KeyboardEvent): [number, number] => {
    const by = size().height / 36;
    return [{ ArrowLeft: -by, ArrowRight: by }[event.key] ?? 0, { ArrowUp: -by, ArrowDown: by }[event.key] ?? 0];
  };
  const arrows = (event: KeyboardEvent) => {
    const [dx, dy] = step(event);
    orbit(event.shiftKey ? panned(page.state.orbit, -dx, -dy, size()) : turned(page.state.orbit, -dx, -dy, size()));
  };
  const zoom = (factor: number) => () => {
    const { width, height } = size();
    orbit(zoomed(page.state.orbit, factor, [width / 2, height / 2], size()));
  };
  /** Acts, or says why the key has no effect now. */
  const unlessIdle = (control: Control, does: () => void) => () => {
    const why = idleReason(control, page.state, page.panes[0].about, page.layers);
    if (why) page.say(why);
    else does();
  };
  const flip = (name: "white" | "box" | "axes" | "scale" | "circles" | "images" | "byLayer") => () =>
    page.change({ [name]: !page.state[name] });
  const times = (name: "radius" | "opacity", factor: number) => unlessIdle(name, () =>
    page.change({ [name]: Math.min(name === "opacity" ? 1 : Infinity, page.state[name] * factor) }));
  const next = <T>(all: readonly T[], now: T): T => all[(all.indexOf(now) + 1) % all.length];
  const key = (keys: string[], label: string, what: string, does: (event: KeyboardEvent) => void): KeyBinding =>
    ({ keys, label, what, act: does });
  return [
    key(["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"], "arrows", "rotate by 5°; with Shift, pan", arrows),
    key(["+", "="], "+", "zoom in", zoom(0.85)),
    key(["-", "_"], "−", "zoom out", zoom(1 / 0.85)),
    key(["r"], "r", "reset the camera", () => act("reset")),
    key(["o"], "o", "orthographic or perspective", () =>
      orbit({ ...page.state.orbit, orthographic: !page.state.orbit.orthographic })),
    ...[..."xyz"].flatMap((name, i) => [
      key([name], name, `view from +${name}`, () => look(2 * i)),
      key([name.toUpperCase()], `Shift ${name}`, `view from −${name}`, () => look(2 * i + 1)),
    ]),
    key(["["], "[", "smaller radius", times("radius", 1 / 1.25)),
    key(["]"], "]", "larger radius", times("radius", 1.25)),
    key([","], ",", "less opacity", times("opacity", 1 / 1.25)),
    key(["."], ".", "more opacity", times("opacity", 1.25)),
    key(["l"], "l", "next style", unlessIdle("look", () => page.change({ look: next(LOOKS, page.state.look) }))),
    key(["f"], "f", "colour by the next field", () => {
      const { fields } = page.panes[0].about;
      const names = ["", ...fields.flatMap((f) => f.maps.map((m) => m.name))];
      if (fields.length === 0) return page.say("the model has no fields");
      const name = next(names, page.state.field?.name ?? "");
      page.change({ field: nextField(name, page.state), range: null });
    }),
    key(["m"], "m", "next colour map", unlessIdle("colormap", () => {
      const { colormaps } = page.panes[0].about;
      const { field } = page.state;
      if (field) page.change({ field: { ...field, colormap: next(["", ...colormaps], field.colormap) } });
      else page.change({ colormap: next(colormaps, page.state.colormap), look: "density" });
    })),
    key(["w"], "w", "white or black background", flip("white")),
    key(["b"], "b", "box outline", flip("box")),
    key(["a"], "a", "axes", flip("axes")),
    key(["n"], "n", "scale bar", flip("scale")),
    ...(page.setup.opening.circles ? [key(["e"], "e", "circles", flip("circles"))] : []),
    key(["i"], "i", "periodic images", unlessIdle("images", flip("images"))),
    key(["k"], "k", "colour by layer", unlessIdle("byLayer", flip("byLayer"))),
    ...(timeline ? [
      key([" "], "space", "play or pause", () => timeline.toggle()),
      key(["<"], "<", "previous frame", () => timeline.step(-1)),
      key([">"], ">", "next frame", () => timeline.step(1)),
      key(["s"], "s", "smooth: interpolated pictures between frames", () => timeline.flip("smooth")),
      key(["u"], "u", "loop", () => timeline.flip("loop")),
    ] : []),
    ...(page.setup.truth ? [
      key(["t"], "t", "compare with all particles, side by side", () => act("compare")),
      key(["d"], "d", "show the difference from all particles", () => act("difference")),
    ] : []),
    key(["p"], "p", "save a PNG", () => act("png")),
    key(["v"], "v", "save views.json", () => act("views")),
    key(["c"], "c", "copy a link to this view", () => act("link")),
    key(["?", "h"], "?", "this list", () => act("help")),
  ];
}

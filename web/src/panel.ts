// The panel of controls: each is a native input with a label.

import { h } from "./dom";
import { LOOKS, type ModelSummary, type Vec3 } from "./protocol";
import { diagonal, idleReason, isDispersion, nextField, type Control, type FieldColours, type Slab, type State } from "./state";
import { formatNumber } from "./units";

/** What the panel needs from the page. */
export interface PanelContext {
  about: ModelSummary;
  /** The layers of all models, each name once. */
  layers: ModelSummary["layers"];
  /** Whether there are circles. */
  circles: boolean;
  state(): State;
  change(part: Partial<State>): void;
  /** The range of the current picture's densities or values. */
  range(): [number, number] | null;
  /** Whether its colours are on a logarithmic scale. */
  logarithmic(): boolean;
  act(name: Action): void;
  goTo(text: string): string | null;
}

export type Action =
  | "reset" | "png" | "npy" | "views" | "load" | "link" | "command" | "turn" | "compare" | "difference" | "help";

type Refresh = (s: State) => void;

/** The panel; `refresh` sets its controls to a state. */
export function panel(context: PanelContext): { element: HTMLElement; refresh: Refresh } {
  const parts = [styleSection(context), particleSection(context), layerSection(context), spaceSection(context), cameraSection(context), exportSection(context)];
  const element = h("aside", { id: "panel", "aria-label": "Controls" }, ...parts.map((p) => p.element));
  return { element, refresh: (s) => parts.forEach((p) => p.refresh(s)) };
}

interface Widget { element: HTMLElement; refresh: Refresh }

/** A widget that is hidden while its control has no effect. */
function hiddenWhenIdle(context: PanelContext, control: Control, part: Widget): Widget {
  return {
    element: part.element,
    refresh: (s) => {
      part.element.hidden = idleReason(control, s, context.about, context.layers.length) !== null;
      part.refresh(s);
    },
  };
}

function section(title: string, open: boolean, ...rows: Widget[]): Widget {
  const element = h("details", { open }, h("summary", { text: title }), ...rows.map((r) => r.element));
  return { element, refresh: (s) => rows.forEach((r) => r.refresh(s)) };
}

/** A logarithmic slider with its value; the default is marked and the certified range shaded. */
function logarithmicSlider(
  label: string, unit: string, [low, high]: [number, number], home: number, certified: [number, number] | null,
  get: (s: State) => number, set: (v: number) => void,
): Widget {
  const id = `slider-${label.toLowerCase()}`;
  const share = (v: number) => Math.log(v / low) / Math.log(high / low);
  const slider = h("input", {
    type: "range", id, min: 0, max: 1, step: "any", list: `${id}-default`,
    input: () => set(low * (high / low) ** Number(slider.value)),
  });
  const field = h("input", {
    type: "text", inputmode: "decimal", "aria-label": `${label}${unit ? ` in ${unit}` : ""}`,
    change: () => {
      const v = Number(field.value);
      if (v > 0 && Number.isFinite(v)) set(label === "Opacity" ? Math.min(1, v) : v);
    },
  });
  const percent = (v: number) => 100 * Math.max(0, Math.min(1, share(v)));
  const track = h("span", { class: "track" });
  const mark = h("span", { class: "default", title: `default: ${formatNumber(home)}` });
  // The thumb's centre stays half its width (8 px) away from either end.
  const place = (p: number) => `calc(${p}% + ${8 - 0.16 * p}px)`;
  mark.style.left = place(percent(home));
  if (certified) {
    const shade = h("span", { class: "certified", title: "range measured by the certificate" });
    shade.style.left = place(percent(certified[0]));
    shade.style.right = `calc(100% - ${place(percent(certified[1]))})`;
    track.append(shade);
  }
  track.append(mark);
  const element = h("div", { class: "slider" },
    h("label", { for: id, text: unit ? `${label} (${unit})` : label }), field, h("span", { class: "slide" }, track, slider));
  const refresh = (s: State) => {
    const v = get(s);
    slider.value = String(Math.max(0, Math.min(1, share(v))));
    slider.setAttribute("aria-valuetext", `${formatNumber(v)} ${unit}`);
    if (document.activeElement !== field) field.value = String(Number(v.toPrecision(4)));
  };
  return { element, refresh };
}

/** A menu; a choice is a name, or a value with its name. */
function select(label: string, choices: readonly (string | [string, string])[], get: (s: State) => string, set: (v: string) => void): Widget {
  const option = (c: string | [string, string]) => (typeof c === "string" ? h("option", { value: c, text: c }) : h("option", { value: c[0], text: c[1] }));
  const box = h("select", { change: () => set(box.value) }, ...choices.map(option));
  return { element: h("label", { class: "row" }, label, box), refresh: (s) => (box.value = get(s)) };
}

function checkbox(label: string, get: (s: State) => boolean, set: (on: boolean) => void, color?: string): Widget {
  const box = h("input", { type: "checkbox", change: () => set(box.checked) });
  const swatch = h("span", { class: "swatch", hidden: color === undefined });
  // The page's security policy forbids style attributes.
  swatch.style.background = color ?? "";
  return { element: h("label", { class: "check" }, box, swatch, label), refresh: (s) => (box.checked = get(s)) };
}

function button(label: string, act: () => void, title?: string): HTMLButtonElement {
  return h("button", { type: "button", text: label, title, click: act });
}

function staticWidget(element: HTMLElement): Widget {
  return { element, refresh: () => {} };
}

function particleSection(context: PanelContext): Widget {
  const m = context.about.metadata;
  const radii: [number, number] = [m.default_radius / 32, m.default_radius * 256];
  const certified = context.about.certified;
  const radius = logarithmicSlider("Radius", context.about.units.length, radii, m.default_radius,
    certified?.[0] ?? null, (s) => s.radius, (v) => context.change({ radius: v }));
  const opacity = logarithmicSlider("Opacity", "", [0.001, 1], m.default_opacity, certified?.[1] ?? null, (s) => s.opacity,
    (v) => context.change({ opacity: v }));
  const back = staticWidget(h("div", { class: "buttons" },
    button("Defaults", () => context.change({ radius: m.default_radius, opacity: m.default_opacity, exposure: 0 }))));
  return hiddenWhenIdle(context, "radius", section("Particles", true, radius, opacity, back));
}

function styleSection(context: PanelContext): Widget {
  const buttons = LOOKS.map((name) => button(STYLES[name][0], () => context.change({ look: name }), STYLES[name][1]));
  const look: Widget = {
    element: h("div", { class: "buttons", role: "group", "aria-label": "Style" }, ...buttons),
    refresh: (s) => buttons.forEach((b, i) => b.setAttribute("aria-pressed", String(LOOKS[i] === s.look))),
  };
  const slider = h("input", {
    type: "range", min: -4, max: 4, step: 0.1, "aria-label": "Exposure in stops",
    input: () => context.change({ exposure: Number(slider.value) }),
  });
  const value = h("output", {});
  const exposure: Widget = {
    element: h("div", { class: "slider brightness" }, h("span", { text: "Exposure (stops)" }), value, slider),
    refresh: (s) => {
      slider.value = String(s.exposure);
      value.textContent = s.exposure > 0 ? `+${s.exposure.toFixed(1)}` : s.exposure.toFixed(1).replace("-", "−");
    },
  };
  const white = checkbox("White background", (s) => s.white, (on) => context.change({ white: on }));
  const colormap = select("Colour map", [["", "automatic"], ...context.about.colormaps], (s) => s.field?.colormap ?? s.colormap,
    (v) => (context.state().field ? ofField({ colormap: v }) : context.change({ colormap: v })));
  // Densities have no automatic map.
  const automatic = colormap.element.querySelector("option")!;
  const map: Widget = { ...colormap, refresh: (s) => {
    automatic.hidden = !s.field;
    colormap.refresh(s);
  } };
  const ends = [0, 1].map((k) => h("input", {
    type: "text", inputmode: "decimal", "aria-label": k === 0 ? "Lowest value of the colour map" : "Highest value of the colour map",
    change: () => {
      const range = ends.map((e) => Number(e.value)) as [number, number];
      const shows = context.logarithmic() ? range[0] > 0 : Number.isFinite(range[0]);
      if (shows && range[1] > range[0] && Number.isFinite(range[1])) context.change({ range });
    },
  }));
  const range: Widget = {
    element: h("div", { class: "row" }, "Range", h("span", { class: "pair" }, ...ends)),
    refresh: () => {
      const now = context.range();
      ends.forEach((e, k) => {
        if (document.activeElement !== e) e.value = now ? String(Number(now[k].toPrecision(3))) : "";
      });
    },
  };
  const hold = checkbox("Fixed range", (s) => s.range !== null, (on) => context.change({ range: on ? context.range() : null }));
  const of = (control: Control, part: Widget) => hiddenWhenIdle(context, control, part);
  const ofField = (part: Partial<FieldColours>) => {
    const { field } = context.state();
    // Another scale or another motion has another range.
    if (field) context.change({ field: { ...field, ...part }, ...("scale" in part || "bulk" in part ? { range: null } : {}) });
  };
  const fieldRows = [
    of("bulk", checkbox("Subtract bulk motion", (s) => s.field?.bulk ?? false, (bulk) => ofField({ bulk }))),
    of("field", checkbox("Brightness from surface density, hue from field", (s) => s.field?.shade ?? false, (shade) => ofField({ shade }))),
    of("field", select("Scale", [["", "automatic"], "linear", ["log", "logarithmic"], "signed"], (s) => s.field?.scale ?? "",
      (scale) => ofField({ scale: scale as FieldColours["scale"] }))),
  ];
  return section("Style", true, colourBy(context), of("look", look), of("exposure", exposure), ...fieldRows, white, of("range", map),
    of("range", range), of("range", hold));
}

/** The menu of what colours the picture: the style, or a map of a field. */
function colourBy(context: PanelContext): Widget {
  const groups = context.about.fields.map(({ name, unit, maps }) =>
    h("optgroup", { label: unit ? `${name} (${unit})` : name }, ...maps.map((m) =>
      h("option", { value: m.name, text: isDispersion(m.name) ? `${name} dispersion` : m.title, title: m.title }))));
  const box = h("select", {
    id: "colour-by",
    change: () => context.change({ field: nextField(box.value, context.state()), range: null }),
  }, h("option", { value: "", text: "density or brightness" }), ...groups);
  const element = h("label", { class: "row wide", hidden: groups.length === 0 }, "Colour by", box);
  return { element, refresh: (s) => (box.value = s.field?.name ?? "") };
}

/** Label and tooltip of each style. */
const STYLES: Record<State["look"], [string, string]> = {
  density: ["Density", "Surface density in logarithmic colours"],
  paraview: ["ParaView", "ParaView's picture of the particles, without shot noise"],
  expected: ["Expected", "Brightness 255 (1 − exp(−τ)) for the optical depth τ"],
};

function layerSection(context: PanelContext): Widget {
  const all = context.layers;
  const shown = all.map(({ name, title, color }) => checkbox(title, (s) => !s.hidden.includes(name), (on) =>
    context.change({ hidden: context.state().hidden.filter((n) => n !== name).concat(on ? [] : [name]) }), `rgb(${color.join(" ")})`));
  const by = hiddenWhenIdle(context, "byLayer", checkbox("Colour by layer", (s) => s.byLayer, (on) => context.change({ byLayer: on })));
  const own = section("Layers", all.length > 1, ...shown, by);
  own.element.hidden = all.length < 2;
  return own;
}

function spaceSection(context: PanelContext): Widget {
  const b = context.about.metadata.bounds;
  const rows: Widget[] = [];
  const slabOf = (axis: Slab["axis"]): Slab => {
    const k = "xyz".indexOf(axis);
    const long = k < 0 ? diagonal(b) : b.max[k] - b.min[k];
    return { axis, middle: k < 0 ? 0 : 0.5 * (b.min[k] + b.max[k]), thickness: 0.2 * long };
  };
  rows.push(select("Slab along", ["none", "x", "y", "z", "view"], (s) => s.slab?.axis ?? "none", (v) =>
    context.change({ slab: v === "none" ? null : slabOf(v as Slab["axis"]) })));
  const bar = (label: string, low: (s: Slab) => number, high: (s: Slab) => number, key: "middle" | "thickness"): Widget => {
    const slider = h("input", {
      type: "range", step: "any", "aria-label": `${label} of the slab`,
      input: () => change(Number(slider.value)),
    });
    const field = h("input", {
      type: "text", inputmode: "decimal", "aria-label": `${label} of the slab, as a number`,
      change: () => Number.isFinite(Number(field.value)) && change(Number(field.value)),
    });
    const change = (v: number) => {
      const slab = context.state().slab;
      if (slab && (key === "middle" || v > 0)) context.change({ slab: { ...slab, [key]: v } });
    };
    const element = h("div", { class: "slider" }, h("span", { text: label }), field, slider);
    return {
      element,
      refresh: (s) => {
        element.hidden = !s.slab || (key === "middle" && s.slab.axis === "view");
        if (!s.slab) return;
        slider.min = String(low(s.slab));
        slider.max = String(high(s.slab));
        slider.value = String(s.slab[key]);
        if (document.activeElement !== field) field.value = String(Number(s.slab[key].toPrecision(5)));
      },
    };
  };
  const axis = (s: Slab) => "xyz".indexOf(s.axis);
  const long = (s: Slab) => (axis(s) < 0 ? diagonal(b) : b.max[axis(s)] - b.min[axis(s)] || 1);
  rows.push(bar("Centre", (s) => (axis(s) < 0 ? 0 : b.min[axis(s)]), (s) => (axis(s) < 0 ? 1 : b.max[axis(s)]), "middle"));
  rows.push(bar("Thickness", (s) => 0.002 * long(s), long, "thickness"));
  rows.push(checkbox("Clip box", (s) => s.clip !== null, (on) => context.change({ clip: on ? structuredClone(b) : null })));
  rows.push(clipFields(context));
  rows.push(hiddenWhenIdle(context, "images", checkbox("Periodic images", (s) => s.images, (on) => context.change({ images: on }))));
  rows.push(checkbox("Box outline", (s) => s.box, (on) => context.change({ box: on })));
  rows.push(checkbox("Axes", (s) => s.axes, (on) => context.change({ axes: on })));
  rows.push(checkbox("Scale bar", (s) => s.scale, (on) => context.change({ scale: on })));
  if (context.circles) rows.push(checkbox("Circles", (s) => s.circles, (on) => context.change({ circles: on })));
  return section("Region and axes", false, ...rows);
}

function clipFields(context: PanelContext): Widget {
  const ends = ["min", "max"] as const;
  const fields = ends.map((end) => [0, 1, 2].map((k) => {
    const field = h("input", {
      type: "text", inputmode: "decimal", "aria-label": `${end === "min" ? "Lowest" : "Highest"} ${"xyz"[k]} of the clip box`,
      change: () => {
        const clip = structuredClone(context.state().clip);
        if (!clip || !Number.isFinite(Number(field.value))) return;
        clip[end][k] = Number(field.value);
        if (clip.min[k] < clip.max[k]) context.change({ clip });
      },
    });
    return field;
  }));
  const rows = [0, 1, 2].map((k) => h("div", { class: "row" }, "xyz"[k], h("span", { class: "pair" }, fields[0][k], fields[1][k])));
  const element = h("div", {}, ...rows);
  return {
    element,
    refresh: (s) => {
      element.hidden = !s.clip;
      if (!s.clip) return;
      ends.forEach((end, e) => fields[e].forEach((f, k) => {
        if (document.activeElement !== f) f.value = String(Number(s.clip![end][k].toPrecision(6)));
      }));
    },
  };
}

const PRESETS: [string, number, number][] =
  [["+x", 90, 0], ["−x", -90, 0], ["+y", 0, 90], ["−y", 0, -90], ["+z", 0, 0], ["−z", 180, 0]];

/** The current view, seen from one end of an axis. */
export function preset(s: State, which: number): State["orbit"] {
  const [, azimuth, elevation] = PRESETS[which];
  return { ...s.orbit, azimuth, elevation, roll: 0 };
}

function cameraSection(context: PanelContext): Widget {
  const from = h("div", { class: "presets", role: "group", "aria-label": "View from" }, h("span", { text: "View from" }),
    ...PRESETS.map(([name], i) => h("button", {
      type: "button", text: name, "aria-label": `View from ${name}`, click: () => context.change({ orbit: preset(context.state(), i) }),
    })));
  const orthographic = checkbox("Orthographic", (s) => s.orbit.orthographic, (on) =>
    context.change({ orbit: { ...context.state().orbit, orthographic: on } }));
  const answer = h("p", { class: "hint", role: "status" });
  const field = h("input", { type: "text", placeholder: "x, y, z or Gaussian #n", "aria-label": "Go to a point x, y, z or a Gaussian #number" });
  const form = h("form", { class: "row", submit: (e) => {
    e.preventDefault();
    answer.textContent = context.goTo(field.value) ?? "";
  } }, field, h("button", { type: "submit", text: "Go" }));
  const place = h("p", { class: "hint", id: "place" });
  const own = section("Camera", false, staticWidget(from), orthographic, staticWidget(form), staticWidget(answer), staticWidget(place),
    staticWidget(h("div", { class: "buttons" }, button("Reset camera", () => context.act("reset")))));
  return {
    element: own.element,
    refresh: (s) => {
      own.refresh(s);
      const f = s.orbit.focal.map((v) => formatNumber(v, 4)).join(", ");
      place.textContent = `Looking at ${f}; azimuth ${s.orbit.azimuth.toFixed(1)}°, elevation ${s.orbit.elevation.toFixed(1)}°, distance ${formatNumber(s.orbit.distance)}`;
    },
  };
}

function exportSection(context: PanelContext): Widget {
  const row = (...names: [string, Action, string][]) =>
    staticWidget(h("div", { class: "buttons" }, ...names.map(([label, act, title]) => button(label, () => context.act(act), title))));
  return section("Export", false,
    row(["PNG …", "png", "Save the picture at any size"], ["NPY", "npy", "Save the values behind the picture for NumPy"]),
    row(["Copy link", "link", "Copy a link that restores this view"], ["Copy command", "command", "Copy the command that draws this picture"]),
    row(["Turntable …", "turn", "Save the frames of one turn about the vertical axis"], ["Save views.json", "views", "Save the camera for `render --views`"]),
    row(["Open views.json …", "load", "Load the camera from a views file"]));
}

/** A point from text, or a Gaussian's number. */
export function parseTarget(text: string): { point: Vec3 } | { gaussian: number } | null {
  const one = /^#\s*(\d+)$/.exec(text.trim());
  if (one) return { gaussian: Number(one[1]) };
  const point = text.split(/[\s,;]+/).filter((t) => t !== "").map(Number);
  return point.length === 3 && point.every(Number.isFinite) ? { point: point as Vec3 } : null;
}

// The state of the page: everything that a link restores.

import { FOV, add, axes, cameraOf, center, dot, length, orbitOf, scaled, type Orbit } from "./camera";
import { LOOKS, SCALES, type ModelSummary, type Bounds, type Camera, type FieldRequest, type Opening, type PageStyle, type ToneStyle, type PlaneColours, type Scene, type Size, type Vec3 } from "./protocol";

export interface Slab { axis: "x" | "y" | "z" | "view"; middle: number; thickness: number }

/** A field that colours the picture; an empty colour map is that of the scale. */
export interface FieldColours extends FieldRequest { colormap: string }

export interface State {
  orbit: Orbit;
  /** Of a series, what its clock shows. */
  time: number | null;
  radius: number;
  opacity: number;
  look: PageStyle;
  /** Drawn instead of the style. */
  field: FieldColours | null;
  exposure: number;
  /** Of densities. */
  colormap: string;
  /** Of densities or of the field. */
  range: [number, number] | null;
  white: boolean;
  /** Names of the layers that are not drawn. */
  hidden: string[];
  byLayer: boolean;
  slab: Slab | null;
  clip: Bounds | null;
  images: boolean;
  box: boolean;
  axes: boolean;
  scale: boolean;
  circles: boolean;
}

/** The initial view of a model, or of a series at `time`: its surface density, if it has one. */
export function initialState(about: ModelSummary, orbit: Orbit, time: number | null): State {
  const m = about.metadata;
  return {
    orbit, time, radius: m.default_radius, opacity: m.default_opacity,
    look: about.adds_up ? "density" : "paraview", field: null, exposure: 0,
    colormap: "inferno", range: null, white: false, hidden: [], byLayer: false, slab: null,
    clip: null, images: false, box: false, axes: true, scale: true, circles: true,
  };
}

/** The default state with the settings of an opening; `layers` are those of all models. */
export function withOpening(o: Opening, usual: State, about: ModelSummary, layers: string[]): State {
  const s = o.views === undefined ? usual : fromViewsFile(JSON.stringify(o.views), usual, about);
  const { orbit } = s;
  const field = mapOf(o.field, about) ? fieldColours(o.field!) : s.field;
  return {
    ...s,
    orbit: {
      ...orbit, focal: o.look_at ?? orbit.focal, azimuth: o.azimuth ?? orbit.azimuth,
      elevation: o.elevation ?? orbit.elevation, distance: orbit.distance * (o.distance ?? 1),
      orthographic: o.orthographic ?? orbit.orthographic,
    },
    look: o.style ?? s.look, field, colormap: o.colormap ?? s.colormap, white: o.white ?? s.white,
    // The range of a field that the model lacks says nothing of densities.
    range: o.field && !field ? s.range : o.range ?? s.range,
    byLayer: o.color_by_layer ?? s.byLayer, radius: o.radius ?? s.radius, opacity: o.opacity ?? s.opacity,
    hidden: o.layers ? layers.filter((n) => !o.layers!.includes(n)) : s.hidden,
  };
}

/** A field in its default colours. */
export const fieldColours = (name: string): FieldColours => ({ name, bulk: false, scale: "", shade: false, colormap: "" });

/** Is a map one of dispersions, of which nothing is subtracted? */
export const isDispersion = (name: string): boolean => name.startsWith("dispersion.");

/** The title and unit of a map of a model's field, and whether bulk motion can be subtracted; `undefined` without it. */
export function mapOf(name: string | undefined, about: ModelSummary): { title: string; unit: string; moves: boolean } | undefined {
  for (const { vector, maps } of about.fields) {
    const map = maps.find((m) => m.name === name);
    if (map) return { title: map.title, unit: map.unit, moves: vector && !isDispersion(map.name) };
  }
  return undefined;
}

/** The field to show next, none if `name` is empty: shading and subtraction stay. */
export function nextField(name: string, { field }: State): FieldColours | null {
  if (name === "") return null;
  return { ...fieldColours(name), shade: field?.shade ?? false, bulk: field?.bulk ?? false };
}

/** A state without a field that the model lacks, and without what the field or the program does not have. */
export function withKnownField(s: State, about: ModelSummary): State {
  if (!s.field) return s;
  const map = mapOf(s.field.name, about);
  if (!map) return { ...s, field: null, range: null };
  const { bulk, colormap } = s.field;
  return { ...s, field: { ...s.field, bulk: bulk && map.moves, colormap: about.colormaps.includes(colormap) ? colormap : "" } };
}

/** Whether colours show values: those of a field, or densities. */
export const hasColorBar = (s: State): boolean => s.field !== null || s.look === "density";

/** Why another model's density cannot share the colours of the first; empty if it can. */
export function densityDiffers(other: ModelSummary, first: ModelSummary): string {
  const [own, of] = [other, first].map((m) => `${m.density_of} in ${m.units.surface}`);
  return own === of ? "" : `its density is of ${own}, that of the first model of ${of}: choose another style`;
}

/** Controls that have no effect in some states. */
export type Control = "field" | "bulk" | "look" | "colormap" | "range" | "radius" | "opacity" | "exposure" | "byLayer" | "images";

/** Why a control has no effect now; `null` if it has one. */
export function idleReason(control: Control, s: State, about: ModelSummary, layers: number): string | null {
  const shown = s.field ? "a field" : s.look === "density" ? "the density style" : null;
  const other = s.field ? "colour by density or brightness" : "choose another style";
  switch (control) {
    case "field": return s.field ? null : about.fields.length > 0 ? "choose a field first" : "the model has no fields";
    case "bulk": return mapOf(s.field?.name, about)?.moves ? null : "only components of vectors have bulk motion";
    case "look":
      if (s.field) return "a field has no style: colour by density or brightness first";
      return about.adds_up ? null : "an alpha-blend model has only this style";
    case "colormap": return about.adds_up ? null : "an alpha-blend model has no surface density to colour";
    case "range": return hasColorBar(s) ? null : "only the density style and fields have a range";
    case "radius": case "opacity": case "exposure":
      return shown ? `${shown} has no ${control}: ${other}` : null;
    case "byLayer":
      if (layers < 2) return "the model has only one layer";
      if (!about.adds_up) return "an alpha-blend model has no layer colours";
      return shown ? `${shown} has no layer colours: ${other}` : null;
    case "images":
      if (!about.adds_up) return "an alpha-blend model has no periodic images";
      return about.metadata.cell?.periodic.includes(true) ? null : "the box is not periodic";
  }
}

export const diagonal = (b: Bounds): number => length(add(b.max, b.min, -1)) || 1;

/** The camera of a state. */
export function cameraFor(s: State, about: ModelSummary): Camera {
  const bounds = about.metadata.bounds;
  const away = length(add(s.orbit.focal, center(bounds), -1));
  const reach = away + (s.images ? 4 : 1.5) * diagonal(bounds);
  return cameraOf(s.orbit, s.slab?.axis === "view" ? s.slab.thickness : null, reach);
}

/** The scene that the engine draws. */
export function sceneOf(s: State, about: ModelSummary, size: Size): Scene {
  const scene: Scene = { size, camera: cameraFor(s, about), radius: s.radius, opacity: s.opacity, images: s.images };
  if (s.hidden.length > 0) scene.layers = about.layers.map((l) => !s.hidden.includes(l.name));
  const clip = clipOf(s, about);
  if (clip) scene.clip = clip;
  return scene;
}

/** The box to clip to: the clip box, cut by a slab along x, y or z. */
export function clipOf(s: State, about: ModelSummary): Bounds | null {
  const slab = s.slab && s.slab.axis !== "view" ? s.slab : null;
  if (!s.clip && !slab) return null;
  const b = about.metadata.bounds;
  const margin = diagonal(b);
  const clip: Bounds = s.clip
    ? { min: [...s.clip.min], max: [...s.clip.max] }
    : { min: b.min.map((v) => v - margin) as Vec3, max: b.max.map((v) => v + margin) as Vec3 };
  if (slab) {
    const k = "xyz".indexOf(slab.axis);
    clip.min[k] = Math.max(clip.min[k], slab.middle - 0.5 * slab.thickness);
    clip.max[k] = Math.min(clip.max[k], slab.middle + 0.5 * slab.thickness);
  }
  return clip;
}

export function paintOf(s: State): PlaneColours {
  return {
    look: s.look === "density" ? null : (s.look as ToneStyle), white: s.white, colormap: s.field ? s.field.colormap : s.colormap,
    exposure: s.exposure, range: s.range, by_layer: s.byLayer, field: s.field,
  };
}

const numberText = (v: number): string => String(Number(v.toPrecision(9)));

/** What is drawn over the picture unless a link says otherwise. */
const INITIAL = ["axes", "scale", "circles"] as const;

/** The state as the part of an address after `#`. */
export function toLink(s: State): string {
  const o = s.orbit;
  const p = new URLSearchParams();
  p.set("at", o.focal.map(numberText).join(","));
  p.set("from", [o.azimuth, o.elevation, o.roll, o.distance].map(numberText).join(","));
  if (s.time !== null) p.set("time", numberText(s.time));
  p.set("radius", numberText(s.radius));
  p.set("opacity", numberText(s.opacity));
  p.set("look", s.look);
  const flags: [string, boolean][] = [["orthographic", o.orthographic], ["white", s.white], ["bylayer", s.byLayer],
    ["images", s.images], ["box", s.box]];
  for (const [name, on] of flags) if (on) p.set(name, "1");
  for (const name of INITIAL) if (!s[name]) p.set(name, "0");
  if (s.exposure !== 0) p.set("exposure", numberText(s.exposure));
  if (s.field) {
    const { name, bulk, scale, shade, colormap } = s.field;
    p.set("field", name);
    if (bulk) p.set("bulk", "1");
    if (scale) p.set("values", scale);
    if (shade) p.set("shade", "1");
    if (colormap) p.set("colormap", colormap);
  } else if (s.look === "density") {
    p.set("colormap", s.colormap);
  }
  if (s.range) p.set("range", s.range.map(numberText).join(","));
  s.hidden.forEach((name) => p.append("hidden", name));
  if (s.slab) p.set("slab", `${s.slab.axis},${numberText(s.slab.middle)},${numberText(s.slab.thickness)}`);
  if (s.clip) p.set("clip", [...s.clip.min, ...s.clip.max].map(numberText).join(","));
  return p.toString();
}

/** `count` finite numbers from a link; `null` otherwise. */
function parseNumbers(text: string | null, count: number): number[] | null {
  const found = (text ?? "").split(",").map(Number);
  return text !== null && found.length === count && found.every(Number.isFinite) ? found : null;
}

/** Applies the valid settings of a link; of one that is not whole the others stay as they are. */
export function fromLink(text: string, s: State): State {
  const p = new URLSearchParams(text);
  const next: State = structuredClone(s);
  const at = parseNumbers(p.get("at"), 3);
  if (at) next.orbit.focal = at as Vec3;
  const from = parseNumbers(p.get("from"), 4);
  if (from && from[3] > 0) {
    [next.orbit.azimuth, next.orbit.elevation, next.orbit.roll, next.orbit.distance] = from;
    next.orbit.elevation = Math.max(-90, Math.min(90, next.orbit.elevation));
  }
  const one = (name: string, low: number, high: number, take: (v: number) => void) => {
    const v = parseNumbers(p.get(name), 1);
    if (v && v[0] >= low && v[0] <= high) take(v[0]);
  };
  if (s.time !== null) one("time", -1e300, 1e300, (v) => (next.time = v));
  one("radius", 1e-300, 1e300, (v) => (next.radius = v));
  one("opacity", 1e-6, 1, (v) => (next.opacity = v));
  one("exposure", -8, 8, (v) => (next.exposure = v));
  const look = LOOKS.find((l) => l === p.get("look"));
  if (look) next.look = look;
  const colormap = /^[a-z]+$/.exec(p.get("colormap") ?? "")?.[0];
  const field = p.get("field");
  if (field) {
    const scale = SCALES.find((v) => v === p.get("values")) ?? "";
    next.field = { name: field, bulk: p.get("bulk") === "1", scale, shade: p.get("shade") === "1", colormap: colormap ?? "" };
  } else if (colormap) {
    next.colormap = colormap;
  }
  if (p.has("at")) {
    if (!field) next.field = null;
    next.range = null;
    next.orbit.orthographic = p.get("orthographic") === "1";
    next.white = p.get("white") === "1";
    next.byLayer = p.get("bylayer") === "1";
    next.images = p.get("images") === "1";
    next.box = p.get("box") === "1";
    for (const name of INITIAL) next[name] = p.get(name) !== "0";
    if (!p.has("exposure")) next.exposure = 0;
    [next.hidden, next.slab, next.clip] = [[], null, null];
  }
  if (p.has("hidden")) next.hidden = p.getAll("hidden");
  const range = parseNumbers(p.get("range"), 2);
  if (range && (next.field || range[0] > 0) && range[1] > range[0]) next.range = range as [number, number];
  const [axis, ...slab] = (p.get("slab") ?? "").split(",");
  const of = parseNumbers(slab.join(","), 2);
  if (["x", "y", "z", "view"].includes(axis) && of && of[1] > 0) {
    next.slab = { axis: axis as Slab["axis"], middle: of[0], thickness: of[1] };
  }
  const clip = parseNumbers(p.get("clip"), 6);
  if (clip) next.clip = { min: clip.slice(0, 3) as Vec3, max: clip.slice(3) as Vec3 };
  return next;
}

/** A views file with one view, for `render --views`. */
export function viewsFile(s: State, about: ModelSummary, size: Size): string {
  const { position, focal_point, view_up, fov_deg, height_world, clipping_range } = cameraFor(s, about);
  const view = {
    name: "view", position, focal_point, view_up, radius: s.radius, opacity: s.opacity,
    ...(height_world !== undefined ? { height_world } : {}), ...(clipping_range ? { clipping_range } : {}),
  };
  return JSON.stringify({ ...size, fov_deg: fov_deg ?? 30, views: [view] }, null, 2) + "\n";
}

/** The first view of a views file; throws if the file is invalid. */
export function fromViewsFile(text: string, s: State, about: ModelSummary): State {
  type OneView = Camera & { radius?: number; opacity?: number };
  const file = JSON.parse(text) as { fov_deg?: number; views?: OneView[] };
  const view = file.views?.[0];
  const places = [view?.position, view?.focal_point, view?.view_up];
  if (!view || !places.every((p) => Array.isArray(p) && p.length === 3 && p.every(Number.isFinite))) {
    throw new Error("this is not a views file: it needs a view with position, focal_point and view_up");
  }
  const radius = (view.radius ?? 0) > 0 ? view.radius! : s.radius;
  const opacity = (view.opacity ?? 0) > 0 && view.opacity! <= 1 ? view.opacity! : s.opacity;
  const orbit = orbitOf(view);
  // The page has a fixed field of view: the distance is scaled to keep the focal point's size in the picture.
  const fov = view.fov_deg ?? file.fov_deg ?? FOV;
  if (view.height_world === undefined) orbit.distance *= Math.tan((fov * Math.PI) / 360) / Math.tan((FOV * Math.PI) / 360);
  if (!(orbit.distance > 0 && Number.isFinite(orbit.distance))) {
    throw new Error("the camera of this views file is invalid: check its distance, field of view and height_world");
  }
  const range = view.clipping_range && !coversBox(view.clipping_range, view, about.metadata.bounds) ? view.clipping_range : null;
  if (!range) return { ...s, orbit, radius, opacity, slab: s.slab?.axis === "view" ? null : s.slab };
  // A slab is centred at the focal point, which may move along the line of sight.
  const middle = 0.5 * (range[0] + range[1]);
  orbit.focal = add(view.position, axes(orbit).back, -middle);
  if (!orbit.orthographic) orbit.distance = middle;
  return { ...s, orbit, radius, opacity, slab: { axis: "view", middle: 0, thickness: range[1] - range[0] } };
}

/** Whether a clipping range contains all of a box that is in front of the camera. */
function coversBox([near, far]: [number, number], c: Camera, b: Bounds): boolean {
  const sight = add(c.focal_point, c.position, -1);
  const ahead = scaled(sight, 1 / length(sight));
  const depths = Array.from({ length: 8 }, (_, i) =>
    dot(add([0, 1, 2].map((k) => (i >> k & 1 ? b.max[k] : b.min[k])) as Vec3, c.position, -1), ahead));
  const [least, most] = [Math.min(...depths), Math.max(...depths)];
  return near <= Math.max(least, 1e-3 * length(sight)) && far >= most;
}

// The messages between the page, its worker and the engine (crates/particlegs-web).

/** Index of the lowest density's colour among 256, as in core's `DensityColors`; index 0 is for empty pixels. */
export const LOWEST = 51;

export type Vec3 = [number, number, number];

export const LOOKS = ["density", "paraview", "expected"] as const;
export type PageStyle = (typeof LOOKS)[number];

/** A centre and a radius, in world units. */
export type Circle = [Vec3, number];

/** View settings from the command; each replaces a default of `initialState`. */
export interface Opening {
  style?: PageStyle; field?: string; colormap?: string; range?: [number, number]; white?: boolean; color_by_layer?: boolean;
  /** Names of the layers that are drawn. */
  layers?: string[];
  radius?: number; opacity?: number;
  /** A views file. */
  views?: unknown;
  /** The camera: angles in degrees, distance in base distances. */
  azimuth?: number; elevation?: number; distance?: number; look_at?: Vec3; orthographic?: boolean;
  circles?: Circle[];
}

/** The page's input, from the server or from the offline page itself. */
export interface Setup {
  version: string;
  served: boolean;
  engine: Source;
  models: (Source & { name: string; bytes: number; series: boolean; verdict?: Verdict[] })[];
  /** `smoothed`: number of neighbours that densities are smoothed over; `null` if there are too many particles. */
  truth: { url: string; name: string; particles: number; density_of: string; smoothed: number | null } | null;
  opening: Opening;
}

/** Where bytes are: at an address, or as base64 in an element. */
export type Source = { url?: string; element?: string };

/** How well a model serves one use, from its certificate. */
export interface Verdict {
  use: string;
  word: string;
  why: string;
}

export interface Bounds { min: Vec3; max: Vec3 }

export interface ModelSummary {
  metadata: {
    law: string; count: number; mass: number; bounds: Bounds;
    cell: { origin: Vec3; vectors: [Vec3, Vec3, Vec3]; periodic: [boolean, boolean, boolean] } | null;
    default_radius: number; default_opacity: number; source: string;
    length_unit: string | null; mass_unit: string | null; comoving: boolean | null; scale_factor: number | null;
    time: number | null; tool_version: string;
  };
  blake3: string;
  colormaps: string[];
  gaussians: number;
  has_masses: boolean;
  /** What the density sums: mass, particles, or weights by their name. */
  density_of: string;
  mass: number | null;
  raw_bytes: number;
  layers: { name: string; title: string; particles: number; gaussians: number; color: Vec3 }[];
  adds_up: boolean;
  /** As the command prints them; `length` is empty if unknown. */
  units: { length: string; mass: string; surface: string; number: string; density: string };
  fields: FieldSummary[];
  certified: [[number, number], [number, number]] | null;
}

/** A field and its maps, by the names that `render --field` takes; `unit` is empty if unknown. */
export interface FieldSummary {
  name: string;
  unit: string;
  vector: boolean;
  maps: { name: string; title: string; unit: string }[];
  place_units: [string, string];
}

export interface Size { width: number; height: number }

/** A camera as in views files. */
export interface Camera {
  position: Vec3; focal_point: Vec3; view_up: Vec3;
  fov_deg?: number; height_world?: number; clipping_range?: [number, number];
}

export interface Scene {
  size: Size; camera: Camera; radius: number; opacity: number;
  layers?: boolean[]; clip?: Bounds; images?: boolean; coarse?: boolean;
}

export type ToneStyle = "paraview" | "paraview-no-fxaa" | "expected";

export interface PlaneColours {
  look: ToneStyle | null; white: boolean; colormap: string; range: [number, number] | null;
  exposure: number; by_layer: boolean; field: FieldRequest | null;
}

export const SCALES = ["linear", "log", "signed"] as const;
export type ValueScale = (typeof SCALES)[number];

/** A map of a field; an empty `scale` is the one that suits the values. */
export interface FieldRequest { name: string; bulk: boolean; scale: ValueScale | ""; shade: boolean }

/** The answer to "picture"; `scale` and `without`, titles of layers without values, are those of a field. */
export interface PictureAnswer { range: [number, number] | null; scale?: ValueScale; without?: string[] }

export interface ProbeHit {
  position: Vec3; in_box: Vec3; gaussian: number; layer: string; count: number; mass: number | null;
  deviations: Vec3; number_density: number; density: number | null;
  /** Of a scalar one number, of a vector x, y, z and along the line of sight; none where nothing has the field. */
  fields: { name: string; mean: number[]; dispersion: number[] }[];
}

export interface StrokePlanes {
  pad: number; focal: number; center: [number, number]; perspective: boolean;
  planes: { width: number; height: number; first: number; count: number }[];
}

export interface ToneCurve { depths: number[]; ratios: number[]; blur: number }

/** An open model, and the share of its Gaussians that is decoded; of a series its first frame. */
export interface OpenedModel { about: ModelSummary; decoded: number; series?: SeriesSummary }

/** What a series' clock shows, and its frames without gaps. */
export interface SeriesSummary { clock: string; frames: SeriesFrame[] }

/** A frame: its time, as a number and as pictures show it, and where its bytes are in the file. */
export interface SeriesFrame { number: number; keyframe: boolean; time: number; text: string; start: number; length: number }

/** What changes of a model's summary from one moment of a series to another. */
export interface MomentSummary extends Pick<ModelSummary, "metadata" | "gaussians" | "mass" | "layers"> { text: string; interpolated: boolean }

export type EngineQuery =
  | { ask: "decode"; model: number }
  | { ask: "add-frame"; model: number; frame: number }
  | { ask: "set-time"; model: number; time: number }
  | { ask: "picture"; model: number; scene: Scene; paint: PlaneColours }
  | { ask: "values"; model: number; scene: Scene; style: "depth" | "density"; field?: FieldRequest }
  | { ask: "strokes"; model: number; scene: Scene; style: "depth" | "density" }
  | { ask: "tone"; model: number; opacity: number; radius_pixels: number }
  | { ask: "colors"; model: number; name: string; white: boolean; scale?: ValueScale }
  | { ask: "window"; model: number; scene: Scene }
  | { ask: "probe"; model: number; scene: Scene; pixel: [number, number] }
  | { ask: "sphere"; model: number; center: Vec3; radius: number; layers?: boolean[]; clip?: Bounds }
  | { ask: "gaussian"; model: number; index: number }
  | { ask: "base-distance"; model: number; size: Size }
  | { ask: "score"; model: number; size: Size };

/** A request to the worker; the reply repeats `id`. */
export type WorkerRequest = { id: number } & (
  | { do: "start"; engine: ArrayBuffer; gzip: boolean }
  | { do: "open"; bytes: ArrayBuffer }
  | { do: "ask"; question: EngineQuery; numbers?: ArrayBuffer }
);

export type WorkerResponse = { id: number; error?: string; json?: unknown; numbers?: ArrayBuffer; milliseconds: number };

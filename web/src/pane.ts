// One model's picture, drawn on the GPU or the CPU, whichever is faster; coarser in motion.

import { center, distanceOf, type Orbit } from "./camera";
import { h } from "./dom";
import { GlRenderer } from "./gl";
import { drawOverlay, type Marker } from "./overlay";
import type { BarContent } from "./colorbar";
import { LOWEST, type Circle, type ModelSummary, type MomentSummary, type OpenedModel, type PictureAnswer, type PlaneColours, type Scene, type Size, type StrokePlanes, type ToneCurve, type Vec3, type ValueScale } from "./protocol";
import type { EngineClient } from "./engine";
import type { SeriesFrames } from "./series";
import { hasColorBar, mapOf, paintOf, sceneOf, type State } from "./state";

/** Frames that take longer, in milliseconds, are drawn coarser in motion. */
const SMOOTH = 30;
/** If a map of a field takes longer, in milliseconds, the moving one has a quarter of its width and height. */
const SLOW = 300;
/** Milliseconds of rest before it is drawn in full, which a new movement has to wait for. */
const LONG_REST = 600;
/** Milliseconds between two pictures during decoding. */
const SKETCH = 400;
/** Milliseconds without a change before the picture is drawn in full. */
const REST = 120;

export type Processor = "CPU" | "GPU";

/** What a state's colours show. */
const shown = ({ look, field }: State): string => (field ? `${field.name} ${field.bulk} ${field.scale}` : look);

export class Pane {
  readonly element: HTMLElement;
  readonly overlay = h("canvas", { class: "overlay", "aria-hidden": "true" });
  readonly cpu = h("canvas", { class: "picture" });
  readonly gpu = h("canvas", { class: "picture", hidden: true });
  /** The range of the last full picture's densities or values. */
  range: [number, number] | null = null;
  private label = h("div", { class: "pane-name", "aria-hidden": "true" });
  /** The processor to use, and the one that drew the last picture. */
  by: Processor = "CPU";
  drew: Processor = "CPU";
  milliseconds = 0;
  frames = 0;
  marker: Marker | null = null;
  circles: Circle[] = [];
  /** The moment of the series that is shown. */
  moment: { time: number; text: string; interpolated: boolean } | null = null;
  /** Whether a series is playing: then the range of its colours does not change. */
  playing = false;
  /** The time of the engine's model; `null` while other moments are looked at. */
  private engineTime: number | null = null;
  /** The range of colours while time passes, and what is drawn with it. */
  private held: { view: string; shown: string; range: [number, number] } | null = null;
  private homes = new Map<string, Promise<Orbit>>();
  /** Called after every frame; `full` if nothing is left to draw. */
  onframe: (full: boolean) => void = () => {};
  onerror: (text: string) => void = () => {};

  private state: State | null = null;
  private lacks = "";
  /** What was drawn last, and the engine's answer. */
  private last: { state: State; answer: PictureAnswer } | null = null;
  private changed = 0;
  private drawn = -1;
  private busy = false;
  private rest: ReturnType<typeof setTimeout> | undefined;
  private coarse = 1;
  /** Time of the last change of state, and of the end of the last frame. */
  private touched = 0;
  private ended = 0;
  private gl: GlRenderer | null = null;
  private tone: { key: string; curve: ToneCurve; levels: Float32Array } | null = null;
  private colors: { key: string; data: Uint8Array } | null = null;

  /**
   * `decoded` is the decoded share of the model. If its first picture `waits`, nothing is drawn before decoding ends,
   * unless the user moves the view.
   */
  constructor(
    private remote: EngineClient, readonly model: number, readonly name: string, public about: ModelSummary,
    private decoded: number, private waits: boolean, readonly series: SeriesFrames | null,
  ) {
    // The context is lost when a driver is reset or a machine sleeps.
    this.gpu.addEventListener("webglcontextlost", () => {
      this.gl = null;
      this.by = "CPU";
      this.onerror("drawing on the CPU: the GPU's context was lost");
      if (this.state) this.show(this.state);
    });
    const label = `${name}: picture of the model. Drag or press the arrow keys to rotate; press ? for all keys.`;
    this.element = h("div", { class: "pane", tabindex: "0", role: "img", "aria-label": label },
      this.cpu, this.gpu, this.overlay, this.label);
    this.label.textContent = name;
  }

  /** The range of the last state; `undefined` before the first. */
  get shownRange(): [number, number] | null | undefined {
    return this.state?.range;
  }

  /** The picture's size in device pixels. */
  get size(): Size {
    const { clientWidth, clientHeight } = this.element;
    const ratio = Math.min(2, globalThis.devicePixelRatio || 1);
    return { width: Math.max(16, Math.round(clientWidth * ratio)), height: Math.max(16, Math.round(clientHeight * ratio)) };
  }

  /** Draws a state as soon as possible; nothing if `lacks` says why the model has no such field. */
  show(state: State, lacks = ""): void {
    const first = this.state === null;
    this.lacks = lacks;
    this.label.textContent = lacks || this.name;
    this.state = state;
    this.touched = performance.now();
    this.lines();
    if (!(first && this.waits && this.decoded < 1)) this.redraw();
  }

  /** Whether something is left to draw. Fields are decoded last. */
  private get pending(): boolean {
    return this.state !== null && this.drawn !== this.changed && !(this.state.field && this.decoded < 1);
  }

  private redraw(): void {
    this.changed++;
    void this.loop();
  }

  /** Decodes the rest of the model in steps, with pictures in between; `onstep` gets the decoded share. */
  async decode(onstep: (share: number) => void): Promise<void> {
    if (this.decoded === 1) return onstep(1);
    while (this.decoded < 1) {
      onstep(this.decoded);
      if (this.frames > 0 && !this.busy && performance.now() - this.ended > SKETCH) this.redraw();
      this.decoded = (await this.remote.ask<OpenedModel>({ ask: "decode", model: this.model })).json.decoded;
    }
    onstep(1);
    // Drawn in full at once, unless the view is moving.
    this.coarse = performance.now() - this.touched < REST && this.frames > 0 ? 2 : 1;
    if (this.state) this.redraw();
  }

  /** Draws until the picture shows the last state. */
  private async loop(): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    let now = this.changed;
    try {
      while (this.state && this.pending) {
        now = this.changed;
        const whole = this.decoded === 1;
        const moving = this.coarse > 1 || !whole;
        await this.frame(this.state, moving ? Math.max(2, this.coarse) : 1);
        this.drawn = now;
        this.ended = performance.now();
        clearTimeout(this.rest);
        if (moving && whole && this.changed === now) this.rest = setTimeout(() => void this.full(), this.coarse > 2 ? LONG_REST : REST);
        this.onframe(!moving && this.changed === now);
      }
    } catch (error) {
      this.drawn = now;
      this.onerror(error instanceof Error ? error.message : String(error));
    } finally {
      this.busy = false;
    }
    // The state changed during a frame that failed.
    if (this.pending) void this.loop();
  }

  /** Draws the state again in full. */
  private async full(): Promise<void> {
    if (this.busy || !this.state) return;
    this.coarse = 1;
    this.drawn = -1;
    await this.loop();
  }

  private async frame(state: State, coarse: number): Promise<void> {
    const { width, height } = this.size;
    const size = { width: Math.ceil(width / coarse), height: Math.ceil(height / coarse) };
    const began = performance.now();
    const held = await this.rangeOverTime(state);
    const scene = { ...sceneOf(state, this.about, size), coarse: coarse > 1 };
    const paint = { ...paintOf(state), range: state.range ?? held };
    let gpu = this.by === "GPU" && this.about.adds_up && !paint.by_layer && !paint.field ? this.gl : null;
    // Densities exceed the largest half float, 65504.
    if (gpu?.half && paint.look === null) gpu = null;
    let answer: PictureAnswer = { range: null };
    if (gpu) {
      try {
        answer = { range: await this.drawOnGpu(gpu, scene, paint) };
      } catch (error) {
        // The context was lost, or the GPU's memory is too small.
        gpu = this.gl = null;
        this.by = "CPU";
        this.onerror(`drawing on the CPU: ${error instanceof Error ? error.message : String(error)}`);
      }
    }
    if (!gpu) answer = await this.drawOnCpu(scene, paint);
    if (coarse === 1 || held || !this.range || !this.answerFor(state)) this.range = answer.range;
    this.last = { state, answer: { ...answer, range: this.range } };
    this.gpu.hidden = !gpu;
    this.cpu.hidden = !!gpu;
    if (this.series) this.lines();
    this.drew = gpu ? "GPU" : "CPU";
    this.frames++;
    const took = performance.now() - began;
    if (coarse === 1) {
      this.milliseconds = took;
      this.coarse = took > SMOOTH ? (state.field && took > SLOW ? 4 : 2) : 1;
    }
  }

  /** Whether a picture is being drawn. */
  get drawing(): boolean {
    return this.busy || this.pending;
  }

  /** Shows the series at the time of a state; returns the range of its colours if that must not change with time. */
  private async rangeOverTime(state: State): Promise<[number, number] | null> {
    const { series, last } = this;
    if (!series || state.time === null) return null;
    const passes = last !== null && last.state.time !== state.time;
    const view = JSON.stringify({ ...state, time: null });
    const kept = this.held && this.held.shown === shown(state) && (this.playing || this.held.view === view);
    if (!kept) this.held = null;
    if (!kept && passes && !state.range && hasColorBar(state)) {
      const range = await this.rangeOfKeyframes(state, series);
      if (range) this.held = { view, shown: shown(state), range };
    }
    await this.setTime(series, series.timeAt(series.positionOf(state.time)));
    return this.held?.range ?? null;
  }

  /** The range of the first, the middle and the last keyframe together; `null` if none has values. */
  private async rangeOfKeyframes(state: State, series: SeriesFrames): Promise<[number, number] | null> {
    const ends: [number, number][] = [];
    this.engineTime = null;
    for (const position of [0, series.keyframe(series.last / 2), series.keyframe(series.last)]) {
      await this.askMoment(series, series.timeAt(position));
      const range = await this.rangeOf(sceneOf(state, this.about, this.size), state.field).catch(() => null);
      if (range) ends.push(range);
    }
    return ends.length > 0 ? [Math.min(...ends.map((e) => e[0])), Math.max(...ends.map((e) => e[1]))] : null;
  }

  private async askMoment(series: SeriesFrames, time: number): Promise<MomentSummary> {
    await series.load(time);
    return (await this.remote.ask<MomentSummary>({ ask: "set-time", model: this.model, time })).json;
  }

  /** Shows the series at a time: the engine's next picture is of it. */
  private async setTime(series: SeriesFrames, time: number): Promise<void> {
    if (this.engineTime === time) return;
    const { text, interpolated, ...changes } = await this.askMoment(series, time);
    this.engineTime = time;
    this.about = { ...this.about, ...changes };
    this.moment = { time, text, interpolated };
    this.marker = null;
  }

  /** The answer to the last picture, with its range, if that showed the same field or style as a state. */
  answerFor(state: State): PictureAnswer | null {
    return this.last && shown(this.last.state) === shown(state) ? this.last.answer : null;
  }

  private async drawOnCpu(scene: Scene, paint: PlaneColours): Promise<PictureAnswer> {
    const { width, height } = scene.size;
    if (this.lacks) {
      [this.cpu.width, this.cpu.height] = [width, height];
      return { range: null };
    }
    const { json, numbers } = await this.picture(scene, paint);
    this.cpu.width = width;
    this.cpu.height = height;
    this.cpu.getContext("2d")!.putImageData(new ImageData(new Uint8ClampedArray(numbers), width, height), 0, 0);
    return json;
  }

  /** A picture's pixels, drawn on the CPU. */
  picture(scene: Scene, paint: PlaneColours) {
    return this.remote.ask<PictureAnswer>({ ask: "picture", model: this.model, scene, paint });
  }

  /** Whether the whole model is decoded. */
  get whole(): boolean {
    return this.decoded === 1;
  }

  /** The default camera; the engine is asked once per picture size. */
  home(): Promise<Orbit> {
    const { width, height } = this.size;
    const key = `${width}x${height}`;
    const known = this.homes.get(key) ?? this.askHome();
    this.homes.set(key, known);
    return known;
  }

  private async askHome(): Promise<Orbit> {
    const { json } = await this.remote.ask<{ distance: number }>({ ask: "base-distance", model: this.model, size: this.size });
    const focal = center(this.about.metadata.bounds);
    return { focal, azimuth: 0, elevation: 0, roll: 0, distance: json.distance, orthographic: false };
  }

  /** Masked PSNR in dB of two grey pictures; infinite if they are equal. */
  async maskedPsnr(a: Uint8Array, b: Uint8Array, size: Size): Promise<number> {
    const both = new Uint8Array(a.length + b.length);
    both.set(a);
    both.set(b, a.length);
    type Score = { masked_psnr: number | null };
    const { json } = await this.remote.ask<Score>({ ask: "score", model: this.model, size }, both.buffer);
    return json.masked_psnr ?? Infinity;
  }

  /** The focal point and distance at which an orthographic view shows the whole box. */
  async window(state: State): Promise<Pick<Orbit, "focal" | "distance">> {
    const scene = sceneOf(state, this.about, this.size);
    type Window = { center: Vec3; height_world: number };
    const { json } = await this.remote.ask<Window>({ ask: "window", model: this.model, scene });
    return { focal: json.center, distance: distanceOf(json.height_world) };
  }

  /** The depths or densities of a picture, or the values of a field. */
  values(scene: Scene, style: "depth" | "density", field?: State["field"]) {
    return this.remote.ask<{ range: [number, number] | null }>({ ask: "values", model: this.model, scene, style, field: field ?? undefined });
  }

  private async drawOnGpu(gl: GlRenderer, scene: Scene, paint: PlaneColours): Promise<[number, number] | null> {
    const style = paint.look === null ? "density" : "depth";
    const { json, numbers } = await this.remote.ask<StrokePlanes>({ ask: "strokes", model: this.model, scene, style });
    const own = paint.range ? paint : { ...paint, range: paint.look === null ? await this.rangeOf(scene) ?? [1, 10] : null };
    const tone = paint.look === null || paint.look === "expected" ? null : await this.curve(scene);
    const colors = paint.look === null ? await this.mapColors(paint.colormap, paint.white) : null;
    gl.draw(numbers, { paint: own, strokes: json, tone, colors }, scene.size);
    return own.range;
  }

  /** The range of a picture's densities or of a field's values, from one of a quarter of its size. */
  private async rangeOf(scene: Scene, field?: State["field"]): Promise<[number, number] | null> {
    const size = { width: Math.ceil(scene.size.width / 4), height: Math.ceil(scene.size.height / 4) };
    return (await this.values({ ...scene, size }, "density", field)).json.range;
  }

  private async curve(scene: Scene): Promise<{ curve: ToneCurve; levels: Float32Array }> {
    const c = scene.camera;
    const far = Math.hypot(...c.position.map((v, k) => v - c.focal_point[k]));
    const per = c.height_world !== undefined
      ? scene.size.height / c.height_world
      : (0.5 * scene.size.height) / Math.tan(((c.fov_deg ?? 30) * Math.PI) / 360) / far;
    const radius_pixels = scene.radius * per;
    const key = `${scene.opacity} ${radius_pixels}`;
    if (this.tone?.key !== key) {
      const { json, numbers } = await this.remote.ask<ToneCurve>(
        { ask: "tone", model: this.model, opacity: scene.opacity, radius_pixels });
      this.tone = { key, curve: json, levels: new Float32Array(numbers) };
    }
    return this.tone;
  }

  /** What the colour bar of the last picture shows. */
  lastBar(): Promise<BarContent | null> {
    return this.last ? this.bar(this.last.state, this.last.answer) : Promise.resolve(null);
  }

  /** What the colour bar of a picture shows; `null` if it has none. */
  async bar(s: State, { range, scale, without = [] }: PictureAnswer): Promise<BarContent | null> {
    if (!range || !hasColorBar(s)) return null;
    if (!s.field) {
      const colors = (await this.mapColors(s.colormap, s.white)).subarray(3 * LOWEST);
      return { title: `Σ (${this.about.units.surface})`, note: "", range, logarithmic: true, colors };
    }
    const map = mapOf(s.field.name, this.about);
    if (!map || !scale) return null;
    const unit = map.unit ? ` (${map.unit})` : "";
    const bulk = s.field.bulk && map.moves ? ", bulk motion subtracted" : "";
    const note = [
      without.length > 0 ? `no values: ${without.join(", ")}` : "", s.field.shade ? "brightness: surface density" : "",
    ].filter((t) => t).join("; ");
    const colors = await this.mapColors(s.field.colormap, s.white, scale);
    return { title: `${map.title}${bulk}${unit}`, note, range, logarithmic: scale === "log", colors };
  }

  /** The 256 colours of a map: of densities on a black or white background, or of a field's values. */
  async mapColors(name: string, white: boolean, scale?: ValueScale): Promise<Uint8Array> {
    const key = `${name} ${white} ${scale ?? ""}`;
    if (this.colors?.key !== key) {
      const { numbers } = await this.remote.ask<object>({ ask: "colors", model: this.model, name, white, scale });
      this.colors = { key, data: new Uint8Array(numbers) };
    }
    return this.colors.data;
  }

  /** Starts the GPU renderer; throws if the GPU cannot blend floats. */
  startGpu(): GlRenderer {
    this.gl ??= new GlRenderer(this.gpu);
    return this.gl;
  }

  /** Times the current state on both processors and uses the faster one. */
  async measure(): Promise<void> {
    if (!this.about.adds_up) return;
    const gl = this.startGpu();
    // Waits until the picture is drawn in full.
    while (this.busy || !this.state || this.decoded < 1 || this.drawn !== this.changed) await new Promise((r) => setTimeout(r, 100));
    const scene = sceneOf(this.state, this.about, this.size);
    const paint = { ...paintOf(this.state), by_layer: false, field: null };
    const timed = async (draw: () => Promise<unknown>) => {
      await draw();
      const began = performance.now();
      await draw();
      return performance.now() - began;
    };
    const cpu = await timed(() => this.picture(scene, paint));
    const gpu = await timed(async () => {
      await this.drawOnGpu(gl, scene, paint);
      gl.finish();
    });
    this.by = gpu < cpu ? "GPU" : "CPU";
    this.show(this.state);
  }

  /** Draws lines and text over the picture. */
  lines(): void {
    if (!this.state) return;
    const { width, height } = this.size;
    if (this.overlay.width !== width) this.overlay.width = width;
    if (this.overlay.height !== height) this.overlay.height = height;
    const unit = width / Math.max(1, this.element.clientWidth);
    // On the CPU: an emulated GPU takes seconds for ten thousand circles.
    const context = this.overlay.getContext("2d", { willReadFrequently: this.circles.length > 0 })!;
    drawOverlay(context, this.state, this, { width, height }, unit);
  }
}

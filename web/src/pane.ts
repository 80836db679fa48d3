// One model's picture: asks the engine, draws by the faster of the graphics card and the CPU, coarser in motion.

import { center, distanceOf, type Orbit } from "./camera";
import { h } from "./dom";
import { GlRenderer } from "./gl";
import { drawOverlay, type Marker } from "./overlay";
import type { ModelSummary, OpenedModel, PlaneColours, Scene, Size, StrokePlanes, ToneCurve, Vec3 } from "./protocol";
import type { EngineClient } from "./engine";
import { paintOf, sceneOf, type State } from "./state";

/** Milliseconds of a frame in motion that the eye still takes for motion. */
const SMOOTH = 30;
/** Milliseconds between two pictures of what is decoded by now. */
const SKETCH = 400;
/** Milliseconds without a change after which the picture is drawn in full. */
const REST = 120;

export type Processor = "CPU" | "GPU";

export class Pane {
  readonly element: HTMLElement;
  readonly overlay = h("canvas", { class: "overlay", "aria-hidden": "true" });
  readonly cpu = h("canvas", { class: "picture" });
  readonly card = h("canvas", { class: "picture", hidden: true });
  /** Of the last full picture. */
  range: [number, number] | null = null;
  /** What it is to be drawn by, and what drew the last picture. */
  by: Processor = "CPU";
  drew: Processor = "CPU";
  milliseconds = 0;
  frames = 0;
  marker: Marker | null = null;
  private homes = new Map<string, Promise<Orbit>>();
  /** After every frame; `full` where nothing is left to draw. */
  onframe: (full: boolean) => void = () => {};
  onerror: (text: string) => void = () => {};

  private state: State | null = null;
  private changed = 0;
  private drawn = -1;
  private busy = false;
  private rest: ReturnType<typeof setTimeout> | undefined;
  private coarse = 1;
  /** When a state came in last, and when the last frame ended. */
  private touched = 0;
  private ended = 0;
  private gl: GlRenderer | null = null;
  private tone: { key: string; curve: ToneCurve; levels: Float32Array } | null = null;
  private colors: { key: string; data: Uint8Array } | null = null;

  /**
   * `decoded` is the share of the model that is decoded. Where its first picture `waits` for the rest, nothing is drawn
   * before, unless the view is moved.
   */
  constructor(
    private remote: EngineClient, readonly model: number, readonly name: string, readonly about: ModelSummary,
    private decoded: number, private waits: boolean,
  ) {
    // A driver that is reset, a machine that slept: never a black picture.
    this.card.addEventListener("webglcontextlost", () => {
      this.gl = null;
      this.by = "CPU";
      this.onerror("drawn by the CPU: the GPU was lost");
      if (this.state) this.show(this.state);
    });
    const label = `${name}: picture of the model. Drag to turn, arrow keys turn as well; press ? for all keys.`;
    this.element = h("div", { class: "pane", tabindex: "0", role: "img", "aria-label": label },
      this.cpu, this.card, this.overlay, h("div", { class: "pane-name", "aria-hidden": "true", text: name }));
  }

  /** The range that it was told to have; `undefined` before the first. */
  get shownRange(): [number, number] | null | undefined {
    return this.state?.range;
  }

  /** Device pixels of the picture. */
  get size(): Size {
    const { clientWidth, clientHeight } = this.element;
    const ratio = Math.min(2, globalThis.devicePixelRatio || 1);
    return { width: Math.max(16, Math.round(clientWidth * ratio)), height: Math.max(16, Math.round(clientHeight * ratio)) };
  }

  /** Shows a state, soon. */
  show(state: State): void {
    const first = this.state === null;
    this.state = state;
    this.touched = performance.now();
    this.lines();
    if (!(first && this.waits && this.decoded < 1)) this.redraw();
  }

  private redraw(): void {
    this.changed++;
    void this.loop();
  }

  /** Decodes what is left of the model, step by step, so that pictures come between; `onstep` is told the share. */
  async decode(onstep: (share: number) => void): Promise<void> {
    if (this.decoded === 1) return onstep(1);
    while (this.decoded < 1) {
      onstep(this.decoded);
      if (this.frames > 0 && !this.busy && performance.now() - this.ended > SKETCH) this.redraw();
      this.decoded = (await this.remote.ask<OpenedModel>({ ask: "decode", model: this.model })).json.decoded;
    }
    onstep(1);
    // In full at once, unless a hand is at it.
    this.coarse = performance.now() - this.touched < REST && this.frames > 0 ? 2 : 1;
    if (this.state) this.redraw();
  }

  /** Draws until the picture is that of the last state. */
  private async loop(): Promise<void> {
    if (this.busy) return;
    this.busy = true;
    let now = this.changed;
    try {
      while (this.state && this.drawn !== this.changed) {
        now = this.changed;
        const whole = this.decoded === 1;
        const moving = this.coarse > 1 || !whole;
        await this.frame(this.state, moving ? 2 : 1);
        this.drawn = now;
        this.ended = performance.now();
        clearTimeout(this.rest);
        if (moving && whole && this.changed === now) this.rest = setTimeout(() => void this.full(), REST);
        this.onframe(!moving && this.changed === now);
      }
    } catch (error) {
      this.drawn = now;
      this.onerror(error instanceof Error ? error.message : String(error));
    } finally {
      this.busy = false;
    }
    // What came in during a frame that failed.
    if (this.state && this.drawn !== this.changed) void this.loop();
  }

  /** The same again in full. */
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
    const scene = { ...sceneOf(state, this.about, size), coarse: coarse > 1 };
    const paint = paintOf(state);
    let card = this.by === "GPU" && this.about.adds_up && !paint.by_layer ? this.gl : null;
    // Half floats end at 65504, which densities pass.
    if (card?.half && paint.look === null) card = null;
    let range: [number, number] | null = null;
    if (card) {
      try {
        range = await this.drawOnCard(card, scene, paint);
      } catch (error) {
        // A lost context, or more than the card holds: never a black page.
        card = this.gl = null;
        this.by = "CPU";
        this.onerror(`drawn by the CPU: ${error instanceof Error ? error.message : String(error)}`);
      }
    }
    if (!card) range = await this.drawOnCpu(scene, paint);
    if (coarse === 1 || !this.range) this.range = range;
    this.card.hidden = !card;
    this.cpu.hidden = !!card;
    this.drew = card ? "GPU" : "CPU";
    this.frames++;
    const took = performance.now() - began;
    if (coarse === 1) {
      this.milliseconds = took;
      // In motion by two at most.
      this.coarse = took > SMOOTH ? 2 : 1;
    }
  }

  private async drawOnCpu(scene: Scene, paint: PlaneColours): Promise<[number, number] | null> {
    const { json, numbers } = await this.picture(scene, paint);
    const { width, height } = scene.size;
    this.cpu.width = width;
    this.cpu.height = height;
    this.cpu.getContext("2d")!.putImageData(new ImageData(new Uint8ClampedArray(numbers), width, height), 0, 0);
    return json.range;
  }

  /** Pixels of a picture by the CPU. */
  picture(scene: Scene, paint: PlaneColours) {
    return this.remote.ask<{ range: [number, number] | null }>({ ask: "picture", model: this.model, scene, paint });
  }

  /** Is all of the model decoded? */
  get whole(): boolean {
    return this.decoded === 1;
  }

  /** Where a camera stands that nobody moved: the engine is asked once a size, so that what follows a known one waits for nothing. */
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

  /** Masked PSNR in dB of two grey pictures; infinite where they agree. */
  async maskedPsnr(a: Uint8Array, b: Uint8Array, size: Size): Promise<number> {
    const both = new Uint8Array(a.length + b.length);
    both.set(a);
    both.set(b, a.length);
    type Score = { masked_psnr: number | null };
    const { json } = await this.remote.ask<Score>({ ask: "score", model: this.model, size }, both.buffer);
    return json.masked_psnr ?? Infinity;
  }

  /** Where a view along parallel lines shows the whole box. */
  async window(state: State): Promise<Pick<Orbit, "focal" | "distance">> {
    const scene = sceneOf(state, this.about, this.size);
    type Window = { center: Vec3; height_world: number };
    const { json } = await this.remote.ask<Window>({ ask: "window", model: this.model, scene });
    return { focal: json.center, distance: distanceOf(json.height_world) };
  }

  /** The plane behind a picture. */
  values(scene: Scene, style: "depth" | "density") {
    return this.remote.ask<{ range: [number, number] }>({ ask: "values", model: this.model, scene, style });
  }

  private async drawOnCard(gl: GlRenderer, scene: Scene, paint: PlaneColours): Promise<[number, number] | null> {
    const style = paint.look === null ? "density" : "depth";
    const { json, numbers } = await this.remote.ask<StrokePlanes>({ ask: "strokes", model: this.model, scene, style });
    const own = paint.range ? paint : { ...paint, range: paint.look === null ? await this.rangeOf(scene) : null };
    const tone = paint.look === null || paint.look === "expected" ? null : await this.curve(scene);
    const colors = paint.look === null ? await this.mapColors(paint.colormap, paint.white) : null;
    gl.draw(numbers, { paint: own, strokes: json, tone, colors }, scene.size);
    return own.range;
  }

  /** The range of colours that nearly all of a picture needs, from one of a quarter of its size. */
  private async rangeOf(scene: Scene): Promise<[number, number]> {
    const size = { width: Math.ceil(scene.size.width / 4), height: Math.ceil(scene.size.height / 4) };
    return (await this.values({ ...scene, size }, "density")).json.range;
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

  /** 256 colours, for black or white ground. */
  async mapColors(name: string, white: boolean): Promise<Uint8Array> {
    const key = `${name} ${white}`;
    if (this.colors?.key !== key) {
      const { numbers } = await this.remote.ask<object>({ ask: "colors", model: this.model, name, white });
      this.colors = { key, data: new Uint8Array(numbers) };
    }
    return this.colors.data;
  }

  /** Makes the graphics card's renderer; throws where there is none that adds up. */
  startCard(): GlRenderer {
    this.gl ??= new GlRenderer(this.card);
    return this.gl;
  }

  /** Draws the present state once by each, and keeps the faster. */
  async measure(): Promise<void> {
    if (!this.about.adds_up) return;
    const gl = this.startCard();
    // Not beside a frame, nor while the picture is still to be drawn in full.
    while (this.busy || !this.state || this.decoded < 1 || this.drawn !== this.changed) await new Promise((r) => setTimeout(r, 100));
    const scene = sceneOf(this.state, this.about, this.size);
    const paint = { ...paintOf(this.state), by_layer: false };
    const timed = async (draw: () => Promise<unknown>) => {
      await draw();
      const began = performance.now();
      await draw();
      return performance.now() - began;
    };
    const cpu = await timed(() => this.picture(scene, paint));
    const card = await timed(async () => {
      await this.drawOnCard(gl, scene, paint);
      gl.finish();
    });
    this.by = card < cpu ? "GPU" : "CPU";
    this.show(this.state);
  }

  /** Lines and words over the picture. */
  lines(): void {
    if (!this.state) return;
    const { width, height } = this.size;
    if (this.overlay.width !== width) this.overlay.width = width;
    if (this.overlay.height !== height) this.overlay.height = height;
    const unit = width / Math.max(1, this.element.clientWidth);
    drawOverlay(this.overlay.getContext("2d")!, this.state, this.about, { width, height }, unit, this.marker);
  }
}

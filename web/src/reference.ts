// Pictures of all particles from the server, coarse first. A request that is out of date is aborted.

import { h } from "./dom";
import { LOWEST, type Scene, type Size } from "./protocol";
import type { State } from "./state";

/** Number of particles in the first, coarse picture. */
const MOST_AT_FIRST = 2e6;

export type ComparisonMode = "split" | "difference";

/** A picture of all particles: grey levels, or densities. */
export interface ReferencePicture { size: Size; levels: Uint8Array | null; densities: Float32Array | null }

export class ReferenceClient {
  private running: AbortController | null = null;

  constructor(private url: string, private particles: number) {}

  /** Aborts the running request. */
  stop(): void {
    this.running?.abort();
    this.running = null;
  }

  /** Draws a scene, coarse first; `each` gets every picture unless the request was aborted. */
  async draw(scene: Scene, state: State, each: (picture: ReferencePicture, last: boolean) => void): Promise<void> {
    this.stop();
    const own = (this.running = new AbortController());
    for (const coarse of [4, 1]) {
      const size = { width: Math.ceil(scene.size.width / coarse), height: Math.ceil(scene.size.height / coarse) };
      const share = coarse > 1 ? Math.min(1, MOST_AT_FIRST / this.particles) : 1;
      const body = JSON.stringify({
        camera: scene.camera, radius: scene.radius, opacity: scene.opacity, look: state.look, width: size.width, height_pixels: size.height,
        share, periodic: false,
      });
      let answer: Response;
      try {
        answer = await fetch(this.url, { method: "POST", body, signal: own.signal, headers: { "content-type": "application/json" } });
      } catch (error) {
        if (own.signal.aborted) return;
        throw error;
      }
      if (own.signal.aborted) return;
      if (!answer.ok) throw new Error((await answer.text()).trim() || `the server returned HTTP ${answer.status}`);
      const bytes = await answer.arrayBuffer();
      if (own.signal.aborted) return;
      const density = state.look === "density";
      each({
        size, levels: density ? null : new Uint8Array(bytes), densities: density ? new Float32Array(bytes) : null,
      }, coarse === 1);
    }
  }
}

/** RMS difference of the logarithms, in dex, where both are above `floor`. */
export function rmsDex(a: Float32Array, b: Float32Array, floor: number): number {
  let [sum, n] = [0, 0];
  for (let i = 0; i < a.length; i++) {
    if (a[i] <= floor || b[i] <= floor) continue;
    sum += Math.log10(a[i] / b[i]) ** 2;
    n++;
  }
  return n === 0 ? NaN : Math.sqrt(sum / n);
}

/** The first channel of a picture. */
export function greyLevels(rgba: ArrayBuffer): Uint8Array {
  const all = new Uint8Array(rgba);
  return Uint8Array.from({ length: all.length / 4 }, (_, i) => all[4 * i]);
}

/** A reference picture in the colours of the page. */
export function colorImage(t: ReferencePicture, state: State, colors: Uint8Array, range: [number, number]): ImageData {
  const out = new ImageData(t.size.width, t.size.height);
  const gain = 2 ** state.exposure;
  for (let i = 0; i < t.size.width * t.size.height; i++) {
    let rgb = [0, 0, 0];
    if (t.levels) {
      const v = Math.min(255, Math.round(t.levels[i] * gain));
      rgb = Array(3).fill(state.white ? 255 - v : v);
    } else if (t.densities) {
      const share = Math.log(t.densities[i] / range[0]) / Math.log(range[1] / range[0]);
      const place = t.densities[i] > 0 ? LOWEST + (255 - LOWEST) * share : 0;
      const k = 3 * Math.round(Math.max(0, Math.min(255, place)));
      rgb = [colors[k], colors[k + 1], colors[k + 2]];
    }
    out.data.set([...rgb, 255], 4 * i);
  }
  return out;
}

/** Model minus reference: blue is negative, red positive, dark zero; full colour at 64 grey levels or 0.5 dex. */
export function differenceImage(model: ArrayLike<number>, truth: ArrayLike<number>, logarithmic: boolean, size: Size): ImageData {
  const out = new ImageData(size.width, size.height);
  for (let i = 0; i < truth.length; i++) {
    const d = logarithmic
      ? (model[i] > 0 && truth[i] > 0 ? Math.log10(model[i] / truth[i]) / 0.5 : 0)
      : (model[i] - truth[i]) / 64;
    const v = Math.min(1, Math.abs(d));
    out.data.set(d < 0 ? [64 * v, 128 * v, 255 * v, 255] : [255 * v, 96 * v, 48 * v, 255], 4 * i);
  }
  return out;
}

/** The split over a pane: a canvas for the reference picture, and a divider to drag or to move by keys. */
export class SplitView {
  readonly canvas = h("canvas", { class: "truth" });
  readonly bar = h("div", {
    class: "divider", role: "separator", tabindex: "0", "aria-orientation": "vertical",
    "aria-label": "Divider between model (left) and all particles (right)", "aria-valuemin": "0", "aria-valuemax": "100",
  });
  private at = 50;

  constructor(host: HTMLElement) {
    host.append(this.canvas, this.bar);
    this.place(50);
    this.bar.addEventListener("pointerdown", (e) => {
      e.stopPropagation();
      this.bar.setPointerCapture(e.pointerId);
    });
    this.bar.addEventListener("pointermove", (e) => {
      e.stopPropagation();
      if (!this.bar.hasPointerCapture(e.pointerId)) return;
      const box = host.getBoundingClientRect();
      this.place((100 * (e.clientX - box.left)) / box.width);
    });
    for (const kind of ["pointerup", "click", "dblclick"]) this.bar.addEventListener(kind, (e) => e.stopPropagation());
    this.bar.addEventListener("keydown", (e) => {
      const step = { ArrowLeft: -2, ArrowRight: 2, Home: -100, End: 100 }[e.key];
      if (step !== undefined) {
        e.preventDefault();
        e.stopPropagation();
        this.place(this.at + step);
      }
    });
  }

  /** Moves the divider, in percent of the width. */
  place(percent: number): void {
    this.at = Math.max(0, Math.min(100, percent));
    this.bar.style.left = `${this.at}%`;
    this.bar.setAttribute("aria-valuenow", String(Math.round(this.at)));
    this.canvas.style.clipPath = this.whole ? "none" : `inset(0 0 0 ${this.at}%)`;
  }

  /** Shows a picture, right of the divider or as a `whole`. */
  put(pixels: ImageData, whole: boolean): void {
    this.whole = whole;
    this.bar.hidden = whole;
    this.canvas.hidden = false;
    this.canvas.width = pixels.width;
    this.canvas.height = pixels.height;
    this.canvas.getContext("2d")!.putImageData(pixels, 0, 0);
    this.place(this.at);
  }

  /** Hides a picture that is out of date, and the divider. */
  clear(): void {
    this.canvas.hidden = this.bar.hidden = true;
  }

  remove(): void {
    this.canvas.remove();
    this.bar.remove();
  }

  private whole = false;
}

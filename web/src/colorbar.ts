// The colour bar of densities or of a field, beside the picture.

import { h } from "./dom";
import { evenTicks, logTicks, formatNumber } from "./units";

/** What a colour bar shows: its colours as RGB, the lowest first. */
export interface BarContent {
  title: string;
  /** Says what the picture does not show; may be empty. */
  note: string;
  range: [number, number];
  logarithmic: boolean;
  colors: Uint8Array;
}

/** Where values lie along a bar, from 0 to 1, and their labels. */
function ticksOf({ range: [lo, hi], logarithmic }: BarContent): [number, string][] {
  const share = (v: number) => (logarithmic ? Math.log(v / lo) / Math.log(hi / lo) : (v - lo) / (hi - lo));
  const ticks: [number, string][] = logarithmic && hi / lo > 10 ? logTicks(lo, hi).map((v) => [v, formatNumber(v, 2)]) : evenTicks(lo, hi);
  return ticks.map(([v, text]) => [share(v), text]);
}

export class ColorBar {
  private strip = h("canvas", { "aria-hidden": "true" });
  private ticks = h("div", { class: "ticks" });
  private title = h("div", { class: "bar-title" });
  private note = h("div", { class: "bar-title bar-note" });
  readonly element = h("div", { id: "colorbar", hidden: true, role: "img" }, this.title, h("div", { class: "bar-body" }, this.strip, this.ticks), this.note);

  show(bar: BarContent): void {
    const { title, note, range, logarithmic, colors } = bar;
    this.element.hidden = false;
    this.title.textContent = title;
    this.note.textContent = note;
    const scale = logarithmic ? ", logarithmic" : "";
    this.element.setAttribute("aria-label", `Colour bar: ${title} from ${formatNumber(range[0])} to ${formatNumber(range[1])}${scale}. ${note}`);
    // On a narrow page the bar is below the picture.
    const flat = matchMedia("(max-width: 700px)").matches;
    const count = colors.length / 3;
    [this.strip.width, this.strip.height] = flat ? [count, 1] : [1, count];
    const c = this.strip.getContext("2d")!;
    const pixels = c.createImageData(this.strip.width, this.strip.height);
    for (let i = 0; i < count; i++) {
      pixels.data.set([...colors.subarray(3 * i, 3 * i + 3), 255], 4 * (flat ? i : count - 1 - i));
    }
    c.putImageData(pixels, 0, 0);
    this.ticks.replaceChildren(...ticksOf(bar).map(([share, text]) => {
      const tick = h("span", { text });
      tick.style[flat ? "left" : "bottom"] = `${100 * share}%`;
      return tick;
    }));
  }

  hide(): void {
    this.element.hidden = true;
  }
}

/** A picture with its colour bar beside it, on a black or white background. */
export function withColorBar(picture: OffscreenCanvas, bar: BarContent, white: boolean): OffscreenCanvas {
  const { title, note, colors } = bar;
  const em = Math.max(10, Math.round(picture.height / 50));
  const canvas = new OffscreenCanvas(picture.width + (note ? 10.5 : 9) * em, picture.height);
  const c = canvas.getContext("2d")!;
  const ink = white ? "#000" : "#fff";
  c.fillStyle = white ? "#fff" : "#000";
  c.fillRect(0, 0, canvas.width, canvas.height);
  c.drawImage(picture, 0, 0);
  const [left, top, wide, high] = [picture.width + em, em, em, picture.height - 2 * em];
  const last = colors.length / 3 - 1;
  for (let y = 0; y < high; y++) {
    const k = 3 * Math.round(last * (1 - y / Math.max(1, high - 1)));
    c.fillStyle = `rgb(${colors[k]} ${colors[k + 1]} ${colors[k + 2]})`;
    c.fillRect(left, top + y, wide, 1);
  }
  c.strokeStyle = c.fillStyle = ink;
  c.lineWidth = Math.max(1, em / 12);
  c.strokeRect(left, top, wide, high);
  c.font = `${em}px system-ui, sans-serif`;
  c.textBaseline = "middle";
  let widest = 0;
  for (const [share, text] of ticksOf(bar)) {
    const y = top + high * (1 - share);
    c.fillRect(left + wide, y, 0.4 * em, c.lineWidth);
    // Keeps the labels at both ends inside the picture.
    c.fillText(text, left + 1.6 * em, Math.max(0.6 * em, Math.min(picture.height - 0.6 * em, y)));
    widest = Math.max(widest, c.measureText(text).width);
  }
  c.translate(left + 2.4 * em + widest, picture.height / 2);
  c.rotate(-Math.PI / 2);
  c.textAlign = "center";
  c.fillText(title, 0, 0, high);
  c.fillText(note, 0, 1.5 * em, high);
  return canvas;
}

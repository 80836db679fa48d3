// The colour bar of densities, beside the picture.

import { h } from "./dom";
import { LOWEST } from "./protocol";
import { logTicks, formatNumber } from "./units";

export class ColorBar {
  private strip = h("canvas", { "aria-hidden": "true" });
  private ticks = h("div", { class: "ticks" });
  private title = h("div", { class: "bar-title" });
  readonly element = h("div", { id: "colorbar", hidden: true, role: "img" }, this.title, h("div", { class: "bar-body" }, this.strip, this.ticks));

  show(range: [number, number], colors: Uint8Array, unit: string): void {
    this.element.hidden = false;
    this.title.textContent = `Σ (${unit})`;
    this.element.setAttribute("aria-label", `Colour bar: surface density from ${formatNumber(range[0])} to ${formatNumber(range[1])} ${unit}, logarithmic`);
    // On a narrow page the bar is below the picture.
    const flat = matchMedia("(max-width: 700px)").matches;
    const count = 256 - LOWEST;
    [this.strip.width, this.strip.height] = flat ? [count, 1] : [1, count];
    const c = this.strip.getContext("2d")!;
    const pixels = c.createImageData(this.strip.width, this.strip.height);
    for (let i = 0; i < count; i++) {
      const at = 3 * (LOWEST + i);
      pixels.data.set([...colors.subarray(at, at + 3), 255], 4 * (flat ? i : count - 1 - i));
    }
    c.putImageData(pixels, 0, 0);
    const long = Math.log(range[1] / range[0]);
    this.ticks.replaceChildren(...logTicks(...range).map((v) => {
      const tick = h("span", { text: formatNumber(v, 2) });
      tick.style[flat ? "left" : "bottom"] = `${(100 * Math.log(v / range[0])) / long}%`;
      return tick;
    }));
  }

  hide(): void {
    this.element.hidden = true;
  }
}

/** A picture with its colour bar beside it, on a black or white background. */
export function withColorBar(picture: OffscreenCanvas, range: [number, number], colors: Uint8Array, unit: string, white: boolean): OffscreenCanvas {
  const em = Math.max(10, Math.round(picture.height / 50));
  const canvas = new OffscreenCanvas(picture.width + 9 * em, picture.height);
  const c = canvas.getContext("2d")!;
  const ink = white ? "#000" : "#fff";
  c.fillStyle = white ? "#fff" : "#000";
  c.fillRect(0, 0, canvas.width, canvas.height);
  c.drawImage(picture, 0, 0);
  const [left, top, wide, high] = [picture.width + em, em, em, picture.height - 2 * em];
  for (let y = 0; y < high; y++) {
    const k = 3 * Math.round(255 - ((255 - LOWEST) * y) / Math.max(1, high - 1));
    c.fillStyle = `rgb(${colors[k]} ${colors[k + 1]} ${colors[k + 2]})`;
    c.fillRect(left, top + y, wide, 1);
  }
  c.strokeStyle = c.fillStyle = ink;
  c.lineWidth = Math.max(1, em / 12);
  c.strokeRect(left, top, wide, high);
  c.font = `${em}px system-ui, sans-serif`;
  c.textBaseline = "middle";
  let widest = 0;
  for (const v of logTicks(...range)) {
    const y = top + high * (1 - Math.log(v / range[0]) / Math.log(range[1] / range[0]));
    c.fillRect(left + wide, y, 0.4 * em, c.lineWidth);
    // Keeps the labels at both ends inside the picture.
    c.fillText(formatNumber(v, 2), left + 1.6 * em, Math.max(0.6 * em, Math.min(picture.height - 0.6 * em, y)));
    widest = Math.max(widest, c.measureText(formatNumber(v, 2)).width);
  }
  c.translate(left + 2.4 * em + widest, picture.height / 2);
  c.rotate(-Math.PI / 2);
  c.textAlign = "center";
  c.fillText(`Σ (${unit})`, 0, 0);
  return canvas;
}

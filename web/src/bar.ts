// The colour bar of densities: beside the picture, never over it.

import { h } from "./dom";
import { logTicks, number } from "./units";

export class ColorBar {
  private strip = h("canvas", { "aria-hidden": "true" });
  private ticks = h("div", { class: "ticks" });
  private title = h("div", { class: "bar-title" });
  readonly element = h("div", { id: "colorbar", hidden: true, role: "img" }, this.title, h("div", { class: "bar-body" }, this.strip, this.ticks));

  show(range: [number, number], colors: Uint8Array, unit: string): void {
    this.element.hidden = false;
    this.title.textContent = `Σ (${unit})`;
    this.element.setAttribute("aria-label", `Colour bar: surface density from ${number(range[0])} to ${number(range[1])} ${unit}, logarithmic`);
    // Beneath the picture where the page is narrow.
    const flat = matchMedia("(max-width: 700px)").matches;
    [this.strip.width, this.strip.height] = flat ? [256, 1] : [1, 256];
    const c = this.strip.getContext("2d")!;
    const pixels = c.createImageData(this.strip.width, this.strip.height);
    for (let i = 0; i < 256; i++) {
      pixels.data.set([colors[3 * i], colors[3 * i + 1], colors[3 * i + 2], 255], 4 * (flat ? i : 255 - i));
    }
    c.putImageData(pixels, 0, 0);
    const long = Math.log(range[1] / range[0]);
    this.ticks.replaceChildren(...logTicks(...range).map((v) => {
      const tick = h("span", { text: number(v, 2) });
      tick.style[flat ? "left" : "bottom"] = `${(100 * Math.log(v / range[0])) / long}%`;
      return tick;
    }));
  }

  hide(): void {
    this.element.hidden = true;
  }
}

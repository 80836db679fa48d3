// The colour bar of densities: beside the picture, never over it.

import { h } from "./dom";
import { LOWEST } from "./protocol";
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
      const tick = h("span", { text: number(v, 2) });
      tick.style[flat ? "left" : "bottom"] = `${(100 * Math.log(v / range[0])) / long}%`;
      return tick;
    }));
  }

  hide(): void {
    this.element.hidden = true;
  }
}

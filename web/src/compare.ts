// Compares the model with all particles: the reference picture is requested when the camera rests and dropped when it
// moves.

import { h } from "./dom";
import type { Page } from "./page";
import type { Setup } from "./protocol";
import { paintOf, sceneOf } from "./state";
import { rmsDex, differenceImage, greyLevels, colorImage, SplitView, ReferenceClient, type ComparisonMode, type ReferencePicture } from "./reference";
import { formatWhole } from "./units";

/** Milliseconds without movement before the server is asked. */
const REST = 250;

export class Comparison {
  readonly element: HTMLElement;
  private truth: ReferenceClient;
  private split: SplitView | null = null;
  private shown: ComparisonMode | null = null;
  private score = h("p", { class: "hint", role: "status" });
  private buttons: Record<ComparisonMode, HTMLButtonElement>;
  private rest: ReturnType<typeof setTimeout> | undefined;
  /** Increases with every change; a picture requested before the last one is out of date. */
  private turn = 0;

  constructor(private page: Page, private of: NonNullable<Setup["truth"]>) {
    this.truth = new ReferenceClient(of.url, of.particles);
    const button = (shown: ComparisonMode, text: string) =>
      h("button", { type: "button", text, "aria-pressed": "false", click: () => this.toggle(shown) });
    this.buttons = { split: button("split", "Split"), difference: button("difference", "Difference") };
    this.element = h("details", { open: true }, h("summary", { text: "All particles" }),
      h("p", { class: "hint", text: `${of.name}: ${formatWhole(of.particles)} particles, drawn on the server` }),
      h("div", { class: "buttons" }, this.buttons.split, this.buttons.difference), this.score);
  }

  toggle(shown: ComparisonMode): void {
    this.shown = this.shown === shown ? null : shown;
    this.turn++;
    clearTimeout(this.rest);
    for (const name of ["split", "difference"] as const) this.buttons[name].setAttribute("aria-pressed", String(this.shown === name));
    if (this.shown === null) {
      this.truth.stop();
      this.split?.remove();
      this.split = null;
      this.score.textContent = "";
    } else {
      this.split ??= new SplitView(this.page.panes[0].element);
      this.moved();
    }
  }

  /** Drops the current reference picture and requests a new one. */
  moved(): void {
    if (this.shown === null) return;
    this.turn++;
    this.truth.stop();
    this.split?.clear();
    this.score.textContent = "…";
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.ask().catch((error: unknown) => (this.score.textContent = error instanceof Error ? error.message : String(error)));
    }, REST);
  }

  private async ask(): Promise<void> {
    const { panes, state } = this.page;
    const pane = panes[0];
    const scene = sceneOf(state, pane.about, pane.size);
    if (state.field) {
      this.score.textContent = "To compare, colour by density or brightness: the page does not draw fields of all particles.";
      return;
    }
    if (scene.clip || scene.layers || scene.images) {
      this.score.textContent = "To compare, turn off the clip box, slabs along x, y or z and periodic images, and show all layers.";
      return;
    }
    const differs = state.look === "density" && this.of.density_of !== pane.about.density_of;
    if (differs) {
      this.score.textContent = `To compare densities, both must be of the same: this model's is of ${pane.about.density_of}, the snapshot's of ${this.of.density_of}.`;
      return;
    }
    const smoothed = state.look === "density" && this.of.smoothed;
    this.score.textContent = smoothed ? `drawing all particles, each smoothed over ${smoothed} neighbours …` : "drawing all particles …";
    await this.truth.draw(scene, state, (picture, last) => {
      void this.show(picture, last).catch((error: Error) => (this.score.textContent = error.message));
    });
  }

  private async show(picture: ReferencePicture, last: boolean): Promise<void> {
    const own = this.turn;
    const { panes, state } = this.page;
    const pane = panes[0];
    const scene = sceneOf(state, pane.about, picture.size);
    const density = picture.densities !== null;
    const range = pane.answerFor(state)?.range ?? [1, 10];
    const paint = { ...paintOf(state), white: false, exposure: 0, by_layer: false };
    const model = density
      ? new Float32Array((await pane.values(scene, "density")).numbers)
      : greyLevels((await pane.picture(scene, paint)).numbers);
    const colors = await pane.mapColors(state.colormap, state.white);
    if (own !== this.turn) return;
    if (this.shown === "difference") {
      this.split?.put(differenceImage(model, (picture.densities ?? picture.levels)!, density, picture.size), true);
    } else {
      this.split?.put(colorImage(picture, state, colors, range), false);
    }
    if (!last) return;
    const score = density ? this.densityScore(model as Float32Array, picture.densities!, range[0])
      : `masked PSNR ${(await pane.maskedPsnr(model as Uint8Array, picture.levels!, picture.size)).toFixed(2)} dB`;
    if (own !== this.turn) return;
    this.score.textContent = score;
    document.documentElement.dataset.compared = this.score.textContent;
  }

  /** Only for smoothed particles: the shot noise of others would count as an error. */
  private densityScore(model: Float32Array, truth: Float32Array, floor: number): string {
    const { smoothed } = this.of;
    if (smoothed === null) return "no score: there are too many particles to smooth, and their shot noise would count as an error";
    return `RMS ${rmsDex(model, truth, floor).toFixed(3)} dex where both are above the lower end of the range; particles are smoothed over ${smoothed} neighbours`;
  }
}

// The bar of a series: a slider over its frames, play, speed, loop.

import { h } from "./dom";
import type { Page } from "./page";
import type { SeriesFrames } from "./series";

/** Frames of the series per second. */
const SPEEDS = [1, 2, 4, 8, 15, 30];
/** A run is played in about this many seconds, unless the user chooses a speed. */
const USUAL = 8;

export class Timeline {
  readonly element: HTMLElement;
  private play = h("button", { type: "button", "aria-label": "Play", text: "▶", click: () => this.toggle() });
  private slider: HTMLInputElement;
  private text = h("output", { class: "moment" });
  private progress = h("span", { class: "hint", role: "status" });
  private speed: HTMLSelectElement;
  private loop = h("input", { type: "checkbox", checked: true });
  private smooth = h("input", { type: "checkbox", checked: true });
  private playing = false;
  /** Where it plays, and how often it was started or stopped. */
  private playhead = 0;
  private turn = 0;

  constructor(private page: Page, private series: SeriesFrames) {
    const usual = SPEEDS.reduce((a, b) => (Math.abs(b - series.last / USUAL) < Math.abs(a - series.last / USUAL) ? b : a));
    this.slider = h("input", {
      type: "range", min: 0, max: series.last, step: 1, value: 0, "aria-label": "Frame", input: () => this.to((this.playhead = Number(this.slider.value))),
    });
    this.speed = h("select", { "aria-label": "Speed" },
      ...SPEEDS.map((s) => h("option", { value: s, selected: s === usual, text: `${s} frame${s === 1 ? "" : "s"}/s` })));
    const check = (box: HTMLInputElement, text: string, title: string) => h("label", { class: "check", title }, box, text);
    this.element = h("div", { id: "timeline", role: "group", "aria-label": "Time" }, this.play, this.slider, this.text, this.speed,
      check(this.loop, "Loop", "Start again after the last frame"),
      check(this.smooth, "Smooth", "Show interpolated pictures between frames while playing"), this.progress);
  }

  /** Shows the frame at a position. */
  private to(position: number): void {
    this.page.change({ time: this.series.timeAt(position) });
  }

  private get position(): number {
    return this.series.positionOf(this.page.state.time ?? 0);
  }

  /** Shows the next frame, or the one before. */
  step(by: 1 | -1): void {
    this.stop();
    this.to(by > 0 ? Math.floor(this.position) + 1 : Math.ceil(this.position) - 1);
  }

  flip(name: "loop" | "smooth"): void {
    this[name].checked = !this[name].checked;
  }

  toggle(): void {
    if (this.playing) this.stop();
    else void this.run().catch((error: unknown) => this.page.say(error instanceof Error ? error.message : String(error)));
  }

  private stop(): void {
    this.setPlaying(false);
  }

  /** Stops, and waits for the last picture. */
  async pause(): Promise<void> {
    this.stop();
    await this.drawn();
  }

  private setPlaying(on: boolean): void {
    this.turn++;
    this.playing = on;
    this.page.panes.forEach((p) => (p.playing = on));
    this.play.textContent = on ? "❚❚" : "▶";
    this.play.setAttribute("aria-label", on ? "Pause" : "Play");
  }

  /** Plays at the chosen speed; a slow machine shows fewer pictures, not a slower film. */
  private async run(): Promise<void> {
    const { last } = this.series;
    if (last < 1) return;
    this.setPlaying(true);
    const turn = this.turn;
    this.playhead = this.position >= last ? 0 : this.position;
    try {
      this.to(this.playhead);
      await this.drawn();
      let before = performance.now();
      while (this.turn === turn) {
        const now = performance.now();
        this.playhead += (Math.min(now - before, 1000) / 1000) * Number(this.speed.value);
        before = now;
        if (this.playhead > last) {
          if (!this.loop.checked) {
            this.to(last);
            break;
          }
          this.playhead %= last;
        }
        const shown = this.smooth.checked ? this.playhead : Math.floor(this.playhead);
        if (this.series.timeAt(shown) !== this.page.state.time) this.to(shown);
        await this.drawn();
      }
    } finally {
      // Stopped and started again meanwhile, it plays on.
      if (this.turn === turn) this.setPlaying(false);
    }
  }

  /** Waits for the pictures, and for the screen. */
  private async drawn(): Promise<void> {
    do await new Promise(requestAnimationFrame);
    while (this.page.panes.some((p) => p.drawing));
  }

  /** Shows the state of the page and of the loading. */
  refresh(): void {
    const { series, position } = this;
    this.slider.value = String(Math.round(position));
    const moment = this.page.panes.find((p) => p.series === series)?.moment;
    const frame = position % 1 === 0 ? `frame ${series.frames[position].number}` : "between frames";
    this.text.textContent = `${frame}${moment ? `, ${moment.text}` : ""}`;
    this.slider.setAttribute("aria-valuetext", this.text.textContent);
    const loaded = series.count;
    this.progress.textContent = loaded < series.frames.length ? `${loaded} of ${series.frames.length} frames loaded` : "";
  }
}

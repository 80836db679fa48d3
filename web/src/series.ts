// The frames of a series: where they are in time and in the file, and which are loaded.

import { bytesOf, type EngineClient } from "./engine";
import type { SeriesFrame, SeriesSummary, Source } from "./protocol";

/** A series, whose frames are loaded when they are needed. Positions count the frames that are there, from 0. */
export class SeriesFrames {
  readonly frames: SeriesFrame[];
  readonly clock: string;
  /** The request for each group of frames, by the position of its keyframe. */
  private groups = new Map<number, Promise<void>>();
  private loaded: boolean[];

  /** `start` is the number of the file's first bytes that the engine has. */
  constructor(private remote: EngineClient, private model: number, private source: Source, { frames, clock }: SeriesSummary, start: number) {
    this.frames = frames;
    this.clock = clock;
    this.loaded = frames.map((f) => f.start + f.length <= start);
  }

  get last(): number {
    return this.frames.length - 1;
  }

  /** Number of frames that are loaded. */
  get count(): number {
    return this.loaded.filter((l) => l).length;
  }

  /** The time at a position, which may lie between two frames. */
  timeAt(position: number): number {
    const at = Math.max(0, Math.min(this.last, position));
    const i = Math.floor(at);
    const [before, after] = [this.frames[i].time, this.frames[Math.min(this.last, i + 1)].time];
    return at === i ? before : before + (at - i) * (after - before);
  }

  /** The position of a time; times outside the series are moved to its ends. */
  positionOf(time: number): number {
    // A link has nine digits of it.
    const same = this.frames.findIndex((f) => Math.abs(f.time - time) <= 1e-8 * Math.abs(time));
    if (same >= 0) return same;
    const next = this.frames.findIndex((f) => f.time >= time);
    if (next < 0) return this.last;
    if (next === 0) return next;
    const [before, after] = [this.frames[next - 1].time, this.frames[next].time];
    return next - 1 + (time - before) / (after - before);
  }

  /** Position of the last keyframe up to a position. */
  keyframe(position: number): number {
    let i = Math.floor(position);
    while (i > 0 && !this.frames[i].keyframe) i--;
    return i;
  }

  /** Loads what the picture at a time is made from. */
  async load(time: number): Promise<void> {
    const position = this.positionOf(time);
    const ends = [Math.floor(position), Math.ceil(position)].map((p) => this.keyframe(p));
    await Promise.all([...new Set(ends)].map((key) => this.group(key)));
  }

  /** Loads all frames in their order; `onload` is called after each group. */
  async loadAll(onload: () => void): Promise<void> {
    for (const [i, frame] of this.frames.entries()) {
      if (!frame.keyframe) continue;
      await this.group(i);
      onload();
    }
  }

  /** A keyframe and the frames up to the next, in one request. */
  private group(key: number): Promise<void> {
    const known = this.groups.get(key);
    if (known) return known;
    const request = this.request(key);
    this.groups.set(key, request);
    // It is tried again when the frames are next needed.
    request.catch(() => this.groups.delete(key));
    return request;
  }

  private async request(key: number): Promise<void> {
    const next = this.frames.findIndex((f, i) => i > key && f.keyframe);
    const end = next < 0 ? this.frames.length : next;
    const missing = Array.from({ length: end - key }, (_, i) => key + i).filter((i) => !this.loaded[i]);
    if (missing.length === 0) return;
    const [first, final] = [this.frames[missing[0]], this.frames[missing[missing.length - 1]]];
    const bytes = await bytesOf(this.source, [first.start, final.start + final.length]);
    for (const i of missing) {
      const { number, start, length } = this.frames[i];
      const own = bytes.slice(start - first.start, start - first.start + length);
      await this.remote.ask({ ask: "add-frame", model: this.model, frame: number }, own);
      this.loaded[i] = true;
    }
  }
}

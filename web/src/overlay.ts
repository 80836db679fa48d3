// Lines and words over the picture: box, axes, scale bar, the place that was asked about. Lines have a rim of the
// ground's colour and no plate: what is beneath stays visible.

import { add, axes, heightAt, projected } from "./camera";
import type { About, Bounds, Size, Vec3 } from "./protocol";
import type { State } from "./state";
import { lengthUnit, number, roundBelow } from "./units";

const AXES: [string, Vec3, string][] =
  [["x", [1, 0, 0], "#e8836b"], ["y", [0, 1, 0], "#7cc47c"], ["z", [0, 0, 1], "#7aa7e8"]];

export interface Marked { position: Vec3; sphere: number }

/** Draws over a picture of `size` pixels; `unit` is the size of a letter's em over 13 pixels. */
export function drawOverlay(
  c: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D, s: State, about: About, size: Size, unit: number,
  marked: Marked | null,
): void {
  c.clearRect(0, 0, size.width, size.height);
  c.lineJoin = c.lineCap = "round";
  c.font = `${13 * unit}px system-ui, sans-serif`;
  const ink = s.white ? "#111" : "#f4f4f4";
  const rim = s.white ? "rgb(255 255 255 / 80%)" : "rgb(0 0 0 / 70%)";
  const pen = { c, ink, rim, unit };
  if (s.box) box(pen, s, about, size);
  if (marked) mark(pen, s, marked, size);
  if (s.axes) triad(pen, s, size);
  if (s.scale) scaleBar(pen, s, about, size);
}

interface Pen {
  c: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D; ink: string; rim: string; unit: number;
}

function stroke({ c, rim, unit }: Pen, color: string, width: number, path: () => void): void {
  for (const [style, w] of [[rim, width + 2], [color, width]] as const) {
    c.strokeStyle = style;
    c.lineWidth = w * unit;
    c.beginPath();
    path();
    c.stroke();
  }
}

function say({ c, rim, unit }: Pen, color: string, text: string, x: number, y: number, align: CanvasTextAlign): void {
  c.textAlign = align;
  c.textBaseline = "middle";
  c.strokeStyle = rim;
  c.lineWidth = 3 * unit;
  c.strokeText(text, x, y);
  c.fillStyle = color;
  c.fillText(text, x, y);
}

const corner = (b: Bounds, i: number): Vec3 => [0, 1, 2].map((k) => (i & (1 << k) ? b.max[k] : b.min[k])) as Vec3;

function box(pen: Pen, s: State, about: About, size: Size): void {
  const cell = about.metadata.cell;
  const at = (i: number): Vec3 => {
    if (!cell) return corner(about.metadata.bounds, i);
    return [0, 1, 2].reduce((p, k) => (i & (1 << k) ? add(p, cell.vectors[k]) : p), cell.origin);
  };
  stroke(pen, pen.ink, 1, () => {
    for (let i = 0; i < 8; i++) {
      for (let k = 0; k < 3; k++) {
        if (i & (1 << k)) continue;
        segment(pen, s, at(i), at(i | (1 << k)), size);
      }
    }
  });
}

/** A line in the world, cut where it passes the eye. */
function segment({ c }: Pen, s: State, from: Vec3, to: Vec3, size: Size): void {
  const steps = 24;
  let drawing = false;
  for (let i = 0; i <= steps; i++) {
    const p = projected(s.orbit, add(from, add(to, from, -1), i / steps), size);
    if (p && Math.abs(p[0]) < 1e5 && Math.abs(p[1]) < 1e5) {
      if (drawing) c.lineTo(...p);
      else c.moveTo(...p);
      drawing = true;
    } else {
      drawing = false;
    }
  }
}

function triad(pen: Pen, s: State, size: Size): void {
  const { right, up, back } = axes(s.orbit);
  const long = 30 * pen.unit;
  const [x, y] = [size.width - 48 * pen.unit, size.height - 48 * pen.unit];
  const flat = AXES.map(([name, v, color]) => {
    const along = [right, up, back].map((a) => a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
    return { name, color, x: along[0], y: -along[1], near: along[2] };
  });
  for (const axis of flat.sort((a, b) => a.near - b.near)) {
    const [tx, ty] = [x + axis.x * long, y + axis.y * long];
    stroke(pen, axis.color, 2, () => {
      pen.c.moveTo(x, y);
      pen.c.lineTo(tx, ty);
    });
    const aside = Math.hypot(axis.x, axis.y) < 0.2 ? [0.4, -0.4] : [axis.x * 0.35, axis.y * 0.35];
    say(pen, axis.color, axis.name, tx + aside[0] * long, ty + aside[1] * long, "center");
  }
}

function scaleBar(pen: Pen, s: State, about: About, size: Size): void {
  const per = heightAt(s.orbit) / size.height;
  const bar = roundBelow(0.22 * size.width * per);
  const long = bar / per;
  const [x, y] = [16 * pen.unit, size.height - 18 * pen.unit];
  stroke(pen, pen.ink, 2, () => {
    pen.c.moveTo(x, y - 4 * pen.unit);
    pen.c.lineTo(x, y);
    pen.c.lineTo(x + long, y);
    pen.c.lineTo(x + long, y - 4 * pen.unit);
  });
  const where = s.orbit.orthographic ? "" : " at the centre of view";
  const unit = lengthUnit(about);
  say(pen, pen.ink, `${number(bar)}${unit ? ` ${unit}` : ""}${where}`, x, y - 15 * pen.unit, "left");
}

function mark(pen: Pen, s: State, { position, sphere }: Marked, size: Size): void {
  const p = projected(s.orbit, position, size);
  if (!p) return;
  const edge = projected(s.orbit, add(position, axes(s.orbit).right, sphere), size);
  stroke(pen, "#ffb000", 1.5, () => {
    const arm = 7 * pen.unit;
    pen.c.moveTo(p[0] - arm, p[1]);
    pen.c.lineTo(p[0] + arm, p[1]);
    pen.c.moveTo(p[0], p[1] - arm);
    pen.c.lineTo(p[0], p[1] + arm);
    const r = edge ? Math.hypot(edge[0] - p[0], edge[1] - p[1]) : 0;
    if (r > 2 && r < 1e5) {
      pen.c.moveTo(p[0] + r, p[1]);
      pen.c.arc(p[0], p[1], r, 0, 2 * Math.PI);
    }
  });
}

// Lines and text over the picture: box, circles, axes, scale bar, the marked point. Each has an outline in the background
// colour, so that it stands out without hiding the picture.

import { add, axes, heightAt, projected, projection } from "./camera";
import type { ModelSummary, Bounds, Circle, Size, Vec3 } from "./protocol";
import { clipOf, type State } from "./state";
import { lengthUnit, formatNumber, roundBelow } from "./units";

const AXES: [string, Vec3, string][] =
  [["x", [1, 0, 0], "#e8836b"], ["y", [0, 1, 0], "#7cc47c"], ["z", [0, 0, 1], "#7aa7e8"]];

/** Radius of the smallest circle that is drawn, in pixels of the screen. */
const SMALLEST = 2;

export interface Marker { position: Vec3; sphere: number }

/** A model, and what is marked in its space. */
interface OverlaySubject {
  about: ModelSummary; marker: Marker | null; circles: Circle[]; moment: { text: string; interpolated: boolean } | null;
}

/** Draws over a picture of `size` pixels; `unit` scales lines and text, which is `13 * unit` pixels high. */
export function drawOverlay(
  c: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D, s: State, { about, marker, circles, moment }: OverlaySubject,
  size: Size, unit: number,
): void {
  c.clearRect(0, 0, size.width, size.height);
  c.lineJoin = c.lineCap = "round";
  c.font = `${13 * unit}px system-ui, sans-serif`;
  const ink = s.white ? "#111" : "#f4f4f4";
  const rim = s.white ? "rgb(255 255 255 / 80%)" : "rgb(0 0 0 / 70%)";
  const context = { c, ink, rim, unit };
  if (s.box) drawBox(context, s, about, size);
  if (s.circles) drawCircles(context, s, clipOf(s, about), circles, size);
  if (marker) drawMarker(context, s, marker, size);
  if (s.axes) drawTriad(context, s, size);
  if (s.scale) drawScaleBar(context, s, about, size);
  if (moment) drawText(context, ink, moment.text + (moment.interpolated ? ", interpolated" : ""), size.width - 14 * unit, 18 * unit, "right");
}

interface OverlayContext {
  c: CanvasRenderingContext2D | OffscreenCanvasRenderingContext2D; ink: string; rim: string; unit: number;
}

function strokePath({ c, rim, unit }: OverlayContext, color: string, width: number, path: () => void): void {
  for (const [style, w] of [[rim, width + 2], [color, width]] as const) {
    c.strokeStyle = style;
    c.lineWidth = w * unit;
    c.beginPath();
    path();
    c.stroke();
  }
}

function drawText({ c, rim, unit }: OverlayContext, color: string, text: string, x: number, y: number, align: CanvasTextAlign): void {
  c.textAlign = align;
  c.textBaseline = "middle";
  c.strokeStyle = rim;
  c.lineWidth = 3 * unit;
  c.strokeText(text, x, y);
  c.fillStyle = color;
  c.fillText(text, x, y);
}

const corner = (b: Bounds, i: number): Vec3 => [0, 1, 2].map((k) => (i & (1 << k) ? b.max[k] : b.min[k])) as Vec3;

function drawBox(context: OverlayContext, s: State, about: ModelSummary, size: Size): void {
  const cell = about.metadata.cell;
  const at = (i: number): Vec3 => {
    if (!cell) return corner(about.metadata.bounds, i);
    return [0, 1, 2].reduce((p, k) => (i & (1 << k) ? add(p, cell.vectors[k]) : p), cell.origin);
  };
  strokePath(context, context.ink, 1, () => {
    for (let i = 0; i < 8; i++) {
      for (let k = 0; k < 3; k++) {
        if (i & (1 << k)) continue;
        drawSegment(context, s, at(i), at(i | (1 << k)), size);
      }
    }
  });
}

/** A line in the world; parts behind the camera are left out. */
function drawSegment({ c }: OverlayContext, s: State, from: Vec3, to: Vec3, size: Size): void {
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

/** Circles across the line of sight around the centres that are not clipped. */
function drawCircles(context: OverlayContext, s: State, clip: Bounds | null, all: Circle[], { width, height }: Size): void {
  const place = projection(s.orbit, { width, height });
  const reach = s.slab?.axis === "view" ? 0.5 * s.slab.thickness : Infinity;
  for (const [center, radius] of all) {
    if (clip && center.some((v, k) => v < clip.min[k] || v > clip.max[k])) continue;
    const placed = place(center);
    if (!placed || Math.abs(placed.above) > reach) continue;
    const [[x, y], r] = [placed.at, radius * placed.scale];
    const nearest = Math.hypot(Math.max(0, -x, x - width), Math.max(0, -y, y - height));
    const farthest = Math.hypot(Math.max(x, width - x), Math.max(y, height - y));
    if (r < SMALLEST * context.unit || nearest > r || r > farthest) continue;
    strokePath(context, context.ink, 1, () => context.c.arc(x, y, r, 0, 2 * Math.PI));
  }
}

function drawTriad(context: OverlayContext, s: State, size: Size): void {
  const { right, up, back } = axes(s.orbit);
  const long = 30 * context.unit;
  const [x, y] = [size.width - 48 * context.unit, size.height - 48 * context.unit];
  const flat = AXES.map(([name, v, color]) => {
    const along = [right, up, back].map((a) => a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
    return { name, color, x: along[0], y: -along[1], near: along[2] };
  });
  for (const axis of flat.sort((a, b) => a.near - b.near)) {
    const [tx, ty] = [x + axis.x * long, y + axis.y * long];
    strokePath(context, axis.color, 2, () => {
      context.c.moveTo(x, y);
      context.c.lineTo(tx, ty);
    });
    const aside = Math.hypot(axis.x, axis.y) < 0.2 ? [0.4, -0.4] : [axis.x * 0.35, axis.y * 0.35];
    drawText(context, axis.color, axis.name, tx + aside[0] * long, ty + aside[1] * long, "center");
  }
}

function drawScaleBar(context: OverlayContext, s: State, about: ModelSummary, size: Size): void {
  const per = heightAt(s.orbit) / size.height;
  const bar = roundBelow(0.22 * size.width * per);
  const long = bar / per;
  const [x, y] = [16 * context.unit, size.height - 18 * context.unit];
  strokePath(context, context.ink, 2, () => {
    context.c.moveTo(x, y - 4 * context.unit);
    context.c.lineTo(x, y);
    context.c.lineTo(x + long, y);
    context.c.lineTo(x + long, y - 4 * context.unit);
  });
  const where = s.orbit.orthographic ? "" : " at the centre of view";
  const unit = lengthUnit(about);
  drawText(context, context.ink, `${formatNumber(bar)}${unit ? ` ${unit}` : ""}${where}`, x, y - 15 * context.unit, "left");
}

function drawMarker(context: OverlayContext, s: State, { position, sphere }: Marker, size: Size): void {
  const p = projected(s.orbit, position, size);
  if (!p) return;
  const edge = projected(s.orbit, add(position, axes(s.orbit).right, sphere), size);
  strokePath(context, "#ffb000", 1.5, () => {
    const arm = 7 * context.unit;
    context.c.moveTo(p[0] - arm, p[1]);
    context.c.lineTo(p[0] + arm, p[1]);
    context.c.moveTo(p[0], p[1] - arm);
    context.c.lineTo(p[0], p[1] + arm);
    const r = edge ? Math.hypot(edge[0] - p[0], edge[1] - p[1]) : 0;
    if (r > 2 && r < 1e5) {
      context.c.moveTo(p[0] + r, p[1]);
      context.c.arc(p[0], p[1], r, 0, 2 * Math.PI);
    }
  });
}

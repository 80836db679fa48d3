// The camera: a position on a sphere about the focal point. Angles in degrees, lengths in world units.

import type { Bounds, Camera, Size, Vec3 } from "./protocol";

export const FOV = 30;
const RADIANS = Math.PI / 180;

export interface Orbit {
  focal: Vec3;
  /** 0 looks along -z, 90 along -x. */
  azimuth: number;
  elevation: number;
  /** Clockwise rotation of the picture. */
  roll: number;
  distance: number;
  orthographic: boolean;
}

export const add = (a: Vec3, b: Vec3, s = 1): Vec3 => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const scaled = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
const cross = (a: Vec3, b: Vec3): Vec3 =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Vec3): number => Math.hypot(...a);

export const center = (b: Bounds): Vec3 => scaled(add(b.min, b.max), 0.5);

/** Right, up and back (towards the camera) in the world. */
export function axes(o: Orbit): { right: Vec3; up: Vec3; back: Vec3 } {
  const [a, e, r] = [o.azimuth * RADIANS, o.elevation * RADIANS, o.roll * RADIANS];
  const back: Vec3 = [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
  const level: Vec3 = [-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)];
  const aside = cross(level, back);
  const up = add(scaled(level, Math.cos(r)), aside, Math.sin(r));
  return { right: cross(up, back), up, back };
}

/** The picture's height at the focal point, in world units. */
export const heightAt = (o: Orbit): number => 2 * o.distance * Math.tan(0.5 * FOV * RADIANS);

/** The distance that gives this height. */
export const distanceOf = (height: number): number => height / (2 * Math.tan(0.5 * FOV * RADIANS));

/**
 * The camera; `slab` is a thickness about the focal point, along the line of sight. An orthographic camera is `reach`
 * away, outside everything, because its distance does not set the scale.
 */
export function cameraOf(o: Orbit, slab: number | null, reach: number): Camera {
  const { up, back } = axes(o);
  const distance = o.orthographic ? reach : o.distance;
  const camera: Camera = { position: add(o.focal, back, distance), focal_point: o.focal, view_up: up };
  if (o.orthographic) camera.height_world = heightAt(o);
  else camera.fov_deg = FOV;
  if (slab !== null) {
    const least = 1e-6 * distance;
    camera.clipping_range = [Math.max(least, distance - 0.5 * slab), Math.max(2 * least, distance + 0.5 * slab)];
  }
  return camera;
}

/** The orbit of a camera from a views file. */
export function orbitOf(c: Camera): Orbit {
  const from = add(c.position, c.focal_point, -1);
  const distance = length(from) || 1;
  const back = scaled(from, 1 / distance);
  const elevation = Math.asin(Math.max(-1, Math.min(1, back[1]))) / RADIANS;
  const azimuth = Math.atan2(back[0], back[2]) / RADIANS;
  const orbit: Orbit = { focal: c.focal_point, azimuth, elevation, roll: 0, distance, orthographic: false };
  const { right, up } = axes(orbit);
  orbit.roll = Math.atan2(dot(c.view_up, right), dot(c.view_up, up)) / RADIANS;
  if (c.height_world !== undefined) {
    orbit.orthographic = true;
    orbit.distance = distanceOf(c.height_world);
  }
  return orbit;
}

/** The orbit for a picture of another aspect ratio, so that an orthographic view shows at least as much. */
export function asWide(o: Orbit, from: Size, to: Size): Orbit {
  const wider = (from.width * to.height) / (from.height * to.width);
  return o.orthographic ? { ...o, distance: o.distance * Math.max(1, wider) } : o;
}

/** Rotates by a drag in pixels; the picture's height is half a turn. */
export function turned(o: Orbit, dx: number, dy: number, size: Size): Orbit {
  const per = 180 / size.height;
  const azimuth = ((((o.azimuth - dx * per + 180) % 360) + 360) % 360) - 180;
  return { ...o, azimuth, elevation: Math.max(-90, Math.min(90, o.elevation + dy * per)) };
}

/** Pans by a drag in pixels. */
export function panned(o: Orbit, dx: number, dy: number, size: Size): Orbit {
  const { right, up } = axes(o);
  const per = heightAt(o) / size.height;
  return { ...o, focal: add(add(o.focal, right, -dx * per), up, dy * per) };
}

/** Scales the distance by `factor`; the point of the focal plane at `pixel` stays there. */
export function zoomed(o: Orbit, factor: number, pixel: [number, number], size: Size): Orbit {
  const { right, up } = axes(o);
  const per = heightAt(o) / size.height;
  const [x, y] = [(pixel[0] - 0.5 * size.width) * per, (0.5 * size.height - pixel[1]) * per];
  const at = add(add(o.focal, right, x), up, y);
  return { ...o, distance: o.distance * factor, focal: add(at, add(o.focal, at, -1), factor) };
}

/**
 * Places world points in the picture: in pixels, with the pixels of a unit of length there and the height above the focal
 * plane; `null` behind the camera.
 */
export function projection(o: Orbit, size: Size): (p: Vec3) => { at: [number, number]; scale: number; above: number } | null {
  const { right, up, back } = axes(o);
  return (p) => {
    const d = add(p, o.focal, -1);
    const above = dot(d, back);
    const depth = o.orthographic ? o.distance : o.distance - above;
    if (depth <= 1e-6 * o.distance) return null;
    const scale = (size.height / heightAt(o)) * (o.distance / depth);
    return { at: [0.5 * size.width + dot(d, right) * scale, 0.5 * size.height - dot(d, up) * scale], scale, above };
  };
}

/** A world point in the picture, in pixels; `null` behind the camera. */
export const projected = (o: Orbit, p: Vec3, size: Size): [number, number] | null => projection(o, size)(p)?.at ?? null;

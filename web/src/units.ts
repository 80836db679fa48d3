// Numbers as journals print them, and the unit of length.

import type { ModelSummary } from "./protocol";

const RAISED: Record<string, string> = {
  "-": "⁻", "0": "⁰", "1": "¹", "2": "²", "3": "³", "4": "⁴", "5": "⁵", "6": "⁶", "7": "⁷", "8": "⁸", "9": "⁹",
};

/** A number with `figures` digits; large and small ones with a power of ten. */
export function formatNumber(v: number, figures = 3): string {
  if (!Number.isFinite(v)) return "–";
  if (v === 0) return "0";
  const e = Math.floor(Math.log10(Math.abs(v)));
  if (e >= -3 && e < 5) return minus(String(Number(v.toPrecision(figures))));
  const front = Number((v / 10 ** e).toPrecision(figures));
  const power = [...String(e)].map((c) => RAISED[c]).join("");
  return front === 1 ? `10${power}` : `${minus(String(front))} × 10${power}`;
}

const minus = (text: string): string => text.replace("-", "−");

/** A whole number with thin spaces between thousands. */
export const formatWhole = (v: number): string => Math.round(v).toString().replace(/\B(?=(\d{3})+$)/g, "\u2009");

/** A size in B, kB, MB, GB or TB. */
export function formatBytes(n: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  const e = Math.min(units.length - 1, Math.max(0, Math.floor(Math.log10(Math.max(1, n)) / 3)));
  return `${formatNumber(n / 1000 ** e)} ${units[e]}`;
}

/** The unit of length; empty if unknown. */
export const lengthUnit = ({ units, metadata }: ModelSummary): string =>
  units.length && metadata.comoving ? `comoving ${units.length}` : units.length;

/** The largest of 1, 2 or 5 times a power of ten that is at most `v`. */
export function roundBelow(v: number): number {
  const base = 10 ** Math.floor(Math.log10(v));
  return (v >= 5 * base ? 5 : v >= 2 * base ? 2 : 1) * base;
}

/** Ticks of an even axis, at most six intervals of 1, 2 or 5 times a power of ten, and their labels. */
export function evenTicks(lo: number, hi: number): [number, string][] {
  const least = (hi - lo) / 6;
  const power = 10 ** Math.floor(Math.log10(least));
  const step = power * ([1, 2, 5].find((f) => f * power >= least) ?? 10);
  const figures = Math.ceil(Math.log10(Math.max(Math.abs(lo), Math.abs(hi)) / step)) + 1;
  const first = Math.ceil(lo / step - 1e-9);
  const count = Math.floor(hi / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, i) => (first + i) * step)
    .map((v) => [v, formatNumber(v, Math.max(1, Math.min(15, figures)))]);
}

/** Ticks of a logarithmic axis. */
export function logTicks(lo: number, hi: number): number[] {
  const fronts = Math.log10(hi / lo) > 2.5 ? [1] : [1, 2, 5];
  const found: number[] = [];
  for (let d = Math.floor(Math.log10(lo)); d <= Math.ceil(Math.log10(hi)); d++) {
    for (const f of fronts) {
      const v = f * 10 ** d;
      if (v >= lo * (1 - 1e-9) && v <= hi * (1 + 1e-9)) found.push(v);
    }
  }
  return found.length >= 2 ? found : [lo, hi];
}

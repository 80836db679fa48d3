// Text about a model and its certificate.

import { h } from "./dom";
import type { Pane } from "./pane";
import type { ModelSummary, ProbeHit, Verdict } from "./protocol";
import type { SeriesFrames } from "./series";
import { formatBytes, lengthUnit, formatNumber, formatWhole } from "./units";

/** Particles, Gaussians, size, ratio; of a series its frames and size. */
export function summaryLine(about: ModelSummary, size: number, series: SeriesFrames | null): string {
  const m = about.metadata;
  if (series) return `${formatWhole(series.frames.length)} frames of ${formatWhole(m.count)} particles, ${formatBytes(size)}`;
  return `${formatWhole(m.count)} particles, ${formatWhole(about.gaussians)} Gaussians, ${formatBytes(size)}, ratio ${formatNumber(about.raw_bytes / size)}`;
}

/** A table of the model's properties, and the certificate's verdict. */
export function summaryTable({ name, about, series }: Pane, size: number, verdict: Verdict[] | undefined, named: boolean): HTMLElement {
  const m = about.metadata;
  const u = about.units;
  const extent = m.bounds.max.map((v, k) => formatNumber(v - m.bounds.min[k])).join(" × ");
  const rows: [string, string][] = [
    ["Model", name], ["Source", m.source], ["Particles", formatWhole(m.count)], ["Gaussians", formatWhole(about.gaussians)],
    ["Size", formatBytes(size)], ["Extent", `${extent} ${lengthUnit(about).replaceAll(" ", "\u00a0")}`],
  ];
  if (series) rows.splice(1, 1, ["Frames", `${series.frames.length}, ${series.frames[0].text} to ${series.frames[series.last].text}`]);
  if (about.mass !== null) rows.push(["Mass", `${formatNumber(about.mass, 4)} ${u.mass}`]);
  if (about.fields.length > 0) rows.push(["Fields", about.fields.map((f) => (f.unit ? `${f.name} (${f.unit})` : f.name)).join(", ")]);
  if (m.scale_factor !== null && !series) rows.push(["Redshift", formatNumber(1 / m.scale_factor - 1)]);
  if (m.time !== null && !series) rows.push(["Time", formatNumber(m.time)]);
  rows.push(["Law", m.law.replaceAll("_", " ")], ["Made by", `particlegs ${m.tool_version}`]);
  const table = h("table", {}, ...rows.map(([k, v]) => h("tr", {}, h("th", { scope: "row", text: k }), h("td", { text: v }))));
  return h("details", { class: "facts" }, h("summary", { text: named ? `${name}: model and certificate` : "Model and certificate" }), table, series ? h("p", { class: "hint", text: "Numbers are those of the first frame. `particlegs info` lists what was measured of each frame." }) : verdicts(verdict));
}

function verdicts(verdict: Verdict[] | undefined): HTMLElement {
  if (!verdict || verdict.length === 0) return h("p", { class: "hint", text: "This file has no certificate, so its accuracy was not measured." });
  const mark: Record<string, string> = { good: "✓", fair: "≈", poor: "✗" };
  return h("ul", { class: "verdict" }, ...verdict.map((v) =>
    h("li", {},
      h("b", { text: `${mark[v.word] ?? "·"} ${v.use.replaceAll("_", " ")}` }), `: ${v.word}`, h("small", { text: v.why }))));
}

/** Describes the point under the pointer. */
export function probeText(seen: ProbeHit, about: ModelSummary): string {
  const [u, length] = [about.units, lengthUnit(about)];
  const at = seen.position.map((v) => formatNumber(v, 4)).join(", ");
  const density = seen.density !== null ? `${formatNumber(seen.density)} ${u.density}` : `${formatNumber(seen.number_density)} ${u.number}`;
  const layer = about.layers.length > 1 ? `, layer ${seen.layer}` : "";
  return `at (${at})${length ? ` ${length}` : ""}${layer}: density ${density}; Gaussian #${seen.gaussian} with ${formatWhole(seen.count)} particles`;
}

/** Describes each field at a point. */
export function probeFieldsTexts(seen: ProbeHit, about: ModelSummary): string[] {
  return seen.fields.map(({ name, mean, dispersion }) => {
    if (mean.length === 0) return `${name}: no values here`;
    const units = about.fields.find((f) => f.name === name)?.place_units ?? ["", ""];
    const of = (values: number[], unit: string) => {
      const [x, y, z, sight] = values.map((v) => formatNumber(v));
      return `${y === undefined ? x : `(${x}, ${y}, ${z}), along the line of sight ${sight}`}${unit ? ` ${unit}` : ""}`;
    };
    if (dispersion.length === 0) return `${name}: ${of(mean, units[0])}`;
    return `${name}: mean ${of(mean, units[0])}; dispersion ${of(dispersion, units[1])}`;
  });
}

//! Output of `info` for a model file, and its certificate as a table.

use crate::common::CommandContext;
use crate::info_snapshot::{self, point};
use crate::report::{counted, wrapped};
use particlegs_core::codec::{BlockInfo, FileInfo};
use particlegs_core::context::Context;
use particlegs_core::model::{
    AlphaBlend, Certificate, CertificateLevel, Effort, GoalResult, LawKind, Layer, Metadata, MetricEntry, MetricGroup,
    MetricValue, Quantity, SharedSpecies, VIZMAPPER_SHAPE, VizMapper, VizRanges, hex,
};
use particlegs_core::space::Cell;
use particlegs_core::text::one_line;
use particlegs_core::{Result, codec};
use particlegs_figure::number;
use particlegs_files::input::name_of;
use particlegs_measure::score::{Assessment, Grade, UseCase};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

#[derive(Serialize)]
struct ModelInfoReport<'a> {
    format_version: String,
    model_bytes: u64,
    missing: Option<String>,
    lacking_fields: &'a [String],
    other_sections: &'a [(String, u64)],
    raw_bytes: u64,
    compression_ratio: f64,
    gaussians: u64,
    bytes_per_gaussian: f64,
    metadata: Value,
    layers: Vec<Value>,
    vizmapper: Option<Value>,
    published_bytes: u64,
    certificate: Option<&'a Certificate>,
    verdict: Vec<Assessment>,
}

pub fn print(context: &CommandContext, path: &Path, bytes: &[u8]) -> Result<()> {
    print_info(context, &codec::read_info(bytes, &name_of(path))?)
}

fn layer_report(layer: &Layer<Vec<BlockInfo>>, shared: &[SharedSpecies]) -> Value {
    let Layer { name, mass, content } = layer;
    let mut report =
        json!({ "name": name, "particle_mass": mass.unit(), "weighted": mass.is_weighted(), "blocks": content });
    if SharedSpecies::share_layer(shared, name) {
        report["species"] = json!(shared);
    }
    report
}

/// The same of what was read.
pub fn print_info(context: &CommandContext, info: &FileInfo) -> Result<()> {
    let gaussians = info.gaussians() as u64;
    let quantities = info.metadata.quantities(info.layers.iter().any(|l| l.mass.is_weighted()));
    let report = ModelInfoReport {
        format_version: format!("{}.{}", info.version[0], info.version[1]),
        model_bytes: info.bytes,
        missing: info.missing(),
        lacking_fields: &info.lacking_fields,
        other_sections: &info.other_sections,
        raw_bytes: info.raw_bytes(),
        compression_ratio: info.compression_ratio(),
        gaussians,
        bytes_per_gaussian: info.bytes as f64 / gaussians as f64,
        metadata: metadata(&info.metadata, &quantities),
        layers: info.layers.iter().map(|l| layer_report(l, &info.metadata.shared_species)).collect(),
        vizmapper: info.vizmapper.as_ref().map(network),
        published_bytes: gaussians * AlphaBlend::PLY_BYTES,
        certificate: info.certificate.as_ref(),
        verdict: Assessment::verdict(info.certificate.as_ref(), &info.metadata),
    };
    context.finish(&text(info, &report, &quantities), &report)
}

fn network(n: &VizMapper) -> Value {
    json!({
        "shape": VIZMAPPER_SHAPE, "parameters": n.parameters.len(), "ranges": n.ranges,
        "bytes": codec::VIZMAPPER_SECTION_BYTES,
    })
}

fn metadata(m: &Metadata, quantities: &[Quantity]) -> Value {
    let mut report = json!({
        "law": m.law.name(), "particles": m.count, "mass": m.mass, "bounds": m.bounds, "cell": m.cell,
        "default_radius": m.default_radius, "default_opacity": m.default_opacity, "source": m.source,
        "source_blake3": hex(&m.source_hash), "redshift": m.epoch.redshift(), "weighting": Metadata::WEIGHTING,
        "kept": quantities, "command": m.recipe.to_string(), "tool_version": m.tool_version,
        "effort": m.recipe.fitted().map(Effort::name),
    });
    m.weight_name().iter().for_each(|name| report["weight_name"] = (*name).into());
    for more in [json!(m.units), json!(m.cosmology), json!(m.epoch)] {
        report.as_object_mut().into_iter().for_each(|r| r.extend(more.as_object().cloned().unwrap_or_default()));
    }
    report
}

fn text(info: &FileInfo, r: &ModelInfoReport<'_>, quantities: &[Quantity]) -> String {
    let m = &info.metadata;
    let mut out = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "{}", wrapped(&format!("{name:<18} "), &one_line(&value), 19));
    };
    row("format", format!("{}, image law {}", r.format_version, m.law.name()));
    row("size", format!("{} bytes, {} to {} raw bytes", r.model_bytes, info.describe_ratio(), r.raw_bytes));
    r.missing.iter().chain(r.lacking_fields).for_each(|gap| row("incomplete", gap.clone()));
    row("Gaussians", format!("{}, {:.3} bytes each", r.gaussians, r.bytes_per_gaussian));
    // Splats have no fields.
    let raw_bytes = r.raw_bytes - info.raw_field_bytes();
    let (bytes, each, ratio) = (r.published_bytes, AlphaBlend::PLY_BYTES, raw_bytes as f64 / r.published_bytes as f64);
    row("as published", format!("{bytes} bytes as PLY, {each} per Gaussian, ratio {ratio:.1}"));
    match &info.vizmapper {
        Some(VizMapper { parameters, ranges: VizRanges { scale, opacity, floor }, .. }) => {
            let (shape, bytes) = (VIZMAPPER_SHAPE.map(|n| n.to_string()).join(", "), codec::VIZMAPPER_SECTION_BYTES);
            let network = format!("layers of {shape} values, {} parameters in {bytes} bytes", parameters.len());
            let ranges = format!("scale within {scale}, opacity within {opacity}, its factor at least {floor}");
            row("VizMapper", format!("{network}; {ranges}"));
        }
        None if m.law == LawKind::AlphaBlend => row("VizMapper", "none: trained without".into()),
        None => {}
    }
    row("particles", m.count.to_string());
    let weight_words = m.weight_name().map_or_else(String::new, |name| format!(" of `{name}`"));
    row("weights", format!("{}{weight_words} in total (1 per particle in layers without weights)", m.mass));
    row("bounds", format!("{} to {}", point(m.bounds.min), point(m.bounds.max)));
    row("cell", m.cell.as_ref().map_or_else(|| "none stated".into(), Cell::to_string));
    row("default radius", number(m.default_radius));
    row("default opacity", format!("{}", m.default_opacity));
    row("source", m.source.to_string());
    row("source BLAKE3", hex(&m.source_hash));
    row("unit of length", info_snapshot::length(&m.units));
    info_snapshot::moment(&m.units, &m.cosmology, &m.epoch).into_iter().for_each(|(name, value)| row(name, value));
    row("raw data", quantities.iter().map(quantity).collect::<Vec<_>>().join("; "));
    for (field, line) in m.fields.iter().zip(info.describe_fields()) {
        let by = if field.by_mass { "mass" } else { "count" };
        row("field", format!("{line}; {}, weighted by {by}", field.describe_kind()));
    }
    row("weighting", format!("by {}: means and shapes of Gaussians weigh all particles alike", Metadata::WEIGHTING));
    row("command", m.recipe.to_string());
    row("made by", format!("particlegs {}", m.tool_version));
    m.recipe.fitted().iter().for_each(|effort| row("fitted with", format!("effort {}", effort.name())));
    let weight = m.weight_name().map_or_else(|| "mass".to_string(), |name| format!("`{name}`"));
    for layer in &info.layers {
        let count: u64 = layer.content.iter().map(|b| b.count).sum();
        let mass = match (layer.mass.is_weighted(), layer.mass.unit()) {
            (true, _) => format!("each with its own {weight}"),
            (false, Some(m)) => format!("of {weight} {m} each"),
            (false, None) => "mass not stated".to_string(),
        };
        let blocks = counted(layer.content.len(), "block");
        let shared = Some(&m.shared_species).filter(|s| SharedSpecies::share_layer(s, &layer.name));
        // Each of the species has its mass in a line below.
        let mass = if shared.is_some() { "which share Gaussians".into() } else { mass };
        row("layer", format!("`{}`: {count} particles, {mass}, {blocks}", layer.name));
        for SharedSpecies { name, count, mass } in shared.into_iter().flatten() {
            let mass = mass.map_or("mass not stated".into(), |m| format!("of {weight} {m} each"));
            row("  species", format!("`{name}`: {count} particles, {mass}"));
        }
        if shared.is_some() {
            let each = info.share_bytes as f64 / info.gaussians().max(1) as f64;
            row("  shares", format!("{} bytes, {each:.2} per Gaussian", info.share_bytes));
        }
        for b in &layer.content {
            let BlockInfo { count, gaussians, bytes, .. } = b;
            let each = b.bytes as f64 / f64::from(b.gaussians);
            let place = format!("{} to {}", point(b.bounds.min), point(b.bounds.max));
            row(
                "  block",
                format!("{count} particles, {gaussians} Gaussians, {bytes} bytes ({each:.3} each), {place}"),
            );
            let p = &b.precision;
            let steps = format!(
                "position {:.4} radii, ln size {:.4}, shape {:.4}, ln count {:.4}, importance {:.2}",
                p.position, p.size, p.shape, p.count, p.importance
            );
            row("  steps", steps);
        }
    }
    for (tag, bytes) in r.other_sections {
        row("other section", format!("`{tag}`, {bytes} bytes: unknown to this program"));
    }
    out.push_str(&certificate(r.certificate, m.units.length_text()));
    out.push_str(&verdict(&r.verdict));
    out.trim_end().to_string()
}

fn quantity(q: &Quantity) -> String {
    let unit = q.unit.as_ref().map_or(String::new(), |u| format!(", {}", u.text));
    format!("{} ({}{unit}, {} bytes per particle)", q.name, q.kind.name(), q.bytes)
}

pub fn certificate(c: Option<&Certificate>, unit: Option<&str>) -> String {
    let Some(c) = c else { return "certificate        none\n".into() };
    let mut out = "certificate        measured at encoding (-: not measured, or none)\n".to_string();
    let mut line = |text: &str| out += &(wrapped("  ", text, 6) + "\n");
    if let Some(goal) = &c.goal {
        line(&describe_goal(goal, unit));
    }
    // The goal is in the line above.
    for (group, entries) in c.groups().into_iter().filter(|(group, _)| group.tag != MetricGroup::GOAL) {
        match entries {
            Some(entries) => {
                line(&group.describe(&entries, unit));
                tables(&entries, unit).iter().for_each(|text| line(text));
            }
            None if group.levels == [CertificateLevel::Full] => {
                line(&format!("{}: not measured (--certificate full)", group.words));
            }
            None if group.levels.contains(&CertificateLevel::Full) => line(&format!("{}: not measured", group.words)),
            None => {}
        }
    }
    out
}

pub fn describe_goal(goal: &GoalResult, unit: Option<&str>) -> String {
    format!("asked for: {}", goal.describe(unit))
}

/// Rows of numbers: one table for rows with the same columns; single numbers share a line.
fn tables(entries: &[MetricEntry], unit: Option<&str>) -> Vec<String> {
    type MetricRows<'a> = Vec<&'a [MetricEntry]>;
    let mut tables: Vec<MetricRows<'_>> = Vec::new();
    let names = |row: &[MetricEntry]| row.iter().map(|e| e.metric.name).collect::<Vec<_>>();
    // Entries without a row are in the sentence of their group.
    for row in entries.chunk_by(|a, b| a.row == b.row).filter(|row| !row[0].row.is_empty()) {
        match tables.iter_mut().find(|rows| names(rows[0]) == names(row)) {
            Some(rows) => rows.push(row),
            None => tables.push(vec![row]),
        }
    }
    let cell = |e: &MetricEntry| match e.value {
        MetricValue::None => "-".into(),
        MetricValue::Score(s) => format!("{} {:.4}", s.masked_psnr.map_or("-".into(), |v| format!("{v:.2}")), s.ssim),
        value => e.metric.describe(value, unit),
    };
    let mut lines = Vec::new();
    for rows in tables {
        if let [one] = names(rows[0])[..] {
            let all: Vec<String> = rows.iter().map(|row| format!("{} {}", row[0].row, cell(&row[0]))).collect();
            lines.push(format!("{one}: {}", all.join(", ")));
            continue;
        }
        let line = |first: &str, rest: Vec<String>| [vec![first.to_string()], rest].concat();
        let mut text = vec![line("", names(rows[0]).into_iter().map(String::from).collect())];
        text.extend(rows.iter().map(|row| line(&row[0].row, row.iter().map(cell).collect())));
        let width = |column: usize| text.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..text[0].len()).map(width).collect();
        lines.extend(text.iter().map(|row| {
            let rest = row.iter().zip(&widths).skip(1).map(|(cell, w)| format!("  {cell:>w$}"));
            format!("{:<w$}{}", row[0], rest.collect::<String>(), w = widths[0])
        }));
    }
    lines
}

pub fn verdict(findings: &[Assessment]) -> String {
    let mut out = "verdict            what the model is good for (docs/guide/certificate.md)\n".to_string();
    for f in findings {
        out += &(wrapped(&format!("  {:<15} {:<14} ", f.of.name(), f.word.name()), &f.why, 33) + "\n");
    }
    out
}

/// The verdict on a model that was just written, in at most nine lines, and as data. Warns about a poor model, whose
/// pictures or density do not clearly beat trivial ones.
pub fn describe_new_model<T>(
    c: Option<&Certificate>,
    metadata: &Metadata,
    layers: &[Layer<T>],
    place: &Path,
    context: &Context<'_>,
) -> (String, Vec<Assessment>) {
    let v = Assessment::verdict(c, metadata);
    let poor = |f: &&Assessment| matches!(f.of, UseCase::Pictures | UseCase::Density) && f.word == Grade::Poor;
    let poor: Vec<String> = v.iter().filter(poor).map(|f| format!("{}: {}", f.of.name(), f.figure())).collect();
    if !poor.is_empty() {
        context.message(&format!("warning: the model shows little of these particles: {}", poor.join("; ")));
        context.message(
            "hint: for clustered particles a larger file helps, such as half the ratio; liquids and crystals are not \
             shown well at any ratio (docs/guide/certificate.md)",
        );
    }
    let differing = c.map_or_else(Vec::new, |c| c.differing_layers(layers, metadata.units.length_text()));
    differing.iter().for_each(|difference| context.message(&format!("warning: {difference}")));
    let short = if c.is_some() { brief(&v) } else { String::new() };
    (format!("{short}\nparticlegs info {} shows the rest", place.display()), v)
}

/// One line per use; uses that were not measured for the same reason share a line.
fn brief(findings: &[Assessment]) -> String {
    let (missing, judged): (Vec<_>, Vec<_>) = findings.iter().partition(|f| f.word == Grade::NotMeasured);
    let mut lines: Vec<[String; 3]> =
        judged.iter().map(|f| [f.of.name(), f.word.name(), f.figure()].map(String::from)).collect();
    for why in missing.iter().map(|f| f.figure()).collect::<BTreeSet<_>>() {
        let uses: Vec<&str> = missing.iter().filter(|f| f.figure() == why).map(|f| f.of.name()).collect();
        lines.push([Grade::NotMeasured.name().into(), String::new(), format!("{}: {why}", uses.join(", "))]);
    }
    lines.iter().map(|[name, word, why]| format!("\n  {name:<15} {word:<14} {why}")).collect()
}

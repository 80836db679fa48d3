//! What `info` prints about a model file, and its certificate as a table.

use crate::common::Context;
use particlegs::codec::{self, FileInfo, LayerInfo};
use particlegs::model::{Certificate, Law, LookScore, Metadata, VIZMAPPER_SHAPE, VizMapper, VizRanges};
use particlegs::picture::number;
use particlegs::{Error, Result};
use particlegs_formats::SPLAT_PLY_BYTES;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// The result.
#[derive(Serialize)]
struct Report<'a> {
    format_version: String,
    model_bytes: u64,
    raw_bytes: u64,
    compression_ratio: f64,
    gaussians: u64,
    bytes_per_gaussian: f64,
    metadata: MetadataReport<'a>,
    layers: &'a [LayerInfo],
    vizmapper: Option<NetworkReport>,
    published_bytes: u64,
    certificate: Option<&'a Certificate>,
}

/// The network of an alpha-blend model.
#[derive(Serialize)]
struct NetworkReport {
    shape: [usize; 4],
    parameters: usize,
    ranges: VizRanges,
    bytes: usize,
}

#[derive(Serialize)]
struct MetadataReport<'a> {
    law: &'static str,
    particles: u64,
    mass: f64,
    bounds: particlegs::particles::Bounds,
    cell: Option<particlegs::particles::Cell>,
    default_radius: f64,
    default_opacity: f64,
    source: &'a str,
    source_blake3: String,
    length_unit: Option<&'a str>,
    mass_unit: Option<&'a str>,
    comoving: Option<bool>,
    scale_factor: Option<f64>,
    redshift: Option<f64>,
    hubble: Option<f64>,
    time: Option<f64>,
    command: &'a str,
    tool_version: &'a str,
}

/// Prints what the file says.
pub fn print(context: &Context, path: &Path) -> Result<()> {
    let info = codec::read_info(&read(path)?, &path.display().to_string())?;
    print_info(context, &info)
}

/// A model file's bytes.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::io(path, e))
}

fn print_info(context: &Context, info: &FileInfo) -> Result<()> {
    let gaussians: u64 = info.layers.iter().flat_map(|l| &l.blocks).map(|b| u64::from(b.gaussians)).sum();
    let layer_bytes = |l: &LayerInfo| {
        let count = l.blocks.iter().fold(0u64, |sum, b| sum.saturating_add(b.count));
        count.saturating_mul(if l.weighted { 16 } else { 12 })
    };
    let raw_bytes = info.layers.iter().map(layer_bytes).fold(0, u64::saturating_add);
    let report = Report {
        format_version: format!("{}.{}", info.version[0], info.version[1]),
        model_bytes: info.bytes,
        raw_bytes,
        compression_ratio: raw_bytes as f64 / info.bytes as f64,
        gaussians,
        bytes_per_gaussian: info.bytes as f64 / gaussians as f64,
        metadata: metadata(&info.metadata),
        layers: &info.layers,
        vizmapper: info.vizmapper.as_ref().map(network),
        published_bytes: gaussians * SPLAT_PLY_BYTES,
        certificate: info.certificate.as_ref(),
    };
    context.finish(&text(&report), &report)
}

fn network(n: &VizMapper) -> NetworkReport {
    NetworkReport {
        shape: VIZMAPPER_SHAPE,
        parameters: n.parameters.len(),
        ranges: n.ranges,
        bytes: codec::VIZMAPPER_SECTION_BYTES,
    }
}

fn metadata(m: &Metadata) -> MetadataReport<'_> {
    MetadataReport {
        law: m.law.name(),
        particles: m.count,
        mass: m.mass,
        bounds: m.bounds,
        cell: m.cell,
        default_radius: m.default_radius,
        default_opacity: m.default_opacity,
        source: &m.source,
        source_blake3: particlegs::particles::hex(&m.source_hash),
        length_unit: m.length_unit.as_deref(),
        mass_unit: m.mass_unit.as_deref(),
        comoving: m.comoving,
        scale_factor: m.scale_factor,
        redshift: m.redshift(),
        hubble: m.hubble,
        time: m.time,
        command: &m.command,
        tool_version: &m.tool_version,
    }
}

fn text(r: &Report<'_>) -> String {
    let m = &r.metadata;
    let mut out = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "{name:<18} {value}");
    };
    row("format", format!("{}, image law {}", r.format_version, m.law));
    row("size", format!("{} bytes, ratio {:.1} to {} raw bytes", r.model_bytes, r.compression_ratio, r.raw_bytes));
    row("Gaussians", format!("{}, {:.3} bytes each", r.gaussians, r.bytes_per_gaussian));
    row(
        "as published",
        format!(
            "{} bytes as PLY, {SPLAT_PLY_BYTES} a Gaussian, ratio {:.1}",
            r.published_bytes,
            r.raw_bytes as f64 / r.published_bytes as f64
        ),
    );
    match &r.vizmapper {
        Some(n) => row(
            "VizMapper",
            format!(
                "{:?}, {} parameters in {} bytes; scale within {}, opacity within {}, its factor at least {}",
                n.shape, n.parameters, n.bytes, n.ranges.scale, n.ranges.opacity, n.ranges.floor
            ),
        ),
        None if m.law == Law::AlphaBlend.name() => row("VizMapper", "none: trained without".into()),
        None => {}
    }
    row("particles", m.particles.to_string());
    row("weights", format!("{} in all (1 a particle where a layer has none)", m.mass));
    row("bounds", format!("{:?} to {:?}", m.bounds.min, m.bounds.max));
    row("cell", cell(m));
    row("default radius", number(m.default_radius));
    row("default opacity", format!("{}", m.default_opacity));
    row("source", m.source.to_string());
    row("source BLAKE3", m.source_blake3.clone());
    row("unit of length", said(m.length_unit));
    row("unit of mass", said(m.mass_unit));
    row("comoving", said(m.comoving));
    row("scale factor", said(m.scale_factor));
    row("redshift", said(m.redshift));
    row("h", said(m.hubble));
    row("time", said(m.time));
    row("command", m.command.to_string());
    row("made by", format!("particlegs {}", m.tool_version));
    for layer in r.layers {
        let count: u64 = layer.blocks.iter().map(|b| b.count).sum();
        let mass = match (layer.weighted, layer.particle_mass) {
            (true, _) => "each with a mass of its own".to_string(),
            (false, Some(m)) => format!("of mass {m} each"),
            (false, None) => "mass not stated".to_string(),
        };
        let blocks = layer.blocks.len();
        row("layer", format!("`{}`: {count} particles, {mass}, {blocks} block(s)", layer.name));
        for b in &layer.blocks {
            let each = b.bytes as f64 / f64::from(b.gaussians);
            let place = format!("{:?} to {:?}", b.bounds.min, b.bounds.max);
            row(
                "  block",
                format!(
                    "{} particles, {} Gaussians, {} bytes ({each:.3} each), {place}",
                    b.count, b.gaussians, b.bytes
                ),
            );
            let p = &b.precision;
            let steps = format!(
                "position {:.4} radii, ln size {:.4}, shape {:.4}, ln count {:.4}, importance {:.2}",
                p.position, p.size, p.shape, p.count, p.importance
            );
            row("  steps", steps);
        }
    }
    out.push_str(&certificate(r.certificate, m.length_unit));
    out.trim_end().to_string()
}

fn cell(m: &MetadataReport<'_>) -> String {
    let Some(c) = &m.cell else { return "none stated".into() };
    let axes: String = ["x", "y", "z"].iter().zip(c.periodic).filter(|a| a.1).map(|a| *a.0).collect();
    let periodic = if axes.is_empty() { "not periodic".into() } else { format!("periodic in {axes}") };
    match c.lengths() {
        Some([x, y, z]) => format!("{x} x {y} x {z}, {periodic}"),
        None => format!("{:?}, {periodic}", c.vectors),
    }
}

fn said(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "not stated".into(), |v| v.to_string())
}

/// The certificate as a table, and what statistics said in words. `unit` is the unit of length.
pub fn certificate(c: Option<&Certificate>, unit: Option<&str>) -> String {
    let Some(c) = c else { return "certificate        none\n".into() };
    let mut out = format!(
        "certificate        measured at encoding: {} x {}, one frame an orbit, seed {}\n  {:<6} {:<17} {:>22} {:>20}\n",
        c.width, c.height, c.seed, "orbit", "look", "masked PSNR (noise-free)", "SSIM (noise-free)"
    );
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.orbits) {
        let looks = [
            ("paraview", &orbit.paraview),
            ("paraview-no-fxaa", &orbit.paraview_no_fxaa),
            ("expected", &orbit.expected),
        ];
        for (look, score) in looks {
            let _ = writeln!(out, "  {name:<6} {look:<17} {}", scores(score));
        }
    }
    let _ = writeln!(
        out,
        "  density on a grid of {} cells: correlation {:.5}, mean absolute error of the contrast {:.4}",
        c.grid, c.density_correlation, c.density_mae
    );
    match &c.science {
        Some(science) => science.in_words(unit).iter().for_each(|words| {
            let _ = writeln!(out, "  {words}");
        }),
        None => out.push_str("  power spectrum, cross-correlation, groups: not measured\n"),
    }
    out
}

fn scores(s: &LookScore) -> String {
    let decibels = |v: Option<f64>| v.map_or_else(|| "-".to_string(), |v| format!("{v:.2}"));
    let psnr = format!("{} ({}) dB", decibels(s.masked_psnr), decibels(s.noise_free_masked_psnr));
    format!("{psnr:>24} {:>20}", format!("{:.4} ({:.4})", s.ssim, s.noise_free_ssim))
}

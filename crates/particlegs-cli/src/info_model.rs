//! What `info` prints about a model file, and its certificate as a table.

use crate::annotate::text::number;
use crate::common::Context;
use crate::inputs;
use crate::printable::one_line;
use crate::rows::wrapped;
use particlegs::Result;
use particlegs::codec::{self, BlockInfo, FileInfo};
use particlegs::model::{
    AlphaBlend, BANDS, Certificate, Effort, GROUP_CLASSES, LawKind, Layer, Limit, LookBaselines, LookPictures,
    LookScore, MassPower, Measures, Metadata, PictureScore, PictureScores, Pictures, PowerAgreement, Reached, Recipe,
    VIZMAPPER_SHAPE, VizMapper, VizRanges, per_length,
};
use particlegs::progress::Progress;
use particlegs::score::{Finding, Use, Word};
use particlegs::space::Cell;
use particlegs_files::input::name_of;
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
    layers: Vec<LayerReport<'a>>,
    vizmapper: Option<NetworkReport>,
    published_bytes: u64,
    certificate: Option<&'a Certificate>,
    verdict: Vec<Finding>,
}

#[derive(Serialize)]
struct LayerReport<'a> {
    name: &'a str,
    particle_mass: Option<f64>,
    weighted: bool,
    blocks: &'a [BlockInfo],
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
    bounds: particlegs::space::Bounds,
    cell: Option<particlegs::space::Cell>,
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
    command: String,
    tool_version: &'a str,
    /// Of the fit, where the Gaussians are what it gave.
    effort: Option<&'static str>,
}

/// Prints what the file says.
pub fn print(context: &Context, path: &Path, bytes: &[u8]) -> Result<()> {
    print_info(context, &codec::read_info(bytes, &name_of(path))?)
}

/// Does a model file say that this made it?
///
/// # Errors
/// Those of reading it.
pub fn is_of_recipe(path: &Path, recipe: &Recipe, progress: &dyn Progress) -> Result<bool> {
    Ok(codec::read_metadata(&inputs::model(path, progress)?, &name_of(path))?.recipe == *recipe)
}

fn layer_report(layer: &Layer<Vec<BlockInfo>>) -> LayerReport<'_> {
    let Layer { name, mass, content } = layer;
    LayerReport { name, particle_mass: mass.unit(), weighted: mass.is_weighted(), blocks: content }
}

fn print_info(context: &Context, info: &FileInfo) -> Result<()> {
    let gaussians = info.gaussians() as u64;
    let layer_bytes = |l: &Layer<Vec<BlockInfo>>| {
        let count = l.content.iter().fold(0u64, |sum, b| sum.saturating_add(b.count));
        count.saturating_mul(l.mass.particle_bytes())
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
        layers: info.layers.iter().map(layer_report).collect(),
        vizmapper: info.vizmapper.as_ref().map(network),
        published_bytes: gaussians * AlphaBlend::PLY_BYTES,
        certificate: info.certificate.as_ref(),
        verdict: Finding::verdict(info.certificate.as_ref(), &info.metadata),
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
        source_blake3: particlegs::model::hex(&m.source_hash),
        length_unit: m.length_unit.as_deref(),
        mass_unit: m.mass_unit.as_deref(),
        comoving: m.comoving,
        scale_factor: m.scale_factor,
        redshift: m.redshift(),
        hubble: m.hubble,
        time: m.time,
        command: m.recipe.to_string(),
        tool_version: &m.tool_version,
        effort: m.recipe.fitted().map(Effort::name),
    }
}

fn text(r: &Report<'_>) -> String {
    let m = &r.metadata;
    let mut out = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(out, "{}", wrapped(&format!("{name:<18} "), &one_line(&value), 19));
    };
    row("format", format!("{}, image law {}", r.format_version, m.law));
    row("size", format!("{} bytes, ratio {:.1} to {} raw bytes", r.model_bytes, r.compression_ratio, r.raw_bytes));
    row("Gaussians", format!("{}, {:.3} bytes each", r.gaussians, r.bytes_per_gaussian));
    row(
        "as published",
        format!(
            "{} bytes as PLY, {} a Gaussian, ratio {:.1}",
            r.published_bytes,
            AlphaBlend::PLY_BYTES,
            r.raw_bytes as f64 / r.published_bytes as f64
        ),
    );
    match &r.vizmapper {
        Some(n) => row(
            "VizMapper",
            format!(
                "layers of {} values, {} parameters in {} bytes; scale within {}, opacity within {}, its factor at least {}",
                n.shape.map(|n| n.to_string()).join(", "),
                n.parameters,
                n.bytes,
                n.ranges.scale,
                n.ranges.opacity,
                n.ranges.floor
            ),
        ),
        None if m.law == LawKind::AlphaBlend.name() => row("VizMapper", "none: trained without".into()),
        None => {}
    }
    row("particles", m.particles.to_string());
    row("weights", format!("{} in all (1 a particle where a layer has none)", m.mass));
    row("bounds", format!("{} to {}", point(m.bounds.min), point(m.bounds.max)));
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
    row("command", m.command.clone());
    row("made by", format!("particlegs {}", m.tool_version));
    m.effort.iter().for_each(|effort| row("fitted with", format!("effort {effort}")));
    for layer in &r.layers {
        let count: u64 = layer.blocks.iter().map(|b| b.count).sum();
        let mass = match (layer.weighted, layer.particle_mass) {
            (true, _) => "each with a mass of its own".to_string(),
            (false, Some(m)) => format!("of mass {m} each"),
            (false, None) => "mass not stated".to_string(),
        };
        let blocks = layer.blocks.len();
        row("layer", format!("`{}`: {count} particles, {mass}, {blocks} block(s)", layer.name));
        for b in layer.blocks {
            let each = b.bytes as f64 / f64::from(b.gaussians);
            let place = format!("{} to {}", point(b.bounds.min), point(b.bounds.max));
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
    out.push_str(&verdict(&r.verdict));
    out.trim_end().to_string()
}

fn cell(m: &MetadataReport<'_>) -> String {
    m.cell.as_ref().map_or_else(|| "none stated".into(), Cell::in_words)
}

fn point(p: [f64; 3]) -> String {
    format!("({}, {}, {})", p[0], p[1], p[2])
}

fn said(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "not stated".into(), |v| v.to_string())
}

/// The certificate as a table, and what statistics said in words. `unit` is the unit of length.
pub fn certificate(c: Option<&Certificate>, unit: Option<&str>) -> String {
    let Some(c) = c else { return "certificate        none\n".into() };
    let mut out = format!(
        "certificate        measured at encoding: {} x {}, one frame an orbit, seed {}\n",
        c.width, c.height, c.seed
    );
    if let Some(goal) = &c.measures.goal {
        out += &(wrapped("  ", &goal_in_words(goal, unit), 6) + "\n");
    }
    out += &pictures(c);
    out += &c.measures.pictures.as_ref().map_or_else(String::new, settings);
    let mut line = |text: String| out += &(wrapped("  ", &text, 6) + "\n");
    line(format!("density on a grid of {} cells: correlation {:.5} (uniform 0)", c.grid, c.density_correlation));
    let uniform = c.baselines.map_or_else(|| "not measured".into(), |b| format!("{:.4}", b.uniform_density_mae));
    line(format!("density contrast on it: mean absolute error {:.4} (uniform {uniform}, empty 1)", c.density_mae));
    match &c.science {
        Some(science) => science.in_words(unit).into_iter().for_each(&mut line),
        None => line("power spectrum, cross-correlation, groups: not measured".into()),
    }
    match &c.measures.subset {
        Some(s) => line(format!(
            "subset: {} of the particles, at random, coded in {} bytes; drawn with radii times sqrt(N / kept)",
            s.kept, s.bytes
        )),
        None => line("random subset of the same bytes: not measured".into()),
    }
    if c.measures.pictures.is_none() {
        line("pictures at other radii and opacities, and from close up: not measured (--certificate full)".into());
    }
    measures(&c.measures, unit).into_iter().for_each(line);
    out
}

/// What was asked for, and what the file has.
pub fn goal_in_words(goal: &Reached, unit: Option<&str>) -> String {
    format!("asked for: {}", goal.in_words(unit))
}

/// What else was measured, a line each.
fn measures(m: &Measures, unit: Option<&str>) -> Vec<String> {
    let length = unit.map_or(String::new(), |u| format!(" {u}"));
    let percent = |v: Option<f64>| v.map_or("-".to_string(), |v| format!("{:.1} %", 100.0 * v));
    let mut lines = Vec::new();
    for d in m.densities.iter().flatten() {
        lines.push(format!(
            "density in cells of {:.4}{length} ({:.1} particles): correlation {:.5}, mean absolute error {:.4} (uniform {:.4})",
            d.edge, d.particles, d.correlation, d.mean_absolute_error, d.uniform_mean_absolute_error
        ));
    }
    if let Some(s) = &m.sample {
        lines.push(format!(
            "what follows of distances, groups and halves: of {} particles, all those from {} to {}",
            s.particles,
            point(s.bounds.min),
            point(s.bounds.max)
        ));
    }
    if let Some(s) = &m.spacing {
        lines.push(format!(
            "distance to the nearest neighbour: median {:.4}{length}, of particles drawn {:.4}; 5th percentile over it {:.3} \
             and {:.3}",
            s.median, s.drawn_median, s.regularity, s.drawn_regularity
        ));
    }
    if let Some(blocks) = m.blocks {
        lines.push(format!(
            "added up of {blocks} block(s), each measured by itself: what does not add up was not measured"
        ));
    }
    mass_power(m.mass_power.as_ref(), unit, &mut lines);
    match &m.held_out {
        None => lines.push("held-out particles: not measured (--certificate full)".into()),
        Some(h) => {
            lines.push(format!(
                "held-out particles, of models of halves by the same method: {:.3} +- {:.3} bits a particle above uniform in a \
                 volume of {:.4e} (a kernel estimate on all particles: {:.3})",
                h.bits, h.error, h.volume, h.kernel_bits
            ));
            let bands = BANDS.iter().zip(&h.transfer).filter_map(|(share, t)| {
                t.deviation
                    .map(|d| format!("{:+.2} +- {:.2} % to {:.3}", 100.0 * d, 100.0 * t.scatter, share * h.k_max))
            });
            let unit = unit.map_or_else(|| "1/length".into(), per_length);
            let bands: Vec<String> = bands.collect();
            lines.push(match bands[..] {
                [] => "transfer function of the halves: the particles have no power above their noise".into(),
                _ => format!("transfer function of the halves: {} {unit}", bands.join(", ")),
            });
        }
    }
    match &m.groups {
        None => lines.push("groups matched by position: not measured (--certificate full)".into()),
        Some(classes) => {
            for (k, c) in classes.iter().enumerate() {
                let to = GROUP_CLASSES.get(k + 1).map_or(" and more".into(), |n| format!(" to {}", n - 1));
                if c.groups == 0 {
                    lines.push(format!("groups of {}{to} particles: none", GROUP_CLASSES[k]));
                    continue;
                }
                lines.push(format!(
                    "groups of {}{to} particles: {}; number in draws {} +- {}, completeness {}, purity {}, median mass {} \
                     +- {}",
                    GROUP_CLASSES[k],
                    c.groups,
                    percent(c.number),
                    percent(Some(c.number_scatter)),
                    percent(c.completeness),
                    percent(c.purity),
                    percent(c.mass),
                    percent(Some(c.mass_scatter))
                ));
            }
        }
    }
    lines
}

/// What the model is good for, a line a use.
pub fn verdict(findings: &[Finding]) -> String {
    let mut out = "verdict            what the model is good for (docs/guide/certificate.md)\n".to_string();
    for f in findings {
        out += &(wrapped(&format!("  {:<16}{:<14}", f.of.name(), f.word.name()), &f.why, 32) + "\n");
    }
    out
}

/// The certificate that a file was just given, and its verdict, as text and as data; tells unasked what
/// a user must know of a poor model, whose pictures or density do not clearly beat trivial ones, and what helps.
pub fn told(c: Option<&Certificate>, metadata: &Metadata, progress: &dyn Progress) -> (String, Vec<Finding>) {
    let v = Finding::verdict(c, metadata);
    let poor = |f: &&Finding| matches!(f.of, Use::Pictures | Use::Density) && f.word == Word::DoesNot;
    let poor: Vec<String> = v.iter().filter(poor).map(|f| format!("{}: {}", f.of.name(), f.why)).collect();
    if !poor.is_empty() {
        progress.message(&format!("warning: the model shows little of these particles; {}", poor.join("; ")));
        progress.message(
            "hint: where particles cluster a larger file helps, such as half the ratio; liquids and crystals are shown at \
             no ratio (docs/guide/certificate.md)",
        );
    }
    let text = if c.is_some() {
        format!("\n{}{}", certificate(c, metadata.length_unit.as_deref()), verdict(&v))
    } else {
        String::new()
    };
    (text.trim_end().to_string(), v)
}

/// Widths of the columns of a table of pictures.
const COLUMNS: [usize; 5] = [6, 6, 6, 7, 6];

/// A row of columns.
fn columns(values: [String; 5]) -> String {
    let cells: Vec<String> = values.into_iter().zip(COLUMNS).map(|(v, width)| format!("{v:>width$}")).collect();
    cells.join(" ")
}

/// The two lines of a table's head: what is compared.
fn heads() -> [String; 2] {
    let words = |w: [&str; 5]| columns(w.map(String::from));
    [words(["", "noise-", "", "", ""]), words(["model", "free", "black", "uniform", "subset"])]
}

fn decibels(v: Option<f64>) -> String {
    v.map_or_else(|| "-".to_string(), |v| format!("{v:.2}"))
}

/// The scores of pictures, the model's beside the noise-free, the trivial ones and the subset's.
fn pictures(c: &Certificate) -> String {
    let [above, names] = heads();
    let mut out = format!("{:26}{:>35}  {:>35}\n", "", "masked PSNR in dB: ", "SSIM: ");
    let _ = writeln!(out, "{:26}{above}  {above}", "");
    let _ = writeln!(out, "  {:<6} {:<17}{names}  {names}", "orbit", "look");
    for (k, name) in ["far", "mid", "near"].iter().enumerate() {
        for (l, (look, score, baselines)) in looks(c, k).into_iter().enumerate() {
            if c.measures.blocks.is_some() && look != "expected" {
                let _ = writeln!(out, "  {name:<6} {look:<17}not measured (by blocks)");
                continue;
            }
            let subset = c.measures.subset.and_then(|s| s.orbits[k][l]);
            let model = PictureScore { masked_psnr: score.masked_psnr, ssim: score.ssim };
            let best = PictureScore { masked_psnr: score.noise_free_masked_psnr, ssim: score.noise_free_ssim };
            let all =
                [Some(model), Some(best), baselines.map(|b| b.all_black), baselines.map(|b| b.uniform_box), subset];
            let psnr = columns(all.map(|s| decibels(s.and_then(|s| s.masked_psnr))));
            let ssim = columns(all.map(|s| s.map_or_else(|| "-".to_string(), |s| format!("{:.4}", s.ssim))));
            let _ = writeln!(out, "  {name:<6} {look:<17}{psnr}  {ssim}");
        }
    }
    out
}

/// The scores at other radii and opacities, and from close up.
fn settings(p: &Pictures) -> String {
    let [above, names] = heads();
    let mut out = format!(
        "pictures of {} x {}, three views each (radius in default radii; close: from within)\n{:23}{:>35}  {:>21} {:>13}\n",
        p.width, p.height, "", "masked PSNR in dB, mean: ", "of the worst view: ", "model's SSIM:"
    );
    let _ = writeln!(out, "{:23}{above}", "");
    let _ = writeln!(
        out,
        "  {:>6} {:<7}{:<7}{names}  {:<7} {:>6} {:>6} {:>6} {:>6}",
        "radius", "opacity", " look", "view", "model", "subset", "mean", "worst"
    );
    for s in &p.settings {
        for (look, scores) in [("parav.", &s.paraview), ("expec.", &s.expected)] {
            let radius = if s.close { "close".to_string() } else { format!("{}", s.radius) };
            let of = |s: &PictureScores| {
                let subset = s.subset.and_then(|s| s.masked_psnr);
                [
                    s.model.masked_psnr,
                    s.noise_free.masked_psnr,
                    s.all_black.masked_psnr,
                    s.uniform_box.masked_psnr,
                    subset,
                ]
            };
            let (mean, worst) = (of(&scores.mean), of(&scores.worst));
            let _ = writeln!(
                out,
                "  {radius:>6} {:<7.4} {look:<6}{}  {:<7} {:>6} {:>6} {:>6.3} {:>6.3}",
                s.opacity,
                columns(mean.map(decibels)),
                view_name(scores, s.close),
                decibels(worst[0]),
                decibels(worst[4]),
                scores.mean.model.ssim,
                scores.worst.model.ssim
            );
        }
    }
    out
}

/// The worst view's name.
fn view_name(scores: &LookPictures, close: bool) -> &'static str {
    let names = if close { ["first", "second", "third"] } else { ["far", "mid", "near"] };
    names[usize::from(scores.worst_view).min(2)]
}

/// The looks of an orbit: name, scores, and those of the trivial pictures where they were measured.
fn looks(c: &Certificate, orbit: usize) -> [(&'static str, LookScore, Option<LookBaselines>); 3] {
    let (o, b) = (&c.orbits[orbit], c.baselines.map(|b| b.orbits[orbit]));
    [
        ("paraview", o.paraview, b.map(|b| b.paraview)),
        ("paraview-no-fxaa", o.paraview_no_fxaa, b.map(|b| b.paraview_no_fxaa)),
        ("expected", o.expected, b.map(|b| b.expected)),
    ]
}

/// P(k) of mass: of all layers, and of each by its place in the file.
fn mass_power(power: Option<&MassPower>, unit: Option<&str>, lines: &mut Vec<String>) {
    let Some(power) = power else { return };
    let unit = unit.map_or_else(|| "1/length".into(), per_length);
    let mut line = |of: &str, p: &PowerAgreement| {
        let to = match p.within_1_percent_to {
            Limit::NotMeasured => "not measured".to_string(),
            Limit::Never => "nowhere".into(),
            Limit::At(k) => format!("up to k = {k:.4} {unit}"),
        };
        let largest = p.largest_deviation.map_or("-".into(), |d| format!("{:.2} %", 100.0 * d));
        lines.push(format!(
            "power spectrum by mass, of the mixture itself, {of}: within 1 % {to}; largest deviation {largest}"
        ));
    };
    line("all layers", &power.whole);
    for (number, p) in power.layers.iter().flatten().enumerate() {
        line(&format!("layer {}", number + 1), p);
    }
}

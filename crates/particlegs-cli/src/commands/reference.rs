//! `particlegs reference IN... --style S --out DIR`.

use crate::common::{CommandContext, Common, NamedChoice, OrNone, one_of};
use crate::density_args::{DensityArgs, Quantities};
use crate::device::DeviceArgs;
use crate::drawing::finish::Finisher;
use crate::drawing::job::DrawingJob;
use crate::drawing::provenance::{PictureProvenance, PictureUnits, SourceFile};
use crate::drawing::run::{self, PictureTarget};
use crate::drawing::{ViewContent, ViewRenderer};
use crate::field_args::{FieldArgs, FieldChoice, FieldSource};
use crate::figure::args::FigureArgs;
use crate::figure::{FileKind, number};
use crate::rendered_view::RenderedView;
use crate::sequence_args::SequenceArgs;
use crate::snapshot_args::{ParticleArgs, SelectionArgs, SnapshotArgs};
use crate::view_args::{ViewArgs, ViewSubject};
use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum, ValueHint};
use particlegs_compress::FieldSelection;
use particlegs_core::camera::{Extent, View, ViewSet};
use particlegs_core::model::{LawKind, hex};
use particlegs_core::render::{FieldQuery, FieldWeight, Renderer};
use particlegs_core::splat::{DEFAULT_OPACITY, ToneStyle};
use particlegs_core::{Error, NamedValue, Result};
use particlegs_particles::{LayerFields, Particles, StarFormingGas, Storage};
use particlegs_reference::{FieldValues, Reference};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    after_help = "\
Examples:
  particlegs reference samples/nbody64 -o pictures
  particlegs reference snapshot --views views.json --style response-fxaa -o noise-free",
    after_long_help = "\
Examples:
  particlegs reference samples/nbody64 -o pictures
  particlegs reference snapshot --views views.json --style response-fxaa -o noise-free
  particlegs reference snapshot --style density --smooth 32 --projection orthographic -o sigma.png
  particlegs reference x.f32 y.f32 z.f32 --azimuth 30 --distance 0.5 --style expected -o pictures

docs/guide/pictures.md describes styles, cameras and views files."
)]
pub struct Arguments {
    /// Snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// Folder for the pictures (NAME.png for each view), or, for one view, the file to write: NAME.png, .pdf or .svg.
    #[arg(
        long = "output",
        short,
        alias = "out",
        value_name = "DIR|FILE",
        value_hint = ValueHint::AnyPath,
        required_unless_present = "video"
    )]
    out: Option<PathBuf>,
    /// What to draw.
    #[arg(long, value_name = "STYLE", default_value = "paraview", value_parser = one_of(STYLES))]
    style: ParticleStyle,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    sequence: SequenceArgs,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    density: DensityArgs,
    #[command(flatten)]
    field: FieldArgs,
    /// Smooth each particle over a sphere that reaches its K-th nearest neighbour [default: points].
    ///
    /// Uses the cubic spline kernel, across periodic boundaries, with neighbours among all particles that are drawn. 16
    /// to 64 are common. A particle counts if its centre is within --depth.
    #[arg(
        long,
        value_name = "K",
        help_heading = "Options of --style density",
        hide_short_help = true,
        value_parser = RangedU64ValueParser::<usize>::new().range(2..)
    )]
    smooth: Option<usize>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    common: Common,
}

/// How particles are drawn: the tone style, and whether with shot noise; `None` = surface density.
type ParticleStyle = OrNone<(ToneStyle, bool)>;

const STYLES: [NamedChoice<ParticleStyle>; 6] = [
    (
        Some((ToneStyle::Paraview, true)),
        "paraview",
        "ParaView 6's default picture, with shot noise: dual depth peeling, 8-bit blending, FXAA",
    ),
    (Some((ToneStyle::ParaviewNoFxaa, true)), "paraview-no-fxaa", "The same without antialiasing (FXAA)"),
    (Some((ToneStyle::Expected, true)), "expected", "255 (1 - exp(-tau)) for the optical depth tau: noise-free"),
    (Some((ToneStyle::ParaviewNoFxaa, false)), "response", "Noise-free mean of paraview-no-fxaa"),
    (Some((ToneStyle::Paraview, false)), "response-fxaa", "Noise-free mean of paraview"),
    (None, "density", "Surface density in logarithmic colours, with a colour bar and a scale bar"),
];

#[derive(Serialize)]
struct ParticleView {
    #[serde(flatten)]
    drawn: RenderedView,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_px: Option<f64>,
    particles_per_second: f64,
}

#[derive(Serialize)]
struct ReferenceReport {
    style: String,
    particles: u64,
    /// Number of neighbours to smooth over, and the seconds to find them.
    #[serde(skip_serializing_if = "Option::is_none")]
    smooth: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    smooth_seconds: Option<f64>,
    width: usize,
    height: usize,
    fov_deg: Option<f64>,
    /// Values of the first and last colour, if all pictures share one range.
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 2]>,
    views: Vec<ParticleView>,
}

pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let files = [&a.view.views, &a.sequence.path, &a.figure.overlay, &a.snapshot.topology].into_iter().flatten();
    context.reads(a.input.iter().chain(files).map(PathBuf::as_path), false)?;
    let range = if a.field.field.is_some() { a.density.field_range() } else { a.density.asked_range() }?;
    let particles = ParticleArgs::without_window(&a.snapshot, &a.selection);
    let mut choice = particles.choice(a.common.seed)?;
    let (particles, sources) = match &a.field.field {
        None => (choice.read(&a.input, &Storage::Memory, &context)?, Vec::new()),
        Some(_) => choice.read_fields(&a.input, &Storage::Memory, &context)?,
    };
    let field =
        a.field.field.as_deref().map(|name| particle_field(a, name, &particles, &sources, &context)).transpose()?;
    field.iter().try_for_each(|(f, _)| f.checked(range))?;
    let style = if field.is_some() { None } else { a.style };
    let mut reference = Reference::new(&particles);
    let bounds = *reference.bounds();
    let count = particles.len() as u64;
    let (density, cell) = (style.is_none(), particles.meta.cell);
    let radius = bounds.default_radius(count);
    let extent = Extent::new(&bounds, cell.as_ref());
    let subject = ViewSubject { bounds, cell, extent, radius, opacity: DEFAULT_OPACITY, density, center: None };
    let quantities = Quantities::from_particles(&particles, a.smooth);
    let set = run::views(None, &a.view, (&a.sequence, None), &subject, &context)?;
    let kind = a.out.as_deref().and_then(FileKind::from_path).unwrap_or(FileKind::Png);
    let resolved = a.figure.resolved(set.size, kind, 1).filter(|_| a.view.size.is_none());
    let set = ViewSet { size: resolved.unwrap_or(set.size), ..set };
    let unit = particles.meta.units.length_text().unwrap_or_default().to_string();
    if let Some(note) = a.view.note(&subject, &set, &unit) {
        context.message(&note);
    }
    a.figure.note_missing(&[], &context);
    let style_name = STYLES.iter().find(|s| s.0 == style).map(|s| s.1.to_string()).unwrap_or_default();
    let (mut smooth_seconds, mut text) = (None, String::new());
    if let Some(neighbours) = a.smooth {
        let started = Instant::now();
        reference = reference.smoothed(neighbours, &context)?;
        let seconds = started.elapsed().as_secs_f64();
        smooth_seconds = Some(seconds);
        text = format!("{:<16} {seconds:>9.3}\n", format!("({neighbours} neighbours)"));
    }
    let colormap = a.density.colormap.unwrap_or_default();
    let ground = a.figure.background.and_then(|b| Some(b.to_possible_value()?.get_name().to_string()));
    let name = a.input.first().and_then(|p| p.file_name()).map(|n| n.to_string_lossy().into_owned());
    let about = PictureProvenance {
        particlegs: env!("CARGO_PKG_VERSION").into(),
        of: vec![SourceFile { name: name.unwrap_or_default(), blake3: hex(&particles.source_hash()), moment: None }],
        style: style_name.clone(),
        colormap: density.then(|| colormap.name().into()),
        unit: density.then(|| quantities.unit()),
        units: Some(PictureUnits::new(particles.meta.unit_system(), density.then(|| particles.density_of()))),
        background: ground,
        ..PictureProvenance::default()
    };
    let about = field.iter().fold(about, |about, (f, _)| a.field.stored(f, about));
    let (args, quantities) = (&a.figure, &quantities);
    let circles = args.circles((particles.meta.unit_system(), cell), &context)?;
    let of_field = field.as_ref().map(|(f, _)| f.legend.clone());
    let (legend, subject) = (Vec::new(), &subject);
    let finish = Finisher { args, colormap, field: of_field, quantities, subject, legend, circles, stamps: &[], about };
    let target = PictureTarget { out: a.out.as_deref(), density: &a.density, sequence: &a.sequence };
    let device = a.device.open()?;
    if device.is_some() && density {
        let what = "surface densities are rendered on the CPU only";
        return Err(Error::argument_with(what, "omit --device"));
    }
    let on_device = device.map(|d| d.particles(reference.input(), &context)).transpose()?;
    let painter = renderer(&reference, on_device, (style, field.as_ref()), subject, &context);
    let job = DrawingJob { painter: &painter, finish: &finish, set: &set, range, hints: false, context: &context };
    let drawn = job.draw(&target)?;
    text += &if density || !drawn.lines.is_empty() { drawn.text() } else { rows(&set, &drawn.views, count) };
    let radii = set.views.iter().map(|v| (!density).then(|| v.radius_pixels(set.size)));
    let rate = |d: &RenderedView| count as f64 / d.seconds.max(1e-9);
    let of = |(drawn, radius_px)| ParticleView { particles_per_second: rate(&drawn), drawn, radius_px };
    let report = ReferenceReport {
        style: style_name,
        particles: count,
        smooth: a.smooth,
        smooth_seconds,
        width: set.size.width,
        height: set.size.height,
        fov_deg: set.fov_deg(),
        range: drawn.range,
        views: drawn.views.into_iter().zip(radii).map(of).collect(),
    };
    context.finish(&text, &report)
}

/// The field that --field names, and the particles' values.
fn particle_field(
    a: &Arguments,
    name: &str,
    particles: &Particles,
    sources: &[LayerFields],
    context: &CommandContext,
) -> Result<(FieldChoice, FieldValues)> {
    let weight = a.field.field_weight.as_ref().filter(|w| FieldWeight::from_name(w).is_err());
    let select = |name: &String| {
        let names: Vec<String> = [Some(name), weight].into_iter().flatten().cloned().collect();
        FieldSelection::new(&names, StarFormingGas::Keep, particles, sources, LawKind::OpticalDepth)
    };
    let candidates = FieldQuery::candidates(name);
    let mut found = candidates.iter().map(select).collect::<Vec<_>>();
    let at = found.iter().position(Result::is_ok).unwrap_or(0);
    let selection = found.swap_remove(at)?;
    context.notes(selection.notes());
    // A class of a category is one of several.
    let number = selection.quantities().iter().position(|q| q.name.eq_ignore_ascii_case(&candidates[at]));
    let values = selection.values(number.unwrap_or(0))?;
    let mean = |_: &str| {
        let of = |column: &Vec<f64>| {
            let there: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
            there.iter().sum::<f64>() / there.len().max(1) as f64
        };
        [0, 1, 2].map(|k| values.columns.get(k).map_or(0.0, of))
    };
    let samples = |_: &str| values.columns[0].clone();
    let source = FieldSource {
        quantities: selection.quantities(),
        length: particles.meta.units.length_text(),
        mean: &mean,
        samples: &samples,
    };
    let choice = a.field.choice(name, &source, a.density.colormap)?;
    let Some(by) = &choice.query.by else { return Ok((choice, values)) };
    let number = selection.quantities().iter().position(|q| q.name == *by).unwrap_or(0);
    let mut weights = selection.values(number)?.columns.swap_remove(0);
    if let (true, Some(masses)) = (selection.quantities()[number].extensive, particles.weights()) {
        // A sum weighs by itself.
        weights.iter_mut().zip(masses.iter()).for_each(|(v, mass)| *v /= f64::from(*mass));
    }
    Ok((choice, FieldValues { by: Some(weights), ..values }))
}

fn rows(set: &ViewSet, drawn: &[RenderedView], count: u64) -> String {
    let mut text = format!("{:<16} {:>8} {:>9} {:>14}", "view", "r px", "seconds", "particles/s");
    for (view, drawn) in set.views.iter().zip(drawn) {
        let (radius_px, seconds) = (view.radius_pixels(set.size), drawn.seconds);
        let rate = number(count as f64 / seconds.max(1e-9));
        text += &format!("\n{:<16} {radius_px:>8.3} {seconds:>9.3} {rate:>14}", view.name);
    }
    text
}

/// Draws a snapshot, on a GPU if one is given.
fn renderer<'a>(
    reference: &'a Reference<'a>,
    on_device: Option<Box<dyn Renderer + 'a>>,
    (style, field): (ParticleStyle, Option<&'a (FieldChoice, FieldValues)>),
    subject: &'a ViewSubject,
    context: &'a CommandContext,
) -> ViewRenderer<'a> {
    let draw = move |view: &View, size| {
        let renderer = on_device.as_deref().unwrap_or(reference);
        let levels = match style {
            Some((look, true)) => renderer.draw(view, size, look, context),
            Some((look, false)) => renderer.response(view, size, look, context),
            None => {
                let view = subject.density_view(view, size);
                if let Some((field, values)) = field {
                    let map = reference.field_map(values, &field.query, &view, size, context)?;
                    return Ok(field.content(map));
                }
                return Ok(ViewContent::Density(reference.surface_density(&view, size, context)?));
            }
        };
        levels.map(ViewContent::Levels)
    };
    // Each picture uses all threads, and memory like the snapshot's.
    ViewRenderer { draw: Box::new(draw), side_by_side: false }
}

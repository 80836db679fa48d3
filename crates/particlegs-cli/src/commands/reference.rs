//! `particlegs reference IN... --style S --out DIR`.

use crate::annotate::text::number;
use crate::common::{Common, Context};
use crate::density_args::{DensityArgs, Quantities};
use crate::drawn::Drawn;
use crate::picture_out::PictureOut;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, Subset, WindowArgs};
use crate::view_args::{Subject, ViewArgs};
use clap::builder::RangedU64ValueParser;
use clap::{Args, ValueEnum, ValueHint};
use particlegs::Result;
use particlegs::picture::write_png;
use particlegs::reference::Reference;
use particlegs::splat::{DEFAULT_OPACITY, Look};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
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
    /// Folder for the pictures, NAME.png for each view; or, of one view, the picture to write.
    #[arg(long = "output", short, alias = "out", value_name = "DIR|NAME.png", value_hint = ValueHint::AnyPath)]
    out: PathBuf,
    /// What to draw.
    #[arg(long, value_enum, value_name = "STYLE", default_value_t = Style::Paraview)]
    style: Style,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    density: DensityArgs,
    /// Spread each particle over the sphere that reaches its K-th nearest other particle [default: points].
    ///
    /// By the cubic spline kernel, around the box where that repeats; neighbours are among all particles that are
    /// drawn. 16 to 64 are common. Particles count whose centres are within --depth.
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

/// The styles that all particles can be drawn in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Style {
    /// As ParaView 6 draws by default, with shot noise: dual depth peeling, 8-bit blending, FXAA.
    Paraview,
    /// The same without antialiasing (FXAA).
    ParaviewNoFxaa,
    /// 255 (1 - exp(-tau)) for the optical depth tau: noise-free.
    Expected,
    /// Noise-free mean of paraview-no-fxaa.
    Response,
    /// Noise-free mean of paraview.
    ResponseFxaa,
    /// Surface density in logarithmic colours, with a colour bar and a scale bar.
    Density,
}

#[derive(Serialize)]
struct DrawnParticles {
    #[serde(flatten)]
    drawn: Drawn,
    radius_px: f64,
    particles_per_second: f64,
}

#[derive(Serialize)]
struct Report {
    style: String,
    particles: u64,
    width: usize,
    height: usize,
    fov_deg: Option<f64>,
    views: Vec<DrawnParticles>,
}

#[derive(Serialize)]
struct DensityReport {
    style: &'static str,
    particles: u64,
    /// Neighbours that each particle is spread over, and how long they took to find.
    smooth: Option<usize>,
    smooth_seconds: Option<f64>,
    width: usize,
    height: usize,
    fov_deg: Option<f64>,
    views: Vec<Drawn>,
}

/// Draws every view.
pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads(a.input.iter().map(PathBuf::as_path).chain(a.view.views.as_deref()), false)?;
    let subset = Subset { selection: &a.selection, window: &WindowArgs::default(), seed: a.common.seed };
    let particles = a.snapshot.open_selected(&a.input, subset, &context)?;
    let reference = Reference::new(&particles);
    let bounds = *reference.bounds();
    let count = particles.len() as u64;
    if a.style == Style::Density {
        return densities(a, reference, &context);
    }
    let subject = Subject { bounds, radius: bounds.default_radius(count), opacity: DEFAULT_OPACITY };
    let set = a.view.resolve(&subject, &context)?;
    let out = PictureOut::new(&a.out, set.views.len(), false, &context)?;
    let paths = out.pictures(set.views.iter().map(|v| &v.name[..]), &context)?;
    let style = a.style.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default();
    let (width, height) = (set.size.width, set.size.height);
    let mut report = Report { style, particles: count, width, height, fov_deg: None, views: Vec::new() };
    let mut text = format!("{:<16} {:>8} {:>9} {:>14}", "view", "r px", "seconds", "particles/s");
    for (view, path) in set.views.iter().zip(paths) {
        let started = Instant::now();
        let picture = match a.style {
            Style::Paraview => reference.draw(view, set.size, Look::Paraview, &context),
            Style::ParaviewNoFxaa => reference.draw(view, set.size, Look::ParaviewNoFxaa, &context),
            Style::Expected => reference.draw(view, set.size, Look::Expected, &context),
            Style::Response => reference.response(view, set.size, Look::ParaviewNoFxaa, &context),
            // Density has left above.
            Style::ResponseFxaa | Style::Density => reference.response(view, set.size, Look::Paraview, &context),
        };
        let seconds = started.elapsed().as_secs_f64();
        let written = picture.and_then(|picture| write_png(&path, picture.size, &picture.data));
        context.says_what_is_there(&a.out, report.views.len(), set.views.len(), written)?;
        let (radius_px, rate) = (view.radius_pixels(set.size), count as f64 / seconds);
        text += &format!("\n{:<16} {radius_px:>8.3} {seconds:>9.3} {:>14}", view.name, number(rate));
        let drawn = Drawn::of_view(view, seconds, path);
        report.fov_deg = drawn.fov_deg();
        report.views.push(DrawnParticles { drawn, radius_px, particles_per_second: rate });
    }
    context.finish(&text, &report)
}

/// Draws the surface density of every view.
fn densities(a: &Arguments, mut reference: Reference<'_>, context: &Context) -> Result<()> {
    let (particles, bounds) = (reference.particles(), *reference.bounds());
    let count = particles.len() as u64;
    let subject = Subject { bounds, radius: bounds.default_radius(count), opacity: DEFAULT_OPACITY };
    let quantities = Quantities::of_particles(particles, a.smooth);
    let (size, views) = a.density.views(&a.view, &subject, &quantities, context)?;
    let out = PictureOut::new(&a.out, views.len(), a.density.raw, context)?;
    a.density.plan(&out, &views, context)?;
    let (smooth, width, height) = (a.smooth, size.width, size.height);
    let mut report = DensityReport {
        style: "density",
        particles: count,
        smooth,
        smooth_seconds: None,
        width,
        height,
        fov_deg: None,
        views: Vec::new(),
    };
    let mut text = format!("{:<16} {:>9}", "view", "seconds");
    if let Some(neighbours) = a.smooth {
        let started = Instant::now();
        let smoothed = reference.smoothed(neighbours, context);
        reference = context.says_what_is_there(&a.out, 0, views.len(), smoothed)?;
        let seconds = started.elapsed().as_secs_f64();
        report.smooth_seconds = Some(seconds);
        text += &format!("\n{:<16} {seconds:>9.3}", format!("({neighbours} neighbours)"));
    }
    for view in &views {
        let started = Instant::now();
        let plane = reference.surface_density(view, size, context);
        let seconds = started.elapsed().as_secs_f64();
        let drawn = plane.and_then(|plane| a.density.write(&out, view, &plane, &quantities));
        let path = context.says_what_is_there(&a.out, report.views.len(), views.len(), drawn)?;
        text += &format!("\n{:<16} {seconds:>9.3}", view.name);
        let drawn = Drawn::of_density(view, seconds, path);
        report.fov_deg = drawn.fov_deg();
        report.views.push(drawn);
    }
    context.finish(&text, &report)
}

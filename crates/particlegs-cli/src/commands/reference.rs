//! `particlegs reference IN... --style S --out DIR`.

use crate::common::{Common, Context};
use crate::density_args::{DensityArgs, Quantities};
use crate::picture_out::PictureOut;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use crate::view_args::{Subject, ViewArgs};
use clap::{Args, ValueEnum};
use particlegs::Result;
use particlegs::particles::{Bounds, Particles};
use particlegs::picture::write_gray_png;
use particlegs::reference::{Reference, surface_density};
use particlegs::splat::{DEFAULT_OPACITY, Look};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "Examples:
  particlegs reference samples/nbody64 --style paraview --out pictures
  particlegs reference snapshot --views views.json --style response-fxaa --out noise-free
  particlegs reference xx.f32 yy.f32 zz.f32 --azimuth 30 --elevation 20 --distance 0.5 --style expected --out out

Styles: `paraview` and `paraview-no-fxaa` are what ParaView 6 draws, shot noise and all; `response`
and `response-fxaa` their noise-free means; `expected` is 255 (1 - exp(-tau)).")]
pub struct Arguments {
    /// A snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "IN")]
    input: Vec<PathBuf>,
    /// What to draw.
    #[arg(long, value_enum, default_value_t = Style::Paraview)]
    style: Style,
    /// Folder for the pictures, made where it is missing; or, of one view, the picture NAME.png.
    #[arg(long, short, alias = "output", value_name = "DIR|NAME.png")]
    out: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    density: DensityArgs,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    common: Common,
}

/// The styles of spec/metrics.md that all particles can be drawn in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Style {
    /// ParaView's default: dual depth peeling, 8-bit blending, FXAA.
    Paraview,
    /// The same without FXAA.
    ParaviewNoFxaa,
    /// Noise-free, 255 (1 - exp(-tau)).
    Expected,
    /// Noise-free mean of paraview-no-fxaa.
    Response,
    /// Noise-free mean of paraview.
    ResponseFxaa,
    /// Surface density, in logarithmic colours with bars.
    Density,
}

#[derive(Serialize)]
struct Drawn {
    name: String,
    radius: f64,
    opacity: f64,
    radius_px: f64,
    seconds: f64,
    particles_per_second: f64,
    path: PathBuf,
}

#[derive(Serialize)]
struct Report {
    style: String,
    particles: u64,
    width: usize,
    height: usize,
    views: Vec<Drawn>,
}

#[derive(Serialize)]
struct DrawnDensity {
    name: String,
    seconds: f64,
    path: PathBuf,
}

#[derive(Serialize)]
struct DensityReport {
    style: &'static str,
    particles: u64,
    width: usize,
    height: usize,
    views: Vec<DrawnDensity>,
}

/// Draws every view.
pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let particles =
        a.snapshot.open_selected(&a.input, (&a.selection, &WindowArgs::default()), a.common.seed, &context)?;
    let reference = Reference::new(&particles);
    let bounds = *reference.bounds();
    let count = particles.len() as u64;
    if a.style == Style::Density {
        return densities(a, &particles, bounds, &context);
    }
    let set = a.view.resolve(&Subject { bounds, radius: bounds.default_radius(count), opacity: DEFAULT_OPACITY })?;
    let out = PictureOut::new(&a.out, set.views.len(), false)?;
    let style = a.style.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default();
    let mut report =
        Report { style, particles: count, width: set.size.width, height: set.size.height, views: Vec::new() };
    let mut text = format!("{:<16} {:>8} {:>9} {:>14}", "view", "r px", "seconds", "particles/s");
    for view in &set.views {
        let started = Instant::now();
        let picture = match a.style {
            Style::Paraview => reference.draw(view, set.size, Look::Paraview, &context)?,
            Style::ParaviewNoFxaa => reference.draw(view, set.size, Look::ParaviewNoFxaa, &context)?,
            Style::Expected => reference.draw(view, set.size, Look::Expected, &context)?,
            Style::Response => reference.response(view, set.size, Look::ParaviewNoFxaa, &context)?,
            // Density has left above.
            Style::ResponseFxaa | Style::Density => reference.response(view, set.size, Look::Paraview, &context)?,
        };
        let seconds = started.elapsed().as_secs_f64();
        let path = out.picture(&view.name);
        write_gray_png(&path, &picture)?;
        let (radius_px, rate) = (view.radius_pixels(set.size), count as f64 / seconds);
        text += &format!("\n{:<16} {radius_px:>8.3} {seconds:>9.3} {rate:>14.3e}", view.name);
        report.views.push(Drawn {
            name: view.name.clone(),
            radius: view.radius,
            opacity: view.opacity,
            radius_px,
            seconds,
            particles_per_second: rate,
            path,
        });
    }
    context.finish(&text, &report)
}

/// Draws the surface density of every view.
fn densities(a: &Arguments, particles: &Particles, bounds: Bounds, context: &Context) -> Result<()> {
    let count = particles.len() as u64;
    let subject = Subject { bounds, radius: bounds.default_radius(count), opacity: DEFAULT_OPACITY };
    let quantities = Quantities::of_particles(particles);
    let (size, views) = a.density.views(&a.view, &subject, &quantities)?;
    let out = PictureOut::new(&a.out, views.len(), a.density.raw)?;
    let mut report =
        DensityReport { style: "density", particles: count, width: size.width, height: size.height, views: Vec::new() };
    let mut text = format!("{:<16} {:>9}", "view", "seconds");
    for view in &views {
        let started = Instant::now();
        let plane = surface_density(particles, view, size, context)?;
        let seconds = started.elapsed().as_secs_f64();
        let path = a.density.write(&out, view, &plane, &quantities)?;
        text += &format!("\n{:<16} {seconds:>9.3}", view.name);
        report.views.push(DrawnDensity { name: view.name.clone(), seconds, path });
    }
    context.finish(&text, &report)
}

//! `particlegs render MODEL --style S --out DIR`.

use crate::common::{Common, Context};
use crate::density_args::{DensityArgs, Quantities};
use crate::drawn::Drawn;
use crate::inputs;
use crate::picture_out::PictureOut;
use crate::view_args::{Subject, ViewArgs};
use clap::{Args, ValueEnum, ValueHint};
use particlegs::model::{LawKind, Model};
use particlegs::picture::write_png;
use particlegs::render::{Scene, draw, surface_density};
use particlegs::splat::Look;
use particlegs::{Error, Result, codec};
use particlegs_files::input::name_of;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(
    after_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --style density --colormap magma -o sigma",
    after_long_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs -o figure.png
  particlegs render model.pgs --views views.json --style expected -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --azimuth 30 --save-views view.json -o pictures
  particlegs render model.pgs --style density --colormap magma -o sigma
  particlegs render model.pgs --layer PartType4 -o stars
  particlegs render model.pgs --style density --projection orthographic --width 30 --depth 5 -o slab

docs/guide/pictures.md describes styles, cameras and views files."
)]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "MODEL", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// Folder for the pictures, NAME.png for each view; or, of one view, the picture to write.
    #[arg(long = "output", short, alias = "out", value_name = "DIR|NAME.png", value_hint = ValueHint::AnyPath)]
    out: PathBuf,
    /// What to draw.
    #[arg(long, value_enum, value_name = "STYLE", default_value_t = Style::Paraview)]
    style: Style,
    /// Layers to draw, by the names that `info` lists, or `all`.
    #[arg(long = "layer", alias = "layers", value_name = "NAME,...", value_delimiter = ',', default_value = "all")]
    layers: Vec<String>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    density: DensityArgs,
    #[command(flatten)]
    common: Common,
}

/// The styles that a model can be drawn in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Style {
    /// As ParaView draws the particles, without their shot noise.
    Paraview,
    /// The same without antialiasing (FXAA).
    ParaviewNoFxaa,
    /// 255 (1 - exp(-tau)) for the optical depth tau.
    Expected,
    /// Surface density in logarithmic colours, with a colour bar and a scale bar.
    Density,
}

#[derive(Serialize)]
struct Report {
    style: String,
    gaussians: usize,
    width: usize,
    height: usize,
    fov_deg: Option<f64>,
    views: Vec<Drawn>,
}

/// Draws every view.
pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads([a.model.as_path()].into_iter().chain(a.view.views.as_deref()), false)?;
    let bytes = inputs::model(&a.model, &context)?;
    let model = codec::decode_with(&bytes, &name_of(&a.model), &context)?;
    let model = if a.layers == ["all"] { model } else { model.only(&a.layers)? };
    let m = &model.metadata;
    let subject = Subject { bounds: m.bounds, radius: m.default_radius, opacity: m.default_opacity };
    let mut report = Report {
        style: a.style.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default(),
        gaussians: model.gaussians(),
        width: 0,
        height: 0,
        fov_deg: None,
        views: Vec::new(),
    };
    let look = match a.style {
        Style::Paraview => Some(Look::Paraview),
        Style::ParaviewNoFxaa => Some(Look::ParaviewNoFxaa),
        Style::Expected => Some(Look::Expected),
        Style::Density => None,
    };
    match look {
        Some(look) => pictures(a, &model, &subject, look, &context, &mut report)?,
        None => densities(a, &model, &subject, &context, &mut report)?,
    }
    report.fov_deg = report.views.first().and_then(Drawn::fov_deg);
    let mut text = format!("{:<16} {:>9}", "view", "seconds");
    for v in &report.views {
        text += &format!("\n{:<16} {:>9.3}", v.name(), v.seconds());
    }
    context.finish(&text, &report)
}

fn pictures(
    a: &Arguments,
    model: &Model,
    subject: &Subject,
    look: Look,
    context: &Context,
    report: &mut Report,
) -> Result<()> {
    let set = a.view.resolve(subject, context)?;
    let out = PictureOut::new(&a.out, set.views.len(), false, context)?;
    let paths = out.pictures(set.views.iter().map(|v| &v.name[..]), context)?;
    (report.width, report.height) = (set.size.width, set.size.height);
    let scene = Scene::of(model);
    for (view, path) in set.views.iter().zip(paths) {
        let started = Instant::now();
        let mut seconds = 0.0;
        let drawn = draw(&scene, view, set.size, look, context).and_then(|picture| {
            seconds = started.elapsed().as_secs_f64();
            write_png(&path, picture.size, &picture.data)
        });
        context.says_what_is_there(&a.out, report.views.len(), set.views.len(), drawn)?;
        report.views.push(Drawn::of_view(view, seconds, path));
    }
    Ok(())
}

fn densities(a: &Arguments, model: &Model, subject: &Subject, context: &Context, report: &mut Report) -> Result<()> {
    if model.metadata.law == LawKind::AlphaBlend {
        let what = "an alpha-blend model has no surface density: its splats hold opacities, not masses".to_string();
        let hint = "draw particles with `recover`, then their density with `reference --style density`".to_string();
        return Err(Error::Argument { what, remedy: hint.into() });
    }
    let quantities = Quantities::of_model(model);
    let (size, views) = a.density.views(&a.view, subject, &quantities, context)?;
    let out = PictureOut::new(&a.out, views.len(), a.density.raw, context)?;
    a.density.plan(&out, &views, context)?;
    (report.width, report.height) = (size.width, size.height);
    let scene = Scene::of(model);
    for view in &views {
        let started = Instant::now();
        let mut seconds = 0.0;
        let drawn = surface_density(&scene, view, size, context).and_then(|plane| {
            seconds = started.elapsed().as_secs_f64();
            a.density.write(&out, view, &plane, &quantities)
        });
        let path = context.says_what_is_there(&a.out, report.views.len(), views.len(), drawn)?;
        report.views.push(Drawn::of_density(view, seconds, path));
    }
    Ok(())
}

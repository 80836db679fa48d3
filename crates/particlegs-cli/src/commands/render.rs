//! `particlegs render MODEL --style S --out DIR`.

use crate::common::Common;
use crate::density_args::{DensityArgs, Quantities};
use crate::picture_out::PictureOut;
use crate::view_args::{Subject, ViewArgs};
use clap::{Args, ValueEnum};
use particlegs::model::{Law, Model};
use particlegs::picture::write_gray_png;
use particlegs::progress::Progress;
use particlegs::render::{Scene, draw, surface_density};
use particlegs::splat::Look;
use particlegs::{Error, Result, codec};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Arguments.
#[derive(Args)]
#[command(after_help = "Examples:
  particlegs render model.pgs --out pictures
  particlegs render model.pgs -o figure.png
  particlegs render model.pgs --views views.json --style expected --out pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 --out near
  particlegs render model.pgs --style density --colormap magma --out sigma
  particlegs render model.pgs --layer PartType4 --out stars
  particlegs render model.pgs --style density --projection orthographic --center 0,25,25 --width 30 --depth 5 --out slab")]
pub struct Arguments {
    /// The model file.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// What to draw.
    #[arg(long, value_enum, default_value_t = Style::Paraview)]
    style: Style,
    /// Folder for the pictures, made where it is missing; or, of one view, the picture NAME.png.
    #[arg(long, short, alias = "output", value_name = "DIR|NAME.png")]
    out: PathBuf,
    /// Layers to draw: `all`, or names as `info` lists them.
    #[arg(long, visible_alias = "layer", value_name = "all|NAME,...", value_delimiter = ',', default_value = "all")]
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
    /// What ParaView would draw of the particles, without its noise.
    Paraview,
    /// The same without FXAA.
    ParaviewNoFxaa,
    /// 255 (1 - exp(-tau)).
    Expected,
    /// Surface density, in logarithmic colours with bars.
    Density,
}

#[derive(Serialize)]
struct Drawn {
    name: String,
    seconds: f64,
    path: PathBuf,
}

#[derive(Serialize)]
struct Report {
    style: String,
    gaussians: usize,
    width: usize,
    height: usize,
    views: Vec<Drawn>,
}

/// Draws every view.
pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let bytes = std::fs::read(&a.model).map_err(|e| Error::io(&a.model, e))?;
    let model = codec::decode(&bytes, &a.model.display().to_string())?;
    let model = if a.layers == ["all"] { model } else { model.only(&a.layers)? };
    let m = &model.metadata;
    let subject = Subject { bounds: m.bounds, radius: m.default_radius, opacity: m.default_opacity };
    let mut report = Report {
        style: a.style.to_possible_value().map(|v| v.get_name().to_string()).unwrap_or_default(),
        gaussians: model.gaussians(),
        width: 0,
        height: 0,
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
    let mut text = format!("{:<16} {:>9}", "view", "seconds");
    for v in &report.views {
        text += &format!("\n{:<16} {:>9.3}", v.name, v.seconds);
    }
    context.finish(&text, &report)
}

fn pictures(
    a: &Arguments,
    model: &Model,
    subject: &Subject,
    look: Look,
    progress: &dyn Progress,
    report: &mut Report,
) -> Result<()> {
    let set = a.view.resolve(subject)?;
    let out = PictureOut::new(&a.out, set.views.len(), false)?;
    (report.width, report.height) = (set.size.width, set.size.height);
    let scene = Scene::of(model);
    for view in &set.views {
        let started = Instant::now();
        let picture = draw(&scene, view, set.size, look, progress)?;
        let seconds = started.elapsed().as_secs_f64();
        let path = out.picture(&view.name);
        write_gray_png(&path, &picture)?;
        report.views.push(Drawn { name: view.name.clone(), seconds, path });
    }
    Ok(())
}

fn densities(
    a: &Arguments,
    model: &Model,
    subject: &Subject,
    progress: &dyn Progress,
    report: &mut Report,
) -> Result<()> {
    if model.metadata.law == Law::AlphaBlend {
        let what = "an alpha-blend model has no surface density: its splats hold opacities, not masses".to_string();
        let hint = "draw particles with `recover`, and their density with `reference --style density`".to_string();
        return Err(Error::Argument { what, hint });
    }
    let quantities = Quantities::of_model(model);
    let (size, views) = a.density.views(&a.view, subject, &quantities)?;
    let out = PictureOut::new(&a.out, views.len(), a.density.raw)?;
    (report.width, report.height) = (size.width, size.height);
    let scene = Scene::of(model);
    for view in &views {
        let started = Instant::now();
        let plane = surface_density(&scene, view, size, progress)?;
        let seconds = started.elapsed().as_secs_f64();
        let path = a.density.write(&out, view, &plane, &quantities)?;
        report.views.push(Drawn { name: view.name.clone(), seconds, path });
    }
    Ok(())
}

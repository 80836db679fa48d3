//! `particlegs render MODEL... --style S -o OUT`.

use crate::common::{Common, NamedChoice, one_of};
use crate::device::DeviceArgs;
use crate::inputs::{self, FrameArgs};
use crate::picture_args::{DensityArgs, FieldArgs, FigureArgs, SequenceArgs, ViewArgs};
use clap::{Args, ValueHint};
use particlegs::input::DecodedModel;
use particlegs_core::{Error, Result};
use particlegs_figure::number;
use particlegs_pictures::{
    HaloNumber, PictureOptions, PictureReport, PictureSource, PictureStyle, RenderOptions, render_models, render_series,
};
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --style density --projection orthographic -o fig.pdf
  particlegs render model.pgs --turntable 120 --video turn.mp4",
    after_long_help = "\
Examples:
  particlegs render model.pgs -o pictures
  particlegs render model.pgs -o figure.png
  particlegs render model.pgs --views views.json --style expected -o pictures
  particlegs render model.pgs --azimuth 30 --elevation 20 --distance 0.5 --radius 0.02 -o near.png
  particlegs render model.pgs --azimuth 30 --save-views view.json -o pictures
  particlegs render model.pgs --style density --colormap magma -o sigma
  particlegs render model.pgs --field velocity.los --bulk mean --projection orthographic -o velocity.png
  particlegs render model.pgs --field temperature --shade -o temperature
  particlegs render model.pgs --layer stars -o stars
  particlegs render m.pgs --style density --projection orthographic --width 30 --depth 5 -o slab.pdf
  particlegs render a.pgs b.pgs --panels --style density --background white -o compared.pdf
  particlegs render model.pgs --like published.png -o again.png
  particlegs render model.pgs --turntable 120 --video turn.mp4
  particlegs render model.pgs --path keys.json --frames 300 --video flight.webm -o frames
  particlegs render run.pgs --frames all --follow haloes.csv:12 --width 5 --video halo.mp4

docs/guide/pictures.md describes styles, cameras, figures, films and views files."
)]
pub struct Arguments {
    /// Model file; several with --panels.
    #[arg(required = true, value_name = "MODEL", value_hint = ValueHint::FilePath)]
    models: Vec<PathBuf>,
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
    /// What to draw [default: paraview].
    #[arg(long, value_name = "STYLE", value_parser = one_of(STYLES))]
    style: Option<PictureStyle>,
    /// Layers to draw: species such as gas or dm, names that `info` lists, or `all`.
    #[arg(long = "layer", alias = "layers", value_name = "NAME,...", value_delimiter = ',')]
    layers: Option<Vec<String>>,
    /// Colour by layer: hues are mixed by optical depth, brightness is unchanged.
    #[arg(long, hide_short_help = true)]
    color_by_layer: bool,
    /// Reuse the camera, style, colours and range stored in a PNG from this program.
    ///
    /// Other options on the command line override what is stored.
    #[arg(
        long,
        value_name = "PNG",
        hide_short_help = true,
        value_hint = ValueHint::FilePath,
        conflicts_with_all = ["views", "path", "azimuth", "elevation", "distance", "projection", "center", "width", "depth", "fit"]
    )]
    like: Option<PathBuf>,
    /// Draw all models and views in one figure, with a common range and colour bar.
    #[arg(long, hide_short_help = true, conflicts_with_all = ["turntable", "path", "video", "raw"])]
    panels: bool,
    /// Panels per row [default: one per model; up to three for a single model].
    #[arg(long, value_name = "N", hide_short_help = true, requires = "panels")]
    columns: Option<usize>,
    /// Captions of the panels, row by row [default: names of models and views].
    #[arg(long, value_name = "TEXT,...", value_delimiter = ',', hide_short_help = true, requires = "panels")]
    captions: Vec<String>,
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
    /// Follow a halo through a film of a series (--frames): a list read as by `stats --centres`, and the halo's id, or its
    /// row from 1 if the list has no ids.
    ///
    /// From the frame of the list on, the centre moves with the mass within the halo's radius. The camera keeps its
    /// distance and direction.
    #[arg(
        long,
        value_name = "FILE:NUMBER",
        hide_short_help = true,
        requires = "frames",
        conflicts_with_all = ["views", "path", "like", "center"]
    )]
    follow: Option<HaloNumber>,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    common: Common,
}

const STYLES: [NamedChoice<PictureStyle>; 4] = [
    (PictureStyle::Paraview, "paraview", "ParaView's picture of the particles, without shot noise"),
    (PictureStyle::ParaviewNoFxaa, "paraview-no-fxaa", "The same without antialiasing (FXAA)"),
    (PictureStyle::Expected, "expected", "255 (1 - exp(-tau)) for the optical depth tau"),
    (PictureStyle::Density, "density", "Surface density in logarithmic colours, with a colour bar and a scale bar"),
];

impl Arguments {
    fn options(&self) -> Result<RenderOptions> {
        Ok(RenderOptions {
            pictures: PictureOptions {
                output: self.out.clone(),
                style: self.style,
                view: self.view.options(),
                film: self.sequence.options(),
                figure: self.figure.options(),
                field: self.field.options(),
                colormap: self.density.colormap,
                range: self.density.range()?,
                raw: self.density.raw,
                // Only particles are smoothed; Gaussians are smooth.
                smooth: None,
                device: self.device.open()?,
            },
            layers: self.layers.clone().unwrap_or_default(),
            color_by_layer: self.color_by_layer,
            like: self.like.clone(),
            panels: self.panels,
            columns: self.columns,
            captions: self.captions.clone(),
            follow: self.follow.clone(),
        })
    }
}

pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let options = a.options()?;
    context.reads(a.models.iter().chain(options.files()).map(PathBuf::as_path), false)?;
    options.check()?;
    let report = match &a.models[..] {
        [path] if a.sequence.frames.is_some() && inputs::is_series(path) => {
            if a.series.is_given() {
                return Err(Error::argument("--frames makes a film of the whole series: omit --frame and --time"));
            }
            render_series(path, &inputs::read_file(path, &context)?, &options, &context.outputs, &context)?
        }
        paths => {
            let source = |path: &PathBuf| {
                let decoded = inputs::decoded_model(path, &a.series.choice(), &context)?;
                let DecodedModel { model, blake3, moment, interpolated } = decoded;
                Ok(PictureSource { path: path.clone(), model, blake3, moment, interpolated })
            };
            let sources = paths.iter().map(source).collect::<Result<Vec<_>>>()?;
            render_models(sources, &options, &context.outputs, &context)?
        }
    };
    context.finish(&pictures_text(&report), &report)
}

/// Pictures as text: a row for each picture, or lines about a film or a figure of panels.
pub fn pictures_text(report: &PictureReport) -> String {
    let mut text = String::new();
    if let (Some(neighbours), Some(seconds)) = (report.smooth, report.smooth_seconds) {
        text = format!("{:<16} {seconds:>9.3}\n", format!("({neighbours} neighbours)"));
    }
    if !report.lines.is_empty() {
        return text + &report.lines.join("\n");
    }
    let of_particles = report.views.iter().any(|v| v.radius_px.is_some());
    text += &match of_particles {
        true => format!("{:<16} {:>8} {:>9} {:>14}", "view", "r px", "seconds", "particles/s"),
        false => format!("{:<16} {:>9}", "view", "seconds"),
    };
    for v in &report.views {
        text += &match (v.radius_px, v.particles_per_second) {
            (Some(radius), Some(rate)) => {
                format!("\n{:<16} {radius:>8.3} {:>9.3} {:>14}", v.view.name, v.seconds, number(rate))
            }
            _ => format!("\n{:<16} {:>9.3}", v.view.name, v.seconds),
        };
    }
    text
}

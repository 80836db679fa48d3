//! `particlegs reference IN... --style S --out DIR`.

use crate::commands::render::pictures_text;
use crate::common::{Common, named};
use crate::device::DeviceArgs;
use crate::picture_args::{DensityArgs, FieldArgs, FigureArgs, SequenceArgs, ViewArgs};
use crate::snapshot_args::{ParticleArgs, SelectionArgs, SnapshotArgs};
use clap::{Args, ValueHint};
use particlegs::Snapshot;
use particlegs::pictures::{PictureOptions, PictureStyle, render_snapshot};
use particlegs_core::Result;
use std::path::PathBuf;

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
    #[arg(long, value_name = "STYLE", default_value = "paraview", value_parser = named::<PictureStyle>())]
    style: PictureStyle,
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
    #[arg(long, value_name = "K", help_heading = "Options of --style density", hide_short_help = true)]
    smooth: Option<usize>,
    #[command(flatten)]
    snapshot: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(a: &Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let options = PictureOptions {
        output: a.out.clone(),
        style: Some(a.style),
        view: a.view.options(),
        film: a.sequence.options(),
        figure: a.figure.options(),
        field: a.field.options(),
        colormap: a.density.colormap,
        range: a.density.range()?,
        raw: a.density.raw,
        smooth: a.smooth,
        device: a.device.open()?,
    };
    let files = a.input.iter().chain(options.files()).chain(&a.snapshot.topology);
    context.reads(files.map(PathBuf::as_path), false)?;
    let choice = ParticleArgs::without_window(&a.snapshot, &a.selection).choice(a.common.seed)?;
    let report = render_snapshot(&Snapshot::of_files(&a.input, choice), &options, &context.outputs, &context)?;
    context.finish(&pictures_text(&report), &report)
}

//! `particlegs eval MODEL SNAPSHOT...`.

use crate::common::Common;
use crate::device::DeviceArgs;
use crate::inputs;
use crate::snapshot_args::ParticleArgs;
use clap::{Args, ValueHint};
use particlegs::evaluation::EvaluationViews;
use particlegs::{Model, Snapshot};
use particlegs_core::Result;
use particlegs_core::picture::Size;
use particlegs_files::ViewsFile;
use particlegs_files::input::name_of;
use particlegs_particles::Storage;
use particlegs_pictures::certificate;
use std::path::PathBuf;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(after_help = "\
Compares pictures from the far, mid and near orbits in three styles. Beside each score are the
noise-free score, the gap to it, and the scores of an all-black picture and a uniform box, which a
model must clearly beat (docs/guide/certificate.md).

Examples:
  particlegs eval model.pgs snapshot
  particlegs eval model.pgs snapshot --frames 80 --json scores.json
  particlegs eval model.pgs snapshot --views views.json
  particlegs eval model.pgs snapshot --pictures pictures")]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "MODEL", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// Snapshot: its first file, its folder, or raw columns x y z (w).
    #[arg(required = true, value_name = "SNAPSHOT")]
    input: Vec<PathBuf>,
    /// Number of views per orbit.
    ///
    /// Their radii and opacities are drawn at random (--seed).
    #[arg(long, value_name = "N", default_value_t = 8)]
    frames: usize,
    /// Score the views of a views file instead.
    ///
    /// Scores are averaged by orbit: the part of a view's name before the first `_`.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "frames")]
    views: Option<PathBuf>,
    /// Picture size in pixels.
    #[arg(long, value_name = "WxH", default_value = "1920x1080", conflicts_with = "views")]
    size: Size,
    /// Folder for pictures of snapshot, model, error and surface density.
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

pub fn run(mut a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let inputs =
        a.input.iter().chain([&a.model]).chain(&a.views).chain(&a.particles.opening.topology).map(PathBuf::as_path);
    context.reads(inputs, false)?;
    if let Some(folder) = &a.pictures {
        certificate::declare(folder, &context.outputs, &context)?;
    }
    let bytes = inputs::model_with_snapshot(&a.model, &mut a.particles.opening, &context)?;
    let name = name_of(&a.model);
    let model = Model::decode(bytes, &name, &context)?;
    let snapshot = Snapshot::of_files(&a.input, a.particles.choice(context.common.seed)?);
    let views = match &a.views {
        Some(path) => EvaluationViews::Stated(ViewsFile::read(path, &context)?.0, path.display().to_string()),
        None => EvaluationViews::Orbits { frames: a.frames, size: a.size, seed: context.common.seed },
    };
    let (layers, device) = (&a.particles.opening.particle_type, a.device.open()?);
    let report = model.evaluate(layers, &snapshot, views, device.as_deref(), &context)?;
    if let Some(folder) = &a.pictures {
        // The pictures show the layers that were scored.
        let model = model.decoded().clone().only_named(&a.particles.opening.particle_type)?;
        let units = model.metadata.unit_system();
        let particles = snapshot.particles(&context)?.in_units(&units, &Storage::Memory, &context)?;
        certificate::write(folder, &model, &particles, &context)?;
    }
    context.finish(&report.text(), &report)
}

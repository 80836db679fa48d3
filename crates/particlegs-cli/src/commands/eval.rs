//! `particlegs eval MODEL SNAPSHOT...`.

use crate::common::{CommandContext, Common};
use crate::device::DeviceArgs;
use crate::inputs;
use crate::snapshot_args::ParticleArgs;
use crate::text_wrap::counted;
use clap::{Args, ValueHint};
use particlegs_compress::source_difference;
use particlegs_core::camera::View;
use particlegs_core::model::Model;
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result, codec};
use particlegs_files::ViewsFile;
use particlegs_files::input::name_of;
use particlegs_files::model_file;
use particlegs_measure::score;
use particlegs_measure::score::{Evaluation, LookScores, MeanViewScores};
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

#[derive(serde::Serialize)]
struct EvalReport {
    #[serde(flatten)]
    evaluation: Evaluation,
    model_bytes: u64,
    raw_bytes: u64,
    compression_ratio: f64,
    gaussians: usize,
    bytes_per_gaussian: f64,
    particles: u64,
    /// Are these the particles that the model was made from?
    source_matches: bool,
    width: usize,
    height: usize,
    views_from: String,
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
    let place = name_of(&a.model);
    let whole = codec::decode_with(&bytes, &place, &context)?;
    let layers = whole.layers.len();
    let model = a.particles.opening.layers_of(whole)?;
    let particles = a.particles.read(&a.input, context.common.seed, &Storage::Memory, &context)?;
    // The hash is of all layers.
    let of_several = model.layers.len() < layers || model_file::is_of_several(&bytes, &model.metadata, &place)?;
    let difference = source_difference(&particles, &model, of_several);
    if let Some(why) = difference {
        context.message(&format!(
            "warning: {} is not the snapshot that {place} was made from ({why}: {} particles, made from {})",
            a.input[0].display(),
            particles.len(),
            model.metadata.count,
        ));
    }
    let particles = particles.in_units(&model.metadata.unit_system(), &Storage::Memory, &context)?;
    let (views, size, views_from) = views(&a, &model, &context)?;
    let device = a.device.open()?;
    let info = codec::read_info(&bytes, &place)?;
    let (model_bytes, gaussians) = (bytes.len() as u64, model.gaussians());
    let report = EvalReport {
        evaluation: score::evaluate(&model, &particles, &views, size, device.as_deref(), &context)?,
        model_bytes,
        raw_bytes: info.raw_bytes(),
        compression_ratio: info.compression_ratio(),
        gaussians,
        bytes_per_gaussian: model_bytes as f64 / gaussians.max(1) as f64,
        particles: particles.len() as u64,
        source_matches: difference.is_none(),
        width: size.width,
        height: size.height,
        views_from,
    };
    if let Some(folder) = &a.pictures {
        certificate::write(folder, &model, &particles, &context)?;
    }
    context.finish(&table(&report), &report)
}

/// The views, their size, and a text about their origin.
fn views(a: &Arguments, model: &Model, context: &CommandContext) -> Result<(Vec<View>, Size, String)> {
    if let Some(path) = &a.views {
        let ViewsFile(set) = ViewsFile::read(path, context)?;
        return Ok((set.views, set.size, format!("{}", path.display())));
    }
    if a.frames == 0 || a.frames > 10_000 {
        return Err(Error::argument(format!("--frames {} is outside 1 to 10000", a.frames)));
    }
    let seed = context.common.seed;
    let words = format!("{} per orbit, seed {seed}", counted(a.frames, "view"));
    Ok((score::evaluation_views(&model.metadata, a.size, seed, a.frames), a.size, words))
}

fn table(r: &EvalReport) -> String {
    let mut text = format!(
        "{} Gaussians, {} bytes: ratio {:.1}, {:.2} bytes per Gaussian\n{} views of {}x{} ({})\n{}",
        r.gaussians,
        r.model_bytes,
        r.compression_ratio,
        r.bytes_per_gaussian,
        r.evaluation.views.len(),
        r.width,
        r.height,
        r.views_from,
        if r.source_matches { "" } else { "these are not the particles that the model was made from\n" }
    );
    text += &format!(
        "\n{:<17} {:<6} {:>9} {:>8} {:>7} {:>10} {:>6} {:>10} {:>9} {:>8}",
        "against", "orbit", "masked dB", "PSNR dB", "SSIM", "noise-free", "gap", "shot noise", "all black", "uniform"
    );
    for (name, pick) in LOOKS {
        for (orbit, mean) in r.evaluation.by_orbit.iter().chain([&("mean", r.evaluation.mean)]) {
            text += &row(name, orbit, pick(mean));
        }
    }
    text + "\nMeans over views; noise-free, gap, shot noise, all black and uniform (box) are\nmasked PSNR in dB."
}

type ScoreSelector = fn(&MeanViewScores) -> &LookScores;

const LOOKS: [(&str, ScoreSelector); 3] =
    [("paraview", |m| &m.paraview), ("paraview-no-fxaa", |m| &m.paraview_no_fxaa), ("expected", |m| &m.expected)];

fn row(look: &str, orbit: &str, s: &LookScores) -> String {
    let db = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.2}"));
    let ssim = s.model.ssim.map_or("-".into(), |v| format!("{v:.4}"));
    let noise_free = if look == "expected" { "identical".into() } else { db(s.noise_free.masked_psnr) };
    let mut row = format!(
        "\n{look:<17} {orbit:<6} {:>9} {:>8} {ssim:>7} {noise_free:>10} {:>6} {:>10} {:>9} {:>8}",
        db(s.model.masked_psnr),
        db(s.model.psnr),
        db(s.gap.masked_psnr),
        db(s.shot_noise.flatten()),
        db(s.all_black.masked_psnr),
        db(s.uniform_box.masked_psnr)
    );
    if let Some(n) = s.left_out.filter(|n| *n > 0) {
        row += &format!("   (without the {n} views that have no value)");
    }
    row
}

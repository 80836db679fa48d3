//! Trained models: cached by their inputs; interrupted runs continue where they stopped.

mod recording;

use crate::lab::{Lab, ModelBuild};
use crate::snapshot::Snapshot;
use particlegs_compress::{Checkpoint, CompressedModel, FineTuning, Options, Target, compress, finetune};
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, LawKind};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
use particlegs_particles::Particles;
use particlegs_train::{Config, Densify, Limits, Preset, Stage};
use recording::{CurveCheckpoint, CurveRecorder, curve_of, seconds_of};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Limit of Gaussians, relative to the start of the published recipe. Except at very small scales it makes fewer.
const ROOM: u64 = 6;
/// Limit of Gaussians per Gaussian in fine-tuning; DSSIM alone makes 6 (paper, table of fine-tuning).
const TUNING_ROOM: u64 = 8;
/// The limit with quick settings.
const QUICK_TUNING_ROOM: u64 = 2;
/// From this share of the limit on, a number of Gaussians counts as limited.
const HELD: f64 = 0.98;
/// Held-out views for scores during training, except in the long run.
const HELD_OUT: u64 = 4;
/// Width in pixels of the last stage of the preset `fast`, and of the published recipe.
const WIDTHS: [f64; 2] = [1440.0, 5760.0];

/// A model to train on all particles.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct TrainingTask {
    pub target: Target,
    /// `None` = not trained.
    pub training: Option<Config>,
    /// Number of blocks, each trained on its own.
    pub blocks: u32,
    /// Seed of the start, pictures and steps.
    pub seed: u64,
}

impl TrainingTask {
    /// The published law by `training`, with as many Gaussians as it makes.
    pub fn published(training: Config, blocks: u32, seed: u64) -> TrainingTask {
        let most = ROOM * u64::from(blocks) * training.start_gaussians.unwrap_or(1);
        TrainingTask { target: Target::Gaussians(most), training: Some(training), blocks, seed }
    }

    /// The same, started from a fit of as many Gaussians as the recipe draws.
    pub fn published_from_fit(mut training: Config, seed: u64) -> TrainingTask {
        let first = training.start_gaussians.unwrap_or(1);
        training.alpha_blend.most_gaussians = Some(ROOM * first);
        TrainingTask { target: Target::Gaussians(first), training: Some(training), blocks: 1, seed }
    }

    /// The same in a file of `bytes`, which may limit the number of Gaussians.
    pub fn published_in(bytes: u64, scale: f64, seed: u64) -> Result<TrainingTask> {
        Ok(TrainingTask { target: Target::Size(bytes), training: Some(recipe().scaled(scale)?), blocks: 1, seed })
    }

    /// Our law in a file of `bytes`.
    pub fn ours(bytes: u64, training: Option<Config>, seed: u64) -> TrainingTask {
        TrainingTask { target: Target::Size(bytes), training, blocks: 1, seed }
    }
}

/// Share of the published recipe to train whole models with, if many are compared.
pub(crate) fn scale(lab: &Lab<'_>) -> f64 {
    lab.settings.scale.unwrap_or(if lab.settings.quick { 0.02 } else { 0.08 })
}

/// The published recipe, not scaled.
pub(crate) fn recipe() -> Config {
    Config { evaluate_views: HELD_OUT, ..Config::preset(Preset::Paper, LawKind::AlphaBlend) }
}

/// Smallest number of Gaussians at the start.
const FEWEST: f64 = 64.0;

/// A scaled recipe: picture width and height, steps and pictures by `scale`, first Gaussians by its square, so that
/// their number per pixel stays the same.
pub(crate) fn scaled(config: Config, scale: f64) -> Result<Config> {
    let start_gaussians = config.start_gaussians.map(|n| (n as f64 * scale * scale).round().max(FEWEST) as u64);
    Ok(Config { start_gaussians, ..config.scaled(scale)? })
}

/// Our preset `fast`, with the last stage as large as that of the published recipe at `scale`.
pub(crate) fn ours_at(scale: f64) -> Result<Config> {
    let fast = Config { evaluate_views: HELD_OUT, ..Config::preset(Preset::Fast, LawKind::OpticalDepth) };
    scaled(fast, (scale * WIDTHS[1] / WIDTHS[0]).min(1.0))
}

/// The published recipe in one stage of the first stage's size, with all its steps.
pub(crate) fn single_resolution() -> Config {
    let all = recipe();
    let until = all.stages.iter().map(|s| s.densify.until).max().unwrap_or(0);
    let first = all.stages[0];
    let densify = Densify { until, ..first.densify };
    Config { stages: vec![Stage { iterations: all.iterations(), densify, ..first }], ..all }
}

/// Sizes of the first stage, which the paper scores, and of the last.
pub(crate) fn sizes(config: &Config) -> [Size; 2] {
    let size_of = |s: Option<&Stage>| s.map_or([16, 9], |s| s.size);
    [size_of(config.stages.first()), size_of(config.stages.last())].map(|[width, height]| Size { width, height })
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingScore {
    /// Block; empty if there is only one.
    #[serde(default)]
    pub run: String,
    pub iteration: u64,
    /// Seconds of training so far, including earlier runs.
    pub seconds: f64,
    /// Masked PSNR on held-out views, dB.
    pub held_out_masked_psnr: Option<f64>,
    pub gaussians: u64,
}

pub(crate) struct TrainingResult {
    pub made: ModelBuild,
    pub curve: Vec<TrainingScore>,
    /// Steps done, if the run is not finished; this is then its best model so far.
    pub unfinished: Option<u64>,
    /// Whether it reached the limit of Gaussians.
    pub held: bool,
}

impl TrainingResult {
    fn held_by(self, most: u64) -> TrainingResult {
        TrainingResult { held: self.made.model.gaussians() as f64 >= HELD * most as f64, ..self }
    }
}

/// The model of a task, cached.
pub(crate) fn trained(lab: &Lab<'_>, snapshot: &Snapshot, task: &TrainingTask) -> Result<TrainingResult> {
    trained_on(lab, &snapshot.particles, &snapshot.hash, task, None)
}

/// No limits, only the device.
fn limits(lab: &Lab<'_>) -> Limits {
    Limits { device: lab.settings.device.clone(), ..Limits::default() }
}

/// [`trained`] on named particles. With `piece`, training pauses after that time, and the next call continues.
pub(crate) fn trained_on(
    lab: &Lab<'_>,
    particles: &Particles,
    hash: &str,
    task: &TrainingTask,
    piece: Option<Duration>,
) -> Result<TrainingResult> {
    let options = Options {
        target: task.target,
        training: task.training.clone(),
        blocks: Some(task.blocks),
        seed: task.seed,
        limits: limits(lab),
        certificate: CertificateLevel::None,
        ..Options::default()
    };
    let work = |checkpoints: &mut dyn CheckpointStore, context: &Context<'_>| {
        compress(particles, &options, checkpoints, context)
    };
    let trained = kept(lab, &("compress", hash, task), piece, work)?;
    Ok(match (task.target, &task.training) {
        (Target::Gaussians(most), Some(c)) if c.law == LawKind::AlphaBlend => {
            trained.held_by(c.alpha_blend.most_gaussians.unwrap_or(most))
        }
        _ => trained,
    })
}

/// A merged model, fine-tuned by `config`, cached. It has as many Gaussians as the recipe makes.
pub(crate) fn tuned(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    merged: &ModelBuild,
    config: &Config,
    seed: u64,
) -> Result<TrainingResult> {
    let room = if lab.settings.quick { QUICK_TUNING_ROOM } else { TUNING_ROOM };
    let most = room * merged.model.gaussians() as u64;
    let options = FineTuning {
        target: Target::Gaussians(most),
        training: config.clone(),
        limits: limits(lab),
        memory: None,
        seed,
        certificate: CertificateLevel::None,
    };
    let model = blake3::hash(&merged.bytes).to_hex().to_string();
    let work = |checkpoints: &mut dyn CheckpointStore, context: &Context<'_>| {
        let size = merged.bytes.len() as u64;
        finetune(&merged.model, size, &snapshot.particles, &options, checkpoints, context)
    };
    Ok(kept(lab, &("finetune", model, &snapshot.hash, config, seed, most), None, work)?.held_by(most))
}

/// Caches the result of `work` by `inputs`, with its curve; the checkpoint is kept until it is finished.
fn kept(
    lab: &Lab<'_>,
    inputs: &impl Serialize,
    piece: Option<Duration>,
    work: impl FnOnce(&mut dyn CheckpointStore, &Context<'_>) -> Result<CompressedModel>,
) -> Result<TrainingResult> {
    let path = lab.on_device.path("checkpoint", inputs, "checkpoint");
    let inputs_json =
        serde_json::to_vec(inputs).map_err(|e| Error::input(path.display().to_string(), e.to_string()))?;
    let mut best = None;
    let outcome = lab.made_on_device(inputs, || {
        let checkpoint = Checkpoint::open(path.clone(), blake3::hash(&inputs_json).as_bytes())?;
        let recorder = CurveRecorder::new(lab.context.sink(), curve_of(&checkpoint), piece);
        let before = seconds_of(&checkpoint);
        let mut curve_checkpoint = CurveCheckpoint { checkpoint, recorder: &recorder, before, start: Instant::now() };
        let cancel = || lab.context.cancelled() || recorder.ends_training();
        let done = work(&mut curve_checkpoint, &lab.context.with_sink(&recorder).with_cancel(&cancel));
        if done.as_ref().map_or_else(|e| matches!(e, Error::Cancelled), |d| d.stopped) {
            curve_checkpoint.keep_seconds()?;
        }
        curve_checkpoint.checkpoint.save()?;
        let (done, seconds) = (done?, curve_checkpoint.seconds());
        let curve = recorder.curve().clone();
        if !done.stopped {
            lab.on_device.result("curve", inputs, || Ok(curve))?;
            return Ok((done, seconds));
        }
        // A stop by the user is an error; a run out of time returns its best so far.
        if recorder.late() && !lab.context.cancelled() {
            let build = ModelBuild { bytes: done.bytes, model: done.model, seconds };
            let steps = done.trained.iter().map(|run| run.iterations).sum();
            best = Some(TrainingResult { made: build, curve, unfinished: Some(steps), held: false });
        }
        Err(Error::Cancelled)
    });
    if let (Some(best), Err(Error::Cancelled)) = (best, &outcome) {
        return Ok(best);
    }
    let build = outcome?;
    // The model is cached by now, so its checkpoint is no longer needed.
    if path.exists() {
        std::fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
    }
    let curve = lab.on_device.result("curve", inputs, || Ok(Vec::new()))?;
    Ok(TrainingResult { made: build, curve, unfinished: None, held: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use particlegs_core::context::Context;

    fn small() -> Config {
        Config { evaluate_every: 20, ..scaled(recipe(), 0.004).unwrap() }
    }

    /// A run in short pieces ends with the bytes and the curve of one that was never broken.
    #[test]
    fn interrupted_runs_give_the_same_bytes_and_curve() {
        let (snapshot, folders) = (crate::testing::snapshot(), [0, 1].map(|_| tempfile::tempdir().unwrap()));
        let [whole, parts] =
            folders.each_ref().map(|f| Lab::new(Settings::new(true, "".into()), f.path(), &Context::SILENT).unwrap());
        let task = TrainingTask::published(small(), 1, 42);
        let all = trained(&whole, &snapshot, &task).unwrap();
        assert!(all.unfinished.is_none() && all.curve.len() >= 8, "{:?}", all.curve);
        let (mut pieces, mut seconds) = (0, 0.0);
        let last = loop {
            let piece = Some(Duration::from_millis(if pieces == 0 { 0 } else { 30 + 60 * pieces }));
            let training = trained_on(&parts, &snapshot.particles, &snapshot.hash, &task, piece).unwrap();
            // Those of all pieces, each more than the one before.
            assert!(training.made.seconds > seconds, "{} {seconds}", training.made.seconds);
            seconds = training.made.seconds;
            if training.unfinished.is_none() {
                break training;
            }
            pieces += 1;
            assert!(pieces < 200);
        };
        assert!(pieces > 0);
        assert_eq!(last.made.bytes, all.made.bytes);
        let steps = |t: &TrainingResult| -> Vec<_> {
            t.curve.iter().map(|e| (e.iteration, e.held_out_masked_psnr, e.gaussians)).collect()
        };
        assert_eq!(steps(&last), steps(&all));
        // The checkpoint is gone, and the model is kept.
        let left = std::fs::read_dir(folders[1].path()).unwrap();
        assert!(left.flatten().all(|f| f.path().extension().is_none_or(|e| e != "checkpoint")));
        assert_eq!(trained(&parts, &snapshot, &task).unwrap().made.bytes, all.made.bytes);
    }

    #[test]
    fn one_stage_has_all_steps() {
        let (one, all) = (single_resolution(), recipe());
        assert_eq!((one.iterations(), one.stages.len()), (all.iterations(), 1));
        assert_eq!((one.stages[0].densify.until, one.stages[0].size), (36_000, [1920, 1080]));
        let tenth = scaled(all, 0.1).unwrap();
        assert_eq!((tenth.iterations(), tenth.start_gaussians), (3900, Some(2000)));
        let [first, last] = sizes(&tenth);
        assert_eq!([first.width, first.height, last.width, last.height], [192, 108, 576, 324]);
        assert_eq!(ours_at(0.1).unwrap().stages.last().unwrap().size, [576, 324]);
    }
}

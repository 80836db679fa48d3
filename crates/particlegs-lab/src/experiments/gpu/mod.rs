//! Speed of a GPU in drawing and training. The scenes are built in.

mod frames;
mod particles;
mod rates;
mod scenes;
mod steps;
mod work;

use super::{Experiment, published_run};
use crate::gpu::TimedDevice;
use crate::lab::Lab;
use crate::results::{ExperimentResults, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use crate::store::COMMIT;
use crate::training::{TrainingTask, scaled, trained_on};
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
use particlegs_gpu::Device;
use particlegs_particles::Particles;
use particlegs_train::{Config, Preset};
use rates::Rates;
use scenes::TiledScene;
use std::sync::Arc;
use std::time::Duration;
use work::WorkBound;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "gpu",
    title: "Frames and training steps per second on a GPU",
    paper: "",
    trains: false,
    weight: 0,
    run,
};

const HD: Size = Size { width: 1920, height: 1080 };
const UHD: Size = Size { width: 3840, height: 2160 };
const SMALL: Size = Size { width: 320, height: 180 };
/// Time limit of a measurement.
const LIMIT: Duration = Duration::from_secs(20);

/// Training by the published recipe, full and quick: particles, scale, minutes per run.
const PARTICLES: [usize; 2] = [1 << 21, 20_000];
const SCALE: [f64; 2] = [1.0, 0.004];
const MINUTES: [f64; 2] = [120.0, 2.0];

/// Last columns of every table: the least work of one frame, step or picture.
const WORK: [&str; 7] = ["MB of GPU memory", "GB", "G adds", "G ops", "copies, %", "adds, %", "ops, %"];

#[derive(Clone, Copy)]
struct GpuBench<'a> {
    device: &'a Arc<Device>,
    timed: &'a TimedDevice,
    rates: Rates,
    quick: bool,
    context: &'a Context<'a>,
}

struct GpuTables {
    frames: ResultTable,
    steps: ResultTable,
    particles: ResultTable,
    kernels: ResultTable,
    /// Measurements that failed, and why.
    failed: Vec<String>,
}

/// With training, tables are cached, so that later runs only continue the training.
fn run(lab: &Lab<'_>, _: &[Snapshot]) -> Result<ExperimentResults> {
    let device = lab.gpu.as_ref().ok_or_else(|| Error::argument("this experiment needs a GPU"))?;
    let quick = lab.settings.quick;
    let now = || measure(device, quick, lab.context);
    let (mut tables, notes) = match lab.settings.training {
        true => lab.on_device.result("gpu", &(quick, COMMIT), now)?,
        false => now()?,
    };
    if lab.settings.training {
        let [(sample, tiles), ..] = tilings(quick);
        tables.extend(recipe(lab, &scenes::tiled(sample, tiles)?)?);
    }
    Ok(ExperimentResults { tables, notes, ..ExperimentResults::default() })
}

/// Copies of the sample along the axes: 171 000, 769 000 and 1.73 million Gaussians.
fn tilings(quick: bool) -> [(usize, [usize; 3]); 3] {
    match quick {
        true => [(1, [1, 2, 2]), (0, [1, 2, 2]), (0, [1, 2, 4])],
        false => [(1, [4, 8, 8]), (0, [4, 16, 16]), (0, [9, 16, 16])],
    }
}

fn measure(timed: &TimedDevice, quick: bool, context: &Context<'_>) -> Result<(Vec<ResultTable>, Vec<String>)> {
    let device = &timed.device;
    let rates = Rates::measure(device)?;
    let bench = GpuBench { device, timed, rates, quick, context };
    let (sizes, hd) = if quick { (&[SMALL][..], SMALL) } else { (&[HD, UHD][..], HD) };
    let [few, more, most] = tilings(quick).map(|(sample, tiles)| scenes::tiled(sample, tiles));
    let (few, more, most) = (few?, more?, most?);
    context.begin("measuring", 2 * (frames::OF_DEPTH + frames::OF_ALPHA) * sizes.len() as u64 + 4);
    let mut tables = GpuTables::new();
    for scene in [&few, &more] {
        for &size in sizes {
            tables.attempt(scene, size, |tables| frames::of_depth(bench, tables, scene, size))?;
            tables.attempt(scene, size, |tables| frames::of_alpha(bench, tables, &scene.published(), size))?;
        }
    }
    for scene in [&few, &most] {
        tables.attempt(scene, hd, |tables| steps::of_depth(bench, tables, scene, hd))?;
        context.advance(1);
    }
    tables.attempt(&few, hd, |tables| steps::of_alpha(bench, tables, &few.published(), hd))?;
    context.advance(1);
    tables.attempt(&few, hd, |tables| particles::row(bench, tables, &few, hd))?;
    context.end();
    let columns = ["copies, GB/s", "G atomic adds/s", "G float32 operations/s"];
    let mut rates_table = ResultTable::new("gpu-rates", "Highest rates of the GPU", &columns);
    rates_table.row([rates.copied_bytes, rates.additions, rates.operations].map(|r| TableCell::number(1e-9 * r, 2)));
    let mut notes = vec![format!(
        "Measured on {}. Copies, adds, ops: the minimum work of a frame, a step or a picture as a percentage of the \
         GPU's highest rates; 100 % is the fastest possible.",
        device.name()
    )];
    if tables.kernels.rows.is_empty() {
        notes.push("Kernels were not timed: the GPU has no timer queries.".into());
    }
    notes.append(&mut tables.failed);
    Ok((vec![rates_table, tables.frames, tables.steps, tables.particles, tables.kernels], notes))
}

/// Trains by the published recipe for some minutes, on particles drawn from a scene.
fn recipe(lab: &Lab<'_>, scene: &TiledScene) -> Result<[ResultTable; 2]> {
    let (quick_index, settings) = (usize::from(lab.settings.quick), &lab.settings);
    let [x, y, z] = scene.particles(PARTICLES[quick_index]);
    let snapshot = Snapshot::new("tiled".into(), "tiled".into(), Particles::from_columns(x, y, z), None);
    let scale = settings.scale.unwrap_or(SCALE[quick_index]);
    let config = scaled(Config::preset(Preset::Paper, LawKind::AlphaBlend), scale)?;
    let total_steps = config.iterations();
    let piece = Duration::from_secs_f64(60.0 * settings.minutes.unwrap_or(MINUTES[quick_index]));
    let task = TrainingTask::published(config, 1, settings.seed);
    let run = trained_on(lab, &snapshot.particles, &snapshot.hash, &task, Some(piece))?;
    let title = "The published recipe so far: run the same command again until all steps are done";
    let columns = ["share", "particles", "steps", "of", "s of all runs", "Gaussians", "held out, masked PSNR, dB"];
    let mut table = ResultTable::new("gpu-recipe", title, &columns);
    table.row([
        TableCell::number(scale, 3),
        TableCell::count(snapshot.particles.len() as u64),
        TableCell::count(run.unfinished.unwrap_or(total_steps)),
        TableCell::count(total_steps),
        TableCell::number(run.made.seconds, 0),
        TableCell::count(run.made.model.gaussians() as u64),
        TableCell::number(run.curve.iter().filter_map(|e| e.held_out_masked_psnr).reduce(f64::max), 2),
    ]);
    Ok([table, ResultTable { name: "gpu-recipe-curve".into(), ..published_run::table(&run.curve) }])
}

impl GpuTables {
    fn new() -> GpuTables {
        let table = |name, title, columns: &[&str]| ResultTable::new(name, title, &[columns, &WORK].concat());
        let frames = ["Gaussians", "pixels", "law", "look", "changes", "summed by", "radius, px", "footprints"];
        let frames = [&frames[..], &["frames/s", "frames/s, read back"]].concat();
        let steps = ["Gaussians", "pixels", "law", "footprints", "steps", "steps/s", "first loss", "last loss"];
        let particles = ["particles", "pixels", "look", "pictures", "s per picture", "s to load"];
        GpuTables {
            frames: table("gpu-frames", "Frames per second of models", &frames),
            steps: table("gpu-steps", "Training steps per second", &steps),
            particles: table("gpu-particles", "Pictures of all particles", &particles),
            kernels: ResultTable::new("gpu-kernels", "Time of kernels", &["of", "kernel", "runs", "ms"]),
            failed: Vec::new(),
        }
    }

    /// Records a failure, so that the other measurements go on.
    fn attempt(&mut self, scene: &TiledScene, size: Size, work: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        match work(self) {
            Err(Error::Cancelled) => Err(Error::Cancelled),
            Err(e) => {
                self.failed.push(format!(
                    "Not measured completely: {} Gaussians, {}: {e}",
                    scene.gaussians.len(),
                    pixels(size)
                ));
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    /// Times the kernels of `work`, which is this many frames, steps or pictures, if the device has timestamps; longest
    /// first.
    fn time_kernels(
        &mut self,
        bench: GpuBench<'_>,
        label: &str,
        number: usize,
        work: impl FnOnce() -> Result<()>,
    ) -> Result<()> {
        let mut all = bench.timed.timed(work)?.unwrap_or_default();
        all.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        for k in all {
            let (runs, ms) = (k.runs as f64 / number as f64, 1e3 * k.seconds / number as f64);
            let cells = [TableCell::number(runs, 1), TableCell::number(ms, 3)];
            self.kernels.row([TableCell::text(label), TableCell::text(k.kernel)].into_iter().chain(cells));
        }
        Ok(())
    }
}

impl GpuBench<'_> {
    /// The number to measure; few with --quick.
    fn either(&self, few: usize, many: usize) -> usize {
        if self.quick { few } else { many }
    }

    /// The last columns for this work at this rate.
    fn work(&self, per_second: f64, least: &WorkBound) -> [TableCell; WORK.len()] {
        let memory = self.device.device.generate_allocator_report().map(|r| 1e-6 * r.total_reserved_bytes as f64);
        let all = [least.bytes, least.additions, least.operations];
        let rates = [self.rates.copied_bytes, self.rates.additions, self.rates.operations];
        let share = |k: usize| TableCell::number(100.0 * per_second * all[k] / rates[k], 1);
        let [bytes, additions, operations] = all.map(|v| TableCell::number(1e-9 * v, 3));
        [TableCell::number(memory, 0), bytes, additions, operations, share(0), share(1), share(2)]
    }
}

fn pixels(size: Size) -> String {
    format!("{}x{}", size.width, size.height)
}

//! Training steps per second.

use super::scenes::{OPACITY, TiledScene, views};
use super::work::{BlendWork, DepthWork, WorkBound};
use super::{GpuBench, GpuTables, LIMIT, pixels};
use crate::results::TableCell;
use particlegs_core::Result;
use particlegs_core::camera::{Normalisation, View};
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::{Renderer, Scene};
use particlegs_core::splat::ToneStyle;
use particlegs_gpu::GpuAccelerator;
use particlegs_gpu::render::ScenePictures;
use particlegs_train::alpha::TrainingScale;
use particlegs_train::depth::{Parameters, StepSize};
use particlegs_train::{Accelerator, AlphaConfig, Crop, Loss, StepReport, TrainingSample, alpha};
use std::time::Instant;

/// Number of steps after two: the last uses the first picture again.
const STEPS: usize = 503;
const QUICK_STEPS: usize = 7;
/// Number of steps whose kernels are timed.
const TIMED: usize = 4;
/// Number of training pictures, used in turn.
const TARGETS: usize = 8;

/// Steps of the optical-depth law: counts of Gaussians start too high or too low by half, targets are the pictures of
/// the original.
pub(super) fn of_depth(bench: GpuBench<'_>, tables: &mut GpuTables, scene: &TiledScene, size: Size) -> Result<()> {
    let lesson = TrainingPictures::new(bench, scene, &Scene::from_mixture(&scene.gaussians, scene.bounds), size)?;
    let mut gaussians = scene.gaussians.clone();
    gaussians.count.iter_mut().enumerate().for_each(|(i, n)| *n *= if i % 2 == 0 { 0.5 } else { 1.5 });
    let mut parameters = Parameters::new(&gaussians, scene.particles, 48, scene.bounds, ToneStyle::Expected);
    let mut steps = GpuAccelerator::new(bench.device.clone()).depth_steps(&parameters)?;
    let pace = StepSize { rates: [0.01; 3], beta1: 0.9, beta2: 0.999, epsilon: 0.5, decay: 0.0, average: 0.01 };
    let work = DepthWork::new(scene, &lesson.views[0], size)?;
    let work = (work.footprints, work.step(scene.gaussians.len(), size));
    lesson.take(bench, tables, work, |shot| steps.step(&mut parameters, shot, &Loss::PUBLISHED, &pace))
}

/// Steps of the alpha-blend law at the published rates: opacities start too high or too low by half.
pub(super) fn of_alpha(bench: GpuBench<'_>, tables: &mut GpuTables, tiles: &TiledScene, size: Size) -> Result<()> {
    let scene = Scene::from_law(&tiles.gaussians, tiles.bounds, tiles.radius, OPACITY);
    let lesson = TrainingPictures::new(bench, tiles, &scene, size)?;
    let mut gaussians = tiles.gaussians.clone();
    if let Some(law) = gaussians.law.alpha_blend_mut() {
        let change = |(i, o): (usize, &mut f64)| *o = (*o * if i % 2 == 0 { 0.5 } else { 1.5 }).min(0.95);
        law.opacity.iter_mut().enumerate().for_each(change);
    }
    let frame = Normalisation::new(&tiles.bounds);
    let scale = TrainingScale { frame, radius: tiles.radius, opacity: OPACITY, particles: tiles.particles, seed: 1 };
    let mut parameters = alpha::Gaussians::from_mixture(&gaussians, scale)?;
    let mut steps = GpuAccelerator::new(bench.device.clone()).alpha_steps(&parameters)?;
    let c = AlphaConfig::default();
    let pace = alpha::StepSize {
        rates: [c.position_rate * c.extent, c.scale_rate, c.rotation_rate, c.opacity_rate, c.feature_rate],
        network: c.vizmapper_rate,
        clip: c.vizmapper_clip,
        identity: c.identity,
    };
    let work = BlendWork::new(tiles, &lesson.views[0], size, bench.context)?;
    let work = (work.footprints, work.step(tiles.gaussians.len(), size));
    lesson.take(bench, tables, work, |shot| steps.step(&mut parameters, shot, &Loss::PUBLISHED, &pace))
}

/// Training pictures.
struct TrainingPictures<'a> {
    law: LawKind,
    made: &'a TiledScene,
    size: Size,
    views: Vec<View>,
    /// Brightness in [0, 1].
    targets: Vec<Plane>,
}

impl<'a> TrainingPictures<'a> {
    /// Pictures of the original scene.
    fn new(bench: GpuBench<'_>, tiles: &'a TiledScene, scene: &Scene, size: Size) -> Result<Self> {
        let views: Vec<View> = views(tiles, size, true).into_iter().step_by(64 / TARGETS).collect();
        let pictures = ScenePictures::new(bench.device, scene)?;
        let one = |view| {
            let levels = pictures.draw(view, size, ToneStyle::Expected, bench.context)?;
            Ok(Plane { size, data: levels.data.iter().map(|&v| f32::from(v) / 255.0).collect() })
        };
        let targets = views.iter().map(one).collect::<Result<_>>()?;
        Ok(TrainingPictures { law: scene.law(), made: tiles, size, views, targets })
    }

    /// Takes all steps, or as many as the time allows, and adds a row.
    fn take(
        &self,
        bench: GpuBench<'_>,
        tables: &mut GpuTables,
        (footprints, least): (u64, WorkBound),
        mut step: impl FnMut(&TrainingSample<'_>) -> Result<StepReport>,
    ) -> Result<()> {
        let mut one = |k: usize| -> Result<f64> {
            bench.context.check()?;
            let (view, target) = (&self.views[k % TARGETS], &self.targets[k % TARGETS]);
            Ok(step(&TrainingSample { view, target, crop: Crop::whole(self.size), context: bench.context })?.loss)
        };
        // Warm up.
        let mut losses = [one(0)?, one(1)?];
        let (started, mut steps) = (Instant::now(), 0);
        let (most, timed) = (bench.either(QUICK_STEPS, STEPS), bench.either(1, TIMED));
        while steps < most && started.elapsed() < LIMIT {
            losses[1] = one(2 + steps)?;
            steps += 1;
        }
        let per_second = steps as f64 / started.elapsed().as_secs_f64();
        let (law, gaussians) = (self.law.name(), self.made.gaussians.len());
        let label = format!("step of {gaussians}, {}, {law}", pixels(self.size));
        tables.time_kernels(bench, &label, timed, || (0..timed).try_for_each(|k| one(2 + steps + k).map(drop)))?;
        let cells = [
            TableCell::count(gaussians as u64),
            TableCell::text(pixels(self.size)),
            TableCell::text(law),
            TableCell::count(footprints),
            TableCell::count(steps as u64),
            TableCell::number(per_second, 1),
            TableCell::number(losses[0], 5),
            TableCell::number(losses[1], 5),
        ];
        tables.steps.row(cells.into_iter().chain(bench.work(per_second, &least)));
        Ok(())
    }
}

//! Steps of training a second.

use super::scenes::{OPACITY, TiledScene, views};
use super::stages::KernelStages;
use super::work::{BlendWork, DepthWork, WorkBound};
use super::{LIMIT, QuickRun, in_megabytes};
use crate::common::Context;
use particlegs::Result;
use particlegs::camera::{Normalisation, View};
use particlegs::model::LawKind;
use particlegs::picture::{Plane, Size};
use particlegs::progress::{Progress, Silent};
use particlegs::render::{Renderer, Scene};
use particlegs::splat::ToneStyle;
use particlegs::train::alpha::{self, TrainingScale};
use particlegs::train::depth::{Parameters, StepSize};
use particlegs::train::{Accelerator, AlphaConfig, Crop, Loss, StepReport, TrainingSample};
use particlegs_gpu::Device;
use particlegs_gpu::GpuAccelerator;
use particlegs_gpu::Rates;
use particlegs_gpu::render::ScenePictures;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Steps of a measurement, behind two: so many that the last, as the first, is of the first picture.
const STEPS: usize = 503;
const QUICK_STEPS: usize = 7;
/// Steps whose kernels are timed.
const TIMED: usize = 4;
/// Pictures that are learnt from in turn.
const TARGETS: usize = 8;

#[derive(Serialize, Deserialize)]
pub struct TrainingRow {
    law: LawKind,
    gaussians: usize,
    width: usize,
    height: usize,
    steps: usize,
    steps_per_second: f64,
    /// Loss of the first and of the last step.
    losses: [f64; 2],
    device_memory_bytes: Option<u64>,
    /// Footprints of a step's picture.
    footprints: u64,
    /// What a step takes at least.
    #[serde(flatten)]
    least: WorkBound,
    stages: KernelStages,
}

/// Steps of the optical-depth law from Gaussians that are half as many particles each too many or too few, by pictures
/// of those as they were.
pub fn of_depth(
    device: &Arc<Device>,
    made: &TiledScene,
    size: Size,
    quick: QuickRun,
    context: &Context,
) -> Result<TrainingRow> {
    let lesson = TrainingPictures::new(device, made, &Scene::of_mixture(&made.gaussians, made.bounds), size)?;
    let mut gaussians = made.gaussians.clone();
    gaussians.count.iter_mut().enumerate().for_each(|(i, n)| *n *= if i % 2 == 0 { 0.5 } else { 1.5 });
    let mut of = Parameters::new(&gaussians, made.particles, 48, (made.bounds, ToneStyle::Expected));
    let mut steps = GpuAccelerator::new(device.clone()).depth_steps(&of)?;
    let pace = StepSize { rates: [0.01; 3], beta1: 0.9, beta2: 0.999, calm: 0.5, pull: 0.0, average: 0.01 };
    let taken = lesson.take(quick, context, |shot| steps.step(&mut of, shot, &Loss::PUBLISHED, &pace))?;
    let work = DepthWork::of(made, &lesson.views[0], size)?;
    let least = work.step(made.gaussians.len(), size);
    Ok(taken.row(LawKind::OpticalDepth, made, &lesson, (work.footprints, least)))
}

/// Steps of the alpha-blend law, at the published rates, from Gaussians half as opaque, or half more, as those of the
/// pictures.
pub fn of_alpha(
    device: &Arc<Device>,
    made: &TiledScene,
    size: Size,
    quick: QuickRun,
    context: &Context,
) -> Result<TrainingRow> {
    let scene = Scene::of_law(&made.gaussians, made.bounds, [made.radius, OPACITY]);
    let lesson = TrainingPictures::new(device, made, &scene, size)?;
    let mut gaussians = made.gaussians.clone();
    if let Some(law) = gaussians.law.alpha_blend_mut() {
        let change = |(i, o): (usize, &mut f64)| *o = (*o * if i % 2 == 0 { 0.5 } else { 1.5 }).min(0.95);
        law.opacity.iter_mut().enumerate().for_each(change);
    }
    let frame = Normalisation::of(&made.bounds);
    let ground = TrainingScale { frame, radius: made.radius, opacity: OPACITY, particles: made.particles, seed: 1 };
    let mut of = alpha::Gaussians::of_mixture(&gaussians, ground)?;
    let mut steps = GpuAccelerator::new(device.clone()).alpha_steps(&of)?;
    let c = AlphaConfig::default();
    let pace = alpha::StepSize {
        rates: [c.position_rate * c.extent, c.scale_rate, c.rotation_rate, c.opacity_rate, c.feature_rate],
        network: c.vizmapper_rate,
        clip: c.vizmapper_clip,
        identity: c.identity,
    };
    let taken = lesson.take(quick, context, |shot| steps.step(&mut of, shot, &Loss::PUBLISHED, &pace))?;
    let work = BlendWork::of(made, &lesson.views[0], size, context)?;
    let least = work.step(made.gaussians.len(), size);
    Ok(taken.row(LawKind::AlphaBlend, made, &lesson, (work.footprints, least)))
}

/// Pictures that are learnt from.
struct TrainingPictures<'a> {
    device: &'a Arc<Device>,
    views: Vec<View>,
    /// Brightness in [0, 1].
    targets: Vec<Plane>,
    size: Size,
}

/// Steps that were taken.
struct TrainingSteps {
    steps: usize,
    seconds: f64,
    losses: [f64; 2],
    stages: KernelStages,
}

impl<'a> TrainingPictures<'a> {
    /// Of the scene as it is.
    fn new(device: &'a Arc<Device>, made: &TiledScene, scene: &Scene, size: Size) -> Result<Self> {
        let views: Vec<View> = views(made, size, true).into_iter().step_by(64 / TARGETS).collect();
        let pictures = ScenePictures::new(device, scene)?;
        let one = |view| {
            let levels = pictures.draw(view, size, ToneStyle::Expected, &Silent)?;
            Ok(Plane { size, data: levels.data.iter().map(|&v| f32::from(v) / 255.0).collect() })
        };
        let targets = views.iter().map(one).collect::<Result<_>>()?;
        Ok(TrainingPictures { device, views, targets, size })
    }

    /// Takes steps until all are taken or the time is over.
    fn take(
        &self,
        quick: QuickRun,
        context: &Context,
        mut step: impl FnMut(&TrainingSample<'_>) -> Result<StepReport>,
    ) -> Result<TrainingSteps> {
        let mut one = |k: usize| -> Result<f64> {
            context.check()?;
            let (view, target) = (&self.views[k % TARGETS], &self.targets[k % TARGETS]);
            Ok(step(&TrainingSample { view, target, crop: Crop::whole(self.size), progress: context })?.loss)
        };
        // Everything is compiled and there.
        let mut losses = [one(0)?, one(1)?];
        let (started, mut steps) = (Instant::now(), 0);
        let (most, timed) = (quick.or(QUICK_STEPS, STEPS), quick.or(1, TIMED));
        while steps < most && started.elapsed() < LIMIT {
            losses[1] = one(2 + steps)?;
            steps += 1;
        }
        let seconds = started.elapsed().as_secs_f64();
        let stages =
            KernelStages::of(self.device, timed, || (0..timed).try_for_each(|k| one(2 + steps + k).map(drop)))?;
        Ok(TrainingSteps { steps, seconds, losses, stages })
    }
}

impl TrainingSteps {
    fn row(
        self,
        law: LawKind,
        made: &TiledScene,
        of: &TrainingPictures<'_>,
        (footprints, least): (u64, WorkBound),
    ) -> TrainingRow {
        TrainingRow {
            law,
            gaussians: made.gaussians.len(),
            width: of.size.width,
            height: of.size.height,
            steps: self.steps,
            steps_per_second: self.steps as f64 / self.seconds,
            losses: self.losses,
            device_memory_bytes: of.device.allocated(),
            footprints,
            least,
            stages: self.stages,
        }
    }
}

impl TrainingRow {
    /// Rows as people read them; `rates` are the device's.
    pub fn text(rows: &[TrainingRow], rates: &Rates) -> String {
        let mut text =
            format!("{:>9} {:>10} {:<13} {:>8} {:>17}", "Gaussians", "pixels", "law", "steps/s", "loss, from to");
        text += &format!(" {:>7}{}", "MB", WorkBound::heads());
        for r in rows {
            let memory = in_megabytes(r.device_memory_bytes);
            let (pixels, losses) = (format!("{}x{}", r.width, r.height), r.losses.map(|l| format!("{l:.5}")).join(" "));
            text += &format!("\n{:>9} {pixels:>10} {:<13} {:>8.1}", r.gaussians, r.law.name(), r.steps_per_second);
            text += &format!(" {losses:>17} {memory:>7}{}", r.least.shares(r.steps_per_second, rates));
        }
        text
    }

    /// What the row is of, and its kernels.
    pub fn stages(&self) -> (String, &KernelStages) {
        let TrainingRow { law, gaussians, width, height, .. } = self;
        (format!("step of {gaussians}, {width}x{height}, {}", law.name()), &self.stages)
    }
}

//! Training steps on a GPU: those of particlegs-train's `depth`, each stage a kernel.
//!
//! | kernel | twin in particlegs-train | what it does |
//! |---|---|---|
//! | those of [`crate::render`] | `depth::raster` | the depth that Gaussians draw |
//! | loss.wgsl, dssim.wgsl | `loss`, `depth::steps` | depth to brightness, loss, and the gradient with depth |
//! | gather_down_main.wgsl | core's `pyramid::gather_down` | that gradient on every plane |
//! | gather.wgsl | `depth::gather` | what each footprint gathers of it |
//! | adjoint.wgsl, slopes.wgsl, slice_slopes.wgsl | `depth::adjoint`, core's slopes | footprints back to Gaussians |
//! | adam_main.wgsl, change_main.wgsl, average_main.wgsl | `depth::steps`, `groups`, `parameters` | the step |
//!
//! Those of the alpha-blend law: `alpha`.
//!
//! Each Gaussian gathers its own gradient, and sums are in a fixed order: the same steps give the same bits on one GPU.

mod alpha;
mod compared;
mod gaussians;
mod kernels;
mod picture;
#[cfg(test)]
mod tests;

use crate::render::DepthRenderer;
use crate::{CUT_GROUPS, Device, groups};
pub(crate) use alpha::AlphaSteps;
use alpha::Blender;
use gaussians::DepthBuffers;
use kernels::TrainingKernels;
use particlegs_core::picture::Size;
use particlegs_core::render::lens::Lens;
use particlegs_core::{Error, Hint, Result};
use particlegs_train::depth::{DepthStepper, Parameters, StepSize, WIDTHS};
use particlegs_train::{Loss, NonFiniteGradient, StepReport, TrainingSample};
use picture::{CurveCache, TrainingPicture};
use std::sync::Arc;

/// Kernels of training, and what is drawn by.
pub(crate) struct Trainer {
    device: Arc<Device>,
    renderer: Arc<DepthRenderer>,
    kernels: Arc<TrainingKernels>,
    blender: Arc<Blender>,
}

impl Trainer {
    pub fn new(device: &Arc<Device>) -> Result<Trainer> {
        let (renderer, kernels) = (Arc::new(DepthRenderer::new(device)?), Arc::new(TrainingKernels::new(device)));
        let blender = Arc::new(Blender::new(device)?);
        device.check()?;
        Ok(Trainer { device: device.clone(), renderer, kernels, blender })
    }

    pub fn depth_steps(&self, parameters: &Parameters) -> Result<Box<DepthSteps>> {
        Ok(Box::new(DepthSteps {
            device: self.device.clone(),
            renderer: self.renderer.clone(),
            kernels: self.kernels.clone(),
            held: DepthBuffers::new(&self.device, &self.kernels, parameters)?,
            newer: ParameterLocation::Here,
            picture: None,
            curves: CurveCache::default(),
        }))
    }

    pub fn alpha_steps(&self, gaussians: &particlegs_train::alpha::Gaussians) -> Result<Box<AlphaSteps>> {
        Ok(Box::new(AlphaSteps::new(&self.device, &self.kernels, &self.blender, gaussians)?))
    }
}

/// The side on which the parameters are up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ParameterLocation {
    Here,
    Device,
    Both,
}

/// Gaussians of the optical-depth law on a device.
pub(crate) struct DepthSteps {
    device: Arc<Device>,
    renderer: Arc<DepthRenderer>,
    kernels: Arc<TrainingKernels>,
    held: DepthBuffers,
    newer: ParameterLocation,
    /// Of the last step's size.
    picture: Option<TrainingPicture>,
    curves: CurveCache,
}

/// Adam's numbers of a step, as step.wgsl has them.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct StepRecord {
    rate: [f32; 4],
    unroot: [f32; 4],
    epsilon: [f32; 4],
    beta: [f32; 2],
    decay: f32,
    average: f32,
    count: u32,
    groups: u32,
    pad: [u32; 2],
}

impl StepRecord {
    fn new(parameters: &Parameters, size: &StepSize) -> StepRecord {
        let mut record = StepRecord {
            rate: [0.0; 4],
            unroot: [1.0; 4],
            epsilon: [0.0; 4],
            beta: [size.beta1 as f32, size.beta2 as f32],
            decay: size.decay as f32,
            average: size.average as f32,
            count: parameters.len() as u32,
            groups: parameters.groups.counts.len() as u32,
            pad: [0; 2],
        };
        for (k, averages) in parameters.averages.iter().enumerate() {
            let correct = |beta: f64, steps: u64| 1.0 - beta.powi(steps.min(i32::MAX as u64) as i32);
            let (before, now) = (averages.steps, averages.steps + 1);
            // The CPU uses float32 decays, too.
            let beta = record.beta.map(f64::from);
            record.rate[k] = (size.rates[k] / correct(beta[0], now)) as f32;
            record.unroot[k] = (1.0 / correct(beta[1], now)) as f32;
            // Before the first step there is no mean size, and the correction would divide by 0.
            record.epsilon[k] =
                if before == 0 { 0.0 } else { (size.epsilon / correct(size.beta2, before).sqrt()) as f32 };
        }
        record
    }
}

impl DepthStepper for DepthSteps {
    fn step(
        &mut self,
        parameters: &mut Parameters,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport> {
        if self.newer == ParameterLocation::Here {
            self.held.put(&self.device, parameters)?;
        }
        let picture = self.picture_of(sample.crop.size, loss.dssim > 0.0)?;
        let mut lens = Lens::optical(sample.view, sample.crop.full, &parameters.bounds)?;
        for k in 0..2 {
            // A crop is the whole picture with its centre moved.
            lens.center[k] -= sample.crop.corner[k] as f64;
        }
        let radius = sample.view.radius_pixels(sample.crop.full);
        picture.compared.set(&self.device, sample.target, loss);
        picture.set_curve(&self.device, parameters.look, self.curves.of(parameters.look, sample.view.opacity, radius));
        self.held.set_step(&self.device, &StepRecord::new(parameters, size));
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        self.renderer.sum(&mut encoder, &self.held.seen, &picture.canvas, &lens);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        picture.backward(&mut pass, &self.kernels);
        self.backward(&mut pass, &picture);
        self.held.update(&mut pass, &self.kernels);
        drop(pass);
        self.device.queue.submit([encoder.finish()]);
        let report = picture.told(&self.device)?;
        self.picture = Some(picture);
        parameters.averages.iter_mut().for_each(|a| a.steps += 1);
        self.newer = ParameterLocation::Device;
        Ok(report)
    }

    fn fetch(&mut self, parameters: &mut Parameters) -> Result<()> {
        if self.newer == ParameterLocation::Device {
            self.held.get(&self.device, parameters)?;
            self.newer = ParameterLocation::Both;
        }
        Ok(())
    }

    fn changed(&mut self) {
        self.newer = ParameterLocation::Here;
    }

    fn replaced(&mut self, parameters: &Parameters, which: &[usize]) -> Result<()> {
        match self.newer {
            ParameterLocation::Both => self.held.replace(&self.device, &self.kernels, parameters, which),
            // They are sent with the next step.
            ParameterLocation::Here | ParameterLocation::Device => {
                self.newer = ParameterLocation::Here;
                Ok(())
            }
        }
    }
}

impl DepthSteps {
    /// Memory for pictures of a size: that of the last step where it had that size.
    fn picture_of(&mut self, size: Size, with_dssim: bool) -> Result<TrainingPicture> {
        // Where it had not, its memory goes before the next one's is taken.
        if let Some(picture) = self.picture.take().filter(|p| p.shape() == (size, with_dssim)) {
            return Ok(picture);
        }
        let canvas = self.renderer.canvas(&self.held.seen, size)?;
        TrainingPicture::new(&self.device, &self.kernels, &self.held, canvas, with_dssim)
    }

    /// The gradient with every Gaussian.
    fn backward(&self, pass: &mut wgpu::ComputePass<'_>, picture: &TrainingPicture) {
        for (bound, count) in &picture.whole {
            self.kernels.backward.run(pass, bound, groups(u64::from(*count)));
        }
        for (bound, count) in &picture.cut {
            self.kernels.backward_slices.run(pass, bound, [CUT_GROUPS.min(*count), 1]);
        }
    }
}

#[cfg(test)]
impl DepthSteps {
    /// Fills all that is written before it is read with what is no number.
    fn poison(&self) {
        let picture = self.picture.as_ref().expect("it has a size");
        for buffer in self.held.scratch().into_iter().chain(picture.scratch()) {
            self.device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
        }
    }
}

/// The report of a step, of faults.wgsl's words.
fn stepped(words: &[u8]) -> StepReport {
    let word = |k: usize| [words[4 * k], words[4 * k + 1], words[4 * k + 2], words[4 * k + 3]];
    let (count, first) = (u32::from_le_bytes(word(4)), u32::from_le_bytes(word(5)));
    // One number holds both, so that a kernel can find the least with a single atomic operation.
    let group = ["position", "covariance", "count"][(first % 4).min(2) as usize];
    let not_finite = NonFiniteGradient { group, gaussian: first as usize / 4, count: count as usize };
    StepReport { loss: f64::from(f32::from_le_bytes(word(0))), not_finite: (count > 0).then_some(not_finite) }
}

/// Numbers of a Gaussian that steps move.
const NUMBERS: usize = WIDTHS[0] + WIDTHS[1] + WIDTHS[2];

/// Why Gaussians are not held.
fn too_many(device: &Device, count: usize, most: usize) -> Error {
    let name = device.name();
    let hint = Hint::use_cpu().words(", or use more blocks");
    Error::argument_with(format!("device {name} can train at most {most} Gaussians, not {count}"), hint)
}

//! Steps of training by the alpha-blend law: those of particlegs-train's `alpha`, each stage a kernel.
//!
//! | kernel | twin in particlegs-train | what it does |
//! |---|---|---|
//! | unfold_main.wgsl | `alpha::parameters` | what is moved to what is drawn |
//! | those of [`crate::alpha`] | `alpha::pass` | the picture |
//! | loss_main.wgsl, loss_gradient_main.wgsl, those of the other law | `loss`, `dssim` | the loss, and its gradient with brightness |
//! | backward_main.wgsl of [`crate::alpha`] | `alpha::raster` | what pixels want of each footprint |
//! | chain_main.wgsl | `alpha::chain` | footprints back to Gaussians |
//! | network_main.wgsl | `alpha::network` | through the network |
//! | adam_main.wgsl, network_adam_main.wgsl | `alpha::steps` | the step |
//!
//! Density control runs on the CPU, which fetches the Gaussians when it is due and sends them back.

mod held;
mod kernels;
mod picture;
mod record;
#[cfg(test)]
mod tests;

use super::ParameterLocation;
use super::kernels::TrainingKernels;
use crate::alpha::AlphaRenderer;
use crate::{Device, groups};
use held::AlphaBuffers;
use kernels::AlphaTrainingKernels;
use particlegs_core::Result;
use particlegs_train::alpha::{AlphaStepper, Gaussians, StepSize};
use particlegs_train::{Loss, NonFiniteGradient, StepReport, TrainingSample};
use picture::AlphaTrainingPicture;
use record::AlphaStepRecord;
use std::sync::Arc;

/// Groups of parameters, by their numbers in adam_main.wgsl.
const GROUPS: [&str; 5] = ["position", "scale", "rotation", "opacity", "feature"];

/// The renderer and the kernels of steps by this law.
pub(super) struct Blender {
    renderer: AlphaRenderer,
    kernels: AlphaTrainingKernels,
}

impl Blender {
    pub fn new(device: &Arc<Device>) -> Result<Blender> {
        let renderer = AlphaRenderer::for_training(device)?;
        Ok(Blender { renderer, kernels: AlphaTrainingKernels::new(device) })
    }
}

/// Gaussians of the alpha-blend law on a device.
pub(crate) struct AlphaSteps {
    device: Arc<Device>,
    shared: Arc<TrainingKernels>,
    blender: Arc<Blender>,
    held: AlphaBuffers,
    /// Whether those on the device are newer than the caller's, older, or neither.
    newer: ParameterLocation,
    /// Of the last step's size.
    picture: Option<AlphaTrainingPicture>,
}

impl AlphaSteps {
    pub(super) fn new(
        device: &Arc<Device>,
        shared: &Arc<TrainingKernels>,
        blender: &Arc<Blender>,
        gaussians: &Gaussians,
    ) -> Result<Self> {
        Ok(AlphaSteps {
            device: device.clone(),
            shared: shared.clone(),
            blender: blender.clone(),
            held: AlphaBuffers::new(device, blender, gaussians)?,
            newer: ParameterLocation::Here,
            picture: None,
        })
    }

    /// The Gaussians as the caller has them, on the device.
    fn send(&mut self, gaussians: &Gaussians) -> Result<()> {
        if !self.held.fits(gaussians) {
            self.picture = None;
            self.held = AlphaBuffers::new(&self.device, &self.blender, gaussians)?;
        }
        self.held.put(&self.device, gaussians)
    }

    /// Memory for the pictures of a sample: that of the last step where it had that size.
    fn picture_of(&mut self, sample: &TrainingSample<'_>, loss: &Loss) -> Result<AlphaTrainingPicture> {
        let shape = (sample.crop.size, loss.dssim > 0.0);
        // Where it had not, its memory goes before the next one's is taken.
        match self.picture.take().filter(|p| p.shape() == shape) {
            Some(picture) => Ok(picture),
            None => AlphaTrainingPicture::new(&self.device, (&self.shared, &self.blender), &self.held, shape),
        }
    }
}

impl AlphaStepper for AlphaSteps {
    fn step(
        &mut self,
        gaussians: &mut Gaussians,
        sample: &TrainingSample<'_>,
        loss: &Loss,
        size: &StepSize,
    ) -> Result<StepReport> {
        let (eye, setting) = (gaussians.eye(sample)?, gaussians.setting(sample));
        if self.newer == ParameterLocation::Here {
            self.send(gaussians)?;
        }
        let mut picture = self.picture_of(sample, loss)?;
        let (device, blender, held) = (&*self.device, &*self.blender, &self.held);
        held.begin(device, blender, &AlphaStepRecord::new(gaussians, &eye, setting, size));
        picture.compared.set(device, sample.target, loss);
        blender.renderer.blend_all(&held.seen, &mut picture.canvas, &eye, setting)?;
        picture.compare(device, (&self.shared, blender));
        blender.renderer.backward(&picture.canvas, &mut picture.back)?;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        blender.kernels.chain.run(&mut pass, &picture.chain, groups(gaussians.parameters.len() as u64));
        held.update(device, &mut pass, blender, &picture.compared.told);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        let (report, network_moved) = stepped(&device.read(&picture.compared.told, 28)?);
        self.picture = Some(picture);
        gaussians.averages.iter_mut().for_each(|a| a.steps += 1);
        if gaussians.mapper.is_some() && network_moved {
            gaussians.mapper_averages.steps += 1;
        }
        self.newer = ParameterLocation::Device;
        Ok(report)
    }

    fn fetch(&mut self, gaussians: &mut Gaussians) -> Result<()> {
        if self.newer == ParameterLocation::Device {
            self.held.get(&self.device, gaussians)?;
            self.newer = ParameterLocation::Both;
        }
        Ok(())
    }

    fn changed(&mut self) {
        self.newer = ParameterLocation::Here;
    }
}

#[cfg(test)]
impl AlphaSteps {
    /// Fills all that is written before it is read with what is no number.
    fn poison(&self) {
        let picture = self.picture.as_ref().expect("it has a size");
        for buffer in self.held.scratch().into_iter().chain(picture.compared.scratch()).chain([&picture.back.by_pixel])
        {
            self.device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
        }
        picture.back.poison(&self.device);
    }
}

/// The report of a step, of faults.wgsl's words, and whether the network was moved.
fn stepped(words: &[u8]) -> (StepReport, bool) {
    let word = |k: usize| [words[4 * k], words[4 * k + 1], words[4 * k + 2], words[4 * k + 3]];
    let [count, first, network] = [4, 5, 6].map(|k| u32::from_le_bytes(word(k)));
    let group = GROUPS[(first % 8).min(4) as usize];
    let of_gaussians = NonFiniteGradient { group, gaussian: first as usize / 8, count: count as usize };
    let of_network = NonFiniteGradient { group: "vizmapper", gaussian: 0, count: 1 };
    let not_finite = (count > 0).then_some(of_gaussians).or((network > 0).then_some(of_network));
    (StepReport { loss: f64::from(f32::from_le_bytes(word(0))), not_finite }, network == 0)
}

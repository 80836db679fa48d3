//! Steps of training by the alpha-blend law: those of particlegs-train's `alpha`, each stage a kernel.
//!
//! | kernel | twin in particlegs-train | what it does |
//! |---|---|---|
//! | unfold_main.wgsl | `alpha::parameters` | what is moved to what is drawn |
//! | those of [`crate::alpha`] | `alpha::pass` | the picture |
//! | loss_main.wgsl, loss_gradient_main.wgsl, those of the other law | `loss` | the loss, and its gradient with brightness |
//! | backward_main.wgsl of [`crate::alpha`] | `alpha::raster` | what pixels want of each footprint |
//! | chain_main.wgsl | `alpha::chain` | footprints back to Gaussians |
//! | network_main.wgsl | `alpha::network` | through the network |
//! | adam_main.wgsl, network_adam_main.wgsl | `alpha::steps` | the step |
//!
//! Density control runs on the CPU, which fetches the Gaussians when it is due and sends them back.

mod buffers;
#[cfg(test)]
mod tests;

use super::ParameterLocation;
use super::kernels::TrainingKernels;
use crate::alpha::AlphaRenderer;
use crate::alpha::sources::{BIN, FIXED, FRAME, PROJECT};
use crate::kernel::{BufferUse, Kernel};
use crate::render::sources::FRAME as PICTURE;
use crate::{Device, groups};
use buffers::{AlphaBuffers, AlphaTrainingPicture};
use particlegs_core::Result;
use particlegs_core::model::VizRanges;
use particlegs_core::render::alpha::Eye;
use particlegs_core::render::alpha::network::Setting;
use particlegs_train::alpha::{AlphaStepper, Gaussians, StepSize};
use particlegs_train::{Averages, Loss, NonFiniteGradient, StepReport, TrainingSample};
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
        // Reading waits until the step is done.
        let (report, network_moved) = stepped(&device.read(&picture.compared.told, 28)?);
        self.picture = Some(picture);
        gaussians.averages.iter_mut().for_each(|a| a.steps += 1);
        // Adam's corrections count steps that were taken: with a gradient that is not finite there was none.
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

const FAULTS: &str = include_str!("../faults.wgsl");
const LOSS: &str = include_str!("../loss.wgsl");
const NETWORK: &str = include_str!("network.wgsl");
const PART: &str = include_str!("../part.wgsl");
const STEP: &str = include_str!("step.wgsl");

/// All of them, but those that the other law has too.
struct AlphaTrainingKernels {
    unfold: Kernel,
    loss: Kernel,
    loss_gradient: Kernel,
    chain: Kernel,
    network: Kernel,
    network_total: Kernel,
    network_adam: Kernel,
    adam: Kernel,
}

impl AlphaTrainingKernels {
    /// Compiled for a device.
    fn new(device: &Device) -> AlphaTrainingKernels {
        use BufferUse::{Read as R, Uniform as U, Write as W};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        macro_rules! main {
            ($file:literal) => {
                include_str!(concat!($file, "_main.wgsl"))
            };
        }
        AlphaTrainingKernels {
            unfold: new("unfold", &[main!("unfold"), STEP, FIXED], &[U, R, W]),
            loss: new("loss, alpha", &[main!("loss"), PICTURE, LOSS, PART], &[U, R, R, U, W, W]),
            loss_gradient: new(
                "gradient of the loss, alpha",
                &[main!("loss_gradient"), PICTURE, LOSS, FAULTS],
                &[U, R, R, U, W, R, W],
            ),
            chain: new(
                "gradient of Gaussians, alpha",
                &[main!("chain"), STEP, FRAME, FIXED, PROJECT, BIN],
                &[U, U, R, R, R, R, R, W, W, W],
            ),
            network: new("gradient of the network", &[main!("network"), STEP, NETWORK], &[U, R, R, R, W, W]),
            network_total: new("gradient of the network in all", &[main!("network_total"), NETWORK], &[R, W]),
            network_adam: new("Adam, network", &[main!("network_adam"), STEP, NETWORK, PART, FAULTS], &[U, R, W, W, W]),
            adam: new("Adam, alpha", &[main!("adam"), STEP, FAULTS], &[U, R, W, W, W]),
        }
    }
}

/// Decays of Adam's means (3DGS and PyTorch).
const BETA: [f32; 2] = [0.9, 0.999];

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct AlphaStepRecord {
    rate: [f32; 4],
    unroot: [f32; 4],
    rate_more: [f32; 2],
    unroot_more: [f32; 2],
    beta: [f32; 2],
    half: [f32; 2],
    wanted: [f32; 2],
    shares: [f32; 2],
    floor: f32,
    hold: f32,
    clip: f32,
    count: u32,
}

impl AlphaStepRecord {
    /// Of the next step of these Gaussians.
    fn new(gaussians: &Gaussians, eye: &Eye, setting: Setting, size: &StepSize) -> AlphaStepRecord {
        let [position, scale, rotation, opacity, feature] = &gaussians.averages;
        let corrected = |averages: &Averages, rate: f64| {
            let steps = (averages.steps + 1).min(i32::MAX as u64) as i32;
            let [first, second] = BETA.map(|beta| 1.0 - f64::from(beta).powi(steps));
            [(rate / first) as f32, (1.0 / second) as f32]
        };
        let r = size.rates;
        let pairs = [position, scale, rotation, opacity].into_iter().zip(r).map(|(a, rate)| corrected(a, rate));
        let corrections: Vec<[f32; 2]> = pairs.collect();
        let more = [corrected(feature, r[4]), corrected(&gaussians.mapper_averages, size.network)];
        let ranges = gaussians.mapper.as_ref().map_or(VizRanges::TRAINING, |m| m.ranges);
        AlphaStepRecord {
            rate: std::array::from_fn(|k| corrections[k][0]),
            unroot: std::array::from_fn(|k| corrections[k][1]),
            rate_more: more.map(|m| m[0]),
            unroot_more: more.map(|m| m[1]),
            beta: BETA,
            half: eye.half.map(|v| v as f32),
            wanted: [setting.radius, setting.opacity].map(|v| v as f32),
            shares: [ranges.scale, ranges.opacity].map(|v| v as f32),
            floor: ranges.floor as f32,
            // The derivative of the weight times the mean of squares.
            hold: (2.0 * size.identity / gaussians.parameters.len().max(1) as f64) as f32,
            clip: size.clip as f32,
            count: gaussians.parameters.len() as u32,
        }
    }
}

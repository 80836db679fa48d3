//! A GPU that draws and trains in place of the CPU.

use crate::Device;
use crate::reference::ParticlePictures;
use crate::render::ScenePictures;
use crate::train::Trainer;
use crate::train::subject::DeviceSubject;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::render::{Renderer, Scene};
use particlegs_train::depth::{DepthStepper, Parameters};
use particlegs_train::{Accelerator, ParticleInput, TrainingSubject, alpha};
use std::fmt;
use std::sync::{Arc, OnceLock};

/// A GPU that draws and trains.
pub struct GpuAccelerator {
    device: Arc<Device>,
    /// Compiled when the first steps are asked for.
    trainer: OnceLock<Trainer>,
}

impl GpuAccelerator {
    /// Of an open device.
    pub fn new(device: Arc<Device>) -> Self {
        GpuAccelerator { device, trainer: OnceLock::new() }
    }

    fn trainer(&self) -> Result<&Trainer> {
        if let Some(trainer) = self.trainer.get() {
            return Ok(trainer);
        }
        let trainer = Trainer::new(&self.device)?;
        Ok(self.trainer.get_or_init(|| trainer))
    }
}

impl fmt::Debug for GpuAccelerator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.device.name())
    }
}

impl Accelerator for GpuAccelerator {
    fn name(&self) -> &str {
        self.device.name()
    }

    fn scene(&self, scene: &Scene<'_>) -> Result<Box<dyn Renderer>> {
        Ok(Box::new(ScenePictures::new(&self.device, scene)?))
    }

    fn particles<'a>(&self, input: ParticleInput<'a>, context: &Context<'_>) -> Result<Box<dyn Renderer + 'a>> {
        let count = input.count as u64;
        let mut pictures = ParticlePictures::new(&self.device, input)?;
        context.begin("copying particles to the GPU", count);
        pictures.keep(&self.device, &mut |sent| {
            context.advance(sent);
            context.check()
        })?;
        context.end();
        Ok(Box::new(pictures))
    }

    fn subject<'a>(
        &self,
        subject: &'a dyn TrainingSubject,
        context: &Context<'_>,
    ) -> Result<Box<dyn TrainingSubject + 'a>> {
        Ok(Box::new(DeviceSubject::new(&self.device, subject, context)?))
    }

    fn depth_steps(&self, parameters: &Parameters) -> Result<Box<dyn DepthStepper>> {
        Ok(self.trainer()?.depth_steps(parameters)?)
    }

    fn alpha_steps(&self, gaussians: &alpha::Gaussians) -> Result<Box<dyn alpha::AlphaStepper>> {
        Ok(self.trainer()?.alpha_steps(gaussians)?)
    }
}

//! A GPU that draws and trains in place of the CPU, and the subject of a run drawn on it.

use crate::Device;
use crate::reference::ParticlePictures;
use crate::render::{DepthRenderer, ScenePictures};
use crate::train::Trainer;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::{Renderer, Scene, SceneRenderer};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_train::depth::{DepthStepper, Parameters};
use particlegs_train::{Accelerator, ParticleInput, TrainingSubject, alpha};
use std::fmt;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// A GPU that draws and trains.
pub struct GpuAccelerator {
    device: Arc<Device>,
    /// Compiled when the first scene comes, for all.
    scenes: OnceLock<Arc<DepthRenderer>>,
    /// Compiled when the first steps are asked for.
    trainer: OnceLock<Trainer>,
}

impl GpuAccelerator {
    /// Of an open device.
    pub fn new(device: Arc<Device>) -> Self {
        GpuAccelerator { device, scenes: OnceLock::new(), trainer: OnceLock::new() }
    }

    fn trainer(&self) -> Result<&Trainer> {
        compiled(&self.trainer, || Trainer::new(&self.device))
    }
}

/// The kernels of `cell`, compiled where they are not yet. If two threads come here at once, one compiles in vain.
fn compiled<T>(cell: &OnceLock<T>, compile: impl FnOnce() -> Result<T>) -> Result<&T> {
    if let Some(kernels) = cell.get() {
        return Ok(kernels);
    }
    // `get_or_init` takes no work that may fail.
    let kernels = compile()?;
    Ok(cell.get_or_init(|| kernels))
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

    fn scene<'a>(&self, scene: &Scene<'a>) -> Result<Box<dyn SceneRenderer + 'a>> {
        if scene.law() == LawKind::AlphaBlend {
            return Ok(Box::new(ScenePictures::new(&self.device, scene)?));
        }
        let renderer = compiled(&self.scenes, || Ok(Arc::new(DepthRenderer::new(&self.device)?)))?;
        Ok(Box::new(ScenePictures::of_depth(renderer.clone(), scene)))
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

/// Bytes a pixel that a kernel sees at once of pictures of all particles: 4, and their edges.
const A_PIXEL: u64 = 5;

/// Particles whose pictures the device draws if they fit; otherwise the CPU draws the same pictures.
struct DeviceSubject<'a> {
    of: &'a dyn TrainingSubject,
    device: Arc<Device>,
    pictures: ParticlePictures<'a>,
}

impl<'a> DeviceSubject<'a> {
    /// Sends the particles, as many as there is room for.
    fn new(device: &Arc<Device>, subject: &'a dyn TrainingSubject, context: &Context<'_>) -> Result<Self> {
        let columns = Box::new(move |range| subject.columns(range));
        let input = ParticleInput { origin: subject.origin(), bounds: subject.bounds(), count: subject.len(), columns };
        let mut pictures = ParticlePictures::new(device, input)?;
        pictures.keep(device, &mut |_| context.check())?;
        Ok(DeviceSubject { of: subject, device: device.clone(), pictures })
    }

    fn holds(&self, size: Size) -> bool {
        self.device.fits(size, A_PIXEL * size.pixels() as u64).is_ok()
    }
}

impl Renderer for DeviceSubject<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        if self.holds(size) {
            return self.pictures.draw(view, size, style, context);
        }
        self.of.draw(view, size, style, context)
    }

    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        if self.holds(size) {
            return self.pictures.response(view, size, style, context);
        }
        self.of.response(view, size, style, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        if self.holds(size) {
            return self.pictures.optical_depth(view, size, context);
        }
        self.of.optical_depth(view, size, context)
    }
}

impl TrainingSubject for DeviceSubject<'_> {
    fn len(&self) -> usize {
        self.of.len()
    }

    fn position(&self, i: usize) -> [f64; 3] {
        self.of.position(i)
    }

    fn origin(&self) -> [f64; 3] {
        self.of.origin()
    }

    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3] {
        self.of.columns(range)
    }

    fn bounds(&self) -> Bounds {
        self.of.bounds()
    }
}

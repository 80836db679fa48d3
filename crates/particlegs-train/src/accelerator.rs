//! What a run is given: the particles that it learns from, and a device that draws and trains in place of the CPU.

use crate::alpha;
use crate::depth::{DepthStepper, Parameters};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::render::{Renderer, Scene, SceneRenderer};
use particlegs_core::space::Bounds;
use std::fmt::Debug;
use std::ops::Range;

/// The particles of a run: their pictures to learn from and to be scored on, and where they lie.
/// `particlegs_reference::Reference` is one.
pub trait TrainingSubject: Renderer {
    fn len(&self) -> usize;

    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn position(&self, i: usize) -> [f64; 3];

    /// Origin of positions as they are stored, world units.
    fn origin(&self) -> [f64; 3];

    /// Positions of particles relative to the origin, as they are stored, in columns.
    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3];

    /// Bounds of the particles, world units: they say between which distances a view without any draws.
    fn bounds(&self) -> Bounds;
}

/// Positions of a range of particles in columns, relative to the snapshot's origin.
pub type ColumnReader<'a> = Box<dyn Fn(Range<usize>) -> [Vec<f32>; 3] + Send + Sync + 'a>;

/// Particles as a device reads them.
pub struct ParticleInput<'a> {
    /// Origin that positions are relative to, world units.
    pub origin: [f64; 3],
    /// World units; they clip where a view does not say.
    pub bounds: Bounds,
    pub count: usize,
    pub columns: ColumnReader<'a>,
}

/// A device that draws and trains in place of the CPU: it opens [`Renderer`]s, and takes steps of training.
pub trait Accelerator: Debug + Send + Sync {
    /// Its name, which results that it had a part in depend on.
    fn name(&self) -> &str;

    /// Draws a scene on the device, which gets it with the first picture.
    fn scene<'a>(&self, scene: &Scene<'a>) -> Result<Box<dyn SceneRenderer + 'a>>;

    /// Sends particles to the device, as many as it has room for; the others are sent again for every picture.
    fn particles<'a>(&self, particles: ParticleInput<'a>, context: &Context<'_>) -> Result<Box<dyn Renderer + 'a>>;

    /// The same subject, whose pictures the device draws.
    fn subject<'a>(
        &self,
        subject: &'a dyn TrainingSubject,
        context: &Context<'_>,
    ) -> Result<Box<dyn TrainingSubject + 'a>>;

    /// Takes steps of these Gaussians of the optical-depth law.
    fn depth_steps(&self, parameters: &Parameters) -> Result<Box<dyn DepthStepper>>;

    /// Takes steps of these Gaussians of the alpha-blend law.
    fn alpha_steps(&self, gaussians: &alpha::Gaussians) -> Result<Box<dyn alpha::AlphaStepper>>;
}

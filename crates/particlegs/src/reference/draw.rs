//! Pictures of all particles, look by look.

use super::fxaa::fxaa;
use super::paraview;
use super::project::Projector;
use crate::Result;
use crate::camera::{View, clipping_range};
use crate::particles::{Bounds, Particles};
use crate::picture::{Gray8, Size};
use crate::progress::Progress;
use crate::splat::Look;

/// A snapshot ready to be drawn: its particles and their bounds, found once.
pub struct Reference<'a> {
    particles: &'a Particles,
    bounds: Bounds,
}

impl<'a> Reference<'a> {
    /// Finds the bounds of the particles (one pass).
    pub fn new(particles: &'a Particles) -> Self {
        Self::with_bounds(particles, particles.bounds())
    }

    /// With bounds known already, world units.
    pub fn with_bounds(particles: &'a Particles, bounds: Bounds) -> Self {
        Reference { particles, bounds }
    }

    /// The bounds.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// The exact picture.
    pub fn draw(&self, view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Gray8> {
        let projector = self.projector(view, size)?;
        match look {
            Look::ParaviewNoFxaa => paraview::draw(self.particles, &projector, size, view.opacity as f32, progress),
            Look::Paraview => {
                Ok(fxaa(&paraview::draw(self.particles, &projector, size, view.opacity as f32, progress)?))
            }
            Look::Expected => todo!(),
        }
    }

    fn projector(&self, view: &View, size: Size) -> Result<Projector> {
        let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(&self.bounds, &view.camera));
        Projector::new(view, size, self.particles.origin, range)
    }
}

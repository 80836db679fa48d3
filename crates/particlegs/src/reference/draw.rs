//! Pictures of all particles, look by look.

use super::depth;
use super::fxaa::fxaa;
use super::paraview;
use super::project::Projector;
use crate::Result;
use crate::camera::{View, clipping_range};
use crate::particles::{Bounds, Particles};
use crate::picture::{Gray8, Plane, Size};
use crate::progress::Progress;
use crate::splat::{Look, tone};

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

    /// A picture of all particles: for ParaView's looks its own, exactly, shot noise and all
    /// (point-gaussian.md); for [`Look::Expected`] `round(255 (1 - exp(-tau*)))`.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a view out of range or not in perspective;
    /// [`crate::Error::Cancelled`] where the caller stops.
    pub fn draw(&self, view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Gray8> {
        match look {
            Look::Expected => self.response(view, size, look, progress),
            Look::ParaviewNoFxaa => self.exact(view, size, progress),
            Look::Paraview => Ok(fxaa(&self.exact(view, size, progress)?)),
        }
    }

    /// The noise-free picture of all particles in a look: tau* through the look's tone curve
    /// (response.md). What a model that knows every particle but not the shot noise would draw.
    ///
    /// # Errors
    /// As [`Reference::draw`].
    pub fn response(&self, view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Gray8> {
        let tau = self.optical_depth(view, size, progress)?;
        Ok(tone(&tau, look, view.opacity, view.radius_pixels(size)))
    }

    /// The noise-free optical depth tau*: every splat's opacity averaged over each pixel, then
    /// `sum -ln(1 - m)` (response.md, section 1). Results do not depend on threads.
    ///
    /// # Errors
    /// As [`Reference::draw`].
    pub fn optical_depth(&self, view: &View, size: Size, progress: &dyn Progress) -> Result<Plane> {
        self.optical_depth_within(view, size, depth::direct_deposits(size, view.opacity), progress)
    }

    /// With a limit of our own on direct deposits.
    pub(super) fn optical_depth_within(
        &self,
        view: &View,
        size: Size,
        direct: f64,
        progress: &dyn Progress,
    ) -> Result<Plane> {
        depth::optical_depth(self.particles, &self.projector(view, size)?, size, view.opacity, direct, progress)
    }

    fn exact(&self, view: &View, size: Size, progress: &dyn Progress) -> Result<Gray8> {
        paraview::draw(self.particles, &self.projector(view, size)?, size, view.opacity as f32, progress)
    }

    fn projector(&self, view: &View, size: Size) -> Result<Projector> {
        let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(&self.bounds, &view.camera));
        Projector::new(view, size, self.particles.origin, range)
    }
}

//! Pictures of all particles, look by look.

use super::fxaa::fxaa;
use super::project::Projector;
use super::{density, depth, paraview, smooth};
use particlegs_core::Result;
use particlegs_core::camera::{DensityView, View, clipping_range};
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::{Renderer, tone};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_files::memory::require;
use particlegs_particles::{Domain, Particles, distances_to};
use particlegs_train::{ParticleInput, TrainingSubject};
use std::ops::Range;

/// A snapshot ready to be drawn: its particles and their bounds, found once.
pub struct Reference<'a> {
    particles: &'a Particles,
    bounds: Bounds,
    /// Bytes of splats that are held at a time.
    budget: u64,
    /// Support radii of the particles' kernels, world units; `None` = points.
    pub(super) radii: Option<Vec<f32>>,
}

impl<'a> Reference<'a> {
    /// Finds the bounds of the particles (one pass).
    pub fn new(particles: &'a Particles) -> Self {
        Self::with_bounds(particles, particles.bounds())
    }

    /// With bounds known already, world units.
    pub fn with_bounds(particles: &'a Particles, bounds: Bounds) -> Self {
        // A quarter of the positions: few passes over the particles, little beside them.
        let budget = (particles.len() as u64 * 3).max(paraview::LEAST_BUDGET);
        Reference { particles, bounds, budget, radii: None }
    }

    /// With at most about this many bytes beside the particles, for more passes over them. Pictures do
    /// not depend on it.
    pub fn within(self, bytes: u64) -> Self {
        Reference { budget: self.budget.min(bytes).max(1 << 24), ..self }
    }

    /// With surface densities smoothed: each particle is spread by the cubic spline kernel (Monaghan and
    /// Lattanzio 1985) over the sphere that reaches its `neighbours`-th nearest other particle, around the box
    /// where that repeats. No other picture changes.
    pub fn smoothed(self, neighbours: usize, context: &Context<'_>) -> Result<Self> {
        let domain = Domain::new(&self.bounds, self.particles.meta.cell.as_ref());
        let radii = Some(distances_to(neighbours, self.particles, &domain, context)?);
        Ok(Reference { radii, ..self })
    }

    /// The same particles with other weights.
    pub(super) fn weighted<'b>(&self, particles: &'b Particles) -> Reference<'b> {
        Reference { particles, bounds: self.bounds, budget: self.budget, radii: self.radii.clone() }
    }

    /// Mass a world unit squared at every pixel (docs/law/depth.md, "Surface density"): each particle's mass over
    /// the area of the pixel that it falls in, at its depth in perspective, or spread by its kernel where
    /// densities are [`smoothed`](Self::smoothed). Particles count whose centres are in the view's range of depths.
    /// Periodic copies where the view wraps. Masses are the weights (1 without) times the particle mass where the
    /// source gives one.
    pub fn surface_density(&self, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane> {
        match &self.radii {
            None => density::unsmoothed(self.particles, &self.bounds, view, size, context),
            Some(radii) => smooth::smoothed(self.particles, &self.bounds, radii, view, size, context),
        }
    }

    /// The particles.
    pub fn particles(&self) -> &'a Particles {
        self.particles
    }

    /// The bounds.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// A picture of all particles: for ParaView's looks its own, exactly, shot noise and all
    /// (docs/law/splat.md); for [`ToneStyle::Expected`] `round(255 (1 - exp(-tau*)))`.
    pub fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        match style {
            ToneStyle::Expected => self.response(view, size, style, context),
            ToneStyle::ParaviewNoFxaa => self.exact(view, size, context),
            ToneStyle::Paraview => Ok(fxaa(&self.exact(view, size, context)?)),
        }
    }

    /// The noise-free picture of all particles in a look: tau* through the look's tone curve
    /// (docs/law/response.md). A model that knew every particle but not the shot noise would draw it.
    pub fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        let tau = self.optical_depth(view, size, context)?;
        Ok(tone(&tau, style, view.opacity, view.radius_pixels(size)))
    }

    /// The noise-free optical depth tau*: every splat's opacity averaged over each pixel, then
    /// `sum -ln(1 - m)` (docs/law/depth.md). Results do not depend on threads.
    pub fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.optical_depth_within(view, size, depth::direct_deposits(size, view.opacity), context)
    }

    /// The input of which an [`Accelerator`](particlegs_train::Accelerator) draws the same pictures.
    pub fn input(&self) -> ParticleInput<'a> {
        let (particles, bounds) = (self.particles, self.bounds);
        let columns = Box::new(move |range| particles.columns(range));
        ParticleInput { origin: particles.origin, bounds, count: particles.len(), columns }
    }

    /// With a limit of our own on direct deposits.
    pub(super) fn optical_depth_within(
        &self,
        view: &View,
        size: Size,
        direct: f64,
        context: &Context<'_>,
    ) -> Result<Plane> {
        let projector = self.projector(view, size)?;
        // Planes of halved resolution, and what a look takes beside the finest.
        require("a picture", 10 * size.pixels() as u64)?;
        depth::optical_depth(self.particles, &projector, size, view.opacity, direct, context)
    }

    fn exact(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8> {
        let projector = self.projector(view, size)?;
        // The picture upside down, turned, and smoothed.
        require("a picture", 3 * size.pixels() as u64)?;
        paraview::draw(self.particles, &projector, size, view.opacity as f32, self.budget, context)
    }

    fn projector(&self, view: &View, size: Size) -> Result<Projector> {
        let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(&self.bounds, &view.camera));
        Projector::new(view, size, self.particles.origin, range)
    }
}

impl Renderer for Reference<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        Reference::draw(self, view, size, style, context)
    }

    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        Reference::response(self, view, size, style, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        Reference::optical_depth(self, view, size, context)
    }
}

impl TrainingSubject for Reference<'_> {
    fn len(&self) -> usize {
        self.particles.len()
    }

    fn position(&self, i: usize) -> [f64; 3] {
        self.particles.position(i)
    }

    fn origin(&self) -> [f64; 3] {
        self.particles.origin
    }

    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3] {
        self.particles.columns(range)
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }
}

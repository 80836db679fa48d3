//! Scenes to draw: the Gaussians, borrowed, and the bounds that clip where a view does not say; and renderers of scenes
//! and of particles.

use super::alpha::Blend;
use super::field_map::FieldMap;
use super::field_query::FieldQuery;
use super::tone::Tones;
use crate::Result;
use crate::camera::{DensityView, Normalisation, View};
use crate::context::Context;
use crate::math::each_axis;
use crate::model::{AlphaBlend, LawKind, Mass, Mixture, Model};
use crate::picture::{Gray8, Plane, Size};
use crate::space::Bounds;
use crate::splat::ToneStyle;

/// Gaussians to draw. Cheap to make: nothing is copied.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// The parts, drawn in this order, and the mass of a particle of weight 1 in each.
    pub(super) parts: Vec<(&'a Mixture, f64)>,
    /// Bounds of the particles, world units.
    pub(super) bounds: Bounds,
    /// Settings of the alpha-blend law; `None` = the optical-depth law.
    pub(super) blend: Option<Blend<'a>>,
    /// Shifts at which it is drawn, from where it is, world units.
    pub(super) shifts: Vec<[f64; 3]>,
    /// Whether densities count particles, whatever masses there are.
    pub(super) by_number: bool,
}

impl<'a> Scene<'a> {
    /// All blocks of all layers of a model, to be drawn by its law.
    pub fn new(model: &'a Model) -> Self {
        Scene::from_layers(model, |_| true)
    }

    /// The layers of a model that are `shown`, by their place; bounds stay those of the whole. Densities count particles
    /// where one of these layers has no masses.
    pub fn from_layers(model: &'a Model, shown: impl Fn(usize) -> bool) -> Self {
        let layers = model.layers.iter().enumerate().filter(|(place, _)| shown(*place)).map(|(_, layer)| layer);
        let by_number = layers.clone().any(|l| l.mass == Mass::Unknown);
        let parts = layers.flat_map(|l| l.content.iter().map(|b| (&b.gaussians, l.mass.unit_or_one()))).collect();
        let (bounds, blend) = (model.metadata.bounds, Blend::from_model(model));
        Scene { parts, bounds, blend, shifts: vec![[0.0; 3]], by_number }
    }

    /// The same, whose densities count particles.
    pub fn by_number(self) -> Self {
        Scene { by_number: true, ..self }
    }

    /// The same, repeated at these `shifts` (world units) from where it is: a periodic box and its images. Bounds
    /// become those of all of them. Pictures of the optical-depth law alone are repeated.
    pub fn repeated(mut self, shifts: Vec<[f64; 3]>) -> Self {
        let bounds = self.bounds;
        let moved = |s: &[f64; 3]| Bounds {
            min: each_axis(|k| bounds.min[k] + s[k]),
            max: each_axis(|k| bounds.max[k] + s[k]),
        };
        self.bounds = shifts.iter().map(moved).reduce(|a, b| a.union(&b)).unwrap_or(bounds);
        self.shifts = shifts;
        self
    }

    /// Bounds of what is drawn, world units.
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Its parts, in the order in which they are drawn.
    pub fn parts(&self) -> impl Iterator<Item = &'a Mixture> {
        self.parts.iter().map(|(m, _)| *m)
    }

    /// What each Gaussian adds to densities, part by part: its mass, or its count where they count particles.
    pub fn weights(&self) -> impl Iterator<Item = f64> + '_ {
        self.parts.iter().flat_map(move |&(m, unit_mass)| (0..m.len()).map(move |i| self.weight(m, unit_mass, i)))
    }

    /// That of Gaussian `i` of a part in which a particle of weight 1 has `unit_mass`.
    pub(super) fn weight(&self, m: &Mixture, unit_mass: f64, i: usize) -> f64 {
        if self.by_number { m.count[i] } else { unit_mass * m.mass_of(i) }
    }

    /// Shifts at which it is drawn, from where it is, world units.
    pub fn shifts(&self) -> &[[f64; 3]] {
        &self.shifts
    }

    /// One mixture of the optical-depth law, fitted to particles with these bounds.
    pub fn from_mixture(mixture: &'a Mixture, bounds: Bounds) -> Self {
        Scene { parts: vec![(mixture, 1.0)], bounds, blend: None, shifts: vec![[0.0; 3]], by_number: false }
    }

    /// One mixture, to be drawn by its law, fitted to particles with these bounds, with default `radius`
    /// and `opacity`.
    pub fn from_law(mixture: &'a Mixture, bounds: Bounds, radius: f64, opacity: f64) -> Self {
        let blend = |law: &'a AlphaBlend| Blend {
            vizmapper: law.vizmapper.as_deref(),
            frame: Normalisation::new(&bounds),
            radius,
            opacity,
        };
        Scene { blend: mixture.law.alpha_blend().map(blend), ..Scene::from_mixture(mixture, bounds) }
    }

    /// The law by which its Gaussians become a picture.
    pub fn law(&self) -> LawKind {
        if self.blend.is_some() { LawKind::AlphaBlend } else { LawKind::OpticalDepth }
    }

    /// Settings of the alpha-blend law; `None` = the optical-depth law.
    pub fn blend(&self) -> Option<Blend<'a>> {
        self.blend
    }

    /// Grey levels of its optical depth ([`super::optical_depth`]) in a look. A scene of the
    /// alpha-blend law has the one look that it was trained on, whichever is asked for.
    pub fn tone(&self, tau: &Plane, style: ToneStyle, tones: &Tones) -> Gray8 {
        tones.of(tau, self.look(style))
    }

    /// The look that it is drawn in where this one is asked for.
    pub(super) fn look(&self, style: ToneStyle) -> ToneStyle {
        if self.blend.is_some() { ToneStyle::Expected } else { style }
    }
}

/// Draws one thing, a scene or all particles of a snapshot, on the CPU or on a GPU.
pub trait Renderer: Sync {
    /// The picture in a look. ParaView's looks of particles have their shot noise.
    ///
    /// # Errors
    /// For a view out of range, or of particles not in perspective; where the caller stops; those of the device.
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8>;

    /// The picture without shot noise, which scenes never have.
    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        self.draw(view, size, style, context)
    }

    /// The optical depth of each pixel, without shot noise; of an alpha-blend scene the depth that looks as bright.
    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane>;
}

/// Draws a scene, also as its surface density and the map of a field.
pub trait SceneRenderer: Renderer {
    /// The surface density of each pixel ([`super::surface_density`]), mass or particles a world unit squared.
    ///
    /// # Errors
    /// As [`Renderer::draw`]; of a scene of the alpha-blend law, those of the device.
    fn surface_density(&self, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane>;

    /// The map of a field ([`super::field_map`]).
    ///
    /// # Errors
    /// Those of that; a GPU refuses means that another field weighs.
    fn field_map(&self, query: &FieldQuery, view: &DensityView, size: Size, context: &Context<'_>) -> Result<FieldMap>;
}

impl SceneRenderer for Scene<'_> {
    fn surface_density(&self, view: &DensityView, size: Size, context: &Context<'_>) -> Result<Plane> {
        super::surface_density(self, view, size, context)
    }

    fn field_map(&self, query: &FieldQuery, view: &DensityView, size: Size, context: &Context<'_>) -> Result<FieldMap> {
        super::field_map(self, query, view, size, context)
    }
}

impl Renderer for Scene<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        super::draw(self, view, size, style, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        super::optical_depth(self, view, size, context)
    }
}

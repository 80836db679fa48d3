//! What is drawn: the Gaussians, borrowed, and the bounds that clip where a view does not say.

use super::alpha::Blend;
use crate::camera::{Normalisation, View};
use crate::model::{Law, Mixture, Model, VizMapper};
use crate::picture::{Gray8, Plane, Size};
use crate::space::Bounds;
use crate::splat::{Look, tone};

/// Gaussians to draw. Cheap to make: nothing is copied.
#[derive(Clone, Debug)]
pub struct Scene<'a> {
    /// The parts, drawn in this order, and the mass of a particle of weight 1 in each.
    pub(super) parts: Vec<(&'a Mixture, f64)>,
    /// Bounds of the particles, world units.
    pub(super) bounds: Bounds,
    /// What the alpha-blend law needs beside; `None` = the optical-depth law.
    pub(super) blend: Option<Blend<'a>>,
}

impl<'a> Scene<'a> {
    /// All blocks of all layers of a model, to be drawn by its law.
    pub fn of(model: &'a Model) -> Self {
        let parts = model.layers.iter().flat_map(|l| l.blocks.iter().map(|b| (&b.gaussians, l.unit_mass())));
        Scene { parts: parts.collect(), bounds: model.metadata.bounds, blend: Blend::of(model) }
    }

    /// One mixture of the optical-depth law, fitted to particles with these bounds.
    pub fn of_mixture(mixture: &'a Mixture, bounds: Bounds) -> Self {
        Scene { parts: vec![(mixture, 1.0)], bounds, blend: None }
    }

    /// One mixture of the alpha-blend law, which has opacities, with its network, if any; fitted to
    /// particles with these bounds, with default `radius` and `opacity`.
    pub fn of_shaded(
        mixture: &'a Mixture,
        vizmapper: Option<&'a VizMapper>,
        bounds: Bounds,
        [radius, opacity]: [f64; 2],
    ) -> Self {
        let blend = Blend { vizmapper, frame: Normalisation::of(&bounds), radius, opacity };
        Scene { parts: vec![(mixture, 1.0)], bounds, blend: Some(blend) }
    }

    /// How its Gaussians become a picture.
    pub fn law(&self) -> Law {
        if self.blend.is_some() { Law::AlphaBlend } else { Law::OpticalDepth }
    }

    /// Grey levels of its optical depth ([`super::optical_depth`]) in a look. A scene of the
    /// alpha-blend law has the one look that it was trained on, whichever is asked for.
    pub fn tone(&self, tau: &Plane, look: Look, view: &View, size: Size) -> Gray8 {
        tone(tau, self.look(look), view.opacity, view.radius_pixels(size))
    }

    /// The look that it is drawn in where this one is asked for.
    pub(super) fn look(&self, asked: Look) -> Look {
        if self.blend.is_some() { Look::Expected } else { asked }
    }
}

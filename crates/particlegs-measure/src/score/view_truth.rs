//! The pictures of all particles that a model is measured against.

use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::{Renderer, Tones};
use particlegs_core::splat::ToneStyle;
use particlegs_reference::fxaa;

/// One view of all particles: ParaView's pictures, and the noise-free optical depth.
pub(super) struct ViewTruth {
    paraview: Gray8,
    paraview_no_fxaa: Gray8,
    expected: Gray8,
    tau: Plane,
    /// The curves of the view.
    pub tones: Tones,
}

impl ViewTruth {
    /// Draws all looks: ParaView's picture and the depth.
    pub fn draw(particles: &dyn Renderer, view: &View, size: Size, context: &Context<'_>) -> Result<Self> {
        let paraview_no_fxaa = particles.draw(view, size, ToneStyle::ParaviewNoFxaa, context)?;
        let tau = particles.optical_depth(view, size, context)?;
        let tones = Tones::new(view.opacity, view.radius_pixels(size));
        Ok(ViewTruth {
            paraview: fxaa(&paraview_no_fxaa),
            paraview_no_fxaa,
            expected: tones.of(&tau, ToneStyle::Expected),
            tau,
            tones,
        })
    }

    pub fn picture(&self, look: ToneStyle) -> &Gray8 {
        match look {
            ToneStyle::Paraview => &self.paraview,
            ToneStyle::ParaviewNoFxaa => &self.paraview_no_fxaa,
            ToneStyle::Expected => &self.expected,
        }
    }

    /// The noise-free picture of all particles in a look: what a model gets that knows every
    /// particle but not the sampling noise of one shot.
    pub fn noise_free(&self, look: ToneStyle) -> Gray8 {
        self.tones.of(&self.tau, look)
    }
}

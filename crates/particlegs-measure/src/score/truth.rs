//! Pictures of all particles that models are measured against: of one view in all looks, and of held-out views, by which
//! candidates are ranked while a model is made.

use super::evaluate::clipped;
use super::scores::mean;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size, masked_psnr};
use particlegs_core::render::{Renderer, Scene, Tones, tone};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Result, render};
use particlegs_particles::Particles;
use particlegs_reference::{Reference, fxaa};

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

/// Views and the `expected` pictures of all particles in them, drawn once.
pub struct HeldOutPictures {
    size: Size,
    views: Vec<View>,
    truth: Vec<Gray8>,
}

impl HeldOutPictures {
    /// Draws the truth: one noise-free pass over the particles a view.
    pub fn draw(particles: &Particles, views: &[View], size: Size, context: &Context<'_>) -> Result<Self> {
        let reference = Reference::new(particles);
        let views: Vec<View> = views.iter().map(|v| clipped(v, reference.bounds())).collect();
        let truth = views
            .iter()
            .map(|view| {
                view.check(size)?;
                let tau = reference.optical_depth(view, size, context)?;
                Ok(tone(&tau, ToneStyle::Expected, view.opacity, view.radius_pixels(size)))
            })
            .collect::<Result<_>>()?;
        Ok(HeldOutPictures { size, views, truth })
    }

    /// Mean over the views of the masked PSNR of `scene` in `expected`, dB. `None` where no view
    /// has a value: nothing is lit, or all are identical.
    pub fn expected_masked_psnr(&self, scene: &Scene, context: &Context<'_>) -> Result<Option<f64>> {
        let scores = self
            .views
            .iter()
            .zip(&self.truth)
            .map(|(view, truth)| {
                let picture = render::draw(scene, view, self.size, ToneStyle::Expected, context)?;
                Ok(masked_psnr(&picture, truth))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(mean(scores.into_iter()))
    }
}

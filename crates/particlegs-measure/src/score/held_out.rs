//! Held-out views with the truth at hand, by which candidates are ranked while a model is made.

use super::evaluate::clipped;
use super::scores::mean;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Size, masked_psnr};
use particlegs_core::render::{Scene, tone};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Result, render};
use particlegs_particles::Particles;
use particlegs_reference::Reference;

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

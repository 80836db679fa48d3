//! Held-out views: what says which Gaussians are the best.

use super::cameras::Defaults;
use super::config::Config;
use crate::Result;
use crate::camera::View;
use crate::model::{Law, Mixture, VizMapper};
use crate::picture::{Gray8, Size, masked_psnr};
use crate::progress::Progress;
use crate::reference::Reference;
use crate::render::{self, Scene};
use crate::splat::Look;

/// Views and their targets.
pub(crate) struct HeldOut<'a> {
    config: &'a Config,
    defaults: &'a Defaults,
    progress: &'a dyn Progress,
    size: Size,
    views: Vec<View>,
    truth: Vec<Gray8>,
}

impl<'a> HeldOut<'a> {
    /// Draws the targets of the first `config.evaluate_views` views, at the largest stage's size.
    ///
    /// # Errors
    /// Those of the reference renderer.
    pub fn draw(
        reference: &Reference<'_>,
        views: &[View],
        config: &'a Config,
        defaults: &'a Defaults,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let [width, height] = config.stages.iter().map(|s| s.size).max_by_key(|s| s[0] * s[1]).unwrap_or([16, 16]);
        let size = Size { width, height };
        let views: Vec<View> = views.iter().take(config.evaluate_views as usize).cloned().collect();
        let truth = views
            .iter()
            .map(|view| match config.target {
                Look::Expected => reference.response(view, size, Look::Expected, progress),
                look => reference.draw(view, size, look, progress),
            })
            .collect::<Result<_>>()?;
        Ok(HeldOut { config, defaults, progress, size, views, truth })
    }

    /// Mean masked PSNR of Gaussians, dB; `None` where no view has one.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn masked_psnr(&self, mixture: &Mixture, vizmapper: Option<&VizMapper>) -> Result<Option<f64>> {
        let Defaults { bounds, radius, opacity, .. } = *self.defaults;
        let scene = match self.config.law {
            Law::OpticalDepth => Scene::of_mixture(mixture, bounds),
            Law::AlphaBlend => Scene::of_shaded(mixture, vizmapper, bounds, [radius, opacity]),
        };
        let mut scores = Vec::new();
        for (view, truth) in self.views.iter().zip(&self.truth) {
            let drawn = render::draw(&scene, view, self.size, self.config.target, self.progress)?;
            scores.extend(masked_psnr(&drawn, truth));
        }
        Ok((!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64))
    }
}

//! Held-out views, whose score says which Gaussians are the best.

use super::cameras::Defaults;
use super::config::Config;
use super::subject::TrainingSubject;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::Mixture;
use particlegs_core::picture::{Gray8, Size, masked_psnr};
use particlegs_core::render::{self, Scene};

pub(crate) struct HeldOutViews<'a> {
    config: &'a Config,
    defaults: &'a Defaults,
    context: &'a Context<'a>,
    size: Size,
    views: Vec<View>,
    truth: Vec<Gray8>,
}

impl<'a> HeldOutViews<'a> {
    /// Draws the targets of the first `config.evaluate_views` views, at the largest stage's size.
    pub fn draw(
        subject: &dyn TrainingSubject,
        views: &[View],
        config: &'a Config,
        defaults: &'a Defaults,
        context: &'a Context<'a>,
    ) -> Result<Self> {
        let [width, height] = config.stages.iter().map(|s| s.size).max_by_key(|s| s[0] * s[1]).unwrap_or([16, 16]);
        let size = Size { width, height };
        let views: Vec<View> = views.iter().take(config.evaluate_views as usize).cloned().collect();
        let truth = views.iter().map(|view| subject.draw(view, size, config.target, context)).collect::<Result<_>>()?;
        Ok(HeldOutViews { config, defaults, context, size, views, truth })
    }

    /// Mean masked PSNR of Gaussians, dB; `None` where no view has one.
    pub fn masked_psnr(&self, mixture: &Mixture) -> Result<Option<f64>> {
        let Defaults { bounds, radius, opacity, .. } = *self.defaults;
        let scene = Scene::from_law(mixture, bounds, radius, opacity);
        let mut scores = Vec::new();
        for (view, truth) in self.views.iter().zip(&self.truth) {
            let drawn = render::draw(&scene, view, self.size, self.config.target, self.context)?;
            scores.extend(masked_psnr(&drawn, truth));
        }
        Ok((!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64))
    }
}

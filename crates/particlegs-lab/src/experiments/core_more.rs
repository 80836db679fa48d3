//! The published recipe with other choices that the paper does not compare: one seed each.

use crate::training::{TrainingTask, recipe, scaled};
use particlegs::Result;
use particlegs::model::LawKind;
use particlegs::splat::ToneStyle;
use particlegs::train::{Config, Norm, Start};

/// What is chosen otherwise, and what is trained then.
pub(super) fn choices(scale: f64, seed: u64) -> Result<Vec<(&'static str, TrainingTask)>> {
    let with = |change: fn(&mut Config)| {
        let mut config = recipe();
        change(&mut config);
        scaled(config, scale)
    };
    let published = |change| -> Result<TrainingTask> { Ok(TrainingTask::published(with(change)?, 1, seed)) };
    let from = |change| -> Result<TrainingTask> { Ok(TrainingTask::published_from_fit(with(change)?, seed)) };
    Ok(vec![
        ("without density control", published(|c| c.stages.iter_mut().for_each(|s| s.densify.every = 0))?),
        ("without opacity resets", published(|c| c.alpha_blend.reset_every = 0)?),
        ("0.8 L1 + 0.2 DSSIM", published(|c| c.loss.dssim = 0.2)?),
        ("L2", published(|c| c.loss.norm = Norm::L2)?),
        ("targets free of noise (expected)", published(|c| c.target = ToneStyle::Expected)?),
        ("started from our partition", from(|c| c.start = Start::Partition)?),
        ("started from our fit", from(|c| c.start = Start::Fit)?),
        ("law optical-depth, all else published", published(|c| c.law = LawKind::OpticalDepth)?),
    ])
}

//! The published fine-tuning of merged models.

use super::alpha::AlphaConfig;
use super::config::{Cameras, Config, Preset, Stage, Start};
use super::learner::Densify;
use particlegs_core::model::LawKind;

impl Config {
    /// The published fine-tuning of a merged alpha-blend model (paper section III-D, docs/law/published.md):
    /// 60 000 iterations at 1080p on the pictures of the whole snapshot's orbits, densification every
    /// 100 until 30 000, wider ranges of the network and nothing that holds it, no reset of opacities
    /// and no pruning by them. The run starts from a model, whatever `start` says.
    pub fn fine_tuning() -> Config {
        let published = Config::preset(Preset::Paper, LawKind::AlphaBlend);
        let first = published.stages[0];
        let stage = Stage {
            iterations: 60_000,
            size: [1920, 1080],
            internal: 0.0,
            densify: Densify { every: 100, until: 30_000, threshold: 2e-4 },
            ..first
        };
        Config {
            start: Start::Fit,
            cameras: Cameras { frames: 400, ..published.cameras },
            stages: vec![stage],
            start_gaussians: None,
            alpha_blend: AlphaConfig::fine_tuning(),
            ..published
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recipe_is_the_published_one() {
        let c = Config::fine_tuning();
        c.check().unwrap();
        assert_eq!((c.iterations(), c.stages[0].size, c.stages[0].oversample), (60_000, [1920, 1080], 2));
        assert_eq!(c.stages[0].densify, Densify { every: 100, until: 30_000, threshold: 2e-4 });
        let a = c.alpha_blend;
        assert_eq!((a.ranges.scale, a.ranges.opacity, a.ranges.floor), (0.3, 0.8, 0.1));
        assert_eq!((a.identity, a.least_opacity, a.reset_every, a.densify_from), (0.0, 0.0, 0, 1));
        let small = c.scaled(0.01).unwrap();
        small.check().unwrap();
        assert_eq!((small.iterations(), small.stages[0].densify.until), (600, 300));
    }
}

//! Every hyper-parameter of a training run, the presets, and the published fine-tuning of merged models.

use super::alpha::AlphaConfig;
use super::depth::DepthConfig;
use super::learner::Densify;
use super::loss::{Loss, Norm};
use particlegs_core::codec::file_hash;
use particlegs_core::model::{LawKind, TrainingRecipe, hex};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use serde::{Deserialize, Serialize};

/// The source of the Gaussians that a run starts from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// The effort's fit: the partition, refined by EM with split and merge.
    Fit,
    Partition,
    /// Particles drawn at random, round, as wide as their nearest neighbours are far (as published).
    Random,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cameras {
    /// Distances of the orbits, in base distances.
    pub orbits: Vec<f64>,
    /// Pictures over all orbits, held-out ones included.
    pub frames: u64,
    /// Smallest and largest radius, in default radii; between them Beta(3, 3).
    pub radius: [f64; 2],
    /// Smallest and largest opacity, in default opacities; between them Beta(3, 3).
    pub opacity: [f64; 2],
    /// Share of the pictures whose radius goes from the largest above to `wide_radius`, evenly in its
    /// logarithm.
    pub wide: f64,
    /// Largest radius of those, in default radii.
    pub wide_radius: f64,
    pub held_out: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stage {
    pub iterations: u64,
    /// Pixels across and down.
    pub size: [usize; 2],
    /// Targets are drawn this many times larger along either side, then averaged.
    pub oversample: usize,
    /// A step sees a part of this many pixels, drawn at random; [0, 0] = all.
    pub crop: [usize; 2],
    /// Share of the steps whose camera stands inside the bounds.
    pub internal: f64,
    pub densify: Densify,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    pub law: LawKind,
    /// Look of the targets: `paraview`, `paraview-no-fxaa` or `expected`.
    pub target: ToneStyle,
    pub start: Start,
    /// Steps from one evaluation on held-out pictures to the next.
    pub evaluate_every: u64,
    /// Held-out pictures that are looked at, at most.
    pub evaluate_views: u64,
    /// Seconds from one checkpoint to the next.
    pub checkpoint_seconds: f64,
    /// Bytes of targets kept on disk.
    pub cache_bytes: u64,
    pub loss: Loss,
    pub cameras: Cameras,
    pub stages: Vec<Stage>,
    /// Particles that a random start draws, at most as many as the file has room for; `None` (0 in a file) =
    /// that many.
    #[serde(with = "zero_is_none")]
    pub start_gaussians: Option<u64>,
    pub optical_depth: DepthConfig,
    pub alpha_blend: AlphaConfig,
}

particlegs_core::named_values! {
    /// A named set of hyper-parameters.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Preset {
        Fast = "fast": "At most 5 minutes on two cores for a few million particles",
        Best = "best": "At most 30 minutes on two cores",
        Paper = "paper": "The published recipe",
    }
}

const NEVER: Densify = Densify { every: 0, until: 0, threshold: 0.0 };

impl Config {
    pub fn preset(preset: Preset, law: LawKind) -> Config {
        let stage =
            |iterations, size| Stage { iterations, size, oversample: 1, crop: [0, 0], internal: 0.05, densify: NEVER };
        // Whole pictures, of less than full size: every Gaussian is seen at every step, and parts at
        // full size teach half as much in the same time (docs/results/training-optical-depth.md).
        let ours = |[half, larger]: [u64; 2], frames: u64| Config {
            law,
            target: ToneStyle::Expected,
            start: Start::Fit,
            evaluate_every: 500,
            evaluate_views: 6,
            checkpoint_seconds: 60.0,
            cache_bytes: 4 << 30,
            loss: Loss { norm: Norm::L2, smooth: 0.0, dssim: 0.0, logarithm: true },
            cameras: Cameras {
                orbits: vec![1.0, 0.7, 0.5],
                frames,
                radius: [0.25, 1.75],
                opacity: [0.25, 1.75],
                wide: 0.15,
                wide_radius: 6.25,
                held_out: 0.05,
            },
            stages: vec![stage(half, [960, 540]), stage(larger, [1440, 810])],
            start_gaussians: None,
            optical_depth: DepthConfig::default(),
            alpha_blend: AlphaConfig::default(),
        };
        match preset {
            Preset::Fast => ours([3000, 600], 240),
            Preset::Best => ours([12_000, 3000], 720),
            Preset::Paper => Config::published(law),
        }
    }

    /// The published single-block recipe: three stages, 39 000 iterations (docs/law/published.md).
    fn published(law: LawKind) -> Config {
        let stage = |iterations, size, oversample, internal, densify| Stage {
            iterations,
            size,
            oversample,
            crop: [0, 0],
            internal,
            densify,
        };
        let (hd, three) = ([1920, 1080], [5760, 3240]);
        let ours = Config::preset(Preset::Fast, law);
        Config {
            target: ToneStyle::Paraview,
            start: Start::Random,
            evaluate_every: 1000,
            evaluate_views: 8,
            checkpoint_seconds: 120.0,
            cache_bytes: 32 << 30,
            loss: Loss::PUBLISHED,
            cameras: Cameras { frames: 400, wide: 0.0, wide_radius: 1.75, held_out: 0.2, ..ours.cameras },
            stages: vec![
                stage(12_000, hd, 2, 0.0, Densify { every: 100, until: 12_000, threshold: 2e-4 }),
                stage(15_000, three, 1, 0.0, Densify { every: 200, until: 24_000, threshold: 3e-4 }),
                stage(12_000, three, 1, 0.2, Densify { every: 200, until: 36_000, threshold: 3e-4 }),
            ],
            start_gaussians: Some(200_000),
            ..ours
        }
    }

    /// Resolution, steps and counts in proportion to `scale` in (0, 1].
    pub fn scaled(mut self, scale: f64) -> Result<Config> {
        if !(scale > 0.0 && scale <= 1.0) {
            return Err(Error::argument(format!("the scale must be above 0 and at most 1, not {scale}")));
        }
        let steps = |n: u64| ((n as f64 * scale).round() as u64).max(u64::from(n > 0));
        // Sides stay at 16 pixels or more, but a crop of 0, which means the whole picture, stays 0.
        let pixels = |n: usize| ((n as f64 * scale).round() as usize).max(16.min(n));
        for stage in &mut self.stages {
            stage.iterations = steps(stage.iterations);
            stage.size = stage.size.map(pixels);
            stage.crop = stage.crop.map(pixels);
            stage.densify.until = steps(stage.densify.until);
            stage.densify.every = steps(stage.densify.every);
        }
        self.cameras.frames = steps(self.cameras.frames).max(8);
        self.evaluate_every = steps(self.evaluate_every);
        self.start_gaussians = self.start_gaussians.map(steps);
        self.alpha_blend.schedule(steps);
        Ok(self)
    }

    /// With `n` steps in all; stages, and every schedule that counts steps (densification, opacity
    /// resets, the decay of the position rate), keep their proportions. The steps between evaluations
    /// stay.
    pub fn with_iterations(mut self, n: u64) -> Result<Config> {
        if n == 0 {
            return Err(Error::argument("iterations must be at least 1"));
        }
        let total = self.iterations().max(1) as f64;
        // What is off stays off, what is on stays on.
        let steps = |s: u64| ((s as f64 / total * n as f64).round() as u64).max(u64::from(s > 0));
        let (mut before, mut done) = (0, 0);
        for stage in &mut self.stages {
            before += stage.iterations;
            // The ends are rounded instead of the lengths, so that the stages add up to `n`.
            let end = (before as f64 / total * n as f64).round() as u64;
            stage.iterations = end - done;
            stage.densify.until = (stage.densify.until as f64 / total * n as f64).round() as u64;
            stage.densify.every = steps(stage.densify.every);
            done = end;
        }
        self.alpha_blend.schedule(steps);
        Ok(self)
    }

    pub fn check(&self) -> Result<()> {
        let fail = |message: &str| Err(Error::argument(format!("training: {message}")));
        let c = &self.cameras;
        let ordered = |r: &[f64; 2]| r[0] > 0.0 && r[0] <= r[1] && r[1].is_finite();
        let share = |s: f64| (0.0..=1.0).contains(&s);
        if c.orbits.is_empty() || !c.orbits.iter().all(|o| *o > 0.0 && o.is_finite()) {
            return fail("cameras.orbits must contain at least one distance, and all must be positive");
        }
        if c.frames < 2 || c.frames > 1_000_000 {
            return fail("cameras.frames must be 2 to 1000000");
        }
        let beyond = (c.radius[1]..1e6).contains(&c.wide_radius);
        if !(ordered(&c.radius) && ordered(&c.opacity) && beyond) {
            return fail(
                "cameras.radius and cameras.opacity must be positive and ascending, wide_radius at least radius",
            );
        }
        if !(share(c.wide) && (0.0..1.0).contains(&c.held_out)) {
            return fail("cameras.wide must be 0 to 1, and cameras.held_out at least 0 and below 1");
        }
        if self.stages.is_empty() || self.stages.iter().all(|s| s.iterations == 0) {
            return fail("at least one stage must have iterations");
        }
        for s in &self.stages {
            let side = |n: usize| (16..=16_384).contains(&n);
            let whole = s.crop == [0, 0];
            let inside = (0..2).all(|k| side(s.crop[k]) && s.crop[k] <= s.size[k]);
            if !s.size.into_iter().all(side) || !(1..=8).contains(&s.oversample) || !(whole || inside) {
                return fail("a stage's size must be 16 to 16384 pixels and contain its crop, oversample 1 to 8");
            }
            if !share(s.internal) {
                return fail("a stage's internal must be 0 to 1");
            }
        }
        if self.evaluate_every == 0 || self.evaluate_views == 0 {
            return fail("evaluate_every and evaluate_views must be at least 1");
        }
        if !(self.loss.smooth >= 0.0 && share(self.loss.dssim) && self.checkpoint_seconds >= 0.0) {
            return fail("loss.smooth and checkpoint_seconds must not be negative, and loss.dssim must be 0 to 1");
        }
        self.optical_depth.check()?;
        self.alpha_blend.check()
    }

    /// The recipe that names these hyper-parameters in a model.
    pub fn recipe(&self) -> TrainingRecipe {
        let preset = |preset| Config::preset(preset, self.law);
        let presets = [
            ("fast", preset(Preset::Fast)),
            ("best", preset(Preset::Best)),
            ("paper", preset(Preset::Paper)),
            (TrainingRecipe::FINE_TUNING, Config::fine_tuning()),
        ];
        let steps = self.iterations();
        for (name, preset) in presets {
            let other = (preset.iterations() != steps).then_some(steps);
            if *self == preset || preset.with_iterations(steps).is_ok_and(|preset| *self == preset) {
                return TrainingRecipe { preset: Some(name.into()), iterations: other, config: None };
            }
        }
        let hash = file_hash(&serde_json::to_vec(self).expect("plain data"));
        TrainingRecipe { config: Some(hex(&hash)[..16].into()), ..TrainingRecipe::default() }
    }

    pub fn iterations(&self) -> u64 {
        self.stages.iter().map(|s| s.iterations).sum()
    }
}

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

/// A number that may be missing, which files write as 0.
pub(crate) mod zero_is_none {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(number: &Option<u64>, to: S) -> Result<S::Ok, S::Error> {
        number.unwrap_or(0).serialize(to)
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Option<u64>, D::Error> {
        Ok(Some(u64::deserialize(from)?).filter(|n| *n > 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_sound_at_every_scale() {
        for preset in [Preset::Fast, Preset::Best, Preset::Paper] {
            for scale in [1.0, 0.3, 0.01] {
                let config = Config::preset(preset, LawKind::OpticalDepth).scaled(scale).unwrap();
                config.check().unwrap();
            }
        }
        assert_eq!(Config::preset(Preset::Paper, LawKind::AlphaBlend).iterations(), 39_000);
        assert!(Config::preset(Preset::Fast, LawKind::OpticalDepth).scaled(0.0).is_err());
    }

    /// Files write a number that is missing as 0, and both numbers come back.
    #[test]
    fn missing_numbers_are_zero_in_files() {
        let mut config = Config::preset(Preset::Fast, LawKind::AlphaBlend);
        let text = serde_json::to_string(&config).unwrap();
        assert!(text.contains("\"start_gaussians\":0") && text.contains("\"most_gaussians\":0"), "{text}");
        assert_eq!(serde_json::from_str::<Config>(&text).unwrap(), config);
        (config.start_gaussians, config.alpha_blend.most_gaussians) = (Some(7), Some(9));
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<Config>(&text).unwrap(), config);
    }

    /// A tenth of the steps has a tenth of every schedule of the published recipe, and there and back is
    /// the same.
    #[test]
    fn schedules_shrink_with_the_steps() {
        let paper = Config::preset(Preset::Paper, LawKind::AlphaBlend);
        let short = paper.clone().with_iterations(3900).unwrap();
        let a = short.alpha_blend;
        assert_eq!((a.reset_every, a.position_rate_steps, a.densify_from), (300, 5000, 50));
        assert_eq!(short.stages.iter().map(|s| s.densify.every).collect::<Vec<_>>(), [10, 20, 20]);
        assert_eq!(short.stages.iter().map(|s| s.densify.until).collect::<Vec<_>>(), [1200, 2400, 3600]);
        assert_eq!(short.with_iterations(39_000).unwrap(), paper);
        // The rate is as far down its slope at the same share of the run.
        let rate = |c: &AlphaConfig, step| c.position_rate_at(step);
        let full = AlphaConfig::default();
        assert!((rate(&a, 1950) - rate(&full, 19_500)).abs() < 1e-15);
        // What is off stays off; one step of a schedule is the least.
        let mut off = paper;
        off.alpha_blend.reset_every = 0;
        let off = off.with_iterations(10).unwrap();
        assert_eq!((off.alpha_blend.reset_every, off.stages[0].densify.every), (0, 1));
    }

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

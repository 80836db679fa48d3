//! Methods to keep a snapshot in few bytes: our models, other compressors, a subset. Each returns a model or particles
//! to draw and measure.

use crate::jitter::jittered;
use crate::lab::{Lab, ModelBuild, ModelSettings};
use crate::rate::{BoundCheck, SizeBound, at_size, verified};
use crate::snapshot::{Snapshot, columns_of, particles_of};
use crate::subset::subset;
use crate::training::{self, TrainingTask, trained_on};
use crate::views::{ReferenceViews, Score};
use particlegs_compress::{Target, compress};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::model::Model;
use particlegs_core::{Error, Result};
use particlegs_fit::Effort;
use particlegs_particles::Particles;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompressionMethod {
    /// Our models: Gaussians whose optical depths add up.
    OpticalDepth,
    /// The published law, trained at the lab's scale.
    AlphaBlend,
    /// One of the lab's baselines; its particles may be moved at random within the bound after decoding.
    Baseline {
        /// Index in [`Lab::baselines`].
        at: usize,
        jitter: bool,
    },
    /// A random subset, drawn larger.
    Subset,
}

pub struct MethodOutput {
    pub bytes: u64,
    pub content: FileContent,
    /// The bound, for compressors that have one.
    pub bound: Option<BoundReport>,
}

impl MethodOutput {
    fn new(build: ModelBuild) -> MethodOutput {
        let bytes = build.bytes.len() as u64;
        MethodOutput { bytes, content: FileContent::Model(Box::new(build.model)), bound: None }
    }
}

pub enum FileContent {
    Model(Box<Model>),
    /// Particles, drawn with this multiple of the radius.
    Particles(Box<Particles>, f64),
}

/// A bound and whether it held.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundReport {
    /// The bound of every coordinate, world units.
    pub asked: f64,
    /// The largest error after decoding, before particles are moved.
    pub largest_error: f64,
    /// Seconds of compression and of decompression.
    pub seconds: [f64; 2],
}

/// One method at one size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MethodMeasurement {
    /// File size; 0 without a file.
    pub bytes: u64,
    /// A bound and whether it held.
    pub bound: Option<BoundReport>,
    /// Scores of its pictures; empty if it failed.
    pub scores: Vec<Score>,
    pub failure: Option<String>,
}

impl CompressionMethod {
    /// All methods without training, ours first. Methods that decode to bin centres appear twice, also with moved
    /// particles.
    pub fn all(lab: &Lab<'_>) -> Vec<CompressionMethod> {
        let variants = |at: usize| {
            let moved = ["LCP", "Quantise + pco"].contains(&lab.baselines[at].name());
            [false, true]
                .into_iter()
                .filter(move |j| moved || !j)
                .map(move |jitter| CompressionMethod::Baseline { at, jitter })
        };
        let baselines = (0..lab.baselines.len()).flat_map(variants);
        [CompressionMethod::OpticalDepth, CompressionMethod::Subset].into_iter().chain(baselines).collect()
    }

    /// [`CompressionMethod::all`]; with training also the published law, after ours.
    pub fn all_and_trained(lab: &Lab<'_>) -> Vec<CompressionMethod> {
        let mut all = CompressionMethod::all(lab);
        if lab.settings.training {
            all.insert(1, CompressionMethod::AlphaBlend);
        }
        all
    }

    /// Whether it is a model. Models are slow and hardly depend on the seed.
    pub fn is_model(self) -> bool {
        matches!(self, CompressionMethod::OpticalDepth | CompressionMethod::AlphaBlend)
    }

    /// Name in tables.
    pub fn name(self, lab: &Lab<'_>) -> String {
        match self {
            CompressionMethod::OpticalDepth => "particlegs".into(),
            CompressionMethod::AlphaBlend => "published law, trained".into(),
            CompressionMethod::Subset => "subset, scaled".into(),
            CompressionMethod::Baseline { at, jitter: false } => lab.baselines[at].name().into(),
            CompressionMethod::Baseline { at, jitter: true } => format!("{}, jittered", lab.baselines[at].name()),
        }
    }

    /// Whether it depends on the seed.
    pub fn is_random(self) -> bool {
        !matches!(self, CompressionMethod::Baseline { jitter: false, .. })
    }

    /// The identity of the method that results depend on, besides snapshot, size and seed.
    pub fn source(self, lab: &Lab<'_>) -> String {
        match self {
            CompressionMethod::Baseline { at, .. } => format!("{} {}", self.name(lab), lab.baselines[at].source()),
            CompressionMethod::AlphaBlend => format!("{} at scale {}", self.name(lab), training::scale(lab)),
            _ => self.name(lab),
        }
    }

    /// Keeps particles in about `bytes` at most; `hash` identifies them.
    pub fn keep(self, lab: &Lab<'_>, particles: &Particles, hash: &str, bytes: u64, seed: u64) -> Result<MethodOutput> {
        match self {
            CompressionMethod::OpticalDepth => {
                let recipe = ModelSettings { target: Target::Size(bytes), effort: Effort::Default, blocks: 1, seed };
                let build = lab.made(&(hash, &recipe), || {
                    compress(particles, &recipe.options(), &mut NoCheckpoints, lab.context)
                })?;
                Ok(MethodOutput::new(build))
            }
            CompressionMethod::AlphaBlend => {
                let task = TrainingTask::published_in(bytes, training::scale(lab), seed)?;
                Ok(MethodOutput::new(trained_on(lab, particles, hash, &task, None)?.made))
            }
            CompressionMethod::Subset => {
                let thin = subset(&columns_of(particles), bytes, seed, lab.context)?;
                let thin = thin.ok_or_else(|| Error::input("subset", format!("{bytes} bytes are too few")))?;
                let content =
                    FileContent::Particles(Box::new(particles_of(thin.particles, particles)), thin.radius_factor);
                Ok(MethodOutput { bytes: thin.bytes, content, bound: None })
            }
            CompressionMethod::Baseline { at, jitter } => {
                let (baseline, columns) = (&*lab.baselines[at], columns_of(particles));
                let inputs = (baseline.name(), baseline.source(), hash, bytes);
                let bound_and_bytes: (f64, u64) = lab.store.result("bound", &inputs, || {
                    let SizeBound { bound, bytes, .. } = at_size(baseline, &columns, bytes, lab.context)?;
                    Ok((bound, bytes))
                })?;
                let checked = verified(baseline, &columns, bound_and_bytes.0);
                let why = checked.failure().unwrap_or_default();
                let run = match checked {
                    BoundCheck::Held(run) => run,
                    BoundCheck::Failed(Error::Cancelled) => return Err(Error::Cancelled),
                    BoundCheck::Exceeded(_) | BoundCheck::Failed(_) => return Err(Error::input(baseline.name(), why)),
                };
                let seconds = [run.compress_seconds, run.decompress_seconds];
                let bound = BoundReport { asked: run.bound, largest_error: run.largest_error, seconds };
                // Exactly kept particles have no bins.
                let moved = jitter && run.largest_error > 0.0;
                let decoded = if moved { jittered(&run.decoded, run.bound, seed) } else { run.decoded };
                let content = FileContent::Particles(Box::new(particles_of(decoded, particles)), 1.0);
                Ok(MethodOutput { bytes: run.bytes, content, bound: Some(bound) })
            }
        }
    }

    /// Keeps a snapshot in about `bytes` and scores its pictures. Failures are reported but not cached, so that they
    /// are tried again the next time.
    pub fn measure(
        self,
        lab: &Lab<'_>,
        snapshot: &Snapshot,
        truth: &ReferenceViews,
        bytes: u64,
        seed: u64,
    ) -> Result<MethodMeasurement> {
        let seed = if self.is_random() { seed } else { 0 };
        let inputs = (self.source(lab), &snapshot.hash, truth.key(), bytes, seed);
        let measured = lab.on_device.result("pictures", &inputs, || {
            let output = self.keep(lab, &snapshot.particles, &snapshot.hash, bytes, seed)?;
            let scores = match &output.content {
                FileContent::Model(model) => truth.score_model(lab, model)?,
                FileContent::Particles(particles, factor) => truth.score_particles(lab, particles, *factor)?,
            };
            Ok(MethodMeasurement { bytes: output.bytes, bound: output.bound, scores, failure: None })
        });
        match measured {
            Err(e @ (Error::Cancelled | Error::Io { .. } | Error::Memory { .. })) => Err(e),
            Err(e) => {
                // Ctrl-C also ends the Python: report the stop, not a failure.
                lab.context.check()?;
                Ok(MethodMeasurement { bytes: 0, bound: None, scores: Vec::new(), failure: Some(e.to_string()) })
            }
            measured => measured,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantised::QuantisedCoder;
    use crate::settings::Settings;
    use crate::{Baseline, CompressedParticles, PositionColumns};
    use particlegs_core::context::Context;
    use particlegs_core::picture::Size;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// Fails while it is to.
    struct FlakyBaseline(&'static AtomicBool);

    impl Baseline for FlakyBaseline {
        fn name(&self) -> &'static str {
            "sometimes"
        }

        fn source(&self) -> String {
            "here".into()
        }

        fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
            match self.0.load(Ordering::Relaxed) {
                true => Err(Error::input("python", "ended before it answered")),
                false => QuantisedCoder.compress(particles, bound),
            }
        }

        fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
            QuantisedCoder.decompress(bytes)
        }
    }

    /// A failure is tried again by the next run, and a stop is no failure at all.
    #[test]
    fn failures_are_reported_and_not_cached() {
        static FAILS: AtomicBool = AtomicBool::new(false);
        let (snapshot, folder) = (crate::testing::snapshot(), tempfile::tempdir().unwrap());
        let stopped = AtomicBool::new(false);
        let cancel = || stopped.load(Ordering::Relaxed);
        let context = Context::SILENT.with_cancel(&cancel);
        let size = Size { width: 64, height: 36 };
        let settings = Settings { size, ..Settings::new(true, "".into()) };
        let mut lab = Lab::new(settings, folder.path(), &context).unwrap();
        lab.baselines = vec![Box::new(FlakyBaseline(&FAILS))];
        let model = lab.model(&snapshot, &ModelSettings::ratio(10.0, 1)).unwrap().model;
        let truth = ReferenceViews::new(&lab, &snapshot, &model.metadata).unwrap();
        let method = CompressionMethod::Baseline { at: 0, jitter: false };
        let measure = || method.measure(&lab, &snapshot, &truth, 3600, 1);
        FAILS.store(true, Ordering::Relaxed);
        let failed = measure().unwrap();
        assert!(failed.failure.unwrap().contains("ended before") && failed.scores.is_empty());
        stopped.store(true, Ordering::Relaxed);
        assert!(matches!(measure(), Err(Error::Cancelled)));
        stopped.store(false, Ordering::Relaxed);
        FAILS.store(false, Ordering::Relaxed);
        assert_eq!((measure().unwrap().failure, measure().unwrap().scores.len()), (None, truth.views.len()));
    }

    /// The published law stands beside ours where models may be trained, and keeps to the size that it is given.
    #[test]
    fn the_published_law_meets_a_size() {
        let particles = crate::testing::snapshot().particles;
        let folder = tempfile::tempdir().unwrap();
        let settings = Settings { training: true, scale: Some(0.004), ..Settings::new(true, "".into()) };
        let mut lab = Lab::new(settings, folder.path(), &particlegs_core::context::Context::SILENT).unwrap();
        assert_eq!(
            CompressionMethod::all_and_trained(&lab)[..2],
            [CompressionMethod::OpticalDepth, CompressionMethod::AlphaBlend]
        );
        let output = CompressionMethod::AlphaBlend.keep(&lab, &particles, "p", 6500, 1).unwrap();
        let FileContent::Model(model) = output.content else { panic!("a model") };
        assert_eq!(model.metadata.law, particlegs_core::model::LawKind::AlphaBlend);
        assert!((5200..6500).contains(&output.bytes), "{}", output.bytes);
        lab.settings.training = false;
        assert!(!CompressionMethod::all_and_trained(&lab).contains(&CompressionMethod::AlphaBlend));
    }
}

//! Runs broken at any moment end as unbroken ones; faults and limits are survived.

use super::learner::{Learner, NonFiniteGradient, StepInfo, StepReport, TrainingSample};
use super::loss::Loss;
use super::run::bytes_wanted;
use super::state::TrainingState;
use super::targets_tests::{ParticleSubject, cloud, defaults};
use super::{Cameras, Config, InitialGaussians, Limits, Preset, Stage, TrainedMixture, Training};
use particlegs_core::checkpoint::{CheckpointStore, NoCheckpoints};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Mixture};
use particlegs_core::{Error, Result};
use particlegs_fit::{Effort, FitOptions, fit};
use particlegs_particles::Particles;
use particlegs_reference::Reference;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

fn config(law: LawKind, iterations: u64) -> Config {
    let plain = Config::preset(Preset::Fast, law);
    let stage = Stage { iterations, size: [48, 32], crop: [32, 16], internal: 0.3, ..plain.stages[0] };
    Config {
        stages: vec![stage, Stage { iterations: 2, crop: [0, 0], oversample: 2, ..stage }],
        cameras: Cameras { frames: 8, ..plain.cameras.clone() },
        evaluate_every: 3,
        evaluate_views: 2,
        checkpoint_seconds: 0.0,
        ..plain
    }
}

fn fitted(particles: &Particles) -> Mixture {
    let options = FitOptions { gaussians: 20, effort: Effort::Fast, radius: 0.1, pixel: 0.1, seed: 1, share: 1.0 };
    fit(particles, &options, &Context::SILENT).unwrap()
}

#[derive(Default)]
struct MemoryPieces(BTreeMap<String, Vec<u8>>);

impl CheckpointStore for MemoryPieces {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.0.get(key).cloned()
    }
    fn keep(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.0.insert(key.into(), bytes);
        Ok(())
    }
}

/// Asks to stop from the n-th question on.
fn cancel_after(n: u64) -> impl Fn() -> bool + Sync {
    let left = AtomicU64::new(n);
    move || left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| Some(n.saturating_sub(1))) == Ok(0)
}

#[test]
fn memory_is_that_of_the_largest_pictures() {
    let small = Config::preset(Preset::Fast, LawKind::OpticalDepth);
    let stage = Stage { size: [16_384, 16_384], oversample: 8, ..small.stages[0] };
    let large = Config { stages: [&small.stages[..], &[stage]].concat(), ..small.clone() };
    let [small, large] = [small, large].map(|c| bytes_wanted(&c, 1000));
    assert!(small < 100 << 20 && large > 128 << 30, "{small} and {large} bytes");
}

#[test]
fn a_run_stopped_at_any_question_ends_with_the_same_bits() {
    let particles = cloud(2000);
    let (defaults, start) = (defaults(&particles), fitted(&particles));
    let subject = ParticleSubject(Reference::with_bounds(&particles, defaults.bounds));
    for law in [LawKind::OpticalDepth, LawKind::AlphaBlend] {
        let config = config(law, 8);
        let run = |checkpoints: &mut dyn CheckpointStore, context: &Context<'_>| -> Result<TrainedMixture> {
            let training =
                Training { subject: &subject, config: &config, limits: &Limits::default(), defaults: &defaults };
            training.run(InitialGaussians::Fit(&start), checkpoints, context)
        };
        let whole = run(&mut NoCheckpoints, &Context::SILENT).unwrap();
        assert_eq!((whole.iterations, whole.stopped), (10, false));
        // Every process is stopped a few questions after it has gone on.
        for stride in [9, 14, 31] {
            let mut checkpoints = MemoryPieces::default();
            let mut processes = 0;
            let broken = loop {
                processes += 1;
                assert!(processes < 400, "no progress");
                match run(&mut checkpoints, &Context::SILENT.with_cancel(&cancel_after(stride + processes / 4))) {
                    Err(Error::Cancelled) => {}
                    Ok(t) if t.stopped => {}
                    done => break done.unwrap(),
                }
            };
            assert!(processes > 1, "never stopped");
            assert_eq!(&broken.mixture, &whole.mixture, "{law:?} {stride}");
            assert_eq!((broken.scores, broken.iterations), (whole.scores, whole.iterations));
            // A finished run is not done again.
            assert_eq!(run(&mut checkpoints, &Context::SILENT).unwrap().mixture, whole.mixture);
        }
    }
}

/// Never has a finite gradient.
struct FaultyLearner(Mixture, f64);

impl Learner for FaultyLearner {
    fn step(&mut self, _: &TrainingSample<'_>, _: &Loss, _: &StepInfo) -> Result<StepReport> {
        self.1 += 1.0;
        let not_finite = Some(NonFiniteGradient { group: "position", gaussian: 4, count: 1 });
        Ok(StepReport { loss: f64::NAN, not_finite })
    }
    fn control(&mut self, _: &StepInfo) -> Result<()> {
        Ok(())
    }
    fn len(&self) -> usize {
        self.0.len()
    }
    fn mixture(&self) -> Mixture {
        self.0.clone()
    }
    fn state(&self) -> TrainingState {
        let mut state = TrainingState::default();
        state.numbers.insert("steps".into(), vec![self.1]);
        state
    }
    fn restore(&mut self, state: &TrainingState) -> std::result::Result<(), String> {
        self.1 = state.doubles("steps", 1)?[0];
        Ok(())
    }
}

#[test]
fn faults_in_every_step_and_a_time_that_is_up_are_survived() {
    let particles = cloud(500);
    let defaults = defaults(&particles);
    let subject = ParticleSubject(Reference::with_bounds(&particles, defaults.bounds));
    let config = config(LawKind::OpticalDepth, 30);
    let run = |limits: &Limits| {
        let learner = Box::new(FaultyLearner(fitted(&particles), 0.0));
        let training = Training { subject: &subject, config: &config, limits, defaults: &defaults };
        training.run_with(learner, &mut NoCheckpoints, &Context::SILENT).unwrap()
    };
    let done = run(&Limits::default());
    assert_eq!((done.iterations, done.not_finite, done.mixture.len()), (32, 32, 20));
    let late = run(&Limits { seconds: Some(0.0), ..Limits::default() });
    assert_eq!((late.iterations, late.stopped), (0, false));
    assert!(late.scores[1].is_some(), "the start is scored");
}

#[test]
fn states_of_other_runs_are_refused() {
    let particles = cloud(500);
    let (defaults, start) = (defaults(&particles), fitted(&particles));
    let subject = ParticleSubject(Reference::with_bounds(&particles, defaults.bounds));
    let mut checkpoints = MemoryPieces::default();
    checkpoints.keep("train", TrainingState::default().to_bytes()).unwrap();
    let config = config(LawKind::OpticalDepth, 4);
    let training = Training { subject: &subject, config: &config, limits: &Limits::default(), defaults: &defaults };
    let error = training.run(InitialGaussians::Fit(&start), &mut checkpoints, &Context::SILENT).unwrap_err();
    assert!(error.to_string().contains("no column `run`"), "{error}");
}

#[test]
fn runs_share_the_time_that_is_left() {
    let limits = Limits { seconds: Some(300.0), ..Limits::default() };
    let share = |runs| limits.share(runs).seconds.unwrap();
    assert!((share(1) - 300.0).abs() < 1.0 && (share(3) - 100.0).abs() < 1.0);
    assert_eq!(Limits::default().share(3).seconds, None);
}

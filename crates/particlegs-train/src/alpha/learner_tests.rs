//! The learner as a whole, on the sample.

use super::parameters::ParameterGroup;
use super::*;
use crate::learner::{Crop, Densify, Learner, NonFiniteGradient, StepInfo, TrainingSample};
use crate::loss::Loss;
use crate::state::TrainingState;
use crate::targets_tests::ParticleSubject;
use particlegs_core::camera::{Normalisation, ORBITS, View, base_distance, spiral};
use particlegs_core::context::{Context, Level};
use particlegs_core::math::Random;
use particlegs_core::model::{Block, LawKind, Layer, Mass, Mixture, Model};
use particlegs_core::picture::{Gray8, Plane, Size, masked_psnr};
use particlegs_core::render::{self, Scene};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_particles::Particles;
use particlegs_reference::Reference;

fn scale(bounds: &Bounds, particles: u64) -> TrainingScale {
    TrainingScale {
        frame: Normalisation::new(bounds),
        radius: bounds.default_radius(particles),
        opacity: 0.05,
        particles,
        seed: 4,
    }
}

/// Pictures of the sample to learn from.
struct TrainingSet {
    bounds: Bounds,
    particles: Particles,
    samples: Vec<(View, Gray8, Plane)>,
}

/// `frames` views an orbit, radius and opacity as published.
fn views(bounds: &Bounds, radius: f64, size: Size, frames: usize, seed: u64) -> Vec<View> {
    let base = base_distance(bounds, size);
    let cameras = ORBITS.iter().flat_map(|o| spiral(bounds.center(), base * o.factor, frames, Some(seed)));
    cameras
        .enumerate()
        .map(|(i, camera)| {
            let mut r = Random::new(seed, 1, i as u64);
            let (radius, opacity) = (radius * (0.25 + 1.5 * r.beta33()), 0.0125 + 0.075 * r.beta33());
            View { name: format!("{i}"), camera, radius, opacity }
        })
        .collect()
}

fn lesson(size: Size, frames: usize) -> TrainingSet {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/nbody64");
    let particles = Particles::open_raw(&[folder.into()]).unwrap();
    let bounds = particles.bounds();
    let radius = bounds.default_radius(particles.len() as u64);
    let reference = Reference::new(&particles);
    let samples = views(&bounds, radius, size, frames, 3)
        .into_iter()
        .map(|view| {
            let truth = reference.draw(&view, size, ToneStyle::Expected, &Context::SILENT).unwrap();
            let target = Plane { size, data: truth.data.iter().map(|b| f32::from(*b) / 255.0).collect() };
            (view, truth, target)
        })
        .collect();
    TrainingSet { bounds, particles, samples }
}

fn sample<'a>(view: &'a View, target: &'a Plane) -> TrainingSample<'a> {
    sample_with(view, target, &Context::SILENT)
}

fn sample_with<'a>(view: &'a View, target: &'a Plane, context: &'a Context<'a>) -> TrainingSample<'a> {
    TrainingSample { view, target, crop: Crop::whole(target.size), context }
}

fn moment(iteration: u64, iterations: u64, densify: Densify) -> StepInfo {
    StepInfo { iteration, iterations, done: iteration as f64 / iterations as f64, densify }
}

const STILL: Densify = Densify { every: 0, until: 0, threshold: 2e-4 };

fn train(learner: &mut AlphaLearner, lesson: &TrainingSet, from: u64, steps: u64, densify: Densify) -> f64 {
    train_with(learner, lesson, from..from + steps, densify, &Context::SILENT)
}

fn train_with(
    learner: &mut AlphaLearner,
    lesson: &TrainingSet,
    iterations: std::ops::Range<u64>,
    densify: Densify,
    context: &Context<'_>,
) -> f64 {
    let (mut sum, last, steps) = (0.0, iterations.end, iterations.end - iterations.start);
    for iteration in iterations {
        let (view, _, target) = &lesson.samples[iteration as usize % lesson.samples.len()];
        let at = moment(iteration, last, densify);
        let stepped = learner.step(&sample_with(view, target, context), &Loss::PUBLISHED, &at).unwrap();
        assert_eq!(stepped.not_finite, None);
        sum += stepped.loss;
        learner.control(&at).unwrap();
    }
    sum / steps as f64
}

fn model(learner: &AlphaLearner, bounds: Bounds) -> Model {
    let gaussians = learner.mixture();
    let n = learner.gaussians.scale.particles;
    let mut m = render::testing::empty_model(bounds, n);
    m.metadata.law = LawKind::AlphaBlend;
    m.metadata.default_radius = learner.gaussians.scale.radius;
    m.metadata.default_opacity = learner.gaussians.scale.opacity;
    let block = Block { bounds, count: n, mass: n as f64, gaussians };
    m.layers = vec![Layer { name: "dm".into(), mass: Mass::Unknown, content: vec![block] }];
    m
}

/// Mean masked PSNR over a lesson's views, drawn as models are.
fn score(learner: &AlphaLearner, lesson: &TrainingSet) -> f64 {
    let m = model(learner, lesson.bounds);
    let psnr = lesson.samples.iter().map(|(view, truth, _)| {
        masked_psnr(
            &render::draw(&Scene::new(&m), view, truth.size, ToneStyle::Paraview, &Context::SILENT).unwrap(),
            truth,
        )
        .unwrap()
    });
    psnr.sum::<f64>() / lesson.samples.len() as f64
}

const SMALL: Size = Size { width: 240, height: 135 };

#[test]
fn training_on_the_sample_lowers_the_loss() {
    let lesson = lesson(SMALL, 4);
    let n = lesson.particles.len() as u64;
    let subject = ParticleSubject(Reference::with_bounds(&lesson.particles, lesson.bounds));
    let mut learner =
        AlphaLearner::from_particles(&subject, 2000, scale(&lesson.bounds, n), AlphaConfig::default()).unwrap();
    let before = score(&learner, &lesson);
    let first = train(&mut learner, &lesson, 0, 12, STILL);
    train(&mut learner, &lesson, 12, 180, STILL);
    let last = train(&mut learner, &lesson, 192, 12, STILL);
    let after = score(&learner, &lesson);
    println!("loss {first:.4} to {last:.4}, masked PSNR {before:.2} to {after:.2} dB");
    assert!(last < 0.7 * first, "{first} to {last}");
    assert!(after > before + 3.0, "{before} to {after}");
}

const BUSY: Densify = Densify { every: 4, until: 100, threshold: 1e-5 };

fn small_learner(lesson: &TrainingSet, config: AlphaConfig) -> AlphaLearner {
    let n = lesson.particles.len() as u64;
    let subject = ParticleSubject(Reference::with_bounds(&lesson.particles, lesson.bounds));
    AlphaLearner::from_particles(&subject, 600, scale(&lesson.bounds, n), config).unwrap()
}

const QUICK: Size = Size { width: 112, height: 63 };

/// Twelve steps, densification, pruning and a reset among them.
fn eventful(
    lesson: &TrainingSet,
    from: Option<(&TrainingState, u64)>,
    to: u64,
    context: &Context<'_>,
) -> TrainingState {
    let config = AlphaConfig { densify_from: 1, reset_every: 9, ..AlphaConfig::default() };
    let mut learner = small_learner(lesson, config);
    if let Some((state, _)) = from {
        learner.restore(state).unwrap();
    }
    let start = from.map_or(0, |f| f.1);
    train_with(&mut learner, lesson, start..to, BUSY, context);
    assert!(learner.len() > 700, "{}", learner.len());
    learner.state()
}

#[test]
fn threads_vectors_and_interruptions_do_not_change_a_bit() {
    let lesson = lesson(QUICK, 1);
    let whole = eventful(&lesson, None, 12, &Context::SILENT);
    let one = rayon_core::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(whole == one.install(|| eventful(&lesson, None, 12, &Context::SILENT)), "threads");
    let plain = eventful(&lesson, None, 12, &Context::scalar());
    assert!(whole == plain, "vectors");
    let half = eventful(&lesson, None, 6, &Context::SILENT);
    assert!(whole == eventful(&lesson, Some((&half, 6)), 12, &Context::SILENT), "interruption");
}

#[test]
fn a_state_that_does_not_fit_is_refused() {
    let lesson = lesson(QUICK, 1);
    let mut learner = small_learner(&lesson, AlphaConfig::default());
    let before = learner.state();
    let mut broken = before.clone();
    broken.columns.get_mut("rotation.first").unwrap().pop();
    assert!(learner.restore(&broken).unwrap_err().contains("`rotation.first`"));
    broken = before.clone();
    broken.columns.remove("vizmapper");
    assert!(learner.restore(&broken).unwrap_err().contains("`vizmapper`"));
    assert!(learner.state() == before);
}

/// A spoilt gradient is named, its Gaussian stays, the others move.
#[test]
fn gradients_that_are_not_numbers_are_survived() {
    let lesson = lesson(QUICK, 1);
    for (group, value) in [(ParameterGroup::Scale, f32::NAN), (ParameterGroup::Position, f32::INFINITY)] {
        let mut learner = small_learner(&lesson, AlphaConfig::default());
        train(&mut learner, &lesson, 0, 3, STILL);
        let before = learner.state();
        learner = learner.by(|_| Ok(Box::new(AlphaCpuSteps { spoil: Some((group, 17, value)) }))).unwrap();
        let (view, _, target) = &lesson.samples[0];
        let at = moment(3, 9, STILL);
        let stepped = learner.step(&sample(view, target), &Loss::PUBLISHED, &at).unwrap();
        assert_eq!(stepped.not_finite, Some(NonFiniteGradient { group: group.name(), gaussian: 17, count: 1 }));
        let after = learner.state();
        for g in ParameterGroup::ALL {
            let w = g.width();
            for name in [g.name().to_string(), format!("{}.first", g.name()), format!("{}.second", g.name())] {
                let (a, b) = (&before.columns[&name], &after.columns[&name]);
                assert_eq!(a[17 * w..18 * w], b[17 * w..18 * w], "{name}");
                assert!(a != b && b.iter().all(|v| v.is_finite()), "{name}");
            }
        }
        train(&mut learner, &lesson, 4, 3, STILL);
    }
}

#[test]
fn parameters_and_targets_that_are_not_numbers_are_named() {
    let lesson = lesson(QUICK, 1);
    let mut learner = small_learner(&lesson, AlphaConfig::default());
    learner.gaussians.parameters.0[ParameterGroup::Rotation as usize][4 * 33 + 1] = f32::NAN;
    let (view, _, target) = &lesson.samples[0];
    let at = moment(0, 9, STILL);
    let stepped = learner.step(&sample(view, target), &Loss::PUBLISHED, &at).unwrap();
    assert_eq!(stepped.not_finite, Some(NonFiniteGradient { group: "rotation", gaussian: 33, count: 1 }));
    assert!(learner.gaussians.mapper.as_ref().unwrap().parameters.iter().all(|v| v.is_finite()));
    let mut target = target.clone();
    target.data.fill(f32::NAN);
    let mut learner = small_learner(&lesson, AlphaConfig::default());
    let before = learner.gaussians.parameters.clone();
    let stepped = learner.step(&sample(view, &target), &Loss::PUBLISHED, &at).unwrap();
    assert!(stepped.not_finite.unwrap().count > 100);
    assert!(learner.gaussians.parameters.0.iter().flatten().all(|v| v.is_finite()));
    assert_eq!(learner.len(), before.len());
    let mut mixture = Mixture::default();
    mixture.push([0.0; 3], particlegs_core::math::Sym3::scaled_identity(1.0), 1.0, 1.0);
    mixture.push([0.0, f64::NAN, 0.0], particlegs_core::math::Sym3::scaled_identity(1.0), 1.0, 1.0);
    let fault = AlphaLearner::from_mixture(&mixture, learner.gaussians.scale, learner.config).err().unwrap();
    assert_eq!(fault.to_string(), "Gaussian 1: its position is not finite");
}

/// Each rule of the published density control on its own.
#[test]
fn density_control_by_hand() {
    let lesson = lesson(QUICK, 1);
    let config = AlphaConfig { densify_from: 1, ..AlphaConfig::default() };
    let fresh = || {
        let mut l = small_learner(&lesson, config);
        // Gaussian 3 is small and pulled at, 5 large and pulled at, 7 nearly transparent.
        l.gaussians.parameters.0[ParameterGroup::Scale as usize][9..12].fill(-6.0);
        l.gaussians.parameters.0[ParameterGroup::Scale as usize][15..18].copy_from_slice(&[-6.0, -1.0, -6.0]);
        l.gaussians.parameters.0[ParameterGroup::Opacity as usize][7] = -6.0;
        l.gaussians.screen[3] = [3e-3, 3.0];
        l.gaussians.screen[5] = [9e-3, 3.0];
        l.gaussians.averages[ParameterGroup::Opacity as usize].first.fill(0.5);
        l
    };
    let due = Densify { every: 10, until: 100, threshold: 5e-4 };
    let at = |iteration, densify| moment(iteration, 1000, densify);
    let mut l = fresh();
    for quiet in [at(8, due), at(109, due), at(9, Densify { every: 0, ..due })] {
        l.control(&quiet).unwrap();
        assert!(l.gaussians.parameters == fresh().gaussians.parameters);
    }
    l.control(&at(9, due)).unwrap();
    let before = fresh().gaussians.parameters;
    // One more by the clone, one more by the split, one less by pruning.
    assert_eq!(l.len(), 601);
    let p = &l.gaussians.parameters;
    assert_eq!((p.get(3), p.get(4), p.get(5)), (before.get(3), before.get(4), before.get(6)));
    assert_eq!(p.get(6), before.get(8));
    assert_eq!(p.get(598), before.get(3));
    for k in [599, 600] {
        let (piece, whole) = (p.get(k), before.get(5));
        assert!((0..3).all(|a| (whole.log_scale[a] - piece.log_scale[a] - 1.6f64.ln()).abs() < 1e-6));
        assert!(piece.position != whole.position && piece.rotation == whole.rotation);
    }
    let first = &l.gaussians.averages[ParameterGroup::Opacity as usize].first;
    assert!(first.len() == 601 && first[597] == 0.5 && first[598..] == [0.0; 3]);
    assert!(l.gaussians.screen.iter().all(|s| *s == [0.0; 2]));
    // One place is left: the stronger pull gets it.
    let mut l = fresh();
    l.config.most_gaussians = Some(601);
    l.control(&at(9, due)).unwrap();
    assert_eq!(l.len(), 600);
    assert_eq!(l.gaussians.parameters.get(3), before.get(3));
    // Opacities go down to 1.33 of what is pruned.
    let mut l = fresh();
    l.config.reset_every = 7;
    l.control(&at(6, due)).unwrap();
    let most = (0..600).map(|i| l.gaussians.parameters.get(i).opacity()).fold(0.0, f64::max);
    assert!(
        (most - 0.0133).abs() < 1e-6
            && l.gaussians.averages[ParameterGroup::Opacity as usize].first.iter().all(|v| *v == 0.0)
    );
}

/// The picture in training and the one drawn from the model are the same, and a model goes on where
/// it was.
#[test]
fn models_hold_what_was_trained() {
    let lesson = lesson(QUICK, 2);
    let mut learner = small_learner(&lesson, AlphaConfig::default());
    train(&mut learner, &lesson, 0, 30, STILL);
    let m = model(&learner, lesson.bounds);
    let sum: f64 = m.layers[0].content[0].gaussians.count.iter().sum();
    assert!((sum / lesson.particles.len() as f64 - 1.0).abs() < 1e-12);
    let mut again = AlphaLearner::from_model(&m, learner.gaussians.scale, learner.config).unwrap();
    let (view, _, target) = &lesson.samples[1];
    let at = moment(30, 31, STILL);
    let sample = sample(view, target);
    let losses = [&mut learner, &mut again].map(|l| l.step(&sample, &Loss::PUBLISHED, &at).unwrap().loss);
    assert!((losses[0] - losses[1]).abs() < 1e-6, "{losses:?}");
    let drawn = render::draw(&Scene::new(&m), view, QUICK, ToneStyle::Expected, &Context::SILENT).unwrap();
    let levels = drawn.data.iter().map(|b| f32::from(*b) / 255.0).collect();
    let loss = Loss::PUBLISHED.evaluate(&Plane { size: QUICK, data: levels }, target, Level::new()).value;
    assert!((loss - losses[0]).abs() < 2e-3, "{loss} {losses:?}");
}

/// A mixture of the optical-depth law is a far better start than particles at random.
#[test]
fn a_mixture_is_a_start() {
    use particlegs_fit::{Effort, FitOptions, fit};
    let lesson = lesson(QUICK, 2);
    let scale = scale(&lesson.bounds, lesson.particles.len() as u64);
    let options = FitOptions { effort: Effort::Fast, ..FitOptions::new(600, scale.radius) };
    let mixture = fit(&lesson.particles, &options, &Context::SILENT).unwrap();
    let from = AlphaLearner::from_mixture(&mixture, scale, AlphaConfig::default()).unwrap();
    let (mixture, random) = (score(&from, &lesson), score(&small_learner(&lesson, AlphaConfig::default()), &lesson));
    println!("masked PSNR of the start: mixture {mixture:.2}, particles {random:.2} dB");
    assert!(mixture > random + 5.0, "{mixture} {random}");
}

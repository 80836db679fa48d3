//! Steps against their twins on the processor, on whatever adapter there is.

use super::*;
use crate::GpuAccelerator;
use crate::tests::{clumps, device, target, view};
use crate::train::Trainer;
use particlegs_compress::{Options, Target, compress};
use particlegs_core::camera::{Normalisation, View};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::model::LawKind;
use particlegs_core::picture::Size;
use particlegs_core::render::alpha::network::twin::stirred;
use particlegs_core::space::Bounds;
use particlegs_train::alpha::{AlphaCpuSteps, AlphaParameters, TrainingScale};
use particlegs_train::{Accelerator, Averages, Config, Crop, Limits, Norm, Preset};

const SIZE: Size = Size { width: 160, height: 90 };
/// Default radius and opacity.
const USUAL: [f64; 2] = [0.02, 0.05];

struct AlphaTrainingCase {
    name: &'static str,
    gaussians: Gaussians,
    view: View,
    loss: Loss,
    crop: Crop,
}

/// Gaussians of about this logarithm of their size, as much flatter along two axes, with a network or without.
fn gaussians(seed: u64, n: u64, size: f64, flatness: f64, with_network: bool) -> Gaussians {
    let bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
    let [radius, opacity] = USUAL;
    let frame = Normalisation::new(&bounds);
    let mut parameters = AlphaParameters::default();
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let [position, scale, rotation, logit, feature] = &mut parameters.0;
        position.extend([0; 3].map(|_| (frame.scale * (2.0 * r.uniform() - 1.0)) as f32));
        let log_size = size + 0.5 * r.normal();
        scale.extend([
            log_size as f32,
            (log_size - flatness * r.uniform()) as f32,
            (log_size - flatness * r.uniform()) as f32,
        ]);
        rotation.extend([0; 4].map(|_| r.normal() as f32));
        logit.push((-1.0 + 2.0 * r.normal()) as f32);
        feature.push((0.5 * r.normal()) as f32);
    }
    let mapper = with_network.then(|| stirred(3));
    let network = mapper.as_ref().map_or(0, |m| m.parameters.len());
    Gaussians {
        scale: TrainingScale { frame, radius, opacity, particles: 1000, seed: 1 },
        averages: parameters.0.each_ref().map(|column| Averages::zeros(column.len())),
        mapper,
        mapper_averages: Averages::zeros(network),
        screen: vec![[0.0; 2]; n as usize],
        parameters,
    }
}

fn cases() -> Vec<AlphaTrainingCase> {
    let (far, near, inside) = ([1.0, 2.0, 6.0], [0.3, 0.2, 1.6], [0.1, 0.2, 0.5]);
    let l2 = Loss { norm: Norm::L2, ..Loss::PUBLISHED };
    let case = |name, gaussians, view| AlphaTrainingCase { name, gaussians, view, loss: l2, crop: Crop::whole(SIZE) };
    let usual = || gaussians(1, 800, -3.0, 1.0, true);
    let crop = Crop { full: SIZE, corner: [37, 21], size: Size { width: 64, height: 48 } };
    vec![
        case("from afar", usual(), view(far, USUAL)),
        case("without a network", gaussians(1, 800, -3.0, 1.0, false), view(far, USUAL)),
        case("large and opaque", usual(), view(far, [0.035, 0.0875])),
        case("small and faint", usual(), view(far, [0.005, 0.0125])),
        case("smaller than a pixel", gaussians(2, 800, -6.0, 1.0, true), view(far, USUAL)),
        case("near", usual(), view(near, USUAL)),
        case("within", usual(), view(inside, USUAL)),
        case("needles", gaussians(4, 500, -2.0, 5.0, true), view(far, USUAL)),
        case("wide", gaussians(5, 60, 0.0, 1.0, true), view(far, USUAL)),
        AlphaTrainingCase { crop, ..case("crop", usual(), view(far, USUAL)) },
        AlphaTrainingCase { loss: Loss::PUBLISHED, ..case("published loss", usual(), view(far, USUAL)) },
        AlphaTrainingCase { loss: Loss { dssim: 0.4, ..l2 }, ..case("SSIM", usual(), view(far, USUAL)) },
        AlphaTrainingCase {
            loss: Loss { dssim: 1.0, logarithm: true, ..l2 },
            ..case("SSIM alone, logarithm", usual(), view(near, USUAL))
        },
    ]
}

/// Rates that move Gaussians by about as much as published ones do in a hundred steps.
const STEP: StepSize = StepSize { rates: [1e-3, 5e-3, 1e-3, 5e-2, 2.5e-3], network: 1e-3, clip: 1.0, identity: 0.01 };

fn steps(
    steps: &mut dyn AlphaStepper,
    gaussians: &mut Gaussians,
    case: &AlphaTrainingCase,
    number: usize,
) -> Vec<StepReport> {
    let target = target(case.crop.size);
    let sample = TrainingSample { view: &case.view, target: &target, crop: case.crop, context: &Context::SILENT };
    let reports = (0..number).map(|_| steps.step(gaussians, &sample, &case.loss, &STEP).unwrap()).collect();
    steps.fetch(gaussians).unwrap();
    reports
}

/// The root mean square of differences over that of the first.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let square = |v: f64| v * v;
    let sum: f64 = a.iter().zip(b).map(|(a, b)| square(f64::from(*a) - f64::from(*b))).sum();
    (sum / a.iter().map(|a| square(f64::from(*a))).sum::<f64>().max(1e-300)).sqrt()
}

/// Differences over the way that the first went from `start`.
fn strayed(a: &[f32], b: &[f32], start: &[f32]) -> f64 {
    let way = |v: &[f32]| v.iter().zip(start).map(|(v, s)| v - s).collect::<Vec<f32>>();
    apart(&way(a), &way(b))
}

#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn gradients_and_losses_are_the_cpus() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    for case in cases() {
        let (mut cpu, mut gpu) = (case.gaussians.clone(), case.gaussians.clone());
        let ours = steps(&mut AlphaCpuSteps::default(), &mut cpu, &case, 1);
        let theirs = steps(&mut *trainer.alpha_steps(&gpu).unwrap(), &mut gpu, &case, 1);
        // Adam's first mean is a tenth of the gradient.
        let mut by: Vec<f64> = cpu.averages.iter().zip(&gpu.averages).map(|(a, b)| apart(&a.first, &b.first)).collect();
        if cpu.mapper.is_some() {
            by.push(apart(&cpu.mapper_averages.first, &gpu.mapper_averages.first));
        }
        let sizes = |gaussians: &Gaussians| gaussians.screen.iter().map(|s| s[0]).collect::<Vec<f32>>();
        by.push(apart(&sizes(&cpu), &sizes(&gpu)));
        assert!(cpu.screen.iter().zip(&gpu.screen).all(|(a, b)| a[1] == b[1]), "{}: others are seen", case.name);
        let loss = (ours[0].loss - theirs[0].loss).abs() / ours[0].loss.abs();
        println!(
            "{}: {}; loss {loss:.1e}",
            case.name,
            by.iter().map(|v| format!("{v:.1e}")).collect::<Vec<_>>().join(" ")
        );
        assert!(theirs[0].not_finite.is_none());
        assert!(by.iter().all(|b| *b < 1e-4) && loss < 1e-5, "{}", case.name);
    }
}

/// Steps one after the other, also where memory holds what is no number before each.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn steps_go_where_the_cpus_go() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    for case in [0, 1, 11].map(|k| cases().swap_remove(k)) {
        let start = &case.gaussians;
        let [mut cpu, mut gpu, mut poisoned, mut both] = std::array::from_fn(|_| start.clone());
        let ours = steps(&mut AlphaCpuSteps::default(), &mut cpu, &case, 12);
        let theirs = steps(&mut *trainer.alpha_steps(&gpu).unwrap(), &mut gpu, &case, 12);
        let mut device_steps = AlphaSteps::new(&device, &trainer.kernels, &trainer.blender, start).unwrap();
        for _ in 0..12 {
            steps(&mut device_steps, &mut poisoned, &case, 1);
            device_steps.poison();
        }
        assert!(poisoned == gpu, "{}: what was there before is seen", case.name);
        // Begun on one, and gone on on the other.
        steps(&mut AlphaCpuSteps::default(), &mut both, &case, 6);
        steps(&mut *trainer.alpha_steps(&both).unwrap(), &mut both, &case, 6);
        let passed: Vec<f64> = cpu.parameters.0.iter().zip(&both.parameters.0).map(|(a, b)| apart(a, b)).collect();
        assert!(passed.iter().all(|v| *v < 1e-4), "{}: {passed:?}", case.name);
        let columns = cpu.parameters.0.iter().zip(&gpu.parameters.0).zip(&start.parameters.0);
        let mut by: Vec<f64> = columns.map(|((a, b), start)| strayed(a, b, start)).collect();
        if let [Some(a), Some(b), Some(start)] = [&cpu.mapper, &gpu.mapper, &start.mapper] {
            by.push(strayed(&a.parameters, &b.parameters, &start.parameters));
        }
        let loss = (ours[11].loss - theirs[11].loss).abs() / ours[11].loss;
        println!(
            "{}: {}; loss {loss:.1e}",
            case.name,
            by.iter().map(|v| format!("{v:.1e}")).collect::<Vec<_>>().join(" ")
        );
        assert!(ours[11].loss < ours[0].loss && by.iter().all(|v| *v < 1e-2) && loss < 1e-4, "{}", case.name);
    }
}

/// Gaussians that others changed, in number too, are sent anew.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn what_density_control_changed_is_sent() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let case = cases().swap_remove(0);
    let mut gaussians = case.gaussians.clone();
    let mut device_steps = trainer.alpha_steps(&gaussians).unwrap();
    steps(&mut *device_steps, &mut gaussians, &case, 2);
    for (column, width) in gaussians.parameters.0.iter_mut().zip([3, 3, 4, 1, 1]) {
        column.truncate(500 * width);
    }
    for (a, column) in gaussians.averages.iter_mut().zip(&gaussians.parameters.0) {
        a.first.truncate(column.len());
        a.second.truncate(column.len());
    }
    gaussians.screen.truncate(500);
    device_steps.changed();
    let mut fresh = gaussians.clone();
    let reports = steps(&mut *device_steps, &mut gaussians, &case, 2);
    assert_eq!(reports, steps(&mut *trainer.alpha_steps(&fresh).unwrap(), &mut fresh, &case, 2));
    assert!(gaussians == fresh && gaussians.parameters.len() == 500);
}

/// Numbers that are none are told as on the processor, and stay.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn numbers_that_are_none_are_told_and_survived() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let mut case = cases().swap_remove(0);
    case.gaussians.parameters.0[2][4 * 33 + 1] = f32::NAN;
    case.gaussians.parameters.0[3][40] = f32::INFINITY;
    let (mut cpu, mut gpu) = (case.gaussians.clone(), case.gaussians.clone());
    let ours = steps(&mut AlphaCpuSteps::default(), &mut cpu, &case, 1);
    let theirs = steps(&mut *trainer.alpha_steps(&gpu).unwrap(), &mut gpu, &case, 1);
    assert_eq!(ours[0].not_finite, theirs[0].not_finite);
    assert_eq!(theirs[0].not_finite, Some(NonFiniteGradient { group: "rotation", gaussian: 33, count: 2 }));
    let start = &case.gaussians.parameters.0;
    assert_eq!(gpu.parameters.0[0][3 * 33..3 * 34], start[0][3 * 33..3 * 34]);
    assert_ne!(gpu.parameters.0[0][3 * 34..3 * 35], start[0][3 * 34..3 * 35]);
    assert!(gpu.mapper.unwrap().parameters.iter().all(|v| v.is_finite()));
}

/// A device that is gone in the midst of a run: an error, and what was fetched before stays.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_device_that_is_gone_is_an_error() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let case = cases().swap_remove(0);
    let mut gaussians = case.gaussians.clone();
    let mut device_steps = trainer.alpha_steps(&gaussians).unwrap();
    steps(&mut *device_steps, &mut gaussians, &case, 2);
    let before = gaussians.parameters.clone();
    device.device.destroy();
    let target = target(SIZE);
    let sample = TrainingSample { view: &case.view, target: &target, crop: case.crop, context: &Context::SILENT };
    let error = device_steps.step(&mut gaussians, &sample, &case.loss, &STEP).unwrap_err().to_string();
    assert!(error.contains("device") && error.lines().count() == 1, "{error}");
    assert!(gaussians.parameters == before);
}

/// The published recipe, scaled, on the processor and on the device.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_short_run_reaches_the_cpus_score() {
    let device = device();
    let device: Arc<dyn Accelerator> = Arc::new(GpuAccelerator::new(device));
    // Whom density control chooses is decided by roundings: from there on two runs are as far apart as those of two seeds.
    let all = Config { evaluate_views: 4, ..Config::preset(Preset::Paper, LawKind::AlphaBlend).scaled(0.01).unwrap() };
    let mut still = Config { start_gaussians: Some(1000), ..all.clone() };
    still.stages.iter_mut().for_each(|s| s.densify.every = 0);
    for (name, config, most) in [("without density control", still, 0.05), ("whole", all, 0.5)] {
        let [before, ours] = scores(&config, 4, None);
        let theirs = scores(&config, 4, Some(device.clone()))[1];
        println!("{name}, {} steps: {before:.3} dB, processor {ours:.3}, device {theirs:.3}", config.iterations());
        assert!(ours > before + 0.2 && (ours - theirs).abs() < most, "{name}: {before} {ours} {theirs}");
    }
}

/// A run's scores before and after.
fn scores(config: &Config, seed: u64, device: Option<Arc<dyn Accelerator>>) -> [f64; 2] {
    let limits = Limits { device, ..Limits::default() };
    let training = Some(config.clone());
    let options = Options { target: Target::Gaussians(6000), training, limits, seed, ..Options::default() };
    compress(&clumps(), &options, &mut NoCheckpoints, &Context::SILENT).unwrap().trained[0].scores.map(Option::unwrap)
}

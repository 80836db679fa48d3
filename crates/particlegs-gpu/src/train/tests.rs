//! Steps against their twins on the processor, on whatever adapter there is.

use super::*;
use crate::GpuAccelerator;
use crate::tests::{clumps, device, target, view};
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::Mixture;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_train::depth::{DepthCpuSteps, DepthGaussians};
use particlegs_train::{Accelerator, Crop, Norm};

const SIZE: Size = Size { width: 160, height: 90 };

struct DepthTrainingCase {
    name: &'static str,
    gaussians: Mixture,
    view: View,
    look: ToneStyle,
    loss: Loss,
    crop: Crop,
}

fn mixture(seed: u64, n: u64, spread: f64, flatness: f64) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
        let base = spread * (0.1 + r.uniform());
        let mut cov = Sym3::scaled_identity(1e-6 * base * base);
        for s in [base, base * flatness * r.uniform(), base * flatness * r.uniform()] {
            let v = [0; 3].map(|_| r.normal());
            cov = cov.add(&Sym3::outer(v.map(|x| x * s / 1.7)));
        }
        m.push(mean, cov, 1.0 + 40.0 * r.uniform(), 0.0);
    }
    m
}

fn bounds() -> Bounds {
    Bounds { min: [-1.0; 3], max: [1.0; 3] }
}

fn cases() -> Vec<DepthTrainingCase> {
    let (far, near, inside) = ([1.0, 2.0, 6.0], [0.3, 0.2, 1.6], [0.1, 0.2, 0.5]);
    let l2 = Loss { norm: Norm::L2, ..Loss::PUBLISHED };
    let case = |name, gaussians, view| DepthTrainingCase {
        name,
        gaussians,
        view,
        look: ToneStyle::Expected,
        loss: l2,
        crop: Crop::whole(SIZE),
    };
    let usual = [0.01, 0.05];
    let round = || mixture(1, 800, 0.1, 1.0);
    let mut slab = view(far, usual);
    slab.camera.clipping_range = Some([5.9, 6.6]);
    let crop = Crop { full: SIZE, corner: [37, 21], size: Size { width: 64, height: 48 } };
    vec![
        case("from afar", round(), view(far, usual)),
        case("smaller than a pixel", mixture(2, 800, 0.004, 1.0), view(far, [0.001, 0.9])),
        case("near", round(), view(near, [0.005, 0.02])),
        case("within", round(), view(inside, [0.005, 0.02])),
        case("needles", mixture(4, 300, 0.3, 1e-4), view(far, [0.002, 0.5])),
        case("slab", round(), slab),
        case("wide", mixture(5, 60, 1.0, 1.0), view(far, [0.02, 0.5])),
        DepthTrainingCase { crop, ..case("crop", round(), view(far, usual)) },
        DepthTrainingCase { look: ToneStyle::Paraview, ..case("ParaView's look", round(), view(far, [0.01, 0.3])) },
        DepthTrainingCase {
            loss: Loss { smooth: 0.02, ..Loss::PUBLISHED },
            ..case("L1, rounded", round(), view(far, usual))
        },
        DepthTrainingCase {
            loss: Loss { dssim: 0.4, logarithm: true, ..l2 },
            ..case("SSIM, logarithm", round(), view(far, usual))
        },
        DepthTrainingCase { loss: Loss { dssim: 1.0, ..l2 }, ..case("SSIM alone", round(), view(near, usual)) },
    ]
}

fn parameters(case: &DepthTrainingCase) -> Parameters {
    let particles = case.gaussians.count.iter().sum::<f64>().round() as u64;
    Parameters::new(&case.gaussians, particles, 48, bounds(), case.look)
}

fn size_of_step(rate: f64) -> StepSize {
    StepSize { rates: [rate; 3], beta1: 0.9, beta2: 0.999, epsilon: 0.5, decay: 0.01, average: 0.2 }
}

fn steps(
    steps: &mut dyn DepthStepper,
    parameters: &mut Parameters,
    case: &DepthTrainingCase,
    number: usize,
) -> Vec<StepReport> {
    let target = target(case.crop.size);
    let sample = TrainingSample { view: &case.view, target: &target, crop: case.crop, context: &Context::SILENT };
    let mut one = || steps.step(parameters, &sample, &case.loss, &size_of_step(0.01)).unwrap();
    let reports = (0..number).map(|_| one()).collect();
    steps.fetch(parameters).unwrap();
    reports
}

/// The root mean square of differences over that of the first.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let square = |v: f64| v * v;
    let sum: f64 = a.iter().zip(b).map(|(a, b)| square(f64::from(*a) - f64::from(*b))).sum();
    (sum / a.iter().map(|a| square(f64::from(*a))).sum::<f64>()).sqrt()
}

#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn gradients_and_losses_are_the_cpus() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    for case in cases() {
        let (mut cpu, mut gpu) = (parameters(&case), parameters(&case));
        let ours = steps(&mut DepthCpuSteps::default(), &mut cpu, &case, 1);
        let theirs = steps(&mut *trainer.depth_steps(&gpu).unwrap(), &mut gpu, &case, 1);
        // Adam's first mean is a tenth of the gradient.
        let by: Vec<f64> = (0..3).map(|k| apart(&cpu.averages[k].first, &gpu.averages[k].first)).collect();
        let loss = (ours[0].loss - theirs[0].loss).abs() / ours[0].loss.abs();
        eprintln!("{}: place {:.1e}, shape {:.1e}, count {:.1e}; loss {loss:.1e}", case.name, by[0], by[1], by[2]);
        assert!(theirs[0].not_finite.is_none());
        assert!(by.iter().all(|b| *b < 1e-3) && loss < 1e-4, "{}", case.name);
    }
}

/// As from afar, drawn of Gaussians that were decoded.
fn decoded() -> (DepthTrainingCase, Parameters) {
    let case = cases().swap_remove(0);
    let mut parameters = parameters(&case);
    let mut decoded = parameters.now.clone();
    for (i, g) in decoded.0.iter_mut().enumerate() {
        let mut r = Random::new(3, 1, i as u64);
        g[..3].iter_mut().for_each(|v| *v += 1e-3 * r.normal());
        g[9] += 0.05 * r.normal();
    }
    parameters.decoded = Some(decoded);
    (case, parameters)
}

/// The distance by which numbers were moved apart, over the way that they went from `start`.
fn strayed(cpu: &DepthGaussians, gpu: &DepthGaussians, start: &DepthGaussians) -> f64 {
    let square = |a: &DepthGaussians, b: &DepthGaussians| -> f64 {
        let numbers = a.0.as_flattened().iter().zip(b.0.as_flattened());
        numbers.map(|(a, b)| (a - b) * (a - b)).sum()
    };
    (square(cpu, gpu) / square(cpu, start)).sqrt()
}

#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn steps_lead_where_the_cpus_do_and_either_may_go_on() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let (case, start) = decoded();
    let mut cpu = start.clone();
    steps(&mut DepthCpuSteps::default(), &mut cpu, &case, 12);
    let counts = |parameters: &Parameters| parameters.groups.counts.len();
    assert!(counts(&start) > 10);
    // All on the device; the first half there and the second here; and the other way.
    for of_device in [[12, 0], [6, 6], [0, 6]] {
        let mut mixed = start.clone();
        let mut device_steps = trainer.depth_steps(&mixed).unwrap();
        if of_device[0] == 0 {
            steps(&mut DepthCpuSteps::default(), &mut mixed, &case, 6);
            device_steps.changed();
            steps(&mut *device_steps, &mut mixed, &case, of_device[1]);
        } else {
            steps(&mut *device_steps, &mut mixed, &case, of_device[0]);
            steps(&mut DepthCpuSteps::default(), &mut mixed, &case, of_device[1]);
        }
        let pairs = [
            (&cpu.now, &mixed.now, &start.now),
            (&cpu.averaged, &mixed.averaged, &start.averaged),
            (cpu.seen(), mixed.seen(), start.seen()),
        ];
        let apart = pairs.map(|(a, b, from)| strayed(a, b, from));
        eprintln!("{of_device:?}: now {:.1e}, averaged {:.1e}, decoded {:.1e}", apart[0], apart[1], apart[2]);
        assert!(apart.iter().all(|a| *a < 2e-3));
        for (group, aim) in mixed.groups.aims.iter().enumerate() {
            let members = mixed.now.0.iter().zip(&mixed.groups.of).filter(|(_, g)| **g as usize == group);
            let sum: f64 = members.map(|(n, _)| n[9].exp()).sum();
            assert!((sum / aim - 1.0).abs() < 1e-5, "{sum} of {aim}");
        }
        assert!(mixed.averages.iter().all(|a| a.steps == 12));
    }
}

#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn the_same_steps_give_the_same_bits_whatever_was_there() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let case = cases().swap_remove(3);
    let run = |poisoned: bool| {
        let mut parameters = parameters(&case);
        let mut device_steps = *trainer.depth_steps(&parameters).unwrap();
        device_steps.picture = Some(device_steps.picture_of(case.crop.size, case.loss.dssim > 0.0).unwrap());
        if poisoned {
            device_steps.poison();
        }
        let reports = steps(&mut device_steps, &mut parameters, &case, 3);
        (reports, parameters.now, parameters.averaged, parameters.averages)
    };
    let first = run(false);
    assert!(first == run(false) && first == run(true));
    assert!(first.0[2].loss.is_finite());
}

/// Changes of density control on the way: only those are sent.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn what_is_replaced_goes_on_as_on_the_cpu() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let (case, start) = decoded();
    let run = |steps: &mut dyn DepthStepper| {
        let mut parameters = start.clone();
        self::steps(steps, &mut parameters, &case, 4);
        for i in [3, 77, 401] {
            parameters.now.0[i][0] += 0.01;
            parameters.now.0[i][9] += 0.1;
            parameters.first_log_count[i] = parameters.now.0[i][9];
            parameters.averages[1].first[6 * i..6 * i + 6].fill(0.0);
        }
        parameters.groups.count(&parameters.now.0, 20_000);
        parameters.decoded = None;
        parameters.averaged = parameters.now.clone();
        steps.replaced(&parameters, &[3, 77, 401]).unwrap();
        self::steps(steps, &mut parameters, &case, 4);
        parameters
    };
    let (cpu, gpu) = (run(&mut DepthCpuSteps::default()), run(&mut *trainer.depth_steps(&start).unwrap()));
    let apart = [(&cpu.now, &gpu.now, &start.now), (&cpu.averaged, &gpu.averaged, &start.averaged)]
        .map(|(a, b, from)| strayed(a, b, from));
    eprintln!("now {:.1e}, averaged {:.1e}", apart[0], apart[1]);
    assert!(apart.iter().all(|a| *a < 1e-4));
}

/// A target with a pixel that is no number: whom it concerns is told as on the processor, and stays.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn gradients_that_are_no_numbers_are_told_and_survived() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let case = cases().swap_remove(0);
    let mut target = target(SIZE);
    target.data[SIZE.width * 45 + 80] = f32::NAN;
    let sample = TrainingSample { view: &case.view, target: &target, crop: case.crop, context: &Context::SILENT };
    let (mut cpu, mut gpu) = (parameters(&case), parameters(&case));
    let one = |steps: &mut dyn DepthStepper, parameters: &mut Parameters| {
        let report = steps.step(parameters, &sample, &case.loss, &size_of_step(0.01)).unwrap();
        steps.fetch(parameters).unwrap();
        report.not_finite.unwrap()
    };
    let ours = one(&mut DepthCpuSteps::default(), &mut cpu);
    let theirs = one(&mut *trainer.depth_steps(&gpu).unwrap(), &mut gpu);
    // The processor multiplies pixels beside a footprint by zero, which makes no number of them either.
    assert!(ours.gaussian <= theirs.gaussian && (1..=ours.count).contains(&theirs.count), "{ours:?} {theirs:?}");
    assert!(ours.count < cpu.len());
    let stays = strayed_of(&gpu.now.0[theirs.gaussian], &parameters(&case).now.0[theirs.gaussian]);
    assert!(stays < 1e-6, "{stays}");
    assert!(gpu.now.0.as_flattened().iter().all(|v| v.is_finite()));
}

/// The largest difference of places and shapes.
fn strayed_of(a: &[f64; 10], b: &[f64; 10]) -> f64 {
    a[..9].iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A device that is gone in the midst of a run: an error, and what was fetched before stays.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_device_that_is_gone_is_an_error() {
    let device = device();
    let trainer = Trainer::new(&device).unwrap();
    let case = cases().swap_remove(0);
    let mut parameters = parameters(&case);
    let mut device_steps = *trainer.depth_steps(&parameters).unwrap();
    steps(&mut device_steps, &mut parameters, &case, 2);
    let before = parameters.now.clone();
    device.device.destroy();
    let target = target(SIZE);
    let sample = TrainingSample { view: &case.view, target: &target, crop: case.crop, context: &Context::SILENT };
    let error = device_steps.step(&mut parameters, &sample, &case.loss, &size_of_step(0.01)).unwrap_err().to_string();
    assert!(error.contains("device") && error.lines().count() == 1, "{error}");
    assert!(parameters.now == before);
}

#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn more_gaussians_than_it_holds_are_refused() {
    let device = device();
    let e = too_many(&device, 3_000_000, 1_600_000).to_string();
    assert!(e.contains("at most 1600000 Gaussians, not 3000000"), "{e}");
}

/// A fit that is trained, on the processor and on the device: held-out views within 0.05 dB.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_short_run_reaches_the_cpus_score() {
    use particlegs_compress::{Options, Target, compress};
    use particlegs_core::checkpoint::NoCheckpoints;
    use particlegs_train::{Config, Limits, Preset, Start};
    let device = device();
    let device: Arc<dyn Accelerator> = Arc::new(GpuAccelerator::new(device));
    let fast = Config::preset(Preset::Fast, particlegs_core::model::LawKind::OpticalDepth);
    let config = Config {
        start: Start::Random,
        target: ToneStyle::Expected,
        start_gaussians: Some(300),
        ..fast.scaled(0.06).unwrap()
    };
    let run = |device: Option<Arc<dyn Accelerator>>| {
        let limits = Limits { device, ..Limits::default() };
        let training = Some(config.clone());
        let options = Options { target: Target::Gaussians(300), training, limits, seed: 4, ..Options::default() };
        let done = compress(&clumps(), &options, &mut NoCheckpoints, &Context::SILENT).unwrap();
        done.trained[0].clone()
    };
    let (cpu, gpu) = (run(None), run(Some(device)));
    let [before, ours] = cpu.scores.map(Option::unwrap);
    let theirs = gpu.scores[1].unwrap();
    eprintln!("{} steps: {before:.3} dB, processor {ours:.3}, device {theirs:.3}", cpu.iterations);
    assert!(ours > before + 0.2 && (ours - theirs).abs() < 0.05, "{before} {ours} {theirs}");
}

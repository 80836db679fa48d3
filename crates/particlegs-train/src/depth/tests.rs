use super::adjoint::GaussianGradient;
use super::config::DepthConfig;
use super::groups::GaussianGroups;
use super::learner::{DepthContext, DepthLearner};
use super::parameters::{DepthGaussians, FrameChange, Parameters};
use super::raster::Tape;
use super::steps::{DepthCpuSteps, DepthStepper};
use crate::learner::{Densify, Learner, StepInfo, TrainingSample};
use crate::{Crop, Loss, Norm};
use particlegs_core::camera::{View, spherical_camera};
use particlegs_core::codec::{Encoder, Precision, decode_block};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{Block, Mixture};
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::Scratch;
use particlegs_core::render::bin::lattice_sum;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::plain::footprints;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;

const SIZE: Size = Size { width: 48, height: 32 };

fn bounds() -> Bounds {
    Bounds { min: [-3.0; 3], max: [3.0; 3] }
}

fn learner(m: &Mixture, context: DepthContext, config: DepthConfig) -> DepthLearner {
    DepthLearner::new(m, context, config, |_| Ok(Box::new(DepthCpuSteps::default()))).unwrap()
}

fn drawn(m: &Mixture, view: &View, crop: &Crop) -> Tape {
    Tape::draw(m, &bounds(), view, crop, &mut Scratch::default(), &Context::SILENT).unwrap()
}

fn context(m: &Mixture, look: ToneStyle) -> DepthContext {
    DepthContext { bounds: bounds(), particles: m.count.iter().sum::<f64>() as u64, look, bytes: None }
}

fn view(distance: f64) -> View {
    let camera = spherical_camera([0.0; 3], 35.0, 20.0, distance);
    View { name: "v".into(), camera, radius: 0.02, opacity: 0.05 }
}

fn moment(iteration: u64, iterations: u64) -> StepInfo {
    let densify = Densify { every: 0, until: 0, threshold: 0.0 };
    StepInfo { iteration, iterations, done: iteration as f64 / iterations as f64, densify }
}

/// Gaussians of many sizes and shapes, some flat, around the origin.
fn mixture(seed: u64, number: usize) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..number {
        let mut d = Random::new(seed, 0, i as u64);
        let mean = each_axis(|_| 0.9 * d.normal());
        let mut cov = Sym3::scaled_identity(1e-5);
        for _ in 0..3 {
            let size = 0.02 * (2.0 * d.uniform()).exp2().powi(2);
            cov = cov.add(&Sym3::outer(each_axis(|_| size * d.normal())));
        }
        m.push(mean, cov, 30.0 + 400.0 * d.uniform(), 0.0);
    }
    m
}

/// A weight for every pixel: the loss is the sum of weights times depths.
fn weights() -> Plane {
    let mut d = Random::new(77, 0, 0);
    // Smooth enough that the pixel grid's own error does not matter.
    let (u, v, w) = (d.uniform(), d.uniform(), d.uniform());
    let at = |i: usize, j: usize| {
        ((0.21 * i as f64 + 6.0 * u).sin() * (0.17 * j as f64 + 6.0 * v).cos() + 0.3 * (0.05 * i as f64 * w).sin())
            as f32
    };
    Plane { size: SIZE, data: (0..SIZE.pixels()).map(|p| at(p % SIZE.width, p / SIZE.width)).collect() }
}

fn value(tau: impl Iterator<Item = f64>) -> f64 {
    weights().data.iter().zip(tau).map(|(w, t)| f64::from(*w) * t).sum()
}

/// The ten numbers of a Gaussian, and their gradient.
fn numbers(g: &GaussianGradient) -> [f64; 10] {
    let mut n = [0.0; 10];
    n[..3].copy_from_slice(&g.mean);
    n[3..9].copy_from_slice(&g.cov);
    n[9] = g.count;
    n
}

fn moved(m: &Mixture, i: usize, number: usize, by: f64) -> Mixture {
    let mut m = m.clone();
    match number {
        0..3 => m.mean[number][i] += by,
        3..9 => m.cov[number - 3][i] += by,
        _ => m.count[i] += by,
    }
    m
}

/// A step for a number that changes little of the picture's second order.
fn step(m: &Mixture, i: usize, number: usize) -> f64 {
    let size = m.cov_of(i).trace().sqrt();
    match number {
        0..3 => 2e-3 * (size + 0.02),
        3..9 => 2e-3 * (size * size + 4e-4) * 0.1,
        _ => 0.01 * m.count[i],
    }
}

/// The law written plainly in f64: every footprint at every pixel, without cut or coarse planes.
fn plain(m: &Mixture, view: &View) -> f64 {
    let lens = Lens::optical(view, SIZE, &bounds()).unwrap();
    let mut tau = vec![0.0; SIZE.pixels()];
    for f in (0..m.len()).flat_map(|i| footprints(&lens, m, i, m.count[i])) {
        let [xx, xy, yy] = f.cov;
        let det = xx * yy - xy * xy;
        let peak = f.sum / (2.0 * std::f64::consts::PI * det.sqrt() * lattice_sum(f.mean, f.cov));
        for (p, t) in tau.iter_mut().enumerate() {
            let (x, y) = ((p % SIZE.width) as f64 - f.mean[0], (p / SIZE.width) as f64 - f.mean[1]);
            *t += peak * (-0.5 * (yy * x * x - 2.0 * xy * x * y + xx * y * y) / det).exp();
        }
    }
    let grown = tau.iter().enumerate().map(|(p, t)| {
        let x = ((p % SIZE.width) as f64 - lens.center[0]) / lens.focal;
        let y = ((p / SIZE.width) as f64 - lens.center[1]) / lens.focal;
        t * (1.0 + x * x).sqrt() * (1.0 + y * y).sqrt()
    });
    value(grown)
}

/// A comparison of gradients with differences of the plain law.
struct Trial {
    distance: f64,
    seed: u64,
    /// Of the usual step of each number.
    share: f64,
    /// Gaussians left out, the worst ones.
    jumps: usize,
    tolerance: f64,
}

/// Every gradient against differences of the plain law: number by number, the root of the mean
/// squared difference over all Gaussians but the worst, in shares of the gradient of the
/// number of its group (mean, covariance, count) that the picture depends on most.
fn against_plain(trial: &Trial) {
    let &Trial { distance, seed, share, jumps, tolerance } = trial;
    let (m, view) = (mixture(seed, 14), view(distance));
    let gradients = drawn(&m, &view, &Crop::whole(SIZE)).gradient(&m, weights());
    let off: Vec<[f64; 2]> = (0..10)
        .map(|number| {
            let mut squares: Vec<(f64, f64)> = gradients
                .iter()
                .enumerate()
                .map(|(i, g)| {
                    let h = share * step(&m, i, number);
                    let at = |by: f64| plain(&moved(&m, i, number, by), &view);
                    let exact = (at(h) - at(-h)) / 2.0;
                    ((numbers(g)[number] * h - exact).powi(2), exact * exact)
                })
                .collect();
            squares.sort_by(|a, b| a.0.total_cmp(&b.0));
            let smallest_squares = &squares[..squares.len() - jumps];
            [smallest_squares.iter().map(|s| s.0).sum::<f64>().sqrt(), squares.iter().map(|s| s.1).sum::<f64>().sqrt()]
        })
        .collect();
    for group in [0..3, 3..9, 9..10] {
        let largest = off[group.clone()].iter().fold(0.0, |a: f64, o| a.max(o[1]));
        for number in group {
            let share = off[number][0] / largest;
            assert!(share < tolerance, "number {number} is off by {share:.4}: {off:.4?}");
        }
    }
}

#[test]
fn gradients_from_afar() {
    against_plain(&Trial { distance: 14.0, seed: 5, share: 0.1, jumps: 0, tolerance: 0.06 });
}

#[test]
fn gradients_among_the_gaussians() {
    // The camera stands inside: many are cut along depth or by the near plane. Where a step changes
    // the number of slices, the plain law jumps.
    against_plain(&Trial { distance: 1.2, seed: 17, share: 5.0, jumps: 2, tolerance: 0.1 });
}

/// Neighbours' counts sum to what they did, and what all of them gain together nobody gains.
#[test]
fn neighbours_share_their_particles() {
    let m = mixture(8, 100);
    let (now, particles) = (DepthGaussians::from_mixture(&m, |i| i), context(&m, ToneStyle::Expected).particles);
    let groups = GaussianGroups::new(&now.0, particles, 16);
    assert_eq!(groups.counts.len(), 8);
    let mut draw = Random::new(5, 0, 0);
    let mut gradient: Vec<f32> = (0..100).map(|_| draw.normal() as f32).collect();
    let original_gradient = gradient.clone();
    groups.share(&mut gradient, &now.0);
    for g in 0..8 {
        let group_values = |v: &[f32]| (0..100).filter(|&i| groups.of[i] == g).map(|i| v[i]).collect::<Vec<f32>>();
        let (sum, absolute_sum) = (
            group_values(&gradient).iter().sum::<f32>(),
            group_values(&original_gradient).iter().map(|v| v.abs()).sum::<f32>(),
        );
        assert!(sum.abs() < 1e-5 * absolute_sum, "{sum} of {absolute_sum}");
    }
    let mut changes: Vec<FrameChange> =
        gradient.iter().map(|&g| [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, g]).collect();
    groups.keep(&now.0, &mut changes);
    let mut after = now.clone();
    after.change(&changes);
    let mut moved = groups.clone();
    moved.count(&after.0, particles);
    for (now, before) in moved.counts.iter().zip(&groups.counts) {
        assert!((now / before - 1.0).abs() < 1e-6, "{now} of {before}");
    }
    let all = GaussianGroups::new(&now.0, 2 * particles, 0).counts;
    assert!(all.len() == 1 && (all[0] / (2 * particles) as f64 - 1.0).abs() < 1e-12, "a start may hold another number");
}

/// A run that settled gives the file that it saw: within its budget, and the same when coded again.
#[test]
fn a_settled_run_is_what_is_coded() {
    let (m, view) = (mixture(8, 400), view(12.0));
    let target = Plane { size: SIZE, data: vec![0.2; SIZE.pixels()] };
    let sample = TrainingSample { view: &view, target: &target, crop: Crop::whole(SIZE), context: &Context::SILENT };
    let context = DepthContext { bytes: Some(1800), ..context(&m, ToneStyle::Expected) };
    let config = DepthConfig { code_every: 2, ..DepthConfig::default() };
    let mut learner = learner(&m, context, config);
    for i in 0..100 {
        learner.step(&sample, &Loss { norm: Norm::L2, ..Loss::PUBLISHED }, &moment(i, 100)).unwrap();
    }
    let factor = learner.factor().expect("settled");
    let gaussians = learner.mixture();
    let (count, precision) = (context.particles, Precision::BALANCED.scaled(factor));
    let block = Block { bounds: context.bounds, count, mass: count as f64, gaussians };
    let bytes = Encoder::new(&block).unwrap().encode(&precision);
    assert!((1760..=1800).contains(&bytes.len()), "{} bytes", bytes.len());
    assert!(Encoder::new(&decode_block(&bytes, "a test").unwrap()).unwrap().encode(&precision) == bytes);
}

/// The whole step's gradient, loss and curve included, along random directions in the Gaussians'
/// own frames against differences of the loss.
#[test]
fn steps_go_down_the_loss() {
    let (m, view) = (mixture(8, 30), view(12.0));
    let target = drawn(&mixture(9, 30), &view, &Crop::whole(SIZE)).tau;
    let target = Plane { size: SIZE, data: target.data.iter().map(|t| 1.0 - (-t).exp()).collect() };
    let sample = TrainingSample { view: &view, target: &target, crop: Crop::whole(SIZE), context: &Context::SILENT };
    let loss = Loss { norm: Norm::L2, ..Loss::PUBLISHED };
    let mut learner = learner(&m, context(&m, ToneStyle::Expected), DepthConfig::default());
    let at = |iteration| moment(iteration, 150);
    let losses: Vec<f64> = (0..150).map(|i| learner.step(&sample, &loss, &at(i)).unwrap().loss).collect();
    assert!(losses[149] < 0.5 * losses[0], "{} to {}", losses[0], losses[149]);
    let sum: f64 = learner.mixture().count.iter().sum();
    assert!((sum / context(&m, ToneStyle::Expected).particles as f64 - 1.0).abs() < 1e-6, "particles are kept");
}

#[test]
fn a_crop_is_a_part_of_the_whole() {
    let (m, view) = (mixture(3, 20), view(9.0));
    let whole = drawn(&m, &view, &Crop::whole(SIZE)).tau;
    let crop = Crop { full: SIZE, corner: [13, 7], size: Size { width: 32, height: 24 } };
    let part = drawn(&m, &view, &crop).tau;
    let largest = whole.data.iter().fold(0.0f32, |a, b| a.max(*b));
    for j in 0..24 {
        for i in 0..32 {
            let d = part.data[j * 32 + i] - whole.data[(j + 7) * SIZE.width + i + 13];
            assert!(d.abs() < 2e-3 * largest, "{d} of {largest}");
        }
    }
}

#[test]
fn what_is_not_seen_has_no_gradient_and_changes_none() {
    let (mut m, view) = (mixture(4, 8), view(14.0));
    let draw = |m: &Mixture| {
        let tape = drawn(m, &view, &Crop::whole(SIZE));
        (tape.gradient(m, weights()), tape.tau)
    };
    let (before, tau) = draw(&m);
    // Behind the camera, and far to the side.
    let behind = view.camera.position.map(|v| 1.5 * v);
    m.push(behind, Sym3::scaled_identity(0.01), 1e4, 0.0);
    m.push([0.0, 900.0, 0.0], Sym3::scaled_identity(0.01), 1e4, 0.0);
    let (after, tau_after) = draw(&m);
    assert_eq!(before[..], after[..8]);
    assert_eq!(tau, tau_after);
    assert!(after[8..].iter().all(|g| *g == GaussianGradient::default()));
}

#[test]
fn order_changes_next_to_nothing_and_none_is_black() {
    let (m, view) = (mixture(4, 8), view(14.0));
    let mut reversed = Mixture::default();
    for i in (0..8).rev() {
        reversed.push(m.mean_of(i), m.cov_of(i), m.count[i], 0.0);
    }
    let draw = |m: &Mixture| drawn(m, &view, &Crop::whole(SIZE));
    let (a, b) = (draw(&m), draw(&reversed));
    for (x, y) in a.tau.data.iter().zip(&b.tau.data) {
        assert!((x - y).abs() <= 1e-5 * x.max(1e-3));
    }
    for (i, g) in b.gradient(&reversed, weights()).iter().enumerate() {
        let other = a.gradient(&m, weights())[7 - i];
        for (x, y) in numbers(g).into_iter().zip(numbers(&other)) {
            assert!((x - y).abs() <= 1e-4 * (x.abs() + 1e-3), "{x} {y}");
        }
    }
    let none = draw(&Mixture::default());
    assert!(none.tau.data.iter().all(|&t| t == 0.0) && none.gradient(&Mixture::default(), weights()).is_empty());
}

#[test]
fn a_gradient_that_is_not_a_number_is_named_and_survived() {
    let (m, view) = (mixture(4, 8), view(14.0));
    let target = Plane::zeros(SIZE);
    let sample = TrainingSample { view: &view, target: &target, crop: Crop::whole(SIZE), context: &Context::SILENT };
    let steps = |_: &Parameters| -> particlegs_core::Result<Box<dyn DepthStepper>> {
        let mut processor = DepthCpuSteps::default();
        processor.poison = Some(3);
        Ok(Box::new(processor))
    };
    let mut learner = DepthLearner::new(&m, context(&m, ToneStyle::Expected), DepthConfig::default(), steps).unwrap();
    let at = moment(0, 10);
    let fault = learner.step(&sample, &Loss::PUBLISHED, &at).unwrap().not_finite.unwrap();
    assert_eq!((fault.group, fault.gaussian, fault.count), ("covariance", 3, 1));
    let after = learner.mixture();
    assert!((0..3).all(|k| (after.mean_of(3)[k] - m.mean_of(3)[k]).abs() < 1e-12));
    assert!(after.mean_of(2) != m.mean_of(2));
    assert!(after.mean.iter().chain(&after.cov).flatten().chain(&after.count).all(|v| v.is_finite()));
}

/// Density control moves masses with their Gaussians; a state taken before or after holds them.
#[test]
fn masses_are_kept_by_density_control_and_by_states() {
    let (mut m, view) = (mixture(8, 40), view(12.0));
    let masses = m.count.iter().enumerate().map(|(i, c)| c * (1.0 + i as f64)).collect();
    m.columns.set(particlegs_core::model::MASS, masses);
    let mass = |l: &DepthLearner| l.mixture().masses().unwrap().iter().sum::<f64>();
    let config = DepthConfig { relocate: 0.25, ..DepthConfig::default() };
    let new = || learner(&m, context(&m, ToneStyle::Expected), config);
    let target = Plane { size: SIZE, data: vec![0.2; SIZE.pixels()] };
    let sample = TrainingSample { view: &view, target: &target, crop: Crop::whole(SIZE), context: &Context::SILENT };
    let mut learner = new();
    learner.step(&sample, &Loss::PUBLISHED, &moment(0, 10)).unwrap();
    let at = StepInfo { densify: Densify { every: 1, until: 10, threshold: 0.0 }, ..moment(0, 10) };
    // What is scored is the average, which density control sets to the present.
    learner.control(&at).unwrap();
    let all = mass(&learner);
    let mut other = new();
    other.restore(&learner.state()).unwrap();
    assert_eq!(mass(&other), all);
    learner.control(&at).unwrap();
    assert!((mass(&learner) / all - 1.0).abs() < 1e-12, "{} of {all}", mass(&learner));
}

#[test]
fn a_state_goes_on_to_the_same_bits() {
    let (m, view) = (mixture(8, 30), view(12.0));
    let target = Plane { size: SIZE, data: vec![0.2; SIZE.pixels()] };
    let sample = TrainingSample { view: &view, target: &target, crop: Crop::whole(SIZE), context: &Context::SILENT };
    let new = || learner(&m, context(&m, ToneStyle::Paraview), DepthConfig::default());
    let at = |iteration| moment(iteration, 20);
    let run = |learner: &mut DepthLearner, range: std::ops::Range<u64>| {
        range.for_each(|i| {
            learner.step(&sample, &Loss::PUBLISHED, &at(i)).unwrap();
        });
    };
    let mut whole = new();
    run(&mut whole, 0..20);
    let mut first = new();
    run(&mut first, 0..9);
    let mut second = new();
    second.restore(&first.state()).unwrap();
    run(&mut second, 9..20);
    assert_eq!(whole.state(), second.state());
    assert!(new().restore(&Default::default()).is_err() || new().len() == 0);
}

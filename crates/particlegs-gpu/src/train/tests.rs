//! Steps against their twins on the processor, on whatever adapter there is.

use super::*;
use crate::tests::device;
use particlegs_core::camera::{Camera, Projection, View};
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::Mixture;
use particlegs_core::picture::Plane;
use particlegs_core::progress::Silent;
use particlegs_core::space::Bounds;
use particlegs_core::splat::Look;
use particlegs_train::depth::Processor;
use particlegs_train::{Crop, Device as _, Norm};

const SIZE: Size = Size { width: 160, height: 90 };

struct Case {
    name: &'static str,
    gaussians: Mixture,
    view: View,
    look: Look,
    loss: Loss,
    crop: Crop,
}

fn view(position: [f64; 3], [radius, opacity]: [f64; 2]) -> View {
    View {
        name: "v".into(),
        camera: Camera {
            position,
            focal_point: [0.0; 3],
            view_up: [0.0, 1.0, 0.0],
            projection: Projection::Perspective { fov_deg: 30.0 },
            clipping_range: None,
        },
        radius,
        opacity,
    }
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

fn cases() -> Vec<Case> {
    let (far, near, inside) = ([1.0, 2.0, 6.0], [0.3, 0.2, 1.6], [0.1, 0.2, 0.5]);
    let l2 = Loss { norm: Norm::L2, ..Loss::PUBLISHED };
    let case =
        |name, gaussians, view| Case { name, gaussians, view, look: Look::Expected, loss: l2, crop: Crop::whole(SIZE) };
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
        Case { crop, ..case("crop", round(), view(far, usual)) },
        Case { look: Look::Paraview, ..case("ParaView's look", round(), view(far, [0.01, 0.3])) },
        Case { loss: Loss { smooth: 0.02, ..Loss::PUBLISHED }, ..case("L1, rounded", round(), view(far, usual)) },
        Case { loss: Loss { dssim: 0.4, logarithm: true, ..l2 }, ..case("SSIM, logarithm", round(), view(far, usual)) },
        Case { loss: Loss { dssim: 1.0, ..l2 }, ..case("SSIM alone", round(), view(near, usual)) },
    ]
}

fn parameters(case: &Case) -> Parameters {
    let particles = case.gaussians.count.iter().sum::<f64>().round() as u64;
    Parameters::new(&case.gaussians, particles, 48, (bounds(), case.look))
}

/// A picture of the same Gaussians in other places, with some noise.
fn target(size: Size) -> Plane {
    let mut r = Random::new(77, 1, 0);
    let data = (0..size.pixels()).map(|p| {
        let (x, y) = (p % size.width, p / size.width);
        let smooth = 0.3 + 0.2 * (x as f64 / 11.0).sin() * (y as f64 / 7.0).cos();
        (smooth + 0.05 * r.normal()).clamp(0.0, 1.0) as f32
    });
    Plane { size, data: data.collect() }
}

fn size_of_step(rate: f64) -> StepSize {
    StepSize { rates: [rate; 3], beta1: 0.9, beta2: 0.999, calm: 0.5, pull: 0.01, average: 0.2 }
}

fn steps(steps: &mut dyn Steps, of: &mut Parameters, case: &Case, number: usize) -> Vec<Stepped> {
    let target = target(case.crop.size);
    let shot = Shot { view: &case.view, target: &target, crop: case.crop, progress: &Silent };
    let mut one = || steps.step(of, &shot, &case.loss, &size_of_step(0.01)).unwrap();
    let told = (0..number).map(|_| one()).collect();
    steps.fetch(of).unwrap();
    told
}

/// The root mean square of differences over that of the first.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let square = |v: f64| v * v;
    let sum: f64 = a.iter().zip(b).map(|(a, b)| square(f64::from(*a) - f64::from(*b))).sum();
    (sum / a.iter().map(|a| square(f64::from(*a))).sum::<f64>()).sqrt()
}

#[test]
fn gradients_and_losses_are_the_processors() {
    let Some(device) = device() else { return };
    let trainer = Trainer::new(&device).unwrap();
    for case in cases() {
        let (mut here, mut there) = (parameters(&case), parameters(&case));
        let ours = steps(&mut Processor::default(), &mut here, &case, 1);
        let theirs = steps(&mut *trainer.depth_steps(&there).unwrap(), &mut there, &case, 1);
        // Adam's first mean is a tenth of the gradient.
        let by: Vec<f64> = (0..3).map(|k| apart(&here.averages[k].first, &there.averages[k].first)).collect();
        let loss = (ours[0].loss - theirs[0].loss).abs() / ours[0].loss.abs();
        eprintln!("{}: place {:.1e}, shape {:.1e}, count {:.1e}; loss {loss:.1e}", case.name, by[0], by[1], by[2]);
        assert!(theirs[0].not_finite.is_none());
        assert!(by.iter().all(|b| *b < 1e-3) && loss < 1e-4, "{}", case.name);
    }
}

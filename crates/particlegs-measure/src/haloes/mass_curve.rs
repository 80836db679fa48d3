//! Masses of a model within radii about a centre, by integration over its Gaussians.

use super::overdensity::Overdensity;
use super::sphere::DensitySphere;
use crate::stats::{EnclosedMass, GaussianSpheres};
use particlegs_core::Result;
use particlegs_core::context::Context;

/// Steps of the logarithm of the radius in which masses are integrated, and the most of them.
const CURVE_STEP: f64 = 0.3;
const MOST_STEPS: f64 = 32.0;
/// Reach of the curve beyond the spheres of drawn particles, as a factor, at first; and the most curves, each further.
const CURVE_REACH: f64 = 1.2;
const CURVES: usize = 4;
/// Numbers of densities.
pub const SPHERES: usize = Overdensity::ALL.len();

/// A sphere, and the error of its mass, of a model.
#[derive(Clone, Copy)]
pub struct HaloSphere {
    pub sphere: DensitySphere,
    pub error: f64,
}

/// Logarithms of masses inside spheres, and of radii: between them, a parabola through the three nearest.
struct MassCurve {
    /// Logarithm of the first radius, and the distance of each from the last.
    first: f64,
    step: f64,
    /// Logarithms of the masses.
    masses: Vec<f64>,
    inside: Vec<EnclosedMass>,
}

impl MassCurve {
    /// By integration over Gaussians, from one radius to another.
    fn new(model: &GaussianSpheres, center: [f64; 3], ends: [f64; 2], context: &Context<'_>) -> Result<MassCurve> {
        let [first, last] = ends.map(libm::log);
        let number = ((last - first) / CURVE_STEP).ceil().clamp(2.0, MOST_STEPS);
        let step = (last - first) / number;
        let radii: Vec<f64> = (0..=number as usize).map(|i| libm::exp(first + step * i as f64)).collect();
        let inside = model.enclosed(center, &radii, context)?;
        let masses = inside.iter().map(|inside| libm::log(inside.mass.max(f64::MIN_POSITIVE))).collect();
        Ok(MassCurve { first, step, masses, inside })
    }

    /// The sphere in which the mass first falls to `per_cube` times the cube of the radius, and the error of its mass.
    fn sphere(&self, per_cube: f64) -> Option<HaloSphere> {
        let excess = |i: usize| self.masses[i] - 3.0 * (self.first + self.step * i as f64) - libm::log(per_cube);
        // Small spheres about a density peak may hold less.
        let above = (1..self.masses.len()).find(|i| excess(*i) < 0.0 && excess(i - 1) >= 0.0)?;
        // The parabola about the middle of the three nodes, in steps.
        let middle = above.min(self.masses.len() - 2);
        let [low, at, high] = [middle - 1, middle, middle + 1].map(excess);
        let (slope, curve) = (0.5 * (high - low), high - 2.0 * at + low);
        let (mut from, mut to) = ((above - 1) as f64 - middle as f64, above as f64 - middle as f64);
        for _ in 0..40 {
            let x = 0.5 * (from + to);
            *(if at + slope * x + 0.5 * curve * x * x < 0.0 { &mut to } else { &mut from }) = x;
        }
        let x = 0.5 * (from + to);
        let radius = libm::exp(self.first + self.step * (middle as f64 + x));
        let [inner, outer] = [self.inside[above - 1], self.inside[above]];
        let variance = inner.variance + (outer.variance - inner.variance) * (x - (above - 1) as f64 + middle as f64);
        // A mass that is larger by a share makes the sphere larger, too.
        let steepness = -(slope + curve * x) / (3.0 * self.step);
        let error = variance.max(0.0).sqrt() / steepness.max(0.2);
        let mass = per_cube * radius.powi(3);
        let count = (mass * (outer.number / outer.mass)).round() as usize;
        Some(HaloSphere { sphere: DensitySphere { radius, mass, count }, error })
    }
}

/// Spheres of mean densities by integration over Gaussians, near those of drawn particles.
pub fn integrated(
    model: &GaussianSpheres,
    center: [f64; 3],
    counted: [Option<DensitySphere>; SPHERES],
    per_cube: [Option<f64>; SPHERES],
    context: &Context<'_>,
) -> Result<[Option<HaloSphere>; SPHERES]> {
    let radii = || counted.iter().flatten().map(|s| s.radius);
    let (smallest, largest) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    let mut spheres = [None; SPHERES];
    // Drawn particles scatter, so the sphere of the Gaussians may lie beyond theirs.
    let mut reach = CURVE_REACH;
    for _ in 0..CURVES {
        if largest <= 0.0 {
            break;
        }
        let curve = MassCurve::new(model, center, [smallest / reach, largest * reach], context)?;
        spheres = std::array::from_fn(|k| counted[k].and_then(|_| curve.sphere(per_cube[k]?)));
        if (0..SPHERES).all(|k| spheres[k].is_some() || counted[k].is_none()) {
            break;
        }
        reach *= CURVE_REACH;
    }
    Ok(spheres)
}

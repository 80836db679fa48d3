//! Measures of the particles about one centre: spheres of mean densities, and the properties that a catalogue has beside
//! their masses.

use crate::stats::ParticleFields;
use particlegs_core::math::{Sym3, each_axis};

/// The innermost particles, whose density says nothing.
const INNERMOST: usize = 10;
/// Steps towards the shape, at most; a step that changes both axis ratios by less ends them.
const SHAPE_STEPS: usize = 20;
const SHAPE_CHANGE: f64 = 0.01;
/// Range of concentrations that are looked for.
const CONCENTRATIONS: [f64; 2] = [0.5, 200.0];

/// A particle about a centre.
#[derive(Clone, Copy, Debug)]
pub struct SphereParticle {
    /// Square of the distance.
    pub square: f64,
    /// From the centre.
    pub offset: [f64; 3],
    pub mass: f64,
    /// Its number.
    pub index: u32,
}

/// A sphere of a mean density about a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensitySphere {
    pub radius: f64,
    pub mass: f64,
    /// Particles inside.
    pub count: usize,
}

/// Particles by their distance, with the mass up to each.
#[derive(Clone, Debug, Default)]
pub struct RadialParticles {
    pub particles: Vec<SphereParticle>,
    enclosed: Vec<f64>,
    /// Square of the distance up to which there are no others.
    reach: f64,
}

impl RadialParticles {
    /// All particles up to a distance `reach`.
    pub fn new(mut particles: Vec<SphereParticle>, reach: f64) -> Self {
        particles.sort_unstable_by(|a, b| a.square.total_cmp(&b.square).then(a.index.cmp(&b.index)));
        let mut sum = 0.0;
        let enclosed = particles.iter().map(|p| {
            sum += p.mass;
            sum
        });
        RadialParticles { enclosed: enclosed.collect(), particles, reach: reach * reach }
    }

    /// The sphere in which the mass first falls to `per_cube` times the cube of the radius, outside the innermost
    /// particles; `None` where it does not as far as particles are known.
    pub fn sphere(&self, per_cube: f64) -> Option<DensitySphere> {
        let first = INNERMOST.min(self.particles.len());
        // The mean density falls between two particles: the mass up to one holds as far as the next.
        let thin = |i: &usize| {
            let square = self.particles.get(*i).map_or(self.reach, |p| p.square);
            self.enclosed[i - 1] < per_cube * square * square.sqrt()
        };
        let count = (first.max(1)..=self.particles.len()).find(thin)?;
        let mass = self.enclosed[count - 1];
        Some(DensitySphere { radius: libm::cbrt(mass / per_cube), mass, count })
    }

    /// The number of particles within a radius.
    pub fn count_within(&self, radius: f64) -> usize {
        self.particles.partition_point(|p| p.square <= radius * radius)
    }

    /// The largest mass over radius outside a radius, within another, and the radius that has it.
    fn steepest(&self, outside: f64, within: f64) -> Option<[f64; 2]> {
        let range = self.count_within(outside).max(INNERMOST)..self.count_within(within);
        let at = |i: usize| {
            let radius = self.particles[i].square.sqrt();
            [self.enclosed[i] / radius, radius]
        };
        range.map(at).reduce(|a, b| if b[0] > a[0] { b } else { a })
    }
}

/// Mass-weighted mean of vectors.
fn mean_of(particles: &[SphereParticle], vector_of: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut mass = 0.0;
    for p in particles {
        let v = vector_of(p.index);
        sum = each_axis(|k| sum[k] + p.mass * v[k]);
        mass += p.mass;
    }
    sum.map(|s| s / mass)
}

/// Root of the mass-weighted mean square of vectors about their mean, in three dimensions.
fn dispersion_of(particles: &[SphereParticle], mean: [f64; 3], vector_of: impl Fn(u32) -> [f64; 3]) -> f64 {
    let mut sum = 0.0;
    let mut mass = 0.0;
    for p in particles {
        let v = vector_of(p.index);
        sum += p.mass * (0..3).map(|k| (v[k] - mean[k]) * (v[k] - mean[k])).sum::<f64>();
        mass += p.mass;
    }
    (sum / mass).sqrt()
}

/// Axis ratios b/a and c/a, and the direction of the longest axis.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HaloShape {
    b_to_a: f64,
    c_to_a: f64,
    axis: [f64; 3],
}

impl HaloShape {
    /// Of particles within an ellipsoid whose longest semi-axis is `radius`, each weighted by its mass over the square
    /// of its elliptical distance (Allgood et al. 2006). The axis has its largest component above 0.
    fn new(particles: &[SphereParticle], radius: f64) -> Option<HaloShape> {
        let mut shape = HaloShape { b_to_a: 1.0, c_to_a: 1.0, axis: [1.0, 0.0, 0.0] };
        let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for _ in 0..SHAPE_STEPS {
            let mut tensor = Sym3::default();
            for p in particles {
                let along = axes.map(|axis| (0..3).map(|k| axis[k] * p.offset[k]).sum::<f64>());
                let (b, c) = (along[1] / shape.b_to_a, along[2] / shape.c_to_a);
                let square = along[0] * along[0] + b * b + c * c;
                // The longest semi-axis stays `radius` while the others shrink to the shape (Allgood et al. 2006).
                if square > 0.0 && square <= radius * radius {
                    let ([x, y, z], weight) = (p.offset, p.mass / square);
                    let products = [x * x, x * y, x * z, y * y, y * z, z * z];
                    tensor.0.iter_mut().zip(products).for_each(|(sum, product)| *sum += weight * product);
                }
            }
            let eigen = tensor.eigen();
            let [a, b, c] = eigen.values.map(|v| v.max(0.0).sqrt());
            // Particles in one plane have no third axis to compare.
            if c <= 0.0 {
                return None;
            }
            let last = shape;
            axes = eigen.vectors;
            shape = HaloShape { b_to_a: b / a, c_to_a: c / a, axis: axes[0] };
            let change = (shape.b_to_a / last.b_to_a - 1.0).abs().max((shape.c_to_a / last.c_to_a - 1.0).abs());
            if change < SHAPE_CHANGE {
                break;
            }
        }
        // An axis has no sign: with its largest component above 0, equal shapes have equal numbers.
        let largest = shape.axis.iter().copied().fold(0.0, |a: f64, v| if v.abs() > a.abs() { v } else { a });
        shape.axis = shape.axis.map(|v| v * largest.signum());
        Some(shape)
    }
}

/// The concentration of the profile of Navarro, Frenk and White (1997) that makes the distances of particles between
/// `inner` and `radius` most likely; `None` at the ends of [`CONCENTRATIONS`].
fn concentration(particles: &RadialParticles, inner: f64, radius: f64) -> Option<f64> {
    let (first, end) = (particles.count_within(inner), particles.count_within(radius));
    let inside = particles.particles.get(first..end).filter(|p| !p.is_empty())?;
    let mass: f64 = inside.iter().map(|p| p.mass).sum();
    let enclosed = |y: f64| libm::log1p(y) - y / (1.0 + y);
    // Terms without the concentration are left out.
    let likelihood = |log: f64| {
        let c = libm::exp(log);
        let places: f64 = inside.iter().map(|p| p.mass * libm::log1p(c * p.square.sqrt() / radius)).sum();
        mass * (2.0 * log - libm::log(enclosed(c) - enclosed(c * inner / radius))) - 2.0 * places
    };
    let [mut low, mut high] = CONCENTRATIONS.map(libm::log);
    let ends = [low, high];
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut at_a, mut at_b) = (likelihood(a), likelihood(b));
    // Golden section: each step evaluates one new place.
    while high - low > 1e-3 {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - GOLDEN * (high - low);
            at_a = likelihood(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + GOLDEN * (high - low);
            at_b = likelihood(b);
        }
    }
    let log_concentration = 0.5 * (low + high);
    // At an end of the range the likeliest value lies beyond it.
    (log_concentration > ends[0] + 0.01 && log_concentration < ends[1] - 0.01).then(|| libm::exp(log_concentration))
}

/// A column that is measured of particles within R200m.
pub struct HaloProperty {
    pub name: &'static str,
    pub description: &'static str,
    pub kind: HaloPropertyKind,
    /// Particles within R200m that it takes.
    pub least: usize,
}

/// The unit of a property.
#[derive(Clone, Copy, PartialEq)]
pub enum HaloPropertyKind {
    /// That of velocities.
    Velocity,
    /// km/s, of masses and radii: needs their units.
    Circular,
    /// The unit of length, where circular velocities are known.
    Length,
    Number,
}

const fn property(name: &'static str, kind: HaloPropertyKind, least: usize, description: &'static str) -> HaloProperty {
    HaloProperty { name, description, kind, least }
}

/// All of them.
pub const PROPERTIES: [HaloProperty; 12] = [
    property("vx", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along x"),
    property("vy", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along y"),
    property("vz", HaloPropertyKind::Velocity, 100, "mean velocity within R200m, along z"),
    property("vrms", HaloPropertyKind::Velocity, 300, "velocity dispersion in three dimensions within R200m"),
    property("b_to_a", HaloPropertyKind::Number, 300, "ratio of the second to the longest axis (Allgood et al. 2006)"),
    property("c_to_a", HaloPropertyKind::Number, 300, "ratio of the shortest to the longest axis"),
    property("a_x", HaloPropertyKind::Number, 300, "direction of the longest axis, along x"),
    property("a_y", HaloPropertyKind::Number, 300, "direction of the longest axis, along y"),
    property("a_z", HaloPropertyKind::Number, 300, "direction of the longest axis, along z"),
    property("vmax", HaloPropertyKind::Circular, 300, "largest circular velocity outside three softening lengths"),
    property("rvmax", HaloPropertyKind::Length, 300, "radius of the largest circular velocity"),
    property(
        "c200c",
        HaloPropertyKind::Number,
        1000,
        "concentration of the likeliest NFW profile, R200c / scale radius",
    ),
];

/// A value for each of [`PROPERTIES`]; NaN where there is none. Circular velocities are the largest mass over radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereProperties(pub [f64; PROPERTIES.len()]);

impl SphereProperties {
    /// Of particles about a centre: circular velocities and profiles from the radius `inner` on, all up to `outer`,
    /// R200m; `critical` = R200c. Those properties are measured for which `count` particles are enough.
    pub fn new(
        particles: &RadialParticles,
        velocities: Option<&ParticleFields>,
        [inner, outer]: [f64; 2],
        critical: Option<f64>,
        count: usize,
    ) -> Self {
        let inside = &particles.particles[..particles.count_within(outer)];
        let enough = |i: usize| count >= PROPERTIES[i].least;
        let mut all = [f64::NAN; PROPERTIES.len()];
        if let Some(v) = velocities.filter(|_| enough(0)) {
            let velocity_of = |i: u32| v.of(i as usize);
            let mean = mean_of(inside, velocity_of);
            all[..3].copy_from_slice(&mean);
            if enough(3) {
                all[3] = dispersion_of(inside, mean, velocity_of);
            }
        }
        if let Some(shape) = enough(4).then(|| HaloShape::new(inside, outer)).flatten() {
            all[4..6].copy_from_slice(&[shape.b_to_a, shape.c_to_a]);
            all[6..9].copy_from_slice(&shape.axis);
        }
        if let Some(steepest) = enough(9).then(|| particles.steepest(inner, outer)).flatten() {
            all[9..11].copy_from_slice(&steepest);
        }
        if let Some(radius) = critical.filter(|_| enough(11)) {
            all[11] = concentration(particles, inner, radius).unwrap_or(f64::NAN);
        }
        SphereProperties(all)
    }

    /// Standard errors from values that each lack one part of the particles, times `scale`.
    pub fn jackknife<const N: usize>(parts: &[SphereProperties; N], scale: f64) -> Self {
        let n = N as f64;
        let error = |k: usize| {
            let mean = parts.iter().map(|p| p.0[k]).sum::<f64>() / n;
            let square = parts.iter().map(|p| (p.0[k] - mean) * (p.0[k] - mean)).sum::<f64>();
            scale * ((n - 1.0) / n * square).sqrt()
        };
        SphereProperties(std::array::from_fn(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// NFW of a concentration, stretched by axis ratios along x, y and z, out to its radius of 1.
    fn halo(n: usize, c: f64, axes: [f64; 3]) -> RadialParticles {
        let mut r = Random::new(11, 0, 0);
        let enclosed = |y: f64| y.ln_1p() - y / (1.0 + y);
        let particle = |index: usize| {
            let share = r.uniform() * enclosed(1.5 * c);
            let (mut low, mut high) = (0.0, 1.5);
            for _ in 0..50 {
                let middle: f64 = 0.5 * (low + high);
                *(if enclosed(c * middle) < share { &mut low } else { &mut high }) = middle;
            }
            let z = [r.normal(), r.normal(), r.normal()];
            let per = low / z.iter().map(|v| v * v).sum::<f64>().sqrt();
            let offset: [f64; 3] = each_axis(|k| per * z[k] * axes[k]);
            SphereParticle { square: offset.iter().map(|v| v * v).sum(), offset, mass: 2.0, index: index as u32 }
        };
        RadialParticles::new((0..n).map(particle).collect(), 1.5)
    }

    #[test]
    fn a_profile_has_its_concentration_and_its_sphere() {
        for c in [3.0, 8.0, 20.0] {
            let h = halo(40_000, c, [1.0; 3]);
            let concentration = concentration(&h, 0.03, 1.0).unwrap();
            assert!((concentration / c - 1.0).abs() < 0.06, "{concentration} {c}");
            let enclosed = |y: f64| y.ln_1p() - y / (1.0 + y);
            let mass = 80_000.0 * enclosed(c) / enclosed(1.5 * c);
            let sphere = h.sphere(mass).unwrap();
            assert!((sphere.radius - 1.0).abs() < 0.01 && (sphere.mass / mass - 1.0).abs() < 0.02);
            assert_eq!(sphere.mass, 2.0 * sphere.count as f64);
            assert!((sphere.mass / sphere.radius.powi(3) / mass - 1.0).abs() < 1e-12);
            // NFW: the largest circular velocity is at 2.163 scale radii.
            let [_, at] = h.steepest(0.01, 1.5).unwrap();
            assert!(c < 4.0 || (at * c / 2.163 - 1.0).abs() < 0.35, "{}", at * c);
            assert_eq!(h.sphere(1.0), None);
            // Past the last particle, as far as there are known to be no others.
            let alone = RadialParticles::new(h.particles, 2.0);
            let all = alone.sphere(80_000.0 / 1.9f64.powi(3)).unwrap();
            assert!((all.radius - 1.9).abs() < 1e-9 && all.count == 40_000 && alone.sphere(9e3).is_none());
        }
        assert_eq!(concentration(&RadialParticles::default(), 0.1, 1.0), None);
    }

    #[test]
    fn a_stretched_halo_has_its_axes() {
        let h = halo(40_000, 6.0, [0.5, 1.0, 0.7]);
        let shape = HaloShape::new(&h.particles, 0.9).unwrap();
        assert!((shape.b_to_a - 0.7).abs() < 0.02 && (shape.c_to_a - 0.5).abs() < 0.02, "{shape:?}");
        assert!(shape.axis[1] > 0.999);
        assert_eq!(HaloShape::new(&h.particles[..1], 1.0), None);
    }

    #[test]
    fn dispersions_are_about_the_weighted_mean() {
        let h = halo(3, 5.0, [1.0; 3]);
        let velocity = |i: u32| [f64::from(i), 0.0, -2.0];
        let mean = mean_of(&h.particles, velocity);
        assert_eq!(mean, [1.0, 0.0, -2.0]);
        assert!((dispersion_of(&h.particles, mean, velocity) - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }
}

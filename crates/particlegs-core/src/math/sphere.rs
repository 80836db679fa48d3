//! The mass of one Gaussian inside a sphere.
//!
//! Along its shortest principal axis a Gaussian's share in a chord of the sphere is a difference of error functions;
//! the two other axes are integrated by Gauss and Legendre's rule where the sphere's surface cuts through. Angles
//! stand for coordinates there, y = c + r sin(a), so that the chord has no root at the sphere's edge.

use super::{Sym3, each_axis, normal_share};
use std::f64::consts::{PI, TAU};

/// Gaussians end here, in deviations along each principal axis: 1e-4 of the mass lies beyond.
const TAIL: f64 = 4.0;
const RULES: [usize; 3] = [8, 12, 20];
/// Widest piece of a Gaussian for the first rule, in deviations of its shortest axis, and for the second, in its own.
const WIDEST: [f64; 2] = [4.0, 7.0];
/// Spheres over which density changes by no more than about this share are small.
const SMALL: f64 = 0.6;
/// Points that are counted at once.
const POINTS: usize = 64;

/// A sphere about a place.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Its centre, wherever the caller counts from.
    pub center: [f64; 3],
    /// Its radius.
    pub radius: f64,
}

impl Ball {
    /// Whether a place lies inside or on it.
    pub fn contains(&self, x: [f64; 3]) -> bool {
        (0..3).map(|k| (x[k] - self.center[k]) * (x[k] - self.center[k])).sum::<f64>() <= self.radius * self.radius
    }
}

/// A Gaussian as its mass in spheres is computed.
#[derive(Clone, Debug)]
pub struct GaussianInSphere {
    /// The mean, wherever the caller counts from.
    pub mean: [f64; 3],
    /// All of its mass.
    pub mass: f64,
    deviation: [f64; 3],
    axes: [[f64; 3]; 3],
}

impl GaussianInSphere {
    /// Deviations are taken as the ends of `widths` where they are beyond.
    pub fn new(mean: [f64; 3], cov: &Sym3, mass: f64, widths: [f64; 2]) -> Self {
        let eigen = cov.eigen();
        let deviation = eigen.values.map(|v| v.max(0.0).sqrt().clamp(widths[0], widths[1]));
        GaussianInSphere { mean, mass, deviation, axes: eigen.vectors }
    }

    /// Distance from the mean beyond which there is nothing.
    pub fn reach(&self) -> f64 {
        TAIL * self.deviation[0]
    }

    /// Adds the mass inside spheres of ascending `radii` about a place at `offset` from the mean.
    pub fn add_within(&self, offset: [f64; 3], radii: &[f64], rules: &Rules, to: &mut [f64]) {
        let center: [f64; 3] = each_axis(|k| (0..3).map(|j| self.axes[k][j] * offset[j]).sum());
        let distance = center.iter().map(|c| c * c).sum::<f64>().sqrt();
        // How far it reaches towards that place.
        let along = (0..3)
            .map(|k| {
                let v = center[k] * self.deviation[k];
                v * v
            })
            .sum::<f64>()
            .sqrt();
        let small = LocalDensity::new(center, self.deviation);
        let nearest = if distance > 0.0 { distance - TAIL * (along / distance) } else { 0.0 };
        for (to, r) in to.iter_mut().zip(radii) {
            if *r >= distance + self.reach() {
                *to += self.mass;
            } else if *r <= small.radius {
                *to += self.mass * small.share(*r);
            } else if *r > nearest {
                *to += self.mass * self.share(center, *r, rules);
            }
        }
    }

    /// The same, by the share of evenly spread points of a standard normal distribution that lie inside: to a hundredth of
    /// the mass for 250 of them. Points in one of the balls `excluded`, whose centres are counted from that place, are
    /// left out.
    pub fn add_counted(
        &self,
        offset: [f64; 3],
        radii: &[f64],
        excluded: &[Ball],
        [x, y, z]: &[Vec<f64>; 3],
        to: &mut [f64],
    ) {
        let along_axes = |v: [f64; 3]| -> [f64; 3] { each_axis(|k| (0..3).map(|j| self.axes[k][j] * v[j]).sum()) };
        let center = along_axes(offset);
        let square = center.iter().map(|c| c * c).sum::<f64>();
        let (distance, largest) = (square.sqrt(), radii.last().copied().unwrap_or(0.0));
        let along = (0..3).map(|k| center[k] * self.deviation[k]).map(|v| v * v).sum::<f64>().sqrt();
        if distance > 0.0 && largest <= distance - TAIL * (along / distance) {
            return;
        }
        let turned = |ball: &Ball| Ball { center: along_axes(each_axis(|k| offset[k] + ball.center[k])), ..*ball };
        let reaches = |ball: &Ball| Ball { radius: ball.radius + self.reach(), ..*ball }.contains([0.0; 3]);
        let excluded: Vec<Ball> = excluded.iter().map(turned).filter(reaches).collect();
        let is_cut = !excluded.is_empty();
        // Where a part is left out, every point is looked at.
        let whole = if is_cut { radii.len() } else { radii.partition_point(|r| *r < distance + self.reach()) };
        to[whole..].iter_mut().for_each(|to| *to += self.mass);
        let small = LocalDensity::new(center, self.deviation);
        let first = if is_cut { 0 } else { radii[..whole].partition_point(|r| *r <= small.radius) };
        to[..first].iter_mut().zip(radii).for_each(|(to, r)| *to += self.mass * small.share(*r));
        if first == whole {
            return;
        }
        let ([a, b, c], [s, t, u]) = (center, self.deviation);
        let each = self.mass / x.len() as f64;
        let mut squares = [0.0; POINTS];
        for start in (0..x.len()).step_by(POINTS) {
            let end = x.len().min(start + POINTS);
            let points = x[start..end].iter().zip(&y[start..end]).zip(&z[start..end]);
            for (square, ((x, y), z)) in squares.iter_mut().zip(points) {
                let d = [s * x - a, t * y - b, u * z - c];
                *square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            }
            for ball in &excluded {
                let points = squares.iter_mut().zip(start..end);
                let inside = points.filter(|(_, i)| ball.contains([s * x[*i], t * y[*i], u * z[*i]]));
                inside.for_each(|(square, _)| *square = f64::INFINITY);
            }
            for (to, r) in to[first..whole].iter_mut().zip(&radii[first..]) {
                let inside = |square: &f64| if *square <= r * r { 1.0 } else { 0.0 };
                *to += each * squares[..end - start].iter().map(inside).sum::<f64>();
            }
        }
    }

    /// Mass per volume at `offset` from the mean.
    pub fn density(&self, offset: [f64; 3]) -> f64 {
        if offset.iter().map(|d| d * d).sum::<f64>() > self.reach() * self.reach() {
            return 0.0;
        }
        let center: [f64; 3] = each_axis(|k| (0..3).map(|j| self.axes[k][j] * offset[j]).sum());
        let square: f64 = (0..3).map(|k| center[k] / self.deviation[k]).map(|v| v * v).sum();
        if square > TAIL * TAIL {
            return 0.0;
        }
        let peak: f64 = self.deviation.iter().map(|s| 1.0 / (TAU.sqrt() * s)).product();
        self.mass * peak * libm::exp(-0.5 * square)
    }

    /// The share inside a sphere about `c`, in the frame of the principal axes.
    fn share(&self, c: [f64; 3], r: f64, rules: &Rules) -> f64 {
        let s = self.deviation;
        // The nearest and the furthest that there is of it from the centre along an axis, squared.
        let ends = |k: usize| {
            let (c, t) = (c[k].abs(), TAIL * s[k]);
            let near = (c - t).max(0.0);
            (near * near, (c + t) * (c + t))
        };
        let (second, third) = (ends(1), ends(2));
        let root = |square: f64| square.max(0.0).sqrt();
        let square = r * r;
        let ends_of_first = [root(square - second.0 - third.0), root(square - second.1 - third.1)];
        let outer = rules.over(c[0], ends_of_first, [s[0], s[2]], |x| {
            let square = square - x * x;
            rules.over(c[1], [root(square - third.0), root(square - third.1)], [s[1], s[2]], |x| {
                let chord = root(square - x * x);
                normal_share(c[2] + chord, s[2]) - normal_share(c[2] - chord, s[2])
            })
        });
        outer.clamp(0.0, 1.0)
    }
}

/// Spheres in which a Gaussian is its density at their centre and the curvature there.
struct LocalDensity {
    radius: f64,
    /// The density's peak, and the logarithm of what it is at the centre over that.
    peak: f64,
    exponent: f64,
    /// The Laplacian over the density.
    curvature: f64,
}

impl LocalDensity {
    fn new(center: [f64; 3], deviation: [f64; 3]) -> Self {
        let sum = |term: fn(f64, f64) -> f64| (0..3).map(|k| term(center[k], deviation[k])).sum::<f64>();
        let slopes = sum(|c, s| {
            let v = c / (s * s);
            v * v
        });
        let widths = sum(|_, s| 1.0 / (s * s));
        let exponent = -0.5
            * sum(|c, s| {
                let v = c / s;
                v * v
            });
        let peak = deviation.iter().map(|s| 1.0 / (TAU.sqrt() * s)).product::<f64>();
        LocalDensity { radius: SMALL / (slopes.sqrt() + widths.sqrt()), peak, exponent, curvature: slopes - widths }
    }

    fn share(&self, r: f64) -> f64 {
        4.0 / 3.0 * PI * r * r * r * (self.peak * libm::exp(self.exponent)) * (1.0 + r * r / 10.0 * self.curvature)
    }
}

/// Gauss and Legendre's rules on [-1, 1].
pub struct Rules([Vec<(f64, f64)>; RULES.len()]);

/// Nodes and weights; the nodes are roots of the Legendre polynomial, by Newton's method.
fn legendre(n: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        // So near the root that ten steps reach its last digit.
        let mut x = libm::cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
        let mut slope = 1.0;
        for _ in 0..10 {
            let (mut last, mut value) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                (last, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * last) / k);
            }
            slope = n as f64 * (x * value - last) / (x * x - 1.0);
            x -= value / slope;
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..n).map(node).collect()
}

impl Default for Rules {
    fn default() -> Self {
        Rules::new()
    }
}

impl Rules {
    /// All of them.
    pub fn new() -> Self {
        Rules(RULES.map(legendre))
    }

    /// For a piece so wide of a Gaussian of deviation `s` along it and `least` along its shortest axis.
    fn for_width(&self, width: f64, s: f64, least: f64) -> &[(f64, f64)] {
        let fits = [width / least, width / s].iter().zip(WIDEST).position(|(width, widest)| *width <= widest);
        &self.0[fits.unwrap_or(WIDEST.len())]
    }

    /// The integral of a Gaussian of deviation `s` about 0 times `f(x)` over y = c + x, |x| < r, as far as the
    /// Gaussian goes; `f` is 1 where |x| < `whole`.
    fn over(&self, c: f64, [r, whole]: [f64; 2], [s, least]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
        if r <= 0.0 {
            return 0.0;
        }
        let angle = |x: f64| libm::asin((x / r).clamp(-1.0, 1.0));
        let (low, high) = (angle(-TAIL * s - c), angle(TAIL * s - c));
        let piece = |low: f64, high: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            if half.is_nan() || half <= 0.0 {
                return 0.0;
            }
            let at = |(node, weight): &(f64, f64)| {
                let sine = libm::sin(middle + half * node);
                let cosine = (1.0 - sine * sine).max(0.0).sqrt();
                let y = (c + r * sine) / s;
                weight * cosine * libm::exp(-0.5 * y * y) * f(r * sine)
            };
            half * r / (TAU.sqrt() * s) * self.for_width(2.0 * half * r, s, least).iter().map(at).sum::<f64>()
        };
        if whole <= 0.0 {
            return piece(low, high);
        }
        // Where `f` is 1 the integral is known, and no rule is needed.
        let inside = normal_share(c + whole, s) - normal_share(c - whole, s);
        inside + piece(low, high.min(angle(-whole))) + piece(low.max(angle(whole)), high)
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::splat::erf;

    fn within(deviations: [f64; 3], offset: [f64; 3], r: f64) -> f64 {
        let [a, b, c] = deviations.map(|s| s * s);
        let mut to = [0.0];
        let gaussian = GaussianInSphere::new([0.0; 3], &Sym3([a, 0.0, 0.0, b, 0.0, c]), 1.0, [1e-12, 1e12]);
        gaussian.add_within(offset, &[r], &Rules::new(), &mut to);
        to[0]
    }

    /// A round Gaussian: Maxwell's distribution, and off its centre the noncentral one.
    fn round(s: f64, d: f64, r: f64) -> f64 {
        let gaussian = |x: f64| (-0.5 * x * x).exp();
        let (low, high) = ((r - d) / s, (r + d) / s);
        let root = 2.0f64.sqrt();
        if d == 0.0 {
            return erf(high / root) - (2.0 / PI).sqrt() * high * gaussian(high);
        }
        0.5 * (erf(high / root) + erf(low / root)) - s / (d * TAU.sqrt()) * (gaussian(low) - gaussian(high))
    }

    #[test]
    fn round_gaussians_hold_what_maxwell_says() {
        for s in [0.05, 0.4, 1.0, 3.0] {
            for d in [0.0, 0.3, 1.0, 2.5] {
                for r in [0.02, 0.3, 1.0, 2.0] {
                    let expected = round(s, d, r);
                    for offset in [[d, 0.0, 0.0], [0.0, 0.0, -d], [0.6 * d, 0.0, 0.8 * d], [d / 3f64.sqrt(); 3]] {
                        let share = within([s; 3], offset, r);
                        let error = (share - expected).abs();
                        assert!(error < 1e-4 + 1e-4 * expected, "{s} {d} {r}: {share} {expected}");
                    }
                }
            }
        }
    }

    /// Flat, long and thin ones against drawn particles.
    #[test]
    fn other_shapes_hold_what_drawn_particles_do() {
        let n = 400_000;
        let mut r = Random::new(5, 0, 0);
        let normals: Vec<[f64; 3]> = (0..n).map(|_| [r.normal(), r.normal(), r.normal()]).collect();
        let mut worst: f64 = 0.0;
        for deviations in
            [[1.0, 0.7, 0.4], [1.0, 1.0, 0.05], [1.0, 0.05, 0.05], [1.0, 0.3, 0.01], [3.0, 1.0, 0.3], [1.0, 1.0, 1e-6]]
        {
            for offset in [[0.0; 3], [0.8, 0.0, 0.0], [0.0, 0.0, 0.3], [0.5, -0.7, 0.2], [1.5, 1.0, -0.6]] {
                for r in [0.25, 0.5, 1.0, 2.0] {
                    let inside = |x: &&[f64; 3]| {
                        (0..3).map(|k| (x[k] * deviations[k] - offset[k]).powi(2)).sum::<f64>() <= r * r
                    };
                    let drawn = normals.iter().filter(inside).count() as f64 / n as f64;
                    let share = within(deviations, offset, r);
                    let scatter = (drawn * (1.0 - drawn) / n as f64).sqrt();
                    worst = worst.max((share - drawn).abs() - 3.0 * scatter);
                }
            }
        }
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn rules_are_exact_for_polynomials() {
        for nodes in RULES {
            for power in 0..2 * nodes as i32 {
                let sum: f64 = legendre(nodes).iter().map(|(x, w)| w * x.powi(power)).sum();
                let exact = if power % 2 == 0 { 2.0 / f64::from(power + 1) } else { 0.0 };
                assert!((sum - exact).abs() < 1e-13, "{nodes} {power}");
            }
        }
    }
}

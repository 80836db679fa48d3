//! Sums of two normal distributions, from which logarithms of a field are drawn so that the values themselves have the
//! mean that the model states: gas of two phases has a mean far from that of log-normal values.

use super::quantile::quantile;
use particlegs_core::model::{FieldMoments, Mixture};

/// Share of the variance that lies between the two, at most.
const MOST_BETWEEN: f64 = 0.95;
/// That share, for each part of half the variance that the excess is.
const BETWEEN: f64 = 2.4;
/// The smaller part's weight.
const LEAST_WEIGHT: f64 = 1e-3;
/// Share of the particles that the narrowest Gaussians have, whose width is that of a phase.
const NARROWEST: f64 = 0.02;
/// Widths between two phases at least.
const APART: f64 = 6.0;
/// Largest errors of variances and of values that follow from the shares of phases: rounding makes 0.35 and 0.11.
const MOST_OFF: [f64; 2] = [0.45, 0.2];
/// Steps towards the mean of all values.
const SCALINGS: usize = 8;
/// Deviations about the two means that hold all of it.
const REACH: f64 = 5.0;
/// Steps towards a quantile at most.
const ITERATIONS: usize = 30;
/// Halvings of the interval of weights.
const HALVINGS: usize = 40;

/// Two normal distributions of one width, together of mean 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoNormals {
    /// Weight of the upper one.
    weight: f64,
    /// Means: the upper one's, the lower one's.
    means: [f64; 2],
    width: f64,
}

/// The two phases of a logarithmic field that are the same everywhere: only their shares change from place to place.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoPhases {
    /// Means of the logarithm: the upper one's, the lower one's.
    means: [f64; 2],
    width: f64,
    /// Factor of values, which makes their mean over all the model's.
    scale: f64,
}

impl TwoPhases {
    /// Of the Gaussians of a layer; `None` where their moments are not those of two phases: with shares p and 1 - p of
    /// normals about u and v, variance + mean^2 is linear in the mean, and so is the mean of the values.
    pub fn new(field: &FieldMoments, g: &Mixture) -> Option<TwoPhases> {
        let counted = || (0..g.len()).filter(|i| g.count[*i] >= 1.0);
        let total: f64 = counted().map(|i| g.count[i]).sum();
        let average = |value: &dyn Fn(usize) -> f64| counted().map(|i| g.count[i] * value(i)).sum::<f64>() / total;
        let mean = |i: usize| field.mean[0][i];
        // Across a Gaussian the values have what the slopes explain, too.
        let slope = |i: usize| [0, 1, 2].map(|k| field.slope[0][k][i]);
        let variance = |i: usize| field.spread[0][i] + g.cov_of(i).quadratic(slope(i));
        let value = |i: usize| field.overall_value(0, i, &g.cov_of(i));
        field.excess.as_ref()?;
        let center = average(&mean);
        let between = average(&|i| (mean(i) - center) * (mean(i) - center));
        let along = |of: &dyn Fn(usize) -> f64| average(&|i| (mean(i) - center) * of(i)) / between;
        let square = |i: usize| variance(i) + (mean(i) - center) * (mean(i) - center);
        // The narrowest Gaussians have next to nothing of the other phase.
        let mut narrowest: Vec<(f64, f64)> = counted().map(|i| (variance(i), g.count[i])).collect();
        narrowest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = NARROWEST * total;
        let of_one = narrowest.iter().find(|(_, count)| {
            left -= count;
            left <= 0.0
        })?;
        // About the centre the means are the roots of y^2 - sum y - (variance + mean^2 at the centre - width^2).
        let sum = along(&square);
        let root = (sum * sum + 4.0 * (average(&square) - of_one.0)).sqrt();
        let (means, width) = ([0.5 * (sum + root) + center, 0.5 * (sum - root) + center], of_one.0.sqrt());
        let mut phases = TwoPhases { means, width, scale: 1.0 };
        let share = |i: usize| ((mean(i) - means[1]) / root).clamp(0.0, 1.0);
        let off = |i: usize| root * root * share(i) * (1.0 - share(i)) + of_one.0 - variance(i);
        let of_values = |i: usize| (phases.value(share(i)) - value(i)).abs();
        let alike = average(&|i| off(i) * off(i)) < MOST_OFF[0] * MOST_OFF[0] * average(&|i| variance(i) * variance(i))
            && average(&of_values) < MOST_OFF[1] * average(&value)
            && root > APART * width;
        // No share is above 1, which the others make up for.
        for _ in 0..SCALINGS {
            phases.scale *= average(&value) / average(&|i| phases.value(phases.share(value(i))));
        }
        alike.then_some(phases)
    }

    /// The mean of values of which this share is of the upper phase.
    fn value(&self, share: f64) -> f64 {
        let [upper, lower] = self.means.map(|mean| libm::exp(mean + 0.5 * self.width * self.width));
        share * upper + (1.0 - share) * lower
    }

    /// The share of the upper phase in values of this mean.
    fn share(&self, value: f64) -> f64 {
        let [lower, upper] = [0.0, 1.0].map(|share| self.value(share));
        ((self.scale * value - lower) / (upper - lower)).clamp(0.0, 1.0)
    }
}

impl TwoNormals {
    /// Those of a Gaussian of a logarithmic field about its mean, and whether this follows the slope; `None` of other
    /// fields.
    pub fn of_field(
        field: &FieldMoments,
        gaussian: usize,
        phases: Option<&TwoPhases>,
        g: &Mixture,
    ) -> Option<(TwoNormals, bool)> {
        let excess = field.excess.as_ref()?[gaussian];
        let mean = field.mean[0][gaussian];
        if let Some(phases) = phases {
            let weight = phases.share(field.overall_value(0, gaussian, &g.cov_of(gaussian)));
            return Some((TwoNormals { weight, means: phases.means.map(|m| m - mean), width: phases.width }, false));
        }
        Some((TwoNormals::new(field.spread[0][gaussian], excess), true))
    }

    /// Of this variance, such that the logarithm of the mean of exp(draw) is `excess` above `variance / 2`, or as near
    /// as the distribution comes.
    pub fn new(variance: f64, excess: f64) -> TwoNormals {
        let between = (BETWEEN * excess.abs() / (0.5 * variance)).min(MOST_BETWEEN);
        if between.is_nan() || between <= 0.0 {
            return TwoNormals { weight: 0.5, means: [0.0; 2], width: variance.max(0.0).sqrt() };
        }
        let width = (variance * (1.0 - between)).max(0.0).sqrt();
        let of_weight = |p: f64| {
            let scale = (between * variance).sqrt();
            let odds = ((1.0 - p) / p).sqrt();
            TwoNormals { weight: p, means: [scale * odds, -scale / odds], width }
        };
        // The mean of exponentials falls as the upper part's weight grows.
        let (mut low, mut high) = (LEAST_WEIGHT, 1.0 - LEAST_WEIGHT);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if of_weight(middle).log_mean() - 0.5 * variance > excess { low = middle } else { high = middle }
        }
        of_weight(0.5 * (low + high))
    }

    /// The logarithm of the mean of exp(draw).
    fn log_mean(&self) -> f64 {
        let [upper, lower] = self.means;
        let two = self.weight + (1.0 - self.weight) * libm::exp(lower - upper);
        upper + libm::log(two) + 0.5 * self.width * self.width
    }

    /// A draw, by two of a normal distribution.
    pub fn draw(&self, normals: [f64; 2]) -> f64 {
        // The first one's place among all chooses the part.
        let is_upper = 0.5 * libm::erfc(normals[0] * std::f64::consts::FRAC_1_SQRT_2) < self.weight;
        self.means[usize::from(!is_upper)] + self.width * normals[1]
    }

    /// The value below which as much lies as below `z` in a normal distribution: a draw, by one of that, which rises
    /// with it.
    pub fn quantile(&self, z: f64) -> f64 {
        let [upper, lower] = self.means;
        if upper == lower || self.width <= 0.0 {
            return upper + self.width * z;
        }
        // Shares beyond a value, on the side where they are small.
        let side = if z > 0.0 { 1.0 } else { -1.0 };
        let beyond = |x: f64| 0.5 * libm::erfc(side * x * std::f64::consts::FRAC_1_SQRT_2);
        let density = |x: f64| libm::exp(-0.5 * x * x) / (2.0 * std::f64::consts::PI).sqrt();
        let (wanted, weights) = (beyond(z), [self.weight, 1.0 - self.weight]);
        let (mut low, mut high) = (lower + self.width * z, upper + self.width * z);
        let mut x = self.weight * high + (1.0 - self.weight) * low;
        for _ in 0..ITERATIONS {
            let parts = [0, 1].map(|k| (x - self.means[k]) / self.width);
            let off = weights[0] * beyond(parts[0]) + weights[1] * beyond(parts[1]) - wanted;
            if side * off > 0.0 {
                low = x
            } else {
                high = x
            }
            let slope = side * (weights[0] * density(parts[0]) + weights[1] * density(parts[1])) / self.width;
            let next = x + off / slope;
            if (next - x).abs() < 1e-6 * self.width {
                return next;
            }
            x = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        x
    }

    /// The correlation of [`TwoNormals::quantile`] with its argument.
    pub fn gain(&self) -> f64 {
        let [upper, lower] = self.means;
        if upper == lower || self.width <= 0.0 {
            return 1.0;
        }
        // The mean of value times z is that of the quantile's slope: an integral over values of the density of z.
        let [from, to] = [lower - REACH * self.width, upper + REACH * self.width];
        let nodes = (2.0 * (to - from) / self.width).ceil();
        let below = |x: f64| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
        let node = |k: f64| {
            let [p, q] = self.means.map(|m| below((from + (k + 0.5) / nodes * (to - from) - m) / self.width));
            let z = quantile(self.weight * p + (1.0 - self.weight) * q);
            libm::exp(-0.5 * z * z)
        };
        let sum: f64 = (0..nodes as u32).map(|k| node(f64::from(k))).sum();
        let mean = sum * (to - from) / (nodes * (2.0 * std::f64::consts::PI).sqrt());
        (mean / (self.width * self.width - upper * lower).sqrt()).clamp(0.1, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, Sym3};

    /// Gaussians whose particles are drawn by `log`, of Gaussian i of n and a random number.
    fn field(log: impl Fn(f64, &mut Random) -> f64) -> (FieldMoments, Mixture) {
        let (mut f, mut g) = (FieldMoments::logarithmic(), Mixture::new(false));
        f.range = vec![[-50.0, 50.0]];
        for i in 0..400 {
            let mut random = Random::new(9, 0, i);
            let logs: Vec<f64> = (0..200).map(|_| log(i as f64 / 400.0, &mut random)).collect();
            let mean = |of: &dyn Fn(f64) -> f64| logs.iter().map(|v| of(*v)).sum::<f64>() / logs.len() as f64;
            let center = mean(&|v| v);
            let variance = mean(&|v| (v - center) * (v - center));
            f.mean[0].push(center);
            f.slope[0].iter_mut().for_each(|column| column.push(0.0));
            f.spread[0].push(variance);
            f.excess.as_mut().unwrap().push(mean(&f64::exp).ln() - center - 0.5 * variance);
            g.push([i as f64, 0.0, 0.0], Sym3::scaled_identity(1.0), 200.0, 200.0);
        }
        (f, g)
    }

    #[test]
    fn two_phases_are_seen_and_keep_shares_and_the_mean_of_values() {
        let (f, g) = field(|at, r| if r.uniform() < 1.4 * at - 0.2 { 16.0 } else { 9.0 } + 0.3 * r.normal());
        let phases = TwoPhases::new(&f, &g).unwrap();
        assert!((phases.means[0] - 16.0).abs() < 0.1 && (phases.means[1] - 9.0).abs() < 0.1, "{phases:?}");
        assert!((phases.width - 0.3).abs() < 0.06, "{phases:?}");
        let of_model = |i: usize| f.overall_value(0, i, &g.cov_of(i));
        let shares: Vec<f64> = (0..400).map(|i| phases.share(of_model(i))).collect();
        assert!((shares.iter().sum::<f64>() / 400.0 - 0.5).abs() < 0.02);
        let [drawn, model] = [shares.iter().map(|p| phases.value(*p)).sum::<f64>(), (0..400).map(of_model).sum()];
        assert!((drawn / model - 1.0).abs() < 1e-3, "{drawn} {model}");
    }

    #[test]
    fn other_fields_have_no_phases() {
        // One phase that changes from place to place; noise alone; a second phase that follows the first.
        let one = field(|at, r| 9.0 + 4.0 * at + 0.5 * r.normal());
        let noise = field(|_, r| 9.0 + 2.0 * r.normal());
        let following = field(|at, r| 9.0 + 8.0 * at + if r.uniform() < 0.5 { 3.0 } else { 0.0 } + 0.3 * r.normal());
        for (f, g) in [one, noise, following] {
            assert!(TwoPhases::new(&f, &g).is_none());
        }
        assert!(TwoPhases::new(&FieldMoments::logarithmic(), &Mixture::new(false)).is_none());
    }

    #[test]
    fn draws_have_the_variance_and_the_mean_of_exponentials() {
        let cases =
            [(0.3, 0.0), (0.5, 0.05), (1.0, -0.12), (4.0, -1.2), (3.5, -1.07), (0.5, 1.1), (1e-9, 0.5), (0.0, 0.0)];
        for (variance, excess) in cases {
            let distribution = TwoNormals::new(variance, excess);
            let mut random = Random::new(3, 1, 4);
            let n = 400_000;
            let (mut sum, mut square, mut exponential) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let normals = [random.normal(), random.normal()];
                // Half of them one way, half the other.
                let v = if i % 2 == 0 { distribution.draw(normals) } else { distribution.quantile(normals[0]) };
                (sum, square, exponential) = (sum + v, square + v * v, exponential + v.exp());
            }
            let mean_of = |v: f64| v / f64::from(n);
            assert!(mean_of(sum).abs() < 0.01 * f64::sqrt(variance) + 1e-12, "{variance} {excess}: {}", mean_of(sum));
            assert!((mean_of(square) - variance).abs() <= 0.1 * variance, "{variance} {excess}: {}", mean_of(square));
            let measured_excess = mean_of(exponential).ln() - 0.5 * variance;
            if variance > 0.1 {
                assert!((measured_excess - excess).abs() < 0.03, "{variance} {excess}: {measured_excess}");
            }
        }
    }
}

//! Sums of two normal distributions, from which logarithms of a field are drawn so that the values themselves have the
//! mean that the model states: gas of two phases has a mean far from that of log-normal values.

use super::quantile::quantile;

/// Share of the variance that lies between the two, at most.
const MOST_BETWEEN: f64 = 0.95;
/// That share, for each part of half the variance that the excess is.
const BETWEEN: f64 = 2.4;
/// The smaller part's weight.
const LEAST_WEIGHT: f64 = 1e-3;
/// Deviations about the two means that hold all of it.
const REACH: f64 = 5.0;
/// Steps towards a quantile at most.
const ITERATIONS: usize = 30;
/// Halvings of the interval of weights.
const HALVINGS: usize = 40;

/// Two normal distributions of one width.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoNormals {
    /// Weight of the upper one.
    weight: f64,
    /// Means: the upper one's, the lower one's.
    means: [f64; 2],
    width: f64,
}

impl TwoNormals {
    /// Parts of this width about the means of the upper and the lower one, this share of them in the upper one.
    pub fn mixed(weight: f64, means: [f64; 2], width: f64) -> TwoNormals {
        TwoNormals { weight, means, width }
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
        let between = self.weight * (1.0 - self.weight) * (upper - lower) * (upper - lower);
        (mean / (self.width * self.width + between).sqrt()).clamp(0.1, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

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

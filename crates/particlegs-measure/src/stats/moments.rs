//! Moments of positions along each axis, by mass.

use super::Subject;
use super::subject::mixtures;
use particlegs_particles::Particles;

/// Moments of one axis, world units.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct AxisMoments {
    /// Mean position.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Third standardised moment.
    pub skewness: f64,
    /// Fourth standardised moment, 3 for a Gaussian.
    pub kurtosis: f64,
}

/// Sums of mass, m x, m x^2, m x^3, m x^4 about a pivot.
type PowerSums = [f64; 5];

/// Moments along x, y and z. Positions are taken as they are: a periodic box has no other origin.
pub fn axis_moments(subject: Subject<'_>) -> [AxisMoments; 3] {
    // About the middle of the box fourth powers keep their digits.
    let pivot = {
        let d = subject.domain();
        [0, 1, 2].map(|k| d.min[k] + 0.5 * d.length[k])
    };
    let sums = match subject {
        Subject::Particles(p) => of_particles(p, pivot),
        Subject::Model(m) => {
            let mut sums = [PowerSums::default(); 3];
            for (unit, g) in mixtures(m) {
                for i in 0..g.len() {
                    let (mass, cov) = (unit * g.mass_of(i), g.cov_of(i).0);
                    for k in 0..3 {
                        // Raw moments of a Gaussian of mean d and variance v.
                        let (d, v) = (g.mean[k][i] - pivot[k], cov[[0, 3, 5][k]]);
                        let terms =
                            [1.0, d, d * d + v, d * (d * d + 3.0 * v), d.powi(4) + 6.0 * d * d * v + 3.0 * v * v];
                        (0..5).for_each(|t| sums[k][t] += mass * terms[t]);
                    }
                }
            }
            sums
        }
    };
    [0, 1, 2].map(|k| moments(&sums[k], pivot[k]))
}

fn of_particles(p: &Particles, pivot: [f64; 3]) -> [PowerSums; 3] {
    let parts = p.par_chunks(|_, c| {
        let mut sums = [PowerSums::default(); 3];
        for k in 0..3 {
            let origin = p.origin[k] - pivot[k];
            for (i, x) in c.position[k].iter().enumerate() {
                let (d, w) = (f64::from(*x) + origin, c.weight.map_or(1.0, |w| f64::from(w[i])));
                let square = d * d;
                let terms = [1.0, d, square, square * d, square * square];
                (0..5).for_each(|t| sums[k][t] += w * terms[t]);
            }
        }
        sums
    });
    let mut all = [PowerSums::default(); 3];
    parts.iter().for_each(|s| (0..3).for_each(|k| (0..5).for_each(|t| all[k][t] += s[k][t])));
    all
}

fn moments(s: &PowerSums, pivot: f64) -> AxisMoments {
    if s[0] <= 0.0 {
        return AxisMoments { mean: 0.0, deviation: 0.0, skewness: 0.0, kurtosis: 0.0 };
    }
    let [m1, m2, m3, m4] = [1, 2, 3, 4].map(|t| s[t] / s[0]);
    let variance = (m2 - m1 * m1).max(0.0);
    let third = m3 - 3.0 * m1 * m2 + 2.0 * m1.powi(3);
    let fourth = m4 - 4.0 * m1 * m3 + 6.0 * m1 * m1 * m2 - 3.0 * m1.powi(4);
    let over = |v: f64, power: f64| if variance > 0.0 { v / libm::pow(variance, power) } else { 0.0 };
    AxisMoments {
        mean: pivot + m1,
        deviation: variance.sqrt(),
        skewness: over(third, 1.5),
        kurtosis: over(fourth, 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Sym3;

    #[test]
    fn moments_of_particles_and_of_a_mixture() {
        let p = Particles::from_columns(vec![1.0, 2.0, 3.0, 10.0], vec![5.0; 4], vec![0.0, 1.0, 0.0, 1.0]);
        let [x, y, z] = axis_moments(Subject::Particles(&p));
        assert!((x.mean - 4.0).abs() < 1e-12 && (x.deviation - 12.5f64.sqrt()).abs() < 1e-12);
        assert!((x.skewness - 180.0 / 4.0 / 12.5f64.powf(1.5)).abs() < 1e-12);
        assert_eq!((y.mean, y.deviation, y.skewness), (5.0, 0.0, 0.0));
        assert!((z.kurtosis - 1.0).abs() < 1e-12);
        let model = particlegs_particles::testing::model_of(
            &[([3.0, 4.0, 5.0], Sym3([4.0, 0.0, 0.0, 1.0, 0.0, 0.25]), 7.0)],
            [9.0; 3],
        );
        let [x, _, z] = axis_moments(Subject::Model(&model));
        assert!((x.mean - 3.0).abs() < 1e-12 && (x.deviation - 2.0).abs() < 1e-12);
        assert!(x.skewness.abs() < 1e-12 && (z.kurtosis - 3.0).abs() < 1e-9);
    }
}

//! The linear prediction of sizes, and the least squares that find it on the encoder's side.

/// A linear prediction in whole numbers: constant + sum of slopes / 256 times features.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Predictor {
    pub constant: i32,
    pub slopes: [i16; SIZE_SLOPES],
}

pub(crate) const SIZE_SLOPES: usize = 3;

impl Predictor {
    /// Sum of slope times feature, rounded.
    #[inline(always)]
    pub(crate) fn apply(&self, features: [i32; SIZE_SLOPES]) -> i32 {
        let sum: i64 = self.slopes.iter().zip(features).map(|(&a, f)| i64::from(a) * i64::from(f)).sum();
        let sum = (sum + 128) >> 8;
        (sum + i64::from(self.constant)).clamp(-(1 << 21), 1 << 21) as i32
    }
}

/// Slopes and constant that predict `target(i)` from `features(i)`, i in 0 .. n, rounded to what
/// a block holds. Sums in order, so that the same mixture gives the same bytes.
pub(crate) fn fit<const K: usize>(
    n: usize,
    features: impl Fn(usize) -> [f64; K],
    target: impl Fn(usize) -> f64,
) -> Predictor {
    let count = n as f64;
    let mut mean = [0.0; K];
    let mut mean_y = 0.0;
    for i in 0..n {
        let x = features(i);
        for k in 0..K {
            mean[k] += x[k] / count;
        }
        mean_y += target(i) / count;
    }
    let mut a = [[0.0; K]; K];
    let mut b = [0.0; K];
    for i in 0..n {
        let x = features(i);
        let y = target(i) - mean_y;
        for j in 0..K {
            for k in 0..K {
                a[j][k] += (x[j] - mean[j]) * (x[k] - mean[k]);
            }
            b[j] += (x[j] - mean[j]) * y;
        }
    }
    let trace: f64 = (0..K).map(|k| a[k][k]).sum();
    for k in 0..K {
        // A feature that does not vary would leave the system singular.
        a[k][k] += 1e-6 * trace + 1e-3;
    }
    let slopes = solve(a, b);
    let mut p = Predictor::default();
    let mut constant = mean_y;
    for k in 0..K {
        p.slopes[k] = (slopes[k] * 256.0).round().clamp(-32768.0, 32767.0) as i16;
        // With the slopes as they are rounded, so that the constant makes up for that in the mean.
        constant -= f64::from(p.slopes[k]) / 256.0 * mean[k];
    }
    p.constant = constant.round().clamp(-2e9, 2e9) as i32;
    p
}

/// Gaussian elimination of a positive definite system.
fn solve<const K: usize>(mut a: [[f64; K]; K], mut b: [f64; K]) -> [f64; K] {
    for j in 0..K {
        for i in j + 1..K {
            let f = a[i][j] / a[j][j];
            for k in j..K {
                a[i][k] -= f * a[j][k];
            }
            b[i] -= f * b[j];
        }
    }
    for j in (0..K).rev() {
        for k in j + 1..K {
            b[j] -= a[j][k] * b[k];
        }
        b[j] /= a[j][j];
    }
    b
}

/// Plain low bits that leave residuals below `most` steps in the mean to the model.
pub(crate) fn low_bits(residuals: impl Iterator<Item = i32>, most: u64) -> u8 {
    let (mut n, mut sum) = (0u64, 0u64);
    for r in residuals {
        n += 1;
        sum += u64::from(r.unsigned_abs());
    }
    let mean = sum / n.max(1);
    (64 - (mean / most).leading_zeros()).min(15) as u8
}

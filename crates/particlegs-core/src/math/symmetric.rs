//! Symmetric 3x3 matrices in f64.

use super::{cross, dot, each_axis};

/// Variances below this share of a matrix's trace are taken as that where their roots or logarithms are wanted.
const FLATTEST: f64 = 1e-12;

/// A symmetric 3x3 matrix by its upper triangle: xx, xy, xz, yy, yz, zz.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3(pub [f64; 6]);

/// Eigenvalues in descending order with their unit vectors (row `k` belongs to `values[k]`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigen {
    /// Descending.
    pub values: [f64; 3],
    /// Row k is the unit vector of `values[k]`.
    pub vectors: [[f64; 3]; 3],
}

impl Sym3 {
    /// `s` times the identity.
    pub fn scaled_identity(s: f64) -> Self {
        Sym3([s, 0.0, 0.0, s, 0.0, s])
    }

    /// The outer product v v^T.
    pub fn outer(v: [f64; 3]) -> Self {
        Sym3([v[0] * v[0], v[0] * v[1], v[0] * v[2], v[1] * v[1], v[1] * v[2], v[2] * v[2]])
    }

    /// Full rows.
    pub fn rows(&self) -> [[f64; 3]; 3] {
        let m = self.0;
        [[m[0], m[1], m[2]], [m[1], m[3], m[4]], [m[2], m[4], m[5]]]
    }

    /// Sum of the diagonal.
    pub fn trace(&self) -> f64 {
        self.0[0] + self.0[3] + self.0[5]
    }

    /// The element of the diagonal of an axis.
    pub fn variance(&self, axis: usize) -> f64 {
        self.0[[0, 3, 5][axis]]
    }

    /// As a covariance where lengths along an axis are multiplied.
    pub fn stretched(&self, axis: usize, by: f64) -> Sym3 {
        let f: [f64; 3] = each_axis(|k| if k == axis { by } else { 1.0 });
        let [a, b, c, d, e, g] = self.0;
        Sym3([a * f[0] * f[0], b * f[0] * f[1], c * f[0] * f[2], d * f[1] * f[1], e * f[1] * f[2], g * f[2] * f[2]])
    }

    /// Determinant.
    pub fn det(&self) -> f64 {
        let [a, b, c, d, e, f] = self.0;
        a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    }

    /// The inverse, or `None` where the determinant is not positive.
    pub fn inverse(&self) -> Option<Sym3> {
        let [a, b, c, d, e, f] = self.0;
        let det = self.det();
        if det.is_nan() || det <= 0.0 {
            return None;
        }
        let s = 1.0 / det;
        Some(Sym3([
            (d * f - e * e) * s,
            (c * e - b * f) * s,
            (b * e - c * d) * s,
            (a * f - c * c) * s,
            (b * c - a * e) * s,
            (a * d - b * b) * s,
        ]))
    }

    /// v^T M v.
    pub fn quadratic(&self, v: [f64; 3]) -> f64 {
        let m = &self.0;
        m[0] * v[0] * v[0]
            + m[3] * v[1] * v[1]
            + m[5] * v[2] * v[2]
            + 2.0 * (m[1] * v[0] * v[1] + m[2] * v[0] * v[2] + m[4] * v[1] * v[2])
    }

    /// M v.
    pub fn apply(&self, v: [f64; 3]) -> [f64; 3] {
        let r = self.rows();
        each_axis(|i| r[i][0] * v[0] + r[i][1] * v[1] + r[i][2] * v[2])
    }

    /// Every element times `s`.
    pub fn scale(&self, s: f64) -> Sym3 {
        Sym3(self.0.map(|v| v * s))
    }

    /// Element by element sum.
    pub fn add(&self, o: &Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|i| self.0[i] + o.0[i]))
    }

    /// Eigenvalues and vectors by cyclic Jacobi rotations: slow, robust, exact to rounding.
    pub fn eigen(&self) -> Eigen {
        let mut a = self.rows();
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for _ in 0..32 {
            let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
            let on = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
            // Below rounding of the diagonal: further turns change nothing.
            if off <= 1e-17 * on {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut a, &mut v, p, q);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| a[j][j].total_cmp(&a[i][i]));
        Eigen { values: order.map(|k| a[k][k]), vectors: order.map(|k| [v[0][k], v[1][k], v[2][k]]) }
    }

    /// Of a covariance: its three standard deviations, the largest first and none of them 0, and the turn that
    /// takes x, y and z to their axes, as a unit quaternion w, x, y, z.
    pub fn deviations_and_turn(&self) -> ([f64; 3], [f64; 4]) {
        // Scaled first: squares of very small or large lengths keep their digits.
        let size = self.trace().max(f64::MIN_POSITIVE);
        let e = self.scale(1.0 / size).eigen();
        let least = e.values[0].max(f64::MIN_POSITIVE) * FLATTEST;
        let deviations = e.values.map(|v| v.max(least).sqrt() * size.sqrt());
        let [a, b, mut c] = e.vectors;
        // Axes have no sign: a turn has to be right-handed.
        if dot(cross(a, b), c) < 0.0 {
            c = c.map(|v| -v);
        }
        (deviations, quaternion([a, b, c]))
    }

    /// Sum of `values[k]` times the outer products of `vectors[k]`.
    pub fn from_eigen(e: &Eigen) -> Sym3 {
        (0..3).fold(Sym3::default(), |s, k| s.add(&Sym3::outer(e.vectors[k]).scale(e.values[k])))
    }
}

/// The turn whose columns are the axes, by the largest of the four components (Shepperd 1978).
fn quaternion([a, b, c]: [[f64; 3]; 3]) -> [f64; 4] {
    let trace = a[0] + b[1] + c[2];
    let squares = [trace, 2.0 * a[0] - trace, 2.0 * b[1] - trace, 2.0 * c[2] - trace];
    let largest = (0..4).fold(0, |l, k| if squares[k] > squares[l] { k } else { l });
    let twice = (1.0 + squares[largest]).max(0.0).sqrt();
    let over = |v: f64| v / (2.0 * twice.max(f64::MIN_POSITIVE));
    let (x, y, z) = (b[2] - c[1], c[0] - a[2], a[1] - b[0]);
    let (xy, xz, yz) = (a[1] + b[0], a[2] + c[0], b[2] + c[1]);
    let half = 0.5 * twice;
    match largest {
        0 => [half, over(x), over(y), over(z)],
        1 => [over(x), half, over(xy), over(xz)],
        2 => [over(y), over(xy), half, over(yz)],
        _ => [over(z), over(xz), over(yz), half],
    }
}

/// One Jacobi rotation that clears a[p][q].
fn rotate(a: &mut [[f64; 3]; 3], v: &mut [[f64; 3]; 3], p: usize, q: usize) {
    let apq = a[p][q];
    if apq == 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * apq);
    // The smaller of the two roots: it turns by 45 degrees at most.
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    // `signum` tells -0 from 0, which would turn the other way.
    let t = if theta == 0.0 { 1.0 } else { t };
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..3 {
        let (x, y) = (a[k][p], a[k][q]);
        a[k][p] = c * x - s * y;
        a[k][q] = s * x + c * y;
    }
    for k in 0..3 {
        let (x, y) = (a[p][k], a[q][k]);
        a[p][k] = c * x - s * y;
        a[q][k] = s * x + c * y;
    }
    for row in v.iter_mut() {
        let (x, y) = (row[p], row[q]);
        row[p] = c * x - s * y;
        row[q] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigen_rebuilds_the_matrix(m in proptest::array::uniform6(-10.0f64..10.0)) {
            let m = Sym3(m);
            let e = m.eigen();
            let back = Sym3::from_eigen(&e);
            for k in 0..6 {
                prop_assert!((back.0[k] - m.0[k]).abs() < 1e-12 * 30.0);
            }
            prop_assert!(e.values[0] >= e.values[1] && e.values[1] >= e.values[2]);
        }

        #[test]
        fn inverse_undoes(v in proptest::array::uniform6(-1.0f64..1.0)) {
            let m = Sym3::outer([v[0], v[1], v[2]]).add(&Sym3::outer([v[3], v[4], v[5]])).add(&Sym3::scaled_identity(0.1));
            let x = m.inverse().unwrap().apply(m.apply([1.0, 2.0, 3.0]));
            prop_assert!((x[0] - 1.0).abs() + (x[1] - 2.0).abs() + (x[2] - 3.0).abs() < 1e-9);
        }
    }

    /// R S S R^T of a unit quaternion.
    fn covariance(deviations: [f64; 3], [w, x, y, z]: [f64; 4]) -> Sym3 {
        let columns = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        (0..3).fold(Sym3::default(), |s, k| s.add(&Sym3::outer(columns[k]).scale(deviations[k] * deviations[k])))
    }

    #[test]
    fn turns_of_every_kind_are_right() {
        for cov in [[3.0, 2.0, 1.0], [1.0, 2.0, 3.0], [1.0, 3.0, 2.0], [2.0, 3.0, 1.0], [2.0, 1.0, 3.0], [1.0; 3]] {
            for size in [1e-180, 1.0, 1e150] {
                let cov = Sym3([cov[0], 0.1, -0.2, cov[1], 0.3, cov[2]]).scale(size);
                let (deviations, turn) = cov.deviations_and_turn();
                assert!((turn.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
                // Squares of small deviations would lose their digits.
                let back = covariance(deviations.map(|d| d / size.sqrt()), turn);
                assert!((0..6).all(|k| (back.0[k] - cov.0[k] / size).abs() < 1e-12), "{cov:?} {back:?}");
            }
        }
        let (deviations, turn) = Sym3::default().deviations_and_turn();
        assert!(deviations.iter().all(|d| *d > 0.0) && turn.iter().all(|v| v.is_finite()));
    }
}

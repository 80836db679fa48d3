//! The largest eigenvalue of a covariance in closed form, where Jacobi's rotations would take too long.

use particlegs_core::math::Sym3;

/// Largest eigenvalue of a matrix whose eigenvalues have this mean (a third of the trace), and how far
/// they spread about it (their standard deviation over the square root of 2): the trigonometric solution,
/// never too small by more than rounding.
pub(super) fn largest_eigenvalue(m: &Sym3, mean: f64) -> (f64, f64) {
    let [a, b, c, d, e, f] = m.0;
    let squares = (a - mean) * (a - mean) + (d - mean) * (d - mean) + (f - mean) * (f - mean);
    let squares = squares + 2.0 * (b * b + c * c + e * e);
    if squares <= 0.0 {
        return (mean, 0.0);
    }
    let spread = (squares / 6.0).sqrt();
    let shifted = Sym3([a - mean, b, c, d - mean, e, f - mean]).scale(1.0 / spread);
    let angle = libm::acos((0.5 * shifted.det()).clamp(-1.0, 1.0)) / 3.0;
    (mean + 2.0 * spread * libm::cos(angle), spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_largest(m in proptest::array::uniform6(-1.0f64..1.0), unit in -20i32..20) {
            let m = Sym3(m).scale(10f64.powi(unit));
            let e = m.eigen().values;
            let (largest, spread) = largest_eigenvalue(&m, m.trace() / 3.0);
            let size = e.iter().fold(0.0f64, |s, v| s.max(v.abs()));
            prop_assert!((largest - e[0]).abs() < 1e-7 * size);
            let variance = e.iter().map(|v| (v - m.trace() / 3.0).powi(2)).sum::<f64>() / 3.0;
            prop_assert!((spread - (variance / 2.0).sqrt()).abs() < 1e-9 * size);
        }
    }

    #[test]
    fn equal_eigenvalues_are_no_error() {
        assert_eq!(largest_eigenvalue(&Sym3::scaled_identity(3.0), 3.0), (3.0, 0.0));
    }
}

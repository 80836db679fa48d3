//! The exponential of a symmetric trace-free matrix by named operations in a named order, so that every machine gets the
//! same bits (docs/format.md, section 9).

use crate::math::{INVERSE_FACTORIAL, Sym3};

/// Coordinates of a trace-free symmetric matrix in the orthonormal basis of docs/format.md.
pub(crate) fn to_five(m: &Sym3) -> [f64; 5] {
    let [xx, xy, xz, yy, yz, zz] = m.0;
    let (h, s) = (std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::SQRT_2);
    [(xx - yy) * h, (xx + yy - 2.0 * zz) * SQRT_SIXTH, xy * s, xz * s, yz * s]
}

const SQRT_SIXTH: f64 = 0.408_248_290_463_863;

/// exp(2 S) for the trace-free S of five coordinates, each at most 32 in magnitude.
///
/// The Taylor series of 2 S / 2^j to degree 16 on 1, A and A^2 alone (A^3 = c1 A + c0), squared j
/// times.
#[inline(always)]
pub(crate) fn exp_twice(five: [f64; 5]) -> Sym3 {
    let norm2 = five[0] * five[0] + five[1] * five[1] + five[2] * five[2] + five[3] * five[3] + five[4] * five[4];
    let mut j = 0;
    let mut reach = 0.25;
    // Scaled to a norm of at most 1, where degree 16 of the series is enough for f64.
    while norm2 > reach {
        reach *= 4.0;
        j += 1;
    }
    let scale = 2.0 / (1u64 << j) as f64;
    let h = std::f64::consts::FRAC_1_SQRT_2;
    let (a, b) = (five[0] * h * scale, five[1] * SQRT_SIXTH * scale);
    let (xx, yy, zz) = (b + a, b - a, -2.0 * b);
    let (xy, xz, yz) = (five[2] * h * scale, five[3] * h * scale, five[4] * h * scale);
    let square = [
        xx * xx + xy * xy + xz * xz,
        xx * xy + xy * yy + xz * yz,
        xx * xz + xy * yz + xz * zz,
        xy * xy + yy * yy + yz * yz,
        xy * xz + yy * yz + yz * zz,
        xz * xz + yz * yz + zz * zz,
    ];
    let c1 = 0.5 * (square[0] + square[3] + square[5]);
    let c0 = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    // Horner: P = P A + 1/k! on the triple (p, q, r) = p + q A + r A^2.
    let (mut p, mut q, mut r) = (INVERSE_FACTORIAL[16], 0.0, 0.0);
    for k in (0..16).rev() {
        (p, q, r) = (r * c0 + INVERSE_FACTORIAL[k], p + r * c1, q);
    }
    for _ in 0..j {
        let (qr, rr) = (2.0 * q * r, r * r);
        (p, q, r) = (p * p + qr * c0, 2.0 * p * q + qr * c1 + rr * c0, q * q + 2.0 * p * r + rr * c1);
    }
    Sym3([
        p + q * xx + r * square[0],
        q * xy + r * square[1],
        q * xz + r * square[2],
        p + q * yy + r * square[3],
        q * yz + r * square[4],
        p + q * zz + r * square[5],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Eigen;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_twice_is_the_matrix_exponential(five in proptest::array::uniform5(-3.5f64..3.5)) {
            let exponential = exp_twice(five);
            let h = std::f64::consts::FRAC_1_SQRT_2;
            let (a, b) = (five[0] * h, five[1] / 6f64.sqrt());
            let s = Sym3([b + a, five[2] * h, five[3] * h, b - a, five[4] * h, -2.0 * b]);
            let coordinates = to_five(&s);
            for k in 0..5 {
                prop_assert!((coordinates[k] - five[k]).abs() < 1e-14 * 8.0);
            }
            let e = s.eigen();
            let truth = Sym3::from_eigen(&Eigen { values: e.values.map(|v| (2.0 * v).exp()), vectors: e.vectors });
            let size = truth.trace();
            for k in 0..6 {
                prop_assert!((truth.0[k] - exponential.0[k]).abs() < 1e-12 * size, "{truth:?} {exponential:?}");
            }
        }
    }
}

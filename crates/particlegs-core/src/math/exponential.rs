//! The exponential function and whole numbers, in operations that every machine has.

/// 1/k! for k = 0 to 17.
pub(crate) const INVERSE_FACTORIAL: [f64; 18] = {
    let mut f = [1.0; 18];
    let mut product = 1.0;
    let mut k = 1;
    while k < 18 {
        product *= k as f64;
        f[k] = 1.0 / product;
        k += 1;
    }
    f
};

/// Adding and taking this away rounds a small number to the nearest whole one, ties to even.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// e^x for |x| <= 700 (clamped), to 4e-16: k = x / ln 2 rounded, Taylor to degree 13 of the rest. The same bits on every
/// machine (docs/format.md, section 9), and quick where the compiler makes vectors of it.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let x = x.clamp(-700.0, 700.0);
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
    let k = shifted - ROUNDER;
    // ln 2 in two parts: the first has 32 bits, so that k times it is exact.
    let r = (x - k * 0.693_147_180_369_123_8) - k * 1.908_214_929_270_587_7e-10;
    let mut p = INVERSE_FACTORIAL[13];
    for i in (0..13).rev() {
        p = p * r + INVERSE_FACTORIAL[i];
    }
    // 2^k by its exponent, from the low bits of `shifted`: k is at most 1010 in size, so that it is no subnormal number.
    p * f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52)
}

/// The largest whole number that is not above `x`, for |x| below 2^51; larger numbers may come back one off. `f64::floor` is
/// a function call for the processors that a default build is made for.
#[inline(always)]
pub fn floor(x: f64) -> f64 {
    let nearest = (x + ROUNDER) - ROUNDER;
    // No branch: one that goes either way costs more than all the rest.
    nearest - f64::from(u8::from(nearest > x))
}

/// [`floor`] as an index, below 2^51 in size.
#[inline(always)]
pub fn floor_index(x: f64) -> i64 {
    let shifted = x + ROUNDER;
    shifted.to_bits().wrapping_sub(ROUNDER.to_bits()) as i64 - i64::from(shifted - ROUNDER > x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_is_exp(x in -690.0f64..690.0) {
            prop_assert!((exp(x) / x.exp() - 1.0).abs() < 4e-16);
        }
    }

    #[test]
    fn floor_is_floor() {
        for x in [0.0, -0.0, 0.5, -0.5, 1.5, 2.5, -1e-300, 0.999_999_999_999_999_9, -1e9 - 0.25, 2f64.powi(50) + 0.75] {
            assert_eq!(floor(x), x.floor());
            assert_eq!(floor(-x), (-x).floor());
            assert_eq!([x, -x].map(floor_index), [x, -x].map(|x| x.floor() as i64));
        }
        assert!(floor(f64::NAN).is_nan() && floor(f64::INFINITY) == f64::INFINITY);
    }

    #[test]
    fn exp_keeps_its_ends() {
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(1e300).is_finite() && exp(-1e300) > 0.0);
    }
}

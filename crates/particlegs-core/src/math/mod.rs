//! Small mathematics that every module uses: vectors in space, symmetric 3x3 matrices, random draws that
//! do not depend on order, and functions of whole vectors of numbers.

mod exponential;
mod random;
mod sphere;
mod symmetric;
mod vector;

pub(crate) use exponential::INVERSE_FACTORIAL;
pub use exponential::{exp, floor, floor_index};
pub use random::{Purpose, Random};
pub use sphere::{Ball, GaussianInSphere, Rules};
pub use symmetric::{Eigen, Sym3};
pub use vector::{Matrix, across, add_product, exp2};

/// A value for each axis: x, y and z are 0, 1 and 2. A plain array: `std::array::from_fn` takes the compiler
/// six functions for every closure, and vectors of three are made in hundreds of places.
#[inline(always)]
pub fn each_axis<T>(mut value_of: impl FnMut(usize) -> T) -> [T; 3] {
    [value_of(0), value_of(1), value_of(2)]
}

/// The scalar product.
#[inline(always)]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The length, scaled so that coordinates of 1e-200 or 1e200 neither underflow nor overflow.
pub fn norm(a: [f64; 3]) -> f64 {
    let m = a[0].abs().max(a[1].abs()).max(a[2].abs());
    if m == 0.0 || !m.is_finite() {
        return m;
    }
    m * a.map(|v| (v / m) * (v / m)).iter().sum::<f64>().sqrt()
}

/// Whether float32 holds numbers between two so that each is told from those that lie a thousandth of the range away.
pub fn float32_holds([least, largest]: [f64; 2]) -> bool {
    let size = least.abs().max(largest.abs());
    let (range, step) = (largest - least, size * f64::from(f32::EPSILON));
    (size == 0.0 || (1e-30..1e38).contains(&size)) && (range == 0.0 || step < 1e-3 * range)
}

/// The power of two by which numbers of at most this size become so small that float32 holds their squares; 1 where it
/// holds them anyway.
pub fn float32_scale(largest: f64) -> f64 {
    match largest {
        _ if !largest.is_finite() || largest == 0.0 || (1e-12..1e15).contains(&largest) => 1.0,
        _ => libm::ldexp(1.0, -libm::frexp(largest).1),
    }
}

/// The share of a Gaussian of deviation `s` below `x`, to 1e-7 (Abramowitz and Stegun 7.1.26):
/// a grid's cell needs no more, and it is called a hundred times a Gaussian.
pub fn normal_share(x: f64, s: f64) -> f64 {
    if s <= 0.0 {
        return if x > 0.0 { 1.0 } else { 0.0 };
    }
    let z = (x / s).abs() * std::f64::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let upper = 0.5 * poly * libm::exp(-z * z);
    if x > 0.0 { 1.0 - upper } else { upper }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn float32_holds_what_it_tells_apart() {
        for range in [[0.0, 0.0], [-1.0, 1.0], [0.1, 0.1], [1e4, 1e8], [1e-30, 1e-25], [-1e8, 1.0], [3e5, 3e5 + 100.0]]
        {
            assert!(float32_holds(range), "{range:?}");
        }
        for range in [[1e40, 1e46], [-1e39, 0.0], [1e-60, 1e-50], [-1e8 - 1.0, -1e8 + 1.0], [0.0, f64::INFINITY]] {
            assert!(!float32_holds(range), "{range:?}");
        }
        assert_eq!([0.0, 1.0, 1e8, f64::NAN].map(float32_scale), [1.0; 4]);
        assert!([1e46, 1e-40, 1e300].iter().all(|v| (0.5..=1.0).contains(&(v * float32_scale(*v)))));
    }
}

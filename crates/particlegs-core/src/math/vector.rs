//! Functions of whole vectors: the same operations in the same order at every SIMD level.

use fearless_simd::{Simd, f32x16, prelude::*, u32x16};

/// 2^t for t in [-120, 120] (others are cut to it), relative error below 3e-7.
#[inline(always)]
pub fn exp2<S: Simd>(simd: S, t: f32x16<S>) -> f32x16<S> {
    // 1.5 * 2^23: adding it leaves the rounded integer in the low bits.
    const MAGIC: f32 = 12_582_912.0;
    let t = t.max(f32x16::splat(simd, -120.0)).min(f32x16::splat(simd, 120.0));
    let shifted = t + MAGIC;
    let f = t - (shifted - MAGIC);
    // Minimax of 2^f on [-1/2, 1/2].
    let p = f * 1.540_353e-4 + 1.333_355_8e-3;
    let p = p * f + 9.618_129e-3;
    let p = p * f + 5.550_411e-2;
    let p = p * f + 0.240_226_5;
    let p = p * f + std::f32::consts::LN_2;
    let p = p * f + 1.0;
    let bits: u32x16<S> = p.to_bits() + (shifted.to_bits() << 23);
    f32x16::from_bits(bits)
}

/// A matrix in memory.
#[derive(Clone, Copy)]
pub struct Matrix<'a> {
    /// Its values, the first one first.
    pub data: &'a [f32],
    /// Values from row to row and from column to column.
    pub step: [usize; 2],
}

impl Matrix<'_> {
    #[inline(always)]
    fn rows_from(self, row: usize) -> Self {
        Matrix { data: &self.data[row * self.step[0]..], ..self }
    }
}

/// `c += a b`: `a` is m x k, `b` is k x n, `c` is m x n, the last two row by row without gaps; n a
/// multiple of 16.
#[inline(always)]
pub fn add_product<S: Simd>(simd: S, [m, n, k]: [usize; 3], a: Matrix<'_>, b: &[f32], c: &mut [f32]) {
    let full = m - m % 4;
    for column in (0..n).step_by(16) {
        for row in (0..full).step_by(4) {
            block::<S, 4>(simd, [n, k], a.rows_from(row), &b[column..], &mut c[row * n + column..]);
        }
        for row in full..m {
            block::<S, 1>(simd, [n, k], a.rows_from(row), &b[column..], &mut c[row * n + column..]);
        }
    }
}

/// R rows of 16 columns.
#[inline(always)]
fn block<S: Simd, const R: usize>(simd: S, [n, k]: [usize; 2], a: Matrix<'_>, b: &[f32], c: &mut [f32]) {
    let mut sum: [f32x16<S>; R] = std::array::from_fn(|r| f32x16::from_slice(simd, &c[r * n..r * n + 16]));
    for i in 0..k {
        let row = f32x16::from_slice(simd, &b[i * n..i * n + 16]);
        for (r, sum) in sum.iter_mut().enumerate() {
            *sum += row * a.data[r * a.step[0] + i * a.step[1]];
        }
    }
    for (r, sum) in sum.into_iter().enumerate() {
        sum.store_slice(&mut c[r * n..r * n + 16]);
    }
}

/// Sum over the lanes, halves onto halves.
#[inline(always)]
pub fn across(l: &[f32; 16]) -> f32 {
    let a: [f32; 8] = std::array::from_fn(|i| l[i] + l[i + 8]);
    let b: [f32; 4] = std::array::from_fn(|i| a[i] + a[i + 4]);
    (b[0] + b[2]) + (b[1] + b[3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_and_products() {
        let level = fearless_simd::Level::new();
        fearless_simd::dispatch!(level, simd => {
            let x: [f32; 16] = std::array::from_fn(|i| 3.7 * i as f32 - 30.1);
            let powers: [f32; 16] = exp2(simd, f32x16::from_slice(simd, &x)).into();
            for (x, y) in x.iter().zip(powers) {
                assert!((f64::from(y) / f64::from(*x).exp2() - 1.0).abs() < 4e-7);
            }
            let a: Vec<f32> = (0..15).map(|i| i as f32).collect();
            let b: Vec<f32> = (0..48).map(|i| (i % 7) as f32).collect();
            let mut c = vec![1.0f32; 80];
            add_product(simd, [5, 16, 3], Matrix { data: &a, step: [3, 1] }, &b, &mut c);
            for (r, q) in (0..5).flat_map(|r| (0..16).map(move |q| (r, q))) {
                let law = 1.0 + (0..3).map(|i| a[r * 3 + i] * b[i * 16 + q]).sum::<f32>();
                assert_eq!(c[r * 16 + q], law);
            }
        });
    }
}

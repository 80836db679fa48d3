//! 1 - SSIM as 3-D Gaussian splatting takes it (Kerbl et al. 2023): a Gaussian window of 11 pixels,
//! sigma 1.5, pictures continued with zeros, K1 0.01, K2 0.03, data range 1; and its gradient.

use particlegs_core::parallel;
use particlegs_core::picture::{Plane, Size};

const HALF: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f32 = 1e-4;
const C2: f32 = 9e-4;

/// The loss of one picture.
pub(crate) struct LossValue {
    pub value: f64,
    /// Change with the brightness of each pixel.
    pub gradient: Plane,
}

/// The mean over all pixels of 1 - SSIM, and its change with each pixel of `a`.
pub(super) fn dssim(a: &Plane, b: &Plane) -> LossValue {
    let size = a.size;
    let product = |p: &Plane, q: &Plane| p.data.iter().zip(&q.data).map(|(x, y)| x * y).collect::<Vec<f32>>();
    let [ma, mb] = [&a.data, &b.data].map(|p| blur(p, size));
    let [aa, bb, ab] = [product(a, a), product(b, b), product(a, b)].map(|p| blur(&p, size));
    let n = size.pixels();
    let mut value = 0.0f64;
    // Changes of SSIM with the blurred a, a^2 and ab.
    let (mut by_mean, mut by_square, mut by_product) = (vec![0.0f32; n], vec![0.0f32; n], vec![0.0f32; n]);
    for i in 0..n {
        let (x, y) = (ma[i], mb[i]);
        let (vx, vy, cxy) = (aa[i] - x * x, bb[i] - y * y, ab[i] - x * y);
        let (l, s) = (2.0 * x * y + C1, 2.0 * cxy + C2);
        let (dl, ds) = (x * x + y * y + C1, vx + vy + C2);
        let inverse = 1.0 / (dl * ds);
        let ssim = l * s * inverse;
        value += f64::from(1.0 - ssim);
        by_product[i] = 2.0 * l * inverse;
        by_square[i] = -ssim / ds;
        by_mean[i] = 2.0 * y * (s - l) * inverse - 2.0 * x * ssim * (1.0 / dl - 1.0 / ds);
    }
    let [by_mean, by_square, by_product] = [by_mean, by_square, by_product].map(|p| blur(&p, size));
    let scale = -1.0 / n as f32;
    let gradient =
        (0..n).map(|i| scale * (by_mean[i] + 2.0 * a.data[i] * by_square[i] + b.data[i] * by_product[i])).collect();
    LossValue { value: value / n as f64, gradient: Plane { size, data: gradient } }
}

/// The window's weighted mean about every pixel; symmetric, so its own transpose.
fn blur(p: &[f32], size: Size) -> Vec<f32> {
    let weights: [f32; HALF + 1] = {
        let g: [f64; HALF + 1] = std::array::from_fn(|k| (-((k * k) as f64) / (2.0 * SIGMA * SIGMA)).exp());
        let sum = g[0] + 2.0 * g[1..].iter().sum::<f64>();
        g.map(|v| (v / sum) as f32)
    };
    let Size { width, height } = size;
    let mut across = vec![0.0f32; p.len()];
    parallel::for_each(across.chunks_mut(width).zip(p.chunks(width)), |(out, row)| {
        for (i, o) in out.iter_mut().enumerate() {
            let at = |j: Option<usize>| j.and_then(|j| row.get(j)).copied().unwrap_or(0.0);
            *o = weights[0] * row[i]
                + (1..=HALF).map(|k| weights[k] * (at(i.checked_sub(k)) + at(Some(i + k)))).sum::<f32>();
        }
    });
    let mut out = vec![0.0f32; p.len()];
    parallel::for_each_chunk(&mut out, width, |j, out| {
        let mut add = |row: usize, w: f32| {
            out.iter_mut().zip(&across[row * width..(row + 1) * width]).for_each(|(o, v)| *o += w * v);
        };
        for row in j.saturating_sub(HALF)..(j + HALF + 1).min(height) {
            add(row, weights[row.abs_diff(j)]);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_lose_nothing() {
        let size = Size { width: 20, height: 12 };
        let a = Plane { size, data: (0..240).map(|i| (i % 7) as f32 / 7.0).collect() };
        let loss = dssim(&a, &a);
        assert!(loss.value.abs() < 1e-6);
        assert!(loss.gradient.data.iter().all(|g| g.abs() < 1e-5));
    }
}

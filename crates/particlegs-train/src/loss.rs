//! The loss of a drawn picture against its target, and its gradient with every pixel.
//!
//! The published loss is the mean absolute difference over the content mask (paper equation 5):
//! pixels that are lit in either picture. To it, L2 and the mixture with DSSIM of 3-D Gaussian
//! splatting (Kerbl et al. 2023, equation 7) are the ablations.

use fearless_simd::{Level, dispatch};
use particlegs_core::parallel;
use particlegs_core::picture::{MASK_LEVEL, Plane, Size};

/// Pixels in one step of parallel work; fixed, so that sums do not depend on threads.
const RUN: usize = 1 << 14;

/// The difference of two pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Norm {
    L1,
    L2,
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Loss {
    /// Difference of pixels.
    pub norm: Norm,
    /// The absolute difference is rounded off below this difference: sqrt(d^2 + s^2) - s. 0 = not.
    pub smooth: f64,
    /// Lambda: share of 1 - SSIM.
    pub dssim: f64,
    /// Whether the logarithm of the loss is taken, so that faint and bright views weigh alike.
    pub logarithm: bool,
}

impl Loss {
    pub const PUBLISHED: Loss = Loss { norm: Norm::L1, smooth: 0.0, dssim: 0.0, logarithm: false };

    /// Compares brightnesses in [0, 1] of two pictures of one size. No lit pixel: the loss is 0.
    pub(crate) fn evaluate(&self, drawn: &Plane, target: &Plane, simd: Level) -> LossValue {
        assert_eq!(drawn.size, target.size, "pictures of one size");
        let mut gradient = Plane::zeros(drawn.size);
        let runs = gradient.data.chunks_mut(RUN).zip(drawn.data.chunks(RUN).zip(target.data.chunks(RUN)));
        let runs = parallel::map(runs, |(g, (a, b))| self.run(a, b, g, simd));
        let (sum, lit) = runs.into_iter().fold((0.0, 0), |(s, n), r| (s + r.0, n + r.1));
        let pixels = (lit as f64).max(1.0);
        let mut value = sum / pixels * (1.0 - self.dssim);
        let mut scale = (1.0 - self.dssim) / pixels;
        let structure = (self.dssim > 0.0).then(|| dssim(drawn, target));
        if let Some(s) = &structure {
            value += self.dssim * s.value;
        }
        // d ln v = dv / v: one factor for the whole gradient.
        let log_scale = if self.logarithm && value > 0.0 { 1.0 / value } else { 1.0 };
        scale *= log_scale;
        gradient.data.iter_mut().for_each(|g| *g *= scale as f32);
        if let Some(s) = structure {
            let share = (self.dssim * log_scale) as f32;
            gradient.data.iter_mut().zip(&s.gradient.data).for_each(|(g, s)| *g += share * s);
        }
        let value = if self.logarithm && value > 0.0 { value.ln() } else { value };
        LossValue { value, gradient }
    }

    /// Sum of differences over lit pixels, their number, and the change with each pixel.
    fn run(&self, drawn: &[f32], target: &[f32], gradient: &mut [f32], simd: Level) -> (f64, u64) {
        dispatch!(simd, _simd => match self.norm {
            Norm::L2 => differences(drawn, target, gradient, |d| (d * d, 2.0 * d)),
            Norm::L1 if self.smooth > 0.0 => {
                let smooth = self.smooth as f32;
                differences(drawn, target, gradient, |d| {
                    let root = (d * d + smooth * smooth).sqrt();
                    (root - smooth, d / root)
                })
            }
            Norm::L1 => differences(drawn, target, gradient, |d| (d.abs(), if d == 0.0 { 0.0 } else { d.signum() })),
        })
    }
}

/// [`Loss::run`] for a value and slope of differences; sixteen sums, so that it goes sixteen at a time.
#[inline(always)]
fn differences(
    drawn: &[f32],
    target: &[f32],
    gradient: &mut [f32],
    norm: impl Fn(f32) -> (f32, f32) + Copy,
) -> (f64, u64) {
    const LANES: usize = 16;
    const LIT: f32 = (MASK_LEVEL / 255.0) as f32;
    let (mut sums, mut lit) = ([0.0f64; LANES], [0u32; LANES]);
    let mut lane = |k: usize, a: f32, b: f32| {
        // Not the negation: a pixel that is not a number shows in the loss.
        let dark = a <= LIT && b <= LIT;
        let (value, slope) = norm(a - b);
        sums[k] += f64::from(if dark { 0.0 } else { value });
        lit[k] += u32::from(!dark);
        if dark { 0.0 } else { slope }
    };
    let ((a, a_rest), (b, b_rest)) = (drawn.as_chunks::<LANES>(), target.as_chunks::<LANES>());
    let (g, g_rest) = gradient.as_chunks_mut::<LANES>();
    for ((a, b), g) in a.iter().zip(b).zip(g) {
        for k in 0..LANES {
            g[k] = lane(k, a[k], b[k]);
        }
    }
    for (k, ((a, b), g)) in a_rest.iter().zip(b_rest).zip(g_rest).enumerate() {
        *g = lane(k, *a, *b);
    }
    (sums.iter().sum(), lit.iter().map(|&n| u64::from(n)).sum())
}

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

/// The mean over all pixels of 1 - SSIM as 3-D Gaussian splatting takes it (Kerbl et al. 2023), and its change with
/// each pixel of `a`: a Gaussian window of 11 pixels, sigma 1.5, pictures continued with zeros, K1 0.01, K2 0.03, data
/// range 1.
fn dssim(a: &Plane, b: &Plane) -> LossValue {
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
        // The mean changes the variance and the covariance too, since these are E[x^2] - x^2 and E[x y] - x y.
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
    use particlegs_core::math::Random;
    use particlegs_core::picture::Size;

    fn planes(seed: u64) -> (Plane, Plane) {
        let size = Size { width: 23, height: 17 };
        let mut draw = Random::new(seed, 0, 0);
        let mut plane = || Plane { size, data: (0..size.pixels()).map(|_| draw.uniform() as f32).collect() };
        (plane(), plane())
    }

    /// The gradient along random directions against differences of the value.
    fn check(loss: Loss) {
        let (a, b) = planes(3);
        let evaluation = loss.evaluate(&a, &b, Level::new());
        for k in 0..4 {
            let mut draw = Random::new(9, 0, k);
            let along: Vec<f32> = a.data.iter().map(|_| draw.normal() as f32).collect();
            let at = |step: f32| {
                let data = a.data.iter().zip(&along).map(|(v, d)| v + step * d).collect();
                loss.evaluate(&Plane { size: a.size, data }, &b, Level::new()).value
            };
            let h = 2e-4;
            let numeric = (at(h) - at(-h)) / f64::from(2.0 * h);
            let exact: f64 = evaluation.gradient.data.iter().zip(&along).map(|(g, d)| f64::from(g * d)).sum();
            assert!((numeric - exact).abs() < 2e-3 * (1.0 + exact.abs()), "{loss:?}: {numeric} for {exact}");
        }
    }

    #[test]
    fn gradients_are_differences() {
        check(Loss { smooth: 0.05, ..Loss::PUBLISHED });
        check(Loss { norm: Norm::L2, ..Loss::PUBLISHED });
        check(Loss { norm: Norm::L2, dssim: 0.4, ..Loss::PUBLISHED });
        check(Loss { norm: Norm::L2, dssim: 1.0, logarithm: true, ..Loss::PUBLISHED });
    }

    #[test]
    fn darkness_does_not_count() {
        let (mut a, mut b) = planes(4);
        let half = Loss::PUBLISHED.evaluate(&a, &b, Level::new()).value;
        let size = Size { width: a.size.width, height: 2 * a.size.height };
        a.size = size;
        b.size = size;
        a.data.resize(size.pixels(), 0.009);
        b.data.resize(size.pixels(), 0.001);
        assert!((Loss::PUBLISHED.evaluate(&a, &b, Level::new()).value - half).abs() < 1e-9);
        assert_eq!(Loss::PUBLISHED.evaluate(&Plane::zeros(size), &Plane::zeros(size), Level::new()).value, 0.0);
    }

    #[test]
    fn equal_pictures_lose_nothing() {
        let size = Size { width: 20, height: 12 };
        let a = Plane { size, data: (0..240).map(|i| (i % 7) as f32 / 7.0).collect() };
        let loss = dssim(&a, &a);
        assert!(loss.value.abs() < 1e-6);
        assert!(loss.gradient.data.iter().all(|g| g.abs() < 1e-5));
    }
}

//! The loss of a drawn picture against its target, and its gradient with every pixel.
//!
//! The published loss is the mean absolute difference over the content mask (paper equation 5):
//! pixels that are lit in either picture. To it, L2 and the mixture with DSSIM of 3-D Gaussian
//! splatting (Kerbl et al. 2023, equation 7) are the ablations.

use super::dssim::{LossValue, dssim};
use fearless_simd::{Level, dispatch};
use particlegs_core::parallel;
use particlegs_core::picture::{MASK_LEVEL, Plane};

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
}

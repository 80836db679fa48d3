//! FXAA's effect on the mean of a noisy picture: on shot noise it is a noise filter that darkens
//! faint pictures (docs/law/fxaa.md).

/// Opacities, splat radii (pixels) and optical depths of [`RATIO`].
const OPACITY: [f64; 4] = [0.0125, 0.05, 0.2, 0.5];
const RADIUS: [f64; 7] = [0.1, 0.2, 0.3, 0.45, 0.7, 1.0, 2.0];
const TAU: [f64; 6] = [0.01, 0.03, 0.1, 0.3, 1.0, 3.0];

/// Mean level with FXAA over the mean level without, `[opacity][radius][tau]`, on uniform random
/// sheets drawn by VTK: opacity 0.05 was measured at most radii, the others at 0.3 pixels. The rest
/// is estimated: other radii scale the loss as opacity 0.05 does, and some cells of opacities
/// 0.0125, 0.2 and 0.5 have no measurement behind them.
#[rustfmt::skip]
const RATIO: [[[f64; TAU.len()]; RADIUS.len()]; OPACITY.len()] = [
    [
        [0.970, 0.983, 0.996, 1.000, 1.000, 1.000],
        [0.971, 0.984, 0.997, 1.000, 1.000, 1.000],
        [0.970, 0.983, 0.996, 1.000, 1.000, 1.000],
        [0.978, 0.984, 0.996, 1.000, 1.000, 1.000],
        [0.991, 0.991, 0.997, 1.000, 1.000, 1.000],
        [0.997, 0.997, 0.998, 1.000, 1.000, 1.000],
        [1.000, 1.000, 1.000, 1.000, 1.000, 1.000],
    ],
    [
        [0.859, 0.908, 0.984, 0.998, 1.001, 1.000],
        [0.861, 0.910, 0.984, 0.998, 1.001, 1.000],
        [0.858, 0.907, 0.982, 0.998, 1.001, 1.000],
        [0.895, 0.914, 0.983, 0.999, 1.001, 1.000],
        [0.956, 0.952, 0.987, 0.998, 1.001, 1.000],
        [0.988, 0.983, 0.992, 0.999, 1.001, 1.000],
        [1.000, 0.999, 0.999, 1.000, 1.000, 1.000],
    ],
    [
        [0.582, 0.696, 0.891, 0.988, 1.006, 1.001],
        [0.588, 0.700, 0.896, 0.988, 1.006, 1.001],
        [0.580, 0.690, 0.880, 0.988, 1.006, 1.001],
        [0.689, 0.714, 0.885, 0.990, 1.005, 1.001],
        [0.871, 0.839, 0.915, 0.994, 1.003, 1.000],
        [0.965, 0.942, 0.948, 0.996, 1.002, 1.000],
        [1.000, 0.996, 0.992, 0.999, 1.000, 1.000],
    ],
    [
        [0.502, 0.570, 0.772, 0.947, 1.016, 1.005],
        [0.510, 0.577, 0.782, 0.947, 1.016, 1.005],
        [0.500, 0.562, 0.750, 0.947, 1.016, 1.005],
        [0.629, 0.596, 0.760, 0.958, 1.013, 1.004],
        [0.846, 0.773, 0.823, 0.974, 1.008, 1.002],
        [0.958, 0.919, 0.892, 0.984, 1.005, 1.002],
        [1.000, 0.994, 0.983, 0.997, 1.001, 1.000],
    ],
];

/// FXAA leaves a neighbourhood alone where it spans less than this share of white.
const HARD_THRESHOLD: f64 = 0.045;

/// Mean with FXAA over mean without, for one opacity and splat radius, against depth.
#[derive(Clone, Debug)]
pub struct FxaaMean {
    ratio: [f32; TAU.len()],
    log2_tau: [f32; TAU.len()],
}

impl FxaaMean {
    /// The curve of one opacity in (0, 1] and splat radius in pixels.
    pub fn new(opacity: f64, radius_px: f64) -> Self {
        let (r, s) = locate(&RADIUS, radius_px);
        let at = |o: usize, t: usize| RATIO[o][r][t] + s * (RATIO[o][r + 1][t] - RATIO[o][r][t]);
        let (o, w) = locate(&OPACITY, opacity);
        let ratio = std::array::from_fn(|t| {
            // Single fragments cannot reach the threshold where the opacity is far below it.
            let fade = (opacity / OPACITY[0]).min(1.0);
            let loss = 1.0 - (at(o, t) + w * (at(o + 1, t) - at(o, t)));
            // Beyond the largest radius neighbours are nearly equal and FXAA rests.
            let rest = (RADIUS[RADIUS.len() - 1] / radius_px).min(1.0);
            (1.0 - loss * fade * (rest * rest)) as f32
        });
        FxaaMean { ratio, log2_tau: TAU.map(|t| libm::log2(t) as f32) }
    }

    /// The curve: the logarithms to base 2 of rising depths, and its factors there.
    pub fn nodes(&self) -> (&[f32], &[f32]) {
        (&self.log2_tau, &self.ratio)
    }

    /// The factor on the mean level at optical depth `tau`; the ends of the table hold beyond it.
    #[inline]
    pub fn ratio(&self, tau: f32) -> f32 {
        let x = libm::log2f(tau);
        let last = self.ratio.len() - 1;
        if x.is_nan() || x <= self.log2_tau[0] {
            return self.ratio[0];
        }
        match self.log2_tau.iter().position(|&t| x < t) {
            None => self.ratio[last],
            Some(i) => {
                let t = (x - self.log2_tau[i - 1]) / (self.log2_tau[i] - self.log2_tau[i - 1]);
                self.ratio[i - 1] + t * (self.ratio[i] - self.ratio[i - 1])
            }
        }
    }
}

/// Interval and position within it, in logarithms, of `x` in a rising grid; clamped to its ends.
fn locate(grid: &[f64], x: f64) -> (usize, f64) {
    let i = grid[1..grid.len() - 1].iter().take_while(|&&g| x >= g).count();
    let t = libm::log(x / grid[i]) / libm::log(grid[i + 1] / grid[i]);
    (i, if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) })
}

/// Share that either neighbour takes of a pixel's mean level along one axis: FXAA blends noisy
/// pixels with their 3x3 mean, so it blurs. A Gaussian of 0.4 pixels while splats are smaller than
/// a pixel (docs/law/fxaa.md, "The blur"), none for splats of two pixels, whose noise is smooth, nor for
/// single fragments below the threshold.
pub fn fxaa_blur(opacity: f64, radius_px: f64) -> f32 {
    const TAP: f64 = 0.0404;
    let small = (libm::log2(2.0 / radius_px) / 2.0).clamp(0.0, 1.0);
    let loud = (opacity / HARD_THRESHOLD).min(1.0);
    (TAP * small * loud) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reproduces_its_nodes() {
        assert!((FxaaMean::new(0.05, 0.3).ratio(0.03) - 0.907).abs() < 1e-3);
        assert!((FxaaMean::new(0.05, 0.1).ratio(1e-4) - 0.859).abs() < 1e-3);
        assert!((FxaaMean::new(0.5, 0.3).ratio(0.1) - 0.75).abs() < 1e-3);
    }

    #[test]
    fn rests_where_there_is_no_noise() {
        assert!((FxaaMean::new(0.05, 40.0).ratio(0.03) - 1.0).abs() < 1e-4);
        assert!((FxaaMean::new(1e-4, 0.1).ratio(0.03) - 1.0).abs() < 1e-3);
        assert_eq!(FxaaMean::new(0.05, 0.3).ratio(f32::INFINITY), 1.0);
        assert_eq!(fxaa_blur(0.05, 3.0), 0.0);
    }
}

//! From optical depth to grey levels: the tone curve of each look.

use crate::parallel;
use crate::picture::{Gray8, Plane, PlaneRows};
use crate::splat::{FxaaMean, Response, ToneStyle, fxaa_blur};
use std::sync::{Arc, OnceLock};

/// Grey levels of a noise-free plane of optical depth (the opacity integral, A1 of
/// docs/law/depth.md), of all particles or of a model.
///
/// `opacity` in (0, 1] and `radius_px`, the splat radius in pixels at the focal point, say how
/// noisy ParaView's picture would be and so what its rounding and FXAA do to the mean.
/// Results do not depend on the number of threads.
pub fn tone(tau: &Plane, style: ToneStyle, opacity: f64, radius_px: f64) -> Gray8 {
    Tones::new(opacity, radius_px).of(tau, style)
}

/// The response of one opacity, made where a style first needs it: that takes milliseconds.
#[derive(Debug)]
pub(super) struct LazyResponse {
    opacity: f64,
    curve: OnceLock<Response>,
}

impl LazyResponse {
    /// That of an opacity; `previous` where it is of the same.
    pub(super) fn new(opacity: f64, previous: Option<&Arc<LazyResponse>>) -> Arc<LazyResponse> {
        match previous.filter(|p| p.opacity.to_bits() == opacity.to_bits()) {
            Some(previous) => previous.clone(),
            None => Arc::new(LazyResponse { opacity, curve: OnceLock::new() }),
        }
    }
}

/// The tone curves of one opacity and splat radius.
pub struct Tones {
    radius_px: f64,
    response: Arc<LazyResponse>,
}

impl Tones {
    /// The curves that [`tone`] has for these.
    pub fn new(opacity: f64, radius_px: f64) -> Self {
        Tones::with_response(LazyResponse::new(opacity, None), radius_px)
    }

    pub(super) fn with_response(response: Arc<LazyResponse>, radius_px: f64) -> Self {
        Tones { radius_px, response }
    }

    /// [`tone`] in a look.
    pub fn of(&self, tau: &Plane, style: ToneStyle) -> Gray8 {
        let mut out = Gray8::black(tau.size);
        self.rows(tau.clone().rows(), style, &mut out.data);
        out
    }

    /// [`tone`] of rows, which are overwritten, into `out`.
    pub(super) fn rows(&self, mut tau: PlaneRows<'_>, style: ToneStyle, out: &mut [u8]) {
        let opacity = self.response.opacity;
        let response = || self.response.curve.get_or_init(|| Response::new(opacity));
        match style {
            ToneStyle::Expected => per_pixel(&tau, out, |t| 255.0 * -libm::expm1f(-t)),
            ToneStyle::ParaviewNoFxaa => {
                let response = response();
                per_pixel(&tau, out, |t| response.level(t));
            }
            ToneStyle::Paraview => {
                let mean = FxaaMean::new(opacity, self.radius_px);
                let curve = response().scaled(|tau| mean.ratio(tau));
                // Levels are blurred, not depths: FXAA works on the finished picture.
                tau.each(|_, row| row.iter_mut().for_each(|t| *t = curve.level(*t)));
                blurred(&tau, fxaa_blur(opacity, self.radius_px), out);
            }
        }
    }
}

/// A level rounded to even, NaN to black. The sum has the rounded number in its last bits, and is vectorised where a call
/// of `round_ties_even` is not.
fn rounded(level: f32) -> u8 {
    const LAST_BITS: f32 = 8_388_608.0;
    // Not `clamp`, which keeps NaN.
    #[expect(clippy::manual_clamp)]
    let level = level.max(0.0).min(255.0);
    (level + LAST_BITS).to_bits() as u8
}

fn per_pixel(tau: &PlaneRows<'_>, out: &mut [u8], curve: impl Fn(f32) -> f32 + Send + Sync) {
    parallel::for_each_chunk(out, tau.size.width.max(1), |j, out| {
        out.iter_mut().zip(tau.row(j)).for_each(|(o, &t)| *o = rounded(curve(t)));
    });
}

/// Levels with `tap` of either neighbour mixed in along both axes (edges repeated), rounded.
fn blurred(levels: &PlaneRows<'_>, tap: f32, out: &mut [u8]) {
    let (w, h) = (levels.size.width, levels.size.height);
    let center = 1.0 - 2.0 * tap;
    parallel::for_each_chunk_with(out, w.max(1), Vec::new, |column, y, out| {
        let (above, here, below) = (levels.row(y.saturating_sub(1)), levels.row(y), levels.row((y + 1).min(h - 1)));
        // The ends stand twice, so that every pixel has two neighbours.
        column.resize(w + 2, 0.0);
        let rows = here.iter().zip(above).zip(below);
        column[1..]
            .iter_mut()
            .zip(rows)
            .for_each(|(c, ((here, above), below))| *c = center * here + tap * (above + below));
        (column[0], column[w + 1]) = (column[1], column[w]);
        let neighbours = column.iter().zip(&column[1..]).zip(&column[2..]);
        for (level, ((left, middle), right)) in out.iter_mut().zip(neighbours) {
            *level = rounded(center * middle + tap * (left + right));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Size;

    fn sheet(tau: f32) -> Plane {
        let size = Size { width: 7, height: 5 };
        Plane { size, data: vec![tau; size.pixels()] }
    }

    #[test]
    fn uniform_sheets_have_the_published_levels() {
        // docs/law/response.md, "Examples".
        assert!(tone(&sheet(1.0), ToneStyle::Expected, 0.05, 0.3).data.iter().all(|&v| v == 161));
        assert!(tone(&sheet(1.0), ToneStyle::ParaviewNoFxaa, 0.05, 0.3).data.iter().all(|&v| v == 159));
        assert!(tone(&sheet(0.03), ToneStyle::Paraview, 0.05, 0.3).data.iter().all(|&v| v == 7));
        assert!(tone(&sheet(0.0), ToneStyle::Paraview, 0.05, 0.3).data.iter().all(|&v| v == 0));
        assert!(tone(&sheet(f32::NAN), ToneStyle::Expected, 0.05, 0.3).data.iter().all(|&v| v == 0));
    }

    /// The table of level times ratio is what both say at every depth, to a thirtieth of a level.
    #[test]
    fn the_factor_in_the_table_is_that_of_each_depth() {
        let mut largest = 0.0f32;
        for opacity in [0.01, 0.05, 0.3, 1.0] {
            let response = Response::new(opacity);
            for radius in [0.05, 0.25, 0.8, 3.0] {
                let mean = FxaaMean::new(opacity, radius);
                let curve = response.scaled(|tau| mean.ratio(tau));
                let depth = |i: i32| libm::expf(0.001 * i as f32 - 11.0);
                let off = |tau: f32| (curve.level(tau) - response.level(tau) * mean.ratio(tau)).abs();
                largest = (0..15_000).map(depth).map(off).fold(largest, f32::max);
            }
        }
        assert!(largest < 0.033, "{largest}");
    }
}

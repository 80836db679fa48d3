//! From optical depth to grey levels: the tone curve of each look.

use crate::parallel;
use crate::picture::{Gray8, Plane, PlaneRows};
use crate::splat::{FxaaMean, Response, ToneStyle, fxaa_blur};
use std::sync::OnceLock;

/// Grey levels of a noise-free plane of optical depth (the opacity integral, A1 of
/// docs/law/depth.md), of all particles or of a model.
///
/// `opacity` in (0, 1] and `radius_px`, the splat radius in pixels at the focal point, say how
/// noisy ParaView's picture would be and so what its rounding and FXAA do to the mean.
/// Results do not depend on the number of threads.
pub fn tone(tau: &Plane, style: ToneStyle, opacity: f64, radius_px: f64) -> Gray8 {
    Tones::new(opacity, radius_px).of(tau, style)
}

/// The tone curves of one opacity and splat radius: the response takes milliseconds, and is made once, where a
/// look first asks for it.
pub struct Tones {
    opacity: f64,
    radius_px: f64,
    response: OnceLock<Response>,
}

impl Tones {
    /// The curves that [`tone`] has for these.
    pub fn new(opacity: f64, radius_px: f64) -> Self {
        Tones { opacity, radius_px, response: OnceLock::new() }
    }

    /// [`tone`] in a look.
    pub fn of(&self, tau: &Plane, style: ToneStyle) -> Gray8 {
        let mut out = Gray8::black(tau.size);
        self.rows(tau.clone().rows(), style, &mut out.data);
        out
    }

    /// [`tone`] of rows, which are overwritten, into `out`.
    pub(super) fn rows(&self, mut tau: PlaneRows<'_>, style: ToneStyle, out: &mut [u8]) {
        let response = || self.response.get_or_init(|| Response::new(self.opacity));
        match style {
            ToneStyle::Expected => per_pixel(&tau, out, |t| 255.0 * -libm::expm1f(-t)),
            ToneStyle::ParaviewNoFxaa => {
                let response = response();
                per_pixel(&tau, out, |t| response.level(t));
            }
            ToneStyle::Paraview => {
                let (response, mean) = (response(), FxaaMean::new(self.opacity, self.radius_px));
                // Levels are blurred, not depths: FXAA works on the finished picture.
                tau.each(|_, row| row.iter_mut().for_each(|t| *t = response.level(*t) * mean.ratio(*t)));
                blurred(&tau, fxaa_blur(self.opacity, self.radius_px), out);
            }
        }
    }
}

fn per_pixel(tau: &PlaneRows<'_>, out: &mut [u8], curve: impl Fn(f32) -> f32 + Send + Sync) {
    // The cast saturates and takes NaN to black.
    parallel::for_each_chunk(out, tau.size.width.max(1), |j, out| {
        out.iter_mut().zip(tau.row(j)).for_each(|(o, &t)| *o = curve(t).round_ties_even() as u8);
    });
}

/// Levels with `tap` of either neighbour mixed in along both axes (edges repeated), rounded.
fn blurred(levels: &PlaneRows<'_>, tap: f32, out: &mut [u8]) {
    let (w, h) = (levels.size.width, levels.size.height);
    let center = 1.0 - 2.0 * tap;
    parallel::for_each_chunk_with(out, w.max(1), Vec::new, |column, y, out| {
        let (above, here, below) = (levels.row(y.saturating_sub(1)), levels.row(y), levels.row((y + 1).min(h - 1)));
        column.clear();
        column.extend((0..w).map(|x| center * here[x] + tap * (above[x] + below[x])));
        for x in 0..w {
            let sides = column[x.saturating_sub(1)] + column[(x + 1).min(w - 1)];
            out[x] = (center * column[x] + tap * sides).round_ties_even() as u8;
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
}

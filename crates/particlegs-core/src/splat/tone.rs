//! From optical depth to grey levels: the tone curve of each look.

use super::{FxaaMean, Look, Response, fxaa_blur};
use crate::picture::{Gray8, Plane, Size};
use rayon::prelude::*;

/// Grey levels of a noise-free plane of optical depth (the opacity integral, A1 of
/// docs/law/depth.md), of all particles or of a model.
///
/// `opacity` in (0, 1] and `radius_px`, the splat radius in pixels at the focal point, say how
/// noisy ParaView's picture would be and so what its rounding and FXAA do to the mean.
/// Results do not depend on the number of threads.
pub fn tone(tau: &Plane, look: Look, opacity: f64, radius_px: f64) -> Gray8 {
    match look {
        Look::Expected => per_pixel(tau, |t| 255.0 * -(-t).exp_m1()),
        Look::ParaviewNoFxaa => {
            let response = Response::new(opacity);
            per_pixel(tau, |t| response.level(t))
        }
        Look::Paraview => {
            let (response, mean) = (Response::new(opacity), FxaaMean::new(opacity, radius_px));
            let levels = map(&tau.data, |t| response.level(t) * mean.ratio(t));
            blurred(tau.size, &levels, fxaa_blur(opacity, radius_px))
        }
    }
}

fn map<T: Send>(tau: &[f32], curve: impl Fn(f32) -> T + Sync) -> Vec<T> {
    tau.par_iter().with_min_len(4096).map(|&t| curve(t)).collect()
}

fn per_pixel(tau: &Plane, curve: impl Fn(f32) -> f32 + Sync) -> Gray8 {
    // The cast saturates and takes NaN to black.
    Gray8 { size: tau.size, data: map(&tau.data, |t| curve(t).round_ties_even() as u8) }
}

/// Levels with `tap` of either neighbour mixed in along both axes (edges repeated), rounded.
fn blurred(size: Size, levels: &[f32], tap: f32) -> Gray8 {
    let (w, h) = (size.width, size.height);
    let mut data = vec![0u8; levels.len()];
    let center = 1.0 - 2.0 * tap;
    data.par_chunks_mut(w.max(1)).enumerate().for_each_init(Vec::new, |column, (y, out)| {
        let row = |y: usize| &levels[y * w..(y + 1) * w];
        let (above, here, below) = (row(y.saturating_sub(1)), row(y), row((y + 1).min(h - 1)));
        column.clear();
        column.extend((0..w).map(|x| center * here[x] + tap * (above[x] + below[x])));
        for x in 0..w {
            let sides = column[x.saturating_sub(1)] + column[(x + 1).min(w - 1)];
            out[x] = (center * column[x] + tap * sides).round_ties_even() as u8;
        }
    });
    Gray8 { size, data }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(tau: f32) -> Plane {
        let size = Size { width: 7, height: 5 };
        Plane { size, data: vec![tau; size.pixels()] }
    }

    #[test]
    fn uniform_sheets_have_the_published_levels() {
        // docs/law/response.md, "Examples".
        assert!(tone(&sheet(1.0), Look::Expected, 0.05, 0.3).data.iter().all(|&v| v == 161));
        assert!(tone(&sheet(1.0), Look::ParaviewNoFxaa, 0.05, 0.3).data.iter().all(|&v| v == 159));
        assert!(tone(&sheet(0.03), Look::Paraview, 0.05, 0.3).data.iter().all(|&v| v == 7));
        assert!(tone(&sheet(0.0), Look::Paraview, 0.05, 0.3).data.iter().all(|&v| v == 0));
        assert!(tone(&sheet(f32::NAN), Look::Expected, 0.05, 0.3).data.iter().all(|&v| v == 0));
    }
}

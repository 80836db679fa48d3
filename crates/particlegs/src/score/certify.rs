//! The certificate: what a model's file says was measured after decoding it.

use super::evaluate::evaluate_against;
use super::science::science;
use super::{LookScores, certificate_views, density_of};
use crate::Result;
use crate::model::{Baselines, Certificate, LookBaselines, LookScore, Model, OrbitBaselines, OrbitScore, PictureScore};
use crate::particles::Particles;
use crate::picture::{Scores, Size};
use crate::progress::Progress;
use crate::reference::Reference;
use particlegs_core::math::each_axis;

/// Picture size of certificates.
const SIZE: Size = Size { width: 1920, height: 1080 };
/// Cells of the density grid along the longest extent.
const GRID: u16 = 50;

/// Measures `model` against the snapshot that it was made from: one frame of each orbit at the
/// model's default radius and opacity, and the density on a grid of 50 cells along the longest
/// extent, over the periodic box where there is one; what an empty picture, a uniform box and a uniform
/// density score there; then P(k), r(k) and groups (`science`). `seed`
/// turns the views and draws the particles; measuring again with the certificate's own repeats it.
/// The model is best the decoded one. `memory` is what the pictures of all particles may take; what is
/// measured does not depend on it.
///
/// # Errors
/// [`crate::Error::Input`] for a box that does not hold the particles; [`crate::Error::Memory`],
/// [`crate::Error::Cancelled`].
pub fn certificate(
    model: &Model,
    particles: &Particles,
    seed: u64,
    memory: Option<u64>,
    progress: &dyn Progress,
) -> Result<Certificate> {
    let m = &model.metadata;
    let views = certificate_views(m, SIZE, seed);
    let truth = Reference::new(particles).within(memory.unwrap_or(u64::MAX));
    let evaluation = evaluate_against(model, &truth, &views, SIZE, progress)?;
    let orbits = each_axis(|k| {
        let v = &evaluation.views[k];
        OrbitScore {
            paraview: look_score(&v.paraview),
            paraview_no_fxaa: look_score(&v.paraview_no_fxaa),
            expected: look_score(&v.expected),
        }
    });
    let baselines = each_axis(|k| {
        let v = &evaluation.views[k];
        OrbitBaselines {
            paraview: look_baselines(&v.paraview),
            paraview_no_fxaa: look_baselines(&v.paraview_no_fxaa),
            expected: look_baselines(&v.expected),
        }
    });
    let [density, uniform] = density_of(model, particles, &m.bounds, GRID, progress)?;
    let science = science(model, particles, seed, progress)?;
    Ok(Certificate {
        width: SIZE.width as u16,
        height: SIZE.height as u16,
        seed,
        orbits,
        grid: GRID,
        density_correlation: density.correlation,
        density_mae: density.mean_absolute_error,
        science,
        baselines: Some(Baselines { orbits: baselines, uniform_density_mae: uniform.mean_absolute_error }),
    })
}

fn look_baselines(s: &LookScores) -> LookBaselines {
    let score = |f: &Scores| PictureScore { masked_psnr: f.masked_psnr, ssim: f.ssim.unwrap_or(0.0) };
    LookBaselines { all_black: score(&s.all_black), uniform_box: score(&s.uniform_box) }
}

fn look_score(s: &LookScores) -> LookScore {
    // The size of certificates is larger than the window of SSIM, so it always has a value.
    LookScore {
        masked_psnr: s.model.masked_psnr,
        ssim: s.model.ssim.unwrap_or(0.0),
        noise_free_masked_psnr: s.noise_free.masked_psnr,
        noise_free_ssim: s.noise_free.ssim.unwrap_or(0.0),
    }
}

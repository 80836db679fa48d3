//! What was measured after decoding, when the file was made.

use super::{Measures, Science};

/// Scores of one orbit in one look: the model's, and those of the noise-free picture of all
/// particles (docs/law/scores.md).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LookScore {
    /// Masked PSNR of the model, dB. `None`: identical or nothing lit.
    pub masked_psnr: Option<f64>,
    /// SSIM of the model.
    pub ssim: f64,
    /// Masked PSNR of the noise-free picture, dB.
    pub noise_free_masked_psnr: Option<f64>,
    /// SSIM of the noise-free picture.
    pub noise_free_ssim: f64,
}

/// One frame of one orbit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OrbitScore {
    /// Against `paraview`.
    pub paraview: LookScore,
    /// Against `paraview-no-fxaa`.
    pub paraview_no_fxaa: LookScore,
    /// Against `expected` (whose noise-free picture is itself).
    pub expected: LookScore,
}

/// Measured at encoding, bound to the source by the metadata's hash. Fixed length in the file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Certificate {
    /// Picture size of the measurement.
    pub width: u16,
    /// Picture size of the measurement.
    pub height: u16,
    /// Seed of the views.
    pub seed: u64,
    /// Far, mid, near.
    pub orbits: [OrbitScore; 3],
    /// Cells along the longest extent of the density grid.
    pub grid: u16,
    /// Pearson correlation of the density on that grid.
    pub density_correlation: f64,
    /// Mean absolute error of the density contrast delta = rho / mean - 1 on that grid.
    pub density_mae: f64,
    /// What statistics said; `None` in files before version 1.2.
    pub science: Option<Science>,
    /// What trivial pictures and densities score; `None` in files before version 1.4.
    pub baselines: Option<Baselines>,
    /// What else was measured; nothing in files before version 1.5.
    pub measures: Measures,
}

/// How much is measured of a decoded model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CertificateLevel {
    /// Nothing: the file holds no certificate.
    None,
    /// What takes seconds.
    #[default]
    Quick,
    /// Also groups, of several draws, and models of halves of the particles against the other halves.
    Full,
    /// What adds up over the blocks of a job, each measured by its own task: no process needs all particles.
    Blocks,
}

impl CertificateLevel {
    /// Is anything measured?
    pub fn measures(self) -> bool {
        self != CertificateLevel::None
    }
}

/// Scores of one picture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureScore {
    /// Masked PSNR, dB. `None`: identical or nothing lit.
    pub masked_psnr: Option<f64>,
    /// SSIM.
    pub ssim: f64,
}

/// What two pictures score that show nothing of the structure, in one orbit and look.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LookBaselines {
    /// An empty picture.
    pub all_black: PictureScore,
    /// The noise-free picture of as many particles spread evenly over the box.
    pub uniform_box: PictureScore,
}

/// Baselines of one frame of one orbit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OrbitBaselines {
    /// Against `paraview`.
    pub paraview: LookBaselines,
    /// Against `paraview-no-fxaa`.
    pub paraview_no_fxaa: LookBaselines,
    /// Against `expected`.
    pub expected: LookBaselines,
}

/// Trivial references of a certificate: a model that does not clearly beat them shows nothing. Fixed
/// length in the file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Baselines {
    /// Far, mid, near.
    pub orbits: [OrbitBaselines; 3],
    /// Mean absolute error of the density contrast of a uniform density (whose correlation is 0): the
    /// mean of |delta| on the grid. An empty one has an error of 1.
    pub uniform_density_mae: f64,
}

impl LookScore {
    /// Stands for scores of pictures that were not drawn.
    pub const NOT_MEASURED: LookScore =
        LookScore { masked_psnr: None, ssim: 0.0, noise_free_masked_psnr: None, noise_free_ssim: 0.0 };
}

impl PictureScore {
    /// Stands for the score of a picture that was not drawn.
    pub const NOT_MEASURED: PictureScore = PictureScore { masked_psnr: None, ssim: 0.0 };
}

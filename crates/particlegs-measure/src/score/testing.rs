//! A certificate for tests: a good model's.

use particlegs_core::model::{
    Certificate, DensityMetrics, Limit, OrbitMetrics, PictureScore, PictureScores, ScienceMetrics, ViewMetrics,
};

/// Pictures of 30.5 dB where black scores 12 and a uniform box 16; every number is one that the file holds.
pub(super) fn certificate() -> Certificate {
    let score = |masked_psnr, ssim| Some(PictureScore { masked_psnr, ssim });
    let look = |noise_free, noise_free_ssim| PictureScores {
        model: score(Some(30.5), 0.75),
        noise_free: score(noise_free, noise_free_ssim),
        all_black: score(Some(12.0), 0.25),
        uniform_box: score(Some(16.0), 0.25),
        ..PictureScores::default()
    };
    let orbit = OrbitMetrics {
        paraview: look(Some(42.0), 0.99),
        paraview_no_fxaa: look(Some(44.0), 0.99),
        expected: look(None, 1.0),
    };
    let (correlation, mean_absolute_error, uniform_mean_absolute_error) = (0.9975, 0.375, 1.25);
    Certificate {
        views: ViewMetrics { width: 1920, height: 1080, seed: 42, orbits: [orbit; 3] },
        density: DensityMetrics { cells: 50, correlation, mean_absolute_error, uniform_mean_absolute_error },
        science: Some(ScienceMetrics {
            k_max: 8.0,
            power_within_1_percent_to: Limit::At(4.0),
            power_within_5_percent_to: Limit::At(8.0),
            r_above_0_99_to: Limit::At(2.5),
            r_above_0_9_to: Limit::At(8.0),
            groups_within_10_percent_from: Limit::At(57.0),
            ..ScienceMetrics::default()
        }),
        ..Certificate::default()
    }
}

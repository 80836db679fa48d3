//! A certificate for tests: a good model's.

use crate::model::{
    Baselines, Certificate, Limit, LookBaselines, LookScore, Measures, OrbitBaselines, OrbitScore, PictureScore,
    Science, ScienceOf,
};

/// Pictures of 30.5 dB where black scores 12 and a uniform box 16; every number is one that the file holds.
pub(super) fn certificate() -> Certificate {
    let look = |noise_free, noise_free_ssim| LookScore {
        masked_psnr: Some(30.5),
        ssim: 0.75,
        noise_free_masked_psnr: noise_free,
        noise_free_ssim,
    };
    let orbit = OrbitScore {
        paraview: look(Some(42.0), 0.99),
        paraview_no_fxaa: look(Some(44.0), 0.99),
        expected: look(None, 1.0),
    };
    let score = |v| PictureScore { masked_psnr: Some(v), ssim: 0.25 };
    let trivial = LookBaselines { all_black: score(12.0), uniform_box: score(16.0) };
    let baselines = OrbitBaselines { paraview: trivial, paraview_no_fxaa: trivial, expected: trivial };
    Certificate {
        width: 1920,
        height: 1080,
        seed: 42,
        orbits: [orbit; 3],
        grid: 50,
        density_correlation: 0.9975,
        density_mae: 0.375,
        science: Some(Science {
            of: ScienceOf::DrawnParticles,
            spectrum_grid: 128,
            k_max: 8.0,
            power_within_1_percent_to: Limit::At(4.0),
            power_within_5_percent_to: Limit::At(8.0),
            r_above_0_99_to: Limit::At(2.5),
            r_above_0_9_to: Limit::At(8.0),
            groups_within_10_percent_from: Limit::At(57.0),
        }),
        baselines: Some(Baselines { orbits: [baselines; 3], uniform_density_mae: 1.25 }),
        measures: Measures::default(),
    }
}

//! Numbers of the paper on training, blocks and generalisation, with the names of the `\newcommand` lines in its
//! source; those on performance and recovery are in modules of their own. All were measured on its HACC snapshot of
//! 281 million particles with the published method. PSNR is of whole pictures of 1920 x 1080 unless it says masked.

/// Bytes of a Gaussian as published, a PLY of 17 float32.
pub(super) const BYTES_A_GAUSSIAN: u64 = 68;

/// A row of the paper's tables of models.
#[derive(Clone, Copy, Debug)]
pub(super) struct PublishedRow {
    pub psnr: f64,
    /// Change from the table's first row, dB.
    pub change: f64,
    /// Size as PLY, MB.
    pub megabytes: f64,
}

/// `Sb...`: the single block, which the ablations of components start from.
pub(super) const SINGLE: PublishedRow = PublishedRow { psnr: 28.80, change: 0.0, megabytes: 11.1 };
/// `AblNoVm...`.
pub(super) const NO_VIZMAPPER: PublishedRow = PublishedRow { psnr: 23.30, change: -5.51, megabytes: 14.4 };
/// `AblNoProg...`.
pub(super) const SINGLE_RESOLUTION: PublishedRow = PublishedRow { psnr: 26.42, change: -2.39, megabytes: 11.0 };
/// `AblNoOrbit...`.
pub(super) const FAR_ORBIT: PublishedRow = PublishedRow { psnr: 28.04, change: -0.77, megabytes: 12.4 };

/// `Eb...`: eight blocks, fine-tuned, which the ablations of fine-tuning start from.
pub(super) const EIGHT: PublishedRow = PublishedRow { psnr: 30.03, change: 0.0, megabytes: 49.8 };
/// `AblFtNoDensify...`.
pub(super) const NO_DENSIFICATION: PublishedRow = PublishedRow { psnr: 28.61, change: -1.42, megabytes: 57.9 };
/// `AblFtPureDssim...`.
pub(super) const PURE_DSSIM: PublishedRow = PublishedRow { psnr: 26.60, change: -3.43, megabytes: 298.2 };
/// `AblFtDssimBlend...`.
pub(super) const DSSIM_BLEND: PublishedRow = PublishedRow { psnr: 28.26, change: -1.77, megabytes: 54.2 };

/// A row of the block sweep (`Blk...`).
#[derive(Clone, Copy, Debug)]
pub(super) struct PublishedBlocks {
    pub blocks: u32,
    /// PSNR after the merge, dB.
    pub merged: Option<f64>,
    /// PSNR after fine-tuning, dB; for one block, after training.
    pub tuned: f64,
    /// SSIM, likewise.
    pub ssim: f64,
    pub thousands: f64,
}

pub(super) const BLOCKS: [PublishedBlocks; 5] = [
    PublishedBlocks { blocks: 1, merged: None, tuned: 28.80, ssim: 0.7723, thousands: 171.0 },
    PublishedBlocks { blocks: 2, merged: Some(28.99), tuned: 29.72, ssim: 0.8076, thousands: 543.0 },
    PublishedBlocks { blocks: 4, merged: Some(28.85), tuned: 29.94, ssim: 0.8195, thousands: 601.0 },
    PublishedBlocks { blocks: 8, merged: Some(28.32), tuned: 30.03, ssim: 0.8241, thousands: 769.0 },
    PublishedBlocks { blocks: 16, merged: Some(26.80), tuned: 30.08, ssim: 0.8271, thousands: 1037.0 },
];

pub(super) fn blocks(k: u32) -> Option<PublishedBlocks> {
    BLOCKS.into_iter().find(|b| b.blocks == k)
}

/// `BlkDistFarGain`, `BlkDistNearGain`: gain in masked PSNR of eight fine-tuned blocks over one, far and near, dB.
pub(super) const EIGHT_GAINS: [f64; 2] = [1.04, 1.49];

/// An orbit of the table of generalisation (`GenOrbit...`).
#[derive(Clone, Copy, Debug)]
pub(super) struct OrbitRow {
    /// Distance in base distances.
    pub orbit: f64,
    /// Relation to training: trained, between or beyond.
    pub kind: &'static str,
    pub masked: f64,
    pub ssim: f64,
}

const fn orbit(orbit: f64, kind: &'static str, masked: f64, ssim: f64) -> OrbitRow {
    OrbitRow { orbit, kind, masked, ssim }
}

/// The table of generalisation over orbits.
pub(super) const ORBITS: [OrbitRow; 7] = [
    orbit(1.3, "beyond", 26.20, 0.915),
    orbit(1.0, "trained", 26.32, 0.863),
    orbit(0.85, "between", 26.33, 0.823),
    orbit(0.7, "trained", 26.43, 0.769),
    orbit(0.6, "between", 26.37, 0.727),
    orbit(0.5, "trained", 26.07, 0.685),
    orbit(0.35, "beyond", 25.10, 0.588),
];

/// Masked PSNR at the mid orbit and the default radius and opacity, dB (from the paper's artifact).
pub(super) const AT_DEFAULTS: f64 = 26.00;
/// `GenRad...`: factor of the default radius, masked PSNR in dB.
pub(super) const RADII: [(f64, f64); 2] = [(2.0, 21.85), (2.5, 20.67)];
/// `GenOpa...`: factor of the default opacity, masked PSNR in dB.
pub(super) const OPACITIES: [(f64, f64); 2] = [(2.0, 22.30), (2.4, 21.33)];

/// Whether a change agrees in sign with the paper's, in words. Changes within `noise` count as none.
pub(super) fn same_sign(ours: f64, theirs: f64, noise: f64) -> &'static str {
    match (ours.abs() <= noise, ours * theirs > 0.0) {
        (true, _) => "within noise",
        (false, true) => "yes",
        (false, false) => "no",
    }
}

/// The paper's performance numbers, from its \newcommand lines (particlegs-sc26.tex, table tab:perf and figure
/// fig:scale): 281 million particles, an alpha-blend model of 8 blocks (769 thousand Gaussians) on a GPU.
pub(super) mod performance {
    /// Its hardware (section 5).
    pub const HARDWARE: &str = "NVIDIA RTX PRO 6000 Blackwell";
    pub const PARTICLES: f64 = 281e6;
    pub const GAUSSIANS: f64 = 769e3;

    /// Milliseconds of a frame by ParaView and by the published method, and their stated ratio.
    pub struct PublishedFrame {
        pub paraview: f64,
        pub published: f64,
        pub ratio: f64,
    }

    /// Numbers for a picture height; `settings`: with a new radius and opacity ("Combined": adaptation and drawing), else
    /// with a new camera only.
    pub fn frame(height: usize, settings: bool) -> Option<PublishedFrame> {
        let published_frame = |paraview, published, ratio| Some(PublishedFrame { paraview, published, ratio });
        match (height, settings) {
            // \PerfPvCamMs, \PerfGsRastMs, \SpeedupCamOneK; \PerfPvCombMs, \PerfGsCombMs, \SpeedupOneK.
            (1080, false) => published_frame(129.0, 0.38, 339.0),
            (1080, true) => published_frame(3603.0, 1.51, 2386.0),
            // \PerfPvCamFourKMs, \PerfGsRastFourKMs, \SpeedupCamFourK;
            // \PerfPvCombFourKMs, \PerfGsCombFourKMs, \SpeedupFourK.
            (2160, false) => published_frame(129.0, 0.77, 168.0),
            (2160, true) => published_frame(3648.0, 1.93, 1890.0),
            _ => None,
        }
    }

    pub const PARAVIEW_LOAD: f64 = 39.4;
    pub const MODEL_LOAD: f64 = 0.041;
    pub const PREPARATION: f64 = 6.85 * 60.0;
    pub const TRAINING: f64 = 67.0 * 60.0;
    pub const MERGE: f64 = 0.11;
    pub const FINE_TUNING: f64 = 15.0 * 60.0;
    /// \InferMemMB, MB of GPU memory.
    pub const DRAWING_MEMORY: f64 = 462.2;
    /// \TrainPeakGB, MB of GPU memory.
    pub const TRAINING_MEMORY: f64 = 8500.0;

    /// Particles and Gaussians per block: 16 blocks (\ScaleSixteenGaussians, \ScaleSixteenParticlesM) and one
    /// (\ScaleOneGaussians).
    pub const SCALE: [[f64; 2]; 2] = [[17.6e6, 94e3], [281e6, 171e3]];
}

/// The paper's numbers on recovery, from its \newcommand lines (particlegs-sc26.tex): 281 million HACC particles in a
/// box of 256 Mpc/h, an alpha-blend model of 8 blocks at ratio 65 trained on pictures.
pub(super) mod recovery {
    use particlegs_fit::recover::Method;

    /// A row of a table of the paper.
    pub struct PublishedRecovery {
        pub correlation: f64,
        /// Mean absolute error of delta.
        pub mae: f64,
        /// Mean distance to the nearest neighbour among 500 000 random particles, Mpc/h.
        pub nearest: f64,
        /// Mean |xi / xi_truth - 1|, per cent.
        pub xi: f64,
    }

    /// The truth's mean distance to the nearest neighbour (\RecGtNNMean), Mpc/h.
    pub const TRUTH_NEAREST: f64 = 0.665;
    /// P(k) is within 10 % up to here (\RecPkTenPctK), h/Mpc.
    pub const POWER_TO: f64 = 2.63;
    /// xi(r) is within 10 % from here on (\RecXiTenPctR), Mpc/h.
    pub const XI_FROM: f64 = 10.0;
    /// Particles in a cell of its density grid: 281 million in 256^3 (\RecGridSize).
    pub const PARTICLES_A_CELL: f64 = 281e6 / (256.0 * 256.0 * 256.0);

    const fn row(correlation: f64, mae: f64, nearest: f64, xi: f64) -> PublishedRecovery {
        PublishedRecovery { correlation, mae, nearest, xi }
    }

    /// Table tab:recovery_methods (\RecVZero... to \RecVSix...); `None` for methods that it does not have.
    pub fn method(method: Method) -> Option<PublishedRecovery> {
        Some(match method {
            Method::Count => row(0.928, 0.718, 0.250, 8.6),
            Method::Volume => row(0.437, 1.172, 1.216, 4.0),
            Method::Ellipsoid => row(0.917, 0.701, 0.281, 8.9),
            Method::Grid => row(0.003, 1.924, 0.061, 154.1),
            Method::Stratified | Method::Spaced => return None,
        })
    }

    /// Table tab:recovery_blocks (\RecBlk...), by number of blocks.
    pub fn blocks(number: u32) -> Option<PublishedRecovery> {
        Some(match number {
            1 => row(0.897, 0.906, 0.161, 15.3),
            2 => row(0.916, 0.815, 0.186, 9.3),
            4 => row(0.923, 0.760, 0.218, 8.3),
            8 => row(0.928, 0.718, 0.250, 8.6),
            16 => row(0.928, 0.681, 0.292, 7.8),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_those_of_the_tables() {
        // The paper rounds each figure on its own.
        let near = |a: f64, b: f64| assert!((a - b).abs() < 0.0151, "{a} {b}");
        for row in [NO_VIZMAPPER, SINGLE_RESOLUTION, FAR_ORBIT] {
            near(row.psnr - SINGLE.psnr, row.change);
        }
        for row in [NO_DENSIFICATION, PURE_DSSIM, DSSIM_BLEND] {
            near(row.psnr - EIGHT.psnr, row.change);
        }
        assert_eq!(blocks(16).map(|b| b.ssim), Some(0.8271));
        assert!(blocks(3).is_none());
    }

    #[test]
    fn signs_agree_beyond_noise() {
        let said = [(-1.0, -5.0), (1.0, -5.0), (-0.2, -5.0)].map(|(a, b)| same_sign(a, b, 0.25));
        assert_eq!(said, ["yes", "no", "within noise"]);
    }
}

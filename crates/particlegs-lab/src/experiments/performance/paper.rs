//! The paper's performance numbers, from its \newcommand lines (particlegs-sc26.tex, table tab:perf and figure
//! fig:scale): 281 million particles, an alpha-blend model of 8 blocks (769 thousand Gaussians) on a GPU.

/// Its hardware (section 5).
pub(super) const HARDWARE: &str = "NVIDIA RTX PRO 6000 Blackwell";
pub(super) const PARTICLES: f64 = 281e6;
pub(super) const GAUSSIANS: f64 = 769e3;

/// Milliseconds of a frame by ParaView and by the published method, and their stated ratio.
pub(super) struct PublishedFrame {
    pub paraview: f64,
    pub published: f64,
    pub ratio: f64,
}

/// Numbers for a picture height; `settings`: with a new radius and opacity ("Combined": adaptation and drawing), else
/// with a new camera only.
pub(super) fn frame(height: usize, settings: bool) -> Option<PublishedFrame> {
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

pub(super) const PARAVIEW_LOAD: f64 = 39.4;
pub(super) const MODEL_LOAD: f64 = 0.041;
pub(super) const PREPARATION: f64 = 6.85 * 60.0;
pub(super) const TRAINING: f64 = 67.0 * 60.0;
pub(super) const MERGE: f64 = 0.11;
pub(super) const FINE_TUNING: f64 = 15.0 * 60.0;
/// \InferMemMB, MB of GPU memory.
pub(super) const DRAWING_MEMORY: f64 = 462.2;
/// \TrainPeakGB, MB of GPU memory.
pub(super) const TRAINING_MEMORY: f64 = 8500.0;

/// Particles and Gaussians per block: 16 blocks (\ScaleSixteenGaussians, \ScaleSixteenParticlesM) and one
/// (\ScaleOneGaussians).
pub(super) const SCALE: [[f64; 2]; 2] = [[17.6e6, 94e3], [281e6, 171e3]];

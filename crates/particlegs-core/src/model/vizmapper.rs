//! The network that follows radius and opacity in the published law (paper section III-B).

/// Inputs, hidden units (twice) and outputs of [`VizMapper`].
pub const VIZMAPPER_SHAPE: [usize; 4] = [4, 64, 64, 2];

/// Weights and biases of [`VizMapper`].
pub const VIZMAPPER_PARAMETERS: usize = 4 * 64 + 64 + 64 * 64 + 64 + 64 * 2 + 2;

/// Ranges of the corrections of [`VizMapper`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VizRanges {
    /// Largest |delta_s|: scales change by at most this share.
    pub scale: f64,
    /// Largest |delta_o|.
    pub opacity: f64,
    /// Least factor on opacity.
    pub floor: f64,
}

impl VizRanges {
    /// Ranges of first training.
    pub const TRAINING: VizRanges = VizRanges { scale: 0.1, opacity: 0.3, floor: 0.4 };
    /// Ranges of fine-tuning.
    pub const FINE_TUNING: VizRanges = VizRanges { scale: 0.3, opacity: 0.8, floor: 0.1 };
}

/// The network 4-64-64-2 with SiLU between and tanh at its end that corrects each Gaussian's scale
/// and opacity for a radius and an opacity (paper section III-B). Inputs of a Gaussian: `f_r - 1`,
/// `f_a - 1`, `(mean log-scale + 8) / 2` (scale in the frame of [`crate::camera::Normalisation`]),
/// `(logit opacity + 3) / 4`.
#[derive(Clone, Debug, PartialEq)]
pub struct VizMapper {
    /// [`VIZMAPPER_PARAMETERS`] numbers: of each of the three layers in turn the weights, a row an
    /// output, then the biases.
    pub parameters: Vec<f32>,
    /// Ranges of its outputs.
    pub ranges: VizRanges,
}

//! The laws by which Gaussians become a picture, and what these need beside places and shapes.

use std::sync::Arc;

/// The law that Gaussians are drawn by, and its columns of their length.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Law {
    /// Depths add up: `1 - exp(-sum tau)`. No order, no network, no columns.
    #[default]
    OpticalDepth,
    /// Splatting as published.
    AlphaBlend(AlphaBlend),
}

/// Columns of the published law: opacities and grey levels, and the network that follows radius and
/// opacity (paper sections III-A and III-B).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaBlend {
    /// Opacity at a Gaussian's peak at the default radius and opacity, in (0, 1).
    pub opacity: Vec<f64>,
    /// Grey level, 1 = white; at least 0.
    pub grey: Vec<f64>,
    /// The network; `None` = trained without one, or a block on its own.
    pub vizmapper: Option<Arc<VizMapper>>,
}

impl AlphaBlend {
    /// Bytes of a Gaussian in a published model: 17 float32 of a PLY file.
    pub const PLY_BYTES: u64 = 68;
}

impl Law {
    /// The kind of law.
    pub fn kind(&self) -> LawKind {
        match self {
            Law::OpticalDepth => LawKind::OpticalDepth,
            Law::AlphaBlend(_) => LawKind::AlphaBlend,
        }
    }

    /// The columns of the alpha-blend law.
    pub fn alpha_blend(&self) -> Option<&AlphaBlend> {
        match self {
            Law::OpticalDepth => None,
            Law::AlphaBlend(columns) => Some(columns),
        }
    }

    /// The columns of the alpha-blend law, to be changed.
    pub fn alpha_blend_mut(&mut self) -> Option<&mut AlphaBlend> {
        match self {
            Law::OpticalDepth => None,
            Law::AlphaBlend(columns) => Some(columns),
        }
    }
}

crate::named_values! {
    /// The kind of law: [`Law`] without its columns.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum LawKind {
        #[default]
        OpticalDepth = "optical-depth": "Optical depths add up: no sorting, no network",
        AlphaBlend = "alpha-blend": "Sorted and alpha-blended as published, with the VizMapper network",
    }
}

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

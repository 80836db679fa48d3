//! The laws by which Gaussians become a picture, and what these need beside places and shapes.

use super::VizMapper;
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

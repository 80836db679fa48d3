//! Floor 1: planes of floats and of grey levels, colour maps, scores of one picture against another.

mod colormap;
mod layers;
mod plane;
mod score;
mod score_density;
mod units;
mod value_scale;

pub use colormap::{Colormap, DensityColors, cool_to_warm, diverging};
pub(crate) use plane::PlaneRows;
pub use plane::{Gray8, Pixels, Plane, Rgb8, Size};
pub use score::{MASK_LEVEL, Scores, decibels, is_lit, masked_psnr, psnr, ssim};
pub use score_density::DensityScores;
pub use units::{journal_unit, superscript};
pub use value_scale::{ValueColors, ValueScale};

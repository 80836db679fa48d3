//! Floor 1: what one splat does to a pixel: profile, integrals, and the response of ParaView's
//! 8-bit blending. Every constant of the picture law stands here once.

mod constants;
mod fxaa_mean;
mod response;
mod tone_style;

pub use constants::{
    CUT_SHARE, CUT_SHARE_2D, CUT_SIGMA, DEFAULT_OPACITY, DEPTH_TOLERANCE, LARGEST_MEAN_ALPHA, MEAN_COVERED_ALPHA,
    PEELS, PIXEL_VARIANCE, erf, opacity_integral,
};
pub use fxaa_mean::{FxaaMean, fxaa_blur};
pub use response::{Response, mul8};
pub use tone_style::ToneStyle;

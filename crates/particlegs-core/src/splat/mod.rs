//! Floor 1: what one splat does to a pixel: profile, integrals, and the response of ParaView's
//! 8-bit blending. Every constant of the picture law stands here once.

mod constants;
mod fxaa_mean;
mod look;
mod response;

pub use constants::{
    CUT_SHARE, CUT_SHARE_2D, CUT_SIGMA, DEFAULT_OPACITY, DEPTH_TOLERANCE, LARGEST_MEAN_ALPHA, MEAN_COVERED_ALPHA,
    PEELS, PIXEL_VARIANCE, erf, opacity_integral,
};
pub use fxaa_mean::{FxaaMean, fxaa_blur};
pub use look::ToneStyle;
pub use response::Response;
pub use response::mul8;

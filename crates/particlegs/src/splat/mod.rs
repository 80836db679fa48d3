//! Floor 1: what one splat does to a pixel: profile, integrals, and the response of ParaView's
//! 8-bit blending. Every constant of the picture law stands here once.

mod look;

pub use look::Look;

//! Views beyond one camera: windows that fit, a turn, a path through key frames.

pub mod path;
mod rotation;
pub mod sequence_args;
mod spline;
pub mod window;

//! What the command line says of figures; `particlegs_figure` draws them.

pub mod args;
pub mod output;

pub use particlegs_figure::*;

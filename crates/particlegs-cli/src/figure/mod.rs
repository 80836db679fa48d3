//! Figures on the command line; `particlegs_figure` draws them.

pub mod args;
pub mod output;

pub use particlegs_figure::*;

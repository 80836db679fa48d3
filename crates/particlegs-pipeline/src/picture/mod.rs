//! Floor 1: grey pictures and planes of floats, PNG, scores of one picture against another, colour maps.

mod png_io;

pub use particlegs_core::picture::*;
pub use png_io::{read_png, write_png};

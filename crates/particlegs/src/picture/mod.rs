//! Floor 1: grey pictures and planes of floats, PNG, scores of one picture against another,
//! colour maps and annotations.

mod colormap;
mod plane;
mod png_io;
mod text;

pub use colormap::{Colormap, diverging};
pub use plane::{Gray8, Plane, Rgb8, Size};
pub use png_io::{read_gray_png, write_gray_png, write_rgb_png};

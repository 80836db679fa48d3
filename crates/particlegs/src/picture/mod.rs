//! Floor 1: grey pictures and planes of floats, PNG, scores of one picture against another,
//! colour maps and annotations.

mod annotate;
mod annotate_bar;
mod annotate_panels;
mod png_io;
mod text;

pub use annotate::{DensityPicture, ScaleBar, annotate_density, log_range};
pub use annotate_panels::{PanelImage, panels};
pub use particlegs_core::picture::*;
pub use png_io::{PNG, read_gray_png, write_gray_png, write_rgb_png};
pub use text::{FONT, number, superscript};

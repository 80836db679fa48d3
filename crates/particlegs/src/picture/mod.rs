//! Floor 1: grey pictures and planes of floats, PNG, scores of one picture against another,
//! colour maps and annotations.

mod annotate;
mod annotate_bar;
mod annotate_panels;
mod colormap;
mod plane;
mod png_io;
mod score;
mod score_ssim;
mod text;

pub use annotate::{DensityPicture, ScaleBar, annotate_density, log_range};
pub use annotate_panels::{PanelImage, panels};
pub use colormap::{Colormap, diverging};
pub use plane::{Gray8, Plane, Rgb8, Size};
pub use png_io::{PNG, read_gray_png, write_gray_png, write_rgb_png};
pub use score::{MASK_LEVEL, Scores, decibels, is_lit, masked_psnr, psnr};
pub use score_ssim::ssim;
pub use text::{FONT, number, superscript};

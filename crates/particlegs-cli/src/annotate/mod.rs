//! What is drawn on pictures: colour bars, scale bars and captions.

mod bar;
mod density;
mod panels;
pub mod text;

pub use density::{DensityPicture, ScaleBar, annotate_density};
pub use panels::{PanelImage, panels};

//! Pictures as figures: what stands about and on a picture, laid out once and written as PNG, SVG or PDF.
//!
//! A [`Figure`] says what is to be seen; [`layout`] places it on a [`Sheet`], a list of marks in one unit; `raster`,
//! `svg` and `pdf` write a sheet.

pub mod args;
pub mod axes;
pub mod cube;
mod font;
mod image;
mod layout;
mod layout_parts;
pub mod output;
mod panel;
mod pdf;
mod pdf_font;
pub mod png_file;
mod raster;
mod sheet;
pub mod svg;
pub mod ticks;

pub use image::FigureImage;
pub use layout::{FigureSpace, layout};
#[cfg(test)]
pub use panel::EdgeAxis;
pub use panel::{BarPlacement, ColourBar, Figure, Panel, PaperColour, ScaleBar};
pub use raster::raster;

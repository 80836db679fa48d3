//! Figures: pictures with what stands about and on them, and plots with axes, laid out once and written as PNG, SVG
//! or PDF.
//!
//! A [`Figure`] says what is to be seen of pictures, a [`Plot`] of curves; [`layout`] and `plot_layout` place it on a
//! [`Sheet`], a list of marks in one unit; `raster`, `svg` and `pdf` write a sheet, and a new kind of mark goes into
//! each of them. Nothing here prints.

#![allow(missing_docs)]

pub mod axes;
pub mod cube;
mod font;
mod layout;
mod layout_parts;
mod panel;
mod pdf;
mod plot;
mod plot_layout;
pub mod png_file;
mod raster;
mod sheet;
mod svg;
pub mod ticks;

pub use font::missing;
pub use layout::{FigureSpace, layout};
pub use panel::{BarPlacement, ColourBar, EdgeAxis, Figure, FigureImage, Panel, PaperColour, ScaleBar};
pub use plot::{Plot, PlotAxis, PlotSeries, Point};
pub use plot_layout::{plot_bytes, shows, write_plots};
pub use raster::raster;
pub use sheet::{Anchor, FileKind, Mark, PageRectangle, RgbColour, Sheet, TextLine};
pub use ticks::{labelled, number};

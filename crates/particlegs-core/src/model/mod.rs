//! Floor 2: the mixture and what is known about it: plain data. Knows no file, no camera, no thread.

mod alpha_blend;
mod certificate;
mod columns;
mod layer;
mod metadata;
mod mixture;
mod science;
pub mod vizmapper;

pub use alpha_blend::{Shade, VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
pub use certificate::{Baselines, Certificate, LookBaselines, LookScore, OrbitBaselines, OrbitScore, PictureScore};
pub use columns::{Columns, GREY, MASS, OPACITY};
pub use layer::{Layer, Mass};
pub use metadata::{Law, Metadata, hex};
pub use mixture::{Block, Mixture, Model};
pub use science::{Limit, Science, ScienceOf, per_length};

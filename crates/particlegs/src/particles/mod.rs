//! Floor 1: particles in memory or mapped, where they come from, and what is known about them.
//!
//! A [`SnapshotReader`] tells its [`SnapshotMeta`] first and then hands over its particles run by
//! run; [`Particles`] is a snapshot opened whole, mapped where the file's layout allows it.
//! Positions are `origin + local` with f32 locals, so that a box far from the origin keeps its
//! precision; raw float32 files have the origin 0 and are never copied. [`convert`] writes a
//! snapshot from a snapshot: tiled, cropped, thinned.

mod convert;
mod hash;
mod images;
mod in_box;
mod layer;
mod layered;
mod load;
mod masses;
mod meta;
mod open;
mod scratch;
mod select;
mod sidecar;
mod source;
mod storage;
mod tile;
mod units;
mod write;

pub use convert::{Converted, convert, write_raw};
pub(crate) use hash::hash_of_runs;
pub(crate) use hash::hash_run;
pub use hash::{RunHash, column_hash, source_hash};
pub(crate) use in_box::{check_box, check_particles};
pub use layer::ONE_LAYER;
pub use layered::{LayerSource, Layered, ReadLayer};
pub use load::{Stated, load};
pub use masses::{layers_by_mass, settle_masses};
pub use meta::SnapshotMeta;
pub(crate) use open::{Invalid, invalid};
pub use open::{check_values, map_file, open_raw};
pub use scratch::{Blank, Storage};
pub use select::{Kept, Run, Selection, select};
pub use source::{Chunk, ChunkBuffer, InPlace, RUN, RunSink, SnapshotReader};
pub(crate) use storage::CHUNK;
pub use storage::{Column, Particles, Positions};
pub use tile::Tiling;
pub(crate) use write::SnapshotWriter;
pub use write::{Described, FOLDER_FILES, RawForm};

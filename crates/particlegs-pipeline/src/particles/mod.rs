//! Floor 1: particles in memory or mapped, where they come from, and what is known about them.
//!
//! A [`SnapshotReader`] tells its [`SnapshotMeta`] first and then hands over its particles run by
//! run; [`Particles`] is a snapshot opened whole, mapped where the file's layout allows it.
//! Positions are `origin + local` with f32 locals, so that a box far from the origin keeps its
//! precision; raw float32 files have the origin 0 and are never copied. [`SelectedParticles`] is what is
//! left of a snapshot when it is tiled, cropped and thinned, to be written by any format.

mod align;
mod box_check;
mod chunk;
mod convert;
pub(crate) mod domain;
mod fields;
mod hash;
mod images;
mod layer;
mod layered;
mod load;
mod masses;
mod meta;
mod neighbours;
mod open;
mod scratch;
mod select;
mod sidecar;
mod source;
mod storage;
mod tile;
mod units;
mod write;

pub use align::{AlignedFrame, Alignment};
pub(crate) use box_check::{ParticlesOutsideBox, check_box, check_particles};
pub(crate) use chunk::ChunkBuffer;
pub use chunk::{Chunk, RUN};
pub(crate) use domain::Domain;
pub(crate) use fields::{FieldColumns, KM_S};
pub use fields::{LayerFields, Number, PhysicalUnit, SourceField, StarFormingGas, StoredNumber};
pub(crate) use hash::RunHash;
pub(crate) use hash::hash_of_runs;
pub(crate) use hash::hash_run;
pub use layered::LayeredParticles;
pub(crate) use layered::ReadLayer;
pub(crate) use masses::mass_classes;
pub use meta::SnapshotMeta;
pub(crate) use neighbours::{Neighbours, cubic_spline, distances_to, places_of};
pub(crate) use open::{InvalidParticles, invalid};
pub(crate) use scratch::ColumnBuffer;
pub use scratch::Storage;
pub use select::{Run, SelectedParticles, Selection};
pub use source::{InPlace, SnapshotReader};
pub(crate) use storage::CHUNK;
pub use storage::{Column, Particles, Positions};
pub use tile::Tiling;
pub use write::RawForm;
pub(crate) use write::{SnapshotDescription, SnapshotLayout, SnapshotWriter};

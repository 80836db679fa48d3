//! Particles in memory or mapped, where they come from, and what is known about them.
//!
//! A [`SnapshotReader`] tells its [`SnapshotMeta`] first and then hands over its particles run by
//! run; [`Particles`] is a snapshot opened whole, mapped where the file's layout allows it.
//! Positions are `origin + local` with f32 locals, so that a box far from the origin keeps its
//! precision; raw float32 files have the origin 0 and are never copied. [`SelectedParticles`] is what is
//! left of a snapshot when it is tiled, cropped and thinned, to be written by any format.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod align;
pub mod blocks;
mod box_check;
mod convert;
mod domain;
mod fields;
mod hash;
mod layer;
mod layered;
mod meta;
mod neighbours;
mod open;
mod periodic;
mod scratch;
mod select;
mod source;
mod storage;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
mod units;
mod write;

pub use align::{AlignedFrame, Alignment};
pub use box_check::{ParticlesOutsideBox, check_box, check_particles};
pub use domain::{Domain, Tilt};
pub use fields::{
    FieldColumns, GasTemperature, KM_S, LayerFields, Number, PhysicalUnit, SourceField, StarFormingGas, StoredNumber,
};
pub(crate) use hash::hash_of_runs;
pub use hash::{RunHash, hash_run};
pub use layer::mass_classes;
pub use layered::{LayeredParticles, ReadLayer};
pub use meta::SnapshotMeta;
pub use neighbours::{Neighbours, cubic_spline, distances_to, places_of};
pub use open::{InvalidParticles, invalid};
pub use periodic::Tiling;
pub use scratch::{ColumnBuffer, Storage};
pub use select::{Run, SelectedParticles, Selection};
pub use source::{InPlace, RunSink, SnapshotReader};
pub use storage::{CHUNK, Chunk, ChunkBuffer, Column, Particles, Positions, RUN};
pub use write::{RawForm, SnapshotDescription, SnapshotLayout, SnapshotWriter};

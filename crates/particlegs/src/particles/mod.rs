//! Floor 1: particles in memory or mapped, where they come from, and what is known about them.
//!
//! A [`SnapshotReader`] tells its [`SnapshotMeta`] first and then fills the caller's buffers by
//! chunks; [`Particles`] is a snapshot opened whole, mapped where the file's layout allows it.
//! Positions are `origin + local` with f32 locals, so that a box far from the origin keeps its
//! precision; raw float32 files have the origin 0 and are never copied.

mod bounds;
mod hash;
mod meta;
mod npy;
mod open;
mod sidecar;
mod source;
mod storage;

pub use bounds::Bounds;
pub use hash::source_hash;
pub use meta::{Cell, SnapshotMeta};
pub use open::{OpenOptions, open};
pub use source::{Chunk, ChunkBuffer, SnapshotReader};
pub use storage::{Column, Particles, Positions};

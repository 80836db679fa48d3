//! Other people's files: what they say about themselves, and their particles.
//!
//! [`open`] finds a file's format by its content and gives a [`Snapshot`]: a [`Description`] first
//! (species, fields, units, box, frames), then a [`particlegs::particles::SnapshotReader`] for the
//! species and fields that were chosen. One file a format; [`FORMATS`] lists them.
//!
//! Binary formats say where numbers lie ([`strided`]) or how a stretch of rows is decoded
//! ([`pieces`]); one reader serves them all. Text formats bring their own reader. Limits are
//! checked before memory is taken; nothing here panics on any input.

pub mod affine;
mod ascii;
pub mod axes;
pub mod cache;
mod codecs;
pub mod compressed;
pub mod laned;
pub mod pieces;
pub mod stored;
pub mod streamed;
pub mod strided;
pub mod text;

mod choose;
mod folder;
mod kind;
mod registry;
mod snapshot;
mod writers;

mod csv;
mod gadget;
mod genericio;
mod hdf5;
mod lammps;
mod npy;
mod npz;
mod ply;
mod splats;
mod vtk_legacy;
mod vtk_xml;
mod xyz;

pub use choose::{Choice, describe, read, read_later, read_selected};
pub use kind::Kind;
pub use registry::{FORMATS, Format, Head, detect, open, spool};
pub use snapshot::{Description, Field, Fields, Frames, Mass, OpenOptions, Snapshot, Species, Weights};
pub use splats::{SPLAT_PLY_BYTES, write_splats};
pub use writers::{WRITERS, Writer, writer_for};

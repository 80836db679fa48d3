//! Other people's files: what they say about themselves, and their particles.
//!
//! [`Choice::read`] gives the particles that are chosen, [`Choice::read_later`] the same to be read in parts,
//! and [`Choice::describe`] what the files say. Below them, [`Choice::open`] finds a file's format by its content and gives
//! a [`Snapshot`]: a [`Description`] first (species, fields, units, box, frames), then a
//! [`particlegs::particles::SnapshotReader`] for the species and fields that were chosen. One file a
//! format; [`Choice::formats`] lists them. A [`Writer`] writes particles in one of [`Writer::all`].
//!
//! Binary formats say where numbers lie (`strided`) or how a stretch of rows is decoded (`pieces`);
//! one reader serves them all. Text formats bring their own reader. Limits are checked before memory is
//! taken; nothing here panics on any input.

mod affine;
mod array;
mod ascii;
mod axes;
mod cache;
mod codecs;
mod compressed;
mod laned;
mod pieces;
mod stored;
mod streamed;
mod strided;
mod text;

mod choose;
mod fields;
mod folder;
mod foreign;
mod kind;
mod raw;
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

pub use array::Array;
pub use choose::Choice;
pub use csv::Catalogue;
pub use kind::PathKind;
pub use registry::Format;
pub use snapshot::{Description, Snapshot, Species, SpeciesField, SpeciesMass, TrajectoryFrames, Weights};
pub use splats::write_splats;
pub use writers::Writer;

/// A result whose error is in words, without the file.
type TextResult<T> = std::result::Result<T, String>;

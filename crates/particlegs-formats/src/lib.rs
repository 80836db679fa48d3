//! Other people's files: what they say about themselves, and their particles.
//!
//! [`Choice::read`] gives the particles that are chosen, [`Choice::read_later`] the same to be read in parts,
//! and [`Choice::describe`] what the files say. Below them, [`Choice::open`] finds a file's format by its content and gives
//! a [`Snapshot`]: a [`Description`] first (species, fields, units, box, frames), then a
//! [`particlegs_particles::SnapshotReader`] for the species and fields that were chosen. One file a
//! format; [`Choice::formats`] lists them. A [`Writer`] writes particles in one of [`Writer::all`].
//!
//! Binary formats say where numbers lie (`numbers`) or how a stretch of rows is decoded (`pieces`);
//! one reader serves them all. Text formats bring their own reader. Limits are checked before memory is
//! taken; nothing here panics on any input.

mod affine;
mod ascii;
mod atoms;
mod axes;
mod blosc;
mod cache;
mod codecs;
mod columns;
mod compression;
mod frames;
mod numbers;
mod pieces;
mod stored_bytes;
mod stream_reader;
mod text;
mod wrapping;

mod choice;
mod fields;
mod folder;
mod foreign;
mod format;
mod halo_file;
mod open;
mod path_kind;
mod physical;
mod raw;
mod read;
mod registry;
mod single_file;
mod snapshot;
mod snapshot_order;
mod topology;
mod writers;

mod asdf;
mod csv;
mod dcd;
mod gadget;
mod genericio;
mod gro;
mod gromacs;
mod gsd;
mod hdf5;
mod lammps;
mod npy;
mod npz;
mod pdb;
mod ply;
mod poscar;
mod splats;
mod tipsy;
mod vtk_legacy;
mod vtk_xml;
mod xyz;

#[cfg(test)]
mod testing;

pub use choice::{Choice, Weights};
pub use csv::Catalogue;
pub use format::Format;
pub use halo_file::{is_hdf5, write_haloes};
pub use npy::Array;
pub use path_kind::PathKind;
pub use physical::VelocityConvention;
pub use snapshot::{AbsentField, Description, Snapshot, Species, SpeciesField, SpeciesMass, TrajectoryFrames};
pub use snapshot_order::run_snapshots;
pub use splats::write_splats;
pub use topology::selection::AtomSelection;
pub use writers::Writer;

/// A result whose error is in words, without the file.
type TextResult<T> = std::result::Result<T, String>;

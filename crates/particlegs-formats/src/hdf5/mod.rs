//! HDF5 snapshots of Gadget-2/3/4, AREPO, SWIFT, GIZMO: groups `PartType0` ... with data sets of rows; plain tables.
//!
//! The container (superblock, groups, attributes, index of chunks) is read by `hdf5-reader`, which
//! stays hidden in [`container`], [`attributes`], [`storage`] and [`filters`]. Numbers are read by
//! us: in place where they lie in one stretch, else chunk by chunk, on all cores.

mod attributes;
mod columns;
mod container;
mod encode;
mod files;
mod filters;
mod h5md;
mod header;
mod packed;
mod reader;
mod snapshot;
mod storage;
mod tables;
mod units;
mod virtual_sets;
mod write;

pub use encode::{OutDataSet, OutGroup, OutValue, plan};
pub use write::{fields, write};

use crate::Format;
use crate::format::FileHead;
use std::path::Path;

pub const FORMAT: Format =
    Format { name: "hdf5", title: "HDF5 snapshot (Gadget, AREPO, SWIFT, GIZMO)", detect, open: snapshot::open };

/// The signature at byte 0, or after a block of the user's, at 512, 1024, 2048 ...
fn detect(head: &FileHead) -> bool {
    let at = std::iter::once(0).chain((9..).map(|k| 1usize << k));
    at.take_while(|&k| k < head.bytes.len()).any(|k| head.bytes[k..].starts_with(&container::SIGNATURE))
}

/// Whether a file has no type of particles, such as a catalogue of groups.
pub fn is_catalogue(path: &Path) -> bool {
    let groups = container::Container::open(path).and_then(|c| c.groups());
    groups.is_ok_and(|groups| groups.iter().all(|g| snapshot::kind_of(&g.0).is_none()))
}

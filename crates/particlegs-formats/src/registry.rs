//! The formats that are read.

use crate::Choice;
use crate::format::{FileHead, Format};
use particlegs_core::{Error, Result};

/// All formats, the surest signatures first, tables of text last.
pub(crate) static FORMATS: &[Format] = &[
    crate::hdf5::FORMAT,
    crate::genericio::FORMAT,
    crate::npy::FORMAT,
    crate::npz::FORMAT,
    crate::ply::FORMAT,
    crate::vtk_legacy::FORMAT,
    crate::vtk_xml::FORMAT,
    crate::splats::GLB,
    crate::splats::SPZ,
    crate::gromacs::xtc::FORMAT,
    crate::gromacs::trr::FORMAT,
    crate::dcd::FORMAT,
    crate::tipsy::FORMAT,
    crate::gsd::FORMAT,
    crate::asdf::FORMAT,
    crate::gadget::FORMAT,
    crate::lammps::FORMAT,
    crate::lammps::data::FORMAT,
    crate::pdb::FORMAT,
    crate::poscar::FORMAT,
    crate::poscar::XDATCAR,
    crate::gro::FORMAT,
    crate::xyz::FORMAT,
    crate::splats::SPLAT,
    crate::csv::FORMAT,
];

/// The first format that takes a file to be its own.
pub(crate) fn format_of(head: &FileHead) -> Option<&'static Format> {
    FORMATS.iter().find(|f| (f.detect)(head))
}

pub(crate) fn named(name: &str) -> Result<&'static Format> {
    let unknown = || Error::argument(format!("unknown format `{name}`; known formats: {}", names()));
    FORMATS.iter().find(|f| f.name == name).ok_or_else(unknown)
}

/// All names, for messages.
pub(crate) fn names() -> String {
    FORMATS.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")
}

impl Choice {
    /// Names of all formats ([`Choice::format`]), in the order in which a file's content is asked for them.
    pub fn formats() -> impl Iterator<Item = &'static str> {
        FORMATS.iter().map(|f| f.name)
    }
}

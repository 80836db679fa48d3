//! Topologies read from the files that name atoms.

use super::{Topology, psf};
use crate::detect::detect;
use crate::format::FileHead;
use crate::{Choice, gro, lammps, pdb};
use particlegs_core::{Error, Result};
use std::path::Path;

impl Topology {
    /// Of a file that a user names, of its first frame.
    pub fn read(path: &Path) -> Result<Topology> {
        let head = FileHead::read(path)?;
        if psf::is_psf(&head) {
            return psf::read(path);
        }
        let format = detect(path)?.name;
        let mut topology = Topology::of_format(format, path, Some(0), true)?.ok_or_else(|| {
            let message = format!("a file of the format `{format}` holds no topology");
            Error::input_with(path, message, "use a GRO, PDB, PSF or LAMMPS data file")
        })?;
        if topology.masses.len() < topology.count {
            topology.weigh();
        }
        Ok(topology)
    }

    /// Of a file of a format that names atoms, at a frame: in the order of the file, or as trajectories have them
    /// (`sorted`). `None` of other formats.
    pub fn of_format(format: &str, path: &Path, frame: Option<i64>, sorted: bool) -> Result<Option<Topology>> {
        let choice = Choice { frame, ..Choice::default() };
        Ok(Some(match format {
            f if f == gro::FORMAT.name => gro::topology(path, &choice)?,
            f if f == pdb::FORMAT.name => pdb::topology(path, &choice)?,
            f if f == lammps::data::FORMAT.name => lammps::data::topology(path, sorted)?,
            _ => return Ok(None),
        }))
    }
}

//! LAMMPS text dump. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// LAMMPS text dump.
pub const FORMAT: Format = Format {
    name: "lammps",
    title: "LAMMPS text dump",
    detect: |_| false,
    open: |paths, _| Err(Error::input(&paths[0], "LAMMPS text dump cannot be read yet")),
};

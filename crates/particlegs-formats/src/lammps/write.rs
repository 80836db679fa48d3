//! LAMMPS text out.

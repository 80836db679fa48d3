//! What a snapshot says about itself.

use crate::space::Cell;

/// Metadata of a snapshot, read before any particle. `None` means that the source does not say;
/// nothing is guessed.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct SnapshotMeta {
    /// Name shown to people: the file's or folder's.
    pub name: String,
    /// Simulation cell.
    pub cell: Option<Cell>,
    /// Unit of length as text, e.g. `Mpc/h`.
    pub length_unit: Option<String>,
    /// Unit of mass as text, e.g. `Msun/h`.
    pub mass_unit: Option<String>,
    /// Mass of one particle where all are equal, in `mass_unit`.
    pub particle_mass: Option<f64>,
    /// Are lengths comoving?
    pub comoving: Option<bool>,
    /// Cosmological scale factor.
    pub scale_factor: Option<f64>,
    /// Hubble parameter h.
    pub hubble: Option<f64>,
    /// Simulation time, in the source's unit.
    pub time: Option<f64>,
}

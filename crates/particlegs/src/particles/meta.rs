//! What a snapshot says about itself.

use super::units::{is_known_length, is_known_mass};
use crate::space::Cell;
use crate::{Error, Result};

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

impl SnapshotMeta {
    /// Takes what a user states, box lengths, a unit of length and one of mass, over what the files say; numbers are not converted. The corner of a stated box is the
    /// file's, else 0. Gives what a user should know: a unit that is not known by name, and where the
    /// files say something else.
    ///
    /// # Errors
    /// [`Error::Argument`] for lengths that are not positive.
    pub fn state(&mut self, box_lengths: Option<[f64; 3]>, units: [Option<&str>; 2]) -> Result<Vec<String>> {
        let mut notes = Vec::new();
        if let Some(lengths) = box_lengths {
            if !lengths.iter().all(|l| *l > 0.0 && l.is_finite()) {
                return Err(Error::argument(format!(
                    "box lengths {} must be positive",
                    super::sidecar::listed(&lengths)
                )));
            }
            let origin = self.cell.map_or([0.0; 3], |c| c.origin);
            let cell = Cell { origin, ..Cell::orthogonal(lengths) };
            if let Some(said) = self.cell.replace(cell).filter(|said| *said != cell) {
                notes.push(format!("the box is taken as {}; the file says {}", cell.in_words(), said.in_words()));
            }
        }
        let mut state = |of: &str, stated: Option<&str>, said: &mut Option<String>, known: fn(&str) -> bool| {
            let Some(unit) = stated else { return };
            if !known(unit) {
                notes.push(format!("`{unit}` is no unit of {of} that is known: it is kept as a label"));
            }
            if let Some(other) = said.replace(unit.into()).filter(|other| other != unit) {
                notes.push(format!(
                    "the unit of {of} is taken as {unit}; the file says {other}; no number is converted"
                ));
            }
        };
        state("length", units[0], &mut self.length_unit, is_known_length);
        state("mass", units[1], &mut self.mass_unit, is_known_mass);
        Ok(notes)
    }
}

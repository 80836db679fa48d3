//! Metadata of a snapshot.

use particlegs_core::model::{Cosmology, Dimension, Epoch, Unit, UnitSystem, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// Metadata of a snapshot, read before any particle. `None` means that the source does not say;
/// nothing is guessed.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct SnapshotMeta {
    /// Name shown to people: the file's or folder's.
    pub name: String,
    /// Simulation cell, in the unit of length.
    pub cell: Option<Cell>,
    /// Units of lengths, masses and times.
    #[serde(flatten)]
    pub units: Units,
    /// Mass of one particle where all are equal, in the unit of mass.
    pub particle_mass: Option<f64>,
    /// Name of weights that are not masses, such as `Charge`: the unit of mass is theirs then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight_name: Option<String>,
    /// Hubble and density parameters.
    #[serde(flatten)]
    pub cosmology: Cosmology,
    /// Scale factor, time and step.
    #[serde(flatten)]
    pub epoch: Epoch,
    /// Names of the fields that the source has beside positions and weights.
    #[serde(skip)]
    pub fields: Vec<String>,
    /// Units of those that have no other place for them, by name.
    #[serde(skip)]
    pub field_units: BTreeMap<String, String>,
}

impl SnapshotMeta {
    /// Units with the scale factor and h that convert them.
    pub fn unit_system(&self) -> UnitSystem<'_> {
        UnitSystem::new(&self.units, &self.epoch, &self.cosmology)
    }

    /// Takes what a user states, box lengths, a unit of length and one of mass, over what the files say; numbers are
    /// not converted. The corner of a stated box is the file's, else 0. Gives notes for the user: a unit that is not
    /// known by name, and values of the files that differ.
    pub fn state(&mut self, box_lengths: Option<[f64; 3]>, units: [Option<&str>; 2]) -> Result<Vec<String>> {
        let mut notes = Vec::new();
        if let Some(lengths) = box_lengths {
            let origin = self.cell.map_or([0.0; 3], |c| c.origin);
            let upright = Cell::orthogonal(lengths);
            let sound = lengths.iter().all(|l| *l >= 0.0 && l.is_finite());
            let cell = Cell::stated(origin, upright.vectors, upright.periodic)
                .filter(|_| sound)
                .ok_or_else(|| Error::argument(format!("box lengths {} must be positive", listed(&lengths))))?;
            if let Some(said) = self.cell.replace(cell).filter(|said| *said != cell) {
                notes.push(format!("the box is {cell} as stated, not {said} as in the file"));
            }
        }
        let mut state = |quantity: &str, stated: Option<&str>, said: &mut Option<Unit>, dimension| {
            let Some(text) = stated else { return };
            if !Unit::is_known(text, dimension) {
                notes.push(format!("`{text}` is not a known unit of {quantity}, so it is only a label"));
            }
            let unit = Unit::parse(text, dimension);
            if let Some(other) = said.replace(unit).filter(|other| other.text != text) {
                notes.push(format!(
                    "the unit of {quantity} is {text} as stated, not {} as in the file; no number is converted",
                    other.text
                ));
            }
        };
        state("length", units[0], &mut self.units.length, Dimension::Length);
        state("mass", units[1], &mut self.units.mass, Dimension::Mass);
        self.units = std::mem::take(&mut self.units).settled();
        Ok(notes)
    }
}

/// Metadata of a file that says nothing but its name.
pub(super) fn named(path: &Path) -> SnapshotMeta {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned());
    SnapshotMeta { name: name.unwrap_or_else(|| "snapshot".into()), ..SnapshotMeta::default() }
}

/// Numbers as people write them: `1, 2, 3`.
pub(super) fn listed(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

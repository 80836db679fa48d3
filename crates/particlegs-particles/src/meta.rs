//! Metadata of a snapshot: box, units, cosmology, layers; also from the meta.json beside raw data.

use particlegs_core::model::{Cosmology, Dimension, Epoch, Layer, Mass, Unit, UnitSystem, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::input::{self, Begins, read_own};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
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
            // A length of 0 states an axis along which nothing repeats.
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
fn named(path: &Path) -> SnapshotMeta {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned());
    SnapshotMeta { name: name.unwrap_or_else(|| "snapshot".into()), ..SnapshotMeta::default() }
}

/// Numbers as people write them: `1, 2, 3`.
fn listed(numbers: &[f64]) -> String {
    numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

/// A page or two, in truth.
const FILE: input::Form =
    input::Form { title: "a snapshot's metadata", begins: Begins::Object, most: 1 << 20, expansion: 16 };

#[derive(Deserialize, Default)]
struct SidecarForm {
    #[serde(rename = "box")]
    lengths: Option<CellLengths>,
    periodic: Option<PeriodicAxes>,
    origin: Option<[f64; 3]>,
    cell: Option<Cell>,
    layers: Option<Vec<LayerForm>>,
    length_unit: Option<String>,
    mass_unit: Option<String>,
    time_unit: Option<String>,
    particle_mass: Option<f64>,
    comoving: Option<bool>,
    scale_factor: Option<f64>,
    a: Option<f64>,
    redshift: Option<f64>,
    h: Option<f64>,
    #[serde(alias = "Omega_m")]
    omega_matter: Option<f64>,
    #[serde(alias = "Omega_L")]
    omega_lambda: Option<f64>,
    #[serde(alias = "Omega_b")]
    omega_baryon: Option<f64>,
    time: Option<f64>,
    frame: Option<u64>,
    step: Option<i64>,
    #[serde(default)]
    field_units: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum CellLengths {
    Cube(f64),
    Each([f64; 3]),
}

#[derive(Deserialize, Clone, Copy)]
#[serde(untagged)]
enum PeriodicAxes {
    All(bool),
    Each([bool; 3]),
}

#[derive(Deserialize)]
struct LayerForm {
    name: String,
    particles: usize,
    particle_mass: Option<f64>,
    #[serde(default)]
    weighted: bool,
}

/// Metadata beside raw data.
pub(super) struct Sidecar {
    /// Box, units, cosmology.
    pub meta: SnapshotMeta,
    /// The f64 point that the columns are relative to.
    pub origin: [f64; 3],
    /// Layers; empty where it tells no kinds apart.
    pub layers: Vec<Layer<Range<usize>>>,
}

/// Reads `file` where it exists; the snapshot is named after `place`.
pub(super) fn read(place: &Path, file: &Path) -> Result<Sidecar> {
    // A place such as `.` has a name only in full.
    let mut meta = named(&std::fs::canonicalize(place).unwrap_or_else(|_| place.to_path_buf()));
    let none = [0.0; 3];
    let Some(text) = read_own(file, FILE)? else { return Ok(Sidecar { meta, origin: none, layers: Vec::new() }) };
    let form: SidecarForm =
        serde_json::from_slice(&text).map_err(|e| Error::input(file, format!("this is not snapshot metadata: {e}")))?;
    let positive = |v: &f64| *v > 0.0 && v.is_finite();
    if let Some(lengths) = form.lengths {
        let lengths = match lengths {
            CellLengths::Cube(l) => [l; 3],
            CellLengths::Each(l) => l,
        };
        if !lengths.iter().all(positive) {
            return Err(Error::input(file, format!("box lengths {} must be positive", listed(&lengths))));
        }
        meta.cell = Some(Cell { periodic: periodic(form.periodic), ..Cell::orthogonal(lengths) });
    }
    if let Some(cell) = form.cell {
        let finite = cell.vectors.iter().flatten().chain(&cell.origin).all(|v| v.is_finite());
        if !finite || cell.inverse().is_none() {
            return Err(Error::input(file, "`cell` must have finite vectors that span a volume"));
        }
        meta.cell = Some(cell);
    }
    meta.units = Units {
        time: form.time_unit.map(|text| Unit::parse(&text, Dimension::Time)),
        ..Units::new(form.length_unit.as_deref(), form.mass_unit.as_deref(), form.comoving)
    };
    meta.particle_mass = form.particle_mass.filter(positive);
    meta.cosmology = Cosmology {
        hubble: form.h.filter(positive),
        omega_matter: form.omega_matter,
        omega_lambda: form.omega_lambda,
        omega_baryon: form.omega_baryon,
    };
    meta.epoch = Epoch {
        scale_factor: form.scale_factor.or(form.a).or(form.redshift.map(|z| 1.0 / (1.0 + z))).filter(positive),
        time: form.time,
        frame: form.frame,
        step: form.step,
    };
    meta.field_units = form.field_units;
    let origin = form.origin.unwrap_or_default();
    if origin.iter().any(|v| !v.is_finite()) {
        return Err(Error::input(file, "`origin` must be finite"));
    }
    Ok(Sidecar { meta, origin, layers: layers(form.layers.unwrap_or_default(), file)? })
}

fn periodic(said: Option<PeriodicAxes>) -> [bool; 3] {
    match said {
        None => [true; 3],
        Some(PeriodicAxes::All(all)) => [all; 3],
        Some(PeriodicAxes::Each(each)) => each,
    }
}

/// Layers one after the other; those without particles are left out.
fn layers(forms: Vec<LayerForm>, file: &Path) -> Result<Vec<Layer<Range<usize>>>> {
    if !forms.is_empty() && forms.iter().all(|f| f.particles == 0) {
        return Err(Error::input(file, "its `layers` contain no particles"));
    }
    let mut end = 0usize;
    let mut layers = Vec::with_capacity(forms.len().min(1024));
    for form in forms {
        let start = end;
        end = start.checked_add(form.particles).ok_or_else(|| Error::input(file, "too many particles in `layers`"))?;
        let LayerForm { name, particle_mass, weighted, .. } = form;
        if start < end {
            layers.push(Layer { name, mass: Mass::new(weighted, particle_mass), content: start..end });
        }
    }
    Ok(layers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_without_particles_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("meta.json");
        let layers = |text: &str| {
            std::fs::write(&file, format!("{{\"layers\": [{text}]}}")).unwrap();
            read(folder.path(), &file).map(|s| s.layers.iter().map(|l| l.content.clone()).collect::<Vec<_>>())
        };
        let layer = |name: &str, n: u32| format!("{{\"name\": \"{name}\", \"particles\": {n}}}");
        assert_eq!(layers(&[layer("a", 0), layer("b", 3), layer("c", 2)].join(",")).unwrap(), [0..3, 3..5]);
        assert!(layers(&layer("a", 0)).unwrap_err().to_string().contains("contain no particles"));
        assert!(layers("").unwrap().is_empty());
    }
}

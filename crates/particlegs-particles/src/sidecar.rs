//! meta.json beside raw data: box, units, cosmology, layers.

use super::SnapshotMeta;
use super::meta::{listed, named};
use particlegs_core::model::{Cosmology, Dimension, Epoch, Layer, Mass, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::input::{self, Begins, read_own};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

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
pub struct Sidecar {
    /// Box, units, cosmology.
    pub meta: SnapshotMeta,
    /// The f64 point that the columns are relative to.
    pub origin: [f64; 3],
    /// Layers; empty where it tells no kinds apart.
    pub layers: Vec<Layer<Range<usize>>>,
}

/// Reads `file` where it exists; the snapshot is named after `place`.
pub fn read(place: &Path, file: &Path) -> Result<Sidecar> {
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

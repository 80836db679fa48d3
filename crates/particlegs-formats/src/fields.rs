//! Fields that are carried from a snapshot to a file: how they are read, and what they are called there.

use crate::physical::physical;
use crate::{Choice, Snapshot, Species, SpeciesField, Weights};
use particlegs_core::Result;
use particlegs_particles::{LayerFields, Number, Run, SelectedParticles, SnapshotReader, SourceField};
use std::sync::Arc;

/// Components that a field may have in a file that is written.
const MOST_COMPONENTS: u32 = 1024;

/// Whether a field of this name tells particles apart.
pub(crate) fn is_id(name: &str) -> bool {
    let names = ["particleids", "particleid", "particle_id", "id", "ids", "pid", "pids", "particle_identifier"];
    names.contains(&&name.to_ascii_lowercase()[..])
}

/// The type that holds a field's numbers; none for what are no numbers.
pub(crate) fn number_of(field: &SpeciesField) -> Option<Number> {
    Some(match &field.kind[..] {
        "f16" | "f32" => Number::F32,
        "f64" => Number::F64,
        "i8" => Number::I8,
        "i16" => Number::I16,
        "i24" | "i32" => Number::I32,
        "i64" => Number::I64,
        "u8" => Number::U8,
        "u16" => Number::U16,
        "u32" => Number::U32,
        "u64" => Number::U64,
        // Numbers of fewer bits than their bytes have.
        packed => match (packed.get(..1)?, packed.get(1..)?.parse().ok()?) {
            ("i", 1..=32) => Number::I32,
            ("u", 1..=32) => Number::U32,
            ("i", 33..=64) => Number::I64,
            ("u", 33..=64) => Number::U64,
            ("f", 1..=64) => Number::F64,
            _ => return None,
        },
    })
}

/// The fields that hold the positions that `choice` reads.
fn positions<'a>(species: &'a Species, choice: &'a Choice) -> Vec<&'a str> {
    let chosen = choice.positions.as_deref().unwrap_or(&species.positions);
    if species.fields.iter().any(|f| f.name == chosen) {
        return vec![chosen];
    }
    let name = |text: &'a str| text.trim().rsplit_once('[').map_or(text.trim(), |(name, _)| name);
    chosen.split(',').map(name).collect()
}

/// Names of the fields that are neither positions nor weights, nor what species are called by.
pub(crate) fn others(species: &Species, choice: &Choice) -> Vec<String> {
    let position_names = positions(species, choice);
    let weight = species.weight_field("", &choice.weights).ok().flatten();
    let is_name =
        |f: &SpeciesField| f.kind == "text" && ["species", "element", "symbol", "type"].contains(&&f.name[..]);
    let fields = species.fields.iter().filter(|f| !position_names.contains(&&f.name[..]) && !is_name(f));
    fields.map(|f| f.name.clone()).filter(|name| weight.as_ref() != Some(name)).collect()
}

/// The fields of species `index` beside its positions, and these where float32 does not hold them.
pub(crate) fn fields_of(snapshot: &dyn Snapshot, index: usize, choice: &Choice) -> Result<LayerFields> {
    let species = &snapshot.description().species[index];
    let position_names = positions(species, choice);
    let convention = snapshot.convention();
    let mut fields: Vec<SourceField> = Vec::new();
    for field in &species.fields {
        let Some(number) = number_of(field) else { continue };
        let is_named = field.name == field.name.trim() && !field.name.contains(',');
        let is_new = !position_names.contains(&&field.name[..]) && fields.iter().all(|f| f.name != field.name);
        if is_named && is_new && (1..=MOST_COMPONENTS).contains(&field.components) {
            let (name, components) = (field.name.clone(), field.components);
            let attributes = snapshot.attributes(index, &name);
            let (unit, meta) = (field.unit.clone(), &snapshot.description().meta);
            let physical = physical((&name, components), unit.as_deref(), &attributes, &convention, meta);
            fields.push(SourceField { name, number, components, unit, attributes, physical });
        }
    }
    // Vectors first: each is one read then.
    fields.sort_by_key(|f| f.components != 3);
    let readers = match readers(snapshot, index, choice, &fields) {
        Ok(readers) => readers,
        // One field that cannot be read must not take the others with it.
        Err(_) => {
            fields.retain(|f| readers(snapshot, index, choice, std::slice::from_ref(f)).is_ok());
            readers(snapshot, index, choice, &fields)?
        }
    };
    let is_wide =
        |f: &&SpeciesField| position_names.contains(&&f.name[..]) && number_of(f).is_some_and(|n| n != Number::F32);
    let wide = species.fields.iter().any(|f| is_wide(&f));
    let positions = || snapshot.reader(index, &Choice { weights: Weights::None, ..choice.clone() });
    let absent = snapshot.description().absent.iter().map(|f| (f.name.clone(), f.why.clone())).collect();
    Ok(LayerFields::new(fields, readers, wide.then(positions).transpose()?.map(Arc::from))?.with_absent(absent))
}

fn readers(
    snapshot: &dyn Snapshot,
    index: usize,
    choice: &Choice,
    fields: &[SourceField],
) -> Result<Vec<Arc<dyn SnapshotReader>>> {
    let component = |f: &SourceField, k: u32| match f.components {
        1 => f.name.clone(),
        _ => format!("{}[{k}]", f.name),
    };
    let all = fields.iter().flat_map(|f| (0..f.components).map(move |k| (f, component(f, k))));
    let all: Vec<(&SourceField, String)> = all.collect();
    all.chunks(3)
        .map(|three| {
            // A reader always gives three columns: the last name fills those that are left over.
            let last = &three[three.len() - 1].1;
            let name = |k: usize| three.get(k).map_or(last, |(_, name)| name);
            let positions = match three[0].0 {
                one if one.components == 3 && name(0).ends_with("[0]") => one.name.clone(),
                _ => format!("{},{},{}", name(0), name(1), name(2)),
            };
            let choice =
                Choice { positions: Some(positions), weights: Weights::None, as_stored: true, ..choice.clone() };
            snapshot.reader(index, &choice).map(Arc::from)
        })
        .collect()
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OutField {
    pub name: String,
    pub number: Number,
    /// The run's columns that are its components.
    pub columns: Vec<usize>,
    /// Unit as text, where the source says.
    pub unit: Option<String>,
    /// Numbers that the source says about it.
    pub attributes: Vec<(String, f64)>,
    pub sources: Vec<String>,
    /// Factor of real numbers.
    pub factor: f64,
    /// Factor to peculiar velocities in km/s or physical specific energies in (km/s)^2, where the source tells.
    pub physical: Option<f64>,
}

impl OutField {
    /// Appends its numbers of a run, row by row.
    pub fn append(&self, run: &Run, out: &mut Vec<u8>) {
        for i in 0..run.columns[0].len() {
            self.columns.iter().for_each(|&c| match self.factor {
                // As it is stored: whole numbers of 64 bits do not fit the f64 that a factor needs.
                1.0 => self.number.append(run.field(c, i), out),
                factor => {
                    let value = factor * self.number.value(run.field(c, i));
                    self.number.append(self.number.stored(value), out);
                }
            });
        }
    }
}

/// A format's name of a field that all snapshots have, its numbers a particle, and the names in other formats.
pub(crate) type StandardField = (&'static str, usize, &'static [&'static str]);

const VELOCITIES: [[&str; 3]; 3] =
    [["vx", "vy", "vz"], ["vel_x", "vel_y", "vel_z"], ["velocity_x", "velocity_y", "velocity_z"]];

/// A layer's fields in a file: by the standard's names, else their own; those whose names are taken are left out.
pub(crate) fn outputs(fields: &[SourceField], standard: &[StandardField], reserved: &[&str]) -> Vec<OutField> {
    let mut first = 0;
    let mut all: Vec<OutField> = Vec::new();
    for field in fields {
        let count = field.components as usize;
        let columns: Vec<usize> = (first..first + count).collect();
        first += count;
        let SourceField { name, number, unit, attributes, physical, .. } = field.clone();
        let (sources, physical) = (vec![name.clone()], physical.map(|p| p.factor));
        all.push(OutField { sources, name, number, columns, unit, attributes, factor: 1.0, physical });
    }
    for &(name, count, names) in standard {
        if all.iter().any(|f| f.name == name) {
            continue;
        }
        let is = |f: &&mut OutField| f.columns.len() == count && names.contains(&&f.name[..]);
        if let Some(field) = all.iter_mut().find(is) {
            field.name = name.into();
        } else if name == "Velocities" {
            join(&mut all, name);
        }
    }
    let mut taken: Vec<String> = reserved.iter().map(|n| n.to_string()).collect();
    all.retain(|f| {
        let is_new = !taken.contains(&f.name);
        taken.push(f.name.clone());
        is_new
    });
    all
}

/// Three columns of velocities become one of vectors.
fn join(all: &mut Vec<OutField>, name: &str) {
    for names in VELOCITIES {
        let three: Vec<usize> = names.iter().filter_map(|n| all.iter().position(|f| f.name == *n)).collect();
        let [x, y, z] = three[..] else { continue };
        let kind = |i: usize| (all[i].number, &all[i].unit, &all[i].physical);
        if kind(x) != kind(y) || kind(x) != kind(z) {
            continue;
        }
        let columns = three.iter().flat_map(|&i| all[i].columns.clone()).collect();
        let sources = three.iter().flat_map(|&i| all[i].sources.clone()).collect();
        let joined = OutField { name: name.into(), columns, sources, ..all[x].clone() };
        let mut at = 0..;
        all.retain(|_| at.next().is_some_and(|i| !three.contains(&i)));
        all.push(joined);
        return;
    }
}

pub(crate) fn common(
    particles: &SelectedParticles<'_>,
    standard: &[StandardField],
    reserved: &[&str],
) -> Vec<Vec<OutField>> {
    let outputs_of = |fields: &&[SourceField]| outputs(fields, standard, reserved);
    let layers: Vec<Vec<OutField>> = particles.fields().iter().map(outputs_of).collect();
    let Some((first, rest)) = layers.split_first() else { return Vec::new() };
    let alike =
        |a: &OutField, b: &OutField| a.name == b.name && a.number == b.number && a.columns.len() == b.columns.len();
    let all = |field: &OutField| {
        let others = rest.iter().map(|layer| layer.iter().find(|f| alike(f, field)).cloned());
        std::iter::once(Some(field.clone())).chain(others).collect::<Option<Vec<_>>>()
    };
    first.iter().filter_map(all).collect()
}

//! A snapshot whose atoms have names: its species are by residues, elements or types, and atoms can be selected.

use super::Topology;
use crate::pieces::RowBuffer;
use crate::text::table::MOST_SPECIES;
use crate::{
    Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, Weights, axes, dcd, gro, gromacs, hdf5, lammps,
    pdb,
};
use particlegs_core::context::Context;
use particlegs_core::model::{Dimension, Unit};
use particlegs_core::{Error, Hint, Result, parallel};
use particlegs_files::memory;
use particlegs_particles::{RUN, RunSink, SnapshotMeta, SnapshotReader};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Formats whose atoms have names, and those that take them from another file: their atoms are in the same order always.
const NAMES: [&str; 3] = [gro::FORMAT.name, pdb::FORMAT.name, lammps::data::FORMAT.name];
const TRAJECTORIES: [&str; 4] =
    [gromacs::xtc::FORMAT.name, gromacs::trr::FORMAT.name, dcd::FORMAT.name, hdf5::FORMAT.name];

/// The field of masses from a topology.
const MASS: &str = "mass";

struct TopologySnapshot {
    inner: Box<dyn Snapshot>,
    place: String,
    description: Description,
    /// The rows of each species.
    rows: Vec<Arc<[u32]>>,
    /// By row; empty where the topology gives none.
    masses: Arc<[f64]>,
}

/// The snapshot with the names of its atoms, those that are selected; `inner` is one of the format `format` in which all
/// atoms are one species.
pub fn named(inner: Box<dyn Snapshot>, format: &str, path: &Path, choice: &Choice) -> Result<Box<dyn Snapshot>> {
    // HDF5 files without frames are of simulation codes: their particles are no atoms.
    if ![&NAMES[..], &TRAJECTORIES].concat().contains(&format)
        || inner.description().frames.is_none() && format == hdf5::FORMAT.name
    {
        return Err(Error::input(path, format!("a file of the format `{format}` has no atoms that can be named")));
    }
    let topology = match &choice.topology {
        Some(file) => Topology::read(file)?,
        None => Topology::of_format(format, path, choice.frame, false)?.ok_or_else(|| {
            let hint = Hint::from("add ").option("topology", "conf.gro").words(" (GRO, PDB, PSF or LAMMPS data)");
            Error::input_with(path, "the file has no names of atoms", hint)
        })?,
    };
    let all = match &inner.description().species[..] {
        [] => return Ok(inner),
        [one] => one.clone(),
        several => {
            let message =
                format!("the file tells {} particle types apart itself: atoms cannot be named", several.len());
            return Err(Error::input(path, message));
        }
    };
    if all.count != topology.count as u64 {
        let message = format!("the file has {} atoms, but {} has {}", all.count, topology.place, topology.count);
        return Err(Error::input_with(path, message, "name the topology of this system"));
    }
    let mut description = inner.description().clone();
    // The names are there now.
    description.notes.retain(|note| note != super::NO_NAMES);
    let mut atoms: Vec<u32> = match &choice.select {
        None => (0..topology.count as u32).collect(),
        Some(select) => {
            let atoms =
                select.atoms(&topology).map_err(|message| Error::input(path, format!("selection: {message}")))?;
            description.notes.push(format!("{} of {} atoms are selected", atoms.len(), topology.count));
            atoms
        }
    };
    // What the file states itself comes first.
    let weighs = all.mass == SpeciesMass::Unknown && !topology.masses.is_empty();
    if weighs {
        description.meta.units.mass = topology.mass_unit.map(|unit| Unit::parse(unit, Dimension::Mass));
    }
    description.notes.extend(about_masses(&topology, choice, weighs));
    let is_mass = |weights: &Weights| matches!(weights, Weights::Auto) || *weights == Weights::Field(MASS.into());
    if weighs && is_mass(&choice.weights) {
        let all = atoms.len();
        // Sites of water models have no mass, and a weight must be above 0.
        atoms.retain(|&atom| topology.masses[atom as usize] > 0.0);
        if atoms.len() < all {
            description.notes.push(format!("{} sites without a mass are left out", all - atoms.len()));
        }
    }
    if atoms.is_empty() {
        return Err(Error::input(path, "the selection holds no atoms"));
    }
    let species = by_species(&topology, atoms);
    description.species = species.iter().map(|(name, rows)| describe(&all, &topology, name, rows, weighs)).collect();
    let rows = species.into_iter().map(|(_, rows)| rows.into()).collect();
    let masses = if weighs { topology.masses.into() } else { Arc::default() };
    Ok(Box::new(TopologySnapshot { inner, place: path.display().to_string(), description, rows, masses }))
}

/// A note of the source of masses, or of the reason why there are none.
fn about_masses(topology: &Topology, choice: &Choice, weighs: bool) -> Option<String> {
    let place = &topology.place;
    if choice.topology.is_none() {
        let guesses = topology.guesses_elements && choice.select.as_ref().is_some_and(|s| s.asks_for_elements());
        return guesses.then(|| format!("{place} does not state all elements: they follow from the names of atoms"));
    }
    let guess = if topology.guesses_elements { ", which follow from the names of atoms" } else { "" };
    let unknown = (0..topology.count).find(|&atom| topology.elements.get(atom).is_empty());
    Some(match unknown {
        _ if weighs && topology.weighs_by_elements => {
            format!("masses are standard atomic weights of the elements in {place}{guess}")
        }
        _ if weighs => format!("masses are from {place}"),
        _ if !topology.masses.is_empty() => "masses are those of the file itself".into(),
        Some(atom) if topology.names.words.iter().any(|name| !name.is_empty()) => {
            let (name, residue) = (topology.names.get(atom), topology.residues.get(atom));
            let [name, residue] = [name, residue].map(str::escape_debug);
            format!("there are no masses: the element of atom `{name}` of residue `{residue}` is unknown ({place})")
        }
        _ => format!("there are no masses: {place} states none"),
    })
}

/// Names of species and their atoms; one where there are too many.
fn by_species(topology: &Topology, atoms: Vec<u32>) -> Vec<(String, Vec<u32>)> {
    let column = &topology.species;
    let mut species_rows: Vec<Vec<u32>> = vec![Vec::new(); column.words.len()];
    if column.words.len() > MOST_SPECIES {
        return vec![("atoms".into(), atoms)];
    }
    atoms.into_iter().for_each(|atom| species_rows[column.of[atom as usize] as usize].push(atom));
    let name = |word: &String| if word.is_empty() { "unnamed".into() } else { word.clone() };
    column.words.iter().map(name).zip(species_rows).filter(|(_, rows)| !rows.is_empty()).collect()
}

fn describe(all: &Species, topology: &Topology, name: &str, rows: &[u32], weighs: bool) -> Species {
    let mut fields = all.fields.clone();
    for (name, column) in [
        ("residue", &topology.residues),
        ("name", &topology.names),
        ("element", &topology.elements),
        ("type", &topology.types),
    ] {
        let is_stated = column.words.iter().any(|word| !word.is_empty());
        if is_stated && fields.iter().all(|f| f.name != name) {
            fields.push(SpeciesField::new(name, "text", 1));
        }
    }
    let mut mass = all.mass.clone();
    if weighs {
        let unit = topology.mass_unit.map(String::from);
        fields.push(SpeciesField { unit, ..SpeciesField::new(MASS, "f64", 1) });
        let masses = || rows.iter().map(|&row| topology.masses[row as usize]);
        let first = topology.masses[rows[0] as usize];
        mass = match masses().all(|mass| mass == first) && first > 0.0 {
            true => SpeciesMass::Each(first),
            false => SpeciesMass::Field(MASS.into()),
        };
    }
    let lower = name.to_lowercase();
    let aliases = lower.strip_prefix("type ").map(String::from).into_iter().chain([lower.clone()]).collect();
    Species { name: name.into(), aliases, count: rows.len() as u64, mass, fields, positions: all.positions.clone() }
}

impl TopologySnapshot {
    /// Positions of all atoms in the fields that `names` are, as a choice.
    fn inner(&self, choice: &Choice, positions: Option<String>) -> Result<Box<dyn SnapshotReader>> {
        self.inner.reader(0, &Choice { positions, weights: Weights::None, ..choice.clone() })
    }

    /// The numbers of a scalar field, of all atoms.
    fn column(&self, field: &str, choice: &Choice) -> Result<Arc<[f64]>> {
        let is_stored = self.inner.description().species[0].fields.iter().any(|f| f.name == field);
        if !is_stored {
            return Ok(self.masses.clone());
        }
        let reader = self.inner(choice, Some([field; 3].join(",")))?;
        memory::require("the weights of the atoms", 8 * reader.count())?;
        let mut all = Vec::new();
        reader.read_wide(0..runs(&*reader), &mut |_, [x, ..]| {
            all.extend_from_slice(x);
            Ok(())
        })?;
        Ok(all.into())
    }
}

fn runs(reader: &dyn SnapshotReader) -> u64 {
    reader.count().div_ceil(RUN as u64)
}

impl Snapshot for TopologySnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let (Some(species), Some(rows)) = (self.description.species.get(species), self.rows.get(species)) else {
            return Err(Error::argument(format!("particle type {species} does not exist")));
        };
        let columns = axes::columns(&self.place, species, choice)?;
        let is_mass = |k: usize| columns[k].field == MASS && !self.masses.is_empty();
        let positions = [0, 1, 2].map(is_mass).contains(&true).then(|| {
            let name = |k: usize| match is_mass(k) {
                // The file has no masses: any column is read in their place, and replaced.
                true => format!("{}[0]", species.positions),
                false if species.fields.iter().any(|f| f.name == columns[k].field && f.components == 1) => {
                    columns[k].field.clone()
                }
                false => format!("{}[{}]", columns[k].field, columns[k].component),
            };
            [0, 1, 2].map(name).join(",")
        });
        let inner = self.inner(choice, positions.or_else(|| choice.positions.clone()))?;
        let weights = columns.get(3).map(|weight| self.column(&weight.field, choice)).transpose()?;
        let masses = [0, 1, 2].map(|k| is_mass(k).then(|| self.masses.clone()));
        let meta = self.description.meta_of(species);
        Ok(Box::new(AtomReader { meta, inner, rows: rows.clone(), masses, weights }))
    }
}

/// Some atoms of a snapshot.
struct AtomReader {
    meta: SnapshotMeta,
    /// Positions of all.
    inner: Box<dyn SnapshotReader>,
    rows: Arc<[u32]>,
    /// Masses in place of x, y or z, by row of all.
    masses: [Option<Arc<[f64]>>; 3],
    weights: Option<Arc<[f64]>>,
}

impl AtomReader {
    /// Hands over the atoms of every run of `runs`, in one pass.
    fn pass(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, &RowBuffer) -> Result<()>) -> Result<()> {
        let first = (runs.start as usize * RUN).min(self.rows.len());
        let end = (runs.end as usize * RUN).min(self.rows.len());
        let (Some(&low), Some(&high)) = (self.rows[first..end].first(), self.rows[first..end].last()) else {
            return Ok(());
        };
        let mut run = runs.start;
        let mut rows = RowBuffer::default();
        let mut wanted = self.rows[first..end].iter().map(|&row| row as usize).peekable();
        // Atoms ascend: one pass over the runs from the first to the last finds all.
        let of_inner = u64::from(low) / RUN as u64..u64::from(high) / RUN as u64 + 1;
        self.inner.read_wide(of_inner, &mut |inner_run, position| {
            let start = inner_run as usize * RUN;
            while let Some(row) = wanted.next_if(|row| row - start < position[0].len()) {
                for k in 0..3 {
                    let mass = self.masses[k].as_ref().map(|masses| masses[row]);
                    rows.position[k].push(mass.unwrap_or_else(|| position[k][row - start]));
                }
                rows.weight.extend(self.weights.as_ref().map(|weights| weights[row]));
                if rows.position[0].len() == RUN || wanted.peek().is_none() {
                    sink(run, &rows)?;
                    rows.clear();
                    run += 1;
                }
            }
            Ok(())
        })
    }
}

impl SnapshotReader for AtomReader {
    fn meta(&self) -> &SnapshotMeta {
        &self.meta
    }

    fn count(&self) -> u64 {
        self.rows.len() as u64
    }

    fn has_weights(&self) -> bool {
        self.weights.is_some()
    }

    fn origin(&self) -> [f64; 3] {
        let origin = self.inner.origin();
        [0, 1, 2].map(|k| if self.masses[k].is_some() { 0.0 } else { origin[k] })
    }

    fn random_access(&self) -> bool {
        self.inner.random_access()
    }

    fn read(&self, runs: Range<u64>, context: &Context<'_>, sink: &RunSink<'_>) -> Result<()> {
        let pass = |runs: Range<u64>| {
            let mut columns = <[Vec<f32>; 4]>::default();
            self.pass(runs, &mut |run, rows| {
                context.check()?;
                sink(run, rows.chunk(self.origin(), self.has_weights(), &mut columns))?;
                context.advance(rows.position[0].len() as u64);
                Ok(())
            })
        };
        // A stream is passed over once for all runs.
        if self.random_access() { parallel::try_for_each(runs, |run| pass(run..run + 1)) } else { pass(runs) }
    }

    fn read_wide(&self, runs: Range<u64>, sink: &mut dyn FnMut(u64, [&[f64]; 3]) -> Result<()>) -> Result<()> {
        self.pass(runs, &mut |run, rows| {
            let [x, y, z] = &rows.position;
            sink(run, [x, y, z])
        })
    }
}

//! Atoms of a system, by files of structures and topologies, in the order of their positions: names, residues,
//! elements, types, masses. Trajectories have none of it.

pub mod elements;
mod psf;
pub mod selection;
pub mod snapshot;

use crate::format::FileHead;
use crate::open::detect;
use crate::{Choice, gro, lammps, pdb};
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use std::collections::HashMap;
use std::path::Path;

/// The note of a file that has no names.
pub const NO_NAMES: &str = "the file stores no names of atoms: all are one species";

/// A word for each atom.
#[derive(Default)]
pub struct WordColumn {
    /// Each once, in the order of their first atoms.
    pub words: Vec<String>,
    /// Index in `words` of each atom's word; empty where the file has no such column.
    pub of: Vec<u32>,
    known: HashMap<Vec<u8>, u32>,
}

impl WordColumn {
    pub fn push(&mut self, word: &[u8]) {
        // The word often is that of the atom before, which saves a search.
        let last = self.of.last().filter(|&&last| self.words[last as usize].as_bytes() == word).copied();
        let number = last.or_else(|| self.known.get(word).copied()).unwrap_or_else(|| {
            let next = self.words.len() as u32;
            self.words.push(String::from_utf8_lossy(word).into_owned());
            self.known.insert(word.to_vec(), next);
            next
        });
        self.of.push(number);
    }

    pub fn get(&self, atom: usize) -> &str {
        &self.words[self.of[atom] as usize]
    }
}

/// The atoms of a system.
#[derive(Default)]
pub struct Topology {
    /// The file, as messages name it.
    pub place: String,
    pub count: usize,
    pub names: WordColumn,
    pub residues: WordColumn,
    pub residue_numbers: Vec<i64>,
    pub elements: WordColumn,
    pub types: WordColumn,
    /// Their species, as the reader of that file tells them apart.
    pub species: WordColumn,
    /// Empty where they are not known.
    pub masses: Vec<f64>,
    pub mass_unit: Option<&'static str>,
    /// Whether masses are those of elements.
    pub weighs_by_elements: bool,
    /// Whether elements follow from names.
    pub guesses_elements: bool,
}

/// Memory that an atom takes at most.
const ATOM: u64 = 48;
/// Atoms for which there must be memory before more are read.
const STEP: usize = 1 << 20;

/// The values of an atom's row; empty or `None` where it states none.
#[derive(Clone, Copy, Default)]
pub struct AtomRow<'a> {
    pub name: &'a [u8],
    pub residue: &'a [u8],
    pub residue_number: Option<i64>,
    /// Its symbol; by the names where it is empty.
    pub element: &'a [u8],
    pub kind: Option<&'a [u8]>,
    pub mass: Option<f64>,
}

impl Topology {
    pub fn new(path: &Path) -> Topology {
        Topology { place: path.display().to_string(), ..Topology::default() }
    }

    pub fn push(&mut self, row: AtomRow<'_>) -> Result<()> {
        if self.count.is_multiple_of(STEP) {
            memory::require("the names of the atoms", ATOM * (self.count + STEP) as u64)?;
        }
        if self.count == u32::MAX as usize {
            return Err(Error::input(&self.place, "there are more atoms than can be named"));
        }
        self.count += 1;
        self.names.push(row.name);
        self.residues.push(row.residue);
        self.residue_numbers.extend(row.residue_number);
        let stated = std::str::from_utf8(row.element).ok().and_then(elements::symbol);
        self.guesses_elements |= row.element.is_empty();
        let element = if row.element.is_empty() { elements::by_name(row.name, row.residue) } else { stated };
        self.elements.push(element.unwrap_or_default().as_bytes());
        row.kind.into_iter().for_each(|kind| self.types.push(kind));
        self.masses.extend(row.mass);
        Ok(())
    }

    /// Masses by element, where all are known.
    fn weigh(&mut self) {
        let of_words: Vec<Option<f64>> = self.elements.words.iter().map(|word| elements::mass(word)).collect();
        let masses: Option<Vec<f64>> = self.elements.of.iter().map(|&word| of_words[word as usize]).collect();
        self.masses = masses.unwrap_or_default();
        self.mass_unit = Some("amu");
        self.weighs_by_elements = true;
    }

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

#[cfg(test)]
mod tests;

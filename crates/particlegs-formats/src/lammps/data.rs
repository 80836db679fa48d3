//! LAMMPS data files, plain or compressed: a header with counts and the box, sections of atoms, masses, velocities:
//! <https://docs.lammps.org/read_data.html>.

use super::frame::{LammpsBox, units_of};
use crate::atoms::{AtomSnapshot, AtomSpecies, FieldBuffer};
use crate::format::{FileHead, is_whole};
use crate::single_file::{named, only};
use crate::text::content::{TextContent, TextPosition};
use crate::text::lines::LineReader;
use crate::text::snapshot::header_number;
use crate::text::split::{Separator, number, shown, tokens};
use crate::text::table::MOST_SPECIES;
use crate::topology::{AtomRow, Topology};
use crate::{Choice, Description, Format, Snapshot, SpeciesMass, TextResult};
use particlegs_core::model::{Dimension, Epoch, Unit, Units};
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use particlegs_particles::SnapshotMeta;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub const FORMAT: Format = Format { name: "lammps-data", title: "LAMMPS data file", detect, open };

fn detect(head: &FileHead) -> bool {
    let is_count = |l: &[u8]| matches!(tokens(l, Separator::Blanks)[..], [n, b"atoms", ..] if is_whole(n));
    let is_side = |l: &[u8]| memchr::memmem::find(l, b"xlo xhi").is_some();
    head.lines().take(64).any(is_count) && head.lines().take(64).any(is_side)
}

/// Styles of atoms: their columns up to the positions. Others have more behind them, and image flags may follow.
const STYLES: [(&str, &[AtomColumn]); 16] = [
    ("atomic", &[Id, Type]),
    ("charge", &[Id, Type, Charge]),
    ("dipole", &[Id, Type, Charge]),
    ("molecular", &[Id, Molecule, Type]),
    ("bond", &[Id, Molecule, Type]),
    ("angle", &[Id, Molecule, Type]),
    ("full", &[Id, Molecule, Type, Charge]),
    ("sphere", &[Id, Type, Other, Other]),
    ("ellipsoid", &[Id, Type, Other, Other]),
    ("line", &[Id, Molecule, Type, Other, Other]),
    ("body", &[Id, Type, Other, Other]),
    ("tri", &[Id, Molecule, Type, Other, Other]),
    ("peri", &[Id, Type, Other, Other]),
    ("electron", &[Id, Type, Charge, Other, Other]),
    ("hybrid", &[Id, Type]),
    ("template", &[Id, Type, Molecule, Other, Other]),
];

#[derive(Clone, Copy, PartialEq)]
enum AtomColumn {
    Id,
    Molecule,
    Type,
    Charge,
    Other,
}

use AtomColumn::{Charge, Id, Molecule, Other, Type};

/// Memory that an atom takes while the file is read.
const ATOM: u64 = 160;
/// Atoms for which there must be memory before more are read.
const STEP: usize = 1 << 16;

#[derive(Default)]
struct LammpsData {
    units: Option<String>,
    step: Option<i64>,
    atoms: u64,
    sides: [[f64; 2]; 3],
    tilts: [f64; 3],
    /// Vectors and the origin of a general cell.
    general: [Option<[f64; 3]>; 4],
    /// Names of types, by what rows call them; their masses, and labels.
    types: Vec<String>,
    masses: HashMap<String, f64>,
    labels: HashMap<String, String>,
    style: Option<&'static [AtomColumn]>,
    id: Vec<i64>,
    molecule: Vec<i64>,
    kind: Vec<u32>,
    charge: Vec<f64>,
    position: Vec<f64>,
    velocities: Vec<(i64, [f64; 3])>,
    notes: Vec<String>,
}

impl LammpsData {
    /// Takes step and units from the first line of LAMMPS's own files: `..., timestep = 100, units = metal`.
    fn title(&mut self, line: &[u8]) {
        let text = String::from_utf8_lossy(line);
        let behind = |name: &str| {
            let rest = text.split_once(name)?.1.trim_start().strip_prefix('=')?.trim_start();
            rest.split([',', ' ']).next().map(String::from)
        };
        self.units = behind("units");
        self.step = behind("timestep").and_then(|step| step.parse().ok());
    }

    fn header(&mut self, words: &[&[u8]]) -> TextResult<()> {
        let numbers =
            |count: usize| -> TextResult<Vec<f64>> { words[..count].iter().map(|w| header_number(w)).collect() };
        let three = |numbers: Vec<f64>| [numbers[0], numbers[1], numbers[2]];
        let axis = |low: &[u8]| [&b"xlo"[..], b"ylo", b"zlo"].iter().position(|name| *name == low);
        match words {
            [n, b"atoms"] => {
                let count = std::str::from_utf8(n).ok().and_then(|n| n.parse().ok());
                self.atoms = count.ok_or_else(|| format!("{} is not a number of atoms", shown(n)))?;
            }
            [_, _, low, _] if axis(low).is_some() => {
                let ends = numbers(2)?;
                self.sides[axis(low).unwrap_or(0)] = [ends[0], ends[1]];
            }
            [_, _, _, b"xy", b"xz", b"yz"] => self.tilts = three(numbers(3)?),
            [_, _, _, b"avec"] => self.general[0] = Some(three(numbers(3)?)),
            [_, _, _, b"bvec"] => self.general[1] = Some(three(numbers(3)?)),
            [_, _, _, b"cvec"] => self.general[2] = Some(three(numbers(3)?)),
            [_, _, _, b"abc", b"origin"] => self.general[3] = Some(three(numbers(3)?)),
            _ => {}
        }
        Ok(())
    }

    fn cell(&self) -> TextResult<LammpsBox> {
        if let [Some(a), Some(b), Some(c), origin] = self.general {
            let origin = origin.unwrap_or_default();
            return Ok(LammpsBox { origin, vectors: [a, b, c], ..LammpsBox::default() });
        }
        let [xy, xz, yz] = self.tilts;
        let [x, y, z] = self.sides.map(|[low, high]| high - low);
        match self.sides.iter().find(|[low, high]| low > high) {
            Some([low, high]) => Err(format!("the box is inverted: a side runs from {low} to {high}")),
            None => Ok(LammpsBox {
                origin: self.sides.map(|side| side[0]),
                vectors: [[x, 0.0, 0.0], [xy, y, 0.0], [xz, yz, z]],
                ..LammpsBox::default()
            }),
        }
    }

    /// The columns of atoms: as the section's comment says, else by how many there are.
    fn style(&mut self, stated: &[u8], row: &[&[u8]]) -> TextResult<&'static [AtomColumn]> {
        // Of hybrid ones the sub-styles follow.
        let stated = String::from_utf8_lossy(stated).split_whitespace().next().unwrap_or_default().to_string();
        let named = |name: &str| STYLES.iter().find(|s| s.0 == name).map(|s| s.1);
        if !stated.is_empty() {
            let columns = named(&stated);
            return columns.ok_or_else(|| format!("atoms of style `{}` are not read", stated.escape_debug()));
        }
        let is_molecule = row.get(2).is_some_and(|word| is_whole(word));
        // Three image flags may stand behind the positions.
        let name = match row.len() {
            5 | 8 => "atomic",
            7 | 10 => "full",
            6 | 9 if is_molecule => "molecular",
            6 | 9 => "charge",
            n => return Err(format!("atoms with {n} columns need their style, as in `Atoms # full`")),
        };
        self.notes.push(format!("the file does not state the style of its atoms: assuming `{name}` by their columns"));
        named(name).ok_or_else(|| "the style is unknown".into())
    }

    fn atom(&mut self, style: &[AtomColumn], row: &[&[u8]]) -> TextResult<()> {
        if row.len() < style.len() + 3 {
            return Err(format!("{} columns instead of {}", row.len(), style.len() + 3));
        }
        let whole = |word: &[u8]| {
            let value = std::str::from_utf8(word).ok().and_then(|text| text.parse::<i64>().ok());
            value.ok_or_else(|| format!("{} is not a whole number", shown(word)))
        };
        let real = |word: &[u8]| number(word).ok_or_else(|| format!("{} is not a number", shown(word)));
        for (column, word) in style.iter().zip(row) {
            match column {
                Id => self.id.push(whole(word)?),
                Molecule => self.molecule.push(whole(word)?),
                Charge => self.charge.push(real(word)?),
                Type => {
                    let name = String::from_utf8_lossy(word);
                    // Successive rows are mostly of one type: comparing with the last one saves a search.
                    let last = self.kind.last().copied().filter(|&k| self.types[k as usize] == name);
                    let index = last.or_else(|| self.types.iter().position(|t| *t == name).map(|k| k as u32));
                    self.kind.push(index.unwrap_or(self.types.len() as u32));
                    // More than can be told apart are one species.
                    if index.is_none() && self.types.len() <= MOST_SPECIES {
                        self.types.push(name.into_owned());
                    } else if index.is_none() {
                        *self.kind.last_mut().ok_or("no atom")? = 0;
                    }
                }
                Other => {}
            }
        }
        for word in &row[style.len()..style.len() + 3] {
            self.position.push(real(word)?);
        }
        Ok(())
    }

    fn velocity(&mut self, row: &[&[u8]]) -> TextResult<()> {
        let [id, x, y, z, ..] = row else { return Err(format!("{} columns instead of 4", row.len())) };
        let id = std::str::from_utf8(id).ok().and_then(|text| text.parse().ok());
        let id = id.ok_or_else(|| format!("{} is not an atom", shown(row[0])))?;
        let real = |word: &[u8]| number(word).ok_or_else(|| format!("{} is not a number", shown(word)));
        self.velocities.push((id, [real(x)?, real(y)?, real(z)?]));
        Ok(())
    }

    /// The mass of a type, by what rows call it.
    fn mass(&self, kind: &String) -> Option<f64> {
        let of_label = || self.labels.iter().find(|l| l.1 == kind).and_then(|l| self.masses.get(l.0));
        self.masses.get(kind).or_else(of_label).copied()
    }

    /// Velocities in the order of the atoms.
    fn sorted_velocities(&self) -> TextResult<Option<Vec<f64>>> {
        if self.velocities.is_empty() {
            return Ok(None);
        }
        // LAMMPS writes velocities in the order of the atoms: no map of the numbers is needed then.
        let in_order =
            self.velocities.len() == self.id.len() && self.velocities.iter().zip(&self.id).all(|(v, id)| v.0 == *id);
        if in_order {
            return Ok(Some(self.velocities.iter().flat_map(|v| v.1).collect()));
        }
        let velocity_by_id: HashMap<i64, [f64; 3]> = self.velocities.iter().copied().collect();
        let velocity = |id: &i64| velocity_by_id.get(id).copied().ok_or_else(|| format!("atom {id} has no velocity"));
        Ok(Some(self.id.iter().map(velocity).collect::<TextResult<Vec<_>>>()?.concat()))
    }
}

/// A section that is read.
#[derive(Clone, Copy, PartialEq)]
enum DataSection {
    Header,
    Masses,
    Labels,
    Atoms,
    Velocities,
    Skipped,
}

fn read(path: &Path, content: &TextContent) -> Result<LammpsData> {
    let mut data = LammpsData::default();
    let mut lines = LineReader::open(content, TextPosition::START, None)?;
    // LAMMPS skips the first line whatever it holds; its own writer states step and units there.
    if let Some(title) = lines.line()? {
        data.title(title);
    }
    let mut section = DataSection::Header;
    let mut stated: Vec<u8> = Vec::new();
    loop {
        let at = lines.place().line;
        let Some(line) = lines.line()? else { break };
        let (text, comment) = match memchr::memchr(b'#', line) {
            Some(end) => (&line[..end], &line[end + 1..]),
            None => (line, &b""[..]),
        };
        let words = tokens(text, Separator::Blanks);
        let Some(first) = words.first() else { continue };
        // Types may be called by labels.
        let is_mass = section == DataSection::Masses && words.len() == 2 && number(words[1]).is_some();
        if first[0].is_ascii_alphabetic() && !is_mass {
            section = match &words[..] {
                [b"Masses"] => DataSection::Masses,
                [b"Atom", b"Type", b"Labels"] => DataSection::Labels,
                [b"Atoms"] => DataSection::Atoms,
                [b"Velocities"] => DataSection::Velocities,
                // Sections that are not read end the one before: their rows would count as its own.
                _ => DataSection::Skipped,
            };
            if section == DataSection::Atoms {
                stated = comment.to_vec();
            }
            continue;
        }
        let text = |word: &[u8]| String::from_utf8_lossy(word).into_owned();
        let outcome = match (section, &words[..]) {
            (DataSection::Header, words) => data.header(words),
            (DataSection::Masses, [kind, mass, ..]) if data.masses.len() <= MOST_SPECIES => {
                header_number(mass).map(|mass| {
                    data.masses.insert(text(kind), mass);
                })
            }
            (DataSection::Labels, [number, label]) if data.labels.len() <= MOST_SPECIES => {
                data.labels.insert(text(number), text(label));
                Ok(())
            }
            (DataSection::Atoms, row) => {
                // By the rows that came: the header's count may be damaged.
                if data.id.len().is_multiple_of(STEP) {
                    memory::require("the atoms of this file", ATOM * (data.id.len() + STEP) as u64)?;
                }
                // The first row tells the style where the section does not state it; it holds for all rows.
                let style = match data.style {
                    Some(style) => Ok(style),
                    None => data.style(&stated, row),
                };
                style.and_then(|style| {
                    data.style = Some(style);
                    data.atom(style, row)
                })
            }
            (DataSection::Velocities, row) => data.velocity(row),
            _ => Ok(()),
        };
        outcome.map_err(|message| Error::input(path, format!("line {at}: {message}")))?;
    }
    if data.id.len() as u64 != data.atoms {
        let message = format!("the header states {} atoms, but the section `Atoms` has {}", data.atoms, data.id.len());
        return Err(Error::input_with(path, message, "the file is cut short or damaged: copy it again"));
    }
    Ok(data)
}

fn open(paths: &[PathBuf], choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let content = TextContent::open(path)?;
    let mut data = read(path, &content)?;
    let mut notes = std::mem::take(&mut data.notes);
    let cell = data.cell().map_err(|message| Error::input(path, message))?;
    // The boundary is not in the file; LAMMPS's own default repeats all sides.
    let cell = LammpsBox { periodic: [true; 3], ..cell }.cell();
    notes.push("the file does not say which sides are periodic: assuming all, as LAMMPS does".into());
    let [length, mass, time] = data.units.as_deref().map_or([None; 3], units_of);
    let mut buffer = FieldBuffer::default();
    buffer.add("pos", 3, length, &data.position);
    buffer.add_whole("id", &data.id);
    // Columns that the style lacks are empty.
    if data.molecule.len() == data.id.len() {
        buffer.add_whole("mol", &data.molecule);
    }
    if data.charge.len() == data.id.len() {
        buffer.add("q", 1, None, &data.charge);
    }
    if let Some(velocity) = data.sorted_velocities().map_err(|message| Error::input(path, message))? {
        buffer.add("velocity", 3, None, &velocity);
    }
    let (bytes, fields) = buffer.finish();
    let names: Vec<(String, Vec<String>)> = data.types.iter().map(|name| type_names(name, &data.labels)).collect();
    let rows = data.id.len() as u64;
    let all = AtomSpecies::all(fields, rows);
    let mut species = match rows {
        0 => Vec::new(),
        _ if choice.by_atoms() => vec![all],
        _ => all.by_type(&data.kind, &names),
    };
    // Masses are stated by type: a species of all atoms gets none.
    for one in &mut species {
        let number = names.iter().position(|n| n.0 == one.name).map(|k| &data.types[k]);
        one.mass = number.and_then(|n| data.mass(n)).map_or(SpeciesMass::Unknown, SpeciesMass::Each);
    }
    let meta = SnapshotMeta {
        cell,
        units: Units { time: time.map(|text| Unit::parse(text, Dimension::Time)), ..Units::new(length, mass, None) },
        epoch: Epoch { step: data.step, ..Epoch::default() },
        ..named(path)
    };
    let description = Description { notes, ..Description::new(content.title(FORMAT.title), paths, meta) };
    Ok(Box::new(AtomSnapshot::new(description, bytes, species).with_unwrapped(choice)?))
}

/// The atoms, as they stand or by their numbers.
pub fn topology(path: &Path, sorted: bool) -> Result<Topology> {
    let data = read(path, &TextContent::open(path)?)?;
    if data.types.len() > MOST_SPECIES {
        return Err(Error::input(path, format!("it has more than {MOST_SPECIES} types of atoms")));
    }
    let mut order: Vec<usize> = (0..data.id.len()).collect();
    if sorted {
        order.sort_by_key(|&atom| data.id[atom]);
    }
    let types: Vec<(String, Option<f64>)> =
        data.types.iter().map(|name| (type_names(name, &data.labels).0, data.mass(name))).collect();
    let weighs = types.iter().all(|kind| kind.1.is_some());
    let mass_unit = data.units.as_deref().and_then(|units| units_of(units)[1]);
    let mut topology = Topology { mass_unit, ..Topology::new(path) };
    for atom in order {
        let kind = data.kind[atom] as usize;
        topology.species.push(types[kind].0.as_bytes());
        topology.push(AtomRow {
            residue_number: data.molecule.get(atom).copied(),
            kind: Some(data.types[kind].as_bytes()),
            mass: types[kind].1.filter(|_| weighs),
            ..AtomRow::default()
        })?;
    }
    Ok(topology)
}

/// The name of a type, and its other names: its number, and the label that the file has for it.
fn type_names(name: &str, labels: &HashMap<String, String>) -> (String, Vec<String>) {
    let label = labels.get(name).map(|label| label.to_lowercase());
    let aliases = [format!("type{name}"), name.to_string()].into_iter().map(|a| a.to_lowercase()).chain(label);
    (format!("type {name}"), aliases.collect())
}

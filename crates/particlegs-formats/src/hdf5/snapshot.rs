//! A snapshot's files, opened: species, fields, units, box.

use super::container::{Container, DataSet};
use super::header::{Hdf5Header, TYPES};
use super::reader::{self, FilePart, GroupSource};
use super::units::{self, Simulation};
use super::{files, h5md, tables, virtual_sets};
use crate::physical::{UNDECIDED, VelocityConvention};
use crate::single_file::named;
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass};
use particlegs_core::model::{Cosmology, Dimension, Epoch, Unit, Units, species_aliases};
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader, SourceField};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Names of a data set of positions, the usual one first.
const POSITIONS: [&str; 7] = ["Coordinates", "coordinates", "Positions", "Position", "positions", "POS", "pos"];

/// Names of a data set of masses.
const MASSES: [&str; 5] = ["Masses", "Mass", "masses", "MASS", "mass"];

struct Hdf5Snapshot {
    description: Description,
    convention: VelocityConvention,
    parts: Vec<FilePart>,
    types: Vec<usize>,
}

impl Snapshot for Hdf5Snapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let (Some(kind), Some(species)) = (self.types.get(species), self.description.species.get(species)) else {
            return Err(Error::argument(format!("particle type {species} does not exist")));
        };
        let (group, description) = (&group_name(*kind)[..], &self.description);
        let source = GroupSource { parts: &self.parts, kind: *kind, group, species, description };
        reader::reader(&source, choice)
    }

    fn attributes(&self, species: usize, field: &str) -> Vec<(String, f64)> {
        let Some(&kind) = self.types.get(species) else { return Vec::new() };
        let Some(part) = self.parts.iter().find(|p| p.rows[kind] > 0) else { return Vec::new() };
        let Ok(container) = Container::from_map(&part.path, part.map.clone()) else { return Vec::new() };
        container.data_set(&group_name(kind), field).map(|s| s.attributes.single()).unwrap_or_default()
    }

    fn convention(&self) -> VelocityConvention {
        self.convention
    }
}

pub fn open(paths: &[PathBuf], options: &Choice) -> Result<Box<dyn Snapshot>> {
    let first = Container::open(&paths[0])?;
    let header = Hdf5Header::read(&first)?;
    if let [path] = paths
        && !first.groups()?.iter().any(|g| kind_of(&g.0).is_some())
    {
        // The surest layouts first: marks, then names, then any array that may hold positions.
        if first.groups()?.iter().any(|g| g.0 == h5md::MARK) {
            return h5md::open(path, first, options);
        }
        if let Some(tables) = tables::open(path, &first, options, false)? {
            return Ok(tables);
        }
        if let Some((description, hint)) = tables::foreign(path, &first) {
            return Err(Error::input_with(path, format!("{description}, which this program does not read"), hint));
        }
        if let Some(frames) = h5md::open_plain(path, options)? {
            return Ok(frames);
        }
        if let Some(tables) = tables::open(path, &first, options, true)? {
            return Ok(tables);
        }
    }
    let (type_groups, strict) = (Default::default(), options.strict);
    let mut builder = SnapshotBuilder {
        header,
        strict,
        found: type_groups,
        notes: Vec::new(),
        parts: Vec::new(),
        sources: BTreeSet::new(),
    };
    let paths = match (paths, files::stands_alone(&paths[0], builder.header.files)) {
        ([_], true) if !strict => {
            builder
                .note(format!("the snapshot has {} files; this file is read as one part of it", builder.header.files));
            paths.to_vec()
        }
        _ => files::all(paths, builder.header.files)?,
    };
    for path in &paths {
        builder.add(path, Container::open(path)?)?;
    }
    builder.finish(paths)
}

/// A type of particles as its first file with particles has it.
struct TypeGroup {
    group: String,
    positions: String,
    sets: Vec<DataSet>,
    aliases: Vec<String>,
}

impl TypeGroup {
    fn masses(&self) -> Option<&'static str> {
        MASSES.into_iter().find(|n| self.sets.iter().any(|s| s.name == *n && s.components() == 1))
    }

    /// Whether it has velocities whose attributes do not say how they become peculiar.
    fn has_plain_velocities(&self) -> bool {
        let is_velocity =
            |s: &&DataSet| s.name != self.positions && SourceField::is_velocity(&s.name, s.components() as u32);
        self.sets.iter().filter(is_velocity).any(|s| units::a_power(&s.attributes).is_none())
    }

    /// Whether the positions' own attributes say that they are comoving or not.
    fn says_comoving(&self) -> bool {
        self.sets.iter().any(|s| s.name == self.positions && units::a_power(&s.attributes).is_some())
    }
}

fn rows_of(positions: &DataSet, place: &str) -> Result<u64> {
    match positions.shape[..] {
        [rows, 3] => Ok(rows),
        // Codes write types without particles in any shape.
        [0, ..] => Ok(0),
        _ => {
            let message = format!("positions have the shape {}, not (N, 3)", positions.shape_text());
            Err(Error::input(format!("{place}/{}", positions.name), message))
        }
    }
}

struct SnapshotBuilder {
    header: Hdf5Header,
    /// Whether counts in the header that are not those of the files are refused.
    strict: bool,
    found: [Option<TypeGroup>; TYPES],
    notes: Vec<String>,
    parts: Vec<FilePart>,
    /// Files that hold the numbers of virtual data sets.
    sources: BTreeSet<PathBuf>,
}

pub fn group_name(kind: usize) -> String {
    format!("PartType{kind}")
}

pub fn kind_of(group: &str) -> Option<usize> {
    let digits = group.strip_prefix("PartType")?;
    // `PartType01` is none.
    digits.parse::<usize>().ok().filter(|&k| k < TYPES && digits.len() == k.to_string().len())
}

impl SnapshotBuilder {
    fn note(&mut self, text: String) {
        if !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }

    /// A count in the header that is not that of the files.
    fn doubt(&mut self, place: &str, message: String) -> Result<()> {
        if self.strict {
            let hint = "the header belongs to another snapshot, or files are missing or incomplete";
            return Err(Error::input_with(place, message, hint));
        }
        self.note(format!("{message}: using the particles found"));
        Ok(())
    }

    /// The rows of a type in a file, whose header may state others.
    fn rows(&mut self, positions: &DataSet, stated: Option<u64>, place: &str) -> Result<u64> {
        let rows = rows_of(positions, place)?;
        if let Some(stated) = stated.filter(|&s| s != rows) {
            let message =
                format!("{} has {rows} rows, but NumPart_ThisFile in the header says {stated}", positions.name);
            self.doubt(place, message)?;
        }
        Ok(rows)
    }

    fn add(&mut self, path: &Path, container: Container) -> Result<()> {
        let header = Hdf5Header::read(&container)?;
        if header.files != self.header.files || header.total != self.header.total || header.time() != self.header.time()
        {
            let message = "the header differs from that of the first file: this file belongs to another snapshot";
            return Err(Error::input_with(path, message, "name one snapshot at a time"));
        }
        let groups = container.groups()?;
        let mut rows = [0; TYPES];
        for (name, address) in &groups {
            let Some(kind) = kind_of(name) else { continue };
            let aliases = groups.iter().filter(|g| g.1 == *address && g.0 != *name).map(|g| g.0.to_lowercase());
            rows[kind] = self.add_type(&container, &header, kind, aliases.collect())?;
        }
        self.check_missing(&container, &header, &groups, &rows)?;
        self.parts.push(FilePart { path: path.to_path_buf(), map: container.map.clone(), rows });
        Ok(())
    }

    /// Rows of a type in a file; the first file that has some says what the type looks like.
    fn add_type(
        &mut self,
        container: &Container,
        header: &Hdf5Header,
        kind: usize,
        aliases: Vec<String>,
    ) -> Result<u64> {
        let group = group_name(kind);
        let place = format!("{}: {group}", container.place);
        let stated = header.here.as_ref().and_then(|h| h.get(kind).copied());
        if let Some(known) = self.found[kind].as_ref() {
            // What else there is has been listed; hundreds of files are opened quickly.
            return match container.data_set(&group, &known.positions) {
                Ok(positions) => self.rows(&positions, stated, &place),
                Err(_) if stated == Some(0) => Ok(0),
                Err(e) => Err(e),
            };
        }
        let members = container.members(&group)?;
        let positions = POSITIONS.iter().find_map(|n| members.sets.iter().find(|s| s.name == *n));
        let Some(positions) = positions else {
            if let Some((_, error)) = members.unreadable.into_iter().find(|u| POSITIONS.contains(&&u.0[..])) {
                return Err(error);
            }
            if stated != Some(0) {
                self.note(format!("{group} has no positions (no data set {}) and is skipped", POSITIONS[0]));
            }
            return Ok(0);
        };
        let rows = self.rows(positions, stated, &place)?;
        if rows > 0 {
            for set in &members.sets {
                match virtual_sets::extents(container, &group, set) {
                    Ok(extents) => {
                        self.sources.extend(extents.into_iter().flatten().map(|e| e.source.file.to_path_buf()))
                    }
                    Err(e) if set.name == positions.name => return Err(e),
                    Err(_) => {}
                }
            }
            let positions = positions.name.clone();
            for (_, error) in members.unreadable {
                self.note(format!("skipped: {error}"));
            }
            self.found[kind] = Some(TypeGroup { group, positions, sets: members.sets, aliases });
        }
        Ok(rows)
    }

    /// Particles that the header counts and the file has no group for.
    fn check_missing(
        &mut self,
        container: &Container,
        header: &Hdf5Header,
        groups: &[(String, u64)],
        rows: &[u64; TYPES],
    ) -> Result<()> {
        for (kind, &stated) in header.here.iter().flatten().enumerate().filter(|(_, n)| **n > 0) {
            let is_present = kind < TYPES && (rows[kind] > 0 || groups.iter().any(|g| g.0 == group_name(kind)));
            if !is_present {
                self.note(format!(
                    "the header counts {stated} particles of type {kind}, but there is no group {}",
                    group_name(kind)
                ));
            }
        }
        let elsewhere = container.elsewhere();
        if !elsewhere.is_empty() {
            self.note(format!("links to other files are not followed: {}", elsewhere.join(", ")));
        }
        if header.files == 1 && rows.iter().all(|&r| r == 0) {
            let names: Vec<&str> = groups.iter().map(|g| &g.0[..]).take(8).collect();
            let has = if names.is_empty() { "no groups".to_string() } else { names.join(", ") };
            let message =
                format!("this HDF5 file has no group PartType0, PartType1, ... and no positions; it has {has}");
            let hint = match &elsewhere[..] {
                [] => "circular links are not followed; `h5ls` lists the contents".to_string(),
                names => format!("links to other files ({}) and circular links are not followed", names.join(", ")),
            };
            return Err(Error::input_with(&container.place, message, hint));
        }
        Ok(())
    }

    fn finish(mut self, paths: Vec<PathBuf>) -> Result<Box<dyn Snapshot>> {
        let place = self.header_place(&paths);
        let counts: Vec<u64> =
            (0..TYPES).map(|k| self.parts.iter().map(|p| p.rows[k]).fold(0, u64::saturating_add)).collect();
        self.check_totals(&place, &counts)?;
        if counts.iter().all(|&n| n == 0) {
            return Err(Error::input(&paths[0], "no file of the snapshot has particles"));
        }
        let mut notes = std::mem::take(&mut self.notes);
        let cell = self.header.cell(&mut notes)?;
        let mut doubts = Vec::new();
        let cosmological = self.header.cosmological(&mut doubts);
        let convention = self.header.convention(cosmological);
        // Where the positions' attributes say it, it does not matter that the header does not.
        if !self.found.iter().flatten().any(TypeGroup::says_comoving) {
            notes.append(&mut doubts);
        }
        if convention.is_undecided() && self.found.iter().flatten().any(TypeGroup::has_plain_velocities) {
            notes.push(UNDECIDED.into());
        }
        let hubble = self.header.hubble();
        let expands = cosmological == Some(true);
        let time = self.header.time_apart(expands);
        let mut meta = SnapshotMeta {
            cell,
            units: Units { time: units::time_unit(&self.header.groups).filter(|_| time.is_some()), ..Units::default() },
            cosmology: if expands { self.header.cosmology() } else { Cosmology { hubble, ..Cosmology::default() } },
            epoch: Epoch { scale_factor: self.header.scale_factor().filter(|_| expands), time, ..Epoch::default() },
            ..named(&paths[0])
        };
        let simulation = Simulation { groups: &self.header.groups, cosmological, hubble };
        let (mut species, mut types) = (Vec::new(), Vec::new());
        for (kind, slot) in self.found.iter().enumerate() {
            let Some(type_group) = slot else { continue };
            let attributes = |name: &str| {
                type_group.sets.iter().find(|s| s.name == name).map(|s| s.attributes.clone()).unwrap_or_default()
            };
            let mut units = |name: &str, dimension| {
                units::unit(&attributes(name), &attributes(&type_group.positions), &simulation, dimension, &mut notes)
            };
            let (length, comoving) = units(&type_group.positions, Dimension::Length);
            let (mass, _) = units(type_group.masses().unwrap_or_default(), Dimension::Mass);
            species.push(self.species(kind, type_group, counts[kind], [&length, &mass]));
            meta.units.length = meta.units.length.or(length);
            meta.units.mass = meta.units.mass.or(mass);
            meta.units.comoving = meta.units.comoving.or(comoving);
            types.push(kind);
        }
        let code = self.header.code().map(|c| format!(", {c}")).unwrap_or_default();
        let format = format!("HDF5 snapshot{code}");
        let files: Vec<_> = paths.into_iter().chain(self.sources).collect();
        let description = Description { species, notes, ..Description::new(format, &files, meta) };
        Ok(Box::new(Hdf5Snapshot { description, convention, parts: self.parts, types }))
    }

    fn header_place(&self, paths: &[PathBuf]) -> String {
        format!("{}: Header", paths[0].display())
    }

    /// All files together must have what the header counts in all.
    fn check_totals(&mut self, place: &str, counts: &[u64]) -> Result<()> {
        let Some(total) = self.header.total.clone() else { return Ok(()) };
        for (kind, &stated) in total.iter().enumerate().take(TYPES) {
            let count = counts[kind];
            let message = format!("NumPart_Total says {stated} particles of type {kind}, but the files have {count}");
            // Of one file, the same number has been compared with it already.
            let said =
                self.header.files == 1 && self.header.here.as_ref().is_some_and(|h| h.get(kind) == Some(&stated));
            if stated != count && !said {
                self.doubt(place, message)?;
            }
        }
        Ok(())
    }

    fn species(&self, kind: usize, type_group: &TypeGroup, count: u64, [length, mass]: [&Option<Unit>; 2]) -> Species {
        let masses = type_group.masses();
        let text = |unit: &Option<Unit>| unit.as_ref().map(|u| u.text.clone());
        let field = |set: &DataSet| SpeciesField {
            name: set.name.clone(),
            kind: set.kind.clone(),
            components: u32::try_from(set.components()).unwrap_or(u32::MAX),
            unit: match &set.name {
                n if *n == type_group.positions => text(length),
                n if Some(&n[..]) == masses => text(mass),
                _ => set
                    .attributes
                    .text(&["Expression for physical CGS units", "Units", "units", "unit"])
                    .map(str::to_string),
            },
        };
        let mut aliases = species_aliases(kind);
        aliases.extend(type_group.aliases.iter().cloned());
        Species {
            name: type_group.group.clone(),
            aliases,
            count,
            mass: match (masses, self.header.mass(kind)) {
                (Some(name), _) => SpeciesMass::Field(name.to_string()),
                (None, Some(mass)) => SpeciesMass::Each(mass),
                (None, None) => SpeciesMass::Unknown,
            },
            positions: type_group.positions.clone(),
            fields: type_group.sets.iter().map(field).collect(),
        }
    }
}

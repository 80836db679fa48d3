//! HDF5 files without the groups of a simulation code: data sets `x`, `y`, `z` or `positions` at the top, or in a
//! group at the top, each of which is a species then.

use super::attributes::{Attributes, HeaderGroups};
use super::container::{Container, DataSet, TOP};
use super::header::TYPES;
use super::reader::{self, FilePart, GroupSource};
use super::units::{self, Simulation};
use crate::foreign::{YT, python};
use crate::frames::{self, ChosenFrame};
use crate::npy::layout::{mass_named, positions_named};
use crate::single_file::named;
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, TrajectoryFrames};
use particlegs_core::model::{Cosmology, Dimension, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader, SourceField};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Names of attributes that hold the lengths of the box.
const BOXES: [&str; 7] = ["BoxSize", "boxsize", "box_size", "Boxsize", "box", "Lbox", "boxlength"];

struct TableSnapshot {
    description: Description,
    parts: [FilePart; 1],
    groups: Vec<String>,
    /// Power of a that makes its velocities peculiar, where it says.
    velocity_power: Option<f64>,
}

impl Snapshot for TableSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, kind: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let (Some(group), Some(species)) = (self.groups.get(kind), self.description.species.get(kind)) else {
            return Err(Error::argument(format!("species {kind} does not exist")));
        };
        let description = &self.description;
        reader::reader(&GroupSource { parts: &self.parts, kind, group, species, description }, choice)
    }

    /// Velocities of OpenCosmo are comoving or not as lengths are, whatever the text of their unit.
    fn attributes(&self, _: usize, field: &str) -> Vec<(String, f64)> {
        let power = self.velocity_power.filter(|_| [1, 3].iter().any(|n| SourceField::is_velocity(field, *n)));
        power.map(|power| vec![("a_scaling".into(), power), ("to_cgs".into(), 1e5)]).unwrap_or_default()
    }
}

/// A group whose data sets hold particles.
struct ParticleTable {
    group: String,
    species: Species,
    positions: Attributes,
    masses: Attributes,
}

/// Opens such a file; `None` where no group holds positions. Groups at the top are looked into, or all groups and
/// arrays of any name.
pub fn open(
    path: &Path,
    container: &Container,
    choice: &Choice,
    everywhere: bool,
) -> Result<Option<Box<dyn Snapshot>>> {
    let header = OpenCosmoHeader::read(container)?;
    let mut groups: Vec<String> = container.groups()?.into_iter().map(|g| g.0).collect();
    if header.is_some() {
        // Collections have the columns of each kind in a group `data` of its own.
        let data_group =
            |group: &String| container.names_in(group).iter().any(|n| n == DATA).then(|| format!("{group}/{DATA}"));
        groups = groups.iter().filter(|g| *g == DATA).cloned().chain(groups.iter().filter_map(data_group)).collect();
    } else {
        groups.insert(0, TOP.into());
    }
    let mut notes = Vec::new();
    let mut tables = of_groups(container, &groups, choice.positions.as_deref())?;
    // Groups further down are searched only where those at the top hold nothing: there may be thousands.
    if tables.is_empty() && everywhere {
        groups.extend(container.groups_below(MOST_GROUPS)?);
        tables = of_groups(container, &groups, choice.positions.as_deref())?;
        if tables.is_empty() {
            tables = of_only_array(container, &groups, &mut notes)?;
        }
    }
    let frames = keep_frame(&mut tables, path, choice.frame, &mut notes)?;
    // `FilePart` counts the rows of so many species.
    if tables.len() > TYPES {
        notes.push(format!("the first {TYPES} of {} groups with positions are read", tables.len()));
    }
    tables.truncate(TYPES);
    if let Some(header) = &header {
        tables.iter_mut().for_each(|table| header.name(table));
    }
    let Some(first) = tables.first() else { return Ok(None) };
    let top = container.attributes(TOP)?;
    // The box of whatever stands nearest to the positions holds.
    let owners = [&first.positions, &container.attributes(&first.group)?, &top, &container.attributes("Header")?];
    let cell = owners.iter().find_map(|a| BOXES.iter().find_map(|name| a.numbers(name)));
    let cell = cell.map(|lengths| cell_of(lengths, &container.place)).transpose()?.flatten();
    let simulation = Simulation { groups: &HeaderGroups::default(), cosmological: None, hubble: None };
    let mut unit =
        |attributes, dimension| units::unit(attributes, &first.positions, &simulation, dimension, &mut notes).0;
    let units = Units {
        length: unit(&first.positions, Dimension::Length),
        mass: unit(&first.masses, Dimension::Mass),
        ..Units::default()
    };
    let epoch = frames.map(|f| f.epoch()).unwrap_or_default();
    let mut meta = SnapshotMeta { cell, units: units.settled(), epoch, ..named(path) };
    if let Some(header) = &header {
        header.complete(&mut meta, &mut notes);
    }
    // Velocities of OpenCosmo's other conventions are comoving: times a they are peculiar.
    let velocity_power = header.as_ref().map(|h| if h.convention == "physical" { 0.0 } else { 1.0 });
    let mut rows = [0; TYPES];
    rows.iter_mut().zip(&tables).for_each(|(rows, table)| *rows = table.species.count);
    let description = Description {
        species: tables.iter().map(|t| t.species.clone()).collect(),
        frames,
        notes,
        ..Description::new(
            header.map_or("HDF5 tables".into(), |h| format!("HDF5, OpenCosmo ({})", h.kind)),
            &[path.to_path_buf()],
            meta,
        )
    };
    let groups = tables.into_iter().map(|t| t.group).collect();
    let parts = [FilePart { path: PathBuf::from(path), map: container.map.clone(), rows }];
    Ok(Some(Box::new(TableSnapshot { description, parts, groups, velocity_power })))
}

/// Groups that are looked into at most.
const MOST_GROUPS: usize = 1 << 16;

fn of_groups(container: &Container, groups: &[String], chosen: Option<&str>) -> Result<Vec<ParticleTable>> {
    if groups.len() >= MOST_GROUPS {
        return Err(Error::input(
            &container.place,
            format!("it has {MOST_GROUPS} groups or more: too many to look into"),
        ));
    }
    let mut tables = Vec::new();
    for group in groups {
        tables.extend(table(container, group, chosen)?);
    }
    Ok(tables)
}

/// The only array of three columns, by whatever name; an error where there are several.
fn of_only_array(container: &Container, groups: &[String], notes: &mut Vec<String>) -> Result<Vec<ParticleTable>> {
    let mut arrays = Vec::new();
    for group in groups {
        let sets = container.members(group)?.sets.into_iter();
        arrays.extend(
            sets.filter(|s| s.number.is_some() && matches!(s.shape[..], [n, 3] if n > 0)).map(|s| (group, s.name)),
        );
    }
    let names: Vec<&str> = arrays.iter().map(|f| &f.1[..]).take(8).collect();
    match &arrays[..] {
        [(group, name)] => {
            notes.push(format!("the positions are taken to be `{name}`, the only array of three columns"));
            Ok(table(container, group, Some(name))?.into_iter().collect())
        }
        [] => Ok(Vec::new()),
        _ => {
            let hint = Hint::from("choose with ").option("positions", "").words(format!(": {}", names.join(", ")));
            Err(Error::input_with(&container.place, "it is not clear which data set holds positions", hint))
        }
    }
}

/// The number of a group that is one moment of several: `Step#3`, `snapshot_010/gas`.
fn moment(group: &str) -> Option<i64> {
    const NAMES: [&str; 11] =
        ["step", "timestep", "time_step", "snap", "snapshot", "frame", "time", "iteration", "dump", "cycle", "output"];
    group.split('/').find_map(|name| {
        let name = name.to_ascii_lowercase();
        let text = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_one = NAMES.contains(&text.trim_end_matches(['_', '#', '-', ' ', '.']));
        name[text.len()..].parse().ok().filter(|_| is_one)
    })
}

/// Keeps the groups of one moment, where all groups are moments.
fn keep_frame(
    tables: &mut Vec<ParticleTable>,
    path: &Path,
    chosen: Option<i64>,
    notes: &mut Vec<String>,
) -> Result<Option<TrajectoryFrames>> {
    let Some(moments) = tables.iter().map(|t| moment(&t.group)).collect::<Option<BTreeSet<i64>>>() else {
        return Ok(None);
    };
    let count = moments.len() as u64;
    if count < 2 {
        return Ok(None);
    }
    let frame = frames::number(path, chosen, count)?;
    let step = moments.into_iter().nth(frame as usize);
    tables.retain(|t| moment(&t.group) == step);
    for table in tables.iter_mut() {
        let name = table.group.split('/').rfind(|name| moment(name).is_none());
        table.species.name = name.unwrap_or("particles").into();
    }
    if chosen.is_none() {
        notes.push(ChosenFrame::<()>::note_of_the_last(count));
    }
    Ok(Some(TrajectoryFrames { count, chosen: frame, step }))
}

/// The particles of a group: by the names of its data sets, else by the positions `chosen`.
fn table(container: &Container, group: &str, chosen: Option<&str>) -> Result<Option<ParticleTable>> {
    let sets: Vec<DataSet> = container.members(group)?.sets.into_iter().filter(|s| s.number.is_some()).collect();
    let field = |set: &DataSet| SpeciesField {
        name: set.name.clone(),
        kind: set.kind.clone(),
        components: u32::try_from(set.components()).unwrap_or(u32::MAX),
        unit: set.attributes.text(&["units", "unit", "Units"]).map(str::to_string),
    };
    let tabular = |set: &&DataSet| matches!(set.shape[..], [_] | [_, _]) && set.components() > 0;
    let all: Vec<SpeciesField> = sets.iter().filter(tabular).map(field).collect();
    let is_there = |names: &&str| match names.split(',').collect::<Vec<_>>()[..] {
        [name] => all.iter().any(|f| f.name == name && f.components == 3),
        [_, _, _] => names.split(',').all(|name| axis_of(&all, name.trim()).is_some()),
        _ => false,
    };
    let positions = positions_named(&all).or_else(|| chosen.filter(is_there).map(String::from));
    let Some(positions) = positions else { return Ok(None) };
    let set_named = |name: &str| sets.iter().find(|s| s.name == name);
    let first = positions.split(',').next().and_then(|name| axis_of(&all, name)).and_then(set_named);
    let Some(count) = first.map(|s| s.shape[0]).filter(|&n| n > 0) else { return Ok(None) };
    // Data sets of other lengths are not of these particles.
    let fields: Vec<SpeciesField> = sets.iter().filter(tabular).filter(|s| s.shape[0] == count).map(field).collect();
    let mass = mass_named(&fields);
    let attributes = |set: Option<&DataSet>| set.map(|s| s.attributes.clone()).unwrap_or_default();
    let masses = attributes(mass.as_deref().and_then(set_named));
    let name = if group == TOP { "particles".to_string() } else { group.to_string() };
    let mass = mass.map_or(SpeciesMass::Unknown, SpeciesMass::Field);
    let positions_of = attributes(first);
    let species = Species { name, aliases: Vec::new(), count, mass, positions, fields };
    Ok(Some(ParticleTable { group: group.into(), species, positions: positions_of, masses }))
}

/// The group of columns in files of OpenCosmo, and that of their metadata.
const DATA: &str = "data";
const HEADER: &str = "header";

/// Metadata of a file of OpenCosmo: <https://opencosmo.readthedocs.io>.
struct OpenCosmoHeader {
    kind: String,
    is_lightcone: bool,
    redshift: Option<f64>,
    convention: String,
    box_size: Option<f64>,
    cosmology: Cosmology,
}

impl OpenCosmoHeader {
    /// At the top or, in collections, in a group of one kind.
    fn read(container: &Container) -> Result<Option<OpenCosmoHeader>> {
        let groups = container.groups()?.into_iter().map(|g| format!("{}/{HEADER}", g.0));
        for place in std::iter::once(HEADER.to_string()).chain(groups) {
            let file = container.attributes(&format!("{place}/file"))?;
            let Some(kind) = file.text(&["data_type"]) else { continue };
            let simulation = container.attributes(&format!("{place}/simulation/parameters"))?;
            let cosmology = container.attributes(&format!("{place}/simulation/cosmology"))?;
            return Ok(Some(OpenCosmoHeader {
                kind: kind.into(),
                is_lightcone: file.number(&["is_lightcone"]) == Some(1.0),
                redshift: file.number(&["redshift"]).filter(|z| *z > -1.0 && z.is_finite()),
                convention: file.text(&["unit_convention"]).unwrap_or("scalefree").into(),
                box_size: simulation.number(&["box_size"]).filter(|l| *l > 0.0 && l.is_finite()),
                cosmology: Cosmology {
                    hubble: cosmology.number(&["h"]),
                    omega_matter: cosmology.number(&["omega_m", "Om0"]),
                    omega_lambda: cosmology.number(&["omega_l", "Ode0"]),
                    omega_baryon: cosmology.number(&["omega_b", "Ob0"]),
                },
            }));
        }
        Ok(None)
    }

    /// By its kind where the file has one alone, else by its group.
    fn name(&self, table: &mut ParticleTable) {
        table.species.name = match table.group.strip_suffix(&format!("/{DATA}")) {
            Some(group) => group.into(),
            None => self.kind.clone(),
        };
    }

    fn complete(&self, meta: &mut SnapshotMeta, notes: &mut Vec<String>) {
        meta.cosmology = self.cosmology;
        meta.units.comoving = meta.units.comoving.or(Some(self.convention != "physical"));
        meta.units = std::mem::take(&mut meta.units).settled();
        if self.is_lightcone {
            notes.push("a light cone: it has no periodic box and no one redshift".into());
            return;
        }
        meta.epoch.scale_factor = self.redshift.map(|z| 1.0 / (1.0 + z));
        // The box is stated in comoving Mpc/h whatever the convention of the columns, which are in Mpc.
        let factor = match &self.convention[..] {
            "scalefree" => Some(1.0),
            "comoving" => self.cosmology.hubble.map(|h| 1.0 / h),
            "physical" => self.cosmology.hubble.zip(meta.epoch.scale_factor).map(|(h, a)| a / h),
            _ => None,
        };
        let factor = factor.filter(|f| *f > 0.0 && meta.units.length_text().is_some_and(|unit| unit.contains("Mpc")));
        meta.cell = self.box_size.zip(factor).map(|(length, factor)| Cell::orthogonal([length * factor; 3]));
    }
}

/// The field that a name is of: `pos`, or `pos[1]`.
fn axis_of<'a>(fields: &'a [SpeciesField], name: &str) -> Option<&'a str> {
    let plain = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')).map_or(name, |(plain, _)| plain);
    fields.iter().find(|f| f.name == name).or_else(|| fields.iter().find(|f| f.name == plain)).map(|f| &f.name[..])
}

/// A box of one length or three; 0 means that there is none.
fn cell_of(lengths: &[f64], place: &str) -> Result<Option<Cell>> {
    let lengths = match *lengths {
        [l] => [l; 3],
        [x, y, z] => [x, y, z],
        _ => return Ok(None),
    };
    match lengths {
        [0.0, 0.0, 0.0] => Ok(None),
        l if l.iter().all(|l| l.is_finite() && *l > 0.0) => Ok(Some(Cell::orthogonal(l))),
        _ => Err(Error::input(place, format!("the box {lengths:?} is invalid"))),
    }
}

/// Title of an HDF5 file without particles that are read, where it is known, and the command that converts it.
pub fn foreign(path: &Path, container: &Container) -> Option<(String, Hint)> {
    let groups: Vec<String> = container.groups().ok()?.into_iter().map(|g| g.0).collect();
    if container.attributes(TOP).is_ok_and(|a| a.has("openPMD")) {
        return Some(("an openPMD file".into(), python(path, YT, "yt")));
    }
    if groups.iter().any(|g| g.starts_with("Grid0000")) {
        return Some(("an Enzo file".into(), python(path, YT, "yt")));
    }
    if let Some(frame) = groups.iter().find(|g| container.names_in(g).iter().any(|n| n == "block0_values")) {
        let code = format!("import pandas; pandas.read_hdf('{{in}}', '{frame}').to_csv('{{out}}.csv', index=False)");
        return Some(("a pandas table".into(), python(path, &code, "pandas tables")));
    }
    None
}

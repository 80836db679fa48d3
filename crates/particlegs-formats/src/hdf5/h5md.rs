//! H5MD: molecular trajectories in HDF5. Groups of `particles`, whose elements are arrays of frames, `value` beside `step`
//! and `time`, or hold for all frames: <https://www.nongnu.org/h5md/h5md.html>.

use super::columns::{ColumnTarget, DataSetColumns};
use super::container::{Container, DataSet, TOP};
use super::reader::{DataSetSequence, assemble, positions, side_by_side};
use crate::atoms::{AtomSpecies, OwnRows, cell_of};
use crate::cache::ChunkCache;
use crate::frames::{self, ChosenFrame};
use crate::npy::layout::positions_named;
use crate::pieces::{ParticlePiece, RowBuffer};
use crate::single_file::named;
use crate::{
    AbsentField, Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, TrajectoryFrames, wrapping,
};
use particlegs_core::model::{Dimension, Epoch, Unit, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// The group that every such file has, and that of its particles.
pub const MARK: &str = "h5md";
const PARTICLES: &str = "particles";
const POSITION: &str = "position";

/// An element of a group of particles.
struct H5mdElement {
    name: String,
    /// Its data set's group and name.
    place: [String; 2],
    set: DataSet,
    /// Whether it has arrays of frames.
    varies: bool,
    /// The array of the chosen frame among these.
    row: u64,
}

impl H5mdElement {
    fn shape(&self) -> &[u64] {
        &self.set.shape[usize::from(self.varies).min(self.set.shape.len())..]
    }

    fn unit(&self) -> Option<&str> {
        self.set.attributes.text(&["unit", "units"])
    }

    fn field(&self) -> SpeciesField {
        let components = u32::try_from(self.shape().get(1).copied().unwrap_or(1)).unwrap_or(u32::MAX);
        let unit = self.unit().map(String::from);
        SpeciesField { unit, ..SpeciesField::new(&self.name, &self.set.kind, components) }
    }
}

/// A group of particles.
struct H5mdGroup {
    name: String,
    /// The element that holds the positions.
    position: String,
    elements: Vec<H5mdElement>,
    frames: Option<u64>,
    rows: u64,
}

impl H5mdGroup {
    /// `None` where it has no positions.
    fn read(container: &Container, name: &str) -> Option<H5mdGroup> {
        let path = format!("{PARTICLES}/{name}");
        let element = |name: String| {
            let group = format!("{path}/{name}");
            match container.data_set(&group, "value") {
                Ok(set) => Some(H5mdElement { name, place: [group, "value".into()], set, varies: true, row: 0 }),
                Err(_) => {
                    let set = container.data_set(&path, &name).ok()?;
                    Some(H5mdElement { place: [path.clone(), name.clone()], name, set, varies: false, row: 0 })
                }
            }
        };
        let mut elements: Vec<H5mdElement> = container.names_in(&path).into_iter().filter_map(element).collect();
        let position = elements.iter().find(|e| e.name == POSITION)?;
        let &[rows, 1..=3] = position.shape() else { return None };
        let frames = position.varies.then(|| position.set.shape[0]);
        elements.retain(|e| e.set.number.is_some() && matches!(e.shape(), [n] | [n, _] if *n == rows));
        elements.sort_by_key(|e| e.name != POSITION);
        Some(H5mdGroup { name: name.into(), position: POSITION.into(), elements, frames, rows })
    }

    /// Arrays of frames at the top of a file that is not of H5MD.
    fn plain(container: &Container) -> Option<H5mdGroup> {
        let sets: Vec<DataSet> = container.members(TOP).ok()?.sets.into_iter().filter(|s| s.number.is_some()).collect();
        let is_array = |s: &&DataSet| matches!(s.shape[..], [frames, n, 3] if frames > 0 && n > 0);
        let arrays: Vec<SpeciesField> =
            sets.iter().filter(is_array).map(|s| SpeciesField::new(&s.name, "", 3)).collect();
        let position = match &arrays[..] {
            [only] => only.name.clone(),
            several => positions_named(several)?,
        };
        let &[frames, rows, _] = &sets.iter().find(|s| s.name == position)?.shape[..] else { return None };
        let element = |set: DataSet| {
            let varies = matches!(set.shape[..], [f, n] | [f, n, _] if f == frames && n == rows);
            let fits = varies || matches!(set.shape[..], [n] if n == rows);
            let place = [TOP.into(), set.name.clone()];
            fits.then(|| H5mdElement { name: set.name.clone(), place, set, varies, row: 0 })
        };
        let mut elements: Vec<H5mdElement> = sets.into_iter().filter_map(element).collect();
        elements.sort_by_key(|e| e.name != position);
        Some(H5mdGroup { name: "atoms".into(), position, elements, frames: Some(frames), rows })
    }

    /// Finds each element's array of a frame, at the same step as the positions; those that have none are left out and
    /// given back.
    fn choose(&mut self, container: &Container, frame: u64) -> Result<Vec<AbsentField>> {
        let mut absent = Vec::new();
        let place = format!("{PARTICLES}/{}/{POSITION}", self.name);
        let positions = (&place[..], self.frames.unwrap_or(1));
        for element in self.elements.iter_mut().filter(|e| e.varies) {
            let series = (&element.place[0][..], element.set.shape[0]);
            match row_of(container, positions, series, frame)? {
                Some(row) => element.row = row,
                None => absent.push(AbsentField::new(&element.name, frame, &rows_of(container, positions, series)?)),
            }
        }
        self.elements.retain(|e| absent.iter().all(|a| a.name != e.name));
        Ok(absent)
    }

    fn element(&self, name: &str) -> Option<&H5mdElement> {
        self.elements.iter().find(|e| e.name == name)
    }
}

struct H5mdSnapshot {
    description: Description,
    container: Container,
    groups: Vec<H5mdGroup>,
    /// The group of each species, and its rows there.
    species: Vec<(usize, Option<Arc<[u32]>>)>,
    wraps: bool,
}

/// Opens arrays of frames without the groups of H5MD, such as those of MDTraj; `None` where there are none.
pub fn open_plain(path: &Path, choice: &Choice) -> Result<Option<Box<dyn Snapshot>>> {
    let container = Container::open(path)?;
    let Some(group) = H5mdGroup::plain(&container) else { return Ok(None) };
    let count = group.frames.unwrap_or(1);
    let frame = frames::number(path, choice.frame, count)?;
    let frame_values = |name: &str| values(&container, [TOP, name], Some(frame)).ok();
    let unit = |name: &str, names: [(&str, &str); 2]| {
        let set = container.data_set(TOP, name).ok()?;
        let text = set.attributes.text(&["units", "unit"])?;
        Some(names.into_iter().find(|n| n.0 == text).map_or(text, |n| n.1).to_string())
    };
    let length = unit(&group.position, [("nanometers", "nm"), ("angstroms", "Angstrom")]);
    let time_unit = unit("time", [("picoseconds", "ps"), ("femtoseconds", "fs")]);
    let frames = TrajectoryFrames { count, chosen: frame, step: None };
    let cell = match (frame_values("cell_lengths").as_deref(), frame_values("cell_angles").as_deref()) {
        (Some(&[a, b, c]), Some(&[alpha, beta, gamma])) => cell_of([a, b, c], [alpha, beta, gamma]),
        _ => None,
    };
    let is_last = choice.frame.is_none() && count > 1;
    let meta = SnapshotMeta {
        cell,
        units: Units {
            time: time_unit.map(|text| Unit::parse(&text, Dimension::Time)),
            ..Units::new(length.as_deref(), None, None)
        },
        epoch: Epoch { time: frame_values("time").and_then(|t| t.first().copied()), ..frames.epoch() },
        ..named(path)
    };
    let description = Description {
        frames: Some(frames),
        notes: is_last.then(|| ChosenFrame::<()>::note_of_the_last(count)).into_iter().collect(),
        ..Description::new("HDF5, arrays of frames", &[path.to_path_buf()], meta)
    };
    let mut groups = vec![group];
    groups[0].elements.iter_mut().for_each(|e| e.row = frame);
    let mut snapshot = H5mdSnapshot { description, container, groups, species: Vec::new(), wraps: false };
    snapshot.find_species(choice.by_atoms())?;
    snapshot.settle(choice)?;
    Ok(Some(Box::new(snapshot)))
}

pub fn open(path: &Path, container: Container, choice: &Choice) -> Result<Box<dyn Snapshot>> {
    let names = container.names_in(PARTICLES);
    let mut groups: Vec<H5mdGroup> = names.iter().filter_map(|name| H5mdGroup::read(&container, name)).collect();
    let Some(first) = groups.first() else {
        let message = format!("an H5MD file without positions in a group of `{PARTICLES}`");
        return Err(Error::input(path, message));
    };
    let count = first.frames.unwrap_or(1);
    let frame = frames::number(path, choice.frame, count)?;
    if let Some(group) = groups.iter().find(|g| g.frames.is_some_and(|n| n <= frame)) {
        return Err(Error::input(path, format!("the group `{}` has no frame {frame}", group.name)));
    }
    let mut notes = Vec::new();
    if choice.frame.is_none() && count > 1 {
        notes.push(ChosenFrame::<()>::note_of_the_last(count));
    }
    let mut absent = Vec::new();
    for group in &mut groups {
        absent.extend(group.choose(&container, frame)?);
    }
    notes.extend(absent.iter().map(|field: &AbsentField| field.why.clone()));
    let first = &groups[0];
    let group = format!("{PARTICLES}/{}", first.name);
    let place = format!("{group}/{POSITION}");
    let at = |name: &str| numbers(&container, &place, name, frame).ok().flatten();
    let frames = TrajectoryFrames { count, chosen: frame, step: at("step").map(|step| step as i64) };
    let time_unit = container.data_set(&place, "time").ok();
    let time_unit = time_unit.and_then(|set| set.attributes.text(&["unit", "units"]).map(String::from));
    let units = Units {
        time: time_unit.map(|text| Unit::parse(&text, Dimension::Time)),
        ..Units::new(
            first.element(POSITION).and_then(H5mdElement::unit),
            first.element("mass").and_then(H5mdElement::unit),
            None,
        )
    };
    let meta = SnapshotMeta {
        cell: cell(&container, &format!("{group}/box"), (&place, count), frame, &mut notes)?,
        units,
        epoch: Epoch { time: at("time").filter(|t| t.is_finite()), ..frames.epoch() },
        ..named(path)
    };
    let description = Description {
        frames: Some(frames),
        absent,
        notes,
        ..Description::new("HDF5, H5MD trajectory", &[path.to_path_buf()], meta)
    };
    let mut snapshot = H5mdSnapshot { description, container, groups, species: Vec::new(), wraps: false };
    snapshot.find_species(choice.by_atoms())?;
    snapshot.settle(choice)?;
    Ok(Box::new(snapshot))
}

/// The number of a frame: an array's, or from the first one's and the steps between.
fn numbers(container: &Container, group: &str, name: &str, frame: u64) -> Result<Option<f64>> {
    let set = container.data_set(group, name)?;
    if !set.shape.is_empty() {
        return Ok(values(container, [group, name], Some(frame))?.first().copied());
    }
    let offset = set.attributes.number(&["offset"]).unwrap_or(0.0);
    Ok(values(container, [group, name], None)?.first().map(|step| offset + step * frame as f64))
}

/// Data sets that tell the moments of arrays, the surest first.
const MOMENTS: [&str; 2] = ["step", "time"];

/// The array of an element at the step, or else at the time, that frame `frame` of the positions has. Elements are
/// groups and their numbers of arrays; of one without steps and times the frame's own.
fn row_of(
    container: &Container,
    (positions, frames): (&str, u64),
    (element, arrays): (&str, u64),
    frame: u64,
) -> Result<Option<u64>> {
    let number = |group: &str| MOMENTS.map(|name| numbers(container, group, name, frame).ok().flatten());
    let (wanted, at_same_place) = (number(positions), number(element));
    for (k, name) in MOMENTS.into_iter().enumerate() {
        if container.data_set(element, name).is_err() {
            continue;
        }
        let Some(moment) = wanted[k] else { continue };
        // Mostly all elements are written at the same steps: then the list of moments need not be read.
        if frame < arrays && at_same_place[k] == Some(moment) {
            return Ok(Some(frame));
        }
        return Ok(moments(container, element, name, arrays)?.iter().position(|m| *m == moment).map(|row| row as u64));
    }
    Ok((arrays == frames).then_some(frame))
}

/// For each frame of the positions, whether an element has an array.
fn rows_of(container: &Container, positions: (&str, u64), element: (&str, u64)) -> Result<Vec<bool>> {
    for name in MOMENTS {
        let has = |group: &str| container.data_set(group, name).is_ok();
        if has(positions.0) && has(element.0) {
            let moments_of = |(group, count): (&str, u64)| moments(container, group, name, count);
            // f64 has no total order for a set; equal moments have equal bits.
            let element_moments: BTreeSet<u64> = moments_of(element)?.into_iter().map(f64::to_bits).collect();
            return Ok(moments_of(positions)?.iter().map(|m| element_moments.contains(&m.to_bits())).collect());
        }
    }
    Ok(Vec::new())
}

/// The steps or times of all arrays of an element.
fn moments(container: &Container, group: &str, name: &str, count: u64) -> Result<Vec<f64>> {
    memory::require("the steps of a trajectory", 24 * count)?;
    let set = container.data_set(group, name)?;
    if !set.shape.is_empty() {
        return rows(container, [group, name], None, count);
    }
    let offset = set.attributes.number(&["offset"]).unwrap_or(0.0);
    let step = values(container, [group, name], None)?.first().copied().unwrap_or(0.0);
    Ok((0..count).map(|i| offset + step * i as f64).collect())
}

/// Numbers of a small data set, or of its frame, row by row.
fn values(container: &Container, place: [&str; 2], frame: Option<u64>) -> Result<Vec<f64>> {
    rows(container, place, frame, 3)
}

/// The same of at most `most` rows.
fn rows(container: &Container, [group, name]: [&str; 2], frame: Option<u64>, most: u64) -> Result<Vec<f64>> {
    let choice = Choice::default();
    let shape = container.data_set(group, name)?.shape;
    let components = shape.get(1 + usize::from(frame.is_some())).copied().unwrap_or(1).min(3);
    let wants: Vec<ColumnTarget> = (0..components).map(|k| ColumnTarget { component: k, target: k as usize }).collect();
    let part = DataSetSequence { choice: &choice, count: 0 }.part(container, [group, name], frame, &wants)?;
    let rows = part.count().min(most);
    let mut out = RowBuffer::default();
    DataSetColumns::new(vec![part], Arc::new(ChunkCache::new(0)), false).read(0..rows, &mut out)?;
    Ok((0..rows as usize)
        .flat_map(|i| (0..components as usize).map(move |k| (i, k)))
        .map(|(i, k)| out.position[k][i])
        .collect())
}

/// The cell of a frame: three lengths, or three vectors.
fn cell(
    container: &Container,
    group: &str,
    positions: (&str, u64),
    frame: u64,
    notes: &mut Vec<String>,
) -> Result<Option<Cell>> {
    let varying = format!("{group}/edges");
    let edges = match container.data_set(&varying, "value") {
        Ok(set) => {
            let series = (&varying[..], set.shape.first().copied().unwrap_or(0));
            let Some(row) = row_of(container, positions, series, frame)? else {
                notes.push(AbsentField::new("box", frame, &rows_of(container, positions, series)?).why);
                return Ok(None);
            };
            values(container, [&varying, "value"], Some(row))?
        }
        Err(_) if container.data_set(group, "edges").is_ok() => values(container, [group, "edges"], None)?,
        Err(_) => return Ok(None),
    };
    let vectors = match edges[..] {
        [x, y, z] => [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]],
        [ax, ay, az, bx, by, bz, cx, cy, cz] => [[ax, ay, az], [bx, by, bz], [cx, cy, cz]],
        _ => return Ok(None),
    };
    let attributes = container.attributes(group)?;
    let boundary = attributes.texts("boundary").unwrap_or_default();
    if boundary.len() != 3 {
        notes.push("the file does not say which sides are periodic: assuming none".into());
    }
    let periodic = [0, 1, 2].map(|k| boundary.get(k).is_some_and(|side| side.trim() == "periodic"));
    Ok(Cell::stated([0.0; 3], vectors, periodic))
}

impl H5mdSnapshot {
    /// Groups are species; where there is one, its numbers of species tell them apart, if not all are `as_one`.
    fn find_species(&mut self, as_one: bool) -> Result<()> {
        for index in 0..self.groups.len() {
            let one = &self.groups[index];
            let fields: Vec<SpeciesField> = one.elements.iter().map(H5mdElement::field).collect();
            let mass = one.element("mass").map_or(SpeciesMass::Unknown, |e| SpeciesMass::Field(e.name.clone()));
            let (name, positions) = (one.name.clone(), one.position.clone());
            let all = Species { name, aliases: Vec::new(), count: one.rows, mass, positions, fields };
            self.description.species.push(all.clone());
            self.species.push((index, None));
            if as_one || self.groups.len() > 1 || self.groups[0].element("species").is_none_or(|e| e.shape().len() != 1)
            {
                continue;
            }
            let mut types = Vec::new();
            // A reader always gives three columns.
            let choice = Choice { positions: Some("species,species,species".into()), ..Choice::default() };
            let reader = self.reader(0, &choice)?;
            let runs = reader.count().div_ceil(particlegs_particles::RUN as u64);
            reader.read_wide(0..runs, &mut |_, [x, ..]| {
                types.extend(x.iter().map(|&v| v as i64));
                Ok(())
            })?;
            let kinds: Vec<i64> = types.iter().copied().collect::<BTreeSet<i64>>().into_iter().collect();
            let names: Vec<_> = kinds.iter().map(|k| (format!("species {k}"), vec![k.to_string()])).collect();
            let types: Vec<u32> = types.iter().filter_map(|t| kinds.binary_search(t).ok()).map(|k| k as u32).collect();
            let species_by_type = AtomSpecies::all(Vec::new(), all.count).by_type(&types, &names);
            if species_by_type.len() > 1 {
                (self.species, self.description.species) = Default::default();
                for species in species_by_type {
                    let count = species.own.as_ref().map_or(0, |rows| rows.len() as u64);
                    let (name, aliases) = (species.name, species.aliases);
                    self.description.species.push(Species { name, aliases, count, ..all.clone() });
                    self.species.push((0, species.own));
                }
            }
        }
        if self.groups.len() > 1 {
            self.description.notes.push("groups of particles are species; the same atom may be in several".into());
        }
        Ok(())
    }

    fn settle(&mut self, choice: &Choice) -> Result<()> {
        let mut first = Vec::new();
        if self.description.meta.cell.is_some() {
            self.reader(0, &Choice::default())?.read_wide(0..1, &mut |_, [x, y, z]| {
                let all = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]);
                first = all.take(wrapping::LOOKED_AT).collect();
                Ok(())
            })?;
        }
        self.wraps =
            wrapping::settle(&mut self.description, choice, |periods| wrapping::leave(periods, first.into_iter()))?;
        Ok(())
    }
}

impl Snapshot for H5mdSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let (Some(species), Some((group, rows))) = (self.description.species.get(species), self.species.get(species))
        else {
            return Err(Error::argument(format!("species {species} does not exist")));
        };
        let name = &self.description.meta.name;
        let mut wanted = positions(species, name, choice.positions.as_deref().unwrap_or(&species.positions))?;
        let weight = species.weight_field(name, &choice.weights)?;
        if let Some(name) = &weight {
            wanted.push((name.clone(), vec![ColumnTarget { component: 0, target: 3 }]));
        }
        let mut sets = DataSetSequence { choice, count: 0 };
        let mut columns = Vec::new();
        for (name, wants) in &wanted {
            let missing = || species.missing(&self.container.place, name, [].into_iter());
            let element = self.groups[*group].element(name).ok_or_else(missing)?;
            let [group, name] = &element.place;
            let frame = element.varies.then_some(element.row);
            columns.push(vec![sets.part(&self.container, [group, name], frame, wants)?]);
        }
        let moved = self.wraps && choice.positions.as_ref().is_none_or(|p| *p == species.positions);
        let cell = if moved { wrapping::cell(&self.description, choice)? } else { None };
        let meta = self.description.meta_of(species);
        assemble(meta, side_by_side(columns)?, weight.is_some(), |inner| {
            Box::new(OwnRows { inner, own: rows.clone(), cell })
        })
    }
}

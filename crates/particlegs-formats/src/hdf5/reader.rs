//! A reader of one species with the fields chosen, over all files.

use super::columns::{ColumnTarget, DataSetColumns, DataSetPart, chunk_bytes};
use super::container::Container;
use super::header::TYPES;
use super::storage::table;
use super::virtual_sets;
use crate::axes::axis;
use crate::cache::ChunkCache;
use crate::pieces::{ParticlePiece, PieceReader};
use crate::{Choice, Description, Species, SpeciesField};
use particlegs_core::{Error, Result};
use particlegs_files::input::MappedFile;
use particlegs_files::memory;
use particlegs_particles::{RUN, SnapshotMeta, SnapshotReader};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub struct GroupSource<'a> {
    pub parts: &'a [FilePart],
    pub kind: usize,
    pub group: &'a str,
    pub species: &'a Species,
    pub description: &'a Description,
}

pub struct FilePart {
    pub path: PathBuf,
    pub map: Arc<MappedFile>,
    /// Rows of each type's positions.
    pub rows: [u64; TYPES],
}

/// Files in which f64 positions are looked at to find where they lie.
const SAMPLED: usize = 8;

/// Decoded chunks that are kept at most. Larger sets of chunks are read stretch by stretch.
const BUDGET: u64 = 96 << 20;

/// Data sets to read, each with its columns.
pub type DataSetTargets = Vec<(String, Vec<ColumnTarget>)>;

pub fn reader(source: &GroupSource<'_>, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
    let species = source.species;
    let place = &source.description.meta.name;
    let mut wanted = positions(species, place, choice.positions.as_deref().unwrap_or(&species.positions))?;
    let weight = species.weight_field(place, &choice.weights)?;
    if let Some(name) = &weight {
        wanted.push((name.clone(), vec![ColumnTarget { component: 0, target: 3 }]));
    }
    let group = source.group;
    let used: Vec<&FilePart> = source.parts.iter().filter(|p| p.rows[source.kind] > 0).collect();
    let mut tables = Vec::with_capacity(used.len());
    let mut sets = DataSetSequence { choice, count: 0 };
    for file in used {
        let container = Container::from_map(&file.path, file.map.clone())?;
        let mut sources = BTreeMap::new();
        let columns = wanted.iter().map(|(name, wants)| sets.parts(&container, &mut sources, [group, name], wants));
        tables.extend(side_by_side(columns.collect::<Result<_>>()?)?);
    }
    assemble(source.description.meta_of(species), tables, weight.is_some(), |piece| piece)
}

/// Data sets that are read, one after the other.
pub struct DataSetSequence<'a> {
    pub choice: &'a Choice,
    pub count: u64,
}

impl DataSetSequence<'_> {
    /// Columns of a data set: one part, or as many as a virtual one has sources.
    fn parts(
        &mut self,
        container: &Container,
        sources: &mut BTreeMap<Arc<Path>, Container>,
        [group, name]: [&str; 2],
        wants: &[ColumnTarget],
    ) -> Result<Vec<DataSetPart>> {
        let set = container.data_set(group, name)?;
        let Some(extents) = virtual_sets::extents(container, group, &set)? else {
            return Ok(vec![self.part(container, [group, name], None, wants)?]);
        };
        let mut parts = Vec::with_capacity(extents.len());
        for extent in extents {
            let source = match sources.entry(extent.source.file.clone()) {
                Entry::Occupied(open) => open.into_mut(),
                Entry::Vacant(new) => {
                    let source = Container::open(new.key())?;
                    new.insert(source)
                }
            };
            let mut part = self.part(source, extent.source.name(), None, wants)?;
            let whole = [0..part.table.rows, 0..part.table.components];
            let [rows, columns] = extent.there.unwrap_or(whole.clone());
            let stated = extent.rows.end - extent.rows.start;
            if rows.end > whole[0].end
                || columns != whole[1]
                || columns.end != set.components()
                || rows.end.checked_sub(rows.start) != Some(stated)
            {
                let shape = format!("{} rows of {} numbers", part.table.rows, part.table.components);
                let message =
                    format!("it has {shape}, but {} refers to {stated} rows of {}", container.place, set.components());
                return Err(Error::input_with(part.place, message, "the two files may belong to different snapshots"));
            }
            part.rows = rows;
            parts.push(part);
        }
        Ok(parts)
    }

    /// Columns of a data set, or of one of its frames.
    pub fn part(
        &mut self,
        container: &Container,
        [group, name]: [&str; 2],
        frame: Option<u64>,
        wants: &[ColumnTarget],
    ) -> Result<DataSetPart> {
        let place = format!("{}: {group}/{name}", container.place);
        let mut table = table(container, group, name, frame)?;
        match &mut table.packed {
            None => table.kind = table.kind.stored(self.choice.as_stored),
            Some(packed) => *packed = packed.stored(self.choice.as_stored),
        }
        if let Some(want) = wants.iter().find(|w| w.component >= table.components) {
            let message = format!("it has {} numbers per row, not {}", table.components, want.component + 1);
            return Err(Error::input(place, message));
        }
        let (key, rows) = (self.count, 0..table.rows);
        self.count += 1;
        Ok(DataSetPart { map: container.map.clone(), rows, table: Arc::new(table), wants: wants.to_vec(), place, key })
    }
}

/// Pieces with one part of each column, cut where any column goes on in another data set.
pub fn side_by_side(mut columns: Vec<Vec<DataSetPart>>) -> Result<Vec<Vec<DataSetPart>>> {
    let count = |parts: &Vec<DataSetPart>| parts.iter().map(DataSetPart::count).sum::<u64>();
    let rows = columns.first().map_or(0, count);
    if let Some(odd) = columns.iter().find(|c| count(c) != rows) {
        let place = odd.first().map_or("", |p| &p.place);
        return Err(Error::input(place, format!("it has {} rows, but the positions have {rows}", count(odd))));
    }
    // `pop` takes from the end.
    columns.iter_mut().for_each(|parts| parts.reverse());
    let mut pieces = Vec::new();
    while let Some(rows) = columns.iter().filter_map(|c| Some(c.last()?.count())).min() {
        let take = |parts: &mut Vec<DataSetPart>| {
            let mut part = parts.pop()?;
            let rest = part.rows.start + rows..part.rows.end;
            part.rows.end = rest.start;
            if !rest.is_empty() {
                parts.push(DataSetPart { rows: rest, ..part.clone() });
            }
            Some(part)
        };
        pieces.push(columns.iter_mut().filter_map(take).collect());
    }
    Ok(pieces)
}

/// A reader of tables one after the other, as `shown`: the rows of each that are read, and how.
pub fn assemble(
    meta: SnapshotMeta,
    tables: Vec<Vec<DataSetPart>>,
    weighted: bool,
    shown: impl Fn(Box<dyn ParticlePiece>) -> Box<dyn ParticlePiece>,
) -> Result<Box<dyn SnapshotReader>> {
    let (rows, bytes) = tables.iter().flat_map(|t| chunk_bytes(t)).fold((0, 0), |a, b| (a.0.max(b.0), a.1.max(b.1)));
    let threads = particlegs_core::parallel::threads() as u64;
    // As many rows of chunks as threads can work on, and the budget allows.
    let together = (BUDGET / bytes.max(1)).saturating_sub(1).clamp(1, threads.max(2));
    // Those that are kept, and one in two stages of its decoding.
    memory::require("decoding the chunks of this HDF5 file", (together + 3).saturating_mul(bytes))?;
    let cache = Arc::new(ChunkCache::new(((together + 1) * bytes) as usize));
    let step = tables.len().div_ceil(SAMPLED).max(1);
    let mut pieces: Vec<Box<dyn ParticlePiece>> = Vec::with_capacity(tables.len());
    for (index, parts) in tables.into_iter().enumerate() {
        let piece = DataSetColumns::new(parts, cache.clone(), index % step == 0);
        pieces.push(shown(Box::new(piece)));
    }
    let inner = PieceReader::new(meta, pieces, weighted)?;
    // Chunks that only few runs wide are shared by neighbours on one thread; those that are wider must
    // not be decoded again for every run.
    let wide = rows > 2 * RUN as u64;
    Ok(Box::new(if wide { inner.by_stretches((together * rows).div_ceil(RUN as u64)) } else { inner }))
}

/// Data sets of the positions: one of three numbers a row, or three, `x,y,z`.
pub fn positions(species: &Species, place: &str, name: &str) -> Result<DataSetTargets> {
    let find = |name: &str, components: u32| -> Result<&SpeciesField> {
        species.fields.iter().find(|f| f.name == name && f.components == components).ok_or_else(|| {
            let field_names = species.fields.iter().filter(|f| f.components == components).map(|f| &f.name[..]);
            species.missing(place, name, field_names)
        })
    };
    let names: Vec<&str> = name.split(',').map(str::trim).collect();
    match names[..] {
        [name] => {
            let wants = (0..3).map(|k| ColumnTarget { component: k, target: k as usize }).collect();
            Ok(vec![(find(name, 3)?.name.clone(), wants)])
        }
        [_, _, _] => {
            let one = |(target, name): (usize, &&str)| match axis(species, name) {
                Some(axis) => Ok((axis.field, vec![ColumnTarget { component: axis.component.into(), target }])),
                None => Ok((find(name, 1)?.name.clone(), vec![ColumnTarget { component: 0, target }])),
            };
            names.iter().enumerate().map(one).collect()
        }
        _ => Err(Error::argument(format!("positions `{name}` must be one field or three"))),
    }
}

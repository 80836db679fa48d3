//! GenericIO, the format of HACC: columns of every rank, each with a checksum.
//!
//! Columns are read where they lie, or decompressed by blosc. The header's CRC64 is verified when a
//! file is opened; a column's before its first number is handed over, rank by rank as they are read.

mod header;
mod ranks;

use crate::axes::{self, FieldComponent};
use crate::cache::DEFAULT_BYTES;
use crate::numbers::NumberType;
use crate::pieces::{ParticlePiece, PieceReader};
use crate::single_file::named;
use crate::{Choice, Description, Format, Snapshot, Species, SpeciesField, SpeciesMass};
use header::GenericIoFile;
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use ranks::Ranks;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub const FORMAT: Format = Format {
    name: "genericio",
    title: "GenericIO (HACC)",
    detect: |head| head.compression.is_none() && header::signature(&head.bytes).is_some(),
    open: |paths, _| Ok(Box::new(GenericIo::open(paths)?)),
};

struct GenericIo {
    files: Vec<Arc<GenericIoFile>>,
    description: Description,
}

impl GenericIo {
    fn open(paths: &[PathBuf]) -> Result<GenericIo> {
        let files = open(paths)?;
        let description = describe(&paths[0], &files)?;
        Ok(GenericIo { files: files.into_iter().map(Arc::new).collect(), description })
    }
}

fn describe(path: &Path, files: &[GenericIoFile]) -> Result<Description> {
    let first = &files[0];
    let count = files.iter().flat_map(|f| &f.ranks).try_fold(0u64, |sum, r| sum.checked_add(r.count));
    let count = count.ok_or_else(|| Error::input(path, "too many particles to count"))?;
    if count == 0 {
        return Err(Error::input(path, "it holds no particles"));
    }
    // Truncation is reported before anything is read.
    files.iter().try_for_each(|f| f.check())?;
    let ranks: usize = files.iter().map(|f| f.ranks.len()).sum();
    // The first rank stands for all: files of big runs have a million.
    let compressed = (0..first.ranks.len().min(1))
        .any(|r| (0..first.variables.len()).any(|v| first.column(r, v).is_ok_and(|c| c.blosc)));
    let order = if first.big_endian { "big-endian" } else { "little-endian" };
    let format = format!("GenericIO, {ranks} rank(s), {order}{}", if compressed { ", blosc" } else { "" });
    let has = |v: &header::Variable| v.kind.is_some() && files.iter().all(|f| f.variable(&v.name).is_some());
    let fields: Vec<SpeciesField> = first
        .variables
        .iter()
        .filter(|v| has(v))
        .map(|v| SpeciesField::new(&v.name, v.kind.map_or("", |k| k.name()), 1))
        .collect();
    let known = |name: &str| fields.iter().any(|f| f.name == name);
    let mass = if known("mass") { SpeciesMass::Field("mass".into()) } else { SpeciesMass::Unknown };
    let axis = |k: usize| {
        let plain = ["x", "y", "z"][k];
        let marked = first.variables.iter().find(|v| v.axis == Some(k) && has(v)).map(|v| &v.name[..]);
        if known(plain) { plain } else { marked.unwrap_or(plain) }.to_string()
    };
    let positions = [axis(0), axis(1), axis(2)].join(",");
    let other: Vec<&str> = first.variables.iter().filter(|v| !has(v)).map(|v| &v.name[..]).collect();
    let units = "the file states no units; HACC usually uses Mpc/h: set the unit of length";
    let unread =
        (!other.is_empty()).then(|| format!("variables that are not numbers are skipped: {}", other.join(", ")));
    let notes = std::iter::once(units.to_string()).chain(unread).collect();
    let species = Species { name: "particles".into(), aliases: vec![], count, mass, positions, fields };
    let files: Vec<_> = files.iter().map(|f| f.path.clone()).collect();
    Ok(Description { species: vec![species], notes, ..Description::new(format, &files, meta(path, first)) })
}

fn meta(path: &Path, file: &GenericIoFile) -> SnapshotMeta {
    let cell =
        file.scale.iter().all(|&s| s > 0.0).then(|| Cell { origin: file.origin, ..Cell::orthogonal(file.scale) });
    SnapshotMeta { cell, ..named(path) }
}

impl Snapshot for GenericIo {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = &self.description.species[species];
        let place = self.files[0].path.display().to_string();
        let columns = axes::columns(&place, species, choice)?;
        let mut pieces: Vec<Box<dyn ParticlePiece>> = Vec::new();
        for file in &self.files {
            let variable = |column: &FieldComponent| {
                let missing = || Error::input(&file.path, format!("there is no variable {}", column.field));
                file.variable(&column.field).ok_or_else(missing)
            };
            let variables: Vec<usize> = columns.iter().map(variable).collect::<Result<_>>()?;
            let cache = DEFAULT_BYTES / self.files.len();
            pieces.push(Box::new(Ranks::new(file.clone(), &variables, cache, choice.as_stored)?));
        }
        if let ([one], [file]) = (&pieces[..], &self.files[..])
            && file.ranks.iter().filter(|r| r.count > 0).count() == 1
        {
            // One rank can be used where it lies, past `read`: what is wrong must be said here.
            one.read(0..1, &mut crate::pieces::RowBuffer::default())?;
        }
        Ok(Box::new(PieceReader::new(self.description.meta.clone(), pieces, columns.len() > 3)?))
    }
}

/// The column of a map.
const PARTITION: &str = "$partition";

/// Snapshots in several files: `name` maps ranks to partitions, which `name#0`, `name#7`, ... hold.
fn open(paths: &[PathBuf]) -> Result<Vec<GenericIoFile>> {
    let whole = whole_of(&paths[0]);
    let first = GenericIoFile::open(&whole)?;
    let Some(partition) = first.variable(PARTITION) else {
        return match paths.iter().find(|p| **p != whole) {
            Some(other) => Err(Error::input_with(
                other,
                format!("a second file was named, but {} is a whole snapshot", whole.display()),
                "name one snapshot at a time",
            )),
            None => Ok(vec![first]),
        };
    };
    let parts: Vec<PathBuf> = partitions(&first, partition)?.iter().map(|p| part(&whole, *p)).collect();
    if let Some(alien) = paths.iter().find(|p| **p != whole && !parts.contains(p)) {
        let message = format!("{} does not list this file", whole.display());
        return Err(Error::input_with(alien, message, "name one snapshot at a time"));
    }
    let open = |path: &PathBuf| {
        if path.exists() {
            return GenericIoFile::open(path);
        }
        let message = format!("this file is missing: {} lists it as part of the snapshot", whole.display());
        Err(Error::input_with(path, message, "put all files of the snapshot into one folder"))
    };
    let files: Vec<GenericIoFile> = parts.iter().map(open).collect::<Result<_>>()?;
    if files.is_empty() {
        return Err(Error::input(&whole, "the map lists no files"));
    }
    if let Some(odd) = files.iter().find(|f| f.scale != files[0].scale || f.origin != files[0].origin) {
        return Err(Error::input(&odd.path, format!("the box differs from that of {}", files[0].path.display())));
    }
    Ok(files)
}

fn part(whole: &Path, number: i64) -> PathBuf {
    PathBuf::from(format!("{}#{number}", whole.display()))
}

/// `name` for `name#7` where there is such a file.
fn whole_of(path: &Path) -> PathBuf {
    let text = path.to_string_lossy();
    match text.rsplit_once('#') {
        Some((stem, number)) if number.parse::<u32>().is_ok() && Path::new(stem).is_file() => stem.into(),
        _ => path.to_path_buf(),
    }
}

fn partitions(map: &GenericIoFile, variable: usize) -> Result<BTreeSet<i64>> {
    let mut out = BTreeSet::new();
    for (r, rank) in map.ranks.iter().enumerate() {
        let column = map.column(r, variable)?;
        let kind =
            map.variables[variable].kind.filter(|k| matches!(k, NumberType::I32 | NumberType::I64 | NumberType::U32));
        let kind = kind.filter(|_| !column.blosc);
        let kind = kind.ok_or_else(|| Error::input(&map.path, "the map of ranks has an unknown layout"))?;
        for i in 0..rank.count {
            let at = (column.start + i * kind.bytes()) as usize;
            out.insert(kind.get(&map.bytes[at..], map.big_endian) as i64);
            if out.len() > 65_536 {
                return Err(Error::input(&map.path, "the map lists more than 65536 files"));
            }
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests;

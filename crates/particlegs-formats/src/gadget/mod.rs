//! Gadget-1 and -2 binary snapshots: formats 1 and 2, either byte order, one or several files (`snap.0`, `snap.1`, ...).
//!
//! The blocks lie in the files as the numbers are, so that they are read where they lie. The file
//! has no units: none are given.

mod blocks;
mod header;
mod order;

use crate::axes::{self, FieldComponent};
use crate::numbers::{StridedColumn, StridedParticles};
use crate::physical::{UNDECIDED, VelocityConvention};
use crate::pieces::{ParticlePiece, PieceReader};
use crate::single_file::named;
use crate::{Choice, Description, Format, Snapshot, Species, SpeciesField, SpeciesMass};
use blocks::GadgetFile;
use header::TYPES;
use particlegs_core::model::species_aliases;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotReader;
use std::path::{Path, PathBuf};

pub const FORMAT: Format = Format {
    name: "gadget",
    title: "Gadget binary",
    detect: |head| head.compression.is_none() && blocks::signature(&head.bytes).is_some(),
    open: |paths, choice| Ok(Box::new(Gadget::open(paths, choice)?)),
};

struct Gadget {
    parts: Vec<GadgetFile>,
    description: Description,
    types: Vec<usize>,
}

impl Gadget {
    fn open(paths: &[PathBuf], options: &Choice) -> Result<Gadget> {
        let (parts, notes) = open(paths, options)?;
        let present = |t: &usize| parts.iter().any(|p| p.header.count[*t] > 0);
        let types: Vec<usize> = (0..TYPES).filter(present).collect();
        if types.is_empty() {
            return Err(Error::input(&paths[0], "it holds no particles"));
        }
        let species = types.iter().map(|&t| species(&parts, t)).collect::<Result<_>>()?;
        let mut description = describe(&parts, paths, species);
        description.notes.extend(notes);
        Ok(Gadget { parts, description, types })
    }
}

fn describe(parts: &[GadgetFile], paths: &[PathBuf], species: Vec<Species>) -> Description {
    let first = &parts[0];
    let format = format!(
        "Gadget binary, format {}, {}",
        if first.named { 2 } else { 1 },
        if first.big_endian { "big-endian" } else { "little-endian" }
    );
    let mut notes =
        vec!["the file states no units; Gadget usually uses kpc/h: set the units of length and mass".to_string()];
    let h = &first.header;
    if h.is_cosmological() {
        notes.push(format!("redshift {}, Omega0 {}, OmegaLambda {}", h.redshift, h.omega0, h.omega_lambda));
    }
    if h.convention().is_undecided() && first.block("VEL").is_some() {
        notes.push(UNDECIDED.into());
    }
    let usual = ["POS", "VEL", "ID", "MASS", "U", "RHO", "NE", "NH", "HSML"];
    if first.order.iter().any(|name| !usual.contains(&&name[..])) {
        let order = first.order.join(", ");
        notes.push(format!("format 1 does not name its blocks; judging by sizes and values they are {order}"));
    }
    if !first.unknown.is_empty() {
        notes.push(format!("skipped blocks of unknown layout: {}", first.unknown.join(", ")));
    }
    let files: Vec<_> = parts.iter().map(|p| p.path.clone()).collect();
    Description { species, notes, ..Description::new(format, &files, h.meta(named(&paths[0]))) }
}

fn species(parts: &[GadgetFile], t: usize) -> Result<Species> {
    let with = || parts.iter().filter(|p| p.header.count[t] > 0);
    let first = with().next().expect("a part with particles of the type");
    let table = first.header.mass[t];
    let holds = |p: &GadgetFile, name: &str| p.block(name).is_some_and(|b| b.types[t]);
    let mass = if table > 0.0 {
        SpeciesMass::Each(table)
    } else if with().all(|p| holds(p, "MASS")) {
        SpeciesMass::Field("MASS".into())
    } else if with().any(|p| holds(p, "MASS")) {
        return Err(Error::input(&first.path, "some files of the snapshot have a block MASS and others do not"));
    } else {
        SpeciesMass::Unknown
    };
    let fields = first.blocks.iter().filter(|b| b.types[t] && with().all(|p| holds(p, &b.name)));
    let field = |b: &blocks::GadgetBlock| SpeciesField::new(&b.name, b.kind.name(), b.components);
    Ok(Species {
        name: format!("PartType{t}"),
        aliases: species_aliases(t),
        count: with().map(|p| u64::from(p.header.count[t])).sum(),
        mass,
        positions: "POS".into(),
        fields: fields.map(field).collect(),
    })
}

impl Snapshot for Gadget {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let (t, species) = (self.types[species], &self.description.species[species]);
        let place = self.parts[0].path.display().to_string();
        let columns = axes::columns(&place, species, choice)?;
        let mut pieces: Vec<Box<dyn ParticlePiece>> = Vec::new();
        for part in self.parts.iter().filter(|p| p.header.count[t] > 0) {
            let lane = |FieldComponent { field, component }: &FieldComponent| {
                let block = part.block(field).filter(|b| b.types[t] && *component < b.components);
                let block = block.ok_or_else(|| Error::input(&part.path, format!("there is no block {field}")))?;
                let lane = part.lane(block, t, *component);
                Ok(StridedColumn { kind: lane.kind.stored(choice.as_stored), ..lane })
            };
            let lanes: Vec<StridedColumn> = columns.iter().map(lane).collect::<Result<_>>()?;
            let (place, rows) = (part.path.display().to_string(), part.header.count[t].into());
            pieces.push(Box::new(StridedParticles::new(&place, part.bytes.clone(), rows, &lanes)?));
        }
        Ok(Box::new(PieceReader::new(self.description.meta_of(species), pieces, columns.len() > 3)?))
    }

    fn convention(&self) -> VelocityConvention {
        self.parts[0].header.convention()
    }
}

/// More files than any snapshot has.
const MOST_FILES: u32 = 65_536;

/// Opens all files of the snapshot that `paths` belong to: one of them is enough; their blocks as
/// [`GadgetFile::open`]. Also what a user should know.
fn open(paths: &[PathBuf], options: &Choice) -> Result<(Vec<GadgetFile>, Vec<String>)> {
    let named_file = GadgetFile::open(&paths[0], &options.blocks)?;
    let files = named_file.header.files;
    if files > MOST_FILES {
        return Err(Error::input(&paths[0], format!("the header says {files} files: the header is damaged")));
    }
    let mut notes = Vec::new();
    let names = match names(&paths[0], files) {
        // Part of a snapshot may have been given another name.
        Err(_) if !options.strict && paths.len() == 1 => {
            notes.push(format!("the snapshot has {files} files; this file is read as one part of it"));
            vec![paths[0].clone()]
        }
        names => names?,
    };
    if let Some(alien) = paths.iter().find(|p| !names.contains(p)) {
        let message = format!("this is not one of the {files} file(s) of the snapshot {}", names[0].display());
        return Err(Error::input_with(alien, message, "name one snapshot at a time"));
    }
    let mut parts: Vec<GadgetFile> = Vec::with_capacity(names.len());
    for name in &names {
        if !name.exists() {
            let message =
                format!("this file is missing: {} says that the snapshot has {files} files", paths[0].display());
            return Err(Error::input_with(name, message, "put all files of the snapshot into one folder"));
        }
        let part = GadgetFile::open(name, &options.blocks)?;
        check_alike(&named_file, &part)?;
        parts.push(part);
    }
    for message in wrong_totals(&parts) {
        if options.strict {
            return Err(Error::input_with(&parts[0].path, message, "a file of the snapshot is missing or damaged"));
        }
        notes.push(format!("{message}: using the particles found"));
    }
    Ok((parts, notes))
}

/// `snap.0` ... of one of them.
fn names(path: &Path, files: u32) -> Result<Vec<PathBuf>> {
    if files == 1 {
        return Ok(vec![path.to_path_buf()]);
    }
    let text = path.to_str().unwrap_or_default();
    match text.rsplit_once('.') {
        Some((stem, number)) if number.parse().is_ok_and(|n: u32| n < files) => {
            Ok((0..files).map(|i| PathBuf::from(format!("{stem}.{i}"))).collect())
        }
        _ => Err(Error::input_with(
            path,
            format!("the snapshot has {files} files, but this file name has no number"),
            format!("name them NAME.0 to NAME.{}", files - 1),
        )),
    }
}

fn check_alike(first: &GadgetFile, part: &GadgetFile) -> Result<()> {
    let (a, b) = (&first.header, &part.header);
    let same = a.files == b.files && a.total == b.total && a.box_size == b.box_size && a.time == b.time;
    let masses = (0..TYPES).all(|t| a.count[t] == 0 || b.count[t] == 0 || a.mass[t] == b.mass[t]);
    if same && masses {
        return Ok(());
    }
    let message = format!("the header differs from that of {}", first.path.display());
    Err(Error::input_with(&part.path, message, "the files are of different snapshots"))
}

/// Notes of the types whose totals in the headers are not what the files hold together. Codes that leave the totals 0
/// are believed, and the high words are not looked at: old codes leave what was in memory there.
fn wrong_totals(parts: &[GadgetFile]) -> Vec<String> {
    let total = parts[0].header.total;
    let sum = |t: usize| parts.iter().map(|p| u64::from(p.header.count[t])).sum::<u64>();
    let wrong = (0..TYPES).filter(|&t| total != [0; TYPES] && sum(t) as u32 != total[t]);
    wrong
        .map(|t| format!("the header says {} particles of type {t} in total, but the files have {}", total[t], sum(t)))
        .collect()
}

#[cfg(test)]
mod tests;

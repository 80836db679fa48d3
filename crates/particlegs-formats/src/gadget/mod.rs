//! Gadget-1 and -2 binary snapshots: formats 1 and 2, either byte order, one or several files.
//!
//! The blocks lie in the files as the numbers are, so that they are read where they lie. The file
//! has no units: none are given.

mod blocks;
mod header;
mod order;
mod parts;
mod records;

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
use std::path::PathBuf;

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
        let (parts, notes) = parts::open(paths, options)?;
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

#[cfg(test)]
mod tests;

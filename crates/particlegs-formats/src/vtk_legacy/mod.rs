//! Legacy VTK files: text and binary, versions 2 to 5.1, of anything that has points.

mod scan;

use crate::numbers::Bytes;
use crate::pieces::PieceReader;
use crate::single_file::named;
use crate::vtk_xml::mass_of;
use crate::vtk_xml::points::PiecePoints;
use crate::vtk_xml::source::{ArraySource, VtkArray, open_columns};
use crate::vtk_xml::stream::Stream;
use crate::{Choice, Description, Format, Snapshot, Species, SpeciesField, axes};
use particlegs_core::model::Epoch;
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use scan::{ArrayData, LegacyArray, LegacyContents};
use std::path::PathBuf;

pub const FORMAT: Format = Format {
    name: "vtk-legacy",
    title: "legacy VTK",
    detect: |head| head.compression.is_none() && head.bytes.starts_with(b"# vtk DataFile"),
    open: |paths, _| Ok(Box::new(LegacySnapshot::open(paths)?)),
};

struct LegacySnapshot {
    place: String,
    bytes: Bytes,
    scanned: LegacyContents,
    description: Description,
}

impl LegacySnapshot {
    fn open(paths: &[PathBuf]) -> Result<LegacySnapshot> {
        let path = &paths[0];
        if let Some(second) = paths.get(1) {
            return Err(Error::input_with(second, "a second VTK file was named", "name one file"));
        }
        let bytes = Bytes::from_file(path)?;
        let scanned = scan::scan(path, &bytes)?;
        if scanned.points == 0 {
            return Err(Error::input(path, "it holds no points"));
        }
        let coding = if scanned.ascii { "text" } else { "binary" };
        let field = |a: &LegacyArray| SpeciesField::new(&a.name, a.kind.name(), a.components);
        let fields: Vec<SpeciesField> = scanned.arrays.iter().map(field).collect();
        let (name, count, mass) = ("points".into(), scanned.points, mass_of(&fields));
        let species = Species { name, aliases: vec![], count, mass, positions: "POINTS".into(), fields };
        let meta = SnapshotMeta { epoch: Epoch { time: scanned.time, ..Epoch::default() }, ..named(path) };
        let description = Description {
            species: vec![species],
            notes: scanned.note.iter().cloned().collect(),
            ..Description::new(
                format!("legacy VTK {}, {}, {coding}", scanned.version, scanned.dataset),
                std::slice::from_ref(path),
                meta,
            )
        };
        Ok(LegacySnapshot { place: path.display().to_string(), bytes, scanned, description })
    }
}

fn array(legacy_array: &LegacyArray) -> VtkArray {
    let source = match &legacy_array.data {
        ArrayData::Binary(at) => ArraySource::Plain(Stream::Raw(*at)),
        ArrayData::Text(text) => ArraySource::Ascii(text.clone()),
    };
    let (name, kind, components) = (legacy_array.name.clone(), legacy_array.kind, legacy_array.components);
    VtkArray { name, kind, components, big_endian: true, source }
}

impl Snapshot for LegacySnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = &self.description.species[species];
        let columns = axes::columns(&self.place, species, choice)?;
        let arrays = open_columns(&columns, |name| {
            let legacy_array = self.scanned.arrays.iter().find(|a| a.name == name);
            let missing = || Error::input(&self.place, format!("there is no array `{name}`"));
            let vtk_array = array(legacy_array.ok_or_else(missing)?);
            Ok(VtkArray { kind: vtk_array.kind.stored(choice.as_stored), ..vtk_array })
        })?;
        let points = PiecePoints::new(&self.place, self.bytes.clone(), self.scanned.points, arrays)?;
        let meta = self.description.meta.clone();
        Ok(Box::new(PieceReader::new(meta, vec![Box::new(points)], columns.len() > 3)?))
    }
}

#[cfg(test)]
mod tests;

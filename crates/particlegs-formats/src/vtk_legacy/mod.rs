//! Legacy VTK files: text and binary, versions 2 to 5.1, of anything that has points.

mod scan;

use crate::numbers::Bytes;
use crate::pieces::PieceReader;
use crate::single_file::named;
use crate::vtk_xml::mass_of;
use crate::vtk_xml::points::{ArraySource, PiecePoints, VtkArray, open_columns};
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
mod tests {
    use super::*;
    use crate::testing::open_bytes;
    use crate::{SpeciesMass, Weights};

    fn rows(bytes: &[u8], choice: &Choice) -> Result<(Description, Vec<[f64; 4]>)> {
        let snapshot = open_bytes("a.vtk", bytes)?;
        Ok((snapshot.description().clone(), crate::testing::rows(&*snapshot, 0, choice)?))
    }

    const TEXT: &str = "# vtk DataFile Version 2.0\ntitle\nASCII\nDATASET POLYDATA\nFIELD FieldData 1\nTIME 1 1 double\n0.25\n\
        POINTS 2 float\n1 2 3 4\n5 6\nVERTICES 2 4\n1 0 1 1\nCELL_DATA 2\nSCALARS c float\nLOOKUP_TABLE default\n0 0\n\
        POINT_DATA 2\nSCALARS mass float 1\nLOOKUP_TABLE default\n7 8\nVECTORS v%20w int\n1 1 1 2 2 2\n";

    #[test]
    fn text_with_sections_in_any_order() {
        let (d, got) = rows(TEXT.as_bytes(), &Choice::default()).unwrap();
        assert_eq!(got, [[1.0, 2.0, 3.0, 7.0], [4.0, 5.0, 6.0, 8.0]]);
        assert_eq!((d.meta.epoch.time, &d.species[0].mass), (Some(0.25), &SpeciesMass::Field("mass".into())));
        let names: Vec<&str> = d.species[0].fields.iter().map(|f| &f.name[..]).collect();
        assert_eq!(names, ["POINTS", "mass", "v w"]);
        let other = Choice { positions: Some("v w".into()), weights: Weights::None, ..Choice::default() };
        assert_eq!(rows(TEXT.as_bytes(), &other).unwrap().1[1], [2.0, 2.0, 2.0, 0.0]);
        let (d, _) = rows(format!("{TEXT}MYSTERY 3\n").as_bytes(), &Choice::default()).unwrap();
        assert!(d.notes[0].contains("MYSTERY"));
    }

    fn binary(modern: bool) -> Vec<u8> {
        let mut out = format!(
            "# vtk DataFile Version {}\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 2 double\n",
            if modern { "5.1" } else { "3.0" }
        )
        .into_bytes();
        (1..7).for_each(|v| out.extend(f64::from(v).to_be_bytes()));
        if modern {
            out.extend(b"\nMETADATA\nINFORMATION 0\n\nCELLS 2 2\nOFFSETS vtktypeint64\n");
            [0i64, 2].iter().for_each(|v| out.extend(v.to_be_bytes()));
            out.extend(b"\nCONNECTIVITY vtktypeint64\n");
            [0i64, 1].iter().for_each(|v| out.extend(v.to_be_bytes()));
        } else {
            out.extend(b"\nCELLS 1 3\n");
            [2i32, 0, 1].iter().for_each(|v| out.extend(v.to_be_bytes()));
        }
        out.extend(b"\nCELL_TYPES 1\n\0\0\0\x02\nPOINT_DATA 2\nFIELD FieldData 1\nmass 1 2 short\n");
        out.extend([0, 9, 0, 10, b'\n']);
        out
    }

    #[test]
    fn binary_of_both_generations() {
        for modern in [false, true] {
            let (_, got) = rows(&binary(modern), &Choice::default()).unwrap();
            assert_eq!(got, [[1.0, 2.0, 3.0, 9.0], [4.0, 5.0, 6.0, 10.0]]);
        }
    }

    #[test]
    fn broken_files_are_refused() {
        let fault = |text: &str| rows(text.as_bytes(), &Choice::default()).unwrap_err().to_string();
        assert!(fault(&TEXT.replace("POINTS 2", "POINTS 4000000000")).contains("12000000000 numbers"));
        assert!(fault(&TEXT.replace("POINTS 2", "POINTS -2")).contains("not a count"));
        assert!(fault(&TEXT.replace("1 2 3 4", "1 2 x 4")).contains("`x` at byte"));
        assert!(fault(&TEXT.replace("POLYDATA", "STRUCTURED_POINTS")).contains("no explicit points"));
        assert!(fault(TEXT.split("POINTS").next().unwrap()).contains("no POINTS"));
        let whole = binary(true);
        for bytes in [whole, TEXT.as_bytes().to_vec()] {
            for cut in 0..bytes.len() {
                let _ = rows(&bytes[..cut], &Choice::default());
            }
        }
    }
}

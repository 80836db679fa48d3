//! Catalogues of haloes as files.

use crate::hdf5::{OutDataSet, OutGroup, OutValue, plan};
use particlegs_core::text::{cell, one_line, printable};
use particlegs_core::{Error, Result};
use particlegs_files::output::{PlacedFile, ending, write_atomic};
use particlegs_measure::haloes::{HaloCatalogue, HaloColumn};
use particlegs_particles::Number;
use std::path::Path;

/// Longest text of an attribute.
const MOST_TEXT: usize = 2000;

/// Writes a catalogue: as HDF5 where the name ends in `.hdf5` or `.h5`, with a data set a column in the group `Haloes`,
/// else as CSV, with the columns' names in the first line and what they are in lines behind `#`. The file appears whole
/// or not at all.
///
/// # Errors
/// A file that cannot be written; a name that means another type of file; a catalogue without haloes.
pub fn write_haloes(catalogue: &HaloCatalogue, out: &Path) -> Result<()> {
    let is_hdf5 = is_hdf5(out)?;
    if catalogue.is_empty() {
        return Err(Error::argument("there are no haloes to write"));
    }
    match is_hdf5 {
        true => write_hdf5(catalogue, out),
        false => write_csv(catalogue, out),
    }
}

/// Whether a catalogue's name means HDF5, or else CSV.
///
/// # Errors
/// A name that means another type of file.
pub fn is_hdf5(out: &Path) -> Result<bool> {
    Ok(ending(out, &["csv", "hdf5", "h5"])?.is_some_and(|e| e != "csv"))
}

fn write_csv(catalogue: &HaloCatalogue, out: &Path) -> Result<()> {
    write_atomic(out, |to| {
        let names: Vec<String> = catalogue.columns.iter().map(|c| cell(&c.name)).collect();
        writeln!(to, "{}", names.join(","))?;
        // For readers of centres, which take the unit of these from it.
        if let Some(x) = catalogue.columns.iter().find(|c| c.name == "x" && !c.unit.is_empty()) {
            writeln!(to, "# positions and radii in {}", one_line(&x.unit))?;
        }
        catalogue.remarks.iter().try_for_each(|line| writeln!(to, "# {}", one_line(line)))?;
        for c in &catalogue.columns {
            let unit = if c.unit.is_empty() { String::new() } else { format!(" [{}]", c.unit) };
            writeln!(to, "# {}", one_line(&format!("{}{unit}: {}", c.name, c.description)))?;
        }
        for i in 0..catalogue.len() {
            let row: Vec<String> = catalogue.columns.iter().map(|c| text_of(c, i)).collect();
            writeln!(to, "{}", row.join(","))?;
        }
        Ok(())
    })
}

/// A value in nine digits; nothing where there is none.
fn text_of(column: &HaloColumn, i: usize) -> String {
    match column.values[i] {
        v if !v.is_finite() => String::new(),
        v if column.whole => format!("{v:.0}"),
        v => {
            let short: f64 = format!("{v:.8e}").parse().unwrap_or(v);
            if (1e-4..1e9).contains(&short.abs()) || short == 0.0 { format!("{short}") } else { format!("{short:e}") }
        }
    }
}

fn write_hdf5(catalogue: &HaloCatalogue, out: &Path) -> Result<()> {
    let text = |text: &str| OutValue::Text(printable(text).chars().take(MOST_TEXT).collect());
    // A column with gaps holds NaN, which whole numbers do not have.
    let is_whole = |c: &HaloColumn| c.whole && c.values.iter().all(|v| v.is_finite());
    let set = |c: &HaloColumn| OutDataSet {
        name: one_line(&c.name).into_owned(),
        number: if is_whole(c) { Number::I64 } else { Number::F64 },
        rows: catalogue.len() as u64,
        columns: 1,
        attributes: vec![("unit", text(&c.unit)), ("description", text(&c.description))],
        source: Vec::new(),
        hollow: false,
    };
    let group = OutGroup {
        name: "Haloes".into(),
        attributes: vec![("remarks", text(&catalogue.remarks.join("\n")))],
        sets: catalogue.columns.iter().map(set).collect(),
    };
    let plan = plan(&[group]);
    let file = PlacedFile::create(out, plan.length)?;
    file.write_at(&plan.metadata, 0)?;
    for (c, at) in catalogue.columns.iter().zip(plan.data.iter().flatten()) {
        let bytes: Vec<u8> = match is_whole(c) {
            true => c.values.iter().flat_map(|v| (*v as i64).to_le_bytes()).collect(),
            false => c.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        };
        file.write_at(&bytes, *at)?;
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Catalogue;
    use particlegs_core::model::{UnitSystem, Units};

    fn catalogue() -> HaloCatalogue {
        let column = |name: &str, unit: &str, values: [f64; 2]| HaloColumn {
            name: name.into(),
            unit: unit.into(),
            description: "something".into(),
            whole: name == "id",
            values: values.into(),
        };
        let columns = vec![
            column("id", "", [1.0, 2.0]),
            column("x", "Mpc/h", [0.125, 3.0]),
            column("y", "Mpc/h", [1.0 / 3.0, 4.0]),
            column("z", "Mpc/h", [12.0, 5.0]),
            column("m200m", "Msun/h", [1.234_567_891e14, f64::NAN]),
            column("r200m", "Mpc/h", [1.5, f64::NAN]),
        ];
        let remarks = vec!["haloes of a snapshot".into(), "a = 0.5; h = 0.7".into()];
        HaloCatalogue { columns, remarks, ..HaloCatalogue::default() }
    }

    #[test]
    fn tables_are_read_again_as_centres() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("haloes.csv");
        let all = HaloCatalogue { centers: vec![[0.0; 3]; 2], ..catalogue() };
        write_haloes(&all, &out).unwrap();
        let text = std::fs::read_to_string(&out).unwrap();
        assert!(text.starts_with("id,x,y,z,m200m,r200m\n# positions and radii in Mpc/h\n# haloes of"), "{text}");
        assert!(text.ends_with("1,0.125,0.333333333,12,1.23456789e14,1.5\n2,3,4,5,,\n"), "{text}");
        let (kpc, read) = (Units::new(Some("kpc/h"), None, Some(true)), Catalogue::parse(text.as_bytes()).unwrap());
        let to = UnitSystem { units: &kpc, scale_factor: Some(0.5), hubble: Some(0.7) };
        let (centres, _) = read.convert(&to, None).unwrap();
        let expected = [([125.0, 333.333_333, 12_000.0], Some(1500.0)), ([3000.0, 4000.0, 5000.0], None)];
        for (centre, expected) in centres.iter().zip(expected) {
            assert!((0..3).all(|k| (centre.0[k] - expected.0[k]).abs() < 1e-6) && centre.1 == expected.1, "{centre:?}");
        }
        assert!(write_haloes(&catalogue(), &out).is_err());
        let text = write_haloes(&all, &dir.path().join("haloes.txt")).unwrap_err();
        assert_eq!(text.hint().to_string(), "possible endings: .csv, .hdf5, .h5");
    }

    #[test]
    fn hdf5_holds_whole_numbers_and_values() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("haloes.hdf5");
        write_haloes(&HaloCatalogue { centers: vec![[0.0; 3]; 2], ..catalogue() }, &out).unwrap();
        let bytes = std::fs::read(&out).unwrap();
        assert!(bytes.starts_with(b"\x89HDF\r\n\x1a\n"));
        let numbers: Vec<u8> = [1i64, 2].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(bytes.windows(16).any(|w| w == numbers));
    }
}

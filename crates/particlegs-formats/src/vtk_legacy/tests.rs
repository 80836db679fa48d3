//! Small files made here: text and binary, sections before and after the points.

use super::*;
use crate::testing::open_bytes;
use crate::{Choice, SpeciesMass, Weights};

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

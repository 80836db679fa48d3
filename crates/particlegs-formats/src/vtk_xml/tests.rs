//! Small files made here: encodings, several pieces, lists of files, what is refused, out and in.

use super::*;
use crate::testing::written;
use crate::{Choice, Weights};
use particlegs_core::context::Context;
use particlegs_core::model::{Layer, Mass as LayerMass, Units};
use particlegs_particles::{Column, Particles, Storage};

fn rows(path: &Path, choice: &Choice) -> Result<(Description, Vec<[f64; 4]>)> {
    let snapshot = choice.open(&[path.to_path_buf()])?;
    Ok((snapshot.description().clone(), crate::testing::rows(&*snapshot, 0, choice)?))
}

fn xml(pieces: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\"><PolyData>{pieces}</PolyData></VTKFile>"
    )
}

/// Two points as text, with masses in base64: a length of 8 bytes, then 7 and 8 as f32.
const PIECE: &str = "<Piece NumberOfPoints=\"2\"><PointData><DataArray type=\"Float32\" Name=\"Mass\" format=\"binary\">\n\
    CAAAAAAA4EAAAABB </DataArray><DataArray type=\"String\" Name=\"s\" format=\"ascii\"/></PointData><Points>\
    <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\"><InformationKey>9</InformationKey>1 2 3\n4 5 6</DataArray></Points></Piece>";

#[test]
fn pieces_of_text_and_base64() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtp");
    std::fs::write(&path, xml(&format!("{PIECE}<Piece NumberOfPoints=\"0\"/>{PIECE}"))).unwrap();
    let (d, got) = rows(&path, &Choice::default()).unwrap();
    assert_eq!(got[..2], [[1.0, 2.0, 3.0, 7.0], [4.0, 5.0, 6.0, 8.0]]);
    assert_eq!(got[2..], got[..2]);
    assert_eq!((d.species[0].count, &d.species[0].mass), (4, &SpeciesMass::Field("Mass".into())));
    assert_eq!(d.species[0].fields.len(), 2);
    // The length encoded on its own, as some writers do.
    let apart = PIECE.replace("CAAAAAAA4EAAAABB", "CAAAAA==AADgQAAAAEE=");
    std::fs::write(&path, xml(&apart)).unwrap();
    assert_eq!(rows(&path, &Choice::default()).unwrap().1, got[..2]);
}

#[test]
fn lists_name_files_beside_them() {
    let folder = tempfile::tempdir().unwrap();
    let list = |source: &str| {
        let text = format!(
            "<VTKFile type=\"PPolyData\"><PPolyData><PPoints><PDataArray/></PPoints><Piece Source=\"{source}\"/><Piece Source=\"p/1.vtp\"/></PPolyData></VTKFile>"
        );
        let path = folder.path().join("a.pvtp");
        std::fs::write(&path, text).unwrap();
        rows(&path, &Choice::default())
    };
    std::fs::create_dir(folder.path().join("p")).unwrap();
    std::fs::write(folder.path().join("p/0.vtp"), xml(PIECE)).unwrap();
    assert!(list("p/0.vtp").unwrap_err().to_string().contains("missing"));
    std::fs::write(folder.path().join("p/1.vtp"), xml(PIECE)).unwrap();
    assert_eq!(list("p/0.vtp").unwrap().1.len(), 4);
    assert!(list("../b.vtp").unwrap_err().to_string().contains("outside"));
    assert!(list("/etc/passwd").unwrap_err().to_string().contains("outside"));
    assert!(list("a.pvtp").unwrap_err().to_string().contains("neither"));
}

#[test]
fn broken_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtp");
    let fault = |text: &str| {
        std::fs::write(&path, text).unwrap();
        rows(&path, &Choice::default()).unwrap_err().to_string()
    };
    let good = xml(PIECE);
    assert!(
        fault(&good.replace("NumberOfPoints=\"2\"", "NumberOfPoints=\"4294967295\""))
            .contains("too short for 4294967295 rows")
    );
    assert!(fault(&good.replace("NumberOfPoints=\"2\"", "NumberOfPoints=\"1\"")).contains("8 bytes instead of 4"));
    assert!(fault(&good.replace("4 5", "4 x")).contains("`x`"));
    assert!(fault(&good.replace("PolyData", "ImageData")).contains("ImageData"));
    assert!(fault(&good.replace("<VTKFile", "<!DOCTYPE l [<!ENTITY a \"b\">]><VTKFile")).contains("entities"));
    assert!(fault(&good.replace("4 5", "&a;")).contains("entities"));
    assert!(fault(&xml(&"<a>".repeat(100))).contains("nested"));
    assert!(fault(&good.replace("format=\"binary\"", "format=\"appended\" offset=\"0\"")).contains("no appended data"));
    for cut in 0..good.len() {
        fault(&good[..cut]);
    }
}

/// A VTP of one point, and lists of such files.
fn lists(folder: &Path) {
    let put = |name: &str, text: String| std::fs::write(folder.join(name), text).unwrap();
    let file = |kind: &str, inside: String| format!("<VTKFile type=\"{kind}\"><{kind}>{inside}</{kind}></VTKFile>");
    for i in 0..4 {
        let points =
            format!("<Points><DataArray type=\"Float32\" NumberOfComponents=\"3\">{i} 2 3</DataArray></Points>");
        put(&format!("p{i}.vtp"), file("PolyData", format!("<Piece NumberOfPoints=\"1\">{points}</Piece>")));
    }
    put("grid.vti", file("ImageData", String::new()));
    let sets = |attributes: &[&str]| attributes.iter().map(|a| format!("<DataSet {a}/>")).collect::<String>();
    let moments = [
        "timestep=\"0\" file=\"p0.vtp\"",
        "timestep=\"0.5\" part=\"0\" file=\"p1.vtp\"",
        "timestep=\"0.5\" part=\"1\" file=\"p2.vtp\"",
    ];
    put("run.pvd", file("Collection", sets(&moments)));
    let blocks = |attributes: &[&str]| format!("<Block index=\"0\" name=\"fluid\">{}</Block>", sets(attributes));
    put(
        "a.vtm",
        file(
            "vtkMultiBlockDataSet",
            blocks(&["index=\"0\" file=\"./p3.vtp\"", "index=\"1\" file=\"grid.vti\"", "file=\"p0.vtp\""]),
        ),
    );
    put("of_blocks.pvd", file("Collection", sets(&["timestep=\"7\" file=\"a.vtm\""])));
    put("grids.vtm", file("vtkMultiBlockDataSet", blocks(&["file=\"grid.vti\""])));
    put("out.pvd", file("Collection", sets(&["file=\"../p0.vtp\""])));
    put("self.vtm", file("vtkMultiBlockDataSet", sets(&["file=\"self.vtm\""])));
}

#[test]
fn collections_and_blocks_are_read() {
    let folder = tempfile::tempdir().unwrap();
    lists(folder.path());
    let read = |name: &str, frame| {
        let (d, rows) = rows(&folder.path().join(name), &Choice { frame, ..Choice::default() })?;
        Ok::<_, particlegs_core::Error>((d, rows.iter().map(|r| r[0]).collect::<Vec<_>>()))
    };
    let (d, x) = read("run.pvd", None).unwrap();
    assert_eq!((x, d.meta.epoch.time, d.meta.epoch.frame), (vec![1.0, 2.0], Some(0.5), Some(1)));
    assert!(d.notes[0].contains("using frame 1, the last of 2 (0 to 1)"));
    let (d, x) = read("run.pvd", Some(0)).unwrap();
    assert_eq!((x, d.meta.epoch.time, d.notes.len()), (vec![0.0], Some(0.0), 0));
    assert!(read("run.pvd", Some(2)).unwrap_err().to_string().contains("there is no frame 2; the frames are 0 to 1"));
    let (d, x) = read("a.vtm", None).unwrap();
    assert!(x == [3.0, 0.0] && d.frames.is_none() && d.notes[0].contains("grid.vti is skipped"), "{:?}", d.notes);
    let (d, x) = read("of_blocks.pvd", None).unwrap();
    assert_eq!((x, d.meta.epoch.time), (vec![3.0, 0.0], Some(7.0)));
    for (name, why) in [
        ("grids.vtm", "none of the listed files has points"),
        ("out.pvd", "outside its folder"),
        ("self.vtm", "nested too deeply"),
        ("grid.vti", "have no explicit points"),
    ] {
        assert!(read(name, None).unwrap_err().to_string().contains(why), "{name}");
    }
    // Their folder is several snapshots: what a list names is none of its own.
    let error =
        Choice::default().read(&[folder.path().to_path_buf()], &Storage::Memory, &Context::SILENT).err().unwrap();
    assert!(error.to_string().contains("run.pvd") && !error.to_string().contains("p1.vtp"), "{error}");
}

#[test]
fn out_and_in_gives_equal_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtp");
    let n = 70_001;
    let column = |k: u32| (0..n).map(|i| (i as f32 * 0.7 + k as f32).sin() * 1e3).collect::<Vec<f32>>();
    let mut p = Particles::from_columns(column(0), column(1), column(2));
    p.meta.epoch.time = Some(0.125);
    let bytes = written(&p, &path, "vtp");
    assert!(bytes < n as u64 * 16 + 2000);
    let (d, got) = rows(&path, &Choice::default()).unwrap();
    assert_eq!((d.meta.epoch.time, &d.species[0].mass), (Some(0.125), &SpeciesMass::Unknown));
    let same = |got: &[[f64; 4]], weight: &dyn Fn(usize) -> f32| {
        (0..n as usize).all(|i| {
            let [x, y, z] = p.position(i);
            got[i].map(f64::to_bits) == [x, y, z, weight(i).into()].map(f64::to_bits)
        })
    };
    assert!(same(&got, &|_| 0.0));
    let snapshot = Choice::default().open(std::slice::from_ref(&path)).unwrap();
    assert!(snapshot.reader(0, &Choice::default()).unwrap().in_place().is_some());

    let layer = |name: &str, content, mass| Layer { name: name.into(), mass, content };
    let weights = (0..n).map(|i| if i < 66_000 { 0.5 } else { i as f32 }).collect();
    let (dm, gas) = (LayerMass::Each(0.5), LayerMass::Weights(None));
    let q = p
        .clone()
        .with_weights(Column::owned(weights))
        .with_layers(vec![layer("dm--x", 0..66_000, dm), layer("gas", 66_000..n as usize, gas)]);
    written(&q, &path, "vtp");
    let (d, got) = rows(&path, &Choice::default()).unwrap();
    assert_eq!(d.species[0].mass, SpeciesMass::Field("mass".into()));
    assert!(same(&got, &|i| if i < 66_000 { 0.5 } else { i as f32 }));
    let species = Choice { weights: Weights::Field("species".into()), ..Choice::default() };
    // A sum of numbers of species is no map.
    assert!(rows(&path, &species).is_err());
}

/// `tests/data/vtk/written.vtp` was read by VTK 9.7.2 (vtkXMLPolyDataReader): six points, one cell
/// of all, `mass`, `species` and TimeValue, equal bits.
#[test]
fn the_bytes_written_are_those_that_vtk_reads() {
    let reference_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/vtk/written.vtp");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtp");
    let column = |k: f32| (0..6).map(|i| 1.0 / (i as f32 + k)).collect::<Vec<f32>>();
    let mut p = Particles::from_columns(column(0.5), column(1.5), column(2.5));
    p.meta.epoch.time = Some(0.125);
    p.meta.units = Units::new(Some("kpc/h"), None, None);
    let layer = |name: &str, content, mass| Layer { name: name.into(), mass, content };
    let p = p
        .with_weights(Column::owned(vec![0.5, 0.5, 3.0, 4.0, 5.0, 6.0]))
        .with_layers(vec![layer("dm", 0..2, LayerMass::Each(0.5)), layer("gas", 2..6, LayerMass::Weights(None))]);
    written(&p, &path, "vtp");
    if std::env::var_os("WRITE_FIXTURES").is_some() {
        std::fs::copy(&path, &reference_file).unwrap();
    }
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(reference_file).unwrap());
}

//! Fields of every type through every format that has it: the same numbers for whoever counts with them, all bits for
//! whoever copies them.

use particlegs_compress::FieldSelection;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_formats::{Choice, Writer};
use particlegs_particles::{LayerFields, Particles, SelectedParticles, Selection, Storage, Tiling};
use std::path::{Path, PathBuf};

/// Three rows of a scalar `s` and a vector `v`: numbers of a type as text, its name in NumPy, and what of it is stored.
struct NumberColumn {
    numpy: &'static str,
    rows: [&'static str; 3],
}

const fn column(numpy: &'static str, rows: [&'static str; 3]) -> NumberColumn {
    NumberColumn { numpy, rows }
}

/// The largest whole numbers are no float64.
const COLUMNS: [NumberColumn; 11] = [
    column("i1", ["-128", "5", "127"]),
    column("u1", ["0", "5", "255"]),
    column("i2", ["-32768", "5", "32767"]),
    column("u2", ["0", "5", "65535"]),
    column("i4", ["-2147483648", "5", "2147483647"]),
    column("u4", ["0", "5", "4294967295"]),
    column("i8", ["-9007199254740993", "5", "9223372036854775807"]),
    column("u8", ["0", "9007199254740993", "18446744073709551615"]),
    column("f2", ["-2.5", "0.125", "65504"]),
    column("f4", ["-2.5", "0.1", "3e38"]),
    column("f8", ["-2.5", "0.1", "1e300"]),
];

const POSITIONS: [[f64; 3]; 3] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.5], [7.0, 8.0, 1.5]];

impl NumberColumn {
    fn is_whole_of_64_bits(&self) -> bool {
        ["i8", "u8"].contains(&self.numpy)
    }

    fn bits(&self, row: usize) -> u64 {
        let text = self.rows[row];
        text.parse().unwrap_or_else(|_| text.parse::<i64>().unwrap() as u64)
    }

    fn bytes(&self, row: usize) -> Vec<u8> {
        let text = self.rows[row];
        match self.numpy {
            "f2" => [0xc100u16, 0x3000, 0x7bff][row].to_le_bytes().to_vec(),
            "f4" => text.parse::<f32>().unwrap().to_le_bytes().to_vec(),
            "f8" => text.parse::<f64>().unwrap().to_le_bytes().to_vec(),
            whole => self.bits(row).to_le_bytes()[..whole[1..].parse().unwrap()].to_vec(),
        }
    }

    /// The number as float64.
    fn value(&self, row: usize) -> f64 {
        let text = self.rows[row];
        if self.numpy == "f4" { text.parse::<f32>().unwrap().into() } else { text.parse().unwrap() }
    }

    /// Component `k` of the vector has the scalar's rows, moved on by k.
    fn row_of(row: usize, k: usize) -> usize {
        (row + k) % 3
    }
}

/// A table of x, y, z, s, v as NumPy writes it.
fn npy(column: &NumberColumn) -> Vec<u8> {
    let kind = column.numpy;
    let fields = format!("('x', '<f8'), ('y', '<f8'), ('z', '<f8'), ('s', '<{kind}'), ('v', '<{kind}', (3,))");
    let header = format!("{{'descr': [{fields}], 'fortran_order': False, 'shape': (3,), }}");
    let header = format!("{header:<237}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for row in 0..3 {
        bytes.extend(POSITIONS[row].iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(column.bytes(row));
        (0..3).for_each(|k| bytes.extend(column.bytes(NumberColumn::row_of(row, k))));
    }
    bytes
}

fn table(separator: &str, row: impl Fn(usize) -> Vec<String>) -> String {
    (0..3).map(|i| row(i).join(separator) + "\n").collect()
}

fn place(i: usize) -> Vec<String> {
    POSITIONS[i].iter().map(f64::to_string).collect()
}

fn vector(column: &NumberColumn, i: usize) -> String {
    [0, 1, 2].map(|k| column.rows[NumberColumn::row_of(i, k)]).join(" ")
}

/// Files of formats that have whole numbers of 64 bits, with the scalar's name.
fn others(column: &NumberColumn, signed: bool) -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let text = |rows: &dyn Fn(usize) -> Vec<String>| table(" ", rows);
    let s = |i: usize| column.rows[i].to_string();
    let places = text(&place);
    let scalars = text(&|i| vec![s(i)]);
    let vectors = text(&|i| vec![vector(column, i)]);
    let xml = if signed { "Int64" } else { "UInt64" };
    let legacy = if signed { "vtktypeint64" } else { "vtktypeuint64" };
    let big = |rows: &dyn Fn(usize) -> Vec<u64>| (0..3).flat_map(rows).flat_map(u64::to_be_bytes).collect::<Vec<u8>>();
    let binary = [
        b"# vtk DataFile Version 4.2\nx\nBINARY\nDATASET POLYDATA\nPOINTS 3 double\n".to_vec(),
        big(&|i| POSITIONS[i].map(f64::to_bits).to_vec()),
        format!("\nPOINT_DATA 3\nSCALARS s {legacy} 1\nLOOKUP_TABLE default\n").into_bytes(),
        big(&|i| vec![column.bits(i)]),
        format!("\nVECTORS v {legacy}\n").into_bytes(),
        big(&|i| [0, 1, 2].map(|k| column.bits(NumberColumn::row_of(i, k))).to_vec()),
    ];
    let mut all = vec![
        (
            "ascii.vtp",
            "s",
            format!(
                "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\"><PolyData><Piece NumberOfPoints=\"3\">\
                 <PointData><DataArray type=\"{xml}\" Name=\"s\" format=\"ascii\">{scalars}</DataArray>\
                 <DataArray type=\"{xml}\" Name=\"v\" NumberOfComponents=\"3\" format=\"ascii\">{vectors}</DataArray>\
                 </PointData><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">{places}\
                 </DataArray></Points></Piece></PolyData></VTKFile>"
            )
            .into_bytes(),
        ),
        (
            "ascii.vtk",
            "s",
            format!(
                "# vtk DataFile Version 4.2\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 double\n{places}\nPOINT_DATA 3\n\
                 SCALARS s {legacy} 1\nLOOKUP_TABLE default\n{scalars}\nVECTORS v {legacy}\n{vectors}\n"
            )
            .into_bytes(),
        ),
        ("binary.vtk", "s", binary.concat()),
        (
            "a.csv",
            "id",
            format!("x,y,z,id\n{}", table(",", |i| [place(i), vec![s(i)]].concat())).into_bytes(),
        ),
        (
            "a.extxyz",
            "s",
            format!(
                "3\nProperties=species:S:1:pos:R:3:s:I:1:v:I:3\n{}",
                text(&|i| [vec!["H".into()], place(i), vec![s(i), vector(column, i)]].concat())
            )
            .into_bytes(),
        ),
    ];
    let asdf_kind = if signed { "int64" } else { "uint64" };
    let array = |name: &str, source: u32, kind: &str, shape: &str| {
        format!(
            "  {name}: !core/ndarray-1.1.0 {{source: {source}, datatype: {kind}, byteorder: big, shape: [{shape}]}}\n"
        )
    };
    let tree = format!(
        "#ASDF 1.0.0\n#ASDF_STANDARD 1.6.0\n%YAML 1.1\n%TAG ! tag:stsci.edu:asdf/\n--- !core/asdf-1.1.0\ndata:\n{}{}{}header: \
         {{}}\n...\n",
        array("pos", 0, "float64", "3, 3"),
        array("s", 1, asdf_kind, "3"),
        array("v", 2, asdf_kind, "3, 3"),
    );
    let block = |content: Vec<u8>| {
        let size = (content.len() as u64).to_be_bytes();
        [&b"\xd3BLK\0\x30"[..], &[0; 8], &size, &size, &size, &[0; 16], &content].concat()
    };
    let content = [
        big(&|i| POSITIONS[i].map(f64::to_bits).to_vec()),
        big(&|i| vec![column.bits(i)]),
        big(&|i| [0, 1, 2].map(|k| column.bits(NumberColumn::row_of(i, k))).to_vec()),
    ];
    all.push(("a.asdf", "s", [tree.into_bytes(), content.map(block).concat()].concat()));
    all
}

fn read(path: &Path) -> (Particles, Vec<LayerFields>) {
    let read = Choice::default().read_fields(&[path.to_path_buf()], &Storage::Memory, &Context::SILENT);
    read.unwrap_or_else(|e| panic!("{}: {e} ({})", path.display(), e.hint()))
}

/// Holds the fields of a file to the column, and writes it in every other format that has them.
fn check(path: &Path, column: &NumberColumn, scalar: &str, copies: bool) {
    let (particles, layers) = read(path);
    let place = format!("{}, {}", path.display(), column.numpy);
    let numbered = |name: &str| layers[0].fields.iter().position(|f| f.name == name);
    // HDF5 has a name of its own for ids.
    let number = numbered(scalar).or_else(|| numbered("ParticleIDs")).unwrap_or_else(|| panic!("{place}: no {scalar}"));
    // Text has the shortest decimal of a float32.
    let values_of = |number: usize| -> Vec<Vec<f64>> {
        let round = |v: f64| if column.numpy == "f4" { f64::from(v as f32) } else { v };
        let columns = layers[0].values(number, 3).unwrap();
        columns.into_iter().map(|c| c.into_iter().map(round).collect()).collect()
    };
    let values = values_of(number);
    assert_eq!(values, [[0, 1, 2].map(|i| column.value(i)).to_vec()], "{place}");
    if column.is_whole_of_64_bits() && layers[0].fields[number].number.is_whole() {
        assert_eq!(layers[0].identities(number, 3).unwrap(), [0, 1, 2].map(|i| column.bits(i)), "{place}");
    }
    if let Some(number) = numbered("v") {
        let values = values_of(number);
        let component = |k: usize| [0, 1, 2].map(|i| column.value(NumberColumn::row_of(i, k))).to_vec();
        assert_eq!(values, [0, 1, 2].map(component), "{place}");
    }
    let names = [layers[0].fields[number].name.clone()];
    let chosen = FieldSelection::new(&names, Default::default(), &particles, &layers, LawKind::OpticalDepth).unwrap();
    // Whole numbers of few values are a category: its first class is that of the least.
    let share = chosen.quantities()[0].class().is_some();
    let of_model: f64 = chosen.values(0).unwrap().columns[0].iter().sum();
    let sum: f64 = if share { 1.0 } else { [0, 1, 2].map(|i| column.value(i)).iter().sum() };
    assert!((of_model / sum - 1.0).abs() < 1e-6, "{place}: {of_model} {sum}");
    if !copies {
        return;
    }
    for ending in ["hdf5", "vtp", "dump"] {
        let out = path.with_extension(format!("copy.{ending}"));
        let selected_particles =
            SelectedParticles::new(&particles, Tiling::single(), Selection::all(), &Context::SILENT).unwrap();
        let writer = Writer::for_output(&out, None).unwrap();
        writer.write(&selected_particles.with_fields(layers.clone()), &out, &Context::SILENT).unwrap();
        check(&out, column, scalar, false);
    }
}

#[test]
fn fields_of_every_type_are_the_same_numbers_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: Vec<u8>| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    for column in &COLUMNS {
        check(&file(&format!("{}.npy", column.numpy), npy(column)), column, "s", true);
        if column.is_whole_of_64_bits() {
            for (name, scalar, bytes) in others(column, column.numpy == "i8") {
                check(&file(name, bytes), column, scalar, true);
            }
        }
    }
}

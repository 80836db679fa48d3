//! Density and fields as VTK ImageData (VTI): cell data, appended raw.

use super::{Density, Notes, ascii, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::text::xml;
use std::fmt::Write;
use std::path::Path;
use std::slice::from_ref;

pub fn write(density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let arrays = arrays(density);
    let mut head = String::new();
    // Writing to a String does not fail.
    let _ = text(density, &arrays, notes, &mut head);
    let bytes: u64 = arrays.iter().map(CellArray::bytes).sum();
    written(out, head.len() as u64 + bytes, context, |sink| {
        sink.put(head.as_bytes())?;
        for array in &arrays {
            sink.put(&(array.bytes() - LENGTH).to_le_bytes())?;
            let columns: Vec<&[f32]> = array.columns.iter().map(|c| &c[..]).collect();
            density.for_each_run(&columns, |run| {
                sink.check()?;
                sink.put(&run.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
            })?;
        }
        sink.put(b"\n  </AppendedData>\n</VTKFile>\n")
    })
}

/// Bytes before an array that say how long it is.
const LENGTH: u64 = 8;

/// An array of the cells, of one column or three.
struct CellArray<'a> {
    name: String,
    unit: Option<String>,
    columns: &'a [Vec<f32>],
}

impl CellArray<'_> {
    fn bytes(&self) -> u64 {
        LENGTH + 4 * self.columns.iter().map(|c| c.len() as u64).sum::<u64>()
    }
}

/// The density, then means and dispersions of its fields.
fn arrays(density: &Density) -> Vec<CellArray<'_>> {
    let mut all = vec![CellArray { name: "density".into(), unit: None, columns: from_ref(&density.values) }];
    for field in &density.fields {
        let (name, unit) = (&field.quantity.name, field.unit.clone());
        // The name of the first array is taken.
        let name = if name == "density" { "field_density" } else { name };
        all.push(CellArray { name: name.into(), unit, columns: &field.values.mean });
        if let Some((columns, unit)) = field.dispersion() {
            all.push(CellArray { name: format!("dispersion_{name}"), unit, columns });
        }
    }
    all
}

fn text(density: &Density, arrays: &[CellArray<'_>], notes: &Notes, xml: &mut String) -> std::fmt::Result {
    let ([nx, ny, nz], [x, y, z], [dx, dy, dz]) = (density.grid.cells, density.grid.min, density.grid.side);
    writeln!(xml, "<?xml version=\"1.0\"?>")?;
    writeln!(xml, "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">")?;
    writeln!(
        xml,
        "  <ImageData WholeExtent=\"0 {nx} 0 {ny} 0 {nz}\" Origin=\"{x} {y} {z}\" Spacing=\"{dx} {dy} {dz}\">"
    )?;
    writeln!(xml, "    <FieldData>")?;
    string(xml, "unit", &density.unit)?;
    for array in arrays.iter().filter(|a| a.name != "density") {
        string(xml, &format!("{}_unit", array.name), array.unit.as_deref().unwrap_or("not stated"))?;
    }
    string(xml, "length_unit", notes.text("length_unit").unwrap_or("not stated"))?;
    string(xml, "notes", &notes.lines().join("\n"))?;
    number(xml, "total", density.total)?;
    number(xml, "outside", density.outside)?;
    if let Some(time) = notes.number("time") {
        number(xml, "TimeValue", time)?;
    }
    writeln!(xml, "    </FieldData>")?;
    writeln!(xml, "    <Piece Extent=\"0 {nx} 0 {ny} 0 {nz}\">")?;
    writeln!(xml, "      <CellData Scalars=\"density\">")?;
    // Offsets are counted from behind the underscore, and every array has its length before it.
    let mut offset = 0;
    for array in arrays {
        let (name, components) = (attribute(&array.name), array.columns.len());
        let several = if components == 1 { String::new() } else { format!(" NumberOfComponents=\"{components}\"") };
        let place = format!("format=\"appended\" offset=\"{offset}\"");
        writeln!(xml, "        <DataArray type=\"Float32\" Name=\"{name}\"{several} {place}/>")?;
        offset += array.bytes();
    }
    writeln!(xml, "      </CellData>\n    </Piece>\n  </ImageData>")?;
    // The underscore is part of the format: raw data begins behind it.
    write!(xml, "  <AppendedData encoding=\"raw\">_")
}

/// A name within quotes.
fn attribute(name: &str) -> String {
    xml(&ascii(name)).into_owned()
}

/// A text as VTK has it: the codes of its letters, and a 0.
fn string(xml: &mut String, name: &str, text: &str) -> std::fmt::Result {
    let lines: Vec<String> = text.lines().map(ascii).collect();
    let codes: String = lines.join("\n").bytes().map(|b| format!("{b} ")).collect();
    writeln!(
        xml,
        "      <DataArray type=\"String\" Name=\"{}\" NumberOfTuples=\"1\" format=\"ascii\">{codes}0</DataArray>",
        attribute(name)
    )
}

fn number(xml: &mut String, name: &str, value: f64) -> std::fmt::Result {
    writeln!(
        xml,
        "      <DataArray type=\"Float64\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">{value:e}</DataArray>"
    )
}

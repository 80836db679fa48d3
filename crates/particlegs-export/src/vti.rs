//! Density as VTK ImageData (VTI): cell data, appended raw.

use super::notes::ascii;
use super::{Density, Notes, written};
use particlegs_pipeline::Result;
use particlegs_pipeline::context::Context;
use std::fmt::Write;
use std::path::Path;

pub fn write(density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let bytes = 4 * density.values.len() as u64;
    let mut head = String::new();
    // Writing to a String does not fail.
    let _ = text(density, notes, &mut head);
    written(out, head.len() as u64 + bytes, context, |sink| {
        sink.put(head.as_bytes())?;
        sink.put(&bytes.to_le_bytes())?;
        density.for_each_run(|run| {
            sink.check()?;
            sink.put(&run.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
        })?;
        sink.put(b"\n  </AppendedData>\n</VTKFile>\n")
    })
}

fn text(density: &Density, notes: &Notes, xml: &mut String) -> std::fmt::Result {
    let ([nx, ny, nz], [x, y, z], [dx, dy, dz]) = (density.grid.cells, density.grid.min, density.grid.side);
    writeln!(xml, "<?xml version=\"1.0\"?>")?;
    writeln!(xml, "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">")?;
    writeln!(
        xml,
        "  <ImageData WholeExtent=\"0 {nx} 0 {ny} 0 {nz}\" Origin=\"{x} {y} {z}\" Spacing=\"{dx} {dy} {dz}\">"
    )?;
    writeln!(xml, "    <FieldData>")?;
    string(xml, "unit", &density.unit)?;
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
    writeln!(xml, "        <DataArray type=\"Float32\" Name=\"density\" format=\"appended\" offset=\"0\"/>")?;
    writeln!(xml, "      </CellData>\n    </Piece>\n  </ImageData>")?;
    write!(xml, "  <AppendedData encoding=\"raw\">_")
}

/// A text as VTK has it: the codes of its letters, and a 0.
fn string(xml: &mut String, name: &str, text: &str) -> std::fmt::Result {
    let lines: Vec<String> = text.lines().map(ascii).collect();
    let codes: String = lines.join("\n").bytes().map(|b| format!("{b} ")).collect();
    writeln!(
        xml,
        "      <DataArray type=\"String\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">{codes}0</DataArray>"
    )
}

fn number(xml: &mut String, name: &str, value: f64) -> std::fmt::Result {
    writeln!(
        xml,
        "      <DataArray type=\"Float64\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">{value:e}</DataArray>"
    )
}

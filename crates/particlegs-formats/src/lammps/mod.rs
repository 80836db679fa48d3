//! LAMMPS text dumps, plain or compressed: <https://docs.lammps.org/dump.html>.

pub mod data;
mod frame;
pub mod write;

use crate::format::FileHead;
use crate::single_file::named;
use crate::text::content::TextContent;
use crate::text::parse::Scaling;
use crate::text::snapshot::{self, TextSnapshot, kinds};
use crate::text::table::{FrameScan, scan};
use crate::{Choice, Description, Format, Snapshot, SpeciesField};
use frame::{LammpsFrameHead, units_of};
use particlegs_core::model::{Dimension, Epoch, Unit, Units};
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format = Format { name: "lammps", title: "LAMMPS text dump", detect, open };

fn detect(head: &FileHead) -> bool {
    let mut lines = head.content.split(|&b| b == b'\n');
    lines.find(|line| !frame::is_comment(line)).is_some_and(|line| line.starts_with(b"ITEM: "))
}

/// Columns of positions, the most welcome first.
const POSITIONS: [[&str; 3]; 4] = [["x", "y", "z"], ["xs", "ys", "zs"], ["xu", "yu", "zu"], ["xsu", "ysu", "zsu"]];
/// Columns of positions in units of the cell.
const SCALED: [&[&str]; 3] = [&["xs", "xsu"], &["ys", "ysu"], &["zs", "zsu"]];
/// Columns of positions that leave the cell as atoms do.
const UNWRAPPED: [&str; 6] = ["xu", "yu", "zu", "xsu", "ysu", "zsu"];
const WHOLE: [&str; 8] = ["id", "mol", "type", "proc", "procp1", "ix", "iy", "iz"];

fn open(paths: &[PathBuf], options: &Choice) -> Result<Box<dyn Snapshot>> {
    let [path] = paths else {
        return Err(Error::argument("name one LAMMPS dump at a time"));
    };
    let content = TextContent::open(path)?;
    let mut units = None;
    let scan = scan(&content, options.frame, |lines, number, wanted| {
        frame::next(&content, lines, &mut units, number, wanted)
    })?;
    let mut notes = scan.notes.clone();
    notes.extend(scan.head.cell.notes.clone());
    let names = &scan.table.layout.columns;
    if names.iter().any(|n| n == "ix") && names.iter().any(|n| n == "x" || n == "xs") {
        notes.push("positions are inside the cell: image flags ix, iy, iz are not applied".into());
    }
    let meta = meta(path, &scan, units.as_deref(), &mut notes);
    let columns = columns(&scan.table.layout.columns, &kinds(&scan.table), meta.units.length_text());
    let description =
        Description { frames: Some(scan.frames), notes, ..Description::new(content.title(FORMAT.title), paths, meta) };
    let scaling = Scaling { origin: scan.head.cell.origin, vectors: scan.head.cell.vectors };
    let noun = scan.head.noun();
    let positions = options.positions.as_ref().unwrap_or(&columns.positions);
    let unwrapped = positions.split(',').any(|name| UNWRAPPED.contains(&name.trim()));
    let snapshot = TextSnapshot::new(description, scan.table, columns, "atoms", noun).with_scaled(SCALED, scaling);
    Ok(Box::new(snapshot.with_unwrapped(unwrapped, options)?))
}

fn meta(
    path: &std::path::Path,
    scan: &FrameScan<LammpsFrameHead>,
    style: Option<&str>,
    notes: &mut Vec<String>,
) -> SnapshotMeta {
    let [length, mass, time] = style.map_or([None; 3], units_of);
    if let (Some(style), None) = (style, length) {
        notes.push(format!("unknown unit style `{style}`"));
    }
    SnapshotMeta {
        cell: scan.head.cell.cell(),
        units: Units { time: time.map(|text| Unit::parse(text, Dimension::Time)), ..Units::new(length, mass, None) },
        epoch: Epoch { time: scan.head.time, ..scan.frames.epoch() },
        ..named(path)
    }
}

fn columns(names: &[String], kinds: &[&str], unit: Option<&str>) -> snapshot::TableColumns {
    let field = |(name, kind): (&String, &&str)| {
        let kind = match &name[..] {
            _ if *kind == "text" => "text",
            n if WHOLE.contains(&n) => "i64",
            _ => "f64",
        };
        let length = ["x", "y", "z", "xu", "yu", "zu"].contains(&&name[..]);
        let unit = if length { unit.map(String::from) } else { None };
        SpeciesField { name: name.clone(), kind: kind.into(), components: 1, unit }
    };
    let has = |name: &str| names.iter().any(|n| n == name);
    let positions = POSITIONS.iter().find(|p| p.iter().all(|n| has(n)));
    snapshot::TableColumns {
        fields: names.iter().zip(kinds).map(field).collect(),
        positions: positions.map_or(String::new(), |p| p.join(",")),
        mass: has("mass").then(|| "mass".into()),
    }
}

#[cfg(test)]
mod tests;

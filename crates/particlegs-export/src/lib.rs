//! Models as files that other programs open. One file a format; what every format says of itself is in
//! `notes`, and what the formats of one group share is in `splats` and `colors`, `grid`, `gaussians`.
//! docs/guide/export.md says what a user finds in them.

#![allow(missing_docs)]

mod colors;
mod csv;
mod dx;
mod fits;
mod gaussians;
mod gltf;
mod grid;
mod kind;
mod mrc;
mod notes;
mod npz;
mod splats;
mod vti;

pub use colors::{ColorBy, Coloring};
pub use gaussians::{FieldNumbers, LayerGaussian, all as all_gaussians};
pub use grid::{Cells, Density, FieldGrid, density_unit, fields_named};
pub use kind::{Group, Kind};
pub use notes::Notes;
pub use splats::{Faint, as_splats};

use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_files::output::{check_space_in, npy_header, scratch_folder, write_atomic};
use particlegs_formats::write_splats;
use std::io::Write;
use std::path::Path;

/// Values between two looks at whether to stop.
const RUN: usize = 1 << 14;

/// Writes a file from its beginning to its end, and counts its bytes.
struct CountingWriter<'a> {
    to: &'a mut dyn Write,
    bytes: u64,
    context: &'a Context<'a>,
}

impl CountingWriter<'_> {
    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.bytes += bytes.len() as u64;
        self.to.write_all(bytes)
    }

    /// An error where the user wants to stop.
    fn check(&self) -> std::io::Result<()> {
        self.context.check().map_err(|_| std::io::ErrorKind::Interrupted.into())
    }
}

impl Write for CountingWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.put(bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.to.flush()
    }
}

/// A file of about `expected` bytes, whole or not at all; its bytes.
fn written(
    out: &Path,
    expected: u64,
    context: &Context<'_>,
    fill: impl FnOnce(&mut CountingWriter<'_>) -> std::io::Result<()>,
) -> Result<u64> {
    check_space_in(&scratch_folder(out), expected)?;
    let mut bytes = 0;
    let done = write_atomic(out, |to| {
        let mut sink = CountingWriter { to, bytes: 0, context };
        fill(&mut sink)?;
        bytes = sink.bytes;
        Ok(())
    });
    // What was asked for says more than that writing was interrupted.
    context.check()?;
    done.map(|()| bytes)
}

/// A text on one line, with an escape for what is not ASCII: many heads hold nothing else.
fn ascii(text: &str) -> String {
    let plain = |c: char| c == ' ' || c.is_ascii_graphic();
    text.chars().map(|c| if plain(c) { c.to_string() } else { c.escape_default().to_string() }).collect()
}

pub fn write_as_splats(
    kind: Kind,
    model: &Model,
    colors: Option<&[[f32; 3]]>,
    notes: &Notes,
    out: &Path,
    context: &Context<'_>,
) -> Result<u64> {
    match kind {
        Kind::Glb => gltf::write(model, colors, notes, out, gltf::GltfForm::Binary, context),
        Kind::Gltf => gltf::write(model, colors, notes, out, gltf::GltfForm::Text, context),
        _ => write_splats(model, colors, &notes.lines(), out, context),
    }
}

pub fn write_density(kind: Kind, density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    match kind {
        Kind::Vti => vti::write(density, notes, out, context),
        Kind::Fits => fits::write(density, notes, out, context),
        Kind::Dx => dx::write(density, notes, out, context),
        Kind::Mrc => mrc::write(density, notes, out, context),
        _ => written(out, 4 * density.values.len() as u64, context, |sink| {
            sink.put(&npy_header("<f4", &density.grid.cells.map(|n| n as u64)))?;
            for run in density.values.chunks(RUN) {
                sink.check()?;
                sink.put(&run.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
            }
            Ok(())
        }),
    }
}

pub fn write_gaussians(kind: Kind, model: &Model, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    match kind {
        Kind::Csv => csv::write(model, notes, out, context),
        _ => npz::write(model, notes, out, context),
    }
}

//! The Gaussians as a NumPy archive: an array a column, stored, and what is known about them as JSON.

use super::gaussians::{LayerGaussian, all, has_opacities};
use super::{CountingWriter, Notes, RUN, written};
use particlegs_files::output::npy_header;
use particlegs_pipeline::Result;
use particlegs_pipeline::context::Context;
use particlegs_pipeline::model::Model;
use rawzip::ZipArchiveWriter;
use std::io::{Error, Write};
use std::path::Path;

/// A column: name, element type of NumPy, sides behind the number of Gaussians, and a Gaussian's bytes.
struct NpzColumn {
    name: &'static str,
    element: &'static str,
    sides: &'static [u64],
    put: fn(&LayerGaussian<'_>, &mut Vec<u8>),
}

fn reals(out: &mut Vec<u8>, values: &[f64]) {
    out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}

const COLUMNS: [NpzColumn; 4] = [
    NpzColumn { name: "mean", element: "<f8", sides: &[3], put: |g, out| reals(out, &g.of.mean_of(g.i)) },
    NpzColumn {
        name: "covariance",
        element: "<f8",
        sides: &[3, 3],
        put: |g, out| reals(out, g.of.cov_of(g.i).rows().as_flattened()),
    },
    NpzColumn { name: "count", element: "<f8", sides: &[], put: |g, out| reals(out, &[g.of.count[g.i]]) },
    NpzColumn { name: "layer", element: "<i4", sides: &[], put: |g, out| out.extend((g.layer as i32).to_le_bytes()) },
];
const MASS: NpzColumn = NpzColumn { name: "mass", element: "<f8", sides: &[], put: |g, out| reals(out, &[g.mass()]) };
const OPACITIES: [NpzColumn; 2] = [
    NpzColumn { name: "opacity", element: "<f8", sides: &[], put: |g, out| reals(out, &g.splat()[..1]) },
    NpzColumn { name: "grey", element: "<f8", sides: &[], put: |g, out| reals(out, &g.splat()[1..]) },
];

pub fn write(model: &Model, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let masses = model.has_masses().then_some(MASS);
    let opacities = has_opacities(model).then_some(OPACITIES);
    let columns = COLUMNS.into_iter().chain(masses).chain(opacities.into_iter().flatten());
    let bytes = model.gaussians() as u64 * (9 + 3 + 2) * 8;
    written(out, bytes, context, |sink| {
        let mut archive = ZipArchiveWriter::new(sink);
        for column in columns {
            member(&mut archive, column.name, |to| of_column(to, model, &column, context))?;
        }
        let names: Vec<&str> = model.layers.iter().map(|l| &l.name[..]).collect();
        member(&mut archive, "layer_names", |to| of_texts(to, &names, &[names.len() as u64]))?;
        let metadata = serde_json::to_string_pretty(&notes.json()).expect("plain data");
        member(&mut archive, "metadata", |to| of_texts(to, &[&metadata], &[]))?;
        archive.finish().map_err(Error::other).map(drop)
    })
}

fn member(
    archive: &mut ZipArchiveWriter<&mut CountingWriter<'_>>,
    name: &str,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let name = format!("{name}.npy");
    let (mut entry, config) = archive.new_file(name.as_str()).start().map_err(Error::other)?;
    let mut data = config.wrap(&mut entry);
    fill(&mut data)?;
    let (_, descriptor) = data.finish().map_err(Error::other)?;
    entry.finish(descriptor).map_err(Error::other).map(drop)
}

fn of_column(to: &mut dyn Write, model: &Model, column: &NpzColumn, context: &Context<'_>) -> std::io::Result<()> {
    let shape: Vec<u64> = std::iter::once(model.gaussians() as u64).chain(column.sides.iter().copied()).collect();
    to.write_all(&npy_header(column.element, &shape))?;
    let mut run = Vec::new();
    for (number, one) in all(model).enumerate() {
        (column.put)(&one, &mut run);
        if (number + 1).is_multiple_of(RUN) {
            context.check().map_err(|_| Error::from(std::io::ErrorKind::Interrupted))?;
            to.write_all(&run)?;
            run.clear();
        }
    }
    to.write_all(&run)
}

/// Texts as NumPy has them: as many 32-bit letters each as the longest has.
fn of_texts(to: &mut dyn Write, texts: &[&str], shape: &[u64]) -> std::io::Result<()> {
    let longest = texts.iter().map(|t| t.chars().count()).max().unwrap_or(0).max(1);
    let mut bytes = npy_header(&format!("<U{longest}"), shape);
    for text in texts {
        let letters = text.chars().map(u32::from).chain(std::iter::repeat(0));
        bytes.extend(letters.take(longest).flat_map(u32::to_le_bytes));
    }
    to.write_all(&bytes)
}

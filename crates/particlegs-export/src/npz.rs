//! The Gaussians as a NumPy archive: an array a column, stored, and what is known about them as JSON.

use super::gaussians::{LayerGaussian, all, has_opacities};
use super::{CountingWriter, Notes, RUN, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_files::output::npy_header;
use rawzip::ZipArchiveWriter;
use std::io::{Error, Write};
use std::path::Path;

/// A column: name, element type of NumPy, sides behind the number of Gaussians, and a Gaussian's bytes.
struct NpzColumn<'a> {
    name: String,
    element: &'static str,
    sides: &'static [u64],
    put: Box<dyn Fn(&LayerGaussian<'_>, &mut Vec<u8>) + 'a>,
}

impl<'a> NpzColumn<'a> {
    fn reals(
        name: impl Into<String>,
        sides: &'static [u64],
        numbers_of: impl Fn(&LayerGaussian<'_>) -> Vec<f64> + 'a,
    ) -> Self {
        NpzColumn { name: name.into(), element: "<f8", sides, put: Box::new(move |g, out| reals(out, &numbers_of(g))) }
    }
}

fn reals(out: &mut Vec<u8>, values: &[f64]) {
    out.extend(values.iter().flat_map(|v| v.to_le_bytes()));
}

/// The columns of a model: places and shapes, masses, opacities, fields.
fn columns(model: &Model) -> Vec<NpzColumn<'_>> {
    let layer = NpzColumn {
        name: "layer".into(),
        element: "<i4",
        sides: &[],
        put: Box::new(|g, out| out.extend((g.layer as i32).to_le_bytes())),
    };
    let mut all = vec![
        NpzColumn::reals("mean", &[3], |g| g.of.mean_of(g.i).into()),
        NpzColumn::reals("covariance", &[3, 3], |g| g.of.cov_of(g.i).rows().as_flattened().into()),
        NpzColumn::reals("count", &[], |g| vec![g.of.count[g.i]]),
        layer,
    ];
    if model.has_masses() {
        all.push(NpzColumn::reals("mass", &[], |g| vec![g.mass()]));
    }
    if has_opacities(model) {
        all.push(NpzColumn::reals("opacity", &[], |g| g.splat()[..1].into()));
        all.push(NpzColumn::reals("grey", &[], |g| g.splat()[1..].into()));
    }
    for q in &model.metadata.fields {
        let name = &q.name;
        // Sides of the mean, the slope and the spread.
        let (sides, spread): ([&[u64]; 3], _) = match q.component_names().len() {
            1 => ([&[], &[3], &[]], "variance"),
            _ => ([&[3], &[3, 3], &[3, 3]], "covariance"),
        };
        all.push(NpzColumn::reals(format!("field_{name}"), sides[0], move |g| g.field(q).mean));
        // Of natural logarithms, where the field is described by them.
        let log = if q.logarithmic { "log_" } else { "" };
        all.push(NpzColumn::reals(format!("field_{name}_{log}slope"), sides[1], move |g| g.field(q).slope));
        all.push(NpzColumn::reals(format!("field_{name}_{log}{spread}"), sides[2], move |g| g.field(q).spread));
    }
    all
}

pub fn write(model: &Model, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let columns = columns(model);
    let numbers: u64 = columns.iter().map(|c| c.sides.iter().product::<u64>()).sum();
    let bytes = model.gaussians() as u64 * numbers * 8;
    written(out, bytes, context, |sink| {
        let mut archive = ZipArchiveWriter::new(sink);
        for column in &columns {
            // A slash would make a folder in the archive.
            let name = column.name.replace(['/', '\\'], "_");
            member(&mut archive, &name, |to| of_column(to, model, column, context))?;
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

fn of_column(to: &mut dyn Write, model: &Model, column: &NpzColumn<'_>, context: &Context<'_>) -> std::io::Result<()> {
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

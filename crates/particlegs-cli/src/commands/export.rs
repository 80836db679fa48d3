//! `particlegs export MODEL -o OUT`.

use crate::common::{CommandContext, Common, named};
use crate::density_args::range_of;
use crate::inputs::{self, FrameArgs};
use crate::outputs::ForceArgs;
use crate::page_args::{AppearanceArgs, PageArgs};
use clap::{Args, ValueHint};
use particlegs_core::codec::{FileInfo, SeriesFile};
use particlegs_core::model::{LawKind, Model, Quantity};
use particlegs_core::{Error, Result, codec};
use particlegs_export::{
    Cells, ColorBy, Coloring, Density, Group, Kind, Notes, as_splats, fields_named, write_as_splats, write_density,
    write_gaussians,
};
use particlegs_files::input::{self, name_of};
use particlegs_files::output::{is_stream, write_bytes};
use particlegs_view::page::{ModelFile, linked, offline};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args)]
#[command(
    after_help = "\
For particles, run `recover`, then `convert` to any format.

Examples:
  particlegs export M.pgs -o page.html
  particlegs export M.pgs -o splats.ply --color density
  particlegs export M.pgs -o density.vti --grid 256",
    after_long_help = "\
What is lost; each file says so itself:
  .ply .glb .gltf   counts, masses and the box; the splats are for viewers that sort and blend, and
                    approximate an optical-depth model at one radius and opacity
  .npy .vti .fits .dx .mrc
                    structure smaller than a cell: cells hold mass or number per volume
  .npz .csv         blocks, certificate and VizMapper; the Gaussians are complete
  .html             nothing: the page contains the model file

For particles, run `recover`, then `convert` to any format:
  particlegs recover M.pgs -o particles && particlegs convert particles -o particles.hdf5

Examples:
  particlegs export M.pgs -o page.html                        # opens in any browser, offline
  particlegs export run.pgs -o run.html --link                # a series, for a web server
  particlegs export M.pgs -o splats.ply                       # as for 3-D Gaussian splatting
  particlegs export M.pgs -o splats.glb --color layer         # glTF with KHR_gaussian_splatting
  particlegs export M.pgs -o splats.ply --opacity 0.5 --color density --colormap viridis
  particlegs export M.pgs -o density.npy --grid 256           # and density.json beside it
  particlegs export M.pgs -o density.vti --cell 0.5           # for ParaView
  particlegs export M.pgs -o density.vti --fields velocity    # with its mean and dispersion in each cell
  particlegs export M.pgs -o density.fits --layer dm
  particlegs export M.pgs -o water.mrc --layer water          # or .dx: for VMD, PyMOL, ChimeraX
  particlegs export M.pgs -o gaussians.npz                    # means, covariances, counts, masses
  particlegs export M.pgs -o - --kind csv | head

docs/guide/export.md describes every file."
)]
pub struct Arguments {
    /// Model file.
    #[arg(value_name = "MODEL", value_hint = ValueHint::FilePath)]
    model: PathBuf,
    /// File to write: .html .ply .glb .gltf .npy .vti .fits .dx .mrc .npz .csv.
    ///
    /// The extension selects what is written.
    #[arg(long, short, alias = "out", value_name = "OUT", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// What to write, if the extension does not tell.
    #[arg(long, value_name = "KIND", value_parser = named::<Kind>())]
    kind: Option<Kind>,
    /// Layers to write: species such as gas or dm, names that `info` lists, or `all`.
    ///
    /// A page contains all layers, and opens with these.
    #[arg(long = "layer", alias = "layers", value_name = "NAME,...", value_delimiter = ',', default_value = "all")]
    layers: Vec<String>,
    /// Leave the model's file out of the page, which then loads it from its own folder on a web server.
    ///
    /// A series plays while its frames are loading, if the server supports HTTP Range, as most do.
    #[arg(long, hide_short_help = true)]
    link: bool,
    #[command(flatten)]
    page: PageArgs,
    #[command(flatten, next_help_heading = "Pages and splats (.html, .ply, .glb, .gltf)")]
    dials: AppearanceArgs,
    #[command(flatten)]
    splats: SplatArgs,
    #[command(flatten)]
    grid: GridArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    series: FrameArgs,
    #[command(flatten)]
    common: Common,
}

#[derive(Args)]
#[command(next_help_heading = "Splats (.ply, .glb, .gltf)")]
struct SplatArgs {
    /// What the colours show.
    #[arg(long, value_name = "WHAT", default_value = "grey", value_parser = named::<ColorBy>())]
    color: ColorBy,
}

#[derive(Args)]
#[command(next_help_heading = "Density on a grid (.npy, .vti, .fits, .dx, .mrc)")]
struct GridArgs {
    /// Cells along the longest edge of the box [default: 128].
    #[arg(long, value_name = "N", conflicts_with = "cell")]
    grid: Option<usize>,
    /// Edge of a cell in world units, rounded so that cells fill the box.
    #[arg(long, value_name = "SIZE")]
    cell: Option<f64>,
    /// Fields to add, or `all`: mean and dispersion in each cell (.vti, .fits).
    ///
    /// Means are over the cell, weighted by density, as the density is the mean over the cell. They are NaN where no
    /// Gaussian with the field reaches. A vector has three components. `info` lists the fields.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    fields: Vec<String>,
}

/// What was written: its size, a description, and further keys of the report.
type ExportSummary = (u64, String, Value);

struct Export<'a> {
    a: &'a Arguments,
    kind: Kind,
    notes: Notes,
    context: &'a CommandContext,
}

pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    context.reads([&a.model].into_iter().chain(a.page.files()).map(PathBuf::as_path), a.force.force)?;
    let kind = match Kind::for_output(&a.output, a.kind) {
        Ok(kind) => kind,
        // First check that the output is neither an input nor another output.
        Err(error) => return context.writes(&a.output, &crate::outputs::PARTICLES).and(Err(error)),
    };
    context.writes(&a.output, &kind.file())?;
    let start = Instant::now();
    let paged = kind.group() == Group::Page;
    if a.link && !paged {
        return Err(Error::argument(format!("--link is for pages, not for .{}", kind.ending())));
    }
    if a.link && input::is_stream(&a.model) {
        return Err(Error::argument("--link needs the name of a file that the page can load, not standard input"));
    }
    if a.link && a.series.is_given() {
        let what = "--link leaves the whole file beside the page, so it takes no --frame or --time";
        return Err(Error::argument_with(what, "extract the frame first, or leave out --link"));
    }
    let bytes = if paged && !a.series.is_given() {
        inputs::read_file(&a.model, &context)?
    } else {
        inputs::model_of(&a.model, &a.series, &context)?
    };
    let name = a.model.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let place = name_of(&a.model);
    let series = if codec::is_series(&bytes) { Some(SeriesFile::read(&bytes, &place)?) } else { None };
    let first = match &series {
        Some(series) => series.frame_bytes(series.first()?)?,
        None => &bytes,
    };
    let model = codec::decode_with(first, &place, &context)?;
    let whole = a.layers == ["all"] || paged;
    let mut model = if whole { model } else { model.only(&a.layers)? };
    if !paged {
        model.drop_empty();
    }
    let fields = fields_named(kind, &model, &a.grid.fields)?;
    let notes = Notes::new(kind, &model, &name, &fields);
    let (gaussians, lost) = (model.gaussians(), notes.lost.clone());
    let mut export = Export { a: &a, kind, notes, context: &context };
    let (bytes, what, more) = match kind.group() {
        Group::Splats => export.splats(model)?,
        Group::Grid => export.grid(&model, fields)?,
        Group::Page => {
            let info = codec::read_info(first, &place)?;
            let written = export.page(ModelFile { name: &name, bytes: &bytes }, &model, &info)?;
            let what = match &series {
                Some(series) => format!("a page of {} frames", series.frames.len()),
                None => format!("a page of {gaussians} Gaussians"),
            };
            (written, what, json!({}))
        }
        Group::Gaussians => {
            let write = |out: &Path| write_gaussians(kind, &model, &export.notes, out, &context);
            (context.outputs.write_file(&a.output, write, &context)?, format!("{gaussians} Gaussians"), json!({}))
        }
    };
    let (out, megabytes, seconds) = (a.output.display(), bytes as f64 / 1e6, start.elapsed().as_secs_f64());
    let text = format!("{out}: {what}, {megabytes:.1} MB, in {seconds:.2} s");
    let mut report = json!({
        "output": a.output.to_string_lossy(), "kind": kind.ending(), "gaussians": gaussians, "bytes": bytes,
        "seconds": seconds, "lost": lost,
    });
    report.as_object_mut().into_iter().for_each(|r| r.extend(more.as_object().cloned().unwrap_or_default()));
    context.finish(&text, &report)
}

impl Export<'_> {
    /// The page, which contains the unchanged file or requests it.
    fn page(&self, file: ModelFile<'_>, model: &Model, info: &FileInfo) -> Result<u64> {
        let a = self.a;
        let opening = a.page.opening(&a.dials, &a.layers, &[info], self.context)?;
        let html = if a.link {
            self.context.message(&format!("note: put the page and {} into one folder of a web server", file.name));
            linked(file, &opening)
        } else {
            offline(&[(file, model)], &opening, self.context)?
        };
        let write = |out: &Path| write_bytes(out, &html).map(|()| html.len() as u64);
        self.context.outputs.write_file(&a.output, write, self.context)
    }

    fn splats(&mut self, model: Model) -> Result<ExportSummary> {
        let (a, color, context, m) = (&self.a.dials, self.a.splats.color, self.context, &model.metadata);
        if m.law == LawKind::AlphaBlend
            && model.vizmapper().is_none()
            && let Some(option) = a.radius.map(|_| "--radius").or(a.opacity.map(|_| "--opacity"))
        {
            let what = format!("{option} has no effect here: this alpha-blend model has no VizMapper");
            return Err(Error::argument(what));
        }
        let (range, colormap) = (range_of(a.range.as_deref())?, a.colormap.unwrap_or_default());
        let (radius, opacity) = (a.radius.unwrap_or(m.default_radius), a.opacity.unwrap_or(m.default_opacity));
        // Memory besides the model: colours, and for glTF its arrays.
        context.require_memory("splats", 40 * model.gaussians() as u64)?;
        let coloring = Coloring::new(&model, color, colormap, range)?;
        let notes = &mut self.notes;
        notes.set("radius", radius);
        notes.set("opacity", opacity);
        notes.say(format!("particles of radius {radius} and opacity {opacity}"));
        coloring.describe(&model, color, colormap, notes);
        let (splats, faint) = as_splats(model, radius, opacity, context)?;
        notes.set("fainter_than_viewers_draw", json!(faint));
        let write =
            |out: &Path| write_as_splats(self.kind, &splats, coloring.colors.as_deref(), &self.notes, out, context);
        let bytes = context.outputs.write_file(&self.a.output, write, context)?;
        if faint.particles > 0.01 {
            context.message(&format!(
                "note: {:.0} % of the Gaussians, with {:.0} % of the particles, are fainter than 1/255, so viewers \
                 do not draw them; a larger --opacity or --radius shows them",
                100.0 * faint.gaussians,
                100.0 * faint.particles
            ));
        }
        let mut report = json!({ "radius": radius, "opacity": opacity, "fainter_than_viewers_draw": faint });
        coloring.range.iter().for_each(|range| report["color_range"] = json!(range));
        Ok((bytes, format!("{} splats", splats.gaussians()), json!({ "splats": report })))
    }

    fn grid(&mut self, model: &Model, fields: Vec<Quantity>) -> Result<ExportSummary> {
        let (a, context) = (self.a, self.context);
        if model.metadata.law == LawKind::AlphaBlend {
            let what = "an alpha-blend model has no density: its splats hold opacities, not masses";
            let hint = "draw particles with `recover`, or write its splats (.ply) or Gaussians (.npz)";
            return Err(Error::argument_with(what, hint));
        }
        let beside = (self.kind == Kind::Npy && !is_stream(&a.output)?).then(|| a.output.with_extension("json"));
        if let Some(beside) = &beside {
            context.writes(beside, &Kind::description())?;
        }
        let cells = match (a.grid.grid, a.grid.cell) {
            (_, Some(side)) => Cells::OfSide(side),
            (Some(n), None) => Cells::Along(n),
            (None, None) => Cells::default(),
        };
        let mut density = Density::new(model, cells, context)?;
        density.add_fields(model, fields, context)?;
        let (grid, unit, total, outside) = (&density.grid, &density.unit, density.total, density.outside);
        let report = json!({
            "cells": grid.cells, "origin": grid.min, "cell": grid.side, "periodic": grid.periodic, "unit": unit,
            "total": total, "outside": outside,
            "fields": density.fields.iter().map(|f| json!({ "name": f.quantity.name, "unit": f.unit })).collect::<Value>(),
        });
        self.notes.set("density", report.clone());
        self.notes.say(format!("{total} in all cells, {outside} beyond them; unit of density: {unit}"));
        let write = |out: &Path| write_density(self.kind, &density, &self.notes, out, context);
        let bytes = match beside {
            None => context.outputs.write_file(&a.output, write, context)?,
            Some(beside) => {
                let mut all = self.notes.json();
                all["values"] = "float32, little-endian; the first index is x, the last z".into();
                all["quantity"] = "density".into();
                let mut text = serde_json::to_vec_pretty(&all).expect("plain data");
                text.push(b'\n');
                context.outputs.write_described(&a.output, (&beside, &text), write, context)?
            }
        };
        let [x, y, z] = grid.cells;
        let what = format!("{x} x {y} x {z} cells, {} in total, in {unit}", total as f32);
        Ok((bytes, what, json!({ "grid": report })))
    }
}

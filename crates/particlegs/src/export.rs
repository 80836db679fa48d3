//! Models as files of other programs, and as a page.

use crate::{Context, Error, Model, Result, Series};
use particlegs_core::model::LawKind;
use particlegs_core::picture::Colormap;
use particlegs_export::{
    Cells, ColorBy, Coloring, Density, Group, Kind, Notes, as_splats, fields_named, write_as_splats, write_density,
    write_gaussians,
};
use particlegs_files::output::{Outputs, is_stream, kinds, write_bytes};
use particlegs_view::page::{ModelFile, PageOpening, linked, offline};
use serde_json::{Value, json};
use std::path::Path;

/// A larger share of the particles than this in splats that viewers do not draw is worth a note.
const FAINT_SHARE: f64 = 0.01;

/// Options of an export. The default takes the kind from the output's ending, all layers, 128 cells along the longest
/// edge, and grey splats of the model's radius and opacity.
#[derive(Clone, Debug, Default)]
pub struct ExportOptions {
    /// The kind of file, if the output's ending does not tell.
    pub kind: Option<Kind>,
    /// Names of layers or species; all if empty. A page contains all of them.
    pub layers: Vec<String>,
    /// Cells of a density grid.
    pub cells: Cells,
    /// Fields in the cells: mean and dispersion.
    pub fields: Vec<String>,
    /// The quantity that the colours of splats show.
    pub color: ColorBy,
    /// Colours of splats by density.
    pub colormap: Colormap,
    /// Densities of the first and the last colour; `None` for those of nearly all splats.
    pub range: Option<[f64; 2]>,
    /// Particle radius of splats, world units; `None` for the model's.
    pub radius: Option<f64>,
    /// Particle opacity of splats, above 0 and at most 1; `None` for the model's.
    pub opacity: Option<f64>,
    /// The view with which a page opens.
    pub opening: PageOpening,
    /// Whether a page loads the model's file from its own folder instead of containing it.
    pub link: bool,
}

/// Results of an export.
#[derive(Clone, Debug)]
pub struct ExportResult {
    /// The kind of file.
    pub kind: Kind,
    /// Gaussians of the exported layers.
    pub gaussians: usize,
    /// Bytes that were written.
    pub bytes: u64,
    /// Notes on what the file lacks of the model.
    pub lost: Vec<String>,
    /// Content of the file, in words.
    pub content: String,
    /// Further figures: of `splats`, or of the `grid`.
    pub figures: Value,
}

/// The kind of file that an export to `out` writes, declared as an output unless it is one already: what long work does
/// before it reads its input.
///
/// # Errors
/// [`Error::Argument`] for an unknown ending; [`Error::Output`] for what may not be replaced, and an input.
pub fn plan_export(out: &Path, kind: Option<Kind>, outputs: &Outputs, context: &Context<'_>) -> Result<Kind> {
    match Kind::for_output(out, kind) {
        Ok(kind) if outputs.is_declared(out, Some(&kind.file())) => Ok(kind),
        Ok(kind) => outputs.writes(out, &kind.file(), context).map(|_| kind),
        // First check that the output is neither an input nor another output.
        Err(error) => outputs.writes(out, &kinds::PARTICLES, context).and(Err(error)),
    }
}

impl Model {
    /// Writes it as a file of another program, or as a page.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that the kind does not know; [`Error::Input`]; [`Error::Memory`]; [`Error::Io`];
    /// [`Error::Cancelled`].
    pub fn export(
        &self,
        out: &Path,
        options: &ExportOptions,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<ExportResult> {
        let kind = plan_export(out, options.kind, outputs, context)?;
        let (paged, name) = (kind.group() == Group::Page, self.file_name());
        if options.link && !paged {
            return Err(Error::argument(format!("only a page can be linked, not a .{} file", kind.ending())));
        }
        if paged {
            let (model, gaussians) = (self.decoded(), self.decoded().gaussians());
            let notes = Notes::new(kind, model, &name, &fields_named(kind, model, &options.fields)?);
            let lost = notes.lost.clone();
            let work = ExportWork { kind, out, options, notes, outputs, context };
            let bytes = work.page(ModelFile { name: &name, bytes: self.bytes() }, self)?;
            let content = format!("a page of {gaussians} Gaussians");
            return Ok(ExportResult { kind, gaussians, bytes, lost, content, figures: Value::Null });
        }
        let mut model = self.decoded().clone();
        if !options.layers.is_empty() && options.layers != ["all"] {
            model = model.only(&options.layers)?;
        }
        // Gaussians that fade between two frames of a series stand for no particle.
        model.drop_empty();
        let notes = Notes::new(kind, &model, &name, &fields_named(kind, &model, &options.fields)?);
        let (gaussians, lost) = (model.gaussians(), notes.lost.clone());
        let mut work = ExportWork { kind, out, options, notes, outputs, context };
        let (bytes, content, figures) = match kind.group() {
            Group::Splats => work.splats(model)?,
            Group::Grid => work.grid(&model)?,
            Group::Gaussians | Group::Page => {
                let write = |out: &Path| write_gaussians(kind, &model, &work.notes, out, context);
                (outputs.write_file(out, write, context)?, format!("{gaussians} Gaussians"), Value::Null)
            }
        };
        Ok(ExportResult { kind, gaussians, bytes, lost, content, figures })
    }

    /// A page that shows it in any browser, offline: HTML.
    ///
    /// # Errors
    /// [`Error::Argument`] for layers that there are not; [`Error::Memory`]; [`Error::Cancelled`].
    pub fn page(&self, opening: &PageOpening, context: &Context<'_>) -> Result<Vec<u8>> {
        if !opening.layers.is_empty() {
            self.decoded().which(&opening.layers)?;
        }
        offline(&[(ModelFile { name: &self.file_name(), bytes: self.bytes() }, self.decoded())], opening, context)
    }
}

impl Series {
    /// Writes it as a page that plays it.
    ///
    /// # Errors
    /// [`Error::Argument`] for another kind of file; [`Error::Io`]; [`Error::Memory`]; [`Error::Cancelled`].
    pub fn export(
        &self,
        out: &Path,
        options: &ExportOptions,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<ExportResult> {
        let kind = plan_export(out, options.kind, outputs, context)?;
        if kind.group() != Group::Page {
            return Err(Error::argument("a series is exported as a page, and one of its frames as other files"));
        }
        let first = self.decoder().series().first()?;
        // Decoding the first frame proves that the page can show it.
        let model = self.decoder().frame(first, context)?.clone().into_model();
        let name = self.file_name();
        let notes = Notes::new(kind, &model, &name, &[]);
        let (gaussians, lost) = (model.gaussians(), notes.lost.clone());
        let work = ExportWork { kind, out, options, notes, outputs, context };
        let file = ModelFile { name: &name, bytes: self.bytes() };
        let bytes = match options.link {
            true => work.write_page(linked_page(file, options, context))?,
            false => work.write_page(offline(&[(file, &model)], &options.opening, context)?)?,
        };
        let content = format!("a page of {} frames", self.times().len());
        Ok(ExportResult { kind, gaussians, bytes, lost, content, figures: Value::Null })
    }
}

fn linked_page(file: ModelFile<'_>, options: &ExportOptions, context: &Context<'_>) -> Vec<u8> {
    context.note(&format!("put the page and {} into one folder of a web server", file.name));
    linked(file, &options.opening)
}

struct ExportWork<'a> {
    kind: Kind,
    out: &'a Path,
    options: &'a ExportOptions,
    notes: Notes,
    outputs: &'a Outputs,
    context: &'a Context<'a>,
}

/// Bytes, what they are, and further figures.
type ExportSummary = (u64, String, Value);

impl ExportWork<'_> {
    fn page(&self, file: ModelFile<'_>, model: &Model) -> Result<u64> {
        match self.options.link {
            true => self.write_page(linked_page(file, self.options, self.context)),
            false => self.write_page(model.page(&self.options.opening, self.context)?),
        }
    }

    fn write_page(&self, html: Vec<u8>) -> Result<u64> {
        let write = |out: &Path| write_bytes(out, &html).map(|()| html.len() as u64);
        self.outputs.write_file(self.out, write, self.context)
    }

    fn splats(&mut self, model: particlegs_core::model::Model) -> Result<ExportSummary> {
        let (o, context, m) = (self.options, self.context, &model.metadata);
        if m.law == LawKind::AlphaBlend
            && model.vizmapper().is_none()
            && let Some(option) = o.radius.map(|_| "radius").or(o.opacity.map(|_| "opacity"))
        {
            let message = format!("the {option} has no effect here: this alpha-blend model has no VizMapper");
            return Err(Error::argument(message));
        }
        let (radius, opacity) = (o.radius.unwrap_or(m.default_radius), o.opacity.unwrap_or(m.default_opacity));
        // Memory besides the model: colours, and for glTF its arrays.
        context.require_memory("splats", 40 * model.gaussians() as u64)?;
        // Before the Gaussians are widened to splats: colours by density are those of the model.
        let coloring = Coloring::new(&model, o.color, o.colormap, o.range)?;
        let notes = &mut self.notes;
        notes.set("radius", radius);
        notes.set("opacity", opacity);
        notes.say(format!("particles of radius {radius} and opacity {opacity}"));
        coloring.describe(&model, o.color, o.colormap, notes);
        let (splats, faint) = as_splats(model, radius, opacity, context)?;
        notes.set("fainter_than_viewers_draw", json!(faint));
        let colors = coloring.colors.as_deref();
        let write = |out: &Path| write_as_splats(self.kind, &splats, colors, &self.notes, out, context);
        let bytes = self.outputs.write_file(self.out, write, context)?;
        if faint.particles > FAINT_SHARE {
            let [gaussians, particles] = [faint.gaussians, faint.particles].map(|share| 100.0 * share);
            context.note(&format!(
                "{gaussians:.0} % of the Gaussians, with {particles:.0} % of the particles, are fainter than 1/255, so \
                 viewers do not draw them; a larger opacity or radius shows them"
            ));
        }
        let mut figures = json!({ "radius": radius, "opacity": opacity, "fainter_than_viewers_draw": faint });
        coloring.range.iter().for_each(|range| figures["color_range"] = json!(range));
        Ok((bytes, format!("{} splats", splats.gaussians()), json!({ "splats": figures })))
    }

    fn grid(&mut self, model: &particlegs_core::model::Model) -> Result<ExportSummary> {
        let (out, context) = (self.out, self.context);
        // An array has no room for notes, and standard output none for a second file.
        let beside = (self.kind == Kind::Npy && !is_stream(out)?).then(|| out.with_extension("json"));
        if let Some(beside) = &beside {
            self.outputs.writes(beside, &Kind::description(), context)?;
        }
        let mut density = Density::new(model, self.options.cells, context)?;
        density.add_fields(model, fields_named(self.kind, model, &self.options.fields)?, context)?;
        let (grid, unit, total, outside) = (&density.grid, &density.unit, density.total, density.outside);
        let figures = json!({
            "cells": grid.cells, "origin": grid.min, "cell": grid.side, "periodic": grid.periodic, "unit": unit,
            "total": total, "outside": outside,
            "fields": density.fields.iter().map(|f| json!({ "name": f.quantity.name, "unit": f.unit })).collect::<Value>(),
        });
        self.notes.set("density", figures.clone());
        self.notes.say(format!("{total} in all cells, {outside} beyond them; unit of density: {unit}"));
        let write = |out: &Path| write_density(self.kind, &density, &self.notes, out, context);
        let bytes = match beside {
            None => self.outputs.write_file(out, write, context)?,
            Some(beside) => {
                let mut all = self.notes.json();
                all["values"] = "float32, little-endian; the first index is x, the last z".into();
                all["quantity"] = "density".into();
                let text = serde_json::to_string_pretty(&all).expect("plain data") + "\n";
                self.outputs.write_described(out, (&beside, text.as_bytes()), write, context)?
            }
        };
        let [x, y, z] = grid.cells;
        let content = format!("{x} x {y} x {z} cells, {} in total, in {unit}", total as f32);
        Ok((bytes, content, json!({ "grid": figures })))
    }
}

//! Pictures of particles.

use crate::field_choice::{FieldChoice, FieldSource};
use crate::finish::Finisher;
use crate::options::{PictureOptions, PictureStyle};
use crate::provenance::{PictureProvenance, PictureUnits, SourceFile};
use crate::run::{DrawingJob, PictureReport};
use crate::subject::{Quantities, ViewSubject};
use crate::view_content::{ViewContent, ViewRenderer};
use particlegs_compress::FieldSelection;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, hex};
use particlegs_core::render::{FieldQuery, FieldWeight, Renderer};
use particlegs_core::{NamedValue, Result};
use particlegs_files::output::Outputs;
use particlegs_particles::{LayerFields, Particles, StarFormingGas};
use particlegs_reference::{FieldValues, Reference};
use std::time::Instant;

/// Draws particles into pictures, which store `name` as the name of what is drawn. `fields` are those of the layers, where
/// the options name a field, and else may be empty.
///
/// # Errors
/// [`particlegs_core::Error::Argument`] for options that are out of range or exclude one another;
/// [`particlegs_core::Error::Input`] for files that cannot be used and fields that there are not;
/// [`particlegs_core::Error::Output`] and [`particlegs_core::Error::Io`] where pictures cannot be written;
/// [`particlegs_core::Error::Memory`]; [`particlegs_core::Error::Cancelled`].
pub fn render_particles(
    particles: &Particles,
    fields: &[LayerFields],
    name: &str,
    options: &PictureOptions,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<PictureReport> {
    options.check()?;
    options.declare(options.files(), outputs);
    let field = options.field.name.as_deref();
    let field = field.map(|name| options.particle_field(name, particles, fields, context)).transpose()?;
    field.iter().try_for_each(|(f, _)| f.checked(options.range))?;
    let style = options.drawn_style();
    let mut reference = Reference::new(particles);
    let bounds = *reference.bounds();
    let count = particles.len() as u64;
    let (density, cell) = (style == PictureStyle::Density, particles.meta.cell);
    if density {
        options.refuse_device("surface densities of particles are drawn on the CPU only")?;
    }
    // Views depend on bounds, cell and number alone, so their errors come before the long work of smoothing.
    let subject = ViewSubject::of_particles(bounds, cell, count, density);
    let quantities = Quantities::from_particles(particles, options.smooth);
    let set = options.resolved(options.views(None, None, &subject, outputs, context)?, 1);
    let unit = particles.meta.units.length_text().unwrap_or_default();
    if let Some(note) = options.view.note(&subject, &set, unit) {
        context.note(&note);
    }
    options.figure.note_missing(&[], context);
    let mut smooth_seconds = None;
    if let Some(neighbours) = options.smooth {
        let started = Instant::now();
        reference = reference.smoothed(neighbours, context)?;
        smooth_seconds = Some(started.elapsed().as_secs_f64());
    }
    let system = particles.meta.unit_system();
    let about = PictureProvenance {
        of: vec![SourceFile { name: name.into(), blake3: hex(&particles.source_hash()), moment: None }],
        units: Some(PictureUnits::new(system, density.then(|| particles.density_of()))),
        ..options.provenance(style.name(), &quantities)
    };
    let finish = Finisher {
        options: &options.figure,
        colormap: options.colormap.unwrap_or_default(),
        field: field.as_ref().map(|(f, _)| f.legend.clone()),
        quantities: &quantities,
        subject: &subject,
        legend: Vec::new(),
        circles: options.figure.circles((system, cell), context)?,
        stamps: &[],
        about: field.iter().fold(about, |about, (f, _)| options.field.stored(f, about)),
    };
    let on_device = options.device.as_ref().map(|d| d.particles(reference.input(), context)).transpose()?;
    let renderer = renderer(&reference, on_device, (style, field.as_ref()), &subject, context);
    let job = DrawingJob { painter: &renderer, finish: &finish, set: &set, hints: false, options, outputs, context };
    let mut report = job.draw()?.of(&set);
    for (drawn, view) in report.views.iter_mut().zip(&set.views) {
        drawn.radius_px = (!density).then(|| view.radius_pixels(set.size));
        // A clock may not advance while a few particles are drawn.
        drawn.particles_per_second = Some(count as f64 / drawn.seconds.max(1e-9));
    }
    let (style, smooth) = (style.name().into(), options.smooth);
    Ok(PictureReport { style, particles: Some(count), smooth, smooth_seconds, ..report })
}

impl PictureOptions {
    /// The field of a name, and the particles' values.
    fn particle_field(
        &self,
        name: &str,
        particles: &Particles,
        sources: &[LayerFields],
        context: &Context<'_>,
    ) -> Result<(FieldChoice, FieldValues)> {
        // Mass and number weigh without a field of the snapshot.
        let weight = self.field.weight.as_ref().filter(|w| FieldWeight::from_name(w).is_err());
        let select = |name: &String| {
            let names: Vec<String> = [Some(name), weight].into_iter().flatten().cloned().collect();
            FieldSelection::new(&names, StarFormingGas::Keep, particles, sources, LawKind::OpticalDepth)
        };
        let candidates = FieldQuery::candidates(name);
        let mut selections = candidates.iter().map(select).collect::<Vec<_>>();
        // Of an unknown name the error of its likeliest meaning is reported.
        let at = selections.iter().position(Result::is_ok).unwrap_or(0);
        let selection = selections.swap_remove(at)?;
        selection.notes().iter().for_each(|note| context.note(note));
        // A class of a category is one of several.
        let number = selection.quantities().iter().position(|q| q.name.eq_ignore_ascii_case(&candidates[at]));
        let values = selection.values(number.unwrap_or(0))?;
        let mean = |_: &str| {
            let column_mean = |column: &Vec<f64>| {
                // Particles of layers without the field have NaN.
                let finite_values: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
                finite_values.iter().sum::<f64>() / finite_values.len().max(1) as f64
            };
            [0, 1, 2].map(|k| values.columns.get(k).map_or(0.0, column_mean))
        };
        let samples = |_: &str| values.columns[0].clone();
        let source = FieldSource {
            quantities: selection.quantities(),
            length: particles.meta.units.length_text(),
            mean: &mean,
            samples: &samples,
        };
        let choice = self.field.choice(name, &source, self.colormap)?;
        let Some(by) = &choice.query.by else { return Ok((choice, values)) };
        let number = selection.quantities().iter().position(|q| q.name == *by).unwrap_or(0);
        let mut weights = selection.values(number)?.columns.swap_remove(0);
        if let (true, Some(masses)) = (selection.quantities()[number].extensive, particles.weights()) {
            // A sum weighs by itself.
            weights.iter_mut().zip(masses.iter()).for_each(|(v, mass)| *v /= f64::from(*mass));
        }
        Ok((choice, FieldValues { by: Some(weights), ..values }))
    }
}

/// Draws a snapshot, on a GPU if one is given.
fn renderer<'a>(
    reference: &'a Reference<'a>,
    on_device: Option<Box<dyn Renderer + 'a>>,
    (style, field): (PictureStyle, Option<&'a (FieldChoice, FieldValues)>),
    subject: &'a ViewSubject,
    context: &'a Context<'a>,
) -> ViewRenderer<'a> {
    let draw = move |view: &View, size| {
        let renderer = on_device.as_deref().unwrap_or(reference);
        let levels = match style.tone() {
            Some(tone) if style.is_mean() => renderer.response(view, size, tone, context),
            Some(tone) => renderer.draw(view, size, tone, context),
            None => {
                let view = subject.density_view(view, size);
                if let Some((field, values)) = field {
                    let map = reference.field_map(values, &field.query, &view, size, context)?;
                    return Ok(field.content(map));
                }
                return Ok(ViewContent::Density(reference.surface_density(&view, size, context)?));
            }
        };
        levels.map(ViewContent::Levels)
    };
    // Each picture uses all threads, and memory like the snapshot's.
    ViewRenderer { draw: Box::new(draw), side_by_side: false }
}

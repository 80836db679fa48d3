//! Fields added to a model file: gathered from the particles for the Gaussians that the file decodes to. Blocks of
//! positions keep their bytes.

use crate::codec::{self, FieldPrecision, StoredSection};
use crate::context::Context;
use crate::fit::gather;
use crate::model::{LawKind, Model, Quantity, QuantityKind, Unit};
use crate::particles::{LayerFields, Particles};
use crate::{Error, Result};

/// Adds fields, by name, to the file of a model that was made of `particles`; `fields` are those of each layer of the
/// particles. A layer that lacks a field has none; a field that every layer lacks is an error. Gives the new file.
pub fn add_fields(
    bytes: &[u8],
    model: &Model,
    particles: &Particles,
    fields: &[LayerFields],
    names: &[String],
    precision: &FieldPrecision,
    context: &Context<'_>,
) -> Result<Vec<u8>> {
    if model.metadata.law != LawKind::OpticalDepth {
        return Err(Error::argument("models of the law alpha-blend have no fields"));
    }
    if fields.len() != particles.layers().len() {
        return Err(Error::argument_with(
            "the fields of this snapshot cannot be read as it is selected",
            "fields need all particles of their types, in the units of the file",
        ));
    }
    let mut metadata = model.metadata.clone();
    let mut layers = codec::coded_layers(bytes, "the model")?;
    let by_mass = model.layers.iter().any(|l| l.mass.is_weighted());
    let mut found = vec![false; names.len()];
    metadata.fields = names.iter().map(|name| quantity(name, by_mass)).collect();
    for (layer, own) in particles.layers().iter().zip(fields) {
        let chosen: Vec<(usize, Result<(Option<&str>, Vec<usize>)>)> =
            names.iter().enumerate().map(|(n, name)| (n, own.find(name))).collect();
        let mut columns = Vec::new();
        let mut kept = Vec::new();
        for (n, there) in chosen {
            let (unit, own_columns) = match there {
                Ok(there) => there,
                Err(_) if fields.len() > 1 => continue,
                Err(error) => return Err(error),
            };
            let field = &mut metadata.fields[n];
            let kind = if own_columns.len() == 3 { QuantityKind::Vector } else { QuantityKind::Scalar };
            if found[n] && field.kind != kind {
                return Err(Error::argument(format!("field `{}` is a vector in one layer and a scalar in another", names[n])));
            }
            found[n] = true;
            (field.kind, field.bytes) = (kind, 4 * own_columns.len() as u16);
            field.unit = unit.map(|text| Unit { text: text.into(), si: None });
            kept.push((n, own_columns.len()));
            columns.extend(own_columns);
        }
        let at = model.layers.iter().position(|l| l.name == layer.name);
        let (Some(at), false) = (at, kept.is_empty()) else { continue };
        let components: Vec<usize> = kept.iter().map(|k| k.1).collect();
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            let mut all = Vec::new();
            own.read(run, &mut all)?;
            out.extend(columns.iter().map(|&c| all[c].clone()));
            Ok(())
        };
        let gathered = gather(&model.layers[at].content, &particles.of_layer(layer), &components, &read, context)?;
        for ((block, stored), fields) in model.layers[at].content.iter().zip(&mut layers[at].content).zip(gathered) {
            for ((n, _), f) in kept.iter().zip(fields) {
                let bytes = codec::encode_field(*n as u8, &f.moments, &block.gaussians, &f.sums, &f.range, precision);
                stored.sections.push(StoredSection { tag: codec::FIELD, bytes });
            }
        }
    }
    if let Some(n) = found.iter().position(|f| !f) {
        return Err(Error::argument(format!("no layer has a field `{}`", names[n])));
    }
    codec::assemble(&metadata, model.certificate.as_ref(), layers)
}

fn quantity(name: &str, by_mass: bool) -> Quantity {
    Quantity { name: name.into(), kind: QuantityKind::Scalar, unit: None, bytes: 4, by_mass }
}

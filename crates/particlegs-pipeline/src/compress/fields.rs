//! Fields added to a model file: gathered from the particles for the Gaussians that the file decodes to. Blocks of
//! positions keep their bytes.

use super::CompressedModel;
use crate::codec::{self, FieldPrecision, StoredSection};
use crate::context::Context;
use crate::fit::gather;
use crate::model::{LawKind, Model, Quantity, QuantityKind, Unit};
use crate::particles::{FieldColumns, LayerFields, Particles, RUN};
use crate::reference::FieldValues;
use crate::{Error, Hint, Result};

/// The name that stands for all fields of real numbers.
const ALL: &str = "all";
/// Fields of a model file at most (docs/format.md, section 2).
pub(crate) const MOST_FIELDS: usize = 256;

/// Which fields of a snapshot a model gets.
pub struct FieldSelection<'a> {
    particles: &'a Particles,
    sources: &'a [LayerFields],
    plan: FieldPlan,
}

/// Fields that a model gets, and where the layers have them.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FieldPlan {
    /// What the model's metadata lists.
    pub quantities: Vec<Quantity>,
    /// For each layer of the particles: a quantity's place in the list, and where its values come from.
    pub layers: Vec<Vec<(usize, FieldColumns)>>,
    /// Names of the snapshot's fields that the model omits.
    #[serde(skip)]
    pub omitted: Vec<String>,
    /// How values were converted, for people.
    #[serde(skip)]
    pub notes: Vec<String>,
}

impl FieldPlan {
    /// No fields?
    pub fn is_empty(&self) -> bool {
        self.quantities.is_empty()
    }

    /// Finds fields by their names among `sources`, those of each of so many `layers`; `listed` are all that the snapshot
    /// has.
    pub fn new(
        names: &[String],
        (sources, layers): (&[LayerFields], usize),
        listed: &[String],
        by_mass: bool,
        law: LawKind,
    ) -> Result<Self> {
        if law != LawKind::OpticalDepth {
            return Err(Error::argument_with(
                "models of the alpha-blend law cannot store fields",
                Hint::from("compress without ")
                    .option("law", "alpha-blend")
                    .words(", or without ")
                    .option("fields", ""),
            ));
        }
        if sources.len() != layers {
            return Err(Error::argument_with(
                "fields cannot be read from this selection of particles",
                "compress all particles of the chosen types, or convert the selection to a file first",
            ));
        }
        let mut wanted: Vec<String> = Vec::new();
        for name in names {
            let all = sources.iter().flat_map(|s| s.real_fields()).collect();
            let found = if name == ALL { all } else { vec![name.trim().to_string()] };
            found.into_iter().for_each(|name| {
                if !wanted.contains(&name) {
                    wanted.push(name)
                }
            });
        }
        let mut plan = FieldPlan::default();
        plan.layers.resize_with(sources.len(), Vec::new);
        let mut used: Vec<String> = Vec::new();
        for name in &wanted {
            let mut found: Vec<(usize, FieldColumns)> = Vec::new();
            let mut missing = None;
            for (layer, source) in sources.iter().enumerate() {
                match source.find(name) {
                    Ok(columns) => found.push((layer, columns)),
                    Err(error) => missing = Some(error),
                }
            }
            let Some((_, first)) = found.first() else {
                return Err(missing.unwrap_or_else(|| Error::argument("the snapshot has no particles")));
            };
            if let Some((_, other)) =
                found.iter().find(|(_, f)| f.unit != first.unit || f.columns.len() != first.columns.len())
            {
                let said = |f: &FieldColumns| {
                    format!("{} numbers, unit {}", f.columns.len(), f.unit.as_deref().unwrap_or("not stated"))
                };
                let what = format!("field `{name}` differs between layers: {} and {}", said(first), said(other));
                return Err(Error::argument_with(what, "compress one particle type at a time"));
            }
            let kind = if first.columns.len() == 3 { QuantityKind::Vector } else { QuantityKind::Scalar };
            let unit = first.unit.clone().map(|text| Unit { text, si: None });
            let bytes = 4 * first.columns.len() as u16;
            let place = plan.quantities.len();
            plan.quantities.push(Quantity { name: name.clone(), kind, unit, bytes, by_mass });
            for (layer, columns) in found {
                used.extend(columns.sources.clone());
                plan.notes.extend(columns.note.as_ref().map(|why| format!("{name}: {why}")));
                plan.layers[layer].push((place, columns));
            }
        }
        if plan.quantities.len() > MOST_FIELDS {
            return Err(Error::argument(format!(
                "a model can store {MOST_FIELDS} fields, not {}",
                plan.quantities.len()
            )));
        }
        plan.notes.dedup();
        let is_omitted = |name: &&String| !used.contains(name);
        plan.omitted = listed.iter().filter(is_omitted).cloned().collect();
        Ok(plan)
    }
}

impl<'a> FieldSelection<'a> {
    /// Finds fields by their names among `sources`, those of each layer of the particles. `all` means every field of real
    /// numbers. A layer that lacks a field has none; a name that no layer has is an error, and so are two layers that
    /// differ in a field's unit or kind.
    pub fn new(names: &[String], particles: &'a Particles, sources: &'a [LayerFields], law: LawKind) -> Result<Self> {
        let (layers, by_mass) = (particles.layers().len(), particles.weights().is_some());
        let plan = FieldPlan::new(names, (sources, layers), &particles.meta.fields, by_mass, law)?;
        Ok(FieldSelection { particles, sources, plan })
    }

    /// Of particles whose fields were planned.
    pub(crate) fn planned(plan: FieldPlan, particles: &'a Particles, sources: &'a [LayerFields]) -> Self {
        FieldSelection { particles, sources, plan }
    }

    /// Names of the snapshot's fields that the model omits.
    pub fn omitted(&self) -> &[String] {
        &self.plan.omitted
    }

    /// What the fields are, in the order of their names.
    pub fn quantities(&self) -> &[Quantity] {
        &self.plan.quantities
    }

    /// The values of field `number` of all particles.
    pub fn values(&self, number: usize) -> Result<FieldValues> {
        let components = self.plan.quantities[number].component_names().len();
        let mut columns = vec![vec![f32::NAN; self.particles.len()]; components];
        for ((layer, source), chosen) in self.particles.layers().iter().zip(self.sources).zip(&self.plan.layers) {
            let Some((_, from)) = chosen.iter().find(|(n, _)| *n == number) else { continue };
            let mut run = Vec::new();
            for (id, start) in layer.content.clone().step_by(RUN).enumerate() {
                source.read(id as u64, &mut run)?;
                for (column, &c) in columns.iter_mut().zip(&from.columns) {
                    let own = column[start..].iter_mut().zip(&run[c]);
                    own.for_each(|(to, v)| *to = (from.factor * v) as f32);
                }
            }
        }
        Ok(FieldValues { columns })
    }

    /// How values were converted, for people.
    pub fn notes(&self) -> &[String] {
        &self.plan.notes
    }

    /// A model that was made of the particles, with the fields.
    pub fn add_to_model(&self, done: CompressedModel, context: &Context<'_>) -> Result<CompressedModel> {
        const PLACE: &str = "the file just coded";
        let bytes = self.add_to(&done.bytes, &done.model, context)?;
        let model = codec::decode_with(&bytes, PLACE, context)?;
        let raw_bytes = done.raw_bytes + codec::read_info(&bytes, PLACE)?.raw_field_bytes();
        Ok(CompressedModel { bytes, model, raw_bytes, ..done })
    }

    /// Adds the fields to the file of a `model` that was made of the particles, and gives the new file.
    pub(crate) fn add_to(&self, bytes: &[u8], model: &Model, context: &Context<'_>) -> Result<Vec<u8>> {
        let precision = &FieldPrecision::default();
        let metadata = crate::model::Metadata { fields: self.plan.quantities.clone(), ..model.metadata.clone() };
        let mut coded = codec::coded_layers(bytes, "the model")?;
        for ((layer, source), chosen) in self.particles.layers().iter().zip(self.sources).zip(&self.plan.layers) {
            let at = model.layers.iter().position(|l| l.name == layer.name);
            let (Some(at), false) = (at, chosen.is_empty()) else { continue };
            let fields: Vec<(&str, usize)> =
                chosen.iter().map(|(n, columns)| (&self.plan.quantities[*n].name[..], columns.columns.len())).collect();
            let read = |run: u64, out: &mut Vec<Vec<f64>>| {
                let mut all = Vec::new();
                source.read(run, &mut all)?;
                for (_, columns) in chosen {
                    let values = columns.columns.iter().map(|&c| all[c].iter().map(|v| columns.factor * v).collect());
                    out.extend(values);
                }
                Ok(())
            };
            let blocks = &model.layers[at].content;
            let gathered = gather(blocks, &self.particles.of_layer(layer), &fields, &read, context)?;
            for ((block, stored), fields) in blocks.iter().zip(&mut coded[at].content).zip(gathered) {
                for ((n, _), f) in chosen.iter().zip(fields) {
                    let bytes = codec::encode_field(*n as u8, &f.moments, &block.gaussians, &f.sums, precision);
                    stored.sections.push(StoredSection { tag: codec::FIELD, bytes });
                }
            }
        }
        codec::assemble(&metadata, model.certificate.as_ref(), coded)
    }
}

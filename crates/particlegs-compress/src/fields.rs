//! Fields added to a model file: gathered from the particles for the Gaussians that the file decodes to. Blocks of
//! positions keep their bytes.

use super::CompressedModel;
use particlegs_core::codec::{FieldPrecision, PreviousField, StoredSection};
use particlegs_core::context::Context;
use particlegs_core::model::{
    Block, Certificate, LawKind, Metadata, Model, Quantity, QuantityKind, SharedSpecies, Unit,
};
use particlegs_core::{Error, Hint, Result, codec, parallel};
use particlegs_fit::{BlockField, FieldShape, correlations, gather};
use particlegs_particles::{ChunkBuffer, FieldColumns, LayerFields, Particles, RUN, StarFormingGas};
use particlegs_reference::FieldValues;

/// The name that stands for all fields of real numbers.
const ALL: &str = "all";
/// A positive scalar whose values differ by this factor is described by its logarithms.
const DECADES: f64 = 100.0;
/// Fields of a model file at most (docs/format.md, section 2).
pub const MOST_FIELDS: usize = 256;

/// The fields of a snapshot that a model gets.
pub struct FieldSelection<'a> {
    pub(super) particles: &'a Particles,
    sources: &'a [LayerFields],
    plan: FieldPlan,
    hash: Option<[u8; 16]>,
}

/// Fields that a model gets, and where the layers have them.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FieldPlan {
    /// The fields that the model's metadata lists.
    pub quantities: Vec<Quantity>,
    /// For each layer of the particles: a quantity's place in the list, and the source of its values.
    pub layers: Vec<Vec<(usize, FieldColumns)>>,
    /// Names of the snapshot's fields that the model omits.
    #[serde(skip)]
    pub omitted: Vec<String>,
    /// Notes on conversions of values, for people.
    #[serde(skip)]
    pub notes: Vec<String>,
}

impl FieldPlan {
    /// Whether no field is chosen.
    pub fn is_empty(&self) -> bool {
        self.quantities.is_empty()
    }

    /// Finds fields by their names among `sources`, those of each of the layers of such `counts`; `listed` are all that
    /// the snapshot has. `star_forming` is for temperatures that are computed from energies.
    pub fn new(
        (names, star_forming): (&[String], StarFormingGas),
        (sources, counts): (&[LayerFields], &[u64]),
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
        if sources.len() != counts.len() {
            return Err(Error::argument_with(
                "fields cannot be read from this selection of particles",
                "compress all particles of the chosen types, or convert the selection to a file first",
            ));
        }
        // `all` and a name may stand for the same field, which is stored once.
        let mut wanted_names: Vec<String> = Vec::new();
        for name in names {
            let all = sources.iter().flat_map(|s| s.real_fields()).collect();
            let matching_names = if name == ALL { all } else { vec![field_name(name.trim(), sources, star_forming)] };
            matching_names.into_iter().for_each(|name| {
                if !wanted_names.contains(&name) {
                    wanted_names.push(name)
                }
            });
        }
        let mut plan = FieldPlan::default();
        plan.layers.resize_with(sources.len(), Vec::new);
        let mut used: Vec<String> = Vec::new();
        for name in &wanted_names {
            let mut layer_columns: Vec<(usize, FieldColumns)> = Vec::new();
            let mut missing = None;
            for (layer, source) in sources.iter().enumerate() {
                match source.find(name, star_forming) {
                    Ok(columns) => layer_columns.push((layer, columns)),
                    Err(error) => missing = Some(error),
                }
            }
            let Some((_, first)) = layer_columns.first() else {
                return Err(missing.unwrap_or_else(|| Error::argument("the snapshot has no particles")));
            };
            // The metadata list a field once, so its unit and kind must be those of every layer.
            if let Some((_, other)) =
                layer_columns.iter().find(|(_, f)| f.unit != first.unit || f.columns.len() != first.columns.len())
            {
                let description = |f: &FieldColumns| {
                    format!("{} numbers, unit {}", f.columns.len(), f.unit.as_deref().unwrap_or("not stated"))
                };
                let [first, other] = [first, other].map(description);
                let message = format!("field `{name}` differs between layers: {first} and {other}");
                return Err(Error::argument_with(message, "compress one particle type at a time"));
            }
            let kind = if first.columns.len() == 3 { QuantityKind::Vector } else { QuantityKind::Scalar };
            // Fields that a temperature or a vector is made of are not omitted either.
            used.extend(layer_columns.iter().flat_map(|(_, columns)| columns.sources.clone()));
            // Charges are often a few whole numbers, and are still added up.
            if let Some(classes) = classes(sources, counts, &layer_columns)?.filter(|_| !is_sum(name)) {
                plan.notes.push(format!(
                    "{name} is a category: the model stores the share of each of its {} values",
                    classes.len()
                ));
                plan.add_classes(name, &classes, layer_columns, by_mass);
                continue;
            }
            let unit = first.unit.clone().map(|text| Unit { text, si: None });
            let bytes = 4 * first.columns.len() as u16;
            let place = plan.quantities.len();
            let extensive = kind == QuantityKind::Scalar && is_sum(name);
            // This reads all values, so it comes after what the names alone decide.
            let logarithmic =
                kind == QuantityKind::Scalar && !extensive && spans_decades(sources, counts, &layer_columns)?;
            let quantity_name = name.clone();
            plan.quantities.push(Quantity { name: quantity_name, kind, unit, bytes, by_mass, logarithmic, extensive });
            for (layer, columns) in layer_columns {
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
        // Layers whose values are converted alike give the same note.
        plan.notes.dedup();
        let is_omitted = |name: &&String| !used.contains(name);
        plan.omitted = listed.iter().filter(is_omitted).cloned().collect();
        Ok(plan)
    }
}

impl FieldPlan {
    /// Adds the classes of a category, whose values the layers have in `layer_columns`.
    fn add_classes(&mut self, name: &str, classes: &[f64], layer_columns: Vec<(usize, FieldColumns)>, by_mass: bool) {
        for (k, class) in classes.iter().enumerate() {
            let place = self.quantities.len();
            let quantity = Quantity::new(format!("{name}={class}"), QuantityKind::Category);
            // The snapshot has one byte for all classes together: the first class counts it.
            self.quantities.push(Quantity { bytes: u16::from(k == 0), by_mass, ..quantity });
            for (layer, columns) in &layer_columns {
                let class_columns = FieldColumns { class: Some(*class), wide: false, ..columns.clone() };
                self.layers[*layer].push((place, class_columns));
            }
        }
    }

    /// The fields of a layer that are stored.
    fn stored(&self, layer: usize) -> impl Iterator<Item = &(usize, FieldColumns)> {
        self.layers[layer].iter().filter(|f| Metadata::is_stored(&self.quantities, f.0))
    }
}

impl<'a> FieldSelection<'a> {
    /// Finds fields by their names among `sources`, those of each layer of the particles. `all` means every field of
    /// real numbers. `star_forming` is for temperatures that are computed from energies. A layer that lacks a field has
    /// none; a name that no layer has is an error, and so are two layers that differ in a field's unit or kind.
    pub fn new(
        names: &[String],
        star_forming: StarFormingGas,
        particles: &'a Particles,
        sources: &'a [LayerFields],
        law: LawKind,
    ) -> Result<Self> {
        let by_mass = particles.weights().is_some();
        let counts: Vec<u64> = particles.layers().iter().map(|l| l.content.len() as u64).collect();
        let plan = FieldPlan::new((names, star_forming), (sources, &counts), &particles.meta.fields, by_mass, law)?;
        Ok(FieldSelection { particles, sources, plan, hash: None })
    }

    /// Of particles whose fields were planned.
    pub(crate) fn planned(plan: FieldPlan, particles: &'a Particles, sources: &'a [LayerFields]) -> Self {
        FieldSelection { particles, sources, plan, hash: None }
    }

    /// The same, with the hash of all values, which models then keep (docs/format.md, section 2).
    pub fn hashed(mut self) -> Result<Self> {
        let mut hasher = blake3::Hasher::new();
        for (layer, (source, chosen)) in self.particles.layers().iter().zip(self.sources.iter().zip(&self.plan.layers))
        {
            // Each run has a hash of its own, so that threads can share the work and order still counts.
            let hash_of_run = |run: usize| {
                let (mut columns, mut bytes) = (Vec::new(), Vec::new());
                source.read_some(run as u64, |c| chosen.iter().any(|f| f.1.needs(c)), &mut columns)?;
                for (_, field) in chosen {
                    let components = 0..field.columns.len();
                    components.for_each(|k| bytes.extend(field.values(&columns, k).flat_map(f64::to_le_bytes)));
                }
                Ok::<_, Error>(blake3::hash(&bytes))
            };
            for hash in parallel::try_map_range(layer.content.len().div_ceil(RUN), hash_of_run)? {
                hasher.update(hash.as_bytes());
            }
        }
        self.hash = hasher.finalize().as_bytes().first_chunk().copied();
        Ok(self)
    }

    /// The hash of all values, where [`FieldSelection::hashed`] has computed it.
    pub fn hash(&self) -> Option<[u8; 16]> {
        self.hash
    }

    /// Names of the snapshot's fields that the model omits.
    pub fn omitted(&self) -> &[String] {
        &self.plan.omitted
    }

    /// Descriptions of the fields, in the order of their names.
    pub fn quantities(&self) -> &[Quantity] {
        &self.plan.quantities
    }

    /// The values of field `number` of all particles.
    pub fn values(&self, number: usize) -> Result<FieldValues> {
        let components = self.plan.quantities[number].component_names().len();
        let mut columns = vec![vec![f64::NAN; self.particles.len()]; components];
        for ((layer, source), chosen) in self.particles.layers().iter().zip(self.sources).zip(&self.plan.layers) {
            let Some((_, from)) = chosen.iter().find(|(n, _)| *n == number) else { continue };
            let mut run = Vec::new();
            for (id, start) in layer.content.clone().step_by(RUN).enumerate() {
                source.read_some(id as u64, |c| from.needs(c), &mut run)?;
                for (k, column) in columns.iter_mut().enumerate() {
                    let entries = column[start..].iter_mut().zip(from.values(&run, k));
                    entries.for_each(|(to, v)| *to = v);
                }
            }
        }
        Ok(FieldValues { columns, logarithmic: self.plan.quantities[number].logarithmic, by: None })
    }

    /// The places of a layer's fields in the list.
    pub(super) fn numbers(&self, layer: usize) -> Vec<usize> {
        self.plan.stored(layer).map(|f| f.0).collect()
    }

    /// Shapes of a layer's fields, by which they are gathered.
    pub(super) fn shapes(&self, layer: usize) -> Vec<FieldShape<'_>> {
        let shape = |(n, columns): &(usize, FieldColumns)| FieldShape {
            may_lack: columns.may_lack,
            ..FieldShape::new(&self.plan.quantities[*n])
        };
        self.plan.stored(layer).map(shape).collect()
    }

    /// Reads their values in a run of the layer's particles, as [`gather`] wants them.
    pub(super) fn read(&self, layer: usize, run: u64, out: &mut Vec<Vec<f64>>) -> Result<()> {
        let layer_particles = self.particles.of_layer(&self.particles.layers()[layer]);
        let chosen: Vec<&(usize, FieldColumns)> = self.plan.stored(layer).collect();
        let mut all = Vec::new();
        self.sources[layer].read_some(run, |c| chosen.iter().any(|f| f.1.needs(c)), &mut all)?;
        let mut buffer = ChunkBuffer::default();
        let first = run as usize * RUN;
        let chunk = layer_particles.chunk(first..layer_particles.len().min(first + RUN), &mut buffer);
        // Gathering weights every value, so that a value over its weight adds up to the sum of the values.
        let over_weight = |(i, v): (usize, f64)| v / chunk.weight.map_or(1.0, |w| f64::from(w[i]));
        for (n, columns) in chosen {
            // `gather` takes a logarithmic field as two columns: logarithms first, then the values themselves.
            if self.plan.quantities[*n].logarithmic {
                out.push(columns.values(&all, 0).map(libm::log).collect());
            }
            match self.plan.quantities[*n].extensive {
                true => out.push(columns.values(&all, 0).enumerate().map(over_weight).collect()),
                false => out.extend((0..columns.columns.len()).map(|k| columns.values(&all, k).collect())),
            }
        }
        Ok(())
    }

    /// Notes on conversions of values, for people.
    pub fn notes(&self) -> &[String] {
        &self.plan.notes
    }

    /// A model that was made of the particles, with the fields.
    pub fn add_to_model(&self, done: CompressedModel, context: &Context<'_>) -> Result<CompressedModel> {
        const PLACE: &str = "the file just coded";
        let bytes = self.add_to(&done.bytes, &done.model, context)?;
        let model = codec::decode_with(&bytes, PLACE, context)?;
        Ok(CompressedModel { bytes, model, ..done })
    }

    /// The file of a model with the fields added: `bytes` is its file without them, `model` the same decoded, both made
    /// of the particles that have the fields.
    pub(crate) fn add_to(&self, bytes: &[u8], model: &Model, context: &Context<'_>) -> Result<Vec<u8>> {
        let shared = codec::read_metadata(bytes, "the model")?.shared_species;
        if !shared.is_empty() {
            return Err(Error::argument("fields cannot be added where particle types share Gaussians"));
        }
        let (fields, fields_hash) = (self.plan.quantities.clone(), self.hash);
        let metadata = Metadata { fields, fields_hash, ..model.metadata.clone() };
        let mut coded = codec::coded_layers(bytes, "the model")?;
        let blocks = coded.iter_mut().flat_map(|layer| &mut layer.content);
        for (stored, sections) in blocks.zip(self.sections(model, &|_, _| None, context)?) {
            stored.sections.extend(sections);
        }
        let measured =
            |c: Certificate| Ok::<_, Error>(Certificate { fields: self.agreement(model, c.views.seed, context)?, ..c });
        let certificate = model.certificate.map(measured).transpose()?;
        codec::assemble(&metadata, certificate.as_ref(), coded)
    }

    /// Whether scalars are described by their logarithms as `others` of their names and kinds are.
    pub(crate) fn with_scales(mut self, others: &[Quantity]) -> Self {
        for (quantity, other) in self.plan.quantities.iter_mut().zip(others) {
            if quantity.name == other.name && quantity.kind == other.kind && quantity.extensive == other.extensive {
                quantity.logarithmic = other.logarithmic;
            }
        }
        self
    }

    /// A `model` that was made of the particles, with the fields as a file of it holds them. `before` is that of
    /// [`FieldSelection::sections`].
    pub(crate) fn coded_anew<'b>(
        &self,
        model: &Model,
        before: &dyn Fn([usize; 2], &Quantity) -> Option<PreviousField<'b>>,
        context: &Context<'_>,
    ) -> Result<Model> {
        codec::with_fields(model.clone(), &self.sections(model, before, context)?, before)
    }

    /// The fields of a `model` that was made of the particles, coded for each of its blocks: as changes, where `before`
    /// gives the values of a quantity that the Gaussians of a layer's block had in the frame before.
    pub(crate) fn sections<'b>(
        &self,
        model: &Model,
        before: &dyn Fn([usize; 2], &Quantity) -> Option<PreviousField<'b>>,
        context: &Context<'_>,
    ) -> Result<Vec<Vec<StoredSection>>> {
        let mut sections: Vec<Vec<Vec<StoredSection>>> =
            model.layers.iter().map(|l| vec![Vec::new(); l.content.len()]).collect();
        for (index, layer) in self.particles.layers().iter().enumerate() {
            // Layers are matched by name: those of the file may stand in another order.
            let chosen = self.numbers(index);
            let at = model.layers.iter().position(|l| l.name == layer.name);
            let (Some(at), false) = (at, chosen.is_empty()) else { continue };
            let read = |run: u64, out: &mut Vec<Vec<f64>>| self.read(index, run, out);
            let (blocks, shapes) = (&model.layers[at].content, self.shapes(index));
            let gathered = gather(blocks, &self.particles.of_layer(layer), &shapes, &read, context)?;
            let particles = self.particles.of_layer(layer);
            let pairs = correlations(blocks, &particles, (&shapes, &gathered), &read, None, context)?;
            let each = blocks.iter().zip(&mut sections[at]).zip(gathered).zip(pairs).enumerate();
            for (number, (((block, stored), fields), pairs)) in each {
                for pair in pairs {
                    let numbers = pair.fields.map(|f| chosen[f] as u8);
                    let bytes = codec::encode_correlation(numbers, &pair.values, &block.gaussians);
                    stored.push(StoredSection { tag: codec::CORRELATION, bytes });
                }
                for (n, f) in chosen.iter().zip(fields) {
                    stored.push(self.section(*n, &f, block, before([at, number], &self.plan.quantities[*n])));
                }
            }
        }
        Ok(sections.concat())
    }

    /// Field `number` of a block, coded: as a change from what its Gaussians had in the frame `before`.
    pub(super) fn section(
        &self,
        number: usize,
        field: &BlockField,
        block: &Block,
        before: Option<PreviousField<'_>>,
    ) -> StoredSection {
        let (quantity, precision) = (&self.plan.quantities[number], FieldPrecision::default());
        let of_field = (number as u8, quantity);
        let BlockField { moments, sums } = field;
        let bytes = codec::encode_field(of_field, moments, &block.gaussians, sums, &precision, before.as_ref());
        StoredSection { tag: if before.is_some() { codec::FIELD_CHANGE } else { codec::FIELD }, bytes }
    }
}

/// Names of fields that are sums over particles, in lower case; others are means.
fn is_sum(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    ["q", "charge", "charges", "sfr"].contains(&&name[..])
        || ["starformationrate", "luminosit", "metalmass"].iter().any(|part| name.contains(part))
}

/// The field that `name` means: the category of `CATEGORY=CLASS`.
fn field_name(name: &str, sources: &[LayerFields], star_forming: StarFormingGas) -> String {
    let category = name.split_once('=').map(|(category, _)| category);
    let is_there = |name: &str| sources.iter().any(|s| s.find(name, star_forming).is_ok());
    category.filter(|category| !is_there(name) && is_there(category)).unwrap_or(name).to_string()
}

/// The values of a field of whole numbers that has 2 to 16 of them, rising; `None` of others.
fn classes(
    sources: &[LayerFields],
    counts: &[u64],
    layer_columns: &[(usize, FieldColumns)],
) -> Result<Option<Vec<f64>>> {
    let is_one = |(_, c): &(usize, FieldColumns)| c.whole && c.columns.len() == 1 && c.temperature.is_none();
    if !layer_columns.iter().all(is_one) {
        return Ok(None);
    }
    let mut values: Vec<f64> = Vec::new();
    let mut run = Vec::new();
    for (layer, columns) in layer_columns {
        for id in 0..counts[*layer].div_ceil(RUN as u64) {
            sources[*layer].read_some(id, |c| columns.needs(c), &mut run)?;
            for v in columns.values(&run, 0) {
                if let Err(place) = values.binary_search_by(|value| value.total_cmp(&v)) {
                    values.insert(place, v);
                }
                // Ids are whole numbers too, and are given up here after a few particles.
                if values.len() > SharedSpecies::MOST {
                    return Ok(None);
                }
            }
        }
    }
    Ok(Some(values).filter(|v| v.len() > 1))
}

/// Whether all values of a field are positive, and the largest is at least [`DECADES`] times the least.
fn spans_decades(sources: &[LayerFields], counts: &[u64], layer_columns: &[(usize, FieldColumns)]) -> Result<bool> {
    let (mut least, mut largest) = (f64::INFINITY, 0.0f64);
    let mut run = Vec::new();
    for (layer, columns) in layer_columns {
        for id in 0..counts[*layer].div_ceil(RUN as u64) {
            sources[*layer].read_some(id, |c| columns.needs(c), &mut run)?;
            for v in columns.values(&run, 0).filter(|v| !(columns.may_lack && v.is_nan())) {
                if v.is_nan() || v <= 0.0 {
                    return Ok(false);
                }
                (least, largest) = (least.min(v), largest.max(v));
            }
        }
    }
    Ok(largest.is_finite() && largest >= DECADES * least)
}

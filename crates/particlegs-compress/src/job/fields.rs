//! Values of fields on their way from the snapshot to the blocks, converted: columns of float32 behind the particles'
//! own. A value that needs a float64 takes two, the halves of its bits.

use super::manifest::JobFolder;
use crate::{FieldPlan, FieldSelection, MOST_FIELDS};
use particlegs_core::context::Context;
use particlegs_core::model::Model;
use particlegs_core::{Result, codec};
use particlegs_fit::value_fault;
use particlegs_measure::score::{FieldCellTable, FieldCells};
use particlegs_particles::{FieldColumns, LayerFields, LayeredParticles, Number, Particles, SourceField};

/// For each layer, columns of its particles.
pub(super) type FieldBits = Vec<Vec<Vec<f32>>>;

/// Columns that a field takes.
fn width(from: &FieldColumns) -> usize {
    from.columns.len() * if is_wide(from) { 2 } else { 1 }
}

/// Whether values need a float64.
fn is_wide(from: &FieldColumns) -> bool {
    from.wide || from.factors.iter().any(|factor| *factor != 1.0)
}

impl JobFolder {
    /// Columns of a layer's particles: x, y, z, weights, fields.
    pub(super) fn columns(&self, layer: usize) -> usize {
        self.manifest.plan.layers[layer].mass.columns() + self.manifest.fields.columns(layer)
    }

    /// Checks that the fields of a snapshot that was opened again are those that were planned.
    pub(super) fn check_fields(&self, source: &LayeredParticles) -> Result<()> {
        for (layer, chosen) in self.manifest.fields.layers.iter().enumerate() {
            for (number, from) in chosen {
                let quantity = &self.manifest.fields.quantities[*number];
                let name = quantity.class().map_or(&quantity.name[..], |(category, _)| category);
                let current_columns = source.fields.get(layer).map(|f| f.find(name, from.star_forming()));
                // Class and width are the plan's choice; a source does not state them.
                let same = |f: FieldColumns| FieldColumns { class: from.class, wide: from.wide, ..f } == *from;
                if !current_columns.is_some_and(|f| f.is_ok_and(same)) {
                    return Err(self.changed(&format!("its field `{name}` is different")));
                }
            }
        }
        Ok(())
    }

    /// The fields of some particles of a run, as columns.
    pub(super) fn field_bits(
        &self,
        source: &LayeredParticles,
        layer: usize,
        run: u64,
        particles: &[u32],
    ) -> Result<Vec<Vec<f32>>> {
        let fields = &self.manifest.fields;
        let Some((chosen, layer_fields)) = fields.layers.get(layer).zip(source.fields.get(layer)) else {
            return Ok(Vec::new());
        };
        let (mut values, mut columns) = (Vec::new(), Vec::with_capacity(self.manifest.fields.columns(layer)));
        layer_fields.read_some(run, |c| chosen.iter().any(|f| f.1.needs(c)), &mut values)?;
        for (number, from) in chosen {
            for k in 0..from.columns.len() {
                let all: Vec<f64> = from.values(&values, k).collect();
                let value = |&i: &u32| all.get(i as usize).copied();
                let missing = || self.changed("a field has another number of values");
                let field_values: Vec<f64> = particles.iter().map(value).collect::<Option<_>>().ok_or_else(missing)?;
                // Refused here: a block's task could not name the particle's place in the snapshot.
                if let Some(at) = field_values.iter().position(|v| !(v.is_finite() || from.may_lack && v.is_nan())) {
                    let particle = run as usize * particlegs_particles::RUN + particles[at] as usize;
                    return Err(value_fault(&fields.quantities[*number].name, particle, field_values[at]));
                }
                let half =
                    |shift: u32| field_values.iter().map(|v| f32::from_bits((v.to_bits() >> shift) as u32)).collect();
                match is_wide(from) {
                    true => columns.extend([half(0), half(32)]),
                    false => columns.push(field_values.iter().map(|v| *v as f32).collect()),
                }
            }
        }
        Ok(columns)
    }

    /// A block's file with the fields of its particles.
    pub(super) fn with_fields(
        &self,
        bytes: Vec<u8>,
        particles: &Particles,
        bits: &FieldBits,
        context: &Context<'_>,
    ) -> Result<Vec<u8>> {
        if !self.has_fields() {
            return Ok(bytes);
        }
        let model = codec::decode_with(&bytes, "the block just coded", context)?;
        let (plan, sources) = self.fields_of_bits(bits);
        FieldSelection::planned(plan, particles, &sources).add_to(&bytes, &model, context)
    }

    /// Sums over the fields of a block, whose `model` was made of these particles.
    pub(super) fn field_sums(
        &self,
        model: &Model,
        (particles, bits): (&Particles, &FieldBits),
        cells: &FieldCells,
        context: &Context<'_>,
    ) -> Result<Vec<FieldCellTable>> {
        let (plan, sources) = self.fields_of_bits(bits);
        let counts: Vec<u64> = self.manifest.plan.layers.iter().map(|l| l.content).collect();
        FieldSelection::planned(plan, particles, &sources).sums(model, cells, &counts, context)
    }

    /// The planned fields as the columns of a block have them.
    fn fields_of_bits(&self, bits: &FieldBits) -> (FieldPlan, Vec<LayerFields>) {
        let planned = &self.manifest.fields;
        let (mut plan, mut sources) = (planned.clone(), Vec::new());
        for (chosen, columns) in plan.layers.iter_mut().zip(bits) {
            let (mut fields, mut values) = (Vec::new(), Vec::new());
            let mut left = &columns[..];
            for (number, from) in chosen {
                let (field_columns, after) = left.split_at(width(from));
                left = after;
                let components = from.columns.len() as u32;
                let wide = is_wide(from);
                // Values come converted.
                (from.factors, from.temperature, from.class) = (vec![1.0; from.columns.len()], None, None);
                from.columns = (values.len()..values.len() + from.columns.len()).collect();
                values.extend(field_columns.chunks(if wide { 2 } else { 1 }).map(numbers));
                fields.push(SourceField {
                    name: planned.quantities[*number].name.clone(),
                    number: Number::F64,
                    components,
                    unit: None,
                    attributes: Vec::new(),
                    physical: None,
                });
            }
            sources.push(LayerFields::from_columns(fields, values));
        }
        (plan, sources)
    }
}

/// Numbers from one column, or from those of the halves of their bits.
fn numbers(columns: &[Vec<f32>]) -> Vec<f64> {
    match columns {
        [low, high] => {
            let joined = |(l, h): (&f32, &f32)| f64::from_bits(u64::from(h.to_bits()) << 32 | u64::from(l.to_bits()));
            low.iter().zip(high).map(joined).collect()
        }
        _ => columns.iter().flatten().map(|v| f64::from(*v)).collect(),
    }
}

impl FieldPlan {
    /// Columns of float32 that the fields of a layer take.
    pub(super) fn columns(&self, layer: usize) -> usize {
        self.layers.get(layer).map_or(0, |l| l.iter().map(|(_, from)| width(from)).sum())
    }

    /// Bytes that the fields of a layer's particle take where a block is done: as columns, and as float64.
    pub(super) fn particle_bytes(&self, layer: usize) -> u64 {
        let numbers: usize = self.layers.get(layer).map_or(0, |l| l.iter().map(|(_, from)| from.columns.len()).sum());
        (4 * self.columns(layer) + 8 * numbers) as u64
    }

    /// The same of all particles of layers of such `counts`.
    pub(super) fn bytes(&self, counts: impl Iterator<Item = u64>) -> u64 {
        counts.enumerate().map(|(l, n)| n.saturating_mul(self.particle_bytes(l))).fold(0, u64::saturating_add)
    }

    /// Whether it is one that this program makes for so many layers.
    pub(super) fn is_sound(&self, layers: usize) -> bool {
        let is_sound_field = |(number, from): &(usize, FieldColumns)| {
            let quantity = self.quantities.get(*number);
            let count = from.columns.len();
            quantity.is_some_and(|q| q.component_names().len() == count)
                && from.factors.len() == count
                && from.factors.iter().all(|factor| factor.is_finite())
        };
        let whole = self.layers.len() == if self.is_empty() { 0 } else { layers };
        whole && self.quantities.len() <= MOST_FIELDS && self.layers.iter().flatten().all(is_sound_field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_float64_are_joined_again() {
        let values = [0.0, -0.0, 1.0 / 3.0, 1e300, -5e-324, f64::MAX];
        let half = |shift: u32| values.iter().map(|v: &f64| f32::from_bits((v.to_bits() >> shift) as u32)).collect();
        let joined = numbers(&[half(0), half(32)]);
        assert!(joined.iter().zip(values).all(|(a, b)| a.to_bits() == b.to_bits()), "{joined:?}");
        assert_eq!(numbers(&[vec![0.1f32]]), [f64::from(0.1f32)]);
    }
}

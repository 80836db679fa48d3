//! Agreement of a model's fields with those of particles that they were not gathered from, for its certificate.

use super::FieldSelection;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Block, CERTIFIED_FIELDS, FieldAgreements, FieldMoments, Metadata, Model};
use particlegs_core::{Result, codec, parallel};
use particlegs_fit::{FieldMeans, FieldShape, gather};
use particlegs_measure::score::{FieldCellSums, FieldCellTable, FieldCells, FieldPlace};
use particlegs_particles::{ChunkBuffer, RUN};

/// Particles of a layer that is looked at, at least.
const LEAST_PARTICLES: u64 = 200;
/// Runs of particles that wait together.
const RUNS: usize = 4;

impl FieldSelection<'_> {
    /// Gathers the first fields from a random half of the particles, and rounds them, as [`FieldSelection::add_to_model`]
    /// does of all, for the Gaussians of a `model` that was made of all, and compares with the other half: means of values
    /// in cells, whose sampling noise is independent in the halves. Of many particles, those of some regions. `None`
    /// without fields.
    pub fn agreement(&self, model: &Model, seed: u64, context: &Context<'_>) -> Result<Option<FieldAgreements>> {
        self.agreement_by(model, seed, false, context)
    }

    /// The same of the fields that the `model` has; of a block without one its means are 0.
    pub(crate) fn agreement_of_model(
        &self,
        model: &Model,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<Option<FieldAgreements>> {
        self.agreement_by(model, seed, true, context)
    }

    fn agreement_by(
        &self,
        model: &Model,
        seed: u64,
        of_model: bool,
        context: &Context<'_>,
    ) -> Result<Option<FieldAgreements>> {
        let cells = FieldCells::new(&model.metadata, seed);
        let counts: Vec<u64> = self.particles.layers().iter().map(|l| l.content.len() as u64).collect();
        let sums = self.sums_by(model, &cells, &counts, of_model, context)?;
        let mut agreements = FieldAgreements::default();
        let field_agreements = sums.iter().map(|sums| Some(cells.agreement(sums)));
        agreements.each.iter_mut().zip(field_agreements).for_each(|(to, agreement)| *to = agreement);
        Ok((!sums.is_empty()).then_some(agreements))
    }

    /// Sums of each field that agreement is measured by, here of particles that may be a part of all. `counts` are
    /// those of all layers.
    pub(crate) fn sums(
        &self,
        model: &Model,
        cells: &FieldCells,
        counts: &[u64],
        context: &Context<'_>,
    ) -> Result<Vec<FieldCellTable>> {
        self.sums_by(model, cells, counts, false, context)
    }

    fn sums_by(
        &self,
        model: &Model,
        cells: &FieldCells,
        counts: &[u64],
        of_model: bool,
        context: &Context<'_>,
    ) -> Result<Vec<FieldCellTable>> {
        let mut sums = vec![FieldCellTable::new(); self.quantities().len().min(CERTIFIED_FIELDS)];
        for (index, (_, count)) in self.particles.layers().iter().zip(counts).enumerate() {
            if *count >= LEAST_PARTICLES && !sums.is_empty() {
                self.add_layer(index, (model, of_model), cells, &mut sums, context)?;
            }
        }
        Ok(sums)
    }

    fn add_layer(
        &self,
        index: usize,
        (model, of_model): (&Model, bool),
        cells: &FieldCells,
        sums: &mut [FieldCellTable],
        context: &Context<'_>,
    ) -> Result<()> {
        let layer = &self.particles.layers()[index];
        let at = model.layers.iter().position(|l| l.name == layer.name);
        // Particles of the other half lack values.
        let shapes: Vec<FieldShape<'_>> =
            self.shapes(index).into_iter().map(|s| FieldShape { may_lack: true, ..s }).collect();
        let (Some(at), false) = (at, shapes.is_empty()) else { return Ok(()) };
        let (blocks, particles) = (&model.layers[at].content, self.particles.of_layer(layer));
        // Found once, as gathering and comparing must split the particles alike.
        let places = parallel::map(0..particles.len().div_ceil(RUN), |run| {
            let place = |i: usize| cells.place(particles.position(i));
            (run * RUN..particles.len().min((run + 1) * RUN)).map(place).collect::<Vec<Option<FieldPlace>>>()
        });
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            self.read(index, run, out)?;
            for column in out {
                let others = column.iter_mut().zip(&places[run as usize]);
                let others = others.filter(|(_, place)| place.is_none_or(|p| p.half != 0));
                others.for_each(|(v, _)| *v = f64::NAN);
            }
            Ok(())
        };
        let numbers = self.numbers(index);
        let coded_anew;
        let with_fields = match of_model {
            true => blocks,
            false => {
                // Rounded as a file has them.
                let gathered = gather(blocks, &particles, &shapes, &read, context)?;
                let sections = blocks.iter().zip(gathered).map(|(block, fields)| {
                    let stored = numbers.iter().zip(fields).map(|(n, f)| self.section(*n, &f, block, None));
                    stored.collect::<Vec<_>>()
                });
                let metadata = Metadata { fields: self.quantities().to_vec(), ..model.metadata.clone() };
                let alone = Model { layers: vec![model.layers[at].clone()], certificate: None, metadata };
                coded_anew = codec::with_fields(alone, &sections.collect::<Vec<_>>(), &|_, _| None)?;
                &coded_anew.layers[0].content
            }
        };
        let fields: Vec<Vec<FieldMoments>> =
            with_fields.iter().map(|block| self.fields_of(block, &numbers, &shapes)).collect();
        let means = FieldMeans::new(blocks, context);
        let runs = particles.len().div_ceil(RUN);
        for first in (0..runs).step_by(RUNS) {
            let parts = parallel::try_map(first..runs.min(first + RUNS), |run| {
                context.check()?;
                let (mut values, mut buffer) = (Vec::new(), ChunkBuffer::default());
                self.read(index, run as u64, &mut values)?;
                let start = run * RUN;
                let chunk = particles.chunk(start..particles.len().min(start + RUN), &mut buffer);
                // The model's means are looked at where they were not gathered from: in the second half.
                let is_second = |place: &Option<FieldPlace>| place.is_some_and(|p| p.half == 1);
                let place = |i: usize| each_axis(|k| particles.origin[k] + f64::from(chunk.position[k][i]));
                let second: Vec<usize> = (0..chunk.len()).filter(|i| is_second(&places[run][*i])).collect();
                let model_means = means.at(&fields, &second.iter().map(|i| place(*i)).collect::<Vec<_>>());
                let mut places_of_second = 0..;
                let mut contributions = Vec::with_capacity(chunk.len() * shapes.len());
                for (i, place) in places[run].iter().enumerate() {
                    let Some(FieldPlace { cell, half }) = *place else { continue };
                    let second = if half == 1 { places_of_second.next() } else { None };
                    let weight = chunk.weight.map_or(1.0, |w| f64::from(w[i]));
                    let mut column = 0;
                    for (field, (number, shape)) in numbers.iter().zip(&shapes).enumerate() {
                        // The values of a logarithmic field come after their logarithms.
                        let first = column + usize::from(shape.logarithmic);
                        column += shape.columns();
                        if values[first][i].is_nan() {
                            continue;
                        }
                        let mut cell_sums = FieldCellSums::default();
                        cell_sums[half] = weight;
                        let mean = second.map_or([0.0; 3], |place: usize| model_means[field][place]);
                        // The layout is that of `FieldCellSums`.
                        for c in 0..shape.components {
                            cell_sums[2 + 3 * c + half] = weight * values[first + c][i];
                            cell_sums[4 + 3 * c] = weight * mean[c];
                        }
                        contributions.push((cell, *number, cell_sums));
                    }
                }
                Ok::<_, particlegs_core::Error>(contributions)
            })?;
            // In the order of the runs, so that sums do not depend on threads.
            for (cell, number, cell_sums) in parts.iter().flatten() {
                if let Some(sums) = sums.get_mut(*number) {
                    sums.entry(*cell).or_default().iter_mut().zip(cell_sums).for_each(|(a, b)| *a += b);
                }
            }
        }
        Ok(())
    }

    /// The fields of a block's Gaussians by their numbers, in such shapes.
    fn fields_of(&self, block: &Block, numbers: &[usize], shapes: &[FieldShape<'_>]) -> Vec<FieldMoments> {
        let g = &block.gaussians;
        let none = |components: usize| {
            let mut none = FieldMoments { range: vec![[0.0; 2]; components], ..FieldMoments::new(components) };
            none.mean.iter_mut().for_each(|column| column.resize(g.len(), 0.0));
            none.slope.iter_mut().flatten().for_each(|column| column.resize(g.len(), 0.0));
            none
        };
        let moments = |(number, shape): (&usize, &FieldShape<'_>)| {
            let moments = g.fields.get(&self.quantities()[*number].name);
            moments.filter(|f| f.components() == shape.components).cloned().unwrap_or_else(|| none(shape.components))
        };
        numbers.iter().zip(shapes).map(moments).collect()
    }
}

//! Moments of what particles carry, gathered for the Gaussians of a decoded model in one pass over the particles.

use super::assignment::{PlaceShares, SoftAssignment};
use super::block_runs::{BlockFinder, BlockReader, BlockRun, RUNS};
use fearless_simd::{Level, Simd, dispatch, f64x8, prelude::*};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{Block, FieldMoments, Mixture, Quantity, QuantityKind};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::Particles;
use std::ops::Range;
use std::sync::Arc;

/// Gaussians that one task adds to.
const RANGE: usize = 256;
/// Particles that a slope of 0 counts as.
const SLOPE_PRIOR: f64 = 5.0;
/// Particles that the block's mean spread counts as. Outside haloes it is far above a Gaussian's own, so more of it
/// would widen velocities there (docs/results/fields.md); without it Gaussians of few particles would have none.
const SPREAD_PRIOR: f64 = 0.5;
/// Largest part of a logarithm's variance across a Gaussian that its slopes explain: exponentials of slopes that few
/// particles suggest would outgrow all others.
const MOST_EXPLAINED_OF_LOGARITHMS: f64 = 0.25;
/// Passes over the particles.
const PASSES: usize = 4;
/// Bytes of shares and values that are held from pass to pass: as much as refinement held before.
const HELD: usize = 240 << 20;
/// Shares at least, where particles are weighed by them: a Gaussian in which few were of a class may have more.
const LEAST_SHARE: f64 = 1e-3;
/// A spread's variances are no smaller than this part of their sum, where values are weighed by it.
const LEAST_SPREAD: f64 = 1e-6;

/// The moments of a field in a block, with what its particles sum to.
#[derive(Clone, Debug)]
pub struct BlockField {
    /// Moments of each Gaussian.
    pub moments: FieldMoments,
    /// Sums of weight times value, one a component.
    pub sums: Vec<f64>,
}

/// A field that is gathered.
#[derive(Clone, Copy, Debug)]
pub struct FieldShape<'a> {
    /// For messages.
    pub name: &'a str,
    /// 1 or 3.
    pub components: usize,
    /// Whether it is described by its logarithms.
    pub logarithmic: bool,
    /// Whether particles may lack a value (NaN). These count as the others' mean.
    pub may_lack: bool,
    /// Whether the values are 1 for particles of a class, else 0.
    pub share: bool,
}

impl<'a> FieldShape<'a> {
    /// The shape of a field in which no value is missing.
    pub fn new(q: &'a Quantity) -> Self {
        let (components, share) = (q.component_names().len(), q.kind == QuantityKind::Category);
        FieldShape { name: &q.name, components, logarithmic: q.logarithmic, may_lack: false, share }
    }

    /// Columns of values: one for each component; of a logarithmic field the logarithm, then the value.
    pub fn columns(&self) -> usize {
        self.components + usize::from(self.logarithmic)
    }
}

/// Reads the values of a run of particles: the columns of each field ([`FieldShape`]); then, of particles that stand
/// for several, a column of how many. A logarithmic field has two: the logarithm of the value, and the value.
pub type ReadValues<'a> = dyn Fn(u64, &mut Vec<Vec<f64>>) -> Result<()> + Sync + 'a;

/// Gathers `fields` for the decoded `blocks` of one layer, whose particles these are. Gives
/// the fields of each block. Particles weigh by their masses, where they have weights.
///
/// The first pass shares each particle among the Gaussians by their densities at its place. Further passes also ask how
/// well its value agrees with each Gaussian's moments: expectation maximisation of the field's distribution given the
/// place, so that cold and hot Gaussians in one place keep their own spreads.
pub fn gather(
    blocks: &[Block],
    particles: &Particles,
    fields: &[FieldShape<'_>],
    read: &ReadValues<'_>,
    context: &Context<'_>,
) -> Result<Vec<Vec<BlockField>>> {
    let mut sums: Vec<BlockFieldSums> = blocks.iter().map(|b| BlockFieldSums::new(b, fields, context)).collect();
    let reader = BlockReader { particles, fields, read, finder: BlockFinder::new(blocks) };
    let mut held_runs: Vec<Option<Arc<FieldRun>>> = Vec::new();
    let mut bytes_left = HELD;
    context.begin("fields", (PASSES * particles.len()) as u64);
    for pass in 0..PASSES {
        if pass > 0 {
            sums.iter_mut().for_each(BlockFieldSums::next_pass);
        }
        // Shares by place and values are the same in every pass: those that fit into the bound are kept for the next.
        if pass > 0 && held_runs.iter().all(Option::is_some) {
            for batch in held_runs.chunks(RUNS) {
                context.check()?;
                add_batch(&mut sums, batch.iter().flatten().cloned().collect(), context);
            }
            continue;
        }
        let mut number = 0;
        reader.each_batch(context, |runs| {
            let held = |k: usize| held_runs.get(number + k).cloned().flatten();
            let batch = parallel::map(runs.into_iter().enumerate(), |(k, run)| {
                held(k).unwrap_or_else(|| Arc::new(FieldRun::new(run, &sums)))
            });
            if pass == 0 {
                for run in &batch {
                    sums[run.block].add_totals(&run.totals);
                    let fits = run.bytes() <= bytes_left;
                    bytes_left -= if fits { run.bytes() } else { 0 };
                    held_runs.push(fits.then(|| run.clone()));
                }
            }
            number += batch.len();
            add_batch(&mut sums, batch, context);
            Ok(())
        })?;
    }
    context.end();
    Ok(sums.into_iter().map(BlockFieldSums::finish).collect())
}

/// Adds runs to the sums of their blocks.
fn add_batch(sums: &mut [BlockFieldSums<'_>], batch: Vec<Arc<FieldRun>>, context: &Context<'_>) {
    context.advance(batch.iter().map(|run| run.particles as u64).sum());
    let weighed = parallel::map(batch, |run| {
        let fields = &sums[run.block].fields;
        let weighed: Vec<_> = fields.iter().enumerate().map(|(k, f)| run.weighed(k, f, context.simd())).collect();
        (run, weighed)
    });
    // Every row adds the runs in their order, so that sums do not depend on threads.
    for (number, block) in sums.iter_mut().enumerate() {
        block.add(&weighed.iter().filter(|(run, _)| run.block == number).collect::<Vec<_>>(), context.simd());
    }
}

/// Refuses values that are no numbers; `first` is the particle of the first.
pub(super) fn check_finite(fields: &[FieldShape<'_>], values: &[Vec<f64>], first: usize) -> Result<()> {
    let shapes = fields.iter().flat_map(|f| std::iter::repeat_n(f, f.columns()));
    for (field, values) in shapes.zip(values) {
        let is_wrong = |v: &f64| !(v.is_finite() || field.may_lack && v.is_nan());
        if let Some(i) = values.iter().position(is_wrong) {
            return Err(value_fault(field.name, first + i, values[i]));
        }
    }
    Ok(())
}

/// A value that is no number.
pub fn value_fault(field: &str, particle: usize, value: f64) -> Error {
    let message = format!("particle {particle} has the value {value} in field `{field}`");
    Error::argument_with(message, "leave the field out, or remove the particle from the file")
}

/// The means of fields at places, by the Gaussians of the blocks that they were gathered for.
pub struct FieldMeans<'a> {
    blocks: &'a [Block],
    finder: BlockFinder,
    assignments: Vec<SoftAssignment>,
}

impl<'a> FieldMeans<'a> {
    /// Of blocks.
    pub fn new(blocks: &'a [Block], context: &Context<'_>) -> Self {
        let assignments = blocks.iter().map(|b| SoftAssignment::new(&b.gaussians, context.simd())).collect();
        FieldMeans { blocks, finder: BlockFinder::new(blocks), assignments }
    }

    /// Of each of the fields the mean of the values of each component at each of the places; components beyond its own are 0.
    pub fn at(&self, fields: &[Vec<FieldMoments>], places: &[[f64; 3]]) -> Vec<Vec<[f64; 3]>> {
        let mut means = vec![vec![[0.0; 3]; places.len()]; fields.first().map_or(0, Vec::len)];
        for (number, at) in self.finder.sorted(places).iter().enumerate() {
            let g = &self.blocks[number].gaussians;
            let shares = self.assignments[number].shares(&at.iter().map(|i| places[*i]).collect::<Vec<_>>());
            for (i, s) in (0..g.len()).flat_map(|i| shares.of(i).map(move |s| (i, s))) {
                let place = at[shares.particle(s)];
                let d = each_axis(|k| places[place][k] - g.mean[k][i]);
                let share = f64::from(shares.share[s]);
                for (means, moments) in means.iter_mut().zip(&fields[number]) {
                    for (c, [least, largest]) in moments.range.iter().enumerate() {
                        let value = moments.value_at(c, i, d);
                        // Slopes of few particles reach far: values that are drawn stay within the range, too.
                        let value = if moments.excess.is_some() { value } else { value.clamp(*least, *largest) };
                        means[place][c] += share * value;
                    }
                }
            }
        }
        means
    }
}

/// Sums over a block's particles, Gaussian by Gaussian.
struct BlockFieldSums<'a> {
    block: &'a Block,
    assignment: SoftAssignment,
    fields: Vec<FieldSums>,
}

/// Sums of one field.
struct FieldSums {
    components: usize,
    logarithmic: bool,
    share: bool,
    /// The first of its columns.
    column: usize,
    /// A row for each Gaussian: number and weight; weighted place from the mean and its products; values, products of
    /// values with places, products of values; where these are logarithms, products of the values themselves with places
    /// and with themselves, and the values themselves.
    rows: Vec<f64>,
    totals: FieldTotals,
    /// Densities by the moments of the pass before, one a Gaussian; empty in the first pass.
    likelihoods: Vec<FieldLikelihood>,
}

/// The logarithm of a field's density given the place.
#[derive(Clone, Copy)]
struct FieldLikelihood {
    mean: [f64; 3],
    slope: [[f64; 3]; 3],
    inverse: Sym3,
    log: f64,
}

/// Sums over particles of a block, whichever Gaussians they belong to.
#[derive(Clone, Copy)]
struct FieldTotals {
    /// Weighted sum, least and largest value of each component.
    all: [[f64; 3]; 3],
    /// Weights of all particles, and of those that have a value.
    weights: [f64; 2],
}

impl FieldTotals {
    const NONE: FieldTotals = FieldTotals { all: [[0.0, f64::INFINITY, f64::NEG_INFINITY]; 3], weights: [0.0; 2] };

    fn add(&mut self, other: &FieldTotals) {
        for (a, b) in self.all.iter_mut().zip(&other.all) {
            *a = [a[0] + b[0], a[1].min(b[1]), a[2].max(b[2])];
        }
        (0..2).for_each(|k| self.weights[k] += other.weights[k]);
    }
}

/// A run's particles that have values, in the order of their shares, and these.
struct FieldRun {
    shares: PlaceShares,
    /// Of each share the particle's place from the Gaussian's mean.
    offset: [Vec<f32>; 3],
    weight: Vec<f64>,
    /// 0 where there is none.
    values: Vec<Vec<f64>>,
    /// Of each field 0 where a particle has a value and NaN where it has none; empty where all have one.
    lacking: Vec<Vec<f64>>,
    /// Number of particles that each stands for; empty where that is one.
    number: Vec<f64>,
    /// Of all the run's particles, for each field.
    totals: Vec<FieldTotals>,
    block: usize,
    /// All of the run.
    particles: usize,
}

impl FieldRun {
    fn new(run: BlockRun, blocks: &[BlockFieldSums<'_>]) -> FieldRun {
        let BlockFieldSums { block, assignment, fields } = &blocks[run.block];
        let BlockRun { mut place, weight, mut values, .. } = run;
        let particles = place.len();
        let totals = fields.iter().map(|f| f.totals_of(&values, &weight)).collect();
        let has_value = |i: &usize| fields.iter().any(|f| !values[f.column][*i].is_nan());
        let valued: Vec<usize> = (0..particles).filter(has_value).collect();
        if valued.len() < particles {
            place = valued.iter().map(|i| place[*i]).collect();
        }
        let shares = assignment.shares(&place);
        let g = &block.gaussians;
        let mut offset = [(); 3].map(|()| Vec::with_capacity(shares.particle.len()));
        for (i, s) in (0..g.len()).flat_map(|i| shares.of(i).map(move |s| (i, s))) {
            let place = place[shares.particle(s)];
            (0..3).for_each(|k| offset[k].push((place[k] - g.mean[k][i]) as f32));
        }
        let sorted = |column: Vec<f64>| shares.order.iter().map(|i| column[valued[*i as usize]]).collect::<Vec<f64>>();
        // Particles that stand for several have one column more.
        let columns = fields.last().map_or(0, |f| f.column + f.components + usize::from(f.logarithmic));
        let number = values.split_off(columns).pop().map_or(Vec::new(), sorted);
        let (weight, mut values) = (sorted(weight), values.into_iter().map(sorted).collect::<Vec<_>>());
        let lacking = |field: &FieldSums| {
            let marks: Vec<f64> = values[field.column].iter().map(|v| 0.0 * v).collect();
            if marks.iter().any(|mark| mark.is_nan()) { marks } else { Vec::new() }
        };
        let lacking = fields.iter().map(lacking).collect();
        // No NaN must reach the sums.
        values.iter_mut().flatten().filter(|v| v.is_nan()).for_each(|v| *v = 0.0);
        FieldRun { offset, weight, values, lacking, number, totals, block: run.block, particles, shares }
    }

    fn bytes(&self) -> usize {
        let numbers: usize = self.values.iter().chain(&self.lacking).map(Vec::len).sum();
        let shares = 5 * size_of_val(&self.shares.particle[..]) + 4 * self.shares.order.len();
        shares + 8 * (numbers + self.weight.len() + self.number.len())
    }

    /// Shares by place, times how likely each particle's value of a field is in the Gaussian, scaled to a sum of 1 for
    /// each particle; 0 without a value.
    fn weighed(&self, number: usize, field: &FieldSums, simd: Level) -> Vec<f32> {
        let mut logs = match &self.lacking[number][..] {
            [] => vec![0.0; self.shares.particle.len()],
            lacking => self.shares.particle.iter().map(|p| lacking[*p as usize]).collect(),
        };
        dispatch!(simd, simd => match field.components {
            1 => self.log_likelihoods::<_, 1>(simd, field, &mut logs),
            _ => self.log_likelihoods::<_, 3>(simd, field, &mut logs),
        });
        self.shares.weighed(&logs, simd)
    }

    /// Adds the logarithms of how likely values are in the Gaussians, given the places, for each share.
    #[inline(always)]
    fn log_likelihoods<S: Simd, const C: usize>(&self, simd: S, field: &FieldSums, logs: &mut [f64]) {
        for (i, l) in field.likelihoods.iter().enumerate() {
            let range = self.shares.of(i);
            for start in range.clone().step_by(LANES) {
                let vector = ShareVector::<S, C>::new(simd, self, field.column, start..range.end.min(start + LANES));
                let mut off = vector.value;
                for (k, off) in off.iter_mut().enumerate() {
                    let [x, y, z] = l.slope[k];
                    *off -= vector.place[0] * x + vector.place[1] * y + vector.place[2] * z + l.mean[k];
                }
                let log = if field.share {
                    let value = <[f64; LANES]>::from(vector.value[0]);
                    let predicted = <[f64; LANES]>::from(vector.value[0] - off[0]);
                    // What is left of the value tells how likely the class is here.
                    std::array::from_fn(|lane| {
                        let p = predicted[lane].clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
                        libm::log(value[lane] * p + (1.0 - value[lane]) * (1.0 - p))
                    })
                } else {
                    let [xx, xy, xz, yy, yz, zz] = l.inverse.0;
                    let mut square = off[0] * off[0] * xx;
                    if C == 3 {
                        square += off[1] * off[1] * yy + off[2] * off[2] * zz;
                        square += (off[0] * off[1] * xy + off[0] * off[2] * xz + off[1] * off[2] * yz) * 2.0;
                    }
                    <[f64; LANES]>::from(f64x8::splat(simd, l.log) - square * 0.5)
                };
                let logs = &mut logs[start..range.end.min(start + LANES)];
                logs.iter_mut().zip(log).for_each(|(sum, log)| *sum += log);
            }
        }
    }

    /// Adds the shares of a Gaussian, `weighed` by a field, to its row.
    #[inline(always)]
    fn add_to<S: Simd, const C: usize>(
        &self,
        simd: S,
        (gaussian, weighed): (usize, &[f32]),
        (column, logarithmic): (usize, bool),
        row: &mut [f64],
    ) {
        let range = self.shares.of(gaussian);
        let zero = f64x8::splat(simd, 0.0);
        let mut total = [zero; MOST_TERMS];
        for start in range.clone().step_by(LANES) {
            let lanes = start..range.end.min(start + LANES);
            let particle = &self.shares.particle[lanes.clone()];
            let share = loaded(simd, &weighed[lanes.clone()]);
            let ShareVector { place, value } = ShareVector::<S, C>::new(simd, self, column, lanes);
            let w = share * gathered(simd, &self.weight, particle);
            total[0] += if self.number.is_empty() { share } else { share * gathered(simd, &self.number, particle) };
            total[1] += w;
            let weighed_place = [w * place[0], w * place[1], w * place[2]];
            let mut product = 5;
            for a in 0..3 {
                total[2 + a] += weighed_place[a];
                for b in a..3 {
                    total[product] += weighed_place[a] * place[b];
                    product += 1;
                }
            }
            product = 11 + 4 * C;
            for a in 0..C {
                total[11 + a] += w * value[a];
                for k in 0..3 {
                    total[11 + C + 3 * a + k] += weighed_place[k] * value[a];
                }
                for b in a..C {
                    total[product] += w * value[a] * value[b];
                    product += 1;
                }
            }
            if logarithmic {
                let values = gathered(simd, &self.values[column + 1], particle);
                let weighed_values = w * values;
                for k in 0..3 {
                    total[product + k] += weighed_values * place[k];
                }
                total[product + 3] += weighed_values * values;
                total[product + 4] += weighed_values;
            }
        }
        for (sum, lanes) in row.iter_mut().zip(total) {
            *sum += <[f64; LANES]>::from(lanes).iter().sum::<f64>();
        }
    }
}

/// Shares in one vector.
const LANES: usize = 8;
/// Numbers of a row at most: those of a vector field.
const MOST_TERMS: usize = 11 + 4 * 3 + 6;

/// Shares of a Gaussian side by side: places from its mean, and values. Those beyond the last are 0.
struct ShareVector<S: Simd, const C: usize> {
    place: [f64x8<S>; 3],
    value: [f64x8<S>; C],
}

impl<S: Simd, const C: usize> ShareVector<S, C> {
    #[inline(always)]
    fn new(simd: S, run: &FieldRun, column: usize, shares: Range<usize>) -> Self {
        let particle = &run.shares.particle[shares.clone()];
        let [x, y, z] = &run.offset;
        let at = |axis: &[f32]| loaded(simd, &axis[shares.clone()]);
        // Loops and no closures of arrays, which would not be part of the vector function.
        let mut value = [f64x8::splat(simd, 0.0); C];
        for (k, value) in value.iter_mut().enumerate() {
            *value = gathered(simd, &run.values[column + k], particle);
        }
        ShareVector { place: [at(x), at(y), at(z)], value }
    }
}

#[inline(always)]
fn loaded<S: Simd>(simd: S, values: &[f32]) -> f64x8<S> {
    lanes(simd, values.len(), |i| f64::from(values[i]))
}

#[inline(always)]
fn gathered<S: Simd>(simd: S, values: &[f64], at: &[u32]) -> f64x8<S> {
    lanes(simd, at.len(), |i| values[at[i] as usize])
}

#[inline(always)]
fn lanes<S: Simd>(simd: S, len: usize, value: impl Fn(usize) -> f64) -> f64x8<S> {
    let mut lanes = [0.0; LANES];
    if len == LANES {
        for (i, lane) in lanes.iter_mut().enumerate() {
            *lane = value(i);
        }
    } else {
        for (i, lane) in lanes.iter_mut().enumerate().take(len) {
            *lane = value(i);
        }
    }
    f64x8::load_array_ref(simd, &lanes)
}

impl FieldSums {
    fn width(&self) -> usize {
        let of_values = if self.logarithmic { 5 } else { 0 };
        11 + 4 * self.components + self.components * (self.components + 1) / 2 + of_values
    }

    /// Sums over particles of their values.
    fn totals_of(&self, values: &[Vec<f64>], weight: &[f64]) -> FieldTotals {
        let mut totals = FieldTotals::NONE;
        for (k, all) in totals.all.iter_mut().enumerate().take(self.components) {
            let values_of = &values[self.column + k];
            // Sums are of values, not of their logarithms.
            let summed = if self.logarithmic { &values[self.column + 1] } else { values_of };
            for ((value, summed), weight) in values_of.iter().zip(summed).zip(weight).filter(|v| !v.0.0.is_nan()) {
                *all = [all[0] + weight * summed, all[1].min(*value), all[2].max(*value)];
            }
        }
        let first = values[self.column].iter().zip(weight);
        totals.weights = [weight.iter().sum(), first.filter(|v| !v.0.is_nan()).map(|v| v.1).sum()];
        totals
    }
}

impl<'a> BlockFieldSums<'a> {
    fn new(block: &'a Block, fields: &[FieldShape<'_>], context: &Context<'_>) -> Self {
        let mut column = 0;
        let fields = fields.iter().map(|shape| {
            let (c, logarithmic) = (shape.components, shape.logarithmic);
            let mut field = FieldSums {
                components: c,
                logarithmic,
                share: shape.share,
                column,
                rows: Vec::new(),
                totals: FieldTotals::NONE,
                likelihoods: Vec::new(),
            };
            field.rows.resize(field.width() * block.gaussians.len(), 0.0);
            column += shape.columns();
            field
        });
        let assignment = SoftAssignment::new(&block.gaussians, context.simd());
        BlockFieldSums { block, assignment, fields: fields.collect() }
    }

    fn add(&mut self, batch: &[&(Arc<FieldRun>, Vec<Vec<f32>>)], simd: Level) {
        for (index, field) in self.fields.iter_mut().enumerate() {
            let (width, components, read) = (field.width(), field.components, (field.column, field.logarithmic));
            parallel::for_each_chunk(&mut field.rows, width * RANGE, |task, rows| {
                for (run, weighed) in batch {
                    dispatch!(simd, simd => for (i, row) in rows.chunks_exact_mut(width).enumerate() {
                        let gaussian = (task * RANGE + i, &weighed[index][..]);
                        match components {
                            1 => run.add_to::<_, 1>(simd, gaussian, read, row),
                            _ => run.add_to::<_, 3>(simd, gaussian, read, row),
                        }
                    });
                }
            });
        }
    }

    fn add_totals(&mut self, totals: &[FieldTotals]) {
        self.fields.iter_mut().zip(totals).for_each(|(field, totals)| field.totals.add(totals));
    }

    /// Turns the sums into likelihoods, and begins new sums.
    fn next_pass(&mut self) {
        for field in &mut self.fields {
            let moments = field.moments(&self.block.gaussians);
            field.likelihoods = (0..self.block.gaussians.len()).map(|i| FieldLikelihood::new(&moments, i)).collect();
            field.rows.fill(0.0);
        }
    }

    fn finish(self) -> Vec<BlockField> {
        let finish = |field: FieldSums| {
            let mut moments = field.moments(&self.block.gaussians);
            // A block without particles has no range.
            let range = |a: &[f64; 3]| if a[1] <= a[2] { [a[1], a[2]] } else { [0.0; 2] };
            let FieldTotals { all, weights: [whole_weight, valued_weight] } = field.totals;
            let all = &all[..field.components];
            moments.range = all.iter().map(range).collect();
            let scale = if valued_weight > 0.0 { whole_weight / valued_weight } else { 1.0 };
            BlockField { moments, sums: all.iter().map(|a| scale * a[0]).collect() }
        };
        self.fields.into_iter().map(finish).collect()
    }
}

impl FieldLikelihood {
    fn new(m: &FieldMoments, i: usize) -> Self {
        let components = m.components();
        let (inverse, det) = match components {
            1 => {
                let variance = m.spread[0][i].max(1e-300);
                (Sym3([1.0 / variance, 0.0, 0.0, 0.0, 0.0, 0.0]), variance)
            }
            _ => {
                let spread = Sym3(std::array::from_fn(|k| m.spread[k][i]));
                let sound = spread.add(&Sym3::scaled_identity(LEAST_SPREAD * spread.trace() + 1e-100));
                (sound.inverse().unwrap_or(Sym3::scaled_identity(0.0)), sound.det())
            }
        };
        let log = -0.5 * libm::log(det.max(f64::MIN_POSITIVE));
        let mut out = FieldLikelihood { mean: [0.0; 3], slope: [[0.0; 3]; 3], inverse, log };
        for k in 0..components {
            out.mean[k] = m.mean[k][i];
            out.slope[k] = each_axis(|a| m.slope[k][a][i]);
        }
        out
    }
}

impl FieldSums {
    fn moments(&self, g: &Mixture) -> FieldMoments {
        let (components, at) = (self.components, 11);
        let rows = || self.rows.chunks_exact(self.width());
        let products = components * (components + 1) / 2;
        // Means over all, for Gaussians without particles, and the mean spread.
        // Where no particle has a value, all moments are 0.
        let total = rows().map(|r| r[1]).sum::<f64>().max(f64::MIN_POSITIVE);
        let overall: Vec<f64> = (0..components).map(|a| rows().map(|r| r[at + a]).sum::<f64>() / total).collect();
        let mut spreads = vec![0.0; products];
        let mut out = if self.logarithmic { FieldMoments::logarithmic() } else { FieldMoments::new(components) };
        let mut regressions = Vec::with_capacity(g.len());
        for (i, row) in rows().enumerate() {
            let regression = Regression::new(row, at, (components, self.logarithmic), &g.cov_of(i));
            if let Some(f) = &regression {
                spreads.iter_mut().zip(&f.spread).for_each(|(s, v)| *s += row[1] * v);
            }
            regressions.push(regression);
        }
        spreads.iter_mut().for_each(|s| *s /= total);
        // In a second loop, as the mean spread is known only after all Gaussians.
        for (i, (row, regression)) in rows().zip(regressions).enumerate() {
            let f = regression.unwrap_or_else(|| Regression {
                mean: overall.clone(),
                slope: vec![[0.0; 3]; components],
                spread: spreads.clone(),
            });
            let share = row[0] / (row[0] + SPREAD_PRIOR);
            for a in 0..components {
                out.mean[a].push(f.mean[a]);
                (0..3).for_each(|k| out.slope[a][k].push(f.slope[a][k]));
            }
            for (k, column) in out.spread.iter_mut().enumerate() {
                column.push(share * f.spread[k] + (1.0 - share) * spreads[k]);
            }
            if let Some(column) = &mut out.excess {
                // Above log-normal values of the spread that is stored, not of that of the particles alone.
                let variance = out.spread[0].last().copied().unwrap_or(0.0);
                column.push(share * excess(row, &f, variance, &g.cov_of(i)));
            }
        }
        out
    }
}

/// Excess of the logarithm of the values' mean over that of log-normal values in a Gaussian of covariance `cov`; 0
/// without particles.
fn excess(row: &[f64], f: &Regression, variance: f64, cov: &Sym3) -> f64 {
    let (w, sum) = (row[1], row[row.len() - 1]);
    if w <= 0.0 || sum <= 0.0 {
        return 0.0;
    }
    libm::log(sum / w) - f.mean[0] - 0.5 * (variance + cov.quadratic(f.slope[0]).max(0.0))
}

/// Mean, slope and spread of one Gaussian's particles.
struct Regression {
    mean: Vec<f64>,
    slope: Vec<[f64; 3]>,
    spread: Vec<f64>,
}

impl Regression {
    /// `None` without particles. Across a Gaussian of covariance `cov_of_all` slopes explain no more than a part of the
    /// variance: those of few particles that lie close together would reach far.
    fn new(row: &[f64], at: usize, (c, logarithmic): (usize, bool), cov_of_all: &Sym3) -> Option<Regression> {
        let (number, w) = (row[0], row[1]);
        if number < 1e-3 || w <= 0.0 {
            return None;
        }
        let place: [f64; 3] = each_axis(|k| row[2 + k] / w);
        let outer = Sym3::outer(place);
        let cov = Sym3(std::array::from_fn(|k| row[5 + k] / w - outer.0[k]));
        let mean: Vec<f64> = (0..c).map(|a| row[at + a] / w).collect();
        // A slope along an axis without extent means nothing: some of the trace keeps the inverse finite.
        let inverse = cov.add(&Sym3::scaled_identity(1e-6 * cov.trace() + 1e-300)).inverse();
        // Of logarithms the slope puts the centre of the values where the particles have it: exp(g x) moves a normal
        // distribution of covariance C by C g. Of two phases the slope of the logarithms would move it much further.
        let of_values = row.last_chunk::<5>().filter(|[.., sum]| logarithmic && *sum > 0.0);
        let counted = of_values.map_or(number, |[.., square, sum]| number * sum * sum / (w * square));
        let shrink = counted / (counted + SLOPE_PRIOR);
        let slope: Vec<[f64; 3]> = (0..c)
            .map(|a| {
                let place_covariance: [f64; 3] = match of_values {
                    Some([x, y, z, _, sum]) => each_axis(|k| [x, y, z][k] / sum - place[k]),
                    None => each_axis(|k| row[at + c + 3 * a + k] / w - mean[a] * place[k]),
                };
                let slope = inverse.map_or([0.0; 3], |i| i.apply(place_covariance).map(|v| v * shrink));
                let explained = cov_of_all.quadratic(slope);
                let variance = row[at + 4 * c + a * (2 * c - a + 1) / 2] / w - mean[a] * mean[a];
                let most = if logarithmic { MOST_EXPLAINED_OF_LOGARITHMS } else { 1.0 } * variance.max(0.0);
                let scale = if explained > most { (most / explained).sqrt() } else { 1.0 };
                slope.map(|v| v * scale)
            })
            .collect();
        // Covariances of what the slopes leave: as slopes are shrunk, the mixed terms do not cancel.
        let mut spread = Vec::new();
        let mut product = at + 4 * c;
        for a in 0..c {
            for b in a..c {
                let pair_covariance = row[product] / w - mean[a] * mean[b];
                let explained: [f64; 3] = cov.apply(slope[b]);
                let place_term = |s: [f64; 3], a: usize| -> f64 {
                    (0..3).map(|k| s[k] * (row[at + c + 3 * a + k] / w - mean[a] * place[k])).sum()
                };
                let slope_covariance: f64 = (0..3).map(|k| slope[a][k] * explained[k]).sum();
                spread.push(pair_covariance - place_term(slope[a], b) - place_term(slope[b], a) + slope_covariance);
                product += 1;
            }
        }
        // Moments are stated at the Gaussian's mean, from which the particles' mean place differs by `place`.
        let at_mean = (0..c).map(|a| mean[a] - (0..3).map(|k| slope[a][k] * place[k]).sum::<f64>()).collect();
        Some(Regression { mean: at_mean, slope, spread })
    }
}

//! Moments of what particles carry, gathered for the Gaussians of a decoded model in one pass over the particles.

use super::assignment::SoftAssignment;
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{Block, FieldMoments, Mixture, Quantity, QuantityKind};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{ChunkBuffer, Particles, RUN};
use std::ops::Range;
use std::sync::Arc;

/// Runs of particles that wait together.
const RUNS: usize = 16;
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
/// Bytes of shares by place that are held from pass to pass: as much as refinement held before.
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

/// The block whose bounds a place lies in.
pub(super) fn block_of(bounds: &[Bounds], x: [f64; 3]) -> usize {
    let within = |b: &Bounds| (0..3).all(|k| b.min[k] <= x[k] && x[k] <= b.max[k]);
    if bounds.len() == 1 { 0 } else { bounds.iter().position(within).unwrap_or(0) }
}

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
    let columns: usize = fields.iter().map(FieldShape::columns).sum();
    let mut sums: Vec<BlockFieldSums> = blocks.iter().map(|b| BlockFieldSums::new(b, fields)).collect();
    let bounds: Vec<Bounds> = blocks.iter().map(|b| b.bounds).collect();
    let runs = particles.len().div_ceil(RUN);
    let mut cached_shares: Vec<Option<Arc<PlaceShares>>> = vec![None; runs];
    let mut bytes_left = HELD;
    context.begin("fields", (PASSES * particles.len()) as u64);
    for pass in 0..PASSES {
        for first in (0..runs).step_by(RUNS) {
            let batch: Vec<RunShares> = parallel::try_map(first..runs.min(first + RUNS), |run_number| {
                context.check()?;
                let range = run_number * RUN..particles.len().min((run_number + 1) * RUN);
                let mut values = Vec::new();
                read(run_number as u64, &mut values)?;
                // Particles that stand for several have one column more.
                let expected = [columns, columns + 1].contains(&values.len());
                if !expected || values.iter().any(|v| v.len() != range.len()) {
                    return Err(Error::input(
                        "fields",
                        "a field has another number of values than there are particles",
                    ));
                }
                check_finite(fields, &values, range.start)?;
                let number = values.split_off(columns).pop().unwrap_or_default();
                let run = RunValues { values, number, ..RunValues::new(particles, range) };
                let place = cached_shares[run_number].clone();
                let place = place.unwrap_or_else(|| Arc::new(PlaceShares::new(&run, &bounds, &sums)));
                Ok(RunShares::new(place, run, &sums))
            })?;
            // Shares by place are the same in every pass: those that fit into the bound are kept for the next.
            for (entry, shares) in cached_shares[first..].iter_mut().zip(&batch).filter(|(entry, _)| entry.is_none()) {
                let bytes = shares.place.bytes();
                if bytes <= bytes_left {
                    bytes_left -= bytes;
                    *entry = Some(shares.place.clone());
                }
            }
            // Every row adds the runs in their order, so that sums do not depend on threads.
            for (number, block) in sums.iter_mut().enumerate() {
                block.add(number as u32, &batch);
            }
            context.advance(batch.iter().map(|r| r.run.weight.len() as u64).sum());
        }
        if pass + 1 < PASSES {
            sums.iter_mut().for_each(BlockFieldSums::next_pass);
        }
    }
    context.end();
    Ok(sums.into_iter().map(BlockFieldSums::finish).collect())
}

/// Refuses values that are no numbers; `first` is the particle of the first.
fn check_finite(fields: &[FieldShape<'_>], values: &[Vec<f64>], first: usize) -> Result<()> {
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
    bounds: Vec<Bounds>,
    assignments: Vec<SoftAssignment>,
}

impl<'a> FieldMeans<'a> {
    /// Of blocks.
    pub fn new(blocks: &'a [Block]) -> Self {
        let assignments = blocks.iter().map(|b| SoftAssignment::new(&b.gaussians)).collect();
        FieldMeans { blocks, bounds: blocks.iter().map(|b| b.bounds).collect(), assignments }
    }

    /// The mean of each component at a place, of the field number `field` in each block; `shares` is scratch space.
    pub fn at(&self, fields: &[Vec<BlockField>], field: usize, x: [f64; 3], shares: &mut Vec<(u32, f64)>) -> [f64; 3] {
        let number = block_of(&self.bounds, x);
        self.assignments[number].shares(x, shares);
        let (g, moments) = (&self.blocks[number].gaussians, &fields[number][field].moments);
        let mut mean = [0.0; 3];
        for &(i, share) in shares.iter() {
            let d = each_axis(|k| x[k] - g.mean[k][i as usize]);
            // Slopes of few particles reach far: values that are drawn stay within the range, too.
            for (c, [least, largest]) in moments.range.iter().enumerate() {
                mean[c] += share * moments.mean_at(c, i as usize, d).clamp(*least, *largest);
            }
        }
        mean
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
    /// values with places, products of values; the values themselves where these are logarithms.
    rows: Vec<f64>,
    /// Weighted sum, least and largest value of each component.
    all: Vec<[f64; 3]>,
    /// Weights of all particles, and of those that have a value.
    weights: [f64; 2],
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

/// Places, weights and values of a run's particles.
struct RunValues {
    position: [Vec<f64>; 3],
    weight: Vec<f64>,
    values: Vec<Vec<f64>>,
    /// Number of particles that each stands for; empty where that is one.
    number: Vec<f64>,
}

/// A particle's share of a Gaussian.
struct PlaceShare {
    block: u32,
    gaussian: u32,
    /// Of the run.
    particle: u32,
    share: f32,
}

/// Shares of a run's particles by their places.
struct PlaceShares {
    /// By block, Gaussian, particle.
    shares: Vec<PlaceShare>,
    /// The block of each particle.
    block: Vec<u32>,
}

/// Shares of a run's particles by their places and values.
struct RunShares {
    place: Arc<PlaceShares>,
    run: RunValues,
    /// For each field, one for each of the shares by place.
    shares: Vec<Vec<f32>>,
}

impl RunValues {
    fn new(particles: &Particles, range: Range<usize>) -> Self {
        let mut buffer = ChunkBuffer::default();
        let chunk = particles.chunk(range.clone(), &mut buffer);
        let position = [0, 1, 2].map(|k| {
            let origin = particles.origin[k];
            chunk.position[k].iter().map(|&v| origin + f64::from(v)).collect::<Vec<f64>>()
        });
        let weight = match chunk.weight {
            Some(w) => w.iter().map(|&w| f64::from(w)).collect(),
            None => vec![1.0; range.len()],
        };
        RunValues { position, weight, values: Vec::new(), number: Vec::new() }
    }

    fn place(&self, i: usize) -> [f64; 3] {
        each_axis(|k| self.position[k][i])
    }
}

impl PlaceShares {
    /// Of particles that have a value of some field.
    fn new(run: &RunValues, bounds: &[Bounds], blocks: &[BlockFieldSums<'_>]) -> Self {
        let particles = run.weight.len();
        let (mut shares, mut particle_shares) = (Vec::with_capacity(3 * particles), Vec::new());
        let mut block = Vec::with_capacity(particles);
        for i in 0..particles {
            let x = run.place(i);
            let number = block_of(bounds, x);
            block.push(number as u32);
            if !blocks[number].fields.iter().any(|f| f.has_value(run, i)) {
                continue;
            }
            blocks[number].assignment.shares(x, &mut particle_shares);
            let entry = |&(gaussian, share): &(u32, f64)| PlaceShare {
                block: number as u32,
                gaussian,
                particle: i as u32,
                share: share as f32,
            };
            shares.extend(particle_shares.iter().map(entry));
        }
        shares.sort_unstable_by_key(|s| (s.block, s.gaussian, s.particle));
        shares.shrink_to_fit();
        PlaceShares { shares, block }
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.shares[..]) + size_of_val(&self.block[..])
    }
}

impl RunShares {
    fn new(place: Arc<PlaceShares>, run: RunValues, blocks: &[BlockFieldSums<'_>]) -> Self {
        let fields = blocks.first().map_or(0, |b| b.fields.len());
        let shares = (0..fields).map(|field| weighed(&place, &run, blocks, field)).collect();
        RunShares { place, run, shares }
    }
}

/// Shares by place, times how likely each particle's value of a field is in the Gaussian, scaled to a sum of 1 for each
/// particle; 0 without a value.
fn weighed(place: &PlaceShares, run: &RunValues, blocks: &[BlockFieldSums<'_>], field: usize) -> Vec<f32> {
    let likelihood = |s: &PlaceShare| {
        let (block, i) = (&blocks[s.block as usize], s.particle as usize);
        let field_sums = &block.fields[field];
        if field_sums.has_value(run, i) {
            field_sums.log_likelihood(&block.block.gaussians, s.gaussian as usize, run, i)
        } else {
            f64::NEG_INFINITY
        }
    };
    let mut logs: Vec<f64> = place.shares.iter().map(likelihood).collect();
    // Relative to a particle's largest: a value far from all Gaussians would have densities of 0.
    let mut largest = vec![f64::NEG_INFINITY; run.weight.len()];
    let mut sum = vec![0.0; run.weight.len()];
    for (s, log) in place.shares.iter().zip(&logs) {
        let largest = &mut largest[s.particle as usize];
        *largest = largest.max(*log);
    }
    for (s, log) in place.shares.iter().zip(&mut logs) {
        let i = s.particle as usize;
        *log = if *log > f64::NEG_INFINITY { f64::from(s.share) * libm::exp(*log - largest[i]) } else { 0.0 };
        sum[i] += *log;
    }
    let scaled_share =
        |(s, part): (&PlaceShare, f64)| if part > 0.0 { (part / sum[s.particle as usize]) as f32 } else { 0.0 };
    place.shares.iter().zip(logs).map(scaled_share).collect()
}

impl FieldSums {
    fn width(&self) -> usize {
        11 + 4 * self.components + self.components * (self.components + 1) / 2 + usize::from(self.logarithmic)
    }

    fn has_value(&self, run: &RunValues, i: usize) -> bool {
        !run.values[self.column][i].is_nan()
    }

    /// The logarithm of how likely a particle's value is in a Gaussian, given its place; 0 in the first pass.
    fn log_likelihood(&self, g: &Mixture, gaussian: usize, run: &RunValues, i: usize) -> f64 {
        let Some(l) = self.likelihoods.get(gaussian) else { return 0.0 };
        let d: [f64; 3] = each_axis(|k| run.position[k][i] - g.mean[k][gaussian]);
        let mut off = [0.0; 3];
        for (k, off) in off.iter_mut().enumerate().take(self.components) {
            *off = run.values[self.column + k][i] - l.mean[k] - (0..3).map(|a| l.slope[k][a] * d[a]).sum::<f64>();
        }
        if self.share {
            // What is left of the value tells how likely the class is here.
            let value = run.values[self.column][i];
            let p = (value - off[0]).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE);
            return libm::log(value * p + (1.0 - value) * (1.0 - p));
        }
        let square: f64 = l.inverse.apply(off).iter().zip(off).map(|(a, b)| a * b).sum();
        l.log - 0.5 * square
    }
}

impl<'a> BlockFieldSums<'a> {
    fn new(block: &'a Block, fields: &[FieldShape<'_>]) -> Self {
        let mut column = 0;
        let fields = fields.iter().map(|shape| {
            let (c, logarithmic) = (shape.components, shape.logarithmic);
            let all = vec![[0.0, f64::INFINITY, f64::NEG_INFINITY]; c];
            let mut field = FieldSums {
                components: c,
                logarithmic,
                share: shape.share,
                column,
                rows: Vec::new(),
                all,
                weights: [0.0; 2],
                likelihoods: Vec::new(),
            };
            field.rows.resize(field.width() * block.gaussians.len(), 0.0);
            column += shape.columns();
            field
        });
        BlockFieldSums { block, assignment: SoftAssignment::new(&block.gaussians), fields: fields.collect() }
    }

    fn add(&mut self, number: u32, batch: &[RunShares]) {
        let g = &self.block.gaussians;
        for (index, field) in self.fields.iter_mut().enumerate() {
            let (width, c, column, logarithmic) = (field.width(), field.components, field.column, field.logarithmic);
            parallel::for_each_chunk(&mut field.rows, width * RANGE, |task, rows| {
                let first = (task * RANGE) as u32;
                for batch in batch {
                    let (run, all) = (&batch.run, &batch.place.shares);
                    let place = |gaussian: u32| all.partition_point(|s| (s.block, s.gaussian) < (number, gaussian));
                    // Shares are sorted by block and Gaussian: those of this task are one range.
                    let share_range = place(first)..place(first + (rows.len() / width) as u32);
                    for (s, &share) in all[share_range.clone()].iter().zip(&batch.shares[index][share_range]) {
                        // Particles without a value have no share: their NaN must not reach the sums.
                        if share == 0.0 {
                            continue;
                        }
                        let row = &mut rows[(s.gaussian - first) as usize * width..][..width];
                        let (i, p) = (s.gaussian as usize, s.particle as usize);
                        let w = f64::from(share) * run.weight[p];
                        let d: [f64; 3] = each_axis(|k| run.position[k][p] - g.mean[k][i]);
                        // Eleven numbers before the values: number, weight, place (3) and its products (6).
                        row[0] += f64::from(share) * run.number.get(p).copied().unwrap_or(1.0);
                        row[1] += w;
                        (0..3).for_each(|k| row[2 + k] += w * d[k]);
                        let outer = Sym3::outer(d);
                        (0..6).for_each(|k| row[5 + k] += w * outer.0[k]);
                        for a in 0..c {
                            let q = run.values[column + a][p];
                            row[11 + a] += w * q;
                            (0..3).for_each(|k| row[11 + c + 3 * a + k] += w * q * d[k]);
                        }
                        let mut product = 11 + 4 * c;
                        for a in 0..c {
                            for b in a..c {
                                row[product] += w * run.values[column + a][p] * run.values[column + b][p];
                                product += 1;
                            }
                        }
                        if logarithmic {
                            row[product] += w * run.values[column + 1][p];
                        }
                    }
                }
            });
            // The first pass has seen them all.
            for RunShares { run, place, .. } in batch.iter().filter(|_| field.likelihoods.is_empty()) {
                for (k, all) in field.all.iter_mut().enumerate() {
                    let values = &run.values[column + k];
                    // Sums are of values.
                    let summed = if logarithmic { &run.values[column + 1] } else { values };
                    let block_particles = (0..values.len()).filter(|&i| place.block[i] == number);
                    for (v, q, w) in block_particles.map(|i| (values[i], summed[i], run.weight[i])) {
                        if k == 0 {
                            field.weights[0] += w;
                            field.weights[1] += if v.is_nan() { 0.0 } else { w };
                        }
                        if v.is_nan() {
                            continue;
                        }
                        all[0] += w * q;
                        (all[1], all[2]) = (all[1].min(v), all[2].max(v));
                    }
                }
            }
        }
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
            moments.range = field.all.iter().map(range).collect();
            let [whole_weight, valued_weight] = field.weights;
            let scale = if valued_weight > 0.0 { whole_weight / valued_weight } else { 1.0 };
            BlockField { moments, sums: field.all.iter().map(|a| scale * a[0]).collect() }
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
            let most = if self.logarithmic { MOST_EXPLAINED_OF_LOGARITHMS } else { 1.0 };
            let regression = Regression::new(row, at, components, (&g.cov_of(i), most));
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
    /// `None` without particles. Across a Gaussian of covariance `cov` slopes explain no more than this part of the
    /// variance: those of few particles that lie close together would reach far.
    fn new(row: &[f64], at: usize, c: usize, (cov_of_all, most): (&Sym3, f64)) -> Option<Regression> {
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
        let shrink = number / (number + SLOPE_PRIOR);
        let slope: Vec<[f64; 3]> = (0..c)
            .map(|a| {
                let place_covariance: [f64; 3] = each_axis(|k| row[at + c + 3 * a + k] / w - mean[a] * place[k]);
                let slope = inverse.map_or([0.0; 3], |i| i.apply(place_covariance).map(|v| v * shrink));
                let explained = cov_of_all.quadratic(slope);
                let variance = row[at + 4 * c + a * (2 * c - a + 1) / 2] / w - mean[a] * mean[a];
                let most = most * variance.max(0.0);
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

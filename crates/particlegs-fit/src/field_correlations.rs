//! Correlations between the scalar fields of a decoded model's Gaussians, about their means at each place: one more
//! pass over the particles, after that of [`super::gather`].

use super::assignment::{PlaceShares, SoftAssignment};
use super::block_runs::{BlockFinder, BlockReader, BlockRun};
use super::field_moments::{BlockField, FieldShape, ReadValues};
use fearless_simd::Level;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Block, FieldMoments};
use particlegs_core::{Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::Particles;

/// Scalar fields between which correlations are known: the first.
const MOST: usize = 8;
/// Particles that the block's own correlation counts as.
const PRIOR: f64 = 5.0;
/// Gaussians that one task adds to.
const RANGE: usize = 256;
/// Values are weighed by a spread of no less than this part of the range.
const LEAST_SPREAD: f64 = 1e-6;

/// The correlations of two fields, by their places in the list.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldCorrelation {
    /// The two fields.
    pub fields: [usize; 2],
    /// One for each Gaussian.
    pub values: Vec<f64>,
}

/// The covariance of two fields, by their places in the list, among the particles that one stands for.
pub type WithinParticle<'a> = dyn Fn(usize, [usize; 2]) -> f64 + Sync + 'a;

/// Of a pair of fields: number and weight; weighted sums of what both differ by from their means, and of the products.
type PairSums = [f64; 7];

/// Gathers the correlations of all pairs of scalars among `fields`, whose moments [`super::gather`] gave for these
/// `blocks` and particles. Gives those of each block. `within` is for particles that stand for several.
pub fn correlations(
    blocks: &[Block],
    particles: &Particles,
    (fields, moments): (&[FieldShape<'_>], &[Vec<BlockField>]),
    read: &ReadValues<'_>,
    within: Option<&WithinParticle<'_>>,
    context: &Context<'_>,
) -> Result<Vec<Vec<FieldCorrelation>>> {
    let scalars: Vec<usize> =
        (0..fields.len()).filter(|&f| fields[f].components == 1 && !fields[f].share).take(MOST).collect();
    let pairs: Vec<[usize; 2]> =
        (0..scalars.len()).flat_map(|b| (0..b).map(move |a| [a, b])).map(|p| p.map(|k| scalars[k])).collect();
    if pairs.is_empty() {
        return Ok(vec![Vec::new(); blocks.len()]);
    }
    let gaussians: usize = blocks.iter().map(|b| b.gaussians.len()).sum();
    require("correlations of fields", (gaussians * pairs.len() * size_of::<PairSums>()) as u64)?;
    let mut first = 0;
    let mut columns = Vec::with_capacity(fields.len());
    for field in fields {
        columns.push(first);
        first += field.columns();
    }
    // Behind the columns of all fields may be that of how many particles each stands for.
    let pass = CorrelationPass {
        blocks,
        assignments: blocks.iter().map(|b| SoftAssignment::new(&b.gaussians, context.simd())).collect(),
        moments,
        scalars: scalars.iter().map(|&f| (f, columns[f])).collect(),
        number: first,
    };
    let mut sums: Vec<Vec<PairSums>> =
        blocks.iter().map(|b| vec![PairSums::default(); pairs.len() * b.gaussians.len()]).collect();
    let reader = BlockReader { particles, fields, read, finder: BlockFinder::new(blocks) };
    context.begin("correlations of fields", particles.len() as u64);
    reader.each_batch(context, |runs| {
        context.advance(runs.iter().map(|run| run.number.len() as u64).sum());
        let batch = parallel::map(runs, |run| pass.residuals(run, context.simd()));
        // Every Gaussian's rows are one task's, which adds the runs in their order: threads change no sum.
        for (block, sums) in sums.iter_mut().enumerate() {
            let block_residuals: Vec<&RunResiduals> = batch.iter().filter(|run| run.block == block).collect();
            parallel::for_each_chunk(sums, pairs.len() * RANGE, |task, rows| {
                block_residuals.iter().for_each(|run| run.add_to(rows, &pairs, task * RANGE, (fields.len(), within)));
            });
        }
        Ok(())
    })?;
    context.end();
    Ok(sums.iter().map(|sums| finished(sums, &pairs)).collect())
}

/// Inputs from which residuals are computed.
struct CorrelationPass<'a> {
    blocks: &'a [Block],
    assignments: Vec<SoftAssignment>,
    moments: &'a [Vec<BlockField>],
    /// The scalars' places in the list, and their columns.
    scalars: Vec<(usize, usize)>,
    /// The column of how many particles each stands for.
    number: usize,
}

/// Shares of a run's particles.
struct RunResiduals {
    block: usize,
    /// The number of each particle among all.
    number: Vec<usize>,
    shares: PlaceShares,
    /// For each share the difference of each field from its mean; NaN where there is no value.
    residuals: Vec<f64>,
    /// For each share the number of particles, and their weight.
    parts: Vec<[f64; 2]>,
}

impl CorrelationPass<'_> {
    fn residuals(&self, run: BlockRun, simd: Level) -> RunResiduals {
        let BlockRun { block, number, place, weight, values } = run;
        let (moments, g) = (&self.moments[block], &self.blocks[block].gaussians);
        let shares = self.assignments[block].shares(&place);
        // NaN stays where a field is no scalar.
        let mut residuals = vec![f64::NAN; moments.len() * shares.particle.len()];
        // Shares by place are weighed by how likely the values are, as in the moments' passes.
        let mut logs = vec![0.0; shares.particle.len()];
        for (j, s) in (0..g.len()).flat_map(|j| shares.of(j).map(move |s| (j, s))) {
            let i = shares.particle(s);
            let d: [f64; 3] = each_axis(|k| place[i][k] - g.mean[k][j]);
            for &(field, column) in &self.scalars {
                let off = values[column][i] - moments[field].moments.mean_at(0, j, d);
                residuals[moments.len() * s + field] = off;
                if !off.is_nan() {
                    logs[s] += log_density(&moments[field].moments, j, off);
                }
            }
        }
        let part = |(s, share): (usize, f32)| {
            let i = shares.particle(s);
            [values.get(self.number).map_or(1.0, |n| n[i]), weight[i]].map(|v| f64::from(share) * v)
        };
        let parts = shares.weighed(&logs, simd).into_iter().enumerate().map(part).collect();
        RunResiduals { block, number, shares, residuals, parts }
    }
}

/// The logarithm of a scalar's density where it differs so much from the mean; 0 of a field that is the same
/// everywhere.
fn log_density(moments: &FieldMoments, i: usize, off: f64) -> f64 {
    let [least, largest] = moments.range[0];
    let floor = (LEAST_SPREAD * (largest - least)).powi(2);
    if floor.is_nan() || floor <= 0.0 {
        return 0.0;
    }
    let variance = moments.spread[0][i].max(floor);
    -0.5 * (libm::log(variance) + off * off / variance)
}

impl RunResiduals {
    /// Adds to the rows of some Gaussians, from the `first` on.
    fn add_to(
        &self,
        rows: &mut [PairSums],
        pairs: &[[usize; 2]],
        first: usize,
        (fields, within): (usize, Option<&WithinParticle<'_>>),
    ) {
        for (gaussian, rows) in rows.chunks_exact_mut(pairs.len()).enumerate() {
            for s in self.shares.of(first + gaussian) {
                let residuals = &self.residuals[fields * s..][..fields];
                let particle = self.number[self.shares.particle(s)];
                for (row, &[a, b]) in rows.iter_mut().zip(pairs) {
                    let (x, y) = (residuals[a], residuals[b]);
                    if x.is_nan() || y.is_nan() {
                        continue;
                    }
                    let inside = |p, q| within.map_or(0.0, |within| within(particle, [p, q]));
                    let products = [x * x + inside(a, a), y * y + inside(b, b), x * y + inside(a, b)];
                    let [n, w] = self.parts[s];
                    let terms = [n, w, w * x, w * y, w * products[0], w * products[1], w * products[2]];
                    row.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                }
            }
        }
    }
}

/// Variances and covariance about the means.
fn covariance(s: &PairSums) -> [f64; 3] {
    let [_, w, x, y, xx, yy, xy] = *s;
    if w > 0.0 { [xx / w - x / w * (x / w), yy / w - y / w * (y / w), xy / w - x / w * (y / w)] } else { [0.0; 3] }
}

fn correlation([xx, yy, xy]: [f64; 3]) -> f64 {
    let r = xy / (xx * yy).sqrt();
    if r.is_finite() { r.clamp(-1.0, 1.0) } else { 0.0 }
}

/// The correlations of a block's Gaussians: those of few particles are near that of all.
fn finished(sums: &[PairSums], pairs: &[[usize; 2]]) -> Vec<FieldCorrelation> {
    let of_pair = |(place, &fields): (usize, &[usize; 2])| {
        let pair_rows = || sums.iter().skip(place).step_by(pairs.len());
        let pooled = pair_rows().fold([0.0; 3], |all, s| {
            let gaussian_covariance = covariance(s);
            [0, 1, 2].map(|k| all[k] + s[1] * gaussian_covariance[k])
        });
        let prior = correlation(pooled);
        let value = |s: &PairSums| (s[0] * correlation(covariance(s)) + PRIOR * prior) / (s[0] + PRIOR);
        FieldCorrelation { fields, values: pair_rows().map(value).collect() }
    };
    pairs.iter().enumerate().map(of_pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gather;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::model::Mixture;
    use particlegs_core::space::Bounds;
    use particlegs_particles::RUN;

    /// Two clouds; in one the fields rise together, in the other one falls as the other rises.
    #[test]
    fn what_slopes_leave_correlates_as_the_particles_do() {
        const COUNT: usize = 20_000;
        let mut g = Mixture::new(false);
        g.push([0.0; 3], Sym3::scaled_identity(1.0), COUNT as f64 / 2.0, 0.0);
        g.push([20.0, 0.0, 0.0], Sym3::scaled_identity(1.0), COUNT as f64 / 2.0, 0.0);
        let (mut place, mut a, mut b) = ([const { Vec::new() }; 3], Vec::new(), Vec::new());
        for i in 0..COUNT as u64 {
            let mut r = Random::new(3, 0, i);
            let x = [r.normal() + 20.0 * (i % 2) as f64, r.normal(), r.normal()];
            let rho: f64 = if i % 2 == 0 { 0.8 } else { -0.5 };
            let (u, v) = (r.normal(), r.normal());
            a.push(5.0 + 3.0 * x[1] + u);
            b.push(2.0 - 7.0 * x[1] + 4.0 * (rho * u + (1.0 - rho * rho).sqrt() * v));
            (0..3).for_each(|k| place[k].push(x[k] as f32));
        }
        let [x, y, z] = place;
        let particles = Particles::from_columns(x, y, z);
        let bounds = Bounds { min: [-50.0; 3], max: [50.0; 3] };
        let blocks = [Block { bounds, count: COUNT as u64, mass: COUNT as f64, gaussians: g }];
        let shape = |name| FieldShape { name, components: 1, logarithmic: false, may_lack: false, share: false };
        let shapes = [shape("a"), shape("b")];
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            let range = run as usize * RUN..COUNT.min((run as usize + 1) * RUN);
            out.extend([&a, &b].map(|v| v[range.clone()].to_vec()));
            Ok(())
        };
        let moments = gather(&blocks, &particles, &shapes, &read, &Context::SILENT).unwrap();
        let block_correlations =
            correlations(&blocks, &particles, (&shapes, &moments), &read, None, &Context::SILENT).unwrap();
        let [one] = &block_correlations[0][..] else { panic!("one pair") };
        assert_eq!(one.fields, [0, 1]);
        assert!((one.values[0] - 0.8).abs() < 0.01 && (one.values[1] + 0.5).abs() < 0.02, "{:?}", one.values);
    }
}

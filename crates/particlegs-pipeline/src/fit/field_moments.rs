//! Moments of what particles carry, gathered for the Gaussians of a decoded model in one pass over the particles.

use super::assignment::Assignment;
use crate::context::Context;
use crate::math::{Sym3, each_axis};
use crate::model::{Block, FieldMoments};
use crate::particles::{ChunkBuffer, Particles, RUN};
use crate::space::Bounds;
use crate::{Error, Result, parallel};
use std::ops::Range;

/// Runs of particles that wait together.
const RUNS: usize = 16;
/// Gaussians that one task adds to.
const RANGE: usize = 256;
/// Particles that a slope of 0, and the block's own spread, count as.
const SLOPE_PRIOR: f64 = 5.0;
const SPREAD_PRIOR: f64 = 2.0;

/// The moments of a field in a block, with what its particles sum to.
#[derive(Clone, Debug)]
pub struct BlockField {
    /// Moments of each Gaussian.
    pub moments: FieldMoments,
    /// Sums of weight times value, one a component.
    pub sums: Vec<f64>,
    /// Least and largest value of each component.
    pub range: Vec<[f64; 2]>,
}

/// Reads the values of a run of particles: a column for each component of each field.
pub type ReadValues<'a> = dyn Fn(u64, &mut Vec<Vec<f64>>) -> Result<()> + Sync + 'a;

/// Gathers fields of so many `components` each for the decoded `blocks` of one layer, whose particles these are. Gives
/// the fields of each block. Particles weigh by their masses, where they have weights.
pub fn gather(
    blocks: &[Block],
    particles: &Particles,
    components: &[usize],
    read: &ReadValues<'_>,
    context: &Context<'_>,
) -> Result<Vec<Vec<BlockField>>> {
    let columns: usize = components.iter().sum();
    let mut sums: Vec<BlockSums> = blocks.iter().map(|b| BlockSums::new(b, components)).collect();
    let bounds: Vec<Bounds> = blocks.iter().map(|b| b.bounds).collect();
    let runs = particles.len().div_ceil(RUN);
    context.begin("fields", particles.len() as u64);
    for first in (0..runs).step_by(RUNS) {
        let batch: Vec<RunShares> = parallel::try_map(first..runs.min(first + RUNS), |run| {
            context.check()?;
            let range = run * RUN..particles.len().min((run + 1) * RUN);
            let mut values = Vec::new();
            read(run as u64, &mut values)?;
            if values.len() != columns || values.iter().any(|v| v.len() != range.len()) {
                return Err(Error::input("fields", "a field has another number of values than there are particles"));
            }
            RunShares::new(particles, range, values, &bounds, &sums)
        })?;
        for (number, block) in sums.iter_mut().enumerate() {
            block.add(number as u32, &batch);
        }
        context.advance(batch.iter().map(|r| r.weight.len() as u64).sum());
    }
    context.end();
    Ok(sums.into_iter().map(BlockSums::finish).collect())
}

/// What a block's particles sum to, Gaussian by Gaussian.
struct BlockSums<'a> {
    block: &'a Block,
    assignment: Assignment,
    components: Vec<usize>,
    /// A row for each Gaussian: number and weight; weighted place from the mean and its products; for each field values,
    /// products of values with places, products of values.
    rows: Vec<f64>,
    width: usize,
    /// Weighted sums, least and largest, of each component.
    all: Vec<[f64; 3]>,
}

/// Shares of a run's particles, sorted by the range of Gaussians.
struct RunShares {
    /// Block, Gaussian, particle of the run, share.
    shares: Vec<(u32, u32, u32, f32)>,
    position: [Vec<f64>; 3],
    weight: Vec<f64>,
    block: Vec<u32>,
    values: Vec<Vec<f64>>,
}

impl RunShares {
    fn new(
        particles: &Particles,
        range: Range<usize>,
        values: Vec<Vec<f64>>,
        bounds: &[Bounds],
        blocks: &[BlockSums<'_>],
    ) -> Result<Self> {
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
        if let Some((c, i)) = values.iter().enumerate().find_map(|(c, v)| Some((c, v.iter().position(|v| !v.is_finite())?))) {
            let what = format!("particle {} has the value {} (component {c} of the chosen fields)", range.start + i, values[c][i]);
            return Err(Error::input("fields", what));
        }
        let (mut shares, mut own) = (Vec::with_capacity(3 * range.len()), Vec::new());
        let mut block = Vec::with_capacity(range.len());
        for i in 0..range.len() {
            let x = each_axis(|k| position[k][i]);
            let within = |b: &Bounds| (0..3).all(|k| b.min[k] <= x[k] && x[k] <= b.max[k]);
            let number = if bounds.len() == 1 { 0 } else { bounds.iter().position(within).unwrap_or(0) };
            block.push(number as u32);
            blocks[number].assignment.shares(x, &mut own);
            shares.extend(own.iter().map(|&(g, share)| (number as u32, g, i as u32, share as f32)));
        }
        shares.sort_by_key(|s| (s.0, s.1));
        Ok(RunShares { shares, position, weight, block, values })
    }
}

impl<'a> BlockSums<'a> {
    fn new(block: &'a Block, components: &[usize]) -> Self {
        let width = 11 + components.iter().map(|c| 4 * c + c * (c + 1) / 2).sum::<usize>();
        BlockSums {
            block,
            assignment: Assignment::new(&block.gaussians),
            components: components.to_vec(),
            rows: vec![0.0; width * block.gaussians.len()],
            width,
            all: vec![[0.0, f64::INFINITY, f64::NEG_INFINITY]; components.iter().sum()],
        }
    }

    fn add(&mut self, number: u32, batch: &[RunShares]) {
        let (g, width, components) = (&self.block.gaussians, self.width, &self.components);
        parallel::for_each_chunk(&mut self.rows, width * RANGE, |task, rows| {
            let first = (task * RANGE) as u32;
            for run in batch {
                let place = |gaussian: u32| run.shares.partition_point(|s| (s.0, s.1) < (number, gaussian));
                for &(_, i, particle, share) in &run.shares[place(first)..place(first + (rows.len() / width) as u32)] {
                    let row = &mut rows[(i - first) as usize * width..][..width];
                    let (i, p) = (i as usize, particle as usize);
                    let w = f64::from(share) * run.weight[p];
                    let d: [f64; 3] = each_axis(|k| run.position[k][p] - g.mean[k][i]);
                    row[0] += f64::from(share);
                    row[1] += w;
                    (0..3).for_each(|k| row[2 + k] += w * d[k]);
                    let outer = Sym3::outer(d);
                    (0..6).for_each(|k| row[5 + k] += w * outer.0[k]);
                    let (mut at, mut column) = (11, 0);
                    for &c in components {
                        for a in 0..c {
                            let q = run.values[column + a][p];
                            row[at + a] += w * q;
                            (0..3).for_each(|k| row[at + c + 3 * a + k] += w * q * d[k]);
                        }
                        let mut product = at + 4 * c;
                        for a in 0..c {
                            for b in a..c {
                                row[product] += w * run.values[column + a][p] * run.values[column + b][p];
                                product += 1;
                            }
                        }
                        (at, column) = (product, column + c);
                    }
                }
            }
        });
        for run in batch {
            for (all, values) in self.all.iter_mut().zip(&run.values) {
                for ((v, w), _) in values.iter().zip(&run.weight).zip(&run.block).filter(|(_, b)| **b == number) {
                    all[0] += w * v;
                    (all[1], all[2]) = (all[1].min(*v), all[2].max(*v));
                }
            }
        }
    }

    fn finish(self) -> Vec<BlockField> {
        let (mut at, mut column) = (11, 0);
        let mut out = Vec::with_capacity(self.components.len());
        for &c in &self.components {
            let all = &self.all[column..column + c];
            let moments = self.moments(at, c);
            out.push(BlockField {
                moments,
                sums: all.iter().map(|a| a[0]).collect(),
                range: all.iter().map(|a| [a[1].min(a[2]), a[2].max(a[1])].map(|v| if v.is_finite() { v } else { 0.0 })).collect(),
            });
            (at, column) = (at + 4 * c + c * (c + 1) / 2, column + c);
        }
        out
    }

    /// The moments of a field whose sums begin at `at` of each row.
    fn moments(&self, at: usize, components: usize) -> FieldMoments {
        let n = self.block.gaussians.len();
        let rows = || self.rows.chunks_exact(self.width);
        let products = components * (components + 1) / 2;
        // Means over all, for Gaussians without particles, and the mean spread.
        let total: f64 = rows().map(|r| r[1]).sum();
        let overall: Vec<f64> = (0..components).map(|a| rows().map(|r| r[at + a]).sum::<f64>() / total).collect();
        let mut spreads = vec![0.0; products];
        let mut out = FieldMoments::new(components);
        let mut each = Vec::with_capacity(n);
        for row in rows() {
            let fitted = Regression::new(row, at, components);
            if let Some(f) = &fitted {
                spreads.iter_mut().zip(&f.spread).for_each(|(s, v)| *s += row[1] * v);
            }
            each.push(fitted);
        }
        spreads.iter_mut().for_each(|s| *s /= total);
        for (row, fitted) in rows().zip(each) {
            let f = fitted.unwrap_or_else(|| Regression {
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
        }
        out
    }
}

/// Mean, slope and spread of one Gaussian's particles.
struct Regression {
    mean: Vec<f64>,
    slope: Vec<[f64; 3]>,
    spread: Vec<f64>,
}

impl Regression {
    /// `None` without particles.
    fn new(row: &[f64], at: usize, c: usize) -> Option<Regression> {
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
                let with: [f64; 3] = each_axis(|k| row[at + c + 3 * a + k] / w - mean[a] * place[k]);
                inverse.map_or([0.0; 3], |i| i.apply(with).map(|v| v * shrink))
            })
            .collect();
        let mut spread = Vec::new();
        let mut product = at + 4 * c;
        for a in 0..c {
            for b in a..c {
                let both = row[product] / w - mean[a] * mean[b];
                let explained: [f64; 3] = cov.apply(slope[b]);
                let with = |s: [f64; 3], a: usize| -> f64 {
                    (0..3).map(|k| s[k] * (row[at + c + 3 * a + k] / w - mean[a] * place[k])).sum()
                };
                let own: f64 = (0..3).map(|k| slope[a][k] * explained[k]).sum();
                spread.push(both - with(slope[a], b) - with(slope[b], a) + own);
                product += 1;
            }
        }
        let at_mean = (0..c).map(|a| mean[a] - (0..3).map(|k| slope[a][k] * place[k]).sum::<f64>()).collect();
        Some(Regression { mean: at_mean, slope, spread })
    }
}

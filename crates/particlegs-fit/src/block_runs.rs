//! Particles of a layer block by block, in runs that are the same whether a block is read alone or with others.

use super::field_moments::{FieldShape, ReadValues, check_finite};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::Block;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{ChunkBuffer, Particles, RUN};

/// Runs of particles that are read together.
pub(super) const RUNS: usize = 16;

/// Particles of one block, in their order, with what they carry.
#[derive(Default)]
pub(super) struct BlockRun {
    pub block: usize,
    /// Their numbers among all.
    pub number: Vec<usize>,
    pub place: Vec<[f64; 3]>,
    pub weight: Vec<f64>,
    /// The columns that are read.
    pub values: Vec<Vec<f64>>,
}

impl BlockRun {
    /// Those at some places.
    fn only(&self, block: usize, at: &[usize]) -> BlockRun {
        let column = |values: &Vec<f64>| at.iter().map(|i| values[*i]).collect();
        BlockRun {
            block,
            number: at.iter().map(|i| self.number[*i]).collect(),
            place: at.iter().map(|i| self.place[*i]).collect(),
            weight: column(&self.weight),
            values: self.values.iter().map(column).collect(),
        }
    }

    fn append(&mut self, mut other: BlockRun) {
        if self.number.is_empty() {
            *self = other;
            return;
        }
        self.number.append(&mut other.number);
        self.place.append(&mut other.place);
        self.weight.append(&mut other.weight);
        self.values.iter_mut().zip(&mut other.values).for_each(|(a, b)| a.append(b));
    }

    /// The first [`RUN`], which leave.
    fn take_run(&mut self) -> BlockRun {
        let rest = BlockRun {
            block: self.block,
            number: self.number.split_off(RUN),
            place: self.place.split_off(RUN),
            weight: self.weight.split_off(RUN),
            values: self.values.iter_mut().map(|v| v.split_off(RUN)).collect(),
        };
        std::mem::replace(self, rest)
    }
}

/// Reads the particles of blocks, and the values of their fields.
pub(super) struct BlockReader<'a> {
    pub particles: &'a Particles,
    pub fields: &'a [FieldShape<'a>],
    pub read: &'a ReadValues<'a>,
    pub finder: BlockFinder,
}

impl BlockReader<'_> {
    /// Gives all particles to `work`, several runs at a time: [`RUN`] particles each but the last of a block.
    pub fn each_batch(&self, context: &Context<'_>, mut work: impl FnMut(Vec<BlockRun>) -> Result<()>) -> Result<()> {
        let mut waiting: Vec<BlockRun> =
            (0..self.finder.bounds.len()).map(|block| BlockRun { block, ..BlockRun::default() }).collect();
        let runs = self.particles.len().div_ceil(RUN);
        for first in (0..runs).step_by(RUNS) {
            let parts = parallel::try_map(first..runs.min(first + RUNS), |run| {
                context.check()?;
                self.parts(run)
            })?;
            let mut ready = Vec::new();
            for part in parts.into_iter().flatten() {
                let waiting = &mut waiting[part.block];
                waiting.append(part);
                while waiting.number.len() >= RUN {
                    ready.push(waiting.take_run());
                }
            }
            if first + RUNS >= runs {
                ready.extend(waiting.drain(..).filter(|w| !w.number.is_empty()));
            }
            work(ready)?;
        }
        Ok(())
    }

    /// The blocks' parts of a run of all particles.
    fn parts(&self, run: usize) -> Result<Vec<BlockRun>> {
        let range = run * RUN..self.particles.len().min((run + 1) * RUN);
        let mut buffer = ChunkBuffer::default();
        let chunk = self.particles.chunk(range.clone(), &mut buffer);
        let mut all = BlockRun { number: range.clone().collect(), ..BlockRun::default() };
        (self.read)(run as u64, &mut all.values)?;
        let columns: usize = self.fields.iter().map(FieldShape::columns).sum();
        // Particles that stand for several have one column more.
        let expected = [columns, columns + 1].contains(&all.values.len());
        if !expected || all.values.iter().any(|v| v.len() != range.len()) {
            return Err(Error::input("fields", "a field has another number of values than there are particles"));
        }
        check_finite(self.fields, &all.values, range.start)?;
        all.weight = chunk.weight.map_or(vec![1.0; range.len()], |w| w.iter().map(|w| f64::from(*w)).collect());
        let place = |i| each_axis(|k| self.particles.origin[k] + f64::from(chunk.position[k][i]));
        all.place = (0..range.len()).map(place).collect();
        if self.finder.bounds.len() < 2 {
            return Ok(vec![all]);
        }
        let sorted = self.finder.sorted(&all.place);
        let parts = sorted.iter().enumerate().filter(|(_, at)| !at.is_empty());
        Ok(parts.map(|(block, at)| all.only(block, at)).collect())
    }
}

/// Finds the block whose bounds a place lies in: the first of those that meet its cell of a grid.
pub(super) struct BlockFinder {
    bounds: Vec<Bounds>,
    low: [f64; 3],
    cells_per_length: [f64; 3],
    cells: Vec<Vec<u32>>,
}

impl BlockFinder {
    const SIDE: usize = 16;

    pub fn new(blocks: &[Block]) -> Self {
        BlockFinder::of(blocks.iter().map(|b| b.bounds).collect())
    }

    fn of(bounds: Vec<Bounds>) -> Self {
        let low = each_axis(|k| bounds.iter().map(|b| b.min[k]).fold(f64::INFINITY, f64::min));
        let high: [f64; 3] = each_axis(|k| bounds.iter().map(|b| b.max[k]).fold(f64::NEG_INFINITY, f64::max));
        let cells_per_length = each_axis(|k| Self::SIDE as f64 / (high[k] - low[k]));
        let mut finder = BlockFinder { bounds, low, cells_per_length, cells: Vec::new() };
        if finder.bounds.len() > 1 {
            finder.cells.resize(Self::SIDE.pow(3), Vec::new());
            for number in 0..finder.bounds.len() {
                let b = finder.bounds[number];
                let [from, to] = [b.min, b.max].map(|x| finder.cell(x));
                for (x, y) in (from[0]..=to[0]).flat_map(|x| (from[1]..=to[1]).map(move |y| (x, y))) {
                    for z in from[2]..=to[2] {
                        finder.cells[(x * Self::SIDE + y) * Self::SIDE + z].push(number as u32);
                    }
                }
            }
        }
        finder
    }

    fn cell(&self, x: [f64; 3]) -> [usize; 3] {
        // Without an extent a place is NaN cells from the first, which is 0 as a whole number.
        [0, 1, 2]
            .map(|k| ((x[k] - self.low[k]) * self.cells_per_length[k]).clamp(0.0, Self::SIDE as f64 - 1.0) as usize)
    }

    fn block_of(&self, x: [f64; 3]) -> usize {
        if self.bounds.len() < 2 {
            return 0;
        }
        let [i, j, k] = self.cell(x);
        let is_in = |b: &Bounds| (0..3).all(|k| b.min[k] <= x[k] && x[k] <= b.max[k]);
        let mut blocks = self.cells[(i * Self::SIDE + j) * Self::SIDE + k].iter().map(|b| *b as usize);
        blocks.find(|b| is_in(&self.bounds[*b])).unwrap_or(0)
    }

    /// The numbers of places in each block.
    pub fn sorted(&self, places: &[[f64; 3]]) -> Vec<Vec<usize>> {
        let mut sorted = vec![Vec::new(); self.bounds.len()];
        places.iter().enumerate().for_each(|(i, x)| sorted[self.block_of(*x)].push(i));
        sorted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn a_place_belongs_to_the_first_block_that_holds_it() {
        let block = |i: u64| {
            let mut r = Random::new(7, 0, i);
            let (corner, size) = ([r.normal(), r.normal(), 2.0], [r.uniform(), 3.0 * r.uniform(), 0.0]);
            Bounds { min: corner, max: each_axis(|k| corner[k] + size[k]) }
        };
        let bounds: Vec<Bounds> = (0..60).map(block).collect();
        let finder = BlockFinder::of(bounds.clone());
        for i in 0..1000 {
            let mut r = Random::new(8, 0, i);
            let x = [r.normal(), r.normal(), 2.0];
            let is_in = |b: &Bounds| (0..3).all(|k| b.min[k] <= x[k] && x[k] <= b.max[k]);
            assert_eq!(finder.block_of(x), bounds.iter().position(is_in).unwrap_or(0));
        }
    }
}

//! A block made ready once and coded at any precision.

use super::header::{
    BlockHeader, GAUSSIANS_A_BYTE, HEADER_BYTES, MOST_PARTICLES, SIZE_SLOPES, count_features, size_features,
};
use super::precision::Precision;
use super::predict::{fit, low_bits};
use super::rans::Recorder;
use super::shape::Logs;
use super::tree::Tree;
use super::trellis::{Sample, State, quantise};
use super::walk::{Leaf, Script, walk};
use crate::model::Block;
use crate::particles::Bounds;
use crate::{Error, Result};

/// The order of a block's Gaussians and their logarithms: all that does not depend on precision.
/// [`Encoder::encode`] then costs a few microseconds a Gaussian, so that rate control can call it
/// over and over.
pub struct Encoder {
    bounds: Bounds,
    count: u64,
    mass: f64,
    tree: Tree,
    logs: Logs,
    /// Place within the leaf's cell, in 0 to 1.
    within: [Vec<f64>; 3],
}

impl Encoder {
    /// Sorts the Gaussians and takes their logarithms.
    ///
    /// # Errors
    /// [`Error::Argument`] for a block without Gaussians or particles, and for numbers that are
    /// not finite.
    pub fn new(block: &Block) -> Result<Encoder> {
        check(block)?;
        let g = &block.gaussians;
        let tree = Tree::build(&g.mean, &block.bounds);
        let logs = Logs::new(block, &tree.order);
        let extent = block.bounds.extent();
        let within = std::array::from_fn(|k| {
            let place = |(&i, cell): (&u32, &super::tree::Cell)| {
                if extent[k] == 0.0 {
                    return 0.5;
                }
                let u = (g.mean[k][i as usize] - block.bounds.min[k]) / extent[k];
                (u * (1u64 << cell.depth[k]) as f64 - cell.index[k] as f64).clamp(0.0, 1.0)
            };
            tree.order.iter().zip(&tree.cells).map(place).collect()
        });
        Ok(Encoder { bounds: block.bounds, count: block.count, mass: block.mass, tree, logs, within })
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.tree.order.len()
    }

    /// No Gaussians? (Never: a block has one at least.)
    pub fn is_empty(&self) -> bool {
        self.tree.order.is_empty()
    }

    /// The block's bytes at a precision.
    pub fn encode(&self, precision: &Precision) -> Vec<u8> {
        let (header, leaves) = self.quantise(precision);
        let mut recorder = Recorder::default();
        let mut script = Given { splits: self.tree.splits.iter(), leaves: &leaves };
        let walked = walk(&mut recorder, &header, &mut script, |_| Ok(()));
        debug_assert!(walked.is_ok(), "quantised numbers are within range");
        let mut out = Vec::new();
        header.write(&mut out);
        debug_assert_eq!(out.len(), HEADER_BYTES);
        out.extend(recorder.finish());
        // A block may not be too small for its Gaussians.
        let least = (self.len() as u64).div_ceil(GAUSSIANS_A_BYTE) as usize;
        out.resize(out.len().max(least), 0);
        out
    }

    /// The header and the whole numbers.
    fn quantise(&self, precision: &Precision) -> (BlockHeader, Vec<Leaf>) {
        let mut header = BlockHeader {
            bounds: self.bounds,
            count: self.count,
            mass: self.mass,
            gaussians: self.len() as u32,
            weighted: self.logs.weight.is_some(),
            low: [0; 4],
            steps: precision.steps(),
            importance: (precision.importance as f32).clamp(0.0, 4.0),
            centre: 0.0,
            predict: Default::default(),
        };
        let mut leaves: Vec<Leaf> = self.tree.cells.iter().map(|&cell| Leaf { cell, ..Leaf::default() }).collect();
        self.scalars(&mut header, &mut leaves);
        let factors: Vec<f64> = leaves.iter().map(|l| header.step_factor(l.t, l.m)).collect();
        let (shapes, places) =
            rayon::join(|| self.shapes(&header, &factors), || self.places(&header, &leaves, &factors));
        for (i, leaf) in leaves.iter_mut().enumerate() {
            leaf.shape.copy_from_slice(&shapes[5 * i..5 * i + 5]);
            leaf.place = places[i];
        }
        header.low[3] = low_bits(shapes.iter().map(|&h| h >> 1));
        predictors(&mut header, &leaves);
        (header, leaves)
    }

    /// Sizes, counts and masses; the centre of the step factor.
    fn scalars(&self, header: &mut BlockHeader, leaves: &mut [Leaf]) {
        let column = |values: &[f64], step: f32| halves(values.len(), |i| values[i] / f64::from(step));
        let (t, m) =
            rayon::join(|| column(&self.logs.size, header.steps[1]), || column(&self.logs.count, header.steps[2]));
        let w = self.logs.weight.as_ref().map(|w| column(w, header.steps[4]));
        for (i, leaf) in leaves.iter_mut().enumerate() {
            (leaf.t, leaf.m) = (t[i], m[i]);
            leaf.w = w.as_ref().map_or(0, |w| w[i]);
        }
        let sum: f64 = leaves.iter().map(|l| header.log_count(l.m) - header.log_size(l.t)).sum();
        header.centre = (sum / leaves.len() as f64) as f32;
    }

    /// Shape numbers of all Gaussians, five in turn, on half steps.
    fn shapes(&self, header: &BlockHeader, factors: &[f64]) -> Vec<i32> {
        let step = f64::from(header.steps[3]);
        halves(5 * self.len(), |j| self.logs.shape[j] / (step * factors[j / 5]))
    }

    /// Positions in quarter levels.
    fn places(&self, header: &BlockHeader, leaves: &[Leaf], factors: &[f64]) -> Vec<[u64; 3]> {
        let extent = self.bounds.extent();
        let mut axes: Vec<(u32, u8)> = Vec::with_capacity(3 * leaves.len());
        let mut samples = Vec::with_capacity(3 * leaves.len());
        for (i, leaf) in leaves.iter().enumerate() {
            let levels = header.levels(&leaf.cell, extent, leaf.t, factors[i]);
            let widths = leaf.cell.widths(extent);
            let step = f64::from(header.steps[0]) * factors[i] * super::exact::exp(header.log_size(leaf.t));
            for k in (0..3).filter(|&k| levels[k] > 1) {
                let n = levels[k] as f64;
                let weight = (widths[k] / (n * step)).powi(2);
                samples.push(Sample { value: self.within[k][i] * n, range: [0, levels[k] as i64 - 1], weight });
                axes.push((i as u32, k as u8));
            }
        }
        let indices = quantise(samples.len(), 0.25, |j| samples[j]);
        let mut out = vec![[2; 3]; leaves.len()];
        let mut state = State::default();
        for (&(i, k), &index) in axes.iter().zip(&indices) {
            out[i as usize][usize::from(k)] = 4 * index as u64 + 1 + 2 * state.lattice() as u64;
            state.step(index);
        }
        out
    }
}

/// Trellis indices as half steps.
fn halves(count: usize, value: impl Fn(usize) -> f64) -> Vec<i32> {
    let mut state = State::default();
    let half = |k: i64| {
        let h = 2 * k as i32 + state.lattice();
        state.step(k);
        h
    };
    quantise(count, 0.0, |i| Sample::free(value(i))).into_iter().map(half).collect()
}

/// Fits the predictors of size and count, and the plain low bits of what they leave.
fn predictors(header: &mut BlockHeader, leaves: &[Leaf]) {
    let before = |i: usize| {
        let at = |d: usize| if i >= d { leaves[i - d] } else { Leaf::default() };
        [at(1), at(2)]
    };
    let rows = |i: usize| size_features(&leaves[i], &before(i)).map(f64::from);
    header.predict[0] = fit::<SIZE_SLOPES>(leaves.len(), rows, |i| f64::from(leaves[i].t));
    let rows = |i: usize| count_features(&leaves[i], &before(i)).map(f64::from);
    header.predict[1] = fit::<6>(leaves.len(), rows, |i| f64::from(leaves[i].m));
    let h = &*header;
    let t = low_bits((0..leaves.len()).map(|i| (leaves[i].t - h.predict_t(&leaves[i], &before(i))) >> 1));
    let m = low_bits((0..leaves.len()).map(|i| (leaves[i].m - h.predict_m(&leaves[i], &before(i))) >> 1));
    let w = low_bits((0..leaves.len()).map(|i| (leaves[i].w - before(i)[0].w) >> 1));
    header.low[..3].copy_from_slice(&[t, m, w]);
}

struct Given<'a> {
    splits: std::slice::Iter<'a, u32>,
    leaves: &'a [Leaf],
}

impl Script for Given<'_> {
    fn split(&mut self) -> u32 {
        self.splits.next().copied().unwrap_or(0)
    }

    fn leaf(&mut self, i: usize) -> Leaf {
        self.leaves[i]
    }
}

fn check(block: &Block) -> Result<()> {
    let g = &block.gaussians;
    let n = g.len();
    let whole = g.mean.iter().chain(&g.cov).chain(&g.mass).all(|c| c.len() == n);
    if n == 0 || n > u32::MAX as usize || !whole {
        return Err(Error::argument(format!(
            "a block of {n} Gaussians, or of columns of several lengths, cannot be coded"
        )));
    }
    if block.count == 0 || block.count > MOST_PARTICLES || !(block.mass > 0.0 && block.mass.is_finite()) {
        return Err(Error::argument(format!(
            "a block of {} particles and mass {} cannot be coded",
            block.count, block.mass
        )));
    }
    let finite = g.mean.iter().chain(&g.cov).chain([&g.count]).chain(&g.mass).all(|c| c.iter().all(|v| v.is_finite()));
    let b = &block.bounds;
    if !finite || !(0..3).all(|k| b.min[k] <= b.max[k] && (b.max[k] - b.min[k]).is_finite()) {
        return Err(Error::argument("a block with NaN or infinite numbers cannot be coded"));
    }
    Ok(())
}

//! A block made ready once and coded at any precision.

use super::header::{
    BlockHeader, GAUSSIANS_A_BYTE, MOST_PARTICLES, SIZE_SLOPES, cholesky, count_features, size_features,
};
use super::place::{Target, quantise_places};
use super::precision::Precision;
use super::predict::{fit, low_bits};
use super::rans::Recorder;
use super::shape::Logs;
use super::streams;
use super::tree::{Segment, Tree, pieces};
use super::trellis::{Sample, State, quantise};
use super::walk::{Leaf, Past, Script, trunk, walk};
use crate::math::{Sym3, each_axis};
use crate::model::{AlphaBlend, Block};
use crate::space::Bounds;
use crate::{Error, Result, parallel};
use std::ops::Range;

/// What a step of a shape number away from 0 costs in squared steps: 1 % of the bits for 0.004 dB.
const PULL: f64 = 0.1;

/// The order of a block's Gaussians and their logarithms: all that does not depend on precision.
/// [`Encoder::encode`] then costs a few microseconds a Gaussian, so that rate control can call it
/// over and over.
pub struct Encoder {
    bounds: Bounds,
    count: u64,
    mass: f64,
    /// Of the alpha-blend law.
    shaded: bool,
    tree: Tree,
    logs: Logs,
    /// Place within the leaf's cell, in 0 to 1.
    within: [Vec<f64>; 3],
}

impl Encoder {
    /// Sorts the Gaussians and takes their logarithms. Of Gaussians of the alpha-blend law the opacity is coded
    /// and not the count, which follows from it.
    ///
    /// # Errors
    /// [`Error::Argument`] for a block without Gaussians or particles, for numbers that are not
    /// finite, opacities outside [0, 1], grey levels below 0, and masses beside opacities.
    pub fn new(block: &Block) -> Result<Encoder> {
        check(block)?;
        let g = &block.gaussians;
        let bounds = box_of(block)?;
        let tree = Tree::build(&g.mean, &bounds);
        let logs = Logs::new(block, &tree.order);
        let extent = bounds.extent();
        let within = each_axis(|k| {
            parallel::map_range(tree.order.len(), |at| {
                let (i, cell) = (tree.order[at], &tree.cells[at]);
                if extent[k] == 0.0 {
                    return 0.5;
                }
                let u = (g.mean[k][i as usize] - bounds.min[k]) / extent[k];
                (u * (1u64 << cell.depth[k]) as f64 - cell.index[k] as f64).clamp(0.0, 1.0)
            })
        });
        let Block { count, mass, .. } = *block;
        Ok(Encoder { bounds, count, mass, shaded: g.law.alpha_blend().is_some(), tree, logs, within })
    }

    /// The Gaussians' numbers in the order of the file.
    pub fn order(&self) -> &[u32] {
        &self.tree.order
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
        let (trunk, segments) = self.record(&header, &leaves, Recorder::default, Recorder::finish);
        let mut out = Vec::new();
        header.write(&mut out);
        debug_assert_eq!(out.len(), header.bytes());
        streams::write(header.gaussians, &trunk, &segments, &mut out);
        // A block may not be too small for its Gaussians.
        let least = (self.len() as u64).div_ceil(GAUSSIANS_A_BYTE) as usize;
        out.resize(out.len().max(least), 0);
        out
    }

    /// Bits a Gaussian by what they are spent on, headers apart.
    pub fn breakdown(&self, precision: &Precision) -> Vec<(&'static str, f64)> {
        let (header, leaves) = self.quantise(precision);
        let account = |r: Recorder| r.bits_by_part();
        let (trunk, segments) = self.record(&header, &leaves, Recorder::with_parts, account);
        let mut bits = trunk;
        for segment in &segments {
            (0..bits.len()).for_each(|p| bits[p] += segment[p]);
        }
        let [count, mass] = if self.shaded { ["opacity", "grey"] } else { ["count", "mass"] };
        ["tree", "size", count, mass, "shape", "place"].into_iter().zip(bits.map(|b| b / self.len() as f64)).collect()
    }

    /// The trunk and the segments, each recorded and `done`.
    fn record<T: Send>(
        &self,
        header: &BlockHeader,
        leaves: &[Leaf],
        recorder: impl Fn() -> Recorder + Sync,
        done: impl Fn(Recorder) -> T + Sync,
    ) -> (T, Vec<T>) {
        let mut above = recorder();
        let walked = trunk(&mut above, header, &mut Given { splits: self.tree.trunk.iter(), leaves: &[] });
        debug_assert!(walked.is_ok(), "splits are those of the tree");
        let segment = |(segment, range): (&Segment, Range<usize>)| {
            let mut recorder = recorder();
            let mut script = Given { splits: segment.splits.iter(), leaves: &leaves[range] };
            let walked = walk(&mut recorder, header, &segment.nodes, &mut script, |_, _| {});
            debug_assert!(walked.is_ok(), "quantised numbers are within range");
            done(recorder)
        };
        let segments = parallel::map(self.tree.segments.iter().zip(self.ranges()), segment);
        (done(above), segments)
    }

    /// The Gaussians of each segment.
    fn ranges(&self) -> Vec<Range<usize>> {
        let mut end = 0;
        let range = |n: usize| {
            end += n;
            end - n..end
        };
        self.tree.lengths().into_iter().map(range).collect()
    }

    /// The header and the whole numbers.
    fn quantise(&self, precision: &Precision) -> (BlockHeader, Vec<Leaf>) {
        let mut header = BlockHeader {
            bounds: self.bounds,
            count: self.count,
            mass: self.mass,
            gaussians: self.len() as u32,
            weighted: self.logs.weight.is_some() && !self.shaded,
            shaded: self.shaded,
            low: [0; 4],
            steps: precision.steps(),
            importance: (precision.importance as f32).clamp(0.0, 4.0),
            centre: 0.0,
            predict: Default::default(),
            spreads: Some([0.0; 3]),
        };
        let mut leaves: Vec<Leaf> = self.tree.cells.iter().map(|&cell| Leaf { cell, ..Leaf::default() }).collect();
        self.each(&mut leaves, |range, leaves| self.scalars(&header, range, leaves));
        let sum: f64 = leaves.iter().map(|l| header.log_importance(l.t, l.m)).sum();
        header.centre = (sum / leaves.len() as f64) as f32;
        self.each(&mut leaves, |range, leaves| {
            let factors: Vec<f64> = leaves.iter().map(|l| header.step_factor(l.t, l.m)).collect();
            self.shapes(&header, range.clone(), &factors, leaves);
            self.places(&header, range, &factors, leaves);
        });
        header.low[3] = low_bits(leaves.iter().flat_map(|l| l.shape).map(|h| h >> 1), 3);
        let shape = leaves.iter().map(|l| l.shape.iter().map(|s| f64::from(s.abs())).sum::<f64>() * l.factor);
        let shape = shape.sum::<f64>() / (5 * leaves.len()) as f64;
        let [size, count] = predictors(&mut header, &self.histories(&leaves));
        header.spreads = Some([size, count, shape].map(|s| s as f32));
        (header, leaves)
    }

    /// Works on the segments' Gaussians, in parallel.
    fn each(&self, leaves: &mut [Leaf], work: impl Fn(Range<usize>, &mut [Leaf]) + Sync) {
        let parts = pieces(leaves, self.tree.lengths().into_iter());
        parallel::for_each(parts.into_iter().zip(self.ranges()), |(leaves, range)| work(range, leaves));
    }

    /// Sizes, counts and masses.
    fn scalars(&self, header: &BlockHeader, range: Range<usize>, leaves: &mut [Leaf]) {
        let column = |values: &[f64], step: f32| {
            let values = &values[range.clone()];
            halves(values.len(), 0.0, |i| values[i] / f64::from(step))
        };
        let (t, m) =
            parallel::join(|| column(&self.logs.size, header.steps[1]), || column(&self.logs.count, header.steps[2]));
        let w = self.logs.weight.as_ref().map(|w| column(w, header.steps[4]));
        for (i, leaf) in leaves.iter_mut().enumerate() {
            (leaf.t, leaf.m) = (t[i], m[i]);
            leaf.w = w.as_ref().map_or(0, |w| w[i]);
        }
    }

    /// Shape numbers, on half steps.
    fn shapes(&self, header: &BlockHeader, range: Range<usize>, factors: &[f64], leaves: &mut [Leaf]) {
        let steps: Vec<f64> = factors.iter().map(|f| 2.0 * header.shape_half_step(*f)).collect();
        let given = &self.logs.shape[5 * range.start..5 * range.end];
        let shapes = halves(given.len(), PULL, |j| given[j] / steps[j / 5]);
        for (leaf, shape) in leaves.iter_mut().zip(shapes.chunks_exact(5)) {
            leaf.shape.copy_from_slice(shape);
        }
    }

    /// Positions in quarter levels. Shapes are known by now, as the decoder will know them.
    fn places(&self, header: &BlockHeader, range: Range<usize>, factors: &[f64], leaves: &mut [Leaf]) {
        let extent = self.bounds.extent();
        let places = quantise_places(leaves.len(), |i| {
            let leaf = &leaves[i];
            let unit = header.unit_covariance(leaf.shape, factors[i]).unwrap_or(Sym3::scaled_identity(1.0));
            let (widths, [ba, ca, cb]) = cholesky(&unit);
            let step = header.place_step(header.radius(leaf.t), factors[i]);
            let levels = header.levels(&leaf.cell, extent, step, widths);
            let cell = leaf.cell.widths(extent);
            // Levels to a step of the block.
            let fine = each_axis(|k| if cell[k] > 0.0 { levels[k] as f64 * step / cell[k] } else { 0.0 });
            Target {
                levels,
                place: each_axis(|k| self.within[k][range.start + i] * levels[k] as f64),
                coarse: each_axis(|k| if fine[k] > 0.0 { 1.0 / (fine[k] * widths[k]) } else { 0.0 }),
                moves: [ba * fine[1], ca * fine[2], cb * fine[2]],
            }
        });
        for (leaf, place) in leaves.iter_mut().zip(places) {
            leaf.place = place;
        }
    }

    /// What each Gaussian says of itself and what the two before it in its segment said.
    fn histories(&self, leaves: &[Leaf]) -> Vec<[Past; 3]> {
        let mut out = Vec::with_capacity(leaves.len());
        for range in self.ranges() {
            let mut before = [Past::default(); 2];
            for leaf in &leaves[range] {
                let own = leaf.past();
                out.push([own, before[0], before[1]]);
                before = [own, before[0]];
            }
        }
        out
    }
}

/// Trellis indices as half steps.
fn halves(count: usize, pull: f64, value: impl Fn(usize) -> f64) -> Vec<i32> {
    let mut state = State::default();
    let half = |k: i64| {
        let h = 2 * k as i32 + state.lattice();
        state.step(k);
        h
    };
    quantise(count, |i| Sample { pull, ..Sample::free(value(i)) }).into_iter().map(half).collect()
}

/// Fits the predictors of size and count, and the plain low bits of what they leave; returns its spread, in steps.
fn predictors(header: &mut BlockHeader, histories: &[[Past; 3]]) -> [f64; 2] {
    let n = histories.len();
    let size = |&[own, a, b]: &[Past; 3]| size_features(own.level, &[a, b]);
    let count = |&[own, a, b]: &[Past; 3]| count_features(own.level, own.t, &[a, b]);
    let (t, m) = parallel::join(
        || fit::<SIZE_SLOPES>(n, |i| size(&histories[i]).map(f64::from), |i| f64::from(histories[i][0].t)),
        || fit::<6>(n, |i| count(&histories[i]).map(f64::from), |i| f64::from(histories[i][0].m)),
    );
    header.predict = [t, m];
    let h = &*header;
    let (t, m) = parallel::join(
        || residuals(histories.iter().map(|p| (p[0].t - h.predict[0].apply(&size(p))) >> 1)),
        || residuals(histories.iter().map(|p| (p[0].m - h.predict[1].apply(&count(p))) >> 1)),
    );
    let w = low_bits(histories.iter().map(|p| (p[0].w - p[1].w) >> 1), 6);
    header.low[..3].copy_from_slice(&[t.0, m.0, w]);
    [t.1, m.1]
}

/// Plain low bits of what predictions leave, in steps, and its spread without those bits.
fn residuals(left: impl Iterator<Item = i32> + Clone) -> (u8, f64) {
    let low = low_bits(left.clone(), 6);
    let (n, sum) = left.fold((0.0, 0.0), |(n, sum), steps| (n + 1.0, sum + f64::from(steps) * f64::from(steps)));
    let rms: f64 = if n > 0.0 { sum / n } else { 0.0 };
    (low, rms.sqrt() / f64::from(1u32 << low))
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

/// The box that means are coded in: the particles' bounds, which hold the means of their moments.
/// Splats are placed by pictures alone and may leave it, so theirs grows to hold them.
fn box_of(block: &Block) -> Result<Bounds> {
    let g = &block.gaussians;
    let mut bounds = block.bounds;
    if g.law.alpha_blend().is_some() {
        (0..g.len()).for_each(|i| bounds.include(g.mean_of(i)));
    }
    match bounds.extent().iter().all(|e| e.is_finite()) {
        true => Ok(bounds),
        false => Err(Error::argument("a block wider than f64 cannot be coded")),
    }
}

fn check(block: &Block) -> Result<()> {
    let g = &block.gaussians;
    let n = g.len();
    let whole = g.mean.iter().chain(&g.cov).chain(g.masses()).all(|c| c.len() == n);
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
    let finite =
        g.mean.iter().chain(&g.cov).chain([&g.count]).chain(g.masses()).all(|c| c.iter().all(|v| v.is_finite()));
    let b = &block.bounds;
    if !finite || !(0..3).all(|k| b.min[k] <= b.max[k] && (b.max[k] - b.min[k]).is_finite()) {
        return Err(Error::argument("a block with NaN or infinite numbers cannot be coded"));
    }
    if let Some(AlphaBlend { opacity, grey, .. }) = g.law.alpha_blend() {
        // 0 and 1 come of rounding, and are coded as the nearest opacity that can be.
        let inside = opacity.iter().all(|o| (0.0..=1.0).contains(o));
        let bright = grey.iter().all(|&v| v >= 0.0 && v.is_finite());
        if opacity.len() != n || grey.len() != n || !inside || !bright || g.masses().is_some() {
            let what = "opacities outside [0, 1], grey levels below 0, or masses beside them cannot be coded";
            return Err(Error::argument(what));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::decode_block;
    use crate::math::{Random, Sym3};
    use crate::model::Mixture;

    /// What was decoded codes to the same bytes at the same precision: training that settles on it
    /// gets the file that it saw.
    #[test]
    fn decoded_gaussians_code_to_the_same_bytes() {
        let mut gaussians = Mixture::default();
        for i in 0..3000 {
            let mut r = Random::new(7, 0, i);
            let mean = each_axis(|_| 10.0 * r.uniform());
            let cov = Sym3([0.02, 0.005 * r.normal(), 0.0, 0.01 + 0.05 * r.uniform(), 0.0, 0.03]);
            gaussians.push(mean, cov, 1.0 + (100.0 * r.uniform()).floor(), 0.0);
        }
        let count = gaussians.count.iter().sum::<f64>() as u64;
        let bounds = Bounds { min: [0.0; 3], max: [10.0; 3] };
        let given = Block { bounds, count, mass: count as f64, gaussians };
        for factor in [0.5, 1.0, 1.7] {
            let precision = Precision::BALANCED.scaled(factor);
            let once = Encoder::new(&given).unwrap().encode(&precision);
            let decoded = decode_block(&once, "a test").unwrap();
            assert!(Encoder::new(&decoded).unwrap().encode(&precision) == once, "at {factor} steps");
        }
    }
}

//! A block made ready once and coded at any precision.

use super::OutOfRange;
use super::balance::{CountBalance, CountDescent};
use super::container::STAGE_BYTES;
use super::fine::{FineWalk, Leaf};
use super::header::{BlockHeader, GAUSSIANS_A_BYTE, MOST_PARTICLES, Precision, cholesky};
use super::levels::{LEVELS, LevelWalk, NodeHalves};
use super::predictor::{fit, low_bits};
use super::rans::RansWriter;
use super::shape::Logs;
use super::source::{SegmentSource, SegmentTree};
use super::streams::{self, STAGES};
use super::tree::{Tree, TreeCell, pieces, trunk};
use super::trellis::{PlacementTarget, TrellisSample, TrellisState, quantise, quantise_places};
use crate::math::{Sym3, each_axis, exp};
use crate::model::{AlphaBlend, Block, Mixture};
use crate::space::Bounds;
use crate::{Error, Result, parallel};
use std::ops::Range;

/// Cost of a step of a shape number away from 0, in squared steps: 1 % of the bits for 0.004 dB.
const PULL: f64 = 0.1;
/// Weight of numbers that must be 0.
const EXACT: f64 = 1e6;

/// The order of a block's Gaussians and their logarithms: all that does not depend on precision.
/// [`Encoder::encode`] then costs a few microseconds a Gaussian, so that rate control can call it
/// over and over.
pub struct Encoder {
    bounds: Bounds,
    count: u64,
    mass: f64,
    shaded: bool,
    tree: Tree,
    segments: Vec<SegmentTree>,
    logs: Logs,
    /// Place within the leaf's cell, in 0 to 1.
    within: [Vec<f64>; 3],
    /// Codes of counts that are decided already, in half steps.
    counts: Option<Vec<i32>>,
    settled: Option<SettledGaussians>,
}

/// Gaussians as they were coded last, in the order of the file. Those whose counts keep their codes are coded alike again.
struct SettledGaussians {
    counts: Vec<i32>,
    /// The header's centre, on which all steps hang.
    centre: f32,
    /// Five a Gaussian.
    shape: Vec<f64>,
    /// Place within the leaf's cell, in 0 to 1.
    within: [Vec<f64>; 3],
}

impl Encoder {
    /// Sorts the Gaussians and takes their logarithms. Of Gaussians of the alpha-blend law the opacity is coded
    /// and not the count, which follows from it.
    pub fn new(block: &Block) -> Result<Encoder> {
        check(block)?;
        let g = &block.gaussians;
        let bounds = box_of(block)?;
        let tree = Tree::build(&g.mean, &bounds);
        let logs = Logs::new(block, &tree.order);
        let extent = bounds.extent();
        let within = within_cells(g, &bounds, &tree.order, &tree.cells);
        let segments = parallel::map(tree.segments.iter().zip(ranges(&tree)), |(segment, range)| {
            SegmentTree::new(&segment.nodes, &tree.cells[range], extent)
        });
        let Block { count, mass, .. } = *block;
        Ok(Encoder {
            bounds,
            count,
            mass,
            shaded: g.law.alpha_blend().is_some(),
            tree,
            segments,
            logs,
            within,
            counts: None,
            settled: None,
        })
    }

    /// The Gaussians' numbers in the order of the file.
    pub fn order(&self) -> &[u32] {
        &self.tree.order
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.tree.order.len()
    }

    /// Whether it has no Gaussians. (Never: a block has one at least.)
    pub fn is_empty(&self) -> bool {
        self.tree.order.is_empty()
    }

    /// Bytes that the block takes in a file beside its own, at most ([`super::stored_bytes`]).
    pub fn stage_bytes(&self) -> usize {
        if self.len() < STAGED { 0 } else { STAGES.len() * STAGE_BYTES }
    }

    /// The block's bytes at a precision.
    pub fn encode(&self, precision: &Precision) -> Vec<u8> {
        let (mut header, leaves) = self.quantise(precision);
        let (trunk, segments) = self.record(&header, &leaves);
        // Where stages end depends on how much each level has recorded, so it is known only now.
        if self.len() >= STAGED {
            header.cuts = cuts(&segments);
        }
        let stage = |number: usize| {
            parallel::map(&segments, |writer| {
                let end = |stage: usize| header.cuts.get(stage).map(|&level| writer.levels()[usize::from(level)]);
                let start = number.checked_sub(1).and_then(end).unwrap_or(0);
                writer.stream(start..end(number).unwrap_or(writer.len()))
            })
        };
        let stages: Vec<Vec<Vec<u8>>> = (0..=header.cuts.len()).map(stage).collect();
        let mut out = Vec::new();
        header.write(&mut out);
        debug_assert_eq!(out.len(), header.bytes());
        streams::write(&header, &trunk.finish(), &stages, &mut out);
        // A block may not be too small for its Gaussians.
        let least = (self.len() as u64).div_ceil(GAUSSIANS_A_BYTE) as usize;
        out.resize(out.len().max(least), 0);
        out
    }

    fn record(&self, header: &BlockHeader, leaves: &[Leaf]) -> (RansWriter, Vec<RansWriter>) {
        let mut trunk_writer = RansWriter::default();
        let trunk_result = trunk(&mut trunk_writer, header, &self.tree.trunk);
        debug_assert!(trunk_result.is_ok(), "splits are those of the tree");
        let segment = |((segment, tree), range): ((&super::tree::Segment, &SegmentTree), Range<usize>)| {
            let mut writer = RansWriter::default();
            let leaves = &leaves[range];
            let mut source = SegmentSource::new(tree, leaves, header.steps[2]);
            let mut record = || {
                let mut walk = LevelWalk::new(&mut writer, header, &segment.nodes, &mut source)?;
                walk.run(&mut writer, &mut source, LEVELS - 1)?;
                let mut fine = FineWalk::new(header);
                walk.leaves()?.iter().zip(leaves).try_for_each(|(&node, leaf)| {
                    let mut coded = *leaf;
                    fine.code(&mut writer, &walk.nodes[node as usize], &mut coded)?;
                    debug_assert_eq!((coded.t, coded.m, coded.w, coded.place), (leaf.t, leaf.m, leaf.w, leaf.place));
                    Ok(())
                })
            };
            let segment_result: std::result::Result<(), OutOfRange> = record();
            debug_assert!(segment_result.is_ok(), "quantised numbers are within range");
            writer
        };
        (trunk_writer, parallel::map(self.tree.segments.iter().zip(&self.segments).zip(ranges(&self.tree)), segment))
    }

    fn quantise(&self, precision: &Precision) -> (BlockHeader, Vec<Leaf>) {
        let mut header = BlockHeader {
            bounds: self.bounds,
            count: self.count,
            mass: self.mass,
            gaussians: self.len() as u32,
            weighted: self.logs.weight.is_some() && !self.shaded,
            shaded: self.shaded,
            steps: precision.steps(),
            importance: (precision.importance as f32).clamp(0.0, 4.0),
            ..BlockHeader::default()
        };
        let mut leaves: Vec<Leaf> = self.tree.cells.iter().map(|&cell| Leaf { cell, ..Leaf::default() }).collect();
        // Sizes and counts come first, as the steps of shapes and places follow from them.
        self.each(&mut leaves, |range, leaves| self.scalars(&header, range, leaves));
        header.centre = self.settled.as_ref().map_or_else(
            || {
                // In order and not in parallel: the bytes hang on the last digit of this sum.
                let sum: f64 = leaves.iter().map(|l| header.log_importance(l.t, l.m)).sum();
                (sum / leaves.len() as f64) as f32
            },
            |settled| settled.centre,
        );
        self.each(&mut leaves, |range, leaves| {
            let factors: Vec<f64> = leaves.iter().map(|l| header.step_factor(l.t, l.m)).collect();
            self.shapes(&header, range.clone(), &factors, leaves);
            self.places(&header, range, &factors, leaves);
        });
        header.low[3] = low_bits(leaves.iter().flat_map(|l| l.shape).map(|h| h >> 1), 3);
        let shape = leaves.iter().map(|l| l.shape.iter().map(|s| f64::from(s.abs())).sum::<f64>() * l.factor);
        let shape = shape.sum::<f64>() / (5 * leaves.len()) as f64;
        // Last: predictions are fitted to the whole numbers that the decoder will have.
        self.predictions(&mut header, &leaves);
        header.spreads[2] = shape as f32;
        (header, leaves)
    }

    /// Takes note of what was decoded of the bytes at a precision: from now on only Gaussians whose counts get other codes
    /// are rounded anew.
    pub fn settle(&mut self, precision: &Precision, decoded: &Block) -> Result<()> {
        if decoded.gaussians.len() != self.len() {
            return Err(Error::argument("the decoded block is another one"));
        }
        // Decoded Gaussians are in the order of the file, each in its cell.
        let order: Vec<u32> = (0..self.len() as u32).collect();
        let shape = Logs::new(decoded, &order).shape;
        let within = within_cells(&decoded.gaussians, &self.bounds, &order, &self.tree.cells);
        let (counts, centre) = match (self.counts.take(), &self.settled) {
            (Some(counts), Some(settled)) => (counts, settled.centre),
            _ => {
                let (header, leaves) = self.quantise(precision);
                (leaves.iter().map(|leaf| leaf.m).collect(), header.centre)
            }
        };
        self.settled = Some(SettledGaussians { counts: counts.clone(), centre, shape, within });
        self.counts = Some(counts);
        Ok(())
    }

    /// Moves the codes of counts that are settled until sums over the Gaussians change as wanted, by those moves that fit
    /// the counts best. Returns the factor by which each count changes.
    pub fn balance_counts(&mut self, precision: &Precision, balance: &CountBalance<'_>) -> Result<Vec<f64>> {
        balance.check(self.len())?;
        let Some(codes) = &mut self.counts else { return Ok(vec![1.0; self.len()]) };
        let (step, last_codes) = (f64::from(precision.steps()[2]), codes.clone());
        CountDescent::run(balance, (&self.logs.count, step), codes, &ranges(&self.tree));
        Ok(codes.iter().zip(last_codes).map(|(code, last)| exp(0.5 * f64::from(code - last) * step)).collect())
    }

    /// The numbers that a Gaussian is to keep, if its count has the code that it had.
    fn settled_as(&self, at: usize, count: i32) -> Option<&SettledGaussians> {
        self.settled.as_ref().filter(|s| s.counts[at] == count)
    }

    /// Works on the segments' Gaussians, in parallel.
    fn each(&self, leaves: &mut [Leaf], work: impl Fn(Range<usize>, &mut [Leaf]) + Sync) {
        let parts = pieces(leaves, self.tree.lengths().into_iter());
        parallel::for_each(parts.into_iter().zip(ranges(&self.tree)), |(leaves, range)| work(range, leaves));
    }

    fn scalars(&self, header: &BlockHeader, range: Range<usize>, leaves: &mut [Leaf]) {
        let column = |values: &[f64], step: f32| {
            let values = &values[range.clone()];
            halves(values.len(), |i| TrellisSample::free(values[i] / f64::from(step)))
        };
        let counts = || match &self.counts {
            Some(counts) => counts[range.clone()].to_vec(),
            None => column(&self.logs.count, header.steps[2]),
        };
        let (t, m) = parallel::join(|| column(&self.logs.size, header.steps[1]), counts);
        let w = self.logs.weight.as_ref().map(|w| column(w, header.steps[4]));
        for (i, leaf) in leaves.iter_mut().enumerate() {
            (leaf.t, leaf.m) = (t[i], m[i]);
            leaf.w = w.as_ref().map_or(0, |w| w[i]);
        }
    }

    /// Shape numbers, on half steps.
    fn shapes(&self, header: &BlockHeader, range: Range<usize>, factors: &[f64], leaves: &mut [Leaf]) {
        let steps: Vec<f64> = factors.iter().map(|f| 2.0 * header.shape_half_step(*f)).collect();
        let shapes = halves(5 * leaves.len(), |j| {
            let settled = self.settled_as(range.start + j / 5, leaves[j / 5].m);
            let log = settled.map_or(&self.logs.shape, |s| &s.shape)[5 * range.start + j];
            let weight = if self.logs.flat.is_along(j % 5, log) { EXACT } else { 1.0 };
            TrellisSample { pull: PULL, weight, ..TrellisSample::free(log / steps[j / 5]) }
        });
        for (leaf, shape) in leaves.iter_mut().zip(shapes.chunks_exact(5)) {
            leaf.shape.copy_from_slice(shape);
        }
    }

    /// Positions in quarter levels. Shapes are known by now, as the decoder will know them.
    fn places(&self, header: &BlockHeader, range: Range<usize>, factors: &[f64], leaves: &mut [Leaf]) {
        let extent = self.bounds.extent();
        let places = quantise_places(leaves.len(), |i| {
            let (leaf, at) = (&leaves[i], range.start + i);
            let within = self.settled_as(at, leaf.m).map_or(&self.within, |s| &s.within);
            let unit = header.unit_covariance(leaf.shape, factors[i]).unwrap_or(Sym3::scaled_identity(1.0));
            let (widths, [ba, ca, cb]) = cholesky(&unit);
            let step = header.place_step(header.radius(leaf.t), factors[i]);
            let levels = header.levels(&leaf.cell, extent, step, widths);
            let cell = leaf.cell.widths(extent);
            // Levels to a step of the block.
            let fine = each_axis(|k| if cell[k] > 0.0 { levels[k] as f64 * step / cell[k] } else { 0.0 });
            PlacementTarget {
                levels,
                place: each_axis(|k| within[k][at] * levels[k] as f64),
                coarse: each_axis(|k| if fine[k] > 0.0 { 1.0 / (fine[k] * widths[k]) } else { 0.0 }),
                moves: [ba * fine[1], ca * fine[2], cb * fine[2]],
            }
        });
        for (leaf, place) in leaves.iter_mut().zip(places) {
            [leaf.levels, leaf.place] = place;
        }
    }

    /// The predictions of sizes and of differences of counts, what they leave to plain low bits, and its spread.
    fn predictions(&self, header: &mut BlockHeader, leaves: &[Leaf]) {
        let (mut features, mut sizes) = (vec![[0; 3]; leaves.len()], vec![0; leaves.len()]);
        // Differences of log counts of two single or two groups of Gaussians, of a group and one, and of log masses.
        let (mut even, mut uneven, mut masses) = (Vec::new(), Vec::new(), Vec::new());
        for (tree, range) in self.segments.iter().zip(ranges(&self.tree)) {
            let leaves = &leaves[range.clone()];
            SegmentSource::new(tree, leaves, header.steps[2]).visit(
                |division| {
                    masses.push(division.mass);
                    match division.halves {
                        NodeHalves::Single(upper) => uneven.push(if upper { -division.count } else { division.count }),
                        _ => even.push(division.count),
                    }
                },
                |leaf, count, above| {
                    let at = range.start + leaf;
                    features[at] = [leaves[leaf].cell.level(), count, above];
                    sizes[at] = leaves[leaf].t >> 1;
                },
            );
        }
        let n = leaves.len();
        header.size = fit(n, |i| features[i].map(f64::from), |i| f64::from(sizes[i]));
        let mean = uneven.iter().map(|&d| f64::from(d)).sum::<f64>() / uneven.len().max(1) as f64;
        header.surplus = mean.round().clamp(-32_768.0, 32_767.0) as i16;
        let size = residuals((0..n).map(|i| sizes[i] - header.size.apply(features[i])));
        let surplus = i32::from(header.surplus);
        let count = residuals(even.iter().copied().chain(uneven.iter().map(|d| d - surplus)));
        header.low[..3].copy_from_slice(&[size.0, count.0, low_bits(masses.into_iter(), 6)]);
        header.spreads[..2].copy_from_slice(&[size.1 as f32, count.1 as f32]);
    }
}

/// Gaussians from which on a block's streams have stages.
const STAGED: usize = 4096;

/// Levels after which stages end, the same in all segments.
fn cuts(segments: &[RansWriter]) -> Vec<u8> {
    let recorded = |level: usize| segments.iter().map(|s| s.levels()[level]).sum::<usize>() as f64;
    let all = recorded(LEVELS - 1);
    let level = |share: f64| (0..LEVELS - 1).find(|&l| recorded(l) >= share * all).unwrap_or(LEVELS - 2) as u8;
    let mut cuts = STAGES.map(level).to_vec();
    // Two shares may fall into one level, but levels must rise strictly (section 4).
    cuts.dedup();
    cuts
}

fn ranges(tree: &Tree) -> Vec<Range<usize>> {
    let mut end = 0;
    let range = |n: usize| {
        end += n;
        end - n..end
    };
    tree.lengths().into_iter().map(range).collect()
}

/// Trellis indices as half steps.
fn halves(count: usize, sample: impl Fn(usize) -> TrellisSample) -> Vec<i32> {
    let mut state = TrellisState::default();
    let half = |k: i64| {
        let h = 2 * k as i32 + state.lattice();
        state.step(k);
        h
    };
    quantise(count, sample).into_iter().map(half).collect()
}

/// Plain low bits of what predictions leave, in steps, and its spread without those bits.
fn residuals(left: impl Iterator<Item = i32> + Clone) -> (u8, f64) {
    let low = low_bits(left.clone(), 6);
    let (n, sum) = left.fold((0.0, 0.0), |(n, sum), steps| (n + 1.0, sum + f64::from(steps) * f64::from(steps)));
    let rms: f64 = if n > 0.0 { sum / n } else { 0.0 };
    (low, rms.sqrt() / f64::from(1u32 << low))
}

/// The box that means are coded in: the particles' bounds, which hold the means of their moments.
/// Splats are placed by pictures alone and may leave it, so theirs grows to hold them.
/// Places of Gaussians within their leaves' cells, each in 0 to 1.
fn within_cells(g: &Mixture, bounds: &Bounds, order: &[u32], cells: &[TreeCell]) -> [Vec<f64>; 3] {
    let extent = bounds.extent();
    each_axis(|k| {
        parallel::map_range(order.len(), |at| {
            let (i, cell) = (order[at] as usize, &cells[at]);
            // A flat axis has one level, and all places lie in its middle.
            if extent[k] == 0.0 {
                return 0.5;
            }
            let u = (g.mean[k][i] - bounds.min[k]) / extent[k];
            (u * (1u64 << cell.depth[k]) as f64 - cell.index[k] as f64).clamp(0.0, 1.0)
        })
    })
}

fn box_of(block: &Block) -> Result<Bounds> {
    let g = &block.gaussians;
    let mut bounds = block.bounds;
    if g.law.alpha_blend().is_some() {
        (0..g.len()).for_each(|i| bounds.include(g.mean_of(i)));
    }
    match bounds.extent().iter().all(|e| e.is_finite()) {
        true => Ok(bounds),
        false => Err(Error::argument("cannot encode a block wider than the range of f64")),
    }
}

fn check(block: &Block) -> Result<()> {
    let g = &block.gaussians;
    let n = g.len();
    let whole = g.mean.iter().chain(&g.cov).chain(g.masses()).all(|c| c.len() == n);
    if n == 0 || n > u32::MAX as usize || !whole {
        return Err(Error::argument(format!(
            "cannot encode a block of {n} Gaussians, or with columns of different lengths"
        )));
    }
    if block.count == 0 || block.count > MOST_PARTICLES || !(block.mass > 0.0 && block.mass.is_finite()) {
        return Err(Error::argument(format!(
            "cannot encode a block of {} particles and mass {}",
            block.count, block.mass
        )));
    }
    let finite =
        g.mean.iter().chain(&g.cov).chain([&g.count]).chain(g.masses()).all(|c| c.iter().all(|v| v.is_finite()));
    let b = &block.bounds;
    if !finite || !(0..3).all(|k| b.min[k] <= b.max[k] && (b.max[k] - b.min[k]).is_finite()) {
        return Err(Error::argument("cannot encode a block with NaN or infinite numbers"));
    }
    if let Some(AlphaBlend { opacity, grey, .. }) = g.law.alpha_blend() {
        // 0 and 1 come of rounding, and are coded as the nearest opacity that can be.
        let opacities_valid = opacity.iter().all(|o| (0.0..=1.0).contains(o));
        let bright = grey.iter().all(|&v| v >= 0.0 && v.is_finite());
        if opacity.len() != n || grey.len() != n || !opacities_valid || !bright || g.masses().is_some() {
            let message = "cannot encode opacities outside [0, 1], grey levels below 0, or either together with masses";
            return Err(Error::argument(message));
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

    /// A rounded shape is turned a little: its length would become the box's thickness.
    #[test]
    fn flat_boxes_keep_their_thickness() {
        for edges in [[1.0, 1.0, 5e-4], [1e-4, 1.0, 1.0], [1.0, 1e-5, 1.0], [1.0, 1e-3, 1e-3], [1e-5, 1e-3, 1.0]] {
            let mut gaussians = Mixture::default();
            for i in 0..200 {
                let mut r = Random::new(8, 0, i);
                let mean = each_axis(|k| edges[k] * r.uniform());
                let [x, y, z] = edges.map(|e| e * (0.05 + 0.2 * r.uniform()));
                let cov = [x * x, 0.3 * x * y, -0.2 * x * z, y * y, 0.1 * y * z, z * z];
                gaussians.push(mean, Sym3(cov), 100.0, 0.0);
            }
            let bounds = Bounds { min: [0.0; 3], max: edges };
            let block = Block { bounds, count: 20_000, mass: 20_000.0, gaussians };
            let coded = Encoder::new(&block).unwrap().encode(&Precision::BALANCED);
            let decoded = decode_block(&coded, "a test").unwrap();
            let width = |b: &Block, k: usize| b.gaussians.cov[[0, 3, 5][k]].iter().sum::<f64>().sqrt();
            for k in 0..3 {
                let ratio = width(&decoded, k) / width(&block, k);
                assert!((0.85..1.18).contains(&ratio), "{edges:?} along {k}: {ratio}");
            }
            assert!(Encoder::new(&decoded).unwrap().encode(&Precision::BALANCED) == coded, "{edges:?}");
        }
    }

    /// Coarse steps add to what the floors leave: the sums of a decoder stay positive.
    #[test]
    fn the_flattest_gaussians_are_decoded_whatever_the_steps() {
        for thin in [1e-6, 1e-7, 1e-9, 1e-30] {
            let mut gaussians = Mixture::default();
            for i in 0..20_000 {
                let mut r = Random::new(9, 0, i);
                let (a, b) = (0.1 * (-9.0 * r.uniform()).exp(), 0.1 * (-30.0 * r.uniform()).exp());
                let (mean, turn) = ([r.uniform(), r.uniform(), thin * r.uniform()], (6.0 * r.uniform()).sin_cos());
                let across = Sym3::outer([0.0, 0.0, 0.1 * thin]);
                let cov = Sym3::outer([a * turn.0, a * turn.1, 0.0]).add(&Sym3::outer([-b * turn.1, b * turn.0, 0.0]));
                gaussians.push(mean, cov.add(&across), (9.0 * r.uniform()).exp(), 0.0);
            }
            let bounds = Bounds { min: [0.0; 3], max: [1.0, 1.0, thin] };
            let encoder = Encoder::new(&Block { bounds, count: 1 << 22, mass: 1e6, gaussians }).unwrap();
            for factor in [1.0, 2.0, 4.0, Precision::FACTORS[1]] {
                let coded = encoder.encode(&Precision::BALANCED.scaled(factor));
                assert!(decode_block(&coded, "a test").is_ok(), "1:{thin} at {factor} steps");
            }
        }
    }

    /// A decoded block codes to the same bytes at the same precision: training that settles on it
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
        let block = Block { bounds, count, mass: count as f64, gaussians };
        for factor in [0.5, 1.0, 1.7] {
            let precision = Precision::BALANCED.scaled(factor);
            let once = Encoder::new(&block).unwrap().encode(&precision);
            let decoded = decode_block(&once, "a test").unwrap();
            assert!(Encoder::new(&decoded).unwrap().encode(&precision) == once, "at {factor} steps");
        }
    }
}

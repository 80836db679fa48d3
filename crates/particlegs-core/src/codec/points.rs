//! Points alone, coded as a block codes its means: what a subset of the particles takes in bytes; and a random subset, as
//! many as a number of bytes holds: what users do who keep every k-th particle.

use super::OutOfRange;
use super::rans::{Coder, RansWriter};
use super::tree::{Segment, Splits, Tree, TreeCell, long_uniform, segments, walk};
use crate::context::Context;
use crate::math::{Purpose, Random, each_axis};
use crate::space::Bounds;
use crate::{Result, parallel};

/// Bounds, the number of points and the step: what a reader must know before the streams.
const HEAD_BYTES: usize = 6 * 8 + 8 + 8;
/// And the length of each stream.
const LENGTH_BYTES: usize = 4;
/// Levels along an edge of a cell at most.
const MOST_LEVELS: f64 = (1u64 << 40) as f64;

/// Points as a reader of their coded bytes has them.
#[derive(Clone, Debug, PartialEq)]
pub struct CodedPoints {
    /// Their places, in the order of the tree.
    pub position: [Vec<f64>; 3],
    /// Bytes that they take, with what stands before the streams.
    pub bytes: usize,
}

impl CodedPoints {
    /// Codes points (one at least) within `bounds` so that each comes back within half a `step` along every axis:
    /// the tree of boxes that a block's means are sorted into, with the same adaptive models, then the place in
    /// its leaf as one of as many levels as steps fit there. The streams are made, not estimated.
    pub fn new(points: &[Vec<f64>; 3], bounds: &Bounds, step: f64) -> CodedPoints {
        let tree = Tree::build(points, bounds);
        let lattice = Lattice { bounds, extent: bounds.extent(), step };
        let mut trunk_writer = RansWriter::default();
        let (mut splits, mut lows) = (Splits::new(), tree.trunk.iter());
        let trunk = segments(tree.order.len() as u32, lattice.extent, |node, _, _| {
            splits.code(&mut trunk_writer, node, lows.next().copied().unwrap_or(0))
        });
        debug_assert!(trunk.is_ok(), "splits are those of the tree");
        let starts = tree.lengths().into_iter().scan(0, |next, n| Some(std::mem::replace(next, *next + n)));
        let parts = parallel::map(tree.segments.iter().zip(starts), |(segment, start)| {
            let mut writer = RansWriter::default();
            let mut position: [Vec<f64>; 3] = Default::default();
            let point_of = |at: usize| each_axis(|k| points[k][tree.order[start + at] as usize]);
            let walk_result =
                lattice.walk(&mut writer, segment, point_of, |p| (0..3).for_each(|k| position[k].push(p[k])));
            debug_assert!(walk_result.is_ok(), "splits are those of the tree");
            (writer.finish().len(), position)
        });
        let bytes = HEAD_BYTES + trunk_writer.finish().len() + parts.iter().map(|p| LENGTH_BYTES + p.0).sum::<usize>();
        let mut position: [Vec<f64>; 3] = Default::default();
        for (_, part) in parts {
            position.iter_mut().zip(part).for_each(|(all, part)| all.extend(part));
        }
        CodedPoints { position, bytes }
    }
}

struct Lattice<'a> {
    bounds: &'a Bounds,
    extent: [f64; 3],
    step: f64,
}

impl Lattice<'_> {
    /// A segment's splits and places; `sink` gets each point as a reader has it. A writer takes from the segment's
    /// splits and from `point` what a reader reads.
    fn walk(
        &self,
        c: &mut impl Coder,
        segment: &Segment,
        point: impl Fn(usize) -> [f64; 3],
        mut sink: impl FnMut([f64; 3]),
    ) -> std::result::Result<(), OutOfRange> {
        let (mut splits, mut lows, mut done) = (Splits::new(), segment.splits.iter(), 0);
        walk(&segment.nodes, self.extent, 1, |node, axis| {
            if axis.is_some() {
                return splits.code(c, node, lows.next().copied().unwrap_or(0));
            }
            for _ in 0..node.count {
                sink(self.place(c, &node.cell, point(done)));
                done += 1;
            }
            Ok(0)
        })
    }

    fn place(&self, c: &mut impl Coder, cell: &TreeCell, point: [f64; 3]) -> [f64; 3] {
        let widths = cell.widths(self.extent);
        each_axis(|k| {
            let n = (widths[k] / self.step).ceil().clamp(1.0, MOST_LEVELS);
            let low = cell.point(self.bounds, self.extent, k, 0.0);
            let share = if widths[k] > 0.0 { (point[k] - low) / widths[k] } else { 0.0 };
            let level = ((share * n) as u64).min(n as u64 - 1);
            let level = if n > 1.0 { long_uniform(c, n as u64, level) } else { 0 };
            cell.point(self.bounds, self.extent, k, (level as f64 + 0.5) / n)
        })
    }
}

/// Points come back this close to their places along every axis, in mean spacings.
const CLOSENESS: f64 = 0.05;
/// Bits a point that the search begins with: what those of a clustered snapshot take.
const FIRST_GUESS: f64 = 14.0;
/// Trials of a number at most; four are usual.
const TRIALS: usize = 8;
/// A subset is as large as the bytes where it leaves less than this share of them.
const CLOSE_ENOUGH: f64 = 5e-3;
/// Of larger numbers a part is coded first, ...
const LARGE: usize = 1 << 18;
/// ... one in so many: among all a point takes this number's logarithm less, in bits.
const PART: usize = 16;

/// A subset as it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Thinning<'a> {
    /// The box that all points lie in.
    pub bounds: &'a Bounds,
    /// The mean spacing of all points, in their unit: positive, finite.
    pub spacing: f64,
    /// Bytes at most.
    pub bytes: u64,
    /// Of the random order.
    pub seed: u64,
}

impl Thinning<'_> {
    /// The most of `n` points whose places, coded, take at most the bytes, each within 0.05 of the spacing along every
    /// axis. They are the first of one random order of all points: their number is sought along the secant of the coded
    /// size, which is measured at every trial. `None` where not one fits. `place` is asked for finite places alone.
    pub fn most(
        &self,
        n: usize,
        place: impl Fn(usize) -> [f64; 3],
        context: &Context<'_>,
    ) -> Result<Option<CodedPoints>> {
        if n == 0 {
            return Ok(None);
        }
        context.begin("subset of the same bytes", 0);
        let mut order = RandomOrder::new(n, self.seed);
        let mut best: Option<(usize, CodedPoints)> = None;
        let bytes = self.bytes as f64;
        let mut number = share_of(n, 8.0 * bytes / FIRST_GUESS);
        if number > LARGE {
            let coded = self.coded(order.first(number / PART), &place);
            let bits = 8.0 * coded.bytes as f64 / (number / PART) as f64 - libm::log2(PART as f64);
            number = share_of(n, 8.0 * bytes / bits.max(1.0));
        }
        // What is known to be too many.
        let mut upper_bound = n + 1;
        for _ in 0..TRIALS {
            context.check()?;
            let coded = self.coded(order.first(number), &place);
            let used = coded.bytes as f64;
            if coded.bytes as u64 <= self.bytes {
                best = Some((number, coded));
            } else {
                upper_bound = number;
            }
            let lower_bound = best.as_ref().map_or(0, |b| b.0);
            let full = best.as_ref().is_some_and(|b| b.1.bytes as f64 >= (1.0 - CLOSE_ENOUGH) * bytes);
            if full || lower_bound + 1 >= upper_bound {
                break;
            }
            // The coded size is nearly proportional to the number; a little less is aimed at than fits.
            let next = share_of(n, number as f64 * (1.0 - 0.3 * CLOSE_ENOUGH) * bytes / used);
            number = next.clamp(lower_bound + 1, upper_bound - 1);
        }
        context.end();
        Ok(best.map(|b| b.1))
    }

    fn coded(&self, indices: &[usize], place: impl Fn(usize) -> [f64; 3]) -> CodedPoints {
        let mut points: [Vec<f64>; 3] = Default::default();
        for &i in indices {
            let p = place(i);
            (0..3).for_each(|k| points[k].push(p[k]));
        }
        CodedPoints::new(&points, self.bounds, 2.0 * CLOSENESS * self.spacing)
    }
}

fn share_of(n: usize, wanted: f64) -> usize {
    (wanted as usize).clamp(1, n)
}

/// All points in a random order, as far as it was asked for.
struct RandomOrder {
    random: Random,
    taken: Vec<u64>,
    order: Vec<usize>,
    n: usize,
}

impl RandomOrder {
    fn new(n: usize, seed: u64) -> Self {
        let random = Random::from_purpose(Purpose::CertificateSubset, seed, 0);
        RandomOrder { random, taken: vec![0; n.div_ceil(64)], order: Vec::new(), n }
    }

    fn first(&mut self, k: usize) -> &[usize] {
        while self.order.len() < k {
            // The upper half of the product is uniform below n, without a division.
            let i = ((u128::from(self.random.bits()) * self.n as u128) >> 64) as usize;
            let (word, bit) = (&mut self.taken[i / 64], 1u64 << (i % 64));
            if *word & bit == 0 {
                *word |= bit;
                self.order.push(i);
            }
        }
        &self.order[..k]
    }
}

#[cfg(test)]
mod tests {
    use super::super::rans::RansReader;
    use super::super::tree::SplitNode;
    use super::*;
    use crate::math::Random;

    fn clumps(n: u64) -> [Vec<f64>; 3] {
        each_axis(|k| {
            (0..n)
                .map(|i| {
                    let centre = 50.0 * Random::new(1, k as u32, i / 40).uniform();
                    (centre + 0.3 * Random::new(2, k as u32, i).normal()).clamp(0.0, 50.0)
                })
                .collect()
        })
    }

    #[test]
    fn points_come_back_within_half_a_step() {
        let bounds = Bounds { min: [0.0; 3], max: [50.0; 3] };
        // More than a segment's, and of one place.
        for (points, step) in
            [(clumps(80_000), 0.04), (clumps(3000), 1e-3), ([vec![7.0; 9], vec![7.0; 9], vec![0.0; 9]], 0.1)]
        {
            let tree = Tree::build(&points, &bounds);
            let coded = CodedPoints::new(&points, &bounds, step);
            assert_eq!(coded.position[2].len(), points[2].len());
            for (at, &i) in tree.order.iter().enumerate() {
                for k in 0..3 {
                    let difference = (coded.position[k][at] - points[k][i as usize]).abs();
                    assert!(difference <= 0.5 * step * (1.0 + 1e-9), "{difference}");
                }
            }
        }
    }

    /// A reader that has the stream alone finds the same places; so the bytes are enough.
    #[test]
    fn the_stream_is_enough() {
        let (points, bounds) = (clumps(5000), Bounds { min: [0.0; 3], max: [50.0; 3] });
        let tree = Tree::build(&points, &bounds);
        let lattice = Lattice { bounds: &bounds, extent: bounds.extent(), step: 0.04 };
        let mut writer = RansWriter::default();
        let mut written = Vec::new();
        let point_of = |at: usize| each_axis(|k| points[k][tree.order[at] as usize]);
        assert!(lattice.walk(&mut writer, &tree.segments[0], point_of, |p| written.push(p)).is_ok());
        let stream = writer.finish();
        let blank = Segment { nodes: vec![SplitNode::root(5000)], splits: Vec::new() };
        let (mut reader, mut decoded) = (RansReader::new(&stream).unwrap(), Vec::new());
        assert!(lattice.walk(&mut reader, &blank, |_| [0.0; 3], |p| decoded.push(p)).is_ok());
        assert!(reader.finished() && decoded == written);
        // Less than evenly spread points of that precision take: log2(cells / n) + log2(e) bits.
        let even = (1250f64.powi(3) / 5000.0).log2() + std::f64::consts::LOG2_E;
        let bits = 8.0 * stream.len() as f64 / 5000.0;
        assert!(bits < even - 2.0, "{bits} bits, evenly {even}");
    }
}

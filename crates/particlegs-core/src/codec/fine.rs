//! The rest of a segment's Gaussians, in the order of the tree: their numbers on half steps, shapes, and places
//! (docs/format.md, section 7).

use super::OutOfRange;
use super::header::{BlockHeader, cholesky, limited};
use super::levels::{NodeContent, TreeNode};
use super::rans::Coder;
use super::symbols::Residual;
use super::tree::{TreeCell, long_uniform};
use super::trellis::TrellisState;
use crate::math::{Sym3, exp};

/// Whole numbers of one Gaussian. `t`, `m`, `w` and `shape` are on half steps (2 k + lattice).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Leaf {
    pub cell: TreeCell,
    pub t: i32,
    /// Log count; in shaded blocks log depth.
    pub m: i32,
    /// Log mass a particle, relative, or in shaded blocks log grey level; 0 where neither is coded.
    pub w: i32,
    pub shape: [i32; 5],
    /// Levels of the cell's axes.
    pub levels: [u64; 3],
    /// Position in quarter levels.
    pub place: [u64; 3],
    /// Covariance of radius 1, as decoded.
    pub unit: Sym3,
    /// Geometric mean radius, world units, as decoded.
    pub radius: f64,
    /// Factor on the steps of shape and place.
    pub factor: f64,
    /// Particles, as decoded, before they are made whole; in shaded blocks the depth.
    pub count: f64,
}

/// Spreads in steps that shape models start from, by half octaves of what is expected.
const SPREADS: [f64; 12] = [0.1875, 0.25, 0.375, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0];
/// Shape numbers that the block's mean spread counts as, beside those of the Gaussian itself.
const MEAN_WEIGHT: f64 = 5.0;

pub(crate) struct FineWalk<'a> {
    header: &'a BlockHeader,
    extent: [f64; 3],
    powers: PowerCache,
    shapes: Vec<Residual<16>>,
    trellis_t: TrellisState,
    trellis_m: TrellisState,
    trellis_w: TrellisState,
    trellis_shape: TrellisState,
    trellis_place: TrellisState,
}

impl<'a> FineWalk<'a> {
    pub(crate) fn new(header: &'a BlockHeader) -> Self {
        let start = TrellisState::default();
        FineWalk {
            header,
            extent: header.bounds.extent(),
            powers: PowerCache::new(),
            shapes: (0..2 * SPREADS.len()).map(|class| Residual::bell(SPREADS[class / 2])).collect(),
            trellis_t: start,
            trellis_m: start,
            trellis_w: start,
            trellis_shape: start,
            trellis_place: start,
        }
    }

    /// Codes the next Gaussian: the one that the walk over levels left in `node`.
    #[inline(always)]
    pub(crate) fn code(&mut self, c: &mut impl Coder, node: &TreeNode, leaf: &mut Leaf) -> Result<(), OutOfRange> {
        let NodeContent::Gaussian { size, bits, place } = node.below else { return Err(OutOfRange) };
        leaf.cell = node.cell;
        leaf.t = self.trellis_t.half_steps(size);
        leaf.m = self.trellis_m.half_steps(node.count);
        leaf.w = if self.header.has_w() { self.trellis_w.half_steps(node.mass) } else { 0 };
        // Steps of shape and place hang on size and count, which both sides know by now.
        self.powers.fill(self.header, leaf);
        self.shape(c, leaf)?;
        self.place(c, leaf, bits, place)
    }

    #[inline(always)]
    fn shape(&mut self, c: &mut impl Coder, leaf: &mut Leaf) -> Result<(), OutOfRange> {
        let h = self.header;
        // Numbers of this Gaussian, and with less and less weight the block's.
        let mean = f64::from(h.spreads[2]) / leaf.factor;
        let mut sum = 0i64;
        for k in 0..5 {
            let expected = (MEAN_WEIGHT * mean + sum as f64) / (MEAN_WEIGHT + k as f64);
            let lattice = self.trellis_shape.lattice();
            let model = &mut self.shapes[2 * spread_class(expected, h.low[3]) + lattice as usize];
            let index = model.code(c, u32::from(h.low[3]), (leaf.shape[k] - lattice) >> 1);
            if index.unsigned_abs() > super::levels::MOST_STEPS as u32 {
                return Err(OutOfRange);
            }
            leaf.shape[k] = self.trellis_shape.half_steps(index);
            sum += i64::from(leaf.shape[k].abs());
        }
        leaf.unit = h.unit_covariance(leaf.shape, leaf.factor).ok_or(OutOfRange)?;
        Ok(())
    }

    #[inline(always)]
    fn place(&mut self, c: &mut impl Coder, leaf: &mut Leaf, bits: [u8; 3], part: [u8; 3]) -> Result<(), OutOfRange> {
        let h = self.header;
        let step = h.place_step(leaf.radius, leaf.factor);
        leaf.levels = h.levels(&leaf.cell, self.extent, step, cholesky(&leaf.unit).0);
        for k in 0..3 {
            let (n, part) = (leaf.levels[k], u64::from(part[k]));
            if n == 1 {
                // One level: the middle of the cell, and the trellis rests.
                leaf.place[k] = 2;
                if part != (1 << bits[k]) / 2 {
                    return Err(OutOfRange);
                }
                continue;
            }
            let lattice = self.trellis_place.lattice() as u64;
            let first = |part: u64| {
                // The first level at or behind the beginning of a part of the cell.
                let begin = 4 * n * part;
                let offset = (1 + 2 * lattice) << bits[k];
                begin.saturating_sub(offset).div_ceil(4 << bits[k]).min(n)
            };
            let (from, to) = (first(part), first(part + 1));
            let j = match to.saturating_sub(from) {
                0 => return Err(OutOfRange),
                1 => from,
                // An encoder's place holds its level in the bits above the quarters.
                count => from + long_uniform(c, count, (leaf.place[k] / 4).saturating_sub(from)),
            };
            self.trellis_place.step(j as i64);
            leaf.place[k] = 4 * j + 1 + 2 * lattice;
        }
        Ok(())
    }
}

/// Powers of sizes and counts that were met lately: few distinct ones follow each other.
struct PowerCache {
    /// Size, radius, share of the step factor.
    sizes: [(i32, f64, f64); POWERS],
    /// Count in half steps, count, share of the step factor.
    counts: [(i32, f64, f64); POWERS],
}

const POWERS: usize = 128;

impl PowerCache {
    fn new() -> Self {
        // No number on half steps is that low.
        let none = [(i32::MIN, 0.0, 0.0); POWERS];
        PowerCache { sizes: none, counts: none }
    }

    /// Radius, count and step factor of a Gaussian whose numbers are known.
    #[inline(always)]
    fn fill(&mut self, h: &BlockHeader, leaf: &mut Leaf) {
        // Negative numbers wrap in the cast, which gives them a place in the cache as well.
        let size = &mut self.sizes[leaf.t as usize % POWERS];
        if size.0 != leaf.t {
            *size = (leaf.t, h.radius(leaf.t), h.size_power(leaf.t));
        }
        let count = &mut self.counts[leaf.m as usize % POWERS];
        if count.0 != leaf.m {
            *count = (leaf.m, exp(h.log_count(leaf.m)), h.count_power(leaf.m));
        }
        (leaf.radius, leaf.count, leaf.factor) = (size.1, count.1, limited(size.2 * count.2));
    }
}

/// Half octaves of what is expected of a shape number in half steps, its plain low bits apart.
#[inline(always)]
fn spread_class(expected: f64, low: u8) -> usize {
    let e = expected / f64::from(1u32 << low);
    // The exponent of the square counts half octaves of e, as no logarithm of the platform may be used.
    let octaves = ((e * e).to_bits() >> 52) as i32 - 1023;
    (octaves + 4).clamp(0, SPREADS.len() as i32 - 1) as usize
}

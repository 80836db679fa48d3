//! Splits of the Gaussians of large nodes, and of points, into the halves of a cell (docs/format.md, section 5).

use super::OutOfRange;
use super::header::BlockHeader;
use super::rans::Coder;
use super::symbols::SymbolModel;
use super::tree::{SplitNode, segments};

/// Models of how nodes fall apart: by count (2 to 15, then powers of two) and share.
pub(super) struct Splits(Vec<[SymbolModel<16>; 3]>);

impl Splits {
    pub(super) fn new() -> Splits {
        let split = |n: u32| {
            // Both ends of a split are likelier than the middle.
            let top = if n < 16 { n as usize } else { 15 };
            let weights = std::array::from_fn(|l| {
                if l > top {
                    0
                } else if l == 0 || l == top {
                    4
                } else {
                    1
                }
            });
            [0, 1, 2].map(|_| SymbolModel::from_weights(weights))
        };
        Splits((2..16).chain([16, 32, 64, 128, 256]).map(split).collect())
    }

    #[inline(always)]
    pub(super) fn code(&mut self, c: &mut impl Coder, node: &SplitNode, low: u32) -> Result<u32, OutOfRange> {
        let n = node.count;
        if n < 16 {
            let low = self.0[n as usize - 2][node.share as usize].code(c, low.min(n) as usize) as u32;
            return if low <= n { Ok(low) } else { Err(OutOfRange) };
        }
        let class = 14 + (n.ilog2() - 4).min(4) as usize;
        let n1 = u64::from(n) + 1;
        let sixteenth = (u64::from(low.min(n)) * 16 / n1) as usize;
        let sixteenth = self.0[class][node.share as usize].code(c, sixteenth) as u64;
        let first = (sixteenth * n1).div_ceil(16);
        let size = ((sixteenth + 1) * n1).div_ceil(16) - first;
        Ok(first as u32 + long_uniform(c, size, u64::from(low).saturating_sub(first)) as u32)
    }
}

/// A value in `0 .. n`, `n` up to 2^60: the upper part as one uniform of at most 2^10, the rest plain.
#[inline(always)]
pub(super) fn long_uniform(c: &mut impl Coder, n: u64, value: u64) -> u64 {
    let low = (64 - n.leading_zeros()).saturating_sub(10);
    let high = c.uniform(((n - 1) >> low) as u32 + 1, (value >> low) as u32);
    ((u64::from(high) << low) | c.long_bits(low, value & ((1 << low) - 1))).min(n - 1)
}

/// The splits above the segments, and with them the segments' nodes. The encoder's `lows` say how many Gaussians
/// fall into each node's lower half; the decoder has none.
pub(super) fn trunk(c: &mut impl Coder, header: &BlockHeader, lows: &[u32]) -> Result<Vec<Vec<SplitNode>>, OutOfRange> {
    let (mut splits, mut lows) = (Splits::new(), lows.iter());
    segments(header.gaussians, header.bounds.extent(), |node, _, _| {
        splits.code(c, node, lows.next().copied().unwrap_or(0))
    })
}

//! The number of blocks that a bound on memory asks for.

use super::size::bytes_a_gaussian;
use particlegs_core::model::Target;
use particlegs_core::{Error, Result};
use particlegs_fit::Effort;

/// The program itself, its buffers and pictures. Measured: docs/results/full-scale.md.
const BASE: u64 = 150 << 20;
/// Refinement holds a few million particles with their candidates at a time.
const REFINING: u64 = 250 << 20;
/// A Gaussian while a block is cut, refined and coded.
const GAUSSIAN: u64 = 260;
/// A Gaussian of the whole model while it is put together, decoded and measured.
const DECODED: u64 = 160;
/// Fields of 256 x 256 x 256 cells while a block is measured.
const MEASURED: u64 = 400 << 20;
/// A Gaussian of the whole model while coded blocks are copied: they and the file made of them.
const COPIED: u64 = 16;

/// Numbers that decide the memory of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MemoryLoad {
    pub count: u64,
    pub raw_bytes: u64,
    pub target: Target,
    pub effort: Effort,
    /// Copies of a block's particles in memory: the fit's, and another where the block was read into
    /// memory.
    pub copies: u64,
    /// A block is measured by its own task.
    pub measuring: bool,
    /// Bytes that fields of all particles take while blocks are fitted.
    pub fields: u64,
}

impl MemoryLoad {
    /// The fewest blocks whose fits take at most `bound` bytes each.
    pub fn blocks_within(&self, bound: u64) -> Result<u32> {
        self.fewest(bound, |blocks| self.block_bytes(blocks))
    }

    /// The fewest blocks that take at most `bound` bytes each where every one has a process of its own:
    /// the whole model is then in none of them.
    pub fn tasks_within(&self, bound: u64) -> Result<u32> {
        self.fewest(bound, |blocks| self.task_bytes(blocks))
    }

    fn fewest(&self, bound: u64, bytes: impl Fn(u64) -> u64) -> Result<u32> {
        let fits = |blocks: u64| bytes(blocks) <= bound;
        let most = self.count.min(1 << 20);
        if !fits(most) {
            let subject = "even the smallest block".to_string();
            return Err(Error::Bound { what: subject, need_bytes: bytes(most), bound_bytes: bound });
        }
        // From here on `high` blocks fit and `low` do not; 0 stands for none at all.
        let (mut low, mut high) = (0, most);
        while high - low > 1 {
            let middle = (low + high) / 2;
            *(if fits(middle) { &mut high } else { &mut low }) = middle;
        }
        Ok(high as u32)
    }

    /// Bytes that a job in `blocks` blocks takes in one process, one block at a time.
    pub fn block_bytes(&self, blocks: u64) -> u64 {
        self.task_bytes(blocks).max(self.merge_bytes(true))
    }

    /// Bytes that putting the blocks together takes; where the model is `measured`, without the particles
    /// that it is measured on.
    pub fn merge_bytes(&self, measured: bool) -> u64 {
        BASE + self.gaussians() * if measured { DECODED } else { COPIED }
    }

    /// Bytes that one of `blocks` blocks takes in a process of its own.
    pub fn task_bytes(&self, blocks: u64) -> u64 {
        // Cuts through a sample are not exact.
        let share = |n: u64| (n as f64 / blocks.max(1) as f64 * 1.01) as u64;
        let gaussians = self.gaussians();
        let refining = REFINING.min(60 * share(self.count));
        let fit = self.copies * share(self.raw_bytes) + share(self.fields) + GAUSSIAN * share(gaussians) + refining;
        let measured = if self.measuring { share(self.raw_bytes) + DECODED * share(gaussians) + MEASURED } else { 0 };
        BASE + fit.max(measured)
    }

    /// Gaussians that the target will ask for.
    fn gaussians(&self) -> u64 {
        let target_gaussians = match (self.target, self.target.bytes(self.raw_bytes)) {
            (_, Some(bytes)) => (bytes as f64 / bytes_a_gaussian(self.effort)) as u64,
            (Target::Gaussians(number), _) => number,
            // A quality: as many as the default size has, and twice as many again.
            _ => 3 * (Target::Default.bytes(self.raw_bytes).unwrap_or(0) as f64 / bytes_a_gaussian(self.effort)) as u64,
        };
        target_gaussians.clamp(1, self.count.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_memory_asks_for_more_blocks() {
        let load = |ratio| MemoryLoad {
            count: 1 << 28,
            raw_bytes: 12 << 28,
            target: Target::Ratio(ratio),
            effort: Effort::Default,
            copies: 1,
            measuring: false,
            fields: 0,
        };
        let blocks = [16u64, 4, 2, 1].map(|gib| load(290.0).blocks_within(gib << 30).unwrap());
        assert_eq!(blocks[0], 1);
        assert!(blocks.windows(2).all(|w| w[0] < w[1]), "{blocks:?}");
        assert!(load(290.0).block_bytes(u64::from(blocks[3])) <= 1 << 30);
        assert!(load(290.0).block_bytes(u64::from(blocks[3]) - 1) > 1 << 30);
        assert!(matches!(load(290.0).blocks_within(100 << 20), Err(Error::Bound { .. })));
        // A model larger than the bound: no single process, but tasks.
        let vast = MemoryLoad { count: 1 << 36, raw_bytes: 12 << 36, ..load(300.0) };
        assert!(vast.blocks_within(8 << 30).is_err());
        assert!(vast.task_bytes(u64::from(vast.tasks_within(8 << 30).unwrap())) <= 8 << 30);
        assert!(vast.merge_bytes(true) > 8 << 30 && vast.merge_bytes(false) < vast.merge_bytes(true) / 5);
    }
}

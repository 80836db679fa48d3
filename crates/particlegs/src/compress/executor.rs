//! The one way in which blocks are done: read, fitted, coded, kept. Where their particles wait and where
//! coded blocks are kept is a [`BlockStore`]'s: memory and scratch files ([`super::in_memory`]) or the folder of
//! a job ([`crate::job`]).

use super::block::{BlockParticles, CodedBlock};
use super::clock::Clock;
use super::context::{BlockContext, StopPolicy};
use crate::Result;
use crate::checkpoint::{CheckpointStore, PrefixedCheckpoints};
use crate::model::Target;
use crate::progress::Progress;

/// Where the particles of a job's blocks wait, and its coded blocks are kept.
pub(crate) trait BlockStore {
    fn particles(&mut self, block: u32, progress: &dyn Progress) -> Result<BlockParticles>;

    fn keep(&mut self, block: u32, coded: CodedBlock, progress: &dyn Progress) -> Result<()>;
}

/// Does one block: its share of what `target` asks of the whole.
pub(crate) fn do_block(
    store: &mut dyn BlockStore,
    block: u32,
    target: Target,
    context: BlockContext<'_>,
    pieces: &mut dyn CheckpointStore,
) -> Result<()> {
    let mut clock = Clock::default();
    let particles = clock.time("read", || store.particles(block, context.progress))?;
    let coded = particles.code(context.plan.share(target, &particles)?, context, pieces)?;
    clock.append(coded.clock);
    store.keep(block, CodedBlock { clock, ..coded }, context.progress)
}

/// Does all blocks, one after the other: a fit itself uses all threads. Limits are those of all together;
/// what becomes of training that is stopped holds for the last block, as a file wants every block.
pub(crate) fn do_blocks(
    store: &mut dyn BlockStore,
    target: Target,
    context: BlockContext<'_>,
    pieces: &mut dyn CheckpointStore,
) -> Result<()> {
    let blocks = context.plan.recipe().blocks;
    for block in 0..blocks {
        let left = blocks - block;
        let mut limits = context.limits.share(left as usize);
        if blocks > 1 {
            limits.run = format!("block {block}");
        }
        let on_stop = if left > 1 { StopPolicy::GiveUp } else { context.on_stop };
        let context = BlockContext { limits: &limits, on_stop, ..context };
        do_block(
            store,
            block,
            target,
            context,
            &mut PrefixedCheckpoints { pieces: &mut *pieces, prefix: block.to_string() },
        )?;
    }
    Ok(())
}

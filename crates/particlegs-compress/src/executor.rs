//! The one way in which blocks are done: read, fitted, coded, kept. The places of their particles and of coded blocks
//! are a [`BlockStore`]'s: memory and scratch files ([`InMemoryBlocks`]) or the folder of a job ([`crate::job`]).

use super::block::{BlockParticles, CodedBlock};
use super::clock::Clock;
use super::options::Options;
use super::plan::{BlockSetup, StopPolicy};
use particlegs_core::Result;
use particlegs_core::checkpoint::{CheckpointStore, PrefixedCheckpoints};
use particlegs_core::context::Context;
use particlegs_core::model::Target;
use particlegs_core::space::Bounds;
use particlegs_particles::blocks::{KdTree, divide};
use particlegs_particles::{Chunk, Particles};

/// The place where the particles of a job's blocks wait, and its coded blocks are kept.
pub(crate) trait BlockStore {
    fn particles(&mut self, block: u32, context: &Context<'_>) -> Result<BlockParticles>;

    fn keep(&mut self, block: u32, coded: CodedBlock, context: &Context<'_>) -> Result<()>;
}

/// Does one block: its share of what `target` asks of the whole.
pub(crate) fn do_block(
    store: &mut dyn BlockStore,
    block: u32,
    target: Target,
    setup: BlockSetup<'_>,
    checkpoints: &mut dyn CheckpointStore,
) -> Result<()> {
    let mut clock = Clock::default();
    let particles = clock.time("read", || store.particles(block, setup.context))?;
    let coded = particles.code(setup.plan.share(target, &particles)?, setup, checkpoints)?;
    clock.append(coded.clock);
    store.keep(block, CodedBlock { clock, ..coded }, setup.context)
}

/// Does all blocks, one after the other: a fit itself uses all threads. Limits are those of all together;
/// what becomes of training that is stopped holds for the last block, as a file wants every block.
pub(crate) fn do_blocks(
    store: &mut dyn BlockStore,
    target: Target,
    setup: BlockSetup<'_>,
    checkpoints: &mut dyn CheckpointStore,
) -> Result<()> {
    let blocks = setup.plan.recipe().blocks;
    for block in 0..blocks {
        let left = blocks - block;
        // An equal share of the time that is left now: what a block has not used goes to the later ones.
        let mut limits = setup.limits.share(left as usize);
        if blocks > 1 {
            limits.run = format!("block {block}");
        }
        let on_stop = if left > 1 { StopPolicy::GiveUp } else { setup.on_stop };
        let setup = BlockSetup { limits: &limits, on_stop, ..setup };
        do_block(
            store,
            block,
            target,
            setup,
            &mut PrefixedCheckpoints { pieces: &mut *checkpoints, prefix: block.to_string() },
        )?;
    }
    Ok(())
}

/// The blocks of particles in this process.
pub(super) struct InMemoryBlocks {
    blocks: Vec<BlockParticles>,
    coded: Vec<Option<CodedBlock>>,
}

impl InMemoryBlocks {
    /// Divides particles as the tree says; what is copied goes where the options say. `layer_bounds` are the
    /// bounds of their layers.
    pub fn new(
        particles: &Particles,
        tree: &KdTree,
        layer_bounds: &[Bounds],
        options: &Options,
        context: &Context<'_>,
    ) -> Result<Self> {
        let law = options.law();
        let blocks: Vec<BlockParticles> = match tree.blocks() {
            1 => vec![BlockParticles::with_bounds(particles, law, layer_bounds)],
            blocks => {
                let blocks_of = |chunk: &Chunk<'_>| tree.blocks_of(chunk).collect();
                let parts = divide(particles, blocks as usize, &blocks_of, &options.storage, context)?;
                parts.iter().map(|p| BlockParticles::new(p, law)).collect()
            }
        };
        let coded = blocks.iter().map(|_| None).collect();
        Ok(InMemoryBlocks { blocks, coded })
    }

    /// Takes the coded blocks away; all of them are done.
    pub fn take_coded(&mut self) -> Vec<CodedBlock> {
        self.coded.iter_mut().filter_map(Option::take).collect()
    }
}

impl BlockStore for InMemoryBlocks {
    fn particles(&mut self, block: u32, _: &Context<'_>) -> Result<BlockParticles> {
        Ok(self.blocks[block as usize].clone())
    }

    fn keep(&mut self, block: u32, coded: CodedBlock, _: &Context<'_>) -> Result<()> {
        self.coded[block as usize] = Some(coded);
        Ok(())
    }
}

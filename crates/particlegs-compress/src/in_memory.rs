//! Particles in this process divided into blocks, in memory or scratch files, and the blocks made of them.

use super::block::{BlockParticles, CodedBlock};
use super::executor::BlockStore;
use super::options::Options;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::space::Bounds;
use particlegs_particles::blocks::{KdTree, divide};
use particlegs_particles::{Chunk, Particles};

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

//! The state of a job, and checks of its files.

use super::manifest::JobFolder;
use super::scatter::Buckets;
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::{Error, Result, codec};
use particlegs_particles::LayeredParticles;
use particlegs_particles::blocks::SnapshotScan;
use serde::Serialize;

/// State of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// The file of the task is there.
    Done,
    /// A checkpoint is there.
    Checkpointed,
    /// Nothing is there.
    Missing,
}

/// State of a job.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobStatus {
    /// Chunks of the snapshot, bucketed or missing.
    pub chunks: Vec<State>,
    /// State of each block.
    pub blocks: Vec<State>,
    /// Bytes of the model files of blocks that are done.
    pub model_bytes: u64,
    /// Gaussians in them.
    pub gaussians: u64,
    /// Particles in them, and in all.
    pub particles: [u64; 2],
    /// Seconds that they took, all phases.
    pub seconds: f64,
}

impl JobFolder {
    /// The state by the files in the folder, without reading them through.
    pub fn status(&self) -> Result<JobStatus> {
        let m = &self.manifest;
        let chunk = |c| if self.chunk_path(c).is_file() { State::Done } else { State::Missing };
        let mut status = JobStatus {
            chunks: (0..m.chunks).map(chunk).collect(),
            blocks: Vec::new(),
            model_bytes: 0,
            gaussians: 0,
            particles: [0, m.plan.metadata.count],
            seconds: 0.0,
        };
        for block in 0..m.plan.recipe().blocks {
            let report =
                self.report(block)?.filter(|_| self.block_path(block, "pgs").is_file() && self.is_measured(block));
            status.blocks.push(match &report {
                Some(_) => State::Done,
                None if self.block_path(block, "checkpoint").is_file() => State::Checkpointed,
                None => State::Missing,
            });
            if let Some(r) = report {
                // Reports are files: their numbers may be any.
                let add = |sum: &mut u64, n: u64| *sum = sum.saturating_add(n);
                add(&mut status.model_bytes, r.bytes);
                add(&mut status.gaussians, r.gaussians);
                add(&mut status.particles[0], r.particles);
                status.seconds += r.seconds.iter().map(|s| s.1).sum::<f64>();
            }
        }
        Ok(status)
    }

    /// Reads every file through that is there: buckets, blocks, and the snapshot where `source` gives it. Blocks
    /// hold particles of their own part of space, and all blocks together as many as were planned.
    pub fn verify(&self, source: Option<LayeredParticles>, context: &Context<'_>) -> Result<()> {
        let m = &self.manifest;
        if let Some(source) = source {
            let scan = SnapshotScan::new(&self.as_planned(source)?, &m.plan.metadata.source, false, context)?;
            if scan.runs != self.runs {
                return Err(self.changed("its particles are different"));
            }
        }
        context.begin("verifying", m.chunks + u64::from(m.plan.recipe().blocks));
        for chunk in (0..m.chunks).filter(|c| self.chunk_path(*c).is_file()) {
            context.check()?;
            Buckets::open(self, chunk)?.check()?;
            context.advance(1);
        }
        let missing = self.missing()?;
        let mut particles = 0u64;
        for block in (0..m.plan.recipe().blocks).filter(|b| missing.binary_search(b).is_err()) {
            context.check()?;
            particles = particles.saturating_add(self.verify_block(block)?);
            context.advance(1);
        }
        context.end();
        if missing.is_empty() && particles != m.plan.metadata.count {
            let message = format!("the blocks have {particles} particles, but the plan has {}", m.plan.metadata.count);
            return Err(Error::input(&self.folder, message));
        }
        Ok(())
    }

    /// Decodes a block that is done; gives its particles.
    fn verify_block(&self, block: u32) -> Result<u64> {
        self.check_sums(block)?;
        let path = self.block_path(block, "pgs");
        let mut particles = 0u64;
        for coded in self.done_block(block)?.layers.iter().flat_map(|l| &l.content) {
            let decoded = codec::decode_block(&coded.bytes, &path.display().to_string())?;
            // Cuts are those of float32 about the origin, so corners are rounded as the particles were.
            let corner = |c: [f64; 3]| each_axis(|k| (c[k] - self.manifest.origin[k]) as f32);
            let reached = self.manifest.plan.tree.blocks_in(corner(decoded.bounds.min), corner(decoded.bounds.max));
            if !reached.contains(&block) {
                let message = format!("the particles in the file are not those of block {block}");
                return Err(Error::input_with(&path, message, self.run_again("block", block, true)));
            }
            particles = particles.saturating_add(decoded.count);
        }
        Ok(particles)
    }
}

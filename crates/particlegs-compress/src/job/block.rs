//! One block of a job: read, fitted, coded, written.

use super::fields::FieldBits;
use super::manifest::JobFolder;
use super::no_part;
use crate::{BlockParticles, BlockSetup, BlockStore, Checkpoint, CodedBlock, SizeOutcome, StopPolicy, do_block};
use particlegs_core::context::Context;
use particlegs_core::model::hex;
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_files::model_file;
use particlegs_files::output;
use particlegs_particles::{LayeredParticles, Particles};
use particlegs_train::Limits;
use serde::{Deserialize, Serialize};

/// The report on a block that is done: `blocks/00000.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlockReport {
    /// The plan that it belongs to, BLAKE3 of plan.json.
    pub plan: String,
    /// The block's number, counted from 0.
    pub block: u32,
    /// BLAKE3 of its model file.
    pub model: String,
    /// Bytes of its model file.
    pub bytes: u64,
    /// Number of particles.
    pub particles: u64,
    /// Number of Gaussians.
    pub gaussians: u64,
    /// Multiple of the nominal steps, of the largest layer.
    pub step_factor: f64,
    pub(super) size_met: SizeOutcome,
    /// Wall-clock seconds by phase.
    pub seconds: Vec<(String, f64)>,
    /// Parts that a checkpoint held when the block was done just now; `None` where it was done before.
    #[serde(skip)]
    pub continued: Option<usize>,
}

const REPORT: Form = Form { title: "a block's report", begins: Begins::Object, most: 1 << 20, expansion: 16 };

impl JobFolder {
    /// Does block `block`: nothing where it is done, the rest where a checkpoint is there. `source`
    /// opens the snapshot where it is read in place. Writes `blocks/00000.pgs`, a model file of the
    /// block alone, then its report.
    pub fn block(
        &self,
        block: u64,
        source: impl FnOnce() -> Result<LayeredParticles>,
        context: &Context<'_>,
    ) -> Result<BlockReport> {
        let blocks = self.manifest.plan.recipe().blocks;
        let number = u32::try_from(block).ok().filter(|number| *number < blocks);
        let block = number.ok_or_else(|| no_part("block", block, blocks.into()))?;
        if let Some(report) = self.report(block)?
            && self.block_path(block, "pgs").metadata().is_ok_and(|m| m.len() == report.bytes)
        {
            // Lost sums cost another measurement, but no other fit.
            if !self.is_measured(block) {
                let (particles, fields) = self.gather(block, source, context)?;
                let file = model_file::read_file(&self.block_path(block, "pgs"), context)?;
                self.measure(block, &file, (&particles, &fields), context)?;
            }
            return Ok(report);
        }
        let mut checkpoint = Checkpoint::open(self.block_path(block, "checkpoint"), &self.id)?;
        if checkpoint.fault().is_some() {
            let place = checkpoint.path().display();
            context.message(&format!(
                "warning: {place}: the checkpoint is damaged or of another plan; the block starts again"
            ));
        }
        let before = checkpoint.len();
        let plan = &self.manifest.plan;
        let limits = Limits { scratch: Some(self.folder.clone()), ..Limits::default() };
        let setup = BlockSetup { plan, limits: &limits, on_stop: StopPolicy::GiveUp, context };
        let mut folder = JobBlockStore { job: self, source: Some(source), particles: None, report: None };
        if let Err(error) = do_block(&mut folder, block, plan.recipe().target, setup, &mut checkpoint) {
            // What stopped the block is told; that its pieces could not be kept as well, only beside it.
            if let Err(e) = checkpoint.save() {
                context.message(&format!("warning: the checkpoint was not saved: {e}"));
            }
            return Err(error);
        }
        checkpoint.remove()?;
        Ok(BlockReport { continued: Some(before), ..folder.report.expect("a block that is kept") })
    }

    /// The report on a block; `None` if it is not done, or for another plan.
    pub(super) fn report(&self, block: u32) -> Result<Option<BlockReport>> {
        let path = self.block_path(block, "json");
        let text = match read_own(&path, REPORT) {
            Ok(Some(text)) => text,
            Ok(None) | Err(Error::Input { .. }) => return Ok(None),
            Err(e) => return Err(e),
        };
        let report: Option<BlockReport> = serde_json::from_slice(&text).ok();
        Ok(report.filter(|r| r.plan == hex(&self.id) && r.block == block))
    }
}

/// The folder while a block is done.
struct JobBlockStore<'a, F> {
    job: &'a JobFolder,
    source: Option<F>,
    /// The block's particles and fields, for measurements and for the fields of its file.
    particles: Option<(Particles, FieldBits)>,
    report: Option<BlockReport>,
}

impl<F: FnOnce() -> Result<LayeredParticles>> BlockStore for JobBlockStore<'_, F> {
    fn particles(&mut self, block: u32, context: &Context<'_>) -> Result<BlockParticles> {
        let source = self.source.take().ok_or_else(|| Error::argument("the snapshot was opened a second time"))?;
        let (particles, fields) = self.job.gather(block, source, context)?;
        if particles.is_empty() {
            return Err(Error::input(&self.job.folder, format!("block {block} has no particles")));
        }
        let block_particles = BlockParticles::new(&particles, self.job.manifest.plan.metadata.law);
        // Columns are shared, not copied.
        self.particles = Some((particles, fields));
        Ok(block_particles)
    }

    fn keep(&mut self, block: u32, coded: CodedBlock, context: &Context<'_>) -> Result<()> {
        let job = self.job;
        let mut bytes = job.manifest.plan.block_file(&coded)?;
        codec::check(&bytes, "the block just coded", context)?;
        let particles = self.particles.take();
        if let Some((particles, fields)) = &particles {
            bytes = job.with_fields(bytes, particles, fields, context)?;
        }
        output::write_bytes(&job.block_path(block, "pgs"), &bytes)?;
        if let Some((particles, fields)) = &particles {
            job.measure(block, &bytes, (particles, fields), context)?;
        }
        let info = codec::read_info(&bytes, "the block just coded")?;
        let report = BlockReport {
            plan: hex(&job.id),
            block,
            model: blake3::hash(&bytes).to_hex().to_string(),
            bytes: bytes.len() as u64,
            particles: info.metadata.count,
            gaussians: info.gaussians() as u64,
            step_factor: coded.step_factor,
            size_met: coded.size_met,
            seconds: coded.clock.seconds().into_iter().map(|(phase, s)| (phase.into(), s)).collect(),
            continued: None,
        };
        let text = serde_json::to_string_pretty(&report).expect("plain data") + "\n";
        // The report comes last: a block with a report is done.
        output::write_bytes(&job.block_path(block, "json"), text.as_bytes())?;
        self.report = Some(report);
        Ok(())
    }
}

//! The job's file from its blocks' files.

use super::manifest::Job;
use crate::codec::{self, CodedLayer};
use crate::compress::Outcome;
use crate::model::VizMapper;
use crate::particles::{Particles, source_hash};
use crate::progress::{Progress, Silent};
use crate::{Error, Result, score};

impl Job {
    /// Puts the file together: the same bytes whatever ran where and in what order. With `particles`
    /// the decoded model is measured on them and the file holds the certificate.
    ///
    /// # Errors
    /// [`Error::Input`] naming blocks that are missing or broken, or where `particles` are not the
    /// snapshot that was planned; [`Error::Unreachable`] where a size asked for cannot be met.
    pub fn merge(&self, particles: Option<&Particles>, progress: &dyn Progress) -> Result<Vec<u8>> {
        let plan = &self.manifest.plan;
        if particles.is_some_and(|p| source_hash(p) != plan.metadata.source_hash) {
            return Err(self.changed("its hash is another"));
        }
        self.check_done()?;
        progress.begin("merging", u64::from(plan.blocks));
        let (mut layers, mut outcomes): (Vec<CodedLayer>, Vec<Outcome>) = Default::default();
        let mut network = None;
        for block in 0..plan.blocks {
            progress.check()?;
            let (coded, vizmapper, outcome) = self.done_block(block)?;
            layers.extend(coded);
            if block == 0 {
                network = vizmapper;
            }
            outcomes.push(outcome);
            progress.advance(1);
        }
        progress.end();
        let bytes = layers.iter().flat_map(|l| &l.blocks).map(|b| b.len() as u64).sum();
        plan.judge(&outcomes, bytes, progress)?;
        let bytes = plan.file(layers.iter(), network.as_ref(), None)?;
        let (count, planned) = (codec::read_metadata(&bytes, "the merged file")?.count, plan.metadata.count);
        if count != planned {
            return Err(Error::input(
                &self.folder,
                format!("its blocks hold {count} particles, {planned} were planned"),
            ));
        }
        let Some(particles) = particles else {
            codec::check(&bytes, "the merged file", progress)?;
            return Ok(bytes);
        };
        let model = codec::decode_with(&bytes, "the merged file", progress)?;
        let certificate = score::certificate(&model, particles, plan.seed, None, progress)?;
        plan.file(layers.iter(), network.as_ref(), Some(&certificate))
    }

    /// Are all blocks done?
    ///
    /// # Errors
    /// [`Error::Input`] naming those that are not.
    pub fn check_done(&self) -> Result<()> {
        let missing = self.missing()?;
        let Some(first) = missing.first() else { return Ok(()) };
        let blocks = self.manifest.plan.blocks;
        let what = format!("blocks not fitted yet: {} ({} of {blocks})", some(&missing), missing.len());
        Err(Error::input_hint(&self.folder, what, format!("run `particlegs block {} {first}`", self.folder.display())))
    }

    /// A done block's coded layers and network.
    pub(super) fn done_block(&self, block: u32) -> Result<(Vec<CodedLayer>, Option<VizMapper>, Outcome)> {
        let path = self.block_path(block, "pgs");
        let broken = |what: &str| {
            let hint = format!("delete it and run `particlegs block {} {block}`", self.folder.display());
            Error::input_hint(&path, what, hint)
        };
        let report = self.report(block)?.ok_or_else(|| broken("its report is missing"))?;
        let bytes = match codec::read_file(&path, &Silent) {
            Err(Error::Corrupt { what, .. } | Error::Compatibility { what, .. }) => return Err(broken(&what)),
            read => read?,
        };
        if blake3::hash(&bytes).to_hex().as_str() != report.model {
            return Err(broken("incomplete or altered: it does not match its report"));
        }
        let name = path.display().to_string();
        let vizmapper = codec::read_info(&bytes, &name)?.vizmapper;
        Ok((codec::coded_layers(&bytes, &name)?, vizmapper, report.outcome))
    }

    /// Blocks that are not done.
    pub(super) fn missing(&self) -> Result<Vec<u32>> {
        let mut missing = Vec::new();
        for block in 0..self.manifest.plan.blocks {
            if self.report(block)?.is_none() || !self.block_path(block, "pgs").is_file() {
                missing.push(block);
            }
        }
        Ok(missing)
    }
}

/// The first few of some numbers.
fn some(numbers: &[u32]) -> String {
    const FEW: usize = 8;
    let first: Vec<String> = numbers.iter().take(FEW).map(u32::to_string).collect();
    let more = if numbers.len() > FEW { format!(" and {} more", numbers.len() - FEW) } else { String::new() };
    first.join(", ") + &more
}

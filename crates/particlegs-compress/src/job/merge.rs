//! The job's file from its blocks' files.

use super::manifest::JobFolder;
use crate::{CodedBlock, DecodedFile, FieldSelection};
use particlegs_core::codec::{StoredBlock, StoredSection};
use particlegs_core::context::Context;
use particlegs_core::model::{Certificate, CertificateLevel, FieldAgreements};
use particlegs_core::{Error, Hint, Result, codec};
use particlegs_files::model_file;
use particlegs_measure::score::CertificateInput;
use particlegs_particles::{LayerFields, Particles};
use std::fmt::Display;

impl JobFolder {
    /// Puts the file together: the same bytes whatever ran where and in what order. The decoded model is measured on
    /// `particles` and the fields of their layers, as much as the level says, or by what the blocks' tasks measured,
    /// and the file holds the certificate.
    pub fn merge(
        &self,
        level: CertificateLevel,
        particles: Option<(&Particles, &[LayerFields])>,
        context: &Context<'_>,
    ) -> Result<Vec<u8>> {
        let plan = &self.manifest.plan;
        if particles.is_some_and(|(p, _)| p.source_hash() != plan.metadata.source_hash) {
            return Err(self.changed("its hash is different"));
        }
        self.check_done()?;
        context.begin("merging", u64::from(plan.recipe().blocks));
        let mut blocks = Vec::new();
        for block in 0..plan.recipe().blocks {
            context.check()?;
            blocks.push(self.done_block(block)?);
            context.advance(1);
        }
        context.end();
        // The file is measured without fields, which are added to it then.
        let sections = stored(&mut blocks).map(|b| std::mem::take(&mut b.sections)).collect();
        plan.judge(&blocks)?.iter().for_each(|note| context.message(&format!("note: {note}")));
        let add = |n: u64, b: &CodedBlock| Ok::<_, Error>(n.saturating_add(codec::sums(&b.layers)?.0));
        let (count, planned) = (blocks.iter().try_fold(0, add)?, plan.metadata.count);
        // Each block may be sound on its own: only together they show that particles are missing or doubled.
        if count != planned {
            return Err(Error::input(
                &self.folder,
                format!("the blocks have {count} particles, but the plan has {planned}"),
            ));
        }
        let file = |certificate: Option<&Certificate>| plan.file(&blocks, certificate);
        let certificate = match level {
            CertificateLevel::None => None,
            CertificateLevel::Blocks => Some(self.added_up(context)?),
            CertificateLevel::Quick | CertificateLevel::Full => {
                let needed = || Error::argument("this certificate needs the snapshot");
                let (particles, fields) = particles.ok_or_else(needed)?;
                let seed = plan.recipe().seed;
                let measure = CertificateInput { particles, seed, level, memory: None, reached: None };
                let DecodedFile { bytes, model, .. } = DecodedFile::new(file, Some(measure), context)?;
                let selection = FieldSelection::planned(self.manifest.fields.clone(), particles, fields);
                return self.with_sections(bytes, blocks, sections, selection.agreement(&model, seed, context)?);
            }
        };
        let fields = certificate.as_ref().and_then(|c| c.fields);
        // Looked at block by block, in less memory than the whole model takes.
        let bytes = self.with_sections(file(certificate.as_ref())?, blocks, sections, fields)?;
        codec::check(&bytes, "the merged file", context)?;
        Ok(bytes)
    }

    /// The file with the sections that were taken from its blocks, and the agreement of fields in its certificate.
    fn with_sections(
        &self,
        bytes: Vec<u8>,
        mut blocks: Vec<CodedBlock>,
        sections: Vec<Vec<StoredSection>>,
        fields: Option<FieldAgreements>,
    ) -> Result<Vec<u8>> {
        if !self.has_fields() {
            return Ok(bytes);
        }
        stored(&mut blocks).zip(sections).for_each(|(block, block_sections)| block.sections = block_sections);
        let mut plan = self.manifest.plan.clone();
        plan.metadata.fields.clone_from(&self.manifest.fields.quantities);
        // As the file has it, rounded.
        let certificate = codec::read_info(&bytes, "the merged file")?.certificate;
        plan.file(&blocks, certificate.map(|c| Certificate { fields, ..c }).as_ref())
    }

    /// Checks that all blocks are done.
    ///
    /// # Errors
    /// [`Error::Input`] names the blocks that are not.
    pub fn check_done(&self) -> Result<()> {
        let missing = self.missing()?;
        let Some(first) = missing.first() else { return Ok(()) };
        let blocks = self.manifest.plan.recipe().blocks;
        let message = format!("blocks not fitted yet: {} ({} of {blocks})", some(&missing), missing.len());
        Err(Error::input_with(&self.folder, message, self.run_again("block", *first, false)))
    }

    /// A command is to be run for a chunk or a block, again where what is there is broken.
    pub(super) fn run_again(&self, command: &'static str, number: impl Display, broken: bool) -> Hint {
        let hint = Hint::from(if broken { "delete it and run " } else { "run " });
        hint.command(command, format!("{} {number}", self.folder.display()))
    }

    pub(super) fn done_block(&self, block: u32) -> Result<CodedBlock> {
        let path = self.block_path(block, "pgs");
        let broken = |fault: &str| Error::input_with(&path, fault, self.run_again("block", block, true));
        let report = self.report(block)?.ok_or_else(|| broken("its report is missing"))?;
        let bytes = match model_file::read_file(&path, &Context::SILENT) {
            Err(Error::Corrupt { what, .. } | Error::Compatibility { what, .. }) => return Err(broken(&what)),
            read => read?,
        };
        if blake3::hash(&bytes).to_hex().as_str() != report.model {
            return Err(broken("the file is incomplete or was changed: it does not match its report"));
        }
        let name = path.display().to_string();
        let info = codec::read_info(&bytes, &name)?;
        Ok(CodedBlock {
            layers: codec::coded_layers(&bytes, &name)?,
            vizmapper: info.vizmapper,
            step_factor: report.step_factor,
            size_met: report.size_met,
            ..CodedBlock::empty(info.metadata.bounds)
        })
    }

    pub(super) fn missing(&self) -> Result<Vec<u32>> {
        let mut missing = Vec::new();
        for block in 0..self.manifest.plan.recipe().blocks {
            let is_present = self.block_path(block, "pgs").is_file() && self.is_measured(block);
            if self.report(block)?.is_none() || !is_present {
                missing.push(block);
            }
        }
        Ok(missing)
    }
}

/// The blocks of all layers.
fn stored(blocks: &mut [CodedBlock]) -> impl Iterator<Item = &mut StoredBlock> {
    blocks.iter_mut().flat_map(|b| &mut b.layers).flat_map(|l| &mut l.content)
}

/// The first few of some numbers.
fn some(numbers: &[u32]) -> String {
    const FEW: usize = 8;
    let first: Vec<String> = numbers.iter().take(FEW).map(u32::to_string).collect();
    let more = if numbers.len() > FEW { format!(" and {} more", numbers.len() - FEW) } else { String::new() };
    first.join(", ") + &more
}

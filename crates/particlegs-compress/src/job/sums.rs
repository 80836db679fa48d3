//! `blocks/00000.sums`: measurements of a block's task on its particles and its decoded model, to be added up.
//!
//! Little-endian: magic, the plan's id; the sections of [`SumsSection::ALL`], one after the other; for each its u64
//! length and CRC-32; CRC-32 of all that is neither section nor this. One section is read without the others.

use super::fields::FieldBits;
use super::manifest::JobFolder;
use particlegs_core::context::Context;
use particlegs_core::model::{Certificate, CertificateLevel};
use particlegs_core::{Error, Hint, Result, codec};
use particlegs_files::input::open_file;
use particlegs_files::output;
use particlegs_measure::score::{MeasurementFrame, PartSums, SumsSection, field_section};
use particlegs_particles::Particles;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

const MAGIC: &[u8; 8] = b"PGSSUMS2";
const HEAD: usize = 8 + 32;
const CHANGED: &str = "the file was changed";
/// A section's length and checksum.
const ENTRY: usize = 8 + 4;
const TAIL: usize = ENTRY * SumsSection::ALL.len() + 4;

impl JobFolder {
    /// Whether the measurements that the plan wants of a block are there.
    pub(super) fn is_measured(&self, block: u32) -> bool {
        self.certificate() != CertificateLevel::Blocks || self.block_path(block, "sums").is_file()
    }

    /// Measures a block, `file` being the bytes of its model, where the plan wants it.
    pub(super) fn measure(
        &self,
        block: u32,
        file: &[u8],
        (particles, fields): (&Particles, &FieldBits),
        context: &Context<'_>,
    ) -> Result<()> {
        if self.certificate() != CertificateLevel::Blocks {
            return Ok(());
        }
        let plan = &self.manifest.plan;
        let mut model = codec::decode_with(file, "the block just coded", context)?;
        // Drawn as a part of the whole.
        model.metadata.bounds = plan.metadata.bounds;
        let frame = MeasurementFrame::new(&plan.metadata, plan.recipe().seed);
        let mut failed = None;
        context.begin("measuring the block", 0);
        let fields = self.field_sums(&model, (particles, fields), &frame.fields, context)?;
        let fill = |to: &mut dyn Write| {
            to.write_all(MAGIC)?;
            to.write_all(&self.id)?;
            let mut tail = Vec::with_capacity(TAIL);
            for section in SumsSection::ALL {
                let measured = match section {
                    SumsSection::Field(number) => Ok(fields.get(number).map_or(Vec::new(), field_section)),
                    _ => frame.measure(section, &model, particles, context),
                };
                let bytes = measured.map_err(|e| {
                    // The writer takes errors of files alone: the true one waits beside it.
                    failed = Some(e);
                    std::io::Error::other("not measured")
                })?;
                tail.extend((bytes.len() as u64).to_le_bytes());
                tail.extend(crc32fast::hash(&bytes).to_le_bytes());
                to.write_all(&bytes)?;
            }
            tail.extend(self.checksum(&tail).to_le_bytes());
            to.write_all(&tail)
        };
        let written = output::write_atomic(&self.block_path(block, "sums"), fill);
        context.end();
        // What kept it from being measured says more than that nothing was written.
        failed.map_or(written, Err)
    }

    /// CRC-32 of the bytes about the sections: magic, id and `entries`.
    fn checksum(&self, entries: &[u8]) -> u32 {
        let mut h = crc32fast::Hasher::new();
        h.update(MAGIC);
        h.update(&self.id);
        h.update(entries);
        h.finalize()
    }

    /// The certificate that the blocks' sums make, in the order of their numbers.
    pub(super) fn added_up(&self, context: &Context<'_>) -> Result<Certificate> {
        let plan = &self.manifest.plan;
        if self.certificate() != CertificateLevel::Blocks {
            let hint = Hint::from("plan it with ").option("certificate", "blocks");
            return Err(Error::argument_with("the plan does not measure its blocks", hint));
        }
        let frame = MeasurementFrame::new(&plan.metadata, plan.recipe().seed);
        let read = |block, section| BlockSums::open(self, block)?.read(section);
        let (seed, parts, fields) = (plan.recipe().seed, plan.recipe().blocks, self.manifest.fields.quantities.len());
        PartSums { frame: &frame, seed, parts, fields, read: &read }.certificate(context)
    }

    /// Reads a block's sums through, where the plan has them.
    pub(super) fn check_sums(&self, block: u32) -> Result<()> {
        if self.certificate() != CertificateLevel::Blocks {
            return Ok(());
        }
        let mut sums = BlockSums::open(self, block)?;
        SumsSection::ALL.into_iter().try_for_each(|s| sums.read(s).map(drop))
    }
}

struct BlockSums<'a> {
    job: &'a JobFolder,
    block: u32,
    path: PathBuf,
    file: File,
    /// Place, length and checksum of each section.
    entries: Vec<(u64, u64, u32)>,
}

impl<'a> BlockSums<'a> {
    fn open(job: &'a JobFolder, block: u32) -> Result<Self> {
        let path = job.block_path(block, "sums");
        let (file, length) = open_file(&path).map_err(|e| match e {
            Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                Error::input_with(&path, "this block has not been measured yet", job.run_again("block", block, false))
            }
            other => other,
        })?;
        let mut sums = BlockSums { job, block, path, file, entries: Vec::new() };
        let tail = length.checked_sub(TAIL as u64).filter(|at| *at >= HEAD as u64);
        let tail = tail.ok_or_else(|| sums.broken("the file is incomplete"))?;
        let (head, rest) = (sums.at(0, HEAD)?, sums.at(tail, TAIL)?);
        if head[..8] != MAGIC[..] || head[8..] != job.id {
            return Err(sums.broken("the file belongs to another plan"));
        }
        let (entries, crc) = rest.split_at(TAIL - 4);
        let mut place = HEAD as u64;
        for entry in entries.chunks_exact(ENTRY) {
            let length = u64::from_le_bytes(std::array::from_fn(|b| entry[b]));
            let end = place.checked_add(length).filter(|end| *end <= tail).ok_or_else(|| sums.broken(CHANGED))?;
            sums.entries.push((place, length, u32::from_le_bytes(std::array::from_fn(|b| entry[8 + b]))));
            place = end;
        }
        if place != tail || crc != job.checksum(entries).to_le_bytes() {
            return Err(sums.broken(CHANGED));
        }
        Ok(sums)
    }

    fn read(&mut self, section: SumsSection) -> Result<Vec<u8>> {
        let number = SumsSection::ALL.iter().position(|s| *s == section).unwrap_or(0);
        let (place, length, crc) = self.entries[number];
        let bytes = self.at(place, length as usize)?;
        if crc32fast::hash(&bytes) == crc { Ok(bytes) } else { Err(self.broken(CHANGED)) }
    }

    fn at(&mut self, place: u64, length: usize) -> Result<Vec<u8>> {
        let mut bytes = vec![0; length];
        let read = self.file.seek(SeekFrom::Start(place)).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => self.broken("the file is incomplete"),
            _ => Error::io(&self.path, e),
        })?;
        Ok(bytes)
    }

    fn broken(&self, fault: &str) -> Error {
        Error::input_with(&self.path, fault, self.job.run_again("block", self.block, true))
    }
}

//! The manifest of a job, and the places of its files.

use super::runs;
use crate::{CompressionPlan, FieldPlan};
use particlegs_core::codec::MOST_LAYERS;
use particlegs_core::model::{CertificateLevel, Metadata};
use particlegs_core::{Error, Hint, Result};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_particles::blocks::RunScan;
use particlegs_particles::{LayeredParticles, RUN};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Version of the folder's layout.
pub(super) const VERSION: u32 = 5;

/// Four million blocks; numbers of JSON take more memory than text.
pub(super) const FORM: Form = Form { title: "a job's plan", begins: Begins::Object, most: 1 << 30, expansion: 24 };

#[derive(Deserialize)]
struct ManifestVersion {
    particlegs_job: u64,
}

/// The description of a job in its folder: `plan.json`. The same snapshot and options give the same text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Manifest {
    pub particlegs_job: u32,
    /// Description of the snapshot by which it is opened again: the caller's own.
    pub snapshot: serde_json::Value,
    pub plan: CompressionPlan,
    /// Fields that the file gets.
    #[serde(default, skip_serializing_if = "FieldPlan::is_empty")]
    pub fields: FieldPlan,
    /// Origin of the positions, world units.
    pub origin: [f64; 3],
    /// Runs that are bucketed together.
    pub chunk_runs: u64,
    /// Chunks to be bucketed; none where blocks read the snapshot where it lies.
    pub chunks: u64,
    /// Memory that a task may take, bytes.
    pub memory: Option<u64>,
}

impl Manifest {
    pub(super) fn text(&self) -> String {
        serde_json::to_string_pretty(self).expect("plain data") + "\n"
    }

    /// Runs before each layer, and in all.
    pub(super) fn layer_runs(&self) -> Vec<u64> {
        let mut sums = vec![0];
        for layer in &self.plan.layers {
            sums.push(layer.content.div_ceil(RUN as u64).saturating_add(sums[sums.len() - 1]));
        }
        sums
    }

    /// A fault that a manifest of this program does not have.
    fn fault(&self) -> Option<&'static str> {
        let plan = &self.plan;
        let counts = plan.layers.iter().try_fold(0u64, |n, l| n.checked_add(l.content));
        let runs = self.layer_runs().last().copied().unwrap_or(0);
        let finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let (m, b) = (&plan.metadata, &plan.metadata.bounds);
        let cell = m.cell.is_none_or(|c| c.origin.iter().all(|v| v.is_finite()) && c.inverse().is_some());
        let mut names: Vec<&str> = plan.layers.iter().map(|l| &l.name[..]).collect();
        names.sort_unstable();
        names.dedup();
        let named = names.len() == plan.layers.len() && names.iter().all(|n| n.len() <= 255);
        let checks = [
            (plan.tree.is_sound() && plan.tree.blocks() == plan.recipe().blocks, "its tree has other blocks"),
            (!plan.layers.is_empty() && plan.layers.iter().all(|l| l.content > 0), "a layer has no particles"),
            // The format counts particles up to 2^53, which float64 holds exactly.
            (counts == Some(m.count) && m.count <= 1 << 53, "the layers do not add up to the number of particles"),
            (named && plan.layers.len() <= MOST_LAYERS, "there are too many layers, or a layer's name is wrong"),
            (plan.layers.iter().all(|l| l.mass.unit().is_none_or(positive)), "a mass is not positive"),
            ((1..=runs.max(1)).contains(&self.chunk_runs), "the number of chunks is wrong"),
            ([0, runs.div_ceil(self.chunk_runs.max(1))].contains(&self.chunks), "the number of chunks is wrong"),
            ((0..3).all(|k| b.min[k] <= b.max[k]) && cell, "the bounds or the box are wrong"),
            (finite(&self.origin) && finite(&b.min) && finite(&b.max), "a position is not finite"),
            (
                positive(m.default_radius) && m.default_opacity > 0.0 && m.default_opacity <= 1.0,
                "the radius or the opacity is wrong",
            ),
            (self.fields.is_sound(plan.layers.len()), "its fields are wrong"),
            (plan.recipe().target.check().is_ok(), "the target is wrong"),
            (plan.training.as_ref().is_none_or(|t| t.check().is_ok()), "the training configuration is wrong"),
        ];
        checks.into_iter().find(|c| !c.0).map(|c| c.1)
    }
}

/// A job's folder, opened.
pub struct JobFolder {
    /// Path of the folder.
    pub folder: PathBuf,
    pub(super) manifest: Manifest,
    /// BLAKE3 of the manifest, by which every file names its plan.
    pub(super) id: [u8; 32],
    /// Runs before each layer, and in all.
    pub(super) starts: Vec<u64>,
    pub(super) runs: Vec<RunScan>,
    pub(super) before: bool,
}

impl JobFolder {
    /// Opens a folder that [`JobFolder::plan`] made.
    pub fn open(folder: &Path) -> Result<JobFolder> {
        let path = folder.join("plan.json");
        let text = read_own(&path, FORM)?.ok_or_else(|| {
            Error::input_with(
                folder,
                "this is not a job folder: it has no plan.json",
                Hint::default().command("plan", "").words(" creates one"),
            )
        })?;
        let no_plan = |e: serde_json::Error| Error::input(&path, format!("this is not a plan: {e}"));
        let version = serde_json::from_slice::<ManifestVersion>(&text).map_err(no_plan)?.particlegs_job;
        let message = match version.cmp(&u64::from(VERSION)) {
            Ordering::Equal => None,
            Ordering::Greater => Some("a newer version made this plan: update particlegs"),
            Ordering::Less => Some("an older version made this plan: run `plan` again, in another folder"),
        };
        if let Some(message) = message {
            return Err(Error::Compatibility { place: path.display().to_string(), what: message.into() });
        }
        let manifest: Manifest = serde_json::from_slice(&text).map_err(no_plan)?;
        if let Some(fault) = manifest.fault() {
            return Err(Error::input(&path, format!("the plan is not valid: {fault}")));
        }
        let id = *blake3::hash(&text).as_bytes();
        let starts = manifest.layer_runs();
        let runs = runs::read(&folder.join("runs.bin"), &id, starts[starts.len() - 1])?;
        Ok(JobFolder { folder: folder.to_path_buf(), manifest, id, starts, runs, before: true })
    }

    /// Whether this is a folder with a plan.
    pub fn is_job(path: &Path) -> bool {
        path.join("plan.json").is_file()
    }

    /// The buckets of a chunk.
    pub fn chunk_path(&self, chunk: u64) -> PathBuf {
        self.folder.join(format!("scatter/{chunk:05}.bin"))
    }

    /// Whether it was planned before, by the same plan.
    pub fn planned_before(&self) -> bool {
        self.before
    }

    /// The snapshot as the caller of [`JobFolder::plan`] named it.
    pub fn snapshot(&self) -> &serde_json::Value {
        &self.manifest.snapshot
    }

    /// Metadata of the merged file.
    pub fn metadata(&self) -> &Metadata {
        &self.manifest.plan.metadata
    }

    /// Level of the merged file's certificate.
    pub fn certificate(&self) -> CertificateLevel {
        self.manifest.plan.certificate
    }

    /// Notes for the user on a job that was just planned, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.manifest.plan.notes
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.manifest.plan.recipe().blocks
    }

    /// Number of chunks that the snapshot is sorted in; 0 where blocks read it where it lies.
    pub fn chunks(&self) -> u64 {
        self.manifest.chunks
    }

    /// Whether the file gets fields.
    pub fn has_fields(&self) -> bool {
        !self.manifest.fields.is_empty()
    }

    /// Bytes of the fields of all particles, as they wait in buckets.
    pub(super) fn field_bytes(&self) -> u64 {
        let layers = self.manifest.plan.layers.iter().enumerate();
        layers.map(|(l, layer)| layer.content * 4 * self.manifest.fields.columns(l) as u64).sum()
    }

    /// Bytes that its chunks take together.
    pub fn scatter_bytes(&self) -> u64 {
        if self.manifest.chunks > 0 { self.manifest.plan.column_bytes() + self.field_bytes() } else { 0 }
    }

    /// Bytes of memory that a task may take, where the plan says.
    pub fn memory(&self) -> Option<u64> {
        self.manifest.memory
    }

    pub(super) fn block_path(&self, block: u32, ending: &str) -> PathBuf {
        self.folder.join(format!("blocks/{block:05}.{ending}"))
    }

    /// The snapshot, opened again, as it was planned: layers whose weights were all the same have none.
    pub(super) fn as_planned(&self, mut source: LayeredParticles) -> Result<LayeredParticles> {
        let planned = &self.manifest.plan.layers;
        let same = source.layers.len() == planned.len()
            && source.origin == self.manifest.origin
            && source.layers.iter().zip(planned).all(|(a, b)| a.layer.name == b.name && a.layer.content == b.content);
        if !same {
            return Err(self.changed("its layers are different"));
        }
        for (layer, planned) in source.layers.iter_mut().zip(planned) {
            if planned.mass.is_weighted() && !layer.layer.mass.is_weighted() {
                return Err(self.changed("its masses are different"));
            }
            layer.layer.mass = planned.mass;
        }
        self.check_fields(&source)?;
        Ok(source)
    }

    pub(super) fn changed(&self, how: &str) -> Error {
        let message = format!("the snapshot changed after `plan`: {how}");
        Error::input_with(&self.manifest.plan.metadata.source, message, "run `plan` again, in another folder")
    }

    /// Layer by layer, the part of some of the snapshot's runs that lies in it.
    pub(super) fn by_layer(&self, runs: Range<u64>) -> impl Iterator<Item = (usize, Range<u64>)> {
        self.starts.windows(2).enumerate().filter_map(move |(layer, span)| {
            let (first, end) = (runs.start.max(span[0]), runs.end.min(span[1]));
            (first < end).then(|| (layer, first - span[0]..end - span[0]))
        })
    }
}

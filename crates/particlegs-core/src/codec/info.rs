//! Information about a file without its Gaussians.

use super::Precision;
use super::container::{CORRELATION, FIELD, SHARE};
use super::file::{BlockPart, FileParts, parts};
use crate::Result;
use crate::model::{Certificate, Layer, Mass, Metadata, SharedSpecies, VizMapper};

/// Factor on the steps of a frame that is coded as a model of its own ([`super::SeriesDecoder::extract`]): they add
/// next to nothing to the errors of the series. (At a quarter they alone move the power spectrum by 0.4 %.)
pub(super) const EXTRACTED: f64 = 1.0 / 16.0;

/// Information about a file without its Gaussians being decoded. Of a file that lacks something
/// ([`FileInfo::missing`]) nothing was measured: it has no certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct FileInfo {
    /// Version of the format: major, minor.
    pub version: [u8; 2],
    /// Metadata.
    pub metadata: Metadata,
    /// Certificate.
    pub certificate: Option<Certificate>,
    /// Network of the alpha-blend law.
    pub vizmapper: Option<VizMapper>,
    /// Layers.
    pub layers: Vec<Layer<Vec<BlockInfo>>>,
    /// Bytes of the file.
    pub bytes: u64,
    /// Particles of blocks that an open file ends before.
    pub missing_particles: u64,
    /// Bytes of the shares of species that share Gaussians.
    pub share_bytes: u64,
    /// Sizes of each of the metadata's fields.
    pub fields: Vec<FieldInfo>,
    /// Gaps of these, a sentence each; none are listed of a file that lacks more.
    pub lacking_fields: Vec<String>,
    /// Bytes of correlations between fields.
    pub correlation_bytes: u64,
    /// Sections that this program does not know, by tag and bytes; first those of blocks.
    pub other_sections: Vec<(String, u64)>,
}

/// A block of a file.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct BlockInfo {
    /// Bounds of its particles, world units.
    pub bounds: crate::space::Bounds,
    /// Particles.
    pub count: u64,
    /// Their mass.
    pub mass: f64,
    /// Gaussians.
    pub gaussians: u32,
    /// Coded size.
    pub bytes: u64,
    /// Stages that are there, and that there should be: without all of them it decodes to fewer, larger Gaussians.
    pub stages: [usize; 2],
    /// Quantisation steps.
    pub precision: Precision,
}

/// Sums over a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerSum {
    /// Particles.
    pub particles: u64,
    /// The sum of their weights, 1 each where they have none.
    pub mass: f64,
    /// Gaussians, of which several species may have a share.
    pub gaussians: usize,
}

/// Reads everything but the Gaussians; every checksum is checked.
pub fn read_info(bytes: &[u8], place: &str) -> Result<FileInfo> {
    Ok(FileInfo::new(parts(bytes, place)?, bytes))
}

/// A field in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldInfo {
    /// Bytes of its moments.
    pub bytes: u64,
    /// Particles of the blocks that have it.
    pub particles: u64,
}

impl FileInfo {
    /// Bytes of the fields' values in the snapshot.
    pub fn raw_field_bytes(&self) -> u64 {
        let raw =
            self.metadata.fields.iter().zip(&self.fields).map(|(q, f)| f.particles.saturating_mul(q.bytes.into()));
        // Counts come from a file and may be any number.
        raw.fold(0, u64::saturating_add)
    }

    /// Bytes of what is stored as the snapshot held it: positions as float32, 12 a particle, masses where they differ, 4
    /// more, and the fields.
    pub fn raw_bytes(&self) -> u64 {
        let layers = self.species_layers();
        let bytes = layers.iter().map(|l| l.content.particles.saturating_mul(l.mass.particle_bytes()));
        bytes.fold(self.raw_field_bytes(), u64::saturating_add)
    }

    /// The compression ratio: bytes of what is stored as the snapshot held it over bytes of the file.
    pub fn compression_ratio(&self) -> f64 {
        self.raw_bytes() as f64 / self.bytes as f64
    }

    /// The compression ratio in words; with fields also that of positions and masses alone, which targets speak of.
    pub fn describe_ratio(&self) -> String {
        let coded = self.fields.iter().map(|f| f.bytes).fold(self.correlation_bytes, u64::saturating_add);
        let ratio = (self.raw_bytes() - self.raw_field_bytes()) as f64 / self.bytes.saturating_sub(coded).max(1) as f64;
        match self.fields.is_empty() {
            true => format!("ratio {:.1}", self.compression_ratio()),
            false => {
                format!("ratio {:.1} with fields ({ratio:.1} of positions and masses alone)", self.compression_ratio())
            }
        }
    }

    /// A line for each field, and for their correlations: `velocity: 9218 bytes, 3.66 per Gaussian`.
    pub fn describe_fields(&self) -> Vec<String> {
        let gaussians = self.gaussians().max(1) as f64;
        let line =
            |name: &str, bytes: u64| format!("{name}: {bytes} bytes, {:.2} per Gaussian", bytes as f64 / gaussians);
        let all = &self.metadata.fields;
        let fields = all.iter().zip(&self.fields).enumerate().map(|(n, (q, f))| match Metadata::is_stored(all, n) {
            true => line(&q.name, f.bytes),
            false => format!("{}: what the other classes leave", q.name),
        });
        let correlations = (self.correlation_bytes > 0).then(|| line("correlations", self.correlation_bytes));
        fields.chain(correlations).collect()
    }

    /// Gaps of the file, in words: blocks that it ends before, stages of blocks. `None`: it is whole.
    pub fn missing(&self) -> Option<String> {
        let blocks = || self.layers.iter().flat_map(|l| &l.content);
        let (all, coarse) = (blocks().count(), blocks().filter(|b| b.stages[0] < b.stages[1]).count());
        let particles = (self.missing_particles > 0).then(|| {
            let count = self.metadata.count;
            format!("the file ends early: it has {count} of {} particles", count.saturating_add(self.missing_particles))
        });
        let stages =
            (coarse > 0).then(|| format!("{coarse} of {all} blocks end early and so have fewer, larger Gaussians"));
        let both: Vec<String> = particles.into_iter().chain(stages).collect();
        (!both.is_empty()).then(|| both.join("; "))
    }

    /// Its sections that this program does not know, in words; a command that changes what they belong to drops them.
    /// `None`: it has none.
    pub fn left_out(&self) -> Option<String> {
        let words: Vec<String> = self.other_sections.iter().map(|(tag, n)| format!("`{tag}` ({n} bytes)")).collect();
        (!words.is_empty()).then(|| format!("unknown sections are dropped: {}", words.join(", ")))
    }

    /// Whether its blocks are as fine as those of a frame of a series that was extracted.
    pub fn is_extracted(&self) -> bool {
        let Precision { position, size, shape, count, .. } = Precision::BALANCED.scaled(EXTRACTED);
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b;
        let has_extracted_steps = |p: &Precision| {
            [(p.position, position), (p.size, size), (p.shape, shape), (p.count, count)]
                .iter()
                .all(|(a, b)| near(*a, *b))
        };
        self.layers.iter().flat_map(|l| &l.content).all(|b| has_extracted_steps(&b.precision))
    }

    /// Number of Gaussians.
    pub fn gaussians(&self) -> usize {
        self.layers.iter().flat_map(|l| &l.content).map(|b| b.gaussians as usize).sum()
    }

    /// Mass of all particles in the unit of mass, where it is known.
    pub fn mass(&self) -> Option<f64> {
        let layers = self.species_layers();
        let known = layers.iter().all(|l| l.mass != Mass::Unknown);
        known.then(|| layers.iter().map(|l| l.mass.unit_or_one() * l.content.mass).sum())
    }

    /// The layers of the decoded model, with one for each of the species that share Gaussians.
    pub fn species_layers(&self) -> Vec<Layer<LayerSum>> {
        let shared = &self.metadata.shared_species;
        let mut out = Vec::new();
        for layer in &self.layers {
            let gaussians = layer.content.iter().map(|b| b.gaussians as usize).sum();
            if SharedSpecies::share_layer(shared, &layer.name) {
                out.extend(shared.iter().map(|s| Layer {
                    name: s.name.clone(),
                    mass: Mass::new(false, s.mass),
                    content: LayerSum { particles: s.count, mass: s.count as f64, gaussians },
                }));
                continue;
            }
            let particles = layer.content.iter().fold(0u64, |sum, b| sum.saturating_add(b.count));
            let mass = layer.content.iter().map(|b| b.mass).sum();
            out.push(layer.with(LayerSum { particles, mass, gaussians }));
        }
        out
    }

    pub(super) fn new(parts: FileParts<'_>, file: &[u8]) -> FileInfo {
        let block = |BlockPart { header: h, bytes, stages, .. }: &BlockPart<'_>| BlockInfo {
            bounds: h.bounds,
            count: h.count,
            mass: h.mass,
            gaussians: h.gaussians,
            bytes: bytes.len() as u64,
            stages: [*stages, h.cuts.len() + 1],
            precision: Precision::from_header(h.steps, h.importance),
        };
        let attached = || parts.layers.iter().flat_map(|l| l.content.iter().flat_map(|b| &b.sections));
        let mut fields = vec![FieldInfo::default(); parts.metadata.fields.len()];
        for block in parts.layers.iter().flat_map(|l| &l.content) {
            for section in block.sections.iter().filter(|s| s.tag == FIELD) {
                let Some(field) = section.bytes.first().and_then(|&n| fields.get_mut(usize::from(n))) else { continue };
                field.bytes += section.bytes.len() as u64;
                field.particles = field.particles.saturating_add(block.header.count);
            }
        }
        let bytes_of = |tag: [u8; 4]| attached().filter(|s| s.tag == tag).map(|s| s.bytes.len() as u64).sum();
        let (share_bytes, correlation_bytes) = (bytes_of(SHARE), bytes_of(CORRELATION));
        let attached = attached().filter(|s| ![FIELD, SHARE, CORRELATION].contains(&s.tag));
        let other = attached.chain(&parts.sections).map(|s| (s.tag.escape_ascii().to_string(), s.bytes.len() as u64));
        let other_sections = other.collect();
        let counts: Vec<usize> = parts.layers.iter().map(|l| l.content.len()).collect();
        let has = |layer: usize, block: usize, _: &str, field: usize| {
            let sections = &parts.layers[layer].content[block].sections;
            sections.iter().any(|s| s.tag == FIELD && s.bytes.first().copied().map(usize::from) == Some(field))
        };
        let lacking_fields = parts.metadata.lacking_fields(&counts, &has);
        let layers = parts.layers.iter().map(|part| part.with(part.content.iter().map(block).collect()));
        let info = FileInfo {
            version: [file[8], file[9]],
            layers: layers.collect(),
            metadata: parts.metadata,
            certificate: parts.certificate,
            vizmapper: parts.network.map(|n| n.1),
            bytes: file.len() as u64,
            missing_particles: parts.missing_particles,
            share_bytes,
            fields,
            lacking_fields,
            correlation_bytes,
            other_sections,
        };
        if info.missing().is_none() { info } else { FileInfo { lacking_fields: Vec::new(), ..info } }
    }
}

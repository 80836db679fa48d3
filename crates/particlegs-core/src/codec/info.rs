//! What a file says of itself, its Gaussians apart.

use super::Precision;
use super::container::Section;
use super::file::{Parts, parts};
use super::header::BlockHeader;
use crate::Result;
use crate::model::{Certificate, Layer, Mass, Metadata, VizMapper};

/// What a file says without its Gaussians being decoded.
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
    /// Quantisation steps.
    pub precision: Precision,
}

/// Reads everything but the Gaussians; every checksum is checked.
///
/// # Errors
/// As [`super::decode`], streams apart.
pub fn read_info(bytes: &[u8], place: &str) -> Result<FileInfo> {
    Ok(FileInfo::of(parts(bytes, place)?, bytes))
}

impl FileInfo {
    /// Number of Gaussians.
    pub fn gaussians(&self) -> usize {
        self.layers.iter().flat_map(|l| &l.content).map(|b| b.gaussians as usize).sum()
    }

    /// Mass of all particles in the unit of mass, where it is known.
    pub fn mass(&self) -> Option<f64> {
        let mass = |l: &Layer<Vec<BlockInfo>>| l.mass.unit_or_one() * l.content.iter().map(|b| b.mass).sum::<f64>();
        let known = self.layers.iter().all(|l| l.mass != Mass::Unknown);
        known.then(|| self.layers.iter().map(mass).sum())
    }

    /// Of the parts of a file.
    pub(super) fn of(parts: Parts<'_>, file: &[u8]) -> FileInfo {
        let block = |(section, h): &(Section<'_>, BlockHeader)| BlockInfo {
            bounds: h.bounds,
            count: h.count,
            mass: h.mass,
            gaussians: h.gaussians,
            bytes: section.bytes.len() as u64,
            precision: Precision::of_header(h.steps, h.importance),
        };
        let layers = parts.layers.iter().map(|part| part.with(part.content.iter().map(block).collect()));
        FileInfo {
            version: [file[8], file[9]],
            layers: layers.collect(),
            metadata: parts.metadata,
            certificate: parts.certificate,
            vizmapper: parts.network.map(|n| n.1),
            bytes: file.len() as u64,
        }
    }
}

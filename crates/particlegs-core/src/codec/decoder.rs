//! A block's bytes to Gaussians.

use super::exact::exp;
use super::header::{BlockHeader, GAUSSIANS_A_BYTE};
use super::rans::Player;
use super::streams;
use super::sums::{opacity_of, rescale, whole_counts};
use super::tree::{Node, gaussians, pieces};
use super::walk::{Nothing, OutOfRange, trunk, walk};
use crate::math::{Sym3, each_axis};
use crate::memory::filled;
use crate::model::{AlphaBlend, Block, Law, MASS, Mixture};
use crate::progress::Progress;
use crate::{Error, parallel};
use std::ops::Range;

/// Where a segment's Gaussians go: mean, count and covariance.
struct Columns<'a> {
    mean: [&'a mut [f64]; 3],
    count: &'a mut [f64],
    cov: [&'a mut [f64]; 6],
    /// Mass a particle, relative, or grey level; empty without either.
    weight: &'a mut [f64],
}

/// Why a block cannot be decoded.
pub(crate) enum Fault {
    /// It contradicts the format.
    Corrupt(String),
    /// There is no memory for its Gaussians.
    Memory(Error),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Fault::Corrupt(what)
    }
}

impl From<&str> for Fault {
    fn from(what: &str) -> Self {
        Fault::Corrupt(what.into())
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Fault::Memory(error)
    }
}

impl Fault {
    /// As an error of the block that `corrupt` names.
    pub(crate) fn at(self, corrupt: impl FnOnce(String) -> Error) -> Error {
        match self {
            Fault::Corrupt(what) => corrupt(what),
            Fault::Memory(error) => error,
        }
    }
}

/// Bytes that the Gaussians of a block take: mean, covariance, count and, where they have them, mass or
/// opacity and grey level.
pub(crate) fn gaussian_bytes(header: &BlockHeader) -> u64 {
    let each = 80 + if header.shaded { 16 } else { 8 * u64::from(header.weighted) };
    u64::from(header.gaussians) * each
}

/// Bytes that decoding a block takes beside its Gaussians, at most: nodes of the segments at
/// work, and remainders of counts.
pub(crate) fn working_bytes(header: &BlockHeader) -> u64 {
    const A_GAUSSIAN: u64 = 32;
    const A_SEGMENT: u64 = 65_536 * 80;
    u64::from(header.gaussians) * A_GAUSSIAN + parallel::threads() as u64 * A_SEGMENT
}

/// What refuses memory for a block's columns is called.
const COLUMNS: &str = "decoding the model";

/// A block on its way to Gaussians: its segments are read on their own, in any order.
pub(crate) struct BlockDecoder {
    header: BlockHeader,
    segments: Vec<Coded>,
    /// Bytes of the block.
    length: usize,
    /// Is every segment's stream as long as a table says?
    table: bool,
    mean: [Vec<f64>; 3],
    count: Vec<f64>,
    cov: [Vec<f64>; 6],
    weight: Vec<f64>,
}

/// A segment as it lies in its block.
struct Coded {
    nodes: Vec<Node>,
    stream: Range<usize>,
}

/// A segment to be read.
pub(crate) struct Segment<'a> {
    header: &'a BlockHeader,
    nodes: &'a [Node],
    stream: &'a [u8],
    /// Bytes of the block, where what follows the stream is its padding.
    padded: Option<usize>,
    out: Columns<'a>,
}

/// Decodes a block.
pub(crate) fn block(bytes: &[u8], progress: &dyn Progress) -> Result<Block, Fault> {
    let mut decoder = BlockDecoder::new(bytes, progress)?;
    parallel::try_for_each(decoder.segments(bytes), Segment::read)?;
    Ok(decoder.finish())
}

impl BlockDecoder {
    /// Reads all but the segments' streams, and takes the memory that its Gaussians need.
    pub(crate) fn new(block: &[u8], progress: &dyn Progress) -> Result<Self, Fault> {
        let header = BlockHeader::read(block)?;
        let streams = streams::read(header.gaussians, block, header.bytes())?;
        let table = streams.trunk.is_some();
        let nodes = match streams.trunk {
            None => vec![vec![Node::root(header.gaussians)]],
            Some(stream) => {
                let mut player = start(&block[stream])?;
                let nodes = trunk(&mut player, &header, &mut Nothing).map_err(out_of_range)?;
                end(&player, true)?;
                nodes
            }
        };
        if nodes.len() != streams.segments.len() {
            return Err(format!("{} streams for {} segments", streams.segments.len(), nodes.len()).into());
        }
        padding(&header, block.len(), &block[streams.padding])?;
        let segments = nodes.into_iter().zip(streams.segments).map(|(nodes, stream)| Coded { nodes, stream });
        let n = header.gaussians as usize;
        let column = |n: usize| filled(COLUMNS, 0.0f64, n, progress);
        Ok(BlockDecoder {
            segments: segments.collect(),
            length: block.len(),
            table,
            mean: [column(n)?, column(n)?, column(n)?],
            count: column(n)?,
            cov: [column(n)?, column(n)?, column(n)?, column(n)?, column(n)?, column(n)?],
            weight: column(if header.has_w() { n } else { 0 })?,
            header,
        })
    }

    /// Number of segments.
    pub(crate) fn len(&self) -> usize {
        self.segments.len()
    }

    /// Gaussians of a segment.
    pub(crate) fn gaussians(&self, segment: usize) -> usize {
        gaussians(&self.segments[segment].nodes)
    }

    /// The segments, to be read from the bytes of the same block.
    pub(crate) fn segments<'a>(&'a mut self, block: &'a [u8]) -> Vec<Segment<'a>> {
        let BlockDecoder { header, segments, length, table, mean, count, cov, weight } = self;
        let columns = split(segments, mean, count, cov, weight);
        let segment = |(coded, out): (&'a Coded, Columns<'a>)| Segment {
            header,
            nodes: &coded.nodes,
            stream: &block[coded.stream.clone()],
            padded: (!*table).then_some(*length),
            out,
        };
        segments.iter().zip(columns).map(segment).collect()
    }

    /// Gaussians of a segment that was read, of the optical-depth law. Their counts are not whole yet, and neither sums
    /// of counts nor of masses are the block's to the last digit.
    pub(crate) fn read_so_far(&self, segment: usize) -> Mixture {
        let first: usize = (0..segment).map(|s| self.gaussians(s)).sum();
        let all = first..first + self.gaussians(segment);
        let part = |column: &Vec<f64>| column[all.clone()].to_vec();
        let count = part(&self.count);
        let mut columns = crate::model::Columns::default();
        if self.header.weighted {
            // Weights are relative to the mean of the block's particles.
            let mean = self.header.mass / self.header.count as f64;
            columns.set(MASS, count.iter().zip(&self.weight[all.clone()]).map(|(c, w)| c * w * mean).collect());
        }
        let (mean, cov) = (self.mean.each_ref().map(part), self.cov.each_ref().map(part));
        Mixture { mean, cov, count, columns, law: Law::OpticalDepth }
    }

    /// What stands for a segment that was not read: its boxes, each as one Gaussian with its share of the block's
    /// particles by the number of its Gaussians. Its variance is that of a linear interpolation between boxes, so that
    /// boxes of one density beside each other look like one.
    pub(crate) fn boxes(&self, segment: usize) -> Mixture {
        let header = &self.header;
        let extent = header.bounds.extent();
        let mut boxes = Mixture::new(header.weighted);
        for node in &self.segments[segment].nodes {
            let mean = each_axis(|k| node.cell.point(&header.bounds, extent, k, 0.5));
            let [x, y, z] = node.cell.widths(extent).map(|w| w * w / 6.0);
            let share = f64::from(node.count) / f64::from(header.gaussians);
            boxes.push(mean, Sym3([x, 0.0, 0.0, y, 0.0, z]), share * header.count as f64, share * header.mass);
        }
        boxes
    }

    /// The block, all segments of which were read.
    pub(crate) fn finish(self) -> Block {
        let BlockDecoder { header, mean, mut count, cov, mut weight, .. } = self;
        // Opacities as coded; the counts in proportion to them are made whole.
        let law = if header.shaded {
            count.iter_mut().for_each(|c| *c = opacity_of(*c));
            let (opacity, grey) = (count.clone(), std::mem::take(&mut weight));
            Law::AlphaBlend(AlphaBlend { opacity, grey, vizmapper: None })
        } else {
            Law::OpticalDepth
        };
        whole_counts(&mut count, header.count);
        let mut named = crate::model::Columns::default();
        if header.weighted {
            let mut mass: Vec<f64> = count.iter().zip(&weight).map(|(c, w)| c * w).collect();
            rescale(&mut mass, header.mass);
            named.set(MASS, mass);
        }
        let gaussians = Mixture { mean, cov, count, columns: named, law };
        Block { bounds: header.bounds, count: header.count, mass: header.mass, gaussians }
    }
}

fn start(stream: &[u8]) -> Result<Player<'_>, String> {
    Player::new(stream).ok_or_else(|| "a stream has no start".into())
}

/// Is a stream read to its end; `whole`: and nothing left of it?
fn end(player: &Player<'_>, whole: bool) -> Result<(), String> {
    if player.exhausted() {
        return Err("a stream ends too soon".into());
    }
    if !player.finished() || (whole && !player.rest().is_empty()) {
        return Err("a stream goes on after its last Gaussian".into());
    }
    Ok(())
}

fn out_of_range(_: OutOfRange) -> String {
    "a number is out of range".into()
}

/// Is what follows the streams of a block of `length` bytes the padding that it needs?
fn padding(header: &BlockHeader, length: usize, rest: &[u8]) -> Result<(), String> {
    let least = u64::from(header.gaussians).div_ceil(GAUSSIANS_A_BYTE) as usize;
    if !rest.is_empty() && (length != least || rest.iter().any(|&b| b != 0)) {
        return Err("the block goes on after its last Gaussian".into());
    }
    Ok(())
}

/// The columns of each segment.
fn split<'a>(
    segments: &[Coded],
    mean: &'a mut [Vec<f64>; 3],
    count: &'a mut [f64],
    cov: &'a mut [Vec<f64>; 6],
    weight: &'a mut [f64],
) -> Vec<Columns<'a>> {
    let part = |column: &'a mut [f64]| pieces(column, segments.iter().map(|s| gaussians(&s.nodes))).into_iter();
    let mut mean = mean.each_mut().map(|c| part(c));
    let mut cov = cov.each_mut().map(|c| part(c));
    let (mut count, mut weight) = (part(count), part(weight));
    let columns = |_: &Coded| Columns {
        mean: mean.each_mut().map(|c| c.next().unwrap_or_default()),
        count: count.next().unwrap_or_default(),
        cov: cov.each_mut().map(|c| c.next().unwrap_or_default()),
        weight: weight.next().unwrap_or_default(),
    };
    segments.iter().map(columns).collect()
}

impl Segment<'_> {
    /// Reads the segment's stream.
    pub(crate) fn read(self) -> Result<(), String> {
        let Segment { header, nodes, stream, padded, out } = self;
        let mut player = start(stream)?;
        let extent = header.bounds.extent();
        let Columns { mean, count, cov, weight } = out;
        let [x, y, z] = mean;
        let mut finite = true;
        walk(&mut player, header, nodes, &mut Nothing, |i, leaf| {
            count[i] = leaf.count;
            for (k, mean) in [&mut *x, &mut *y, &mut *z].into_iter().enumerate() {
                let f = leaf.place[k] as f64 * 0.25 / leaf.levels[k] as f64;
                mean[i] = leaf.cell.point(&header.bounds, extent, k, f);
            }
            if header.has_w() {
                weight[i] = exp(header.log_weight(leaf.w));
            }
            let size = leaf.radius * leaf.radius;
            for k in 0..6 {
                cov[k][i] = leaf.unit.0[k] * size;
                finite &= cov[k][i].is_finite();
            }
        })
        .map_err(out_of_range)?;
        end(&player, padded.is_none())?;
        if !finite {
            return Err("a covariance is out of range".into());
        }
        padded.map_or(Ok(()), |length| padding(header, length, player.rest()))
    }
}

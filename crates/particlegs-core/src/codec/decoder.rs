//! A block's bytes to Gaussians.

use super::OutOfRange;
use super::file::BlockPart;
use super::fine::{FineWalk, Leaf};
use super::header::{BlockHeader, GAUSSIANS_A_BYTE};
use super::levels::{LEVELS, LevelWalk, NoSource, NodeContent, TreeNode};
use super::rans::{Coder, RansReader};
use super::streams::{self, Streams};
use super::sums::{opacity_of, rescale, whole_counts};
use super::tree::{SplitNode, gaussians, pieces, trunk};
use crate::context::Context;
use crate::math::{Sym3, each_axis, exp};
use crate::memory::filled;
use crate::model::{AlphaBlend, Block, Law, MASS, Mixture};
use crate::{Error, parallel};
use std::ops::Range;

/// Columns that a segment's Gaussians are written to.
struct GaussianColumns<'a> {
    mean: [&'a mut [f64]; 3],
    count: &'a mut [f64],
    cov: [&'a mut [f64]; 6],
    /// Mass a particle, relative, or grey level; empty without either.
    weight: &'a mut [f64],
}

pub(crate) enum BlockFault {
    Corrupt(String),
    /// There is no memory for its Gaussians.
    Memory(Error),
}

impl From<String> for BlockFault {
    fn from(message: String) -> Self {
        BlockFault::Corrupt(message)
    }
}

impl From<&str> for BlockFault {
    fn from(message: &str) -> Self {
        BlockFault::Corrupt(message.into())
    }
}

impl From<Error> for BlockFault {
    fn from(error: Error) -> Self {
        BlockFault::Memory(error)
    }
}

impl BlockFault {
    /// As an error of the block that `corrupt` names.
    pub(crate) fn at(self, corrupt: impl FnOnce(String) -> Error) -> Error {
        match self {
            BlockFault::Corrupt(message) => corrupt(message),
            BlockFault::Memory(error) => error,
        }
    }
}

/// Gaussians that a block decodes to, at most: without all its stages no more than its bytes earn.
fn most_gaussians(block: &BlockPart<'_>) -> u64 {
    let all = u64::from(block.header.gaussians);
    if block.is_whole() { all } else { all.min(GAUSSIANS_A_BYTE * block.bytes.len() as u64) }
}

/// Bytes that the Gaussians of a block take: mean, covariance, count and, where they have them, mass or
/// opacity and grey level.
pub(crate) fn gaussian_bytes(block: &BlockPart<'_>) -> u64 {
    let each = 80 + if block.header.shaded { 16 } else { 8 * u64::from(block.header.weighted) };
    most_gaussians(block) * each
}

/// Bytes that decoding a block takes beside its Gaussians, at most: nodes of the segments at
/// work, and remainders of counts.
pub(crate) fn working_bytes(block: &BlockPart<'_>) -> u64 {
    const A_GAUSSIAN: u64 = 32;
    const A_SEGMENT: u64 = 2 * 65_536 * 80;
    most_gaussians(block) * A_GAUSSIAN + parallel::threads() as u64 * A_SEGMENT
}

/// Name of the work in an error that refuses memory for a block's columns.
const COLUMNS: &str = "decoding the model";

/// A block on its way to Gaussians: its segments are read on their own, in any order.
pub(crate) struct BlockDecoder {
    header: BlockHeader,
    segments: Vec<CodedSegment>,
    length: usize,
    /// Whether a table says how long every segment's stream is.
    table: bool,
    columns: BlockColumns,
}

/// The Gaussians of a block, as coded.
#[derive(Default)]
struct BlockColumns {
    mean: [Vec<f64>; 3],
    count: Vec<f64>,
    cov: [Vec<f64>; 6],
    weight: Vec<f64>,
}

/// A segment as it lies in its block: a stream for each stage.
struct CodedSegment {
    nodes: Vec<SplitNode>,
    streams: Vec<Range<usize>>,
}

pub(crate) struct SegmentReader<'a> {
    header: &'a BlockHeader,
    nodes: &'a [SplitNode],
    streams: Vec<&'a [u8]>,
    /// Bytes of the block, where what follows the stream is its padding.
    padded: Option<usize>,
    out: GaussianColumns<'a>,
}

/// Decodes a block. Where its last stages are missing, its Gaussians are fewer and larger: those known by then.
pub(crate) fn block(bytes: &[u8], context: &Context<'_>) -> Result<Block, BlockFault> {
    let header = BlockHeader::read(bytes)?;
    if streams::stages(&header, bytes)?.len() <= header.cuts.len() {
        return part(bytes, Ending::Stage);
    }
    let mut decoder = BlockDecoder::new(bytes, context)?;
    parallel::try_for_each(decoder.segments(bytes), SegmentReader::read)?;
    Ok(decoder.finish())
}

/// A block from its first bytes: a mixture of fewer, larger Gaussians of the same particles and mass. The header
/// and the table of streams must be there.
pub(crate) fn prefix(bytes: &[u8]) -> Result<Block, BlockFault> {
    part(bytes, Ending::Anywhere)
}

/// Ends that the bytes of a part of a block may have.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Ending {
    /// With a stage: its streams end as they should.
    Stage,
    /// Within a stream.
    Anywhere,
}

pub(crate) fn part(bytes: &[u8], ending: Ending) -> Result<Block, BlockFault> {
    let header = BlockHeader::read(bytes)?;
    let streams = streams::read(&header, bytes)?;
    let nodes = segment_nodes(&header, &streams, bytes)?;
    // Ranges go as far as the table says, the bytes perhaps not.
    let available_bytes = |range: &Range<usize>| &bytes[range.start.min(bytes.len())..range.end.min(bytes.len())];
    let parts = parallel::map(nodes.iter().enumerate(), |(segment, nodes)| {
        let streams: Vec<&[u8]> = streams.stages.iter().map(|s| available_bytes(&s[segment])).collect();
        coarse(&header, nodes, &streams, ending)
    });
    let mut all = BlockColumns::default();
    for part in parts {
        let mut part = part?;
        all.mean.iter_mut().zip(&mut part.mean).for_each(|(all, part)| all.append(part));
        all.cov.iter_mut().zip(&mut part.cov).for_each(|(all, part)| all.append(part));
        all.count.append(&mut part.count);
        all.weight.append(&mut part.weight);
    }
    match all.cov.iter().all(|column| column.iter().all(|v| v.is_finite())) {
        true => Ok(all.into_block(header)),
        false => Err("a covariance is out of range".into()),
    }
}

fn segment_nodes(header: &BlockHeader, streams: &Streams, block: &[u8]) -> Result<Vec<Vec<SplitNode>>, String> {
    let Some(trunk_stream) = &streams.trunk else { return Ok(vec![vec![SplitNode::root(header.gaussians)]]) };
    let stream = block.get(trunk_stream.clone()).ok_or("a stream ends too soon")?;
    let mut reader = start(stream)?;
    let nodes = trunk(&mut reader, header, &[]).map_err(out_of_range)?;
    end(&reader, true)?;
    match nodes.len() == streams.segments {
        true => Ok(nodes),
        false => Err(format!("{} streams but {} segments", streams.segments, nodes.len())),
    }
}

/// Variance of what lies somewhere in a cell, over its width squared: between a box's and that of an interpolation
/// between boxes.
const CELL_VARIANCE: f64 = 1.0 / 7.0;
/// And of what lies somewhere in a part of a cell.
const PART_VARIANCE: f64 = 1.0 / 12.0;
/// Middle of the two lattices that a number may lie on, in whole steps.
const MIDDLE: f64 = 0.25;

/// The Gaussians of a segment, as far as its streams go.
fn coarse(
    header: &BlockHeader,
    nodes: &[SplitNode],
    streams: &[&[u8]],
    ending: Ending,
) -> Result<BlockColumns, String> {
    let mut out = BlockColumns::default();
    let extent = header.bounds.extent();
    let bytes: usize = streams.iter().map(|s| s.len()).sum();
    let mut walk: Option<LevelWalk<'_>> = None;
    let mut fine = None;
    for (stage, stream) in streams.iter().enumerate() {
        let mut reader = match RansReader::new(stream) {
            Some(reader) => reader,
            None if ending == Ending::Anywhere => break,
            // A stage that is not there has no bytes at all.
            None if stream.is_empty() && stage > 0 => break,
            None => return Err("a stream has no start".into()),
        };
        if walk.is_none() {
            let mut level_walk = LevelWalk::new(&mut reader, header, nodes, &mut NoSource).map_err(out_of_range)?;
            // A few bytes may claim any number of Gaussians, so the number is limited by the bytes.
            level_walk.limit(bytes * GAUSSIANS_A_BYTE as usize + nodes.len());
            // Roots that were read beyond the end are none: then the cells alone stand for the segment.
            walk = Some(level_walk).filter(|_| !reader.exhausted());
        }
        let Some(walk) = &mut walk else { break };
        // The last stage has no cut: it goes to the last level.
        let level = header.cuts.get(stage).map_or(LEVELS - 1, |&level| usize::from(level));
        let whole = walk.run(&mut reader, &mut NoSource, level).map_err(out_of_range)?;
        // A section holds whole streams, while a prefix of a block may end within one.
        if ending == Ending::Stage {
            end(&reader, true)?;
        }
        if !whole {
            break;
        }
        // The fine part goes on in the stream of the last level (docs/format.md, section 6).
        if level == LEVELS - 1 {
            fine = Some((FineWalk::new(header), reader));
        }
    }
    let Some(walk) = walk else {
        nodes.iter().for_each(|node| out.push_cell(header, node));
        return Ok(out);
    };
    for node in walk.in_order() {
        let node = &walk.nodes[node as usize];
        if let Some((fine_walk, reader)) = &mut fine {
            let mut leaf = Leaf::default();
            let coded = fine_walk.code(reader, node, &mut leaf);
            if !reader.exhausted() {
                coded.map_err(out_of_range)?;
                let whole = WholeGaussian::new(header, extent, &leaf);
                out.push(whole.mean, whole.cov, leaf.count, whole.weight);
                continue;
            }
            // Values read beyond the end are discarded.
            fine = None;
        }
        out.push_node(header, extent, node);
    }
    Ok(out)
}

/// A Gaussian of which all is read, but its count.
struct WholeGaussian {
    mean: [f64; 3],
    cov: [f64; 6],
    weight: Option<f64>,
}

impl WholeGaussian {
    #[inline(always)]
    fn new(header: &BlockHeader, extent: [f64; 3], leaf: &Leaf) -> Self {
        let size = leaf.radius * leaf.radius;
        WholeGaussian {
            mean: each_axis(|k| {
                let f = leaf.place[k] as f64 * 0.25 / leaf.levels[k] as f64;
                leaf.cell.point(&header.bounds, extent, k, f)
            }),
            cov: leaf.unit.0.map(|v| v * size),
            weight: header.has_w().then(|| exp(header.log_weight(leaf.w))),
        }
    }
}

impl BlockColumns {
    fn push(&mut self, mean: [f64; 3], cov: [f64; 6], count: f64, weight: Option<f64>) {
        (0..3).for_each(|k| self.mean[k].push(mean[k]));
        (0..6).for_each(|k| self.cov[k].push(cov[k]));
        self.count.push(count);
        self.weight.extend(weight);
    }

    /// A node of which no more is known than its cell, or its Gaussian's size and about where it lies.
    fn push_node(&mut self, header: &BlockHeader, extent: [f64; 3], node: &TreeNode) {
        let widths = node.cell.widths(extent);
        let (mean, variance) = match node.below {
            NodeContent::Gaussian { size, bits, place } => {
                let radius = exp(f64::from(header.steps[1]) * (f64::from(size) + MIDDLE));
                let part = each_axis(|k| 1.0 / f64::from(1u32 << bits[k]));
                let mean =
                    each_axis(|k| node.cell.point(&header.bounds, extent, k, (f64::from(place[k]) + 0.5) * part[k]));
                let spread = each_axis(|k| widths[k] * part[k] * (widths[k] * part[k]) * PART_VARIANCE);
                (mean, spread.map(|v| v + radius * radius))
            }
            _ => {
                let mean = each_axis(|k| node.cell.point(&header.bounds, extent, k, 0.5));
                (mean, widths.map(|w| w * w * CELL_VARIANCE))
            }
        };
        let mut count = exp(f64::from(header.steps[2]) * (f64::from(node.count) + MIDDLE));
        if header.shaded {
            // Depth is of the Gaussians' own area, which is as large as their size is expected to be.
            let size = header.predict_size(node.cell.level(), node.count, node.count);
            let radius = exp(f64::from(header.steps[1]) * f64::from(size));
            let area = variance.iter().sum::<f64>() / 3.0;
            count *= if area > 0.0 { (radius * radius / area).min(1.0) } else { 1.0 };
        }
        let weight = header.has_w().then(|| exp(f64::from(header.steps[4]) * (f64::from(node.mass) + MIDDLE)));
        let [x, y, z] = variance;
        self.push(mean, [x, 0.0, 0.0, y, 0.0, z], count, weight);
    }

    /// A node of which only the number of its Gaussians is known.
    fn push_cell(&mut self, header: &BlockHeader, node: &SplitNode) {
        let extent = header.bounds.extent();
        let mean = each_axis(|k| node.cell.point(&header.bounds, extent, k, 0.5));
        let [x, y, z] = node.cell.widths(extent).map(|w| w * w * CELL_VARIANCE);
        let share = f64::from(node.count) / f64::from(header.gaussians);
        self.push(mean, [x, 0.0, 0.0, y, 0.0, z], share * header.count as f64, header.has_w().then_some(1.0));
    }

    /// The block: counts whole, sums of counts and masses the block's.
    fn into_block(self, header: BlockHeader) -> Block {
        let BlockColumns { mean, mut count, cov, mut weight } = self;
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
        let gaussians = Mixture { mean, cov, count, columns: named, law, ..Mixture::default() };
        Block { bounds: header.bounds, count: header.count, mass: header.mass, gaussians }
    }
}

impl BlockDecoder {
    /// Reads all but the segments' streams, and takes the memory that its Gaussians need. All stages must be there.
    pub(crate) fn new(block: &[u8], context: &Context<'_>) -> Result<Self, BlockFault> {
        let header = BlockHeader::read(block)?;
        header.check_length(block.len() as u64)?;
        let streams = streams::read(&header, block)?;
        // Without a table the stream goes to the end of the block, and its padding is checked when it is read.
        let last = streams.stages.last().and_then(|s| s.last()).map_or(0, |s| s.end);
        let rest = block.get(last..).ok_or("a stream ends too soon")?;
        padding(&header, block.len(), rest)?;
        let nodes = segment_nodes(&header, &streams, block)?;
        let segments = nodes.into_iter().enumerate().map(|(segment, nodes)| CodedSegment {
            nodes,
            streams: streams.stages.iter().map(|s| s[segment].clone()).collect(),
        });
        let n = header.gaussians as usize;
        let column = |n: usize| filled(COLUMNS, 0.0f64, n, context);
        Ok(BlockDecoder {
            segments: segments.collect(),
            length: block.len(),
            table: streams.table,
            columns: BlockColumns {
                mean: [column(n)?, column(n)?, column(n)?],
                count: column(n)?,
                cov: [column(n)?, column(n)?, column(n)?, column(n)?, column(n)?, column(n)?],
                weight: column(if header.has_w() { n } else { 0 })?,
            },
            header,
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.segments.len()
    }

    pub(crate) fn gaussians(&self, segment: usize) -> usize {
        gaussians(&self.segments[segment].nodes)
    }

    /// The segments, to be read from the bytes of the same block.
    pub(crate) fn segments<'a>(&'a mut self, block: &'a [u8]) -> Vec<SegmentReader<'a>> {
        let BlockDecoder { header, segments, length, table, columns } = self;
        let parts = columns.split(segments.iter().map(|s| gaussians(&s.nodes)));
        let segment = |(coded, out): (&'a CodedSegment, GaussianColumns<'a>)| SegmentReader {
            header,
            nodes: &coded.nodes,
            streams: coded.streams.iter().map(|s| &block[s.clone()]).collect(),
            padded: (!*table).then_some(*length),
            out,
        };
        segments.iter().zip(parts).map(segment).collect()
    }

    /// Gaussians of a segment that was read, of the optical-depth law. Their counts are not whole yet, and neither sums
    /// of counts nor of masses are the block's to the last digit.
    pub(crate) fn read_so_far(&self, segment: usize) -> Mixture {
        let first: usize = (0..segment).map(|s| self.gaussians(s)).sum();
        let all = first..first + self.gaussians(segment);
        let part = |column: &Vec<f64>| column[all.clone()].to_vec();
        let BlockColumns { mean, count, cov, weight } = &self.columns;
        let count = part(count);
        let mut columns = crate::model::Columns::default();
        if self.header.weighted {
            // Weights are relative to the mean of the block's particles.
            let mean = self.header.mass / self.header.count as f64;
            columns.set(MASS, count.iter().zip(&weight[all.clone()]).map(|(c, w)| c * w * mean).collect());
        }
        let (mean, cov) = (mean.each_ref().map(part), cov.each_ref().map(part));
        Mixture { mean, cov, count, columns, ..Mixture::default() }
    }

    /// Stand-ins for a segment that was not read: its boxes, each as one Gaussian with its share of the block's
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
        self.columns.into_block(self.header)
    }
}

fn start(stream: &[u8]) -> Result<RansReader<'_>, String> {
    RansReader::new(stream).ok_or_else(|| "a stream has no start".into())
}

/// Checks that a stream was read to its end; `whole`: that nothing is left of it.
fn end(reader: &RansReader<'_>, whole: bool) -> Result<(), String> {
    if reader.exhausted() {
        return Err("a stream ends too soon".into());
    }
    if !reader.finished() || (whole && !reader.rest().is_empty()) {
        return Err("a stream continues after its last Gaussian".into());
    }
    Ok(())
}

fn out_of_range(_: OutOfRange) -> String {
    "a number is out of range".into()
}

/// Checks that what follows the streams of a block of `length` bytes is the padding that it needs.
fn padding(header: &BlockHeader, length: usize, rest: &[u8]) -> Result<(), String> {
    let least = u64::from(header.gaussians).div_ceil(GAUSSIANS_A_BYTE) as usize;
    if !rest.is_empty() && (length != least || rest.iter().any(|&b| b != 0)) {
        return Err("the block continues after its last Gaussian".into());
    }
    Ok(())
}

impl BlockColumns {
    /// The columns of segments of these lengths.
    fn split<'a>(&'a mut self, lengths: impl Iterator<Item = usize> + Clone) -> Vec<GaussianColumns<'a>> {
        let part = |column: &'a mut [f64]| pieces(column, lengths.clone()).into_iter();
        let mut mean = self.mean.each_mut().map(|c| part(c));
        let mut cov = self.cov.each_mut().map(|c| part(c));
        let (mut count, mut weight) = (part(&mut self.count), part(&mut self.weight));
        let columns = |_| GaussianColumns {
            mean: mean.each_mut().map(|c| c.next().unwrap_or_default()),
            count: count.next().unwrap_or_default(),
            cov: cov.each_mut().map(|c| c.next().unwrap_or_default()),
            weight: weight.next().unwrap_or_default(),
        };
        lengths.map(columns).collect()
    }
}

impl SegmentReader<'_> {
    /// Reads the segment's streams, stage after stage.
    pub(crate) fn read(self) -> Result<(), String> {
        let SegmentReader { header, nodes, streams, padded, out } = self;
        let mut walk: Option<LevelWalk<'_>> = None;
        let (last, earlier) = streams.split_last().ok_or("a stream has no start")?;
        for (stream, &level) in earlier.iter().zip(&header.cuts) {
            let mut reader = start(stream)?;
            advance(&mut walk, &mut reader, header, nodes, usize::from(level))?;
            end(&reader, true)?;
        }
        let mut reader = start(last)?;
        let walk = advance(&mut walk, &mut reader, header, nodes, LEVELS - 1)?;
        let extent = header.bounds.extent();
        let GaussianColumns { mean, count, cov, weight } = out;
        let mut fine = FineWalk::new(header);
        let mut finite = true;
        for (i, node) in walk.leaves().map_err(out_of_range)?.into_iter().enumerate() {
            let mut leaf = Leaf::default();
            fine.code(&mut reader, &walk.nodes[node as usize], &mut leaf).map_err(out_of_range)?;
            count[i] = leaf.count;
            let whole = WholeGaussian::new(header, extent, &leaf);
            (0..3).for_each(|k| mean[k][i] = whole.mean[k]);
            whole.weight.iter().for_each(|w| weight[i] = *w);
            for k in 0..6 {
                cov[k][i] = whole.cov[k];
                finite &= whole.cov[k].is_finite();
            }
        }
        // Without a table the padding is the end of the only stream, so that is not refused but checked below.
        end(&reader, padded.is_none())?;
        if !finite {
            return Err("a covariance is out of range".into());
        }
        padded.map_or(Ok(()), |length| padding(header, length, reader.rest()))
    }
}

/// Begins the walk over levels where there is none yet, and goes on to the end of `level`.
fn advance<'a, 'h>(
    walk: &'a mut Option<LevelWalk<'h>>,
    reader: &mut RansReader<'_>,
    header: &'h BlockHeader,
    nodes: &[SplitNode],
    level: usize,
) -> Result<&'a mut LevelWalk<'h>, String> {
    let mut level_walk = match walk.take() {
        Some(walk) => walk,
        None => LevelWalk::new(reader, header, nodes, &mut NoSource).map_err(out_of_range)?,
    };
    match level_walk.run(reader, &mut NoSource, level).map_err(out_of_range)? {
        true => Ok(walk.insert(level_walk)),
        false => Err("a stream ends too soon".into()),
    }
}

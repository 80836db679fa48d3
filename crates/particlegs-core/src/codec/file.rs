//! Models as files: which sections, in which order.

use super::container::{
    self, BLOCK, CERTIFICATE, ENTRY_BYTES, HEAD_BYTES, LAYER, META, SECTION_BYTES, STAGE, STAGE_BYTES, Section, Tag,
    VIZMAPPER, belongs_to_block,
};
use super::header::BlockHeader;
use super::streams::STAGES;
use super::sums::compensated;
use super::wire::{SectionFault, WireReader};
use super::{Encoder, Precision, certificate, metadata, streams, vizmapper};
use crate::math::{cross, dot};
use crate::model::{
    Certificate, CertificateLevel, LawKind, Layer, LayerRatios, Mass, MassPower, Metadata, Model, SAMPLED_ABOVE,
    Sample, VizMapper,
};
use crate::space::Cell;
use crate::{Error, Result, hash};
use std::borrow::Cow;
use std::f64::consts::PI;

/// Layers in a file at most, and bytes of a layer's name.
pub const MOST_LAYERS: usize = 1024;
const LONGEST_NAME: usize = 255;
/// Blocks from which on a file has an index.
const INDEXED: usize = 16;

/// A coded block, with the sections that belong to it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StoredBlock {
    /// As [`Encoder::encode`] gives it. Stages may be missing at its end.
    pub bytes: Vec<u8>,
    /// Sections of tags that this program does not know.
    pub sections: Vec<StoredSection>,
}

/// A section that is copied as it is.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct StoredSection {
    /// Its tag.
    pub tag: [u8; 4],
    /// Its content, without the number of a block.
    pub bytes: Vec<u8>,
}

impl StoredSection {
    /// Bytes that it takes in a file.
    pub fn size(&self) -> usize {
        self.bytes.len() + STAGE_BYTES
    }
}

impl From<Vec<u8>> for StoredBlock {
    fn from(bytes: Vec<u8>) -> Self {
        StoredBlock { bytes, sections: Vec::new() }
    }
}

/// Coded blocks of a layer, to be put into a file ([`assemble`]), or taken from one ([`coded_layers`]).
pub type CodedLayer = Layer<Vec<StoredBlock>>;

/// A file of a model with every block at `precision`.
pub fn encode(model: &Model, precision: &Precision) -> Result<Vec<u8>> {
    let layers = model.layers.iter().map(|layer| {
        let coded = |b| Ok(Encoder::new(b)?.encode(precision).into());
        Ok(layer.with(layer.content.iter().map(coded).collect::<Result<_>>()?))
    });
    let layers = layers.collect::<Result<_>>()?;
    let network = model.vizmapper().map(|v| &**v);
    assemble_with(&model.metadata, network, model.certificate.as_ref(), layers)
}

/// A file of coded blocks: copied, not coded anew. Layers are sorted by name and blocks by their
/// bounds, so that the file does not depend on the order in which parts were merged.
pub fn assemble(metadata: &Metadata, certificate: Option<&Certificate>, layers: Vec<CodedLayer>) -> Result<Vec<u8>> {
    assemble_with(metadata, None, certificate, layers)
}

/// [`assemble`], with the network of an alpha-blend model that has one. It is kept in 8 bits a weight:
/// what is measured is best measured on the decoded file.
pub fn assemble_with(
    metadata: &Metadata,
    vizmapper: Option<&VizMapper>,
    certificate: Option<&Certificate>,
    layers: Vec<CodedLayer>,
) -> Result<Vec<u8>> {
    let network = vizmapper.map(vizmapper::write).transpose()?;
    let file = CodedFile { metadata: metadata.clone(), network, sections: Vec::new(), layers };
    file.write(certificate)
}

pub(super) struct CodedFile {
    pub metadata: Metadata,
    /// The network's section.
    pub network: Option<Vec<u8>>,
    /// Sections of unknown tags that belong to no block.
    pub sections: Vec<StoredSection>,
    pub layers: Vec<CodedLayer>,
}

impl CodedFile {
    pub(super) fn read(bytes: &[u8], place: &str) -> Result<CodedFile> {
        let copy = |part: LayerPart<'_>| part.map(|blocks| blocks.into_iter().map(BlockPart::stored).collect());
        let parts = parts(bytes, place)?;
        Ok(CodedFile {
            metadata: parts.metadata,
            network: parts.network.map(|n| n.0.to_vec()),
            sections: parts.sections.iter().map(StoredSection::from).collect(),
            layers: parts.layers.into_iter().map(copy).collect(),
        })
    }

    /// The file: metadata, certificate, network; layers with the first stage of each block; further stages, those of
    /// all blocks after each other; then what else belongs to blocks, by tag; then what belongs to none.
    pub(super) fn write(mut self, certificate: Option<&Certificate>) -> Result<Vec<u8>> {
        let masses = self.sort()?;
        let meta = metadata::write(&self.metadata, &masses);
        let certificate = certificate.map(certificate::write);
        let heads: Vec<Vec<u8>> = self.layers.iter().map(layer_bytes).collect();
        let mut out = vec![Section::new(META, None, &meta)];
        out.extend(certificate.iter().map(|c| Section::new(CERTIFICATE, None, c)));
        out.extend(self.network.iter().map(|n| Section::new(VIZMAPPER, None, n)));
        let (mut stages, mut attached, mut number) = (Vec::new(), Vec::new(), 0);
        for (layer, head) in self.layers.iter().zip(&heads) {
            out.push(Section::new(LAYER, None, head));
            for block in &layer.content {
                let header = BlockHeader::read(&block.bytes).map_err(Error::argument)?;
                let ranges = streams::stages(&header, &block.bytes).map_err(Error::argument)?;
                let mut ranges = ranges.into_iter().map(|range| &block.bytes[range]);
                out.extend(ranges.next().map(|first| Section::new(BLOCK, None, first)));
                stages.extend(ranges.enumerate().map(|(stage, bytes)| (stage, number, bytes)));
                attached.extend(block.sections.iter().map(|s| Section::new(s.tag, Some(number), &s.bytes)));
                number += 1;
            }
        }
        // Stage by stage, so that any prefix of the file is a model of all blocks (docs/format.md, section 1).
        stages.sort_by_key(|&(stage, block, _)| (stage, block));
        out.extend(stages.into_iter().map(|(_, block, bytes)| Section::new(STAGE, Some(block), bytes)));
        attached.sort_by_key(|s: &Section<'_>| s.tag);
        out.extend(attached);
        out.extend(self.sections.iter().map(|s| Section::new(s.tag, None, &s.bytes)));
        let file = container::write(container::MODEL, &out, number as usize >= INDEXED);
        // Numbers that only a whole file has (sums, bounds, radius) may be none that the format holds.
        match parts(&file, "the model") {
            Ok(_) => Ok(file),
            Err(Error::Corrupt { what, .. }) => Err(Error::argument(format!("a model file cannot store this: {what}"))),
            Err(other) => Err(other),
        }
    }

    /// Sorts layers and blocks and checks them; the masses of the layers.
    fn sort(&mut self) -> Result<Vec<Mass>> {
        let shaded = self.metadata.law == LawKind::AlphaBlend;
        if self.network.is_some() && !shaded {
            return Err(Error::argument("only models of the alpha-blend law have a VizMapper"));
        }
        let layers = &mut self.layers;
        layers.sort_by(|a, b| a.name.cmp(&b.name));
        let names_differ = layers.windows(2).all(|w| w[0].name != w[1].name);
        let sound = |l: &CodedLayer| {
            !l.content.is_empty() && l.content.len() <= u32::MAX as usize && l.name.len() <= LONGEST_NAME
        };
        if layers.is_empty() || layers.len() > MOST_LAYERS || !names_differ || !layers.iter().all(sound) {
            return Err(Error::argument(
                "a model file needs layers with distinct names of at most 255 bytes, each with at least one block",
            ));
        }
        let mut masses = Vec::with_capacity(layers.len());
        for layer in layers {
            let mut keyed = Vec::with_capacity(layer.content.len());
            for block in layer.content.drain(..) {
                let header = BlockHeader::read(&block.bytes).map_err(Error::argument)?;
                if header.shaded != shaded {
                    return Err(Error::argument(other_law(&layer.name, self.metadata.law)));
                }
                keyed.push((order_key(&header), header.weighted, block));
            }
            // Blocks of equal bounds come in the order of their bytes (section 1).
            keyed.sort();
            let weighted = keyed.first().is_some_and(|b| b.1);
            if keyed.iter().any(|b| b.1 != weighted) {
                return Err(Error::argument(format!(
                    "some blocks of layer `{}` have weights and others do not",
                    layer.name
                )));
            }
            masses.push(Mass::new(weighted, layer.mass.unit()));
            layer.content = keyed.into_iter().map(|k| k.2).collect();
        }
        Ok(masses)
    }
}

/// Blocks that contradict the law of their file.
fn other_law(layer: &str, law: LawKind) -> String {
    format!("a block of layer `{layer}` does not follow the law {}", law.name())
}

/// Bytes that a network of the alpha-blend law adds to a file.
pub const VIZMAPPER_SECTION_BYTES: usize = SECTION_BYTES + vizmapper::VIZMAPPER_BYTES;

/// Bytes that a coded block takes in a file: a section for each further stage, beside what [`size_without_blocks`]
/// counts for it.
pub fn stored_bytes(block: &[u8]) -> usize {
    let stages = BlockHeader::read(block).map_or(0, |h| h.cuts.len());
    block.len() + stages * STAGE_BYTES
}

/// Bytes that a certificate takes in a file.
pub fn certificate_bytes(certificate: &Certificate) -> usize {
    SECTION_BYTES + certificate::write(certificate).len()
}

/// Bytes of a file beside its coded blocks, with or without a certificate of a level. The file's size is this plus the
/// [`stored_bytes`] of its blocks, and of its network where it has one ([`VIZMAPPER_SECTION_BYTES`]); less where a file
/// with an index has blocks without stages. Of each layer the number of its blocks.
pub fn size_without_blocks(metadata: &Metadata, certificate: CertificateLevel, layers: &[Layer<usize>]) -> usize {
    // P(k) by mass is there where masses may differ: of particles with weights, and of several layers.
    let mass_power = match layers {
        [one] if !one.mass.is_weighted() => None,
        several => Some(MassPower::new(several.len())),
    };
    let sample = (metadata.count > SAMPLED_ABOVE).then(Sample::default);
    let certificate = match certificate {
        CertificateLevel::None => 0,
        CertificateLevel::Blocks => {
            SECTION_BYTES + certificate::size(CertificateLevel::Blocks, &Certificate::default())
        }
        level => {
            let layer_ratios = LayerRatios::new(layers.len());
            let layout = Certificate { mass_power, sample, layer_ratios, ..Certificate::default() };
            SECTION_BYTES + certificate::size(level, &layout)
        }
    };
    let heads: usize = layers.iter().map(|l| SECTION_BYTES + 5 + l.name.len() + SECTION_BYTES * l.content).sum();
    let blocks: usize = layers.iter().map(|l| l.content).sum();
    // Metadata, certificate and network beside the layers.
    let entries = 3 + layers.len() + blocks * (1 + STAGES.len());
    let index = if blocks < INDEXED { 0 } else { SECTION_BYTES + ENTRY_BYTES * entries };
    let heads = heads + index;
    let masses: Vec<Mass> = layers.iter().map(|l| l.mass).collect();
    HEAD_BYTES + SECTION_BYTES + metadata::write(metadata, &masses).len() + certificate + heads
}

/// Key that blocks are sorted by: the lower corner of the bounds, then the upper, in the order of numbers.
pub(super) fn order_key(h: &BlockHeader) -> [u64; 6] {
    let ordered = |v: f64| {
        // -0 and 0 are one place; negative numbers count down.
        let bits = (v + 0.0).to_bits();
        if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
    };
    let (a, b) = (h.bounds.min, h.bounds.max);
    [a[0], a[1], a[2], b[0], b[1], b[2]].map(ordered)
}

fn layer_bytes(layer: &CodedLayer) -> Vec<u8> {
    let mut out = vec![layer.name.len() as u8];
    out.extend(layer.name.as_bytes());
    out.extend((layer.content.len() as u32).to_le_bytes());
    out
}

/// A parsed file: metadata and certificate are decoded, blocks are not.
pub(super) struct FileParts<'a> {
    pub metadata: Metadata,
    pub certificate: Option<Certificate>,
    /// The network's section and its content.
    pub network: Option<(&'a [u8], VizMapper)>,
    pub layers: Vec<LayerPart<'a>>,
    /// Sections of unknown tags that belong to no block.
    pub sections: Vec<Section<'a>>,
    /// Particles of blocks that an open file ends before.
    pub missing_particles: u64,
}

type LayerPart<'a> = Layer<Vec<BlockPart<'a>>>;

pub(super) struct BlockPart<'a> {
    pub header: BlockHeader,
    /// Place of its first section.
    pub offset: usize,
    /// Its stages, one after the other.
    pub bytes: Cow<'a, [u8]>,
    /// Stages that are there.
    pub stages: usize,
    /// Sections of unknown tags that belong to it.
    pub sections: Vec<Section<'a>>,
}

impl BlockPart<'_> {
    pub(super) fn is_whole(&self) -> bool {
        self.stages > self.header.cuts.len()
    }

    fn stored(self) -> StoredBlock {
        let sections = self.sections.iter().map(StoredSection::from).collect();
        StoredBlock { bytes: self.bytes.into_owned(), sections }
    }
}

impl From<&Section<'_>> for StoredSection {
    fn from(section: &Section<'_>) -> Self {
        StoredSection { tag: section.tag, bytes: section.bytes.to_vec() }
    }
}

/// Reads all but the streams, and checks what the parts say of each other.
pub(super) fn parts<'a>(bytes: &'a [u8], place: &str) -> Result<FileParts<'a>> {
    let file = container::read(container::MODEL, bytes, place)?;
    let corrupt = |message: String| Error::corrupt(place, message);
    let fault = |fault: SectionFault| match fault {
        SectionFault::Corrupt(message) => corrupt(message),
        SectionFault::Unknown(message) => Error::Compatibility { place: place.into(), what: message },
    };
    let known = |tag: Tag| matches!(tag, META | CERTIFICATE | VIZMAPPER | LAYER | BLOCK | STAGE);
    // Sections of unknown tags may stand between any others, so they are set apart before the order is checked.
    let (sections, others): (Vec<_>, Vec<_>) = file.sections.into_iter().partition(|s| known(s.tag));
    let (attached, others): (Vec<_>, Vec<_>) = others.into_iter().partition(|s| belongs_to_block(s.tag));
    let mut rest = sections.into_iter().peekable();
    let (mut metadata, masses) = match rest.next() {
        Some(s) if s.tag == META => metadata::read(s.bytes).map_err(fault)?,
        _ => return Err(corrupt("the file does not begin with metadata".into())),
    };
    let certificate = rest.next_if(|s| s.tag == CERTIFICATE).map(|s| certificate::read(s.bytes).map_err(corrupt));
    let certificate = certificate.transpose()?;
    let network = rest.next_if(|s| s.tag == VIZMAPPER).map(|s| match vizmapper::read(s.bytes) {
        Ok(_) if metadata.law != LawKind::AlphaBlend => Err(corrupt("the file has a VizMapper but another law".into())),
        Ok(network) => Ok((s.bytes, network)),
        Err(error) => Err(fault(error)),
    });
    let network = network.transpose()?;
    let mut layers: Vec<(String, usize, Vec<BlockPart<'a>>)> = Vec::new();
    while let Some(section) = rest.next_if(|s| s.tag != STAGE) {
        let (name, count) = layer_head(&section).map_err(corrupt)?;
        if layers.len() == MOST_LAYERS || layers.last().is_some_and(|l| l.0 >= name) {
            return Err(corrupt(format!("layer `{name}` is out of order or there are too many layers")));
        }
        let mut blocks: Vec<BlockPart<'a>> = Vec::new();
        while let Some(Section { offset, bytes, .. }) = rest.next_if(|s| s.tag == BLOCK) {
            let at = |message: String| corrupt(format!("block at byte {offset}: {message}"));
            let header = BlockHeader::read(bytes).map_err(at)?;
            blocks.push(BlockPart { header, offset, bytes: bytes.into(), stages: 1, sections: Vec::new() });
        }
        layers.push((name, count as usize, blocks));
    }
    let number_of = |blocks: &[&mut BlockPart<'a>], s: &Section<'_>| {
        let number = s.block.map_or(usize::MAX, |b| b as usize);
        let error =
            || corrupt(format!("the section at byte {} refers to block {number}, which does not exist", s.offset));
        if number < blocks.len() { Ok(number) } else { Err(error()) }
    };
    // Blocks are numbered through all layers, so their further sections are handed out when all layers are read.
    let mut blocks: Vec<&mut BlockPart<'a>> = layers.iter_mut().flat_map(|l| &mut l.2).collect();
    let mut before = None;
    for section in rest {
        if section.tag != STAGE {
            return Err(corrupt(out_of_order(&section)));
        }
        let number = number_of(&blocks, &section)?;
        let block = &mut blocks[number];
        // Stage by stage, in the order of the blocks.
        let place = Some((block.stages, number));
        if place <= before || block.stages > block.header.cuts.len() {
            return Err(corrupt(out_of_order(&section)));
        }
        before = place;
        block.bytes.to_mut().extend(section.bytes);
        block.stages += 1;
    }
    for section in attached {
        let number = number_of(&blocks, &section)?;
        blocks[number].sections.push(section);
    }
    for block in &mut blocks {
        let at = |message: String| corrupt(format!("block at byte {}: {message}", block.offset));
        // Sections are the stages that its table has; a block of one stage alone need not be taken apart.
        let cuts = block.header.cuts.len();
        let stage_count = if cuts == 0 { 1 } else { streams::stages(&block.header, &block.bytes).map_err(at)?.len() };
        if stage_count != block.stages {
            return Err(at(format!("{} sections but {stage_count} stages", block.stages)));
        }
    }
    // Stages come after all blocks: where there is one, no block is missing.
    check_blocks(&layers, file.open && before.is_none()).map_err(corrupt)?;
    // An open file leaves out a layer that it ends before, and the masses of its metadata go with it.
    layers.retain(|l| !l.2.is_empty());
    let wrong = || corrupt("the number of masses differs from the number of layers".into());
    let masses = metadata::of_layers(&masses, layers.len(), file.open).ok_or_else(wrong)?;
    let part = |((name, _, content), mass)| Layer { name, mass, content };
    let layers: Vec<LayerPart<'a>> = layers.into_iter().zip(masses).map(part).collect();
    let mut missing_particles = 0;
    if file.open {
        // What is there may be less than the whole: the rest of the file speaks of what is there.
        let headers = || layers.iter().flat_map(|l| l.content.iter().map(|b| &b.header));
        let particles = headers().fold(0u64, |sum, h| sum.saturating_add(h.count));
        missing_particles = metadata.count.saturating_sub(particles);
        if missing_particles > 0 {
            (metadata.count, metadata.mass) = (particles, compensated(&headers().map(|h| h.mass).collect::<Vec<_>>()));
        }
    }
    agree(&metadata, &layers).map_err(corrupt)?;
    // What was measured on the whole says nothing of a part of it.
    let complete = missing_particles == 0 && layers.iter().flat_map(|l| &l.content).all(BlockPart::is_whole);
    let certificate = certificate.filter(|_| complete);
    certificate.iter().try_for_each(|c| agree_with(c, &metadata, bytes.len() as u64)).map_err(corrupt)?;
    Ok(FileParts { metadata, certificate, network, layers, sections: others, missing_particles })
}

/// Checks that the blocks that each layer says are there, in order. The last ones of an open file may be missing.
fn check_blocks(layers: &[(String, usize, Vec<BlockPart<'_>>)], open: bool) -> std::result::Result<(), String> {
    for (i, (name, count, blocks)) in layers.iter().enumerate() {
        let cut = open && i + 1 == layers.len() && blocks.len() < *count;
        if *count == 0 || blocks.len() != *count && !cut {
            return Err(format!("layer `{name}` has {} of {count} blocks", blocks.len()));
        }
        let out_of_order =
            |w: &&[BlockPart<'_>]| (order_key(&w[0].header), &w[0].bytes) > (order_key(&w[1].header), &w[1].bytes);
        if let Some(pair) = blocks.windows(2).find(out_of_order) {
            return Err(format!("the block at byte {} is out of order", pair[1].offset));
        }
    }
    match layers.iter().any(|l| !l.2.is_empty()) {
        true => Ok(()),
        false => Err("the file ends before the first block".into()),
    }
}

fn out_of_order(section: &Section<'_>) -> String {
    format!("section `{}` at byte {} is out of order", section.tag.escape_ascii(), section.offset)
}

fn layer_head(section: &Section<'_>) -> std::result::Result<(String, u32), String> {
    if section.tag != LAYER {
        return Err(out_of_order(section));
    }
    let mut r = WireReader::new(section.bytes);
    let length = r.u8()?;
    let name = std::str::from_utf8(r.take(usize::from(length))?).map_err(|_| "a layer name is not UTF-8")?.to_string();
    let count = r.u32()?;
    if r.is_done() {
        Ok((name, count))
    } else {
        Err(format!("the header of a layer is {} bytes too long", section.bytes.len() - r.position()))
    }
}

/// Blocks hold together what the metadata says.
fn agree(m: &Metadata, layers: &[LayerPart<'_>]) -> std::result::Result<(), String> {
    let blocks = || layers.iter().flat_map(|l| l.content.iter().map(|b| &b.header));
    let count = blocks().try_fold(0u64, |sum, b| sum.checked_add(b.count));
    if count != Some(m.count) {
        let particles = count.map_or_else(|| "too many".into(), |n| n.to_string());
        return Err(format!("the blocks have {particles} particles, but the metadata says {}", m.count));
    }
    let shaded = m.law == LawKind::AlphaBlend;
    if let Some(l) = layers.iter().find(|l| l.content.iter().any(|b| b.header.shaded != shaded)) {
        return Err(other_law(&l.name, m.law));
    }
    let mass: f64 = blocks().map(|b| b.mass).sum();
    if let Some(l) = layers.iter().find(|l| l.content.iter().any(|b| b.header.weighted != l.mass.is_weighted())) {
        return Err(format!("the blocks of layer `{}` and the metadata disagree about weights", l.name));
    }
    // Sums of masses depend on their order, so that they agree only up to rounding (section 1).
    if (mass - m.mass).abs() > 1e-9 * m.mass {
        return Err(format!("the blocks have a mass of {mass}, but the metadata says {}", m.mass));
    }
    Ok(())
}

/// A certificate is of the file's particles, in bytes no more than the file's.
fn agree_with(c: &Certificate, m: &Metadata, bytes: u64) -> std::result::Result<(), String> {
    let extent = m.bounds.extent();
    let of_cell = |cell: Cell| {
        let [a, b, c] = cell.vectors;
        dot(a, cross(b, c)).abs()
    };
    let volume = extent[0] * extent[1] * extent[2];
    // A snapshot may fill a part of its cell alone, and a cell may have no volume.
    let volume = m.cell.map(of_cell).filter(|v| *v > 0.0).map_or(volume, |v| v.min(volume));
    // Twice the particles' Nyquist frequency.
    let largest = 2.0 * PI * libm::cbrt(m.count as f64 / volume);
    let too_many = c.subset.is_some_and(|s| s.kept > m.count || s.bytes > bytes)
        || c.sample.is_some_and(|s| s.particles > m.count)
        || c.densities.iter().flatten().any(|d| d.particles > m.count as f64);
    match c.science {
        Some(s) if s.k_max > largest => Err(format!("the largest wave number is too large: {}", s.k_max)),
        _ if too_many => Err("the certificate lists more particles or bytes than the file has".into()),
        _ => Ok(()),
    }
}

/// The coded blocks of a file, to be merged or copied ([`assemble`]).
pub fn coded_layers(bytes: &[u8], place: &str) -> Result<Vec<CodedLayer>> {
    Ok(CodedFile::read(bytes, place)?.layers)
}

/// BLAKE3 of a model file's bytes: what is made from a model names it by this.
pub fn file_hash(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hash::update(&mut hasher, bytes);
    *hasher.finalize().as_bytes()
}

/// Metadata alone.
pub fn read_metadata(bytes: &[u8], place: &str) -> Result<Metadata> {
    Ok(parts(bytes, place)?.metadata)
}

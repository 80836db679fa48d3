//! Models as files: which sections, in which order.

use super::container::{
    self, ALPHA_BLEND_SINCE, BASELINES, BASELINES_SINCE, BLOCK, CERTIFICATE, HEAD_BYTES, LAYER, MEASURES, META,
    SCIENCE, SCIENCE_SINCE, SECOND_CODING_SINCE, SECTION_BYTES, Section, VIZMAPPER,
};
use super::header::BlockHeader;
use super::metadata::Fault;
use super::wire::Reader;
use super::{Encoder, Precision, baselines, certificate, measures, metadata, science, vizmapper};
use crate::model::{Certificate, CertificateLevel, LawKind, Layer, Mass, Metadata, Model, SAMPLED_ABOVE, VizMapper};
use crate::{Error, Result, parallel};

/// Place of the minor version in a file.
const MINOR_AT: usize = 9;
/// Layers in a file at most, and bytes of a layer's name.
pub const MOST_LAYERS: usize = 1024;
const LONGEST_NAME: usize = 255;

/// Coded blocks of a layer, as [`Encoder::encode`] gives them or [`coded_layers`] takes them from a file.
pub type CodedLayer = Layer<Vec<Vec<u8>>>;

/// A file of a model with every block at `precision`.
///
/// # Errors
/// [`Error::Argument`] where the model holds no layer, a layer without blocks, or numbers that
/// cannot be coded.
pub fn encode(model: &Model, precision: &Precision) -> Result<Vec<u8>> {
    let layers = model.layers.iter().map(|layer| {
        let blocks = layer.content.iter().map(|b| Ok(Encoder::new(b)?.encode(precision))).collect::<Result<_>>()?;
        Ok(layer.with(blocks))
    });
    let layers = layers.collect::<Result<_>>()?;
    let network = model.vizmapper().map(|v| &**v);
    assemble_with(&model.metadata, network, model.certificate.as_ref(), layers)
}

/// A file of coded blocks: copied, not coded anew. Layers are sorted by name and blocks by their
/// bounds, so that the file does not depend on the order in which parts were merged.
///
/// # Errors
/// [`Error::Argument`] where there is no layer, one without blocks, two of one name, a block that is
/// none, or one of another law than the metadata's, and for metadata that no file holds.
pub fn assemble(metadata: &Metadata, certificate: Option<&Certificate>, layers: Vec<CodedLayer>) -> Result<Vec<u8>> {
    assemble_with(metadata, None, certificate, layers)
}

/// [`assemble`], with the network of an alpha-blend model that has one. It is kept in 8 bits a weight:
/// what is measured is best measured on the decoded file.
///
/// # Errors
/// As [`assemble`]; for a network that cannot be coded, or of a model of another law.
pub fn assemble_with(
    metadata: &Metadata,
    vizmapper: Option<&VizMapper>,
    certificate: Option<&Certificate>,
    layers: Vec<CodedLayer>,
) -> Result<Vec<u8>> {
    let network = vizmapper.map(vizmapper::write).transpose()?;
    put_together(metadata, network.as_deref(), certificate, layers)
}

/// [`assemble_with`] of a network's section as it is coded.
pub(super) fn put_together(
    metadata: &Metadata,
    network: Option<&[u8]>,
    certificate: Option<&Certificate>,
    mut layers: Vec<CodedLayer>,
) -> Result<Vec<u8>> {
    let shaded = metadata.law == LawKind::AlphaBlend;
    if network.is_some() && !shaded {
        return Err(Error::argument("a VizMapper belongs to models of the alpha-blend law alone"));
    }
    layers.sort_by(|a, b| a.name.cmp(&b.name));
    let names_differ = layers.windows(2).all(|w| w[0].name != w[1].name);
    let sound =
        |l: &CodedLayer| !l.content.is_empty() && l.content.len() <= u32::MAX as usize && l.name.len() <= LONGEST_NAME;
    if layers.is_empty() || layers.len() > MOST_LAYERS || !names_differ || !layers.iter().all(sound) {
        return Err(Error::argument(
            "a model file needs layers of different names of at most 255 bytes, each with blocks",
        ));
    }
    let mut masses = Vec::with_capacity(layers.len());
    let mut second = false;
    for layer in &mut layers {
        let mut keyed = Vec::with_capacity(layer.content.len());
        for block in layer.content.drain(..) {
            let header = BlockHeader::read(&block).map_err(Error::argument)?;
            if header.shaded != shaded {
                return Err(Error::argument(other_law(&layer.name, metadata.law)));
            }
            second |= header.spreads.is_some();
            keyed.push((order_key(&header), header.weighted, block));
        }
        keyed.sort();
        let weighted = keyed.first().is_some_and(|b| b.1);
        if keyed.iter().any(|b| b.1 != weighted) {
            return Err(Error::argument(format!(
                "some blocks of layer `{}` have weights and some have none",
                layer.name
            )));
        }
        masses.push(Mass::new(weighted, layer.mass.unit()));
        layer.content = keyed.into_iter().map(|k| k.2).collect();
    }
    let meta = metadata::write(metadata, &masses);
    let science = certificate.and_then(|c| c.science.as_ref()).map(science::write);
    let baselines = certificate.and_then(|c| c.baselines.as_ref()).map(baselines::write);
    let further = certificate.map_or(0, |c| measures::minor_version(&c.measures));
    let measures = certificate.and_then(|c| measures::write(&c.measures));
    let certificate = certificate.map(certificate::write);
    let heads: Vec<Vec<u8>> = layers.iter().map(layer_bytes).collect();
    let body = layers.iter().zip(&heads).flat_map(|(layer, head)| {
        std::iter::once((LAYER, &head[..])).chain(layer.content.iter().map(|b| (BLOCK, &b[..])))
    });
    let minor = metadata::minor_version(&meta, metadata.law)
        .max(if science.is_some() { SCIENCE_SINCE } else { 0 })
        .max(if baselines.is_some() { BASELINES_SINCE } else { 0 })
        .max(if measures.is_some() { further } else { 0 })
        .max(if second { SECOND_CODING_SINCE } else { 0 });
    let front = std::iter::once((META, &meta[..]))
        .chain(certificate.iter().map(|c| (CERTIFICATE, &c[..])))
        .chain(science.iter().map(|s| (SCIENCE, &s[..])))
        .chain(baselines.iter().map(|b| (BASELINES, &b[..])))
        .chain(measures.iter().map(|m| (MEASURES, &m[..])))
        .chain(network.iter().map(|&n| (VIZMAPPER, n)));
    let file = container::write(minor, front.chain(body));
    // Numbers that only a whole file has (sums, bounds, radius) may be none that the format holds.
    match parts(&file, "the model") {
        Ok(_) => Ok(file),
        Err(Error::Corrupt { what, .. }) => Err(Error::argument(format!("no model file can hold this: {what}"))),
        Err(other) => Err(other),
    }
}

/// Blocks that contradict the law of their file.
fn other_law(layer: &str, law: LawKind) -> String {
    format!("a block of layer `{layer}` is not of the law {}", law.name())
}

/// What a network of the alpha-blend law adds to a file.
pub const VIZMAPPER_SECTION_BYTES: usize = SECTION_BYTES + vizmapper::VIZMAPPER_BYTES;

/// Bytes of a file beside its coded blocks, with or without a certificate of a level. The
/// file's size is this plus the sizes of its blocks, and of its network where it has one
/// ([`VIZMAPPER_SECTION_BYTES`]). Of each layer the number of its blocks.
pub fn size_without_blocks(metadata: &Metadata, certificate: CertificateLevel, layers: &[Layer<usize>]) -> usize {
    // P(k) by mass is there where masses may differ: of particles with weights, and of several layers.
    let by_mass = match layers {
        [one] if !one.mass.is_weighted() => 0,
        several => measures::mass_power_bytes(several.len()),
    };
    let sample = if metadata.count > SAMPLED_ABOVE { measures::SAMPLE_FIELD_BYTES } else { 0 };
    let contents = certificate::CERTIFICATE_BYTES + science::SCIENCE_BYTES + baselines::BASELINES_BYTES;
    let measured = |figures: usize| 4 * SECTION_BYTES + contents + figures;
    let certificate = match certificate {
        CertificateLevel::None => 0,
        CertificateLevel::Quick => measured(measures::QUICK_BYTES + by_mass + sample),
        CertificateLevel::Full => measured(measures::FULL_BYTES + by_mass + sample),
        CertificateLevel::Blocks => measured(measures::ADDED_UP_BYTES),
    };
    let heads: usize = layers.iter().map(|l| SECTION_BYTES + 5 + l.name.len() + SECTION_BYTES * l.content).sum();
    let masses: Vec<Mass> = layers.iter().map(|l| l.mass).collect();
    HEAD_BYTES + SECTION_BYTES + metadata::write(metadata, &masses).len() + certificate + heads
}

/// What bounds a block sorts by: the lower corner, then the upper, in the order of numbers.
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

/// A file taken apart: metadata and certificate read, blocks still coded.
pub(super) struct Parts<'a> {
    pub metadata: Metadata,
    pub certificate: Option<Certificate>,
    /// The network's section, and what it says.
    pub network: Option<(&'a [u8], VizMapper)>,
    pub layers: Vec<Part<'a>>,
}

/// Coded blocks where they lie in a file, and their headers.
type Part<'a> = Layer<Vec<(Section<'a>, BlockHeader)>>;

/// Reads all but the streams, and checks what the parts say of each other.
pub(super) fn parts<'a>(bytes: &'a [u8], place: &str) -> Result<Parts<'a>> {
    let sections = container::read(bytes, place)?;
    let corrupt = |what: String| Error::corrupt(place, what);
    let mut rest = sections.into_iter().peekable();
    let unknown = |what: String| Error::Compatibility { place: place.into(), what };
    let (metadata, masses) = match rest.next() {
        Some(s) if s.tag == META => metadata::read(s.bytes).map_err(|fault| match fault {
            Fault::Corrupt(what) => corrupt(what),
            Fault::Unknown(what) => unknown(what),
        })?,
        _ => return Err(corrupt("it does not begin with metadata".into())),
    };
    if metadata.law == LawKind::AlphaBlend && bytes[MINOR_AT] < ALPHA_BLEND_SINCE {
        return Err(unknown(format!("version 1.{} does not know the image law 2", bytes[MINOR_AT])));
    }
    let mut certificate = match rest.next_if(|s| s.tag == CERTIFICATE) {
        Some(s) => Some(certificate::read(s.bytes).map_err(corrupt)?),
        None => None,
    };
    if let Some(c) = &mut certificate
        && let Some(s) = rest.next_if(|s| s.tag == SCIENCE)
    {
        c.science = Some(science::read(s.bytes).map_err(corrupt)?);
    }
    if let Some(c) = &mut certificate
        && let Some(s) = rest.next_if(|s| s.tag == BASELINES)
    {
        c.baselines = Some(baselines::read(s.bytes).map_err(corrupt)?);
    }
    if let Some(c) = &mut certificate
        && let Some(s) = rest.next_if(|s| s.tag == MEASURES)
    {
        c.measures = measures::read(s.bytes).map_err(corrupt)?;
    }
    let network = rest.next_if(|s| s.tag == VIZMAPPER).map(|s| match vizmapper::read(s.bytes) {
        Ok(_) if metadata.law != LawKind::AlphaBlend => Err(corrupt("a VizMapper in a file of another law".into())),
        Ok(network) => Ok((s.bytes, network)),
        Err(vizmapper::Fault::Corrupt(what)) => Err(corrupt(what)),
        Err(vizmapper::Fault::Unknown(what)) => Err(unknown(what)),
    });
    let network = network.transpose()?;
    let mut layers: Vec<(String, Vec<(Section<'a>, BlockHeader)>)> = Vec::new();
    while let Some(section) = rest.next() {
        let (name, count) = layer_head(&section).map_err(corrupt)?;
        if layers.len() == MOST_LAYERS || layers.last().is_some_and(|l| l.0 >= name) {
            return Err(corrupt(format!("layer `{name}` is out of order, or one too many")));
        }
        let mut blocks: Vec<(Section<'a>, BlockHeader)> = Vec::new();
        while let Some(section) = rest.next_if(|s| s.tag == BLOCK) {
            let at = |what: String| corrupt(format!("block at byte {}: {what}", section.offset));
            let header = BlockHeader::read(section.bytes).map_err(at)?;
            let order =
                |b: &(Section<'a>, BlockHeader)| (order_key(&b.1), b.0.bytes) > (order_key(&header), section.bytes);
            if blocks.last().is_some_and(order) {
                return Err(at("out of order".into()));
            }
            blocks.push((section, header));
        }
        if blocks.is_empty() || blocks.len() != count as usize {
            return Err(corrupt(format!("layer `{name}` has {} of {count} blocks", blocks.len())));
        }
        layers.push((name, blocks));
    }
    let masses = metadata::of_layers(&masses, layers.len())
        .ok_or_else(|| corrupt("masses of another number of layers".into()))?;
    let part = |((name, content), mass)| Layer { name, mass, content };
    let layers: Vec<Part<'a>> = layers.into_iter().zip(masses).map(part).collect();
    agree(&metadata, &layers).map_err(corrupt)?;
    Ok(Parts { metadata, certificate, network, layers })
}

fn layer_head(section: &Section<'_>) -> std::result::Result<(String, u32), String> {
    if section.tag != LAYER {
        return Err(format!("a section `{}` at byte {} out of order", section.tag.escape_ascii(), section.offset));
    }
    let mut r = Reader::new(section.bytes);
    let length = r.u8()?;
    let name =
        std::str::from_utf8(r.take(usize::from(length))?).map_err(|_| "a layer's name is not UTF-8")?.to_string();
    let count = r.u32()?;
    if r.is_done() {
        Ok((name, count))
    } else {
        Err(format!("{} bytes too many in a layer's head", section.bytes.len() - r.position()))
    }
}

/// Blocks hold together what the metadata says.
fn agree(m: &Metadata, layers: &[Part<'_>]) -> std::result::Result<(), String> {
    let blocks = || layers.iter().flat_map(|l| l.content.iter().map(|b| &b.1));
    let count = blocks().try_fold(0u64, |sum, b| sum.checked_add(b.count));
    if count != Some(m.count) {
        let held = count.map_or_else(|| "too many".into(), |n| n.to_string());
        return Err(format!("blocks hold {held} particles, the metadata says {}", m.count));
    }
    let shaded = m.law == LawKind::AlphaBlend;
    if let Some(l) = layers.iter().find(|l| l.content.iter().any(|b| b.1.shaded != shaded)) {
        return Err(other_law(&l.name, m.law));
    }
    let mass: f64 = blocks().map(|b| b.mass).sum();
    if let Some(l) = layers.iter().find(|l| l.content.iter().any(|b| b.1.weighted != l.mass.is_weighted())) {
        return Err(format!("the blocks of layer `{}` and the metadata disagree about weights", l.name));
    }
    if (mass - m.mass).abs() > 1e-9 * m.mass {
        return Err(format!("blocks hold a mass of {mass}, the metadata says {}", m.mass));
    }
    Ok(())
}

/// The coded blocks of a file, to be merged or copied ([`assemble`]).
///
/// # Errors
/// As [`super::decode`], streams apart.
pub fn coded_layers(bytes: &[u8], place: &str) -> Result<Vec<CodedLayer>> {
    Ok(coded_file(bytes, place)?.layers)
}

/// A file taken apart to be merged.
pub(super) struct CodedFile {
    pub metadata: Metadata,
    /// The network's section.
    pub network: Option<Vec<u8>>,
    pub layers: Vec<CodedLayer>,
}

/// Metadata, network and coded blocks of a file.
pub(super) fn coded_file(bytes: &[u8], place: &str) -> Result<CodedFile> {
    let copy = |part: Part<'_>| part.map(|blocks| blocks.iter().map(|b| b.0.bytes.to_vec()).collect());
    let parts = parts(bytes, place)?;
    Ok(CodedFile {
        metadata: parts.metadata,
        network: parts.network.map(|n| n.0.to_vec()),
        layers: parts.layers.into_iter().map(copy).collect(),
    })
}

/// BLAKE3 of a model file's bytes: what is made from a model names it by this.
pub fn file_hash(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    parallel::hash(&mut hasher, bytes);
    *hasher.finalize().as_bytes()
}

/// Metadata alone.
///
/// # Errors
/// As [`super::read_info`].
pub fn read_metadata(bytes: &[u8], place: &str) -> Result<Metadata> {
    Ok(parts(bytes, place)?.metadata)
}

//! Model files to models, whole or piece by piece.

use super::container::{CORRELATION, FIELD, FIELD_CHANGE, SHARE};
use super::decoder::{self, BlockDecoder};
use super::field::{PreviousField, decode_field};
use super::field_correlation::decode_correlation;
use super::file::{BlockPart, FileParts, StoredSection, parts};
use super::info::FileInfo;
use super::shared_species::separated;
use crate::context::Context;
use crate::model::{
    Block, Columns, FieldMoments, LawKind, Metadata, Mixture, Model, Quantity, QuantityKind, SharedSpecies,
};
use crate::{Error, Result, parallel};
use std::borrow::Cow;
use std::sync::Arc;

/// [`decode_with`], silently.
pub fn decode(bytes: &[u8], place: &str) -> Result<Model> {
    decode_with(bytes, place, &Context::SILENT)
}

/// Reads a whole file. `place` names it in errors. A small file may stand for many Gaussians: memory is
/// asked for before they are decoded.
pub fn decode_with(bytes: &[u8], place: &str, context: &Context<'_>) -> Result<Model> {
    Decoder::new(bytes, place, context)?.finish()
}

/// A model file on its way to its model, for who wants to see what there is of it meanwhile. Its pieces (segments of
/// blocks, of 65 536 Gaussians at most unless they cannot be told apart) are read on their own, in any order:
/// [`Decoder::finish`] gives the same model whichever were read before. Blocks without all their stages have no pieces:
/// they decode to fewer, larger Gaussians.
pub struct Decoder<'a> {
    file: Cow<'a, [u8]>,
    place: String,
    info: FileInfo,
    /// The blocks of all layers, in order.
    blocks: Vec<PartialBlock>,
    pieces: Vec<SegmentPiece>,
}

struct PartialBlock {
    layer: usize,
    /// Of the section's head in the file, as errors have it; and the block's bytes.
    offset: usize,
    bytes: Vec<u8>,
    state: BlockState,
    /// Sections of fields, shares, and correlations of fields; none of a block that lacks stages.
    fields: Vec<StoredSection>,
    correlations: Vec<Vec<u8>>,
}

enum BlockState {
    Whole(BlockDecoder),
    /// Stages are missing.
    Coarse(Block),
}

struct SegmentPiece {
    block: usize,
    segment: usize,
    read: bool,
}

impl<'a> Decoder<'a> {
    /// Reads everything but the Gaussians, and takes the memory that they need.
    pub fn new(file: impl Into<Cow<'a, [u8]>>, place: &str, context: &Context<'_>) -> Result<Self> {
        let file = file.into();
        let parts = parts(&file, place)?;
        context.require_memory("decoding the model", decoding_bytes(&parts))?;
        let (mut blocks, mut pieces) = (Vec::new(), Vec::new());
        for (layer, part) in parts.layers.iter().enumerate() {
            for block in &part.content {
                let at = |fault: decoder::BlockFault| fault.at(|message| corrupt(place, block.offset, message));
                let state = if block.is_whole() {
                    let decoder = BlockDecoder::new(&block.bytes, context).map_err(at)?;
                    let piece = |segment| SegmentPiece { block: blocks.len(), segment, read: false };
                    pieces.extend((0..decoder.len()).map(piece));
                    BlockState::Whole(decoder)
                } else {
                    BlockState::Coarse(decoder::part(&block.bytes, decoder::Ending::Stage).map_err(at)?)
                };
                let sections = || block.sections.iter().filter(|_| block.is_whole());
                let fields = sections().filter(|s| [FIELD, SHARE].contains(&s.tag));
                let fields = fields.map(|s| StoredSection { tag: s.tag, bytes: s.bytes.to_vec() }).collect();
                let correlations = sections().filter(|s| s.tag == CORRELATION).map(|s| s.bytes.to_vec()).collect();
                let (offset, bytes) = (block.offset, block.bytes.to_vec());
                blocks.push(PartialBlock { layer, offset, bytes, state, fields, correlations });
            }
        }
        let info = FileInfo::new(parts, &file);
        info.missing().iter().for_each(|message| context.message(&format!("note: {place}: {message}")));
        Ok(Decoder { place: place.into(), info, blocks, pieces, file })
    }

    /// Information about the file without its Gaussians.
    pub fn info(&self) -> &FileInfo {
        &self.info
    }

    /// The file.
    pub fn file(&self) -> &[u8] {
        &self.file
    }

    /// Number of pieces.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Gaussians of a piece.
    ///
    /// # Panics
    /// For a piece that there is not, as the other methods.
    pub fn gaussians(&self, piece: usize) -> usize {
        let SegmentPiece { block, segment, .. } = self.pieces[piece];
        self.blocks[block].decoder().map_or(0, |d| d.gaussians(segment))
    }

    /// The layer that a piece belongs to.
    pub fn layer(&self, piece: usize) -> usize {
        self.blocks[self.pieces[piece].block].layer
    }

    /// Reads a piece.
    pub fn read(&mut self, piece: usize) -> Result<()> {
        let Decoder { place, blocks, pieces, .. } = self;
        let SegmentPiece { block, segment, read } = &mut pieces[piece];
        let block = &mut blocks[*block];
        let offset = block.offset;
        block.segments().swap_remove(*segment).read().map_err(|message| corrupt(place, offset, message))?;
        *read = true;
        Ok(())
    }

    /// A piece as it can be drawn so far: its Gaussians where it was read (their counts are not whole yet, and sums are
    /// not yet the blocks' to the last digit), else the boxes that they lie in, each as one Gaussian of the particles
    /// that it may hold. `None` of the alpha-blend law.
    pub fn so_far(&self, piece: usize) -> Option<Mixture> {
        let SegmentPiece { block, segment, read } = self.pieces[piece];
        let decoder = self.blocks[block].decoder()?;
        let shaded = self.info.metadata.law == LawKind::AlphaBlend;
        (!shaded).then(|| if read { decoder.read_so_far(segment) } else { decoder.boxes(segment) })
    }

    /// Reads the pieces that are left, on several threads, and gives the model. Species that share Gaussians have a layer
    /// each.
    pub fn finish(self) -> Result<Model> {
        self.finish_stored().map(separated)
    }

    /// The same with layers as they lie in the file.
    pub(super) fn finish_stored(mut self) -> Result<Model> {
        let Decoder { place, blocks, pieces, .. } = &mut self;
        let segments = blocks.iter_mut().flat_map(|b| {
            let offset = b.offset;
            b.segments().into_iter().map(move |s| (offset, s))
        });
        let left = segments.zip(pieces).filter(|(_, piece)| !piece.read).map(|(segment, _)| segment);
        parallel::try_for_each(left, |(offset, s)| s.read().map_err(|message| corrupt(place, offset, message)))?;
        let vizmapper = self.info.vizmapper.map(Arc::new);
        let (metadata, place) = (&self.info.metadata, &self.place);
        let decoded = parallel::try_map(self.blocks, |b| {
            let mut block = match b.state {
                BlockState::Whole(decoder) => decoder.finish(),
                BlockState::Coarse(block) => block,
            };
            if let Some(columns) = block.gaussians.law.alpha_blend_mut() {
                columns.vizmapper = vizmapper.clone();
            }
            let shared = SharedSpecies::share_layer(&metadata.shared_species, &self.info.layers[b.layer].name);
            fields_of(&mut block, &b.fields, metadata, shared, &|_| None)
                .map_err(|message| corrupt(place, b.offset, message))?;
            // After all fields, as a correlation whose fields are not there is passed over.
            for section in &b.correlations {
                correlation_of(&mut block, section, &metadata.fields)
                    .map_err(|message| corrupt(place, b.offset, message))?;
            }
            Ok::<_, Error>(block)
        })?;
        let mut decoded = decoded.into_iter();
        let layers = self.info.layers.into_iter().map(|l| l.map(|c| decoded.by_ref().take(c.len()).collect()));
        Ok(Model { layers: layers.collect(), metadata: self.info.metadata, certificate: self.info.certificate })
    }
}

impl PartialBlock {
    fn decoder(&self) -> Option<&BlockDecoder> {
        match &self.state {
            BlockState::Whole(decoder) => Some(decoder),
            BlockState::Coarse(_) => None,
        }
    }

    fn segments(&mut self) -> Vec<decoder::SegmentReader<'_>> {
        match &mut self.state {
            BlockState::Whole(decoder) => decoder.segments(&self.bytes),
            BlockState::Coarse(_) => Vec::new(),
        }
    }
}

/// Adds the moments of sections to their block; `shared` = its Gaussians are shared by species; `before` gives what
/// they had of a quantity in the frame before.
pub(super) fn fields_of<'a>(
    block: &mut Block,
    sections: &[StoredSection],
    metadata: &Metadata,
    shared: bool,
    before: &dyn Fn(&Quantity) -> Option<PreviousField<'a>>,
) -> std::result::Result<(), String> {
    let species = if shared { &metadata.shared_species[..] } else { &[] };
    let shares: Vec<Quantity> = species.iter().map(SharedSpecies::quantity).collect();
    for section in sections {
        let (list, kind) = if section.tag == SHARE { (&shares, "species") } else { (&metadata.fields, "field") };
        let wanted = section.bytes.first().and_then(|&n| list.get(usize::from(n)));
        let Some(quantity) = wanted else { return Err(format!("a section names a {kind} that is not listed")) };
        let before = match section.tag {
            FIELD_CHANGE => Some(before(quantity).ok_or(format!("the frame before has no field `{}`", quantity.name))?),
            _ => None,
        };
        let moments = decode_field(&section.bytes, &block.gaussians, quantity, before.as_ref())?;
        let components = if quantity.kind == QuantityKind::Vector { 3 } else { 1 };
        if moments.components() != components || block.gaussians.fields.get(&quantity.name).is_some() {
            return Err(format!("field `{}` is there twice or has {} components", quantity.name, moments.components()));
        }
        block.gaussians.fields.set(&quantity.name, moments);
    }
    let shares = Some(&shares[..]).filter(|s| !s.is_empty());
    Metadata::categories(&metadata.fields).chain(shares).try_for_each(|classes| complete(&mut block.gaussians, classes))
}

/// A model with the fields of these `sections` in place of its own: those of each block of all layers, in order. `before`
/// gives what the Gaussians of a layer's block had of a quantity in the frame before.
pub fn with_fields<'a>(
    mut model: Model,
    sections: &[Vec<StoredSection>],
    before: &dyn Fn([usize; 2], &Quantity) -> Option<PreviousField<'a>>,
) -> Result<Model> {
    let metadata = &model.metadata;
    let wrong = |message: String| Error::corrupt("the fields just coded", message);
    let mut sections = sections.iter();
    for (layer, blocks) in model.layers.iter_mut().map(|l| &mut l.content).enumerate() {
        for ((number, block), sections) in blocks.iter_mut().enumerate().zip(&mut sections) {
            block.gaussians.fields = Columns::default();
            let (pairs, moments): (Vec<_>, Vec<_>) = sections.iter().cloned().partition(|s| s.tag == CORRELATION);
            fields_of(block, &moments, metadata, false, &|q| before([layer, number], q)).map_err(wrong)?;
            for pair in pairs {
                correlation_of(block, &pair.bytes, &metadata.fields).map_err(wrong)?;
            }
        }
    }
    Ok(model)
}

/// Adds the shares of the last class, which follow from the others'.
fn complete(g: &mut Mixture, classes: &[Quantity]) -> std::result::Result<(), String> {
    let Some((last, others)) = classes.split_last() else { return Ok(()) };
    let stored_classes = others.iter().filter_map(|q| g.fields.get(&q.name)).count();
    if stored_classes == 0 && g.fields.get(&last.name).is_none() {
        return Ok(());
    }
    if g.fields.get(&last.name).is_some() {
        return Err(format!("the shares of `{}` follow from those of the other classes", last.name));
    }
    if stored_classes < others.len() {
        // A file that ends early: a category is there whole or not at all.
        others.iter().for_each(|q| drop(g.fields.remove(&q.name)));
        return Ok(());
    }
    let mut moments = FieldMoments::new(1);
    moments.range = vec![[0.0, 1.0]];
    for i in 0..g.len() {
        let sum = |value: &dyn Fn(&FieldMoments) -> f64| -> f64 {
            others.iter().filter_map(|q| g.fields.get(&q.name)).map(value).fold(0.0, |sum, v| sum + v)
        };
        let share = (1.0 - sum(&|f| f.mean[0][i])).max(0.0);
        // Gaussians of no particles have zeros.
        let share = if g.count[i] < 1.0 { 0.0 } else { share };
        moments.mean[0].push(share);
        // A difference and not a negation, which would make -0 of a sum of 0.
        (0..3).for_each(|k| moments.slope[0][k].push(0.0 - sum(&|f| f.slope[0][k][i])));
        moments.spread[0].push(share * (1.0 - share));
    }
    g.fields.set(&last.name, moments);
    Ok(())
}

/// Adds the correlations of a section to its block, whose fields are there.
pub(super) fn correlation_of(
    block: &mut Block,
    section: &[u8],
    fields: &[Quantity],
) -> std::result::Result<(), String> {
    let (numbers, correlations) = decode_correlation(section, &block.gaussians)?;
    let g = &mut block.gaussians;
    let name = |n: u8| fields.get(usize::from(n)).filter(|q| q.kind == QuantityKind::Scalar).map(|q| &q.name[..]);
    let (Some(a), Some(b)) = (name(numbers[0]), name(numbers[1])) else {
        return Err("a correlation names a field that is no scalar".into());
    };
    if [a, b].iter().any(|name| g.fields.get(name).is_none()) {
        // A file that ends early.
        return Ok(());
    }
    if g.correlation(a, b).is_some() {
        return Err(format!("the correlation of `{a}` and `{b}` is there twice"));
    }
    g.fields.get_mut(a).into_iter().for_each(|field| field.correlations.set(b, correlations.clone()));
    Ok(())
}

/// An error of the block whose section begins at byte `offset`.
fn corrupt(place: &str, offset: usize, message: String) -> Error {
    Error::corrupt(place, format!("block at byte {offset}: {message}"))
}

/// Bytes that decoding takes beside the file: all Gaussians, a copy of the blocks, and the work on the largest block.
fn decoding_bytes(parts: &FileParts<'_>) -> u64 {
    let blocks = || parts.layers.iter().flat_map(|l| &l.content);
    let work = blocks().map(decoder::working_bytes).max().unwrap_or(0);
    blocks().map(|b| decoder::gaussian_bytes(b) + b.bytes.len() as u64).sum::<u64>() + work
}

/// Decodes one coded block.
pub fn decode_block(bytes: &[u8], place: &str) -> Result<Block> {
    decoder::block(bytes, &Context::SILENT).map_err(|fault| fault.at(|message| Error::corrupt(place, message)))
}

/// A mixture of fewer, larger Gaussians from the first bytes of a coded block: their counts and masses sum to the block's.
/// The more bytes, the more it is like the whole block's (docs/format.md, section 6).
pub fn decode_prefix(bytes: &[u8], place: &str) -> Result<Block> {
    decoder::prefix(bytes).map_err(|fault| fault.at(|message| Error::corrupt(place, message)))
}

/// Checks that a file can be read again, to its last Gaussian. Its blocks are decoded one after the other, and
/// nothing is kept. Every file that is written has passed this, or [`decode`].
pub fn check(bytes: &[u8], place: &str, context: &Context<'_>) -> Result<()> {
    let parts = parts(bytes, place)?;
    let sound = |block: &BlockPart<'_>| {
        let need = decoder::gaussian_bytes(block) + decoder::working_bytes(block);
        context.require_memory("decoding the model", need)?;
        let decoded = decoder::block(&block.bytes, context);
        decoded.map(drop).map_err(|fault| fault.at(|message| corrupt(place, block.offset, message)))
    };
    parts.layers.iter().flat_map(|l| &l.content).try_for_each(sound)
}

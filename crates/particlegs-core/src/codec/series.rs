//! Series of models: an index, then a file for each frame: a model, or the changes from the frame before
//! (docs/format.md, section 16).

use super::change::{FrameStep, TrackedBlock};
use super::container::{
    self, BLOCK_CHANGE, CERTIFICATE, CHANGE, CORRELATION, FIELD, FIELD_CHANGE, FRAME, FRAME_INDEX, HEAD_BYTES, META,
    SECTION_BYTES, SERIES, SERIES_RECIPE, STAGE_BYTES, Section,
};
use super::decode::{Decoder, correlation_of, decode_block, fields_of};
use super::field::{FieldPrecision, PreviousField, encode_field};
use super::field_correlation::encode_correlation;
use super::file::{self, CodedLayer, StoredBlock, StoredSection};
use super::info::EXTRACTED;
use super::merge::blocks_hash;
use super::series_clock::SeriesClock;
use super::sums::{compensated, whole_counts};
use super::wire::{SectionFault, WireReader};
use super::{Encoder, Precision, assemble, certificate, metadata};
use crate::context::Context;
use crate::model::{
    Block, Certificate, CertificateLevel, Layer, Mass, Metadata, Mixture, Model, Quantity, Recipe, Units,
};
use crate::{Error, Result, parallel};
use std::borrow::Cow;
use std::ops::Range;

/// Frames at most.
pub const MOST_FRAMES: usize = 1 << 20;
/// Bytes of the index before its entries, and of an entry.
const INDEX_HEAD: usize = 1 + 4;
const ENTRY: usize = 1 + 8 + 8 + 8;
/// First bytes of a series that say where its index ends.
pub const INDEX_FROM: usize = HEAD_BYTES + SECTION_BYTES;
/// Bytes of the recipe at most.
const RECIPE_TEXT: usize = 16_384;

/// The coding of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameCoding {
    /// Nothing: a gap.
    Missing,
    /// A model.
    Keyframe,
    /// Changes from the frame before.
    Change,
}

/// A frame of a series that is put together.
#[derive(Clone, Debug, PartialEq)]
pub struct CodedFrame {
    /// Reading of the clock.
    pub time: f64,
    /// Whether it is a keyframe.
    pub keyframe: bool,
    /// A model file, or what [`TrackedModel::change_file`] gives.
    pub bytes: Vec<u8>,
}

/// A frame in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameEntry {
    /// Its coding.
    pub kind: FrameCoding,
    /// Reading of the clock; 0 of a gap.
    pub time: f64,
    /// Its bytes in the file.
    pub place: Range<usize>,
}

impl FrameEntry {
    /// Its place in the file; `None` of a gap.
    fn there(&self) -> Option<Range<usize>> {
        Some(self.place.clone()).filter(|_| self.kind != FrameCoding::Missing)
    }
}

/// A series of models whose index is read.
#[derive(Clone)]
pub struct SeriesFile<'a> {
    place: String,
    /// The frames' own bytes; `None` of gaps, and of frames that are not loaded.
    files: Vec<Option<Cow<'a, [u8]>>>,
    /// The clock.
    pub clock: SeriesClock,
    /// The frames.
    pub frames: Vec<FrameEntry>,
    /// The recipe of the series, as JSON; empty where that is not known.
    pub recipe: String,
}

/// Statements of a series' recipe on its frames; other programs may say less.
#[derive(serde::Deserialize)]
struct SeriesRecipe {
    model: Option<Recipe>,
    keyframe_interval: Option<usize>,
    /// Level of the certificates of all frames, or of the keyframes alone.
    certificate: Option<String>,
    keyframe_certificate: Option<String>,
    /// Whether the frames are those of one trajectory, whose numbers rise.
    #[serde(default)]
    trajectory: bool,
}

impl SeriesRecipe {
    /// Checks that the frame was made so, as number `group` from its keyframe on, which is number 1; gaps do not count.
    fn check(&self, frame: &TrackedModel, group: usize) -> std::result::Result<(), String> {
        // Blocks are as a frame needs them, and species of a series never share Gaussians.
        let comparable = |recipe: &Recipe| {
            let mut copy = Recipe { blocks: 1, ..recipe.clone() };
            copy.read.remove("share-gaussians");
            copy
        };
        let recipe = comparable(&frame.metadata.recipe);
        let model = self.model.as_ref().map(comparable).filter(|model| *model != recipe && recipe.differing.is_empty());
        if let Some(model) = model {
            return Err(format!("it was made by `{recipe}`, but the series says `{model}`"));
        }
        if let Some(interval) = self.keyframe_interval.filter(|interval| group > *interval) {
            return Err(format!("it is frame {group} from its keyframe on, but the series has one every {interval}"));
        }
        let level = if group == 1 { &self.keyframe_certificate } else { &None };
        let measured = self.certificate.as_ref().or(level.as_ref()).map(|level| level != CertificateLevel::None.name());
        match measured.filter(|measured| *measured != frame.certificate.is_some()) {
            Some(true) => Err("it has no certificate, but the series says that it has one".into()),
            Some(false) => Err("it has a certificate, but the series says that it has none".into()),
            None => Ok(()),
        }
    }
}

/// A decoded frame with what is known of its Gaussians' motion.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedModel {
    /// Reading of the clock.
    pub time: f64,
    /// Metadata.
    pub metadata: Metadata,
    /// Certificate.
    pub certificate: Option<Certificate>,
    /// The blocks of the layers.
    pub layers: Vec<Layer<Vec<TrackedBlock>>>,
    /// Metadata of the keyframe, as it is stored.
    pub(super) key: Vec<u8>,
}

/// Puts a series together; `None` is a gap. `recipe` says how it was made, in JSON.
pub fn assemble_series(clock: SeriesClock, recipe: &str, frames: &[Option<CodedFrame>]) -> Result<Vec<u8>> {
    if frames.len() > MOST_FRAMES || recipe.len() > RECIPE_TEXT {
        return Err(Error::argument(format!("a series has at most {MOST_FRAMES} frames")));
    }
    let mut place = HEAD_BYTES + SECTION_BYTES + INDEX_HEAD + ENTRY * frames.len();
    if !recipe.is_empty() {
        place += SECTION_BYTES + recipe.len();
    }
    let mut index = vec![SeriesClock::ALL.iter().position(|c| *c == clock).unwrap_or(0) as u8];
    index.extend((frames.len() as u32).to_le_bytes());
    let mut sections = Vec::new();
    for frame in frames {
        let Some(CodedFrame { time, keyframe, bytes }) = frame else {
            index.extend([0; ENTRY]);
            continue;
        };
        place += SECTION_BYTES;
        index.push(if *keyframe { 1 } else { 2 });
        index.extend(time.to_le_bytes());
        index.extend((place as u64).to_le_bytes());
        index.extend((bytes.len() as u64).to_le_bytes());
        place += bytes.len();
        sections.push(Section::new(FRAME, None, bytes));
    }
    let head = [Section::new(FRAME_INDEX, None, &index), Section::new(SERIES_RECIPE, None, recipe.as_bytes())];
    let head = head.into_iter().filter(|s| !s.bytes.is_empty());
    let file = container::write(SERIES, &head.chain(sections).collect::<Vec<_>>(), false);
    SeriesFile::read(&file, "the series")?;
    Ok(file)
}

impl<'a> SeriesFile<'a> {
    /// Reads the index, and checks it and every checksum.
    pub fn read(bytes: &'a [u8], place: &str) -> Result<SeriesFile<'a>> {
        let corrupt = |message: String| Error::corrupt(place, message);
        let sections = container::read(SERIES, bytes, place)?.sections;
        let mut sections = sections.into_iter();
        let index = sections.next().filter(|s| s.tag == FRAME_INDEX);
        let index = index.ok_or_else(|| corrupt("the file does not begin with an index of frames".into()))?;
        let (clock, frames) = frame_entries(index.bytes).map_err(corrupt)?;
        let mut recipe = String::new();
        let mut present_frames = frames.iter().filter(|f| f.kind != FrameCoding::Missing);
        for section in sections {
            match section.tag {
                SERIES_RECIPE if section.bytes.len() > RECIPE_TEXT || !recipe.is_empty() => {
                    return Err(corrupt("the recipe of the series is too long, or there twice".into()));
                }
                SERIES_RECIPE => recipe = String::from_utf8_lossy(section.bytes).into_owned(),
                FRAME => {
                    let start = section.offset + SECTION_BYTES;
                    let range = start..start + section.bytes.len();
                    if present_frames.next().map(|f| &f.place) != Some(&range) {
                        return Err(corrupt("the index of frames does not match the frames".into()));
                    }
                }
                _ => {}
            }
        }
        if present_frames.next().is_some() {
            return Err(corrupt("a frame of the index is missing".into()));
        }
        let files = frames.iter().map(|f| f.there().and_then(|place| bytes.get(place)).map(Cow::Borrowed)).collect();
        Ok(SeriesFile { place: place.into(), files, clock, frames, recipe })
    }

    /// The same with copies of the frames' bytes.
    pub fn into_owned(self) -> SeriesFile<'static> {
        let SeriesFile { place, files, clock, frames, recipe } = self;
        let files = files.into_iter().map(|file| file.map(|bytes| Cow::Owned(bytes.into_owned()))).collect();
        SeriesFile { place, files, clock, frames, recipe }
    }

    /// End of the index of a series that begins with `head`, of at least [`INDEX_FROM`] bytes.
    pub fn index_end(head: &[u8], place: &str) -> Result<usize> {
        container::promised_length(head, place)?;
        let end = head.get(..INDEX_FROM).and_then(|head| container::section_end(head, HEAD_BYTES));
        let most = (INDEX_FROM + INDEX_HEAD + ENTRY * MOST_FRAMES) as u64;
        let end = end.filter(|end| *end <= most && container::is_series(head));
        end.map(|end| end as usize)
            .ok_or_else(|| Error::corrupt(place, "the file does not begin with an index of frames"))
    }

    /// Reads the index from the first bytes of a file, up to [`SeriesFile::index_end`] or more, and takes the frames that
    /// lie whole among them. The others come by [`SeriesFile::add_frame`]. The recipe is left out.
    pub fn read_start(bytes: &[u8], place: &str) -> Result<SeriesFile<'static>> {
        let corrupt = |message: String| Error::corrupt(place, message);
        SeriesFile::index_end(bytes, place)?;
        let index = container::section(bytes, HEAD_BYTES).map_err(corrupt)?;
        if index.tag != FRAME_INDEX {
            return Err(corrupt("the file does not begin with an index of frames".into()));
        }
        let (clock, frames) = frame_entries(index.bytes).map_err(corrupt)?;
        let file = |f: &FrameEntry| bytes.get(f.there()?).map(|part| Cow::Owned(part.to_vec()));
        Ok(SeriesFile {
            place: place.into(),
            files: frames.iter().map(file).collect(),
            clock,
            frames,
            recipe: String::new(),
        })
    }

    /// Takes the bytes of a frame that was not loaded.
    pub fn add_frame(&mut self, frame: usize, bytes: Vec<u8>) -> Result<()> {
        let length = self.frames.get(frame).and_then(FrameEntry::there).map(|place| place.len());
        match self.files.get_mut(frame) {
            Some(file) if length == Some(bytes.len()) => {
                *file = Some(Cow::Owned(bytes));
                Ok(())
            }
            _ => {
                Err(Error::corrupt(self.name(frame), format!("the index has no frame of {} bytes there", bytes.len())))
            }
        }
    }

    /// A frame's own bytes.
    pub fn frame_bytes(&self, frame: usize) -> Result<&[u8]> {
        match self.frames.get(frame) {
            Some(f) if f.kind != FrameCoding::Missing => {
                let file = self.files[frame].as_deref();
                file.ok_or_else(|| Error::input(self.name(frame), "its bytes are not loaded yet"))
            }
            Some(_) => Err(Error::input(&self.place, format!("frame {frame} is missing"))),
            None => {
                let message =
                    format!("there is no frame {frame}; frames go from 0 to {}", self.frames.len().max(1) - 1);
                Err(Error::input(&self.place, message))
            }
        }
    }

    /// The certificate of a frame, if it was measured.
    pub fn certificate(&self, frame: usize) -> Result<Option<Certificate>> {
        let bytes = self.frame_bytes(frame)?;
        let kind = if self.frames[frame].kind == FrameCoding::Keyframe { container::MODEL } else { CHANGE };
        let sections = container::read(kind, bytes, &self.name(frame))?.sections;
        let section = sections.iter().find(|s| s.tag == CERTIFICATE);
        let certificate =
            section.map(|s| certificate::read(s.bytes).map_err(|message| Error::corrupt(self.name(frame), message)));
        certificate.transpose()
    }

    /// The keyframe that a frame is decoded from.
    fn keyframe(&self, frame: usize) -> Result<usize> {
        self.frame_bytes(frame)?;
        let key = self.frames[..=frame].iter().rposition(|f| f.kind == FrameCoding::Keyframe);
        key.ok_or_else(|| Error::corrupt(&self.place, "the first frame is no keyframe"))
    }

    /// The name of a frame in errors; frames are counted from 0.
    pub fn name(&self, frame: usize) -> String {
        format!("{}, frame {frame} of {}", self.place, self.frames.len())
    }

    /// The numbers of the frames that are there.
    pub fn there(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.frames.len()).filter(|&i| self.frames[i].kind != FrameCoding::Missing)
    }

    /// The number of its last frame that is there.
    pub fn last(&self) -> Result<usize> {
        self.there().last().ok_or_else(|| Error::input(&self.place, "the series has no frames"))
    }

    /// Bytes of a change when its certificate was measured: without certificate and fields.
    pub fn measured_bytes(&self, frame: usize) -> Result<u64> {
        let bytes = self.frame_bytes(frame)?;
        let sections = container::read(CHANGE, bytes, &self.name(frame))?.sections;
        let added = |s: &Section<'_>| match s.tag {
            CERTIFICATE => SECTION_BYTES + s.bytes.len(),
            FIELD | FIELD_CHANGE | CORRELATION => STAGE_BYTES + s.bytes.len(),
            _ => 0,
        };
        Ok((bytes.len() - sections.iter().map(added).sum::<usize>()) as u64)
    }

    /// Decodes every frame, in order, and gives each to `visit` with its number.
    ///
    /// # Errors
    /// [`Error::Corrupt`]: a frame cannot be decoded; the index or the recipe contradicts it, or it is of another run than
    /// the frame before.
    pub fn check(
        &self,
        context: &Context<'_>,
        mut visit: impl FnMut(usize, &TrackedModel) -> Result<()>,
    ) -> Result<()> {
        let recipe = self.series_recipe()?;
        let mut decoder = SeriesDecoder::new(self);
        let (mut before, mut group) = (None::<Metadata>, 0);
        for number in self.there() {
            context.check()?;
            let entry = &self.frames[number];
            let wrong = |message: String| Error::corrupt(self.name(number), message);
            let frame = decoder.frame(number, context)?;
            let metadata = &frame.metadata;
            let stated = SeriesClock::of(metadata);
            // The first frame decides on the clock; of later ones it is enough that they have its number.
            if before.is_none() && stated != self.clock {
                let [index, stated] = [self.clock, stated].map(SeriesClock::name);
                return Err(wrong(format!(
                    "the clock of the index is the {index}, but that of the frame is the {stated}"
                )));
            }
            let time = self.clock.time(number, metadata);
            if time != Some(entry.time) {
                let stated = time.map_or("none".into(), |t| t.to_string());
                let message =
                    format!("its {} is {} in the index and {stated} in the frame", self.clock.name(), entry.time);
                return Err(wrong(message));
            }
            if let Some(before) = &before {
                if let Some(difference) = before.difference_to_next(metadata) {
                    return Err(wrong(difference));
                }
                // Numbers of frames rise only where all are of one trajectory.
                let by_number = recipe.as_ref().is_some_and(|r| r.trajectory);
                let [then, now] = [before, metadata].map(|m| m.epoch.frame.filter(|_| by_number));
                if let Some((then, now)) = then.zip(now).filter(|(then, now)| now <= then) {
                    let message = format!("it is frame {now} of {}, behind frame {then} of it", metadata.source);
                    return Err(wrong(message));
                }
            }
            group = if entry.kind == FrameCoding::Keyframe { 1 } else { group + 1 };
            recipe.iter().try_for_each(|r| r.check(frame, group).map_err(wrong))?;
            before = Some(metadata.clone());
            visit(number, frame)?;
        }
        Ok(())
    }

    /// The recipe, where there is one.
    fn series_recipe(&self) -> Result<Option<SeriesRecipe>> {
        let parse = |text: &str| {
            let wrong = |e: serde_json::Error| Error::corrupt(&self.place, format!("the recipe of the series: {e}"));
            serde_json::from_str(text).map_err(wrong)
        };
        Some(&self.recipe[..]).filter(|text| !text.is_empty()).map(parse).transpose()
    }

    /// The number of its first frame, which is a keyframe.
    pub fn first(&self) -> Result<usize> {
        let first = self.frames.iter().position(|f| f.kind == FrameCoding::Keyframe);
        first.ok_or_else(|| Error::input(&self.place, "the series has no frames"))
    }

    /// Metadata of its first frame.
    fn metadata(&self) -> Result<Metadata> {
        let first = self.first()?;
        file::read_metadata(self.frame_bytes(first)?, &self.name(first))
    }

    /// Units of its frames.
    pub fn units(&self) -> Result<Units> {
        Ok(self.metadata()?.units)
    }

    /// As [`SeriesClock::moment`].
    pub fn moment(&self, text: &str) -> Result<f64> {
        let Metadata { units, cosmology, .. } = self.metadata()?;
        self.clock.moment(text, &units, &cosmology)
    }

    /// Reading of the clock at a time, as text that says whether a model is interpolated there.
    pub fn moment_text(&self, time: f64, units: &Units) -> String {
        let between = if self.frame_at(time).is_some() { "" } else { " (interpolated)" };
        self.clock.text(time, units) + between
    }

    /// The frame of a time of the clock, which may differ by a millionth.
    pub fn frame_at(&self, time: f64) -> Option<usize> {
        let distance = |i: &usize| (self.frames[*i].time - time).abs();
        self.there().min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|i| distance(i) <= 1e-6 * time.abs())
    }
}

/// Decodes frames one after the other: a frame behind one that was decoded lately goes on from there.
pub struct SeriesDecoder<'a> {
    series: Cow<'a, SeriesFile<'a>>,
    /// The last frames that were decoded, two at most.
    last: Vec<(usize, TrackedModel)>,
}

impl<'a> SeriesDecoder<'a> {
    /// Nothing is decoded yet.
    pub fn new(series: &'a SeriesFile<'a>) -> Self {
        SeriesDecoder { series: Cow::Borrowed(series), last: Vec::new() }
    }

    /// Decodes a series whose frames may come later, by [`SeriesDecoder::add_frame`].
    pub fn of(series: SeriesFile<'a>) -> Self {
        SeriesDecoder { series: Cow::Owned(series), last: Vec::new() }
    }

    /// The series.
    pub fn series(&self) -> &SeriesFile<'a> {
        &self.series
    }

    /// As [`SeriesFile::add_frame`].
    pub fn add_frame(&mut self, frame: usize, bytes: Vec<u8>) -> Result<()> {
        self.series.to_mut().add_frame(frame, bytes)
    }

    /// A frame by its number.
    pub fn frame(&mut self, frame: usize, context: &Context<'_>) -> Result<&TrackedModel> {
        let place = match self.last.iter().position(|(number, _)| *number == frame) {
            Some(place) => place,
            None => {
                let model = self.decoded(frame, context)?;
                self.last.truncate(1);
                self.last.insert(0, (frame, model));
                0
            }
        };
        // The frame that was used last comes first, so that the other one is dropped next.
        self.last[..=place].rotate_right(1);
        Ok(&self.last[0].1)
    }

    fn decoded(&self, frame: usize, context: &Context<'_>) -> Result<TrackedModel> {
        let series = &self.series;
        let key = series.keyframe(frame)?;
        // Only a frame of the same group, from its keyframe on, leads to this one.
        let last_decoded = self.last.iter().filter(|(number, _)| (key..frame).contains(number)).max_by_key(|l| l.0);
        let (from, mut model) = match last_decoded {
            Some((number, model)) => (*number, model.clone()),
            None => {
                let time = series.frames[key].time;
                (key, TrackedModel::keyframe(series.frame_bytes(key)?, time, &series.name(key), context)?)
            }
        };
        for i in (from + 1..=frame).filter(|&i| series.frames[i].kind == FrameCoding::Change) {
            context.check()?;
            model = model.next(series.frame_bytes(i)?, series.frames[i].time, &series.name(i))?;
        }
        Ok(model)
    }

    /// The model at a time of the clock, between frames as [`TrackedModel::between`] has it.
    pub fn model_at(&mut self, time: f64, context: &Context<'_>) -> Result<Model> {
        let series = &*self.series;
        if let Some(frame) = series.frame_at(time) {
            return Ok(self.frame(frame, context)?.clone().into_model());
        }
        let is_present = |f: &FrameEntry| f.kind != FrameCoding::Missing;
        let before = series.frames.iter().rposition(|f| is_present(f) && f.time < time);
        let after = series.frames.iter().position(|f| is_present(f) && f.time > time);
        let (Some(before), Some(after)) = (before, after) else {
            let times: Vec<f64> = series.frames.iter().filter(|f| is_present(f)).map(|f| f.time).collect();
            let [first, last] = [times.first(), times.last()].map(|t| t.copied().unwrap_or_default());
            let clock = series.clock.name();
            let message = format!("{clock} {time} is not within the series, which goes from {first} to {last}");
            return Err(Error::input(&series.place, message));
        };
        let from = self.frame(before, context)?.clone();
        let next = self.frame(after, context)?;
        Ok(from.between(next, (time - from.time) / (next.time - from.time)))
    }

    /// A frame as a model file: a keyframe's own bytes, and others coded anew, without a certificate, which would not be of
    /// the new bytes ([`SeriesFile::certificate`]).
    pub fn extract(&mut self, frame: usize, context: &Context<'_>) -> Result<Vec<u8>> {
        let bytes = self.series.frame_bytes(frame)?;
        if self.series.frames[frame].kind == FrameCoding::Keyframe {
            return Ok(bytes.to_vec());
        }
        let Model { metadata, layers, .. } = self.frame(frame, context)?.clone().into_model();
        assemble(&metadata, None, coded_finely(layers, &metadata.fields)?)
    }

    /// The model at a time of the clock as a file: of a frame what [`SeriesDecoder::extract`] gives, between frames what
    /// [`SeriesDecoder::model_at`] gives.
    pub fn extract_at(&mut self, time: f64, context: &Context<'_>) -> Result<Vec<u8>> {
        if let Some(frame) = self.series.frame_at(time) {
            return self.extract(frame, context);
        }
        let mut model = self.model_at(time, context)?;
        model.layers.iter_mut().flat_map(|l| &mut l.content).for_each(leave_out_faded);
        let Model { metadata, layers, .. } = model;
        let layers = coded_finely(layers, &metadata.fields)?;
        assemble(&Metadata { source_hash: blocks_hash(&layers), ..metadata }, None, layers)
    }
}

/// Leaves out Gaussians of a block between frames that have no particle once counts are whole.
fn leave_out_faded(block: &mut Block) {
    let mut counts = block.gaussians.count.clone();
    whole_counts(&mut counts, block.count);
    if block.count > 0 && counts.contains(&0.0) {
        block.gaussians.count.clone_from(&counts);
        block.gaussians.retain(|i| counts[i] > 0.0);
    }
}

/// Layers whose steps are far finer than those of a series, with their `fields`.
fn coded_finely(layers: Vec<Layer<Vec<Block>>>, fields: &[Quantity]) -> Result<Vec<CodedLayer>> {
    let precision = Precision::BALANCED.scaled(EXTRACTED);
    let coded = |b: &Block| {
        let encoder = Encoder::new(b)?;
        let bytes = encoder.encode(&precision);
        let sections = match fields {
            [] => Vec::new(),
            _ => {
                let decoded = decode_block(&bytes, "the frame")?.gaussians;
                field_sections(&b.gaussians, encoder.order(), &decoded, fields)
            }
        };
        Ok(StoredBlock { sections, ..bytes.into() })
    };
    let layer = |layer: Layer<Vec<Block>>| {
        let blocks = layer.content.iter().map(coded).collect::<Result<Vec<_>>>()?;
        Ok(layer.with(blocks))
    };
    layers.into_iter().map(layer).collect()
}

/// The fields of Gaussians that are coded anew, and `decoded` in another `order`.
fn field_sections(g: &Mixture, order: &[u32], decoded: &Mixture, fields: &[Quantity]) -> Vec<StoredSection> {
    let precision = FieldPrecision::default().scaled(EXTRACTED as f32);
    let (mut moments, mut correlations) = (Vec::new(), Vec::new());
    for (number, quantity) in fields.iter().enumerate().filter(|(n, _)| Metadata::is_stored(fields, *n)) {
        let Some(field) = g.fields.get(&quantity.name) else { continue };
        let mut ordered = field.emptied();
        order.iter().for_each(|&i| ordered.push_moved(field, i as usize, [0.0; 3]));
        let weight = |i: usize| if quantity.by_mass { g.mass_of(i) } else { g.count[i] };
        let value = |c: usize, i: usize| weight(i) * field.overall_value(c, i, &g.cov_of(i));
        let sum = |c: usize| compensated(&(0..g.len()).map(|i| value(c, i)).collect::<Vec<_>>());
        let sums: Vec<f64> = (0..field.components()).map(sum).collect();
        let bytes = encode_field((number as u8, quantity), &ordered, decoded, &sums, &precision, None);
        moments.push(StoredSection { tag: FIELD, bytes });
        for (other, values) in ordered.correlations.iter() {
            let Some(with) = fields.iter().position(|q| q.name == *other) else { continue };
            let bytes = encode_correlation([number as u8, with as u8], values, decoded);
            correlations.push(StoredSection { tag: CORRELATION, bytes });
        }
    }
    moments.into_iter().chain(correlations).collect()
}

fn frame_entries(bytes: &[u8]) -> std::result::Result<(SeriesClock, Vec<FrameEntry>), String> {
    let mut r = WireReader::new(bytes);
    let clock = SeriesClock::ALL.get(usize::from(r.u8()?)).ok_or("the clock of the series is not known")?;
    let count = r.u32()? as usize;
    // Checked before memory is taken, as a damaged count may be any number.
    if count == 0 || count > MOST_FRAMES || bytes.len() != INDEX_HEAD + ENTRY * count {
        return Err(format!("the index has {} bytes for {count} frames", bytes.len()));
    }
    let mut frames: Vec<FrameEntry> = Vec::with_capacity(count);
    let mut before = None;
    for number in 0..count {
        let (kind, time, start, length) = (r.u8()?, r.f64()?, r.u64()?, r.u64()?);
        let kind = match kind {
            0 => FrameCoding::Missing,
            1 => FrameCoding::Keyframe,
            2 if before.is_some() => FrameCoding::Change,
            _ => return Err(format!("frame {number} is of the unknown or impossible kind {kind}")),
        };
        if !time.is_finite() || kind != FrameCoding::Missing && before.is_some_and(|t| time <= t) {
            return Err(format!("the clock does not move on at frame {number}"));
        }
        if kind != FrameCoding::Missing {
            before = Some(time);
        }
        let end = usize::try_from(start).ok().zip(usize::try_from(length).ok());
        let end = end.and_then(|(start, length)| Some(start..start.checked_add(length)?));
        frames.push(FrameEntry { kind, time, place: end.ok_or("a frame lies beyond the file")? });
    }
    Ok((*clock, frames))
}

impl TrackedModel {
    /// A model file as the first frame of a group.
    pub fn keyframe(bytes: &[u8], time: f64, place: &str, context: &Context<'_>) -> Result<TrackedModel> {
        let Model { metadata, layers, certificate } = Decoder::new(bytes, place, context)?.finish_stored()?;
        let shaded = layers.iter().flat_map(|l| &l.content).any(|b| b.gaussians.law.alpha_blend().is_some());
        if shaded || !metadata.shared_species.is_empty() {
            let message = "alpha-blend models and species that share Gaussians have no changes from frame to frame";
            return Err(Error::input(place, message));
        }
        let sections = container::read(container::MODEL, bytes, place)?.sections;
        let key = sections.first().map(|s| s.bytes.to_vec()).unwrap_or_default();
        let tracked = |l: Layer<Vec<_>>| l.map(|blocks| blocks.into_iter().map(TrackedBlock::new).collect());
        let layers = layers.into_iter().map(tracked).collect();
        Ok(TrackedModel { time, metadata, certificate, layers, key })
    }

    /// The file of what changes to the next frame. `blocks` are those of all layers in order, as
    /// [`TrackedBlock::encode`] gives them; what else belongs to each stands beside it. `None` where a keyframe
    /// is needed: it has metadata that the next frame lacks, or other layers.
    pub fn change_file(
        &self,
        metadata: &Metadata,
        masses: &[Mass],
        certificate: Option<&Certificate>,
        blocks: &[(Vec<u8>, Vec<StoredSection>)],
    ) -> Option<Vec<u8>> {
        let meta = metadata::difference(&self.key, &metadata::write(metadata, masses))?;
        let certificate = certificate.map(certificate::write);
        let mut sections = vec![Section::new(META, None, &meta)];
        sections.extend(certificate.iter().map(|c| Section::new(CERTIFICATE, None, c)));
        let numbered = || blocks.iter().zip(0u32..);
        sections.extend(numbered().map(|((bytes, _), number)| Section::new(BLOCK_CHANGE, Some(number), bytes)));
        for ((_, attached), number) in numbered() {
            sections.extend(attached.iter().map(|s| Section::new(s.tag, Some(number), &s.bytes)));
        }
        Some(container::write(CHANGE, &sections, false))
    }

    /// The next frame, of a file of changes.
    pub fn next(&self, bytes: &[u8], time: f64, place: &str) -> Result<TrackedModel> {
        let corrupt = |message: String| Error::corrupt(place, message);
        let fault = |fault: SectionFault| match fault {
            SectionFault::Corrupt(message) => corrupt(message),
            SectionFault::Unknown(message) => Error::Compatibility { place: place.into(), what: message },
        };
        let sections = container::read(CHANGE, bytes, place)?.sections;
        let first = sections.first().ok_or_else(|| corrupt("a frame has no metadata".into()))?;
        // A change has the fields that differ from the keyframe's, not from those of the frame before (section 16).
        let whole = metadata::changed(&self.key, first.bytes).map_err(fault)?;
        let (metadata, masses) = metadata::read(&whole).map_err(fault)?;
        let certificate = sections.iter().find(|s| s.tag == CERTIFICATE);
        let certificate = certificate.map(|s| certificate::read(s.bytes).map_err(corrupt)).transpose()?;
        let masses = metadata::of_layers(&masses, self.layers.len(), false)
            .ok_or_else(|| corrupt("the number of masses differs from the number of layers".into()))?;
        let step = FrameStep { cells: [self.metadata.cell, metadata.cell], elapsed: time - self.time };
        let at = |number: u32, message: String| corrupt(format!("block {number}: {message}"));
        // Every block has one change, in the order of the keyframe, even where nothing in it moves.
        let mut changes = sections.iter().filter(|s| s.tag == BLOCK_CHANGE);
        let blocks = self.layers.iter().flat_map(|l| &l.content).zip(0u32..).map(|(block, number)| {
            let change = changes.next().filter(|s| s.block == Some(number));
            let change = change.ok_or_else(|| at(number, "its changes are missing".into()))?;
            Ok((block, number, change.bytes))
        });
        let blocks = blocks.collect::<Result<Vec<_>>>()?;
        // Also fields and correlations belong to blocks that exist, and there is one certificate at most (section 16).
        let mut numbers = sections.iter().filter_map(|s| s.block);
        if changes.next().is_some() || numbers.any(|number| number as usize >= blocks.len()) {
            return Err(corrupt("a frame has sections of a block that does not exist".into()));
        }
        if sections.iter().filter(|s| s.tag == CERTIFICATE).count() > 1 {
            return Err(corrupt("a frame has two certificates".into()));
        }
        let decoded = parallel::try_map(blocks, |(block, number, change)| {
            let at = |message: String| at(number, message);
            let mut next = block.decode(change, &step).map_err(at)?;
            // Fields are predicted from the Gaussians of this frame, and correlations need their fields.
            let block_sections = || sections.iter().filter(|s| s.block == Some(number));
            let fields = block_sections().filter(|s| [FIELD, FIELD_CHANGE].contains(&s.tag));
            let fields: Vec<StoredSection> = fields.map(StoredSection::from).collect();
            let TrackedBlock { block: next_block, origin, unrest, .. } = &mut next;
            let (origin, unrest) = (&origin[..], &unrest[..]);
            let before =
                |q: &Quantity| self.metadata.fields.contains(q).then(|| block.field(&q.name, origin, unrest))?;
            fields_of(next_block, &fields, &metadata, false, &before).map_err(at)?;
            for section in block_sections().filter(|s| s.tag == CORRELATION) {
                correlation_of(&mut next.block, section.bytes, &metadata.fields).map_err(at)?;
            }
            Ok::<_, Error>(next)
        })?;
        let mut decoded = decoded.into_iter();
        let layers = self.layers.iter().zip(masses).map(|(l, mass)| {
            let content: Vec<_> = decoded.by_ref().take(l.content.len()).collect();
            Layer { name: l.name.clone(), mass, content }
        });
        let layers: Vec<_> = layers.collect();
        let all = || layers.iter().flat_map(|l| l.content.iter().map(|b| &b.block));
        let count = all().fold(0u64, |sum, b| sum.saturating_add(b.count));
        let mass = compensated(&all().map(|b| b.mass).collect::<Vec<_>>());
        // Counts agree exactly, masses up to the rounding of sums (docs/format.md, section 1).
        if count != metadata.count || (mass - metadata.mass).abs() > 1e-9 * metadata.mass {
            return Err(corrupt("the blocks and the metadata disagree about particles or mass".into()));
        }
        Ok(TrackedModel { time, metadata, certificate, layers, key: self.key.clone() })
    }

    /// The moments of a quantity that the Gaussians of a block of the `next` frame had in this one; `None` where the
    /// block did not have it.
    pub fn field_before<'a>(
        &'a self,
        next: &'a TrackedModel,
        [layer, block]: [usize; 2],
        quantity: &Quantity,
    ) -> Option<PreviousField<'a>> {
        let [current, next] = [self, next].map(|frame| frame.layers.get(layer)?.content.get(block));
        self.metadata.fields.contains(quantity).then(|| current?.field(&quantity.name, &next?.origin, &next?.unrest))?
    }

    /// As [`Metadata::lacking_fields`].
    pub fn lacking_fields(&self) -> Vec<String> {
        let blocks: Vec<usize> = self.layers.iter().map(|l| l.content.len()).collect();
        let has =
            |l: usize, b: usize, name: &str, _| self.layers[l].content[b].block.gaussians.fields.get(name).is_some();
        self.metadata.lacking_fields(&blocks, &has)
    }

    /// The frame as a model.
    pub fn into_model(self) -> Model {
        let TrackedModel { metadata, certificate, layers, .. } = self;
        let blocks = |l: Layer<Vec<TrackedBlock>>| l.map(|blocks| blocks.into_iter().map(|b| b.block).collect());
        Model { metadata, certificate, layers: layers.into_iter().map(blocks).collect() }
    }
}

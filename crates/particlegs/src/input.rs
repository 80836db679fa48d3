//! Opens inputs: a model file, a frame of a series, or a snapshot.

use crate::snapshot::SnapshotFiles;
use crate::stats::{LayerFields, StatsSide, Subject};
use crate::{Choice, Context, Error, Hint, Model, Particles, Result, Series, Storage};
use particlegs_core::codec::{self, SeriesDecoder, SeriesFile};
use particlegs_core::model::{Metadata, hex};
use particlegs_files::input::{Source, is_stream, name_of};
use particlegs_files::model_file;
use particlegs_formats::PathKind;
use std::io::Read;
use std::path::Path;

/// The choice of a frame of a series.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FrameChoice {
    /// The last that is there.
    #[default]
    Last,
    /// A number from 0, or counted from the end: -1 is the last.
    Number(i64),
    /// A moment: `a=0.5`, `z=1`, `5Gyr`, `step=1000` or `500ps`; between frames the model is interpolated.
    Moment(String),
}

impl From<Option<i64>> for FrameChoice {
    fn from(number: Option<i64>) -> FrameChoice {
        number.map_or(FrameChoice::Last, FrameChoice::Number)
    }
}

impl FrameChoice {
    /// Refuses a frame or moment of a model that is no series.
    pub(crate) fn check_model(&self, place: &str) -> Result<()> {
        let option = match self {
            FrameChoice::Last => return Ok(()),
            FrameChoice::Number(_) => "frame",
            FrameChoice::Moment(_) => "time",
        };
        let message = "it is one model, not a series: it has no other frames or moments";
        Err(Error::input_with(place, message, Hint::from("omit ").option(option, "")))
    }

    /// The clock of a series at the frame or moment, and whether that lies between frames.
    pub(crate) fn time(&self, series: &SeriesFile<'_>, place: &str, context: &Context<'_>) -> Result<(f64, bool)> {
        let clock = series.clock.name();
        if let FrameChoice::Moment(text) = self {
            let time = series.moment(text)?;
            let between = series.frame_at(time).is_none();
            if between {
                context.note(&format!("{place}: {clock} {time} is interpolated between two frames"));
            }
            return Ok((time, between));
        }
        Ok((series.frames[self.number(series, place, context)?].time, false))
    }

    /// The number of the frame; of a moment the last.
    pub fn number(&self, series: &SeriesFile<'_>, place: &str, context: &Context<'_>) -> Result<usize> {
        let (number, count) = (if let FrameChoice::Number(n) = self { *n } else { -1 }, series.frames.len());
        // The last frame may be missing: -1 then means the one before, but -2 is counted as it is.
        let chosen = if number == -1 {
            series.last()?
        } else {
            let from_start = if number < 0 { number + count as i64 } else { number };
            usize::try_from(from_start).ok().filter(|&n| n < count).ok_or_else(|| {
                Error::input(place, format!("there is no frame {number}; the series has {count} frames, from 0"))
            })?
        };
        // An error where this frame is missing.
        series.frame_bytes(chosen)?;
        let gap = if number == -1 && chosen + 1 < count { "; the frames behind it are missing" } else { "" };
        if *self == FrameChoice::Last || !gap.is_empty() {
            let (clock, time) = (series.clock.name(), series.frames[chosen].time);
            context.note(&format!("{place}: frame {chosen} of {count} is read, {clock} {time}{gap}"));
        }
        Ok(chosen)
    }
}

/// A decoded model: that of a file, or of a frame or moment of a series.
pub struct DecodedModel {
    /// The model.
    pub model: particlegs_core::model::Model,
    /// BLAKE3 of the file, hexadecimal.
    pub blake3: String,
    /// The clock of a series at that moment, as text.
    pub moment: Option<String>,
    /// Whether the moment lies between two frames.
    pub interpolated: bool,
}

/// A model or a snapshot, named by a path.
pub enum ModelOrSnapshot {
    /// The bytes of a model file, or of a frame of a series as one.
    Model(Vec<u8>),
    /// A snapshot, and how it is read.
    Snapshot(Box<Choice>),
}

impl ModelOrSnapshot {
    /// A model, of a series the frame that `choice` names or else the last, or a snapshot. A pipe is read only once.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Corrupt`]; [`Error::Input`] for a frame that there is not.
    pub fn open(path: &Path, mut choice: Choice, context: &Context<'_>) -> Result<ModelOrSnapshot> {
        if path.is_dir() {
            return Ok(ModelOrSnapshot::Snapshot(choice.into()));
        }
        let mut source = Source::open(path, context)?;
        if codec::is_model(source.peek(HEAD)?) {
            let bytes = model_file::read_source(source, &name_of(path))?;
            return Ok(ModelOrSnapshot::Model(frame_of(bytes, &choice.frame.into(), &name_of(path), context)?));
        }
        // A pipe gives its data once: what was looked at is kept with the rest.
        if is_stream(path) {
            choice.spool(source)?;
        }
        Ok(ModelOrSnapshot::Snapshot(choice.into()))
    }
}

/// The subject of a measurement: a snapshot, with its fields where they are needed, or a model.
pub enum MeasuredInput {
    /// Particles, and the fields of each layer.
    Particles(Box<Particles>, Vec<LayerFields>),
    /// A model, or the layers of it that were chosen.
    Model(Box<particlegs_core::model::Model>),
}

impl MeasuredInput {
    /// Reads a model, of a series the frame that `choice` names or else the last, or a snapshot.
    ///
    /// # Errors
    /// As [`ModelOrSnapshot::open`]; those of reading.
    pub fn open(path: &Path, choice: Choice, with_fields: bool, context: &Context<'_>) -> Result<MeasuredInput> {
        let layers = choice.species.clone();
        Ok(match ModelOrSnapshot::open(path, choice, context)? {
            ModelOrSnapshot::Model(bytes) => {
                let model = codec::decode_with(&bytes, &name_of(path), context)?;
                MeasuredInput::Model(model.only_named(&layers)?.into())
            }
            ModelOrSnapshot::Snapshot(choice) => {
                let files = SnapshotFiles { paths: vec![path.to_path_buf()], choice: *choice };
                let (particles, fields) = files.read(&Storage::Memory, with_fields, context)?;
                MeasuredInput::Particles(particles.into(), fields)
            }
        })
    }

    /// As a side of a comparison.
    pub fn side(&self) -> StatsSide<'_> {
        match self {
            MeasuredInput::Particles(p, fields) => StatsSide { subject: Subject::Particles(p), fields },
            MeasuredInput::Model(m) => Subject::Model(m).into(),
        }
    }
}

/// Content of a model file.
#[derive(Debug)]
pub enum ModelOrSeries {
    /// One model.
    Model(Box<Model>),
    /// A series of models.
    Series(Series),
}

impl ModelOrSeries {
    /// Reads a model file or a series; `-` is standard input.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for what is neither; [`Error::Corrupt`].
    pub fn open(path: impl AsRef<Path>, context: &Context<'_>) -> Result<ModelOrSeries> {
        let (bytes, name) = (read_file(path.as_ref(), context)?, name_of(path.as_ref()));
        match codec::is_series(&bytes) {
            true => Series::from_bytes(bytes, &name).map(ModelOrSeries::Series),
            false => Ok(ModelOrSeries::Model(Model::decode(bytes, &name, context)?.into())),
        }
    }
}

const HEAD: usize = 8;

/// The bytes of a model file, or of a series; `-` is standard input.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for what is neither.
pub fn read_file(path: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(no_model(path));
    }
    let mut source = Source::open(path, context)?;
    // A snapshot or a picture is called by its name; of other bytes the codec says what is wrong.
    if !codec::is_model(source.peek(HEAD)?) && PathKind::from_path(path).describe().is_some() {
        return Err(no_model(path));
    }
    model_file::read_source(source, &name_of(path))
}

/// A model file's bytes; of a series those of a frame, coded as a model of its own.
///
/// # Errors
/// As [`read_file`]; [`Error::Input`] for a frame that there is not.
pub fn read_model(path: &Path, frame: &FrameChoice, context: &Context<'_>) -> Result<Vec<u8>> {
    frame_of(read_file(path, context)?, frame, &name_of(path), context)
}

/// A model to be drawn; unlike [`read_model`], this does not code a frame of a series anew.
///
/// # Errors
/// As [`read_model`].
pub fn decoded_model(path: &Path, frame: &FrameChoice, context: &Context<'_>) -> Result<DecodedModel> {
    let (bytes, place) = (read_file(path, context)?, name_of(path));
    let blake3 = hex(blake3::hash(&bytes).as_bytes());
    if !codec::is_series(&bytes) {
        frame.check_model(&place)?;
        let model = codec::decode_with(&bytes, &place, context)?;
        return Ok(DecodedModel { model, blake3, moment: None, interpolated: false });
    }
    let series = SeriesFile::read(&bytes, &place)?;
    let (time, interpolated) = frame.time(&series, &place, context)?;
    let model = SeriesDecoder::new(&series).model_at(time, context)?;
    let moment = Some(series.moment_text(time, &model.metadata.units));
    Ok(DecodedModel { model, blake3, moment, interpolated })
}

/// A model's bytes; of a series those of `frame`, which then becomes the snapshot's frame that it was made from.
///
/// # Errors
/// As [`read_model`].
pub fn read_model_of_snapshot(path: &Path, frame: &mut Option<i64>, context: &Context<'_>) -> Result<Vec<u8>> {
    let (bytes, place) = (read_file(path, context)?, name_of(path));
    if !codec::is_series(&bytes) {
        return Ok(bytes);
    }
    let bytes = frame_of(bytes, &(*frame).into(), &place, context)?;
    *frame = frame_of_snapshot(&codec::read_metadata(&bytes, &place)?, &place, context);
    Ok(bytes)
}

/// The frame of the snapshot that a frame of a series was made from.
pub fn frame_of_snapshot(metadata: &Metadata, series: &str, context: &Context<'_>) -> Option<i64> {
    if metadata.recipe.read.contains_key("align") {
        context.warn(&format!("the frames of {series} were aligned: their places are not those of snapshots"));
    }
    metadata.epoch.frame.and_then(|f| i64::try_from(f).ok())
}

/// Whether a file, which is not a pipe, is a series.
pub fn is_series(path: &Path) -> bool {
    let mut head = [0; codec::HEAD_BYTES];
    let mut read = || std::fs::File::open(path)?.read_exact(&mut head);
    path.is_file() && read().is_ok() && codec::is_series(&head)
}

/// The frame of `path` when it is compared with `other`: `frame` is one of `other` where `path` is a single model.
pub fn frame_beside(path: &Path, other: Option<&Path>, frame: Option<i64>) -> Option<i64> {
    let is_of_other = is_single(path) && other.is_some_and(|o| !is_single(o));
    frame.filter(|_| !is_of_other)
}

/// Whether a file, which is not a pipe, is a model but no series.
pub fn is_single(path: &Path) -> bool {
    matches!(PathKind::from_path(path), PathKind::Model) && !is_series(path)
}

/// A frame of a series as a model file; a model file as it is.
///
/// # Errors
/// [`Error::Input`] for a frame that there is not, and of a model that is no series.
pub fn frame_of(bytes: Vec<u8>, frame: &FrameChoice, place: &str, context: &Context<'_>) -> Result<Vec<u8>> {
    if !codec::is_series(&bytes) {
        return frame.check_model(place).map(|()| bytes);
    }
    let series = SeriesFile::read(&bytes, place)?;
    let (time, _) = frame.time(&series, place, context)?;
    SeriesDecoder::new(&series).extract_at(time, context)
}

fn no_model(path: &Path) -> Error {
    let kind = PathKind::from_path(path);
    let message = format!("{}, not a model file", kind.describe().unwrap_or_default());
    Error::input_with(path, message, kind.to_a_model())
}

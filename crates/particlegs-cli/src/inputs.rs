//! Reads inputs: a model, or either a model or a snapshot.

use crate::progress::to_stderr;
use crate::snapshot_args::SnapshotArgs;
use clap::Args;
use particlegs_core::codec::{SeriesDecoder, SeriesFile};
use particlegs_core::context::{Context, ProgressSink};
use particlegs_core::model::{Metadata, Model, hex};
use particlegs_core::text::one_line;
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::{Source, is_stream, name_of};
use particlegs_files::model_file;
use particlegs_formats::{Choice, PathKind};
use std::io::Read;
use std::path::Path;

/// Which frame of a series is read.
#[derive(Args, Clone, Debug, Default)]
pub struct FrameArgs {
    /// Frame of a series, from 0; -1 is the last [default: the last].
    #[arg(long, value_name = "N", hide_short_help = true, allow_negative_numbers = true, conflicts_with = "time")]
    frame: Option<i64>,
    /// Moment of a series: a=0.5, z=1, 5Gyr, step=1000 or 500ps; between frames it is interpolated.
    #[arg(long, value_name = "WHEN", hide_short_help = true)]
    time: Option<String>,
}

impl FrameArgs {
    /// The frame of this number.
    pub fn numbered(frame: Option<i64>) -> FrameArgs {
        FrameArgs { frame, time: None }
    }

    /// Is a frame or a moment named?
    pub fn is_given(&self) -> bool {
        self.frame.is_some() || self.time.is_some()
    }

    /// Refuses a frame or moment of a model that is no series.
    fn check_model(&self, place: &str) -> Result<()> {
        let option = match (self.frame, &self.time) {
            (Some(_), _) => "--frame",
            (None, Some(_)) => "--time",
            (None, None) => return Ok(()),
        };
        let what = "it is one model, not a series: it has no other frames or moments";
        Err(Error::input_with(place, what, format!("omit {option}")))
    }

    /// What the clock of a series shows at the frame or moment, and whether it lies between frames.
    fn time(&self, series: &SeriesFile<'_>, place: &str, context: &Context<'_>) -> Result<(f64, bool)> {
        let clock = series.clock.name();
        if let Some(text) = &self.time {
            let time = series.moment(text)?;
            let between = series.frame_at(time).is_none();
            if between {
                context.message(&format!("note: {place}: {clock} {time} is interpolated between two frames"));
            }
            return Ok((time, between));
        }
        Ok((series.frames[self.number(series, place, context)?].time, false))
    }

    /// The number of the frame, by default of the last that is there.
    pub fn number(&self, series: &SeriesFile<'_>, place: &str, context: &Context<'_>) -> Result<usize> {
        let (number, count) = (self.frame.unwrap_or(-1), series.frames.len());
        let chosen = if number == -1 {
            series.last()?
        } else {
            let from_start = if number < 0 { number + count as i64 } else { number };
            usize::try_from(from_start).ok().filter(|&n| n < count).ok_or_else(|| {
                Error::input(place, format!("there is no frame {number}; the series has {count} frames, from 0"))
            })?
        };
        series.frame_bytes(chosen)?;
        let gap = if number == -1 && chosen + 1 < count { "; the frames behind it are missing" } else { "" };
        if self.frame.is_none() || !gap.is_empty() {
            let (clock, time) = (series.clock.name(), series.frames[chosen].time);
            context.message(&format!("note: {place}: frame {chosen} of {count} is read, {clock} {time}{gap}"));
        }
        Ok(chosen)
    }
}

/// A decoded model: that of a file, or of a frame or moment of a series.
pub struct DecodedModel {
    pub model: Model,
    /// BLAKE3 of the file.
    pub blake3: String,
    /// What the clock of a series shows, as text.
    pub moment: Option<String>,
    /// Between two frames?
    pub interpolated: bool,
}

pub enum PathContent {
    Model(Vec<u8>),
    Snapshot(Box<Choice>),
}

const HEAD: usize = 8;

/// A model file's bytes, of a series those of its last frame; `-` is standard input.
pub fn model(path: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    model_of(path, &FrameArgs::default(), context)
}

/// The same with a frame of a series.
pub fn model_of(path: &Path, frame: &FrameArgs, context: &Context<'_>) -> Result<Vec<u8>> {
    frame_of(model_or_series(path, context)?, frame, &name_of(path), context)
}

/// A model to be drawn; unlike [`model_of`], this does not code a frame of a series anew.
pub fn decoded_model(path: &Path, frame: &FrameArgs, context: &Context<'_>) -> Result<DecodedModel> {
    let (bytes, place) = (model_or_series(path, context)?, name_of(path));
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

/// A model's bytes; of a series those of the frame that `opening` names, which then names the snapshot's frame that it
/// was made from.
pub fn model_with_snapshot(path: &Path, opening: &mut SnapshotArgs, context: &Context<'_>) -> Result<Vec<u8>> {
    let bytes = model_or_series(path, context)?;
    if !codec::is_series(&bytes) {
        return Ok(bytes);
    }
    let bytes = frame_of(bytes, &FrameArgs::numbered(opening.frame), &name_of(path), context)?;
    opening.frame = frame_of_snapshot(&codec::read_metadata(&bytes, &name_of(path))?, &name_of(path), context);
    Ok(bytes)
}

/// The frame of the snapshot that a frame of a series was made from.
pub fn frame_of_snapshot(metadata: &Metadata, series: &str, context: &Context<'_>) -> Option<i64> {
    if metadata.recipe.read.contains_key("align") {
        context
            .message(&format!("warning: the frames of {series} were aligned: their places are not those of snapshots"));
    }
    metadata.epoch.frame.and_then(|f| i64::try_from(f).ok())
}

/// The bytes of a model file, or of a series.
pub fn model_or_series(path: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(no_model(path));
    }
    let mut source = Source::open(path, context)?;
    if !codec::is_model(source.peek(HEAD)?) && PathKind::from_path(path).describe().is_some() {
        return Err(no_model(path));
    }
    model_file::read_source(source, &name_of(path))
}

/// Is a file, which is not a pipe, a series?
pub fn is_series(path: &Path) -> bool {
    let mut head = [0; codec::HEAD_BYTES];
    let mut read = || std::fs::File::open(path)?.read_exact(&mut head);
    path.is_file() && read().is_ok() && codec::is_series(&head)
}

/// Is a file, which is not a pipe, a model but no series?
pub fn is_single(path: &Path) -> bool {
    matches!(PathKind::from_path(path), PathKind::Model) && !is_series(path)
}

/// How `path` is opened when it is compared with `other`: a frame is one of `other` where this is a single model.
pub fn opening_beside(path: &Path, other: Option<&Path>, opening: &SnapshotArgs) -> SnapshotArgs {
    let is_of_other = is_single(path) && other.is_some_and(|o| !is_single(o));
    SnapshotArgs { frame: opening.frame.filter(|_| !is_of_other), ..opening.clone() }
}

/// A frame of a series as a model file; a model file as it is.
pub fn frame_of(bytes: Vec<u8>, frame: &FrameArgs, place: &str, context: &Context<'_>) -> Result<Vec<u8>> {
    if !codec::is_series(&bytes) {
        return frame.check_model(place).map(|()| bytes);
    }
    let series = SeriesFile::read(&bytes, place)?;
    let (time, _) = frame.time(&series, place, context)?;
    SeriesDecoder::new(&series).extract_at(time, context)
}

fn no_model(path: &Path) -> Error {
    let kind = PathKind::from_path(path);
    let what = format!("{}, not a model file", kind.describe().unwrap_or_default());
    Error::input_with(path, what, kind.to_a_model())
}

/// A model, of a series the frame that is named or else the last, or a snapshot. A pipe is read only once.
pub fn model_or_snapshot(path: &Path, opening: &SnapshotArgs, context: &Context<'_>) -> Result<PathContent> {
    let mut choice = opening.choice()?;
    if path.is_dir() {
        return Ok(PathContent::Snapshot(choice.into()));
    }
    let mut source = Source::open(path, context)?;
    if codec::is_model(source.peek(HEAD)?) {
        let frame = FrameArgs::numbered(opening.frame);
        let bytes = model_file::read_source(source, &name_of(path))?;
        return Ok(PathContent::Model(frame_of(bytes, &frame, &name_of(path), context)?));
    }
    if is_stream(path) {
        choice.spool(source)?;
    }
    Ok(PathContent::Snapshot(choice.into()))
}

/// Prints what the command waits for before its progress is shown.
pub struct WaitNotice;

impl ProgressSink for WaitNotice {
    fn message(&self, text: &str) {
        to_stderr(&one_line(text));
    }
}

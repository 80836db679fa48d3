//! A series of models: its frames by number and by moment.

mod describe;
mod make;

use crate::input::FrameChoice;
use crate::{Context, Model, Result};
pub use describe::{FrameDescription, SeriesDescription};
pub use make::{FrameRange, FrameResult, SeriesOptions, SeriesResult, make_series};
use particlegs_core::codec::{FileInfo, FrameCoding, FrameEntry, SeriesDecoder, SeriesFile, read_info};
use std::fmt::{Debug, Formatter};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A series of models. Frames that were decoded lately are kept, so that frames in order cost one step each; clones
/// share that.
#[derive(Clone)]
pub struct Series {
    name: String,
    bytes: Arc<Vec<u8>>,
    decoder: SharedDecoder,
}

impl Debug for Series {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let (name, frames, bytes) = (&self.name, self.times().len(), self.bytes.len());
        write!(f, "Series({name}: {frames} frames, {bytes} bytes)")
    }
}

type SharedDecoder = Arc<Mutex<SeriesDecoder<'static>>>;

/// A frame of a series, and what decodes it.
#[derive(Clone)]
pub(crate) struct SeriesFrame {
    decoder: SharedDecoder,
    pub number: usize,
}

impl SeriesFrame {
    pub fn lock(&self) -> MutexGuard<'_, SeriesDecoder<'static>> {
        self.decoder.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Series {
    /// Reads a series file; `-` is standard input.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Input`] for what is no series; [`crate::Error::Corrupt`].
    pub fn open(path: impl AsRef<Path>) -> Result<Series> {
        let context = Context::SILENT;
        let name = particlegs_files::input::name_of(path.as_ref());
        Series::from_bytes(crate::input::read_file(path.as_ref(), &context)?, &name)
    }

    /// Reads the bytes of a series file; errors name it `name`.
    ///
    /// # Errors
    /// As [`Series::open`].
    pub fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Series> {
        let decoder = SeriesDecoder::of(SeriesFile::read(&bytes, name)?.into_owned());
        Ok(Series { name: name.into(), bytes: Arc::new(bytes), decoder: Arc::new(Mutex::new(decoder)) })
    }

    /// The path that it was read from.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The name of its file, without folders.
    pub fn file_name(&self) -> String {
        Path::new(&self.name).file_name().map_or_else(|| self.name.clone(), |n| n.to_string_lossy().into_owned())
    }

    /// The file's bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Decodes frames one after the other; others wait meanwhile.
    pub fn decoder(&self) -> MutexGuard<'_, SeriesDecoder<'static>> {
        self.decoder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Its clock: `scale factor`, `time`, `step` or `frame`.
    pub fn clock(&self) -> &'static str {
        self.decoder().series().clock.name()
    }

    /// Time of each frame by the clock; `None` for a frame that is missing.
    pub fn times(&self) -> Vec<Option<f64>> {
        let time = |f: &FrameEntry| (f.kind != FrameCoding::Missing).then_some(f.time);
        self.decoder().series().frames.iter().map(time).collect()
    }

    /// The time of the clock at a moment such as `z=1` or `500ps`.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a moment that the clock does not know, or beyond the frames.
    pub fn moment(&self, text: &str) -> Result<f64> {
        self.decoder().series().moment(text)
    }

    /// The model of a frame or moment, between frames interpolated: a keyframe as it is, others coded anew in finer
    /// steps.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for a frame that there is not; those of [`Series::moment`]; [`crate::Error::Cancelled`].
    pub fn model(&self, frame: &FrameChoice, context: &Context<'_>) -> Result<Model> {
        let (time, between) = frame.time(self.decoder().series(), &self.name, context)?;
        if between {
            return self.at(time, context);
        }
        // There is one: the time is not between frames.
        let number = self.decoder().series().frame_at(time).unwrap_or_default();
        self.frame(number, context)
    }

    /// The model of a frame, from 0.
    ///
    /// # Errors
    /// As [`Series::model`].
    pub fn frame(&self, number: usize, context: &Context<'_>) -> Result<Model> {
        let bytes = self.decoder().extract(number, context)?;
        let frame = SeriesFrame { decoder: self.decoder.clone(), number };
        Model::of_frame(bytes, format!("{}, frame {number}", self.name), frame, context)
    }

    /// The model at a time of the clock, between frames interpolated.
    ///
    /// # Errors
    /// As [`Series::model`].
    pub fn at(&self, time: f64, context: &Context<'_>) -> Result<Model> {
        let bytes = self.decoder().extract_at(time, context)?;
        Model::decode(bytes, &format!("{}, {} {time}", self.name, self.clock()), context)
    }

    /// The index of its first frame.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`].
    pub fn first_info(&self) -> Result<FileInfo> {
        let decoder = self.decoder();
        read_info(decoder.series().frame_bytes(decoder.series().first()?)?, &self.name)
    }
}

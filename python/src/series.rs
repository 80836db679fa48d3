//! A series: its index, and its models by number and by moment.

use crate::choice::ReadOptions;
use crate::compress::CompressOptions;
use crate::errors::IntoPyResult;
use crate::model::{Model, SeriesFrame};
use crate::stats::measure_options;
use crate::work::WorkOptions;
use particlegs::SeriesOptions;
use particlegs_compress::verify::SeriesVerification;
use particlegs_core::codec::{FrameCoding, SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::{Result, codec, model};
use particlegs_files::input::Source;
use particlegs_files::model_file;
use particlegs_measure::stats::SeriesStatistics;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A series. Immutable; what was decoded lately is kept, so that frames in order cost one step each.
#[pyclass(frozen, name = "Series", module = "particlegs._particlegs")]
pub struct ModelSeries {
    name: String,
    place: String,
    nbytes: usize,
    clock: &'static str,
    times: Vec<Option<f64>>,
    decoder: Arc<Mutex<SeriesDecoder<'static>>>,
}

impl ModelSeries {
    fn model(
        &self,
        py: Python<'_>,
        name: String,
        frame: Option<usize>,
        threads: Option<usize>,
        file: impl FnOnce(&mut SeriesDecoder<'_>, &Context<'_>) -> Result<Vec<u8>> + Send,
    ) -> PyResult<Model> {
        let (bytes, model) = WorkOptions::quietly(threads).run(py, |context| {
            let mut decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            let bytes = file(&mut decoder, context)?;
            let mut model = codec::decode_with(&bytes, &self.place, context)?;
            if let Some(frame) = frame {
                model.certificate = decoder.series().certificate(frame)?;
            }
            Ok((bytes, model))
        })?;
        let frame = frame.map(|number| SeriesFrame { decoder: self.decoder.clone(), number });
        Ok(Model::new(bytes, model, name).with_frame(frame))
    }
}

#[pymethods]
impl ModelSeries {
    /// Reads a series.
    #[staticmethod]
    #[pyo3(signature = (path, threads=None))]
    fn read(py: Python<'_>, path: PathBuf, threads: Option<usize>) -> PyResult<Self> {
        let place = path.display().to_string();
        WorkOptions::quietly(threads).run(py, |context| {
            let bytes = model_file::read_source(Source::open(&path, context)?, &place)?;
            SeriesFile::read(&bytes, &place)?;
            let series = SeriesFile::read_start(&bytes, &place)?;
            let there = |f: &codec::FrameEntry| (f.kind != FrameCoding::Missing).then_some(f.time);
            Ok(ModelSeries {
                name: path.file_name().map_or_else(|| place.clone(), |n| n.to_string_lossy().into_owned()),
                nbytes: bytes.len(),
                clock: series.clock.name(),
                times: series.frames.iter().map(there).collect(),
                decoder: Arc::new(Mutex::new(SeriesDecoder::of(series))),
                place,
            })
        })
    }

    /// Does a file that begins with these bytes hold a series?
    #[staticmethod]
    fn begins(head: &[u8]) -> bool {
        codec::is_series(head)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    #[getter]
    fn nbytes(&self) -> usize {
        self.nbytes
    }

    #[getter]
    fn clock(&self) -> &str {
        self.clock
    }

    /// What the clock shows for each frame; `None` for a frame that is missing.
    #[getter]
    fn times(&self) -> Vec<Option<f64>> {
        self.times.clone()
    }

    /// The model of a frame.
    #[pyo3(signature = (frame, threads=None))]
    fn frame(&self, py: Python<'_>, frame: usize, threads: Option<usize>) -> PyResult<Model> {
        let name = format!("{}, frame {frame}", self.name);
        self.model(py, name, Some(frame), threads, move |decoder, context| decoder.extract(frame, context))
    }

    /// Decodes every frame: JSON, and what is wrong where anything is.
    #[pyo3(signature = (threads=None, progress=None))]
    fn verify(
        &self,
        py: Python<'_>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(String, Option<String>)> {
        let found = WorkOptions { threads, progress }.run(py, |context| {
            let decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            SeriesVerification::new(decoder.series(), context)
        })?;
        let wrong = found.judge(&self.place).err().map(|e| e.to_string());
        Ok((serde_json::to_string(&found).expect("plain data"), wrong))
    }

    /// Statistics of every frame, of some layers or all: JSON as the command writes it.
    #[pyo3(signature = (asked, layers=None, threads=None, progress=None))]
    fn statistics(
        &self,
        py: Python<'_>,
        asked: &str,
        layers: Option<Vec<String>>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<String> {
        let options = measure_options(asked)?;
        WorkOptions { threads, progress }.run(py, |context| {
            let decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
            let choose = |model: model::Model| if let Some(names) = &layers { model.only(names) } else { Ok(model) };
            let found = SeriesStatistics::new(&self.place, decoder.series(), options, choose, context)?;
            Ok(serde_json::to_string(&found).expect("plain data"))
        })
    }

    /// The time of the clock at a moment such as `z=1`.
    fn moment(&self, text: &str) -> PyResult<f64> {
        let decoder = self.decoder.lock().unwrap_or_else(PoisonError::into_inner);
        decoder.series().moment(text).or_raise()
    }

    /// The model at a time of the clock, between frames interpolated.
    #[pyo3(signature = (time, threads=None))]
    fn at(&self, py: Python<'_>, time: f64, threads: Option<usize>) -> PyResult<Model> {
        let name = format!("{}, {} {time}", self.name, self.clock);
        self.model(py, name, None, threads, move |decoder, context| decoder.extract_at(time, context))
    }
}

/// How the frames of a series are made; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FrameOptions {
    keyframe_interval: usize,
    frames: Option<String>,
    align: Option<String>,
    overwrite: bool,
}

/// Makes a series, or goes on with one; the summary as JSON.
#[pyfunction]
#[pyo3(signature = (snapshots, output, read, compress, frames, threads=None, progress=None))]
pub fn make_series(
    py: Python<'_>,
    snapshots: Vec<PathBuf>,
    output: PathBuf,
    read: ReadOptions,
    compress: CompressOptions,
    frames: FrameOptions,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let choice = read.choice().or_raise()?;
    let options = SeriesOptions {
        compress: compress.options(&choice.options())?,
        keyframe_interval: frames.keyframe_interval,
        frames: frames.frames.map(|text| text.parse()).transpose().or_raise()?,
        align: frames.align,
        replace: frames.overwrite,
    };
    let made = WorkOptions { threads, progress }
        .run(py, |context| particlegs::make_series(&snapshots, &choice, &output, &options, context))?;
    Ok(serde_json::to_string(&made).expect("plain data"))
}

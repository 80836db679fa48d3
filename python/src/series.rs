//! A series: its index, and its models by number and by moment.

use crate::choice::ReadOptions;
use crate::compress::CompressOptions;
use crate::errors::IntoPyResult;
use crate::model::Model;
use crate::stats::measure_options;
use crate::work::WorkOptions;
use particlegs::SeriesOptions;
use particlegs_core::codec;
use pyo3::prelude::*;
use std::path::PathBuf;

/// A series. Immutable; what was decoded lately is kept, so that frames in order cost one step each.
#[pyclass(frozen, name = "Series", module = "particlegs._particlegs")]
pub struct ModelSeries {
    pub file: particlegs::Series,
}

#[pymethods]
impl ModelSeries {
    /// Reads a series.
    #[staticmethod]
    #[pyo3(signature = (path, threads=None))]
    fn read(py: Python<'_>, path: PathBuf, threads: Option<usize>) -> PyResult<Self> {
        let file = WorkOptions::quietly(threads).run(py, |_| particlegs::Series::open(&path))?;
        Ok(ModelSeries { file })
    }

    /// Whether a file that begins with these bytes holds a series.
    #[staticmethod]
    fn begins(head: &[u8]) -> bool {
        codec::is_series(head)
    }

    #[getter]
    fn name(&self) -> String {
        self.file.file_name()
    }

    #[getter]
    fn nbytes(&self) -> usize {
        self.file.bytes().len()
    }

    #[getter]
    fn clock(&self) -> &str {
        self.file.clock()
    }

    /// Time of the clock for each frame; `None` for a frame that is missing.
    #[getter]
    fn times(&self) -> Vec<Option<f64>> {
        self.file.times()
    }

    /// The model of a frame.
    #[pyo3(signature = (frame, threads=None))]
    fn frame(&self, py: Python<'_>, frame: usize, threads: Option<usize>) -> PyResult<Model> {
        WorkOptions::quietly(threads).run(py, |context| self.file.frame(frame, context)).map(Model::from)
    }

    /// Decodes every frame: JSON, and what is wrong where anything is.
    #[pyo3(signature = (threads=None, progress=None))]
    fn verify(
        &self,
        py: Python<'_>,
        threads: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(String, Option<String>)> {
        let verification = WorkOptions { threads, progress }.run(py, |context| self.file.verify(context))?;
        let wrong = verification.judge(self.file.name()).err().map(|e| e.to_string());
        Ok((serde_json::to_string(&verification).expect("plain data"), wrong))
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
            let statistics = self.file.statistics(options, &layers.unwrap_or_default(), context)?;
            Ok(serde_json::to_string(&statistics).expect("plain data"))
        })
    }

    /// The time of the clock at a moment such as `z=1`.
    fn moment(&self, text: &str) -> PyResult<f64> {
        self.file.moment(text).or_raise()
    }

    /// The model at a time of the clock, between frames interpolated.
    #[pyo3(signature = (time, threads=None))]
    fn at(&self, py: Python<'_>, time: f64, threads: Option<usize>) -> PyResult<Model> {
        WorkOptions::quietly(threads).run(py, |context| self.file.at(time, context)).map(Model::from)
    }
}

/// Options of making the frames of a series; the names are those of the command.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct FrameOptions {
    keyframe_interval: usize,
    certify_changes: bool,
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
        certify_changes: frames.certify_changes,
        frames: frames.frames.map(|text| text.parse()).transpose().or_raise()?,
        align: frames.align,
        replace: frames.overwrite,
    };
    let series = WorkOptions { threads, progress }
        .run(py, |context| particlegs::make_series(&snapshots, &choice, &output, &options, context))?;
    Ok(serde_json::to_string(&series).expect("plain data"))
}

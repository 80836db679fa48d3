//! Keeps the curve and the seconds of a training run with its state.

use super::TrainingScore;
use particlegs_compress::Checkpoint;
use particlegs_core::Result;
use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::context::{ProgressEvent, ProgressSink};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const CURVE: &str = "curve";

/// The curve in a checkpoint; empty if it has none.
pub(super) fn curve_of(checkpoint: &Checkpoint) -> Vec<TrainingScore> {
    checkpoint.get(CURVE).and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// Key of the wall-clock seconds of all runs so far.
const SECONDS: &str = "seconds";

/// Seconds of earlier runs, or, if they are missing, of the last score.
pub(super) fn seconds_of(checkpoint: &Checkpoint) -> f64 {
    let seconds = checkpoint.get(SECONDS).and_then(|bytes| serde_json::from_slice(&bytes).ok());
    seconds.unwrap_or_else(|| curve_of(checkpoint).last().map_or(0.0, |e| e.seconds))
}

/// A checkpoint that also stores the curve and the seconds.
pub(super) struct CurveCheckpoint<'a> {
    pub checkpoint: Checkpoint,
    pub recorder: &'a CurveRecorder<'a>,
    /// Seconds of earlier runs.
    pub before: f64,
    pub start: Instant,
}

impl CurveCheckpoint<'_> {
    /// Seconds of all runs, including this one so far.
    pub fn seconds(&self) -> f64 {
        self.before + self.start.elapsed().as_secs_f64()
    }

    pub fn keep_seconds(&mut self) -> Result<()> {
        let text = serde_json::to_vec(&self.seconds()).unwrap_or_default();
        self.checkpoint.keep(SECONDS, text)
    }
}

impl CheckpointStore for CurveCheckpoint<'_> {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.checkpoint.get(key)
    }

    fn keep(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.checkpoint.keep(key, bytes)
    }

    fn keep_now(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        // Stored with the state, so that no score is lost or repeated when the run continues.
        let curve = serde_json::to_vec(&*self.recorder.curve()).unwrap_or_default();
        self.checkpoint.keep(CURVE, curve)?;
        self.keep_seconds()?;
        self.checkpoint.keep_now(key, bytes)
    }
}

/// Records the scores of a run, and ends only its training when the time is over.
pub(super) struct CurveRecorder<'a> {
    inner: &'a dyn ProgressSink,
    curve: Mutex<Vec<TrainingScore>>,
    piece: Option<Duration>,
    /// Running phases.
    phases: Mutex<Vec<String>>,
    /// Start of the training.
    began: Mutex<Option<Instant>>,
}

/// The phase that may end early.
const TRAINING: &str = "training";

impl<'a> CurveRecorder<'a> {
    /// Starts with the curve of earlier runs and a limit of time.
    pub fn new(inner: &'a dyn ProgressSink, curve: Vec<TrainingScore>, piece: Option<Duration>) -> Self {
        CurveRecorder { inner, curve: Mutex::new(curve), piece, phases: Mutex::default(), began: Mutex::default() }
    }

    pub fn curve(&self) -> MutexGuard<'_, Vec<TrainingScore>> {
        locked(&self.curve)
    }

    /// Whether it is training, with no time left.
    pub fn ends_training(&self) -> bool {
        self.late() && locked(&self.phases).iter().any(|p| p == TRAINING)
    }

    /// Whether no time is left.
    pub fn late(&self) -> bool {
        let began = *locked(&self.began);
        self.piece.zip(began).is_some_and(|(piece, began)| began.elapsed() >= piece)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ProgressSink for CurveRecorder<'_> {
    fn event(&self, event: ProgressEvent<'_>) {
        match event {
            ProgressEvent::Begin { phase, .. } => {
                if phase == TRAINING {
                    locked(&self.began).get_or_insert_with(Instant::now);
                }
                locked(&self.phases).push(phase.into());
            }
            ProgressEvent::End => drop(locked(&self.phases).pop()),
            ProgressEvent::Log(line) => {
                let scored = serde_json::from_str::<TrainingScore>(line).ok();
                self.curve().extend(scored.filter(|e| e.held_out_masked_psnr.is_some()));
            }
            ProgressEvent::Advance(_) => {}
        }
        self.inner.event(event);
    }

    fn message(&self, text: &str) {
        self.inner.message(text);
    }
}

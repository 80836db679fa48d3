//! Progress and cancellation, given by the caller: the library prints nothing.

use crate::{Error, Result};

/// Receives what long work has to say and tells it when to stop.
pub trait Progress: Sync {
    /// A phase of `total` steps begins (0 = unknown), within those that have not ended.
    fn begin(&self, _phase: &str, _total: u64) {}
    /// `steps` more steps of the phase are done.
    fn advance(&self, _steps: u64) {}
    /// The phase is over.
    fn end(&self) {}
    /// Something the user should read.
    fn message(&self, _text: &str) {}
    /// A line of a log, JSON.
    fn log(&self, _line: &str) {}
    /// True once the caller wants the work to stop.
    fn cancelled(&self) -> bool {
        false
    }
    /// [`Error::Cancelled`] once the caller wants the work to stop.
    fn check(&self) -> Result<()> {
        if self.cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// No progress, never cancelled.
pub struct Silent;

impl Progress for Silent {}

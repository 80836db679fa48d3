//! What the library asks of its caller: progress and cancellation, the instruction set, the memory
//! there is. It prints nothing, reads no environment and keeps no state of its own.

use crate::{Error, Result};

pub use fearless_simd::Level;

/// Smaller needs are not asked about: a look at the system takes longer than they do.
const SMALL: u64 = 32 << 20;

/// Receives what long work has to say, tells it when to stop, and knows the machine that it runs on.
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
    /// The instruction set that kernels are run with: by default the best that the machine has.
    /// Results are the same bits at every level.
    fn simd(&self) -> Level {
        Level::new()
    }
    /// Bytes that the process can still take; `None` where that is not known.
    fn available_memory(&self) -> Option<u64> {
        None
    }
    /// Asks for memory before it is taken.
    fn require_memory(&self, what: &str, need_bytes: u64) -> Result<()> {
        if need_bytes < SMALL {
            return Ok(());
        }
        match self.available_memory() {
            Some(have_bytes) if need_bytes > have_bytes => {
                Err(Error::Memory { what: what.to_string(), need_bytes, have_bytes })
            }
            _ => Ok(()),
        }
    }
}

/// No progress, never cancelled.
pub struct Silent;

impl Progress for Silent {}

/// [`Silent`], with the instructions alone that every machine of this kind has.
pub struct Scalar;

impl Progress for Scalar {
    fn simd(&self) -> Level {
        Level::baseline()
    }
}

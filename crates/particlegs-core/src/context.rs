//! The caller's side of long work: the sink of progress, whether to stop, the instruction set, the memory
//! there is. The library prints nothing, reads no environment and keeps no state of its own.

use crate::{Error, Result};
use std::fmt::{self, Debug, Formatter};

pub use fearless_simd::Level;

/// Smaller needs are not asked about: a look at the system takes longer than they do.
const SMALL: u64 = 32 << 20;

/// An event in long work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProgressEvent<'a> {
    /// A phase begins, within those that have not ended.
    Begin {
        /// Its name.
        phase: &'a str,
        /// Steps that it has; 0 = unknown.
        total: u64,
    },
    /// So many more steps of the phase are done.
    Advance(u64),
    /// The phase is over.
    End,
    /// A line of a log, JSON.
    Log(&'a str),
}

/// Receives what long work has to say, from any thread.
pub trait ProgressSink: Sync {
    /// The progress of the work.
    fn event(&self, _event: ProgressEvent<'_>) {}
    /// Something the user should read.
    fn message(&self, _text: &str) {}
}

struct Silence;

impl ProgressSink for Silence {}

/// The caller's side of long work. The default shows nothing, is never cancelled, and knows no limit of memory.
///
/// ```
/// use particlegs_core::context::{Context, ProgressSink};
///
/// struct Lines;
/// impl ProgressSink for Lines {
///     fn message(&self, text: &str) {
///         println!("{text}");
///     }
/// }
/// let late = || false;
/// let context = Context::default().with_sink(&Lines).with_cancel(&late);
/// context.message("two particles lie outside the box");
/// assert!(context.check().is_ok());
/// ```
#[derive(Clone, Copy)]
pub struct Context<'a> {
    sink: &'a dyn ProgressSink,
    cancel: &'a (dyn Fn() -> bool + Sync),
    /// `None` = the best that the machine has.
    simd: Option<Level>,
    memory: &'a (dyn Fn() -> Option<u64> + Sync),
    /// Whether notes are dropped.
    no_notes: bool,
}

impl Default for Context<'_> {
    fn default() -> Self {
        Context::SILENT
    }
}

impl Debug for Context<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Context").field("cancelled", &self.cancelled()).field("simd", &self.simd).finish()
    }
}

impl<'a> Context<'a> {
    /// The default, as a constant.
    pub const SILENT: Context<'static> =
        Context { sink: &Silence, cancel: &|| false, simd: None, memory: &|| None, no_notes: false };

    /// [`Context::SILENT`], with the instructions alone that every machine of this kind has.
    pub fn scalar() -> Context<'static> {
        Context::SILENT.with_simd(Level::baseline())
    }

    /// With progress and messages for `sink`.
    pub fn with_sink(self, sink: &'a dyn ProgressSink) -> Self {
        Context { sink, ..self }
    }

    /// Stopped once `cancel` is true.
    pub fn with_cancel(self, cancel: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Context { cancel, ..self }
    }

    /// With an instruction set for kernels: results are the same bits at every level.
    pub fn with_simd(self, level: Level) -> Self {
        Context { simd: Some(level), ..self }
    }

    /// With what tells the bytes that the process can still take; `None` where that is not known.
    pub fn with_memory(self, memory: &'a (dyn Fn() -> Option<u64> + Sync)) -> Self {
        Context { memory, ..self }
    }

    /// The same machine, without progress, messages and cancelling.
    pub fn silent(&self) -> Self {
        Context { sink: &Silence, cancel: &|| false, ..*self }
    }

    /// Without notes, for work that repeats what was reported before.
    pub fn without_notes(self) -> Self {
        Context { no_notes: true, ..self }
    }

    /// A phase of `total` steps begins (0 = unknown), within those that have not ended.
    pub fn begin(&self, phase: &str, total: u64) {
        self.sink.event(ProgressEvent::Begin { phase, total });
    }

    /// `steps` more steps of the phase are done.
    pub fn advance(&self, steps: u64) {
        self.sink.event(ProgressEvent::Advance(steps));
    }

    /// The phase is over.
    pub fn end(&self) {
        self.sink.event(ProgressEvent::End);
    }

    /// Writes a line of a log, JSON.
    pub fn log(&self, line: &str) {
        self.sink.event(ProgressEvent::Log(line));
    }

    /// Says something that the user should read.
    pub fn message(&self, text: &str) {
        self.sink.message(text);
    }

    /// Reports what a user should know of the work: a message that begins with `note: `.
    pub fn note(&self, text: &str) {
        if !self.no_notes {
            self.message(&format!("note: {text}"));
        }
    }

    /// Reports what a user must know, even one who wants no progress: a message that begins with `warning: `.
    pub fn warn(&self, text: &str) {
        self.message(&format!("warning: {text}"));
    }

    /// The sink, for another that stands before it.
    pub fn sink(&self) -> &'a dyn ProgressSink {
        self.sink
    }

    /// True once the caller wants the work to stop.
    pub fn cancelled(&self) -> bool {
        (self.cancel)()
    }

    /// [`Error::Cancelled`] once the caller wants the work to stop.
    pub fn check(&self) -> Result<()> {
        if self.cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// The instruction set that kernels are run with.
    pub fn simd(&self) -> Level {
        self.simd.unwrap_or_else(Level::new)
    }

    /// Bytes that the process can still take; `None` where that is not known.
    pub fn available_memory(&self) -> Option<u64> {
        (self.memory)()
    }

    /// Asks for memory before it is taken: [`Error::Memory`] where `need_bytes` are many, and more than there are.
    pub fn require_memory(&self, what: &str, need_bytes: u64) -> Result<()> {
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

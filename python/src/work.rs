//! Long work: in its own threads, without the interpreter's lock, with progress, stopped by Ctrl-C.

use crate::errors::{InputError, exception};
use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory;
use pyo3::prelude::*;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

/// Interval between checks for signals and reports of progress.
const LOOK: Duration = Duration::from_millis(50);

/// Options of running work.
pub struct WorkOptions {
    /// Number of threads; `None` = all that the process may use.
    pub threads: Option<usize>,
    /// Called with the name of a phase, the steps done and the number of steps (0 = unknown).
    pub progress: Option<Py<PyAny>>,
}

impl WorkOptions {
    /// With a number of threads, without progress.
    pub fn quietly(threads: Option<usize>) -> Self {
        WorkOptions { threads, progress: None }
    }

    /// Runs `work` while other Python threads continue. An exception from a signal or the callback stops it.
    pub fn run<T: Send>(self, py: Python<'_>, work: impl FnOnce(&Context<'_>) -> Result<T> + Send) -> PyResult<T> {
        let threads = self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        if !(1..=4096).contains(&threads) {
            return Err(InputError::new_err(format!("threads must be 1 to 4096, not {threads}")));
        }
        let sink = PythonProgress::default();
        let (done, mut wait) = mpsc::channel();
        let mut stopped = None;
        let result = std::thread::scope(|scope| {
            let sink = &sink;
            scope.spawn(move || {
                let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                    let cancel = || sink.stop.load(Ordering::SeqCst);
                    let memory = &memory::available_bytes;
                    let context = Context::default().with_sink(sink).with_cancel(&cancel).with_memory(memory);
                    parallel::with_threads(threads, || work(&context))
                        .unwrap_or_else(|e| Err(Error::argument(format!("threads={threads}: {e}"))))
                }));
                let _ = done.send(result);
            });
            loop {
                let wait = &mut wait;
                let waited = py.detach(move || wait.recv_timeout(LOOK));
                if stopped.is_none()
                    && let Err(exception) = py.check_signals().and_then(|()| self.tell(py, sink))
                {
                    stopped = Some(exception);
                    sink.stop.store(true, Ordering::SeqCst);
                }
                match waited {
                    Err(mpsc::RecvTimeoutError::Timeout) => {}
                    other => break other.ok(),
                }
            }
        });
        match (stopped, result) {
            (Some(exception), _) => Err(exception),
            (None, Some(Ok(result))) => result.map_err(|e| exception(&e)),
            (None, Some(Err(panic))) => std::panic::resume_unwind(panic),
            (None, None) => unreachable!("the work says when it is done"),
        }
    }

    /// Reports progress and messages.
    fn tell(&self, py: Python<'_>, sink: &PythonProgress) -> PyResult<()> {
        let (events, messages) = {
            let mut log = sink.lock();
            if let Some(now) = log.phases.last_mut()
                && std::mem::take(&mut now.moved)
            {
                // Some work takes a step more than estimated.
                let done = if now.total > 0 { now.done.min(now.total) } else { now.done };
                let event = (now.name.clone(), done, now.total);
                log.events.push_back(event);
            }
            (std::mem::take(&mut log.events), std::mem::take(&mut log.messages))
        };
        if let Some(callback) = &self.progress {
            for (phase, done, total) in events {
                callback.call1(py, (phase, done, total))?;
            }
        }
        for message in messages {
            // Notes become warnings; other messages are logged.
            match message.strip_prefix("note: ").or_else(|| message.strip_prefix("warning: ")) {
                Some(note) => py.import("particlegs._warn")?.call_method1("warn", (note,))?,
                None => {
                    let logger = py.import("logging")?.call_method1("getLogger", ("particlegs",))?;
                    logger.call_method1("info", ("%s", message))?
                }
            };
        }
        Ok(())
    }
}

/// Collects progress and messages of the work until they are reported.
#[derive(Default)]
struct PythonProgress {
    stop: AtomicBool,
    log: Mutex<ProgressLog>,
}

#[derive(Default)]
struct ProgressLog {
    /// Phases that have not ended, from the outermost to the innermost.
    phases: Vec<PhaseProgress>,
    events: VecDeque<(String, u64, u64)>,
    messages: Vec<String>,
}

struct PhaseProgress {
    name: String,
    done: u64,
    total: u64,
    moved: bool,
}

impl PythonProgress {
    fn lock(&self) -> MutexGuard<'_, ProgressLog> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ProgressSink for PythonProgress {
    fn event(&self, event: ProgressEvent<'_>) {
        let mut log = self.lock();
        match event {
            ProgressEvent::Begin { phase, total } => {
                log.phases.push(PhaseProgress { name: phase.into(), done: 0, total, moved: false });
                log.events.push_back((phase.into(), 0, total));
            }
            ProgressEvent::Advance(steps) => {
                if let Some(now) = log.phases.last_mut() {
                    (now.done, now.moved) = (now.done.saturating_add(steps), true);
                }
            }
            ProgressEvent::End => {
                if let Some(PhaseProgress { name, done, total, .. }) = log.phases.pop() {
                    let all = total.max(done);
                    log.events.push_back((name, all, all));
                }
            }
            ProgressEvent::Log(_) => {}
        }
    }

    fn message(&self, text: &str) {
        self.lock().messages.push(text.into());
    }
}

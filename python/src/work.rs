//! Long work: without the interpreter's lock, on threads of its own, told about, and stopped by Ctrl-C.

use crate::errors::{InputError, exception};
use particlegs_files::memory;
use particlegs_pipeline::context::{Context, ProgressEvent, ProgressSink};
use particlegs_pipeline::{Error, Result, parallel};
use pyo3::prelude::*;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

/// How often signals are looked for, and progress is told.
const LOOK: Duration = Duration::from_millis(50);

/// What the caller says of how work is done.
pub struct WorkOptions {
    /// Threads; `None` = as many as the process may use.
    pub threads: Option<usize>,
    /// Called with a phase's name, its steps done, and its steps (0 = not known).
    pub progress: Option<Py<PyAny>>,
}

impl WorkOptions {
    /// So many threads, and nothing told.
    pub fn quietly(threads: Option<usize>) -> Self {
        WorkOptions { threads, progress: None }
    }

    /// Does `work`, which nobody else waits for: other Python threads go on meanwhile, and a signal's exception or the
    /// callback's stops it.
    ///
    /// # Errors
    /// Those of the work as exceptions; the exception that stopped it.
    pub fn run<T: Send>(self, py: Python<'_>, work: impl FnOnce(&Context<'_>) -> Result<T> + Send) -> PyResult<T> {
        let threads = self.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
        if !(1..=4096).contains(&threads) {
            return Err(InputError::new_err(format!("threads={threads} is outside 1 to 4096")));
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

    /// Tells what is new.
    fn tell(&self, py: Python<'_>, sink: &PythonProgress) -> PyResult<()> {
        let (events, messages) = {
            let mut told = sink.told();
            if let Some(now) = told.phases.last_mut()
                && std::mem::take(&mut now.moved)
            {
                // Some work ends up to a step beyond what was foreseen.
                let done = if now.total > 0 { now.done.min(now.total) } else { now.done };
                let event = (now.name.clone(), done, now.total);
                told.events.push_back(event);
            }
            (std::mem::take(&mut told.events), std::mem::take(&mut told.messages))
        };
        if let Some(callback) = &self.progress {
            for (phase, done, total) in events {
                callback.call1(py, (phase, done, total))?;
            }
        }
        for message in messages {
            // What a user has to know of the data is a warning; the rest tells how the work goes on.
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

/// What the work says, until it is told.
#[derive(Default)]
struct PythonProgress {
    stop: AtomicBool,
    told: Mutex<ProgressLog>,
}

#[derive(Default)]
struct ProgressLog {
    /// Phases that have not ended, each within the one before it.
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
    fn told(&self) -> MutexGuard<'_, ProgressLog> {
        self.told.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ProgressSink for PythonProgress {
    fn event(&self, event: ProgressEvent<'_>) {
        let mut told = self.told();
        match event {
            ProgressEvent::Begin { phase, total } => {
                told.phases.push(PhaseProgress { name: phase.into(), done: 0, total, moved: false });
                told.events.push_back((phase.into(), 0, total));
            }
            ProgressEvent::Advance(steps) => {
                if let Some(now) = told.phases.last_mut() {
                    (now.done, now.moved) = (now.done.saturating_add(steps), true);
                }
            }
            ProgressEvent::End => {
                if let Some(PhaseProgress { name, done, total, .. }) = told.phases.pop() {
                    let all = total.max(done);
                    told.events.push_back((name, all, all));
                }
            }
            ProgressEvent::Log(_) => {}
        }
    }

    fn message(&self, text: &str) {
        self.told().messages.push(text.into());
    }
}

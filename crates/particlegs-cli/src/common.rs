//! Options of every command, and the context that they set up.

use crate::process;
use crate::progress::{Meter, to_stderr};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueHint};
use particlegs_core::context::{Context, Level, ProgressEvent, ProgressSink};
use particlegs_core::text::one_line;
use particlegs_core::{Error, NamedValue, Result, parallel};
use particlegs_files::memory;
use particlegs_files::output::Outputs;
use std::collections::BTreeSet;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Write the result as JSON to a file, or to standard output for `-`.
    ///
    /// With `-` nothing else is printed on standard output.
    #[arg(long, value_name = "FILE|-", value_hint = ValueHint::FilePath)]
    pub json: Option<PathBuf>,
    /// Print only errors, and results that are not written to a file.
    #[arg(long, short)]
    pub quiet: bool,
    /// Number of threads [default: all cores this process may use].
    ///
    /// Limits of batch systems, control groups and affinity masks are respected. The results do not depend on the
    /// number of threads.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of the random numbers.
    ///
    /// The same input, options and seed give the same bytes.
    #[arg(long, value_name = "N", default_value_t = 42, hide_short_help = true)]
    pub seed: u64,
}

/// A value with a fixed set of names, which help and completion list.
pub fn named<T: NamedValue>() -> impl TypedValueParser<Value = T> {
    one_of(T::VALUES.iter().copied())
}

/// The value of an option that also accepts `none`; clap uses `Option` for a missing option.
pub type OrNone<T> = Option<T>;

/// The parser of a `T` or a name for none, with its help.
pub fn named_or<T: NamedValue>(name: &'static str, help: &'static str) -> impl TypedValueParser<Value = OrNone<T>> {
    let some = T::VALUES.iter().map(|(value, name, help)| (Some(*value), *name, *help));
    one_of([(None, name, help)].into_iter().chain(some))
}

/// A value of an option, its name and its help, which may be empty.
pub type NamedChoice<T> = (T, &'static str, &'static str);

pub fn one_of<T: Clone + Send + Sync + 'static>(
    values: impl IntoIterator<Item = NamedChoice<T>>,
) -> impl TypedValueParser<Value = T> {
    let values: Vec<_> = values.into_iter().collect();
    let possible = values.iter().map(|(_, name, help)| {
        let value = PossibleValue::new(*name);
        if help.is_empty() { value } else { value.help(*help) }
    });
    PossibleValuesParser::new(possible).try_map(move |name| {
        // The parser before has refused all other names, so one is equal.
        let value = values.iter().find(|(_, value_name, _)| *value_name == name);
        value.map(|(value, ..)| value.clone()).ok_or("no such value")
    })
}

pub struct CommandContext {
    pub common: Common,
    context: Context<'static>,
    display: &'static CommandDisplay,
    pub outputs: Outputs,
}

/// Progress; `None` with --quiet.
#[derive(Default)]
struct CommandDisplay {
    meter: Mutex<Option<Meter>>,
    /// Notes already printed; each is printed once.
    told: Mutex<BTreeSet<String>>,
}

impl Common {
    pub fn start(self) -> Result<CommandContext> {
        let threads = self.threads.unwrap_or_else(process::threads);
        // rayon would take 0 for as many threads as there are cores.
        if threads == 0 || threads > 4096 {
            return Err(Error::argument(format!("--threads {threads} is outside 1 to 4096")));
        }
        parallel::set_threads(threads).map_err(|e| Error::argument(format!("--threads {threads}: {e}")))?;
        // For tests of determinism: plain code instead of vector instructions.
        let plain = std::env::var_os("PARTICLEGS_SIMD").is_some_and(|v| v == "off");
        let simd = if plain { Level::baseline() } else { Level::new() };
        process::meet_stop_signals();
        // A process creates one, or two if it opens the page after other work.
        let display: &'static CommandDisplay = Box::leak(Box::default());
        *lock(&display.meter) = (!self.quiet).then(Meter::start);
        let context = Context::SILENT
            .with_sink(display)
            .with_simd(simd)
            .with_memory(&memory::available_bytes)
            .with_cancel(&process::is_stopped);
        Ok(CommandContext { common: self, context, display, outputs: Outputs::new(false) })
    }
}

impl CommandContext {
    /// From now on a stop writes a checkpoint: signals after the first are ignored for some seconds.
    pub fn finishes_its_steps(&self) {
        process::keep_checkpoint();
    }

    /// Shows no more progress: the work continues until it is stopped.
    pub fn without_progress(self) -> Self {
        lock(&self.display.meter).take();
        self
    }

    /// Prints the result: JSON if requested, and the text on stdout, or on stderr if stdout has an output; with --quiet
    /// no text about written files.
    pub fn finish(&self, text: &str, value: &impl serde::Serialize) -> Result<()> {
        if let Some(target) = &self.common.json {
            self.aside(|| crate::report::json(target, value))?;
            if target == std::path::Path::new("-") {
                return Ok(());
            }
        }
        // A result that no file holds is printed even with --quiet.
        if self.common.quiet && !self.outputs.is_empty() {
            return Ok(());
        }
        self.line(&format!("{text}{}", self.names_files(text)))
    }

    /// Prints a line of the result on stdout, or on stderr if stdout has an output.
    pub fn line(&self, text: &str) -> Result<()> {
        if self.outputs.on_standard_output() {
            text.lines().for_each(|line| self.message(line));
            return Ok(());
        }
        self.aside(|| crate::report::line(text))
    }

    /// Hides the progress while `work` prints; it must not send messages.
    fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        match &*lock(&self.display.meter) {
            Some(meter) => meter.aside(print),
            None => print(),
        }
    }
}

impl Deref for CommandContext {
    type Target = Context<'static>;

    fn deref(&self) -> &Self::Target {
        &self.context
    }
}

impl Drop for CommandContext {
    /// Hides the progress.
    fn drop(&mut self) {
        lock(&self.display.meter).take();
    }
}

impl ProgressSink for CommandDisplay {
    fn event(&self, event: ProgressEvent<'_>) {
        let meter = lock(&self.meter);
        let Some(meter) = &*meter else { return };
        match event {
            ProgressEvent::Begin { phase, total } => meter.begin(&one_line(phase), total),
            ProgressEvent::Advance(steps) => meter.advance(steps),
            ProgressEvent::End => meter.end(),
            ProgressEvent::Log(_) => {}
        }
    }

    fn message(&self, text: &str) {
        let is_new = || lock(&self.told).insert(text.into());
        if text.starts_with("note: ") && !is_new() {
            return;
        }
        match &*lock(&self.meter) {
            Some(meter) => meter.message(&one_line(text)),
            // What a user must know even with --quiet.
            None if text.starts_with("warning: ") => to_stderr(&one_line(text)),
            None => {}
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

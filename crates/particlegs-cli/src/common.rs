//! Options that every command has, and what they set up.

use crate::printable::one_line;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Mutex};

/// Options of every command.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Common options")]
pub struct Common {
    /// Write the result as JSON to a file, or `-` for stdout (then nothing else is printed there).
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// No progress and no messages.
    #[arg(long, short)]
    pub quiet: bool,
    /// Threads (default: all cores). Results do not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Seed of everything drawn at random. Same input, same seed, same bytes.
    #[arg(long, value_name = "N", default_value_t = 42)]
    pub seed: u64,
}

static STOP: AtomicBool = AtomicBool::new(false);
/// Set by SIGUSR1, which batch systems send a while before they end a task.
static SOON: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// What a command runs with.
pub struct Context {
    /// The options.
    pub common: Common,
    bar: Mutex<Option<ProgressBar>>,
}

impl Common {
    /// Sets the threads and the stop signal up.
    pub fn start(self) -> Result<Context> {
        if let Some(threads) = self.threads {
            if threads == 0 || threads > 4096 {
                return Err(Error::argument(format!("--threads {threads} is outside 1 to 4096")));
            }
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build_global()
                .map_err(|e| Error::argument(format!("--threads {threads}: {e}")))?;
        }
        // The switch of the determinism tests: the plain path instead of vector instructions.
        if std::env::var_os("PARTICLEGS_SIMD").is_some_and(|v| v == "off") {
            particlegs::math::set_simd(false);
        }
        // A second signal ends the process at once; outputs are whole or absent either way.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
        #[cfg(unix)]
        let _ = signal_hook::flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&SOON));
        Ok(Context { common: self, bar: Mutex::new(None) })
    }
}

impl Context {
    /// Prints the result: JSON where asked for, else the text on stdout.
    pub fn finish(&self, text: &str, value: &impl serde::Serialize) -> Result<()> {
        if let Some(target) = &self.common.json {
            crate::report::json(target, value)?;
            if target == std::path::Path::new("-") {
                return Ok(());
            }
        }
        crate::report::line(text)
    }
}

impl Progress for Context {
    fn begin(&self, phase: &str, total: u64) {
        if self.common.quiet || !std::io::stderr().is_terminal() {
            return;
        }
        let bar = if total == 0 { ProgressBar::new_spinner() } else { ProgressBar::new(total) };
        let form = if total == 0 { "{msg} {spinner} {elapsed}" } else { "{msg:<28} {wide_bar} {percent:>3}% {eta}" };
        bar.set_style(ProgressStyle::with_template(form).unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(one_line(phase).into_owned());
        if let Some(old) = self.bar.lock().unwrap_or_else(|e| e.into_inner()).replace(bar) {
            old.finish_and_clear();
        }
    }

    fn advance(&self, steps: u64) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(|e| e.into_inner()).as_ref() {
            bar.inc(steps);
        }
    }

    fn end(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(|e| e.into_inner()).take() {
            bar.finish_and_clear();
        }
    }

    fn message(&self, text: &str) {
        if self.common.quiet {
            return;
        }
        let text = one_line(text);
        match self.bar.lock().unwrap_or_else(|e| e.into_inner()).as_ref() {
            Some(bar) => bar.suspend(|| eprintln!("{text}")),
            None => eprintln!("{text}"),
        }
    }

    fn cancelled(&self) -> bool {
        STOP.load(Ordering::SeqCst) || SOON.load(Ordering::SeqCst)
    }
}

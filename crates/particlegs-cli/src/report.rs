//! Prints results on stdout and everything else on stderr.

use crate::error_text;
use crate::progress::to_stderr;
use particlegs_core::Error;
use particlegs_core::text::{one_line, printable};
use particlegs_files::output::{json_text, write_json};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

pub fn failure(error: &Error) -> ExitCode {
    if matches!(error, Error::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe) {
        return ExitCode::SUCCESS;
    }
    to_stderr(&format!("error: {}", one_line(&error.to_string().replace('\n', " "))));
    let hint = error.hint();
    if !hint.is_empty() {
        to_stderr(&format!("hint: {}", one_line(&error_text::hint_text(&hint))));
    }
    ExitCode::from(error.code())
}

/// Prints a line of the result on stdout.
pub fn line(text: &str) -> particlegs_core::Result<()> {
    verbatim(&printable(text))
}

/// Prints text for another program on stdout, unchanged.
pub fn verbatim(line: &str) -> particlegs_core::Result<()> {
    whole(|| writeln!(std::io::stdout(), "{line}"))
}

pub fn text(bytes: &[u8]) -> particlegs_core::Result<()> {
    whole(|| std::io::stdout().write_all(bytes))
}

pub fn help(page: &clap::Error) -> particlegs_core::Result<()> {
    whole(|| page.print())
}

/// Writes to stdout and checks that all of it arrived.
fn whole(write: impl FnOnce() -> std::io::Result<()>) -> particlegs_core::Result<()> {
    write().and_then(|()| std::io::stdout().flush()).map_err(|e| Error::io("standard output", e))
}

/// Writes the result as JSON to a file, or to stdout for `-`.
pub fn json(target: &Path, value: &impl Serialize) -> particlegs_core::Result<()> {
    if target == Path::new("-") { text(json_text(value).as_bytes()) } else { write_json(target, value) }
}

//! What people and programs read: results on stdout, everything else on stderr.

use crate::printable::{one_line, printable, printable_json};
use particlegs::Error;
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// One line and a hint on stderr; the exit code of docs/guide/exit-codes.md.
pub fn failure(error: &Error) -> ExitCode {
    if matches!(error, Error::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe) {
        return ExitCode::SUCCESS;
    }
    eprintln!("error: {}", one_line(&error.to_string().replace('\n', " ")));
    if !error.hint().is_empty() {
        eprintln!("hint: {}", one_line(error.hint()));
    }
    ExitCode::from(error.exit_code())
}

/// A line of the result, on stdout.
pub fn line(text: &str) -> particlegs::Result<()> {
    writeln!(std::io::stdout(), "{}", printable(text)).map_err(|e| Error::io("standard output", e))
}

/// Text for another program, on stdout: as it is.
pub fn verbatim(text: &str) -> particlegs::Result<()> {
    writeln!(std::io::stdout(), "{text}").map_err(|e| Error::io("standard output", e))
}

/// The result as JSON: to a file, or to stdout for `-`.
pub fn json(target: &Path, value: &impl Serialize) -> particlegs::Result<()> {
    let text = serde_json::to_string_pretty(value).expect("results are plain data") + "\n";
    let text = printable_json(&text);
    if target == Path::new("-") {
        std::io::stdout().write_all(text.as_bytes()).map_err(|e| Error::io("standard output", e))
    } else {
        particlegs::output::write_bytes(target, text.as_bytes())
    }
}

//! Prints results on stdout and everything else on stderr, with texts wrapped for a terminal and hints in terms of the
//! command line.

use crate::progress::to_stderr;
use particlegs_core::text::{one_line, printable};
use particlegs_core::{Error, Hint};
use particlegs_files::output::{json_text, write_json};
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

pub fn failure(error: &Error) -> ExitCode {
    // A reader such as `head` has read what it wanted.
    if matches!(error, Error::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe) {
        return ExitCode::SUCCESS;
    }
    to_stderr(&format!("error: {}", one_line(&error.to_string().replace('\n', " "))));
    let hint = error.hint();
    if !hint.is_empty() {
        to_stderr(&format!("hint: {}", one_line(&hint_text(&hint))));
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
    // What stands behind the last line break would only be written at exit, where its error is lost.
    write().and_then(|()| std::io::stdout().flush()).map_err(|e| Error::io("standard output", e))
}

/// Writes the result as JSON to a file, or to stdout for `-`.
pub fn json(target: &Path, value: &impl Serialize) -> particlegs_core::Result<()> {
    if target == Path::new("-") { text(json_text(value).as_bytes()) } else { write_json(target, value) }
}

/// A hint in terms of the command line.
fn hint_text(hint: &Hint) -> String {
    let typed = |name: String, more: &str| format!("`{}`", [&name, more].join(" ").trim_end());
    hint.spell(|name, value| typed(format!("--{name}"), value), |name, more| typed(format!("particlegs {name}"), more))
}

/// Width of a terminal.
const COLUMNS: usize = 100;

/// `1 block`, `2 blocks`.
pub fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// `lead` and `text`, wrapped at spaces; further lines are indented by `indent` spaces.
pub fn wrapped(lead: &str, text: &str, indent: usize) -> String {
    let (mut out, mut column, mut empty) = (lead.to_string(), lead.chars().count(), true);
    for word in text.split(' ') {
        let width = word.chars().count();
        // A word that is wider than the terminal stands on its own, whole.
        if !empty && column + 1 + width > COLUMNS {
            out += &format!("\n{:indent$}", "");
            (column, empty) = (indent, true);
        }
        if !empty {
            out.push(' ');
            column += 1;
        }
        out += word;
        column += width;
        empty = false;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hints_name_the_options_that_help() {
        let fit = |broken| {
            let hint = Hint::from(if broken { "delete it and run " } else { "run " });
            hint.command("block", "job 3")
        };
        assert_eq!(hint_text(&fit(false)), "run `particlegs block job 3`");
        assert_eq!(hint_text(&fit(true)), "delete it and run `particlegs block job 3`");
        let frame = Hint::default().option("frame", 2).words(" reads the last whole frame");
        let both = Hint::from("look closer").and(frame);
        assert_eq!(hint_text(&both), "look closer; `--frame 2` reads the last whole frame");
        assert_eq!(hint_text(&Hint::default().and(Hint::state_box())), hint_text(&Hint::state_box()));
    }

    #[test]
    fn long_rows_are_wrapped_at_spaces() {
        let fields = (0..60).map(|i| format!("Field{i} f32[3]")).collect::<Vec<_>>().join(", ");
        let text = wrapped("  fields           ", &fields, 19);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() > 5 && lines.iter().all(|l| l.chars().count() <= COLUMNS));
        assert!(lines[1..].iter().all(|l| l.starts_with(&" ".repeat(19))));
        let words = text.split_whitespace().skip(1).collect::<Vec<_>>();
        assert_eq!(words, fields.split_whitespace().collect::<Vec<_>>());
        // What has no blank is left whole, and a short text as it is.
        let long = "x".repeat(200);
        assert_eq!([wrapped("", &long, 19), wrapped("", "a  b", 19)], [long, "a  b".to_string()]);
    }
}

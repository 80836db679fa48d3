//! The kinds of outputs, and the files that each may replace.

use super::kind::Kind;
use particlegs_core::codec;
use serde_json::Value;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Kind of an output; existing files of the same kind may be replaced.
const fn replaced(name: &'static str, is: fn(&Path, &[u8]) -> bool) -> Kind {
    Kind { name, kept: false, is }
}

/// A model file: kept without --force.
pub const MODEL: Kind = Kind { name: "a model file", kept: true, is: |_, head| codec::is_model(head) };

pub const PNG: Kind = replaced("a PNG", |_, head| head.starts_with(b"\x89PNG\r\n\x1a\n"));
pub const SVG: Kind =
    replaced("an SVG", |_, head| head.trim_ascii_start().starts_with(b"<svg") || head.windows(4).any(|w| w == b"<svg"));
pub const PDF: Kind = replaced("a PDF", |_, head| head.starts_with(b"%PDF-"));
pub const GIF: Kind = replaced("a GIF", |_, head| head.starts_with(b"GIF8"));
/// A catalogue of haloes, or a mass function.
pub const CSV: Kind = replaced("a table of haloes", |_, head| {
    [&b"id,parent_id,"[..], b"mass_low,mass_high,"].iter().any(|names| head.starts_with(names))
});
pub const HDF5: Kind = replaced("a catalogue of haloes", |_, head| {
    head.starts_with(b"\x89HDF\r\n\x1a\n") && head.windows(6).any(|w| w == b"Haloes")
});
/// In the container of ISO 14496-12.
pub const MP4: Kind = replaced("an MP4 film", |_, head| head.get(4..8).is_some_and(|b| b == b"ftyp"));
/// In the container of Matroska.
pub const WEBM: Kind = replaced("a WebM film", |_, head| head.starts_with(&[0x1a, 0x45, 0xdf, 0xa3]));

/// Results as JSON, but not the JSON of a snapshot or job.
pub const JSON: Kind = replaced("a result as JSON", |path, head| {
    let first = head.iter().find(|b| !b.is_ascii_whitespace());
    let describes = path.file_name().is_some_and(|n| n == "meta.json" || n == "plan.json");
    matches!(first, Some(b'{' | b'[')) && is_text(head) && !describes
});

/// The log of a training run, one JSON object per line.
pub const LOG: Kind = replaced("a log of JSON lines", |_, head| {
    let line = head.split(|b| *b == b'\n').next().unwrap_or_default();
    serde_json::from_slice::<Value>(line).is_ok_and(|v| v.is_object())
});

/// Surface density as raw values, with their description beside them.
pub const VALUES: Kind = replaced("raw values of a surface density", |path, _| {
    beginning(&path.with_extension("json")).is_some_and(|text| text.contains("\"surface density\""))
});

pub const PARTICLES: Kind = Kind { name: "a snapshot", kept: true, is: |_, _| true };

/// A file that may only replace an empty one.
pub(super) const UNKNOWN: Kind = replaced("made by this command", |_, _| false);

/// Whether the beginning of a file is text. It may end inside a character.
fn is_text(head: &[u8]) -> bool {
    std::str::from_utf8(head).map_or_else(|e| e.error_len().is_none(), |_| true)
}

/// The beginning of a file, as text.
fn beginning(path: &Path) -> Option<String> {
    let mut head = Vec::new();
    File::open(path).ok()?.take(4096).read_to_end(&mut head).ok()?;
    Some(String::from_utf8_lossy(&head).into_owned())
}

/// The kind of a result file, by its extension; tables also by their header.
pub(super) fn kind_of(place: &Path, staged: &Path) -> Kind {
    let same_head = || {
        let line = |path| Some(beginning(path)?.lines().next()?.to_string());
        // Tables of frames have columns for what a series has.
        let of_frames = |head: &str| head.starts_with("frame,kind,time,");
        line(place).zip(line(staged)).is_some_and(|(a, b)| a == b || of_frames(&a) && of_frames(&b))
    };
    match place.extension().and_then(|e| e.to_str()) {
        Some("png") => PNG,
        Some("svg") => SVG,
        Some("pdf") => PDF,
        Some("json") => JSON,
        Some("csv") if same_head() => Kind { is: |_, _| true, ..UNKNOWN },
        _ => UNKNOWN,
    }
}

//! Inputs and outputs of a command, declared before its work: the one place that decides what is replaced.

use crate::common::CommandContext;
use crate::text_wrap::wrapped;
use clap::Args;
use particlegs_core::{Error, Result, codec};
use particlegs_files::model_file;
use particlegs_files::output;
use particlegs_files::output::{FileSet, Input, Kind, Outputs};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Most files of a folder that are listed by name.
const MOST_NAMED: usize = 12;

#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceArgs {
    /// Replace an existing output, but no input and no file of another kind.
    #[arg(long, help_heading = None::<&'static str>, display_order = 900)]
    pub force: bool,
}

/// Kind of an output; existing files of the same kind may be replaced.
const fn replaced(name: &'static str, is: fn(&Path, &[u8]) -> bool) -> Kind {
    Kind { name, kept: false, is }
}

/// A model file: kept without --force.
const MODEL: Kind = Kind { name: "a model file", kept: true, is: |_, head| codec::is_model(head) };

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
const UNKNOWN: Kind = replaced("made by this command", |_, _| false);

/// Are two files, or all files of two folders, equal?
fn same_files(a: &Path, b: &Path) -> Result<bool> {
    let names = |folder: &Path| -> std::io::Result<BTreeSet<OsString>> {
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
    };
    let read = || -> std::io::Result<bool> {
        if !a.is_dir() {
            return same_bytes(a, b);
        }
        let of_a = names(a)?;
        let same = of_a.iter().map(|n| same_bytes(&a.join(n), &b.join(n))).collect::<std::io::Result<Vec<_>>>()?;
        Ok(of_a == names(b)? && same.iter().all(|s| *s))
    };
    read().map_err(|e| Error::io(b, e))
}

fn same_bytes(a: &Path, b: &Path) -> std::io::Result<bool> {
    let (mut a, mut b) = (File::open(a)?, File::open(b)?);
    let (mut of_a, mut of_b) = (vec![0; 1 << 20], vec![0; 1 << 20]);
    if a.metadata()?.len() != b.metadata()?.len() {
        return Ok(false);
    }
    loop {
        let n = a.read(&mut of_a)?;
        b.read_exact(&mut of_b[..n])?;
        if n == 0 || of_a[..n] != of_b[..n] {
            return Ok(n == 0);
        }
    }
}

/// Is the beginning of a file text? It may end inside a character.
fn is_text(head: &[u8]) -> bool {
    std::str::from_utf8(head).map_or_else(|e| e.error_len().is_none(), |_| true)
}

/// The beginning of a file, as text.
fn beginning(path: &Path) -> Option<String> {
    let mut head = Vec::new();
    File::open(path).ok()?.take(4096).read_to_end(&mut head).ok()?;
    Some(String::from_utf8_lossy(&head).into_owned())
}

impl CommandContext {
    /// Declares the `inputs` of a command and its first output, `--json`; `force` replaces kept outputs.
    pub fn reads<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>, force: bool) -> Result<()> {
        let inputs = inputs.into_iter().map(|path| Input::Data(path.to_path_buf()));
        self.plan(Outputs::new(force), inputs)
    }

    /// [`CommandContext::reads`] for a job folder and its snapshot.
    pub fn reads_job(&self, job: &Path, snapshot: &[PathBuf], force: bool) -> Result<()> {
        let inputs = snapshot.iter().map(|path| Input::Data(path.clone()));
        self.plan(Outputs::new(force), inputs.chain([Input::Whole(job.to_path_buf())]))
    }

    fn plan(&self, mut outputs: Outputs, inputs: impl Iterator<Item = Input>) -> Result<()> {
        inputs.for_each(|input| outputs.reads(input));
        if let Some(path) = &self.common.json {
            outputs.writes(path, &JSON, self)?;
            self.files().push(path.clone());
        }
        *self.outputs() = outputs;
        Ok(())
    }

    /// Declares an output; returns whether it exists and is kept ([`Outputs::writes`]).
    pub fn writes(&self, path: &Path, kind: &Kind) -> Result<bool> {
        let kept = self.outputs().writes(path, kind, self)?;
        self.files().push(path.to_path_buf());
        Ok(kept)
    }

    /// One line per folder with written files that `text` does not mention.
    pub fn names_files(&self, text: &str) -> String {
        let mut folders: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
        for path in self.files().iter().filter(|p| p.is_file() && !text.contains(&p.display().to_string())) {
            folders.entry(path.parent().unwrap_or(Path::new("")).into()).or_default().push(path.clone());
        }
        let line = |files: &Vec<PathBuf>| match &files[..] {
            [first, .., last] if files.len() > MOST_NAMED => {
                format!("\nwrote {} files, {} to {}", files.len(), first.display(), last.display())
            }
            files => {
                let names: Vec<String> = files.iter().map(|p| p.display().to_string()).collect();
                format!("\n{}", wrapped("wrote ", &names.join(", "), 6))
            }
        };
        folders.values().map(line).collect()
    }

    /// Declares a model file; returns whether it exists and is kept.
    pub fn writes_model(&self, path: &Path) -> Result<bool> {
        let kept = self.writes(path, &MODEL)?;
        model_file::check_name(path).map(|()| kept)
    }

    /// Declares an output; refuses an existing file that is kept.
    pub fn writes_new(&self, path: &Path, kind: &Kind) -> Result<()> {
        if self.writes(path, kind)? { Err(self.refused(path)) } else { Ok(()) }
    }

    pub fn refused(&self, path: &Path) -> Error {
        self.outputs().refused(path)
    }

    /// Creates a folder for outputs; it is removed again if it stays empty.
    pub fn makes_folder(&self, folder: &Path) -> Result<()> {
        self.outputs().make_folder(folder)
    }

    /// Reports the number of complete pictures if a command ends early.
    pub fn count_pictures<T>(&self, folder: &Path, done: usize, all: usize, outcome: Result<T>) -> Result<T> {
        if outcome.is_err() && done > 0 {
            self.message(&format!("{done} of {all} pictures are complete, in {}", folder.display()));
        }
        outcome
    }

    fn same_or_refused(&self, path: &Path, same: bool) -> Result<()> {
        if !same {
            return Err(self.refused(path));
        }
        self.message(&format!("{}: already exists and is the same", path.display()));
        Ok(())
    }

    /// Writes a model file; a `kept` one is only compared.
    pub fn write_model(&self, path: &Path, bytes: &[u8], kept: bool) -> Result<()> {
        if !kept {
            return output::write_bytes(path, bytes);
        }
        let there = crate::inputs::model(path, self)?;
        self.same_or_refused(path, there == bytes)
    }

    /// Writes a snapshot; a `kept` one is only compared, with one written beside it.
    pub fn write_snapshot(&self, path: &Path, kept: bool, write: impl FnOnce(&Path) -> Result<u64>) -> Result<u64> {
        if !kept {
            return write(path);
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // The unfinished set is removed.
        let set = FileSet::in_folder(folder)?;
        let again = set.path().join(path.file_name().unwrap_or("snapshot".as_ref()));
        let bytes = write(&again)?;
        self.same_or_refused(path, same_files(&again, path)?).map(|()| bytes)
    }

    /// Writes a file and its description, both or neither; `kept` ones are only compared.
    pub fn write_described(
        &self,
        path: &Path,
        (beside, description): (&Path, &[u8]),
        kept: bool,
        write: impl FnOnce(&Path) -> Result<u64>,
    ) -> Result<u64> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let set = FileSet::in_folder(folder)?;
        let staged = |place: &Path| set.path().join(place.file_name().unwrap_or("file".as_ref()));
        let bytes = write(&staged(path))?;
        output::write_bytes(&staged(beside), description)?;
        if !kept {
            return set.finish().map(|_| bytes);
        }
        if !(beside.exists() && same_files(&staged(beside), beside)?) {
            return Err(self.refused(beside));
        }
        self.same_or_refused(path, path.exists() && same_files(&staged(path), path)?).map(|()| bytes)
    }

    /// Writes several files into `folder`, all or none; returns their paths.
    pub fn write_set(&self, folder: &Path, fill: impl FnOnce(&Path) -> Result<()>) -> Result<Vec<PathBuf>> {
        self.makes_folder(folder)?;
        let set = FileSet::in_folder(folder)?;
        fill(set.path())?;
        for place in set.places()? {
            let staged = set.path().join(place.file_name().unwrap_or_default());
            self.writes(&place, &kind_of(&place, &staged))?;
        }
        set.finish()
    }
}

/// The kind of a result file, by its extension; tables also by their header.
fn kind_of(place: &Path, staged: &Path) -> Kind {
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

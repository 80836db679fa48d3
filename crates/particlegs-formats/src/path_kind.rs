//! Kinds of files that a path may name, in words, so that the wrong kind of input can name the right command.

use crate::format::{FileHead, Format};
use crate::registry::format_of;
use particlegs_compress::job::JobFolder;
use particlegs_core::{Hint, codec};
use particlegs_files::input::is_stream;
use std::path::Path;

/// The kind of file that a path names.
#[derive(Clone, Copy)]
pub enum PathKind {
    /// A model file.
    Model,
    /// A job's folder.
    Job,
    /// A file inside a job's folder.
    JobFile,
    /// A snapshot's file.
    Snapshot(&'static Format),
    /// A folder with raw columns.
    RawFolder,
    /// Another folder.
    Folder,
    /// A PNG.
    Picture,
    /// A JSON object, such as a views file.
    Json,
    /// A pipe or device: looking would take its data.
    Stream,
    /// A file that begins as nothing known.
    Unknown,
}

/// Beginnings of files that are no snapshots.
const MAGICS: [(&[u8], PathKind); 4] = [
    (b"PGSCKPT", PathKind::JobFile),
    (b"PGSRUNS", PathKind::JobFile),
    (b"PGSCHNK", PathKind::JobFile),
    (b"\x89PNG\r\n\x1a\n", PathKind::Picture),
];

impl PathKind {
    /// Looks at the names in a folder or the first bytes of a file; unreadable paths have no known kind.
    pub fn from_path(path: &Path) -> PathKind {
        match () {
            _ if is_stream(path) => PathKind::Stream,
            _ if path.is_dir() && JobFolder::is_job(path) => PathKind::Job,
            _ if path.join("xx.f32").exists() => PathKind::RawFolder,
            _ if path.is_dir() => PathKind::Folder,
            _ => FileHead::read(path).map_or(PathKind::Unknown, |head| PathKind::from_head(&head)),
        }
    }

    /// By a file's beginning.
    pub(crate) fn from_head(head: &FileHead) -> PathKind {
        if codec::is_model(&head.bytes) {
            return PathKind::Model;
        }
        if let Some((_, kind)) = MAGICS.iter().find(|m| head.bytes.starts_with(m.0)) {
            return *kind;
        }
        if head.bytes.trim_ascii_start().starts_with(b"{") {
            return PathKind::Json;
        }
        format_of(head).map_or(PathKind::Unknown, PathKind::Snapshot)
    }

    /// Its title, with an article; `None` where it is not known.
    pub fn describe(self) -> Option<String> {
        Some(match self {
            PathKind::Model => "a model file".into(),
            PathKind::Job => "a job folder".into(),
            PathKind::JobFile => "a file of a job folder or a checkpoint".into(),
            PathKind::Snapshot(format) => format!("a snapshot ({})", format.title),
            PathKind::RawFolder => "a snapshot (raw float32 columns)".into(),
            PathKind::Folder => "a folder".into(),
            PathKind::Picture => "a picture (PNG)".into(),
            PathKind::Json => "a JSON file".into(),
            PathKind::Stream | PathKind::Unknown => return None,
        })
    }

    /// The hint where a model file is wanted.
    pub fn to_a_model(self) -> Hint {
        match self {
            PathKind::Snapshot(_) | PathKind::RawFolder => {
                Hint::default().command("compress", "").words(" makes a model of it")
            }
            PathKind::Job => {
                let hint = Hint::default().command("merge", "").words(" makes the model of it; ");
                hint.command("status", "").words(" shows its progress")
            }
            PathKind::JobFile => Hint::default().command("merge", "").words(" makes a model of the job folder"),
            _ => Hint::from("name a model file from ").command("compress", ""),
        }
    }

    /// The hint where a snapshot is wanted.
    pub fn to_a_snapshot(self) -> Hint {
        match self {
            PathKind::Model => {
                let hint = Hint::default().command("recover", "").words(" draws particles from it; ");
                hint.command("render", "").words(" draws pictures of it")
            }
            PathKind::Job => self.to_a_model(),
            PathKind::JobFile => "name the snapshot that the job was planned for".into(),
            _ => "name a snapshot; docs/guide/formats.md lists the formats".into(),
        }
    }
}

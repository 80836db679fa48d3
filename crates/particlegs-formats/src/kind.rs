//! What a path names, in words, so that the wrong kind of input can name the right command.

use crate::Format;
use crate::registry::{Head, format_of};
use particlegs::Remedy;
use particlegs::codec;
use particlegs::job::Job;
use particlegs_files::input::is_stream;
use std::path::Path;

/// What a path names.
#[derive(Clone, Copy)]
pub enum Kind {
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
const MAGICS: [(&[u8], Kind); 4] = [
    (b"PGSCKPT", Kind::JobFile),
    (b"PGSRUNS", Kind::JobFile),
    (b"PGSCHNK", Kind::JobFile),
    (b"\x89PNG\r\n\x1a\n", Kind::Picture),
];

impl Kind {
    /// Looks at a folder's names or a file's first bytes; what cannot be read is of no known kind.
    pub fn of(path: &Path) -> Kind {
        match () {
            _ if is_stream(path) => Kind::Stream,
            _ if path.is_dir() && Job::is_job(path) => Kind::Job,
            _ if path.join("xx.f32").exists() => Kind::RawFolder,
            _ if path.is_dir() => Kind::Folder,
            _ => Head::read(path).map_or(Kind::Unknown, |head| Kind::of_head(&head)),
        }
    }

    /// By a file's beginning.
    pub(crate) fn of_head(head: &Head) -> Kind {
        if codec::is_model(&head.bytes) {
            return Kind::Model;
        }
        if let Some((_, kind)) = MAGICS.iter().find(|m| head.bytes.starts_with(m.0)) {
            return *kind;
        }
        if head.bytes.trim_ascii_start().starts_with(b"{") {
            return Kind::Json;
        }
        format_of(head).map_or(Kind::Unknown, Kind::Snapshot)
    }

    /// What it is, with its article; `None` where that is not known.
    pub fn in_words(self) -> Option<String> {
        Some(match self {
            Kind::Model => "a model file".into(),
            Kind::Job => "a job's folder".into(),
            Kind::JobFile => "a file of a job or a checkpoint".into(),
            Kind::Snapshot(format) => format!("a snapshot ({})", format.title),
            Kind::RawFolder => "a snapshot (raw float32 columns)".into(),
            Kind::Folder => "a folder".into(),
            Kind::Picture => "a picture (PNG)".into(),
            Kind::Json => "a JSON file".into(),
            Kind::Stream | Kind::Unknown => return None,
        })
    }

    /// What to do with it where a model file is wanted.
    pub fn to_a_model(self) -> Remedy {
        match self {
            Kind::Snapshot(_) | Kind::RawFolder => Remedy::IsSnapshot,
            Kind::Job => Remedy::IsJob,
            Kind::JobFile => Remedy::IsFileOfJob,
            _ => Remedy::NameModel,
        }
    }

    /// What to do with it where a snapshot is wanted.
    pub fn to_a_snapshot(self) -> Remedy {
        match self {
            Kind::Model => Remedy::IsModel,
            Kind::Job => Remedy::IsJob,
            Kind::JobFile => "name the snapshot that the job was planned for".into(),
            _ => "name a snapshot; docs/guide/formats.md lists what is read".into(),
        }
    }
}

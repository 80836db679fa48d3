//! Reads inputs: a model, or either a model or a snapshot.

use crate::printable::one_line;
use crate::progress::to_stderr;
use crate::snapshot_args::SnapshotArgs;
use particlegs_files::input::{Source, is_stream, name_of};
use particlegs_formats::{Choice, PathKind};
use particlegs_pipeline::context::{Context, ProgressSink};
use particlegs_pipeline::{Error, Result, codec};
use std::path::Path;

pub enum PathContent {
    Model(Vec<u8>),
    Snapshot(Box<Choice>),
}

const HEAD: usize = 8;

/// A model file's bytes; `-` is standard input.
pub fn model(path: &Path, context: &Context<'_>) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(no_model(path));
    }
    let mut source = Source::open(path, context)?;
    if !codec::is_model(source.peek(HEAD)?) && PathKind::from_path(path).describe().is_some() {
        return Err(no_model(path));
    }
    codec::read_source(source, &name_of(path))
}

fn no_model(path: &Path) -> Error {
    let kind = PathKind::from_path(path);
    let what = format!("{}, not a model file", kind.describe().unwrap_or_default());
    Error::input_with(path, what, kind.to_a_model())
}

/// A model or a snapshot. A pipe is read only once.
pub fn model_or_snapshot(path: &Path, opening: &SnapshotArgs, context: &Context<'_>) -> Result<PathContent> {
    let mut choice = opening.choice()?;
    if path.is_dir() {
        return Ok(PathContent::Snapshot(choice.into()));
    }
    let mut source = Source::open(path, context)?;
    if codec::is_model(source.peek(HEAD)?) {
        return Ok(PathContent::Model(codec::read_source(source, &name_of(path))?));
    }
    if is_stream(path) {
        choice.spool(source)?;
    }
    Ok(PathContent::Snapshot(choice.into()))
}

/// Prints what the command waits for before its progress is shown.
pub struct WaitNotice;

impl ProgressSink for WaitNotice {
    fn message(&self, text: &str) {
        to_stderr(&one_line(text));
    }
}

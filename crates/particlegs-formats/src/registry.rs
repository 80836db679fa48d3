//! Which format a file has: by its content, or by name.

use crate::compressed::FileCompression;
use crate::foreign::foreign_of;
use crate::{Choice, PathKind, Snapshot};
use particlegs::{Error, Hint, Result};
use particlegs_files::input::{Source, SpoolFile, open_file};
use std::io::Read;
use std::path::{Path, PathBuf};

/// A format that is read.
pub struct Format {
    /// Name for `--format`.
    pub name: &'static str,
    /// What it is called among people.
    pub title: &'static str,
    /// Does a file that begins so have it? Formats are asked in the order of [`FORMATS`].
    pub(crate) detect: fn(&FileHead) -> bool,
    /// Opens files, the first of which has it.
    pub(crate) open: fn(&[PathBuf], &Choice) -> Result<Box<dyn Snapshot>>,
}

/// All formats, the surest signatures first, tables of text last.
pub(crate) static FORMATS: &[Format] = &[
    crate::hdf5::FORMAT,
    crate::genericio::FORMAT,
    crate::npy::FORMAT,
    crate::npz::FORMAT,
    crate::ply::FORMAT,
    crate::vtk_legacy::FORMAT,
    crate::vtk_xml::FORMAT,
    crate::splats::GLB,
    crate::splats::SPZ,
    crate::gadget::FORMAT,
    crate::lammps::FORMAT,
    crate::xyz::FORMAT,
    crate::splats::SPLAT,
    crate::csv::FORMAT,
];

/// The beginning of a file.
pub(crate) struct FileHead {
    /// The file.
    pub path: PathBuf,
    /// Its length in bytes.
    pub length: u64,
    /// How it is compressed.
    pub compression: Option<FileCompression>,
    /// Its first bytes as they are, at most 64 KiB.
    pub bytes: Vec<u8>,
    /// Its first bytes, decompressed where it is compressed, at most 64 KiB.
    pub content: Vec<u8>,
}

/// Bytes that detection looks at.
const HEAD: usize = 1 << 16;
/// Bytes of a compressed file that detection reads: a block of bzip2 is whole in fewer.
const LOOKED_AT: usize = 2 << 20;

impl FileHead {
    /// Reads it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for what is no file, and for an empty one.
    pub fn read(path: &Path) -> Result<FileHead> {
        let fail = |e| Error::io(path, e);
        let (mut file, length) = open_file(path)?;
        let mut bytes = Vec::new();
        (&mut file).take(HEAD as u64).read_to_end(&mut bytes).map_err(fail)?;
        if FileCompression::of(&bytes).is_some() {
            file.take((LOOKED_AT - HEAD) as u64).read_to_end(&mut bytes).map_err(fail)?;
        }
        FileHead::of(path, length, bytes)
    }

    /// Of a file's first bytes, at most 2 MiB; `path` is how messages name it.
    ///
    /// # Errors
    /// [`Error::Input`] for an empty file.
    pub fn of(path: &Path, length: u64, mut bytes: Vec<u8>) -> Result<FileHead> {
        if bytes.is_empty() {
            return Err(Error::input(path, "the file is empty"));
        }
        let compression = FileCompression::of(&bytes);
        let content = compression.map(|c| decompressed(&bytes, c));
        bytes.truncate(HEAD);
        let content = content.unwrap_or_else(|| bytes.clone());
        Ok(FileHead { path: path.to_path_buf(), length, compression, bytes, content })
    }
}

/// As much as the first bytes give; a broken stream is found when it is read.
fn decompressed(bytes: &[u8], compression: FileCompression) -> Vec<u8> {
    let mut content = Vec::new();
    if let Ok(decoder) = compression.decoder(std::io::Cursor::new(bytes.to_vec())) {
        let _ = decoder.take(HEAD as u64).read_to_end(&mut content);
    }
    content
}

/// Keeps what a pipe or device gives, once its first bytes are those of a snapshot.
pub(crate) fn spool(mut source: Source<'_>, options: &Choice) -> Result<SpoolFile> {
    let bytes = source.peek(LOOKED_AT)?.to_vec();
    let head = FileHead::of(Path::new(source.place()), u64::MAX, bytes)?;
    match &options.format {
        None => known(&head).map(drop)?,
        // Not all of an endless device for a format that it is not in; a table may begin with anything.
        Some(name) if head.content.contains(&0) && !(named(name)?.detect)(&head) => {
            return Err(Error::input(source.place(), format!("does not begin as a file of the format `{name}` does")));
        }
        Some(_) => {}
    }
    SpoolFile::of(source)
}

/// The format of a file, by its content.
pub(crate) fn detect(path: &Path) -> Result<&'static Format> {
    known(&FileHead::read(path)?)
}

fn known(head: &FileHead) -> Result<&'static Format> {
    let path = &head.path;
    match PathKind::of_head(head) {
        PathKind::Snapshot(format) => Ok(format),
        PathKind::Unknown => Err(match foreign_of(head) {
            Some(foreign) => {
                Error::input_with(path, format!("{}, which is not read", foreign.title), foreign.hint(path))
            }
            None => {
                let hint = Hint::default().option("format", "").words(format!(" forces one of: {}", names()));
                Error::input_with(path, "not in a format that this program knows", hint)
            }
        }),
        other => {
            let what = format!("{}, not a snapshot", other.in_words().unwrap_or_default());
            Err(Error::input_with(path, what, other.to_a_snapshot()))
        }
    }
}

/// The first format that takes a file to be its own.
pub(crate) fn format_of(head: &FileHead) -> Option<&'static Format> {
    FORMATS.iter().find(|f| (f.detect)(head))
}

/// The format of that name.
pub(crate) fn named(name: &str) -> Result<&'static Format> {
    let unknown = || Error::argument(format!("format `{name}` is not one of: {}", names()));
    FORMATS.iter().find(|f| f.name == name).ok_or_else(unknown)
}

/// All names, for messages.
fn names() -> String {
    FORMATS.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")
}

impl Choice {
    /// Opens the files of one snapshot. Formats in several files need the first alone and find the rest.
    ///
    /// # Errors
    /// [`Error::Input`] for an unknown or broken format; [`Error::Argument`] for an unknown name;
    /// [`Error::Io`].
    pub fn open(&self, paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
        let first = paths.first().ok_or_else(|| Error::argument("no file was named"))?;
        let format = match &self.format {
            None => detect(first)?,
            Some(name) => named(name)?,
        };
        self.fits(format.name, &first.display().to_string())?;
        (format.open)(paths, self)
    }

    /// Refuses what is chosen and means nothing in a format.
    pub(crate) fn fits(&self, format: &str, place: &str) -> Result<()> {
        if !self.blocks.is_empty() && format != crate::gadget::FORMAT.name {
            return Err(Error::input(place, "only Gadget files of format 1 have blocks to name"));
        }
        if self.keep_unwrapped && ![crate::lammps::FORMAT.name, crate::xyz::FORMAT.name].contains(&format) {
            return Err(Error::input(place, "it is not a trajectory, so it has no unwrapped positions"));
        }
        Ok(())
    }
}

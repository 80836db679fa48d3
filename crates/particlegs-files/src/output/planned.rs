//! Writes what [`Outputs`] planned: kept files are compared instead.

use super::kinds::{MODEL, kind_of};
use super::place::folder_of;
use super::{FileSet, Kind, Outputs, write_bytes};
use crate::context::Context;
use crate::{Error, Result, model_file};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

impl Outputs {
    /// Declares a model file; returns whether it exists and is kept.
    pub fn writes_model(&self, path: &Path, context: &Context<'_>) -> Result<bool> {
        let is_kept = self.writes(path, &MODEL, context)?;
        model_file::check_name(path).map(|()| is_kept)
    }

    /// Declares an output; refuses an existing file that is kept.
    pub fn writes_new(&self, path: &Path, kind: &Kind, context: &Context<'_>) -> Result<()> {
        if self.writes(path, kind, context)? { Err(self.refused(path)) } else { Ok(()) }
    }

    /// Declares a model file, unless it was declared before; returns whether it exists and is kept.
    pub fn declare_model(&self, path: &Path, context: &Context<'_>) -> Result<bool> {
        if self.is_declared(path, Some(&MODEL)) { Ok(self.is_kept(path)) } else { self.writes_model(path, context) }
    }

    /// Writes a declared model file; a kept one is only compared.
    pub fn write_model(&self, path: &Path, bytes: &[u8], context: &Context<'_>) -> Result<()> {
        if !self.is_kept(path) {
            return write_bytes(path, bytes);
        }
        let existing = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        self.same_or_refused(path, existing == bytes, context)
    }

    /// Writes a declared file or folder; a kept one is only compared, with one written beside it.
    pub fn write_file(
        &self,
        path: &Path,
        write: impl FnOnce(&Path) -> Result<u64>,
        context: &Context<'_>,
    ) -> Result<u64> {
        if !self.is_kept(path) {
            return write(path);
        }
        // The unfinished set is removed.
        let set = FileSet::in_folder(folder_of(path))?;
        let again = set.path().join(path.file_name().unwrap_or("snapshot".as_ref()));
        let bytes = write(&again)?;
        self.same_or_refused(path, same_files(&again, path)?, context).map(|()| bytes)
    }

    /// Writes a file and its description, both or neither; kept ones are only compared.
    pub fn write_described(
        &self,
        path: &Path,
        (beside, description): (&Path, &[u8]),
        write: impl FnOnce(&Path) -> Result<u64>,
        context: &Context<'_>,
    ) -> Result<u64> {
        let set = FileSet::in_folder(folder_of(path))?;
        let staged = |place: &Path| set.path().join(place.file_name().unwrap_or("file".as_ref()));
        let bytes = write(&staged(path))?;
        write_bytes(&staged(beside), description)?;
        if !(self.is_kept(path) || self.is_kept(beside)) {
            return set.finish().map(|_| bytes);
        }
        if !(beside.exists() && same_files(&staged(beside), beside)?) {
            return Err(self.refused(beside));
        }
        let same = path.exists() && same_files(&staged(path), path)?;
        self.same_or_refused(path, same, context).map(|()| bytes)
    }

    /// Writes several files into `folder`, all or none; returns their paths.
    pub fn write_set(
        &self,
        folder: &Path,
        fill: impl FnOnce(&Path) -> Result<()>,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        self.make_folder(folder)?;
        let set = FileSet::in_folder(folder)?;
        fill(set.path())?;
        // The names are not known before the files are written.
        for place in set.places()? {
            let staged = set.path().join(place.file_name().unwrap_or_default());
            self.writes(&place, &kind_of(&place, &staged), context)?;
        }
        set.finish()
    }

    fn same_or_refused(&self, path: &Path, same: bool, context: &Context<'_>) -> Result<()> {
        if !same {
            return Err(self.refused(path));
        }
        context.message(&format!("{}: already exists and is the same", path.display()));
        Ok(())
    }
}

/// Whether two files, or all files of two folders, are equal.
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

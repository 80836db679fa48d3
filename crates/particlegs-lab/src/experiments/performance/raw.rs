//! Raw float32 files for child processes: the snapshot's positions, and parts and copies of them.

use crate::lab::Lab;
use crate::snapshot::Snapshot;
use particlegs_core::Result;
use particlegs_files::output::FileSet;
use particlegs_particles::{RawForm, SelectedParticles, Selection, Tiling};
use std::cell::OnceCell;
use std::path::{Path, PathBuf};

/// Temporary folder; files are written on demand.
pub(super) struct RawCopy<'a> {
    lab: &'a Lab<'a>,
    of: &'a Snapshot,
    set: OnceCell<FileSet>,
}

impl<'a> RawCopy<'a> {
    pub fn new(lab: &'a Lab<'a>, snapshot: &'a Snapshot) -> RawCopy<'a> {
        RawCopy { lab, of: snapshot, set: OnceCell::new() }
    }

    pub fn folder(&self) -> Result<&Path> {
        if self.set.get().is_none() {
            let _ = self.set.set(self.lab.store.scratch()?);
        }
        Ok(self.set.get().map_or(Path::new(""), FileSet::path))
    }

    pub fn snapshot(&self) -> Result<PathBuf> {
        self.written("all", Tiling::single(), Selection::all())
    }

    /// A selection of the tiled snapshot, written to a folder of this name.
    pub fn written(&self, name: &str, tiling: Tiling, selection: Selection) -> Result<PathBuf> {
        let path = self.folder()?.join(name);
        if !path.exists() {
            let particles = SelectedParticles::new(&self.of.particles, tiling, selection, self.lab.context)?;
            particles.write_raw(&path, RawForm::Columns, self.lab.context)?;
        }
        Ok(path)
    }
}

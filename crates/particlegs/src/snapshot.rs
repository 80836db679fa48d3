//! A snapshot as a user names it.

use crate::camera::View;
use crate::{Choice, Context, Description, Error, Gray8, Particles, Result, Selection, Size, Storage, ToneStyle};
use particlegs_pipeline::reference::Reference;
use std::path::{Path, PathBuf};

/// Particles in files of any format that is read (docs/guide/formats.md), or in memory.
#[derive(Clone)]
pub struct Snapshot(SnapshotSource);

#[derive(Clone)]
enum SnapshotSource {
    Files { paths: Vec<PathBuf>, choice: Box<Choice> },
    Memory(Box<Particles>),
}

impl Snapshot {
    /// Names a file, or a folder of raw columns; the format is found by the content.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Input`] where it cannot be read, or is no snapshot.
    pub fn open(path: impl AsRef<Path>) -> Result<Snapshot> {
        Snapshot::open_with(&[path.as_ref().to_path_buf()], Choice::default())
    }

    /// Names the files of one snapshot, and what is read of them and how.
    ///
    /// # Errors
    /// As [`Snapshot::open`].
    pub fn open_with(paths: &[PathBuf], choice: Choice) -> Result<Snapshot> {
        choice.describe(paths, false, &Context::default())?;
        Ok(Snapshot(SnapshotSource::Files { paths: paths.to_vec(), choice: choice.into() }))
    }

    /// Positions in columns of float32, in any unit of length.
    pub fn from_columns(x: impl Into<Vec<f32>>, y: impl Into<Vec<f32>>, z: impl Into<Vec<f32>>) -> Snapshot {
        Snapshot::from(Particles::from_columns(x.into(), y.into(), z.into()))
    }

    /// Reads one species alone, by its name, number or alias; called again, that one as well.
    #[must_use]
    pub fn species(mut self, name: &str) -> Snapshot {
        if let SnapshotSource::Files { choice, .. } = &mut self.0 {
            choice.species.push(name.into());
        }
        self
    }

    /// Keeps a part: a region, every n-th particle, a random sample.
    #[must_use]
    pub fn select(mut self, selection: Selection) -> Snapshot {
        if let SnapshotSource::Files { choice, .. } = &mut self.0 {
            choice.selection = Some(selection);
        }
        self
    }

    /// What the files say of themselves; of particles in memory, an error.
    ///
    /// # Errors
    /// [`Error::Argument`] for particles in memory; those of reading.
    pub fn describe(&self, context: &Context<'_>) -> Result<Description> {
        match &self.0 {
            SnapshotSource::Files { paths, choice } => Ok(choice.describe(paths, false, context)?.0),
            SnapshotSource::Memory(_) => Err(Error::argument("particles in memory have no files to describe")),
        }
    }

    /// Reads the particles: mapped where they lie in their file as they are used, else in memory.
    ///
    /// # Errors
    /// [`Error::Input`] for a species that there is not, and invalid values; [`Error::Memory`]; [`Error::Cancelled`].
    pub fn particles(&self, context: &Context<'_>) -> Result<Particles> {
        match &self.0 {
            SnapshotSource::Files { paths, choice } => choice.read(paths, &Storage::Memory, context),
            SnapshotSource::Memory(particles) => Ok((**particles).clone()),
        }
    }

    /// Draws all particles, as ParaView's point Gaussians, to the last level.
    ///
    /// # Errors
    /// [`Error::Argument`] for a view out of range; [`Error::Memory`]; [`Error::Cancelled`]; those of reading.
    pub fn render(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8> {
        let particles = self.particles(context)?;
        Reference::new(&particles).draw(view, size, ToneStyle::Paraview, context)
    }

    /// As a model's recipe says what was read.
    pub(crate) fn options(&self) -> std::collections::BTreeMap<String, String> {
        match &self.0 {
            SnapshotSource::Files { choice, .. } => choice.options(),
            SnapshotSource::Memory(_) => Default::default(),
        }
    }
}

impl From<Particles> for Snapshot {
    fn from(particles: Particles) -> Snapshot {
        Snapshot(SnapshotSource::Memory(particles.into()))
    }
}

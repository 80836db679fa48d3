//! A snapshot as a user names it.

use crate::camera::View;
use crate::{Choice, Context, Description, Error, Gray8, Particles, Result, Selection, Size, Storage, ToneStyle};
use particlegs_files::input::{is_stream, name_of};
use particlegs_files::output::{Input, Outputs};
use particlegs_particles::LayerFields;
use particlegs_reference::Reference;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Particles in files of any format that is read (docs/guide/formats.md), or in memory.
#[derive(Clone)]
pub struct Snapshot {
    source: SnapshotSource,
    choice: Choice,
}

/// The files of a snapshot, and what is read of them and how; `plan.json` of a job holds it.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct SnapshotFiles {
    pub paths: Vec<PathBuf>,
    #[serde(flatten)]
    pub choice: Choice,
}

impl SnapshotFiles {
    /// With absolute paths, since tasks of a job may run in other folders.
    pub fn for_tasks(mut self) -> Result<SnapshotFiles> {
        for path in self.paths.iter_mut().chain(&mut self.choice.topology) {
            if is_stream(path) {
                let message = "a pipe or device, but every task of a job reads it again";
                return Err(Error::input_with(name_of(path), message, "write the data to a file first"));
            }
            *path = std::fs::canonicalize(&*path).map_err(|e| Error::io(&*path, e))?;
            if path.to_str().is_none() {
                let message = format!("{}: a job needs a path in UTF-8, because plan.json stores it", path.display());
                return Err(Error::argument(message));
            }
        }
        Ok(self)
    }

    pub fn read(
        &self,
        storage: &Storage,
        with_fields: bool,
        context: &Context<'_>,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        match with_fields {
            true => self.choice.clone().read_fields(&self.paths, storage, context),
            false => Ok((self.choice.read(&self.paths, storage, context)?, Vec::new())),
        }
    }
}

#[derive(Clone)]
enum SnapshotSource {
    Files(Vec<PathBuf>),
    /// Particles, and fields of each layer, if there are any.
    Memory(Box<Particles>, Vec<LayerFields>),
}

impl Snapshot {
    /// Names a file, or a folder of raw columns; the format is found by the content.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Input`] where it cannot be read, or is no snapshot; [`Error::Argument`] for a pipe,
    /// which gives its data once.
    pub fn open(path: impl AsRef<Path>) -> Result<Snapshot> {
        Snapshot::open_with(&[path.as_ref().to_path_buf()], Choice::default())
    }

    /// Names the files of one snapshot, and what is read of them and how.
    ///
    /// # Errors
    /// As [`Snapshot::open`].
    pub fn open_with(paths: &[PathBuf], choice: Choice) -> Result<Snapshot> {
        if let Some(pipe) = paths.iter().find(|p| is_stream(p)) {
            return Err(Error::argument(format!("{}: a pipe can only be read once; name a file", pipe.display())));
        }
        // What is no snapshot is refused here rather than at the first use.
        choice.describe(paths, false, &Context::default())?;
        Ok(Snapshot { source: SnapshotSource::Files(paths.to_vec()), choice })
    }

    /// Positions in columns of float32, in any unit of length.
    ///
    /// # Errors
    /// [`Error::Argument`] for columns of unequal length.
    pub fn from_columns(x: impl Into<Vec<f32>>, y: impl Into<Vec<f32>>, z: impl Into<Vec<f32>>) -> Result<Snapshot> {
        let (x, y, z) = (x.into(), y.into(), z.into());
        if x.len() != y.len() || x.len() != z.len() {
            let lengths = format!("{}, {} and {}", x.len(), y.len(), z.len());
            return Err(Error::argument(format!("the columns have different lengths: {lengths}")));
        }
        let mut particles = Particles::from_columns(x, y, z);
        particles.meta.name = "columns in memory".into();
        Ok(Snapshot::from(particles))
    }

    /// Reads one species alone, by its name, number or alias; called again, that one as well.
    #[must_use]
    pub fn species(mut self, name: &str) -> Snapshot {
        self.choice.species.push(name.into());
        self
    }

    /// Keeps a part: a region, every n-th particle, a random sample.
    #[must_use]
    pub fn select(mut self, selection: Selection) -> Snapshot {
        self.choice.selection = Some(selection);
        self
    }

    /// Metadata that the files state.
    ///
    /// # Errors
    /// [`Error::Argument`] for particles in memory; those of reading.
    pub fn describe(&self, context: &Context<'_>) -> Result<Description> {
        match &self.source {
            SnapshotSource::Files(paths) => Ok(self.choice.describe(paths, false, context)?.0),
            SnapshotSource::Memory(..) => Err(Error::argument("particles in memory have no files to describe")),
        }
    }

    /// Reads the particles: mapped where they lie in their file as they are used, else in memory.
    ///
    /// While mapped particles are in use, another program must not make their file shorter: reading what is gone ends
    /// the process (SIGBUS). [`Particles::check_files`], which this library calls before it reads all of them, refuses
    /// a file that was cut before; [`Particles::in_memory`] copies them.
    ///
    /// # Errors
    /// [`Error::Input`] for a species that there is not, and invalid values; [`Error::Argument`] for a species of
    /// particles in memory; [`Error::Memory`]; [`Error::Cancelled`].
    pub fn particles(&self, context: &Context<'_>) -> Result<Particles> {
        Ok(self.read(false, &Storage::Memory, context)?.0)
    }

    /// The particles, with their fields if those are wanted; what cannot be used in place goes to `storage`.
    pub(crate) fn read(
        &self,
        with_fields: bool,
        storage: &Storage,
        context: &Context<'_>,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        match (&self.source, self.choice.selection) {
            (SnapshotSource::Files(_), _) => self.files()?.read(storage, with_fields, context),
            (SnapshotSource::Memory(_, fields), _) if with_fields && fields.is_empty() => {
                Err(Error::argument("particles in memory have no fields to store"))
            }
            (SnapshotSource::Memory(..), Some(_)) if with_fields => {
                Err(Error::argument("a selection of particles in memory leaves their fields out"))
            }
            (SnapshotSource::Memory(..), _) if !self.choice.species.is_empty() => {
                Err(Error::argument("particles in memory have no species to choose from"))
            }
            (SnapshotSource::Memory(all, _), Some(part)) => Ok((all.select(part, storage, context)?, Vec::new())),
            (SnapshotSource::Memory(all, fields), None) => {
                Ok(((**all).clone(), if with_fields { fields.clone() } else { Vec::new() }))
            }
        }
    }

    /// The particles, and the fields of each layer: those of the files, or those that it was given.
    ///
    /// # Errors
    /// As [`Snapshot::particles`]; [`Error::Argument`] for a selection of particles in memory that have fields.
    pub fn particles_and_fields(&self, context: &Context<'_>) -> Result<(Particles, Vec<LayerFields>)> {
        self.read(true, &Storage::Memory, context)
    }

    /// Whether fields can be read with the particles.
    pub fn has_fields(&self) -> bool {
        !matches!(&self.source, SnapshotSource::Memory(_, fields) if fields.is_empty())
    }

    /// Gives particles in memory the fields of each layer, in the order of the layers.
    ///
    /// # Errors
    /// [`Error::Argument`] for particles of files, which have their own, and for another number of layers.
    pub fn with_fields(self, fields: Vec<LayerFields>) -> Result<Snapshot> {
        match self.source {
            SnapshotSource::Memory(particles, _) if fields.is_empty() || fields.len() == particles.layers().len() => {
                Ok(Snapshot { source: SnapshotSource::Memory(particles, fields), choice: self.choice })
            }
            SnapshotSource::Memory(..) => Err(Error::argument("give fields for each layer")),
            SnapshotSource::Files(_) => Err(Error::argument("files have fields of their own")),
        }
    }

    /// Names files that were opened before, such as a pipe's, and how they are read.
    pub fn of_files(paths: &[PathBuf], choice: Choice) -> Snapshot {
        Snapshot { source: SnapshotSource::Files(paths.to_vec()), choice }
    }

    /// Reads another frame of a trajectory; of particles in memory there is but one.
    pub(crate) fn with_frame(mut self, frame: Option<i64>) -> Snapshot {
        self.choice.frame = frame;
        self
    }

    /// All particles, and the part that was selected.
    pub(crate) fn without_selection(mut self) -> (Snapshot, Selection) {
        let selection = self.choice.selection.take();
        (self, selection.unwrap_or_else(Selection::all))
    }

    /// Its files, and what is read of them.
    pub(crate) fn files(&self) -> Result<SnapshotFiles> {
        match &self.source {
            SnapshotSource::Files(paths) => Ok(SnapshotFiles { paths: paths.clone(), choice: self.choice.clone() }),
            SnapshotSource::Memory(..) => {
                Err(Error::argument("particles in memory have no files that tasks of a job could read"))
            }
        }
    }

    /// Declares its files as inputs, so that no output is written over them.
    pub(crate) fn declare(&self, outputs: &Outputs) {
        if let SnapshotSource::Files(paths) = &self.source {
            paths.iter().chain(&self.choice.topology).for_each(|path| outputs.reads(Input::Data(path.clone())));
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

    /// The first of its files, or the name of particles in memory.
    pub(crate) fn place(&self) -> String {
        match &self.source {
            SnapshotSource::Files(paths) => paths.first().map_or_else(String::new, |path| path.display().to_string()),
            SnapshotSource::Memory(particles, _) => particles.meta.name.clone(),
        }
    }

    /// Its name without its folder; empty in memory.
    pub(crate) fn name(&self) -> String {
        match &self.source {
            SnapshotSource::Files(paths) => {
                let name = paths.first().and_then(|path| path.file_name());
                name.map_or_else(String::new, |name| name.to_string_lossy().into_owned())
            }
            SnapshotSource::Memory(..) => String::new(),
        }
    }

    /// As a model's recipe says what was read.
    pub(crate) fn options(&self) -> std::collections::BTreeMap<String, String> {
        self.choice.options()
    }
}

impl From<Particles> for Snapshot {
    fn from(particles: Particles) -> Snapshot {
        Snapshot { source: SnapshotSource::Memory(particles.into(), Vec::new()), choice: Choice::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CompressOptions, ProgressSink, compress};
    use std::sync::Mutex;

    #[derive(Default)]
    struct Messages(Mutex<Vec<String>>);

    impl ProgressSink for Messages {
        fn message(&self, text: &str) {
            self.0.lock().unwrap().push(text.into());
        }
    }

    #[test]
    fn no_output_is_written_over_the_files_of_a_snapshot() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("in.xyz");
        let rows: String = (0..200).map(|i| format!("A {} {} {}\n", i % 7, i % 11, i % 13)).collect();
        std::fs::write(&path, format!("200\n\n{rows}")).unwrap();
        let (snapshot, context) = (Snapshot::open(&path).unwrap(), Context::default());
        let (text, outputs) = (std::fs::read(&path).unwrap(), || Outputs::new(true));
        let options = (&CompressOptions::gaussians(5), &crate::RunOptions::default());
        let refused = [
            crate::compress_into(&snapshot, &path, options, &outputs(), &context).err(),
            snapshot.convert(&path, (None, None), &outputs(), &context).err(),
        ];
        assert!(refused.iter().all(|e| e.as_ref().unwrap().to_string().contains("is an input")), "{refused:?}");
        assert_eq!(std::fs::read(&path).unwrap(), text);
    }

    #[test]
    fn fields_are_stored_by_name_and_notes_reach_the_caller() {
        let dir = tempfile::tempdir().unwrap();
        let rows: String = (0..200)
            .map(|i| format!("A {} {} {} {}\n", i % 7, i % 11, i % 13, f64::from(i * 37 % 199) * 0.37))
            .collect();
        let path = dir.path().join("in.xyz");
        std::fs::write(&path, format!("200\nProperties=species:S:1:pos:R:3:heat:R:1\n{rows}")).unwrap();
        let options = CompressOptions { fields: vec!["heat".into()], ..CompressOptions::gaussians(5) };
        let messages = Messages::default();
        let context = Context::default().with_sink(&messages);
        let model = compress(&Snapshot::open(&path).unwrap(), &options, &context).unwrap();
        assert_eq!(model.metadata().fields[0].name, "heat");
        let said = messages.0.lock().unwrap().join("\n");
        assert!(said.contains("note: the snapshot states no periodic box"), "{said}");
        let memory = Snapshot::from_columns([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]).unwrap();
        assert!(compress(&memory, &options, &context).is_err());
        let endless = Snapshot::from_columns([0.0, f32::NAN], [0.0; 2], [0.0; 2]).unwrap();
        let refused = compress(&endless, &CompressOptions::gaussians(1), &context).err().unwrap().to_string();
        assert!(refused.starts_with("columns in memory: "), "{refused}");
        let opaque = CompressOptions { opacity: Some(2.0), ..CompressOptions::gaussians(1) };
        let refused = compress(&memory, &opaque, &context).err().unwrap().to_string();
        assert_eq!(refused, "the opacity must be above 0 and at most 1, not 2");
    }
}

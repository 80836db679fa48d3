//! Reads and checks the models of a page before a browser opens.

use crate::common::CommandContext;
use crate::inputs;
use crate::snapshot_args::SnapshotArgs;
use particlegs_core::codec::{FileInfo, SeriesFile};
use particlegs_core::model::Metadata;
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::name_of;
use particlegs_particles::{Particles, Storage};
use particlegs_view::page::PageOpening;
use particlegs_view::poster;
use std::path::{Path, PathBuf};

pub struct ModelFiles {
    files: Vec<PageModelFile>,
}

struct PageModelFile {
    name: String,
    place: String,
    bytes: Vec<u8>,
    info: FileInfo,
}

impl ModelFiles {
    /// Reads the files and refuses damaged ones. Small ones are decoded; for large ones only the checksums are
    /// verified, to keep the page fast. Of a series the frame of a `snapshot` is read, if there is one to compare with.
    pub fn read(paths: &[PathBuf], mut snapshot: Option<&mut SnapshotArgs>, context: &CommandContext) -> Result<Self> {
        let names = names(paths);
        let mut files = Vec::with_capacity(paths.len());
        let mut clock = None;
        for (path, name) in paths.iter().zip(names) {
            let place = name_of(path);
            let bytes = match &mut snapshot {
                Some(snapshot) => inputs::model_with_snapshot(path, snapshot, context)?,
                None => inputs::read_file(path, context)?,
            };
            if codec::is_series(&bytes) {
                let series = SeriesFile::read(&bytes, &place)?;
                if clock.is_some_and(|clock| clock != series.clock) {
                    let message = format!("its clock is its {}, that of another series is not", series.clock.name());
                    return Err(Error::input_with(place, message, "open the series in pages of their own"));
                }
                clock = Some(series.clock);
                let info = codec::read_info(series.frame_bytes(series.first()?)?, &place)?;
                files.push(PageModelFile { name, place, bytes, info });
                continue;
            }
            let info = codec::read_info(&bytes, &place)?;
            if info.gaussians() <= poster::MORE_THAN {
                codec::check(&bytes, &place, context)?;
            }
            files.push(PageModelFile { name, place, bytes, info });
        }
        let model_files = ModelFiles { files };
        model_files.note_units(context);
        Ok(model_files)
    }

    /// Note on models with other units than the first.
    fn note_units(&self, context: &CommandContext) {
        let Some((first, others)) = self.files.split_first() else { return };
        let text = |m: &Metadata| m.units.length_text().unwrap_or("an unknown unit").to_string();
        for PageModelFile { name, info, .. } in others {
            let other = &info.metadata;
            if !share_length(other, &first.info.metadata) {
                let (unit, first_unit) = (text(other), text(&first.info.metadata));
                let words = format!(
                    "{name} is in {unit} and {} in {first_unit}: the page shows each in its own unit",
                    first.name
                );
                context.note(&words);
            }
        }
    }

    pub fn in_units(&self, particles: Particles, context: &CommandContext) -> Result<Particles> {
        match self.files.first() {
            Some(first) => particles.in_units(&first.info.metadata.unit_system(), &Storage::Memory, context),
            None => Ok(particles),
        }
    }

    /// Name of each model on the page, and its number of Gaussians.
    pub fn names(&self) -> impl Iterator<Item = (&str, usize)> {
        self.files.iter().map(|f| (&f.name[..], f.info.gaussians()))
    }

    pub fn infos(&self) -> Vec<&FileInfo> {
        self.files.iter().map(|f| &f.info).collect()
    }

    pub fn take_files(&mut self) -> Vec<(String, Vec<u8>)> {
        self.files.iter_mut().map(|f| (f.name.clone(), std::mem::take(&mut f.bytes))).collect()
    }

    /// Whether the only model loads slowly enough to need a poster.
    pub fn has_poster(&self, opening: &PageOpening) -> bool {
        matches!(&self.files[..], [only] if !codec::is_series(&only.bytes) && poster::wanted(only.info.gaussians(), opening)
            && only.info.gaussians() <= poster::SERVED_UP_TO)
    }

    /// The poster of the only model; if it fails, a warning is printed.
    pub fn poster(&self, bytes: &[u8], context: &CommandContext, tell: &dyn Fn(&str)) -> Option<Vec<u8>> {
        let place = self.files.first().map_or("", |f| &f.place);
        let model = codec::decode_with(bytes, place, context);
        match model.and_then(|model| poster::draw(&model, poster::LARGE, context)) {
            Ok(poster) => Some(poster.png),
            Err(Error::Cancelled) => None,
            Err(other) => {
                tell(&format!("warning: {other}"));
                None
            }
        }
    }
}

/// Whether two models have the same unit of length, as far as they say.
pub fn share_length(one: &Metadata, other: &Metadata) -> bool {
    one.unit_system().conversion(&other.unit_system()).is_ok_and(|by| by.length == 1.0)
}

/// Names of the files on the page; paths if two have the same name.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let name =
        |path: &Path| path.file_name().filter(|_| path != Path::new("-")).map(|n| n.to_string_lossy().into_owned());
    let short: Vec<String> = paths.iter().map(|p| name(p).unwrap_or_else(|| name_of(p))).collect();
    let unique = |n: &String| short.iter().filter(|other| *other == n).count() == 1;
    paths.iter().zip(&short).map(|(path, n)| if unique(n) { n.clone() } else { name_of(path) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_models_apart() {
        let named = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(named(&["runs/a.pgs", "b.pgs", "-"]), ["a.pgs", "b.pgs", "standard input"]);
        assert_eq!(named(&["x/m.pgs", "y/m.pgs", "z.pgs"]), ["x/m.pgs", "y/m.pgs", "z.pgs"]);
    }
}

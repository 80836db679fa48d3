//! Destinations of pictures: a folder with one file per view, or one named file.

use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_figure::FileKind;
use particlegs_files::output::{self, Outputs, kinds};
use std::path::{Path, PathBuf};

/// Endings of one picture's name.
const ENDINGS: [&str; 3] = ["png", "pdf", "svg"];

#[derive(Clone, Debug)]
pub enum PictureOut {
    /// NAME.png of each view.
    Folder(PathBuf),
    File(PathBuf),
}

impl PictureOut {
    /// Interprets an output for this number of views: a stream, or a name that ends in `.png`, `.pdf` or `.svg`, is one
    /// picture; otherwise a folder, which is created. `raw` values need a folder.
    pub fn new(out: &Path, views: usize, raw: bool, outputs: &Outputs) -> Result<Self> {
        let is_picture = FileKind::from_path(out).is_some() && !out.is_dir() || output::is_stream(out)?;
        if !is_picture && out.is_file() {
            let message = format!("{} is a file, but its name does not end in .png, .pdf or .svg", out.display());
            return Err(Error::argument_with(message, "name a folder, or a picture NAME.png"));
        }
        if !is_picture {
            output::ending(out, &ENDINGS)?;
            outputs.make_folder(out)?;
            return Ok(PictureOut::Folder(out.to_path_buf()));
        }
        if raw {
            let message = format!("{} names a picture, but raw values are written", out.display());
            return Err(Error::argument_with(message, "name a folder: it gets NAME.f32 and NAME.json"));
        }
        if views != 1 {
            let message = format!("{} names one picture, but there are {views} views", out.display());
            return Err(Error::argument_with(message, "name a folder: it gets a picture for each view"));
        }
        Ok(PictureOut::File(out.to_path_buf()))
    }

    /// The files of the views' pictures, declared as outputs.
    pub fn pictures<'a>(
        &self,
        names: impl Iterator<Item = &'a str>,
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        let paths: Vec<PathBuf> = names.map(|name| self.picture(name)).collect();
        let kind = match self.kind() {
            FileKind::Png => kinds::PNG,
            FileKind::Pdf => kinds::PDF,
            FileKind::Svg => kinds::SVG,
        };
        paths.iter().try_for_each(|path| outputs.writes(path, &kind, context).map(drop))?;
        Ok(paths)
    }

    pub fn picture(&self, view: &str) -> PathBuf {
        match self {
            PictureOut::Folder(folder) => folder.join(format!("{view}.png")),
            PictureOut::File(file) => file.clone(),
        }
    }

    pub fn kind(&self) -> FileKind {
        match self {
            PictureOut::Folder(_) => FileKind::Png,
            PictureOut::File(file) => FileKind::from_path(file).unwrap_or(FileKind::Png),
        }
    }

    pub fn folder(&self) -> &Path {
        match self {
            PictureOut::Folder(folder) => folder,
            PictureOut::File(file) => file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")),
        }
    }

    /// Reports the number of complete pictures if the work ends early.
    pub fn count<T>(&self, done: usize, all: usize, outcome: Result<T>, context: &Context<'_>) -> Result<T> {
        if outcome.is_err() && done > 0 {
            let place = match self {
                PictureOut::File(path) | PictureOut::Folder(path) => path.display(),
            };
            context.message(&format!("{done} of {all} pictures are complete, in {place}"));
        }
        outcome
    }
}

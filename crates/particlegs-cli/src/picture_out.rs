//! Where pictures go: a folder with one file per view, or one named file.

use crate::common::CommandContext;
use crate::figure::FileKind;
use crate::outputs::{PDF, PNG, SVG};
use particlegs_core::{Error, Result};
use particlegs_files::output;
use std::path::{Path, PathBuf};

/// Of one picture's name.
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
    pub fn new(out: &Path, views: usize, raw: bool, context: &CommandContext) -> Result<Self> {
        let is_picture = FileKind::from_path(out).is_some() && !out.is_dir() || output::is_stream(out)?;
        if !is_picture && out.is_file() {
            let what = format!("{} is a file, but its name does not end in .png, .pdf or .svg", out.display());
            return Err(Error::argument_with(what, "name a folder, or a picture NAME.png"));
        }
        if !is_picture {
            output::ending(out, &ENDINGS)?;
            context.outputs.make_folder(out)?;
            return Ok(PictureOut::Folder(out.to_path_buf()));
        }
        if raw {
            let what = format!("{} names a picture, but --raw writes values", out.display());
            return Err(Error::argument_with(what, "name a folder: it gets NAME.f32 and NAME.json"));
        }
        if views != 1 {
            let what = format!("{} names one picture, but there are {views} views", out.display());
            return Err(Error::argument_with(what, "name a folder: it gets a picture for each view"));
        }
        Ok(PictureOut::File(out.to_path_buf()))
    }

    /// The files of the views' pictures, declared as outputs.
    pub fn pictures<'a>(&self, names: impl Iterator<Item = &'a str>, context: &CommandContext) -> Result<Vec<PathBuf>> {
        let paths: Vec<PathBuf> = names.map(|name| self.picture(name)).collect();
        let kind = match self.kind() {
            FileKind::Png => PNG,
            FileKind::Pdf => PDF,
            FileKind::Svg => SVG,
        };
        paths.iter().try_for_each(|path| context.writes(path, &kind).map(drop))?;
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
}

//! Where pictures go: a folder with one file a view, or the one file that is named.

use particlegs::{Error, Result};
use std::path::{Path, PathBuf};

/// Where pictures go.
#[derive(Clone, Debug)]
pub enum PictureOut {
    /// NAME.png of each view.
    Folder(PathBuf),
    /// The picture of the only view.
    File(PathBuf),
}

impl PictureOut {
    /// What `--out` means for so many views; a name that ends in `.png` is the one picture's. Makes the
    /// folder.
    ///
    /// # Errors
    /// [`Error::Argument`] for one name and several views, or a file that is no picture; [`Error::Io`].
    pub fn new(out: &Path, views: usize, raw: bool) -> Result<Self> {
        let is_png = out.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) && !out.is_dir();
        if !is_png && out.is_file() {
            let what = format!("--out {} is a file, and its name does not end in .png", out.display());
            return Err(Error::Argument { what, hint: "name a folder, or a picture NAME.png".into() });
        }
        if !is_png {
            std::fs::create_dir_all(out).map_err(|e| Error::io(out, e))?;
            return Ok(PictureOut::Folder(out.to_path_buf()));
        }
        if raw {
            let what = format!("--out {} names a picture, and --raw writes values", out.display());
            return Err(Error::Argument { what, hint: "name a folder: it gets NAME.f32 and NAME.json".into() });
        }
        if views != 1 {
            let what = format!("--out {} names one picture, and there are {views} views", out.display());
            return Err(Error::Argument { what, hint: "name a folder: it gets a picture for each view".into() });
        }
        Ok(PictureOut::File(out.to_path_buf()))
    }

    /// The file of a view's picture.
    pub fn picture(&self, view: &str) -> PathBuf {
        match self {
            PictureOut::Folder(folder) => folder.join(format!("{view}.png")),
            PictureOut::File(file) => file.clone(),
        }
    }

    /// The file of a view's values; only folders have any.
    pub fn values(&self, view: &str, ending: &str) -> PathBuf {
        match self {
            PictureOut::Folder(folder) => folder.join(format!("{view}.{ending}")),
            PictureOut::File(file) => file.with_extension(ending),
        }
    }
}

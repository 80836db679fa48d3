//! Pictures as files.

use crate::{Gray8, Plane, Result};
use particlegs_core::picture::{Colormap, Rgb8};
use particlegs_figure::FigureImage;
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_files::output::write_bytes;
use particlegs_files::png::write_png;
use std::path::Path;

/// Writes a picture as PNG, whole or not at all.
pub trait SavePng {
    /// Writes it to `path`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()>;
}

impl SavePng for Gray8 {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        write_png(path.as_ref(), self.size, &self.data)
    }
}

impl SavePng for Rgb8 {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        let image = FigureImage::Color(self.clone());
        write_bytes(path.as_ref(), &coded(&image, &PngMetadata::default())?)
    }
}

/// A density in the default colours; [`Plane::colored`] has others.
impl SavePng for Plane {
    fn save_png(&self, path: impl AsRef<Path>) -> Result<()> {
        self.colored(Colormap::default(), None).save_png(path)
    }
}

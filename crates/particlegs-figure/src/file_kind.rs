//! A sheet as the bytes of a file, by the kind of file.

use super::FigureImage;
use super::pdf::pdf;
use super::png_file::{PngMetadata, coded};
use super::raster::raster;
use super::sheet::Sheet;
use super::svg::svg;
use particlegs_core::{NamedValue, Result, named_values};
use std::path::Path;

impl Sheet {
    /// The bytes of the sheet's file.
    pub fn bytes(&self, kind: FileKind, about: &PngMetadata) -> Result<Vec<u8>> {
        match kind {
            FileKind::Png => coded(&FigureImage::Color(raster(self)?), about),
            FileKind::Svg => Ok(svg(self, about)?.into_bytes()),
            FileKind::Pdf => pdf(self, about),
        }
    }
}

named_values! {
    /// Kind of a file, by the ending of its name.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum FileKind {
        Png = "png": "pixels",
        Pdf = "pdf": "a page",
        Svg = "svg": "a drawing",
    }
}

impl FileKind {
    /// By the ending of a name.
    pub fn from_path(path: &Path) -> Option<FileKind> {
        FileKind::from_name(&path.extension()?.to_str()?.to_ascii_lowercase()).ok()
    }
}

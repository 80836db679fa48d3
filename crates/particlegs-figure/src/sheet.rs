//! A sheet: what is drawn, in the order that it is drawn in, and its file by the kind of file. The unit is a pixel of a
//! PNG, a point (1/72 inch) of SVG and PDF; the origin is the upper left corner.

use super::FigureImage;
use super::pdf::pdf;
use super::png_file::{PngMetadata, coded};
use super::raster::raster;
use super::svg::svg;
use particlegs_core::{NamedValue, Result, named_values};
use std::path::Path;

pub type RgbColour = [u8; 3];

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PageRectangle {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Across.
    pub w: f64,
    /// Down.
    pub h: f64,
}

impl PageRectangle {
    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }

    /// The corners, the first again at the end.
    pub fn outline(&self) -> Vec<[f64; 2]> {
        let (x, y, r, b) = (self.x, self.y, self.right(), self.bottom());
        vec![[x, y], [r, y], [r, b], [x, b], [x, y]]
    }
}

/// The point of a text that stands at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// Distance of the beginning of a text of this width before its place.
    pub fn before(self, width: f64) -> f64 {
        match self {
            Anchor::Start => 0.0,
            Anchor::Middle => 0.5 * width,
            Anchor::End => width,
        }
    }
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct TextLine {
    pub text: String,
    /// Its place, on the baseline.
    pub at: [f64; 2],
    /// Height of an em.
    pub em: f64,
    pub ink: RgbColour,
    pub anchor: Anchor,
    /// Read from below to above.
    pub turned: bool,
    /// A rim in this colour, so that it is read over a picture.
    pub rim: Option<RgbColour>,
}

#[derive(Clone, Debug)]
pub enum Mark {
    /// A picture, stretched to an area.
    Picture(PageRectangle, FigureImage),
    /// An area in one colour.
    Fill(PageRectangle, RgbColour),
    /// The area between corners, in one colour.
    Polygon(Vec<[f64; 2]>, RgbColour),
    /// A line through points; `opacity` from 0, unseen, to 1.
    Line {
        points: Vec<[f64; 2]>,
        width: f64,
        ink: RgbColour,
        opacity: f64,
    },
    Words(TextLine),
}

#[derive(Clone, Debug)]
pub struct Sheet {
    /// Across.
    pub width: f64,
    /// Down.
    pub height: f64,
    /// The colour under everything.
    pub ground: RgbColour,
    /// The marks, in the order of drawing.
    pub marks: Vec<Mark>,
}

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

//! A sheet: what is drawn, in the order that it is drawn in. The unit is a pixel of a PNG, a point (1/72 inch) of
//! SVG and PDF; the origin is the upper left corner.

use super::FigureImage;

/// A colour: red, green, blue.
pub type RgbColour = [u8; 3];

/// A rectangle.
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
    /// Right edge.
    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    /// Lower edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }
}

/// Which point of a text its place is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Where it begins.
    Start,
    /// Its middle.
    Middle,
    /// Where it ends.
    End,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct TextLine {
    /// What it says.
    pub text: String,
    /// Its place, on the baseline.
    pub at: [f64; 2],
    /// Height of an em.
    pub em: f64,
    /// Colour.
    pub ink: RgbColour,
    /// What its place is of.
    pub anchor: Anchor,
    /// Read from below to above.
    pub turned: bool,
    /// A rim in this colour, so that it is read over a picture.
    pub rim: Option<RgbColour>,
}

/// Something drawn.
#[derive(Clone, Debug)]
pub enum Mark {
    /// A picture, stretched to an area.
    Picture(PageRectangle, FigureImage),
    /// An area in one colour.
    Fill(PageRectangle, RgbColour),
    /// A line through points, so wide, so opaque.
    Line {
        /// Points.
        points: Vec<[f64; 2]>,
        /// Width.
        width: f64,
        /// Colour.
        ink: RgbColour,
        /// From 0, unseen, to 1.
        opacity: f64,
    },
    /// Text.
    Words(TextLine),
}

/// All marks.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Across.
    pub width: f64,
    /// Down.
    pub height: f64,
    /// The colour under everything.
    pub ground: RgbColour,
    /// What is drawn, in order.
    pub marks: Vec<Mark>,
}

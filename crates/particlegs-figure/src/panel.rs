//! Parts of a figure, before they are placed: its pictures, in grey levels or in colours, and what stands about them.

use super::sheet::RgbColour;
use super::ticks::{TickMarks, logarithmic};
use particlegs_core::named_values;
use particlegs_core::picture::{Gray8, Rgb8, Size};

named_values! {
    /// The background of a picture or a page.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum PaperColour {
        Black = "black": "Light on black",
        White = "white": "Dark on white",
    }
}

impl PaperColour {
    pub fn paper(self) -> RgbColour {
        match self {
            PaperColour::White => [255; 3],
            PaperColour::Black => [0; 3],
        }
    }

    /// The colour of lines and letters on it.
    pub fn ink(self) -> RgbColour {
        match self {
            PaperColour::White => [0; 3],
            PaperColour::Black => [235; 3],
        }
    }
}

named_values! {
    /// Place of the bars of a figure.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum BarPlacement {
        #[default]
        Outside = "outside": "Beside the picture",
        Inside = "inside": "On the picture",
        None = "none": "No colour bar; the scale bar beside the picture",
    }
}

#[derive(Clone, Debug)]
pub struct Figure {
    pub title: Option<String>,
    /// The pictures, row by row. All have one size.
    pub panels: Vec<Panel>,
    pub columns: usize,
    pub bar: Option<ColourBar>,
    /// Names that colours stand for.
    pub legend: Vec<(String, RgbColour)>,
    pub place: BarPlacement,
    /// The page about the pictures.
    pub page: PaperColour,
    /// The pictures' own ground, for what is drawn on them.
    pub ground: PaperColour,
}

#[derive(Clone, Debug)]
pub struct Panel {
    pub image: FigureImage,
    pub caption: Option<String>,
    /// A length in it, and what that is in world units.
    pub scale: Option<ScaleBar>,
    /// Coordinates along its edges: across, and upwards.
    pub axes: Option<[EdgeAxis; 2]>,
    /// Lines on it in shares of its width and height: the edges of a box.
    pub lines: Vec<[[f64; 2]; 2]>,
    /// Names on it, in the same shares.
    pub names: Vec<([f64; 2], String)>,
}

impl Figure {
    /// Pictures with dark grounds on a white page, and nothing about them.
    pub fn plain(panels: Vec<Panel>, columns: usize) -> Figure {
        let (place, page, ground) = (BarPlacement::Outside, PaperColour::White, PaperColour::Black);
        Figure { title: None, panels, columns, bar: None, legend: Vec::new(), place, page, ground }
    }
}

impl Panel {
    /// A picture with nothing about it.
    pub fn plain(image: FigureImage) -> Panel {
        Panel { image, caption: None, scale: None, axes: None, lines: Vec::new(), names: Vec::new() }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ScaleBar {
    /// Its length as a share of the picture's width.
    pub share: f64,
    pub label: String,
}

/// Coordinates along an edge.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeAxis {
    /// Its name with its unit.
    pub label: String,
    /// From the left, or from below.
    pub low: f64,
    /// To the right, or above.
    pub high: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct ColourBar {
    /// The quantity that it shows, with its unit.
    pub title: String,
    /// Colours from the lowest value to the highest.
    pub colours: Vec<RgbColour>,
    pub ticks: TickMarks,
}

impl ColourBar {
    /// Of a range in equal steps of the logarithm, whose shares from 0 to 1 have these colours.
    pub fn logarithmic(title: String, range: [f64; 2], colour: impl Fn(f32) -> RgbColour) -> ColourBar {
        let colours = (0..=255).map(|i| colour(i as f32 / 255.0)).collect();
        ColourBar { title, colours, ticks: logarithmic(range[0], range[1]) }
    }
}

/// A picture, top row first.
#[derive(Clone, Debug, PartialEq)]
pub enum FigureImage {
    Gray(Gray8),
    Color(Rgb8),
}

impl FigureImage {
    /// Pixels across and down.
    pub fn size(&self) -> Size {
        match self {
            FigureImage::Gray(g) => g.size,
            FigureImage::Color(c) => c.size,
        }
    }

    /// Its bytes: one a pixel, or three.
    pub fn bytes(&self) -> &[u8] {
        match self {
            FigureImage::Gray(g) => &g.data,
            FigureImage::Color(c) => c.data.as_flattened(),
        }
    }

    pub fn channels(&self) -> usize {
        match self {
            FigureImage::Gray(_) => 1,
            FigureImage::Color(_) => 3,
        }
    }

    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = y * self.size().width + x;
        match self {
            FigureImage::Gray(g) => [g.data[at]; 3],
            FigureImage::Color(c) => c.data[at],
        }
    }

    /// Black for white and white for black: dark ink on a white background.
    pub fn inverted(mut self) -> Self {
        match &mut self {
            FigureImage::Gray(g) => g.data.iter_mut().for_each(|v| *v = 255 - *v),
            FigureImage::Color(c) => c.data.as_flattened_mut().iter_mut().for_each(|v| *v = 255 - *v),
        }
        self
    }
}

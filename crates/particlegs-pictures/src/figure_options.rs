//! Annotations and printed size of pictures.

use particlegs_core::context::Context;
use particlegs_core::model::UnitSystem;
use particlegs_core::picture::Size;
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result, named_values};
use particlegs_figure::{BarPlacement, FileKind, PaperColour, missing};
use particlegs_formats::Catalogue;
use std::path::PathBuf;

/// Default width of a figure (a journal column) and font size, in points.
const COLUMN: f64 = 84.0 * 72.0 / 25.4;
const LETTERS: f64 = 8.0;
/// Pixels of a side at most.
const LARGEST: f64 = 32_768.0;

named_values! {
    /// Axes of a picture.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum FigureAxes {
        Frame = "frame": "Coordinates along the edges of an orthographic picture",
        Cube = "cube": "The edges of the box with the names of its axes, on the picture",
        None = "none": "Neither",
    }
}

/// Appearance of a figure: annotations of pictures, and their size in print.
#[derive(Clone, Debug, Default)]
pub struct FigureOptions {
    /// Position of the colour bar and the scale bar.
    pub colorbar: BarPlacement,
    /// Background of the picture, by default black, and of the page, by default white. On white, grey levels are inverted
    /// and colour maps reversed, so that dense regions are dark.
    pub background: Option<PaperColour>,
    /// Coordinates around the picture, or the box with its axes on it.
    pub axes: Option<FigureAxes>,
    /// Whether a scale bar is drawn, as densities, PDF and SVG have by default.
    pub scale_bar: bool,
    /// A list of centres and radii, such as a catalogue of haloes, that circles are drawn around.
    pub overlay: Option<PathBuf>,
    /// Title above the picture.
    pub title: Option<String>,
    /// Width of the whole figure in points, from 20 to 14400; 84 mm of PDF and SVG by default.
    pub width: Option<f64>,
    /// Font size in points, from 1 to 200; 8 in PDF and SVG by default.
    pub font_size: Option<f64>,
    /// Pixels per inch, from 10 to 10000: a minimum with `width`, else only stored in the PNG.
    pub dpi: Option<f64>,
    /// Whether colour bar and scale bar are left out.
    pub no_annotations: bool,
}

impl FigureOptions {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for one out of its range.
    pub fn check(&self) -> Result<()> {
        let check = |name: &str, value: Option<f64>, low: f64, high: f64, unit: &str| match value {
            Some(v) if !(low..=high).contains(&v) => {
                Err(Error::argument(format!("the {name} must be from {low} to {high} {unit}, not {v}")))
            }
            _ => Ok(()),
        };
        check("width of the figure", self.width, 20.0, 14_400.0, "points (7 to 5080 mm)")?;
        check("font size", self.font_size, 1.0, 200.0, "points")?;
        check("resolution", self.dpi, 10.0, 10_000.0, "pixels per inch")
    }

    /// Whether a picture of this style has annotations in such a file.
    pub(crate) fn is_figure(&self, bars: bool, kind: FileKind) -> bool {
        let is_annotated = self.axes.is_some_and(|a| a != FigureAxes::None) || self.scale_bar || self.title.is_some();
        let is_annotated = is_annotated || self.overlay.is_some();
        let has_print_size = self.width.is_some() || self.font_size.is_some();
        kind != FileKind::Png || !self.no_annotations && (bars || is_annotated || has_print_size)
    }

    /// Centres and radii of the circles, in the units of what is drawn.
    pub(crate) fn circles(
        &self,
        place: (UnitSystem<'_>, Option<Cell>),
        context: &Context<'_>,
    ) -> Result<Vec<([f64; 3], f64)>> {
        self.overlay.as_ref().map_or(Ok(Vec::new()), |path| Catalogue::circles(path, place, context))
    }

    /// Whether a scale bar is drawn.
    pub(crate) fn has_scale(&self, bars: bool, kind: FileKind) -> bool {
        !self.no_annotations && (self.scale_bar || bars || kind != FileKind::Png || self.width.is_some())
    }

    /// Whether a colour bar is drawn, if there are colours.
    pub(crate) fn has_bar(&self) -> bool {
        !self.no_annotations && self.colorbar != BarPlacement::None
    }

    /// Background of the picture.
    pub(crate) fn ground(&self) -> PaperColour {
        self.background.unwrap_or(PaperColour::Black)
    }

    /// Background of the page.
    pub(crate) fn page(&self) -> PaperColour {
        self.background.unwrap_or(PaperColour::White)
    }

    /// Width of a figure in points, if it is chosen or the format needs one.
    pub(crate) fn points(&self, kind: FileKind) -> Option<f64> {
        self.width.or((kind != FileKind::Png).then_some(COLUMN))
    }

    /// Font size in points.
    pub(crate) fn letters(&self) -> f64 {
        self.font_size.unwrap_or(LETTERS)
    }

    /// Font size in pixels for a PNG without a printed size.
    pub(crate) fn pixels(&self, size: Size) -> f64 {
        match (self.font_size, self.dpi) {
            // A tall picture counts as one of its width in 16:9, so that labels fit across it.
            (None, _) => (size.height.min(size.width * 9 / 16) as f64 / 30.0).clamp(11.0, 200.0).round(),
            (Some(points), dpi) => points * dpi.unwrap_or(300.0) / 72.0,
        }
    }

    /// Picture size for a chosen resolution, with `columns` pictures per row.
    pub(crate) fn resolved(&self, size: Size, kind: FileKind, columns: usize) -> Option<Size> {
        let width = (self.dpi? * self.points(kind)? / 72.0 / columns as f64).ceil().clamp(1.0, LARGEST);
        let height = (width * size.height as f64 / size.width as f64).round().clamp(1.0, LARGEST);
        Some(Size { width: width as usize, height: height as usize })
    }

    /// Note on characters that the font lacks.
    pub(crate) fn note_missing(&self, more: &[String], context: &Context<'_>) {
        let missing: String = self.title.iter().chain(more).map(|t| missing(t)).collect();
        if !missing.is_empty() {
            context.note(&format!("the font lacks the characters `{missing}`: boxes are drawn instead"));
        }
    }
}

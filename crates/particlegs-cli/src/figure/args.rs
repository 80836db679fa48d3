//! Annotations and printed size of pictures. Shared by `render` and `reference`.

use super::{BarPlacement, FileKind, PaperColour, missing};
use crate::centres;
use clap::{Args, ValueEnum};
use particlegs_core::context::Context;
use particlegs_core::model::UnitSystem;
use particlegs_core::picture::Size;
use particlegs_core::space::Cell;
use std::path::PathBuf;

/// Default width of a figure (a journal column) and font size, in points.
const COLUMN: f64 = 84.0 * 72.0 / 25.4;
const LETTERS: f64 = 8.0;

/// How a figure looks.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Figures")]
pub struct FigureArgs {
    /// Position of the colour bar and the scale bar [default: outside].
    #[arg(long, value_enum, value_name = "WHERE", hide_short_help = true, conflicts_with = "no_annotations")]
    pub colorbar: Option<ColorbarArg>,
    /// Background of the picture and the page [default: black picture, white page].
    ///
    /// On white, grey levels are inverted and colour maps reversed, so that dense regions are dark.
    #[arg(long, value_enum, value_name = "COLOUR", hide_short_help = true)]
    pub background: Option<Background>,
    /// Draw coordinates around the picture, or the box with its axes on it.
    #[arg(long, value_enum, value_name = "WHAT", hide_short_help = true, conflicts_with = "no_annotations")]
    pub axes: Option<Axes>,
    /// Draw a scale bar, as densities, PDF and SVG have by default.
    #[arg(long, hide_short_help = true, conflicts_with = "no_annotations")]
    pub scale_bar: bool,
    /// Draw a circle around each centre of a list, such as the catalogue that `haloes` writes.
    ///
    /// The file is read like that of `stats --centres`; its radii are those of the circles.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = clap::ValueHint::FilePath, conflicts_with = "no_annotations")]
    pub overlay: Option<PathBuf>,
    /// Title above the picture.
    #[arg(long, value_name = "TEXT", hide_short_help = true, conflicts_with = "no_annotations")]
    pub title: Option<String>,
    /// Width of the whole figure, such as 84mm, 17cm, 3.3in, 240pt [default of PDF and SVG: 84mm].
    #[arg(long, value_name = "LENGTH", hide_short_help = true, value_parser = parse_length)]
    pub figure_width: Option<f64>,
    /// Font size in points [default of PDF and SVG: 8].
    #[arg(long, value_name = "POINTS", hide_short_help = true, value_parser = parse_points)]
    pub font_size: Option<f64>,
    /// Pixels per inch: a minimum with --figure-width, else only stored in the PNG.
    #[arg(long, value_name = "N", hide_short_help = true, value_parser = parse_dpi)]
    pub dpi: Option<f64>,
    /// Draw no colour bar and no scale bar.
    #[arg(long, hide_short_help = true)]
    pub no_annotations: bool,
}

/// Position of the bars.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ColorbarArg {
    /// Beside the picture.
    Outside,
    /// On the picture.
    Inside,
    /// No colour bar; the scale bar beside the picture.
    None,
}

/// The background.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Background {
    /// Light on black.
    Black,
    /// Dark on white.
    White,
}

/// Kind of axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Axes {
    /// Coordinates along the edges of an orthographic picture.
    Frame,
    /// The edges of the box with the names of its axes, on the picture.
    Cube,
    /// Neither.
    None,
}

impl FigureArgs {
    /// Does a picture of this style have annotations in such a file?
    pub fn is_figure(&self, bars: bool, kind: FileKind) -> bool {
        let asked = self.axes.is_some_and(|a| a != Axes::None) || self.scale_bar || self.title.is_some();
        let asked = asked || self.overlay.is_some();
        let sized = self.figure_width.is_some() || self.font_size.is_some();
        kind != FileKind::Png || !self.no_annotations && (bars || asked || sized)
    }

    /// Centres and radii of the circles, in the units of what is drawn.
    pub fn circles(
        &self,
        place: (UnitSystem<'_>, Option<Cell>),
        context: &Context<'_>,
    ) -> particlegs_core::Result<Vec<([f64; 3], f64)>> {
        self.overlay.as_ref().map_or(Ok(Vec::new()), |path| centres::circles(path, place, context))
    }

    /// Is a scale bar drawn?
    pub fn has_scale(&self, bars: bool, kind: FileKind) -> bool {
        !self.no_annotations && (self.scale_bar || bars || kind != FileKind::Png || self.figure_width.is_some())
    }

    /// Is a colour bar drawn, if there are colours?
    pub fn has_bar(&self) -> bool {
        !self.no_annotations && self.colorbar != Some(ColorbarArg::None)
    }

    /// Position of the bars.
    pub fn place(&self) -> BarPlacement {
        if self.colorbar == Some(ColorbarArg::Inside) { BarPlacement::Inside } else { BarPlacement::Outside }
    }

    /// Background of the picture.
    pub fn ground(&self) -> PaperColour {
        if self.background == Some(Background::White) { PaperColour::White } else { PaperColour::Black }
    }

    /// Background of the page.
    pub fn page(&self) -> PaperColour {
        if self.background == Some(Background::Black) { PaperColour::Black } else { PaperColour::White }
    }

    /// Width of a figure in points, if it is chosen or the format needs one.
    pub fn points(&self, kind: FileKind) -> Option<f64> {
        self.figure_width.or((kind != FileKind::Png).then_some(COLUMN))
    }

    /// Font size in points.
    pub fn letters(&self) -> f64 {
        self.font_size.unwrap_or(LETTERS)
    }

    /// Font size in pixels for a PNG without a printed size.
    pub fn pixels(&self, size: Size) -> f64 {
        match (self.font_size, self.dpi) {
            (None, _) => (size.height.min(size.width * 9 / 16) as f64 / 30.0).clamp(11.0, 200.0).round(),
            (Some(points), dpi) => points * dpi.unwrap_or(300.0) / 72.0,
        }
    }

    /// Picture size for a chosen resolution, with `columns` pictures per row.
    pub fn resolved(&self, size: Size, kind: FileKind, columns: usize) -> Option<Size> {
        let width = (self.dpi? * self.points(kind)? / 72.0 / columns as f64).ceil().clamp(1.0, 32_768.0);
        let height = (width * size.height as f64 / size.width as f64).round().clamp(1.0, 32_768.0);
        Some(Size { width: width as usize, height: height as usize })
    }

    /// Note on characters that the font lacks.
    pub fn note_missing(&self, more: &[String], context: &Context<'_>) {
        let texts = self.title.iter().chain(more);
        let missing: String = texts.map(|t| missing(t)).collect();
        if !missing.is_empty() {
            context.message(&format!("note: the font lacks the characters `{missing}`: boxes are drawn instead"));
        }
    }
}

/// A length in points.
fn parse_length(text: &str) -> Result<f64, String> {
    let fail = || format!("`{text}` is not a width: give a number with its unit, such as 84mm, 17cm, 3.3in or 240pt");
    let split = text.find(|c: char| c.is_ascii_alphabetic()).ok_or_else(fail)?;
    let (number, unit) = text.split_at(split);
    let value: f64 = number.trim().parse().map_err(|_| fail())?;
    let points = value
        * match unit {
            "mm" => 72.0 / 25.4,
            "cm" => 720.0 / 25.4,
            "in" => 72.0,
            "pt" => 1.0,
            _ => return Err(fail()),
        };
    if (20.0..=14_400.0).contains(&points) { Ok(points) } else { Err(format!("`{text}` is outside 7mm to 5000mm")) }
}

fn parse_points(text: &str) -> Result<f64, String> {
    number(text, 1.0, 200.0, "points")
}

fn parse_dpi(text: &str) -> Result<f64, String> {
    number(text, 10.0, 10_000.0, "pixels per inch")
}

fn number(text: &str, low: f64, high: f64, of: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|v| (low..=high).contains(v));
    value.ok_or_else(|| format!("`{text}` is not a number of {of} from {low} to {high}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_units() {
        assert!((parse_length("84mm").unwrap() - 238.11).abs() < 0.01);
        assert_eq!([parse_length("2.54cm"), parse_length("1in")].map(|l| l.map(f64::round)), [Ok(72.0), Ok(72.0)]);
        for bad in ["", "84", "mm", "-3mm", "1e9mm", "nanmm", "84 furlongs", "é"] {
            assert!(parse_length(bad).is_err(), "{bad}");
        }
        assert!(parse_dpi("nan").is_err() && parse_points("0").is_err());
    }
}

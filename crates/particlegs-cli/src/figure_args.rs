//! Annotations and printed size of pictures. Shared by `render` and `reference`.

use crate::common::named;
use clap::Args;
use particlegs_figure::{BarPlacement, PaperColour};
use particlegs_pictures::{FigureAxes, FigureOptions};
use std::path::PathBuf;

/// Options of figures.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Figures")]
pub struct FigureArgs {
    /// Position of the colour bar and the scale bar [default: outside].
    #[arg(long, value_name = "WHERE", hide_short_help = true, conflicts_with = "no_annotations", value_parser = named::<BarPlacement>())]
    pub colorbar: Option<BarPlacement>,
    /// Background of the picture and the page [default: black picture, white page].
    ///
    /// On white, grey levels are inverted and colour maps reversed, so that dense regions are dark.
    #[arg(long, value_name = "COLOUR", hide_short_help = true, value_parser = named::<PaperColour>())]
    pub background: Option<PaperColour>,
    /// Draw coordinates around the picture, or the box with its axes on it.
    #[arg(long, value_name = "WHAT", hide_short_help = true, conflicts_with = "no_annotations", value_parser = named::<FigureAxes>())]
    pub axes: Option<FigureAxes>,
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
    #[arg(long, value_name = "POINTS", hide_short_help = true)]
    pub font_size: Option<f64>,
    /// Pixels per inch: a minimum with --figure-width, else only stored in the PNG.
    #[arg(long, value_name = "N", hide_short_help = true)]
    pub dpi: Option<f64>,
    /// Draw no colour bar and no scale bar.
    #[arg(long, hide_short_help = true)]
    pub no_annotations: bool,
}

impl FigureArgs {
    pub fn options(&self) -> FigureOptions {
        FigureOptions {
            colorbar: self.colorbar.unwrap_or_default(),
            background: self.background,
            axes: self.axes,
            scale_bar: self.scale_bar,
            overlay: self.overlay.clone(),
            title: self.title.clone(),
            width: self.figure_width,
            font_size: self.font_size,
            dpi: self.dpi,
            no_annotations: self.no_annotations,
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
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_units() {
        assert!((parse_length("84mm").unwrap() - 238.11).abs() < 0.01);
        assert_eq!([parse_length("2.54cm"), parse_length("1in")].map(|l| l.map(f64::round)), [Ok(72.0), Ok(72.0)]);
        for bad in ["", "84", "mm", "84 furlongs", "é"] {
            assert!(parse_length(bad).is_err(), "{bad}");
        }
    }
}

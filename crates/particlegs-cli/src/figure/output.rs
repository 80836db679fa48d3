//! Writes figures as the command line requests.

use super::args::FigureArgs;
use super::png_file::{PngEffort, PngMetadata, coded};
use super::{Figure, FigureImage, FigureSpace, FileKind, layout, raster};
use particlegs_core::Result;

/// A figure as pixels, and the resolution if its printed width is chosen.
pub fn pixels(figure: &Figure, args: &FigureArgs) -> Result<(FigureImage, Option<f64>)> {
    let size = figure.panels.first().map(|p| p.image.size());
    let Some(points) = args.figure_width else {
        let em = size.map_or(11.0, |s| args.pixels(s));
        return Ok((FigureImage::Color(raster(&layout(figure, em, FigureSpace::Pixels)?)?), args.dpi));
    };
    // The font's pixel size depends on the figure's size in pixels, which depends on the font.
    let letters = args.letters();
    layout(figure, letters, FigureSpace::Width(points))?;
    let mut em = 11.0;
    let mut sheet = layout(figure, em, FigureSpace::Pixels)?;
    for _ in 0..12 {
        em = (letters * sheet.width / points).clamp(1.0, 2000.0);
        sheet = layout(figure, em, FigureSpace::Pixels)?;
    }
    let page = raster(&sheet)?;
    let dpi = page.size.width as f64 / (points / 72.0);
    Ok((FigureImage::Color(page), Some(dpi)))
}

/// The bytes of a figure's file.
pub fn bytes(figure: &Figure, args: &FigureArgs, kind: FileKind, about: &PngMetadata) -> Result<Vec<u8>> {
    if kind == FileKind::Png {
        let (image, dpi) = pixels(figure, args)?;
        return coded(&image, &PngMetadata { dpi, ..about.clone() }, PngEffort::Small);
    }
    let points = args.points(kind).unwrap_or(72.0);
    layout(figure, args.letters(), FigureSpace::Width(points))?.bytes(kind, about)
}

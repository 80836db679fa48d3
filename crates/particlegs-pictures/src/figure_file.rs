//! The bytes of figures.

use crate::figure_options::FigureOptions;
use particlegs_core::Result;
use particlegs_figure::png_file::{PngMetadata, coded};
use particlegs_figure::{Figure, FigureImage, FigureSpace, FileKind, layout, raster};

/// A figure as pixels, and the resolution if its printed width is chosen.
pub fn pixels(figure: &Figure, options: &FigureOptions) -> Result<(FigureImage, Option<f64>)> {
    let size = figure.panels.first().map(|p| p.image.size());
    let Some(points) = options.width else {
        let em = size.map_or(11.0, |s| options.pixels(s));
        return Ok((FigureImage::Color(raster(&layout(figure, em, FigureSpace::Pixels)?)?), options.dpi));
    };
    // The font's pixel size depends on the figure's size in pixels, which depends on the font.
    let letters = options.letters();
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
pub fn bytes(figure: &Figure, options: &FigureOptions, kind: FileKind, about: &PngMetadata) -> Result<Vec<u8>> {
    if kind == FileKind::Png {
        let (image, dpi) = pixels(figure, options)?;
        return coded(&image, &PngMetadata { dpi, ..about.clone() });
    }
    let points = options.points(kind).unwrap_or(72.0);
    layout(figure, options.letters(), FigureSpace::Width(points))?.bytes(kind, about)
}

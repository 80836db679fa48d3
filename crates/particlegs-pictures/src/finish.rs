//! Turns rendered views into pictures or figures and writes them.

use crate::field_choice::FieldLegend;
use crate::figure_options::{FigureAxes, FigureOptions};
use crate::provenance::PictureProvenance;
use crate::subject::{Quantities, ViewSubject};
use crate::view_content::{self, ViewContent, common_range};
use particlegs_core::Result;
use particlegs_core::camera::{CenteredCell, Projection, View, frame_number};
use particlegs_core::math::each_axis;
use particlegs_core::picture::{Colormap, Size, journal_unit};
use particlegs_figure::png_file::{self, PngMetadata, coded};
use particlegs_figure::ticks::round_below;
use particlegs_figure::{
    ColourBar, Figure, FigureImage, FigureSpace, FileKind, Panel, ScaleBar, axes, cube, labelled, layout, number,
    raster,
};
use particlegs_files::output::write_bytes;
use std::path::Path;

/// Longest scale bar, as a share of the picture's width.
const LONGEST_BAR: f64 = 0.22;

/// Settings that finish pictures; the same for all pictures of some work.
pub struct Finisher<'a> {
    /// Annotations.
    pub options: &'a FigureOptions,
    /// Colours of a density.
    pub colormap: Colormap,
    /// The field that is shown instead, if one is.
    pub field: Option<FieldLegend>,
    /// Units.
    pub quantities: &'a Quantities,
    /// Bounds and cell.
    pub subject: &'a ViewSubject,
    /// Legend of the layers' colours.
    pub legend: Vec<(String, [u8; 3])>,
    /// Centres and radii of circles on the picture, world units.
    pub circles: Vec<([f64; 3], f64)>,
    /// The text that is written into each picture of a film, or one text for all pictures.
    pub stamps: &'a [String],
    /// Provenance stored in files, without each picture's view and range.
    pub about: PictureProvenance,
}

/// Why there is no scale bar.
type MissingScaleReason = &'static str;

impl Finisher<'_> {
    /// Default range of a density's colours.
    pub fn range_of(&self, content: &ViewContent) -> Option<[f64; 2]> {
        match (content, &self.field) {
            (ViewContent::Field(plane, _), Some(field)) => field.scale.range(plane),
            (ViewContent::Density(plane), _) => plane.log_range(),
            _ => None,
        }
    }

    /// One range for several pictures.
    pub fn common_range(&self, ranges: impl IntoIterator<Item = Option<[f64; 2]>>) -> [f64; 2] {
        match &self.field {
            Some(field) => field.scale.common_range(ranges),
            None => common_range(ranges),
        }
    }

    fn image(&self, content: ViewContent, range: [f64; 2]) -> FigureImage {
        match (&content, &self.field) {
            (ViewContent::Field(plane, shade), Some(field)) => {
                field.image(plane, shade.as_ref(), range, self.options.ground())
            }
            _ => view_content::image(content, self.colormap, range, self.options.ground()),
        }
    }

    /// World units per pixel, and notes on them.
    fn world_per_pixel(&self, view: &View, size: Size) -> std::result::Result<(f64, &'static str), MissingScaleReason> {
        let (camera, focal) = (&view.camera, view.camera.focal_pixels(size));
        match camera.projection {
            Projection::Orthographic { .. } => Ok((1.0 / focal, "")),
            Projection::Perspective { .. } => {
                // Lengths hold at the focal point; without particles near it they would mean nothing.
                let b = &self.subject.bounds;
                let inside = (0..3).all(|k| {
                    let room = 1e-6 * (b.max[k] - b.min[k]).abs();
                    (b.min[k] - room..=b.max[k] + room).contains(&camera.focal_point[k])
                });
                if !inside {
                    return Err("the camera looks at a point outside the particles");
                }
                Ok((camera.distance() / focal, "at the centre"))
            }
        }
    }

    fn scale(&self, view: &View, size: Size) -> std::result::Result<ScaleBar, MissingScaleReason> {
        let (world, note) = self.world_per_pixel(view, size)?;
        let width = world * size.width as f64;
        if !(width > 0.0 && width.is_finite()) {
            return Err("the picture has no width in world units");
        }
        let length = round_below(LONGEST_BAR * width);
        let unit = journal_unit(self.quantities.length_unit().unwrap_or_default());
        let unknown = if unit.is_empty() { "unit not known" } else { "" };
        let comoving = if self.quantities.comoving { "comoving" } else { "" };
        let notes = [unknown, comoving, note].into_iter().filter(|n| !n.is_empty()).collect::<Vec<_>>().join(", ");
        let notes = if notes.is_empty() { String::new() } else { format!(" ({notes})") };
        Ok(ScaleBar {
            share: length / width,
            label: format!("{} {unit}", number(length)).trim_end().to_string() + &notes,
        })
    }

    /// Note on a requested scale bar that a view cannot have.
    pub fn note(&self, view: &View, size: Size, kind: FileKind) -> Option<String> {
        let is_requested = self.options.has_scale(self.has_bars(), kind);
        let why = self.scale(view, size).err().filter(|_| is_requested)?;
        Some(format!("view `{}` has no scale bar: {why}", view.name))
    }

    /// Whether colours show values: densities, or those of a field.
    pub fn shows_values(&self) -> bool {
        self.about.colormap.is_some() || self.field.is_some()
    }

    fn has_bars(&self) -> bool {
        self.shows_values() || !self.legend.is_empty()
    }

    /// Whether a file of this kind contains annotations.
    pub fn is_figure(&self, kind: FileKind) -> bool {
        self.options.is_figure(self.has_bars() || !self.stamps.is_empty(), kind)
    }

    /// The text that is written into a picture.
    fn stamp(&self, view: &View) -> Option<&String> {
        match self.stamps {
            [one] => Some(one),
            all => frame_number(&view.name).and_then(|frame| all.get(frame)),
        }
    }

    /// A picture with its annotations.
    pub fn panel(&self, content: ViewContent, view: &View, range: [f64; 2], kind: FileKind) -> Result<Panel> {
        let mut panel = Panel::plain(self.image(content, range));
        let size = panel.image.size();
        if self.options.has_scale(self.has_bars(), kind) {
            panel.scale = self.scale(view, size).ok();
        }
        match self.options.axes {
            Some(FigureAxes::Frame) => {
                let unit = journal_unit(self.quantities.length_unit().unwrap_or_default());
                panel.axes = Some(axes::about(&view.camera, size, &unit)?);
            }
            Some(FigureAxes::Cube) => {
                (panel.lines, panel.names) =
                    cube::edges(&view.camera, size, &self.subject.bounds, self.subject.cell.as_ref())?;
            }
            Some(FigureAxes::None) | None => {}
        }
        let stamp = self.stamp(view).filter(|_| !self.options.no_annotations);
        panel.names.extend(stamp.map(|text| ([0.0, 0.0], text.clone())));
        // Circles go where the content goes.
        let about = self.subject.cell.filter(|_| self.subject.center.is_some());
        let about = about.and_then(|cell| CenteredCell::new(view.camera.focal_point, cell.reduced()));
        let nearest_circle = |(place, radius): &([f64; 3], f64)| {
            let shift = about.map_or([0.0; 3], |about| about.shift(*place));
            (each_axis(|k| place[k] + shift[k]), *radius)
        };
        let circles: Vec<_> = self.circles.iter().map(nearest_circle).collect();
        panel.lines.extend(cube::circles(&view.camera, size, &circles)?);
        Ok(panel)
    }

    /// Panels as a figure with one colour bar.
    pub fn figure(&self, panels: Vec<Panel>, columns: usize, range: [f64; 2]) -> Figure {
        let shows_bar = self.shows_values() && self.options.has_bar();
        let ground = self.options.ground();
        let title = || labelled(&format!("Σ{}", self.quantities.of_what()), &journal_unit(&self.quantities.unit()));
        let colors = view_content::densities(self.colormap, ground, range);
        let bar = shows_bar.then(|| match &self.field {
            Some(field) => field.bar(range),
            None => ColourBar::logarithmic(title(), range, |share| colors.at(share)),
        });
        let legend = if self.options.no_annotations { Vec::new() } else { self.legend.clone() };
        let (title, place, page) = (self.options.title.clone(), self.options.colorbar, self.options.page());
        Figure { title, panels, columns, bar, legend, place, page, ground }
    }

    /// Provenance for a file.
    pub fn about(&self, views: &[View], size: Size, range: [f64; 2]) -> Result<PngMetadata> {
        let range = self.shows_values().then_some(range);
        let views: Vec<View> = views.iter().map(|v| self.spelled_out(v)).collect();
        let mut provenance = PictureProvenance { range, ..self.about.clone() };
        // Each picture of a film has its own moment.
        if let ([source], [view]) = (&mut provenance.of[..], &views[..]) {
            source.moment = self.stamp(view).cloned().or_else(|| source.moment.take());
        }
        Ok(PngMetadata {
            title: self.options.title.clone(),
            software: format!("particlegs {}", provenance.particlegs),
            provenance: provenance.text(&views, size)?,
            dpi: self.options.dpi,
        })
    }

    /// A view with its clipping range fixed, since another model's bounds give another one.
    fn spelled_out(&self, view: &View) -> View {
        let mut camera = view.camera;
        let perspective = matches!(camera.projection, Projection::Perspective { .. });
        if camera.clipping_range.is_none() && perspective {
            camera.clipping_range = Some(particlegs_core::camera::clipping_range(&self.subject.bounds, &camera));
        }
        View { camera, ..view.clone() }
    }

    /// A frame of a film: the pixels of the figure.
    pub fn pixels(&self, content: ViewContent, view: &View, range: [f64; 2]) -> Result<(FigureImage, Option<f64>)> {
        if !self.is_figure(FileKind::Png) {
            let image = self.image(content, range);
            return Ok((image, self.options.dpi));
        }
        let panel = self.panel(content, view, range, FileKind::Png)?;
        pixels(&self.figure(vec![panel], 1, range), self.options)
    }

    /// Writes the picture of a view.
    pub fn write(
        &self,
        path: &Path,
        content: ViewContent,
        view: &View,
        range: Option<[f64; 2]>,
        kind: FileKind,
    ) -> Result<()> {
        let range = range.unwrap_or_else(|| self.common_range([self.range_of(&content)]));
        let size = match &content {
            ViewContent::Levels(g) | ViewContent::Layers(g, _) => g.size,
            ViewContent::Density(p) => p.size,
            ViewContent::Field(p, _) => p.size,
        };
        let about = self.about(std::slice::from_ref(view), size, range)?;
        let bytes = match kind {
            FileKind::Png => {
                let (image, dpi) = self.pixels(content, view, range)?;
                png_file::coded(&image, &PngMetadata { dpi, ..about })?
            }
            _ => {
                let panel = self.panel(content, view, range, kind)?;
                bytes(&self.figure(vec![panel], 1, range), self.options, kind, &about)?
            }
        };
        write_bytes(path, &bytes)
    }
}

/// A figure as pixels, and the resolution if its printed width is chosen.
fn pixels(figure: &Figure, options: &FigureOptions) -> Result<(FigureImage, Option<f64>)> {
    let size = figure.panels.first().map(|p| p.image.size());
    let Some(points) = options.width else {
        let em = size.map_or(11.0, |s| options.pixels(s));
        return Ok((FigureImage::Color(raster(&layout(figure, em, FigureSpace::Pixels)?)?), options.dpi));
    };
    // The font's pixel size depends on the figure's size in pixels, which depends on the font.
    let letters = options.letters();
    // Fails here, in points, if the letters do not fit the printed width.
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

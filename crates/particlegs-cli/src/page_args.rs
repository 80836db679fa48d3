//! Options of a page's first view. Shared by `view` and `export`.

use crate::common::{CommandContext, named};
use crate::page_models::share_length;
use crate::picture_args::{ProjectionArg, colormaps, range_of};
use clap::{Args, ValueHint};
use particlegs_core::camera::ViewSet;
use particlegs_core::codec::FileInfo;
use particlegs_core::model::{LawKind, is_species};
use particlegs_core::picture::Colormap;
use particlegs_core::{Error, NamedValue, Result};
use particlegs_figure::PaperColour;
use particlegs_files::ViewsFile;
use particlegs_files::input::name_of;
use particlegs_formats::Catalogue;
use particlegs_pictures::PictureProvenance;
use particlegs_view::page::{MOST_CIRCLES, PageOpening, PageStyle};
use std::path::{Path, PathBuf};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "How the page opens")]
pub struct PageArgs {
    /// Style that the page opens with [default: density; paraview for an alpha-blend model].
    #[arg(long, value_name = "STYLE", value_parser = named::<PageStyle>())]
    pub style: Option<PageStyle>,
    /// Background of the picture [default: black].
    #[arg(long, value_name = "COLOR", hide_short_help = true, value_parser = named::<PaperColour>())]
    pub background: Option<PaperColour>,
    /// Colour by layer.
    #[arg(long, hide_short_help = true)]
    pub color_by_layer: bool,
    /// Open with the camera, style, colours and layers stored in a saved picture.
    ///
    /// Other options on the command line override what is stored.
    #[arg(
        long,
        value_name = "PNG",
        hide_short_help = true,
        value_hint = ValueHint::FilePath,
        conflicts_with_all = CAMERA
    )]
    pub like: Option<PathBuf>,
    /// Open with the first view of a views file (JSON), as saved by the page.
    #[arg(
        long,
        value_name = "FILE",
        hide_short_help = true,
        value_hint = ValueHint::FilePath,
        conflicts_with_all = CAMERA
    )]
    pub views: Option<PathBuf>,
    /// Azimuth of the camera in degrees: 0 looks along -z, 90 along -x.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, hide_short_help = true)]
    pub azimuth: Option<f64>,
    /// Elevation of the camera above the horizon in degrees.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, hide_short_help = true)]
    pub elevation: Option<f64>,
    /// Distance of the camera, in base distances (docs/guide/pictures.md).
    #[arg(long, value_name = "D", hide_short_help = true)]
    pub distance: Option<f64>,
    /// Projection of the camera.
    #[arg(long, value_enum, value_name = "NAME", hide_short_help = true)]
    pub projection: Option<ProjectionArg>,
    /// Point that the camera looks at, world units [default: the centre of the bounds].
    #[arg(
        long = "look-at",
        value_name = "X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        hide_short_help = true
    )]
    pub look_at: Option<Vec<f64>>,
    /// Draw a circle around each centre of a list, such as the catalogue that `haloes` writes.
    ///
    /// The file is read like that of `stats --centres`; its radii are those of the circles, at most 100000.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub overlay: Option<PathBuf>,
}

const CAMERA: [&str; 5] = ["azimuth", "elevation", "distance", "projection", "look_at"];

#[derive(Args, Clone, Debug)]
pub struct AppearanceArgs {
    /// Particle radius in world units [default: the model's].
    #[arg(long, value_name = "R", hide_short_help = true)]
    pub radius: Option<f64>,
    /// Particle opacity, in (0, 1] [default: the model's].
    #[arg(long, value_name = "A", hide_short_help = true)]
    pub opacity: Option<f64>,
    /// Colour map of densities [default: inferno].
    #[arg(long, value_name = "NAME", hide_short_help = true, value_parser = colormaps())]
    pub colormap: Option<Colormap>,
    /// Densities of the first and the last colour [default: those of nearly everything drawn].
    #[arg(long, value_name = "LO,HI", value_delimiter = ',', num_args = 1, hide_short_help = true)]
    pub range: Option<Vec<f64>>,
}

impl PageArgs {
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.like, &self.views, &self.overlay].into_iter().flatten()
    }

    /// The first view of a page of these models; empty `layers` means all.
    pub fn opening(
        &self,
        dials: &AppearanceArgs,
        layers: &[String],
        models: &[&FileInfo],
        context: &CommandContext,
    ) -> Result<PageOpening> {
        let mut opening = self.own(dials)?;
        if let Some(path) = &self.views {
            opening.views = Some(views(ViewsFile::read(path, context)?.0)?);
        }
        if let Some(path) = &self.like {
            let (provenance, set) = PictureProvenance::read(path, context)?;
            // A field is a style of its own, which --style replaces.
            opening.field = provenance.field.clone().filter(|_| opening.style.is_none());
            let style = || PageStyle::from_name(&provenance.style).ok();
            opening.style = opening.style.or_else(style);
            // A range of colours means nothing for another quantity.
            let same = opening.style == Some(PageStyle::Density) && opening.field == provenance.field;
            opening.range = opening.range.or(provenance.range.filter(|_| same));
            opening.colormap = opening.colormap.or_else(|| provenance.colormap.and_then(|name| name.parse().ok()));
            opening.white = opening.white.or(provenance.background.map(|name| name == "white"));
            opening.color_by_layer |= provenance.color_by_layer;
            opening.layers = provenance.layers;
            opening.views = Some(views(set)?);
        }
        if layers != ["all"] && !layers.is_empty() {
            opening.layers = layers.to_vec();
        }
        opening.layers = own_names(&opening.layers, models)?;
        let looks = opening.style.is_some_and(|s| s != PageStyle::Paraview);
        if looks && models.iter().any(|m| m.metadata.law == LawKind::AlphaBlend) {
            let message = "an alpha-blend model has only the style paraview: its splats hold opacities, not masses";
            return Err(Error::argument(message));
        }
        if let Some(path) = &self.overlay {
            opening.circles = circles(path, models, context)?;
        }
        Ok(opening)
    }

    fn own(&self, dials: &AppearanceArgs) -> Result<PageOpening> {
        let finite = |name: &str, value: Option<f64>| match value {
            Some(v) if !v.is_finite() => Err(Error::argument(format!("--{name} {v} is not a finite angle"))),
            value => Ok(value),
        };
        let positive = |name: &str, value: Option<f64>| match value {
            Some(v) if !(v > 0.0 && v.is_finite()) => Err(Error::argument(format!("--{name} {v} must be positive"))),
            value => Ok(value),
        };
        if let Some(v) = dials.opacity.filter(|v| !(*v > 0.0 && *v <= 1.0)) {
            return Err(Error::argument(format!("--opacity {v} is outside 0 to 1 (0 is excluded)")));
        }
        let look_at = match self.look_at.as_deref() {
            None => None,
            Some([x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Some([*x, *y, *z]),
            Some(_) => return Err(Error::argument("--look-at takes X,Y,Z, each a finite number")),
        };
        Ok(PageOpening {
            style: self.style,
            field: None,
            colormap: dials.colormap,
            range: range_of(dials.range.as_deref())?,
            white: self.background.map(|b| b == PaperColour::White),
            color_by_layer: self.color_by_layer,
            layers: Vec::new(),
            radius: positive("radius", dials.radius)?,
            opacity: dials.opacity,
            views: None,
            azimuth: finite("azimuth", self.azimuth)?,
            elevation: finite("elevation", self.elevation)?.map(|e| e.clamp(-90.0, 90.0)),
            distance: positive("distance", self.distance)?,
            look_at,
            orthographic: self.projection.map(|p| p == ProjectionArg::Orthographic),
            circles: Vec::new(),
        })
    }
}

/// The layers of all models with these names or species.
fn own_names(names: &[String], models: &[&FileInfo]) -> Result<Vec<String>> {
    let layers: Vec<_> = models.iter().flat_map(|m| m.species_layers()).collect();
    let layer_names: Vec<&str> = layers.iter().map(|l| &l.name[..]).collect();
    // The name of a layer comes before a species of the same name.
    let is_match =
        |layer: &str, name: &str| if layer_names.contains(&name) { layer == name } else { is_species(layer, name) };
    if let Some(name) = names.iter().find(|n| !layer_names.iter().any(|l| is_match(l, n))) {
        return Err(Error::argument(format!("no layer `{name}`: the layers are {}", layer_names.join(", "))));
    }
    let mut matching_names: Vec<String> = Vec::new();
    for layer in layer_names.iter().filter(|l| names.iter().any(|n| is_match(l, n))) {
        if !matching_names.iter().any(|o| o == layer) {
            matching_names.push((*layer).into());
        }
    }
    Ok(matching_names)
}

/// Centres and radii of the circles over all models.
fn circles(path: &Path, models: &[&FileInfo], context: &CommandContext) -> Result<Vec<([f64; 3], f64)>> {
    let Some((first, others)) = models.split_first() else { return Ok(Vec::new()) };
    let m = &first.metadata;
    if others.iter().any(|other| !share_length(&other.metadata, m)) {
        let message = "--overlay draws the same circles over all models, but these have different units of length";
        return Err(Error::argument_with(message, "open each model in a page of its own"));
    }
    let circles = Catalogue::circles(path, (m.unit_system(), m.cell), context)?;
    if circles.len() > MOST_CIRCLES {
        let message = format!("{} circles are more than the {MOST_CIRCLES} that a page can hold", circles.len());
        return Err(Error::input_with(name_of(path), message, "list only the largest haloes"));
    }
    Ok(circles)
}

/// A views file for the page.
fn views(set: ViewSet) -> Result<serde_json::Value> {
    let text = ViewsFile(set).text()?;
    serde_json::from_str(&text).map_err(|e| Error::argument(e.to_string()))
}

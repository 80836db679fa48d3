//! Options of pictures, shared by `render` and `reference`: views, figures, films, surface densities and fields.

use crate::common::named;
use clap::builder::TypedValueParser;
use clap::{Args, ValueEnum, ValueHint};
use particlegs_core::picture::{Colormap, Size, ValueScale};
use particlegs_core::{Error, Result};
use particlegs_figure::{BarPlacement, PaperColour};
use particlegs_pictures::{
    FieldOptions, FigureAxes, FigureOptions, FilmLength, FilmOptions, PictureCenter, ViewFit, ViewOptions,
};
use std::path::PathBuf;

/// Options of views, radius and opacity.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "View options")]
pub struct ViewArgs {
    /// Views file (JSON): draw one picture per view.
    ///
    /// Without it a single view named `view` is drawn, from --azimuth, --elevation and --distance.
    /// docs/guide/pictures.md describes the file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub views: Option<PathBuf>,
    /// Save the views that are drawn as a views file.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub save_views: Option<PathBuf>,
    /// Azimuth of the camera in degrees.
    ///
    /// 0 looks along -z, 90 along -x.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, conflicts_with = "views")]
    pub azimuth: f64,
    /// Elevation of the camera above the horizon in degrees.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, conflicts_with = "views")]
    pub elevation: f64,
    /// Distance of the camera from the centre, in base distances.
    ///
    /// 1 is 0.65 of the distance of ParaView's Reset Camera (docs/guide/pictures.md), or, with --fit, the closest
    /// distance at which everything fits.
    #[arg(long, value_name = "D", default_value_t = 1.0, conflicts_with = "views")]
    pub distance: f64,
    /// Particle radius in world units [default: the view's, else the default].
    ///
    /// The default is that of the model, or 0.0406 of the mean particle spacing.
    #[arg(long, value_name = "R")]
    pub radius: Option<f64>,
    /// Particle opacity, in (0, 1] [default: the view's, else the default].
    ///
    /// The default is that of the model, or 0.05.
    #[arg(long, value_name = "A")]
    pub opacity: Option<f64>,
    /// Picture size in pixels [default: the views file's, else 1920x1080].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Projection of the camera.
    #[arg(
        long,
        value_enum,
        value_name = "NAME",
        default_value_t = ProjectionArg::Perspective,
        hide_short_help = true,
        conflicts_with = "views"
    )]
    pub projection: ProjectionArg,
    /// Centre of the picture [default: the centre of the bounds, or of the box in orthographic pictures].
    ///
    /// A place X,Y,Z in world units; of a model also the centre of mass of layers, named as by --layer, or of a region
    /// x0,x1,y0,y1,z0,z1. In a film of a series the camera follows that. Content of a periodic box is moved to its images
    /// about a centre of mass.
    #[arg(
        long,
        value_name = "X,Y,Z|NAME,...",
        allow_hyphen_values = true,
        hide_short_help = true,
        conflicts_with = "views"
    )]
    pub center: Option<PictureCenter>,
    /// Width of the picture in world units [default: the whole box].
    ///
    /// In perspective, the width at the centre, instead of --distance.
    #[arg(long, value_name = "W", hide_short_help = true, conflicts_with = "views")]
    pub width: Option<f64>,
    /// Depth of the slab around the centre, world units [default: everything].
    ///
    /// Only particles with their centres in it count. By default an orthographic density counts every particle once.
    #[arg(long, value_name = "D", hide_short_help = true, conflicts_with = "views")]
    pub depth: Option<f64>,
    /// Frame this as tightly as possible.
    #[arg(long, value_name = "WHAT", hide_short_help = true, value_parser = named::<ViewFit>(), conflicts_with_all = ["views", "width"])]
    pub fit: Option<ViewFit>,
}

/// The lines of sight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProjectionArg {
    /// Lines of sight through the eye.
    Perspective,
    /// Parallel lines of sight; a map of part of a periodic box continues with periodic copies.
    Orthographic,
}

impl ViewArgs {
    pub fn options(&self) -> ViewOptions {
        ViewOptions {
            views: self.views.clone(),
            save_views: self.save_views.clone(),
            azimuth: self.azimuth,
            elevation: self.elevation,
            distance: self.distance,
            radius: self.radius,
            opacity: self.opacity,
            size: self.size,
            orthographic: self.projection == ProjectionArg::Orthographic,
            center: self.center.clone(),
            width: self.width,
            depth: self.depth,
            fit: self.fit,
        }
    }
}

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
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath, conflicts_with = "no_annotations")]
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
fn parse_length(text: &str) -> std::result::Result<f64, String> {
    let fail = || format!("`{text}` is not a width: give a number with its unit, such as 84mm, 17cm, 3.3in or 240pt");
    let split = text.find(|c: char| c.is_ascii_alphabetic()).ok_or_else(fail)?;
    let (number, unit) = text.split_at(split);
    let value: f64 = number.trim().parse().map_err(|_| fail())?;
    let points = value
        * match unit {
            // An inch has 72 points and 25.4 mm.
            "mm" => 72.0 / 25.4,
            "cm" => 720.0 / 25.4,
            "in" => 72.0,
            "pt" => 1.0,
            _ => return Err(fail()),
        };
    Ok(points)
}

/// Options of frames and films.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Films")]
pub struct SequenceArgs {
    /// Draw N frames of one turn around the vertical axis: frame_0000.png, ...
    #[arg(long, value_name = "N", conflicts_with = "path")]
    pub turntable: Option<usize>,
    /// Move the camera through the views of a views file, used as key frames.
    ///
    /// Positions, orientations and distances change smoothly, and pass through every key frame.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath, conflicts_with = "views")]
    pub path: Option<PathBuf>,
    /// Number of frames of the path [default: 60 from each key frame to the next], or of a film of a series.
    ///
    /// `all` draws each frame of a series once; a number is spread evenly over its time, and pictures between frames are
    /// interpolated. --turntable N then turns the camera once in N pictures.
    #[arg(long, value_name = "N|all", hide_short_help = true)]
    pub frames: Option<FilmLength>,
    /// Join the frames into a film: NAME.mp4 or NAME.webm (both need ffmpeg), or NAME.gif.
    ///
    /// Without ffmpeg the frames are kept, and the command that joins them is printed.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = ValueHint::FilePath)]
    pub video: Option<PathBuf>,
    /// Frames per second of the film.
    #[arg(long, value_name = "N", default_value_t = 30, hide_short_help = true, requires = "video")]
    pub fps: u32,
}

impl SequenceArgs {
    pub fn options(&self) -> FilmOptions {
        let (path, video) = (self.path.clone(), self.video.clone());
        FilmOptions { turntable: self.turntable, path, frames: self.frames, video, fps: self.fps }
    }
}

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of --style density")]
pub struct DensityArgs {
    /// Colour map [default: inferno].
    #[arg(long, value_name = "NAME", hide_short_help = true, value_parser = colormaps())]
    pub colormap: Option<Colormap>,
    /// Values of the first and the last colour [default: 5th to 99.5th percentile of occupied pixels].
    #[arg(
        long,
        value_name = "LO,HI",
        value_delimiter = ',',
        num_args = 1,
        hide_short_help = true,
        allow_hyphen_values = true
    )]
    pub range: Option<Vec<f64>>,
    /// Write the values instead of a picture: NAME.f32 (rows from the top; NAME.f64 where float32 does not hold a field)
    /// and NAME.json.
    #[arg(long, hide_short_help = true)]
    pub raw: bool,
}

pub fn colormaps() -> impl TypedValueParser<Value = Colormap> {
    named()
}

pub fn range_of(numbers: Option<&[f64]>) -> Result<Option<[f64; 2]>> {
    match numbers {
        None => Ok(None),
        // The colours of densities are logarithmic.
        Some([lo, hi]) if *lo > 0.0 && hi > lo && hi.is_finite() => Ok(Some([*lo, *hi])),
        Some(_) => Err(Error::argument("--range takes LO,HI with 0 < LO < HI")),
    }
}

impl DensityArgs {
    /// The range of colours, whatever they show.
    pub fn range(&self) -> Result<Option<[f64; 2]>> {
        // Values of a field may be negative, so the range is checked where it is known what is drawn.
        let two = |range: &[f64]| range.try_into().map_err(|_| Error::argument("--range takes two numbers LO,HI"));
        self.range.as_deref().map(two).transpose()
    }
}

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Field options")]
pub struct FieldArgs {
    /// Show a field: its mean along each line of sight, such as temperature or velocity.los.
    ///
    /// A vector needs a component: velocity.x, velocity.y, velocity.z, or velocity.los, positive away from the
    /// observer. dispersion.los is the dispersion of the velocity, dispersion.temperature that of the temperature. Means
    /// are weighted by mass, or by numbers of particles where no masses are known. `info` lists the fields.
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub field: Option<String>,
    /// Scale of the field's colours [default: signed for vectors, log for positive values over a wide range].
    #[arg(long, value_name = "SCALE", hide_short_help = true, value_parser = named::<ValueScale>())]
    pub scale: Option<ValueScale>,
    /// Motion to subtract from a vector: `mean`, the mean of all particles, or X,Y,Z in its unit.
    #[arg(long, value_name = "mean|X,Y,Z", hide_short_help = true, allow_hyphen_values = true)]
    pub bulk: Option<String>,
    /// Weight of means along the line of sight [default: mass].
    ///
    /// mass, count (all particles alike), or the name of a positive scalar field: its value times mass. Both fields must be
    /// in the model.
    #[arg(long, value_name = "mass|count|NAME", hide_short_help = true)]
    pub field_weight: Option<String>,
    /// Shade the field's colours by surface density: bright where there is much mass.
    #[arg(long, hide_short_help = true)]
    pub shade: bool,
}

impl FieldArgs {
    pub fn options(&self) -> FieldOptions {
        let (name, weight) = (self.field.clone(), self.field_weight.clone());
        FieldOptions { name, scale: self.scale, bulk: self.bulk.clone(), weight, shade: self.shade }
    }
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

//! Options of views: a views file, or one camera. Shared by `reference` and `render`.

use crate::common::named;
use clap::{Args, ValueEnum, ValueHint};
use particlegs_core::picture::Size;
use particlegs_pictures::{PictureCenter, ViewFit, ViewOptions};
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

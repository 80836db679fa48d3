//! Surface density on the command line: the window, the colours, the files. Shared by `render` and
//! `reference`.

use crate::annotate::{DensityPicture, ScaleBar, annotate_density};
use crate::common::Context;
use crate::density_file::{self, Means};
use crate::outputs::{JSON, VALUES};
use crate::picture_out::PictureOut;
use crate::view_args::{Subject, ViewArgs};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use particlegs::camera::{DensityView, Frame, Projection, Window, spherical_camera};
use particlegs::model::Model;
use particlegs::particles::Particles;
use particlegs::picture::{Colormap, Plane, Size, write_png};
use particlegs::space::Cell;
use particlegs::{Error, Result};
use std::path::PathBuf;

/// How surface density is drawn.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of --style density")]
pub struct DensityArgs {
    /// Colour map.
    #[arg(long, value_name = "NAME", default_value = "inferno", hide_short_help = true, value_parser = colormaps())]
    pub colormap: Colormap,
    /// Values of the first and the last colour [default: from the picture].
    #[arg(long, value_name = "LO,HI", value_delimiter = ',', num_args = 1, hide_short_help = true)]
    pub range: Option<Vec<f64>>,
    /// Projection of the camera.
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Lines::Perspective, hide_short_help = true)]
    pub projection: Lines,
    /// Centre of the orthographic window [default: the centre of the bounds].
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        hide_short_help = true
    )]
    pub center: Option<Vec<f64>>,
    /// Width of the orthographic window in world units [default: the box].
    #[arg(long, value_name = "W", hide_short_help = true)]
    pub width: Option<f64>,
    /// Depth of the orthographic window in world units [default: one periodic box, else everything].
    #[arg(long, value_name = "D", hide_short_help = true)]
    pub depth: Option<f64>,
    /// Write the values instead of a picture: NAME.f32 (rows from the top) and NAME.json.
    #[arg(long, hide_short_help = true)]
    pub raw: bool,
    /// Draw no colour bar and no scale bar.
    #[arg(long, hide_short_help = true)]
    pub no_annotations: bool,
}

/// The lines of sight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Lines {
    /// Lines of sight through the eye.
    Perspective,
    /// Parallel lines of sight; the window repeats a periodic box.
    Orthographic,
}

/// The colour maps by name, so that help and completion list them.
fn colormaps() -> impl TypedValueParser<Value = Colormap> {
    PossibleValuesParser::new(Colormap::ALL.map(Colormap::name)).try_map(|name| name.parse::<Colormap>())
}

/// What a snapshot or a model says about its masses and lengths, and what a density of it is.
#[derive(Clone, Debug)]
pub struct Quantities {
    cell: Option<Cell>,
    length_unit: Option<String>,
    mass_unit: Option<String>,
    comoving: bool,
    smooth: Option<usize>,
}

impl Quantities {
    /// Of a snapshot, each of whose particles may be spread over some neighbours.
    pub fn of_particles(p: &Particles, smooth: Option<usize>) -> Self {
        let m = &p.meta;
        let known = p.weights().is_some() || m.particle_mass.is_some();
        Quantities {
            cell: m.cell,
            length_unit: m.length_unit.clone(),
            mass_unit: known.then(|| m.mass_unit.clone().unwrap_or_else(|| "mass".into())),
            comoving: m.comoving == Some(true),
            smooth,
        }
    }

    /// Of a model.
    pub fn of_model(model: &Model) -> Self {
        let (m, known) = (&model.metadata, model.has_masses());
        Quantities {
            cell: m.cell,
            length_unit: m.length_unit.clone(),
            mass_unit: known.then(|| m.mass_unit.clone().unwrap_or_else(|| "mass".into())),
            comoving: m.comoving == Some(true),
            smooth: None,
        }
    }

    /// Unit of surface density: `Msun/h / (Mpc/h)²`, or particles where no mass is known.
    pub fn unit(&self) -> String {
        let mass = self.mass_unit.as_deref().unwrap_or("particles");
        match self.length_unit.as_deref() {
            None => format!("{mass} / length²"),
            Some(l) if l.contains(['/', ' ']) => format!("{mass} / ({l})²"),
            Some(l) => format!("{mass} / {l}²"),
        }
    }
}

impl DensityArgs {
    /// The views to draw.
    ///
    /// # Errors
    /// [`Error::Argument`] for numbers outside their range.
    pub fn views(
        &self,
        views: &ViewArgs,
        subject: &Subject,
        q: &Quantities,
        context: &Context,
    ) -> Result<(Size, Vec<DensityView>)> {
        if let Some(range) = &self.range
            && !(range.len() == 2 && range[0] > 0.0 && range[1] > range[0] && range[1].is_finite())
        {
            return Err(Error::argument("--range takes LO,HI with 0 < LO < HI"));
        }
        if self.projection == Lines::Perspective {
            let set = views.resolve(subject, context)?;
            return Ok((set.size, set.views.iter().map(|v| DensityView::of_view(v, &subject.bounds)).collect()));
        }
        if views.save_views.is_some() {
            return Err(Error::argument(
                "--save-views cannot be used with --projection orthographic: a views file holds perspective views only",
            ));
        }
        let size = views.size.unwrap_or(Size { width: 1920, height: 1080 });
        let center = match self.center.as_deref() {
            None => subject.bounds.center(),
            Some([x, y, z]) => [*x, *y, *z],
            Some(_) => return Err(Error::argument("--center takes X,Y,Z")),
        };
        let angles = [views.azimuth, views.elevation];
        let frame = spherical_camera([0.0; 3], angles[0], angles[1], 1.0).frame()?;
        let width = self.width.unwrap_or_else(|| default_width(&frame, subject, size, q.cell.is_some()));
        let window = Window { center, angles_deg: angles, width, depth: self.depth };
        let view = DensityView::orthographic("view", &window, size, &subject.bounds, q.cell)?;
        Ok((size, vec![view]))
    }

    /// Says what is written of these views.
    ///
    /// # Errors
    /// Those of [`Context::writes`].
    pub fn plan(&self, out: &PictureOut, views: &[DensityView], context: &Context) -> Result<()> {
        if !self.raw {
            return out.pictures(views.iter().map(|v| &v.name[..]), context).map(drop);
        }
        let path = |view: &DensityView, ending| out.folder().join(format!("{}.{ending}", view.name));
        views.iter().try_for_each(|view| {
            context.writes(&path(view, "f32"), &VALUES)?;
            context.writes(&path(view, "json"), &JSON).map(drop)
        })
    }

    /// Writes a plane as a picture or as raw values; the path written.
    pub fn write(&self, out: &PictureOut, view: &DensityView, plane: &Plane, q: &Quantities) -> Result<PathBuf> {
        let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
        let focal = view.camera.focal_pixels(plane.size);
        let world_per_pixel = if perspective { view.camera.distance() / focal } else { 1.0 / focal };
        if self.raw {
            let (unit, comoving, smooth) = (q.unit(), q.comoving, q.smooth);
            return density_file::write(out.folder(), view, plane, Means { unit, comoving, smooth, world_per_pixel });
        }
        let options = DensityPicture {
            colormap: self.colormap,
            range: self.range.as_deref().map(|r| [r[0], r[1]]),
            unit: q.unit().replace("Msun", "M☉"),
            scale_bar: ScaleBar {
                world_per_pixel,
                unit: q.length_unit.clone().unwrap_or_default(),
                comoving: q.comoving,
                note: if perspective { "at the focal point".into() } else { String::new() },
            },
            annotations: !self.no_annotations,
        };
        let path = out.picture(&view.name);
        let picture = annotate_density(plane, &options);
        write_png(&path, picture.size, picture.data.as_flattened())?;
        Ok(path)
    }
}

/// One box across where it repeats, else everything inside the picture.
fn default_width(frame: &Frame, subject: &Subject, size: Size, repeats: bool) -> f64 {
    let extent = subject.bounds.extent_nonzero();
    let along = |axis: usize| (0..3).map(|k| frame.axes[axis][k].abs() * extent[k]).sum::<f64>();
    let (across, down) = (along(0), along(1) * size.width as f64 / size.height as f64);
    if repeats { across.min(down) } else { across.max(down) }
}

//! Options of surface densities: colours, and values instead of pictures. Shared by `render` and `reference`.

use crate::common::{CommandContext, named};
use crate::density_file::{self, Means};
use crate::drawing::ViewContent;
use crate::drawing::field_colors::FieldLegend;
use crate::outputs::{JSON, VALUES};
use crate::picture_out::PictureOut;
use clap::Args;
use clap::builder::TypedValueParser;
use particlegs_core::camera::{DensityView, Projection, View};
use particlegs_core::math::float32_holds;
use particlegs_core::model::{Model, Units};
use particlegs_core::picture::{Colormap, Plane};
use particlegs_core::{Error, Result};
use particlegs_particles::Particles;
use std::path::PathBuf;

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

/// Units of a snapshot or model, and the meaning of its density.
#[derive(Clone, Debug)]
pub struct Quantities {
    length_unit: Option<String>,
    mass_unit: Option<String>,
    /// Name of the weights, if they are not masses.
    weight_name: Option<String>,
    comoving: bool,
    smooth: Option<usize>,
}

impl Quantities {
    /// For a snapshot, whose particles may be smoothed over neighbours.
    pub fn from_particles(p: &Particles, smooth: Option<usize>) -> Self {
        let (m, known) = (&p.meta, p.weights().is_some() || p.meta.particle_mass.is_some());
        Quantities { smooth, ..Quantities::new(&m.units, known, m.weight_name.as_deref()) }
    }

    pub fn from_model(model: &Model) -> Self {
        let m = &model.metadata;
        Quantities::new(&m.units, model.has_masses(), m.weight_name())
    }

    fn new(units: &Units, has_masses: bool, weight_name: Option<&str>) -> Self {
        Quantities {
            length_unit: units.length_text().map(str::to_string),
            mass_unit: has_masses.then(|| units.mass_text().unwrap_or("mass").to_string()),
            weight_name: weight_name.map(str::to_string),
            comoving: units.comoving == Some(true),
            smooth: None,
        }
    }

    /// Unit of length, as the file has it.
    pub fn length_unit(&self) -> Option<&str> {
        self.length_unit.as_deref()
    }

    pub fn is_comoving(&self) -> bool {
        self.comoving
    }

    /// The summed quantity, if it is not mass: ` of Charge`.
    pub fn of_what(&self) -> String {
        self.weight_name.as_ref().map_or_else(String::new, |name| format!(" of {name}"))
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

pub fn range_of(asked: Option<&[f64]>) -> Result<Option<[f64; 2]>> {
    match asked {
        None => Ok(None),
        Some([lo, hi]) if *lo > 0.0 && hi > lo && hi.is_finite() => Ok(Some([*lo, *hi])),
        Some(_) => Err(Error::argument("--range takes LO,HI with 0 < LO < HI")),
    }
}

impl DensityArgs {
    pub fn asked_range(&self) -> Result<Option<[f64; 2]>> {
        range_of(self.range.as_deref())
    }

    /// The range of a field's colours, which may be negative.
    pub fn field_range(&self) -> Result<Option<[f64; 2]>> {
        match self.range.as_deref() {
            None => Ok(None),
            Some([lo, hi]) if lo < hi && lo.is_finite() && hi.is_finite() => Ok(Some([*lo, *hi])),
            Some(_) => Err(Error::argument("--range takes LO,HI with LO < HI")),
        }
    }

    /// Declares the files of values for these views.
    pub fn plan_raw(&self, out: &PictureOut, views: &[View], context: &CommandContext) -> Result<()> {
        let path = |view: &View, ending| out.folder().join(format!("{}.{ending}", view.name));
        views.iter().try_for_each(|view| {
            context.writes(&path(view, "f32"), &VALUES)?;
            context.writes(&path(view, "f64"), &VALUES)?;
            context.writes(&path(view, "json"), &JSON).map(drop)
        })
    }

    /// Writes the values of a density, or of a field that is shown instead: as float64 where float32 does not hold
    /// them.
    pub fn write_raw(
        &self,
        out: &PictureOut,
        view: &DensityView,
        seen: &ViewContent,
        q: &Quantities,
        field: Option<&FieldLegend>,
    ) -> Result<PathBuf> {
        let (plane, wide) = match seen {
            ViewContent::Field(plane, _) => {
                let there = || plane.data.iter().copied().filter(|v| v.is_finite());
                let range = [there().fold(f64::INFINITY, f64::min), there().fold(f64::NEG_INFINITY, f64::max)];
                (plane.clone(), range[0] <= range[1] && !float32_holds(range))
            }
            ViewContent::Density(plane) => {
                (Plane { size: plane.size, data: plane.data.iter().map(|v| f64::from(*v)).collect() }, false)
            }
            _ => return Err(Error::argument("--raw writes values of densities and fields")),
        };
        let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
        let focal = view.camera.focal_pixels(plane.size);
        let world_per_pixel = if perspective { view.camera.distance() / focal } else { 1.0 / focal };
        let (comoving, smooth) = (q.comoving, q.smooth);
        let (quantity, unit) = match field {
            Some(field) => (field.title.clone(), field.unit.clone()),
            None => (format!("surface density{}", q.of_what()), q.unit()),
        };
        let means = Means { quantity, unit, comoving, smooth, world_per_pixel };
        density_file::write(out.folder(), view, (&plane, wide), means)
    }
}

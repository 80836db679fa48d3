//! Which views to draw: a views file, or one camera from options. Shared by `reference` and `render`.

use crate::common::CommandContext;
use crate::outputs::JSON;
use clap::{Args, ValueEnum, ValueHint};
use particlegs_core::camera::{
    Camera, DensityView, Extent, FOV_DEG, Frame, Projection, View, ViewSet, Window, WindowContent, base_distance,
    spherical_camera,
};
use particlegs_core::math::each_axis;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::Scene;
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Result, render};
use particlegs_files::ViewsFile;
use particlegs_files::output::write_bytes;
use particlegs_measure::stats::mass_center;
use particlegs_particles::Domain;
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
        value_parser = PictureCenter::parse,
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
    #[arg(long, value_enum, value_name = "WHAT", hide_short_help = true, conflicts_with_all = ["views", "width"])]
    pub fit: Option<Fit>,
}

/// What is in the middle of a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum PictureCenter {
    /// A place, world units.
    Place([f64; 3]),
    /// The centre of the mass in a part of the world.
    Region(Bounds),
    /// The centre of mass of layers; of all where none are named.
    Layers(Vec<String>),
}

impl PictureCenter {
    fn parse(text: &str) -> std::result::Result<PictureCenter, String> {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let numbers: Option<Vec<f64>> = words.iter().map(|w| w.parse().ok()).collect();
        let finite = numbers.iter().flatten().all(|v| v.is_finite());
        match numbers.as_deref() {
            Some(&[x, y, z]) if finite => Ok(PictureCenter::Place([x, y, z])),
            Some(&[x0, x1, y0, y1, z0, z1]) if finite => {
                Ok(PictureCenter::Region(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] }))
            }
            Some(_) => Err("--center takes X,Y,Z, each a finite number, a region x0,x1,y0,y1,z0,z1, or layers".into()),
            None if words == ["all"] => Ok(PictureCenter::Layers(Vec::new())),
            None => Ok(PictureCenter::Layers(words.into_iter().map(String::from).collect())),
        }
    }

    /// Is it a centre of mass?
    pub fn is_of_mass(&self) -> bool {
        !matches!(self, PictureCenter::Place(_))
    }

    /// The place in a model, which `of` names in errors.
    pub fn of_model(&self, model: &Model, of: &str, context: &CommandContext) -> Result<[f64; 3]> {
        let (layers, region) = match self {
            PictureCenter::Place(place) => return Ok(*place),
            PictureCenter::Region(bounds) => (&[][..], Some(bounds)),
            PictureCenter::Layers(names) => (&names[..], None),
        };
        if model.metadata.law == LawKind::AlphaBlend {
            return Err(Error::input(of, "an alpha-blend model has no centre of mass: its splats hold opacities"));
        }
        let found = mass_center(&Domain::from_model(model), model, layers, region)?;
        let found = found.ok_or_else(|| Error::input(of, "there is no mass where --center asks for its centre"))?;
        let axes: Vec<&str> = ["x", "y", "z"].into_iter().zip(found.filled).filter(|a| a.1).map(|a| a.0).collect();
        if axes.len() == 3 {
            let what = "--center: this mass fills the periodic box, and has no centre";
            return Err(Error::input_with(of, what, "name a region or a place"));
        }
        if !axes.is_empty() {
            let axes = axes.join(" and ");
            context.message(&format!("note: --center: the mass fills the box along {axes}, and has no centre there: the middle of the box is taken"));
        }
        Ok(found.place)
    }
}

/// The lines of sight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProjectionArg {
    /// Lines of sight through the eye.
    Perspective,
    /// Parallel lines of sight; a map of part of a periodic box continues with periodic copies.
    Orthographic,
}

/// What must fit into a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Fit {
    /// The simulation box.
    Box,
    /// The bounds of the particles.
    Data,
}

impl Fit {
    fn corners(self, subject: &ViewSubject) -> Result<[[f64; 3]; 8]> {
        match (self, subject.cell) {
            (Fit::Box, Some(cell)) => Ok(cell.corners()),
            (Fit::Box, None) => {
                let what = "--fit box: no simulation box is known".to_string();
                Err(Error::argument_with(what, "fit the particles with --fit data"))
            }
            (Fit::Data, _) => Ok(subject.bounds.corners()),
        }
    }
}

/// The middle of corners.
fn center(corners: &[[f64; 3]; 8]) -> [f64; 3] {
    each_axis(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 8.0)
}

fn fitted(length: f64) -> Result<f64> {
    let fault = || Error::argument("--fit: there is no extent to fit; choose --width or --distance");
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err(fault()) }
}

/// Properties of a snapshot or model that views depend on.
#[derive(Clone, Copy, Debug)]
pub struct ViewSubject {
    /// Bounds of the whole snapshot, world units.
    pub bounds: Bounds,
    /// Its cell, if it has one.
    pub cell: Option<Cell>,
    /// What an orthographic picture shows completely.
    pub extent: Extent,
    /// Default particle radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
    /// Is a surface density drawn?
    pub density: bool,
    /// The centre of mass that pictures are about, if that was asked for.
    pub center: Option<[f64; 3]>,
}

impl ViewArgs {
    /// Applies the options size, radius and opacity to views, and checks every view.
    pub fn apply(&self, set: &mut ViewSet) -> Result<()> {
        if let Some(size) = self.size {
            set.size = size;
        }
        for view in &mut set.views {
            view.radius = self.radius.unwrap_or(view.radius);
            view.opacity = self.opacity.unwrap_or(view.opacity);
            view.check(set.size)?;
        }
        Ok(())
    }

    /// Writes the views to --save-views, if given.
    pub fn save(&self, set: &ViewSet, context: &CommandContext) -> Result<()> {
        if let Some(path) = &self.save_views {
            context.writes(path, &JSON)?;
            write_bytes(path, ViewsFile(set.clone()).text()?.as_bytes())?;
        }
        Ok(())
    }

    /// One view; it must fit at all rotations in `turned`.
    pub fn one_view(&self, subject: &ViewSubject, turned: &[f64]) -> Result<ViewSet> {
        if !(self.distance > 0.0 && self.distance.is_finite()) {
            return Err(Error::argument(format!("--distance {} must be positive", self.distance)));
        }
        for (name, degrees) in [("azimuth", self.azimuth), ("elevation", self.elevation)] {
            if !degrees.is_finite() {
                return Err(Error::argument(format!("--{name} {degrees} is not a finite angle")));
            }
        }
        for (name, length) in [("width", self.width), ("depth", self.depth)] {
            if let Some(l) = length.filter(|l| !(*l > 0.0 && l.is_finite())) {
                return Err(Error::argument(format!("--{name} {l} must be positive, in world units")));
            }
        }
        let size = self.size.unwrap_or(Size { width: 1920, height: 1080 });
        let center = match (&self.center, subject.center) {
            (Some(PictureCenter::Place(place)), _) => *place,
            (_, Some(center)) => center,
            (Some(_), None) => {
                return Err(Error::argument("--center takes X,Y,Z here; layers and regions are those of models"));
            }
            (None, None) => self.default_center(subject)?,
        };
        let camera = match self.projection {
            ProjectionArg::Perspective => self.perspective(subject, center, size, turned)?,
            ProjectionArg::Orthographic => self.orthographic(subject, center, size, turned)?,
        };
        let view = View { name: "view".into(), camera, radius: subject.radius, opacity: subject.opacity };
        Ok(ViewSet { size, views: vec![view] })
    }

    fn default_center(&self, subject: &ViewSubject) -> Result<[f64; 3]> {
        Ok(match self.fit {
            Some(Fit::Box) => center(&Fit::Box.corners(subject)?),
            _ if self.projection == ProjectionArg::Orthographic => subject.extent.center,
            _ => subject.bounds.center(),
        })
    }

    fn perspective(&self, subject: &ViewSubject, center: [f64; 3], size: Size, turned: &[f64]) -> Result<Camera> {
        let slope = (0.5 * FOV_DEG.to_radians()).tan();
        let aspect = size.width as f64 / size.height as f64;
        let distance = match (self.width, self.fit) {
            (Some(width), _) => 0.5 * width / (slope * aspect),
            (None, Some(fit)) => {
                let content = WindowContent { points: &fit.corners(subject)?, center, frames: &self.frames(turned)? };
                self.distance * fitted(content.distance([slope * aspect, slope]))?
            }
            (None, None) => self.distance * base_distance(&subject.bounds, size),
        };
        let mut camera = spherical_camera(center, self.azimuth, self.elevation, distance);
        if let Some(depth) = self.depth {
            let near = (distance - 0.5 * depth).max(1e-3 * distance);
            camera.clipping_range = Some([near, distance + 0.5 * depth]);
        }
        Ok(camera)
    }

    fn orthographic(&self, subject: &ViewSubject, center: [f64; 3], size: Size, turned: &[f64]) -> Result<Camera> {
        let frames = &self.frames(turned)?;
        let width = match (self.width, self.fit) {
            (Some(width), _) => width,
            (None, Some(fit)) => fitted(WindowContent { points: &fit.corners(subject)?, center, frames }.width(size))?,
            (None, None) => frames.iter().map(|frame| subject.extent.width(frame, size)).fold(0.0, f64::max),
        };
        let window = Window { center, angles_deg: [self.azimuth, self.elevation], width, depth: self.depth };
        Ok(DensityView::orthographic("view", &window, size, &subject.bounds, subject.cell)?.camera)
    }

    /// Camera axes for every direction.
    fn frames(&self, turned: &[f64]) -> Result<Vec<Frame>> {
        let more = if turned.is_empty() { &[0.0][..] } else { turned };
        more.iter().map(|by| spherical_camera([0.0; 3], self.azimuth + by, self.elevation, 1.0).frame()).collect()
    }

    /// Note on the default width of a window.
    pub fn note(&self, subject: &ViewSubject, set: &ViewSet, unit: &str) -> Option<String> {
        let chosen = self.views.is_some() || self.width.is_some() || self.fit.is_some();
        if chosen || self.projection == ProjectionArg::Perspective || subject.repeats() {
            return None;
        }
        let Projection::Orthographic { height_world } = set.views.first()?.camera.projection else { return None };
        let width = crate::figure::number(height_world * set.size.width as f64 / set.size.height as f64);
        let width = format!("{width} {unit}");
        Some(format!("note: no --width given: the window spans the particles' bounds, {} across", width.trim()))
    }
}

impl ViewSubject {
    /// For a model.
    pub fn of_model(model: &Model, density: bool) -> Self {
        let m = &model.metadata;
        let (bounds, cell) = (m.bounds, m.cell);
        let extent = match density {
            true => render::extent(&Scene::new(model), cell.as_ref()),
            false => Extent::new(&bounds, cell.as_ref()),
        };
        ViewSubject {
            bounds,
            cell,
            extent,
            radius: m.default_radius,
            opacity: m.default_opacity,
            density,
            center: None,
        }
    }

    /// The subject of all pictures of a film, whose bounds move with what they are about.
    pub fn through(&self, set: &ViewSet) -> ViewSubject {
        let Some(center) = self.center else { return *self };
        let moved = |view: &View| {
            let shift: [f64; 3] = each_axis(|k| view.camera.focal_point[k] - center[k]);
            let [min, max] = [self.bounds.min, self.bounds.max].map(|p| each_axis(|k| p[k] + shift[k]));
            Bounds { min, max }
        };
        let bounds = set.views.iter().map(moved).fold(self.bounds, |all, own| all.union(&own));
        ViewSubject { bounds, ..*self }
    }

    pub fn repeats(&self) -> bool {
        self.density && self.cell.is_some_and(|c| c.periodic.contains(&true))
    }

    pub fn density_view(&self, view: &View, size: Size) -> DensityView {
        DensityView::of_cell(view, size, &self.bounds, self.cell)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centres_are_places_regions_or_layers() {
        let layers = |names: &[&str]| PictureCenter::Layers(names.iter().map(|n| n.to_string()).collect());
        assert_eq!(PictureCenter::parse("-1, 2,3e1"), Ok(PictureCenter::Place([-1.0, 2.0, 30.0])));
        let region = Bounds { min: [0.0, 2.0, 4.0], max: [1.0, 3.0, 5.0] };
        assert_eq!(PictureCenter::parse("0,1,2,3,4,5"), Ok(PictureCenter::Region(region)));
        assert_eq!(PictureCenter::parse("stars,gas"), Ok(layers(&["stars", "gas"])));
        assert_eq!(PictureCenter::parse("all"), Ok(layers(&[])));
        for bad in ["1,2", "1,2,inf", "nan,0,0", "1,2,3,4"] {
            assert!(PictureCenter::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn fit_box_needs_a_known_box() {
        let subject = |cell: Option<Cell>| {
            let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [5.0, 4.0, 9.0] };
            let extent = Extent::new(&bounds, cell.as_ref());
            ViewSubject { bounds, cell, extent, radius: 0.1, opacity: 0.05, density: false, center: None }
        };
        assert!(Fit::Box.corners(&subject(None)).is_err());
        let of_box = Fit::Box.corners(&subject(Some(Cell::orthogonal([10.0; 3])))).unwrap();
        assert_eq!(center(&of_box), [5.0; 3]);
    }
}

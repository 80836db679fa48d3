//! Options of the drawn views: those of a file, or one camera.

use crate::subject::ViewSubject;
use particlegs_core::camera::{
    Camera, DensityView, FOV_DEG, Frame, Projection, View, ViewSet, Window, WindowContent, base_distance,
    spherical_camera,
};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Hint, Result, named_values};
use particlegs_files::ViewsFile;
use particlegs_files::output::{Outputs, kinds, write_bytes};
use particlegs_measure::stats::mass_center;
use particlegs_particles::Domain;
use std::path::PathBuf;
use std::str::FromStr;

/// Views, particle radius and opacity. Lengths are in world units, angles in degrees.
#[derive(Clone, Debug)]
pub struct ViewOptions {
    /// A views file (JSON), of which each view is drawn; without it one view named `view`, as the following say.
    pub views: Option<PathBuf>,
    /// A views file to be written, with the views that are drawn.
    pub save_views: Option<PathBuf>,
    /// Azimuth of the camera: 0 looks along -z, 90 along -x.
    pub azimuth: f64,
    /// Elevation of the camera above the horizon.
    pub elevation: f64,
    /// Distance of the camera from the centre: 1 is 0.65 of the distance of ParaView's Reset Camera, or, with `fit`, the
    /// closest at which everything fits.
    pub distance: f64,
    /// Particle radius; by default the view's, else that of the model, or 0.0406 of the mean particle spacing.
    pub radius: Option<f64>,
    /// Particle opacity, above 0 and at most 1; by default the view's, else that of the model, or 0.05.
    pub opacity: Option<f64>,
    /// Picture size in pixels; by default the views file's, else 1920x1080.
    pub size: Option<Size>,
    /// Whether lines of sight are parallel. A map of part of a periodic box continues with periodic copies.
    pub orthographic: bool,
    /// Centre of the picture; by default that of the bounds, or of the box in orthographic pictures.
    pub center: Option<PictureCenter>,
    /// Width of the picture, by default the whole box; in perspective, the width at the centre, instead of `distance`.
    pub width: Option<f64>,
    /// Depth of the slab around the centre; only particles with their centres in it count.
    pub depth: Option<f64>,
    /// The box or the particles, framed as tightly as possible.
    pub fit: Option<ViewFit>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        ViewOptions {
            views: None,
            save_views: None,
            azimuth: 0.0,
            elevation: 0.0,
            distance: 1.0,
            radius: None,
            opacity: None,
            size: None,
            orthographic: false,
            center: None,
            width: None,
            depth: None,
            fit: None,
        }
    }
}

/// The middle of a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum PictureCenter {
    /// A place, world units.
    Place([f64; 3]),
    /// The centre of the mass in a part of the world.
    Region(Bounds),
    /// The centre of mass of layers; of all where none are named.
    Layers(Vec<String>),
}

impl FromStr for PictureCenter {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<PictureCenter, String> {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let numbers: Option<Vec<f64>> = words.iter().map(|w| w.parse().ok()).collect();
        let finite = numbers.iter().flatten().all(|v| v.is_finite());
        match numbers.as_deref() {
            Some(&[x, y, z]) if finite => Ok(PictureCenter::Place([x, y, z])),
            Some(&[x0, x1, y0, y1, z0, z1]) if finite => {
                Ok(PictureCenter::Region(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] }))
            }
            Some(_) => Err("a centre is X,Y,Z, each a finite number, a region x0,x1,y0,y1,z0,z1, or layers".into()),
            None if words == ["all"] => Ok(PictureCenter::Layers(Vec::new())),
            None => Ok(PictureCenter::Layers(words.into_iter().map(String::from).collect())),
        }
    }
}

impl PictureCenter {
    /// Whether it is a centre of mass.
    pub(crate) fn is_of_mass(&self) -> bool {
        !matches!(self, PictureCenter::Place(_))
    }

    /// The place in a model, which `name` names in errors.
    pub(crate) fn of_model(&self, model: &Model, name: &str, context: &Context<'_>) -> Result<[f64; 3]> {
        let (layers, region) = match self {
            PictureCenter::Place(place) => return Ok(*place),
            PictureCenter::Region(bounds) => (&[][..], Some(bounds)),
            PictureCenter::Layers(names) => (&names[..], None),
        };
        if model.metadata.law == LawKind::AlphaBlend {
            return Err(Error::input(name, "an alpha-blend model has no centre of mass: its splats hold opacities"));
        }
        let center = mass_center(&Domain::from_model(model), model, layers, region)?;
        let center = center.ok_or_else(|| Error::input(name, "there is no mass where its centre is asked for"))?;
        // Mass that fills a periodic edge evenly has its centre everywhere along it.
        let axes: Vec<&str> = ["x", "y", "z"].into_iter().zip(center.filled).filter(|a| a.1).map(|a| a.0).collect();
        if axes.len() == 3 {
            let message = "this mass fills the periodic box, and has no centre";
            return Err(Error::input_with(name, message, "name a region or a place"));
        }
        if !axes.is_empty() {
            let axes = axes.join(" and ");
            context.note(&format!(
                "the mass fills the box along {axes}, and has no centre there: the middle of the box is taken"
            ));
        }
        Ok(center.place)
    }
}

named_values! {
    /// The content that must fit into a picture.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum ViewFit {
        Box = "box": "The simulation box",
        Data = "data": "The bounds of the particles",
    }
}

impl ViewFit {
    fn corners(self, subject: &ViewSubject) -> Result<[[f64; 3]; 8]> {
        match (self, subject.cell) {
            (ViewFit::Box, Some(cell)) => Ok(cell.corners()),
            (ViewFit::Box, None) => {
                let hint = Hint::from("fit the particles with ").option("fit", "data");
                Err(Error::argument_with("no simulation box is known that could be fitted", hint))
            }
            (ViewFit::Data, _) => Ok(subject.bounds.corners()),
        }
    }
}

/// The middle of corners.
fn center(corners: &[[f64; 3]; 8]) -> [f64; 3] {
    each_axis(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 8.0)
}

fn fitted(length: f64) -> Result<f64> {
    let hint = || Hint::from("choose ").option("width", "").words(" or ").option("distance", "");
    let fault = || Error::argument_with("there is no extent to fit", hint());
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err(fault()) }
}

impl ViewOptions {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Argument`] for one out of its range.
    pub fn check(&self) -> Result<()> {
        if !(self.distance > 0.0 && self.distance.is_finite()) {
            return Err(Error::argument(format!("the distance {} must be positive", self.distance)));
        }
        for (name, degrees) in [("azimuth", self.azimuth), ("elevation", self.elevation)] {
            if !degrees.is_finite() {
                return Err(Error::argument(format!("the {name} {degrees} is not a finite angle")));
            }
        }
        for (name, length) in [("width", self.width), ("depth", self.depth)] {
            if let Some(l) = length.filter(|l| !(*l > 0.0 && l.is_finite())) {
                return Err(Error::argument(format!("the {name} {l} must be positive, in world units")));
            }
        }
        Ok(())
    }

    /// Applies size, radius and opacity to views, and checks every view.
    pub(crate) fn apply(&self, set: &mut ViewSet) -> Result<()> {
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

    /// Writes the views where they are to be saved.
    pub(crate) fn save(&self, set: &ViewSet, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
        if let Some(path) = &self.save_views {
            outputs.writes(path, &kinds::JSON, context)?;
            write_bytes(path, ViewsFile(set.clone()).text()?.as_bytes())?;
        }
        Ok(())
    }

    /// The view of a subject, as the options say, without those of a file.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number out of its range, and a view that shows nothing.
    pub fn view(&self, subject: &ViewSubject) -> Result<View> {
        self.check()?;
        let mut set = self.one_view(subject, &[])?;
        self.apply(&mut set)?;
        Ok(set.views.remove(0))
    }

    /// One view; it must fit at all rotations in `turned`.
    pub(crate) fn one_view(&self, subject: &ViewSubject, turned: &[f64]) -> Result<ViewSet> {
        let size = self.size.unwrap_or(Size { width: 1920, height: 1080 });
        let center = match (&self.center, subject.center) {
            (Some(PictureCenter::Place(place)), _) => *place,
            (_, Some(center)) => center,
            (Some(_), None) => {
                return Err(Error::argument("a centre is X,Y,Z here; layers and regions are those of models"));
            }
            (None, None) => self.default_center(subject)?,
        };
        let camera = match self.orthographic {
            false => self.perspective(subject, center, size, turned)?,
            true => self.orthographic(subject, center, size, turned)?,
        };
        let view = View { name: "view".into(), camera, radius: subject.radius, opacity: subject.opacity };
        Ok(ViewSet { size, views: vec![view] })
    }

    fn default_center(&self, subject: &ViewSubject) -> Result<[f64; 3]> {
        Ok(match self.fit {
            Some(ViewFit::Box) => center(&ViewFit::Box.corners(subject)?),
            // A map shows the whole periodic box by default, a perspective view what particles occupy.
            _ if self.orthographic => subject.extent.center,
            _ => subject.bounds.center(),
        })
    }

    fn perspective(&self, subject: &ViewSubject, center: [f64; 3], size: Size, turned: &[f64]) -> Result<Camera> {
        // The field of view is vertical: half of the height at distance 1, times the aspect half of the width.
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
            // A slab may reach behind the camera, but the near plane must lie before it.
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
            // The window keeps one width through a turn, the widest that any direction needs.
            (None, None) => frames.iter().map(|frame| subject.extent.width(frame, size)).fold(0.0, f64::max),
        };
        let window = Window { center, angles_deg: [self.azimuth, self.elevation], width, depth: self.depth };
        Ok(DensityView::orthographic("view", &window, size, &subject.bounds, subject.cell)?.camera)
    }

    /// Camera axes for every direction.
    fn frames(&self, turned: &[f64]) -> Result<Vec<Frame>> {
        // A single view is a turn by nothing.
        let more = if turned.is_empty() { &[0.0][..] } else { turned };
        more.iter().map(|by| spherical_camera([0.0; 3], self.azimuth + by, self.elevation, 1.0).frame()).collect()
    }

    /// A note on the default width of a window, where a user should know it.
    pub(crate) fn note(&self, subject: &ViewSubject, set: &ViewSet, unit: &str) -> Option<String> {
        let is_stated = self.views.is_some() || self.width.is_some() || self.fit.is_some();
        if is_stated || !self.orthographic || subject.repeats() {
            return None;
        }
        let Projection::Orthographic { height_world } = set.views.first()?.camera.projection else { return None };
        let width = particlegs_figure::number(height_world * set.size.width as f64 / set.size.height as f64);
        let width = format!("{width} {unit}");
        Some(format!("no width is given: the window spans the particles' bounds, {} across", width.trim()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::Extent;
    use particlegs_core::space::Cell;

    #[test]
    fn centres_are_places_regions_or_layers() {
        let layers = |names: &[&str]| PictureCenter::Layers(names.iter().map(|n| n.to_string()).collect());
        assert_eq!(PictureCenter::from_str("-1, 2,3e1"), Ok(PictureCenter::Place([-1.0, 2.0, 30.0])));
        let region = Bounds { min: [0.0, 2.0, 4.0], max: [1.0, 3.0, 5.0] };
        assert_eq!(PictureCenter::from_str("0,1,2,3,4,5"), Ok(PictureCenter::Region(region)));
        assert_eq!(PictureCenter::from_str("stars,gas"), Ok(layers(&["stars", "gas"])));
        assert_eq!(PictureCenter::from_str("all"), Ok(layers(&[])));
        for bad in ["1,2", "1,2,inf", "nan,0,0", "1,2,3,4"] {
            assert!(PictureCenter::from_str(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn fit_box_needs_a_known_box() {
        let subject = |cell: Option<Cell>| {
            let bounds = Bounds { min: [1.0, 2.0, 3.0], max: [5.0, 4.0, 9.0] };
            let extent = Extent::new(&bounds, cell.as_ref());
            ViewSubject { bounds, cell, extent, radius: 0.1, opacity: 0.05, density: false, center: None }
        };
        assert!(ViewFit::Box.corners(&subject(None)).is_err());
        let of_box = ViewFit::Box.corners(&subject(Some(Cell::orthogonal([10.0; 3])))).unwrap();
        assert_eq!(center(&of_box), [5.0; 3]);
    }
}

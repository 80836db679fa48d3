//! What the page asks for: a camera, a look, a size, as JSON.

use particlegs::camera::{Camera, DensityView, Projection, View};
use particlegs::picture::Size;
use particlegs::progress::Progress;
use particlegs::reference::Reference;
use particlegs::splat::Look;
use particlegs::{Error, Result};
use serde::Deserialize;

/// Pixels a side at most.
const LARGEST_SIDE: usize = 4096;

/// A picture of all particles that is wanted. Lengths are in world units.
#[derive(Clone, Debug, Deserialize)]
pub struct Question {
    camera: AskedCamera,
    /// Radius and opacity of the particles; surface density has none.
    radius: Option<f64>,
    opacity: Option<f64>,
    look: AskedLook,
    width: usize,
    height_pixels: usize,
    /// Does an orthographic surface density repeat a periodic box? As `reference` does unless told not to.
    #[serde(default = "yes")]
    periodic: bool,
}

#[derive(Clone, Debug, Deserialize)]
struct AskedCamera {
    position: [f64; 3],
    focal_point: [f64; 3],
    view_up: [f64; 3],
    /// Of a perspective camera: the vertical field of view.
    fov_deg: Option<f64>,
    /// Of an orthographic camera: the height of the picture.
    height: Option<f64>,
    clipping_range: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum AskedLook {
    Paraview,
    ParaviewNoFxaa,
    Expected,
    Density,
}

fn yes() -> bool {
    true
}

impl Question {
    /// Reads the JSON and checks every number.
    ///
    /// # Errors
    /// [`Error::Argument`] that says what is wrong.
    pub fn read(json: &[u8]) -> Result<Self> {
        let question: Question =
            serde_json::from_slice(json).map_err(|e| Error::argument(format!("not a picture to draw: {e}")))?;
        let (width, height) = (question.width, question.height_pixels);
        if !((1..=LARGEST_SIDE).contains(&width) && (1..=LARGEST_SIDE).contains(&height)) {
            return Err(Error::argument(format!("a size of {width}x{height} is outside 1 to {LARGEST_SIDE} pixels")));
        }
        question.check()?;
        Ok(question)
    }

    /// As pictures are checked; but an orthographic window may begin at the eye.
    fn check(&self) -> Result<()> {
        let mut view = self.view()?;
        if let (Some(_), Some([near, far])) = (self.camera.height, self.camera.clipping_range) {
            if !(near >= 0.0 && near < far && far.is_finite()) {
                return Err(Error::argument(format!("clipping range {near} to {far} is not 0 <= near < far")));
            }
            view.camera.clipping_range = None;
        }
        view.check(self.size())
    }

    fn size(&self) -> Size {
        Size { width: self.width, height: self.height_pixels }
    }

    fn view(&self) -> Result<View> {
        let c = &self.camera;
        let projection = match (c.fov_deg, c.height) {
            (Some(fov_deg), None) => Projection::Perspective { fov_deg },
            (None, Some(height_world)) => Projection::Orthographic { height_world },
            _ => return Err(Error::argument("a camera has either fov_deg or height")),
        };
        let (radius, opacity) = match self.look {
            AskedLook::Density => (1.0, 1.0),
            _ => {
                let missing = |what: &str| Error::argument(format!("the look needs {what}"));
                (self.radius.ok_or_else(|| missing("a radius"))?, self.opacity.ok_or_else(|| missing("an opacity"))?)
            }
        };
        if self.look != AskedLook::Density && c.height.is_some() {
            return Err(Error::argument("all particles are drawn orthographic in the look density alone"));
        }
        let camera = Camera {
            position: c.position,
            focal_point: c.focal_point,
            view_up: c.view_up,
            projection,
            clipping_range: c.clipping_range,
        };
        Ok(View { name: "view".into(), camera, radius, opacity })
    }

    /// Draws it: grey levels, one byte a pixel, or surface density, mass per area as little-endian float32; row by
    /// row from the top.
    ///
    /// # Errors
    /// Those of [`Reference::draw`] and [`Reference::surface_density`].
    pub fn draw(&self, reference: &Reference<'_>, progress: &dyn Progress) -> Result<Vec<u8>> {
        let (view, size) = (self.view()?, self.size());
        let look = match self.look {
            AskedLook::Paraview => Look::Paraview,
            AskedLook::ParaviewNoFxaa => Look::ParaviewNoFxaa,
            AskedLook::Expected => Look::Expected,
            AskedLook::Density => return self.density(&view, reference, progress),
        };
        Ok(reference.draw(&view, size, look, progress)?.data)
    }

    fn density(&self, view: &View, reference: &Reference<'_>, progress: &dyn Progress) -> Result<Vec<u8>> {
        let mut asked = DensityView::of_view(view, reference.bounds());
        if self.camera.height.is_some() && self.periodic {
            asked.wrap = reference.particles().meta.cell.filter(|c| c.periodic.contains(&true));
        }
        let plane = reference.surface_density(&asked, self.size(), progress)?;
        Ok(plane.data.iter().flat_map(|v| v.to_le_bytes()).collect())
    }
}

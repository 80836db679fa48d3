//! A camera, and a view: a camera with the particle radius and opacity to draw.

use crate::math::{cross, each_axis, norm};
use crate::picture::Size;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// Perspective with a vertical angle, or orthographic with a world height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in degrees, in (0, 180).
    Perspective {
        /// Degrees.
        fov_deg: f64,
    },
    /// The picture's height in world units.
    Orthographic {
        /// World units.
        height_world: f64,
    },
}

/// The camera's place, direction and projection. World units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "CameraRecord", try_from = "CameraRecord")]
pub struct Camera {
    /// Eye.
    pub position: [f64; 3],
    /// Point looked at.
    pub focal_point: [f64; 3],
    /// Up, not parallel to the direction of view.
    pub view_up: [f64; 3],
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Near and far distance: particles whose centre is outside are dropped whole.
    /// `None` = VTK's own, from the bounds ([`super::clipping_range`]).
    pub clipping_range: Option<[f64; 2]>,
}

/// A [`Camera`] in JSON, by the keys of views files (docs/guide/pictures.md); it has one of `fov_deg` and `height_world`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraRecord {
    /// Eye.
    pub position: [f64; 3],
    /// Point looked at.
    pub focal_point: [f64; 3],
    /// Up.
    pub view_up: [f64; 3],
    /// Vertical field of view of a perspective camera, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_deg: Option<f64>,
    /// Height of an orthographic camera's picture, world units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_world: Option<f64>,
    /// Near and far distance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clipping_range: Option<[f64; 2]>,
}

const NO_WINDOW: &str = "set fov_deg (perspective) or height_world (orthographic)";

impl From<Camera> for CameraRecord {
    fn from(camera: Camera) -> Self {
        let Camera { position, focal_point, view_up, projection, clipping_range } = camera;
        let (fov_deg, height_world) = match projection {
            Projection::Perspective { fov_deg } => (Some(fov_deg), None),
            Projection::Orthographic { height_world } => (None, Some(height_world)),
        };
        CameraRecord { position, focal_point, view_up, fov_deg, height_world, clipping_range }
    }
}

impl TryFrom<CameraRecord> for Camera {
    type Error = &'static str;

    fn try_from(record: CameraRecord) -> std::result::Result<Self, &'static str> {
        let CameraRecord { position, focal_point, view_up, fov_deg, height_world, clipping_range } = record;
        let projection = match (fov_deg, height_world) {
            (Some(fov_deg), None) => Projection::Perspective { fov_deg },
            (None, Some(height_world)) => Projection::Orthographic { height_world },
            (Some(_), Some(_)) => return Err("set fov_deg or height_world, not both"),
            (None, None) => return Err(NO_WINDOW),
        };
        Ok(Camera { position, focal_point, view_up, projection, clipping_range })
    }
}

/// An orthonormal camera frame: rows right, up, backwards (the camera looks along -z).
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Row k is the world direction of camera axis k.
    pub axes: [[f64; 3]; 3],
    /// Eye, world units.
    pub position: [f64; 3],
}

impl Camera {
    /// The camera's frame, as VTK builds it.
    pub fn frame(&self) -> Result<Frame> {
        let back: [f64; 3] = each_axis(|k| self.position[k] - self.focal_point[k]);
        let z = normalised(back).ok_or_else(|| Error::argument("the camera position equals the focal point"))?;
        let x = normalised(cross(self.view_up, z))
            .ok_or_else(|| Error::argument("the camera direction is parallel to view_up"))?;
        Ok(Frame { axes: [x, cross(z, x), z], position: self.position })
    }

    /// Distance from the eye to the focal point.
    pub fn distance(&self) -> f64 {
        let d: [f64; 3] = each_axis(|k| self.position[k] - self.focal_point[k]);
        norm(d)
    }

    /// The line of sight through a pixel, whose centres have whole coordinates: where it starts, and its direction of
    /// length 1. World units.
    pub fn ray(&self, pixel: [f64; 2], size: Size) -> Result<([f64; 3], [f64; 3])> {
        let Frame { axes: [right, up, back], position } = self.frame()?;
        let focal = self.focal_pixels(size);
        let x = (pixel[0] + 0.5 - 0.5 * size.width as f64) / focal;
        let y = (0.5 * size.height as f64 - 0.5 - pixel[1]) / focal;
        let aside = each_axis(|k| x * right[k] + y * up[k]);
        Ok(match self.projection {
            Projection::Orthographic { .. } => (each_axis(|k| position[k] + aside[k]), back.map(|v| -v)),
            Projection::Perspective { .. } => {
                let length = (1.0 + x * x + y * y).sqrt();
                (position, each_axis(|k| (aside[k] - back[k]) / length))
            }
        })
    }

    /// Pixels for a unit of x/z (perspective) or for a world unit (orthographic).
    pub fn focal_pixels(&self, size: Size) -> f64 {
        match self.projection {
            Projection::Perspective { fov_deg } => 0.5 * size.height as f64 / libm::tan(0.5 * fov_deg.to_radians()),
            Projection::Orthographic { height_world } => size.height as f64 / height_world,
        }
    }
}

impl Frame {
    /// Camera coordinates of a world point; the camera looks along -z.
    pub fn to_camera(&self, p: [f64; 3]) -> [f64; 3] {
        let d: [f64; 3] = each_axis(|k| p[k] - self.position[k]);
        self.axes.map(|a| a[0] * d[0] + a[1] * d[1] + a[2] * d[2])
    }
}

/// A named picture to draw: camera, particle radius (world units) and opacity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct View {
    /// File name without ending.
    pub name: String,
    /// Camera.
    #[serde(flatten)]
    pub camera: Camera,
    /// Particle radius (standard deviation of the splat), world units, > 0.
    pub radius: f64,
    /// Opacity at the splat's centre, in (0, 1].
    pub opacity: f64,
}

impl View {
    /// The view of a scene whose lengths are multiplied by `by`.
    pub fn scaled(&self, by: f64) -> View {
        let mut view = View { radius: self.radius * by, ..self.clone() };
        let Camera { position, focal_point, projection, clipping_range, .. } = &mut view.camera;
        position.iter_mut().chain(focal_point).chain(clipping_range.iter_mut().flatten()).for_each(|v| *v *= by);
        if let Projection::Orthographic { height_world } = projection {
            *height_world *= by;
        }
        view
    }

    /// The splat radius in pixels at the focal point.
    pub fn radius_pixels(&self, size: Size) -> f64 {
        match self.camera.projection {
            Projection::Perspective { .. } => self.radius * self.camera.focal_pixels(size) / self.camera.distance(),
            Projection::Orthographic { .. } => self.radius * self.camera.focal_pixels(size),
        }
    }

    /// Checks every number.
    pub fn check(&self, size: Size) -> Result<()> {
        let name = &self.name;
        let fail = |what: String| Err(Error::argument(format!("view `{name}`: {what}")));
        if size.width == 0 || size.height == 0 || size.width > 32_768 || size.height > 32_768 {
            return fail(format!("the size {}x{} is outside 1 to 32768", size.width, size.height));
        }
        if !(self.radius > 0.0 && self.radius.is_finite()) {
            return fail(format!("radius {} must be positive", self.radius));
        }
        if !(self.opacity > 0.0 && self.opacity <= 1.0) {
            return fail(format!("opacity {} is outside (0, 1]", self.opacity));
        }
        let c = &self.camera;
        let finite = [c.position, c.focal_point, c.view_up].iter().flatten().all(|v| v.is_finite());
        if !finite {
            return fail("the camera has a number that is not finite".into());
        }
        match c.projection {
            Projection::Perspective { fov_deg } if !(fov_deg > 0.0 && fov_deg < 180.0) => {
                return fail(format!("field of view {fov_deg} is outside (0, 180) degrees"));
            }
            Projection::Orthographic { height_world } if !(height_world > 0.0 && height_world.is_finite()) => {
                return fail(format!("picture height {height_world} must be positive"));
            }
            _ => {}
        }
        // Parallel lines of sight may begin at the eye.
        let parallel = matches!(c.projection, Projection::Orthographic { .. });
        if let Some([near, far]) = c.clipping_range
            && !((near > 0.0 || parallel && near == 0.0) && far > near && far.is_finite())
        {
            return fail(format!("clipping range {near} to {far} is not 0 < near < far"));
        }
        match c.frame() {
            Ok(_) => Ok(()),
            Err(e) => fail(e.to_string()),
        }
    }
}

/// Views of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewSet {
    /// Size of every picture.
    pub size: Size,
    /// The views.
    pub views: Vec<View>,
}

impl ViewSet {
    /// The field of view of the first perspective view, degrees.
    pub fn fov_deg(&self) -> Option<f64> {
        self.views.iter().find_map(|v| CameraRecord::from(v.camera).fov_deg)
    }
}

fn normalised(a: [f64; 3]) -> Option<[f64; 3]> {
    let n = norm(a);
    (n > 0.0 && n.is_finite()).then(|| a.map(|v| v / n))
}

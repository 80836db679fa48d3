//! The page's requests: camera, style and size, as JSON.

use particlegs_core::camera::{Camera, DensityView, Projection, View};
use particlegs_core::context::Context;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::tone;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_reference::Reference;
use serde::Deserialize;

/// Maximum width and height, pixels.
const LARGEST_SIDE: usize = 4096;

/// A request for a picture of all particles. Lengths are in world units.
#[derive(Clone, Debug, Deserialize)]
pub struct RenderRequest {
    camera: Camera,
    /// Radius and opacity of the particles; surface density has none.
    radius: Option<f64>,
    opacity: Option<f64>,
    look: RequestLook,
    width: usize,
    height_pixels: usize,
    /// Whether an orthographic surface density repeats a periodic box; true by default, as in `reference`.
    periodic: Option<bool>,
    /// Share of the particles to draw, for a quick picture; 1 by default.
    share: Option<f64>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum RequestLook {
    Paraview,
    ParaviewNoFxaa,
    Expected,
    Density,
}

impl RenderRequest {
    /// Reads the JSON and checks every number.
    pub fn read(json: &[u8]) -> Result<Self> {
        let question: RenderRequest =
            serde_json::from_slice(json).map_err(|e| Error::argument(format!("not a picture request: {e}")))?;
        let (width, height) = (question.width, question.height_pixels);
        if !((1..=LARGEST_SIDE).contains(&width) && (1..=LARGEST_SIDE).contains(&height)) {
            return Err(Error::argument(format!("a size of {width}x{height} is outside 1 to {LARGEST_SIDE} pixels")));
        }
        if let Some(share) = question.share.filter(|share| !(*share > 0.0 && *share <= 1.0)) {
            return Err(Error::argument(format!("a share of {share} is outside (0, 1]")));
        }
        question.view()?.check(question.size())?;
        Ok(question)
    }

    /// Whether it is a surface density.
    pub fn is_density(&self) -> bool {
        self.look == RequestLook::Density
    }

    /// Number of particles to draw out of `all`.
    pub fn particles(&self, all: usize) -> usize {
        ((self.share.unwrap_or(1.0) * all as f64).round() as usize).clamp(1, all.max(1))
    }

    fn size(&self) -> Size {
        Size { width: self.width, height: self.height_pixels }
    }

    fn view(&self) -> Result<View> {
        let (radius, opacity) = match self.look {
            RequestLook::Density => (1.0, 1.0),
            _ => {
                let missing = |part: &str| Error::argument(format!("this style needs {part}"));
                (self.radius.ok_or_else(|| missing("a radius"))?, self.opacity.ok_or_else(|| missing("an opacity"))?)
            }
        };
        if !self.is_density() && matches!(self.camera.projection, Projection::Orthographic { .. }) {
            return Err(Error::argument("orthographic pictures of all particles need style density"));
        }
        Ok(View { name: "view".into(), camera: self.camera, radius, opacity })
    }

    /// Draws grey levels as bytes, or surface densities as little-endian float32; rows from the top.
    pub fn draw(&self, reference: &Reference<'_>, context: &Context<'_>) -> Result<Vec<u8>> {
        match self.look.of_grey() {
            Some(style) => Ok(reference.draw(&self.view()?, self.size(), style, context)?.data),
            None => Ok(as_bytes(&self.density(reference, context)?)),
        }
    }

    /// [`RenderRequest::draw`] from a sample in which each particle stands for `many`: the expected picture of all
    /// particles, without the shot noise of ParaView's styles.
    pub fn draw_some(&self, some: &Reference<'_>, many: f64, context: &Context<'_>) -> Result<Vec<u8>> {
        let for_all = |mut plane: Plane| {
            plane.data.iter_mut().for_each(|v| *v = (f64::from(*v) * many) as f32);
            plane
        };
        let Some(style) = self.look.of_grey() else {
            return Ok(as_bytes(&for_all(self.density(some, context)?)));
        };
        let (view, size) = (self.view()?, self.size());
        let tau = for_all(some.optical_depth(&view, size, context)?);
        Ok(tone(&tau, style, view.opacity, view.radius_pixels(size)).data)
    }

    fn density(&self, reference: &Reference<'_>, context: &Context<'_>) -> Result<Plane> {
        let cell = reference.particles().meta.cell.filter(|_| self.periodic != Some(false));
        let view = DensityView::of_cell(&self.view()?, self.size(), reference.bounds(), cell);
        reference.surface_density(&view, self.size(), context)
    }
}

impl RequestLook {
    /// The tone style; `None` for surface density.
    fn of_grey(self) -> Option<ToneStyle> {
        match self {
            RequestLook::Paraview => Some(ToneStyle::Paraview),
            RequestLook::ParaviewNoFxaa => Some(ToneStyle::ParaviewNoFxaa),
            RequestLook::Expected => Some(ToneStyle::Expected),
            RequestLook::Density => None,
        }
    }
}

fn as_bytes(plane: &Plane) -> Vec<u8> {
    plane.data.iter().flat_map(|v| v.to_le_bytes()).collect()
}

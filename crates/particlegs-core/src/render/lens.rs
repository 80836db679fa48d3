//! A camera made ready to project: axes, focal length in pixels, depth range, weights.

use super::project::InCamera;
use crate::camera::{DensityView, Projection, View, clipping_range};
use crate::picture::Size;
use crate::space::Bounds;
use crate::splat::opacity_integral;
use crate::{Error, Result};

/// A camera in the form that the projection wants. Camera axes are right, down, forward, so that
/// picture coordinates grow with them; depth is the distance along forward.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Rows right, down, forward in world coordinates.
    pub axes: [[f64; 3]; 3],
    /// The eye, world units.
    pub position: [f64; 3],
    /// Does size fall with depth?
    pub perspective: bool,
    /// Pixels for a unit of x/depth (perspective) or a world unit.
    pub focal: f64,
    /// Pixel coordinates of the axis; pixel centres have whole coordinates.
    pub center: [f64; 2],
    /// Nearest and farthest depth of what is drawn.
    pub range: [f64; 2],
    /// Variance added to every Gaussian in the world: the particle radius squared.
    pub radius2: f64,
    /// What one particle (or unit of mass) adds to the sum over pixels, times depth squared in
    /// perspective.
    pub unit: f64,
}

impl Lens {
    /// The lens of a view for optical depth: a particle of radius r and opacity a adds
    /// 2 pi a e^2 r_px^2 (docs/law/depth.md, "A mixture").
    ///
    /// # Errors
    /// [`Error::Argument`] where the view has a number outside its range.
    pub fn optical(view: &View, size: Size, bounds: &Bounds) -> Result<Lens> {
        view.check(size)?;
        let frame = view.camera.frame()?;
        let focal = view.camera.focal_pixels(size);
        let [right, up, back] = frame.axes;
        let radius_px = view.radius * focal;
        let lens = Lens {
            axes: [right, up.map(|v| -v), back.map(|v| -v)],
            position: frame.position,
            perspective: matches!(view.camera.projection, Projection::Perspective { .. }),
            focal,
            center: [0.5 * size.width as f64 - 0.5, 0.5 * size.height as f64 - 0.5],
            range: view.camera.clipping_range.unwrap_or_else(|| clipping_range(bounds, &view.camera)),
            radius2: view.radius * view.radius,
            unit: opacity_integral(view.opacity) * radius_px * radius_px,
        };
        if lens.unit.is_finite() && lens.radius2.is_finite() {
            Ok(lens)
        } else {
            Err(Error::argument(format!("view `{}`: radius {} is too large to draw", view.name, view.radius)))
        }
    }

    /// The lens of a view for surface density: a unit of mass adds (pixels a world unit)^2 at its
    /// depth. `shift` is added to every position.
    ///
    /// # Errors
    /// [`Error::Argument`] where the camera has no direction.
    pub fn density(view: &DensityView, size: Size, shift: [f64; 3]) -> Result<Lens> {
        let frame = view.camera.frame()?;
        let focal = view.camera.focal_pixels(size);
        let [right, up, back] = frame.axes;
        Ok(Lens {
            axes: [right, up.map(|v| -v), back.map(|v| -v)],
            position: std::array::from_fn(|k| frame.position[k] - shift[k]),
            perspective: matches!(view.camera.projection, Projection::Perspective { .. }),
            focal,
            center: [0.5 * size.width as f64 - 0.5, 0.5 * size.height as f64 - 0.5],
            range: view.range,
            radius2: 0.0,
            unit: focal * focal,
        })
    }

    /// Does a Gaussian lie outside the four side planes of what the picture sees? Spares the work of
    /// cutting those that the camera passes by.
    pub fn misses(&self, g: &InCamera) -> bool {
        let [xx, _, xz, yy, yz, zz] = g.cov;
        [(g.mean[0], xx, xz, self.center[0]), (g.mean[1], yy, yz, self.center[1])].into_iter().any(
            |(at, variance, with_depth, center)| {
                // Half the picture and a margin for coarse planes, over the focal length.
                let edge = (1.25 * center + 64.0) / self.focal;
                [edge, -edge].into_iter().any(|t| {
                    // The distance to the plane at = t depth (or at = t), beyond it positive.
                    let (beyond, spread, round) = if self.perspective {
                        (at - t * g.mean[2], variance - 2.0 * t * with_depth + t * t * zz, 1.0 + t * t)
                    } else {
                        (at - t, variance, 1.0)
                    };
                    let beyond = beyond * t.signum();
                    beyond > 0.0 && beyond * beyond > 49.0 * (spread + self.radius2 * round)
                })
            },
        )
    }
}

//! A camera in the training frame.

use crate::camera::{Normalisation, Projection, View};
use crate::math::each_axis;
use crate::picture::Size;
use crate::{Error, Result};

/// Gaussians nearer than this are not drawn, in the training frame (3DGS, `in_frustum`).
const NEAR: f64 = 0.2;

/// The slope at which a Gaussian's shape is taken is cut off at this many half pictures (3DGS,
/// `computeCov2D`).
const GUARD: f64 = 1.3;

/// The camera's place and axes in the training frame. Axes are right, down, forward;
/// pixel centres have whole coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Rows right, down, forward.
    pub axes: [[f64; 3]; 3],
    /// Its place.
    pub position: [f64; 3],
    /// Pixels for a unit of x/depth.
    pub focal: f64,
    /// Pixel coordinates of the axis.
    pub center: [f64; 2],
    /// Largest |x/depth| and |y/depth| at which shapes are taken.
    pub guard: [f64; 2],
    /// Depths outside are not drawn.
    pub range: [f64; 2],
    /// Pixels that are drawn.
    pub size: Size,
    /// Half the whole picture's pixels across and down.
    pub half: [f64; 2],
}

impl Eye {
    /// The camera of a view. Gaussians with centres nearer than 0.2 in the training frame, or outside
    /// the view's clipping range where it has one, are not drawn.
    pub fn new(view: &View, size: Size, frame: &Normalisation) -> Result<Eye> {
        view.check(size)?;
        if !matches!(view.camera.projection, Projection::Perspective { .. }) {
            let name = &view.name;
            return Err(Error::argument(format!(
                "view `{name}`: models of the alpha-blend law can only be drawn in perspective"
            )));
        }
        let axes = view.camera.frame()?;
        let [right, up, back] = axes.axes;
        let focal = view.camera.focal_pixels(size);
        let half = [0.5 * size.width as f64, 0.5 * size.height as f64];
        let [near, far] = view.camera.clipping_range.unwrap_or([0.0, f64::INFINITY]);
        Ok(Eye {
            axes: [right, up.map(|v| -v), back.map(|v| -v)],
            position: each_axis(|k| (axes.position[k] - frame.center[k]) * frame.scale),
            focal,
            center: half.map(|h| h - 0.5),
            guard: half.map(|h| GUARD * h / focal),
            range: [(near * frame.scale).max(NEAR), far * frame.scale],
            size,
            half,
        })
    }

    /// That draws only a part of its picture: `size` pixels from column and row `corner` on.
    pub fn part(self, corner: [usize; 2], size: Size) -> Eye {
        let center = std::array::from_fn(|k| self.center[k] - corner[k] as f64);
        Eye { center, size, ..self }
    }
}

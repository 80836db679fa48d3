//! A camera made ready to project: axes, focal length in pixels, depth range, weights.

use crate::camera::{Camera, DensityView, Projection, View, clipping_range};
use crate::math::each_axis;
use crate::picture::Size;
use crate::space::Bounds;
use crate::splat::opacity_integral;
use crate::{Error, Result};

/// A camera in the form that the projection wants. Camera axes are right, down, forward, so that
/// picture coordinates grow with them; depth is the distance along forward. The lens' unit of length
/// is about the distance to the focal point, so that squares of lengths fit f32 in whatever units the world
/// is; a power of two, so that it costs no digits.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Rows right, down, forward in world coordinates, over the unit.
    pub axes: [[f64; 3]; 3],
    /// The eye, world units.
    pub position: [f64; 3],
    /// Whether size falls with depth.
    pub perspective: bool,
    /// Pixels for a unit of x/depth (perspective) or a unit.
    pub focal: f64,
    /// Pixel coordinates of the axis; pixel centres have whole coordinates.
    pub center: [f64; 2],
    /// Nearest and farthest depth of what is drawn.
    pub range: [f64; 2],
    /// Variance added to every Gaussian: the particle radius squared.
    pub radius2: f64,
    /// The sum over pixels of one particle (or unit of mass), times depth squared in
    /// perspective.
    pub unit: f64,
}

impl Lens {
    /// The lens of a view for optical depth: a particle of radius r and opacity a adds
    /// 2 pi a e^2 r_px^2 (docs/law/depth.md, "A mixture").
    pub fn optical(view: &View, size: Size, bounds: &Bounds) -> Result<Lens> {
        view.check(size)?;
        let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(bounds, &view.camera));
        let (lens, length) = Lens::new(&view.camera, size, range)?;
        let (radius, radius_px) = (view.radius / length, view.radius / length * lens.focal);
        let unit = opacity_integral(view.opacity) * radius_px * radius_px;
        let lens = Lens { radius2: radius * radius, unit, ..lens };
        if lens.unit.is_finite() && lens.radius2.is_finite() {
            Ok(lens)
        } else {
            Err(Error::argument(format!("view `{}`: radius {} is too large to draw", view.name, view.radius)))
        }
    }

    /// The lens of a view for surface density: a unit of mass adds (pixels a world unit)^2 at its
    /// depth. `shift` is added to every position.
    pub fn density(view: &DensityView, size: Size, shift: [f64; 3]) -> Result<Lens> {
        let (lens, length) = Lens::new(&view.camera, size, view.range)?;
        Ok(Lens { unit: (lens.focal / length) * (lens.focal / length), ..lens.shifted(shift) })
    }

    /// The lens for a scene that is drawn at `shift` (world units) from where it is.
    pub fn shifted(&self, shift: [f64; 3]) -> Lens {
        Lens { position: each_axis(|k| self.position[k] - shift[k]), ..*self }
    }

    /// A camera that adds nothing yet, and its unit in world units.
    fn new(camera: &Camera, size: Size, range: [f64; 2]) -> Result<(Lens, f64)> {
        let frame = camera.frame()?;
        let [right, up, back] = frame.axes;
        // The distance with all bits of its fraction dropped.
        let length = f64::from_bits(camera.distance().max(f64::MIN_POSITIVE).to_bits() >> 52 << 52);
        let perspective = matches!(camera.projection, Projection::Perspective { .. });
        let lens = Lens {
            axes: [right, up.map(|v| -v), back.map(|v| -v)].map(|a| a.map(|v| v / length)),
            position: frame.position,
            perspective,
            focal: camera.focal_pixels(size) * if perspective { 1.0 } else { length },
            center: [0.5 * size.width as f64 - 0.5, 0.5 * size.height as f64 - 0.5],
            range: range.map(|v| v / length),
            radius2: 0.0,
            unit: 0.0,
        };
        Ok((lens, length))
    }
}

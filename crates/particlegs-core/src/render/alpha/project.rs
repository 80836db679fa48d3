//! A camera in the training frame, and one Gaussian on its picture: the affine approximation of EWA splatting (Zwicker et
//! al. 2001) as 3DGS takes it, widened by a pixel and dimmed for that.

use crate::camera::{Normalisation, Projection, View};
use crate::math::{Sym3, each_axis};
use crate::picture::Size;
use crate::render::project::CameraGaussian;
use crate::{Error, Result};

/// Variance added to every footprint along either axis: one pixel, in quadrature (docs/law/published.md).
pub const LOW_PASS: f64 = 1.0;

/// Least ratio of determinants that is compensated for (3DGS, antialiasing).
pub const LEAST_RATIO: f64 = 2.5e-5;

/// A Gaussian in the training frame, adapted to radius and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Mean.
    pub mean: [f64; 3],
    /// Covariance.
    pub cov: Sym3,
    /// Opacity at its peak, in (0, 1).
    pub opacity: f64,
    /// Grey level, 1 = white.
    pub grey: f64,
}

impl Gaussian {
    /// As the projection reads it.
    pub fn seen(&self, eye: &Eye) -> GreyCameraGaussian {
        let gaussian = CameraGaussian::new(&eye.axes, eye.position, self.mean, &self.cov, self.opacity);
        GreyCameraGaussian { gaussian, grey: self.grey as f32 }
    }
}

/// A Gaussian of a view: what the projection reads, 44 bytes, as a GPU reads them. Lengths are the training frame's.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct GreyCameraGaussian {
    /// Relative to the eye; its weight is its opacity.
    pub gaussian: CameraGaussian,
    /// Grey level, 1 = white.
    pub grey: f32,
}

/// A footprint: what the projection writes, 44 bytes, as a GPU reads them.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct ProjectedSplat {
    /// As tiles are drawn with it.
    pub splat: Splat,
    /// Depth of its centre.
    pub depth: f32,
    /// The distance from its centre to which it is drawn in x and y, pixels.
    pub reach: [f32; 2],
}

/// The way from a Gaussian to its footprint, which its gradient goes back.
#[derive(Clone, Copy, Debug)]
pub struct FootprintShape {
    /// Its centre, pixels.
    pub at: [f64; 2],
    /// Right, down, depth in the training frame.
    pub seen: [f64; 3],
    /// The slopes x/depth and y/depth at which the shape is taken, and whether they were cut off.
    pub slope: [(f64, bool); 2],
    /// Covariance xx, xy, yy before widening, square pixels.
    pub sharp: [f64; 3],
    /// Covariance after.
    pub wide: [f64; 3],
    /// Determinant before.
    pub sharp_det: f64,
    /// Determinant after.
    pub wide_det: f64,
    /// Factor on opacity.
    pub compensation: f64,
}

/// The footprint's shape, or `None` in front of the near plane or beyond the far one, or where a number is
/// not one. In f64: determinants of long footprints are differences.
pub fn shape(eye: &Eye, g: &CameraGaussian) -> Option<FootprintShape> {
    let seen = g.mean.map(f64::from);
    let [x, y, depth] = seen;
    if !(depth > eye.range[0] && depth <= eye.range[1]) {
        return None;
    }
    let slope = [(x / depth, eye.guard[0]), (y / depth, eye.guard[1])].map(|(s, g)| (s.clamp(-g, g), s.abs() > g));
    // What a step in depth moves on the picture, beside what is left at a given depth.
    let [sx, sy] = [0, 1].map(|k| f64::from(g.slope[k]) - slope[k].0);
    let ([xx, xy, yy], zz) = (g.rest(), f64::from(g.depth));
    let unit2 = (eye.focal / depth) * (eye.focal / depth);
    let sharp = [xx + sx * sx * zz, xy + sx * sy * zz, yy + sy * sy * zz].map(|v| unit2 * v);
    let [down, lean, across] = [g.down, g.lean, g.across].map(f64::from);
    let skew = sx - lean * sy;
    let sharp_det = unit2 * unit2 * (across * down + zz * (across * sy * sy + down * skew * skew));
    let wide = [sharp[0] + LOW_PASS, sharp[1], sharp[2] + LOW_PASS];
    let wide_det = wide[0] * wide[2] - wide[1] * wide[1];
    let at = [eye.center[0] + eye.focal * x / depth, eye.center[1] + eye.focal * y / depth];
    let fine = at[0].is_finite() && at[1].is_finite() && wide_det > 0.0 && wide_det.is_finite();
    fine.then(|| FootprintShape {
        at,
        seen,
        slope,
        sharp,
        wide,
        sharp_det,
        wide_det,
        compensation: (sharp_det / wide_det).max(LEAST_RATIO).sqrt(),
    })
}

/// The footprint, or `None` where nothing is drawn.
pub fn project(eye: &Eye, g: &GreyCameraGaussian, least_alpha: f64) -> Option<ProjectedSplat> {
    let p = shape(eye, &g.gaussian)?;
    let peak = f64::from(g.gaussian.weight) * p.compensation;
    // Not the negation: nothing is drawn of what is not a number.
    if !(peak >= least_alpha && peak.is_finite() && g.grey.is_finite()) {
        return None;
    }
    let [xx, xy, yy] = p.wide;
    let half_log2 = 0.5 * std::f64::consts::LOG2_E;
    let end = libm::log2(least_alpha / peak);
    let splat = Splat {
        x: p.at[0] as f32,
        y: p.at[1] as f32,
        lean: (xy / yy) as f32,
        along: (-half_log2 * yy / p.wide_det) as f32,
        down: (-half_log2 / yy) as f32,
        peak: peak as f32,
        end: end as f32,
        grey: g.grey,
    };
    let reach = [xx, yy].map(|v| (v * -end / half_log2).sqrt() as f32);
    Some(ProjectedSplat { splat, depth: p.seen[2] as f32, reach })
}

/// A footprint as tiles are drawn with it. The alpha of a pixel is `peak 2^p` with
/// `p = along d^2 + down dy^2`, where d is its distance in x from the crest of its row.
/// 32 bytes, as a GPU reads them.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Centre, pixels from the left; pixel centres have whole coordinates.
    pub x: f32,
    /// Centre, pixels from the top.
    pub y: f32,
    /// The shift of the crest from row to row, pixels.
    pub lean: f32,
    /// Fall along a row, 1/pixels^2; negative.
    pub along: f32,
    /// Fall of the crest from row to row, 1/pixels^2; negative.
    pub down: f32,
    /// Alpha at the centre.
    pub peak: f32,
    /// Power below which alpha is too small to be drawn.
    pub end: f32,
    /// Grey level.
    pub grey: f32,
}

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

//! The vertex stage: particles to splats in normalised device coordinates, in float32 as VTK's
//! shaders compute them (docs/law/splat.md, "From the world to the picture", "Shape").

use fearless_simd::{Level, Simd, dispatch};
use particlegs_core::camera::{Projection, View};
use particlegs_core::math::each_axis;
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};

/// Particles that one call of the vector kernel takes.
pub(super) const BLOCK: usize = 256;

/// Centres farther outside the picture than this share of its half are dropped with their splat.
const FRUSTUM_MARGIN: f32 = 1.3;

/// Off-diagonal covariances up to this are ignored: the splat stays axis-aligned.
pub(super) const DIAGONAL_LIMIT: f32 = 1e-6;

/// A splat in normalised device coordinates (x right, y up, the picture is [-1, 1]^2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct NdcSplat {
    pub x: f32,
    pub y: f32,
    /// Window depth in [0, 1]; one for the whole splat.
    pub depth: f32,
    /// `[a, b, c, d]`: one standard deviation of u moves by (a, c), of v by (b, d).
    pub axes: [f32; 4],
}

impl NdcSplat {
    /// The axis u is along x, and v along y.
    pub fn is_aligned(&self) -> bool {
        self.axes[1] == 0.0 && self.axes[2] == 0.0
    }
}

/// A block of projected particles, one column a quantity.
pub(super) struct ProjectedBlock {
    pub x: [f32; BLOCK],
    pub y: [f32; BLOCK],
    pub depth: [f32; BLOCK],
    /// Covariance c00, c11, c01 in device coordinates; c00 is negative where VTK drops the particle.
    pub c00: [f32; BLOCK],
    pub c11: [f32; BLOCK],
    pub c01: [f32; BLOCK],
}

impl Default for ProjectedBlock {
    fn default() -> Self {
        let zero = [0.0; BLOCK];
        ProjectedBlock { x: zero, y: zero, depth: zero, c00: zero, c11: zero, c01: zero }
    }
}

impl ProjectedBlock {
    /// Splat `i`, or `None` where VTK draws nothing.
    pub fn splat(&self, i: usize) -> Option<NdcSplat> {
        if self.c00[i] < 0.0 {
            return None;
        }
        let axes = axes(self.c00[i], self.c11[i], self.c01[i])?;
        Some(NdcSplat { x: self.x[i], y: self.y[i], depth: self.depth[i], axes })
    }
}

/// Half-axes of a covariance; `None` where VTK's float32 root is not a number.
#[inline]
fn axes(c00: f32, c11: f32, c01: f32) -> Option<[f32; 4]> {
    if c01.abs() <= DIAGONAL_LIMIT {
        return Some([c00.sqrt(), 0.0, 0.0, c11.sqrt()]);
    }
    let half_trace = 0.5 * (c00 + c11);
    let determinant = c00 * c11 - c01 * c01;
    let term = (half_trace * half_trace - determinant).sqrt();
    let (e1, e2) = (half_trace + term, half_trace - term);
    let (ux, uy) = (e1 - c11, c01);
    let s = 1.0 / (ux * ux + uy * uy).sqrt();
    let (ux, uy) = (ux * s, uy * s);
    let (s1, s2) = (e1.sqrt(), e2.sqrt());
    // The second axis is the first one turned by a right angle.
    let all = [s1 * ux, s2 * uy, s1 * uy, -s2 * ux];
    all.iter().all(|v| !v.is_nan()).then_some(all)
}

/// A view ready to project: VTK's two matrices in float32.
#[derive(Clone, Debug)]
pub(super) struct Projector {
    /// World to camera, rows x, y, z of (rotation | translation).
    view: [[f32; 4]; 3],
    p00: f32,
    p11: f32,
    p22: f32,
    p23: f32,
    radius: f32,
}

impl Projector {
    /// For positions relative to `origin`: the camera is shifted in f64, the matrices rounded last.
    pub fn new(view: &View, size: Size, origin: [f64; 3], clipping_range: [f64; 2]) -> Result<Self> {
        view.check(size)?;
        let Projection::Perspective { fov_deg } = view.camera.projection else {
            return Err(Error::argument(format!(
                "view `{}`: pictures of all particles in a ParaView style need a perspective camera",
                view.name
            )));
        };
        let frame = view.camera.frame()?;
        let eye: [f64; 3] = each_axis(|k| frame.position[k] - origin[k]);
        let rows = frame.axes.map(|r| {
            let shift = -(r[0] * eye[0] + r[1] * eye[1] + r[2] * eye[2]);
            [r[0] as f32, r[1] as f32, r[2] as f32, shift as f32]
        });
        let t = libm::tan(0.5 * fov_deg.to_radians());
        let [near, far] = clipping_range;
        Ok(Projector {
            view: rows,
            p00: (1.0 / (t * size.width as f64 / size.height as f64)) as f32,
            p11: (1.0 / t) as f32,
            p22: (-(far + near) / (far - near)) as f32,
            p23: (-2.0 * far * near / (far - near)) as f32,
            radius: view.radius as f32,
        })
    }

    /// No splat's pixel radius is larger, whatever its place: the near plane bounds it.
    pub fn radius_pixels_at_most(&self, size: Size) -> f32 {
        // The matrix holds the near plane in this quotient.
        let near = self.p23 / (self.p22 - 1.0);
        self.radius * self.p11 * 0.5 * size.height as f32 / near * 2.0
    }

    /// Projects up to [`BLOCK`] particles.
    pub fn project(&self, level: Level, position: [&[f32]; 3], out: &mut ProjectedBlock) {
        dispatch!(level, simd => project_kernel(simd, self, position, out));
    }
}

#[inline(always)]
fn project_kernel<S: Simd>(_simd: S, p: &Projector, [xs, ys, zs]: [&[f32]; 3], out: &mut ProjectedBlock) {
    let n = xs.len().min(BLOCK);
    let (xs, ys, zs) = (&xs[..n], &ys[..n], &zs[..n]);
    let m = &p.view;
    let r2 = p.radius * p.radius;
    for i in 0..n {
        let (x, y, z) = (xs[i], ys[i], zs[i]);
        // The shader's order of sums, without fused operations: float32 rounds as VTK's does.
        let vx = ((m[0][0] * x + m[0][1] * y) + m[0][2] * z) + m[0][3];
        let vy = ((m[1][0] * x + m[1][1] * y) + m[1][2] * z) + m[1][3];
        let vz = ((m[2][0] * x + m[2][1] * y) + m[2][2] * z) + m[2][3];
        let (cx, cy, cz, cw) = (p.p00 * vx, p.p11 * vy, p.p22 * vz + p.p23, -vz);
        let limit = FRUSTUM_MARGIN * cw;
        let depth = cz / cw;
        let inside = (cx >= -limit) & (cx <= limit) & (cy >= -limit) & (cy <= limit) & (depth.abs() <= 1.0);
        let iz = 1.0 / vz;
        let (jx, jy) = (p.p00 * iz, p.p11 * iz);
        let iz2 = iz * iz;
        let (kx, ky) = (-(p.p00 * vx) * iz2, -(p.p11 * vy) * iz2);
        out.x[i] = cx / cw;
        out.y[i] = cy / cw;
        out.depth[i] = depth * 0.5 + 0.5;
        let c00 = r2 * (jx * jx + kx * kx);
        out.c00[i] = if inside { c00 } else { -1.0 };
        out.c11[i] = r2 * (jy * jy + ky * ky);
        out.c01[i] = r2 * (kx * ky);
    }
}

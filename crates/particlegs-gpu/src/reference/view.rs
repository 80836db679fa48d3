//! A camera as splats.wgsl reads it.

use bytemuck::{Pod, Zeroable};
use particlegs_core::camera::{Projection, View};
use particlegs_core::math::each_axis;
use particlegs_core::picture::Size;
use particlegs_core::splat::LARGEST_MEAN_ALPHA;
use particlegs_core::{Error, Result};

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ViewRecord {
    pub rows: [[f32; 4]; 3],
    pub projection: [f32; 4],
    pub size: [u32; 2],
    pub radius: f32,
    pub opacity: f32,
    pub scale: f32,
    pub count: u32,
    pub first: u32,
    pub last: u32,
    pub nothing: u32,
    pub pad: u32,
    pub strip: [u32; 2],
}

impl ViewRecord {
    /// For positions about `origin`: the camera is moved in f64, and matrices are rounded last.
    pub fn new(view: &View, size: Size, origin: [f64; 3], [near, far]: [f64; 2]) -> Result<ViewRecord> {
        view.check(size)?;
        let Projection::Perspective { fov_deg } = view.camera.projection else {
            let name = &view.name;
            return Err(Error::argument(format!("view `{name}`: drawing all particles needs a perspective camera")));
        };
        let frame = view.camera.frame()?;
        let eye: [f64; 3] = each_axis(|k| frame.position[k] - origin[k]);
        let row = |r: [f64; 3]| {
            let shift = -(r[0] * eye[0] + r[1] * eye[1] + r[2] * eye[2]);
            [r[0] as f32, r[1] as f32, r[2] as f32, shift as f32]
        };
        let t = (0.5 * fov_deg.to_radians()).tan();
        // In the order of `particlegs_reference::project`, whose bits these are.
        let p00 = 1.0 / (t * size.width as f64 / size.height as f64);
        let projection = [p00, 1.0 / t, -(far + near) / (far - near), -2.0 * far * near / (far - near)];
        // The most that one splat adds to a pixel is less than 2^32 of the units.
        let most = -(1.0 - view.opacity.min(LARGEST_MEAN_ALPHA)).ln();
        let scale = f64::exp2((30.0 - most.log2()).floor());
        Ok(ViewRecord {
            rows: frame.axes.map(row),
            projection: projection.map(|v| v as f32),
            size: [size.width as u32, size.height as u32],
            radius: view.radius as f32,
            opacity: view.opacity as f32,
            scale: scale as f32,
            count: 0,
            first: 0,
            last: 0,
            nothing: 0,
            pad: 0,
            strip: [0, size.height as u32],
        })
    }
}

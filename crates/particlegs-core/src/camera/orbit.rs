//! The published cameras: a spiral on spheres about the centre of the bounds, and the frame that models are trained in
//! (docs/law/cameras.md).

use super::rotation::Rotation;
use super::view::{Camera, CameraRecord, Projection};
use crate::math::{each_axis, norm};
use crate::picture::Size;
use crate::space::Bounds;

/// Vertical field of view, degrees.
pub const FOV_DEG: f64 = 30.0;

/// The base distance as a share of the one that VTK's ResetCamera chooses.
const BASE_SHARE: f64 = 0.65;

/// One of the three published orbits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// `far`, `mid` or `near`.
    pub name: &'static str,
    /// Times the base distance.
    pub factor: f64,
}

/// The published orbits.
pub const ORBITS: [Orbit; 3] =
    [Orbit { name: "far", factor: 1.0 }, Orbit { name: "mid", factor: 0.7 }, Orbit { name: "near", factor: 0.5 }];

/// 0.65 of ResetCamera's distance: half the diagonal over sin(fov/2), the narrower angle's where
/// the picture is taller than wide.
pub fn base_distance(bounds: &Bounds, size: Size) -> f64 {
    let half_diagonal = match 0.5 * norm(bounds.extent()) {
        0.0 => 0.5,
        r => r,
    };
    let aspect = size.width as f64 / size.height as f64;
    let mut half_angle = 0.5 * FOV_DEG.to_radians();
    if aspect < 1.0 {
        half_angle = libm::atan(libm::tan(half_angle) * aspect);
    }
    BASE_SHARE * half_diagonal / libm::sin(half_angle)
}

/// Up is +y, or +z where the view direction is within 18 degrees of the y axis.
fn view_up(position: [f64; 3], focal_point: [f64; 3]) -> [f64; 3] {
    let d: [f64; 3] = each_axis(|k| focal_point[k] - position[k]);
    if (d[1] / norm(d)).abs() > 0.95 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] }
}

/// `frames` positions on the spiral of radius `distance` about `center`: y from +0.99 to -0.99 in
/// floor(sqrt(frames)) turns. `turn` = a seed for a random rotation of the whole spiral (`None` =
/// the published, unturned one), so that training, held-out and evaluation views share no pose.
pub fn spiral(center: [f64; 3], distance: f64, frames: usize, turn: Option<u64>) -> Vec<Camera> {
    let loops = ((frames as f64).sqrt().floor()).max(1.0);
    let [a, b, c] = turn.map_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], |s| Rotation::random(s).axes());
    (0..frames)
        .map(|i| {
            // A single frame stands at the beginning of the spiral.
            let t = i as f64 / (frames.max(2) - 1) as f64;
            let y = 0.99 * (1.0 - 2.0 * t);
            let s = (1.0 - y * y).max(0.0).sqrt();
            let angle = 2.0 * std::f64::consts::PI * loops * t;
            let d = [libm::cos(angle) * s, y, libm::sin(angle) * s];
            Camera::looking_at(center, each_axis(|k| center[k] + distance * (a[k] * d[0] + b[k] * d[1] + c[k] * d[2])))
        })
        .collect()
}

/// A camera at `azimuth` and `elevation` (degrees) and `distance` (world units) from `center`:
/// azimuth 0, elevation 0 stands on +z and looks along -z; azimuth turns towards +x.
pub fn spherical_camera(center: [f64; 3], azimuth_deg: f64, elevation_deg: f64, distance: f64) -> Camera {
    let [(sin_a, cos_a), (sin_e, cos_e)] = [azimuth_deg, elevation_deg].map(|d| libm::sincos(d.to_radians()));
    let d = [sin_a * cos_e, sin_e, cos_a * cos_e];
    Camera::looking_at(center, each_axis(|k| center[k] + distance * d[k]))
}

impl Camera {
    /// A camera of the published field of view; up is +y, or +z where it looks within 18 degrees of the y axis.
    pub fn looking_at(focal_point: [f64; 3], position: [f64; 3]) -> Camera {
        let (view_up, projection) = (view_up(position, focal_point), Projection::Perspective { fov_deg: FOV_DEG });
        Camera { position, focal_point, view_up, projection, clipping_range: None }
    }
}

/// VTK's ResetCameraClippingRange of `bounds` (docs/law/cameras.md, "Clipping range").
pub fn clipping_range(bounds: &Bounds, camera: &Camera) -> [f64; 2] {
    let fov = CameraRecord::from(*camera).fov_deg.unwrap_or(FOV_DEG);
    let ahead = each_axis(|k| camera.focal_point[k] - camera.position[k]);
    let n = norm(ahead);
    let depth = |corner: [f64; 3]| -> f64 { (0..3).map(|k| (corner[k] - camera.position[k]) * ahead[k] / n).sum() };
    // VTK starts from 1e-18, which would clip a box of 1e-30 away.
    let (mut lo, mut hi) = (f64::INFINITY, f64::MIN_POSITIVE);
    for d in bounds.corners().map(depth) {
        lo = lo.min(d);
        hi = hi.max(d);
    }
    // VTK wants a tenth of the window's height between the planes, as flat data have no depth at all.
    let gap = 0.2 * libm::tan(0.5 * fov.to_radians()) * hi;
    if hi - lo < gap {
        let widen = 0.5 * (gap - hi + lo);
        hi += widen;
        lo -= widen;
    }
    // What lies behind the camera must not pull the near plane back.
    lo = lo.max(0.0);
    let mut near = 0.99 * lo - 0.5 * (hi - lo);
    let far = 1.01 * hi + 0.5 * (hi - near);
    if near >= far {
        near = 0.01 * far;
    }
    // VTK keeps this share, as its depth buffer could not tell nearer depths apart.
    [near.max(0.001 * far), far]
}

/// From the world to the frame that a model is trained in: `x_n = (x - centre) * scale` (docs/law/cameras.md, "The
/// training frame").
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Normalisation {
    /// Centre of the particles' bounds, world units.
    pub center: [f64; 3],
    /// 4 over the base distance of the published cameras, one over world units.
    pub scale: f64,
}

impl Normalisation {
    /// The frame of particles with these bounds.
    pub fn new(bounds: &Bounds) -> Self {
        let wide = Size { width: 16, height: 9 };
        Normalisation { center: bounds.center(), scale: 4.0 / base_distance(bounds, wide) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// HACC: half the diagonal of 64 x 256 x 256 over sin 15 degrees, times 0.65 (docs/law/cameras.md).
    #[test]
    fn hacc_base_distance() {
        let b = Bounds { min: [0.0; 3], max: [64.0, 256.0, 256.0] };
        let d = base_distance(&b, Size { width: 1920, height: 1080 });
        assert!((d - 461.66).abs() < 0.01, "{d}");
        assert!((b.default_radius(280_953_867) - 0.01).abs() < 1e-5);
    }

    #[test]
    fn the_spiral_stays_at_its_distance() {
        for turn in [None, Some(5)] {
            for c in spiral([1.0, 2.0, 3.0], 4.0, 7, turn) {
                assert!((c.distance() - 4.0).abs() < 1e-12);
                assert!(c.frame().is_ok());
            }
        }
    }
}

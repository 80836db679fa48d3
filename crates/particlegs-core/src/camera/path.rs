//! Views along a path through key frames, and round the vertical axis.

use super::rotation::{Rotation, at};
use super::view::{Camera, Projection, View};
use crate::math::each_axis;
use crate::{Error, Result};

/// `frames` views that pass through all key frames, evenly many from each to the next: the point looked at, the
/// orientation, the logarithm of the distance, and whatever else the key frames say, each smoothly. They begin and end
/// at rest; where two key frames are the same, nothing moves between them.
pub fn path_through(keys: &[View], frames: usize) -> Result<Vec<View>> {
    let parallel = |v: &View| matches!(v.camera.projection, Projection::Orthographic { .. });
    if let Some(other) = keys.iter().find(|v| parallel(v) != parallel(&keys[0])) {
        let message = format!(
            "cannot interpolate between `{}` and `{}`: one is perspective, the other orthographic",
            keys[0].name, other.name
        );
        return Err(Error::argument(message));
    }
    let rotations = keys.iter().map(|v| Ok(Rotation::from_frame(&v.camera.frame()?))).collect::<Result<Vec<_>>>()?;
    let numbers: Vec<[f64; 9]> = keys.iter().map(numbers).collect();
    // A key without a range has VTK's own, of which no numbers are known: then all frames have that.
    let bounded = keys.iter().all(|v| v.camera.clipping_range.is_some());
    let pieces = keys.len() - 1;
    Ok((0..frames)
        .map(|i| {
            // In whole numbers first, so that a frame that falls on a key frame is it, to the bit.
            let (place, last) = (i * pieces, (frames - 1).max(1));
            let (key, rest) = (place / last, place % last);
            let mut view = View { name: frame_name(i, frames), ..keys[key].clone() };
            if rest > 0 {
                let t = rest as f64 / last as f64;
                view.place(at(&numbers, key, t), at(&rotations, key, t), bounded);
            }
            view
        })
        .collect())
}

/// A view's numbers but for its orientation, as they change evenly: point, distance, window, range, radius, opacity.
fn numbers(v: &View) -> [f64; 9] {
    let ([x, y, z], [near, far]) = (v.camera.focal_point, v.camera.clipping_range.unwrap_or_default());
    let window = match v.camera.projection {
        Projection::Perspective { fov_deg } => fov_deg,
        Projection::Orthographic { height_world } => libm::log(height_world),
    };
    [x, y, z, libm::log(v.camera.distance()), window, near, far, libm::log(v.radius), libm::log(v.opacity)]
}

impl View {
    /// Takes what [`numbers`] gives, and an orientation.
    fn place(
        &mut self,
        [x, y, z, distance, window, near, far, radius, opacity]: [f64; 9],
        to: Rotation,
        bounded: bool,
    ) {
        let (focal_point, distance, [_, view_up, back]) = ([x, y, z], libm::exp(distance), to.axes());
        self.camera = Camera {
            position: each_axis(|k| focal_point[k] + distance * back[k]),
            focal_point,
            view_up,
            projection: match self.camera.projection {
                Projection::Perspective { .. } => Projection::Perspective { fov_deg: window },
                Projection::Orthographic { .. } => Projection::Orthographic { height_world: libm::exp(window) },
            },
            clipping_range: bounded.then_some([near, far]),
        };
        // Rounding may lead to a little more than 1, which no view accepts.
        (self.radius, self.opacity) = (libm::exp(radius), libm::exp(opacity).min(1.0));
    }

    /// Turned once round the vertical axis through the point that it looks at, in `frames` steps.
    pub fn turntable(&self, frames: usize) -> Vec<View> {
        let frame = |i| {
            let (sine, cosine) = libm::sincos(2.0 * std::f64::consts::PI * i as f64 / frames as f64);
            let turned = |v: [f64; 3]| [cosine * v[0] + sine * v[2], v[1], cosine * v[2] - sine * v[0]];
            let mut camera = self.camera;
            // The first frame is the view itself, to the bit.
            if i > 0 {
                let from = turned(each_axis(|k| camera.position[k] - camera.focal_point[k]));
                camera.position = each_axis(|k| camera.focal_point[k] + from[k]);
                camera.view_up = turned(camera.view_up);
            }
            View { name: frame_name(i, frames), camera, ..self.clone() }
        };
        (0..frames).map(frame).collect()
    }
}

/// Digits of the number of one of so many frames.
pub fn frame_digits(frames: usize) -> usize {
    frames.saturating_sub(1).to_string().len().max(4)
}

/// `frame_0007`: in the order of the names, and as ffmpeg counts.
fn frame_name(i: usize, frames: usize) -> String {
    format!("frame_{i:0width$}", width = frame_digits(frames))
}

/// The number of the frame that a view was named as.
pub fn frame_number(name: &str) -> Option<usize> {
    name.strip_prefix("frame_")?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{CameraRecord, spherical_camera};
    use crate::picture::Size;

    fn view(center: [f64; 3], azimuth: f64, elevation: f64, distance: f64) -> View {
        let camera = spherical_camera(center, azimuth, elevation, distance);
        View { name: "key".into(), camera, radius: 0.01 * distance, opacity: 0.05 }
    }

    fn same(a: &View, b: &View) -> f64 {
        let camera_numbers = |v: &View| {
            let f = v.camera.frame().unwrap();
            let (c, r) = (v.camera, CameraRecord::from(v.camera));
            let window = r.fov_deg.or(r.height_world).unwrap();
            [[v.radius, v.opacity, window], c.position, c.focal_point, f.axes[0], f.axes[1], f.axes[2]]
        };
        camera_numbers(a)
            .as_flattened()
            .iter()
            .zip(camera_numbers(b).as_flattened())
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_path_passes_through_its_key_frames() {
        let keys = [
            view([0.0; 3], 0.0, 0.0, 10.0),
            view([1.0, 2.0, 3.0], 170.0, 40.0, 1.0),
            view([0.0; 3], 300.0, -80.0, 50.0),
        ];
        for frames in [3, 5, 21] {
            let path = path_through(&keys, frames).unwrap();
            assert_eq!(path.len(), frames);
            for (i, key) in keys.iter().enumerate() {
                let frame = &path[i * (frames - 1) / 2];
                assert_eq!((frame.camera, frame.radius), (key.camera, key.radius), "to the bit");
            }
            path.iter().for_each(|v| v.check(Size { width: 16, height: 9 }).unwrap());
        }
        // Halfway in time it is halfway in the logarithm of the distance between two key frames.
        let path = path_through(&keys[..2], 3).unwrap();
        assert!((path[1].camera.distance() - 10f64.sqrt()).abs() < 1e-9);
        assert_eq!(path_through(&keys[..1], 4).unwrap().len(), 4);
        assert_eq!(path_through(&keys, 1).unwrap()[0].camera, keys[0].camera);
    }

    #[test]
    fn nothing_moves_between_equal_key_frames() {
        let (a, b) = (view([0.0; 3], 10.0, 0.0, 10.0), view([3.0, 0.0, 0.0], 100.0, 20.0, 4.0));
        let path = path_through(&[a.clone(), b.clone(), b.clone(), a], 31).unwrap();
        assert!(path[10..=20].iter().all(|v| same(v, &b) < 1e-12));
    }

    #[test]
    fn steps_are_small_everywhere() {
        let keys = [view([0.0; 3], 0.0, 0.0, 10.0), view([1.0; 3], 90.0, 10.0, 5.0), view([2.0; 3], 260.0, 0.0, 5.0)];
        let path = path_through(&keys, 401).unwrap();
        let most = path.windows(2).map(|p| same(&p[0], &p[1])).fold(0.0, f64::max);
        assert!(most < 0.2, "{most}");
    }

    #[test]
    fn a_turn_keeps_distance_and_height() {
        let first = view([1.0, 2.0, 3.0], 25.0, 30.0, 8.0);
        let all = first.turntable(8);
        assert_eq!(all[0].camera, first.camera);
        for (i, v) in all.iter().enumerate() {
            assert!((v.camera.distance() - 8.0).abs() < 1e-12 && (v.camera.position[1] - 6.0).abs() < 1e-12);
            assert!(same(v, &view([1.0, 2.0, 3.0], 25.0 + 45.0 * i as f64, 30.0, 8.0)) < 1e-12, "{i}");
        }
        assert_eq!([&all[0].name[..], &all[7].name], ["frame_0000", "frame_0007"]);
    }

    #[test]
    fn projections_cannot_be_mixed() {
        let mut flat = view([0.0; 3], 0.0, 0.0, 1.0);
        flat.camera.projection = Projection::Orthographic { height_world: 3.0 };
        assert!(path_through(&[view([0.0; 3], 0.0, 0.0, 1.0), flat], 3).is_err());
    }

    #[test]
    fn it_passes_through_keys_and_stays_between_them() {
        let keys: [f64; 6] = [1.0, 4.0, 4.0, -2.0, -2.5, 7.0];
        let at = |i, t| at(&keys.map(|key| [key]), i, t)[0];
        for i in 0..5 {
            let (low, high) = (keys[i].min(keys[i + 1]), keys[i].max(keys[i + 1]));
            assert!((at(i, 0.0) - keys[i]).abs() < 1e-12 && (at(i, 1.0) - keys[i + 1]).abs() < 1e-12);
            assert!((0..=100).all(|s| (low - 1e-12..=high + 1e-12).contains(&at(i, f64::from(s) / 100.0))));
        }
        assert_eq!(at(1, 0.37), 4.0);
        assert_eq!(super::at(&[[3.0]], 0, 0.0), [3.0]);
    }

    #[test]
    fn it_has_no_corners() {
        let keys = [[0.0], [1.0], [3.0], [4.0]];
        let slope = |i, t, e| (at(&keys, i, t)[0] - at(&keys, i, t - e)[0]) / e;
        for i in 1..3 {
            let (before, after) = (slope(i - 1, 1.0, 1e-6), slope(i, 1e-6, 1e-6));
            assert!((before - after).abs() < 1e-4, "{before} {after}");
        }
    }
}

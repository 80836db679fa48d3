//! Views along a path through key frames, and round the vertical axis.

use super::rotation::{self, Rotation};
use super::spline;
use particlegs::camera::{Camera, Projection, View};
use particlegs::math::each_axis;
use particlegs::{Error, Result};

/// `frames` views that pass through all key frames, evenly many from each to the next: the point looked at, the
/// orientation, the logarithm of the distance, and whatever else the key frames say, each smoothly. They begin and end
/// at rest; where two key frames are the same, nothing moves between them.
pub fn through(keys: &[View], frames: usize) -> Result<Vec<View>> {
    let parallel = |v: &View| matches!(v.camera.projection, Projection::Orthographic { .. });
    if let Some(other) = keys.iter().find(|v| parallel(v) != parallel(&keys[0])) {
        let what = format!(
            "--path: `{}` and `{}` differ in projection: there is no way between perspective and orthographic",
            keys[0].name, other.name
        );
        return Err(Error::argument(what));
    }
    let rotations = keys.iter().map(|v| Ok(Rotation::of(&v.camera.frame()?))).collect::<Result<Vec<_>>>()?;
    let pieces = keys.len() - 1;
    Ok((0..frames)
        .map(|i| {
            // In whole numbers first, so that a frame that falls on a key frame is it, to the bit.
            let (place, last) = (i * pieces, (frames - 1).max(1));
            let (key, rest) = (place / last, place % last);
            let view = match rest {
                0 => keys[key].clone(),
                _ => between(keys, &rotations, key, rest as f64 / last as f64),
            };
            View { name: frame_name(i, frames), ..view }
        })
        .collect())
}

fn between(keys: &[View], rotations: &[Rotation], i: usize, t: f64) -> View {
    let number = |of: &dyn Fn(&View) -> f64| {
        let all: Vec<f64> = keys.iter().map(of).collect();
        spline::at(&all, i, t)
    };
    let logarithm = |of: &dyn Fn(&View) -> f64| number(&|v| of(v).ln()).exp();
    let focal_point = each_axis(|k| number(&|v| v.camera.focal_point[k]));
    let distance = logarithm(&|v| v.camera.distance());
    let axes = rotation::at(rotations, i, t).axes();
    let projection = match keys[i].camera.projection {
        Projection::Perspective { .. } => Projection::Perspective { fov_deg: number(&|v| height(v)) },
        Projection::Orthographic { .. } => Projection::Orthographic { height_world: logarithm(&height) },
    };
    let bounded = keys.iter().all(|v| v.camera.clipping_range.is_some());
    let end = |k: usize| number(&|v| v.camera.clipping_range.unwrap_or_default()[k]);
    View {
        name: String::new(),
        camera: Camera {
            position: each_axis(|k| focal_point[k] + distance * axes[2][k]),
            focal_point,
            view_up: axes[1],
            projection,
            clipping_range: bounded.then(|| [end(0), end(1)]),
        },
        radius: logarithm(&|v| v.radius),
        opacity: logarithm(&|v| v.opacity).min(1.0),
    }
}

/// Degrees, or world units.
fn height(v: &View) -> f64 {
    match v.camera.projection {
        Projection::Perspective { fov_deg } => fov_deg,
        Projection::Orthographic { height_world } => height_world,
    }
}

/// A view turned once round the vertical axis through the point that it looks at, in `frames` steps.
pub fn turntable(view: &View, frames: usize) -> Vec<View> {
    (0..frames)
        .map(|i| {
            let name = frame_name(i, frames);
            let [sine, cosine] = if i == 0 { [0.0, 1.0] } else { turn(i, frames) };
            let turned = |v: [f64; 3]| [cosine * v[0] + sine * v[2], v[1], cosine * v[2] - sine * v[0]];
            let c = view.camera;
            let from = turned(each_axis(|k| c.position[k] - c.focal_point[k]));
            let position = if i == 0 { c.position } else { each_axis(|k| c.focal_point[k] + from[k]) };
            View { name, camera: Camera { position, view_up: turned(c.view_up), ..c }, ..view.clone() }
        })
        .collect()
}

/// Sine and cosine of a part of a turn.
fn turn(i: usize, frames: usize) -> [f64; 2] {
    let (sine, cosine) = (2.0 * std::f64::consts::PI * i as f64 / frames as f64).sin_cos();
    [sine, cosine]
}

/// Degrees that each frame of a turn is turned by.
pub fn turns(frames: usize) -> Vec<f64> {
    (0..frames).map(|i| 360.0 * i as f64 / frames as f64).collect()
}

/// Digits of the number of a frame.
pub fn digits(frames: usize) -> usize {
    frames.saturating_sub(1).to_string().len().max(4)
}

/// `frame_0007`: in the order of the names, and as ffmpeg counts.
fn frame_name(i: usize, frames: usize) -> String {
    format!("frame_{i:0width$}", width = digits(frames))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::camera::spherical_camera;

    fn view(center: [f64; 3], azimuth: f64, elevation: f64, distance: f64) -> View {
        let camera = spherical_camera(center, azimuth, elevation, distance);
        View { name: "key".into(), camera, radius: 0.01 * distance, opacity: 0.05 }
    }

    fn same(a: &View, b: &View) -> f64 {
        let of = |v: &View| {
            let f = v.camera.frame().unwrap();
            let c = v.camera;
            [[v.radius, v.opacity, height(v)], c.position, c.focal_point, f.axes[0], f.axes[1], f.axes[2]]
        };
        of(a).as_flattened().iter().zip(of(b).as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_path_passes_through_its_key_frames() {
        let keys = [
            view([0.0; 3], 0.0, 0.0, 10.0),
            view([1.0, 2.0, 3.0], 170.0, 40.0, 1.0),
            view([0.0; 3], 300.0, -80.0, 50.0),
        ];
        for frames in [3, 5, 21] {
            let path = through(&keys, frames).unwrap();
            assert_eq!(path.len(), frames);
            for (i, key) in keys.iter().enumerate() {
                let frame = &path[i * (frames - 1) / 2];
                assert_eq!((frame.camera, frame.radius), (key.camera, key.radius), "to the bit");
            }
            path.iter().for_each(|v| v.check(particlegs::picture::Size { width: 16, height: 9 }).unwrap());
        }
        // Halfway in time it is halfway in the logarithm of the distance between two key frames.
        let path = through(&keys[..2], 3).unwrap();
        assert!((path[1].camera.distance() - 10f64.sqrt()).abs() < 1e-9);
        assert_eq!(through(&keys[..1], 4).unwrap().len(), 4);
        assert_eq!(through(&keys, 1).unwrap()[0].camera, keys[0].camera);
    }

    #[test]
    fn nothing_moves_between_equal_key_frames() {
        let (a, b) = (view([0.0; 3], 10.0, 0.0, 10.0), view([3.0, 0.0, 0.0], 100.0, 20.0, 4.0));
        let path = through(&[a.clone(), b.clone(), b.clone(), a], 31).unwrap();
        assert!(path[10..=20].iter().all(|v| same(v, &b) < 1e-12));
    }

    #[test]
    fn steps_are_small_everywhere() {
        let keys = [view([0.0; 3], 0.0, 0.0, 10.0), view([1.0; 3], 90.0, 10.0, 5.0), view([2.0; 3], 260.0, 0.0, 5.0)];
        let path = through(&keys, 401).unwrap();
        let most = path.windows(2).map(|p| same(&p[0], &p[1])).fold(0.0, f64::max);
        assert!(most < 0.2, "{most}");
    }

    #[test]
    fn a_turn_keeps_distance_and_height() {
        let first = view([1.0, 2.0, 3.0], 25.0, 30.0, 8.0);
        let all = turntable(&first, 8);
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
        assert!(through(&[view([0.0; 3], 0.0, 0.0, 1.0), flat], 3).is_err());
    }
}

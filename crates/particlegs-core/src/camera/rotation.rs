//! Orientations, as unit quaternions (w, x, y, z), and smooth curves through keys of them or of numbers.

use super::view::Frame;
use crate::math::{Purpose, Random, cross, dot, each_axis, norm};
use std::array::from_fn;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rotation([f64; 4]);

impl Rotation {
    fn new(q: [f64; 4]) -> Rotation {
        let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        Rotation(q.map(|v| v / n))
    }

    /// One drawn uniformly.
    pub fn random(seed: u64) -> Rotation {
        let mut random = Random::from_purpose(Purpose::OrbitTurn, seed, 0);
        Rotation::new(from_fn(|_| random.normal()))
    }

    /// The orientation of a camera's frame (Shepperd 1978: by the largest component).
    pub fn from_frame(frame: &Frame) -> Rotation {
        let [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = frame.axes;
        // Each row is the quaternion times four of its components.
        let rows = [
            [1.0 + xx + yy + zz, yz - zy, zx - xz, xy - yx],
            [yz - zy, 1.0 + xx - yy - zz, xy + yx, xz + zx],
            [zx - xz, xy + yx, 1.0 - xx + yy - zz, yz + zy],
            [xy - yx, xz + zx, yz + zy, 1.0 - xx - yy + zz],
        ];
        let largest = (0..4).fold(0, |b, k| if rows[k][k] > rows[b][b] { k } else { b });
        Rotation::new(rows[largest])
    }

    /// Right, up and backwards in the world.
    pub fn axes(self) -> [[f64; 3]; 3] {
        let Rotation([w, x, y, z]) = self;
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    fn times(self, o: Rotation) -> Rotation {
        let (Rotation([w, u @ ..]), Rotation([r, v @ ..])) = (self, o);
        let turned = cross(u, v);
        let [x, y, z] = each_axis(|k| w * v[k] + r * u[k] + turned[k]);
        Rotation([w * r - dot(u, v), x, y, z])
    }
}

/// Steps are turns: an axis times an angle in radians.
impl Interpolate<3> for Rotation {
    /// The shorter turn, about the axes of this orientation, that leads to another.
    fn step_to(self, other: Rotation) -> [f64; 3] {
        let [a, b, c, d] = self.0;
        let Rotation([w, axis @ ..]) = Rotation([a, -b, -c, -d]).times(other);
        let sine = norm(axis);
        // For small turns the angle is twice the sine.
        let factor = if sine < 1e-12 { 2.0 } else { 2.0 * libm::atan2(sine, w.abs()) / sine };
        // q and -q are the same orientation: the sign of w takes the shorter turn.
        axis.map(|v| v * factor.copysign(w))
    }

    /// This orientation, turned about its own axes.
    fn stepped(self, by: [f64; 3]) -> Rotation {
        let angle = norm(by);
        if angle == 0.0 {
            return self;
        }
        let (sine, cosine) = libm::sincos(0.5 * angle);
        let [x, y, z] = by.map(|v| v * sine / angle);
        // Normalised again, so that rounding does not add up from step to step.
        Rotation::new(self.times(Rotation([cosine, x, y, z])).0)
    }
}

/// A value that changes smoothly from key to key: numbers, or an orientation.
pub(super) trait Interpolate<const N: usize>: Copy {
    /// The step that leads to another.
    fn step_to(self, other: Self) -> [f64; N];

    fn stepped(self, by: [f64; N]) -> Self;
}

impl<const N: usize> Interpolate<N> for [f64; N] {
    fn step_to(self, other: Self) -> [f64; N] {
        from_fn(|k| other[k] - self[k])
    }

    fn stepped(self, by: [f64; N]) -> Self {
        from_fn(|k| self[k] + by[k])
    }
}

/// The slope at a key between two steps, as Fritsch and Butland (1984) choose it: the harmonic mean of steps in one
/// direction, and rest where the direction turns.
fn slope(before: f64, after: f64) -> f64 {
    if before * after > 0.0 { 2.0 / (1.0 / before + 1.0 / after) } else { 0.0 }
}

/// The value at `t` in [0, 1] of the piece that begins at key `i`: a cubic Bezier curve (Shoemake 1985 for orientations)
/// that passes through each key, nowhere beyond its neighbours. The first and the last key are at rest.
pub(super) fn at<const N: usize, T: Interpolate<N>>(keys: &[T], i: usize, t: f64) -> T {
    let Some(&next) = keys.get(i + 1) else { return keys[i] };
    let speed = |k: usize| match (k.checked_sub(1).and_then(|b| keys.get(b)), keys.get(k + 1)) {
        (Some(before), Some(after)) => {
            let (a, b) = (before.step_to(keys[k]), keys[k].step_to(*after));
            from_fn(|k| slope(a[k], b[k]))
        }
        _ => [0.0; N],
    };
    let step = |from: T, by: [f64; N], share: f64| from.stepped(by.map(|v| v * share));
    // The inner points of a cubic Bezier curve lie a third of the slope from its ends.
    let mut points = [keys[i], step(keys[i], speed(i), 1.0 / 3.0), step(next, speed(i + 1), -1.0 / 3.0), next];
    // De Casteljau's construction needs nothing but steps from value to value, which orientations have, too.
    for left in (1..4).rev() {
        for k in 0..left {
            points[k] = step(points[k], points[k].step_to(points[k + 1]), t);
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::spherical_camera;

    fn frame(azimuth: f64, elevation: f64) -> Frame {
        spherical_camera([0.0; 3], azimuth, elevation, 1.0).frame().unwrap()
    }

    fn apart(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn frames_come_back() {
        for azimuth in [0.0, 45.0, 90.0, 170.0, 180.0, 200.0, 359.0] {
            for elevation in [-85.0, -30.0, 0.0, 60.0] {
                let frame = frame(azimuth, elevation);
                assert!(apart(Rotation::from_frame(&frame).axes(), frame.axes) < 1e-12, "{azimuth} {elevation}");
            }
        }
    }

    #[test]
    fn it_passes_through_keys_rests_between_equal_ones_and_has_no_corners() {
        let keys = [[0.0, 0.0], [80.0, 10.0], [80.0, 10.0], [140.0, -20.0], [170.0, -25.0]];
        let keys = keys.map(|[azimuth, elevation]| Rotation::from_frame(&frame(azimuth, elevation)));
        for i in 0..4 {
            assert!(apart(at(&keys, i, 0.0).axes(), keys[i].axes()) < 1e-12);
            assert!(apart(at(&keys, i, 1.0).axes(), keys[i + 1].axes()) < 1e-12);
        }
        for t in [0.1, 0.5, 0.9] {
            assert!(apart(at(&keys, 1, t).axes(), keys[1].axes()) < 1e-12);
        }
        let e = 1e-5;
        let speed = |a: Rotation, b: Rotation| a.step_to(b).map(|v| v / e);
        let (before, after) = (speed(at(&keys, 2, 1.0 - e), keys[3]), speed(keys[3], at(&keys, 3, e)));
        assert!((0..3).all(|k| (before[k] - after[k]).abs() < 1e-3), "{before:?} {after:?}");
    }
}

//! Orientations between key frames, as unit quaternions (w, x, y, z).

use super::spline::slope;
use particlegs::camera::Frame;
use particlegs::math::each_axis;

/// An orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation([f64; 4]);

/// A turn: its axis times its angle in radians.
type RotationVector = [f64; 3];

impl Rotation {
    /// The orientation of a camera's frame (Shepperd 1978: the largest component first).
    pub fn of(frame: &Frame) -> Rotation {
        // Column k of the matrix is camera axis k in the world.
        let m = |r: usize, c: usize| frame.axes[c][r];
        let trace = m(0, 0) + m(1, 1) + m(2, 2);
        let squares = [trace, m(0, 0), m(1, 1), m(2, 2)];
        let largest = (0..4).fold(0, |b, k| if squares[k] > squares[b] { k } else { b });
        let q = match largest {
            0 => [1.0 + trace, m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)],
            k => {
                let (i, j, l) = (k - 1, k % 3, (k + 1) % 3);
                let mut q = [0.0; 4];
                q[0] = m(l, j) - m(j, l);
                q[1 + i] = 1.0 + m(i, i) - m(j, j) - m(l, l);
                q[1 + j] = m(i, j) + m(j, i);
                q[1 + l] = m(i, l) + m(l, i);
                q
            }
        };
        Rotation(q).unit()
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

    fn unit(self) -> Rotation {
        let n = self.0.iter().map(|v| v * v).sum::<f64>().sqrt();
        Rotation(self.0.map(|v| v / n))
    }

    fn times(self, o: Rotation) -> Rotation {
        let (Rotation([a, b, c, d]), Rotation([w, x, y, z])) = (self, o);
        Rotation([
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ])
    }

    /// The shorter turn, about the axes of this orientation, that leads to another.
    fn turn_to(self, o: Rotation) -> RotationVector {
        let [a, b, c, d] = self.0;
        let Rotation([w, x, y, z]) = Rotation([a, -b, -c, -d]).times(o);
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        let sine = (x * x + y * y + z * z).sqrt();
        // For small turns the angle is twice the sine.
        let factor = if sine < 1e-12 { 2.0 } else { 2.0 * sine.atan2(w.abs()) / sine };
        [x, y, z].map(|v| sign * factor * v)
    }

    /// This orientation, turned about its own axes.
    fn turned(self, by: RotationVector) -> Rotation {
        let angle = by.iter().map(|v| v * v).sum::<f64>().sqrt();
        if angle == 0.0 {
            return self;
        }
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let [x, y, z] = by.map(|v| v * sine / angle);
        self.times(Rotation([cosine, x, y, z])).unit()
    }

    /// On the way to another along the shorter arc.
    fn toward(self, o: Rotation, t: f64) -> Rotation {
        self.turned(self.turn_to(o).map(|v| v * t))
    }
}

/// The orientation at `t` of the piece that begins at key `i`: a cubic Bezier curve on the sphere of orientations
/// (Shoemake 1985), whose turn at each key is the limited mean of those before and after; the ends are at rest.
pub fn at(keys: &[Rotation], i: usize, t: f64) -> Rotation {
    let Some(&next) = keys.get(i + 1) else { return keys[i] };
    let speed = |k: usize| -> RotationVector {
        match (k.checked_sub(1).and_then(|b| keys.get(b)), keys.get(k + 1)) {
            (Some(before), Some(after)) => {
                let (a, b) = (before.turn_to(keys[k]), keys[k].turn_to(*after));
                each_axis(|k| slope(a[k], b[k]))
            }
            _ => [0.0; 3],
        }
    };
    let from = keys[i].turned(speed(i).map(|v| v / 3.0));
    let to = next.turned(speed(i + 1).map(|v| -v / 3.0));
    let mut points = [keys[i], from, to, next];
    for left in (1..4).rev() {
        for k in 0..left {
            points[k] = points[k].toward(points[k + 1], t);
        }
    }
    points[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::camera::spherical_camera;

    fn of(azimuth: f64, elevation: f64) -> Rotation {
        Rotation::of(&spherical_camera([0.0; 3], azimuth, elevation, 1.0).frame().unwrap())
    }

    fn apart(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> f64 {
        a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn frames_come_back() {
        for azimuth in [0.0, 45.0, 90.0, 170.0, 180.0, 200.0, 359.0] {
            for elevation in [-85.0, -30.0, 0.0, 60.0] {
                let frame = spherical_camera([0.0; 3], azimuth, elevation, 1.0).frame().unwrap();
                assert!(apart(Rotation::of(&frame).axes(), frame.axes) < 1e-12, "{azimuth} {elevation}");
            }
        }
    }

    #[test]
    fn it_passes_through_keys_rests_between_equal_ones_and_has_no_corners() {
        let keys = [of(0.0, 0.0), of(80.0, 10.0), of(80.0, 10.0), of(140.0, -20.0), of(170.0, -25.0)];
        for i in 0..4 {
            assert!(apart(at(&keys, i, 0.0).axes(), keys[i].axes()) < 1e-12);
            assert!(apart(at(&keys, i, 1.0).axes(), keys[i + 1].axes()) < 1e-12);
        }
        for t in [0.1, 0.5, 0.9] {
            assert!(apart(at(&keys, 1, t).axes(), keys[1].axes()) < 1e-12);
        }
        let e = 1e-5;
        let speed = |a: Rotation, b: Rotation| a.turn_to(b).map(|v| v / e);
        let (before, after) = (speed(at(&keys, 2, 1.0 - e), keys[3]), speed(keys[3], at(&keys, 3, e)));
        assert!((0..3).all(|k| (before[k] - after[k]).abs() < 1e-3), "{before:?} {after:?}");
    }
}

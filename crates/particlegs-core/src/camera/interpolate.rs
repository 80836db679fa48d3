//! Smooth curves through keys.

use std::array::from_fn;

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
    let mut points = [keys[i], step(keys[i], speed(i), 1.0 / 3.0), step(next, speed(i + 1), -1.0 / 3.0), next];
    for left in (1..4).rev() {
        for k in 0..left {
            points[k] = step(points[k], points[k].step_to(points[k + 1]), t);
        }
    }
    points[0]
}

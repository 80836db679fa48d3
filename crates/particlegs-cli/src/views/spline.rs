//! Numbers between key frames: cubic, passing through each, nowhere beyond its neighbours.

/// The slope at a key between two steps, as Fritsch and Butland (1984) choose it: the harmonic mean of steps in one
/// direction, and rest where the direction turns.
pub fn slope(before: f64, after: f64) -> f64 {
    if before * after > 0.0 { 2.0 / (1.0 / before + 1.0 / after) } else { 0.0 }
}

/// The value at `t` in [0, 1] between two values with their slopes (a cubic Hermite polynomial).
fn between(values: [f64; 2], slopes: [f64; 2], t: f64) -> f64 {
    let step = values[1] - values[0];
    let (c, d) = (3.0 * step - 2.0 * slopes[0] - slopes[1], slopes[0] + slopes[1] - 2.0 * step);
    values[0] + t * (slopes[0] + t * (c + t * d))
}

/// The value at `t` of the piece that begins at key `i`; the first and the last key are at rest.
pub fn at(keys: &[f64], i: usize, t: f64) -> f64 {
    let slope_at = |k: usize| match (k.checked_sub(1).and_then(|b| keys.get(b)), keys.get(k + 1)) {
        (Some(before), Some(after)) => slope(keys[k] - before, after - keys[k]),
        _ => 0.0,
    };
    match keys.get(i + 1) {
        Some(&next) => between([keys[i], next], [slope_at(i), slope_at(i + 1)], t),
        None => keys[i],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_passes_through_keys_and_stays_between_them() {
        let keys: [f64; 6] = [1.0, 4.0, 4.0, -2.0, -2.5, 7.0];
        for i in 0..5 {
            let (low, high) = (keys[i].min(keys[i + 1]), keys[i].max(keys[i + 1]));
            assert!((at(&keys, i, 0.0) - keys[i]).abs() < 1e-12 && (at(&keys, i, 1.0) - keys[i + 1]).abs() < 1e-12);
            assert!((0..=100).all(|s| (low - 1e-12..=high + 1e-12).contains(&at(&keys, i, f64::from(s) / 100.0))));
        }
        assert_eq!(at(&keys, 1, 0.37), 4.0);
        assert_eq!(at(&[3.0], 0, 0.0), 3.0);
    }

    #[test]
    fn it_has_no_corners() {
        let keys = [0.0, 1.0, 3.0, 4.0];
        for i in 1..3 {
            let before = (at(&keys, i - 1, 1.0) - at(&keys, i - 1, 1.0 - 1e-6)) / 1e-6;
            let after = (at(&keys, i, 1e-6) - at(&keys, i, 0.0)) / 1e-6;
            assert!((before - after).abs() < 1e-4, "{before} {after}");
        }
    }
}

//! Places and axes as fixed.wgsl has them.

/// Bits of the fraction of a place, and of an axis.
const FRACTION: i32 = 40;
const AXIS_FRACTION: i32 = 47;
/// Places as far as this from the middle of the training frame do not fit.
const FARTHEST: f64 = 4_194_304.0;

/// The words of a coordinate, low one first, where it fits.
pub(super) fn place(v: f64) -> Option<[u32; 2]> {
    (v.abs() < FARTHEST).then(|| words((v * 2f64.powi(FRACTION)).round() as i64))
}

/// The magnitude of a part of an axis, and 1 where it is negative.
pub(super) fn axis(v: f64) -> [u32; 4] {
    let [low, high] = words((v.abs().min(1.0) * 2f64.powi(AXIS_FRACTION)).round() as i64);
    [low, high, u32::from(v < 0.0), 0]
}

fn words(v: i64) -> [u32; 2] {
    [v as u32, (v >> 32) as u32]
}

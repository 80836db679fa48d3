//! Planes kept from one picture to the next: fresh memory costs more than drawing a small scene.

use crate::Result;
use crate::memory::filled;
use std::sync::Mutex;

/// Floats kept at most: enough for a few pictures of 4K.
const MOST: usize = 1 << 26;

static KEPT: Mutex<Vec<Vec<f32>>> = Mutex::new(Vec::new());

/// Are planes of `len` floats kept at all?
pub(super) fn keeps(len: usize) -> bool {
    len <= MOST
}

/// `len` floats of any value.
///
/// # Errors
/// [`crate::Error::Memory`].
pub(super) fn take(len: usize) -> Result<Vec<f32>> {
    let mut kept = KEPT.lock().unwrap_or_else(|e| e.into_inner());
    match kept.iter().position(|v| v.len() == len) {
        Some(at) => Ok(kept.swap_remove(at)),
        None => filled("a picture", 0.0, len),
    }
}

/// Hands floats back; the oldest go where too many are kept.
pub(super) fn give(values: Vec<f32>) {
    let mut kept = KEPT.lock().unwrap_or_else(|e| e.into_inner());
    kept.push(values);
    let mut sum: usize = kept.iter().map(Vec::len).sum();
    while sum > MOST {
        sum -= kept.remove(0).len();
    }
}

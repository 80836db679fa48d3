//! The instruction set, chosen once at run time; a switch forces the plain path for tests.

use fearless_simd::Level;
use std::sync::atomic::{AtomicBool, Ordering};

static OFF: AtomicBool = AtomicBool::new(false);

/// Turns vector instructions off (or on again). Results are the same bits either way.
pub fn set_simd(on: bool) {
    OFF.store(!on, Ordering::Relaxed);
}

/// The level to hand to [`fearless_simd::dispatch!`].
pub fn simd_level() -> Level {
    if OFF.load(Ordering::Relaxed) { Level::baseline() } else { Level::new() }
}

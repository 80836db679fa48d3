//! Pictures of all particles for the page, by the reference renderer: one at a time, the newest first.
//!
//! [`RenderRequest`] is what the page asks, checked; `desk` takes questions from connections and hands them to the one
//! thread that draws.

pub(crate) mod desk;
mod question;

/// Neighbours that each particle is spread over in densities.
const NEIGHBOURS: usize = 32;
/// Particles at most whose neighbours are looked for: a user waits for them.
const MOST_SMOOTHED: u64 = 10_000_000;

/// Over how many neighbours each of so many particles is spread in densities; `None` where they are not.
pub(crate) fn smoothed(particles: u64) -> Option<usize> {
    (NEIGHBOURS as u64 + 1..=MOST_SMOOTHED).contains(&particles).then_some(NEIGHBOURS)
}

pub use question::RenderRequest;

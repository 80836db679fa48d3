//! Pictures of all particles for the page, drawn by the reference renderer. Only the newest request is answered.
//!
//! [`RenderRequest`] is a checked request; `queue` passes requests from connections to the thread that draws.

mod question;
pub(crate) mod queue;

/// Number of neighbours that densities are smoothed over.
const NEIGHBOURS: usize = 32;
/// Maximum number of particles to smooth: the user waits for it.
const MOST_SMOOTHED: u64 = 10_000_000;

/// Number of neighbours that the densities of this many particles are smoothed over; `None` if they are not.
pub(crate) fn smoothed(particles: u64) -> Option<usize> {
    (NEIGHBOURS as u64 + 1..=MOST_SMOOTHED).contains(&particles).then_some(NEIGHBOURS)
}

pub use question::RenderRequest;

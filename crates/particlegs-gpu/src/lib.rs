//! Pictures on a graphics card: the stages of `particlegs_core::render` as kernels in WGSL, which any vendor's card runs.
//!
//! A [`Device`] is an adapter that was opened; [`adapters`] lists what there is. A [`render::Renderer`] draws scenes of the
//! optical-depth law, an [`alpha::Renderer`] those of the alpha-blend law, a [`reference::Reference`] all particles;
//! [`render::Pictures`] are of a scene of either law. Files in WGSL are called as the stages of core that they are twins
//! of, and say where they differ: cards count in f32. Sums that several threads add to are of whole numbers, and what is
//! sorted stays in its order among equals, so that a picture has the same bits whatever the order of threads.

mod adapters;
pub mod alpha;
mod device;
mod kernel;
pub mod reference;
pub mod render;
#[cfg(test)]
mod tests;

pub use adapters::{Adapter, Choice, adapters, advice};
pub use device::{Checks, Device};

/// Threads of a group in kernels of one dimension.
const THREADS: u64 = 64;
/// Groups of a dispatch along an axis, at most.
const MOST_GROUPS: u64 = 65_535;

/// Groups for so many threads, in as many rows as it takes.
fn groups(threads: u64) -> [u32; 2] {
    let all = threads.div_ceil(THREADS);
    let down = all.div_ceil(MOST_GROUPS).max(1);
    [all.div_ceil(down) as u32, down as u32]
}

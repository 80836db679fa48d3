//! Pictures on a graphics card: the stages of `particlegs_core::render` as kernels in WGSL, which any vendor's card runs.
//!
//! A [`Device`] is an adapter that was opened; [`adapters`] lists what there is. A [`render::Renderer`] draws scenes of the
//! optical-depth law, a [`reference::Reference`] all particles without noise, a [`reference::paraview::Paraview`] as
//! ParaView does. Files in WGSL are called as the stages that they are twins of, and say where they differ: cards count
//! in f32; atomic sums and maxima are of whole numbers, so that a picture has the same bits whatever the order.

mod adapters;
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

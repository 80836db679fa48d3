//! Pictures on a GPU: the stages of `particlegs_core::render` as WGSL kernels, which run on GPUs of any vendor.
//!
//! A [`Device`] is an adapter that was opened; [`adapters`] lists what there is. A [`GpuAccelerator`] draws and trains on one:
//! scenes by [`render::DepthRenderer`] or [`alpha::AlphaRenderer`], all particles by [`reference::ReferenceRenderer`] without
//! noise and by [`reference::paraview::Paraview`] as ParaView does. Files in WGSL are called as the stages that they are twins
//! of, and say where they differ: GPUs compute in f32. Sums of several threads are of whole numbers, and equals that
//! are sorted stay in their order, so that a picture has the same bits whatever the order of threads.
//!
//! A kernel is added in the folder of its work: `NAME.wgsl` is the stage, `NAME_main.wgsl` its entry point, and
//! `kernels.rs` (or `mod.rs`) there makes it. It has the name of its twin on the CPU, and its test says by how much it may
//! differ from that; `tests/gpu` runs them.

// Docs stand where a name does not say it.
#![allow(missing_docs)]

mod accelerator;
mod adapters;
pub mod alpha;
mod device;
pub mod kernel;
pub mod reference;
pub mod render;
mod sort;
#[cfg(test)]
mod tests;
mod train;

pub use accelerator::GpuAccelerator;
pub use adapters::{Adapter, AdapterChoice, adapters, advice};
pub use device::{Checks, Device, KernelWatch};

/// Threads of a group in kernels of one dimension.
const THREADS: u64 = 64;
/// Groups of a dispatch along an axis, at most.
const MOST_GROUPS: u64 = 65_535;

/// Gaussians whose pixels are gone over in one dispatch: at the 450 pixels that a round one has at most, a tenth of a second
/// of a slow GPU. Few in tests, so that those have several.
const AT_ONCE: u32 = if cfg!(test) { 512 } else { 1 << 18 };
/// The same of Gaussians that are cut along depth: from within they have some dozens of pieces each.
const CUTS_AT_ONCE: u32 = if cfg!(test) { 64 } else { 1 << 16 };
/// Groups that share out those of a dispatch.
const CUT_GROUPS: u32 = 1024;

/// Gaussians in dispatches of so many at most, and how many each has: a kernel reads the first, and the one after the last.
fn dispatches(device: &Device, count: u32, at_once: u32) -> Vec<(wgpu::Buffer, u32)> {
    let one = |first: u32| {
        let batch_size = at_once.min(count - first);
        // The kernels declare four words, since a uniform has a multiple of 16 bytes; they read two.
        let buffer = device.filled("some", &[first, first + batch_size, 0, 0], wgpu::BufferUsages::UNIFORM);
        (buffer, batch_size)
    };
    (0..count).step_by(at_once as usize).map(one).collect()
}

/// Groups for so many threads, in as many rows as it takes.
fn groups(threads: u64) -> [u32; 2] {
    let all = threads.div_ceil(THREADS);
    // Rows are as equal as can be, so that few groups of the last one have nothing to do.
    let down = all.div_ceil(MOST_GROUPS).max(1);
    [all.div_ceil(down) as u32, down as u32]
}

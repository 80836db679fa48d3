//! Pictures on a graphics card: the stages of `particlegs_core::render` as kernels in WGSL, which any vendor's card runs.
//!
//! A [`Device`] is an adapter that was opened; [`adapters`] lists what there is. A [`render::Renderer`] draws scenes of the
//! optical-depth law. Files in WGSL are called as the stages of core that they are twins of, and say where they differ:
//! cards count in f32, and sums are of whole numbers, so that a picture has the same bits whatever the order.

mod adapters;
mod device;
mod kernel;
pub mod render;

pub use adapters::{Adapter, Choice, adapters, advice};
pub use device::{Checks, Device};

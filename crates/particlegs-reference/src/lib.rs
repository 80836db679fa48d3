//! Pictures of all particles: ParaView's exactly, and the noise-free ones.
//!
//! [`Reference`] holds a snapshot and its bounds and draws views of it. `project` is the vertex
//! stage, in VTK's float32. ParaView's picture goes on to `paraview` (bands of rows, fragments),
//! `quad` (coverage and alpha), `blend` (depth peeling) and `fxaa`; the noise-free optical depth
//! to `depth`, `deposit` (a splat's share of each pixel) and `pyramid` (coarser planes for large
//! splats), and from there through [`particlegs_core::render::tone`]. Surface density is `density`, or `smooth` with the
//! adaptive kernels of `kernel`.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod bands;
mod blend;
mod density;
mod deposit;
mod depth;
mod draw;
mod field_map;
mod fxaa;
mod kernel;
mod paraview;
mod project;
mod pyramid;
mod quad;
mod smooth;
mod uniform;

#[cfg(test)]
mod tests;

pub use draw::Reference;
pub use field_map::FieldValues;
pub use fxaa::fxaa;
pub use uniform::uniform_box;

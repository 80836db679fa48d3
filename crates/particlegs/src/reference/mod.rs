//! Floor 3: pictures of all particles: ParaView's exactly, and the noise-free ones.

mod bands;
mod blend;
mod draw;
mod fxaa;
mod paraview;
mod project;
mod quad;

pub use draw::Reference;
pub use fxaa::fxaa;

//! Gaussian splats of viewers, read as points: SPZ, binary glTF, .splat records. (Splats in PLY
//! files are points of PLY files.) Models of the alpha-blend law are written as the `published` PLY.

mod glb;
mod gltf;
mod published;
mod records;
mod spz;

use crate::Format;
pub use published::write_splats;

/// Binary glTF, with `KHR_gaussian_splatting` or plain points.
pub const GLB: Format = Format { name: "glb", title: "glTF splats or points", detect: glb::detect, open: glb::open };
pub const SPZ: Format = Format { name: "spz", title: "SPZ splats", detect: spz::detect, open: spz::open };
/// Records of 32 bytes, without a signature.
pub const SPLAT: Format =
    Format { name: "splat", title: ".splat records", detect: records::detect, open: records::open };

#[cfg(test)]
mod tests;

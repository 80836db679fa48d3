//! Gaussian splats of viewers, read as points. (Not read yet.)

use crate::Format;
use particlegs::Error;

/// Binary glTF with `KHR_gaussian_splatting`.
pub const GLB: Format = none("glb", "glTF splats");
/// Niantic's SPZ.
pub const SPZ: Format = none("spz", "SPZ splats");
/// Records of 32 bytes, without a signature.
pub const SPLAT: Format = none("splat", ".splat records");

const fn none(name: &'static str, title: &'static str) -> Format {
    Format { name, title, detect: |_| false, open: |paths, _| Err(Error::input(&paths[0], "cannot be read yet")) }
}

/// What readers of splats say.
pub(crate) const NOTE: &str = "Gaussian splats: their centres are read as points, nothing else of them";

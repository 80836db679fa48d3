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
/// Niantic's SPZ.
pub const SPZ: Format = Format { name: "spz", title: "SPZ splats", detect: spz::detect, open: spz::open };
/// Records of 32 bytes, without a signature.
pub const SPLAT: Format =
    Format { name: "splat", title: ".splat records", detect: records::detect, open: records::open };

/// What readers of splats say.
pub(crate) const NOTE: &str = "Gaussian splats: their centres are read as points, nothing else of them";

use crate::laned::ColumnarField;
use crate::strided::NumberType;

/// A field of interleaved little-endian numbers in records.
fn field(name: &str, kind: NumberType, components: u32, base: u64, stride: u64, offset: u64) -> ColumnarField {
    ColumnarField {
        name: name.into(),
        kind_name: kind.name().into(),
        kind: Some(kind),
        big_endian: false,
        components,
        stored: 0,
        base,
        base_step: 0,
        stride,
        offset,
        offset_step: kind.bytes(),
    }
}

#[cfg(test)]
mod tests;

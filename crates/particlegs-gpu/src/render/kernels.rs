//! The kernels of pictures, by their sources.

use crate::Device;
use crate::kernel::{BufferUse, Kernel};

/// The sources that other kernels share.
pub(crate) mod sources {
    pub const FRAME: &str = include_str!("frame.wgsl");
    pub const SCALE: &str = include_str!("scale.wgsl");
    pub const PROJECT: &str = include_str!("project.wgsl");
    pub const SLICES: &str = include_str!("slices.wgsl");
    pub const BIN: &str = include_str!("bin.wgsl");
    pub const SHARE: &str = include_str!("../share.wgsl");
    pub const STROKE: &str = include_str!("stroke.wgsl");
    pub const ROWS: &str = include_str!("rows.wgsl");
    pub const SPAN: &str = include_str!("span.wgsl");
    pub const PLANES: &str = include_str!("planes.wgsl");
    pub const PYRAMID: &str = include_str!("pyramid.wgsl");
    pub const TONE: &str = include_str!("tone.wgsl");
}
use sources::*;
const BOUND: &str = include_str!("bound.wgsl");
const PYRAMID_PLANES: &str = include_str!("pyramid_planes.wgsl");
const RASTER: &str = include_str!("raster.wgsl");

pub(super) struct Kernels {
    pub project: Kernel,
    pub slices_bound: Kernel,
    pub scale: Kernel,
    pub raster: Kernel,
    pub slices: Kernel,
    pub pyramid: Kernel,
    pub pyramid_coarsest: Kernel,
    pub field: Kernel,
}

impl Kernels {
    /// Compiled for a device.
    pub fn new(device: &Device) -> Kernels {
        use BufferUse::{Read, Uniform, Write};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        Kernels {
            project: new(
                "project",
                &[include_str!("project_main.wgsl"), FRAME, PROJECT, STROKE, BIN, BOUND],
                &[Uniform, Read, Write, Write, Write, Write, Write],
            ),
            slices_bound: new(
                "bounds of slices",
                &[include_str!("slices_bound_main.wgsl"), FRAME, PROJECT, SLICES, STROKE, BIN, BOUND],
                &[Uniform, Read, Read, Read, Write, Uniform],
            ),
            scale: new("scales", &[include_str!("scale_main.wgsl"), FRAME, SCALE], &[Uniform, Read, Write]),
            raster: new(
                "raster",
                &[include_str!("raster_main.wgsl"), FRAME, SCALE, STROKE, SHARE, ROWS, SPAN, PLANES, RASTER],
                &[Uniform, Read, Read, Read, Write, Write, Uniform],
            ),
            slices: new(
                "slices",
                &[
                    include_str!("slices_main.wgsl"),
                    FRAME,
                    SCALE,
                    PROJECT,
                    SLICES,
                    STROKE,
                    BIN,
                    SHARE,
                    ROWS,
                    SPAN,
                    PLANES,
                    RASTER,
                ],
                &[Uniform, Read, Read, Read, Read, Write, Write, Uniform],
            ),
            pyramid: new(
                "pyramid",
                &[include_str!("pyramid_main.wgsl"), PYRAMID, PYRAMID_PLANES, PLANES, FRAME, SCALE],
                &[Uniform, Read, Write, Write, Uniform],
            ),
            pyramid_coarsest: new(
                "coarsest planes",
                &[include_str!("pyramid_coarsest_main.wgsl"), PYRAMID, PYRAMID_PLANES, PLANES, FRAME, SCALE],
                &[Uniform, Read, Write, Write, Uniform],
            ),
            field: new("fields", &[include_str!("field_main.wgsl"), STROKE], &[Uniform, Read, Read, Read, Write]),
        }
    }
}

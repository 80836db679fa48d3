//! The kernels of pictures, by their sources.

use super::adapt::AdaptationKernel;
use crate::Device;
use crate::kernel::{BufferUse, FOUR_LEVELS, Kernel};
use crate::sort::{SortPayload, Sorter};

/// Sources that steps of training have too.
pub(crate) mod sources {
    pub const FRAME: &str = include_str!("frame.wgsl");
    pub const PROJECT: &str = include_str!("project.wgsl");
    pub const FIXED: &str = include_str!("fixed.wgsl");
    pub const BIN: &str = include_str!("bin.wgsl");
}
use sources::{BIN, FIXED, FRAME, PROJECT};

const SLOT: &str = include_str!("slot.wgsl");
const SHARE: &str = include_str!("../share.wgsl");

pub(super) struct AlphaKernels {
    pub adapt: AdaptationKernel,
    pub project: Kernel,
    pub sort: Sorter,
    pub sums: Kernel,
    pub fill: Kernel,
    pub ends: Kernel,
    pub raster: Kernel,
    pub tone: Kernel,
    pub slots: Kernel,
    pub backward: Kernel,
    pub gather: Kernel,
}

impl AlphaKernels {
    /// Compiled for a device.
    pub fn new(device: &Device) -> AlphaKernels {
        use BufferUse::{Read, Uniform, Write};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        AlphaKernels {
            adapt: AdaptationKernel::new(device),
            project: new(
                "project, alpha",
                &[include_str!("project_main.wgsl"), FRAME, FIXED, PROJECT, BIN],
                &[Uniform, Read, Read, Write, Write, Write, Write],
            ),
            sort: Sorter::new(device, SortPayload::Values),
            sums: new(
                "sizes of lists",
                &[include_str!("bin_sums_main.wgsl"), FRAME, BIN, SHARE],
                &[Uniform, Uniform, Read, Read, Write],
            ),
            fill: new(
                "lists",
                &[include_str!("bin_fill_main.wgsl"), FRAME, BIN, SHARE],
                &[Uniform, Uniform, Read, Read, Read, Write, Write],
            ),
            ends: new("ends of lists", &[include_str!("bin_ends_main.wgsl"), FRAME], &[Uniform, Read, Write]),
            raster: new(
                "raster, alpha",
                &[include_str!("raster_main.wgsl"), FRAME],
                &[Uniform, Uniform, Read, Read, Read, Write, Write],
            ),
            tone: new("tone, alpha", &[include_str!("tone_main.wgsl"), FRAME, FOUR_LEVELS], &[Uniform, Read, Write]),
            slots: new(
                "slots of footprints",
                &[include_str!("slots_main.wgsl"), FRAME, BIN, SHARE],
                &[Uniform, Uniform, Read, Read, Read, Write],
            ),
            backward: new(
                "raster, alpha, backwards",
                &[include_str!("backward_main.wgsl"), FRAME, SLOT],
                &[Uniform, Uniform, Read, Read, Read, Read, Read, Read, Write, Write],
            ),
            gather: new(
                "sums of slots",
                &[include_str!("backward_gather_main.wgsl"), FRAME, BIN, SLOT],
                &[Uniform, Uniform, Read, Read, Read, Read, Write],
            ),
        }
    }
}

//! The kernels of ParaView's pictures.

use crate::Device;
use crate::kernel::{BufferUse, FOUR_LEVELS, Kernel};
use crate::sort::{SortPayload, Sorter};

pub(super) struct ParaviewKernels {
    pub count: Kernel,
    pub range: Kernel,
    pub peel: Kernel,
    pub settle: Kernel,
    pub rest_count: Kernel,
    pub rest_keys: Kernel,
    pub rest: Kernel,
    pub level: Kernel,
    pub fxaa: Kernel,
    pub sorter: Sorter,
}

const VIEW: &str = include_str!("../view.wgsl");
const SHARE: &str = include_str!("../../share.wgsl");
const EXACT: &str = include_str!("exact.wgsl");
const PROJECT: &str = include_str!("project.wgsl");
const QUAD: &str = include_str!("quad.wgsl");
const SLICE: &str = include_str!("slice.wgsl");
const RANGES: &str = include_str!("ranges.wgsl");
const BLEND: &str = include_str!("blend.wgsl");
const REST: &str = include_str!("rest.wgsl");

impl ParaviewKernels {
    pub fn new(device: &Device) -> ParaviewKernels {
        use BufferUse::{Read, Uniform, Write};
        // Over slices of the pixels of splats: the view, positions, slices, and the kernel's own.
        let over_slices = |label, sources: &[&str], uses: &[BufferUse]| {
            let all = [sources, &[VIEW, SHARE, EXACT, PROJECT, QUAD, SLICE]].concat();
            Kernel::new(device, label, &all, &[&[Uniform, Read, Read], uses].concat())
        };
        let over_pixels = |label, sources: &[&str], uses: &[BufferUse]| {
            let all = [sources, &[VIEW, EXACT, BLEND]].concat();
            Kernel::new(device, label, &all, &[&[Uniform], uses].concat())
        };
        ParaviewKernels {
            count: over_slices("pixels of splats", &[include_str!("count_main.wgsl")], &[Write]),
            range: over_slices("ranges of depths", &[include_str!("range_main.wgsl"), RANGES], &[Write]),
            peel: over_slices("peel", &[include_str!("peel_main.wgsl"), RANGES, BLEND], &[Write, Read, Read, Write]),
            settle: over_pixels("settle", &[include_str!("settle_main.wgsl")], &[Write, Write, Write, Write, Write]),
            rest_count: over_slices(
                "count of the rest",
                &[include_str!("rest_count_main.wgsl"), REST, BLEND],
                &[Read, Write],
            ),
            rest_keys: over_slices(
                "keys of the rest",
                &[include_str!("rest_keys_main.wgsl"), REST, BLEND],
                &[Read, Read, Write],
            ),
            rest: over_pixels("rest", &[include_str!("rest_main.wgsl")], &[Read, Write]),
            level: over_pixels("levels", &[include_str!("level_main.wgsl"), FOUR_LEVELS], &[Read, Write]),
            fxaa: over_pixels(
                "fxaa",
                &[include_str!("fxaa_main.wgsl"), include_str!("fxaa.wgsl"), FOUR_LEVELS],
                &[Read, Write],
            ),
            sorter: Sorter::new(device, SortPayload::Nothing),
        }
    }
}

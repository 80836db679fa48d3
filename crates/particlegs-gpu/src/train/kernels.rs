//! The kernels of steps, by their sources.

use crate::Device;
use crate::kernel::{BufferUse, Kernel};
use crate::render::sources::{BIN, FRAME, PROJECT, PYRAMID, ROWS, SCALE, SHARE, SLICES, STROKE, TONE};

const ADJOINT: &str = include_str!("adjoint.wgsl");
const DSSIM: &str = include_str!("dssim.wgsl");
const FAULTS: &str = include_str!("faults.wgsl");
const GATHER: &str = include_str!("gather.wgsl");
const LOSS: &str = include_str!("loss.wgsl");
const PART: &str = include_str!("part.wgsl");
const SLICE_SLOPES: &str = include_str!("slice_slopes.wgsl");
const SLOPES: &str = include_str!("slopes.wgsl");
const STEP: &str = include_str!("step.wgsl");

pub(super) struct TrainingKernels {
    pub loss: Kernel,
    pub dssim_across: Kernel,
    pub dssim: Kernel,
    pub dssim_back: Kernel,
    pub loss_total: Kernel,
    pub loss_gradient: Kernel,
    pub gather_down: Kernel,
    pub backward: Kernel,
    pub backward_slices: Kernel,
    pub sizes: Kernel,
    pub sizes_total: Kernel,
    pub adam: Kernel,
    pub change: Kernel,
    pub average: Kernel,
    pub replace: Kernel,
}

impl TrainingKernels {
    /// Compiled for a device.
    pub fn new(device: &Device) -> TrainingKernels {
        use BufferUse::{Read as R, Uniform as U, Write as W};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        macro_rules! main {
            ($file:literal) => {
                include_str!(concat!($file, "_main.wgsl"))
            };
        }
        TrainingKernels {
            loss: new("loss", &[main!("loss"), FRAME, SCALE, TONE, LOSS, PART], &[U, R, W, U, R, W, R, U, W]),
            dssim_across: new("SSIM along rows", &[main!("dssim_across"), FRAME, DSSIM], &[U, R, R, W, W, W, W]),
            dssim: new("SSIM", &[main!("dssim"), FRAME, DSSIM, LOSS, PART], &[U, R, R, R, R, W, W, W, W]),
            dssim_back: new("SSIM backwards", &[main!("dssim_back"), FRAME, DSSIM], &[U, R, R, R, R, R, W]),
            loss_total: new("loss in all", &[main!("loss_total"), FRAME, LOSS, PART, FAULTS], &[U, U, R, R, W]),
            loss_gradient: new(
                "gradient of the loss",
                &[main!("loss_gradient"), FRAME, SCALE, TONE, LOSS, FAULTS],
                &[U, R, W, U, R, W, R, U, W, R, W],
            ),
            gather_down: new("gradient of planes", &[main!("gather_down"), PYRAMID, FRAME], &[U, W, U]),
            backward: new(
                "gradient of Gaussians",
                &[main!("backward"), FRAME, PROJECT, STROKE, BIN, SHARE, ROWS, GATHER, FAULTS, ADJOINT, SLOPES],
                &[U, R, R, W, W, U],
            ),
            backward_slices: new(
                "gradient of slices",
                &[
                    main!("backward_slices"),
                    FRAME,
                    PROJECT,
                    SLICES,
                    STROKE,
                    BIN,
                    SHARE,
                    ROWS,
                    GATHER,
                    FAULTS,
                    ADJOINT,
                    SLICE_SLOPES,
                ],
                &[U, R, R, W, W, R, R, U],
            ),
            sizes: new("sizes of gradients", &[main!("sizes"), STEP, PART], &[U, R, W]),
            sizes_total: new("mean sizes", &[main!("sizes_total"), STEP], &[U, R, W]),
            adam: new("Adam", &[main!("adam"), STEP], &[U, R, W, W, R, R, R, R]),
            change: new("change", &[main!("change"), STEP], &[U, R, W]),
            average: new("average", &[main!("average"), STEP], &[U, R, W]),
            replace: new("replace", &[main!("replace")], &[U, R, W, W, W]),
        }
    }
}

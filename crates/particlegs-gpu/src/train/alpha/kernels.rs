//! The kernels of steps by the alpha-blend law, by their sources.

use crate::Device;
use crate::alpha::sources::{BIN, FIXED, FRAME, PROJECT};
use crate::kernel::{BufferUse, Kernel};
use crate::render::sources::FRAME as PICTURE;

const FAULTS: &str = include_str!("../faults.wgsl");
const LOSS: &str = include_str!("../loss.wgsl");
const NETWORK: &str = include_str!("network.wgsl");
const PART: &str = include_str!("../part.wgsl");
const STEP: &str = include_str!("step.wgsl");

/// All of them, but those that the other law has too.
pub(super) struct AlphaTrainingKernels {
    pub unfold: Kernel,
    pub loss: Kernel,
    pub loss_gradient: Kernel,
    pub chain: Kernel,
    pub network: Kernel,
    pub network_total: Kernel,
    pub network_adam: Kernel,
    pub adam: Kernel,
}

impl AlphaTrainingKernels {
    /// Compiled for a device.
    pub fn new(device: &Device) -> AlphaTrainingKernels {
        use BufferUse::{Read as R, Uniform as U, Write as W};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        macro_rules! main {
            ($file:literal) => {
                include_str!(concat!($file, "_main.wgsl"))
            };
        }
        AlphaTrainingKernels {
            unfold: new("unfold", &[main!("unfold"), STEP, FIXED], &[U, R, W]),
            loss: new("loss, alpha", &[main!("loss"), PICTURE, LOSS, PART], &[U, R, R, U, W, W]),
            loss_gradient: new(
                "gradient of the loss, alpha",
                &[main!("loss_gradient"), PICTURE, LOSS, FAULTS],
                &[U, R, R, U, W, R, W],
            ),
            chain: new(
                "gradient of Gaussians, alpha",
                &[main!("chain"), STEP, FRAME, FIXED, PROJECT, BIN],
                &[U, U, R, R, R, R, R, W, W, W],
            ),
            network: new("gradient of the network", &[main!("network"), STEP, NETWORK], &[U, R, R, R, W, W]),
            network_total: new("gradient of the network in all", &[main!("network_total"), NETWORK], &[R, W]),
            network_adam: new("Adam, network", &[main!("network_adam"), STEP, NETWORK, PART, FAULTS], &[U, R, W, W, W]),
            adam: new("Adam, alpha", &[main!("adam"), STEP, FAULTS], &[U, R, W, W, W]),
        }
    }
}

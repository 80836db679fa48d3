//! A drawn picture beside the one that is learnt: its loss, and that of its structure.

use super::kernels::TrainingKernels;
use crate::Device;
use particlegs_core::picture::{Plane, Size};
use particlegs_train::{Loss, Norm};
use wgpu::BufferUsages as Use;

/// Workgroups that sums over pixels are shared out among.
pub(super) const PARTS: u32 = 256;

/// The memory of one size of picture, by any law.
pub(super) struct LossBuffers {
    pub size: Size,
    /// Brightness, in [0, 1]: drawn, and wanted.
    pub drawn: wgpu::Buffer,
    pub target: wgpu::Buffer,
    /// As loss.wgsl has it.
    pub loss: wgpu::Buffer,
    /// Sums of differences, which a law's own kernel writes.
    pub sums: wgpu::Buffer,
    /// The change of 1 - SSIM with each pixel.
    pub by_structure: wgpu::Buffer,
    /// The words of a step's report: faults.wgsl.
    pub told: wgpu::Buffer,
    dssim: Option<[wgpu::BindGroup; 3]>,
    total: wgpu::BindGroup,
    #[cfg(test)]
    unlike: wgpu::Buffer,
}

/// As loss.wgsl has it.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct LossRecord {
    norm: u32,
    logarithm: u32,
    rounded: f32,
    dssim: f32,
}

impl LossBuffers {
    /// For a loss with SSIM or without; `frame` is render's record of the picture.
    pub fn new(
        device: &Device,
        kernels: &TrainingKernels,
        frame: &wgpu::Buffer,
        size: Size,
        with_dssim: bool,
    ) -> LossBuffers {
        let storage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let plane = |label| device.buffer(label, 4 * size.pixels() as u64, storage);
        let parts = |label| device.buffer(label, 8 * u64::from(PARTS), storage);
        let [drawn, target] = ["drawn", "target"].map(plane);
        let loss = device.buffer("loss", 16, Use::UNIFORM | Use::COPY_DST);
        let faults = device.buffer("told", 32, storage);
        let [sums, unlike] = ["sums of the loss", "sums of SSIM"].map(parts);
        // Kernels bind it in any case, but do not read it if SSIM has no share in the loss.
        let by_structure = if with_dssim { plane("gradient of SSIM") } else { parts("no gradient of SSIM") };
        let dssim = with_dssim.then(|| {
            let [a, w, s, p] = ["mean drawn", "mean target", "mean squares", "mean product"].map(plane);
            let [ma, ms, mp] = ["by mean", "by squares", "by product"].map(plane);
            [
                kernels.dssim_across.bind(device, &[frame, &drawn, &target, &a, &w, &s, &p]),
                kernels.dssim.bind(device, &[frame, &a, &w, &s, &p, &ma, &ms, &mp, &unlike]),
                kernels.dssim_back.bind(device, &[frame, &drawn, &target, &ma, &ms, &mp, &by_structure]),
            ]
        });
        let total = kernels.loss_total.bind(device, &[&loss, frame, &sums, &unlike, &faults]);
        LossBuffers {
            size,
            drawn,
            target,
            loss,
            sums,
            by_structure,
            told: faults,
            dssim,
            total,
            #[cfg(test)]
            unlike,
        }
    }

    /// Whether it has what SSIM takes.
    pub fn with_dssim(&self) -> bool {
        self.dssim.is_some()
    }

    /// Sets the picture that is learnt, and the loss.
    pub fn set(&self, device: &Device, target: &Plane, loss: &Loss) {
        let record = LossRecord {
            norm: u32::from(loss.norm == Norm::L2),
            logarithm: u32::from(loss.logarithm),
            rounded: if loss.norm == Norm::L1 { loss.smooth as f32 } else { 0.0 },
            dssim: loss.dssim as f32,
        };
        device.queue.write_buffer(&self.loss, 0, bytemuck::bytes_of(&record));
        device.queue.write_buffer(&self.target, 0, bytemuck::cast_slice(&target.data));
    }

    /// From what is drawn and the sums of differences to the loss, and the change of SSIM with each pixel.
    pub fn total(&self, pass: &mut wgpu::ComputePass<'_>, kernels: &TrainingKernels) {
        if let Some([across, down, back]) = &self.dssim {
            let all = [self.size.width.div_ceil(16) as u32, self.size.height.div_ceil(16) as u32];
            kernels.dssim_across.run(pass, across, all);
            kernels.dssim.run(pass, down, [PARTS, 1]);
            kernels.dssim_back.run(pass, back, all);
        }
        kernels.loss_total.run(pass, &self.total, [1, 1]);
    }

    /// Buffers that are written before they are read.
    #[cfg(test)]
    pub fn scratch(&self) -> [&wgpu::Buffer; 5] {
        [&self.drawn, &self.sums, &self.unlike, &self.by_structure, &self.told]
    }
}

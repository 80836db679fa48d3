//! A picture that is learnt from, on the device: its loss, and what its pixels want.

use super::held::AlphaBuffers;
use super::{Blender, TrainingKernels};
use crate::Device;
use crate::alpha::AlphaCanvas;
use crate::alpha::backward::BackwardBuffers;
use crate::render::{FrameRecord, PlaneLayout};
use crate::train::compared::{LossBuffers, PARTS};
use particlegs_core::Result;
use particlegs_core::picture::Size;
use wgpu::BufferUsages as Use;

/// The memory of one size of picture of some Gaussians.
pub(super) struct AlphaTrainingPicture {
    pub canvas: AlphaCanvas,
    pub back: BackwardBuffers,
    pub compared: LossBuffers,
    pub chain: wgpu::BindGroup,
    loss: wgpu::BindGroup,
    gradient: wgpu::BindGroup,
}

impl AlphaTrainingPicture {
    /// Of Gaussians, of a size, for a loss with SSIM or without.
    pub fn new(
        device: &Device,
        (shared, blender): (&TrainingKernels, &Blender),
        held: &AlphaBuffers,
        (size, with_dssim): (Size, bool),
    ) -> Result<AlphaTrainingPicture> {
        let canvas = blender.renderer.canvas(&held.seen, size)?;
        let back = BackwardBuffers::new(device, &canvas)?;
        let frame = device.filled("frame", &[FrameRecord::of_planes(&PlaneLayout::new(size))], Use::UNIFORM);
        let compared = LossBuffers::new(device, shared, &frame, size, with_dssim);
        let LossBuffers { drawn, target, loss, sums, by_structure, told: faults, .. } = &compared;
        let blended = canvas.brightness();
        let kernels = &blender.kernels;
        let gradient = [&frame, blended, target, loss, faults, by_structure, &back.by_pixel];
        let gaussian_buffers = [canvas.frame(), &held.step, &held.columns, &held.bent, &held.trained, canvas.touched()];
        let chain =
            [gaussian_buffers.as_slice(), &[&back.sums, &held.gradient, &held.by_output, &held.screen]].concat();
        let picture = AlphaTrainingPicture {
            loss: kernels.loss.bind(device, &[&frame, blended, target, loss, drawn, sums]),
            gradient: kernels.loss_gradient.bind(device, &gradient),
            chain: kernels.chain.bind(device, &chain),
            canvas,
            back,
            compared,
        };
        device.check()?;
        Ok(picture)
    }

    /// Its size, and whether it has what SSIM takes.
    pub fn shape(&self) -> (Size, bool) {
        (self.compared.size, self.compared.with_dssim())
    }

    /// From brightness to the gradient with it.
    pub fn compare(&self, device: &Device, (shared, blender): (&TrainingKernels, &Blender)) {
        let Size { width, height } = self.compared.size;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        blender.kernels.loss.run(&mut pass, &self.loss, [PARTS, 1]);
        self.compared.total(&mut pass, shared);
        let all = [width.div_ceil(16) as u32, height.div_ceil(16) as u32];
        blender.kernels.loss_gradient.run(&mut pass, &self.gradient, all);
        drop(pass);
        device.queue.submit([encoder.finish()]);
    }
}

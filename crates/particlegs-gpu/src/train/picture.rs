//! A picture that is learnt from, on the device: its loss, and the gradient of that with depth.

use super::compared::{LossBuffers, PARTS};
use super::gaussians::DepthBuffers;
use super::kernels::TrainingKernels;
use super::stepped;
use crate::render::{CURVE, DepthCanvas, ToneStyleRecord, curve};
use crate::{AT_ONCE, CUTS_AT_ONCE, Device, dispatches};
use particlegs_core::Result;
use particlegs_core::picture::Size;
use particlegs_core::splat::ToneStyle;
use particlegs_train::StepReport;
use std::collections::HashMap;
use wgpu::BufferUsages as Use;

/// Curves that are kept: views of a run are some hundreds, each with its radius and opacity.
const MOST_CURVES: usize = 4096;

/// The memory of one size of picture.
pub(super) struct TrainingPicture {
    pub canvas: DepthCanvas,
    pub compared: LossBuffers,
    look: wgpu::Buffer,
    curve: wgpu::Buffer,
    bound: PictureBindGroups,
    /// The gradient of Gaussians that are whole, in dispatches of some each, and of those that are cut.
    pub whole: Vec<(wgpu::BindGroup, u32)>,
    pub cut: Vec<(wgpu::BindGroup, u32)>,
    #[cfg(test)]
    by_depth: wgpu::Buffer,
}

struct PictureBindGroups {
    loss: wgpu::BindGroup,
    gradient: wgpu::BindGroup,
    /// From fine to coarse, and the workgroups of each.
    planes: Vec<(wgpu::BindGroup, [u32; 2])>,
}

impl TrainingPicture {
    /// Of Gaussians with their canvas, for a loss with SSIM or without.
    pub fn new(
        device: &Device,
        kernels: &TrainingKernels,
        held: &DepthBuffers,
        canvas: DepthCanvas,
        with_dssim: bool,
    ) -> Result<TrainingPicture> {
        let (size, planes) = (canvas.planes().size, canvas.planes().sums);
        device.fits(size, 4 * planes)?;
        let storage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let look = device.buffer("look", 16, Use::UNIFORM | Use::COPY_DST);
        let curve = device.buffer("curve", 4 * (CURVE + 1), storage);
        let by_depth = device.buffer("gradient of planes", 4 * planes, storage);
        let b = canvas.buffers();
        let compared = LossBuffers::new(device, kernels, b.frame, size, with_dssim);
        let LossBuffers { drawn, target, loss, sums, by_structure, told: faults, .. } = &compared;
        let tone = [b.frame, b.scale, b.finest, &look, &curve, drawn, target, loss];
        let coarser = canvas.planes().levels.iter().enumerate().skip(1).map(|(k, level)| {
            let plane = device.filled("target plane", &[k as u32, 0, 0, 0], Use::UNIFORM);
            let bound = kernels.gather_down.bind(device, &[b.frame, &by_depth, &plane]);
            (bound, [level.width.div_ceil(8), level.rows.div_ceil(8)])
        });
        let bound = PictureBindGroups {
            loss: kernels.loss.bind(device, &[tone.as_slice(), &[sums]].concat()),
            gradient: kernels
                .loss_gradient
                .bind(device, &[tone.as_slice(), &[faults, by_structure, &by_depth]].concat()),
            planes: coarser.collect(),
        };
        let whole_buffers = [b.frame, held.seen.buffer(), &by_depth, &held.gradient, faults];
        let count = held.seen.len() as u32;
        let whole = dispatches(device, count, AT_ONCE).into_iter();
        let whole = whole
            .map(|(some, n)| (kernels.backward.bind(device, &[&whole_buffers[..], &[&some]].concat()), n))
            .collect();
        let cut_buffers = [whole_buffers.as_slice(), &[b.cuts, b.cut_count]].concat();
        let cut = dispatches(device, count, CUTS_AT_ONCE).into_iter();
        let cut = cut
            .map(|(some, n)| (kernels.backward_slices.bind(device, &[&cut_buffers[..], &[&some]].concat()), n))
            .collect();
        device.check()?;
        Ok(TrainingPicture {
            canvas,
            compared,
            look,
            curve,
            bound,
            whole,
            cut,
            #[cfg(test)]
            by_depth,
        })
    }

    /// Buffers that are written before they are read.
    #[cfg(test)]
    pub fn scratch(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        self.compared.scratch().into_iter().chain([&self.by_depth])
    }

    /// Its size, and whether it has what SSIM takes.
    pub fn shape(&self) -> (Size, bool) {
        (self.canvas.planes().size, self.compared.with_dssim())
    }

    /// The curve from depth to brightness.
    pub fn set_curve(&self, device: &Device, style: ToneStyle, curve: Option<&[f32]>) {
        let record = ToneStyleRecord::sharp(style, self.canvas.holds_sums());
        device.queue.write_buffer(&self.look, 0, bytemuck::bytes_of(&record));
        if let Some(curve) = curve {
            device.queue.write_buffer(&self.curve, 0, bytemuck::cast_slice(curve));
        }
    }

    /// From the finest plane's depth to the gradient on every plane.
    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, kernels: &TrainingKernels) {
        let bound = &self.bound;
        kernels.loss.run(pass, &bound.loss, [PARTS, 1]);
        self.compared.total(pass, kernels);
        let finest = self.canvas.planes().levels[0];
        kernels.loss_gradient.run(pass, &bound.gradient, [finest.width.div_ceil(16), finest.rows.div_ceil(16)]);
        bound.planes.iter().for_each(|(plane, groups)| kernels.gather_down.run(pass, plane, *groups));
    }

    /// The report of the step, once it is done.
    pub fn told(&self, device: &Device) -> Result<StepReport> {
        Ok(stepped(&device.read(&self.compared.told, 24)?))
    }
}

/// Curves from depth to brightness, each of which takes the CPU a millisecond, by opacity and radius.
#[derive(Default)]
pub(super) struct CurveCache(HashMap<[u64; 2], Vec<f32>>);

impl CurveCache {
    /// That of a look, an opacity and a splat radius in pixels; none where it is no table.
    pub fn of(&mut self, style: ToneStyle, opacity: f64, radius_px: f64) -> Option<&[f32]> {
        if style == ToneStyle::Expected {
            return None;
        }
        let key = [opacity.to_bits(), radius_px.to_bits()];
        // A run hardly ever has so many, so it does not pay to choose which ones to keep.
        if self.0.len() >= MOST_CURVES && !self.0.contains_key(&key) {
            self.0.clear();
        }
        let with_fxaa = (style == ToneStyle::Paraview).then_some(radius_px);
        Some(self.0.entry(key).or_insert_with(|| curve(opacity, with_fxaa)))
    }
}

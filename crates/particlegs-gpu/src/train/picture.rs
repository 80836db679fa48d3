//! A picture that is learnt from, on the device: its loss, and the gradient of that with depth.

use super::gaussians::Held;
use super::kernels::Kernels;
use super::stepped;
use crate::render::{CURVE, Canvas, LookRecord, curve};
use crate::{Device, dispatches};
use particlegs_core::Result;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::splat::Look;
use particlegs_train::{Loss, Norm, Stepped};
use std::collections::HashMap;
use wgpu::BufferUsages as Use;

/// Workgroups that sums over pixels are shared out among.
const PARTS: u32 = 256;
/// Curves that are kept: views of a run are some hundreds, each with its radius and opacity.
const MOST_CURVES: usize = 4096;

/// The memory of one size of picture.
pub(super) struct Picture {
    pub canvas: Canvas,
    target: wgpu::Buffer,
    look: wgpu::Buffer,
    curve: wgpu::Buffer,
    loss: wgpu::Buffer,
    told: wgpu::Buffer,
    bound: Bound,
    /// The gradient of Gaussians that are whole, in dispatches of some each, and of those that are cut.
    pub whole: Vec<(wgpu::BindGroup, u32)>,
    pub cut: wgpu::BindGroup,
    #[cfg(test)]
    scratch: Vec<wgpu::Buffer>,
}

struct Bound {
    loss: wgpu::BindGroup,
    dssim: Option<[wgpu::BindGroup; 3]>,
    total: wgpu::BindGroup,
    gradient: wgpu::BindGroup,
    /// From fine to coarse, and the workgroups of each.
    planes: Vec<(wgpu::BindGroup, [u32; 2])>,
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

impl Picture {
    /// Of Gaussians with their canvas, for a loss with SSIM or without.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Device, kernels: &Kernels, held: &Held, canvas: Canvas, with_dssim: bool) -> Result<Picture> {
        let (size, planes) = (canvas.planes().size, canvas.planes().sums);
        let storage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let plane = |label| device.buffer(label, 4 * size.pixels() as u64, storage);
        let record = |label| device.buffer(label, 16, Use::UNIFORM | Use::COPY_DST);
        let parts = |label| device.buffer(label, 8 * u64::from(PARTS), storage);
        let [drawn, target] = ["drawn", "target"].map(plane);
        let [look, loss] = ["look", "loss"].map(record);
        let curve = device.buffer("curve", 4 * (CURVE + 1), storage);
        let told = device.buffer("told", 32, storage);
        let by_depth = device.buffer("gradient of planes", 4 * planes, storage);
        let [sums, unlike] = ["sums of the loss", "sums of SSIM"].map(parts);
        let by_structure = if with_dssim { plane("gradient of SSIM") } else { parts("no gradient of SSIM") };
        let b = canvas.buffers();
        let dssim = with_dssim.then(|| {
            let [a, w, s, p] = ["mean drawn", "mean target", "mean squares", "mean product"].map(plane);
            let [ma, ms, mp] = ["by mean", "by squares", "by product"].map(plane);
            [
                kernels.dssim_across.bind(device, &[b.frame, &drawn, &target, &a, &w, &s, &p]),
                kernels.dssim.bind(device, &[b.frame, &a, &w, &s, &p, &ma, &ms, &mp, &unlike]),
                kernels.dssim_back.bind(device, &[b.frame, &drawn, &target, &ma, &ms, &mp, &by_structure]),
            ]
        });
        let tone = [b.frame, b.scale, b.planes, &look, &curve, &drawn, &target, &loss];
        let coarser = canvas.planes().levels.iter().enumerate().skip(1).map(|(k, level)| {
            let plane = device.filled("target plane", &[k as u32, 0, 0, 0], Use::UNIFORM);
            let bound = kernels.gather_down.bind(device, &[b.frame, b.scale, &by_depth, &plane]);
            (bound, [level.width.div_ceil(8), level.rows.div_ceil(8)])
        });
        let bound = Bound {
            loss: kernels.loss.bind(device, &[tone.as_slice(), &[&sums]].concat()),
            dssim,
            total: kernels.loss_total.bind(device, &[&loss, b.frame, &sums, &unlike, &told]),
            gradient: kernels
                .loss_gradient
                .bind(device, &[tone.as_slice(), &[&told, &by_structure, &by_depth]].concat()),
            planes: coarser.collect(),
        };
        let own = [b.frame, held.seen.buffer(), &by_depth, &held.gradient, &told];
        let whole = dispatches(device, held.seen.len() as u32)
            .into_iter()
            .map(|(first, count)| (kernels.backward.bind(device, &[own.as_slice(), &[&first]].concat()), count))
            .collect();
        let cut = kernels.backward_slices.bind(device, &[own.as_slice(), &[b.cuts, b.cut_count]].concat());
        device.check()?;
        Ok(Picture {
            canvas,
            target,
            look,
            curve,
            loss,
            bound,
            whole,
            cut,
            #[cfg(test)]
            scratch: vec![drawn, by_depth, sums, unlike, by_structure, told.clone()],
            told,
        })
    }

    /// What is written before it is read.
    #[cfg(test)]
    pub fn scratch(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        self.scratch.iter()
    }

    /// Its size, and whether it has what SSIM takes.
    pub fn shape(&self) -> (Size, bool) {
        (self.canvas.planes().size, self.bound.dssim.is_some())
    }

    /// What is learnt, and what counts.
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

    /// The curve from depth to brightness.
    pub fn set_curve(&self, device: &Device, look: Look, curve: Option<&[f32]>) {
        let record = LookRecord::sharp(look, self.canvas.holds_sums());
        device.queue.write_buffer(&self.look, 0, bytemuck::bytes_of(&record));
        if let Some(curve) = curve {
            device.queue.write_buffer(&self.curve, 0, bytemuck::cast_slice(curve));
        }
    }

    /// From the finest plane's depth to the gradient on every plane.
    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, kernels: &Kernels) {
        let (Size { width, height }, bound) = (self.canvas.planes().size, &self.bound);
        let tiles = |width: u32, rows: u32| [width.div_ceil(16), rows.div_ceil(16)];
        kernels.loss.run(pass, &bound.loss, [PARTS, 1]);
        if let Some([across, down, back]) = &bound.dssim {
            let all = tiles(width as u32, height as u32);
            kernels.dssim_across.run(pass, across, all);
            kernels.dssim.run(pass, down, [PARTS, 1]);
            kernels.dssim_back.run(pass, back, all);
        }
        kernels.loss_total.run(pass, &bound.total, [1, 1]);
        let finest = self.canvas.planes().levels[0];
        kernels.loss_gradient.run(pass, &bound.gradient, tiles(finest.width, finest.rows));
        bound.planes.iter().for_each(|(plane, groups)| kernels.gather_down.run(pass, plane, *groups));
    }

    /// What the step told, once it is done.
    ///
    /// # Errors
    /// Those of the device.
    pub fn told(&self, device: &Device) -> Result<Stepped> {
        Ok(stepped(&device.read(&self.told, 24)?))
    }
}

/// Curves from depth to brightness, each of which takes the processor a millisecond, by opacity and radius.
#[derive(Default)]
pub(super) struct Curves(HashMap<[u64; 2], Vec<f32>>);

impl Curves {
    /// That of a look, an opacity and a splat radius in pixels; none where it is no table.
    pub fn of(&mut self, look: Look, opacity: f64, radius_px: f64) -> Option<&[f32]> {
        if look == Look::Expected {
            return None;
        }
        let key = [opacity.to_bits(), radius_px.to_bits()];
        if self.0.len() >= MOST_CURVES && !self.0.contains_key(&key) {
            self.0.clear();
        }
        let with_fxaa = (look == Look::Paraview).then_some(radius_px);
        Some(self.0.entry(key).or_insert_with(|| curve(opacity, with_fxaa)))
    }
}

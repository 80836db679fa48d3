//! Memory of training on the device: Gaussians with their network, what Adam and density control remember of them, and
//! the pictures that they learn from.

use super::{AlphaStepRecord, Blender, TrainingKernels};
use crate::alpha::backward::BackwardBuffers;
use crate::alpha::gaussians::{COLUMNS, MOST};
use crate::alpha::{AlphaCanvas, Gaussians};
use crate::render::{FrameRecord, PlaneLayout};
use crate::train::compared::{LossBuffers, PARTS};
use crate::{Device, groups};
use particlegs_core::Result;
use particlegs_core::model::{VIZMAPPER_PARAMETERS, VizMapper};
use particlegs_core::picture::Size;
use particlegs_core::render::alpha::Blend;
use particlegs_train::{Averages, alpha};
use wgpu::BufferUsages as Use;

/// Numbers of each group of parameters.
const WIDTHS: [usize; alpha::GROUPS] = [3, 3, 4, 1, 1];
/// Numbers of a Gaussian that steps move.
const NUMBERS: usize = 12;
/// Gaussians for each workgroup of the network's gradient, where they are few ...
const SHARE: usize = 64;
/// Maximum number of workgroups: several for each core of a large GPU.
const NETWORK_PARTS: usize = 512;

/// Buffers, and what they are bound to.
pub(super) struct AlphaBuffers {
    count: usize,
    /// The Gaussians that pictures are drawn of.
    pub seen: Gaussians,
    columns: wgpu::Buffer,
    bent: wgpu::Buffer,
    trained: wgpu::Buffer,
    gradient: wgpu::Buffer,
    /// The change with the network's outputs.
    by_output: wgpu::Buffer,
    screen: wgpu::Buffer,
    step: wgpu::Buffer,
    /// Adam's means of gradients, then of their squares.
    averages: wgpu::Buffer,
    unfold: wgpu::BindGroup,
    network: Option<NetworkTrainingBuffers>,
}

struct NetworkTrainingBuffers {
    weights: wgpu::Buffer,
    averages: wgpu::Buffer,
    #[cfg(test)]
    parts: wgpu::Buffer,
    by_network: wgpu::Buffer,
    backward: wgpu::BindGroup,
    total: wgpu::BindGroup,
}

/// Workgroups that share out so many Gaussians for the network's gradient: no device changes them, nor the sums.
fn parts_of_network(count: usize) -> usize {
    count.div_ceil(SHARE).clamp(1, NETWORK_PARTS)
}

impl AlphaBuffers {
    pub fn new(device: &Device, blender: &Blender, gaussians: &alpha::Gaussians) -> Result<AlphaBuffers> {
        let count = gaussians.parameters.len();
        let most = MOST.min((device.largest_binding() / (8 * NUMBERS as u64)) as usize);
        if count > most {
            return Err(crate::train::too_many(device, count, most));
        }
        let kernels = &blender.kernels;
        let usage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let buffer = |label, words: usize| device.buffer(label, 4 * words as u64, usage);
        let (trained, gradient) = (buffer("trained", NUMBERS * count), buffer("gradient", NUMBERS * count));
        let (columns, averages) = (buffer("gaussians", COLUMNS * count), buffer("averages", 2 * NUMBERS * count));
        let (by_output, screen) = (buffer("change with outputs", 2 * count), buffer("screen", 2 * count));
        // Without a network they stay as they are.
        let bent = device.filled("bent", &vec![[1.0f32; 2]; count], usage);
        let step = device.buffer("step", size_of::<AlphaStepRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        let network = gaussians.mapper.as_ref().map(|_| {
            let weights = buffer("network", VIZMAPPER_PARAMETERS);
            let parts = buffer("parts of the network's gradient", parts_of_network(count) * VIZMAPPER_PARAMETERS);
            let by_network = buffer("the network's gradient", VIZMAPPER_PARAMETERS);
            let back = [&step, &weights, &columns, &by_output, &gradient, &parts];
            NetworkTrainingBuffers {
                backward: kernels.network.bind(device, &back),
                total: kernels.network_total.bind(device, &[&parts, &by_network]),
                averages: buffer("averages of the network", 2 * VIZMAPPER_PARAMETERS),
                weights,
                #[cfg(test)]
                parts,
                by_network,
            }
        });
        let alpha::TrainingScale { frame, radius, opacity, .. } = gaussians.scale;
        let blend = Blend { vizmapper: None, frame, radius, opacity };
        let drawn_by = network.as_ref().zip(gaussians.mapper.as_ref()).map(|(n, m)| (n.weights.clone(), m.ranges));
        let seen = Gaussians::of_buffers(device, [columns.clone(), bent.clone()], count as u32, drawn_by, blend);
        let unfold = kernels.unfold.bind(device, &[&step, &trained, &columns]);
        device.check()?;
        Ok(AlphaBuffers {
            count,
            seen,
            columns,
            bent,
            trained,
            gradient,
            by_output,
            screen,
            step,
            averages,
            unfold,
            network,
        })
    }

    /// Whether they are for as many Gaussians, with a network or without.
    pub fn fits(&self, gaussians: &alpha::Gaussians) -> bool {
        self.count == gaussians.parameters.len() && self.network.is_some() == gaussians.mapper.is_some()
    }

    /// Buffers that are written before they are read.
    #[cfg(test)]
    pub fn scratch(&self) -> Vec<&wgpu::Buffer> {
        let network = self.network.iter().flat_map(|n| [&n.parts, &n.by_network]);
        [&self.columns, &self.gradient, &self.by_output].into_iter().chain(network).collect()
    }

    /// Sets the size of the next step; pictures are drawn of the Gaussians as they are now.
    pub fn begin(&self, device: &Device, blender: &Blender, record: &AlphaStepRecord) {
        device.queue.write_buffer(&self.step, 0, bytemuck::bytes_of(record));
        self.seen.changed();
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        blender.kernels.unfold.run(&mut pass, &self.unfold, groups(self.count as u64));
        drop(pass);
        device.queue.submit([encoder.finish()]);
    }

    /// Moves the Gaussians and the network by their gradients.
    pub fn update(&self, device: &Device, pass: &mut wgpu::ComputePass<'_>, blender: &Blender, faults: &wgpu::Buffer) {
        let kernels = &blender.kernels;
        // The network goes first, because it adds to the gradients of scales and opacities.
        if let Some(n) = &self.network {
            kernels.network.run(pass, &n.backward, [parts_of_network(self.count) as u32, 1]);
            kernels.network_total.run(pass, &n.total, groups(VIZMAPPER_PARAMETERS as u64));
            let adam = kernels.network_adam.bind(device, &[&self.step, &n.by_network, &n.weights, &n.averages, faults]);
            kernels.network_adam.run(pass, &adam, [1, 1]);
        }
        let adam = kernels.adam.bind(device, &[&self.step, &self.gradient, &self.trained, &self.averages, faults]);
        kernels.adam.run(pass, &adam, groups(self.count as u64));
    }

    pub fn put(&self, device: &Device, gaussians: &alpha::Gaussians) -> Result<()> {
        let write = |buffer: &wgpu::Buffer, words: &[f32]| {
            device.queue.write_buffer(buffer, 0, bytemuck::cast_slice(words));
        };
        write(&self.trained, &self.columns_of(gaussians.parameters.0.each_ref()));
        let mut averages = self.columns_of(gaussians.averages.each_ref().map(|a| &a.first));
        averages.extend(self.columns_of(gaussians.averages.each_ref().map(|a| &a.second)));
        write(&self.averages, &averages);
        write(&self.screen, gaussians.screen.as_flattened());
        if let (Some(n), Some(mapper)) = (&self.network, &gaussians.mapper) {
            write(&n.weights, &mapper.parameters);
            write(
                &n.averages,
                &[gaussians.mapper_averages.first.as_slice(), &gaussians.mapper_averages.second].concat(),
            );
        }
        device.wait()
    }

    pub fn get(&self, device: &Device, gaussians: &mut alpha::Gaussians) -> Result<()> {
        let read = |buffer: &wgpu::Buffer, words: usize| -> Result<Vec<f32>> {
            let bytes = device.read(buffer, 4 * words as u64)?;
            Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
        };
        let all = NUMBERS * self.count;
        gaussians.parameters.0 = self.groups_of(&read(&self.trained, all)?);
        let averages = read(&self.averages, 2 * all)?;
        let (first, second) = averages.split_at(all);
        for (a, (first, second)) in
            gaussians.averages.iter_mut().zip(self.groups_of(first).into_iter().zip(self.groups_of(second)))
        {
            *a = Averages { first, second, steps: a.steps };
        }
        gaussians.screen = read(&self.screen, 2 * self.count)?.chunks_exact(2).map(|s| [s[0], s[1]]).collect();
        if let (Some(n), Some(mapper)) = (&self.network, &mut gaussians.mapper) {
            let averages = read(&n.averages, 2 * VIZMAPPER_PARAMETERS)?;
            let (first, second) = averages.split_at(VIZMAPPER_PARAMETERS);
            (gaussians.mapper_averages.first, gaussians.mapper_averages.second) = (first.to_vec(), second.to_vec());
            *mapper = VizMapper { parameters: read(&n.weights, VIZMAPPER_PARAMETERS)?, ranges: mapper.ranges };
        }
        Ok(())
    }

    /// A column a number, of groups whose Gaussians' numbers stand together.
    fn columns_of(&self, groups: [&Vec<f32>; alpha::GROUPS]) -> Vec<f32> {
        let group_columns = |(all, width): (&Vec<f32>, usize)| -> Vec<f32> {
            (0..width).flat_map(|k| (0..self.count).map(move |i| (i, k))).map(|(i, k)| all[width * i + k]).collect()
        };
        groups.into_iter().zip(WIDTHS).flat_map(group_columns).collect()
    }

    fn groups_of(&self, columns: &[f32]) -> [Vec<f32>; alpha::GROUPS] {
        let mut first = 0;
        WIDTHS.map(|width| {
            let group = &columns[first * self.count..(first + width) * self.count];
            first += width;
            (0..self.count).flat_map(|i| (0..width).map(move |k| group[k * self.count + i])).collect()
        })
    }
}

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

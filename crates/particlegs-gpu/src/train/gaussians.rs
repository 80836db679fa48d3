//! Gaussians in training on the device, and what Adam remembers of them.

use super::kernels::TrainingKernels;
use super::{NUMBERS, StepRecord, too_many};
use crate::render::{Gaussians, MOST, two_floats};
use crate::{Device, groups};
use particlegs_core::Result;
use particlegs_core::math::each_axis;
use particlegs_train::depth::{DepthGaussians, Numbers, Parameters, WIDTHS};
use wgpu::BufferUsages as Use;

/// Floats of a Gaussian, each a column: those that pictures read, and ln count.
const COLUMNS: usize = 14;
/// Workgroups that sum the sizes of gradients.
const PARTS: u32 = 64;

/// Buffers, and what they are bound to.
pub(super) struct DepthBuffers {
    origin: [f64; 3],
    count: usize,
    /// Those that pictures are drawn of: as decoded where they are coded on the way, else the same as `now`.
    pub seen: Gaussians,
    seen_columns: wgpu::Buffer,
    now: wgpu::Buffer,
    averaged: wgpu::Buffer,
    /// Gradients; then the changes that come of them.
    pub gradient: wgpu::Buffer,
    /// Adam's means of gradients, then of their squares.
    averages: wgpu::Buffer,
    members: wgpu::Buffer,
    group_records: wgpu::Buffer,
    step: wgpu::Buffer,
    bound: StepBindGroups,
    /// Gaussians by group, and where each group begins among them; then the end.
    order: Vec<u32>,
    starts: Vec<u32>,
    #[cfg(test)]
    sizes: [wgpu::Buffer; 2],
}

struct StepBindGroups {
    sizes: wgpu::BindGroup,
    sizes_total: wgpu::BindGroup,
    adam: wgpu::BindGroup,
    change: [wgpu::BindGroup; 2],
    average: wgpu::BindGroup,
}

impl DepthBuffers {
    /// Room for these, and what steps are bound to.
    pub fn new(device: &Device, kernels: &TrainingKernels, parameters: &Parameters) -> Result<DepthBuffers> {
        let (count, group_count) = (parameters.len(), parameters.groups.counts.len());
        // The largest buffer is that of the averages, with two floats for each number.
        let most = MOST.min((device.largest_binding() / (8 * NUMBERS as u64)) as usize);
        if count > most {
            return Err(too_many(device, count, most));
        }
        let usage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let buffer = |label, words: usize| device.buffer(label, 4 * words as u64, usage);
        let [seen_columns, now, averaged] = ["seen", "now", "averaged"].map(|l| buffer(l, COLUMNS * count));
        let (gradient, averages) = (buffer("gradient", NUMBERS * count), buffer("averages", 2 * NUMBERS * count));
        let (members, group_records) = (buffer("members", 2 * count), buffer("groups", 2 * (group_count + 1)));
        let step = device.buffer("step", size_of::<StepRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        let (parts, epsilon) = (buffer("sizes", 4 * PARTS as usize), buffer("epsilon", 4));
        let bound = StepBindGroups {
            sizes: kernels.sizes.bind(device, &[&step, &averages, &parts]),
            sizes_total: kernels.sizes_total.bind(device, &[&step, &parts, &epsilon]),
            adam: kernels
                .adam
                .bind(device, &[&step, &epsilon, &gradient, &averages, &seen_columns, &now, &members, &group_records]),
            change: [&now, &seen_columns].map(|columns| kernels.change.bind(device, &[&step, &gradient, columns])),
            average: kernels.average.bind(device, &[&step, &now, &averaged]),
        };
        device.check()?;
        let origin = each_axis(|k| 0.5 * (parameters.bounds.min[k] + parameters.bounds.max[k]));
        let seen = Gaussians::of_buffer(seen_columns.clone(), count as u32, origin, parameters.bounds);
        let (order, starts) = by_group(parameters);
        Ok(DepthBuffers {
            origin,
            count,
            seen,
            seen_columns,
            now,
            averaged,
            gradient,
            averages,
            members,
            group_records,
            step,
            bound,
            order,
            starts,
            #[cfg(test)]
            sizes: [parts, epsilon],
        })
    }

    /// Buffers that are written before they are read.
    #[cfg(test)]
    pub fn scratch(&self) -> Vec<&wgpu::Buffer> {
        self.sizes.iter().chain([&self.gradient]).collect()
    }

    /// Sets the size of the next step.
    pub fn set_step(&self, device: &Device, record: &StepRecord) {
        device.queue.write_buffer(&self.step, 0, bytemuck::bytes_of(record));
    }

    /// Moves the Gaussians by their gradients.
    pub fn update(&self, pass: &mut wgpu::ComputePass<'_>, kernels: &TrainingKernels) {
        let (bound, each) = (&self.bound, groups(self.count as u64));
        kernels.sizes.run(pass, &bound.sizes, [PARTS, 1]);
        kernels.sizes_total.run(pass, &bound.sizes_total, [1, 1]);
        // A workgroup a group.
        kernels.adam.run(pass, &bound.adam, groups(64 * (self.starts.len() as u64 - 1)));
        bound.change.iter().for_each(|b| kernels.change.run(pass, b, each));
        kernels.average.run(pass, &bound.average, each);
    }

    pub fn put(&self, device: &Device, parameters: &Parameters) -> Result<()> {
        let write = |buffer: &wgpu::Buffer, words: &[f32]| {
            device.queue.write_buffer(buffer, 0, bytemuck::cast_slice(words));
        };
        for (buffer, columns) in [
            (&self.seen_columns, parameters.seen()),
            (&self.now, &parameters.now),
            (&self.averaged, &parameters.averaged),
        ] {
            write(buffer, &self.columns(columns));
        }
        let mut averages = Vec::with_capacity(2 * NUMBERS * self.count);
        let halves =
            [parameters.averages.each_ref().map(|a| &a.first), parameters.averages.each_ref().map(|a| &a.second)];
        for (all, width) in halves.iter().flat_map(|half| half.iter().zip(WIDTHS)) {
            averages.extend((0..width).flat_map(|k| (0..self.count).map(move |i| all[width * i + k])));
        }
        write(&self.averages, &averages);
        let member = |&i: &u32| [i, (parameters.first_log_count[i as usize] as f32).to_bits()];
        let members: Vec<[u32; 2]> = self.order.iter().map(member).collect();
        device.queue.write_buffer(&self.members, 0, bytemuck::cast_slice(&members));
        self.put_groups(device, parameters);
        device.wait()
    }

    /// Sends the Gaussians that density control has changed, which are neither coded nor averaged.
    pub fn replace(
        &self,
        device: &Device,
        kernels: &TrainingKernels,
        parameters: &Parameters,
        which: &[usize],
    ) -> Result<()> {
        // Members are stored by group, so the place of a Gaussian among them has to be looked up.
        let mut place = vec![0u32; self.count];
        self.order.iter().zip(0..).for_each(|(&i, at)| place[i as usize] = at);
        let mut records: Vec<u32> = Vec::new();
        for &i in which {
            records.extend([i as u32, place[i], (parameters.first_log_count[i] as f32).to_bits()]);
            records.extend(self.column(&parameters.now.0[i]).map(f32::to_bits));
            for half in
                [parameters.averages.each_ref().map(|a| &a.first), parameters.averages.each_ref().map(|a| &a.second)]
            {
                half.iter().zip(WIDTHS).for_each(|(all, width)| {
                    records.extend(all[width * i..width * (i + 1)].iter().map(|v| v.to_bits()))
                });
            }
        }
        let count = [self.count as u32, which.len() as u32, 0, 0];
        let (count, records) =
            (device.filled("count", &count, Use::UNIFORM), device.filled("records", &records, Use::STORAGE));
        let bound = kernels.replace.bind(device, &[&count, &records, &self.now, &self.averages, &self.members]);
        self.put_groups(device, parameters);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        kernels.replace.run(&mut encoder.begin_compute_pass(&Default::default()), &bound, groups(which.len() as u64));
        // After density control nothing is coded, and the average begins anew.
        for copy in [&self.seen_columns, &self.averaged] {
            encoder.copy_buffer_to_buffer(&self.now, 0, copy, 0, copy.size());
        }
        device.queue.submit([encoder.finish()]);
        device.check()
    }

    /// Brings the parameters back.
    pub fn get(&self, device: &Device, parameters: &mut Parameters) -> Result<()> {
        let read = |buffer: &wgpu::Buffer, words: usize| -> Result<Vec<f32>> {
            let bytes = device.read(buffer, 4 * words as u64)?;
            Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
        };
        let columns = |buffer| -> Result<DepthGaussians> { Ok(self.numbers(&read(buffer, COLUMNS * self.count)?)) };
        parameters.now = columns(&self.now)?;
        parameters.averaged = columns(&self.averaged)?;
        if let Some(decoded) = &mut parameters.decoded {
            *decoded = columns(&self.seen_columns)?;
        }
        let averages = read(&self.averages, 2 * NUMBERS * self.count)?;
        let mut first = 0;
        for (a, width) in parameters.averages.iter_mut().zip(WIDTHS) {
            let column = |half: usize| {
                let at = move |k: usize, i: usize| (half * NUMBERS + first + k) * self.count + i;
                (0..self.count).flat_map(|i| (0..width).map(move |k| at(k, i))).map(|at| averages[at]).collect()
            };
            (a.first, a.second) = (column(0), column(1));
            first += width;
        }
        Ok(())
    }

    /// Sends where groups begin, and what their counts are to sum to.
    fn put_groups(&self, device: &Device, parameters: &Parameters) {
        let aims = parameters.groups.aims.iter().map(|&aim| (aim as f32).to_bits()).chain([0]);
        let records: Vec<[u32; 2]> = self.starts.iter().copied().zip(aims).map(|(start, aim)| [start, aim]).collect();
        device.queue.write_buffer(&self.group_records, 0, bytemuck::cast_slice(&records));
    }

    /// A Gaussian's number in each column.
    fn column(&self, g: &Numbers) -> [f32; COLUMNS] {
        let [x, y, z] = each_axis(|k| two_floats(g[k] - self.origin[k]));
        let [a, b, c, d, e, f, count] = std::array::from_fn(|k| g[3 + k] as f32);
        [x[0], y[0], z[0], x[1], y[1], z[1], a, b, c, d, e, f, g[9].exp() as f32, count]
    }

    /// Gaussians as columns.
    fn columns(&self, gaussians: &DepthGaussians) -> Vec<f32> {
        let n = self.count;
        let mut columns = vec![0.0f32; COLUMNS * n];
        for (i, g) in gaussians.0.iter().enumerate() {
            self.column(g).into_iter().enumerate().for_each(|(k, v)| columns[k * n + i] = v);
        }
        columns
    }

    fn numbers(&self, columns: &[f32]) -> DepthGaussians {
        let n = self.count;
        let number = |i: usize| -> Numbers {
            let at = |k: usize| f64::from(columns[k * n + i]);
            std::array::from_fn(|k| match k {
                0..3 => self.origin[k] + (at(k) + at(3 + k)),
                3..9 => at(3 + k),
                _ => at(13),
            })
        };
        DepthGaussians((0..n).map(number).collect())
    }
}

/// Gaussians by group, and where each group begins among them; then the end.
fn by_group(parameters: &Parameters) -> (Vec<u32>, Vec<u32>) {
    let mut order: Vec<u32> = (0..parameters.len() as u32).collect();
    order.sort_by_key(|&i| parameters.groups.of[i as usize]);
    let mut starts = vec![0u32; parameters.groups.counts.len() + 1];
    parameters.groups.of.iter().for_each(|&g| starts[g as usize + 1] += 1);
    for g in 1..starts.len() {
        starts[g] += starts[g - 1];
    }
    (order, starts)
}

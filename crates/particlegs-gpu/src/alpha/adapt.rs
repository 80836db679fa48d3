//! A scene's network on the device, and what its Gaussians were last bent for: adapt_main.wgsl and what it reads. The
//! kernel runs only where radius or opacity changed.

use super::gaussians::Gaussians;
use crate::kernel::{BufferUse, Kernel};
use crate::{Device, groups};
use particlegs_core::model::{VizMapper, VizRanges};
use particlegs_core::render::alpha::network::Setting;
use std::sync::{Mutex, PoisonError};

/// A scene's network on the device.
pub(super) struct NetworkBuffers {
    weights: wgpu::Buffer,
    ranges: VizRanges,
    /// A record for each part of the Gaussians.
    settings: Vec<wgpu::Buffer>,
    /// Factors on radius and opacity that the Gaussians are bent for.
    of: Mutex<Option<[u64; 2]>>,
}

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct SettingRecord {
    wanted: [f32; 2],
    shares: [f32; 2],
    floor: f32,
    count: u32,
    pad: [u32; 2],
}

impl NetworkBuffers {
    pub fn new(device: &Device, vizmapper: &VizMapper, parts: usize) -> NetworkBuffers {
        let weights = device.filled("network", &vizmapper.parameters, wgpu::BufferUsages::STORAGE);
        NetworkBuffers::of_buffer(device, weights, vizmapper.ranges, parts)
    }

    /// Of a network whose numbers lie in a buffer.
    pub fn of_buffer(device: &Device, weights: wgpu::Buffer, ranges: VizRanges, parts: usize) -> NetworkBuffers {
        use wgpu::BufferUsages as Use;
        let record = || device.buffer("setting", size_of::<SettingRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        NetworkBuffers { weights, ranges, settings: (0..parts).map(|_| record()).collect(), of: Mutex::default() }
    }

    /// Gaussians are to be bent anew.
    pub fn forget(&self) {
        *self.of.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl SettingRecord {
    fn new(setting: Setting, ranges: VizRanges, count: u32) -> SettingRecord {
        SettingRecord {
            wanted: [setting.radius, setting.opacity].map(|v| v as f32),
            shares: [ranges.scale, ranges.opacity].map(|v| v as f32),
            floor: ranges.floor as f32,
            count,
            pad: [0; 2],
        }
    }
}

pub(super) struct AdaptationKernel(Kernel);

impl AdaptationKernel {
    /// Compiled for a device.
    pub fn new(device: &Device) -> AdaptationKernel {
        let uses = [BufferUse::Uniform, BufferUse::Read, BufferUse::Read, BufferUse::Write];
        AdaptationKernel(Kernel::new(device, "adapt", &[include_str!("adapt_main.wgsl")], &uses))
    }

    /// Its bind groups, part by part; none where there is no network.
    pub fn bind(&self, device: &Device, gaussians: &Gaussians) -> Vec<wgpu::BindGroup> {
        let Some(network) = &gaussians.network else { return Vec::new() };
        let parts = network.settings.iter().zip(&gaussians.chunks);
        parts.map(|(s, c)| self.0.bind(device, &[s, &network.weights, &c.columns, &c.bent])).collect()
    }

    /// Bends the Gaussians, where they are not yet bent for this.
    pub fn run(
        &self,
        queue: &wgpu::Queue,
        pass: &mut wgpu::ComputePass<'_>,
        bound: &[wgpu::BindGroup],
        gaussians: &Gaussians,
        setting: Setting,
    ) {
        let Some(network) = &gaussians.network else { return };
        let key = [setting.radius.to_bits(), setting.opacity.to_bits()];
        // A camera that moves changes nothing here: the network sees only radius and opacity.
        if network.of.lock().unwrap_or_else(PoisonError::into_inner).replace(key) == Some(key) {
            return;
        }
        for ((bound, record), chunk) in bound.iter().zip(&network.settings).zip(&gaussians.chunks) {
            let setting_record = SettingRecord::new(setting, network.ranges, chunk.count);
            queue.write_buffer(record, 0, bytemuck::bytes_of(&setting_record));
            self.0.run(pass, bound, groups(u64::from(chunk.count)));
        }
    }
}

//! The network that follows radius and opacity: adapt_main.wgsl and what it reads. It runs where they change alone.

use super::gaussians::Gaussians;
use super::network_buffers::SettingRecord;
use crate::kernel::{BufferUse, Kernel};
use crate::{Device, groups};
use particlegs_core::render::alpha::network::Setting;
use std::sync::PoisonError;

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

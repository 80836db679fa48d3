//! A scene's network on the device, and what its Gaussians were last bent for.

use crate::Device;
use particlegs_core::model::{VizMapper, VizRanges};
use particlegs_core::render::alpha::network::Setting;
use std::sync::{Mutex, PoisonError};

/// A scene's network on the device.
pub(super) struct NetworkBuffers {
    pub weights: wgpu::Buffer,
    pub ranges: VizRanges,
    /// A record for each part of the Gaussians.
    pub settings: Vec<wgpu::Buffer>,
    /// Factors on radius and opacity that the Gaussians are bent for.
    pub of: Mutex<Option<[u64; 2]>>,
}

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct SettingRecord {
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
    pub fn new(setting: Setting, ranges: VizRanges, count: u32) -> SettingRecord {
        SettingRecord {
            wanted: [setting.radius, setting.opacity].map(|v| v as f32),
            shares: [ranges.scale, ranges.opacity].map(|v| v as f32),
            floor: ranges.floor as f32,
            count,
            pad: [0; 2],
        }
    }
}

//! The memory of pictures of one size.

use super::Limits;
use super::rest::band_of;
use crate::Device;
use crate::reference::view::ViewRecord;
use crate::sort::{Sort, Sorter};
use particlegs_core::Result;
use particlegs_core::picture::Size;
use wgpu::BufferUsages as Use;

/// Bits of a key below those of its pixel (rest.wgsl).
pub(super) const LEVEL_BITS: u32 = 8;

/// Layers and ranges of depths of a picture's pixels, rows from the bottom.
pub struct Canvas {
    pub(super) size: Size,
    pub(super) view: wgpu::Buffer,
    pub(super) slices: wgpu::Buffer,
    /// Two words a pixel (blend.wgsl).
    pub(super) ranges: wgpu::Buffer,
    pub(super) next_ranges: wgpu::Buffer,
    /// A word a pixel.
    pub(super) layers: wgpu::Buffer,
    /// Two words a pixel.
    pub(super) next_layers: wgpu::Buffer,
    /// Two words: what a peel found.
    pub(super) found: wgpu::Buffer,
    /// Where each slice's keys begin, and how many they are.
    pub(super) offsets: wgpu::Buffer,
    pub(super) counts: wgpu::Buffer,
    /// Pixels and grey levels of fragments.
    pub(super) keys: Sort,
    /// Before FXAA, and after it; rows from the top.
    pub(super) levels: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
}

impl Canvas {
    pub(super) fn new(device: &Device, sorter: &Sorter, size: Size, limits: &Limits) -> Result<Canvas> {
        let pixels = size.pixels() as u64;
        device.fits(size, 8 * pixels)?;
        let here = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let slices = limits.slices as u64;
        let band = band_of(size.width as u32, limits) * size.width as u32;
        let bits = u32::BITS - (band.min(pixels as u32) - 1).leading_zeros();
        let canvas = Canvas {
            size,
            view: device.buffer("view", size_of::<ViewRecord>() as u64, Use::UNIFORM | Use::COPY_DST),
            slices: device.buffer("slices", 8 * slices, Use::STORAGE | Use::COPY_DST),
            ranges: device.buffer("ranges", 8 * pixels, here),
            next_ranges: device.buffer("next ranges", 8 * pixels, here),
            layers: device.buffer("layers", 4 * pixels, here),
            next_layers: device.buffer("next layers", 8 * pixels, here),
            found: device.buffer("found", 8, here),
            offsets: device.buffer("offsets", 4 * slices, Use::STORAGE | Use::COPY_DST),
            counts: device.buffer("counts", 4 * slices, here),
            keys: sorter.room(device, limits.keys, LEVEL_BITS..LEVEL_BITS + bits.max(1)),
            levels: device.buffer("levels", pixels, Use::STORAGE | Use::COPY_SRC),
            picture: device.buffer("picture", pixels, Use::STORAGE | Use::COPY_SRC),
        };
        device.check()?;
        Ok(canvas)
    }

    /// The pictures' size.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Before any particle.
    pub(super) fn clear(&self, device: &Device) {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        for buffer in [&self.ranges, &self.next_ranges, &self.layers, &self.next_layers] {
            encoder.clear_buffer(buffer, 0, None);
        }
        device.queue.submit([encoder.finish()]);
    }

    /// The ranges of all fragments are those of the first peel.
    pub(super) fn begin_peels(&self, device: &Device) {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.next_ranges, 0, &self.ranges, 0, self.ranges.size());
        encoder.clear_buffer(&self.next_ranges, 0, None);
        device.queue.submit([encoder.finish()]);
    }
}

//! The memory of pictures of one size.

use super::DispatchLimits;
use super::rest::band_of;
use crate::Device;
use crate::reference::ViewRecord;
use crate::sort::{Sort, Sorter};
use particlegs_core::Result;
use particlegs_core::picture::Size;
use std::ops::Range;
use wgpu::BufferUsages as Use;

/// Bits of a key below those of its pixel (rest.wgsl).
pub(super) const LEVEL_BITS: u32 = 8;

/// Bytes a pixel of the largest of a strip's buffers.
const WIDEST: u64 = 8;
/// Rows of a strip are a multiple of this, but for the last: its levels, four a word, end with a word.
const WHOLE: usize = 4;

/// Layers and ranges of depths of as many rows of a picture as a GPU can bind; rows from the bottom.
pub(super) struct Strip {
    pub rows: Range<u32>,
    /// Two words a pixel (blend.wgsl).
    pub ranges: wgpu::Buffer,
    pub next_ranges: wgpu::Buffer,
    /// A word a pixel.
    pub layers: wgpu::Buffer,
    /// Two words a pixel; after the last peel the levels of four pixels a word, rows from the top.
    pub next_layers: wgpu::Buffer,
}

impl Strip {
    fn new(device: &Device, width: usize, rows: Range<u32>) -> Strip {
        let pixels = (width * rows.len()) as u64;
        let buffer = |label, bytes| device.buffer(label, bytes, Use::STORAGE | Use::COPY_DST | Use::COPY_SRC);
        Strip {
            rows,
            ranges: buffer("ranges", WIDEST * pixels),
            next_ranges: buffer("next ranges", WIDEST * pixels),
            layers: buffer("layers", 4 * pixels),
            next_layers: buffer("next layers", WIDEST * pixels),
        }
    }
}

/// The memory of pictures of one size.
pub struct ParaviewCanvas {
    pub(super) size: Size,
    pub(super) view: wgpu::Buffer,
    pub(super) slices: wgpu::Buffer,
    /// The uppermost first.
    pub(super) strips: Vec<Strip>,
    /// Two words: what a peel found.
    pub(super) found: wgpu::Buffer,
    /// The first of each slice's keys, and their number.
    pub(super) offsets: wgpu::Buffer,
    pub(super) counts: wgpu::Buffer,
    /// Pixels and grey levels of fragments.
    pub(super) keys: Sort,
    /// Before FXAA, and after it; rows from the top.
    pub(super) levels: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
}

impl ParaviewCanvas {
    pub(super) fn new(device: &Device, sorter: &Sorter, size: Size, limits: &DispatchLimits) -> Result<ParaviewCanvas> {
        let pixels = size.pixels() as u64;
        // A strip has four rows at least.
        device.fits(size, pixels.max(WIDEST * (size.width * size.height.min(WHOLE)) as u64))?;
        let most = limits.strip.min(device.largest_binding() / WIDEST) as usize;
        let rows = (most / size.width / WHOLE).max(1) * WHOLE;
        let strips = (0..size.height).step_by(rows).map(|above| {
            // Strips go from the top down, as pictures do, but VTK counts rows from the bottom.
            let strip_rows = size.height - size.height.min(above + rows)..size.height - above;
            Strip::new(device, size.width, strip_rows.start as u32..strip_rows.end as u32)
        });
        let here = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let slices = limits.slices as u64;
        let band = band_of(size.width as u32, limits) * size.width as u32;
        let bits = u32::BITS - (band.min(pixels as u32) - 1).leading_zeros();
        let canvas = ParaviewCanvas {
            size,
            view: device.buffer("view", size_of::<ViewRecord>() as u64, Use::UNIFORM | Use::COPY_DST),
            slices: device.buffer("slices", 8 * slices, Use::STORAGE | Use::COPY_DST),
            strips: strips.collect(),
            found: device.buffer("found", 8, here),
            offsets: device.buffer("offsets", 4 * slices, Use::STORAGE | Use::COPY_DST),
            counts: device.buffer("counts", 4 * slices, here),
            // Sorted by pixel alone: the sort is stable and keeps the order of particles within a pixel.
            keys: sorter.room(device, limits.keys, LEVEL_BITS..LEVEL_BITS + bits.max(1)),
            levels: device.buffer("levels", pixels, here),
            picture: device.buffer("picture", pixels, Use::STORAGE | Use::COPY_SRC),
        };
        device.check()?;
        Ok(canvas)
    }

    pub fn size(&self) -> Size {
        self.size
    }

    pub(super) fn clear(&self, device: &Device) {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        for strip in &self.strips {
            for buffer in [&strip.ranges, &strip.next_ranges, &strip.layers, &strip.next_layers] {
                encoder.clear_buffer(buffer, 0, None);
            }
        }
        device.queue.submit([encoder.finish()]);
    }

    /// The ranges of all fragments are those of the first peel.
    pub(super) fn begin_peels(&self, device: &Device) {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        for strip in &self.strips {
            encoder.copy_buffer_to_buffer(&strip.next_ranges, 0, &strip.ranges, 0, strip.ranges.size());
            encoder.clear_buffer(&strip.next_ranges, 0, None);
        }
        device.queue.submit([encoder.finish()]);
    }

    /// The levels of the whole picture, from those of its strips.
    pub(super) fn gather_levels(&self, device: &Device) {
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut to = 0;
        for strip in &self.strips {
            let bytes = (self.size.width * strip.rows.len()) as u64;
            // Only the last strip can end within a word (see `WHOLE`).
            encoder.copy_buffer_to_buffer(&strip.next_layers, 0, &self.levels, to, bytes.next_multiple_of(4));
            to += bytes;
        }
        device.queue.submit([encoder.finish()]);
    }
}

//! Changes that the pixels of a picture want of its footprints: the way back of raster_main.wgsl, tile by tile, then
//! footprint by footprint in the order of its tiles.

use super::canvas::BLOCK;
use super::frame::SlabRecord;
use super::kernels::AlphaKernels;
use super::{AlphaCanvas, STORAGE};
use crate::{Device, groups};
use particlegs_core::Result;

/// Numbers that pixels want of a footprint; with h the change of the loss with the logarithm of alpha at a pixel, and d its
/// distance from the centre: sums of h, h dx, h dy, h dx^2, h dx dy, h dy^2; and the change with the grey level.
pub(crate) const SUMS: u64 = 7;

/// The memory of the way back, of pictures on one canvas.
pub(crate) struct BackwardBuffers {
    /// The change of the loss with each pixel's brightness: written before the way back begins.
    pub by_pixel: wgpu::Buffer,
    /// [`SUMS`] of each Gaussian, a column a number; 0 of those that are not drawn.
    pub sums: wgpu::Buffer,
    /// Places of each footprint's slots.
    places: wgpu::Buffer,
    /// Brightness and transmittance of each pixel, from slab to slab.
    walked: wgpu::Buffer,
    /// The sums of each entry of the lists, for as many as there were yet.
    slots: Option<(u32, wgpu::Buffer)>,
}

impl BackwardBuffers {
    pub fn new(device: &Device, canvas: &AlphaCanvas) -> Result<BackwardBuffers> {
        let (pixels, n) = (canvas.size.pixels() as u64, u64::from(canvas.gaussians));
        device.fits(canvas.size, 8 * pixels)?;
        device.holds(&format!("{n} Gaussians"), 4 * SUMS * n)?;
        let buffer = |label, bytes| device.buffer(label, bytes, STORAGE);
        let buffers = BackwardBuffers {
            by_pixel: buffer("change with brightness", 4 * pixels),
            sums: buffer("wanted of footprints", 4 * SUMS * n),
            places: buffer("places of slots", 8 * n),
            walked: buffer("walk", 8 * pixels),
            slots: None,
        };
        device.check()?;
        Ok(buffers)
    }

    /// Room for the sums of so many entries.
    fn room(&mut self, device: &Device, entries: u32) -> Result<()> {
        if self.slots.as_ref().is_some_and(|(room, _)| *room >= entries) {
            return Ok(());
        }
        // The old buffer is freed first, so that memory never holds both.
        self.slots = None;
        device.holds(&format!("{entries} tile entries"), 4 * SUMS * u64::from(entries))?;
        let most = device.largest_binding() / (4 * SUMS);
        let room = u64::from(entries).next_power_of_two().min(most);
        self.slots = Some((room as u32, device.buffer("slots", 4 * SUMS * room, STORAGE)));
        device.check()
    }

    /// Fills all that is written before it is read with what is no number.
    #[cfg(test)]
    pub fn poison(&self, device: &Device) {
        for buffer in [&self.sums, &self.places, &self.walked].into_iter().chain(self.slots.as_ref().map(|s| &s.1)) {
            device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
        }
    }
}

impl super::AlphaRenderer {
    /// Sums what the pixels of the picture that was last submitted want of its footprints.
    pub(crate) fn backward(&self, canvas: &AlphaCanvas, back: &mut BackwardBuffers) -> Result<()> {
        back.room(&self.device, canvas.slabs.largest())?;
        for slab in &canvas.slabs.all {
            // If there are several slabs, only the lists of the last one are left from drawing.
            if canvas.slabs.all.len() > 1 {
                self.list(canvas, *slab);
            }
            self.back_through(canvas, back, slab);
        }
        self.device.check()
    }

    /// The gradients of a slab: places of slots, then each tile's list front to back, then each footprint's sum, in the order
    /// of tiles. What pixels have gone through is begun anew in the first slab.
    fn back_through(&self, canvas: &AlphaCanvas, back: &BackwardBuffers, slab: &SlabRecord) {
        let (Some(lists), Some((_, slots))) = (&canvas.lists, &back.slots) else { return };
        let AlphaKernels { slots: place, backward, gather, .. } = &self.kernels;
        let (device, frame) = (&*self.device, &canvas.batches[0].frame);
        let (order, touched, places) = (&canvas.order.values, &canvas.touched, &back.places);
        let placed = place.bind(device, &[frame, &canvas.slab, order, touched, &canvas.starts, places]);
        let of_pixels = [&back.by_pixel, &canvas.sums, &back.walked, slots];
        let of_lists = [frame, &canvas.slab, &canvas.ranges, &lists.sort.values, &canvas.splats, places];
        let walked = backward.bind(device, &[of_lists.as_slice(), &of_pixels].concat());
        let gathered = gather.bind(device, &[frame, &canvas.slab, order, touched, places, slots, &back.sums]);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        let each = groups(u64::from(BLOCK) * u64::from(slab.blocks));
        place.run(&mut pass, &placed, each);
        backward.run(&mut pass, &walked, [canvas.tiles.across as u32, canvas.tiles.down as u32]);
        gather.run(&mut pass, &gathered, each);
        drop(pass);
        device.queue.submit([encoder.finish()]);
    }
}

//! Pictures of the alpha-blend law in the stages of core's `render::alpha`, each a kernel:
//!
//! | kernel | twin in core | what it does |
//! |---|---|---|
//! | adapt_main.wgsl | `adapt`, `network` | what the network makes of each Gaussian; where radius or opacity changed |
//! | project.wgsl, fixed.wgsl | `project` | Gaussians to footprints, their depths rounded as there |
//! | ../sort/ | `plan` | numbers of Gaussians by depth, of entries by tile: a stable radix sort |
//! | bin.wgsl | `Bin` of `plan` | footprints, in the order of depth, to the lists of the tiles that they touch |
//! | raster_main.wgsl | `raster` | a tile's list to brightness, front to back |
//! | tone_main.wgsl | `depth_as_bright`, `render::tone` | brightness to grey levels |
//! | backward_main.wgsl, slots_main.wgsl | particlegs-train's `alpha::raster` | what pixels want of each footprint |
//!
//! Footprints of equal depth come in the order of their numbers. A pixel's thread adds alone, in the order of the list,
//! so that nothing depends on the order in which threads come. The lengths of the lists are counted first and read
//! back; where they are long, footprints are listed and blended slab by slab of depth, with the same bits.

mod adapt;
pub(crate) mod backward;
mod canvas;
mod fixed;
mod frame;
pub(crate) mod gaussians;
mod kernels;
#[cfg(test)]
mod tests;

pub use canvas::AlphaCanvas;
pub use gaussians::Gaussians;

pub(crate) use kernels::sources;

use crate::{Device, groups};
use canvas::{BLOCK, MOST_ENTRIES, Slabs};
use frame::{AlphaFrameRecord, SlabRecord};
use kernels::AlphaKernels;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::alpha::network::Setting;
use particlegs_core::render::alpha::{Eye, TILE};
use std::sync::Arc;

const STORAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST).union(wgpu::BufferUsages::COPY_SRC);

// The kernels' own.
const _: () = assert!(TILE == 16);

/// Draws on a device.
pub struct AlphaRenderer {
    device: Arc<Device>,
    kernels: AlphaKernels,
    /// Entries that are blended together.
    most: u32,
}

impl AlphaRenderer {
    pub fn new(device: &Arc<Device>) -> Result<Self> {
        let kernels = AlphaKernels::new(device);
        device.check()?;
        // An entry is one word in each of the lists.
        let most = MOST_ENTRIES.min((device.largest_binding() / 4).min(u64::from(u32::MAX)) as u32);
        Ok(AlphaRenderer { device: device.clone(), kernels, most })
    }

    /// Its kernels, for pictures whose way back is gone: that takes more memory an entry.
    pub(crate) fn for_training(device: &Arc<Device>) -> Result<Self> {
        let renderer = AlphaRenderer::new(device)?;
        let most = renderer.most.min((device.largest_binding() / (4 * backward::SUMS)).min(u64::from(u32::MAX)) as u32);
        Ok(AlphaRenderer { most, ..renderer })
    }

    /// Memory for pictures of `size` of these Gaussians.
    pub fn canvas(&self, gaussians: &Gaussians, size: Size) -> Result<AlphaCanvas> {
        AlphaCanvas::new(&self.device, &self.kernels, gaussians, size)
    }

    /// Gives the device a picture to draw, once it has said how long its lists are; the next one overwrites it.
    pub fn submit(&self, gaussians: &Gaussians, canvas: &mut AlphaCanvas, view: &View) -> Result<()> {
        let eye = Eye::new(view, canvas.size, &gaussians.blend.frame)?;
        self.blend_all(gaussians, canvas, &eye, gaussians.setting(view))?;
        self.tone(canvas);
        self.device.check()
    }

    /// [`AlphaRenderer::submit`] as far as brightness, of a camera in the training frame.
    pub(crate) fn blend_all(
        &self,
        gaussians: &Gaussians,
        canvas: &mut AlphaCanvas,
        eye: &Eye,
        setting: Setting,
    ) -> Result<()> {
        self.sort(gaussians, canvas, eye, setting)?;
        let blocks = canvas.gaussians.div_ceil(BLOCK);
        // The CPU must wait for these: it cannot reserve lists before it knows how long they are.
        let sums = self.device.read(&canvas.block_sums, 4 * u64::from(blocks))?;
        let sums: Vec<u32> = sums.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let slabs = Slabs::new(canvas.gaussians, &sums, self.most);
        canvas.lists(&self.device, &self.kernels, slabs.largest())?;
        self.device.queue.write_buffer(&canvas.starts, 0, bytemuck::cast_slice(&slabs.starts));
        canvas.slabs = slabs;
        for slab in &canvas.slabs.all {
            self.list(canvas, *slab);
            self.blend(canvas);
        }
        self.device.check()
    }

    /// Bends and projects Gaussians, sorts them by depth, and counts the entries of their blocks.
    fn sort(&self, gaussians: &Gaussians, canvas: &AlphaCanvas, eye: &Eye, setting: Setting) -> Result<()> {
        let (queue, kernels, n) = (&self.device.queue, &self.kernels, canvas.gaussians);
        for batch in &canvas.batches {
            let record = AlphaFrameRecord::new(eye, batch.first, batch.count)?;
            queue.write_buffer(&batch.frame, 0, bytemuck::bytes_of(&record));
        }
        let slab = SlabRecord { gaussians: n, ..SlabRecord::default() };
        queue.write_buffer(&canvas.slab, 0, bytemuck::bytes_of(&slab));
        canvas.order.set(queue, n);
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernels.adapt.run(queue, &mut pass, &canvas.adapt, gaussians, setting);
        for batch in &canvas.batches {
            kernels.project.run(&mut pass, &batch.project, groups(u64::from(batch.count)));
        }
        kernels.sort.run(&mut pass, &canvas.order, n);
        kernels.sums.run(&mut pass, &canvas.count, groups(u64::from(n)));
        drop(pass);
        queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Lists the footprints of a slab.
    fn list(&self, canvas: &AlphaCanvas, slab: SlabRecord) {
        let Some(lists) = &canvas.lists else { return };
        let (queue, kernels) = (&self.device.queue, &self.kernels);
        // Writes to a buffer come before what is submitted after them, so each slab reads its own record.
        queue.write_buffer(&canvas.slab, 0, bytemuck::bytes_of(&slab));
        lists.sort.set(queue, slab.entries);
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&canvas.ranges, 0, None);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernels.fill.run(&mut pass, &lists.fill, groups(u64::from(BLOCK) * u64::from(slab.blocks)));
        kernels.sort.run(&mut pass, &lists.sort, slab.entries);
        kernels.ends.run(&mut pass, &lists.ends, groups(u64::from(slab.entries)));
        drop(pass);
        queue.submit([encoder.finish()]);
    }

    /// Blends the footprints that are listed onto what there is.
    fn blend(&self, canvas: &AlphaCanvas) {
        let Some(lists) = &canvas.lists else { return };
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.kernels.raster.run(&mut pass, &lists.raster, [canvas.tiles.across as u32, canvas.tiles.down as u32]);
        drop(pass);
        self.device.queue.submit([encoder.finish()]);
    }

    /// From brightness to the picture.
    fn tone(&self, canvas: &AlphaCanvas) {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.kernels.tone.run(&mut pass, &canvas.tone, groups((canvas.size.pixels() as u64).div_ceil(4)));
        drop(pass);
        self.device.queue.submit([encoder.finish()]);
    }

    /// The last picture that was submitted, once it is drawn.
    pub fn picture(&self, canvas: &AlphaCanvas) -> Result<Gray8> {
        let size = canvas.size;
        Ok(Gray8 { size, data: self.device.read(&canvas.picture, size.pixels() as u64)? })
    }

    /// The brightness that it was made of, 1 = white, not cut to [0, 1].
    pub fn brightness(&self, canvas: &AlphaCanvas) -> Result<Plane> {
        let bytes = self.device.read(&canvas.sums, 4 * canvas.size.pixels() as u64)?;
        let data = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        Ok(Plane { size: canvas.size, data })
    }

    pub fn draw(&self, gaussians: &Gaussians, canvas: &mut AlphaCanvas, view: &View) -> Result<Gray8> {
        self.submit(gaussians, canvas, view)?;
        self.picture(canvas)
    }
}

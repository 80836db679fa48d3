//! The memory of pictures of one size of some Gaussians, and what is bound to kernels.

use super::STORAGE;
use super::frame::{AlphaFrameRecord, SlabRecord};
use super::gaussians::Gaussians;
use super::kernels::AlphaKernels;
use super::slabs::{BLOCK, Slabs};
use crate::Device;
use crate::sort::Sort;
use particlegs_core::Result;
use particlegs_core::picture::Size;
use particlegs_core::render::alpha::Tiles;
use wgpu::BufferUsages as Use;

/// Bytes of a footprint.
const SPLAT: u64 = 32;

/// The memory of pictures of one size of some Gaussians.
pub struct AlphaCanvas {
    pub(super) size: Size,
    pub(super) tiles: Tiles,
    pub(super) gaussians: u32,
    pub(super) batches: Vec<AlphaBatch>,
    pub(super) adapt: Vec<wgpu::BindGroup>,
    /// Depths, and the numbers of Gaussians that have them.
    pub(super) order: Sort,
    pub(super) slab: wgpu::Buffer,
    pub(super) splats: wgpu::Buffer,
    pub(super) touched: wgpu::Buffer,
    /// Entries of each block, and the first among those of its slab.
    pub(super) block_sums: wgpu::Buffer,
    pub(super) starts: wgpu::Buffer,
    /// The beginning and the end of each tile's list.
    pub(super) ranges: wgpu::Buffer,
    /// Brightness and transmittance of each pixel.
    pub(super) sums: wgpu::Buffer,
    pub(super) lefts: wgpu::Buffer,
    pub(super) picture: wgpu::Buffer,
    pub(super) count: wgpu::BindGroup,
    pub(super) tone: wgpu::BindGroup,
    /// The slabs of the last picture.
    pub(super) slabs: Slabs,
    /// Lists of tiles, for as many entries as a picture had yet.
    pub(super) lists: Option<AlphaTileLists>,
}

/// Gaussians that are projected together.
pub(super) struct AlphaBatch {
    pub first: u32,
    pub count: u32,
    pub frame: wgpu::Buffer,
    pub project: wgpu::BindGroup,
}

/// Entries of all lists: tiles, and the footprints that touch them.
pub(super) struct AlphaTileLists {
    pub room: u32,
    pub sort: Sort,
    pub fill: wgpu::BindGroup,
    pub ends: wgpu::BindGroup,
    pub raster: wgpu::BindGroup,
}

impl AlphaCanvas {
    /// For pictures of `size` of these Gaussians.
    pub(super) fn new(
        device: &Device,
        kernels: &AlphaKernels,
        gaussians: &Gaussians,
        size: Size,
    ) -> Result<AlphaCanvas> {
        let (tiles, pixels, n) = (Tiles::new(size), size.pixels() as u64, gaussians.len() as u64);
        device.fits(size, 4 * pixels)?;
        device.fits(size, 8 * tiles.number() as u64)?;
        device.holds(&format!("{n} Gaussians"), SPLAT * n)?;
        let buffer = |label, bytes| device.buffer(label, bytes, STORAGE);
        let order = kernels.sort.room(device, n as u32, 0..32);
        let (splats, touched) = (buffer("splats", SPLAT * n), buffer("touched tiles", 8 * n));
        let blocks = n.div_ceil(u64::from(BLOCK));
        let (block_sums, starts) = (buffer("entries of blocks", 4 * blocks), buffer("starts of blocks", 4 * blocks));
        let slab = device.buffer("slab", size_of::<SlabRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        let (sums, lefts) = (buffer("brightness", 4 * pixels), buffer("transmittance", 4 * pixels));
        let picture = buffer("picture", pixels);
        let batch = |c: &super::gaussians::AlphaGaussianChunk| {
            let frame = device.buffer("frame", size_of::<AlphaFrameRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
            let all = [&frame, &c.columns, &c.bent, &splats, &touched, &order.keys, &order.values];
            AlphaBatch { first: c.first, count: c.count, project: kernels.project.bind(device, &all), frame }
        };
        let batches: Vec<AlphaBatch> = gaussians.chunks.iter().map(batch).collect();
        let Some(AlphaBatch { frame, .. }) = batches.first() else {
            return Err(particlegs_core::Error::argument("no Gaussians to draw"));
        };
        let canvas = AlphaCanvas {
            size,
            tiles,
            gaussians: n as u32,
            adapt: kernels.adapt.bind(device, gaussians),
            count: kernels.sums.bind(device, &[frame, &slab, &order.values, &touched, &block_sums]),
            tone: kernels.tone.bind(device, &[frame, &sums, &picture]),
            ranges: buffer("ranges of tiles", 8 * tiles.number() as u64),
            batches,
            order,
            slab,
            splats,
            touched,
            block_sums,
            starts,
            sums,
            lefts,
            picture,
            slabs: Slabs::default(),
            lists: None,
        };
        device.check()?;
        Ok(canvas)
    }

    /// Brightness of each pixel of the last picture, 1 = white, not cut to [0, 1].
    pub(crate) fn brightness(&self) -> &wgpu::Buffer {
        &self.sums
    }

    /// The frame's record that its kernels read, of Gaussians in one buffer.
    pub(crate) fn frame(&self) -> &wgpu::Buffer {
        &self.batches[0].frame
    }

    /// The tiles that each footprint touches.
    pub(crate) fn touched(&self) -> &wgpu::Buffer {
        &self.touched
    }

    /// Room for lists of so many entries.
    pub(super) fn lists(&mut self, device: &Device, kernels: &AlphaKernels, entries: u32) -> Result<&AlphaTileLists> {
        let last_lists = self.lists.take().filter(|l| l.room >= entries);
        let lists = match last_lists {
            Some(lists) => lists,
            None => {
                let subject = format!("{}x{}: {entries} tile entries", self.size.width, self.size.height);
                device.holds(&subject, 4 * u64::from(entries))?;
                // Pictures of a turn need now more, now less.
                let room = u64::from(entries).next_power_of_two().min(device.largest_binding() / 4) as u32;
                let lists = self.new_lists(device, kernels, room);
                device.check()?;
                lists
            }
        };
        Ok(self.lists.insert(lists))
    }

    fn new_lists(&self, device: &Device, kernels: &AlphaKernels, room: u32) -> AlphaTileLists {
        let bits = u32::BITS - (self.tiles.number() as u32).saturating_sub(1).leading_zeros();
        let sort = kernels.sort.room(device, room, 0..bits.max(1));
        let (frame, slab, order) = (&self.batches[0].frame, &self.slab, &self.order);
        let fill = [frame, slab, &order.values, &self.touched, &self.starts, &sort.keys, &sort.values];
        let raster = [frame, slab, &self.ranges, &sort.values, &self.splats, &self.sums, &self.lefts];
        AlphaTileLists {
            room,
            fill: kernels.fill.bind(device, &fill),
            ends: kernels.ends.bind(device, &[slab, &sort.keys, &self.ranges]),
            raster: kernels.raster.bind(device, &raster),
            sort,
        }
    }
}

//! The memory of pictures of one size of some Gaussians, what is bound to kernels, and the slabs of depth whose
//! footprints are listed and blended together: memory and the time of a dispatch stay bounded, whatever is drawn.

use super::STORAGE;
use super::frame::{AlphaFrameRecord, SlabRecord};
use super::gaussians::Gaussians;
use super::kernels::AlphaKernels;
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
        // Lists that are too short are dropped before longer ones take memory.
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
        // Entries are sorted by as many bits as tile numbers have, since eight more cost two passes.
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

/// Entries of a slab's lists, at most, where a single block has no more.
pub(super) const MOST_ENTRIES: u32 = 1 << 22;
/// Footprints of a block.
pub(super) const BLOCK: u32 = 64;

/// The slabs of a picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Slabs {
    /// At least one, where there is a picture.
    pub all: Vec<SlabRecord>,
    /// The first entry of each block among those of its slab.
    pub starts: Vec<u32>,
}

impl Slabs {
    /// Of the entries of each block, `most` together where no block alone has more.
    pub fn new(gaussians: u32, blocks: &[u32], most: u32) -> Slabs {
        let slab = |first: usize| SlabRecord { gaussians, first: first as u32, ..SlabRecord::default() };
        let mut all = vec![SlabRecord { is_first: 1, ..slab(0) }];
        let mut starts = Vec::with_capacity(blocks.len());
        let mut last = all[0];
        for (place, entries) in blocks.iter().enumerate() {
            // A block is never divided: one with more entries than `most` is a slab of its own.
            if last.entries > 0 && *entries > 0 && u64::from(last.entries) + u64::from(*entries) > u64::from(most) {
                last = slab(place);
                all.push(last);
            }
            starts.push(last.entries);
            last.entries += entries;
            last.blocks += 1;
            if let Some(newest) = all.last_mut() {
                *newest = last;
            }
        }
        Slabs { all, starts }
    }

    /// Entries of the largest.
    pub fn largest(&self) -> u32 {
        self.all.iter().map(|s| s.entries).max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_hold_each_block_once_and_no_more_than_they_may() {
        let blocks = [3, 0, 4, 4, 20, 0, 1];
        let slabs = Slabs::new(400, &blocks, 8);
        let summary: Vec<_> = slabs.all.iter().map(|s| (s.first, s.blocks, s.entries, s.is_first)).collect();
        assert_eq!(summary, [(0, 3, 7, 1), (3, 1, 4, 0), (4, 2, 20, 0), (6, 1, 1, 0)]);
        assert_eq!(slabs.starts, [0, 3, 3, 0, 0, 20, 0]);
        assert_eq!(slabs.largest(), 20);
        let none = Slabs::new(0, &[], 8);
        assert_eq!((none.all.len(), none.largest(), none.all[0].is_first), (1, 0, 1));
    }
}

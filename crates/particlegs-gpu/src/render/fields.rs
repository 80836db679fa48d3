//! Maps of fields: core makes strokes of the Gaussians; a kernel adds them up, a tile of pixels a workgroup, in their order,
//! so that sums are float32 and need no scale. Core sums the planes and divides.

use super::DepthRenderer;
use crate::AT_ONCE;
use bytemuck::{Pod, Zeroable};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::render::bin::RasterSplat;
use particlegs_core::render::raster::RasterCanvas;
use particlegs_core::render::raster::pyramid::PAD;
use particlegs_core::render::{FieldSplat, FieldStroke, FieldTerms};

/// Pixels of a tile along a side.
const TILE: u32 = 8;
/// Entries of the lists of a dispatch, but for those of its last stroke.
const MOST_TOUCHES: usize = 1 << 22;

/// Rows of a plane of sums, as field_main.wgsl has them.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct StripRecord {
    width: u32,
    first: u32,
    rows: u32,
    stride: u32,
    number: u32,
    kind: u32,
    pad: [u32; 2],
}

/// Strokes of a dispatch, and which of them touch which tile.
#[derive(Default)]
struct FieldBatch {
    splats: Vec<FieldSplat>,
    /// Tiles with strokes, in the order of the strokes.
    touches: Vec<[u32; 2]>,
}

impl DepthRenderer {
    /// Adds strokes of a field to the planes of a canvas, in their order, in strips of at most so many bytes.
    pub(super) fn sum_field(
        &self,
        strokes: &[FieldStroke],
        terms: &FieldTerms,
        canvas: &mut RasterCanvas<'_>,
        most: u64,
        context: &Context<'_>,
    ) -> Result<()> {
        let number = terms.planes();
        for (place, (level, plane)) in canvas.sums().enumerate() {
            let row = number * level.stride;
            let rows = (most as usize / (size_of::<f32>() * row)).max(1);
            for (k, strip) in plane.chunks_mut(rows * row).enumerate() {
                let shape = StripRecord {
                    width: (level.size.width + 2 * PAD) as u32,
                    first: (k * rows) as u32,
                    rows: (strip.len() / row) as u32,
                    stride: level.stride as u32,
                    number: number as u32,
                    kind: terms.kind as u32,
                    pad: [0; 2],
                };
                let splats = strokes.iter().filter(|stroke| stroke.level == place).map(|stroke| &stroke.splat);
                self.sum_strip(splats, &shape, strip, context)?;
            }
        }
        Ok(())
    }

    /// Adds strokes to rows of their plane.
    fn sum_strip<'a>(
        &self,
        splats: impl Iterator<Item = &'a FieldSplat>,
        shape: &StripRecord,
        strip: &mut [f32],
        context: &Context<'_>,
    ) -> Result<()> {
        let (device, bytes) = (&*self.device, size_of_val(strip) as u64);
        let mut touching = splats.filter(|splat| shape.touched(&splat.raster).next().is_some()).peekable();
        if touching.peek().is_none() {
            return Ok(());
        }
        let sums = device.buffer("sums", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        while touching.peek().is_some() {
            context.check()?;
            let mut batch = FieldBatch::default();
            while batch.splats.len() < AT_ONCE as usize
                && batch.touches.len() < MOST_TOUCHES
                && let Some(splat) = touching.next()
            {
                let stroke = batch.splats.len() as u32;
                batch.touches.extend(shape.touched(&splat.raster).map(|tile| [tile, stroke]));
                batch.splats.push(*splat);
            }
            self.add_batch(&batch, shape, &sums)?;
        }
        bytemuck::cast_slice_mut(strip).copy_from_slice(&device.read(&sums, bytes)?);
        Ok(())
    }

    /// Adds a batch to a strip, and waits until it is done.
    fn add_batch(&self, batch: &FieldBatch, shape: &StripRecord, sums: &wgpu::Buffer) -> Result<()> {
        let (device, kernel) = (&*self.device, &self.kernels.field);
        let tiles = shape.tiles();
        let (starts, lists) = batch.lists((tiles[0] * tiles[1]) as usize);
        let storage = wgpu::BufferUsages::STORAGE;
        let shape = device.filled("strip", &[*shape], wgpu::BufferUsages::UNIFORM);
        let splats = device.filled("strokes of a field", &batch.splats, storage);
        let [starts, lists] = [starts, lists].map(|words| device.filled("lists of tiles", &words, storage));
        let bound = kernel.bind(device, &[&shape, &splats, &starts, &lists, sums]);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.run(&mut pass, &bound, tiles);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        // What is sent stays in memory until then.
        device.wait()
    }
}

impl StripRecord {
    /// Tiles across and down.
    fn tiles(&self) -> [u32; 2] {
        [self.width, self.rows].map(|pixels| pixels.div_ceil(TILE))
    }

    /// The numbers of the tiles that a stroke touches, and perhaps of some beside them.
    fn touched(&self, raster: &RasterSplat) -> impl Iterator<Item = u32> + use<> {
        let [across, down] = self.tiles();
        let RasterSplat { x, y, slope, along, end, half, .. } = *raster;
        let y = y - self.first as f32;
        // Casts of floats saturate; from one beyond the last to the last there is none.
        let range = |from: f32, to: f32, count: u32| {
            let tile = |place: f32| (place.max(0.0) / TILE as f32) as u32;
            tile(from)..if to < 0.0 { 0 } else { count.min(tile(to).saturating_add(1)) }
        };
        // What rounding may have made of places.
        let room = 0.5 + 4e-6 * (x.abs() + (slope * half).abs());
        let wide = (end / along).sqrt() + room;
        range(y - half - room, y + half + room, down).flat_map(move |row| {
            // The row's centre moves from its first line to its last.
            let centers = [0, TILE - 1].map(|line| x + slope * ((row * TILE + line) as f32 - y).max(-half).min(half));
            let [left, right] = [centers[0].min(centers[1]) - wide, centers[0].max(centers[1]) + wide];
            range(left, right, across).map(move |column| row * across + column)
        })
    }
}

impl FieldBatch {
    /// Where the list of each tile begins, and the end of all; the lists.
    fn lists(&self, tiles: usize) -> (Vec<u32>, Vec<u32>) {
        let mut starts = vec![0u32; tiles + 1];
        self.touches.iter().for_each(|[tile, _]| starts[*tile as usize + 1] += 1);
        (0..tiles).for_each(|tile| starts[tile + 1] += starts[tile]);
        let (mut next, mut lists) = (starts.clone(), vec![0u32; self.touches.len()]);
        for [tile, stroke] in &self.touches {
            let place = &mut next[*tile as usize];
            lists[*place as usize] = *stroke;
            *place += 1;
        }
        (starts, lists)
    }
}

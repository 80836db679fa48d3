//! A rival of the atomic adds, to be measured beside them: strokes are listed for each tile of 8 x 8 pixels of each plane,
//! and a pixel is summed by one thread. The same whole numbers are added, so that pictures have the same bits. The
//! lengths of the lists are counted first and read back. Gaussians that are cut along depth are drawn by atomic adds
//! after it. Not parted into dispatches, however long lists are: slow GPUs may treat a long one as hung.

use super::kernels::sources::{FRAME, PLANES, ROWS, SCALE, SPAN, STROKE};
use super::{DepthCanvas, DepthRenderer, GaussianBatch, Gaussians};
use crate::kernel::{BufferUse, Kernel};
use crate::{Device, groups};
use particlegs_core::camera::View;
use particlegs_core::picture::Size;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};

/// Draws on a canvas by tiles.
pub struct DepthTiles<'a> {
    renderer: &'a DepthRenderer,
    gaussians: &'a Gaussians,
    canvas: &'a DepthCanvas,
    kernels: TileKernels,
    /// Of each tile: how many strokes touch it, then where its list begins, then where it ends.
    ends: wgpu::Buffer,
    total: wgpu::Buffer,
    scan: wgpu::BindGroup,
    counts: Vec<wgpu::BindGroup>,
    /// For as many entries as a picture had yet.
    lists: Option<TileLists>,
    /// Entries that the device sees at once.
    pub(super) most: u32,
}

/// Bind groups for lists of so many entries.
struct TileLists {
    room: u32,
    fills: Vec<wgpu::BindGroup>,
    sum: wgpu::BindGroup,
}

struct TileKernels {
    count: Kernel,
    scan: Kernel,
    fill: Kernel,
    sum: Kernel,
}

impl TileKernels {
    fn new(device: &Device) -> TileKernels {
        use BufferUse::{Read, Uniform, Write};
        const TILES: &str = include_str!("tiles.wgsl");
        let of_strokes =
            |label, main, uses: &[BufferUse]| Kernel::new(device, label, &[main, FRAME, STROKE, ROWS, TILES], uses);
        TileKernels {
            count: of_strokes("strokes of tiles", include_str!("count_main.wgsl"), &[Uniform, Read, Read, Write]),
            scan: Kernel::new(device, "starts of tiles", &[include_str!("scan_main.wgsl")], &[Write, Write]),
            fill: of_strokes("lists of tiles", include_str!("fill_main.wgsl"), &[Uniform, Read, Read, Write, Write]),
            sum: Kernel::new(
                device,
                "sums of tiles",
                &[include_str!("sum_main.wgsl"), FRAME, SCALE, STROKE, ROWS, SPAN, PLANES, TILES],
                &[Uniform, Read, Read, Read, Read, Write, Write],
            ),
        }
    }
}

impl<'a> DepthTiles<'a> {
    /// For pictures of these Gaussians on a canvas of theirs.
    pub fn new(renderer: &'a DepthRenderer, gaussians: &'a Gaussians, canvas: &'a DepthCanvas) -> Result<Self> {
        use wgpu::BufferUsages as Usage;
        let (device, kernels) = (&*renderer.device, TileKernels::new(&renderer.device));
        let bytes = 16 * canvas.planes.tiles;
        device.fits(canvas.planes.size, bytes)?;
        let ends = device.buffer("ends of lists", bytes, Usage::STORAGE | Usage::COPY_DST);
        let total = device.buffer("entries", 4, Usage::STORAGE | Usage::COPY_SRC);
        let [strokes, planes_of] = &canvas.scratch;
        let count = |b: &GaussianBatch| kernels.count.bind(device, &[&b.frame, strokes, planes_of, &ends]);
        let counts = canvas.batches.iter().map(count).collect();
        let scan = kernels.scan.bind(device, &[&ends, &total]);
        // Those that 32 bits do not count are counted as the most that they hold.
        let most = (device.largest_binding() / 4).min(u64::from(u32::MAX - 1)) as u32;
        device.check()?;
        Ok(DepthTiles { renderer, gaussians, canvas, kernels, ends, total, scan, counts, lists: None, most })
    }

    /// Gives the device a picture to draw, once it has said how long its lists are: [`DepthRenderer::submit`]'s, to the last
    /// bit.
    ///
    /// # Errors
    /// As there; [`Error::Argument`] where lists are too long for the device.
    pub fn submit(&mut self, view: &View, style: ToneStyle) -> Result<()> {
        let (renderer, canvas) = (self.renderer, self.canvas);
        let lens = renderer.seen(self.gaussians, canvas, view, style)?;
        let mut encoder = self.encoder();
        renderer.begin(&mut encoder, self.gaussians, canvas, &lens);
        let cuts = self.gaussians.may_be_cut(&lens);
        self.bound(&mut encoder, cuts);
        for (k, batch) in canvas.batches.iter().enumerate() {
            // Batches share one buffer of strokes, which now holds those of the last batch.
            if canvas.batches.len() > 1 {
                encoder.clear_buffer(&canvas.cut_count, 0, None);
                renderer.project(&mut encoder.begin_compute_pass(&Default::default()), batch);
            }
            encoder = self.draw(encoder, k, cuts)?;
        }
        let mut pass = encoder.begin_compute_pass(&Default::default());
        renderer.sum_planes(&mut pass, canvas);
        renderer.tones.run(&mut pass, &canvas.tone, canvas.planes.size, style);
        drop(pass);
        renderer.device.queue.submit([encoder.finish()]);
        renderer.device.check()
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.renderer.device.device.create_command_encoder(&Default::default())
    }

    /// Projects all Gaussians, and finds the scale of their sums.
    fn bound(&self, encoder: &mut wgpu::CommandEncoder, cuts: bool) {
        let (renderer, canvas) = (self.renderer, self.canvas);
        for batch in &canvas.batches {
            encoder.clear_buffer(&canvas.cut_count, 0, None);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            renderer.project(&mut pass, batch);
            if cuts {
                renderer.bound_slices(&mut pass, batch);
            }
        }
        let mut pass = encoder.begin_compute_pass(&Default::default());
        renderer.scale(&mut pass, canvas);
    }

    /// Lists the strokes of a batch and sums them, then what is cut: after what an encoder has, and with one for the rest.
    fn draw(&mut self, mut encoder: wgpu::CommandEncoder, k: usize, cuts: bool) -> Result<wgpu::CommandEncoder> {
        let (renderer, canvas) = (self.renderer, self.canvas);
        let (device, batch) = (&renderer.device, &canvas.batches[k]);
        let strokes = groups(u64::from(batch.count));
        encoder.clear_buffer(&self.ends, 0, None);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.kernels.count.run(&mut pass, &self.counts[k], strokes);
        self.kernels.scan.run(&mut pass, &self.scan, [1, 1]);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        let total = device.read(&self.total, 4)?;
        let lists = self.lists(u32::from_le_bytes([total[0], total[1], total[2], total[3]]))?;
        let mut encoder = self.encoder();
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.kernels.fill.run(&mut pass, &lists.fills[k], strokes);
        // A group a tile, and four tiles in each of the canvas'.
        self.kernels.sum.run(&mut pass, &lists.sum, groups(64 * 4 * canvas.planes.tiles));
        if cuts {
            renderer.slices(&mut pass, batch);
        }
        drop(pass);
        self.lists = Some(lists);
        Ok(encoder)
    }

    /// Takes the lists, with room for so many entries.
    fn lists(&mut self, entries: u32) -> Result<TileLists> {
        if let Some(lists) = self.lists.take().filter(|l| l.room >= entries) {
            return Ok(lists);
        }
        let (device, canvas) = (&self.renderer.device, self.canvas);
        if entries > self.most {
            let Size { width, height } = canvas.planes.size;
            let message = format!("{width}x{height}: {entries} tile entries are more than the {} that", self.most);
            return Err(Error::argument(format!("{message} device {} can bind; atomic adds need none", device.name())));
        }
        // Pictures of a turn need now more, now less.
        let room = u64::from(entries).next_power_of_two().min(u64::from(self.most)) as u32;
        let list = device.buffer("lists of tiles", 4 * u64::from(room), wgpu::BufferUsages::STORAGE);
        let [strokes, planes_of] = &canvas.scratch;
        let fill =
            |b: &GaussianBatch| self.kernels.fill.bind(device, &[&b.frame, strokes, planes_of, &self.ends, &list]);
        let fills = canvas.batches.iter().map(fill).collect();
        let [finest, coarser] = &canvas.sums;
        let sum = [&canvas.batches[0].frame, strokes, &self.ends, &list, &canvas.scales, finest, coarser];
        let sum = self.kernels.sum.bind(device, &sum);
        device.check()?;
        Ok(TileLists { room, fills, sum })
    }
}

//! ParaView's own pictures of all particles, shot noise and all, as particlegs' `reference` draws them:
//!
//! | kernel | twin | what it does |
//! |---|---|---|
//! | exact.wgsl | none: what Rust's float32 does | operations that are rounded once each |
//! | project.wgsl | `reference::project` | particles to splats |
//! | quad.wgsl | `reference::quad` | which pixel centres a splat covers, and its alpha there |
//! | slice.wgsl, count_main.wgsl | `reference::paraview` | pixels of splats, shared out evenly |
//! | ranges.wgsl, blend.wgsl, peel_main.wgsl, settle_main.wgsl | `reference::blend` | dual depth peeling |
//! | rest*.wgsl, ../../sort/ | `reference::blend` | what the peels left, blended in the order of the particles |
//! | fxaa.wgsl | `reference::fxaa` | antialiasing |
//!
//! Nothing depends on the order of threads. A peel keeps least and greatest depths and largest levels, by atomic maxima of
//! whole numbers. Fragments that the peels left depend on the particles' order: they are written in that order, sorted
//! by pixel without changing it, and blended one after the other; as many at a time as there is room for.
//!
//! Every stage goes through the particles anew: to count their pixels, for the ranges of depths, for each peel, for the rest.
//! If a picture has more layers than a GPU can bind, strips of rows are drawn, stage by stage, since VTK's last
//! peel is that of the whole picture.

mod kernels;
mod layers;
mod rest;
#[cfg(test)]
mod tests;

pub use layers::ParaviewCanvas;

use super::DeviceParticles;
use super::ViewRecord;
use super::source::ParticleSource;
use crate::kernel::Kernel;
use crate::{Device, groups};
use kernels::ParaviewKernels;
use layers::Strip;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::splat::PEELS;
use std::sync::Arc;

/// Limits of the work that is done at a time.
#[derive(Clone, Copy, Debug)]
struct DispatchLimits {
    /// Slices of a dispatch.
    slices: usize,
    /// Pixels that they have together: well below a second of work on a slow GPU.
    pixels: u64,
    /// Fragments that are sorted together.
    keys: u32,
    /// Pixels that are sorted together.
    band: u32,
    /// Pixels of a strip, where a GPU can bind that many.
    strip: u64,
}

const LIMITS: DispatchLimits =
    DispatchLimits { slices: 65_535, pixels: 1 << 26, keys: 1 << 23, band: 1 << 24, strip: u64::MAX };

/// Draws ParaView's pictures of all particles on a device.
pub struct Paraview {
    device: Arc<Device>,
    kernels: ParaviewKernels,
    limits: DispatchLimits,
}

/// A strip, and of each piece of the particles how many pixels there the boxes of every 64 have.
struct StripWork<'a> {
    strip: &'a Strip,
    counts: Vec<Vec<u32>>,
}

/// A picture about to be drawn.
pub struct PictureRequest<'a> {
    paraview: &'a Paraview,
    canvas: &'a ParaviewCanvas,
    record: ViewRecord,
}

impl Paraview {
    pub fn new(device: &Arc<Device>) -> Result<Paraview> {
        Paraview::within(device, LIMITS)
    }

    fn within(device: &Arc<Device>, limits: DispatchLimits) -> Result<Paraview> {
        let kernels = ParaviewKernels::new(device);
        device.check()?;
        Ok(Paraview { device: device.clone(), kernels, limits })
    }

    /// Memory for pictures of a size: 30 bytes a pixel, and 68 MiB.
    pub fn canvas(&self, size: Size) -> Result<ParaviewCanvas> {
        ParaviewCanvas::new(&self.device, &self.kernels.sorter, size, &self.limits)
    }

    /// A picture of particles about `origin`, between two distances (world units).
    pub fn shot<'a>(
        &'a self,
        canvas: &'a ParaviewCanvas,
        view: &View,
        origin: [f64; 3],
        range: [f64; 2],
    ) -> Result<PictureRequest<'a>> {
        let record = ViewRecord::new(view, canvas.size, origin, range)?;
        Ok(PictureRequest { paraview: self, canvas, record })
    }
}

impl PictureRequest<'_> {
    /// ParaView's picture, with FXAA or before it.
    pub fn draw(&self, source: &dyn ParticleSource, fxaa: bool) -> Result<Gray8> {
        let canvas = self.canvas;
        canvas.clear(&self.paraview.device);
        let work = self.work(source)?;
        let kernel = &self.paraview.kernels.range;
        self.each_batch(source, &work, &mut |points, strip, batch| {
            let buffers = [&canvas.view, &points.positions, &canvas.slices, &strip.next_ranges];
            self.run_slices(kernel, &kernel.bind(self.device(), &buffers), self.of(points, strip), batch);
            Ok(())
        })?;
        canvas.begin_peels(&self.paraview.device);
        if self.peels(source, &work)? {
            self.rest(source, &work)?;
        }
        self.finish(fxaa)
    }

    /// Peels, and says whether there is a rest to blend: VTK stops once a whole peel writes no back layer anywhere, and
    /// blends no rest then.
    fn peels(&self, source: &dyn ParticleSource, work: &[StripWork<'_>]) -> Result<bool> {
        let (canvas, kernel) = (self.canvas, &self.paraview.kernels.peel);
        for _ in 0..PEELS {
            self.each_batch(source, work, &mut |points, strip, batch| {
                let buffers = [
                    &canvas.view,
                    &points.positions,
                    &canvas.slices,
                    &strip.next_ranges,
                    &strip.ranges,
                    &strip.layers,
                    &strip.next_layers,
                ];
                self.run_slices(kernel, &kernel.bind(self.device(), &buffers), self.of(points, strip), batch);
                Ok(())
            })?;
            let [wrote, left] = self.settle()?;
            if wrote == 0 || left == 0 {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Ends a peel: whether it wrote a back layer anywhere, and whether anything is left.
    fn settle(&self) -> Result<[u32; 2]> {
        let (canvas, kernel) = (self.canvas, &self.paraview.kernels.settle);
        self.device().queue.write_buffer(&canvas.found, 0, &[0; 8]);
        for strip in &canvas.strips {
            let buffers =
                [&canvas.view, &strip.next_ranges, &strip.ranges, &strip.layers, &strip.next_layers, &canvas.found];
            let bound = kernel.bind(self.device(), &buffers);
            self.run(kernel, &bound, self.within(strip), groups(self.pixels(strip)));
        }
        let bytes = self.device().read(&canvas.found, 8)?;
        Ok(bytemuck::pod_read_unaligned(&bytes))
    }

    /// The number of pixels in every strip of the boxes of every 64 particles, piece by piece.
    fn work(&self, source: &dyn ParticleSource) -> Result<Vec<StripWork<'_>>> {
        let (canvas, kernel) = (self.canvas, &self.paraview.kernels.count);
        let mut work: Vec<_> = canvas.strips.iter().map(|strip| StripWork { strip, counts: Vec::new() }).collect();
        source.each(&mut |points| {
            let all = points.count.div_ceil(GROUP);
            let counts = self.device().buffer(
                "work",
                4 * u64::from(all),
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            );
            let bound = kernel.bind(self.device(), &[&canvas.view, &points.positions, &canvas.slices, &counts]);
            for strip_work in &mut work {
                self.run(kernel, &bound, self.of(points, strip_work.strip), groups(u64::from(points.count)));
                strip_work.counts.push(bytemuck::pod_collect_to_vec(&self.device().read(&counts, 4 * u64::from(all))?));
            }
            Ok(())
        })?;
        Ok(work)
    }

    /// Calls `run` with every piece, every strip and the slices of its pixels, as many as a dispatch takes.
    fn each_batch(
        &self,
        source: &dyn ParticleSource,
        work: &[StripWork<'_>],
        run: &mut dyn FnMut(&DeviceParticles, &Strip, &[GroupSlice]) -> Result<()>,
    ) -> Result<()> {
        let mut piece = 0;
        source.each(&mut |points| {
            for StripWork { strip, counts } in work {
                for batch in counts.get(piece).iter().flat_map(|c| Batches::new(c, &self.paraview.limits)) {
                    run(points, strip, &batch)?;
                }
            }
            piece += 1;
            // What was given to the queue is done before more is.
            self.device().wait()
        })
    }

    /// Runs a kernel over slices.
    fn run_slices(&self, kernel: &Kernel, bound: &wgpu::BindGroup, record: ViewRecord, batch: &[GroupSlice]) {
        self.device().queue.write_buffer(&self.canvas.slices, 0, bytemuck::cast_slice(batch));
        self.run(kernel, bound, record, [batch.len() as u32, 1]);
    }

    fn run(&self, kernel: &Kernel, bound: &wgpu::BindGroup, record: ViewRecord, groups: [u32; 2]) {
        let device = self.device();
        device.queue.write_buffer(&self.canvas.view, 0, bytemuck::bytes_of(&record));
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.run(&mut pass, bound, groups);
        drop(pass);
        device.queue.submit([encoder.finish()]);
    }

    fn finish(&self, fxaa: bool) -> Result<Gray8> {
        let (canvas, kernels) = (self.canvas, &self.paraview.kernels);
        for strip in &canvas.strips {
            let bound = kernels.level.bind(self.device(), &[&canvas.view, &strip.layers, &strip.next_layers]);
            self.run(&kernels.level, &bound, self.within(strip), groups(self.pixels(strip).div_ceil(4)));
        }
        canvas.gather_levels(&self.paraview.device);
        if fxaa {
            let bound = kernels.fxaa.bind(self.device(), &[&canvas.view, &canvas.levels, &canvas.picture]);
            self.run(&kernels.fxaa, &bound, self.record, groups((canvas.size.pixels() as u64).div_ceil(4)));
        }
        let from = if fxaa { &canvas.picture } else { &canvas.levels };
        let data = self.device().read(from, canvas.size.pixels() as u64)?;
        Ok(Gray8 { size: canvas.size, data })
    }

    fn within(&self, strip: &Strip) -> ViewRecord {
        ViewRecord { strip: [strip.rows.start, strip.rows.end], ..self.record }
    }

    fn of(&self, points: &DeviceParticles, strip: &Strip) -> ViewRecord {
        ViewRecord { count: points.count, ..self.within(strip) }
    }

    fn pixels(&self, strip: &Strip) -> u64 {
        (self.canvas.size.width * strip.rows.len()) as u64
    }

    fn device(&self) -> &Device {
        &self.paraview.device
    }
}

/// Particles whose pixels stand one behind the other: those of a workgroup.
const GROUP: u32 = 64;
/// Pixels of a slice at most (slice.wgsl says so too).
const SLICE: u32 = 4096;

/// The number of a group of particles in its piece, and the first of its pixels.
type GroupSlice = [u32; 2];

/// The slices of a piece, in the order of its particles, as many at a time as a dispatch takes.
struct Batches<'a> {
    /// Pixels of every group.
    counts: &'a [u32],
    next: GroupSlice,
    limits: &'a DispatchLimits,
}

impl<'a> Batches<'a> {
    fn new(counts: &'a [u32], limits: &'a DispatchLimits) -> Self {
        Batches { counts, next: [0, 0], limits }
    }
}

impl Iterator for Batches<'_> {
    type Item = Vec<GroupSlice>;

    fn next(&mut self) -> Option<Vec<GroupSlice>> {
        let mut batch = Vec::new();
        let mut pixels = 0;
        while let Some(&all) = self.counts.get(self.next[0] as usize) {
            // This also steps over groups without any pixels.
            if self.next[1] >= all {
                self.next = [self.next[0] + 1, 0];
                continue;
            }
            if batch.len() >= self.limits.slices || pixels >= self.limits.pixels {
                break;
            }
            batch.push(self.next);
            let slice_pixels = SLICE.min(all - self.next[1]);
            pixels += u64::from(slice_pixels);
            self.next[1] += slice_pixels;
        }
        (!batch.is_empty()).then_some(batch)
    }
}

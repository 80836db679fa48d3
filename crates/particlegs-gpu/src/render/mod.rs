//! Pictures of the optical-depth law in the stages of core's `render`, each a kernel:
//!
//! | kernel | twin in core | what it does |
//! |---|---|---|
//! | project.wgsl, slices.wgsl | `project`, `project::slices` | Gaussians to footprints, whole or in pieces along depth |
//! | bin.wgsl | `bin::place` | footprints to strokes on the plane that suits them |
//! | bound.wgsl, scale_main.wgsl | none: it sums in float32 | a scale for each plane's sums of whole numbers that none wraps at |
//! | raster.wgsl, ../share.wgsl | `raster::draw` | strokes to sums, by atomic adds, pixels shared out evenly |
//! | tiles/ | none: a rival of the last, for strokes | lists of the strokes of 8 x 8 pixels to sums, a pixel by one thread |
//! | pyramid.wgsl | `raster::pyramid` | planes summed from coarse to fine, as depth |
//! | tone.wgsl | `tone` | depth to grey levels |
//! | field_main.wgsl | `field_strokes` | strokes of a field, which core makes, to sums |
//!
//! Nothing is sorted, and nothing depends on the order in which threads come.

mod fields;
mod frame;
mod gaussians;
mod kernels;
mod pictures;
#[cfg(test)]
mod tests;
mod tiles;
mod tone;

pub(crate) use frame::two_floats;
pub use gaussians::Gaussians;
pub(crate) use gaussians::MOST;
pub(crate) use kernels::sources;
pub use pictures::ScenePictures;
pub use tiles::DepthTiles;
pub(crate) use tone::{CURVE, Tone, ToneMapper, TonePlane, ToneStyleRecord, curve};

use crate::{AT_ONCE, CUT_GROUPS, CUTS_AT_ONCE, Device, dispatches, groups};
use frame::MOST_LEVELS;
pub(crate) use frame::{FrameRecord, PlaneLayout};
pub(crate) use gaussians::factor;
use kernels::Kernels;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::lens::Lens;
use particlegs_core::render::raster::pyramid::PAD;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use std::sync::Arc;

/// Pixels of a plane that is summed together with those that are coarser.
const COARSEST: u32 = 8192;

/// Draws on a device.
pub struct DepthRenderer {
    device: Arc<Device>,
    kernels: Kernels,
    tones: ToneMapper,
}

/// The memory of pictures of one size of some Gaussians, and what is bound to kernels.
pub struct DepthCanvas {
    planes: PlaneLayout,
    /// Of the finest plane, and of all others.
    sums: [wgpu::Buffer; 2],
    tiles: wgpu::Buffer,
    /// The factor of sums of each plane, and its inverse.
    scales: wgpu::Buffer,
    cut_count: wgpu::Buffer,
    picture: wgpu::Buffer,
    /// Strokes and their planes: what is written before it is read.
    scratch: [wgpu::Buffer; 2],
    cuts: wgpu::Buffer,
    batches: Vec<GaussianBatch>,
    scale: wgpu::BindGroup,
    steps: Vec<LevelPass>,
    tone: Tone,
}

/// Buffers of a canvas that training reads.
pub(crate) struct CanvasBuffers<'a> {
    pub frame: &'a wgpu::Buffer,
    /// The finest plane.
    pub finest: &'a wgpu::Buffer,
    pub scale: &'a wgpu::Buffer,
    pub cuts: &'a wgpu::Buffer,
    pub cut_count: &'a wgpu::Buffer,
}

impl DepthCanvas {
    pub(crate) fn planes(&self) -> &PlaneLayout {
        &self.planes
    }

    /// Whether the finest plane, being the only one, holds whole numbers.
    pub(crate) fn holds_sums(&self) -> bool {
        self.steps.is_empty()
    }

    /// Its buffers, of Gaussians that are in one buffer.
    pub(crate) fn buffers(&self) -> CanvasBuffers<'_> {
        let DepthCanvas { sums: [finest, _], scales: scale, cuts, cut_count, batches, .. } = self;
        CanvasBuffers { frame: &batches[0].frame, finest, scale, cuts, cut_count }
    }
}

/// Gaussians that go through the stages together, from one place.
struct GaussianBatch {
    shift: [f64; 3],
    count: u32,
    frame: wgpu::Buffer,
    project: wgpu::BindGroup,
    /// In dispatches of some Gaussians each.
    raster: Vec<(wgpu::BindGroup, u32)>,
    /// Of those that are cut, in dispatches of fewer.
    slices: Vec<Slices>,
}

/// Gaussians that are cut along depth, so many at most.
struct Slices {
    count: u32,
    bound: wgpu::BindGroup,
    draw: wgpu::BindGroup,
}

/// A pass from coarse to fine.
struct LevelPass {
    coarsest: bool,
    groups: [u32; 2],
    bound: wgpu::BindGroup,
}

impl DepthRenderer {
    pub fn new(device: &Arc<Device>) -> Result<Self> {
        let (kernels, tones) = (Kernels::new(device), ToneMapper::new(device));
        device.check()?;
        Ok(DepthRenderer { device: device.clone(), kernels, tones })
    }

    /// Memory for pictures of `size` of these Gaussians.
    pub fn canvas(&self, gaussians: &Gaussians, size: Size) -> Result<DepthCanvas> {
        let (device, kernels) = (&*self.device, &self.kernels);
        let planes = PlaneLayout::new(size);
        let words = planes.words();
        words.iter().try_for_each(|w| device.fits(size, 4 * w))?;
        debug_assert!(planes.levels.len() <= MOST_LEVELS);
        use wgpu::BufferUsages as Use;
        let storage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let sums = words.map(|w| device.buffer("sums", 4 * w, storage));
        let [finest, coarser] = &sums;
        let tiles = device.buffer("tiles", 8 * planes.tiles, storage);
        let scale = device.buffer("scales", 8 * planes.levels.len() as u64, storage);
        let picture = device.buffer("picture", size.pixels() as u64, storage);
        // Batches are drawn one after the other, so all of them can use the same strokes.
        let largest = gaussians.chunks.iter().map(|c| u64::from(c.count)).max().unwrap_or(0);
        let strokes = device.buffer("strokes", 32 * largest, storage);
        let planes_of = device.buffer("planes", 4 * largest, storage);
        let cuts = device.buffer("cuts", 4 * largest, storage);
        let cut_count = device.buffer("cut count", 4, storage);
        let mut batches = Vec::new();
        for shift in &gaussians.shifts {
            for chunk in &gaussians.chunks {
                let frame = device.buffer("frame", size_of::<FrameRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
                let columns = &chunk.columns;
                batches.push(GaussianBatch {
                    shift: *shift,
                    count: chunk.count,
                    project: kernels
                        .project
                        .bind(device, &[&frame, columns, &strokes, &planes_of, &tiles, &cuts, &cut_count]),
                    raster: dispatches(device, chunk.count, AT_ONCE)
                        .into_iter()
                        .map(|(some, count)| {
                            let buffers = [&frame, &strokes, &planes_of, &scale, finest, coarser, &some];
                            (kernels.raster.bind(device, &buffers), count)
                        })
                        .collect(),
                    slices: dispatches(device, chunk.count, CUTS_AT_ONCE)
                        .into_iter()
                        .map(|(some, count)| {
                            let bound = [&frame, columns, &cuts, &cut_count, &tiles, &some];
                            let draw = [&frame, columns, &cuts, &cut_count, &scale, finest, coarser, &some];
                            let bound = kernels.slices_bound.bind(device, &bound);
                            Slices { count, bound, draw: kernels.slices.bind(device, &draw) }
                        })
                        .collect(),
                    frame,
                });
            }
        }
        if batches.is_empty() {
            return Err(Error::argument("no Gaussians to draw"));
        }
        let frame = &batches[0].frame;
        let steps = steps(device, kernels, &planes, [frame, &scale, finest, coarser]);
        let tone = self.tones.bind(device, [frame, &scale, finest, &picture]);
        let bound = kernels.scale.bind(device, &[frame, &tiles, &scale]);
        device.check()?;
        Ok(DepthCanvas {
            planes,
            sums,
            tiles,
            scales: scale,
            cut_count,
            picture,
            scratch: [strokes, planes_of],
            cuts,
            batches,
            scale: bound,
            steps,
            tone,
        })
    }

    /// Gives the device a picture to draw; the next one overwrites it.
    pub fn submit(&self, gaussians: &Gaussians, canvas: &DepthCanvas, view: &View, style: ToneStyle) -> Result<()> {
        let lens = self.seen(gaussians, canvas, view, style)?;
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        self.sum(&mut encoder, gaussians, canvas, &lens);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.tones.run(&mut pass, &canvas.tone, canvas.planes.size, style);
        drop(pass);
        self.device.queue.submit([encoder.finish()]);
        self.device.check()
    }

    /// The lens of a picture, once the device knows how it is to be toned.
    fn seen(&self, gaussians: &Gaussians, canvas: &DepthCanvas, view: &View, style: ToneStyle) -> Result<Lens> {
        let size = canvas.planes.size;
        let lens = Lens::optical(view, size, &gaussians.bounds)?;
        canvas.tone.set(&self.device.queue, view, style, TonePlane { size, is_sum: canvas.holds_sums() });
        Ok(lens)
    }

    /// The passes that make the finest plane the depth of the Gaussians as a lens sees them.
    pub(crate) fn sum(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        gaussians: &Gaussians,
        canvas: &DepthCanvas,
        lens: &Lens,
    ) {
        self.begin(encoder, gaussians, canvas, lens);
        // All batches share one scale, so none may be drawn before every one is bounded.
        let (one, cuts) = (canvas.batches.len() == 1, gaussians.may_be_cut(lens));
        for batch in &canvas.batches {
            encoder.clear_buffer(&canvas.cut_count, 0, None);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.project(&mut pass, batch);
            if cuts {
                self.bound_slices(&mut pass, batch);
            }
            if one {
                self.scale(&mut pass, canvas);
                self.raster(&mut pass, batch, cuts);
                self.sum_planes(&mut pass, canvas);
            }
        }
        if !one {
            // All are bounded: once more, to be drawn.
            for (k, batch) in canvas.batches.iter().enumerate() {
                encoder.clear_buffer(&canvas.cut_count, 0, None);
                let mut pass = encoder.begin_compute_pass(&Default::default());
                if k == 0 {
                    self.scale(&mut pass, canvas);
                }
                self.project(&mut pass, batch);
                self.raster(&mut pass, batch, cuts);
            }
            let mut pass = encoder.begin_compute_pass(&Default::default());
            self.sum_planes(&mut pass, canvas);
        }
    }

    /// The lens for all kernels, and sums of nothing.
    fn begin(&self, encoder: &mut wgpu::CommandEncoder, gaussians: &Gaussians, canvas: &DepthCanvas, lens: &Lens) {
        let exposure = gaussians.exposure(lens);
        let lens = &Lens { unit: lens.unit * gaussians.unit(), ..*lens };
        for batch in &canvas.batches {
            let lens = lens.shifted(batch.shift);
            let record = FrameRecord::new(&lens, gaussians.origin, &canvas.planes, batch.count, exposure);
            self.device.queue.write_buffer(&batch.frame, 0, bytemuck::bytes_of(&record));
        }
        canvas.sums.iter().for_each(|s| encoder.clear_buffer(s, 0, None));
        encoder.clear_buffer(&canvas.tiles, 0, None);
    }

    fn project(&self, pass: &mut wgpu::ComputePass<'_>, batch: &GaussianBatch) {
        self.kernels.project.run(pass, &batch.project, groups(u64::from(batch.count)));
    }

    /// The scale of each plane, once all that comes together there is bounded.
    fn scale(&self, pass: &mut wgpu::ComputePass<'_>, canvas: &DepthCanvas) {
        self.kernels.scale.run(pass, &canvas.scale, [canvas.planes.levels.len() as u32, 1]);
    }

    fn raster(&self, pass: &mut wgpu::ComputePass<'_>, batch: &GaussianBatch, cuts: bool) {
        for (bound, count) in &batch.raster {
            self.kernels.raster.run(pass, bound, groups(u64::from(*count)));
        }
        if cuts {
            self.slices(pass, batch);
        }
    }

    fn bound_slices(&self, pass: &mut wgpu::ComputePass<'_>, batch: &GaussianBatch) {
        for some in &batch.slices {
            self.kernels.slices_bound.run(pass, &some.bound, [CUT_GROUPS.min(some.count), 1]);
        }
    }

    fn slices(&self, pass: &mut wgpu::ComputePass<'_>, batch: &GaussianBatch) {
        for some in &batch.slices {
            self.kernels.slices.run(pass, &some.draw, [CUT_GROUPS.min(some.count), 1]);
        }
    }

    /// From the planes of sums to the depth of the finest.
    fn sum_planes(&self, pass: &mut wgpu::ComputePass<'_>, canvas: &DepthCanvas) {
        for step in &canvas.steps {
            let kernel = if step.coarsest { &self.kernels.pyramid_coarsest } else { &self.kernels.pyramid };
            kernel.run(pass, &step.bound, step.groups);
        }
    }

    /// The last picture that was submitted, once it is drawn.
    pub fn picture(&self, canvas: &DepthCanvas) -> Result<Gray8> {
        let size = canvas.planes.size;
        Ok(Gray8 { size, data: self.device.read(&canvas.picture, size.pixels() as u64)? })
    }

    /// The depth that the last picture was made of, before splats are widened towards the edges; not in
    /// [`ToneStyle::Paraview`], whose levels take its place.
    pub fn depth(&self, canvas: &DepthCanvas) -> Result<Plane> {
        let mut plane = self.plane(canvas)?;
        // The interpolation between planes has negative weights, so a sum can fall below 0.
        plane.data.iter_mut().for_each(|v| *v = v.max(0.0));
        Ok(plane)
    }

    /// The sum over Gaussians that were sent for their density, through its lens, with the interpolation's undershoot.
    pub fn density(&self, gaussians: &Gaussians, canvas: &DepthCanvas, lens: &Lens) -> Result<Plane> {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        self.sum(&mut encoder, gaussians, canvas, lens);
        self.device.queue.submit([encoder.finish()]);
        let (mut plane, exposure) = (self.plane(canvas)?, gaussians.exposure(lens));
        plane.data.iter_mut().for_each(|v| *v = (f64::from(*v) / exposure) as f32);
        Ok(plane)
    }

    /// The finest plane, of the picture's pixels.
    fn plane(&self, canvas: &DepthCanvas) -> Result<Plane> {
        let (size, level) = (canvas.planes.size, canvas.planes.levels[0]);
        let bytes = self.device.read(&canvas.sums[0], 4 * u64::from(level.width) * u64::from(level.rows))?;
        let words = bytes.chunks_exact(4).map(|b| [b[0], b[1], b[2], b[3]]);
        let all: Vec<f32> = if canvas.holds_sums() {
            // The only plane is never summed with others: it still holds whole numbers.
            let scale = self.device.read(&canvas.scales, 8)?;
            let down = f32::from_le_bytes([scale[4], scale[5], scale[6], scale[7]]);
            words.map(|b| u32::from_le_bytes(b) as f32 * down).collect()
        } else {
            words.map(f32::from_le_bytes).collect()
        };
        let row = |y: usize| &all[(y + PAD) * level.width as usize + PAD..][..size.width];
        Ok(Plane { size, data: (0..size.height).flat_map(row).copied().collect() })
    }

    /// A picture of a scene.
    pub fn draw(&self, gaussians: &Gaussians, canvas: &DepthCanvas, view: &View, style: ToneStyle) -> Result<Gray8> {
        self.submit(gaussians, canvas, view, style)?;
        self.picture(canvas)
    }
}

/// The passes that sum the planes.
fn steps(device: &Device, kernels: &Kernels, planes: &PlaneLayout, buffers: [&wgpu::Buffer; 4]) -> Vec<LevelPass> {
    let top = planes.levels.len() - 1;
    let small = planes.levels.iter().position(|l| l.width * l.rows <= COARSEST).unwrap_or(top).min(top);
    let step = |level: usize, coarsest: bool, is_sum: bool| {
        let target = [level as u32, u32::from(is_sum), 0, 0];
        let target = device.filled("target plane", &target, wgpu::BufferUsages::UNIFORM);
        let kernel = if coarsest { &kernels.pyramid_coarsest } else { &kernels.pyramid };
        let l = planes.levels[level];
        let groups = if coarsest { [1, 1] } else { [l.width.div_ceil(16), l.rows.div_ceil(16)] };
        LevelPass { coarsest, groups, bound: kernel.bind(device, &[&buffers[..], &[&target]].concat()) }
    };
    let fused = (small < top).then(|| step(small, true, true));
    let rest = (0..small).rev().map(|level| step(level, false, level + 1 == top));
    fused.into_iter().chain(rest).collect()
}

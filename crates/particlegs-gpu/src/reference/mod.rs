//! Pictures of all particles, as particlegs' `reference` draws them: ParaView's own in [`paraview`], and without their noise:
//!
//! | kernel | twin | what it does |
//! |---|---|---|
//! | splats.wgsl | `reference::project`, `reference::depth` | particles to splats, in VTK's float32 |
//! | deposit.wgsl | `reference::deposit` | what a splat adds to the depth of a pixel |
//!
//! Particles come in pieces: those that fit stay on the device from picture to picture, others are sent anew.

pub mod paraview;
mod pictures;
mod source;

pub use pictures::ParticlePictures;
pub use source::{ParticleSource, ParticleStream};

use crate::kernel::{BufferUse, Kernel};
use crate::render::{FrameRecord, PlaneLayout, Tone, ToneMapper, TonePlane};
use crate::{Device, groups};
use bytemuck::{Pod, Zeroable};
use particlegs_core::camera::{Projection, View};
use particlegs_core::math::each_axis;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::splat::{CUT_SIGMA, LARGEST_MEAN_ALPHA, ToneStyle, erf};
use particlegs_core::{Error, Hint, Result};
use std::sync::Arc;

/// Particles of a piece at most: 128 MiB of positions, which every GPU can bind.
pub const MOST: usize = 128 * 1024 * 1024 / 12;
/// Pixels that a dispatch may reach, in thousands: well below a second of work on a slow GPU.
const THOUSANDS: u64 = 2_000_000;
/// Pixels that a piece may reach, in thousands: hours of work; the CPU uses coarser planes instead.
const MOST_THOUSANDS: u64 = 1 << 31;
/// Intervals of the table of the Gaussian's integral from -3 to +3.
const STEPS: usize = 4096;

/// Particles on a device.
pub struct DeviceParticles {
    positions: wgpu::Buffer,
    count: u32,
}

impl DeviceParticles {
    /// Positions in columns of one length, relative to an origin that all pieces share.
    pub fn upload(device: &Device, columns: [&[f32]; 3]) -> Result<DeviceParticles> {
        let n = columns[0].len();
        if n > MOST || columns.iter().any(|c| c.len() != n) {
            return Err(Error::argument(format!("a piece has {n} particles; at most {MOST} are supported")));
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let positions = device.buffer("positions", 12 * n as u64, usage);
        for (k, column) in columns.iter().enumerate() {
            device.queue.write_buffer(&positions, (4 * k * n) as u64, bytemuck::cast_slice(column));
        }
        device.check()?;
        Ok(DeviceParticles { positions, count: n as u32 })
    }
}

/// Draws all particles on a device.
pub struct ReferenceRenderer {
    device: Arc<Device>,
    count: Kernel,
    deposit: Kernel,
    collect: Kernel,
    integrals: wgpu::Buffer,
    tones: ToneMapper,
}

/// The memory of pictures of one size.
pub struct ReferenceCanvas {
    size: Size,
    /// Low words of all pixels, and high ones.
    sums: [wgpu::Buffer; 2],
    view: wgpu::Buffer,
    work: wgpu::Buffer,
    collect: wgpu::BindGroup,
    picture: wgpu::Buffer,
    tone: Tone,
}

/// A picture to which particles are added.
pub struct Sum<'a> {
    reference: &'a ReferenceRenderer,
    canvas: &'a ReferenceCanvas,
    view: &'a View,
    record: ViewRecord,
}

impl ReferenceRenderer {
    pub fn new(device: &Arc<Device>) -> Result<Self> {
        const VIEW: &str = include_str!("view.wgsl");
        let frame = include_str!("../render/frame.wgsl");
        let [main, splats, deposit] =
            [include_str!("deposit_main.wgsl"), include_str!("splats.wgsl"), include_str!("deposit.wgsl")];
        let uses = [BufferUse::Uniform, BufferUse::Read, BufferUse::Read, BufferUse::Write, BufferUse::Write];
        let share = include_str!("../share.wgsl");
        let count_main = include_str!("count_main.wgsl");
        let uses_of_count = [BufferUse::Uniform, BufferUse::Read, BufferUse::Write];
        let count = Kernel::new(device, "work", &[count_main, VIEW, splats], &uses_of_count);
        let deposit = Kernel::new(device, "particles", &[main, VIEW, splats, deposit, share], &uses);
        let collect = Kernel::new(
            device,
            "depth of particles",
            &[include_str!("collect_main.wgsl"), VIEW, frame],
            &[BufferUse::Uniform, BufferUse::Read, BufferUse::Read, BufferUse::Uniform, BufferUse::Write],
        );
        let integrals = device.filled("integrals", &integrals(), wgpu::BufferUsages::STORAGE);
        let tones = ToneMapper::new(device);
        device.check()?;
        Ok(ReferenceRenderer { device: device.clone(), count, deposit, collect, integrals, tones })
    }

    /// Memory for pictures of a size.
    pub fn canvas(&self, size: Size) -> Result<ReferenceCanvas> {
        let (device, bytes, planes) = (&*self.device, 4 * size.pixels() as u64, PlaneLayout::new(size));
        let [finest, _] = planes.words();
        device.fits(size, 4 * finest)?;
        use wgpu::BufferUsages as Use;
        let here = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let sums = ["low words", "high words"].map(|label| device.buffer(label, bytes, here));
        let [low, high] = &sums;
        let view = device.buffer("view", size_of::<ViewRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        let work = device.buffer("work", 8, Use::STORAGE | Use::COPY_DST | Use::COPY_SRC);
        let frame = device.filled("frame", &[FrameRecord::of_planes(&planes)], Use::UNIFORM);
        let plane = device.buffer("depth", 4 * finest, Use::STORAGE);
        let scale = device.buffer("scale", 8, Use::STORAGE);
        let picture = device.buffer("picture", size.pixels() as u64, Use::STORAGE | Use::COPY_SRC);
        let collect = self.collect.bind(device, &[&view, low, high, &frame, &plane]);
        let tone = self.tones.bind(device, [&frame, &scale, &plane, &picture]);
        device.check()?;
        Ok(ReferenceCanvas { size, sums, view, work, collect, picture, tone })
    }

    /// Begins a picture; `origin` is the particles', `range` the distances between which they are drawn.
    pub fn begin<'a>(
        &'a self,
        canvas: &'a ReferenceCanvas,
        view: &'a View,
        origin: [f64; 3],
        range: [f64; 2],
    ) -> Result<Sum<'a>> {
        let record = ViewRecord::new(view, canvas.size, origin, range)?;
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        canvas.sums.iter().for_each(|s| encoder.clear_buffer(s, 0, None));
        self.device.queue.submit([encoder.finish()]);
        Ok(Sum { reference: self, canvas, view, record })
    }
}

impl Sum<'_> {
    /// Adds particles, in as many dispatches as they are work.
    pub fn add(&mut self, points: &DeviceParticles) -> Result<()> {
        let work = self.work(points)?;
        if work > MOST_THOUSANDS {
            let (name, radius) = (&self.view.name, self.view.radius);
            let message = format!("view `{name}`: splats of radius {radius} cover too many pixels");
            return Err(Error::argument_with(message, Hint::use_cpu()));
        }
        let pieces = work.div_ceil(THOUSANDS).max(1) as u32;
        let each = points.count.div_ceil(pieces);
        let (r, canvas) = (self.reference, self.canvas);
        let [low, high] = &canvas.sums;
        let bound = r.deposit.bind(&r.device, &[&canvas.view, &points.positions, &r.integrals, low, high]);
        // `each` is 0 if there are no particles, and a range cannot step by 0.
        for first in (0..points.count).step_by(each.max(1) as usize) {
            let last = points.count.min(first + each);
            let record = ViewRecord { first, last, ..self.record };
            self.run(&r.deposit, &bound, record, last - first);
        }
        r.device.check()
    }

    /// Thousands of pixels that particles reach.
    fn work(&mut self, points: &DeviceParticles) -> Result<u64> {
        let (r, canvas) = (self.reference, self.canvas);
        self.record.count = points.count;
        r.device.queue.write_buffer(&canvas.work, 0, &[0; 8]);
        let bound = r.count.bind(&r.device, &[&canvas.view, &points.positions, &canvas.work]);
        self.run(&r.count, &bound, self.record, points.count);
        let bytes = r.device.read(&canvas.work, 8)?;
        Ok(u64::from_le_bytes(bytes.try_into().expect("eight bytes")))
    }

    fn run(&self, kernel: &Kernel, bound: &wgpu::BindGroup, record: ViewRecord, threads: u32) {
        let (device, canvas) = (&self.reference.device, self.canvas);
        device.queue.write_buffer(&canvas.view, 0, bytemuck::bytes_of(&record));
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.run(&mut pass, bound, groups(u64::from(threads)));
        drop(pass);
        device.queue.submit([encoder.finish()]);
    }

    /// The picture in a look's tone curve; of ParaView's looks the mean without noise.
    pub fn finish(self, style: ToneStyle) -> Result<Gray8> {
        let (r, canvas) = (self.reference, self.canvas);
        let plane = TonePlane { size: canvas.size, is_sum: false };
        canvas.tone.set(&r.device.queue, self.view, style, plane);
        let mut encoder = r.device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        r.collect.run(&mut pass, &canvas.collect, groups(canvas.size.pixels() as u64));
        r.tones.run(&mut pass, &canvas.tone, canvas.size, style);
        drop(pass);
        r.device.queue.submit([encoder.finish()]);
        let data = r.device.read(&canvas.picture, canvas.size.pixels() as u64)?;
        Ok(Gray8 { size: canvas.size, data })
    }

    pub fn depth(self) -> Result<Plane> {
        let words = |buffer: &wgpu::Buffer| -> Result<Vec<u32>> {
            let bytes = self.reference.device.read(buffer, 4 * self.canvas.size.pixels() as u64)?;
            Ok(bytemuck::pod_collect_to_vec(&bytes))
        };
        let [low, high] = &self.canvas.sums;
        let (low, high) = (words(low)?, words(high)?);
        let whole = low.iter().zip(&high).map(|(low, high)| u64::from(*high) << 32 | u64::from(*low));
        let data = whole.map(|v| (v as f64 / f64::from(self.record.scale)) as f32).collect();
        Ok(Plane { size: self.canvas.size, data })
    }
}

/// The integral of exp(-t^2/2) from -3 on, at even steps to 3, and once more at its end.
fn integrals() -> Vec<f32> {
    let (root, half) = ((0.5 * std::f64::consts::PI).sqrt(), std::f64::consts::FRAC_1_SQRT_2);
    let at = |k: usize| CUT_SIGMA * (2.0 * k as f64 / STEPS as f64 - 1.0);
    // Kernels interpolate with the next entry, so the last interval needs one entry more.
    (0..=STEPS + 1).map(|k| (root * (erf(at(k.min(STEPS)) * half) + erf(CUT_SIGMA * half))) as f32).collect()
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct ViewRecord {
    rows: [[f32; 4]; 3],
    projection: [f32; 4],
    size: [u32; 2],
    radius: f32,
    opacity: f32,
    scale: f32,
    count: u32,
    first: u32,
    last: u32,
    nothing: u32,
    pad: u32,
    strip: [u32; 2],
}

impl ViewRecord {
    /// For positions about `origin`: the camera is moved in f64, and matrices are rounded last.
    fn new(view: &View, size: Size, origin: [f64; 3], [near, far]: [f64; 2]) -> Result<ViewRecord> {
        view.check(size)?;
        let Projection::Perspective { fov_deg } = view.camera.projection else {
            let name = &view.name;
            return Err(Error::argument(format!("view `{name}`: drawing all particles needs a perspective camera")));
        };
        let frame = view.camera.frame()?;
        let eye: [f64; 3] = each_axis(|k| frame.position[k] - origin[k]);
        let row = |r: [f64; 3]| {
            let shift = -(r[0] * eye[0] + r[1] * eye[1] + r[2] * eye[2]);
            [r[0] as f32, r[1] as f32, r[2] as f32, shift as f32]
        };
        let t = (0.5 * fov_deg.to_radians()).tan();
        // In the order of `particlegs_reference::project`, whose bits these are.
        let p00 = 1.0 / (t * size.width as f64 / size.height as f64);
        let projection = [p00, 1.0 / t, -(far + near) / (far - near), -2.0 * far * near / (far - near)];
        // The most that one splat adds to a pixel is less than 2^32 of the units.
        let most = -(1.0 - view.opacity.min(LARGEST_MEAN_ALPHA)).ln();
        let scale = f64::exp2((30.0 - most.log2()).floor());
        Ok(ViewRecord {
            rows: frame.axes.map(row),
            projection: projection.map(|v| v as f32),
            size: [size.width as u32, size.height as u32],
            radius: view.radius as f32,
            opacity: view.opacity as f32,
            scale: scale as f32,
            count: 0,
            first: 0,
            last: 0,
            nothing: 0,
            pad: 0,
            strip: [0, size.height as u32],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{columns, device, particles, view};
    use particlegs_core::camera::clipping_range;
    use particlegs_core::context::Context;
    use particlegs_reference as reference;

    /// Splats below a pixel, of some pixels, large and turned; faint and opaque; in one piece and in several.
    #[test]
    #[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
    fn kernels_agree_with_their_twins() {
        let device = device();
        let renderer = ReferenceRenderer::new(&device).unwrap();
        let (columns, size) = (columns(4000), Size { width: 320, height: 180 });
        let particles = particles(&columns);
        let cpu_reference = reference::Reference::new(&particles);
        let canvas = renderer.canvas(size).unwrap();
        for (position, radius, opacity) in [
            ([1.0, 2.0, 6.0], 0.002, 0.05),
            ([1.0, 2.0, 6.0], 0.02, 0.05),
            ([1.0, 2.0, 6.0], 0.02, 0.9),
            ([1.0, 2.0, 6.0], 0.1, 0.3),
            ([0.3, 0.2, 0.9], 0.01, 0.05),
            ([0.3, 0.2, 0.9], 0.05, 0.2),
        ] {
            let view = view(position, [radius, opacity]);
            let range = clipping_range(cpu_reference.bounds(), &view.camera);
            let tau = cpu_reference.optical_depth(&view, size, &Context::SILENT).unwrap();
            let mut whole = None;
            for pieces in [1, 3] {
                let begin = || renderer.begin(&canvas, &view, [0.0; 3], range).unwrap();
                let add = |sum: &mut Sum<'_>| {
                    let n = 4000usize.div_ceil(pieces);
                    for k in 0..pieces {
                        let piece = columns.each_ref().map(|c| &c[k * n..4000.min((k + 1) * n)]);
                        sum.add(&DeviceParticles::upload(&device, piece).unwrap()).unwrap();
                    }
                };
                let mut sum = begin();
                add(&mut sum);
                let depth = sum.depth().unwrap();
                let level = |t: f32| 255.0 * (1.0 - f64::from(-t).exp());
                let apart = depth.data.iter().zip(&tau.data).map(|(a, b)| (level(*a) - level(*b)).abs());
                let worst = apart.fold(0.0, f64::max);
                println!("{position:?} radius {radius} opacity {opacity}: largest {worst:.4} levels");
                assert!(worst < 0.1, "{position:?} radius {radius} opacity {opacity}: largest {worst:.4} levels");
                assert!(whole.get_or_insert_with(|| depth.data.clone()) == &depth.data, "pieces show");
                for style in ToneStyle::ALL {
                    let mut sum = begin();
                    add(&mut sum);
                    let (a, b) = (
                        sum.finish(style).unwrap(),
                        cpu_reference.response(&view, size, style, &Context::SILENT).unwrap(),
                    );
                    let apart = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                    assert!(apart <= 1, "{}: largest {apart}", style.name());
                }
            }
        }
    }

    /// The largest usual picture is drawn where a GPU binds no more than 128 MiB at once.
    #[test]
    #[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
    fn a_picture_of_8k_is_drawn() {
        let device = device();
        let renderer = ReferenceRenderer::new(&device).unwrap();
        let (columns, size) = (columns(1000), Size { width: 7680, height: 4320 });
        let view = view([1.0, 2.0, 6.0], [0.002, 0.05]);
        let particles = particles(&columns);
        let cpu_reference = reference::Reference::new(&particles);
        let canvas = renderer.canvas(size).unwrap();
        let mut sum =
            renderer.begin(&canvas, &view, [0.0; 3], clipping_range(cpu_reference.bounds(), &view.camera)).unwrap();
        sum.add(&DeviceParticles::upload(&device, columns.each_ref().map(|c| &c[..])).unwrap()).unwrap();
        let (a, b) = (
            sum.finish(ToneStyle::Expected).unwrap(),
            cpu_reference.response(&view, size, ToneStyle::Expected, &Context::SILENT).unwrap(),
        );
        assert!(b.data.iter().any(|v| *v > 0) && a.data.iter().zip(&b.data).all(|(a, b)| a.abs_diff(*b) <= 1));
    }
}

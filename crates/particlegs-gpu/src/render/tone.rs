//! Depth to grey levels: tone.wgsl and what it reads.

use super::kernels::sources::{FRAME, SCALE, TONE};
use crate::kernel::{BufferUse, FOUR_LEVELS, Kernel};
use crate::{Device, groups};
use particlegs_core::camera::View;
use particlegs_core::picture::Size;
use particlegs_core::splat::{FxaaMean, Response, ToneStyle, fxaa_blur};
use std::sync::{Mutex, PoisonError};

/// Entries of the curve but the last: its depths are 2^e (1 + k/64), e from -14 to 3.
pub(crate) const CURVE: u64 = 18 * 64;

pub(crate) struct ToneMapper {
    levels: Kernel,
    tone: Kernel,
}

/// Bind groups and buffers of the two kernels.
pub(crate) struct Tone {
    look: wgpu::Buffer,
    blur: wgpu::Buffer,
    curve: wgpu::Buffer,
    levels: wgpu::BindGroup,
    plain: wgpu::BindGroup,
    blurred: wgpu::BindGroup,
    /// The opacity, radius in pixels and look that the curve is of.
    of: Mutex<Option<([u64; 2], ToneStyle)>>,
}

/// The plane that levels are made of.
#[derive(Clone, Copy)]
pub(crate) struct TonePlane {
    pub size: Size,
    /// Whether it still holds whole numbers.
    pub is_sum: bool,
}

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct ToneStyleRecord {
    kind: u32,
    tap: f32,
    is_sum: u32,
    pad: u32,
}

impl ToneStyleRecord {
    /// Of a look, for levels that are not blurred.
    pub fn sharp(style: ToneStyle, is_sum: bool) -> ToneStyleRecord {
        ToneStyleRecord { kind: u32::from(style != ToneStyle::Expected), tap: 0.0, is_sum: u32::from(is_sum), pad: 0 }
    }
}

impl ToneMapper {
    /// Compiled for a device.
    pub fn new(device: &Device) -> ToneMapper {
        use BufferUse::{Read, Uniform, Write};
        let new = |label, main: &[&str]| {
            let uses = [Uniform, Read, Write, Uniform, Read, Write];
            Kernel::new(device, label, &[&[TONE, FRAME, SCALE], main].concat(), &uses)
        };
        ToneMapper {
            levels: new("levels", &[include_str!("tone_levels_main.wgsl")]),
            tone: new("tone", &[include_str!("tone_main.wgsl"), FOUR_LEVELS]),
        }
    }

    /// With the frame, the scale of sums, the plane of depth, and the picture.
    pub fn bind(&self, device: &Device, [frame, scale, plane, picture]: [&wgpu::Buffer; 4]) -> Tone {
        use wgpu::BufferUsages as Use;
        let look = device.buffer("look", 16, Use::UNIFORM | Use::COPY_DST);
        let blur = device.buffer("blur", 16, Use::UNIFORM | Use::COPY_DST);
        let curve = device.buffer("curve", 4 * (CURVE + 1), Use::STORAGE | Use::COPY_DST);
        let bind = |kernel: &Kernel, look| kernel.bind(device, &[frame, scale, plane, look, &curve, picture]);
        Tone {
            levels: bind(&self.levels, &look),
            plain: bind(&self.tone, &look),
            blurred: bind(&self.tone, &blur),
            look,
            blur,
            curve,
            of: Mutex::default(),
        }
    }

    /// Makes the levels of a picture.
    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, tone: &Tone, size: Size, style: ToneStyle) {
        let pixels = size.pixels() as u64;
        let words = groups(pixels.div_ceil(4));
        if style == ToneStyle::Paraview {
            self.levels.run(pass, &tone.levels, groups(pixels));
            self.tone.run(pass, &tone.blurred, words);
        } else {
            self.tone.run(pass, &tone.plain, words);
        }
    }
}

impl Tone {
    /// The look's records, and its curve where it is not there yet.
    pub fn set(&self, queue: &wgpu::Queue, view: &View, style: ToneStyle, plane: TonePlane) {
        let radius_px = view.radius_pixels(plane.size);
        let key = ([view.opacity.to_bits(), radius_px.to_bits()], style);
        // The CPU takes a millisecond for a curve, so the last one is used again where it fits.
        if self.of.lock().unwrap_or_else(PoisonError::into_inner).replace(key) == Some(key) {
            return;
        }
        queue.write_buffer(&self.look, 0, bytemuck::bytes_of(&ToneStyleRecord::sharp(style, plane.is_sum)));
        if style == ToneStyle::Paraview {
            let tap = fxaa_blur(view.opacity, radius_px);
            queue.write_buffer(&self.blur, 0, bytemuck::bytes_of(&ToneStyleRecord { kind: 2, tap, is_sum: 0, pad: 0 }));
        }
        if style != ToneStyle::Expected {
            let curve = curve(view.opacity, (style == ToneStyle::Paraview).then_some(radius_px));
            queue.write_buffer(&self.curve, 0, bytemuck::cast_slice(&curve));
        }
    }
}

/// Levels at the depths of the response's table; with what FXAA makes of means where a radius is given.
pub(crate) fn curve(opacity: f64, radius_px: Option<f64>) -> Vec<f32> {
    let response = Response::new(opacity);
    let mean = radius_px.map(|r| FxaaMean::new(opacity, r));
    // 113 is the exponent of 2^-14; a step of 2^17 changes the upper six bits of the fraction.
    let depth = |i: usize| f32::from_bits((113 << 23) + ((i as u32) << 17));
    let ratio = |i: usize| mean.as_ref().map_or(1.0, |m| m.ratio(depth(i)));
    response.levels().iter().enumerate().map(|(i, level)| level * ratio(i)).collect()
}

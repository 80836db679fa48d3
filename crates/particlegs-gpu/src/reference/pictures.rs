//! Pictures of one snapshot.

use super::paraview::{self, Paraview};
use super::source::{CancellableSource, ParticleSource, ParticleStream};
use super::{ReferenceCanvas, ReferenceRenderer, Sum};
use crate::Device;
use particlegs_core::Result;
use particlegs_core::camera::{View, clipping_range};
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::Renderer;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_train::ParticleInput;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A snapshot drawn on a device at whatever size, one picture at a time.
pub struct ParticlePictures<'a> {
    reference: ReferenceRenderer,
    paraview: Paraview,
    origin: [f64; 3],
    bounds: Bounds,
    snapshot: ParticleStream<'a>,
    // What the last pictures were drawn on.
    sums: Mutex<Option<ReferenceCanvas>>,
    layers: Mutex<Option<paraview::ParaviewCanvas>>,
}

impl<'a> ParticlePictures<'a> {
    /// None of the particles is on the device yet.
    pub fn new(device: &Arc<Device>, input: ParticleInput<'a>) -> Result<Self> {
        let ParticleInput { origin, bounds, count, columns } = input;
        Ok(ParticlePictures {
            reference: ReferenceRenderer::new(device)?,
            paraview: Paraview::new(device)?,
            origin,
            bounds,
            snapshot: ParticleStream::new(device, count, columns),
            sums: Mutex::default(),
            layers: Mutex::default(),
        })
    }

    /// Keeps on the device the particles that half of its memory holds; the others are sent anew for every picture.
    pub fn keep(&mut self, device: &Device, sent: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        self.snapshot.keep(device.room(), sent)
    }

    /// Keeps all of them on the device.
    pub fn keep_all(&mut self, sent: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        self.snapshot.keep(u64::MAX, sent)
    }

    fn summed<T>(
        &self,
        view: &View,
        size: Size,
        context: &Context<'_>,
        finish: impl FnOnce(Sum<'_>) -> Result<T>,
    ) -> Result<T> {
        let mut slot = lock(&self.sums);
        let canvas = match slot.take() {
            Some(canvas) if canvas.size == size => canvas,
            other => {
                // The old canvas is freed before the new one takes memory.
                drop(other);
                self.reference.canvas(size)?
            }
        };
        let mut sum = self.reference.begin(&canvas, view, self.origin, self.range(view))?;
        CancellableSource { source: &self.snapshot, context }.each(&mut |points| sum.add(points))?;
        let drawn = finish(sum)?;
        *slot = Some(canvas);
        Ok(drawn)
    }

    fn range(&self, view: &View) -> [f64; 2] {
        view.camera.clipping_range.unwrap_or_else(|| clipping_range(&self.bounds, &view.camera))
    }
}

impl Renderer for ParticlePictures<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        let fxaa = match style {
            ToneStyle::Expected => return self.response(view, size, style, context),
            ToneStyle::ParaviewNoFxaa => false,
            ToneStyle::Paraview => true,
        };
        let mut slot = lock(&self.layers);
        let canvas = match slot.take() {
            Some(canvas) if canvas.size() == size => canvas,
            other => {
                drop(other);
                self.paraview.canvas(size)?
            }
        };
        let shot = self.paraview.shot(&canvas, view, self.origin, self.range(view))?;
        let drawn = shot.draw(&CancellableSource { source: &self.snapshot, context }, fxaa)?;
        *slot = Some(canvas);
        Ok(drawn)
    }

    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        self.summed(view, size, context, |sum| sum.finish(style))
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.summed(view, size, context, |sum| sum.depth())
    }
}

/// A canvas that a panic left is whole: pictures begin by clearing it.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

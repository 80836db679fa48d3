//! What a run learns from, drawn on the device.

use crate::Device;
use crate::reference::Pictures;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_train::TrainingSubject;
use std::ops::Range;
use std::sync::Arc;

/// Bytes a pixel that a kernel sees at once of pictures of all particles: 4, and their edges.
const A_PIXEL: u64 = 5;

/// Particles whose pictures the device draws, where it holds them; larger ones are the processor's, which are the same.
pub(super) struct DeviceSubject<'a> {
    of: &'a dyn TrainingSubject,
    device: Arc<Device>,
    pictures: Pictures<'a>,
}

impl<'a> DeviceSubject<'a> {
    /// Sends the particles, as many as there is room for.
    pub fn new(device: &Arc<Device>, of: &'a dyn TrainingSubject, context: &Context<'_>) -> Result<Self> {
        let columns = Box::new(move |range: Range<usize>| of.columns(range));
        let mut pictures = Pictures::new(device, of.origin(), of.bounds(), of.len(), columns)?;
        pictures.keep(device, &mut |_| if context.cancelled() { Err(Error::Cancelled) } else { Ok(()) })?;
        Ok(DeviceSubject { of, device: device.clone(), pictures })
    }

    fn holds(&self, size: Size) -> bool {
        self.device.fits(size, A_PIXEL * size.pixels() as u64).is_ok()
    }
}

impl TrainingSubject for DeviceSubject<'_> {
    fn len(&self) -> usize {
        self.of.len()
    }

    fn position(&self, i: usize) -> [f64; 3] {
        self.of.position(i)
    }

    fn origin(&self) -> [f64; 3] {
        self.of.origin()
    }

    fn columns(&self, range: Range<usize>) -> [Vec<f32>; 3] {
        self.of.columns(range)
    }

    fn bounds(&self) -> Bounds {
        self.of.bounds()
    }

    fn draw(&self, view: &View, size: Size, look: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        if self.holds(size) {
            return self.pictures.draw(view, size, look, context);
        }
        self.of.draw(view, size, look, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        if self.holds(size) {
            return self.pictures.optical_depth(view, size, context);
        }
        self.of.optical_depth(view, size, context)
    }
}

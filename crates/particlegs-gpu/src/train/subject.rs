//! The subject that a run learns from, drawn on the device.

use crate::Device;
use crate::reference::ParticlePictures;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::Renderer;
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_train::{ParticleInput, TrainingSubject};
use std::ops::Range;
use std::sync::Arc;

/// Bytes a pixel that a kernel sees at once of pictures of all particles: 4, and their edges.
const A_PIXEL: u64 = 5;

/// Particles whose pictures the device draws if they fit; otherwise the CPU draws the same pictures.
pub(crate) struct DeviceSubject<'a> {
    of: &'a dyn TrainingSubject,
    device: Arc<Device>,
    pictures: ParticlePictures<'a>,
}

impl<'a> DeviceSubject<'a> {
    /// Sends the particles, as many as there is room for.
    pub fn new(device: &Arc<Device>, subject: &'a dyn TrainingSubject, context: &Context<'_>) -> Result<Self> {
        let columns = Box::new(move |range| subject.columns(range));
        let input = ParticleInput { origin: subject.origin(), bounds: subject.bounds(), count: subject.len(), columns };
        let mut pictures = ParticlePictures::new(device, input)?;
        pictures.keep(device, &mut |_| context.check())?;
        Ok(DeviceSubject { of: subject, device: device.clone(), pictures })
    }

    fn holds(&self, size: Size) -> bool {
        self.device.fits(size, A_PIXEL * size.pixels() as u64).is_ok()
    }
}

impl Renderer for DeviceSubject<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        if self.holds(size) {
            return self.pictures.draw(view, size, style, context);
        }
        self.of.draw(view, size, style, context)
    }

    fn response(&self, view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<Gray8> {
        if self.holds(size) {
            return self.pictures.response(view, size, style, context);
        }
        self.of.response(view, size, style, context)
    }

    fn optical_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        if self.holds(size) {
            return self.pictures.optical_depth(view, size, context);
        }
        self.of.optical_depth(view, size, context)
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
}

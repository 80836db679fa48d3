//! Pictures of one scene.

use super::{Canvas, Gaussians, Renderer};
use crate::Device;
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::lens::Lens;
use particlegs_core::render::{Scene, depth};
use particlegs_core::splat::Look;
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device, drawn at whatever size, one picture at a time.
pub struct Pictures {
    renderer: Renderer,
    gaussians: Gaussians,
    canvas: Mutex<Option<Canvas>>,
}

impl Pictures {
    /// Of a scene of the optical-depth law.
    ///
    /// # Errors
    /// Those of [`Gaussians::upload`].
    pub fn new(device: &Arc<Device>, scene: &Scene) -> Result<Pictures> {
        let (renderer, gaussians) = (Renderer::new(device)?, Gaussians::upload(device, scene)?);
        Ok(Pictures { renderer, gaussians, canvas: Mutex::default() })
    }

    /// A picture.
    ///
    /// # Errors
    /// Those of [`Renderer::canvas`] and [`Renderer::submit`].
    pub fn draw(&self, view: &View, size: Size, look: Look) -> Result<Gray8> {
        if self.gaussians.is_empty() {
            return Ok(Gray8::black(size));
        }
        self.on_canvas(size, |canvas| self.renderer.draw(&self.gaussians, canvas, view, look))
    }

    /// The optical depth.
    ///
    /// # Errors
    /// As [`Pictures::draw`].
    pub fn optical_depth(&self, view: &View, size: Size) -> Result<Plane> {
        if self.gaussians.is_empty() {
            return Ok(Plane::zeros(size));
        }
        let mut tau = self.on_canvas(size, |canvas| {
            self.renderer.submit(&self.gaussians, canvas, view, Look::Expected)?;
            self.renderer.depth(canvas)
        })?;
        let lens = Lens::optical(view, size, &self.gaussians.bounds)?;
        if lens.perspective {
            depth::grow(&mut tau, &lens);
        }
        Ok(tau)
    }

    /// Draws on the memory of the picture before, where that had the same size.
    fn on_canvas<T>(&self, size: Size, draw: impl FnOnce(&Canvas) -> Result<T>) -> Result<T> {
        let mut kept = self.canvas.lock().unwrap_or_else(PoisonError::into_inner);
        let canvas = match kept.take() {
            Some(canvas) if canvas.planes.size == size => canvas,
            other => {
                // The old one goes before the new one comes.
                drop(other);
                self.renderer.canvas(&self.gaussians, size)?
            }
        };
        let drawn = draw(&canvas)?;
        *kept = Some(canvas);
        Ok(drawn)
    }
}

//! Pictures of one snapshot.

use super::{Canvas, MOST, Points, Reference};
use crate::Device;
use particlegs_core::Result;
use particlegs_core::camera::{View, clipping_range};
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::space::Bounds;
use particlegs_core::splat::Look;
use std::sync::{Arc, Mutex, PoisonError};

/// A snapshot on a device, drawn at whatever size, one picture at a time.
pub struct Pictures {
    device: Arc<Device>,
    reference: Reference,
    origin: [f64; 3],
    bounds: Bounds,
    pieces: Vec<Points>,
    canvas: Mutex<Option<Canvas>>,
}

impl Pictures {
    /// Of particles about `origin`, which are yet to come, with these bounds.
    ///
    /// # Errors
    /// Those of [`Reference::new`].
    pub fn new(device: &Arc<Device>, origin: [f64; 3], bounds: Bounds) -> Result<Pictures> {
        let reference = Reference::new(device)?;
        Ok(Pictures { device: device.clone(), reference, origin, bounds, pieces: Vec::new(), canvas: Mutex::default() })
    }

    /// Takes more particles, in columns of one length.
    ///
    /// # Errors
    /// Those of [`Points::upload`].
    pub fn take(&mut self, columns: [&[f32]; 3]) -> Result<()> {
        for first in (0..columns[0].len()).step_by(MOST) {
            let piece = columns.map(|c| &c[first..c.len().min(first + MOST)]);
            self.pieces.push(Points::upload(&self.device, piece)?);
        }
        // What was given to the queue is on the device before more is.
        self.device.wait()
    }

    /// The noise-free picture in a look.
    ///
    /// # Errors
    /// Those of [`Reference::canvas`], [`Reference::begin`] and [`super::Sum::add`].
    pub fn draw(&self, view: &View, size: Size, look: Look) -> Result<Gray8> {
        let mut kept = self.canvas.lock().unwrap_or_else(PoisonError::into_inner);
        let canvas = match kept.take() {
            Some(canvas) if canvas.size == size => canvas,
            other => {
                drop(other);
                self.reference.canvas(size)?
            }
        };
        let range = view.camera.clipping_range.unwrap_or_else(|| clipping_range(&self.bounds, &view.camera));
        let mut sum = self.reference.begin(&canvas, view, self.origin, range)?;
        self.pieces.iter().try_for_each(|piece| sum.add(piece))?;
        let drawn = sum.finish(look)?;
        *kept = Some(canvas);
        Ok(drawn)
    }
}

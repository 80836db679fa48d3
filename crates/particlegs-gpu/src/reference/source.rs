//! Particles on their way to a picture.

use super::{DeviceParticles, MOST};
use crate::Device;
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_train::ColumnReader;
use std::sync::Arc;

/// Particles, piece by piece in their order, as often as a picture asks for them.
pub trait ParticleSource {
    /// Calls `work` with every piece.
    fn each(&self, work: &mut dyn FnMut(&DeviceParticles) -> Result<()>) -> Result<()>;
}

/// Pieces that are on the device.
impl ParticleSource for Vec<DeviceParticles> {
    fn each(&self, work: &mut dyn FnMut(&DeviceParticles) -> Result<()>) -> Result<()> {
        self.iter().try_for_each(work)
    }
}

/// A snapshot's particles: the first pieces stay on the device, the others are sent whenever they are asked for.
pub struct ParticleStream<'a> {
    device: Arc<Device>,
    count: usize,
    columns: ColumnReader<'a>,
    /// Particles of a piece.
    each: usize,
    kept: Vec<DeviceParticles>,
}

impl<'a> ParticleStream<'a> {
    /// Of `count` particles, none of which is on the device.
    pub fn new(device: &Arc<Device>, count: usize, columns: ColumnReader<'a>) -> Self {
        ParticleStream { device: device.clone(), count, columns, each: MOST, kept: Vec::new() }
    }

    /// In pieces of at most so many particles.
    #[cfg(test)]
    pub(super) fn in_pieces(self, each: usize) -> Self {
        ParticleStream { each, ..self }
    }

    /// Keeps as many pieces on the device as `bytes` hold; `sent` hears how many particles each has.
    pub fn keep(&mut self, bytes: u64, sent: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        let fit = (bytes / (12 * self.each as u64)) as usize;
        for piece in self.kept.len()..fit.min(self.pieces()) {
            let points = self.send(piece)?;
            sent(u64::from(points.count))?;
            self.kept.push(points);
        }
        Ok(())
    }

    fn pieces(&self) -> usize {
        self.count.div_ceil(self.each)
    }

    fn send(&self, piece: usize) -> Result<DeviceParticles> {
        let first = piece * self.each;
        let columns = (self.columns)(first..self.count.min(first + self.each));
        let points = DeviceParticles::upload(&self.device, columns.each_ref().map(Vec::as_slice))?;
        // What was given to the queue is on the device before more is.
        self.device.wait()?;
        Ok(points)
    }
}

impl ParticleSource for ParticleStream<'_> {
    fn each(&self, work: &mut dyn FnMut(&DeviceParticles) -> Result<()>) -> Result<()> {
        self.kept.iter().try_for_each(&mut *work)?;
        for piece in self.kept.len()..self.pieces() {
            work(&self.send(piece)?)?;
            // Its memory is free before the next piece comes.
            self.device.wait()?;
        }
        Ok(())
    }
}

/// A source whose user may want to stop.
pub(super) struct CancellableSource<'a> {
    pub source: &'a dyn ParticleSource,
    pub context: &'a Context<'a>,
}

impl ParticleSource for CancellableSource<'_> {
    fn each(&self, work: &mut dyn FnMut(&DeviceParticles) -> Result<()>) -> Result<()> {
        self.source.each(&mut |points| {
            self.context.check()?;
            work(points)
        })
    }
}

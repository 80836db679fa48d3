//! Snapshots on a graphics card, alone and beside their models.

use super::card::{Columns, Device, ParticlePictures, Pictures};
use crate::common::CommandContext;
use particlegs::Result;
use particlegs::camera::View;
use particlegs::context::Context;
use particlegs::particles::Particles;
use particlegs::picture::{Gray8, Plane, Size};
use particlegs::render::{Drawer, Scene};
use particlegs::space::Bounds;
use particlegs::splat::ToneStyle;

/// Pictures of all particles on a card, which keeps what it has room for.
pub fn on_card<'a>(
    device: &Device,
    particles: &'a Particles,
    bounds: Bounds,
    context: &Context<'_>,
) -> Result<ParticlePictures<'a>> {
    let columns: Columns<'a> = Box::new(|range| particles.columns(range));
    let mut pictures = ParticlePictures::new(device, particles.origin, bounds, particles.len(), columns)?;
    context.begin("particles to the graphics card", particles.len() as u64);
    pictures.keep(device, &mut |sent| {
        context.advance(sent);
        context.check()
    })?;
    context.end();
    Ok(pictures)
}

/// A model and its snapshot on a card.
pub struct ModelAndParticles<'a> {
    particles: ParticlePictures<'a>,
    model: Pictures,
}

impl<'a> ModelAndParticles<'a> {
    /// Sends them there.
    pub fn new(device: &Device, scene: &Scene, particles: &'a Particles, context: &CommandContext) -> Result<Self> {
        let model = Pictures::new(device, scene)?;
        Ok(ModelAndParticles { particles: on_card(device, particles, particles.bounds(), context)?, model })
    }
}

impl Drawer for ModelAndParticles<'_> {
    fn particles(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Gray8> {
        self.particles.draw(view, size, ToneStyle::ParaviewNoFxaa, context)
    }

    fn particles_depth(&self, view: &View, size: Size, context: &Context<'_>) -> Result<Plane> {
        self.particles.optical_depth(view, size, context)
    }

    fn model_depth(&self, view: &View, size: Size) -> Result<Plane> {
        self.model.optical_depth(view, size)
    }
}

//! A snapshot on its way to a graphics card.

use super::card::{Columns, Device, ParticlePictures};
use crate::common::Context;
use particlegs::Result;
use particlegs::particles::Particles;
use particlegs::progress::Progress;
use particlegs::space::Bounds;

/// Pictures of all particles on a card, which keeps what it has room for.
///
/// # Errors
/// Those of the card; [`particlegs::Error::Cancelled`].
pub fn on_card<'a>(
    device: &Device,
    particles: &'a Particles,
    bounds: Bounds,
    context: &Context,
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

//! Pictures of one scene, by its law.

use super::{Canvas, Gaussians, Renderer};
use crate::{Device, alpha};
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::render::Scene;
use particlegs_core::splat::Look;
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device, drawn at whatever size, one picture at a time.
pub struct Pictures(Law);

enum Law {
    OpticalDepth(Renderer, Gaussians, Kept<Canvas>),
    AlphaBlend(alpha::Renderer, alpha::Gaussians, Kept<alpha::Canvas>),
}

/// The memory of the last picture.
struct Kept<C>(Mutex<Option<(Size, C)>>);

impl Pictures {
    /// Of a scene of either law.
    ///
    /// # Errors
    /// Those of [`Gaussians::upload`] and [`alpha::Gaussians::upload`].
    pub fn new(device: &Arc<Device>, scene: &Scene) -> Result<Pictures> {
        Ok(Pictures(match scene.law() {
            LawKind::OpticalDepth => {
                Law::OpticalDepth(Renderer::new(device)?, Gaussians::upload(device, scene)?, Kept::new())
            }
            LawKind::AlphaBlend => {
                Law::AlphaBlend(alpha::Renderer::new(device)?, alpha::Gaussians::upload(device, scene)?, Kept::new())
            }
        }))
    }

    /// A picture; a scene of the alpha-blend law has one look, whichever is asked for.
    ///
    /// # Errors
    /// Those of [`Renderer::canvas`], [`Renderer::submit`], and of the same in [`alpha`].
    pub fn draw(&self, view: &View, size: Size, look: Look) -> Result<Gray8> {
        match &self.0 {
            Law::OpticalDepth(_, own, _) if own.is_empty() => Ok(Gray8::black(size)),
            Law::AlphaBlend(_, own, _) if own.is_empty() => Ok(Gray8::black(size)),
            Law::OpticalDepth(renderer, own, kept) => {
                kept.with(size, || renderer.canvas(own, size), |canvas| renderer.draw(own, canvas, view, look))
            }
            Law::AlphaBlend(renderer, own, kept) => {
                kept.with(size, || renderer.canvas(own, size), |canvas| renderer.draw(own, canvas, view))
            }
        }
    }
}

impl<C> Kept<C> {
    fn new() -> Self {
        Kept(Mutex::new(None))
    }

    /// Draws with the memory that is there, where it is of this size; it is kept where that succeeds.
    fn with(
        &self,
        size: Size,
        new: impl FnOnce() -> Result<C>,
        draw: impl FnOnce(&mut C) -> Result<Gray8>,
    ) -> Result<Gray8> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut canvas = match kept.take() {
            Some((of, canvas)) if of == size => canvas,
            other => {
                // The old one goes before the new one comes.
                drop(other);
                new()?
            }
        };
        let drawn = draw(&mut canvas)?;
        *kept = Some((size, canvas));
        Ok(drawn)
    }
}

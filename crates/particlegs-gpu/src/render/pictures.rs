//! Pictures of one scene, by its law.

use super::{DepthCanvas, DepthRenderer, Gaussians};
use crate::{Device, alpha};
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::alpha::depth_as_bright;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::{Renderer, Scene, depth};
use particlegs_core::splat::ToneStyle;
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device, drawn at whatever size, one picture at a time.
pub struct ScenePictures(LawRenderer);

enum LawRenderer {
    OpticalDepth(Box<DrawingState<DepthRenderer, Gaussians, DepthCanvas>>),
    AlphaBlend(Box<DrawingState<alpha::AlphaRenderer, alpha::Gaussians, alpha::AlphaCanvas>>),
}

/// The renderer, its Gaussians, and the memory of the last picture.
struct DrawingState<R, G, C> {
    renderer: R,
    gaussians: G,
    kept: CanvasCache<C>,
}

/// The memory of the last picture.
struct CanvasCache<C>(Mutex<Option<(Size, C)>>);

impl ScenePictures {
    /// Of a scene of either law. Alpha blending has one look, whichever is asked for.
    pub fn new(device: &Arc<Device>, scene: &Scene) -> Result<ScenePictures> {
        Ok(ScenePictures(match scene.law() {
            LawKind::OpticalDepth => {
                let (renderer, gaussians) = (DepthRenderer::new(device)?, Gaussians::upload(device, scene)?);
                LawRenderer::OpticalDepth(Box::new(DrawingState { renderer, gaussians, kept: CanvasCache::new() }))
            }
            LawKind::AlphaBlend => {
                let (renderer, gaussians) =
                    (alpha::AlphaRenderer::new(device)?, alpha::Gaussians::upload(device, scene)?);
                LawRenderer::AlphaBlend(Box::new(DrawingState { renderer, gaussians, kept: CanvasCache::new() }))
            }
        }))
    }
}

impl Renderer for ScenePictures {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, _: &Context<'_>) -> Result<Gray8> {
        match &self.0 {
            LawRenderer::OpticalDepth(state) if state.gaussians.is_empty() => Ok(Gray8::black(size)),
            LawRenderer::AlphaBlend(state) if state.gaussians.is_empty() => Ok(Gray8::black(size)),
            LawRenderer::OpticalDepth(state) => {
                let DrawingState { renderer, gaussians, kept } = &**state;
                let new = || renderer.canvas(gaussians, size);
                kept.with(size, new, |canvas| renderer.draw(gaussians, canvas, view, style))
            }
            LawRenderer::AlphaBlend(state) => {
                let DrawingState { renderer, gaussians, kept } = &**state;
                let new = || renderer.canvas(gaussians, size);
                kept.with(size, new, |canvas| renderer.draw(gaussians, canvas, view))
            }
        }
    }

    fn optical_depth(&self, view: &View, size: Size, _: &Context<'_>) -> Result<Plane> {
        match &self.0 {
            LawRenderer::OpticalDepth(state) if state.gaussians.is_empty() => Ok(Plane::zeros(size)),
            LawRenderer::AlphaBlend(state) if state.gaussians.is_empty() => Ok(Plane::zeros(size)),
            LawRenderer::OpticalDepth(state) => {
                let DrawingState { renderer, gaussians, kept } = &**state;
                let new = || renderer.canvas(gaussians, size);
                let mut tau = kept.with(size, new, |canvas| {
                    renderer.submit(gaussians, canvas, view, ToneStyle::Expected)?;
                    renderer.depth(canvas)
                })?;
                let lens = Lens::optical(view, size, &gaussians.bounds)?;
                if lens.perspective {
                    depth::grow(&mut tau, &lens);
                }
                Ok(tau)
            }
            LawRenderer::AlphaBlend(state) => {
                let DrawingState { renderer, gaussians, kept } = &**state;
                let new = || renderer.canvas(gaussians, size);
                let mut plane = kept.with(size, new, |canvas| {
                    renderer.submit(gaussians, canvas, view)?;
                    renderer.brightness(canvas)
                })?;
                plane.data.iter_mut().for_each(|b| *b = depth_as_bright(*b));
                Ok(plane)
            }
        }
    }
}

impl<C> CanvasCache<C> {
    fn new() -> Self {
        CanvasCache(Mutex::new(None))
    }

    /// Draws with the memory that is there, where it is of this size; it is kept where that succeeds.
    fn with<T>(
        &self,
        size: Size,
        new: impl FnOnce() -> Result<C>,
        draw: impl FnOnce(&mut C) -> Result<T>,
    ) -> Result<T> {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut canvas = match slot.take() {
            Some((canvas_size, canvas)) if canvas_size == size => canvas,
            other => {
                // The old one goes before the new one comes.
                drop(other);
                new()?
            }
        };
        let drawn = draw(&mut canvas)?;
        *slot = Some((size, canvas));
        Ok(drawn)
    }
}

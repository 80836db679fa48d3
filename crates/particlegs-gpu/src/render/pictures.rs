//! Pictures of one scene, by its law.

use super::{DepthCanvas, DepthRenderer, Gaussians};
use crate::{Device, alpha};
use particlegs_core::camera::{DensityView, Images, View};
use particlegs_core::context::Context;
use particlegs_core::model::LawKind;
use particlegs_core::picture::{Gray8, Plane, Size};
use particlegs_core::render::alpha::depth_as_bright;
use particlegs_core::render::lens::Lens;
use particlegs_core::render::{
    FieldMap, FieldQuery, Renderer, Scene, SceneRenderer, depth, field_map_by, surface_density_by,
};
use particlegs_core::space::Cell;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Hint, Result};
use std::sync::{Arc, Mutex, PoisonError};

/// A scene on a device, drawn at whatever size, one picture at a time.
pub struct ScenePictures<'a>(LawRenderer<'a>);

enum LawRenderer<'a> {
    OpticalDepth(Box<DepthPictures<'a>>),
    AlphaBlend(Box<AlphaPictures>),
}

/// A scene of the optical-depth law, and what the last picture left on the device.
struct DepthPictures<'a> {
    renderer: Arc<DepthRenderer>,
    scene: Scene<'a>,
    sent: DeviceCache<SceneKey, (Gaussians, DeviceCache<Size, DepthCanvas>)>,
}

/// A scene as the device has it.
#[derive(PartialEq)]
struct SceneKey {
    quantity: SummedQuantity,
    /// Shifts at which it is drawn, world units.
    shifts: Vec<[f64; 3]>,
}

/// What its Gaussians add up to.
#[derive(Clone, Copy, PartialEq)]
enum SummedQuantity {
    Depth,
    /// Of Gaussians that may be moved to their images in the cell about a point.
    Density(Option<([f64; 3], Cell)>),
}

/// A scene of the alpha-blend law.
struct AlphaPictures {
    renderer: alpha::AlphaRenderer,
    gaussians: alpha::Gaussians,
    canvas: DeviceCache<Size, alpha::AlphaCanvas>,
}

/// Something on the device that the next picture can use again, where it is for the same.
struct DeviceCache<K, T>(Mutex<Option<(K, T)>>);

impl<'a> ScenePictures<'a> {
    /// Of a scene of either law. Alpha blending has one look, whichever is asked for.
    pub fn new(device: &Arc<Device>, scene: &Scene<'a>) -> Result<Self> {
        if scene.law() == LawKind::OpticalDepth {
            return Ok(ScenePictures::of_depth(Arc::new(DepthRenderer::new(device)?), scene));
        }
        let (renderer, gaussians) = (alpha::AlphaRenderer::new(device)?, alpha::Gaussians::upload(device, scene)?);
        let pictures = AlphaPictures { renderer, gaussians, canvas: DeviceCache::new() };
        Ok(ScenePictures(LawRenderer::AlphaBlend(Box::new(pictures))))
    }

    /// Of a scene of the optical-depth law, by kernels that are compiled already.
    pub fn of_depth(renderer: Arc<DepthRenderer>, scene: &Scene<'a>) -> Self {
        let pictures = DepthPictures { renderer, scene: scene.clone(), sent: DeviceCache::new() };
        ScenePictures(LawRenderer::OpticalDepth(Box::new(pictures)))
    }
}

impl DepthPictures<'_> {
    /// Draws what the device has of a scene for this quantity, once that is sent. `None` where there is nothing to draw.
    fn with<T>(
        &self,
        scene: &Scene<'_>,
        quantity: SummedQuantity,
        size: Size,
        draw: impl FnOnce(&Gaussians, &DepthCanvas) -> Result<T>,
    ) -> Result<Option<T>> {
        if scene.parts().all(|m| m.is_empty()) {
            return Ok(None);
        }
        let device = &self.renderer.device;
        let send = || {
            let gaussians = match quantity {
                SummedQuantity::Depth => Gaussians::upload(device, scene)?,
                SummedQuantity::Density(_) => Gaussians::upload_weighed(device, scene)?,
            };
            Ok((gaussians, DeviceCache::new()))
        };
        let key = SceneKey { quantity, shifts: scene.shifts().to_vec() };
        let drawn = self.sent.with(key, send, |(gaussians, canvas)| {
            canvas.with(size, || self.renderer.canvas(gaussians, size), |canvas| draw(gaussians, canvas))
        });
        drawn.map(Some)
    }
}

impl Renderer for ScenePictures<'_> {
    fn draw(&self, view: &View, size: Size, style: ToneStyle, _: &Context<'_>) -> Result<Gray8> {
        match &self.0 {
            LawRenderer::OpticalDepth(pictures) => {
                let draw = |gaussians: &_, canvas: &_| pictures.renderer.draw(gaussians, canvas, view, style);
                let drawn = pictures.with(&pictures.scene, SummedQuantity::Depth, size, draw)?;
                Ok(drawn.unwrap_or_else(|| Gray8::black(size)))
            }
            LawRenderer::AlphaBlend(pictures) if pictures.gaussians.is_empty() => Ok(Gray8::black(size)),
            LawRenderer::AlphaBlend(pictures) => {
                let AlphaPictures { renderer, gaussians, canvas } = &**pictures;
                let new = || renderer.canvas(gaussians, size);
                canvas.with(size, new, |canvas| renderer.draw(gaussians, canvas, view))
            }
        }
    }

    fn optical_depth(&self, view: &View, size: Size, _: &Context<'_>) -> Result<Plane> {
        match &self.0 {
            LawRenderer::OpticalDepth(pictures) => {
                let drawn = pictures.with(&pictures.scene, SummedQuantity::Depth, size, |gaussians, canvas| {
                    pictures.renderer.submit(gaussians, canvas, view, ToneStyle::Expected)?;
                    pictures.renderer.depth(canvas)
                })?;
                let Some(mut tau) = drawn else { return Ok(Plane::zeros(size)) };
                let lens = Lens::optical(view, size, pictures.scene.bounds())?;
                if lens.perspective {
                    depth::grow(&mut tau, &lens);
                }
                Ok(tau)
            }
            LawRenderer::AlphaBlend(pictures) if pictures.gaussians.is_empty() => Ok(Plane::zeros(size)),
            LawRenderer::AlphaBlend(pictures) => {
                let AlphaPictures { renderer, gaussians, canvas } = &**pictures;
                let new = || renderer.canvas(gaussians, size);
                let mut plane = canvas.with(size, new, |canvas| {
                    renderer.submit(gaussians, canvas, view)?;
                    renderer.brightness(canvas)
                })?;
                plane.data.iter_mut().for_each(|b| *b = depth_as_bright(*b));
                Ok(plane)
            }
        }
    }
}

impl SceneRenderer for ScenePictures<'_> {
    fn surface_density(&self, view: &DensityView, size: Size, _: &Context<'_>) -> Result<Plane> {
        let LawRenderer::OpticalDepth(pictures) = &self.0 else {
            return Err(Error::argument("a GPU draws no surface density of an alpha-blend scene"));
        };
        let place = match view.images {
            Images::Nearest(cell) => Some((view.camera.focal_point, cell)),
            Images::Own | Images::All(_) => None,
        };
        surface_density_by(&pictures.scene, view, size, |scene, lens, size| {
            let draw = |gaussians: &_, canvas: &_| pictures.renderer.density(gaussians, canvas, lens);
            let drawn = pictures.with(scene, SummedQuantity::Density(place), size, draw)?;
            Ok(drawn.unwrap_or_else(|| Plane::zeros(size)))
        })
    }

    fn field_map(&self, query: &FieldQuery, view: &DensityView, size: Size, context: &Context<'_>) -> Result<FieldMap> {
        let LawRenderer::OpticalDepth(pictures) = &self.0 else {
            return Err(Error::argument_with("a GPU draws no fields of an alpha-blend scene", Hint::use_cpu()));
        };
        if query.by.is_some() {
            let message = "means weighted by another field are drawn on the CPU only";
            return Err(Error::argument_with(message, Hint::use_cpu()));
        }
        field_map_by(&pictures.scene, query, view, size, context, |strokes, terms, canvas| {
            let most = pictures.renderer.device.largest_binding();
            pictures.renderer.sum_field(strokes, terms, canvas, most, context)
        })
    }
}

impl<K: PartialEq, T> DeviceCache<K, T> {
    fn new() -> Self {
        DeviceCache(Mutex::new(None))
    }

    /// Works with what is there, where it is for this, or else with what is new; it is kept where that succeeds.
    fn with<R>(&self, key: K, new: impl FnOnce() -> Result<T>, work: impl FnOnce(&mut T) -> Result<R>) -> Result<R> {
        let mut slot = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut content = match slot.take() {
            Some((old, content)) if old == key => content,
            other => {
                // The old one goes before the new one comes.
                drop(other);
                new()?
            }
        };
        let done = work(&mut content)?;
        *slot = Some((key, content));
        Ok(done)
    }
}

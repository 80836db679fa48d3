//! Pictures for the page: RGBA, four bytes per pixel. Fields of a model are mapped, with their colour bar.

use crate::opened::LoadedModel;
use crate::question::{FieldRequest, PlaneColours, PlaneStyle, SceneRequest};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model, species_title};
use particlegs_core::picture::{DensityColors, Gray8, Pixels, Plane, Rgb8, Size, ValueColors, ValueScale};
use particlegs_core::render::{
    FieldQuery, MapComponent, Scene, Scratch, Tones, field_map, first_means, mean_vector, optical_depth_into,
    surface_density,
};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{NamedValue, Result};
use serde::Serialize;

/// The density range of an empty picture.
pub(crate) const UNLIT: [f64; 2] = [1.0, 10.0];

/// Buffers, and the tone curves of the last opacity and radius.
#[derive(Default)]
pub(crate) struct PlaneRenderer {
    scratch: Scratch,
    tones: Option<([f64; 2], Tones)>,
}

impl PlaneRenderer {
    /// The optical depths or densities of a scene.
    pub(crate) fn plane(&mut self, scene: &Scene<'_>, request: &SceneRequest, style: PlaneStyle) -> Result<Plane> {
        match style {
            PlaneStyle::Density => {
                surface_density(scene, &request.density_view(scene.bounds())?, request.size, &Context::SILENT)
            }
            PlaneStyle::Depth => {
                let mut plane = Plane::zeros(request.size);
                let out = Pixels::new(request.size, &mut plane.data)?;
                optical_depth_into(scene, &request.view()?, out, &mut self.scratch, &Context::SILENT)?;
                Ok(plane)
            }
        }
    }

    /// A picture, and its density range if it shows densities.
    pub(crate) fn picture<'a>(
        &mut self,
        model: &'a Model,
        scene: impl Fn(&dyn Fn(usize) -> bool) -> Scene<'a>,
        request: &SceneRequest,
        paint: &PlaneColours,
    ) -> Result<(Vec<u8>, Option<[f64; 2]>)> {
        let shown = |layer: usize| request.shows(layer);
        let Some(style) = paint.look else {
            let plane = self.plane(&scene(&shown), request, PlaneStyle::Density)?;
            let range = paint.range.or_else(|| plane.first_range()).unwrap_or(UNLIT);
            return Ok((density(&plane, paint, range), Some(range)));
        };
        match paint.by_layer {
            true if scene(&shown).law() == LawKind::OpticalDepth && (0..model.layers.len()).any(shown) => {
                let layers: Vec<usize> = (0..model.layers.len()).filter(|l| shown(*l)).collect();
                let planes = layers.iter().map(|l| self.plane(&scene(&|i| i == *l), request, PlaneStyle::Depth));
                let planes = planes.collect::<Result<Vec<_>>>()?;
                let mut total = Plane::zeros(request.size);
                for plane in &planes {
                    total.data.iter_mut().zip(&plane.data).for_each(|(t, v)| *t += v);
                }
                let levels = self.levels((&scene(&shown), request), &total, style, paint.exposure)?;
                let hues = Rgb8::layer_hues(&planes.iter().zip(layers).collect::<Vec<_>>());
                let tinted = Rgb8::tinted(&Gray8 { size: request.size, data: levels }, &hues, paint.white);
                Ok((tinted.data.into_iter().flat_map(|[r, g, b]| [r, g, b, 255]).collect(), None))
            }
            _ => {
                let scene = scene(&shown);
                let plane = self.plane(&scene, request, PlaneStyle::Depth)?;
                let levels = self.levels((&scene, request), &plane, style, paint.exposure)?;
                Ok((grey(&levels, paint.white), None))
            }
        }
    }

    fn levels(
        &mut self,
        (scene, request): (&Scene<'_>, &SceneRequest),
        tau: &Plane,
        style: ToneStyle,
        exposure: f32,
    ) -> Result<Vec<u8>> {
        let key = [request.opacity, request.view()?.radius_pixels(request.size)];
        self.tones = self.tones.take().filter(|(last_key, _)| *last_key == key);
        let (_, tones) = self.tones.get_or_insert_with(|| (key, Tones::new(key[0], key[1])));
        let mut levels = scene.tone(tau, style, tones).data;
        if exposure != 0.0 {
            let gain = exposure.clamp(-8.0, 8.0).exp2();
            // The cast saturates: what is too bright stays at 255.
            levels.iter_mut().for_each(|v| *v = (f32::from(*v) * gain).round_ties_even() as u8);
        }
        Ok(levels)
    }
}

/// What all pictures of a field have in common, from any side.
#[derive(Clone)]
pub(crate) struct FieldFacts {
    query: FieldQuery,
    scale: ValueScale,
    /// Titles of the drawn layers that have no values of the field.
    without: Vec<String>,
}

impl FieldFacts {
    /// Of the drawn layers of a whole model.
    pub(crate) fn new(whole: &Model, request: &SceneRequest, field: &FieldRequest) -> Result<FieldFacts> {
        let mut query = FieldQuery::new(&field.name, &whole.metadata.fields)?;
        let layers =
            || whole.layers.iter().enumerate().filter(|(place, _)| request.shows(*place)).map(|(_, layer)| layer);
        if field.bulk && query.component != MapComponent::Scalar {
            query.bulk = mean_vector(layers(), &query.name);
        }
        let chosen = ValueScale::from_name(&field.scale).ok();
        let scale = chosen.unwrap_or_else(|| query.scale(|| first_means(layers(), &query.name)));
        let without = layers().filter(|l| l.content.iter().all(|b| b.gaussians.fields.get(&query.name).is_none()));
        let without = without.map(|l| species_title(&l.name)).collect();
        Ok(FieldFacts { query, scale, without })
    }
}

/// A map of a field.
pub(crate) struct FieldPlane {
    /// NaN where there is no mass.
    pub values: Plane<f64>,
    pub shade: Option<Plane>,
    pub scale: ValueScale,
    without: Vec<String>,
}

/// The colour bar of a map.
#[derive(Serialize)]
pub(crate) struct FieldBar {
    range: [f64; 2],
    scale: &'static str,
    without: Vec<String>,
}

impl FieldPlane {
    /// Maps a field of the drawn layers.
    pub(crate) fn new(opened: &mut LoadedModel, request: &SceneRequest, field: &FieldRequest) -> Result<FieldPlane> {
        let FieldFacts { query, scale, without } = opened.field_facts(request, field)?;
        let model: &Model = opened.shown(request)?;
        let scene = request.scene(model, &|layer| request.shows(layer));
        if scene.parts().all(|m| m.fields.get(&query.name).is_none()) {
            let values = Plane { size: request.size, data: vec![f64::NAN; request.size.pixels()] };
            return Ok(FieldPlane { values, shade: None, scale, without });
        }
        let map = field_map(&scene, &query, &request.density_view(scene.bounds())?, request.size, &Context::SILENT)?;
        Ok(FieldPlane { values: map.values, shade: field.shade.then_some(map.density), scale, without })
    }

    /// The range of the values, if they have one.
    pub(crate) fn range(&self) -> [f64; 2] {
        self.scale.common_range([self.scale.range(&self.values)])
    }

    /// The picture as RGBA, and its colour bar.
    pub(crate) fn picture(self, paint: &PlaneColours) -> (Vec<u8>, FieldBar) {
        let range = paint.range.filter(|r| self.scale.shows(*r)).unwrap_or_else(|| self.range());
        let colors = ValueColors { scale: self.scale, range, map: paint.colormap.parse().ok() };
        let picture = colors.image(&self.values, self.shade.as_ref(), paint.white);
        let rgba = picture.data.into_iter().flat_map(|[r, g, b]| [r, g, b, 255]).collect();
        (rgba, FieldBar { range, scale: self.scale.name(), without: self.without })
    }
}

fn grey(levels: &[u8], white: bool) -> Vec<u8> {
    let flip = if white { 255 } else { 0 };
    levels.iter().flat_map(|v| [v ^ flip, v ^ flip, v ^ flip, 255]).collect()
}

fn density(plane: &Plane, paint: &PlaneColours, range: [f64; 2]) -> Vec<u8> {
    let colors = DensityColors::new(paint.colormap.parse().unwrap_or_default(), paint.white, range);
    let rgba = |v: &f32| {
        let [r, g, b] = colors.of(*v);
        [r, g, b, 255]
    };
    plane.data.iter().flat_map(rgba).collect()
}

/// Little-endian bytes of a plane.
pub(crate) fn bytes(plane: &Plane) -> Vec<u8> {
    plane.data.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Maximum number of pixels: 8K and a margin.
pub(crate) const MOST_PIXELS: usize = 1 << 26;

/// Refuses pictures that are too large for memory.
pub(crate) fn check(size: Size) -> Result<()> {
    match size.width.checked_mul(size.height) {
        Some(n) if n <= MOST_PIXELS => Ok(()),
        _ => Err(particlegs_core::Error::argument(format!("a picture of {}x{} is too large", size.width, size.height))),
    }
}

//! Fields of a model: maps for the page, and values at a place.

use crate::opened::LoadedModel;
use crate::question::{FieldRequest, PlaneColours, SceneRequest};
use particlegs_core::context::Context;
use particlegs_core::model::{Model, species_title};
use particlegs_core::picture::{Plane, ValueColors, ValueScale};
use particlegs_core::render::{FieldQuery, MapComponent, field_map, first_means, mean_vector};
use particlegs_core::{NamedValue, Result};
use serde::Serialize;

/// Models of more Gaussians are mapped in motion by joined ones. Of fewer, pairs would be joined to lines that show beside
/// the mass, and no faster.
const MOST: usize = 250_000;

/// A map of a field.
pub(crate) struct FieldPlane {
    /// NaN where there is no mass.
    pub values: Plane<f64>,
    pub shade: Option<Plane>,
    pub scale: ValueScale,
    /// Titles of the drawn layers that have no values of the field.
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
        let whole = &opened.full()?.model;
        let mut query = FieldQuery::new(&field.name, &whole.metadata.fields)?;
        let layers =
            || whole.layers.iter().enumerate().filter(|(place, _)| request.shows(*place)).map(|(_, layer)| layer);
        if field.bulk && query.component != MapComponent::Scalar {
            query.bulk = mean_vector(layers(), &query.name);
        }
        let chosen = ValueScale::from_name(&field.scale).ok();
        let scale = chosen.unwrap_or_else(|| query.scale(|| first_means(layers(), &query.name)));
        let without = layers().filter(|l| l.content.iter().all(|b| b.gaussians.fields.get(&query.name).is_none()));
        let without: Vec<String> = without.map(|l| species_title(&l.name)).collect();
        let request = &SceneRequest { coarse: request.coarse && whole.gaussians() > MOST, ..request.clone() };
        let model: &Model = opened.shown(request)?;
        let scene = request.scene(model, &|layer| request.shows(layer));
        if scene.parts().all(|m| m.fields.get(&query.name).is_none()) {
            let values = Plane { size: request.size, data: vec![f64::NAN; request.size.pixels()] };
            return Ok(FieldPlane { values, shade: None, scale, without });
        }
        let map = field_map(&scene, &query, &request.density_view(scene.bounds())?, request.size, &Context::SILENT)?;
        let values = map.wanted(&query).clone();
        Ok(FieldPlane { values, shade: field.shade.then_some(map.density), scale, without })
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

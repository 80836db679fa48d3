//! Colours by layer ([`particlegs_core::picture::Rgb8::layer_hues`]).

use crate::view_content::ViewContent;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::{Plane, Rgb8, Size};
use particlegs_core::render::{Scene, Tones, optical_depth};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Hint, Result, parallel};

/// A model's layers, one model each.
pub fn apart(model: &Model) -> Result<Vec<Model>> {
    if model.metadata.law == LawKind::AlphaBlend {
        let message = "an alpha-blend model has no optical depth to mix the colours of layers by";
        return Err(Error::argument_with(message, Hint::from("draw one layer with ").option("layer", "NAME")));
    }
    model.layers.iter().map(|l| model.clone().only(std::slice::from_ref(&l.name))).collect()
}

pub fn draw(layers: &[Model], view: &View, size: Size, style: ToneStyle, context: &Context<'_>) -> Result<ViewContent> {
    context.require_memory("a picture by layers", 4 * size.pixels() as u64 * (layers.len() as u64 + 2))?;
    let planes =
        layers.iter().map(|l| optical_depth(&Scene::new(l), view, size, context)).collect::<Result<Vec<Plane>>>()?;
    let sums = parallel::map_range(size.pixels(), |i| planes.iter().map(|p| p.data[i]).sum::<f32>());
    let all = Plane { size, data: sums };
    let levels = Tones::new(view.opacity, view.radius_pixels(size)).of(&all, style);
    let hues = Rgb8::layer_hues(&planes.iter().zip(0..).collect::<Vec<_>>());
    Ok(ViewContent::Layers(levels, hues))
}

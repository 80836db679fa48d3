//! Colours by layer ([`particlegs_core::picture::Rgb8::layer_hues`]).

use crate::view_content::ViewContent;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::{Plane, Rgb8, Size};
use particlegs_core::render::{Renderer, Tones};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Hint, Result, parallel};

/// Refuses a model whose layers have no optical depths to mix their colours by.
pub fn check(model: &Model) -> Result<()> {
    if model.metadata.law == LawKind::AlphaBlend {
        let message = "an alpha-blend model has no optical depth to mix the colours of layers by";
        return Err(Error::argument_with(message, Hint::from("draw one layer with ").option("layer", "NAME")));
    }
    Ok(())
}

/// Draws layers, each by its renderer.
pub fn draw(
    layers: &[Box<dyn Renderer + '_>],
    view: &View,
    size: Size,
    style: ToneStyle,
    context: &Context<'_>,
) -> Result<ViewContent> {
    context.require_memory("a picture by layers", 4 * size.pixels() as u64 * (layers.len() as u64 + 2))?;
    let planes = layers.iter().map(|l| l.optical_depth(view, size, context)).collect::<Result<Vec<Plane>>>()?;
    let sums = parallel::map_range(size.pixels(), |i| planes.iter().map(|p| p.data[i]).sum::<f32>());
    let all = Plane { size, data: sums };
    let levels = Tones::new(view.opacity, view.radius_pixels(size)).of(&all, style);
    let hues = Rgb8::layer_hues(&planes.iter().zip(0..).collect::<Vec<_>>());
    Ok(ViewContent::Layers(levels, hues))
}

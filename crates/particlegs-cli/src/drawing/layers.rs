//! Colours by layer: the level of a pixel is that of all layers together, its hue the mix of the layers' colours by
//! their optical depth there.

use super::Seen;
use particlegs::camera::View;
use particlegs::model::{LawKind, Model};
use particlegs::parallel;
use particlegs::picture::{Plane, Size};
use particlegs::progress::Progress;
use particlegs::render::{Scene, Tones, optical_depth};
use particlegs::splat::Look;
use particlegs::{Error, Result};

/// Colours that those who see few colours tell apart too (Okabe and Ito 2008), in the order in which layers have them.
const COLOURS: [[u8; 3]; 7] =
    [[86, 180, 233], [230, 159, 0], [0, 158, 115], [204, 121, 167], [240, 228, 66], [213, 94, 0], [0, 114, 178]];

/// The colour of a layer; after seven they come again.
pub fn colour_of(layer: usize) -> [u8; 3] {
    COLOURS[layer % COLOURS.len()]
}

/// A model's layers, each to be drawn alone.
///
/// # Errors
/// [`Error::Argument`] for a model of the alpha-blend law, whose layers hide one another.
pub fn apart(model: &Model) -> Result<Vec<Model>> {
    if model.metadata.law == LawKind::AlphaBlend {
        let what = "--color-by-layer: an alpha-blend model has no optical depth to mix colours by".to_string();
        return Err(Error::Argument { what, remedy: "draw one layer with --layer NAME".into() });
    }
    model.layers.iter().map(|l| model.clone().only(std::slice::from_ref(&l.name))).collect()
}

/// Draws a view of layers.
///
/// # Errors
/// Those of [`optical_depth`].
pub fn draw(layers: &[Model], view: &View, size: Size, look: Look, progress: &dyn Progress) -> Result<Seen> {
    progress.require_memory("a picture by layers", 4 * size.pixels() as u64 * (layers.len() as u64 + 2))?;
    let planes =
        layers.iter().map(|l| optical_depth(&Scene::of(l), view, size, progress)).collect::<Result<Vec<Plane>>>()?;
    let sums = parallel::map_range(size.pixels(), |i| planes.iter().map(|p| p.data[i]).sum::<f32>());
    let all = Plane { size, data: sums };
    let levels = Tones::new(view.opacity, view.radius_pixels(size)).of(&all, look);
    let linear: Vec<[f32; 3]> = (0..layers.len()).map(|l| colour_of(l).map(to_linear)).collect();
    let hues = parallel::map_range(size.pixels(), |i| {
        let depths = || planes.iter().map(|p| p.data[i]);
        mixed(depths().zip(linear.iter().copied()))
    });
    Ok(Seen::Layers(levels, hues))
}

/// The mix of colours in proportion to their weights, as light mixes; as bright as its brightest part can be.
fn mixed(parts: impl Iterator<Item = (f32, [f32; 3])>) -> [u8; 3] {
    let (mut sum, mut weights) = ([0f32; 3], 0f32);
    for (weight, colour) in parts {
        (0..3).for_each(|k| sum[k] += weight * colour[k]);
        weights += weight;
    }
    if !(weights > 0.0 && weights.is_finite()) {
        return [255; 3];
    }
    sum.map(|v| from_linear(v / weights))
}

/// sRGB's transfer function (IEC 61966-2-1).
fn to_linear(v: u8) -> f32 {
    let v = f32::from(v) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

fn from_linear(v: f32) -> u8 {
    let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    (255.0 * v).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_layer_alone_has_its_colour_and_mixes_lie_between() {
        let of = |weights: [f32; 2]| mixed(weights.into_iter().zip([0, 1].map(|l| colour_of(l).map(to_linear))));
        assert_eq!(of([3.0, 0.0]), colour_of(0));
        assert_eq!(of([0.0, 1e-3]), colour_of(1));
        let half = of([1.0, 1.0]);
        let (a, b) = (colour_of(0), colour_of(1));
        assert!((0..3).all(|k| (a[k].min(b[k])..=a[k].max(b[k])).contains(&half[k])), "{half:?}");
        assert_eq!(of([0.0, 0.0]), [255; 3]);
    }
}

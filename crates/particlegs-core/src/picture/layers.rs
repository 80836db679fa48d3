//! Pictures that tell layers apart: the level of a pixel is that of all layers together, its hue the mix of the layers'
//! colours by their optical depth there.

use super::{Gray8, Plane, Rgb8};
use crate::parallel;

/// Colours that those who see few colours tell apart too (Okabe and Ito 2008), in the order in which layers have them.
const COLORS: [[u8; 3]; 7] =
    [[86, 180, 233], [230, 159, 0], [0, 158, 115], [204, 121, 167], [240, 228, 66], [213, 94, 0], [0, 114, 178]];

impl Rgb8 {
    /// The colour of a layer; after seven they come again.
    pub fn layer_color(layer: usize) -> [u8; 3] {
        COLORS[layer % COLORS.len()]
    }

    /// The hue of every pixel: the layers' colours in proportion to their depths, as light mixes. White where there is
    /// no depth. `planes` are depths of one size, with their layers.
    pub fn layer_hues(planes: &[(&Plane, usize)]) -> Vec<[u8; 3]> {
        let linear: Vec<[f32; 3]> = planes.iter().map(|(_, l)| Self::layer_color(*l).map(to_linear)).collect();
        let pixels = planes.first().map_or(0, |(p, _)| p.data.len());
        parallel::map_range(pixels, |i| mixed(planes.iter().map(|(p, _)| p.data[i]).zip(linear.iter().copied())))
    }

    /// Levels in hues: light on black, or on white ink that takes from it what the hue lacks.
    pub fn tinted(levels: &Gray8, hues: &[[u8; 3]], white: bool) -> Rgb8 {
        let pixel = |i: usize| {
            let level = u32::from(levels.data[i]);
            let share = |v: u8| ((u32::from(v) * level + 127) / 255) as u8;
            hues[i].map(|h| if white { 255 - share(255 - h) } else { share(h) })
        };
        Rgb8 { size: levels.size, data: parallel::map_range(levels.data.len(), pixel) }
    }
}

fn mixed(parts: impl Iterator<Item = (f32, [f32; 3])>) -> [u8; 3] {
    let (mut sum, mut weights) = ([0f32; 3], 0f32);
    for (weight, color) in parts {
        (0..3).for_each(|k| sum[k] += weight * color[k]);
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
    if v <= 0.04045 { v / 12.92 } else { libm::powf((v + 0.055) / 1.055, 2.4) }
}

fn from_linear(v: f32) -> u8 {
    let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * libm::powf(v, 1.0 / 2.4) - 0.055 };
    (255.0 * v).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Size;

    #[test]
    fn one_layer_alone_has_its_color_and_mixes_lie_between() {
        let plane = |data: [f32; 4]| Plane { size: Size { width: 4, height: 1 }, data: data.into() };
        let hues = Rgb8::layer_hues(&[(&plane([3.0, 0.0, 1.0, 0.0]), 0), (&plane([0.0, 1e-3, 1.0, 0.0]), 1)]);
        let (a, b) = (Rgb8::layer_color(0), Rgb8::layer_color(1));
        assert_eq!((hues[0], hues[1], hues[3]), (a, b, [255; 3]));
        assert!((0..3).all(|k| (a[k].min(b[k])..=a[k].max(b[k])).contains(&hues[2][k])), "{hues:?}");
        let levels = Gray8 { size: Size { width: 4, height: 1 }, data: vec![255, 255, 255, 0] };
        assert_eq!(Rgb8::tinted(&levels, &hues, false).data[..2], [a, b]);
        assert_eq!(Rgb8::tinted(&levels, &hues, true).data[3], [255; 3]);
    }
}

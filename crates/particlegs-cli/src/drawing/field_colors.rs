//! Colours of a field's values: on a linear, a logarithmic or a signed scale.

use crate::figure::ticks::{even, logarithmic};
use crate::figure::{ColourBar, FigureImage, PaperColour, labelled};
use particlegs_pipeline::parallel;
use particlegs_pipeline::picture::{Colormap, Plane, Rgb8, ValueColors, ValueScale, journal_unit};

/// The darkest that shading makes a colour.
const DARKEST: f32 = 0.06;

/// Ticks of a linear scale at most.
const TICKS: f64 = 6.0;

/// How a field is shown.
#[derive(Clone, Debug)]
pub struct FieldLegend {
    /// What it is, without its unit.
    pub title: String,
    pub unit: String,
    pub scale: ValueScale,
    /// The map; none for that of the scale.
    pub map: Option<Colormap>,
}

impl FieldLegend {
    /// The picture; pixels without a value have the background's colour, and those of little `shade` come near it.
    pub fn image(&self, plane: &Plane, shade: Option<&Plane>, range: [f64; 2], background: PaperColour) -> FigureImage {
        let colors = ValueColors { scale: self.scale, range, map: self.map };
        let shades = shade.map(|s| (s, s.log_range().unwrap_or([1.0, 10.0])));
        let ground = if background == PaperColour::White { [255; 3] } else { [0; 3] };
        let pixels = parallel::map_range(plane.data.len(), |i| {
            let value = f64::from(plane.data[i]);
            if value.is_nan() {
                return ground;
            }
            let color = colors.of(value);
            let Some((shade, [lo, hi])) = &shades else { return color };
            let bright = ((f64::from(shade.data[i]) / lo).ln() / (hi / lo).ln()) as f32;
            let bright = if bright.is_nan() { DARKEST } else { bright.clamp(DARKEST, 1.0) };
            [0, 1, 2].map(|k| {
                let (from, to) = (f32::from(ground[k]), f32::from(color[k]));
                (from + (to - from) * bright).round() as u8
            })
        });
        FigureImage::Color(Rgb8 { size: plane.size, data: pixels })
    }

    /// The colour bar of a range.
    pub fn bar(&self, range: [f64; 2]) -> ColourBar {
        let colors = ValueColors { scale: self.scale, range, map: self.map };
        let [lo, hi] = range;
        let ticks = if self.scale == ValueScale::Logarithmic { logarithmic(lo, hi) } else { even(lo, hi, TICKS) };
        let colours = (0..=255).map(|i| colors.at(i as f32 / 255.0)).collect();
        ColourBar { title: labelled(&self.title, &journal_unit(&self.unit)), colours, ticks }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_pipeline::picture::Size;

    fn plane(data: Vec<f32>) -> Plane {
        Plane { size: Size { width: data.len(), height: 1 }, data }
    }

    #[test]
    fn places_without_mass_have_the_colour_of_the_background() {
        let (title, unit) = (String::new(), String::new());
        let legend = FieldLegend { title, unit, scale: ValueScale::Signed, map: None };
        let of = |shade| legend.image(&plane(vec![f32::NAN, -2.0, 0.0, 2.0]), shade, [-2.0, 2.0], PaperColour::White);
        let image = of(None);
        let [empty, blue, middle, red] = [0, 1, 2, 3].map(|x| image.pixel(x, 0));
        assert!(
            empty == [255; 3] && blue[2] > 180 && blue[0] < 80 && middle == [221; 3] && red[0] > 170 && red[2] < 50
        );
        let shade = plane(vec![1.0, 1e-9, 1.0, 10.0]);
        let shaded = of(Some(&shade));
        assert!(shaded.pixel(1, 0)[0] > 230, "{:?}", shaded.pixel(1, 0));
    }
}

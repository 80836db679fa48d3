//! Colours of a field's values: on a linear, a logarithmic or a signed scale.

use particlegs_core::picture::{Colormap, Plane, ValueColors, ValueScale, journal_unit};
use particlegs_figure::ticks::{even, logarithmic};
use particlegs_figure::{ColourBar, FigureImage, PaperColour, labelled};

/// Ticks of a linear scale at most.
const TICKS: f64 = 6.0;

/// Title, unit and colours of a field.
#[derive(Clone, Debug)]
pub struct FieldLegend {
    /// Name of the quantity, without its unit.
    pub title: String,
    pub unit: String,
    pub scale: ValueScale,
    /// The map; none for that of the scale.
    pub map: Option<Colormap>,
}

impl FieldLegend {
    /// The picture; pixels without a value have the background's colour, and those of little `shade` come near it.
    pub fn image(
        &self,
        plane: &Plane<f64>,
        shade: Option<&Plane>,
        range: [f64; 2],
        background: PaperColour,
    ) -> FigureImage {
        let colors = ValueColors { scale: self.scale, range, map: self.map };
        FigureImage::Color(colors.image(plane, shade, background == PaperColour::White))
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

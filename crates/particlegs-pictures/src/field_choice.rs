//! Maps of a field: its name, its scale, the motion that is subtracted, and its colours.

use crate::provenance::PictureProvenance;
use crate::view_content::ViewContent;
use particlegs_core::model::{Model, Quantity};
use particlegs_core::picture::{Colormap, Plane, ValueColors, ValueScale, journal_unit};
use particlegs_core::render::{FieldMap, FieldQuery, MapComponent, first_means, mean_vector};
use particlegs_core::{Error, NamedValue, Result};
use particlegs_figure::ticks::{even, logarithmic};
use particlegs_figure::{ColourBar, FigureImage, PaperColour, labelled};

/// A field that is shown: its mean along each line of sight.
#[derive(Clone, Debug, Default)]
pub struct FieldOptions {
    /// Its name, such as temperature; of a vector with a component: velocity.x, velocity.y, velocity.z, or velocity.los,
    /// positive away from the observer. dispersion.los is the dispersion of the velocity, dispersion.temperature that of the
    /// temperature. None: no field is shown.
    pub name: Option<String>,
    /// Scale of its colours; by default signed for vectors, logarithmic for positive values over a wide range.
    pub scale: Option<ValueScale>,
    /// Motion to subtract from a vector: `mean`, the mean of all particles, or `X,Y,Z` in its unit.
    pub bulk: Option<String>,
    /// Weight of means along the line of sight, by default mass, or numbers where no masses are known: `mass`, `count` (all
    /// particles alike), or the name of a positive scalar field, whose value times mass weighs.
    pub weight: Option<String>,
    /// Whether surface density shades the colours: bright where there is much mass.
    pub shade: bool,
}

/// A field to be drawn, and how.
#[derive(Clone, Debug)]
pub struct FieldChoice {
    pub query: FieldQuery,
    pub legend: FieldLegend,
    pub shade: bool,
}

/// The source of fields: a model, or a snapshot's particles.
pub struct FieldSource<'a> {
    pub quantities: &'a [Quantity],
    /// The unit of length.
    pub length: Option<&'a str>,
    /// The mean of the vector field of a name.
    pub mean: &'a dyn Fn(&str) -> [f64; 3],
    /// Values that a scale is chosen by, of the first component.
    pub samples: &'a dyn Fn(&str) -> Vec<f64>,
}

impl FieldOptions {
    /// Provenance of a picture that shows `choice`, with these options.
    pub(crate) fn stored(&self, choice: &FieldChoice, provenance: PictureProvenance) -> PictureProvenance {
        PictureProvenance {
            field: self.name.clone(),
            scale: Some(choice.legend.scale.name().into()),
            bulk: self.bulk.clone(),
            field_weight: self.weight.clone(),
            shade: self.shade,
            colormap: choice.legend.map.map(|m| m.name().into()),
            unit: Some(choice.legend.unit.clone()),
            ..provenance
        }
    }

    /// Takes over what a picture of the same field stores, where no option says otherwise.
    pub(crate) fn complete(&mut self, provenance: &PictureProvenance) -> std::result::Result<(), String> {
        if let (None, Some(name)) = (self.scale, &provenance.scale) {
            self.scale = Some(ValueScale::from_name(name)?);
        }
        self.weight = self.weight.take().or_else(|| provenance.field_weight.clone());
        self.bulk = self.bulk.take().or_else(|| provenance.bulk.clone());
        self.shade |= provenance.shade;
        Ok(())
    }

    /// The field of this name, in a model.
    pub(crate) fn of_model(&self, name: &str, model: &Model, map: Option<Colormap>) -> Result<FieldChoice> {
        let (quantities, length) = (&model.metadata.fields, model.metadata.units.length_text());
        let (mean, samples) =
            (|name: &str| mean_vector(&model.layers, name), |name: &str| first_means(&model.layers, name));
        self.choice(name, &FieldSource { quantities, length, mean: &mean, samples: &samples }, map)
    }

    pub(crate) fn choice(&self, name: &str, source: &FieldSource<'_>, map: Option<Colormap>) -> Result<FieldChoice> {
        let mut query = FieldQuery::new(name, source.quantities)?;
        if let Some(weight) = &self.weight {
            query = query.weighted(weight, source.quantities)?;
        }
        if let Some(text) = &self.bulk {
            if query.component == MapComponent::Scalar {
                let message =
                    format!("a bulk motion is subtracted from a vector, but field `{}` is a scalar", query.name);
                return Err(Error::argument(message));
            }
            // The mean is taken only where it is asked for: it passes over the whole field.
            query.bulk = match &text[..] {
                "mean" => (source.mean)(&query.name),
                numbers => vector(numbers)?,
            };
        }
        let scale = self.scale.unwrap_or_else(|| query.scale(|| (source.samples)(&query.name)));
        let unit = query.unit(source.quantities, source.length);
        let legend = FieldLegend { title: query.title(), unit, scale, map };
        Ok(FieldChoice { query, legend, shade: self.shade })
    }
}

impl FieldChoice {
    /// The range that is asked for, where the scale can show it.
    pub fn checked(&self, range: Option<[f64; 2]>) -> Result<()> {
        match range {
            Some(range) if !self.legend.scale.shows(range) => Err(Error::argument(
                "the range of colours takes LO,HI with LO < HI, both positive on a logarithmic scale",
            )),
            _ => Ok(()),
        }
    }

    /// The content of a view that shows a map.
    pub fn content(&self, map: FieldMap) -> ViewContent {
        ViewContent::Field(map.values, self.shade.then_some(map.density))
    }
}

fn vector(text: &str) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let three = numbers.and_then(|n| <[f64; 3]>::try_from(n).ok());
    three.ok_or_else(|| Error::argument(format!("the bulk motion is `mean` or three numbers X,Y,Z, not `{text}`")))
}

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

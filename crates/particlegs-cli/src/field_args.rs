//! Options of maps of a field: which one, its scale, and what is subtracted.

use crate::common::named;
use crate::drawing::ViewContent;
use crate::drawing::field_colors::FieldLegend;
use crate::drawing::provenance::PictureProvenance;
use clap::Args;
use particlegs_core::model::{Model, Quantity};
use particlegs_core::picture::{Colormap, ValueScale};
use particlegs_core::render::{FieldMap, FieldQuery, MapComponent, first_means, mean_vector};
use particlegs_core::{Error, NamedValue, Result};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Field options")]
pub struct FieldArgs {
    /// Show a field: its mean along each line of sight, such as temperature or velocity.los.
    ///
    /// A vector needs a component: velocity.x, velocity.y, velocity.z, or velocity.los, positive away from the
    /// observer. dispersion.los is the dispersion of the velocity, dispersion.temperature that of the temperature. Means
    /// are weighted by mass, or by numbers of particles where no masses are known. `info` lists the fields.
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub field: Option<String>,
    /// Scale of the field's colours [default: signed for vectors, log for positive values over a wide range].
    #[arg(long, value_name = "SCALE", hide_short_help = true, value_parser = named::<ValueScale>())]
    pub scale: Option<ValueScale>,
    /// Motion to subtract from a vector: `mean`, the mean of all particles, or X,Y,Z in its unit.
    #[arg(long, value_name = "mean|X,Y,Z", hide_short_help = true, allow_hyphen_values = true)]
    pub bulk: Option<String>,
    /// Weight of means along the line of sight [default: mass].
    ///
    /// mass, count (all particles alike), or the name of a positive scalar field: its value times mass. Both fields must be
    /// in the model.
    #[arg(long, value_name = "mass|count|NAME", hide_short_help = true)]
    pub field_weight: Option<String>,
    /// Shade the field's colours by surface density: bright where there is much mass.
    #[arg(long, hide_short_help = true)]
    pub shade: bool,
}

/// A field to be drawn, and how.
#[derive(Clone, Debug)]
pub struct FieldChoice {
    pub query: FieldQuery,
    pub legend: FieldLegend,
    pub shade: bool,
}

/// What fields are chosen from: a model, or a snapshot's particles.
pub struct FieldSource<'a> {
    pub quantities: &'a [Quantity],
    /// The unit of length.
    pub length: Option<&'a str>,
    /// The mean of the vector field of a name.
    pub mean: &'a dyn Fn(&str) -> [f64; 3],
    /// Values that a scale is chosen by, of the first component.
    pub samples: &'a dyn Fn(&str) -> Vec<f64>,
}

impl FieldArgs {
    /// What a picture that shows `choice` stores of these options.
    pub fn stored(&self, choice: &FieldChoice, about: PictureProvenance) -> PictureProvenance {
        PictureProvenance {
            field: self.field.clone(),
            scale: Some(choice.legend.scale.name().into()),
            bulk: self.bulk.clone(),
            field_weight: self.field_weight.clone(),
            shade: self.shade,
            colormap: choice.legend.map.map(|m| m.name().into()),
            unit: Some(choice.legend.unit.clone()),
            ..about
        }
    }

    /// Takes over what a picture of the same field stores, where no option says otherwise.
    pub fn complete(&mut self, told: &PictureProvenance) -> std::result::Result<(), String> {
        if let (None, Some(name)) = (self.scale, &told.scale) {
            self.scale = Some(ValueScale::from_name(name)?);
        }
        self.field_weight = self.field_weight.take().or_else(|| told.field_weight.clone());
        self.bulk = self.bulk.take().or_else(|| told.bulk.clone());
        self.shade |= told.shade;
        Ok(())
    }

    /// The field of this name, in a model.
    pub fn of_model(&self, name: &str, model: &Model, map: Option<Colormap>) -> Result<FieldChoice> {
        let (quantities, length) = (&model.metadata.fields, model.metadata.units.length_text());
        let (mean, samples) =
            (|name: &str| mean_vector(&model.layers, name), |name: &str| first_means(&model.layers, name));
        self.choice(name, &FieldSource { quantities, length, mean: &mean, samples: &samples }, map)
    }

    pub fn choice(&self, name: &str, source: &FieldSource<'_>, map: Option<Colormap>) -> Result<FieldChoice> {
        let mut query = FieldQuery::new(name, source.quantities)?;
        if let Some(weight) = &self.field_weight {
            query = query.weighted(weight, source.quantities)?;
        }
        if let Some(text) = &self.bulk {
            if query.component == MapComponent::Scalar {
                let what = format!("--bulk needs a vector, but field `{}` is a scalar", query.name);
                return Err(Error::argument(what));
            }
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
            Some(range) if !self.legend.scale.shows(range) => {
                Err(Error::argument("--range takes LO,HI with LO < HI, both positive on a logarithmic scale"))
            }
            _ => Ok(()),
        }
    }

    /// What a map shows.
    pub fn content(&self, map: FieldMap) -> ViewContent {
        let values = map.wanted(&self.query).clone();
        ViewContent::Field(values, self.shade.then_some(map.density))
    }
}

fn vector(text: &str) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|v| v.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let three = numbers.and_then(|n| <[f64; 3]>::try_from(n).ok());
    three.ok_or_else(|| Error::argument(format!("--bulk takes `mean` or three numbers X,Y,Z, not `{text}`")))
}

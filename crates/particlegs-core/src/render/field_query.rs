//! Names of maps of a field: `temperature`, `velocity.los`, `dispersion.los`.

use crate::model::{Block, Layer, Mixture, Quantity, QuantityKind};
use crate::picture::{Plane, Size, ValueScale};
use crate::{Error, Hint, NamedValue, Result};

/// The number of a field that is mapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapComponent {
    /// The value of a scalar.
    Scalar,
    /// A vector's component along x (0), y (1) or z (2).
    Axis(usize),
    /// A vector's component along the line of sight, positive away from the observer.
    LineOfSight,
}

/// A field to be mapped.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldQuery {
    /// The field's name in the metadata.
    pub name: String,
    /// The number of it.
    pub component: MapComponent,
    /// Whether the root mean square about the mean is mapped instead of the mean.
    pub dispersion: bool,
    /// A vector that is subtracted from a vector field, in its unit.
    pub bulk: [f64; 3],
    /// Whether the field is a sum, of which a map shows the amount per area.
    pub per_area: bool,
    /// The weight of means along the line of sight.
    pub weight: FieldWeight,
    /// A scalar field, by its name, that this is multiplied by.
    pub by: Option<String>,
}

crate::named_values! {
    /// Weights of a field's mean along the line of sight. Within a Gaussian it is weighted as the file says.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum FieldWeight {
        #[default]
        Mass = "mass": "By mass, where masses are known",
        Count = "count": "All particles count alike",
    }
}

impl FieldWeight {
    /// The weight of Gaussian `i` of a part whose unit of mass is `unit`.
    pub(super) fn of(self, m: &Mixture, unit: f64, i: usize) -> f64 {
        match self {
            FieldWeight::Mass => unit * m.mass_of(i),
            FieldWeight::Count => m.count[i],
        }
    }
}

/// The vector field that components without a name belong to.
const VELOCITY: &str = "velocity";
const DISPERSION: &str = "dispersion.";
const COMPONENTS: [(&str, MapComponent); 4] = [
    ("x", MapComponent::Axis(0)),
    ("y", MapComponent::Axis(1)),
    ("z", MapComponent::Axis(2)),
    ("los", MapComponent::LineOfSight),
];

impl FieldQuery {
    /// Of a name as users write it: a scalar's own, a vector's with `.x`, `.y`, `.z` or `.los`; `dispersion.` before it asks
    /// for the dispersion, where `dispersion.los` and the like mean the velocity's. An error names what there is.
    pub fn new(text: &str, fields: &[Quantity]) -> Result<FieldQuery> {
        let (wanted, dispersion) = match text.strip_prefix(DISPERSION) {
            Some(rest) => (rest, true),
            None => (text, false),
        };
        let component = |name: &str| COMPONENTS.iter().find(|c| c.0 == name).map(|c| c.1);
        let field = |name: &str| fields.iter().find(|q| q.name.eq_ignore_ascii_case(name));
        let query = |q: &Quantity, component| FieldQuery {
            name: q.name.clone(),
            component,
            dispersion,
            bulk: [0.0; 3],
            per_area: q.extensive,
            weight: FieldWeight::Mass,
            by: None,
        };
        if let Some(q) = field(wanted) {
            let name = &q.name;
            return match q.kind {
                QuantityKind::Vector => Err(Error::argument_with(
                    format!("field `{name}` is a vector"),
                    format!("choose a component: {name}.x, {name}.y, {name}.z, or {name}.los along the line of sight"),
                )),
                _ if dispersion && q.extensive => Err(Error::argument(format!(
                    "field `{name}` is a sum over particles: it has no dispersion along a line of sight"
                ))),
                _ => Ok(query(q, MapComponent::Scalar)),
            };
        }
        let named = wanted.rsplit_once('.').and_then(|(name, suffix)| Some((field(name)?, component(suffix)?)));
        let velocity = || component(wanted).filter(|_| dispersion).and_then(|number| Some((field(VELOCITY)?, number)));
        match named.or_else(velocity).filter(|(q, _)| q.kind == QuantityKind::Vector) {
            Some((q, number)) => Ok(query(q, number)),
            None if fields.is_empty() => {
                let hint = Hint::from("compress the snapshot again with ").option("fields", "NAME");
                Err(Error::argument_with("the model has no fields", hint))
            }
            None => {
                let names: Vec<String> = fields.iter().flat_map(FieldQuery::names).collect();
                let message = format!("the model has no field `{text}`");
                Err(Error::argument_with(message, format!("its fields: {}", names.join(", "))))
            }
        }
    }

    /// Weighted as `text` says: `mass`, `count`, or by mass times a scalar field of this name.
    pub fn weighted(self, text: &str, fields: &[Quantity]) -> Result<FieldQuery> {
        if self.per_area {
            return Err(Error::argument(format!("field `{}` is a sum over particles: it has no weights", self.name)));
        }
        if let Ok(weight) = FieldWeight::from_name(text) {
            return Ok(FieldQuery { weight, ..self });
        }
        let Some(q) = fields.iter().find(|q| q.name.eq_ignore_ascii_case(text)) else {
            let message = format!("there is no field `{text}` to weigh means by");
            return Err(Error::argument_with(
                message,
                "weights are `mass`, `count`, or a positive scalar field's name",
            ));
        };
        if q.kind != QuantityKind::Scalar {
            return Err(Error::argument(format!("field `{}` is not a scalar: means cannot be weighted by it", q.name)));
        }
        if self.component != MapComponent::Scalar {
            let message = format!("field `{}` is a vector: its means are weighted by mass or count alone", self.name);
            return Err(Error::argument(message));
        }
        Ok(FieldQuery { by: Some(q.name.clone()), ..self })
    }

    /// The fields that a name may speak of, the likeliest first.
    pub fn candidates(text: &str) -> Vec<String> {
        let wanted = text.strip_prefix(DISPERSION).unwrap_or(text);
        let is_component = |name: &str| COMPONENTS.iter().any(|c| c.0 == name);
        let vector = wanted.rsplit_once('.').filter(|(_, suffix)| is_component(suffix)).map(|(name, _)| name);
        let velocity = is_component(wanted).then_some(VELOCITY);
        [Some(wanted), vector, velocity].into_iter().flatten().map(str::to_string).collect()
    }

    /// The names that [`FieldQuery::new`] takes for a field's means.
    pub fn names(q: &Quantity) -> Vec<String> {
        match q.kind {
            QuantityKind::Vector => COMPONENTS.iter().map(|(suffix, _)| format!("{}.{suffix}", q.name)).collect(),
            _ => vec![q.name.clone()],
        }
    }

    /// The title for a legend: `velocity along the line of sight`.
    pub fn title(&self) -> String {
        let component = match self.component {
            MapComponent::Scalar => self.name.clone(),
            MapComponent::Axis(k) => format!("{} along {}", self.name, ["x", "y", "z"][k]),
            MapComponent::LineOfSight => format!("{} along the line of sight", self.name),
        };
        let quantity = if self.per_area { format!("{component} per area") } else { component };
        let title = self.by.as_ref().map_or(quantity.clone(), |by| format!("{quantity} weighted by {by}"));
        if self.dispersion { format!("dispersion of {title}") } else { title }
    }

    /// The unit of what is mapped, by the unit of length: the field's, per area for a sum, and dex for the dispersion of a
    /// logarithmic field; empty where it is not known.
    pub fn unit(&self, fields: &[Quantity], length: Option<&str>) -> String {
        match fields.iter().find(|q| q.name == self.name) {
            Some(q) if q.logarithmic && self.dispersion => "dex".into(),
            Some(q) if q.extensive => {
                let unit = q.unit.as_ref().map_or("1", |u| &u.text[..]);
                length.map_or(String::new(), |length| format!("{unit} / ({length})^2"))
            }
            Some(Quantity { unit: Some(unit), .. }) => unit.text.clone(),
            _ => String::new(),
        }
    }

    /// Whether it has a sign that a colour map should show.
    pub fn is_signed(&self) -> bool {
        !self.dispersion && self.component != MapComponent::Scalar
    }

    /// The scale that suits the field, of some of its `values`.
    pub fn scale(&self, values: impl FnOnce() -> Vec<f64>) -> ValueScale {
        let data = if self.dispersion { Vec::new() } else { values() };
        let size = Size { width: data.len(), height: 1 };
        // Charges have both signs.
        let signed = self.is_signed() || self.per_area && data.iter().any(|v| *v < 0.0);
        ValueScale::suited(&Plane { size, data }, signed)
    }
}

/// The mean values of a field's first component in all Gaussians of some layers: values to choose a scale by.
pub fn first_means<'a>(layers: impl IntoIterator<Item = &'a Layer<Vec<Block>>>, name: &str) -> Vec<f64> {
    let blocks = layers.into_iter().flat_map(|l| &l.content);
    let fields = blocks.filter_map(|b| b.gaussians.fields.get(name));
    fields.flat_map(|f| (0..f.len()).map(|i| f.value_at(0, i, [0.0; 3]))).collect()
}

/// The mean of a vector field over all particles of some layers that have it, weighted as maps are; 0 without it.
pub fn mean_vector<'a>(layers: impl IntoIterator<Item = &'a Layer<Vec<Block>>>, name: &str) -> [f64; 3] {
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for layer in layers {
        let unit = layer.mass.unit_or_one();
        let mut add = |m: &Mixture| {
            let Some(field) = m.fields.get(name).filter(|f| f.components() == 3) else { return };
            for i in 0..m.len() {
                let w = unit * m.mass_of(i);
                total += w;
                (0..3).for_each(|k| sum[k] += w * field.mean[k][i]);
            }
        };
        layer.content.iter().for_each(|b| add(&b.gaussians));
    }
    if total > 0.0 { sum.map(|v| v / total) } else { sum }
}

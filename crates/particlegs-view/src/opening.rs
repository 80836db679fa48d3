//! The first view of a page.

use particlegs_core::picture::Colormap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

particlegs_core::named_values! {
    /// The style of a page's picture.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum PageStyle {
        Density = "density": "Surface density in logarithmic colours",
        Paraview = "paraview": "ParaView's picture of the particles, without shot noise",
        Expected = "expected": "255 (1 - exp(-tau)) for the optical depth tau",
    }
}

/// Most circles of a page.
pub const MOST_CIRCLES: usize = 100_000;

/// The first view of a page. Each setting replaces a default: the surface density of all layers (style `paraview` for
/// the alpha-blend law) at azimuth 0, elevation 0 and distance 1. Lengths are in world units.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PageOpening {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub style: Option<PageStyle>,
    /// A field to show instead, as `render --field` takes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Colour map of densities.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "name_of", deserialize_with = "named")]
    pub colormap: Option<Colormap>,
    /// Densities, or values of the field, of the first and the last colour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Whether the background is white.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white: Option<bool>,
    /// Whether each layer has its own colour.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub color_by_layer: bool,
    /// Layers to draw; all if empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<String>,
    /// Particle radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Particle opacity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub opacity: Option<f64>,
    /// A views file; its first view is used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub views: Option<Value>,
    /// Azimuth of the camera, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth: Option<f64>,
    /// Elevation of the camera, degrees, -90 to 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevation: Option<f64>,
    /// Distance of the camera, in base distances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
    /// The point that the camera looks at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub look_at: Option<[f64; 3]>,
    /// Whether the projection is orthographic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orthographic: Option<bool>,
    /// Centres and radii of circles over the picture, at most [`MOST_CIRCLES`].
    #[serde(skip_deserializing, skip_serializing_if = "Vec::is_empty")]
    pub circles: Vec<([f64; 3], f64)>,
}

fn name_of<S: Serializer>(colormap: &Option<Colormap>, to: S) -> std::result::Result<S::Ok, S::Error> {
    colormap.map(Colormap::name).serialize(to)
}

fn named<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Option<Colormap>, D::Error> {
    let name = Option::<String>::deserialize(from)?;
    name.map(|name| name.parse().map_err(serde::de::Error::custom)).transpose()
}

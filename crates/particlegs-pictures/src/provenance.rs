//! Provenance of a picture, stored in it as text: enough to draw the same view again, of this or another model.

use particlegs_core::camera::{View, ViewSet};
use particlegs_core::context::Context;
use particlegs_core::model::{UnitSystem, Units};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
use particlegs_figure::png_file;
use particlegs_files::ViewsFile;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// The record that a picture stores of itself.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PictureProvenance {
    /// The program's version.
    pub particlegs: String,
    /// Files that were drawn, one per panel.
    pub of: Vec<SourceFile>,
    /// The style.
    pub style: String,
    /// Layers that were drawn, or `all`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<String>,
    /// Whether they were coloured.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub color_by_layer: bool,
    /// Colour map of a density, or of a field if one was chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub colormap: Option<String>,
    /// The field that was drawn instead of the density, by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Its scale.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<String>,
    /// The motion that is subtracted from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bulk: Option<String>,
    /// The weight of its means.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_weight: Option<String>,
    /// Whether it is shaded by density.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub shade: bool,
    /// Values of its first and last colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Its unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Units of length and mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<PictureUnits>,
    /// Background, if it was chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub background: Option<String>,
    /// A views file: the cameras, with every default filled in.
    pub views: Value,
}

/// Units of a picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureUnits {
    #[serde(flatten)]
    units: Units,
    scale_factor: Option<f64>,
    hubble: Option<f64>,
    /// The quantity that its density sums, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density_of: Option<String>,
}

impl PictureUnits {
    pub(crate) fn new(system: UnitSystem<'_>, density_of: Option<&str>) -> Self {
        let UnitSystem { units, scale_factor, hubble } = system;
        PictureUnits { units: units.clone(), scale_factor, hubble, density_of: density_of.map(str::to_string) }
    }

    pub(crate) fn system(&self) -> UnitSystem<'_> {
        UnitSystem { units: &self.units, scale_factor: self.scale_factor, hubble: self.hubble }
    }
}

/// A file that was drawn.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SourceFile {
    /// Its name without its folder.
    pub name: String,
    /// BLAKE3 of a model or series file, or the hash of a snapshot's particles that models name.
    pub blake3: String,
    /// The moment that the clock of a series shows, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moment: Option<String>,
}

impl PictureProvenance {
    /// Why its colours cannot be compared with another's, pixel by pixel, if so: in words, what each shows.
    pub(crate) fn differs(&self, other: &PictureProvenance) -> Option<String> {
        let density_of = |p: &PictureProvenance| p.units.as_ref().and_then(|u| u.density_of.clone());
        let content_text = |p: &PictureProvenance| -> String {
            let Some(unit) = p.unit.as_ref() else { return "grey levels".into() };
            let quantity = p.field.clone().or_else(|| density_of(p).map(|sum| format!("density of {sum}")));
            let range = p.range.map_or(String::new(), |[low, high]| format!(", {low} to {high}"));
            let colours = p.colormap.as_ref().map_or(String::new(), |name| format!(", {name}"));
            format!("{} in {unit}{range}{colours}", quantity.unwrap_or_else(|| "density".into()))
        };
        let [a, b] = [self, other].map(content_text);
        (a != b).then(|| format!("{a} and {b}"))
    }

    pub(crate) fn text(&self, views: &[View], size: Size) -> Result<String> {
        let file = ViewsFile(ViewSet { size, views: views.to_vec() }).text()?;
        let plain = |e: serde_json::Error| Error::argument(e.to_string());
        let views = serde_json::from_str(&file).map_err(plain)?;
        serde_json::to_string(&PictureProvenance { views, ..self.clone() }).map_err(plain)
    }

    /// Reads the provenance of a picture, and its view.
    ///
    /// # Errors
    /// [`Error::Input`] for a picture without it, or of several views.
    pub fn read(path: &Path, context: &Context<'_>) -> Result<(PictureProvenance, ViewSet)> {
        let text = png_file::provenance(path, context)?;
        let provenance: PictureProvenance = serde_json::from_str(&text)
            .map_err(|e| Error::input(path, format!("its embedded view settings cannot be read: {e}")))?;
        let ViewsFile(set) = ViewsFile::of_bytes(provenance.views.to_string().as_bytes(), path)?;
        if set.views.len() != 1 {
            return Err(Error::input(path, format!("it is a figure of {} views, not of one", set.views.len())));
        }
        Ok((provenance, set))
    }
}

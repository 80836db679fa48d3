//! What a model file says about its snapshot and its making.

use super::{LawKind, Recipe};
use crate::space::{Bounds, Cell};

/// Everything a file carries beside its Gaussians. `None` = the source does not say.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Metadata {
    /// Image law.
    pub law: LawKind,
    /// Particles of the whole snapshot.
    pub count: u64,
    /// The sum of their weights, each 1 where a layer has none; see [`super::Model::mass`] for the
    /// mass in units.
    pub mass: f64,
    /// Bounds of the whole snapshot, world units.
    pub bounds: Bounds,
    /// Simulation cell.
    pub cell: Option<Cell>,
    /// Default particle radius, world units.
    pub default_radius: f64,
    /// Default opacity.
    pub default_opacity: f64,
    /// Source name.
    pub source: String,
    /// What binds it to its source: BLAKE3 of its runs (docs/format.md).
    #[serde(with = "hexadecimal")]
    pub source_hash: [u8; 32],
    /// Unit of length, as text.
    pub length_unit: Option<String>,
    /// Unit of mass, as text.
    pub mass_unit: Option<String>,
    /// Are lengths comoving?
    pub comoving: Option<bool>,
    /// Cosmological scale factor.
    pub scale_factor: Option<f64>,
    /// Hubble parameter h.
    pub hubble: Option<f64>,
    /// Simulation time.
    pub time: Option<f64>,
    /// What made the model.
    pub recipe: Recipe,
    /// The program's version.
    pub tool_version: String,
}

impl Metadata {
    /// Redshift from the scale factor.
    pub fn redshift(&self) -> Option<f64> {
        self.scale_factor.map(|a| 1.0 / a - 1.0)
    }
}

/// A hash as text: 64 hexadecimal digits.
pub fn hex(hash: &[u8; 32]) -> String {
    blake3::Hash::from_bytes(*hash).to_hex().to_string()
}

/// [`hex`] in serde's terms.
mod hexadecimal {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(hash: &[u8; 32], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&super::hex(hash))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<[u8; 32], D::Error> {
        let hash = blake3::Hash::from_hex(String::deserialize(from)?).map_err(D::Error::custom)?;
        Ok(*hash.as_bytes())
    }
}

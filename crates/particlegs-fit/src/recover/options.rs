//! Options of drawing particles (docs/law/published.md, "Recovery"; the published names in brackets).

use particlegs_core::model::{LawKind, Model};
use particlegs_core::{Error, Result};
use particlegs_particles::RawForm;

particlegs_core::named_values! {
    /// The rule by which Gaussians get particles, and by which these are placed.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum Method {
        #[default]
        Count = "count": "Each Gaussian's own number of particles (published as V0)",
        Volume = "volume": "In proportion to count times volume, or opacity times volume for alpha-blend models (V1)",
        Ellipsoid = "ellipsoid": "Uniformly inside ellipsoids of three standard deviations (V4)",
        Grid = "grid": "Uniformly inside the cells of a 512³ grid that contain centres of Gaussians (V6)",
        Stratified = "stratified": "Like count, but evenly spread: less shot noise in cells, too regular locally",
        Spaced = "spaced": "Like count, but clumped: nearest-neighbour distances are close to the truth",
    }
}

impl Method {
    /// Whether particles are shared out by volume too, rather than by the Gaussians' own numbers alone.
    pub(super) fn by_volume(self, law: LawKind) -> bool {
        self == Method::Volume || self == Method::Grid && law == LawKind::AlphaBlend
    }
}

/// Options of drawing particles from a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Particles (`None`: as many as the model stands for).
    pub particles: Option<u64>,
    /// The rule by which they are shared out and placed.
    pub method: Method,
    /// Factor on the Gaussians' standard deviations (the published variants: 1.2 to 3).
    pub scale: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Columns, or triples.
    pub form: RawForm,
    /// The model file's name, for meta.json.
    pub model_name: String,
}

impl Default for Options {
    fn default() -> Self {
        let (form, model_name) = (RawForm::Columns, String::new());
        Options { particles: None, method: Method::Count, scale: 1.0, seed: 0, form, model_name }
    }
}

impl Options {
    pub(super) fn check(&self) -> Result<()> {
        if self.scale > 0.0 && self.scale.is_finite() {
            return Ok(());
        }
        Err(Error::argument(format!("the scale must be positive, not {}", self.scale)))
    }

    /// Number of particles that are drawn from `model`.
    pub fn total(&self, model: &Model) -> u64 {
        self.particles.unwrap_or_else(|| model.layers.iter().map(|l| l.count()).sum())
    }
}

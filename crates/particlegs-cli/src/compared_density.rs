//! Surface densities as numbers against each other.

use crate::density_file;
use particlegs::Result;
use particlegs::picture::DensityScores;
use particlegs::progress::Progress;
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
pub struct DensityFileComparison {
    /// File name without `.f32`.
    pub name: String,
    /// The scores, where both can be read and show the same.
    #[serde(flatten)]
    pub scores: Option<DensityScores>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Means of views' scores, over those that have a value.
#[derive(Serialize)]
pub struct MeanDensityScores {
    /// Of the root mean squares of log10(A / B).
    pub rms_dex: Option<f64>,
    /// Of the means of log10(A / B).
    pub mean_dex: Option<f64>,
    pub correlation: Option<f64>,
}

/// Scores the values of one file against those of another. A pair that cannot be scored is told in its place.
pub fn compare_density(name: &str, a: &Path, b: &Path, progress: &dyn Progress) -> DensityFileComparison {
    let (scores, error) = match compare(a, b, progress) {
        Ok(Ok(scores)) => (Some(scores), None),
        Ok(Err(why)) => (None, Some(format!("{name}: {why}"))),
        Err(e) => (None, Some(e.to_string())),
    };
    DensityFileComparison { name: name.into(), scores, error }
}

/// The scores, or why there are none.
fn compare(a: &Path, b: &Path, progress: &dyn Progress) -> Result<std::result::Result<DensityScores, String>> {
    let (said_a, density) = density_file::read(a, progress)?;
    let (said_b, truth) = density_file::read(b, progress)?;
    match said_a.differs(&said_b) {
        Some(why) => Ok(Err(why)),
        None => DensityScores::new(&density, &truth, progress).map(Ok),
    }
}

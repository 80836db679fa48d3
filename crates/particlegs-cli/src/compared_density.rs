//! Two folders of surface densities as numbers against each other.

use crate::density_file;
use particlegs::Result;
use particlegs::parallel;
use particlegs::picture::DensityScores;
use particlegs::progress::Progress;
use serde::Serialize;
use std::path::Path;

/// One shared view.
#[derive(Serialize)]
pub struct ComparedDensity {
    /// File name without `.f32`.
    pub name: String,
    /// The scores, where both can be read and show the same.
    #[serde(flatten)]
    pub scores: Option<DensityScores>,
    /// Why there are no scores.
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
    /// Of the correlations.
    pub correlation: Option<f64>,
}

/// Scores the values in folder `a` against those of the same names in `b`. A pair that cannot be scored is told
/// in its place.
///
/// # Errors
/// [`particlegs::Error::Cancelled`].
pub fn compare_densities(
    names: &[&String],
    a: &Path,
    b: &Path,
    progress: &dyn Progress,
) -> Result<Vec<ComparedDensity>> {
    parallel::try_map(names.iter().copied(), |name| {
        progress.check()?;
        let (scores, error) = match compare(name, a, b, progress) {
            Ok(Ok(scores)) => (Some(scores), None),
            Ok(Err(why)) => (None, Some(format!("{name}: {why}"))),
            Err(e) => (None, Some(e.to_string())),
        };
        progress.advance(1);
        Ok(ComparedDensity { name: name.clone(), scores, error })
    })
}

/// The scores, or why there are none.
fn compare(
    name: &str,
    a: &Path,
    b: &Path,
    progress: &dyn Progress,
) -> Result<std::result::Result<DensityScores, String>> {
    let (said_a, density) = density_file::read(a, name, progress)?;
    let (said_b, truth) = density_file::read(b, name, progress)?;
    match said_a.differs(&said_b) {
        Some(why) => Ok(Err(why)),
        None => DensityScores::of(&density, &truth, progress).map(Ok),
    }
}

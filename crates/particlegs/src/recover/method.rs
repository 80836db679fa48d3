//! How particles are placed (docs/law/published.md, "Recovery"; the published names in brackets).

use crate::model::LawKind;

/// How many particles a Gaussian gets, and where they go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// Normal draws, as many as the Gaussian stands for (V0): of models of the alpha-blend law in
    /// proportion to its opacity.
    #[default]
    Count,
    /// Normal draws in proportion to count (alpha-blend: opacity) times volume, the root of the
    /// covariance's determinant (V1).
    Volume,
    /// Uniform in the ellipsoid of three standard deviations, as many as the Gaussian stands for (V4).
    Ellipsoid,
    /// Uniform in the cell of a grid of 512^3 over the bounds that holds the Gaussian's centre (V6): as
    /// many as the Gaussian stands for; in the alpha-blend law, as published, in proportion to opacity
    /// times volume.
    Grid,
    /// As `Count`, at the places of a low-discrepancy sequence: less shot noise in counts of cells,
    /// and spacings more even than any simulation's.
    Stratified,
    /// As `Count`, with the clumps below a Gaussian's size put back at random: a cascade of uneven
    /// halves (`spaced`). Distances to the nearest neighbour come near the truth; the places of the
    /// clumps are made up, so statistics on these scales are not better for it.
    Spaced,
}

impl Method {
    /// Are particles shared out by volume too, rather than by the Gaussians' own numbers alone?
    pub(super) fn by_volume(self, law: LawKind) -> bool {
        self == Method::Volume || self == Method::Grid && law == LawKind::AlphaBlend
    }

    /// Its name on the command line and in meta.json.
    pub fn name(self) -> &'static str {
        match self {
            Method::Count => "count",
            Method::Volume => "volume",
            Method::Ellipsoid => "ellipsoid",
            Method::Grid => "grid",
            Method::Stratified => "stratified",
            Method::Spaced => "spaced",
        }
    }
}

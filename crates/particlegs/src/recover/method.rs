//! How particles are placed (docs/law/published.md, "Recovery"; the published names in brackets).

use crate::model::LawKind;

particlegs_core::named_values! {
    /// How many particles a Gaussian gets, and where they go.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum Method {
        #[default]
        Count = "count": "From each Gaussian as many as it stands for (published as V0)",
        Volume = "volume": "In proportion to count times volume; of alpha-blend models to opacity times volume (V1)",
        Ellipsoid = "ellipsoid": "Uniformly within ellipsoids of three standard deviations (V4)",
        Grid = "grid": "Uniformly within the cells of a grid of 512³ that hold centres of Gaussians (V6)",
        Stratified = "stratified": "As count, but evenly spread: less shot noise in cells, too regular at small distances",
        Spaced = "spaced": "As count, but clumped within Gaussians: nearest-neighbour distances are close to the truth",
    }
}

impl Method {
    /// Are particles shared out by volume too, rather than by the Gaussians' own numbers alone?
    pub(super) fn by_volume(self, law: LawKind) -> bool {
        self == Method::Volume || self == Method::Grid && law == LawKind::AlphaBlend
    }
}

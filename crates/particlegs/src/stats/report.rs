//! What [`super::compare`] measures, as plain data. Pairs are truth, then other.

use super::{
    ApertureMass, AxisMoments, DensityComparison, DensityPdf, Domain, NearestDistances, SizeClass, Slice, Spectra,
    StatsOptions,
};

/// Everything measured; `None` = not asked for, or not to be had of a model.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Statistics {
    /// How.
    pub options: StatsOptions,
    /// The truth's box, which the other is put into.
    pub domain: Domain,
    /// Particles, or those that a model stands for.
    pub particles: [u64; 2],
    /// Is it a model's mixture itself?
    pub model: [bool; 2],
    /// Mean spacing of the truth's particles.
    pub spacing: f64,
    /// Densities on a grid.
    pub density: Option<DensityReport>,
    /// Power spectra.
    pub spectra: Option<Spectra>,
    /// xi(r) from the spectra.
    pub xi_by_transform: Option<XiByTransform>,
    /// xi(r) by pair counts.
    pub xi_by_pairs: Option<XiByPairs>,
    /// Groups.
    pub groups: Option<GroupReport>,
    /// Nearest neighbours.
    pub neighbours: Option<NeighbourReport>,
    /// Moments along x, y and z.
    pub moments: Option<[[AxisMoments; 3]; 2]>,
    /// The figures that a table shows.
    pub summary: super::Summary,
    /// What a reader must know: choices made, things left out.
    pub notes: Vec<String>,
}

/// Densities on one grid.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DensityReport {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Edges of a cell, world units.
    pub side: [f64; 3],
    /// Agreement.
    pub agreement: DensityComparison,
    /// Mass of other / truth.
    pub mass_ratio: f64,
    /// Share of the mass beyond open edges.
    pub outside: [f64; 2],
    /// Distribution.
    pub pdf: DensityPdf,
    /// Mass along each axis, by plane of cells, in units of the mean.
    pub profiles: [[Vec<f64>; 2]; 3],
    /// Central slices of both across x, y and z: large, and written apart.
    #[serde(skip)]
    pub slices: [[Slice; 2]; 3],
}

/// xi(r) from |delta_k|^2, in bins of pi / k_max from there on.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct XiByTransform {
    /// Edges of the bins.
    pub edges: Vec<f64>,
    /// xi of each.
    pub xi: [Vec<f64>; 2],
}

/// xi(r) by pair counts.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct XiByPairs {
    /// Counts of each.
    pub counts: [super::PairCounts; 2],
    /// xi of other / truth; `None` where the truth's is not above zero.
    pub ratio: Vec<Option<f64>>,
}

/// Friends-of-friends groups.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct GroupReport {
    /// Linking length of each, world units: the same share of its own mean spacing.
    pub linking_length: [f64; 2],
    /// 20 to 49, 50 to 99, 100 and more.
    pub classes: Vec<SizeClass>,
    /// Sizes by a factor of the square root of 2.
    pub histogram: Vec<SizeClass>,
    /// Largest group.
    pub largest: [u64; 2],
    /// Share of particles in groups.
    pub grouped: [f64; 2],
    /// Mass within apertures about the truth's centres, by size of group.
    pub apertures: Vec<ApertureMass>,
}

/// Nearest neighbours.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct NeighbourReport {
    /// Distances of each.
    pub distances: [NearestDistances; 2],
    /// Mean of other / truth.
    pub mean_ratio: f64,
    /// Median of other / truth.
    pub median_ratio: f64,
}

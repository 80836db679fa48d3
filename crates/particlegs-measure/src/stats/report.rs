//! What [`super::compare`] measures, as plain data. Pairs are truth, then other.

use super::{
    ApertureMass, AxisMoments, AxisProfile, DensityComparison, DensityPdf, Domain, HaloDispersions, HaloProfiles,
    JointHistogram, Likelihood, Multipoles, NearestDistances, PairCounts, SizeClass, Spectra, StatsOptions,
};
use serde::{Serialize, Serializer};

/// Everything measured; `None` = not asked for, or not to be had of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// The options that it was measured with.
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
    /// Power spectra in shells of wave number.
    pub spectra: Option<Spectra>,
    /// xi(r) from the spectra.
    pub xi_by_transform: Option<XiByTransform>,
    /// xi(r) by pair counts, in bins that both share.
    #[serde(serialize_with = "with_xi_ratio")]
    pub xi_by_pairs: Option<[PairCounts; 2]>,
    /// Friends-of-friends groups, and the mass in their cores.
    pub groups: Option<GroupReport>,
    /// Distances to the nearest neighbour.
    #[serde(serialize_with = "with_distance_ratios")]
    pub neighbours: Option<[NearestDistances; 2]>,
    /// Moments along x, y and z.
    pub moments: Option<[[AxisMoments; 3]; 2]>,
    /// Likelihood of the particles under the model, where one side is a model and one particles.
    pub likelihood: Option<Likelihood>,
    /// Pair counts in linear bins, of which g(r) is made.
    #[serde(serialize_with = "with_g")]
    pub rdf: Option<[PairCounts; 2]>,
    /// Densities along x, y and z.
    pub profiles: Option<[AxisProfile; 3]>,
    /// Density and enclosed mass about centres.
    pub haloes: Option<HaloProfiles>,
    /// Unit of velocities, where it is known.
    pub velocity_unit: Option<String>,
    /// Power in redshift space.
    pub multipoles: Option<Multipoles>,
    /// Power of the momentum: (unit of velocity)^2 times volume.
    pub momentum: Option<Spectra>,
    /// Velocity dispersions about centres.
    pub dispersion: Option<HaloDispersions>,
    /// Joint histograms of two fields, one for each layer that has both on both sides.
    pub joint: Option<Vec<JointHistogram>>,
    /// The figures that a table shows.
    pub summary: Summary,
    /// What a reader must know: choices made, things left out.
    pub notes: Vec<String>,
}

/// `None` = not measured; of a limit: `within` says what it means.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Pearson correlation of densities.
    pub density_correlation: Option<f64>,
    /// Mean absolute error of delta.
    pub density_mean_absolute_error: Option<f64>,
    /// Largest |P_other / P_truth - 1| of any shell.
    pub largest_power_deviation: Option<f64>,
    /// P(k) is within 1 % up to here.
    pub power_within_1_percent_to: Option<f64>,
    /// P(k) is within 5 % up to here.
    pub power_within_5_percent_to: Option<f64>,
    /// P(k) is within 10 % up to here.
    pub power_within_10_percent_to: Option<f64>,
    /// r(k) is at least 0.99 up to here.
    pub r_above_0_99_to: Option<f64>,
    /// r(k) is at least 0.9 up to here.
    pub r_above_0_9_to: Option<f64>,
    /// r at the last shell.
    pub r_at_k_max: Option<f64>,
    /// xi(r) is within 10 % from here on, as far as the truth's is above 0.1: by pairs, and by transform
    /// where pairs are of a sample.
    pub xi_within_10_percent_from: Option<f64>,
    /// Groups of this size and above have counts within 10 %, in classes joined to hold at least 100.
    pub groups_within_10_percent_from: Option<u64>,
    /// Median of other / truth within the aperture, groups of 100 to 299.
    pub core_mass: Option<f64>,
    /// Mean nearest distance, other / truth.
    pub nearest_mean: Option<f64>,
    /// Median nearest distance, other / truth.
    pub nearest_median: Option<f64>,
    /// Distances of the first peak of g(r), truth and other.
    pub rdf_peak_at: [Option<f64>; 2],
    /// Heights of that peak, truth and other.
    pub rdf_peak_height: [Option<f64>; 2],
    /// Largest difference of g(r), other - truth, among bins of 100 pairs and more in an ideal gas.
    pub rdf_largest_difference: Option<f64>,
    /// RMS difference of the densities along the chosen axis, in units of the mean.
    pub profile_relative_difference: Option<f64>,
    /// Half-mass heights along it, truth and other.
    pub profile_half_mass_height: [Option<f64>; 2],
    /// Median of enclosed mass, other / truth, within the largest radius about centres.
    pub halo_mass: Option<f64>,
    /// P0 in redshift space is within 1 % up to here.
    pub monopole_within_1_percent_to: Option<f64>,
    /// P0 in redshift space is within 5 % up to here.
    pub monopole_within_5_percent_to: Option<f64>,
    /// Largest |P2_other - P2_truth| / P0_truth of any shell.
    pub largest_quadrupole_deviation: Option<f64>,
    /// P(k) of the momentum is within 5 % up to here.
    pub momentum_within_5_percent_to: Option<f64>,
    /// Median of velocity dispersions about centres, other / truth.
    pub halo_dispersion: Option<f64>,
    /// Share of the mass that lies in other cells of a joint histogram: the largest of all layers.
    pub joint_difference: Option<f64>,
}

/// Densities on one grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DensityReport {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Edges of a cell, world units.
    pub side: [f64; 3],
    /// Agreement of the two densities, cell by cell.
    pub agreement: DensityComparison,
    /// Mass of other / truth.
    pub mass_ratio: f64,
    /// Share of the mass beyond open edges.
    pub outside: [f64; 2],
    /// Distribution of 1 + delta over the cells.
    pub pdf: DensityPdf,
    /// 1 + delta of both in the central planes of cells across x, y and z, the first of the two other axes slowest.
    #[serde(skip)]
    pub slices: [[Vec<f32>; 2]; 3],
}

/// xi(r) from |delta_k|^2, in bins of pi / k_max from there on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct XiByTransform {
    /// Edges of the bins, world units: one more than bins.
    pub edges: Vec<f64>,
    /// xi in each bin, truth and other.
    pub xi: [Vec<f64>; 2],
}

/// Friends-of-friends groups.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupReport {
    /// Linking length of each, world units: the same share of its own mean spacing, where it is not stated.
    pub linking_length: [f64; 2],
    /// Particles that were linked: all, or the finest of a zoom.
    pub linked: [u64; 2],
    /// Groups that hold heavier particles, which were not linked.
    pub contaminated: [Option<u64>; 2],
    /// 20 to 49, 50 to 99, 100 and more.
    pub classes: Vec<SizeClass>,
    /// Sizes by a factor of the square root of 2.
    pub histogram: Vec<SizeClass>,
    /// Particles of the largest group, truth and other.
    pub largest: [u64; 2],
    /// Share of those particles in groups.
    pub grouped: [f64; 2],
    /// Mass within apertures about the truth's centres, by size of group.
    pub apertures: Vec<ApertureMass>,
}

/// xi of other / truth in each bin; `None` where the truth's is not above zero.
pub(super) fn xi_ratio([truth, other]: &[PairCounts; 2]) -> Vec<Option<f64>> {
    truth.xi.iter().zip(&other.xi).map(|(truth, other)| (*truth > 0.0).then(|| other / truth)).collect()
}

fn with_xi_ratio<S: Serializer>(pair: &Option<[PairCounts; 2]>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct PairCountsForm<'a> {
        counts: &'a [PairCounts; 2],
        ratio: Vec<Option<f64>>,
    }
    pair.as_ref().map(|counts| PairCountsForm { counts, ratio: xi_ratio(counts) }).serialize(serializer)
}

fn with_g<S: Serializer>(pair: &Option<[PairCounts; 2]>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct CorrelationForm<'a> {
        edges: &'a [f64],
        pairs: [&'a [u64]; 2],
        expected: [&'a [f64]; 2],
        g: [Vec<f64>; 2],
    }
    let form = pair.as_ref().map(|counts| CorrelationForm {
        edges: &counts[0].edges,
        pairs: counts.each_ref().map(|c| &c.pairs[..]),
        expected: counts.each_ref().map(|c| &c.expected[..]),
        g: counts.each_ref().map(PairCounts::g),
    });
    form.serialize(serializer)
}

fn with_distance_ratios<S: Serializer>(pair: &Option<[NearestDistances; 2]>, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct DistancesForm<'a> {
        distances: &'a [NearestDistances; 2],
        mean_ratio: f64,
        median_ratio: f64,
    }
    let ratio = |[truth, other]: &[NearestDistances; 2], of: fn(&NearestDistances) -> f64| of(other) / of(truth);
    let form = pair.as_ref().map(|distances| DistancesForm {
        distances,
        mean_ratio: ratio(distances, |d| d.mean),
        median_ratio: ratio(distances, |d| d.median),
    });
    form.serialize(serializer)
}

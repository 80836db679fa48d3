//! The figures of a table: how far each statistic is to be trusted.

use super::report::{GroupReport, NeighbourReport, XiByPairs};
use super::{DensityComparison, Spectra};

/// Truth groups that a bin of sizes must hold before its ratio says anything.
const FEWEST_GROUPS: u64 = 30;
/// xi of the truth below which a ratio of xi says nothing.
const LEAST_XI: f64 = 0.1;

/// `None` = not measured; of a limit: `within` says what it means.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
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
    /// xi(r) by pairs is within 10 % from here on, as far as the truth's is above 0.1.
    pub xi_within_10_percent_from: Option<f64>,
    /// Groups of this size and above have counts within 10 %, in every bin of at least 30 groups.
    pub groups_within_10_percent_from: Option<u64>,
    /// Median of other / truth within the aperture, groups of 100 to 299.
    pub core_mass: Option<f64>,
    /// Mean nearest distance, other / truth.
    pub nearest_mean: Option<f64>,
    /// Median nearest distance, other / truth.
    pub nearest_median: Option<f64>,
}

impl Summary {
    pub(super) fn new(
        density: Option<&DensityComparison>,
        spectra: Option<&Spectra>,
        xi: Option<&XiByPairs>,
        groups: Option<&GroupReport>,
        neighbours: Option<&NeighbourReport>,
    ) -> Self {
        let shells = || spectra.iter().flat_map(|s| &s.shells);
        let deviation = |ratio: Option<f64>| ratio.map_or(f64::INFINITY, |r| (r - 1.0).abs());
        let power_to = |limit: f64| last_while(shells().map(|s| (s.k, deviation(s.ratio) <= limit)));
        let r_to = |limit: f64| last_while(shells().map(|s| (s.k, s.r.is_some_and(|r| r >= limit))));
        Summary {
            density_correlation: density.map(|d| d.correlation),
            density_mean_absolute_error: density.map(|d| d.mean_absolute_error),
            largest_power_deviation: spectra
                .map(|s| s.shells.iter().map(|s| deviation(s.ratio)).fold(0.0, f64::max))
                .filter(|d| d.is_finite()),
            power_within_1_percent_to: power_to(0.01),
            power_within_5_percent_to: power_to(0.05),
            power_within_10_percent_to: power_to(0.1),
            r_above_0_99_to: r_to(0.99),
            r_above_0_9_to: r_to(0.9),
            r_at_k_max: spectra.and_then(|s| s.shells.last()?.r),
            xi_within_10_percent_from: xi.and_then(xi_from),
            groups_within_10_percent_from: groups.and_then(groups_from),
            core_mass: groups.and_then(|g| g.apertures.iter().find(|a| a.sizes == [100, 299])?.median),
            nearest_mean: neighbours.map(|n| n.mean_ratio),
            nearest_median: neighbours.map(|n| n.median_ratio),
        }
    }
}

/// The last place up to which all is well.
fn last_while(places: impl Iterator<Item = (f64, bool)>) -> Option<f64> {
    places.take_while(|(_, good)| *good).last().map(|(k, _)| k)
}

fn xi_from(xi: &XiByPairs) -> Option<f64> {
    let truth = &xi.counts[0];
    (0..xi.ratio.len())
        .rev()
        .filter(|b| truth.xi[*b] >= LEAST_XI)
        .take_while(|b| xi.ratio[*b].is_some_and(|r| (r - 1.0).abs() <= 0.1))
        .last()
        .map(|b| truth.edges[b])
}

fn groups_from(groups: &GroupReport) -> Option<u64> {
    groups
        .histogram
        .iter()
        .rev()
        .filter(|c| c.groups[0] >= FEWEST_GROUPS)
        .take_while(|c| c.ratio.is_some_and(|r| (r - 1.0).abs() <= 0.1))
        .last()
        .map(|c| c.from)
}

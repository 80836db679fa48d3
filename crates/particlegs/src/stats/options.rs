//! What is measured, and how.

use super::Assignment;

/// A group of measurements that can be chosen alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// Density on a grid: agreement, distribution, slices, profiles.
    Density,
    /// P(k), cross power, r(k), and xi(r) from them.
    Spectrum,
    /// xi(r) by pair counts.
    Pairs,
    /// Friends-of-friends groups and the mass in their cores.
    Groups,
    /// Distances to the nearest neighbour.
    Neighbours,
    /// Moments along the axes.
    Moments,
    /// Likelihood of particles under a model.
    Likelihood,
}

impl Measure {
    /// All of them.
    pub const ALL: [Measure; 7] = [
        Measure::Density,
        Measure::Spectrum,
        Measure::Pairs,
        Measure::Groups,
        Measure::Neighbours,
        Measure::Moments,
        Measure::Likelihood,
    ];
}

/// Whose definitions are followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Convention {
    /// Cells of one length, windows and shot noise corrected, neighbours among all particles.
    Correct,
    /// The published table's: a grid stretched over the bounds, one box length for k, P(k) as it
    /// comes from the grid, neighbours among a random 500 000.
    Paper,
}

/// Options of [`super::compare`].
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StatsOptions {
    /// What to measure.
    pub measures: Vec<Measure>,
    /// Definitions.
    pub convention: Convention,
    /// Take no axis as periodic, whatever the truth says?
    pub open: bool,
    /// Cells along the longest edge for densities.
    pub cells: usize,
    /// Assignment for densities.
    pub assignment: Assignment,
    /// Cells along the longest edge for spectra.
    pub spectrum_cells: usize,
    /// Assignment for spectra.
    pub spectrum_assignment: Assignment,
    /// Average spectra with a grid moved by half a cell?
    pub interlaced: bool,
    /// Largest wave number; `None` = the truth's particle Nyquist frequency pi / spacing, as far as
    /// the grid goes.
    pub k_max: Option<f64>,
    /// Smallest and largest separation; `None` = a twentieth of the mean spacing, and an eighth of
    /// the shortest edge.
    pub separations: Option<[f64; 2]>,
    /// Bins of separation a decade.
    pub bins_per_decade: usize,
    /// Distances to take for xi(r), about, a band and side; above it primaries are a sample.
    pub pair_budget: u64,
    /// Linking length in mean spacings.
    pub linking: f64,
    /// Smallest group, particles.
    pub smallest_group: usize,
    /// Radius of the apertures in mean spacings of the truth: 0.128 is 0.05 Mpc/h on nbody128.
    pub aperture: f64,
    /// Particles whose nearest neighbour is sought.
    pub neighbour_sample: usize,
    /// Seed of samples.
    pub seed: u64,
}

impl Default for StatsOptions {
    fn default() -> Self {
        StatsOptions {
            measures: Measure::ALL.to_vec(),
            convention: Convention::Correct,
            open: false,
            cells: 256,
            assignment: Assignment::Ngp,
            spectrum_cells: 256,
            spectrum_assignment: Assignment::Tsc,
            interlaced: true,
            k_max: None,
            separations: None,
            bins_per_decade: 10,
            pair_budget: 300_000_000,
            linking: 0.2,
            smallest_group: 20,
            aperture: 0.128,
            neighbour_sample: 500_000,
            seed: 42,
        }
    }
}

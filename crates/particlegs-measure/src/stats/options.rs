//! What is measured, and how.

use super::Assignment;

particlegs_core::named_values! {
    /// A group of measurements that can be chosen alone.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Measure {
        Density = "density": "Density on a grid",
        Spectrum = "spectrum": "P(k), r(k), and xi(r) by Fourier transform",
        Pairs = "pairs": "xi(r) by pair counts",
        Groups = "groups": "Friends-of-friends groups and the mass in their cores",
        Neighbours = "neighbours": "Distances to the nearest neighbour",
        Moments = "moments": "Moments of the positions along the axes",
        Likelihood = "likelihood": "Likelihood of particles under a model, in bits per particle",
        Rdf = "rdf": "g(r), the radial distribution function",
        Profile = "profile": "Density along the axes",
        Haloes = "haloes": "Density and enclosed mass around centres",
        Multipoles = "multipoles": "P0, P2 and P4 in redshift space",
        Momentum = "momentum": "P(k) of the momentum",
        Dispersion = "dispersion": "Velocity dispersion around centres",
        Joint = "joint": "Joint histogram of two fields, such as density and temperature",
    }
}

particlegs_core::named_values! {
    /// Whose definitions are followed.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Convention {
        Correct = "correct": "Cubic cells; the mass assignment and the shot noise are corrected",
        Paper = "paper": "Definitions of the published table",
    }
}

/// Options of [`super::compare`].
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StatsOptions {
    /// What to measure.
    pub measures: Vec<Measure>,
    /// Whose definitions.
    pub convention: Convention,
    /// Take no axis as periodic, whatever the truth says?
    pub open: bool,
    /// Cells along the longest edge for densities; `None` = cells of eight particles ([`super::Grid::of_eight`]), by
    /// published definitions 256.
    pub cells: Option<usize>,
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
    /// Distances to take for xi(r), about, a band and side; above it primaries are a sample. g(r) takes a third.
    pub pair_budget: u64,
    /// Largest distance of g(r); `None` = four mean spacings, as far as the box goes.
    pub rdf_max: Option<f64>,
    /// The axis whose profile is in the summary: 0, 1, 2.
    pub profile_axis: usize,
    /// Slabs of a profile.
    pub profile_bins: usize,
    /// Centres of haloes, world units, and the largest radius where one is stated; `None` = the truth's groups of 100
    /// particles and more, the 1000 largest of them.
    #[serde(skip)]
    pub centers: Option<Vec<([f64; 3], Option<f64>)>>,
    /// Largest radius about all centres; `None` = what is stated with each, else two mean spacings.
    pub halo_radius: Option<f64>,
    /// Shells about a centre.
    pub halo_bins: usize,
    /// Linking length in mean spacings.
    pub linking: f64,
    /// The linking length itself, such as `0.02Mpc`, or a number in the truth's unit: goes before `linking`.
    pub linking_length: Option<String>,
    /// Smallest group, particles.
    pub smallest_group: usize,
    /// Radius of the apertures in mean spacings of the truth: 0.128 is 0.05 Mpc/h on nbody128.
    pub aperture: f64,
    /// Particles whose nearest neighbour is sought.
    pub neighbour_sample: usize,
    /// The two scalars of joint histograms; `None` = the first that both sides have.
    pub joint: Option<[String; 2]>,
    /// Bins along either axis of joint histograms.
    pub joint_bins: usize,
    /// Seed of samples.
    pub seed: u64,
}

impl StatsOptions {
    /// Is anything measured of velocities?
    pub fn needs_velocities(&self) -> bool {
        self.measures.iter().any(|m| OF_VELOCITIES.contains(m))
    }

    /// Is anything measured of fields?
    pub fn needs_fields(&self) -> bool {
        self.needs_velocities() || self.measures.contains(&Measure::Joint)
    }
}

/// Measures of velocities.
pub(super) const OF_VELOCITIES: [Measure; 3] = [Measure::Multipoles, Measure::Momentum, Measure::Dispersion];

impl Default for StatsOptions {
    fn default() -> Self {
        StatsOptions {
            measures: Measure::ALL.to_vec(),
            convention: Convention::Correct,
            open: false,
            cells: None,
            assignment: Assignment::Ngp,
            spectrum_cells: 256,
            spectrum_assignment: Assignment::Tsc,
            interlaced: true,
            k_max: None,
            separations: None,
            bins_per_decade: 10,
            pair_budget: 300_000_000,
            rdf_max: None,
            profile_axis: 2,
            profile_bins: 200,
            centers: None,
            halo_radius: None,
            halo_bins: 20,
            linking: 0.2,
            linking_length: None,
            smallest_group: 20,
            aperture: 0.128,
            neighbour_sample: 500_000,
            joint: None,
            joint_bins: 50,
            seed: 42,
        }
    }
}

//! Statistics of particles, or of a mixture itself, against those of a truth.
//!
//! [`compare`] does the whole job over the truth's box ([`Domain`]). Densities are deposited on a [`Grid`] (`deposit`,
//! `gaussian`, `resolved`; fields by `field_cells`), compared cell by cell (`density`) and transformed (`transform`)
//! into P(k), r(k) and xi(r) (`spectrum`). Measures of neighbours sort positions into cells: pair counts (`points`,
//! `pairs`), friends-of-friends groups (`groups`) and the mass in their cores (`aperture`); in zooms of the finest
//! particles (`linking`); groups are compared by size (`group_report`); nearest neighbours use the particles' tree
//! (`neighbours`). Pairs in linear bins are g(r) (`rdf`); densities along axes (`profile`) and about centres (`haloes`)
//! are of particles or of the Gaussians themselves, which particles are scored under, too (`likelihood`). Particles
//! with velocities (`velocities`) have power in redshift space and of their momentum (`multipoles`), and dispersions
//! about centres (`dispersion`); those with scalars have joint histograms of two (`joint`). The frames of a series are
//! measured one after the other (`evolution`); pictures of them follow centres of mass (`mass_center`).

mod aperture;
mod compare;
mod comparison_job;
mod density;
mod deposit;
mod dispersion;
mod evolution;
mod field_cells;
mod frame_table;
mod gaussian;
mod grid;
mod group_report;
mod groups;
mod haloes;
mod joint;
mod likelihood;
mod linking;
mod mass_center;
mod moments;
mod multipoles;
mod neighbours;
mod pairs;
mod points;
mod power_target;
pub(crate) mod presentation;
mod profile;
mod rdf;
mod resolved;
mod series_statistics;
mod spectrum;
mod subject;
#[cfg(test)]
mod tests;
mod transform;
mod velocities;

pub use aperture::{ApertureMass, quantile};
pub(crate) use aperture::{group_center, group_offsets, mean_place, shrunk_center};
pub use compare::{Statistics, Summary, compare};
#[cfg(test)]
pub(crate) use density::PAPER_CELLS;
pub use density::{DensityComparison, DensityPdf, DensityReport};
pub use deposit::{Field, deposit};
pub(crate) use deposit::{deposit_bytes, deposit_for_modes, deposit_steps};
pub use dispersion::HaloDispersions;
pub(crate) use evolution::Evolution;
pub use evolution::{FieldMean, FrameStatistics, WaveShell};
pub use field_cells::field_in_cells;
pub use frame_table::{FrameTable, kind_of};
pub(crate) use gaussian::DepositScratch;
pub use gaussian::Slab;
pub use grid::{Assignment, Grid};
pub(crate) use group_report::{FEWEST_GROUPS, largest_deviation_of_numbers, size_histogram, sizes_within};
pub use group_report::{GroupReport, SizeClass};
pub use groups::Groups;
pub(crate) use groups::{find_groups, longest_link};
pub use haloes::HaloProfiles;
pub(crate) use haloes::{EnclosedMass, GaussianSpheres, number_error};
pub use joint::JointHistogram;
pub use likelihood::{Likelihood, MeanAndDispersion, density_at, field_at, likelihood};
pub(crate) use linking::LinkedParticles;
pub use mass_center::{MassCenter, mass_center, mass_center_near};
pub use moments::AxisMoments;
pub use multipoles::{MultipoleShell, Multipoles};
pub use neighbours::NearestDistances;
pub(crate) use neighbours::{NeighbourOptions, nearest_distances};
pub use pairs::PairCounts;
use particlegs_core::{Error, Result};
use particlegs_particles::{Domain, Tilt};
pub(crate) use points::{PointGrid, counterparts};
pub use points::{gathered, local_positions};
pub use power_target::{PowerDeviation, PowerTarget};
pub use presentation::StatsReport;
pub use profile::AxisProfile;
pub use series_statistics::SeriesStatistics;
pub(crate) use spectrum::{CachedTransform, scheme_of, spectra_of};
pub use spectrum::{Shell, Spectra, SpectrumOptions, power_spectra};
pub use subject::Subject;
pub use transform::XiByTransform;
pub(crate) use velocities::ParticleFields;
pub use velocities::StatsSide;

particlegs_core::named_values! {
    /// A group of measurements that can be chosen alone.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
    /// Source of the definitions that are followed.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Convention {
        Correct = "correct": "Cubic cells; the mass assignment and the shot noise are corrected",
        Paper = "paper": "Definitions of the published table",
    }
}

impl Convention {
    /// The treatment of shot noise in spectra of density and momentum, for titles of plots.
    fn shot_noise(self) -> &'static str {
        match self {
            Convention::Correct => "shot noise subtracted",
            Convention::Paper => "shot noise included",
        }
    }
}

/// Options of [`compare`]. As a record that is read, also by the names that they have on the command line.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StatsOptions {
    /// Measures to take.
    #[serde(alias = "only")]
    pub measures: Vec<Measure>,
    /// Source of the definitions.
    pub convention: Convention,
    /// Whether no axis is taken as periodic, whatever the truth says.
    pub open: bool,
    /// Cells along the longest edge for densities; `None` = cells of eight particles ([`Grid::of_eight`]), by
    /// published definitions 256.
    #[serde(alias = "grid")]
    pub cells: Option<usize>,
    /// Assignment for densities.
    pub assignment: Assignment,
    /// Cells along the longest edge for spectra.
    #[serde(alias = "spectrum_grid")]
    pub spectrum_cells: usize,
    /// Assignment for spectra.
    pub spectrum_assignment: Assignment,
    /// Whether spectra are averaged with those of a grid moved by half a cell.
    #[serde(alias = "interlacing")]
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
    #[serde(alias = "pairs")]
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
    /// Largest radius about all centres; `None` = the one stated with each, else two mean spacings.
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
    #[serde(alias = "neighbours")]
    pub neighbour_sample: usize,
    /// The two scalars of joint histograms; `None` = the first that both sides have.
    pub joint: Option<[String; 2]>,
    /// Bins along either axis of joint histograms.
    pub joint_bins: usize,
    /// Seed of samples.
    pub seed: u64,
}

impl StatsOptions {
    /// Whether anything is measured of velocities.
    pub fn needs_velocities(&self) -> bool {
        self.measures.iter().any(|m| OF_VELOCITIES.contains(m))
    }

    /// Whether anything is measured of fields.
    pub fn needs_fields(&self) -> bool {
        self.needs_velocities() || self.measures.contains(&Measure::Joint)
    }

    /// Refuses options out of range.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub fn check(&self) -> Result<()> {
        within("the number of cells of the density grid", self.cells.unwrap_or(2) as f64, 2.0, 8192.0)?;
        within("the number of cells of the spectrum's grid", self.spectrum_cells as f64, 4.0, 8192.0)?;
        within("the number of bins per decade", self.bins_per_decade as f64, 1.0, 1000.0)?;
        within("the linking length in mean spacings", self.linking, 1e-6, 2.0)?;
        within("the aperture in mean spacings", self.aperture, 1e-6, 100.0)?;
        within("the size of the smallest group", self.smallest_group as f64, 2.0, 1e9)?;
        within("the sample of neighbours", self.neighbour_sample as f64, 2.0, 4e9)?;
        within("the axis of a profile", self.profile_axis as f64, 0.0, 2.0)?;
        within("the number of slabs of a profile", self.profile_bins as f64, 1.0, 10_000.0)?;
        within("the number of bins of a joint histogram", self.joint_bins as f64, 2.0, 1000.0)?;
        within("the number of shells around a halo", self.halo_bins as f64, 1.0, 1000.0)?;
        let positive = |name: &str, value: Option<f64>| within(name, value.unwrap_or(1.0), f64::MIN_POSITIVE, f64::MAX);
        positive("the largest distance of g(r)", self.rdf_max)?;
        let stated = self.centers.iter().flatten().filter_map(|(_, r)| *r);
        stated.chain(self.halo_radius).try_for_each(|r| positive("the radius of a halo", Some(r)))?;
        if self.centers.iter().flatten().any(|(c, _)| c.iter().any(|v| !v.is_finite())) {
            return Err(Error::argument("the centres of haloes must be finite"));
        }
        positive("the largest wave number", self.k_max)?;
        if self.joint.as_ref().is_some_and(|[x, y]| x.eq_ignore_ascii_case(y)) {
            return Err(Error::argument("a joint histogram needs two different fields"));
        }
        match self.separations {
            Some([low, high]) if !(low > 0.0 && high > low && high.is_finite()) => Err(Error::argument(format!(
                "separations must be above 0 and in ascending order, not {low:e} to {high:e}"
            ))),
            Some([low, high]) if high / low > WIDEST_SEPARATIONS => Err(Error::argument(format!(
                "separations {low:e} to {high:e} span more than a factor of {WIDEST_SEPARATIONS:e}"
            ))),
            _ => Ok(()),
        }
    }
}

/// Refuses a value of an option that is out of range.
pub(crate) fn within(name: &str, value: f64, low: f64, high: f64) -> Result<()> {
    let range = || match (low == f64::MIN_POSITIVE, high == f64::MAX) {
        (true, true) => "positive".to_string(),
        (true, false) => format!("above 0 and at most {high}"),
        (false, true) => format!("at least {low}"),
        (false, false) => format!("{low} to {high}"),
    };
    let fault = || Error::argument(format!("{name} must be {}, not {value}", range()));
    (low..=high).contains(&value).then_some(()).ok_or_else(fault)
}

/// Largest over smallest separation: float32 positions tell no more apart.
const WIDEST_SEPARATIONS: f64 = 1e9;

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

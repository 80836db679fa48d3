//! What recovered particles, or a mixture itself, are good for, in numbers.
//!
//! [`compare`] does the whole job over the truth's box ([`Domain`]). Densities are deposited on a
//! [`Grid`] (`deposit`, `gaussian`, `resolved`; fields by `field_cells`), compared cell by cell (`density`) and transformed (`transform`)
//! into P(k), r(k) and xi(r) (`spectrum`, `xi_transform`). What looks at neighbours sorts positions
//! into cells: pair counts (`points`, `pairs`), friends-of-friends groups (`groups`) and the mass in
//! their cores (`aperture`); in zooms of the finest particles (`linking`); groups are compared by size (`sizes`); nearest neighbours use the particles' tree (`neighbours`).
//! Pairs in linear bins are g(r) (`rdf`); densities along axes (`profile`) and about centres (`haloes`) are of
//! particles or of the Gaussians themselves (`sphere`), which particles are scored under, too (`likelihood`).
//! Particles with velocities (`velocities`) have power in redshift space and of their momentum (`multipoles`), and
//! dispersions about centres (`dispersion`); those with scalars have joint histograms of two (`joint`).
//! The frames of a series are measured one after the other (`evolution`); pictures of them follow centres of mass
//! (`mass_center`).

mod aperture;
mod boxes;
mod cell_quantity;
mod compare;
mod density;
mod deposit;
mod dispersion;
mod evolution;
mod field_cells;
mod gaussian;
mod grid;
mod groups;
mod haloes;
mod joint;
mod likelihood;
mod linking;
mod mass_center;
mod moments;
mod multipoles;
mod neighbours;
mod options;
mod pairs;
mod points;
mod profile;
mod rdf;
mod report;
mod resolved;
#[cfg(test)]
mod scipy_tests;
mod sizes;
mod slab;
mod spectrum;
#[cfg(test)]
mod spectrum_tests;
mod subject;
mod summary;
mod transform;
mod velocities;
mod xi_transform;

pub use aperture::{ApertureMass, quantile};
pub(crate) use aperture::{group_center, group_offsets, mean_place, shrunk_center};
#[cfg(test)]
pub(crate) use compare::PAPER_CELLS;
pub use compare::compare;
pub use density::{DensityComparison, DensityPdf};
pub use deposit::{Field, deposit};
pub(crate) use deposit::{deposit_bytes, deposit_steps};
pub use dispersion::HaloDispersions;
pub use evolution::{Evolution, FieldMean, FrameStatistics, WaveShell};
pub use field_cells::field_in_cells;
pub(crate) use gaussian::DepositScratch;
pub use grid::{Assignment, Grid};
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
pub use options::{Convention, Measure, StatsOptions};
pub use pairs::PairCounts;
use particlegs_particles::{Domain, Tilt};
pub(crate) use points::PointGrid;
pub use points::{gathered, local_positions};
pub use profile::AxisProfile;
pub use report::{DensityReport, GroupReport, Statistics, Summary, XiByTransform};
pub use sizes::SizeClass;
pub(crate) use sizes::size_histogram;
pub use slab::Slab;
pub(crate) use spectrum::{CachedTransform, spectra_of};
pub use spectrum::{Shell, Spectra, SpectrumOptions, power_spectra};
pub use subject::Subject;
pub(crate) use summary::{FEWEST_GROUPS, largest_deviation_of_numbers, sizes_within};
pub use velocities::{ParticleFields, StatsSide};

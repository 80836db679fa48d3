//! The whole job: everything that is asked for, of truth and other, over the truth's box.

use super::comparison_job::{ComparisonJob, check_boxes};
use super::dispersion::halo_dispersions;
use super::haloes::HaloPlaces;
use super::joint::joint_histograms;
use super::linking::{LinkedGroups, length_in};
use super::moments::axis_moments;
use super::multipoles::momentum_spectra;
use super::neighbours::with_distance_ratios;
use super::pairs::{with_xi_ratio, xi_from};
use super::presentation::Presentation;
use super::profile::axis_profiles;
use super::rdf::{largest_difference, with_g};
use super::subject::ConvertedSubject;
use super::velocities::unit_of;
use super::*;
use particlegs_core::context::Context;
use particlegs_core::model::check_densities;
use particlegs_particles::Particles;
use serde::Serialize;
use std::borrow::Cow;

/// Everything measured; `None` = not asked for, or not to be had of a model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// The options that it was measured with.
    pub options: StatsOptions,
    /// The truth's box, which the other is put into.
    pub domain: Domain,
    /// Particles, or those that a model stands for.
    pub particles: [u64; 2],
    /// Whether a side is a model's mixture itself.
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
    /// Notes for a reader: choices made, things left out.
    pub notes: Vec<String>,
}

/// Declares the figures of a summary, each with its value.
macro_rules! summary {
    ($s:ident: $($(#[$about:meta])* $name:ident: $type:ty = $value:expr;)*) => {
        /// `None` = not measured; of a limit, also where nothing reaches it.
        #[derive(Clone, Debug, Default, PartialEq, Serialize)]
        pub struct Summary {
            $($(#[$about])* pub $name: $type,)*
        }

        impl Summary {
            /// The figures of statistics whose own summary is not looked at.
            fn new($s: &Statistics) -> Self {
                Summary { $($name: $value),* }
            }
        }
    };
}

summary! { s:
    /// Pearson correlation of densities.
    density_correlation: Option<f64> = s.density.as_ref().map(|d| d.agreement.correlation);
    /// Mean absolute error of delta.
    density_mean_absolute_error: Option<f64> = s.density.as_ref().map(|d| d.agreement.mean_absolute_error);
    /// Largest |P_other / P_truth - 1| of any shell.
    largest_power_deviation: Option<f64> = s.spectra.as_ref().and_then(Spectra::largest_power_deviation);
    /// P(k) is within 1 % up to here.
    power_within_1_percent_to: Option<f64> = s.spectra.as_ref().and_then(|p| p.power_within(0.01));
    /// P(k) is within 5 % up to here.
    power_within_5_percent_to: Option<f64> = s.spectra.as_ref().and_then(|p| p.power_within(0.05));
    /// P(k) is within 10 % up to here.
    power_within_10_percent_to: Option<f64> = s.spectra.as_ref().and_then(|p| p.power_within(0.1));
    /// r(k) is at least 0.99 up to here.
    r_above_0_99_to: Option<f64> = s.spectra.as_ref().and_then(|p| p.r_above(0.99));
    /// r(k) is at least 0.9 up to here.
    r_above_0_9_to: Option<f64> = s.spectra.as_ref().and_then(|p| p.r_above(0.9));
    /// r at the last shell.
    r_at_k_max: Option<f64> = s.spectra.as_ref().and_then(|s| s.shells.last()?.r);
    /// xi(r) is within 10 % from here on, as far as the truth's is above 0.1: by pairs, and by transform
    /// where pairs are of a sample.
    xi_within_10_percent_from: Option<f64> = s.xi_by_pairs.as_ref().and_then(|p| xi_from(p, s.xi_by_transform.as_ref()));
    /// Groups of this size and above have counts within 10 %, in classes joined to hold at least 100.
    groups_within_10_percent_from: Option<u64> = s.groups.as_ref().and_then(|g| sizes_within(&g.histogram, 0.1).flatten());
    /// Median of other / truth within the aperture, groups of 100 to 299.
    core_mass: Option<f64> = s.groups.as_ref().and_then(|g| g.apertures.iter().find(|a| a.sizes == [100, 299])?.median);
    /// Mean nearest distance, other / truth.
    nearest_mean: Option<f64> = s.neighbours.as_ref().map(|[truth, other]| other.mean / truth.mean);
    /// Median nearest distance, other / truth.
    nearest_median: Option<f64> = s.neighbours.as_ref().map(|[truth, other]| other.median / truth.median);
    /// Distances of the first peak of g(r), truth and other.
    rdf_peak_at: [Option<f64>; 2] = peaks(s).map(|p| p.map(|[r, _]| r));
    /// Heights of that peak, truth and other.
    rdf_peak_height: [Option<f64>; 2] = peaks(s).map(|p| p.map(|[_, g]| g));
    /// Largest difference of g(r), other - truth, among bins of 100 pairs and more in an ideal gas.
    rdf_largest_difference: Option<f64> = s.rdf.as_ref().and_then(largest_difference).map(|[_, d]| d);
    /// RMS difference of the densities along the chosen axis, in units of the mean.
    profile_relative_difference: Option<f64> = profile(s).map(|p| p.relative_difference);
    /// Half-mass heights along it, truth and other.
    profile_half_mass_height: [Option<f64>; 2] = [0, 1].map(|side| profile(s).map(|p| p.half_mass_height[side]));
    /// Median of enclosed mass, other / truth, within the largest radius about centres.
    halo_mass: Option<f64> = s.haloes.as_ref().and_then(|h| *h.median.last()?);
    /// P0 in redshift space is within 1 % up to here.
    monopole_within_1_percent_to: Option<f64> = s.multipoles.as_ref().and_then(|m| m.monopole_within(0.01));
    /// P0 in redshift space is within 5 % up to here.
    monopole_within_5_percent_to: Option<f64> = s.multipoles.as_ref().and_then(|m| m.monopole_within(0.05));
    /// Largest |P2_other - P2_truth| / P0_truth of any shell.
    largest_quadrupole_deviation: Option<f64> = s.multipoles.as_ref().and_then(Multipoles::largest_quadrupole_deviation);
    /// P(k) of the momentum is within 5 % up to here.
    momentum_within_5_percent_to: Option<f64> = s.momentum.as_ref().and_then(|m| m.power_within(0.05));
    /// Median of velocity dispersions about centres, other / truth.
    halo_dispersion: Option<f64> = s.dispersion.as_ref().and_then(|d| d.median);
    /// Share of the mass that lies in other cells of a joint histogram: the largest of all layers.
    joint_difference: Option<f64> = s.joint.iter().flatten().map(|j| j.difference).reduce(f64::max);
}

fn peaks(s: &Statistics) -> [Option<[f64; 2]>; 2] {
    [0, 1].map(|side| s.rdf.as_ref().and_then(|pair| pair[side].first_peak()))
}

/// The profile along the chosen axis.
fn profile(s: &Statistics) -> Option<&AxisProfile> {
    s.profiles.as_ref()?.get(s.options.profile_axis)
}

/// Shows each measure that was asked for, in the order of the lines.
pub(super) fn show(s: &Statistics, to: &mut Presentation) {
    s.density.iter().for_each(|d| density::show(d, s.particles[0], to));
    s.spectra.iter().for_each(|p| spectrum::show(p, s.options.convention, to));
    pairs::show(s.xi_by_pairs.as_ref(), s.xi_by_transform.as_ref(), to);
    s.groups.iter().for_each(|g| group_report::show(g, to));
    s.neighbours.iter().for_each(|both| neighbours::show(both, to));
    s.rdf.iter().for_each(|counts| rdf::show(counts, to));
    s.profiles.iter().for_each(|profiles| profile::show(profiles, s.options.profile_axis, to));
    s.haloes.iter().for_each(|h| haloes::show(h, to));
    let (unit, convention) = (s.velocity_unit.as_deref(), s.options.convention);
    multipoles::show(s.multipoles.as_ref(), s.momentum.as_ref(), (unit, convention), to);
    s.dispersion.iter().for_each(|d| dispersion::show(d, to));
    s.joint.iter().for_each(|all| joint::show(all, to));
    s.likelihood.iter().for_each(|l| likelihood::show(l, to));
}

/// Measures `other` against `truth`, in the units of the truth.
pub fn compare<'a>(
    truth: impl Into<StatsSide<'a>>,
    other: impl Into<StatsSide<'a>>,
    o: &StatsOptions,
    context: &Context<'_>,
) -> Result<Statistics> {
    o.check()?;
    let sides: [StatsSide<'_>; 2] = [truth.into(), other.into()];
    let [truth, other] = sides.map(|s| s.subject);
    check_inputs([truth, other])?;
    let (converted, of_units) = other.in_units_of(truth)?;
    let other = match &converted {
        None => other,
        Some(ConvertedSubject::Particles(p)) => Subject::Particles(p),
        Some(ConvertedSubject::Model(m)) => Subject::Model(m),
    };
    let of_boxes = check_boxes([truth, other])?;
    let of_masses = check_masses([truth, other])?;
    // A length that cannot be converted is refused before anything is measured.
    o.linking_length.as_ref().map(|text| length_in(text, &truth.unit_system())).transpose()?;
    let fields = [sides[0].read_fields(o, context)?, sides[1].read_fields(o, context)?];
    let fields = fields.each_ref().map(Option::as_ref);
    let job = ComparisonJob { pair: [truth, other], domain: job_domain(truth, o), o, context };
    let mut statistics = Statistics::unmeasured(&job);
    statistics.notes.extend(of_units.into_iter().chain(of_boxes).chain(of_masses));
    statistics.measure_densities(&job)?;
    statistics.measure_neighbours(&job)?;
    let positions = job.positions()?;
    let positions = [&positions[0][..], &positions[1][..]];
    // Linked once: groups are compared, and are the centres of haloes where none are stated.
    let truth_groups = job.truth_groups(positions[0], &mut statistics.notes)?;
    if job.both_particles().is_some() {
        statistics.measure_pairs(&job, positions, truth_groups.as_ref())?;
    }
    let velocities = if o.needs_velocities() { job.velocities(fields, &mut statistics.notes)? } else { None };
    let about_centers = job.wants(&[Measure::Haloes]) || job.wants(&[Measure::Dispersion]) && velocities.is_some();
    let centers =
        if about_centers { job.centers(positions[0], truth_groups.as_ref(), &mut statistics.notes)? } else { None };
    let places = centers.as_ref().map(|(centers, radii)| HaloPlaces { centers, radii, bins: o.halo_bins });
    if let Some(places) = places.as_ref().filter(|_| job.wants(&[Measure::Haloes])) {
        statistics.haloes = Some(job.haloes(positions, places)?);
    }
    if let Some(pair) = &velocities {
        statistics.measure_velocities(&job, pair, places.as_ref())?;
    }
    if job.wants(&[Measure::Joint]) {
        // Of a model it is asked alone whether it stores correlations, which does not depend on units.
        let subjects = sides.map(|s| s.subject);
        let joint = joint_histograms(subjects, fields, o, &mut statistics.notes, context)?;
        statistics.joint = Some(joint).filter(|all| !all.is_empty());
    }
    statistics.summary = Summary::new(&statistics);
    Ok(statistics)
}

impl Statistics {
    /// The statistics of a job of which nothing is measured yet, with its notes.
    fn unmeasured(job: &ComparisonJob<'_>) -> Statistics {
        Statistics {
            options: job.o.clone(),
            domain: job.domain,
            particles: job.pair.map(|s| s.count()),
            model: job.pair.map(|s| s.particles().is_none()),
            spacing: job.spacing(0),
            density: None,
            spectra: None,
            xi_by_transform: None,
            xi_by_pairs: None,
            groups: None,
            neighbours: None,
            moments: None,
            likelihood: None,
            rdf: None,
            profiles: None,
            haloes: None,
            velocity_unit: None,
            multipoles: None,
            momentum: None,
            dispersion: None,
            joint: None,
            summary: Summary::default(),
            notes: job.notes(),
        }
    }

    /// Measures that particles and mixtures have alike: densities on a grid and along axes, spectra, moments,
    /// likelihood.
    fn measure_densities(&mut self, job: &ComparisonJob<'_>) -> Result<()> {
        if job.wants(&[Measure::Density]) {
            self.density = Some(job.density()?);
        }
        if job.wants(&[Measure::Spectrum]) {
            (self.spectra, self.xi_by_transform) = job.spectrum()?;
        }
        if job.wants(&[Measure::Moments]) {
            self.moments = Some(job.pair.map(axis_moments));
        }
        if job.wants(&[Measure::Likelihood]) {
            self.likelihood = job.likelihood()?;
        }
        if job.wants(&[Measure::Profile]) {
            self.profiles = Some(axis_profiles(job.pair, &job.domain, job.o.profile_bins, job.context)?);
        }
        Ok(())
    }

    /// Distances to nearest neighbours, and a note where a side has no particles that pairs are counted of.
    fn measure_neighbours(&mut self, job: &ComparisonJob<'_>) -> Result<()> {
        let particles = job.both_particles();
        if particles.is_none() && job.wants(&[Measure::Pairs, Measure::Groups, Measure::Neighbours, Measure::Rdf]) {
            self.notes
                .push("pairs, groups, neighbours and g(r) were skipped: recover particles from the model first".into());
        }
        if let Some(pair) = particles.filter(|_| job.wants(&[Measure::Neighbours])) {
            self.neighbours = Some(job.neighbours(pair)?);
        }
        Ok(())
    }

    /// Pairs of particles by separation, and groups of linked ones.
    fn measure_pairs(
        &mut self,
        job: &ComparisonJob<'_>,
        positions: [&[[f64; 3]]; 2],
        truth_groups: Option<&LinkedGroups>,
    ) -> Result<()> {
        if job.wants(&[Measure::Pairs]) {
            self.xi_by_pairs = Some(job.pairs(positions, &mut self.notes)?);
        }
        if job.wants(&[Measure::Rdf]) {
            self.rdf = Some(job.rdf(positions, &mut self.notes)?);
        }
        if let Some(truth) = truth_groups.filter(|_| job.wants(&[Measure::Groups])) {
            self.groups = job.groups(positions, truth, &mut self.notes)?;
        }
        Ok(())
    }

    /// Spectra of velocities, and their dispersions about `places`.
    fn measure_velocities(
        &mut self,
        job: &ComparisonJob<'_>,
        pair: &[Cow<'_, ParticleFields>; 2],
        places: Option<&HaloPlaces<'_>>,
    ) -> Result<()> {
        self.velocity_unit = unit_of(pair).map(str::to_string);
        let pair = [&*pair[0], &*pair[1]];
        if job.wants(&[Measure::Multipoles]) {
            self.multipoles = job.multipoles(pair, self.velocity_unit.as_deref(), &mut self.notes)?;
        }
        if job.wants(&[Measure::Momentum]) {
            self.momentum = Some(momentum_spectra(pair, &job.domain, &job.spectrum_options(), job.context)?);
        }
        if let Some(places) = places.filter(|_| job.wants(&[Measure::Dispersion])) {
            self.dispersion = Some(halo_dispersions(pair, &job.domain, places, job.context)?);
        }
        Ok(())
    }
}

/// Refuses particles in files that have become shorter since they were opened, and inputs without particles.
fn check_inputs(pair: [Subject<'_>; 2]) -> Result<()> {
    pair.iter().filter_map(Subject::particles).try_for_each(Particles::check_files)?;
    for (name, subject) in ["the truth", "the other"].into_iter().zip(pair) {
        if subject.count() == 0 {
            return Err(Error::input(name, "there are no particles to measure"));
        }
    }
    Ok(())
}

/// Refuses sides whose densities sum different things. Where one states no masses and all of the other's are the same,
/// the two are measured alike, which a reader of the results must know.
fn check_masses(pair: [Subject<'_>; 2]) -> Result<Option<String>> {
    let [truth, other] = pair.map(|s| s.density_of());
    // Numbers of particles and equal masses are one density but for a factor, which contrasts do not have.
    let side = match (truth.0, other.0) {
        ("particles", "mass") if other.1.is_some() => "the truth",
        ("mass", "particles") if truth.1.is_some() => "the other input",
        (a, b) => return check_densities(("the truth", a), ("the other", b)).map(|()| None),
    };
    Ok(Some(format!("{side} states no masses: its particles are taken to have the same mass, as all others have")))
}

/// The truth's box; its bounds where it is to be taken as open, as the published convention does.
fn job_domain(truth: Subject<'_>, o: &StatsOptions) -> Domain {
    if o.convention == Convention::Correct && !o.open {
        return truth.domain();
    }
    Domain::new(&truth.bounds(), None)
}

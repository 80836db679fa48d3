//! The whole job: everything that is asked for, of truth and other, over the truth's box.

use super::aperture::{aperture_mass, counts_within, group_center};
use super::boxes::check_boxes;
use super::density::{central_slice, compare_density, density_pdf, mean_mass};
use super::dispersion::halo_dispersions;
use super::haloes::{HaloPlaces, HaloSide, halo_profiles};
use super::joint::joint_histograms;
use super::likelihood::likelihood;
use super::linking::{LinkedGroups, LinkedParticles, length_in};
use super::moments::axis_moments;
use super::multipoles::{momentum_spectra, multipoles};
use super::neighbours::{NeighbourOptions, nearest_distances};
use super::options::OF_VELOCITIES;
use super::pairs::{PairOptions, count_pairs, logarithmic_edges, longest_separation};
use super::points::local_positions;
use super::profile::axis_profiles;
use super::rdf::rdf_edges;
use super::report::{DensityReport, GroupReport, Statistics, XiByTransform};
use super::spectrum::{SpectrumOptions, TransformPair, spectra, transform_pair};
use super::subject::ConvertedSubject;
use super::velocities::{displacement, unit_of, velocity_pair};
use super::xi_transform::xi_of_modes;
use super::{
    AxisProfile, Convention, Domain, Field, Grid, Groups, HaloProfiles, Likelihood, Measure, Multipoles,
    NearestDistances, PairCounts, ParticleFields, SizeClass, StatsOptions, StatsSide, Subject, Summary, deposit,
    deposit_bytes, deposit_steps, longest_link, size_histogram,
};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, check_densities};
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::Particles;
use std::borrow::Cow;
use std::f64::consts::PI;

/// Sizes of groups whose cores are compared.
const CORES: [[u64; 2]; 3] = [[100, 299], [300, 999], [1000, u64::MAX]];

/// Particles of the smallest group whose centre is a halo's, and the most haloes.
const LEAST_HALO: usize = 100;
const MOST_HALOES: usize = 1000;
/// How far g(r) and haloes go, in mean spacings.
const RDF_SPACINGS: f64 = 4.0;
const HALO_SPACINGS: f64 = 2.0;

/// Cells along each edge for densities of the published table.
pub(crate) const PAPER_CELLS: usize = 256;

/// Largest over smallest separation: float32 positions tell no more apart.
const WIDEST_SEPARATIONS: f64 = 1e9;

/// Measures `other` against `truth`, in the units of the truth.
pub fn compare<'a>(
    truth: impl Into<StatsSide<'a>>,
    other: impl Into<StatsSide<'a>>,
    o: &StatsOptions,
    context: &Context<'_>,
) -> Result<Statistics> {
    compare_sides([truth.into(), other.into()], o, context)
}

fn compare_sides(sides: [StatsSide<'_>; 2], o: &StatsOptions, context: &Context<'_>) -> Result<Statistics> {
    check(o)?;
    let [truth, other] = sides.map(|s| s.subject);
    [truth, other].iter().filter_map(Subject::particles).try_for_each(Particles::check_files)?;
    for (name, subject) in [("the truth", &truth), ("the other", &other)] {
        if subject.count() == 0 {
            return Err(Error::input(name, "there are no particles to measure"));
        }
    }
    let (converted, of_units) = other.in_units_of(truth)?;
    let other = match &converted {
        None => other,
        Some(ConvertedSubject::Particles(p)) => Subject::Particles(p),
        Some(ConvertedSubject::Model(m)) => Subject::Model(m),
    };
    let of_boxes = check_boxes([truth, other])?;
    let of_masses = check_masses([truth, other])?;
    o.linking_length.as_ref().map(|text| length_in(text, &truth.unit_system())).transpose()?;
    let job = ComparisonJob { pair: [truth, other], domain: job_domain(truth, o), o, context };
    let wants = |m| o.measures.contains(&m);
    let mut notes = job.notes();
    notes.extend(of_units.into_iter().chain(of_boxes).chain(of_masses));
    let density = if wants(Measure::Density) { Some(job.density()?) } else { None };
    let (spectra, xi_by_transform) = if wants(Measure::Spectrum) { job.spectrum()? } else { (None, None) };
    let moments = wants(Measure::Moments).then(|| job.pair.map(axis_moments));
    let likelihood = if wants(Measure::Likelihood) { job.likelihood()? } else { None };
    let profiles = if wants(Measure::Profile) { Some(job.profiles()?) } else { None };
    let particles = job.both_particles();
    let of_pairs = |m| particles.is_some() && wants(m);
    let of_particles = [Measure::Pairs, Measure::Groups, Measure::Neighbours, Measure::Rdf];
    if particles.is_none() && of_particles.iter().any(|m| wants(*m)) {
        notes.push("pairs, groups, neighbours and g(r) were skipped: recover particles from the model first".into());
    }
    let neighbours = match particles {
        Some(pair) if wants(Measure::Neighbours) => Some(job.neighbours(pair)?),
        _ => None,
    };
    let positions = job.positions()?;
    let positions = [&positions[0][..], &positions[1][..]];
    let truth_groups = job.truth_groups(positions[0], &mut notes)?;
    let xi_by_pairs = if of_pairs(Measure::Pairs) { Some(job.pairs(positions, &mut notes)?) } else { None };
    let rdf = if of_pairs(Measure::Rdf) { Some(job.rdf(positions, &mut notes)?) } else { None };
    let groups = match &truth_groups {
        Some(truth) if of_pairs(Measure::Groups) => job.groups(positions, truth, &mut notes)?,
        _ => None,
    };
    let moving = if o.needs_velocities() { job.velocities(sides, &mut notes)? } else { None };
    let about_centers = wants(Measure::Haloes) || wants(Measure::Dispersion) && moving.is_some();
    let centers = if about_centers { job.centers(positions[0], truth_groups.as_ref(), &mut notes)? } else { None };
    let places = centers.as_ref().map(|(centers, radii)| HaloPlaces { centers, radii, bins: o.halo_bins });
    let haloes = match &places {
        Some(places) if wants(Measure::Haloes) => Some(job.haloes(positions, places)?),
        _ => None,
    };
    let of_velocities = |m| moving.as_ref().filter(|_| wants(m)).map(|pair| [&*pair[0], &*pair[1]]);
    let velocity_unit = moving.as_ref().and_then(unit_of).map(str::to_string);
    let multipoles = match of_velocities(Measure::Multipoles) {
        Some(pair) => job.multipoles(pair, velocity_unit.as_deref(), &mut notes)?,
        None => None,
    };
    let momentum = of_velocities(Measure::Momentum)
        .map(|pair| momentum_spectra(pair, &job.domain, &job.spectrum_options(), context))
        .transpose()?;
    let dispersion = of_velocities(Measure::Dispersion)
        .zip(places.as_ref())
        .map(|(pair, places)| halo_dispersions(pair, &job.domain, places, context))
        .transpose()?;
    let joint = if wants(Measure::Joint) { Some(joint_histograms(sides, o, &mut notes, context)?) } else { None };
    let mut statistics = Statistics {
        options: o.clone(),
        domain: job.domain,
        particles: job.pair.map(|s| s.count()),
        model: job.pair.map(|s| s.particles().is_none()),
        spacing: job.spacing(0),
        density,
        spectra,
        xi_by_transform,
        xi_by_pairs,
        groups,
        neighbours,
        moments,
        likelihood,
        rdf,
        profiles,
        haloes,
        velocity_unit,
        multipoles,
        momentum,
        dispersion,
        joint: joint.filter(|all| !all.is_empty()),
        summary: Summary::default(),
        notes,
    };
    statistics.summary = Summary::new(&statistics);
    Ok(statistics)
}

/// Refuses sides whose densities sum different things. Where one states no masses and all of the other's are the same, the
/// two are measured alike, which a reader of the results must know.
fn check_masses(pair: [Subject<'_>; 2]) -> Result<Option<String>> {
    let [truth, other] = pair.map(|s| s.density_of());
    let side = match (truth.0, other.0) {
        ("particles", "mass") if other.1.is_some() => "the truth",
        ("mass", "particles") if truth.1.is_some() => "the other input",
        (a, b) => return check_densities(("the truth", a), ("the other", b)).map(|()| None),
    };
    Ok(Some(format!("{side} states no masses: its particles are taken to have the same mass, as all others have")))
}

pub(super) fn check(o: &StatsOptions) -> Result<()> {
    let within = |name: &str, value: f64, low: f64, high: f64| {
        if value >= low && value <= high {
            Ok(())
        } else {
            Err(Error::argument(format!("{name} must be {low} to {high}, not {value}")))
        }
    };
    within("the number of cells of the density grid", o.cells.unwrap_or(2) as f64, 2.0, 8192.0)?;
    within("the number of cells of the spectrum's grid", o.spectrum_cells as f64, 4.0, 8192.0)?;
    within("the number of bins per decade", o.bins_per_decade as f64, 1.0, 1000.0)?;
    within("the linking length in mean spacings", o.linking, 1e-6, 2.0)?;
    within("the aperture in mean spacings", o.aperture, 1e-6, 100.0)?;
    within("the size of the smallest group", o.smallest_group as f64, 2.0, 1e9)?;
    within("the sample of neighbours", o.neighbour_sample as f64, 2.0, 4e9)?;
    within("the axis of a profile", o.profile_axis as f64, 0.0, 2.0)?;
    within("the number of slabs of a profile", o.profile_bins as f64, 1.0, 10_000.0)?;
    within("the number of bins of a joint histogram", o.joint_bins as f64, 2.0, 1000.0)?;
    within("the number of shells around a halo", o.halo_bins as f64, 1.0, 1000.0)?;
    if let Some(r) = o.rdf_max {
        within("the largest distance of g(r)", r, f64::MIN_POSITIVE, f64::MAX)?;
    }
    let stated = o.centers.iter().flatten().filter_map(|(_, r)| *r);
    for r in stated.chain(o.halo_radius) {
        within("the radius of a halo", r, f64::MIN_POSITIVE, f64::MAX)?;
    }
    if o.centers.iter().flatten().any(|(c, _)| c.iter().any(|v| !v.is_finite())) {
        return Err(Error::argument("the centres of haloes must be finite"));
    }
    if let Some(k) = o.k_max {
        within("the largest wave number", k, f64::MIN_POSITIVE, f64::MAX)?;
    }
    if o.joint.as_ref().is_some_and(|[x, y]| x.eq_ignore_ascii_case(y)) {
        return Err(Error::argument("a joint histogram needs two different fields"));
    }
    match o.separations {
        Some([low, high]) if !(low > 0.0 && high > low && high.is_finite()) => {
            Err(Error::argument(format!("separations must be above 0 and in ascending order, not {low:e} to {high:e}")))
        }
        Some([low, high]) if high / low > WIDEST_SEPARATIONS => Err(Error::argument(format!(
            "separations {low:e} to {high:e} span more than a factor of {WIDEST_SEPARATIONS:e}"
        ))),
        _ => Ok(()),
    }
}

/// The truth's box; its bounds where it is to be taken as open, as the published convention does.
fn job_domain(truth: Subject<'_>, o: &StatsOptions) -> Domain {
    if o.convention == Convention::Correct && !o.open {
        return truth.domain();
    }
    Domain::new(&truth.bounds(), None)
}

pub(super) struct ComparisonJob<'a> {
    pub pair: [Subject<'a>; 2],
    pub domain: Domain,
    pub o: &'a StatsOptions,
    pub context: &'a Context<'a>,
}

impl ComparisonJob<'_> {
    fn paper(&self) -> bool {
        self.o.convention == Convention::Paper
    }

    /// Mean spacing of one side.
    pub fn spacing(&self, side: usize) -> f64 {
        self.domain.spacing(self.pair[side].count() as usize)
    }

    /// Particles of the larger side; 0 of a model.
    fn most_particles(&self) -> u64 {
        self.pair.iter().filter_map(|s| s.particles()).map(|p| p.len() as u64).max().unwrap_or(0)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = vec![];
        if self.wants(&[Measure::Spectrum, Measure::Momentum]) && self.domain.periodic.contains(&false) && !self.paper()
        {
            notes.push("some axes are not periodic, but P(k) treats them as periodic".into());
        }
        let bounds = self.pair[0].bounds();
        for k in (0..3).filter(|k| bounds.extent()[*k] == 0.0 && bounds.extent() != [0.0; 3]) {
            let (axis, length) = (["x", "y", "z"][k], self.domain.length[k]);
            notes.push(format!(
                "all particles have the same {axis}: volumes, spacing and g(r) assume a box {length:.4e} thick there"
            ));
        }
        if self.wants(&[Measure::Density, Measure::Profile]) && self.domain.tilt.is_some() {
            notes.push("the box is tilted: cells, slices and profiles follow the edges of its reduced cell".into());
        }
        if self.pair.iter().any(|s| s.particles().is_some_and(|p| p.weights().is_some())) {
            notes.push("pairs, groups, neighbours and g(r) count particles and ignore their weights".into());
        }
        let gridded = self.wants(&[Measure::Density, Measure::Spectrum]);
        if gridded && self.pair.iter().any(|s| s.particles().is_none()) {
            notes.push(
                "the model's density is its mixture, integrated over the cells (NGP window, no shot noise)".into(),
            );
        }
        let alpha = |s: &Subject<'_>| matches!(s, Subject::Model(m) if m.metadata.law == LawKind::AlphaBlend);
        if self.pair.iter().any(alpha) {
            notes.push(
                "the density of an alpha-blend model follows its opacities, which were fitted to pictures".into(),
            );
        }
        if self.paper() {
            notes.push(
                "the published convention uses NGP on a grid stretched over the bounds, one box length for k, no \
                 correction for shot noise or window, and neighbours in a random subset"
                    .into(),
            );
        }
        notes
    }

    /// `None` of two models or of two sets of particles.
    fn likelihood(&self) -> Result<Option<Likelihood>> {
        let (model, particles) = match self.pair {
            [Subject::Model(m), Subject::Particles(p)] | [Subject::Particles(p), Subject::Model(m)] => (m, p),
            _ => return Ok(None),
        };
        likelihood(model, particles, &self.domain, self.o.seed, self.context).map(Some)
    }

    fn density(&self) -> Result<DensityReport> {
        let grid = match self.o.cells {
            n if self.paper() => Grid::stretched(&self.domain, [n.unwrap_or(PAPER_CELLS); 3]),
            Some(n) => Grid::new(&self.domain, n),
            None => Grid::of_eight(&self.domain, self.pair[0].count() as usize),
        };
        particlegs_files::memory::require(
            "two density grids",
            deposit_bytes(&grid, self.most_particles()) + 4 * grid.len() as u64,
        )?;
        self.context.begin("density grids", self.pair.iter().map(|s| deposit_steps(*s, &grid)).sum());
        let of = |s: Subject<'_>| deposit(s, &grid, self.o.assignment, 0.0, self.context);
        let (a, b) = (of(self.pair[0])?, of(self.pair[1])?);
        self.context.end();
        let inside = |f: &Field| mean_mass(f) * f.grid.len() as f64;
        let [(of_a, mass_a), (of_b, mass_b)] = self.pair.map(|s| s.density_of());
        // Masses that one side does not state are those of the other.
        let unit = if of_a == of_b { 1.0 } else { mass_b.unwrap_or(1.0) / mass_a.unwrap_or(1.0) };
        Ok(DensityReport {
            cells: grid.cells,
            side: grid.side,
            agreement: compare_density(&a, &b),
            mass_ratio: (inside(&b) + b.outside) / (inside(&a) + a.outside) / unit,
            outside: [&a, &b].map(|f| f.outside / (inside(f) + f.outside)),
            pdf: density_pdf(&a, &b),
            slices: [0, 1, 2].map(|axis| [central_slice(&a, axis), central_slice(&b, axis)]),
        })
    }

    pub fn spectrum_options(&self) -> SpectrumOptions {
        let cells = self.o.spectrum_cells;
        let grid_limit = PI * cells as f64 / self.domain.longest();
        let wanted = self.o.k_max.unwrap_or(PI / self.spacing(0));
        SpectrumOptions {
            cells,
            assignment: if self.paper() { super::Assignment::Ngp } else { self.o.spectrum_assignment },
            interlaced: self.o.interlaced && !self.paper(),
            deconvolved: !self.paper(),
            shot_noise_subtracted: !self.paper(),
            k_max: if self.paper() { grid_limit } else { wanted.min(grid_limit) },
        }
    }

    fn spectrum(&self) -> Result<(Option<super::Spectra>, Option<XiByTransform>)> {
        let domain = if self.paper() {
            // One length for all three axes: the grid's cells are taken for cubes.
            Domain { length: [self.domain.longest(); 3], ..self.domain }
        } else {
            self.domain
        };
        let (cells, options) = (self.o.spectrum_cells, self.spectrum_options());
        let grid =
            if self.paper() { Grid::stretched(&self.domain, [cells; 3]) } else { Grid::new(&self.domain, cells) };
        let pair: TransformPair = transform_pair(self.pair, [None; 2], &grid, &domain, &options, self.context)?;
        let spectra = spectra(&pair, &domain, &options, self.context)?;
        // Bins as wide as the shortest wave's half: narrower ones hold its ringing.
        let (width, last) = (PI / options.k_max, self.edges().last().copied().unwrap_or(0.0));
        let edges: Vec<f64> = (1..=1000).map(|i| width * f64::from(i)).take_while(|r| *r <= last).collect();
        let xi = if edges.len() > 1 && !self.paper() {
            let xi = xi_of_modes(&pair, &domain, &options, &edges, self.context)?;
            Some(XiByTransform { xi, edges })
        } else {
            None
        };
        Ok((Some(spectra), xi))
    }

    /// Edges of the bins of separation.
    fn edges(&self) -> Vec<f64> {
        let longest = longest_separation(&self.domain);
        let [low, high] =
            self.o.separations.unwrap_or([0.05 * self.spacing(0), longest.min(0.125 * self.domain.shortest())]);
        let high = high.min(longest);
        logarithmic_edges(low.min(0.5 * high), high, self.o.bins_per_decade)
    }

    fn pairs(&self, positions: [&[[f64; 3]]; 2], notes: &mut Vec<String>) -> Result<[PairCounts; 2]> {
        let options = PairOptions { edges: self.edges(), band: 3.0, budget: self.o.pair_budget, seed: self.o.seed };
        let count = |side: usize| count_pairs(positions[side], &self.domain, &options, self.context);
        let counts = [count(0)?, count(1)?];
        if counts.iter().any(PairCounts::sampled) {
            notes.push("pairs at large separations are counted for a random sample of particles".into());
        }
        Ok(counts)
    }

    /// g(r), of fewer pairs than xi(r): its bands are wider and its bins narrower.
    fn rdf(&self, positions: [&[[f64; 3]]; 2], notes: &mut Vec<String>) -> Result<[PairCounts; 2]> {
        let longest = longest_separation(&self.domain);
        if let Some(wanted) = self.o.rdf_max.filter(|r| *r > longest) {
            notes.push(format!("g(r) ends at {longest:.4e} instead of {wanted:.4e}, because the box is too small"));
        }
        let edges = rdf_edges(self.o.rdf_max.unwrap_or(RDF_SPACINGS * self.spacing(0)).min(longest));
        let options = PairOptions { edges, band: 10.0, budget: self.o.pair_budget / 3, seed: self.o.seed };
        let count = |side: usize| count_pairs(positions[side], &self.domain, &options, self.context);
        let counts = [count(0)?, count(1)?];
        if counts.iter().any(PairCounts::sampled) {
            notes.push("g(r) is measured for a random sample of particles".into());
        }
        Ok(counts)
    }

    fn profiles(&self) -> Result<[AxisProfile; 3]> {
        axis_profiles(self.pair, &self.domain, self.o.profile_bins, self.context)
    }

    /// The particles, where both sides are some.
    fn both_particles(&self) -> Option<[&Particles; 2]> {
        let [truth, other] = self.pair.map(|s| s.particles());
        Some([truth?, other?])
    }

    fn wants(&self, measures: &[Measure]) -> bool {
        measures.iter().any(|m| self.o.measures.contains(m))
    }

    /// Positions of either side, where it has any and something is measured of them.
    fn positions(&self) -> Result<[Vec<[f64; 3]>; 2]> {
        let of_pairs = self.both_particles().is_some() && self.wants(&[Measure::Pairs, Measure::Groups, Measure::Rdf]);
        let needed = of_pairs || self.wants(&[Measure::Haloes, Measure::Dispersion]);
        let particles = self.pair.map(|s| s.particles().filter(|_| needed));
        let bytes = particles.iter().flatten().map(|p| 24 * p.len() as u64).sum();
        particlegs_files::memory::require("positions", bytes)?;
        Ok(particles.map(|p| p.map_or(Vec::new(), |p| local_positions(p, &self.domain))))
    }

    /// The truth's groups, where they are asked for or stand for haloes' centres. `None`, and a note, in a box too
    /// thin for links of that length.
    fn truth_groups(&self, positions: &[[f64; 3]], notes: &mut Vec<String>) -> Result<Option<LinkedGroups>> {
        let centers =
            self.wants(&[Measure::Haloes, Measure::Dispersion]) && self.o.centers.is_none() && !positions.is_empty();
        let measured = self.wants(&[Measure::Groups]) && self.both_particles().is_some();
        if centers || measured { self.find_groups(positions, 0, notes) } else { Ok(None) }
    }

    pub fn find_groups(
        &self,
        positions: &[[f64; 3]],
        side: usize,
        notes: &mut Vec<String>,
    ) -> Result<Option<LinkedGroups>> {
        let Some(particles) = self.pair[side].particles() else { return Ok(None) };
        let linked = LinkedParticles::new(particles, positions, &self.domain);
        let length = match &self.o.linking_length {
            Some(text) => length_in(text, &self.pair[0].unit_system())?,
            None => self.o.linking * linked.spacing,
        };
        let found = linked.groups(positions, &self.domain, length, self.o.smallest_group, self.context)?;
        match &found {
            None => {
                let longest = longest_link(&self.domain);
                notes.push(format!(
                    "no groups were measured: the linking length {length:.4e} exceeds a third of the box, {longest:.4e}"
                ));
            }
            Some(LinkedGroups { groups, linked: number, contaminated: Some(contaminated) }) => notes.push(format!(
                "groups of the {} link the lightest {number} of {} particles, which are {:.4e} apart on average: \
                 {contaminated} of {} groups contain heavier particles",
                ["truth", "other"][side],
                positions.len(),
                linked.spacing,
                groups.members.len(),
            )),
            Some(_) => {}
        }
        Ok(found)
    }

    /// Centres and the largest radius about each. `None`, and a note, where there are none.
    fn centers(
        &self,
        positions: &[[f64; 3]],
        truth: Option<&LinkedGroups>,
        notes: &mut Vec<String>,
    ) -> Result<Option<(Vec<[f64; 3]>, Vec<f64>)>> {
        let repeats = (0..3).filter(|k| self.domain.periodic[*k]).map(|k| 0.5 * self.domain.length[k]);
        let longest = repeats.fold(f64::INFINITY, f64::min);
        let default = (HALO_SPACINGS * self.spacing(0)).min(longest);
        let (centers, stated): (Vec<[f64; 3]>, Vec<Option<f64>>) = match (&self.o.centers, truth) {
            (Some(given), _) => given.iter().map(|(c, r)| (self.domain.local(*c), *r)).unzip(),
            (None, Some(found)) => {
                let large = found.groups.members.iter().take(MOST_HALOES).take_while(|m| m.len() >= LEAST_HALO);
                let center = |m: &Vec<u32>| (group_center(positions, m, &self.domain), None);
                parallel::map(large, center).into_iter().unzip()
            }
            (None, None) => (vec![], vec![]),
        };
        if centers.is_empty() {
            notes.push("no haloes were measured: there are no centres and no groups of 100 particles".into());
            return Ok(None);
        }
        let radii: Vec<f64> = stated.iter().map(|r| self.o.halo_radius.or(*r).unwrap_or(default)).collect();
        if let Some(r) = radii.iter().find(|r| **r > longest) {
            return Err(Error::argument(format!("the halo radius {r:.6} is more than half the box, {longest:.6}")));
        }
        Ok(Some((centers, radii)))
    }

    fn haloes(&self, positions: [&[[f64; 3]]; 2], places: &HaloPlaces<'_>) -> Result<HaloProfiles> {
        let side = |s: usize| HaloSide { subject: self.pair[s], positions: positions[s] };
        halo_profiles([side(0), side(1)], &self.domain, places, self.context)
    }

    /// Velocities of both sides. `None`, and a note, where one has none.
    fn velocities<'s>(
        &self,
        sides: [StatsSide<'s>; 2],
        notes: &mut Vec<String>,
    ) -> Result<Option<[Cow<'s, ParticleFields>; 2]>> {
        let found = velocity_pair(sides)?;
        if let Err(why) = &found {
            let wanted: Vec<&str> = OF_VELOCITIES.iter().filter(|m| self.wants(&[**m])).map(|m| m.name()).collect();
            notes.push(format!("no {}: {why}", wanted.join(", ")));
        }
        Ok(found.ok())
    }

    /// `None`, and a note, where velocities cannot be turned into lengths, and in a box that is not periodic.
    fn multipoles(
        &self,
        pair: [&ParticleFields; 2],
        unit: Option<&str>,
        notes: &mut Vec<String>,
    ) -> Result<Option<Multipoles>> {
        let moved = match self.domain.periodic {
            [true, true, true] => displacement(self.pair, unit),
            _ => Err("the box is not periodic along all axes".into()),
        };
        match moved {
            Ok(moved) => multipoles(pair, moved, &self.domain, &self.spectrum_options(), self.context).map(Some),
            Err(why) => {
                notes.push(format!("no multipoles: {why}"));
                Ok(None)
            }
        }
    }

    /// `None`, and a note, in a box too thin for links of the other's length.
    fn groups(
        &self,
        positions: [&[[f64; 3]]; 2],
        truth: &LinkedGroups,
        notes: &mut Vec<String>,
    ) -> Result<Option<GroupReport>> {
        let Some(other) = self.find_groups(positions[1], 1, notes)? else { return Ok(None) };
        let pair = [truth, &other];
        let apertures = self.apertures(positions, &truth.groups, notes)?;
        let sizes = pair.map(|f| f.groups.sizes());
        let smallest = self.o.smallest_group as u64;
        let class = |from: u64, to: Option<u64>| SizeClass::new(sizes.each_ref().map(|s| &s[..]), from, to);
        let classes = [(20, Some(49)), (50, Some(99)), (100, None)]
            .into_iter()
            .filter(|(_, to)| to.is_none_or(|t| t >= smallest))
            .map(|(from, to)| class(from.max(smallest), to))
            .collect();
        let largest = sizes.each_ref().map(|s| s.first().copied().unwrap_or(0));
        let histogram = size_histogram(sizes.each_ref().map(|s| &s[..]), smallest);
        Ok(Some(GroupReport {
            linking_length: pair.map(|f| f.groups.linking_length),
            linked: pair.map(|f| f.linked),
            contaminated: pair.map(|f| f.contaminated),
            classes,
            histogram,
            largest,
            grouped: [0, 1].map(|s| sizes[s].iter().sum::<u64>() as f64 / pair[s].linked as f64),
            apertures,
        }))
    }

    /// Shares of all particles within the aperture, other over truth, by size of the truth's group.
    /// None, and a note, where the aperture is wider than the box.
    fn apertures(
        &self,
        positions: [&[[f64; 3]]; 2],
        truth: &Groups,
        notes: &mut Vec<String>,
    ) -> Result<Vec<super::ApertureMass>> {
        let radius = self.o.aperture * self.spacing(0);
        let longest = longest_separation(&self.domain);
        if radius > longest {
            notes.push(format!("no core masses were measured: the aperture {radius:.4e} exceeds {longest:.4e}"));
            return Ok(Vec::new());
        }
        let large = truth.members.iter().take_while(|m| m.len() as u64 >= CORES[0][0]).count();
        let chosen = Groups { linking_length: truth.linking_length, members: truth.members[..large].to_vec() };
        let centers = parallel::map(&chosen.members, |m| group_center(positions[0], m, &self.domain));
        let count = |side: usize| counts_within(positions[side], &self.domain, &centers, radius, self.context);
        let (a, b) = (count(0)?, count(1)?);
        let per = positions[0].len() as f64 / positions[1].len() as f64;
        Ok(CORES.map(|sizes| aperture_mass(&chosen, &a, &b, per, radius, sizes)).to_vec())
    }

    fn neighbours(&self, particles: [&Particles; 2]) -> Result<[NearestDistances; 2]> {
        let options =
            NeighbourOptions { sample: self.o.neighbour_sample, among_sample: self.paper(), seed: self.o.seed };
        let of = |side: usize| nearest_distances(particles[side], &self.domain, &options, self.context);
        Ok([of(0)?, of(1)?])
    }
}

//! Density and enclosed mass about given centres: of particles by counting, of a mixture from its Gaussians.

use super::aperture::{group_center, quantile};
use super::comparison_job::ComparisonJob;
use super::linking::LinkedGroups;
use super::points::PointGrid;
use super::presentation::*;
use super::subject::mixtures;
use super::{Domain, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{Ball, GaussianInSphere, Rules, each_axis};
use particlegs_core::model::{Model, decimals};
use particlegs_core::{Error, Result, parallel};
use particlegs_fit::recover::stratify;
use particlegs_particles::Particles;
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Particles of the smallest group whose centre is a halo's, the most haloes, and how far they go in mean spacings.
const LEAST_HALO: usize = 100;
const MOST_HALOES: usize = 1000;
const HALO_SPACINGS: f64 = 2.0;

/// The first radius, as a share of the largest.
const SMALLEST: f64 = 0.02;
/// Narrowest Gaussian, as a share of the longest edge: coded ones may be of no width.
const NARROWEST: f64 = 1e-9;
/// Widest Gaussian where all axes repeat, as a share of the longest edge: its images are uniform to a hundredth.
const WIDEST: f64 = 0.5;
/// Images of a Gaussian are looked for as many edges away: in absurd files those of thin boxes have no end.
const IMAGES: f64 = 4.0;

/// Gaussians between two looks at whether the work was stopped.
const CHECKED: usize = 64;
/// Points that stand for a Gaussian where a sphere cuts it.
const SPREAD_POINTS: usize = 256;

/// The variance of the mass of n particles of a Gaussian in a sphere is that of drawing them times 1 + a n^b: a and b.
/// Measured on nbody128 at ratios 100, 300 and 1000 (docs/results/haloes.md).
const MISFIT: [f64; 2] = [0.25, 0.7];

/// Density and enclosed mass about centres, and those of the other over the truth's. Radii are in units of the largest
/// of each centre.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct HaloProfiles {
    /// Centres, world units.
    #[serde(skip)]
    pub centers: Vec<[f64; 3]>,
    /// Largest radius of each, world units.
    #[serde(skip)]
    pub radii: Vec<f64>,
    /// Mass inside each of `edges` about each centre, centre after centre: truth and other.
    #[serde(skip)]
    pub enclosed: [Vec<f64>; 2],
    /// Number of centres.
    pub count: u64,
    /// The largest radius, where all centres have the same one, world units.
    pub radius: Option<f64>,
    /// All mass per volume of the box: truth and other.
    pub mean_density: [f64; 2],
    /// Radii: edges of the shells, in units of the largest.
    pub edges: Vec<f64>,
    /// Centres about which the truth has mass inside each radius.
    pub compared: Vec<u64>,
    /// Their median of enclosed mass, other / truth, each as a share of all its mass.
    pub median: Vec<Option<f64>>,
    /// A quarter of them are below and above these.
    pub quartiles: Vec<Option<[f64; 2]>>,
    /// The sum of all over the sum of all.
    pub total: Vec<Option<f64>>,
}

/// Places about which profiles are measured, relative to the domain's corner, and how far they go.
pub struct HaloPlaces<'a> {
    pub centers: &'a [[f64; 3]],
    /// Largest radius of each.
    pub radii: &'a [f64],
    pub bins: usize,
}

impl HaloPlaces<'_> {
    /// Edges of the shells, in units of the largest radius.
    fn edges(&self) -> Vec<f64> {
        (0..=self.bins).map(|i| libm::pow(SMALLEST, 1.0 - i as f64 / self.bins as f64)).collect()
    }

    pub fn largest(&self) -> f64 {
        self.radii.iter().copied().fold(0.0, f64::max)
    }
}

/// A side of the comparison.
#[derive(Clone, Copy)]
pub struct HaloSide<'a> {
    pub subject: Subject<'a>,
    pub positions: &'a [[f64; 3]],
}

/// Compares enclosed masses.
pub fn halo_profiles(
    pair: [HaloSide<'_>; 2],
    domain: &Domain,
    places: &HaloPlaces<'_>,
    context: &Context<'_>,
) -> Result<HaloProfiles> {
    let (edges, halos) = (places.edges(), places.centers.len());
    particlegs_files::memory::require("profiles of haloes", 24 * (edges.len() * halos) as u64)?;
    context.begin("halo profiles", 2 * halos as u64);
    let masses_of = |side: HaloSide<'_>| match side.subject {
        Subject::Particles(p) => of_particles(p, side.positions, domain, places, &edges, context),
        Subject::Model(m) => of_model(m, domain, places, &edges, context),
    };
    let enclosed = [masses_of(pair[0])?, masses_of(pair[1])?];
    context.end();
    let masses = pair.map(|s| all_mass(s.subject));
    // Ratios are of shares of all mass, so that a side without masses or with fewer particles can be compared.
    let shares = masses.map(|m| 1.0 / m.max(f64::MIN_POSITIVE));
    let at = |i: usize| MassComparison::new(&enclosed, shares, i, edges.len());
    let compared: Vec<MassComparison> = (0..edges.len()).map(at).collect();
    Ok(HaloProfiles {
        centers: places.centers.iter().map(|c| each_axis(|k| domain.min[k] + c[k])).collect(),
        radii: places.radii.to_vec(),
        count: halos as u64,
        mean_density: masses.map(|m| m / domain.volume()),
        radius: places.radii.first().copied().filter(|r| places.radii.iter().all(|other| other == r)),
        compared: compared.iter().map(|c| c.number).collect(),
        median: compared.iter().map(|c| c.median).collect(),
        quartiles: compared.iter().map(|c| c.quartiles).collect(),
        total: compared.iter().map(|c| c.total).collect(),
        enclosed,
        edges,
    })
}

impl HaloProfiles {
    /// Mass inside radius `edge` about a centre: truth, other.
    pub fn enclosed_mass(&self, center: usize, edge: usize) -> [f64; 2] {
        [0, 1].map(|side| self.enclosed[side][center * self.edges.len() + edge])
    }

    /// Mass per volume in the shell from radius `shell` to the next about a centre: truth, other.
    pub fn density(&self, center: usize, shell: usize) -> [f64; 2] {
        let volume = |edge: usize| 4.0 / 3.0 * PI * (self.edges[edge] * self.radii[center]).powi(3);
        let (inner, outer) = (self.enclosed_mass(center, shell), self.enclosed_mass(center, shell + 1));
        let within = volume(shell + 1) - volume(shell);
        // Enclosed masses of a mixture are right to their last digits alone.
        [0, 1].map(|side| if within > 0.0 { (outer[side] - inner[side]).max(0.0) / within } else { 0.0 })
    }
}

/// Masses inside one radius about all centres, compared.
struct MassComparison {
    number: u64,
    median: Option<f64>,
    quartiles: Option<[f64; 2]>,
    total: Option<f64>,
}

impl MassComparison {
    fn new([truth, other]: &[Vec<f64>; 2], shares: [f64; 2], edge: usize, edges: usize) -> Self {
        let here = |i: &usize| i % edges == edge && truth[*i] > 0.0;
        let indices: Vec<usize> = (0..truth.len()).filter(here).collect();
        let mut ratios: Vec<f64> = indices.iter().map(|i| other[*i] * shares[1] / (truth[*i] * shares[0])).collect();
        ratios.sort_by(f64::total_cmp);
        let at = |share| quantile(&ratios, share);
        let sum = |v: &[f64]| indices.iter().map(|i| v[*i]).sum::<f64>();
        MassComparison {
            number: indices.len() as u64,
            median: at(0.5),
            quartiles: at(0.25).zip(at(0.75)).map(<[f64; 2]>::from),
            total: (!indices.is_empty()).then(|| sum(other) * shares[1] / (sum(truth) * shares[0])),
        }
    }
}

fn all_mass(subject: Subject<'_>) -> f64 {
    match subject {
        Subject::Particles(p) => p.total_mass() * p.meta.particle_mass.unwrap_or(1.0),
        Subject::Model(m) => gaussians(m).map(|(unit, g, i)| unit * g.mass_of(i)).sum(),
    }
}

/// Every Gaussian of a model: the mass of weight 1, its mixture and its number there.
fn gaussians(m: &Model) -> impl Iterator<Item = (f64, &particlegs_core::model::Mixture, usize)> {
    mixtures(m).flat_map(|(unit, g)| (0..g.len()).map(move |i| (unit, g, i)))
}

/// The masses inside `edges` about every centre, as `add` adds those about one.
fn about_each(
    places: &HaloPlaces<'_>,
    edges: &[f64],
    context: &Context<'_>,
    add: impl Fn([f64; 3], &[f64], &mut [f64]) -> Result<()> + Sync,
) -> Result<Vec<f64>> {
    let parts = parallel::try_map_range(places.centers.len(), |i| {
        let radii: Vec<f64> = edges.iter().map(|e| e * places.radii[i]).collect();
        let mut inside = vec![0.0; radii.len()];
        context.check()?;
        add(places.centers[i], &radii, &mut inside)?;
        context.advance(1);
        Ok::<_, Error>(inside)
    })?;
    Ok(parts.concat())
}

fn of_particles(
    p: &Particles,
    positions: &[[f64; 3]],
    domain: &Domain,
    places: &HaloPlaces<'_>,
    edges: &[f64],
    context: &Context<'_>,
) -> Result<Vec<f64>> {
    let points = PointGrid::new(positions, domain, places.largest())?;
    let (weights, unit) = (p.weights(), p.meta.particle_mass.unwrap_or(1.0));
    about_each(places, edges, context, |center, radii, inside| {
        let squares: Vec<f64> = radii.iter().map(|r| r * r).collect();
        points.near(points.cell_of(center), radii[radii.len() - 1], |run, shift| {
            let at: [f64; 3] = each_axis(|k| center[k] - shift[k]);
            for i in run {
                let x = points.position[i];
                let square = (0..3).map(|k| (x[k] - at[k]) * (x[k] - at[k])).sum::<f64>();
                // Each particle is added to one shell; the shells are then added up from inside out.
                let first = squares.partition_point(|s| *s < square);
                if let Some(shell) = inside.get_mut(first) {
                    *shell += unit * weights.map_or(1.0, |w| f64::from(w[points.index[i] as usize]));
                }
            }
        });
        (1..inside.len()).for_each(|i| inside[i] += inside[i - 1]);
        Ok(())
    })
}

/// Gaussians of about one size, by the place of their means.
struct GaussianSizeClass {
    gaussians: Vec<GaussianInSphere>,
    /// Particles of each.
    numbers: Vec<f64>,
    points: PointGrid,
    reach: f64,
}

/// The Gaussians of a model, by their places.
pub(crate) struct GaussianSpheres {
    classes: Vec<GaussianSizeClass>,
    rules: Rules,
    /// A standard normal distribution, evenly spread.
    normals: [Vec<f64>; 3],
}

/// Mass and particles of a model in a sphere.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EnclosedMass {
    pub mass: f64,
    /// That of drawing each particle of each Gaussian alone, and that of particles which are not spread like their
    /// Gaussian ([`MISFIT`]).
    pub variance: f64,
    /// Particles.
    pub number: f64,
}

/// The standard error of a number of particles of Gaussians in a sphere, over the number.
pub(crate) fn number_error(number: f64) -> f64 {
    (misfit(number) / number).sqrt()
}

fn misfit(number: f64) -> f64 {
    1.0 + MISFIT[0] * libm::pow(number, MISFIT[1])
}

impl GaussianSpheres {
    /// To be asked about spheres of at most about `radius`.
    pub fn new(m: &Model, domain: &Domain, radius: f64) -> Result<Self> {
        let mut normals = [0; 3].map(|_| vec![0.0; SPREAD_POINTS]);
        stratify([0; 2], 0, &mut normals.each_mut().map(|column| &mut column[..]));
        Ok(GaussianSpheres { classes: classes(m, domain, radius)?, rules: Rules::new(), normals })
    }

    /// Calls `visit` with each Gaussian that may reach a sphere about a place, the place's offset from its mean, and
    /// its number of particles.
    fn visit(
        &self,
        center: [f64; 3],
        radius: f64,
        context: &Context<'_>,
        mut visit: impl FnMut(&GaussianInSphere, [f64; 3], f64),
    ) -> Result<()> {
        for class in &self.classes {
            class.points.near(class.points.cell_of(center), class.reach + radius, |run, shift| {
                for i in run.take_while(|i| i % CHECKED != 0 || !context.cancelled()) {
                    let index = class.points.index[i] as usize;
                    let gaussian = &class.gaussians[index];
                    visit(gaussian, each_axis(|k| center[k] - shift[k] - gaussian.mean[k]), class.numbers[index]);
                }
            });
            context.check()?;
        }
        Ok(())
    }

    /// The mass inside spheres of ascending `radii` about a place, outside the balls `excluded` whose centres are
    /// counted from there: of each Gaussian, the share of evenly spread points.
    pub fn enclosed(
        &self,
        center: [f64; 3],
        radii: &[f64],
        excluded: &[Ball],
        context: &Context<'_>,
    ) -> Result<Vec<EnclosedMass>> {
        let mut inside = vec![EnclosedMass::default(); radii.len()];
        let mut gaussian_masses = vec![0.0; radii.len()];
        self.visit(center, radii.last().copied().unwrap_or(0.0), context, |gaussian, offset, number| {
            gaussian_masses.fill(0.0);
            gaussian.add_counted(offset, radii, excluded, &self.normals, &mut gaussian_masses);
            if gaussian_masses.last().is_none_or(|mass| *mass <= 0.0) {
                return;
            }
            let number = number.max(f64::MIN_POSITIVE);
            // Each particle is drawn by itself (a binomial variance), times the misfit of docs/results/haloes.md.
            let spread = gaussian.mass / number * misfit(number);
            for (sum, mass) in inside.iter_mut().zip(&gaussian_masses) {
                sum.mass += mass;
                sum.variance += spread * mass * (1.0 - mass / gaussian.mass).max(0.0);
                sum.number += number * (mass / gaussian.mass);
            }
        })?;
        Ok(inside)
    }

    /// Whether the mass per volume at a place is at least `least`.
    pub fn is_dense(&self, center: [f64; 3], least: f64, context: &Context<'_>) -> Result<bool> {
        let mut density = 0.0;
        self.visit(center, 0.0, context, |gaussian, offset, _| {
            // Once it is dense enough the other Gaussians need not be evaluated.
            if density < least {
                density += gaussian.density(offset);
            }
        })?;
        Ok(density >= least)
    }
}

fn of_model(
    m: &Model,
    domain: &Domain,
    places: &HaloPlaces<'_>,
    edges: &[f64],
    context: &Context<'_>,
) -> Result<Vec<f64>> {
    let spheres = GaussianSpheres::new(m, domain, places.largest())?;
    about_each(places, edges, context, |center, radii, inside| {
        spheres.visit(center, radii[radii.len() - 1], context, |gaussian, offset, _| {
            gaussian.add_within(offset, radii, &spheres.rules, inside);
        })
    })
}

fn classes(m: &Model, domain: &Domain, radius: f64) -> Result<Vec<GaussianSizeClass>> {
    let repeats = (0..3).filter(|k| domain.periodic[*k]).map(|k| domain.length[k]).fold(f64::INFINITY, f64::min);
    let widest = if domain.periodic == [true; 3] { WIDEST * domain.longest() } else { f64::MAX };
    let widths = [NARROWEST * domain.longest(), widest];
    particlegs_files::memory::require("Gaussians about centres", 290 * m.gaussians() as u64)?;
    // Each class is looked up within its own reach: wide Gaussians do not widen the search of narrow ones.
    let mut by_size = BTreeMap::<i64, Vec<(GaussianInSphere, f64)>>::new();
    for (unit, g, i) in gaussians(m) {
        let mass = unit * g.mass_of(i);
        let gaussian = GaussianInSphere::new(domain.local(g.mean_of(i)), &g.cov_of(i), mass, widths);
        by_size.entry(libm::log2(gaussian.reach()).ceil() as i64).or_default().push((gaussian, g.count[i]));
    }
    let class = |members: Vec<(GaussianInSphere, f64)>| {
        let (gaussians, numbers): (Vec<GaussianInSphere>, Vec<f64>) = members.into_iter().unzip();
        let reach = gaussians.iter().map(GaussianInSphere::reach).fold(0.0, f64::max).min(IMAGES * repeats);
        let means: Vec<[f64; 3]> = gaussians.iter().map(|g| g.mean).collect();
        // Cells of half the reach hold fewer of what is out of it.
        Ok(GaussianSizeClass {
            points: PointGrid::new(&means, domain, 0.5 * (radius + reach))?,
            gaussians,
            numbers,
            reach,
        })
    };
    by_size.into_values().map(class).collect()
}

impl ComparisonJob<'_> {
    /// Centres and the largest radius about each. `None`, and a note, where there are none.
    pub fn centers(
        &self,
        positions: &[[f64; 3]],
        truth: Option<&LinkedGroups>,
        notes: &mut Vec<String>,
    ) -> Result<Option<(Vec<[f64; 3]>, Vec<f64>)>> {
        let repeats = (0..3).filter(|k| self.domain.periodic[*k]).map(|k| 0.5 * self.domain.length[k]);
        let longest = repeats.fold(f64::INFINITY, f64::min);
        let default = (HALO_SPACINGS * self.spacing(0)).min(longest);
        let (centers, stated): (Vec<[f64; 3]>, Vec<Option<f64>>) = match (&self.o.centers, truth) {
            (Some(stated), _) => stated.iter().map(|(c, r)| (self.domain.local(*c), *r)).unzip(),
            (None, Some(linked)) => {
                let large = linked.groups.members.iter().take(MOST_HALOES).take_while(|m| m.len() >= LEAST_HALO);
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

    pub fn haloes(&self, positions: [&[[f64; 3]]; 2], places: &HaloPlaces<'_>) -> Result<HaloProfiles> {
        let side = |s: usize| HaloSide { subject: self.pair[s], positions: positions[s] };
        halo_profiles([side(0), side(1)], &self.domain, places, self.context)
    }
}

/// Shows them.
pub(super) fn show(h: &HaloProfiles, to: &mut Presentation) {
    let shells = |i: usize| (0..h.edges.len() - 1).map(move |shell| (i, shell));
    let row = |(i, shell): (usize, usize)| {
        let ([a, b], [within_a, within_b]) = (h.density(i, shell), h.enclosed_mass(i, shell + 1));
        let ([x, y, z], radius) = (h.centers[i], h.radii[i]);
        row![i + 1, x, y, z, radius, h.edges[shell] * radius, h.edges[shell + 1] * radius, a, b, within_a, within_b]
    };
    let head = "centre,x,y,z,radius,r_low,r_high,density_truth,density_other,enclosed_truth,enclosed_other";
    to.table("haloes.csv", head, (0..h.radii.len()).flat_map(shells).map(row));
    let row = |(i, edge): (usize, &f64)| {
        let [low, high] = [0, 1].map(|q| maybe(h.quartiles[i].map(|quartiles| quartiles[q])));
        let radius = maybe(h.radius.map(|r| r * edge));
        row![radius, edge, h.compared[i], maybe(h.median[i]), low, high, maybe(h.total[i])]
    };
    let head = "r,r_over_radius,haloes,median,quartile_low,quartile_high,total";
    to.table("halo_mass.csv", head, h.edges.iter().enumerate().map(row));
    let scale = h.radius.unwrap_or(1.0);
    let profile = |side: usize| {
        let density = |shell: usize| (0..h.radii.len()).map(|i| h.density(i, shell)[side]).sum::<f64>();
        let middle = |shell: usize| scale * (h.edges[shell] * h.edges[shell + 1]).sqrt();
        let per = h.count as f64 * h.mean_density[side];
        (0..h.edges.len() - 1).map(|shell| (middle(shell), density(shell) / per)).collect()
    };
    let ratio = h.edges.iter().zip(&h.median).filter_map(|(edge, median)| Some((scale * edge, (*median)?)));
    let r = h.radius.map_or("r / largest radius".into(), |_| format!("r{}", to.units.length));
    let title = format!("Density around {} centres; below, mass within r (median)", h.count);
    let axes = [log(r), log("density / mean of the box")];
    to.plot(chart("halo_profile", &title, axes, pair([profile(0), profile(1)]), ratio.collect()));
    let radius = h.radius.map_or("given".into(), |r| decimals(r) + &to.length);
    to.line("haloes: centres", format!("{}, largest radius {radius}", h.count));
    for share in [0.1, 0.3, 1.0] {
        let near = |i: &usize| libm::log(h.edges[*i] / share).abs();
        let Some(i) = (0..h.edges.len()).min_by(|a, b| near(a).total_cmp(&near(b))) else { continue };
        to.median(&format!("haloes: mass within {:.3} radii", h.edges[i]), h.median[i], h.quartiles[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::local_positions;
    use particlegs_core::context::Context;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_particles::testing::{from_points, model_of, on_threads, random_points};

    const BOX: Domain = Domain::upright([5.0; 3], [10.0; 3], [true; 3]);

    fn side<'a>(subject: Subject<'a>, positions: &'a [[f64; 3]]) -> HaloSide<'a> {
        HaloSide { subject, positions }
    }

    /// Particles drawn from a turned, long Gaussian across the seam, and that Gaussian itself.
    #[test]
    fn a_mixture_encloses_what_its_particles_do() {
        let n = 200_000;
        let (core, deviations): (_, [f64; 3]) = ([5.2, 14.9, 9.0], [0.9, 0.5, 0.2]);
        let turned = [[0.6, 0.8, 0.0], [-0.48, 0.36, 0.8], [0.64, -0.48, 0.6]];
        let cov = (0..3).fold(Sym3::default(), |s, k| s.add(&Sym3::outer(turned[k]).scale(deviations[k].powi(2))));
        let mut r = Random::new(3, 0, 0);
        let particles = from_points((0..n).map(|_| {
            let z = [r.normal(), r.normal(), r.normal()];
            let x = each_axis(|k| core[k] + (0..3).map(|j| z[j] * deviations[j] * turned[j][k]).sum::<f64>());
            BOX.local(x).map(|v| v + 5.0)
        }));
        let mut model = model_of(&[(core, cov, n as f64)], [10.0; 3]);
        model.metadata.bounds = particlegs_core::space::Bounds { min: [5.0; 3], max: [15.0; 3] };
        let positions = local_positions(&particles, &BOX);
        let centers = [core, [5.5, 14.0, 9.5], [12.0; 3]].map(|c| BOX.local(c));
        let places = HaloPlaces { centers: &centers, radii: &[3.0, 1.0, 2.0], bins: 20 };
        let pair = [side(Subject::Particles(&particles), &positions), side(Subject::Model(&model), &[])];
        let h = halo_profiles(pair, &BOX, &places, &Context::SILENT).unwrap();
        assert_eq!((h.edges.len(), h.count, h.radius), (21, 3, None));
        assert!((h.edges[0] - 0.02).abs() < 1e-12 && h.edges[20] == 1.0);
        for center in 0..3 {
            for edge in 0..21 {
                let [drawn, known] = h.enclosed_mass(center, edge);
                assert!((drawn - known).abs() < 4.0 * drawn.sqrt() + 40.0, "{center} {edge}: {drawn} {known}");
            }
        }
        assert!(h.enclosed_mass(0, 20)[0] > 0.998 * n as f64 && h.enclosed_mass(2, 20) == [0.0; 2]);
        assert!((h.median[20].unwrap() - 1.0).abs() < 0.02 && h.compared[20] == 2);
        assert!((h.total[20].unwrap() - 1.0).abs() < 0.01);
    }

    /// NFW, mass within x scale radii as ln(1 + x) - x / (1 + x), drawn to ten scale radii.
    #[test]
    fn a_halo_has_its_profile() {
        let (n, scale) = (100_000, 0.1);
        let mass = |x: f64| (1.0 + x).ln() - x / (1.0 + x);
        let radius = |share: f64| {
            let (mut low, mut high) = (0.0, 10.0);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if mass(middle) < share * mass(10.0) { low = middle } else { high = middle }
            }
            low * scale
        };
        let p = from_points(random_points(n, 3, |_, r| {
            let z = [r.normal(), r.normal(), r.normal()];
            let per = radius(r.uniform()) / z.iter().map(|v| v * v).sum::<f64>().sqrt();
            z.map(|z| 10.0 + per * z)
        }));
        let positions = local_positions(&p, &BOX);
        let places = HaloPlaces { centers: &[[5.0; 3]], radii: &[1.0], bins: 12 };
        let h = halo_profiles([side(Subject::Particles(&p), &positions); 2], &BOX, &places, &Context::SILENT).unwrap();
        for edge in 0..13 {
            let expected = n as f64 * mass(h.edges[edge] / scale) / mass(10.0);
            let [enclosed, same] = h.enclosed_mass(0, edge);
            assert!(
                enclosed == same && (enclosed - expected).abs() < 4.0 * expected.sqrt(),
                "{edge}: {enclosed} {expected}"
            );
        }
        for shell in 0..12 {
            let x = (h.edges[shell] * h.edges[shell + 1]).sqrt() / scale;
            let expected = n as f64 / (4.0 * PI * scale.powi(3) * mass(10.0)) / (x * (1.0 + x).powi(2));
            let [density, _] = h.density(0, shell);
            assert!((density / expected - 1.0).abs() < 0.15, "{shell}: {density} {expected}");
        }
        assert_eq!((h.median[12], h.quartiles[0], h.radius), (Some(1.0), Some([1.0, 1.0]), Some(1.0)));
    }

    #[test]
    fn threads_change_nothing_and_absurd_gaussians_end() {
        let mut r = Random::new(8, 0, 0);
        let mut gaussians: Vec<([f64; 3], Sym3, f64)> = (0..100)
            .map(|_| ([0; 3].map(|_| 20.0 * r.uniform()), Sym3::scaled_identity(r.uniform().powi(4)), 5.0))
            .collect();
        for s in [0.0, 1e30, 1e300] {
            gaussians.push(([7.0; 3], Sym3([s, 0.0, 0.0, 1.0, 0.0, 0.0]), 1.0));
        }
        let model = model_of(&gaussians, [10.0; 3]);
        let centers: Vec<[f64; 3]> = gaussians.iter().map(|g| BOX.local(g.0)).collect();
        let places = HaloPlaces { centers: &centers, radii: &vec![5.0; centers.len()], bins: 5 };
        let pair = [side(Subject::Model(&model), &[]); 2];
        for periodic in [true, false] {
            let domain = Domain { periodic: [periodic; 3], ..BOX };
            let run =
                |threads| on_threads(threads, || halo_profiles(pair, &domain, &places, &Context::SILENT).unwrap());
            let h = run(1);
            assert!(h == run(4) && h.enclosed[0].iter().all(|m| m.is_finite() && *m >= 0.0));
        }
    }
}

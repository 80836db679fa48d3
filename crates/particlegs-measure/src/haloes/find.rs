//! The whole job: from particles or a model to a catalogue.

use super::catalogue::HaloCatalogue;
use super::members::{LinkedHaloes, density_peak};
use super::model::{HaloSphere, SPHERES, dense_part, integrated};
use super::overdensity::{HaloDensities, Overdensity};
use super::sphere::{DensitySphere, RadialParticles, SphereParticle, SphereProperties};
use crate::stats::{
    GaussianSpheres, ParticleFields, PointGrid, StatsSide, Subject, local_positions, number_error, within,
};
use particlegs_core::context::Context;
use particlegs_core::math::{Ball, each_axis};
use particlegs_core::model::{Block, Cosmology, Dimension, Epoch, Layer, Mass, Unit, UnitSystem, Units};
use particlegs_core::{Error, Result, parallel};
use particlegs_fit::recover::Options as RecoverOptions;
use particlegs_particles::{Domain, Particles};

/// Particles inside a sphere whose mass is listed, at least.
pub const LEAST_MASS: usize = 100;
/// Parts that a model's particles are left out by, one after the other, for errors.
const JACKKNIFE: usize = 8;
/// Softening lengths within which circular velocities and profiles are not looked at.
const SOFTENINGS: f64 = 3.0;
/// Softening length in mean spacings, where it is not stated.
const SOFTENING: f64 = 0.04;
/// The sphere that particles are gathered in at first, in radii that the group's mass suggests, and its growth.
const FIRST_REACH: f64 = 1.3;
const GROWTH: f64 = 1.5;
/// Standard error of a model's density peak along an axis, over the radius that holds the root of the halo's particles:
/// tuned on the haloes of one snapshot, checked on others (docs/results/haloes.md).
const CENTER_ERROR: f64 = 0.55;
/// Particles that errors are measured of, about: of more, each of some, scaled as errors are with numbers.
const ERROR_SAMPLE: usize = 512;

/// Options of finding haloes. As a record that is read, also by the names that they have on the command line.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HaloOptions {
    /// Linking length in mean spacings of the linked particles.
    pub linking: f64,
    /// Linked particles of the smallest halo.
    #[serde(alias = "min_particles")]
    pub smallest: usize,
    /// Layers that are linked; by default those of dark matter where there are some, else all.
    #[serde(alias = "link")]
    pub linked: Vec<String>,
    /// Softening length, world units; `None` = a 25th of the linked particles' mean spacing.
    pub softening: Option<f64>,
    /// Share of the simulation's particles that were read: masses are divided by it.
    pub sample_fraction: f64,
    /// Mass of a particle, in the unit of mass, where the source does not state it.
    pub particle_mass: Option<f64>,
    /// Unit of mass; goes before the source's.
    pub mass_unit: Option<String>,
    /// Cosmology; goes before the source's.
    #[serde(skip)]
    pub cosmology: Cosmology,
    /// Redshift; goes before the source's.
    pub redshift: Option<f64>,
    /// Seed of particles that are drawn from a model.
    pub seed: u64,
}

impl Default for HaloOptions {
    fn default() -> Self {
        HaloOptions {
            linking: 0.2,
            smallest: 20,
            linked: Vec::new(),
            softening: None,
            sample_fraction: 1.0,
            particle_mass: None,
            mass_unit: None,
            cosmology: Cosmology::default(),
            redshift: None,
            seed: 42,
        }
    }
}

impl HaloOptions {
    /// Refuses options out of range.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub fn check(&self) -> Result<()> {
        within("the linking length in mean spacings", self.linking, 1e-6, 2.0)?;
        within("the smallest number of particles", self.smallest as f64, 2.0, 1e9)?;
        within("the share of particles that were read", self.sample_fraction, 1e-9, 1.0)?;
        within("the redshift", self.redshift.unwrap_or(0.0), -0.999, 1e6)?;
        within("the softening length", self.softening.unwrap_or(0.0), 0.0, f64::MAX)?;
        within("the mass of a particle", self.particle_mass.unwrap_or(1.0), f64::MIN_POSITIVE, f64::MAX)
    }
}

/// Moment, cosmology and units of a source: those that a user states, else its own.
pub struct HaloSetting {
    pub epoch: Epoch,
    pub cosmology: Cosmology,
    pub units: Units,
}

impl HaloSetting {
    fn new(source: Subject<'_>, o: &HaloOptions) -> Self {
        let ((epoch, cosmology), units) = (source.moment(), source.unit_system().units);
        let scale_factor = o.redshift.map(|z| 1.0 / (1.0 + z)).or(epoch.scale_factor);
        let mass = o.mass_unit.as_ref().map(|text| Unit::parse(text, Dimension::Mass)).or(units.mass.clone());
        let stated = o.cosmology;
        HaloSetting {
            epoch: Epoch { scale_factor, ..*epoch },
            cosmology: Cosmology {
                hubble: stated.hubble.or(cosmology.hubble),
                omega_matter: stated.omega_matter.or(cosmology.omega_matter),
                omega_lambda: stated.omega_lambda.or(cosmology.omega_lambda),
                omega_baryon: cosmology.omega_baryon,
            },
            units: Units { mass, ..units.clone() },
        }
    }
}

/// Finds haloes: friends of friends, their density peaks, and spheres of given mean densities about these.
///
/// # Errors
/// Options out of range; a particle type that does not exist; a box that is not periodic without a cosmology; too
/// little memory.
pub fn find_haloes<'a>(
    source: impl Into<StatsSide<'a>>,
    o: &HaloOptions,
    context: &Context<'_>,
) -> Result<HaloCatalogue> {
    o.check()?;
    let StatsSide { subject: source, fields } = source.into();
    source.particles().map_or(Ok(()), Particles::check_files)?;
    let drawn;
    let mut spheres = None;
    let (particles, velocities, domain, number) = match source {
        Subject::Particles(p) => (p, ParticleFields::moving(p, fields)?, source.domain(), p.len() as u64),
        Subject::Model(m) => {
            let domain = source.domain();
            let options = RecoverOptions { seed: o.seed, ..RecoverOptions::default() };
            let gaussian_spheres =
                spheres.insert(GaussianSpheres::new(m, &domain, domain.spacing(options.total(m) as usize))?);
            let dense = dense_part(m, gaussian_spheres, (&domain, o.linking), context)?.unwrap_or_else(|| m.clone());
            let (particles, fields) = options.draw_with_fields(dense, context)?;
            let velocities = ParticleFields::moving(&particles, &fields)?;
            drawn = particles;
            (&drawn, velocities, domain, options.total(m))
        }
    };
    if particles.is_empty() {
        return Err(Error::argument("there are no particles"));
    }
    let positions = local_positions(particles, &domain);
    let search = HaloSearch::new(source, (particles, number), velocities.as_ref(), (&domain, &positions), o)?;
    search.catalogue(spheres.as_ref(), context)
}
/// One run.
pub struct HaloSearch<'a> {
    pub source: Subject<'a>,
    pub setting: HaloSetting,
    pub particles: &'a Particles,
    /// Particles of the source: more than these where a model's thin part is not drawn.
    number: u64,
    pub velocities: Option<&'a ParticleFields>,
    pub domain: &'a Domain,
    pub positions: &'a [[f64; 3]],
    pub o: &'a HaloOptions,
    pub densities: HaloDensities,
    /// Mass of weight 1.
    pub unit: f64,
    /// Masses are known.
    pub masses: bool,
}

/// A halo of a group.
#[derive(Clone)]
pub struct Halo {
    /// Number of its group.
    pub group: usize,
    /// Relative to the domain's corner.
    pub center: [f64; 3],
    /// Linked particles: those of the group, or within R200m where it is not the group's densest.
    pub members: usize,
    /// Whether it is the densest of its group.
    pub is_main: bool,
    pub measures: HaloMeasures,
    /// Its number among all by linked particles, and that of the halo whose satellite it is.
    pub rank: usize,
    pub parent: Option<usize>,
}

impl Halo {
    /// A further peak with too few particles for a mass is no halo.
    pub fn is_listed(&self) -> bool {
        self.is_main || self.measures.count >= LEAST_MASS
    }
}

/// Measures about one centre.
#[derive(Clone)]
pub struct HaloMeasures {
    pub spheres: [Option<HaloSphere>; SPHERES],
    /// Particles inside the first.
    pub count: usize,
    /// Standard error of the centre along an axis, of a model.
    pub center_error: f64,
    pub properties: SphereProperties,
    pub errors: Option<SphereProperties>,
    /// Share of the mass inside that is of coarse particles, and its error.
    pub contamination: [f64; 2],
}

impl HaloMeasures {
    /// R200m; 0 where there is none.
    pub fn radius(&self) -> f64 {
        self.spheres[Overdensity::Mean200 as usize].map_or(0.0, |s| s.sphere.radius)
    }

    /// The radius of the largest sphere.
    pub fn reach(&self) -> f64 {
        self.spheres.iter().flatten().map(|s| s.sphere.radius).fold(0.0, f64::max)
    }
}

impl<'a> HaloSearch<'a> {
    fn new(
        source: Subject<'a>,
        (particles, number): (&'a Particles, u64),
        velocities: Option<&'a ParticleFields>,
        (domain, positions): (&'a Domain, &'a [[f64; 3]]),
        o: &'a HaloOptions,
    ) -> Result<Self> {
        let layers = particles.layers();
        let stated = layers.iter().all(|l| l.mass != Mass::Unknown) && particles.meta.weight_name.is_none();
        let alike = layers.iter().all(|l| l.mass == Mass::Unknown);
        if o.particle_mass.is_some() && !alike {
            return Err(Error::argument("a mass of the particles was given, but the file states masses"));
        }
        let masses = stated || o.particle_mass.is_some();
        let share = o.sample_fraction;
        let unit = o.particle_mass.or(particles.meta.particle_mass).unwrap_or(1.0) / share;
        let mass = match source {
            Subject::Particles(p) => unit * p.total_mass(),
            Subject::Model(m) => o.particle_mass.unwrap_or(1.0) / share * m.layers.iter().map(layer_mass).sum::<f64>(),
        };
        // Only a box that repeats holds a fair part of the universe.
        let mean = (domain.periodic == [true; 3]).then(|| mass / domain.volume());
        let setting = HaloSetting::new(source, o);
        let HaloSetting { epoch, cosmology, units } = &setting;
        let system = UnitSystem::new(units, epoch, cosmology);
        let densities = HaloDensities::new(&system, (epoch, cosmology), mean, masses)?;
        Ok(HaloSearch { source, setting, particles, number, velocities, domain, positions, o, densities, unit, masses })
    }

    fn mass_of(&self, i: u32) -> f64 {
        self.unit * self.particles.weights().map_or(1.0, |w| f64::from(w[i as usize]))
    }

    fn catalogue(&self, model: Option<&GaussianSpheres>, context: &Context<'_>) -> Result<HaloCatalogue> {
        let mass = |i: u32| self.mass_of(i);
        let groups =
            LinkedHaloes::find(self.particles, self.positions, self.domain, (self.o, self.number), &mass, context)?;
        context.begin("haloes", groups.members.len() as u64);
        let points = PointGrid::new(self.positions, self.domain, 0.0)?;
        let softening = self.o.softening.unwrap_or(SOFTENING * libm::pow(groups.number_density, -1.0 / 3.0));
        let about = AboutCenter {
            search: self,
            points: &points,
            fine: groups.fine.as_deref(),
            model,
            number_density: groups.number_density,
            inner: SOFTENINGS * softening,
        };
        let haloes = parallel::try_map_range(groups.members.len(), |group| {
            context.check()?;
            let haloes = about.haloes_of(group, &groups, context)?;
            context.advance(1);
            Ok::<_, Error>(haloes)
        })?;
        let mut haloes = about.without_overlap(haloes.into_iter().flatten().collect(), &groups, context)?;
        context.end();
        haloes.sort_by_key(|h| (std::cmp::Reverse((h.measures.count, h.members)), h.group));
        Ok(self.table(&groups, &haloes, softening))
    }

    /// The radius within which particles are gathered about a group of a mass, at first.
    fn first_reach(&self, mass: f64) -> f64 {
        let thinnest = self.thinnest();
        FIRST_REACH * libm::cbrt(mass / thinnest)
    }

    /// The least mass over the cube of the radius.
    fn thinnest(&self) -> f64 {
        Overdensity::ALL.iter().filter_map(|kind| self.densities.mass_per_cube(*kind)).fold(f64::INFINITY, f64::min)
    }
}

/// The mass of a layer of a model.
fn layer_mass(layer: &Layer<Vec<Block>>) -> f64 {
    layer.mass.unit_or_one() * layer.content.iter().map(|b| b.mass).sum::<f64>()
}

/// Particles and Gaussians that are looked at about a centre.
pub struct AboutCenter<'a> {
    pub search: &'a HaloSearch<'a>,
    points: &'a PointGrid,
    fine: Option<&'a [bool]>,
    model: Option<&'a GaussianSpheres>,
    /// Mean number density of linked particles.
    number_density: f64,
    /// Circular velocities and profiles begin here.
    inner: f64,
}

impl AboutCenter<'_> {
    /// The haloes of a group: its density peak, and those of members outside R200m of the ones before, as long as they
    /// have the particles of a mass. Bridges of few particles link haloes that are apart.
    fn haloes_of(&self, group: usize, groups: &LinkedHaloes, context: &Context<'_>) -> Result<Vec<Halo>> {
        let (members, mass) = (&groups.members[group], groups.masses[group]);
        let (positions, domain) = (self.search.positions, self.search.domain);
        let mut haloes: Vec<Halo> = Vec::new();
        let mut left = members.to_vec();
        while haloes.is_empty() || left.len() >= LEAST_MASS {
            let center = density_peak(positions, &left, domain, self.number_density);
            let is_main = haloes.is_empty();
            let measures = self.measure((center, &[]), mass, context)?;
            let away = |x: [f64; 3], from: [f64; 3]| domain.shortest_way(each_axis(|k| x[k] - from[k]));
            let square = |d: [f64; 3]| d.iter().map(|v| v * v).sum::<f64>();
            let covers = |h: &Halo| square(away(center, h.center)) <= h.measures.radius().powi(2);
            // A further peak of few particles, or inside an earlier halo, is no halo of its own.
            if !is_main && (measures.count < LEAST_MASS || haloes.iter().any(covers)) {
                break;
            }
            let radius = measures.radius();
            let before = left.len();
            left.retain(|i| square(away(positions[*i as usize], center)) > radius * radius);
            let member_count = if is_main { members.len() } else { before - left.len() };
            haloes.push(Halo { group, center, members: member_count, is_main, measures, rank: 0, parent: None });
            // Nothing was taken away, so the next peak would be the same.
            if before == left.len() {
                break;
            }
        }
        Ok(haloes)
    }

    /// Measures about a centre without what lies in the balls beside it, which are counted from there. The mass is that
    /// of the group.
    pub fn measure(&self, about: ([f64; 3], &[Ball]), mass: f64, context: &Context<'_>) -> Result<HaloMeasures> {
        let search = self.search;
        let particles = self.gathered(about, mass);
        let per_cube: [Option<f64>; SPHERES] =
            std::array::from_fn(|i| search.densities.mass_per_cube(Overdensity::ALL[i]));
        let counted = per_cube.map(|per_cube| particles.sphere(per_cube?));
        // Fewer particles than a mass takes have no listed sphere, but one in which they are counted.
        let error = |s: &DensitySphere| match self.model {
            Some(_) => s.mass * number_error(s.count.max(1) as f64),
            None => f64::NAN,
        };
        let mut spheres = counted.map(|sphere| sphere.map(|s| HaloSphere { sphere: s, error: error(&s) }));
        if let Some(model) = self.model {
            // Gaussians have the source's masses.
            let scale = search.o.particle_mass.unwrap_or(1.0) / search.o.sample_fraction;
            let model_spheres = integrated(model, about, counted, per_cube.map(|c| Some(c? / scale)), context)?;
            for (sphere, model_sphere) in spheres.iter_mut().zip(model_spheres) {
                let scaled = model_sphere.map(|s| HaloSphere {
                    sphere: DensitySphere { mass: scale * s.sphere.mass, ..s.sphere },
                    error: scale * s.error,
                });
                *sphere = scaled.or(*sphere);
            }
        }
        let sphere_of = |kind: Overdensity| spheres[kind as usize].map(|s| s.sphere);
        let outer = sphere_of(Overdensity::Mean200).map_or(0.0, |s| s.radius);
        let inside = &particles.particles[..particles.count_within(outer)];
        // Particles of a model are integrated over its Gaussians, as masses are: those drawn scatter.
        let count = sphere_of(Overdensity::Mean200).filter(|_| self.model.is_some()).map_or(inside.len(), |s| s.count);
        let total_mass: f64 = inside.iter().map(|p| p.mass).sum();
        let coarse = |p: &SphereParticle| f64::from(self.fine.is_some_and(|fine| !fine[p.index as usize]));
        let share = inside.iter().map(|p| p.mass * coarse(p)).sum::<f64>() / total_mass;
        // To first order, of particles that are drawn each by itself.
        let share_error =
            inside.iter().map(|p| (p.mass * (coarse(p) - share)).powi(2)).sum::<f64>().sqrt() / total_mass;
        let contamination = [share, share_error];
        let critical = sphere_of(Overdensity::Critical200).map(|s| s.radius);
        let properties = |particles: &RadialParticles| {
            SphereProperties::new(particles, search.velocities, [self.inner, outer], critical, count)
        };
        let errors = self.model.filter(|_| count >= LEAST_MASS).map(|_| {
            // Errors of a sample are larger than those of all by the root of the factor, which is taken off below.
            let every = count.div_ceil(ERROR_SAMPLE).max(1);
            // Runs of eight successive particles go together, so that each part lacks one of them.
            let sample = |p: &&SphereParticle| (p.index as usize / JACKKNIFE).is_multiple_of(every);
            let part = |left_out: usize| {
                let others = inside.iter().filter(sample).filter(|p| p.index as usize % JACKKNIFE != left_out).copied();
                properties(&RadialParticles::new(others.collect(), 0.0))
            };
            let parts = std::array::from_fn::<_, JACKKNIFE, _>(part);
            SphereProperties::jackknife(&parts, (every as f64).sqrt().recip())
        });
        // The radius that holds the root of the particles follows the centre's error (docs/results/haloes.md).
        let core = (inside.len().max(search.o.smallest) as f64).sqrt().round() as usize;
        let center_error = particles.particles.get(core - 1).map_or(f64::NAN, |p| CENTER_ERROR * p.square.sqrt());
        Ok(HaloMeasures { spheres, count, center_error, properties: properties(&particles), errors, contamination })
    }

    /// Particles about a centre, as far as the thinnest sphere reaches.
    fn gathered(&self, (center, excluded): ([f64; 3], &[Ball]), mass: f64) -> RadialParticles {
        let (search, points) = (self.search, self.points);
        let domain = search.domain;
        let heights = domain.heights();
        // Beyond half the box a particle and its image would both be inside.
        let furthest = (0..3).filter(|k| domain.periodic[*k]).map(|k| 0.5 * heights[k]).fold(f64::INFINITY, f64::min);
        let mut reach = search.first_reach(mass).min(furthest);
        loop {
            let (mut near_particles, mut number) = (Vec::new(), 0);
            points.within(center, reach, |index, offset, square| {
                number += 1;
                if !excluded.iter().any(|ball| ball.contains(offset)) {
                    let index = index as u32;
                    near_particles.push(SphereParticle { square, offset, mass: search.mass_of(index), index });
                }
            });
            let holds_all = number == search.positions.len();
            let particles = RadialParticles::new(near_particles, reach);
            if holds_all || reach >= furthest || particles.sphere(search.thinnest()).is_some() {
                return particles;
            }
            reach = (GROWTH * reach).min(furthest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::space::Cell;
    use particlegs_particles::Column;
    use particlegs_particles::testing::{from_points, model_of};

    /// Clouds of particles, each a place, a width and a number, and `spread` particles anywhere, in a periodic box of
    /// 10.
    fn places(clouds: &[([f64; 3], f64, usize)], spread: usize, seed: u64) -> Vec<[f64; 3]> {
        let mut r = Random::new(seed, 0, 0);
        let mut all = Vec::new();
        for (center, width, n) in clouds {
            all.extend((0..*n).map(|_| each_axis(|k| (center[k] + width * r.normal()).rem_euclid(10.0))));
        }
        all.extend((0..spread).map(|_| each_axis(|_| 10.0 * r.uniform())));
        all
    }

    /// Particles of layers: a name, a mass and places.
    fn particles(layers: &[(&str, f32, Vec<[f64; 3]>)]) -> Particles {
        let mut p = from_points(layers.iter().flat_map(|l| l.2.clone()));
        p.meta.cell = Some(Cell::orthogonal([10.0; 3]));
        p.meta.units = Units::new(Some("Mpc/h"), Some("1e10 Msun/h"), Some(true));
        p.meta.epoch.scale_factor = Some(0.5);
        p.meta.cosmology =
            Cosmology { hubble: Some(0.7), omega_matter: Some(0.3), omega_lambda: Some(0.7), omega_baryon: None };
        let weights = layers.iter().flat_map(|l| std::iter::repeat_n(l.1, l.2.len())).collect();
        let mut first = 0;
        let layers = layers.iter().map(|(name, _, places)| {
            first += places.len();
            Layer { name: name.to_string(), mass: Mass::Weights(Some(1.0)), content: first - places.len()..first }
        });
        let layers = layers.collect();
        p.with_weights(Column::owned(weights)).with_layers(layers)
    }

    fn haloes(p: &Particles, o: &HaloOptions) -> HaloCatalogue {
        find_haloes(Subject::Particles(p), o, &Context::SILENT).unwrap()
    }

    #[test]
    fn gas_is_attached_to_dark_matter_and_weighs_in_its_spheres() {
        let cloud = |n| [([0.02, 5.0, 5.0], 0.05, n)];
        let p = particles(&[
            ("PartType0", 0.5, places(&cloud(1000), 2000, 1)),
            ("PartType1", 2.0, places(&cloud(4000), 8000, 2)),
        ]);
        let catalogue = haloes(&p, &HaloOptions::default());
        let value_of = |name: &str| catalogue.column(name).unwrap()[0];
        let linked = value_of("num_p");
        assert!((3800.0..4020.0).contains(&linked) && (900.0..1010.0).contains(&value_of("num_attached")));
        // The unit of mass is 1e10 Msun/h.
        assert!((value_of("mfof") / (1e10 * (2.0 * linked + 0.5 * value_of("num_attached"))) - 1.0).abs() < 1e-9);
        assert!((value_of("m200m") / 1e10 / 8500.0 - 1.0).abs() < 0.05, "{}", value_of("m200m"));
        assert!((value_of("r200m_kpc") / (value_of("r200m") * 1e3 * 0.5 / 0.7) - 1.0).abs() < 1e-9);
        assert!(catalogue.centers[0][0] < 0.1 && catalogue.column("contamination").is_none());
        let all = HaloOptions { linked: vec!["gas".into(), "dm".into()], ..HaloOptions::default() };
        assert!(haloes(&p, &all).column("num_attached").is_none());
        let tenth = HaloOptions { sample_fraction: 0.1, ..HaloOptions::default() };
        assert!(haloes(&p, &tenth).column("mfof").unwrap()[0] / value_of("mfof") > 9.9);
    }

    #[test]
    fn particles_of_a_model_have_the_masses_of_their_layers() {
        let cloud = |x: f64, width: f64, count| ([x, 5.0, 5.0], Sym3::scaled_identity(width * width), count);
        let mut model = model_of(&[cloud(3.0, 0.05, 3000.0), cloud(5.0, 2.0, 5000.0)], [10.0; 3]);
        let stated = particles(&[("dm", 1.0, vec![[1.0; 3]])]).meta;
        (model.metadata.units, model.metadata.epoch) = (stated.units, stated.epoch);
        model.metadata.cosmology = stated.cosmology;
        let haloes = |mass: f64| {
            let mut model = model.clone();
            (model.layers[0].name, model.layers[0].mass) = ("PartType1".into(), Mass::new(false, Some(mass)));
            find_haloes(Subject::Model(&model), &HaloOptions::default(), &Context::SILENT).unwrap()
        };
        for mass in [0.5, 8.0] {
            let catalogue = haloes(mass);
            let value_of = |name: &str| catalogue.column(name).unwrap()[0];
            assert!((value_of("mfof") / value_of("num_p") / (1e10 * mass) - 1.0).abs() < 1e-9, "{}", value_of("mfof"));
            assert!(
                (value_of("m200m") / value_of("n200m") / (1e10 * mass) - 1.0).abs() < 1e-3
                    && value_of("m200m_err") > 0.0
            );
            assert!((value_of("vmax") / haloes(1.0).column("vmax").unwrap()[0] / mass.sqrt() - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn masses_of_their_own_are_known_without_a_unit_of_their_layer() {
        let cloud = |n| [([5.0; 3], 0.05, n)];
        let p = particles(&[
            ("PartType1", 2.0, places(&cloud(3000), 3000, 1)),
            ("PartType0", 0.5, places(&cloud(1000), 1000, 2)),
        ]);
        let catalogue_of = |masses: [Mass; 2]| {
            let layers = p.layers().iter().zip(masses).map(|(l, mass)| Layer { mass, ..l.clone() }).collect();
            haloes(&p.clone().with_layers(layers), &HaloOptions::default())
        };
        let stated = catalogue_of([Mass::Weights(Some(1.0)); 2]);
        for masses in [[Mass::Weights(None); 2], [Mass::Each(2.0), Mass::Weights(None)]] {
            let catalogue = catalogue_of(masses);
            assert_eq!(catalogue.column("mfof"), stated.column("mfof"));
            assert!(!catalogue.notes.iter().any(|n| n.contains("does not state masses")), "{:?}", catalogue.notes);
        }
        let options = HaloOptions { particle_mass: Some(2.0), ..HaloOptions::default() };
        assert!(find_haloes(Subject::Particles(&p), &options, &Context::SILENT).is_err());
        let none = catalogue_of([Mass::Unknown; 2]);
        assert!(none.column("mfof").is_none() && none.notes.iter().any(|n| n.contains("does not state masses")));
    }

    #[test]
    fn clouds_that_a_bridge_links_are_two_haloes_and_satellites_have_a_parent() {
        let clouds = [([3.0; 3], 0.1, 4000), ([4.5, 3.0, 3.0], 0.08, 1500)];
        let mut all = places(&clouds, 2000, 3);
        all.extend((0..60).map(|i| [3.0 + 0.025 * f64::from(i), 3.0, 3.0]));
        // Its own group, within the first one's sphere.
        all.extend(places(&[([3.0, 3.62, 3.0], 0.01, 150)], 0, 4));
        let p = particles(&[("dm", 1.0, all)]);
        let catalogue = haloes(&p, &HaloOptions::default());
        let column = |name: &str| catalogue.column(name).unwrap();
        assert!(column("n200m")[0] > 4000.0 && column("n200m")[1] > 1400.0 && column("n200m")[1] < 1800.0);
        assert_eq!((column("fof_id")[0], column("fof_id")[1]), (1.0, 1.0));
        assert!(column("mfof")[1].is_nan() && (catalogue.centers[1][0] - 4.5).abs() < 0.05);
        assert_eq!((&column("parent_id")[..2], &column("satellite")[..2]), (&[-1.0, 1.0][..], &[0.0, 0.0][..]));
        let satellite = (0..catalogue.len()).find(|i| (catalogue.centers[*i][1] - 3.62).abs() < 0.02).unwrap();
        assert_eq!((column("parent_id")[satellite], column("fof_id")[satellite] as usize), (1.0, satellite + 1));
        assert_eq!((column("satellite")[satellite], column("num_p")[satellite]), (1.0, 150.0));
        let note = |c: &HaloCatalogue| c.notes.iter().any(|n| n.contains("above three times num_p"));
        let short = HaloOptions { linking: 0.03, ..HaloOptions::default() };
        assert!(!note(&catalogue) && note(&haloes(&p, &short)));
    }

    #[test]
    fn coarse_particles_of_a_zoom_are_not_linked_and_contaminate() {
        let fine = places(&[([5.0; 3], 0.05, 3000)], 0, 5);
        let region = (0..4000).map(|i| {
            let mut r = Random::new(6, 0, i);
            each_axis(|_| 4.0 + 2.0 * r.uniform())
        });
        let coarse = places(&[([5.0; 3], 0.05, 40)], 4000, 7);
        let p = particles(&[("PartType1", 1.0, fine.into_iter().chain(region).collect()), ("PartType2", 8.0, coarse)]);
        let catalogue = haloes(&p, &HaloOptions::default());
        let value_of = |name: &str| catalogue.column(name).unwrap()[0];
        assert!((value_of("contamination") - 320.0 / 3320.0).abs() < 0.03, "{}", value_of("contamination"));
        assert!(value_of("num_p") <= 3300.0);
    }
}

//! The whole job: from particles or a model to a catalogue.

use super::members::{LinkOptions, LinkedHaloes, density_peak};
use super::overdensity::{HaloDensities, Overdensity};
use super::properties::{HaloProperty, HaloPropertyKind, PROPERTIES, SphereProperties};
use super::sphere::{DensitySphere, RadialParticles, SphereParticle};
use super::table::{HaloCatalogue, HaloColumn};
use crate::context::Context;
use crate::model::{Cosmology, Dimension, Epoch, Mass, Model, Unit, UnitSystem, Units};
use crate::particles::Particles;
use crate::recover::Options as RecoverOptions;
use crate::stats::{Domain, GaussianSpheres, ParticleFields, PointGrid, local_positions};
use crate::{Error, NamedValue, Result, parallel};
use particlegs_core::math::each_axis;
use std::borrow::Cow;

/// Particles inside a sphere whose mass is listed, at least.
const LEAST_MASS: usize = 100;
/// Parts that a model's particles are left out by, one after the other, for errors.
const JACKKNIFE: usize = 8;
/// Softening lengths within which circular velocities and profiles are not looked at.
const SOFTENINGS: f64 = 3.0;
/// Softening length in mean spacings, where it is not stated.
const SOFTENING: f64 = 0.04;
/// The sphere that particles are gathered in at first, in radii that the group's mass suggests, and its growth.
const FIRST_REACH: f64 = 1.3;
const GROWTH: f64 = 1.5;
/// Steps of the logarithm of the radius in which masses are integrated, and the most of them.
const CURVE_STEP: f64 = 0.3;
const MOST_STEPS: f64 = 32.0;
/// How far beyond the spheres of drawn particles, as a factor, at first; and how often that is raised.
const CURVE_REACH: f64 = 1.2;
const CURVES: usize = 4;
/// Particles that errors are measured of, about: of more, each of some, scaled as errors are with numbers.
const ERROR_SAMPLE: usize = 1024;
/// Numbers of densities.
const SPHERES: usize = Overdensity::ALL.len();

/// How haloes are found.
#[derive(Clone, Debug, PartialEq)]
pub struct HaloOptions {
    /// Linking length in mean spacings of the linked particles.
    pub linking: f64,
    /// Linked particles of the smallest halo.
    pub smallest: usize,
    /// Layers that are linked; by default those of dark matter where there are some, else all.
    pub linked: Vec<String>,
    /// Softening length, world units; `None` = a 25th of the linked particles' mean spacing.
    pub softening: Option<f64>,
    /// Share of the simulation's particles that were read: masses are divided by it.
    pub sample_fraction: f64,
    /// Mass of a particle, in the unit of mass, where the source does not say.
    pub particle_mass: Option<f64>,
    /// Unit of mass, over what the source says.
    pub mass_unit: Option<String>,
    /// Cosmology, over what the source says.
    pub cosmology: Cosmology,
    /// Redshift, over what the source says.
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

/// What haloes are found in.
#[derive(Clone, Copy)]
pub enum HaloSource<'a> {
    /// Particles, and the same with velocities where they have any.
    Particles(&'a Particles, Option<&'a ParticleFields>),
    /// A model: haloes are found in particles drawn from it, and their masses integrated over its Gaussians.
    Model(&'a Model),
}

/// What is known of a source beside its particles: what a user states, else what it says.
struct HaloSetting {
    epoch: Epoch,
    cosmology: Cosmology,
    units: Units,
}

impl HaloSetting {
    fn new(source: &HaloSource<'_>, o: &HaloOptions) -> Self {
        let (epoch, cosmology, units) = match source {
            HaloSource::Particles(p, _) => (&p.meta.epoch, p.meta.cosmology, &p.meta.units),
            HaloSource::Model(m) => (&m.metadata.epoch, m.metadata.cosmology, &m.metadata.units),
        };
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
/// Options out of range; a particle type that does not exist; no mean density, where the box is not periodic and the cosmology not stated; too little memory.
pub fn find_haloes(source: HaloSource<'_>, o: &HaloOptions, context: &Context<'_>) -> Result<HaloCatalogue> {
    check(o)?;
    let drawn;
    let (particles, velocities, domain) = match source {
        HaloSource::Particles(p, v) => (p, v.map(Cow::Borrowed), Domain::from_particles(p)),
        HaloSource::Model(m) => {
            let options = RecoverOptions { seed: o.seed, ..RecoverOptions::default() };
            let (particles, fields) = options.draw_with_fields(m.clone(), context)?;
            let velocities = ParticleFields::moving(&particles, &fields)?;
            drawn = particles;
            (&drawn, velocities.map(Cow::Owned), Domain::from_model(m))
        }
    };
    if particles.is_empty() {
        return Err(Error::argument("there are no particles"));
    }
    let positions = local_positions(particles, &domain);
    let search = HaloSearch::new(source, particles, velocities.as_deref(), (&domain, &positions), o)?;
    search.catalogue(context)
}

fn check(o: &HaloOptions) -> Result<()> {
    let within = |name: &str, value: f64, [low, high]: [f64; 2]| {
        let fault = || Error::argument(format!("{name} must be {low} to {high}, not {value}"));
        (low..=high).contains(&value).then_some(()).ok_or_else(fault)
    };
    within("the linking length in mean spacings", o.linking, [1e-6, 2.0])?;
    within("the smallest number of particles", o.smallest as f64, [2.0, 1e9])?;
    within("the share of particles that were read", o.sample_fraction, [1e-9, 1.0])?;
    within("the redshift", o.redshift.unwrap_or(0.0), [-0.999, 1e6])?;
    within("the softening length", o.softening.unwrap_or(0.0), [0.0, f64::MAX])?;
    within("the mass of a particle", o.particle_mass.unwrap_or(1.0), [f64::MIN_POSITIVE, f64::MAX])
}

/// One run.
struct HaloSearch<'a> {
    source: HaloSource<'a>,
    setting: HaloSetting,
    particles: &'a Particles,
    velocities: Option<&'a ParticleFields>,
    domain: &'a Domain,
    positions: &'a [[f64; 3]],
    o: &'a HaloOptions,
    densities: HaloDensities,
    /// Mass of weight 1.
    unit: f64,
    /// Masses are known.
    masses: bool,
}

/// A halo of a group.
struct Halo {
    /// Relative to the domain's corner.
    center: [f64; 3],
    /// Linked particles: those of the group, or within R200m where it is not the group's densest.
    members: usize,
    /// Is it the densest of its group?
    is_main: bool,
    measures: HaloMeasures,
}

/// What is measured about one centre.
struct HaloMeasures {
    spheres: [Option<HaloSphere>; SPHERES],
    /// Particles inside the first.
    count: usize,
    properties: SphereProperties,
    errors: Option<SphereProperties>,
    contamination: f64,
}

impl HaloMeasures {
    /// R200m; 0 where there is none.
    fn radius(&self) -> f64 {
        self.spheres[Overdensity::Mean200 as usize].map_or(0.0, |s| s.sphere.radius)
    }
}

/// A sphere, and the error of its mass, of a model.
#[derive(Clone, Copy)]
struct HaloSphere {
    sphere: DensitySphere,
    error: f64,
}

impl<'a> HaloSearch<'a> {
    fn new(
        source: HaloSource<'a>,
        particles: &'a Particles,
        velocities: Option<&'a ParticleFields>,
        (domain, positions): (&'a Domain, &'a [[f64; 3]]),
        o: &'a HaloOptions,
    ) -> Result<Self> {
        let layers = particles.layers();
        let stated = layers.iter().all(|l| l.mass.unit().is_some()) && particles.meta.weight_name.is_none();
        let alike = layers.iter().all(|l| l.mass == Mass::Unknown);
        if o.particle_mass.is_some() && !alike {
            return Err(Error::argument("a mass of the particles was given, but the file states masses"));
        }
        let masses = stated || o.particle_mass.is_some();
        let each = o.particle_mass.or(particles.meta.particle_mass).unwrap_or(1.0);
        let unit = each / o.sample_fraction;
        let mean = (domain.periodic == [true; 3]).then(|| unit * particles.total_mass() / domain.volume());
        let setting = HaloSetting::new(&source, o);
        let HaloSetting { epoch, cosmology, units } = &setting;
        let system = UnitSystem::new(units, epoch, cosmology);
        let densities = HaloDensities::new(&system, (epoch, cosmology), mean, masses)?;
        Ok(HaloSearch { source, setting, particles, velocities, domain, positions, o, densities, unit, masses })
    }

    fn mass_of(&self, i: u32) -> f64 {
        self.unit * self.particles.weights().map_or(1.0, |w| f64::from(w[i as usize]))
    }

    fn catalogue(&self, context: &Context<'_>) -> Result<HaloCatalogue> {
        let link = LinkOptions { linking: self.o.linking, smallest: self.o.smallest, linked: &self.o.linked };
        let mass = |i: u32| self.mass_of(i);
        let found = LinkedHaloes::find(self.particles, self.positions, self.domain, &link, &mass, context)?;
        context.begin("haloes", found.members.len() as u64);
        let reach = self.first_reach(found.masses.first().copied().unwrap_or(0.0));
        let points = PointGrid::new(self.positions, self.domain, 0.0)?;
        let model = match self.source {
            HaloSource::Particles(..) => None,
            HaloSource::Model(m) => Some(GaussianSpheres::new(m, self.domain, reach)?),
        };
        let softening = self.o.softening.unwrap_or(SOFTENING * found.number_density.powf(-1.0 / 3.0));
        let about = AboutCenter {
            search: self,
            points: &points,
            fine: found.fine.as_deref(),
            model: model.as_ref(),
            number_density: found.number_density,
            inner: SOFTENINGS * softening,
        };
        let haloes = parallel::try_map_range(found.members.len(), |group| {
            context.check()?;
            let haloes = about.haloes_of(&found.members[group], found.masses[group], context)?;
            context.advance(1);
            Ok::<_, Error>(haloes.into_iter().map(move |halo| (group, halo)))
        })?;
        context.end();
        let mut haloes: Vec<(usize, Halo)> = haloes.into_iter().flatten().collect();
        haloes.sort_by_key(|(group, h)| (std::cmp::Reverse((h.measures.count, h.members)), *group));
        let parents = self.parents(&haloes)?;
        Ok(self.table(&found, &haloes, &parents, softening))
    }

    /// How far particles are looked for about a group of a mass, at first.
    fn first_reach(&self, mass: f64) -> f64 {
        let thinnest = self.thinnest();
        FIRST_REACH * (mass / thinnest).cbrt()
    }

    /// The least mass over the cube of the radius.
    fn thinnest(&self) -> f64 {
        Overdensity::ALL.iter().filter_map(|kind| self.densities.mass_per_cube(*kind)).fold(f64::INFINITY, f64::min)
    }

    /// The heaviest halo in whose R200m each centre lies that is heavier; its number.
    fn parents(&self, haloes: &[(usize, Halo)]) -> Result<Vec<Option<usize>>> {
        let centers: Vec<[f64; 3]> = haloes.iter().map(|h| h.1.center).collect();
        let sphere = |i: usize| {
            haloes[i].1.measures.spheres[Overdensity::Mean200 as usize].filter(|s| s.sphere.count >= LEAST_MASS)
        };
        let mass = |i: usize| sphere(i).map_or(0.0, |s| s.sphere.mass);
        let mut order: Vec<usize> = (0..centers.len()).filter(|i| sphere(*i).is_some()).collect();
        order.sort_by(|a, b| mass(*b).total_cmp(&mass(*a)).then(a.cmp(b)));
        let points = PointGrid::new(&centers, self.domain, 0.0)?;
        let mut parents = vec![None; centers.len()];
        for i in order {
            let radius = sphere(i).map_or(0.0, |s| s.sphere.radius);
            points.near(points.cell_of(centers[i]), radius, |run, shift| {
                for at in run {
                    let other = points.index[at] as usize;
                    let square: f64 =
                        (0..3).map(|k| points.position[at][k] + shift[k] - centers[i][k]).map(|d| d * d).sum();
                    if other != i && square <= radius * radius && mass(other) < mass(i) && parents[other].is_none() {
                        parents[other] = Some(i);
                    }
                }
            });
        }
        Ok(parents)
    }
}

impl HaloSearch<'_> {
    fn table(
        &self,
        found: &LinkedHaloes,
        haloes: &[(usize, Halo)],
        parents: &[Option<usize>],
        softening: f64,
    ) -> HaloCatalogue {
        let measures: Vec<&HaloMeasures> = haloes.iter().map(|h| &h.1.measures).collect();
        let mut main = vec![0; found.members.len()];
        haloes.iter().enumerate().filter(|(_, h)| h.1.is_main).for_each(|(i, h)| main[h.0] = i);
        let of_group = |i: usize, value: f64| if haloes[i].1.is_main { value } else { f64::NAN };
        let (setting, units) = (&self.setting, &self.densities.units);
        let world = |c: &[f64; 3]| -> [f64; 3] { each_axis(|k| self.domain.min[k] + c[k]) };
        let centers: Vec<[f64; 3]> = haloes.iter().map(|h| world(&h.1.center)).collect();
        let length = setting.units.length_text().unwrap_or("").to_string();
        let (mass_unit, mass_factor) = match (units.mass, &setting.units.mass) {
            (Some(factor), _) => ("Msun/h".to_string(), factor),
            (None, Some(unit)) => (unit.text.clone(), 1.0),
            (None, None) => (String::new(), 1.0),
        };
        let physical = units.length.zip(units.scale_factor).zip(units.hubble).map(|((l, a), h)| 1e3 * l * a / h);
        let mut columns = Vec::new();
        let mut add = |name: &str, unit: &str, description: &str, of: &dyn Fn(usize) -> f64| {
            let values = (0..centers.len()).map(of).collect();
            let (name, unit, description) = (name.into(), unit.into(), description.into());
            columns.push(HaloColumn { name, unit, description, whole: false, values });
        };
        add("id", "", "number of the halo", &|i| (i + 1) as f64);
        add("parent_id", "", "the heaviest halo in whose R200m the centre lies; -1 = none", &|i| {
            parents[i].map_or(-1.0, |p| (p + 1) as f64)
        });
        add(
            "fof_id",
            "",
            "the densest halo of its group of linked particles: itself, or one that it is linked to",
            &|i| (main[haloes[i].0] + 1) as f64,
        );
        add(
            "num_p",
            "",
            "linked particles: of the whole group, or within R200m of a halo that is not its densest",
            &|i| haloes[i].1.members as f64,
        );
        if let Some(attached) = &found.attached {
            add("num_attached", "", "particles of other types, each nearest to a linked one", &|i| {
                of_group(i, attached[haloes[i].0] as f64)
            });
        }
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            add(axis, &length, "density peak", &|i| centers[i][k]);
        }
        if self.masses {
            add("mfof", &mass_unit, "mass of the group: particles that are linked and attached", &|i| {
                of_group(i, found.masses[haloes[i].0] * mass_factor)
            });
        }
        add("n200m", "", "particles within R200m", &|i| {
            if measures[i].count > 0 { measures[i].count as f64 } else { f64::NAN }
        });
        let is_model = matches!(self.source, HaloSource::Model(_));
        for kind in Overdensity::ALL.iter().filter(|kind| self.densities.density[**kind as usize].is_some()) {
            let name = kind.name();
            let sphere = |i: usize| measures[i].spheres[*kind as usize].filter(|s| s.sphere.count >= LEAST_MASS);
            let of = |value: fn(HaloSphere) -> f64| move |i: usize| sphere(i).map_or(f64::NAN, value);
            let (mass, radius) = (of(|s| s.sphere.mass), of(|s| s.sphere.radius));
            let mass_error = of(|s| s.error);
            let radius_error = of(|s| s.sphere.radius * s.error / (3.0 * s.sphere.mass));
            let (about, error) = (
                format!("whose mean density is {}", Overdensity::VALUES[*kind as usize].2.replace("The", "the")),
                "standard error",
            );
            if self.masses {
                add(&format!("m{name}"), &mass_unit, &format!("mass within r{name}"), &|i| mass(i) * mass_factor);
                if is_model {
                    add(&format!("m{name}_err"), &mass_unit, error, &|i| mass_error(i) * mass_factor);
                }
                if let (Some(factor), Some(h)) = (units.mass, units.hubble) {
                    add(&format!("m{name}_msun"), "Msun", &format!("mass within r{name}"), &|i| mass(i) * factor / h);
                }
            }
            add(&format!("r{name}"), &length, &format!("radius of the sphere {about}"), &radius);
            if is_model {
                add(&format!("r{name}_err"), &length, error, &radius_error);
            }
            if let Some(factor) = physical {
                add(&format!("r{name}_kpc"), "kpc", "the same, physical", &|i| radius(i) * factor);
            }
        }
        let velocity_unit = self.velocities.map(|v| v.unit().unwrap_or("").to_string());
        let circular = units.velocity_square().filter(|_| self.masses);
        for (k, p) in PROPERTIES.iter().enumerate() {
            let Some((unit, scale)) = scale_of(p, velocity_unit.as_deref(), circular, &length) else { continue };
            if p.least >= 1000 && self.densities.density[Overdensity::Critical200 as usize].is_none() {
                continue;
            }
            add(p.name, unit, p.description, &|i| scale(measures[i].properties.0[k]));
            if is_model {
                let error = |i: usize| {
                    let value = measures[i].properties.0[k];
                    let error = measures[i].errors.map_or(f64::NAN, |e| e.0[k]);
                    // To first order.
                    (scale(value + 0.5 * error) - scale(value - 0.5 * error)).abs()
                };
                add(&format!("{}_err", p.name), unit, "standard error", &error);
            }
        }
        if found.fine.is_some() {
            add("contamination", "", "share of the mass within R200m that is of the zoom's coarse particles", &|i| {
                measures[i].contamination
            });
        }
        for column in &mut columns {
            column.whole = ["id", "parent_id", "fof_id", "num_p", "num_attached", "n200m"].contains(&&column.name[..]);
        }
        let (notes, remarks) = (self.notes(found), self.remarks(found, softening, &length));
        HaloCatalogue { columns, remarks, notes, centers }
    }

    fn notes(&self, found: &LinkedHaloes) -> Vec<String> {
        let mut notes = self.densities.notes.clone();
        if !self.masses {
            notes.push(
                "the file does not state masses of the particles: masses are left out, n200m counts particles".into(),
            );
        }
        notes.extend(found.note.clone());
        notes
    }

    /// What a reader of the file must know.
    fn remarks(&self, found: &LinkedHaloes, softening: f64, length: &str) -> Vec<String> {
        let (meta, o) = (&self.particles.meta, self.o);
        let HaloSetting { epoch, cosmology, .. } = &self.setting;
        let stated = |name: &str, value: Option<f64>| value.map(|v| format!("{name} = {v}"));
        let numbers = [
            stated("a", epoch.scale_factor),
            stated("h", cosmology.hubble),
            stated("Omega_m", cosmology.omega_matter),
            stated("Omega_Lambda", cosmology.omega_lambda),
        ];
        let mut all = vec![
            format!("haloes of {}", meta.name),
            format!("friends of friends, linking length {:.6} {length} ({} mean spacings), {} particles and more; spherical overdensities about density peaks", found.linking_length, o.linking, o.smallest),
            "no unbinding, no subhaloes; a quantity is empty where its sphere has too few particles: masses 100, dispersion, shape and vmax 300, concentration 1000".into(),
            numbers.into_iter().flatten().collect::<Vec<_>>().join("; "),
        ];
        let assumed = if o.softening.is_none() { ", assumed: a 25th of the mean spacing" } else { "" };
        all.push(format!("softening length {softening:.6} {length}{assumed}; vmax and c200c begin at three of these"));
        if matches!(self.source, HaloSource::Model(_)) {
            all.push(format!("of a model: centres, velocities, shapes and profiles of particles drawn from it (seed {}), masses integrated over its Gaussians; errors of masses are those of drawing particles, others by leaving out one of eight parts of the particles", o.seed));
        }
        if o.sample_fraction != 1.0 {
            all.push(format!("masses are divided by {}, the share of the particles that were read", o.sample_fraction));
        }
        all.retain(|line| !line.is_empty());
        all
    }
}

/// Unit of a property and what makes a column of its numbers; `None` where its unit is not known.
fn scale_of<'a>(
    p: &HaloProperty,
    velocity: Option<&'a str>,
    circular: Option<f64>,
    length: &'a str,
) -> Option<(&'a str, Box<dyn Fn(f64) -> f64>)> {
    match p.kind {
        HaloPropertyKind::Velocity => Some((velocity?, Box::new(|v| v))),
        HaloPropertyKind::Circular => {
            let factor = circular?;
            Some(("km/s", Box::new(move |v: f64| (factor * v).sqrt())))
        }
        HaloPropertyKind::Length => circular.map(|_| (length, Box::new(|v| v) as Box<dyn Fn(f64) -> f64>)),
        HaloPropertyKind::Number => Some(("", Box::new(|v| v))),
    }
}

/// What is looked at about a centre.
struct AboutCenter<'a> {
    search: &'a HaloSearch<'a>,
    points: &'a PointGrid,
    fine: Option<&'a [bool]>,
    model: Option<&'a GaussianSpheres>,
    /// Mean number density of linked particles.
    number_density: f64,
    /// Circular velocities and profiles begin here.
    inner: f64,
}

impl AboutCenter<'_> {
    /// The haloes of a group: its density peak, and those of what lies outside R200m of the ones before, as long as they have
    /// the particles of a mass. Bridges of few particles link haloes that are apart.
    fn haloes_of(&self, members: &[u32], mass: f64, context: &Context<'_>) -> Result<Vec<Halo>> {
        let (positions, domain) = (self.search.positions, self.search.domain);
        let mut haloes: Vec<Halo> = Vec::new();
        let mut left = members.to_vec();
        while haloes.is_empty() || left.len() >= LEAST_MASS {
            let center = density_peak(positions, &left, domain, self.number_density);
            let is_main = haloes.is_empty();
            let measures = self.measure(center, mass, context)?;
            let away = |x: [f64; 3], from: [f64; 3]| domain.shortest_way(each_axis(|k| x[k] - from[k]));
            let square = |d: [f64; 3]| d.iter().map(|v| v * v).sum::<f64>();
            let covers = |h: &Halo| square(away(center, h.center)) <= h.measures.radius().powi(2);
            if !is_main && (measures.count < LEAST_MASS || haloes.iter().any(covers)) {
                break;
            }
            let radius = measures.radius();
            let before = left.len();
            left.retain(|i| square(away(positions[*i as usize], center)) > radius * radius);
            let own = if is_main { members.len() } else { before - left.len() };
            haloes.push(Halo { center, members: own, is_main, measures });
            if before == left.len() {
                break;
            }
        }
        Ok(haloes)
    }

    fn measure(&self, center: [f64; 3], mass: f64, context: &Context<'_>) -> Result<HaloMeasures> {
        let search = self.search;
        let particles = self.gathered(center, mass);
        let per_cube: [Option<f64>; SPHERES] =
            std::array::from_fn(|i| search.densities.mass_per_cube(Overdensity::ALL[i]));
        let counted = per_cube.map(|per_cube| particles.sphere(per_cube?));
        // Fewer particles than a mass takes have no listed sphere, but one in which they are counted.
        let mut spheres = counted.map(|found| Some(HaloSphere { sphere: found?, error: f64::NAN }));
        if let Some(model) = self.model {
            // Gaussians have the source's masses.
            let scale = search.o.particle_mass.unwrap_or(1.0) / search.o.sample_fraction;
            let found = integrated(model, center, counted, per_cube.map(|c| Some(c? / scale)), context)?;
            for (sphere, found) in spheres.iter_mut().zip(found) {
                let scaled = found.map(|s| HaloSphere {
                    sphere: DensitySphere { mass: scale * s.sphere.mass, ..s.sphere },
                    error: scale * s.error,
                });
                *sphere = scaled.or(*sphere);
            }
        }
        let of = |kind: Overdensity| spheres[kind as usize].map(|s| s.sphere);
        let outer = of(Overdensity::Mean200).map_or(0.0, |s| s.radius);
        let count = particles.count_within(outer);
        let inside = &particles.particles[..count];
        let all: f64 = inside.iter().map(|p| p.mass).sum();
        let coarse = |p: &&SphereParticle| self.fine.is_some_and(|fine| !fine[p.index as usize]);
        let contamination = inside.iter().filter(coarse).map(|p| p.mass).sum::<f64>() / all;
        let critical = of(Overdensity::Critical200).map(|s| s.radius);
        let properties = |particles: &RadialParticles| {
            SphereProperties::new(particles, search.velocities, [self.inner, outer], critical, count)
        };
        let errors = self.model.filter(|_| count >= LEAST_MASS).map(|_| {
            let every = count.div_ceil(ERROR_SAMPLE).max(1);
            let sample = |p: &&SphereParticle| (p.index as usize / JACKKNIFE).is_multiple_of(every);
            let part = |left_out: usize| {
                let others = inside.iter().filter(sample).filter(|p| p.index as usize % JACKKNIFE != left_out).copied();
                properties(&RadialParticles::new(others.collect()))
            };
            let parts = std::array::from_fn::<_, JACKKNIFE, _>(part);
            SphereProperties::jackknife(&parts, (every as f64).sqrt().recip())
        });
        Ok(HaloMeasures { spheres, count, properties: properties(&particles), errors, contamination })
    }

    /// Particles about a centre, as far as the thinnest sphere reaches.
    fn gathered(&self, center: [f64; 3], mass: f64) -> RadialParticles {
        let (search, points) = (self.search, self.points);
        let domain = search.domain;
        let heights = domain.heights();
        let furthest = (0..3).filter(|k| domain.periodic[*k]).map(|k| 0.5 * heights[k]).fold(f64::INFINITY, f64::min);
        let mut reach = search.first_reach(mass).min(furthest);
        loop {
            let mut found = Vec::new();
            points.near(points.cell_of(center), reach, |run, shift| {
                for at in run {
                    let offset: [f64; 3] = each_axis(|k| points.position[at][k] + shift[k] - center[k]);
                    let square = offset.iter().map(|d| d * d).sum::<f64>();
                    if square <= reach * reach {
                        let index = points.index[at];
                        found.push(SphereParticle { square, offset, mass: search.mass_of(index), index });
                    }
                }
            });
            let all = found.len() == search.positions.len();
            let particles = RadialParticles::new(found);
            if all || reach >= furthest || particles.sphere(search.thinnest()).is_some() {
                return particles;
            }
            reach = (GROWTH * reach).min(furthest);
        }
    }
}

/// Logarithms of masses inside spheres, and of radii: what is between is a parabola through the three nearest.
struct MassCurve {
    /// Logarithm of the first radius, and the distance of each from the last.
    first: f64,
    step: f64,
    /// Logarithms of the masses, and their variances.
    masses: Vec<(f64, f64)>,
}

impl MassCurve {
    /// By integration over Gaussians, from one radius to another.
    fn new(model: &GaussianSpheres, center: [f64; 3], ends: [f64; 2], context: &Context<'_>) -> Result<MassCurve> {
        let [first, last] = ends.map(f64::ln);
        let number = ((last - first) / CURVE_STEP).ceil().clamp(2.0, MOST_STEPS);
        let step = (last - first) / number;
        let radii: Vec<f64> = (0..=number as usize).map(|i| (first + step * i as f64).exp()).collect();
        let inside = model.enclosed(center, &radii, context)?;
        let masses = inside.into_iter().map(|[m, variance]| (m.max(f64::MIN_POSITIVE).ln(), variance)).collect();
        Ok(MassCurve { first, step, masses })
    }

    /// Where the mass first falls to `per_cube` times the cube of the radius, and its error.
    fn sphere(&self, per_cube: f64, count: usize) -> Option<HaloSphere> {
        let excess = |i: usize| self.masses[i].0 - 3.0 * (self.first + self.step * i as f64) - per_cube.ln();
        let above = (1..self.masses.len()).find(|i| excess(*i) < 0.0)?;
        if excess(above - 1) < 0.0 {
            return None;
        }
        // The parabola about the middle of the three nodes, in steps.
        let middle = above.min(self.masses.len() - 2);
        let [low, at, high] = [middle - 1, middle, middle + 1].map(excess);
        let (slope, curve) = (0.5 * (high - low), high - 2.0 * at + low);
        let (mut from, mut to) = ((above - 1) as f64 - middle as f64, above as f64 - middle as f64);
        for _ in 0..40 {
            let x = 0.5 * (from + to);
            *(if at + slope * x + 0.5 * curve * x * x < 0.0 { &mut to } else { &mut from }) = x;
        }
        let x = 0.5 * (from + to);
        let radius = (self.first + self.step * (middle as f64 + x)).exp();
        let variance = self.masses[above - 1].1
            + (self.masses[above].1 - self.masses[above - 1].1) * (x - (above - 1) as f64 + middle as f64);
        // A mass that is larger by a share makes the sphere larger, too.
        let steepness = -(slope + curve * x) / (3.0 * self.step);
        let error = variance.max(0.0).sqrt() / steepness.max(0.2);
        Some(HaloSphere { sphere: DensitySphere { radius, mass: per_cube * radius.powi(3), count }, error })
    }
}

/// Spheres of mean densities by integration over Gaussians, near those of drawn particles.
fn integrated(
    model: &GaussianSpheres,
    center: [f64; 3],
    counted: [Option<DensitySphere>; SPHERES],
    per_cube: [Option<f64>; SPHERES],
    context: &Context<'_>,
) -> Result<[Option<HaloSphere>; SPHERES]> {
    let enough = |s: &Option<DensitySphere>| s.filter(|s| s.count >= LEAST_MASS);
    let radii = || counted.iter().filter_map(enough).map(|s| s.radius);
    let (smallest, largest) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    let mut found = [None; SPHERES];
    let mut reach = CURVE_REACH;
    for _ in 0..CURVES {
        if largest <= 0.0 {
            break;
        }
        let curve = MassCurve::new(model, center, [smallest / reach, largest * reach], context)?;
        found = std::array::from_fn(|k| curve.sphere(per_cube[k]?, enough(&counted[k])?.count));
        if (0..SPHERES).all(|k| found[k].is_some() || enough(&counted[k]).is_none()) {
            break;
        }
        reach *= CURVE_REACH;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::model::Layer;
    use crate::particles::Column;
    use crate::space::Cell;
    use crate::testing::from_points;

    /// Clouds of particles, each a place, a width and a number, and `spread` particles anywhere, in a periodic box of 10.
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
        find_haloes(HaloSource::Particles(p, None), o, &Context::SILENT).unwrap()
    }

    #[test]
    fn gas_is_attached_to_dark_matter_and_weighs_in_its_spheres() {
        let cloud = |n| [([0.02, 5.0, 5.0], 0.05, n)];
        let p = particles(&[
            ("PartType0", 0.5, places(&cloud(1000), 2000, 1)),
            ("PartType1", 2.0, places(&cloud(4000), 8000, 2)),
        ]);
        let found = haloes(&p, &HaloOptions::default());
        let of = |name: &str| found.column(name).unwrap()[0];
        let linked = of("num_p");
        assert!((3800.0..4020.0).contains(&linked) && (900.0..1010.0).contains(&of("num_attached")));
        // The unit of mass is 1e10 Msun/h.
        assert!((of("mfof") / (1e10 * (2.0 * linked + 0.5 * of("num_attached"))) - 1.0).abs() < 1e-9);
        assert!((of("m200m") / 1e10 / 8500.0 - 1.0).abs() < 0.05, "{}", of("m200m"));
        assert!((of("r200m_kpc") / (of("r200m") * 1e3 * 0.5 / 0.7) - 1.0).abs() < 1e-9);
        assert!(found.centers[0][0] < 0.1 && found.column("contamination").is_none());
        let all = HaloOptions { linked: vec!["gas".into(), "dm".into()], ..HaloOptions::default() };
        assert!(haloes(&p, &all).column("num_attached").is_none());
        let tenth = HaloOptions { sample_fraction: 0.1, ..HaloOptions::default() };
        assert!(haloes(&p, &tenth).column("mfof").unwrap()[0] / of("mfof") > 9.9);
    }

    #[test]
    fn clouds_that_a_bridge_links_are_two_haloes_and_satellites_have_a_parent() {
        let clouds = [([3.0; 3], 0.1, 4000), ([4.5, 3.0, 3.0], 0.08, 1500)];
        let mut all = places(&clouds, 2000, 3);
        all.extend((0..60).map(|i| [3.0 + 0.025 * f64::from(i), 3.0, 3.0]));
        // Its own group, within the first one's sphere.
        all.extend(places(&[([3.0, 3.62, 3.0], 0.01, 150)], 0, 4));
        let found = haloes(&particles(&[("dm", 1.0, all)]), &HaloOptions::default());
        let of = |name: &str| found.column(name).unwrap();
        assert!(of("n200m")[0] > 4000.0 && of("n200m")[1] > 1400.0 && of("n200m")[1] < 1800.0);
        assert_eq!((of("fof_id")[0], of("fof_id")[1]), (1.0, 1.0));
        assert!(of("mfof")[1].is_nan() && (found.centers[1][0] - 4.5).abs() < 0.05);
        assert_eq!(of("parent_id")[..2], [-1.0, -1.0]);
        let satellite = (0..found.len()).find(|i| (found.centers[*i][1] - 3.62).abs() < 0.02).unwrap();
        assert_eq!((of("parent_id")[satellite], of("fof_id")[satellite] as usize), (1.0, satellite + 1));
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
        let found = haloes(&p, &HaloOptions::default());
        let of = |name: &str| found.column(name).unwrap()[0];
        assert!((of("contamination") - 320.0 / 3320.0).abs() < 0.03, "{}", of("contamination"));
        assert!(of("num_p") <= 3300.0);
    }
}

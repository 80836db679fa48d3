//! Particles with fields: velocities, momenta, and the way that particles move in redshift space.

use super::comparison_job::ComparisonJob;
use super::{Domain, Measure, OF_VELOCITIES, StatsOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, Epoch, Model};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory::require;
use particlegs_fit::recover;
use particlegs_particles::{ChunkBuffer, Column, KM_S, LayerFields, Particles, RUN, StarFormingGas};
use std::borrow::Cow;

/// A megaparsec (IAU 2015, resolution B2) in metres.
const MEGAPARSEC: f64 = 3.085_677_581_491_367e22;
/// Numbers that two files state differ where they do by more than this share.
const SAME: f64 = 1e-5;

/// Particles and their fields.
#[derive(Clone)]
pub(crate) struct ParticleFields {
    pub(super) particles: Particles,
    /// Fields of each layer.
    pub(super) layers: Vec<LayerFields>,
    /// Along x, y and z, one value a particle; empty where a layer has none.
    velocity: [Vec<f32>; 3],
    /// Its unit as text, where the source says.
    unit: Option<String>,
}

/// A side of a comparison. Of a model, fields are those of particles drawn from it.
#[derive(Clone, Copy)]
pub struct StatsSide<'a> {
    /// Particles, or a model.
    pub subject: Subject<'a>,
    /// The fields of each layer of the particles, where there are any.
    pub fields: &'a [LayerFields],
}

impl<'a> From<Subject<'a>> for StatsSide<'a> {
    fn from(subject: Subject<'a>) -> Self {
        StatsSide { subject, fields: &[] }
    }
}

impl StatsSide<'_> {
    /// Fields that the measures of `o` need. Where these are all measures, fields that cannot be used are left out with
    /// a note.
    pub(super) fn read_fields(&self, o: &StatsOptions, context: &Context<'_>) -> Result<Option<ParticleFields>> {
        let fields = match self.subject {
            _ if !o.needs_fields() => return Ok(None),
            Subject::Particles(p) => ParticleFields::read(p, self.fields, o),
            Subject::Model(m) => ParticleFields::draw(m, o, context),
        };
        match fields {
            Err(error @ (Error::Memory { .. } | Error::Input { .. })) if o.measures.len() == Measure::ALL.len() => {
                context.note(&format!("fields are left out: {error}"));
                Ok(None)
            }
            other => other,
        }
    }
}

/// Fields of both sides, where there are any.
pub(super) type FieldPair<'a> = [Option<&'a ParticleFields>; 2];

impl ParticleFields {
    /// Particles with the `fields` of their layers, of which velocities are read if `o` needs them. `None` where there
    /// is nothing to measure.
    pub fn read(particles: &Particles, fields: &[LayerFields], o: &StatsOptions) -> Result<Option<Self>> {
        if fields.len() != particles.layers().len() {
            return Ok(None);
        }
        let (particles, layers) = (particles.clone(), fields.to_vec());
        let mut particle_fields = ParticleFields { particles, layers, velocity: Default::default(), unit: None };
        if o.needs_velocities() {
            particle_fields.read_velocities()?;
        }
        Ok(Some(particle_fields))
    }

    /// Particles with velocities; `None` where a layer has none.
    pub fn moving(particles: &Particles, fields: &[LayerFields]) -> Result<Option<Self>> {
        let o = StatsOptions { measures: OF_VELOCITIES.to_vec(), ..StatsOptions::default() };
        Ok(ParticleFields::read(particles, fields, &o)?.filter(ParticleFields::has_velocities))
    }

    fn has_velocities(&self) -> bool {
        self.velocity[0].len() == self.particles.len()
    }

    /// [`ParticleFields::read`] of particles drawn from `model`.
    pub fn draw(model: &Model, o: &StatsOptions, context: &Context<'_>) -> Result<Option<Self>> {
        if model.metadata.fields.is_empty() {
            return Ok(None);
        }
        let options = recover::Options { seed: o.seed, ..recover::Options::default() };
        let (particles, fields) = options.draw_with_own_fields(model.clone(), context)?;
        ParticleFields::read(&particles, &fields, o)
    }

    /// Reads velocities where every layer has them.
    fn read_velocities(&mut self) -> Result<()> {
        let (particles, layers) = (&self.particles, &self.layers);
        let find = |l: &LayerFields| l.find("velocity", StarFormingGas::Keep).ok();
        let Some(field_columns) = layers.iter().map(find).collect::<Option<Vec<_>>>() else { return Ok(()) };
        let unit = field_columns.first().and_then(|f| f.unit.clone());
        if field_columns.iter().any(|f| f.columns.len() != 3 || f.unit != unit) {
            return Ok(());
        }
        require("velocities", 12 * particles.len() as u64)?;
        let mut velocity = [0; 3].map(|_| vec![0f32; particles.len()]);
        let mut run = Vec::new();
        for ((layer, source), from) in particles.layers().iter().zip(layers).zip(&field_columns) {
            for (id, start) in layer.content.clone().step_by(RUN).enumerate() {
                source.read_some(id as u64, |c| from.needs(c), &mut run)?;
                for (k, column) in velocity.iter_mut().enumerate() {
                    let targets = column[start..layer.content.end].iter_mut().zip(from.values(&run, k));
                    targets.for_each(|(to, v)| *to = v as f32);
                }
            }
        }
        if let Some(i) = (0..particles.len()).find(|i| velocity.iter().any(|c| !c[*i].is_finite())) {
            let message = format!("the velocity of particle {i} is not a finite number");
            return Err(Error::input(&particles.meta.name, message));
        }
        (self.velocity, self.unit) = (velocity, unit);
        Ok(())
    }

    /// Their unit as text, where the source says.
    pub(crate) fn unit(&self) -> Option<&str> {
        self.unit.as_deref()
    }

    /// Particles whose velocities in km/s `velocity` gives.
    #[cfg(test)]
    pub(super) fn of_parts(particles: Particles, velocity: impl Fn(usize) -> [f64; 3]) -> Self {
        let column = |k: usize| (0..particles.len()).map(|i| velocity(i)[k] as f32).collect();
        let velocity = [column(0), column(1), column(2)];
        ParticleFields { velocity, unit: Some(KM_S.into()), particles, layers: Vec::new() }
    }

    /// Shot noise of the momentum's power: V sum (w v)^2 / (sum w)^2.
    pub(super) fn momentum_noise(&self, domain: &Domain) -> f64 {
        let square = |i: usize| self.weight(i).powi(2) * self.of(i).map(|v| v * v).iter().sum::<f64>();
        let n = self.particles.len();
        let parts = parallel::map_range(n.div_ceil(RUN), |run| (run * RUN..n.min((run + 1) * RUN)).map(square).sum());
        domain.volume() * parts.iter().sum::<f64>() / self.particles.total_mass().powi(2)
    }

    /// The velocity of a particle.
    pub(crate) fn of(&self, i: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| f64::from(self.velocity[k][i]))
    }

    /// The weight of a particle: 1 where there are none.
    pub(super) fn weight(&self, i: usize) -> f64 {
        self.particles.weights().map_or(1.0, |w| f64::from(w[i]))
    }

    /// The particles moved along an axis by their velocity times `displacement`, which a periodic grid wraps.
    pub(super) fn in_redshift_space(&self, axis: usize, displacement: f64) -> Result<Particles> {
        let p = &self.particles;
        require("particles in redshift space", 12 * p.len() as u64)?;
        let mut columns = [0; 3].map(|_| vec![0f32; p.len()]);
        let [x, y, z] = &mut columns;
        let parts = x.chunks_mut(RUN).zip(y.chunks_mut(RUN)).zip(z.chunks_mut(RUN)).enumerate();
        let parts: Vec<_> = parts.map(|(i, ((x, y), z))| (i * RUN, [x, y, z])).collect();
        parallel::for_each(parts, |(start, mut out)| {
            let mut buffer = ChunkBuffer::default();
            let chunk = p.chunk(start..start + out[0].len(), &mut buffer);
            out.iter_mut().zip(chunk.position).for_each(|(to, from)| to.copy_from_slice(from));
            let by = &self.velocity[axis][start..];
            out[axis].iter_mut().zip(by).for_each(|(x, v)| *x = (f64::from(*x) + displacement * f64::from(*v)) as f32);
        });
        let columns = columns.into_iter().map(Column::owned).chain(p.weights().cloned()).collect();
        Ok(Particles::from_column_list(columns, p.origin, p.meta.clone(), p.layers().to_vec()))
    }

    /// The particles, each of which weighs its weight times a component of its velocity.
    pub(super) fn with_momenta(&self, axis: usize) -> Result<Particles> {
        require("momenta", 4 * self.particles.len() as u64)?;
        let momentum = |i: usize| (self.weight(i) * f64::from(self.velocity[axis][i])) as f32;
        let momenta = (0..self.particles.len()).map(momentum).collect();
        Ok(self.particles.clone().with_weights(Column::owned(momenta)))
    }
}

/// The velocities of both sides, in the units of the truth; else the reason for which they cannot be compared.
pub(super) fn velocity_pair<'a>(
    subject: Subject<'_>,
    fields: FieldPair<'a>,
) -> Result<std::result::Result<[Cow<'a, ParticleFields>; 2], String>> {
    let moving = fields.map(|side| side.filter(|f| f.has_velocities()));
    let [Some(truth), Some(other)] = moving else {
        let side = if moving[0].is_none() { "truth" } else { "other" };
        return Ok(Err(format!("the {side} has no velocities")));
    };
    if let (Some(a), Some(b)) = (&truth.unit, &other.unit)
        && a != b
    {
        return Ok(Err(format!("velocities are in {a} in the truth and in {b} in the other")));
    }
    let (converted, _) = Subject::Particles(&other.particles).in_units_of(subject)?;
    let other = match converted.and_then(super::subject::ConvertedSubject::particles) {
        None => Cow::Borrowed(other),
        Some(particles) => Cow::Owned(ParticleFields { particles, ..other.clone() }),
    };
    Ok(Ok([Cow::Borrowed(truth), other]))
}

/// The unit of velocities of a pair: what one does not state is as in the other.
pub(super) fn unit_of<'a>(pair: &'a [Cow<'_, ParticleFields>; 2]) -> Option<&'a str> {
    pair.iter().find_map(|v| v.unit.as_deref())
}

/// The length, in the truth's unit, by which a velocity of 1 km/s moves a particle in redshift space: 1 / H(a), over a
/// where lengths are comoving. Matter, a cosmological constant and curvature make H(a). Else what it lacks, in words.
pub(super) fn displacement(subjects: [Subject<'_>; 2], unit: Option<&str>) -> std::result::Result<f64, String> {
    let km_s = |text: &str| [KM_S, "kms^-1", "kms-1"].contains(&&text.replace(' ', "")[..]);
    match unit {
        Some(unit) if km_s(unit) => {}
        Some(unit) => return Err(format!("velocities are in {unit}, not in {KM_S}")),
        None => return Err(format!("the files do not say that velocities are in {KM_S}")),
    }
    let units = subjects[0].unit_system().units;
    let mut missing: Vec<&str> = Vec::new();
    let mut stated = |name: &'static str, needed: bool, pick: fn(&Epoch, &Cosmology) -> Option<f64>| {
        let values = subjects.map(|s| s.moment()).map(|(epoch, cosmology)| pick(epoch, cosmology));
        match values {
            [Some(a), Some(b)] if (a - b).abs() > SAME * a.abs() => {
                Err(format!("{name} is {a} in the truth and {b} in the other"))
            }
            [a, b] => {
                let value = a.or(b);
                missing.extend((needed && value.is_none()).then_some(name));
                Ok(value.unwrap_or(f64::NAN))
            }
        }
    };
    let size = units.length.as_ref().and_then(|u| u.si);
    // 1 / H0 goes as 1 / h, and units such as Mpc/h have powers of h of their own: they may cancel.
    let power = -1.0 - size.map_or(0.0, |s| f64::from(s.h));
    let a = stated("the scale factor", true, |e, _| e.scale_factor)?;
    let h = stated("h", power != 0.0, |_, c| c.hubble)?;
    let matter = stated("Omega_m", a != 1.0, |_, c| c.omega_matter)?;
    let lambda = stated("Omega_Lambda", a != 1.0, |_, c| c.omega_lambda)?;
    missing.extend(size.is_none().then_some("the unit of length"));
    missing.extend((a != 1.0 && units.comoving.is_none()).then_some("whether lengths are comoving"));
    let (Some(size), []) = (size, &missing[..]) else {
        return Err(format!("the files do not state {}", missing.join(", ")));
    };
    let square = if a == 1.0 { 1.0 } else { matter / a.powi(3) + (1.0 - matter - lambda) / (a * a) + lambda };
    let hubble = if power == 0.0 { 1.0 } else { libm::pow(h, power) };
    let length = MEGAPARSEC / (100.0 * square.sqrt() * size.factor) * hubble / libm::pow(a, f64::from(size.a));
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err("its cosmology has no rate of expansion".into()) }
}

impl ComparisonJob<'_> {
    /// Velocities of both sides. `None`, and a note, where one has none.
    pub fn velocities<'s>(
        &self,
        fields: FieldPair<'s>,
        notes: &mut Vec<String>,
    ) -> Result<Option<[Cow<'s, ParticleFields>; 2]>> {
        let pair = velocity_pair(self.pair[0], fields)?;
        if let Err(why) = &pair {
            let names: Vec<&str> = OF_VELOCITIES.iter().filter(|m| self.wants(&[**m])).map(|m| m.name()).collect();
            notes.push(format!("no {}: {why}", names.join(", ")));
        }
        Ok(pair.ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::model::Units;
    use particlegs_particles::{Number, PhysicalUnit, SourceField};

    fn particles(length: Option<&str>, comoving: Option<bool>, a: f64, h: Option<f64>) -> Particles {
        let mut p = Particles::from_columns(vec![1.0, 2.0], vec![0.0; 2], vec![0.5; 2]);
        p.meta.units = Units::new(length, None, comoving);
        p.meta.epoch.scale_factor = Some(a);
        p.meta.cosmology =
            Cosmology { hubble: h, omega_matter: Some(0.3), omega_lambda: Some(0.7), ..Cosmology::default() };
        p
    }

    #[test]
    fn displacements_follow_the_unit_of_length_and_the_cosmology() {
        let displacement_of = |p: &Particles| displacement([Subject::Particles(p); 2], Some("km/s"));
        let rate = 100.0 * f64::sqrt(0.3 * 8.0 + 0.7);
        for (unit, comoving, h, expected) in [
            ("Mpc/h", Some(true), None, 2.0 / rate),
            ("ckpc/h", None, None, 2000.0 / rate),
            ("Mpc", Some(true), Some(0.5), 2.0 / (0.5 * rate)),
            ("kpc", Some(false), Some(0.5), 1000.0 / (0.5 * rate)),
        ] {
            let length = displacement_of(&particles(Some(unit), comoving, 0.5, h)).unwrap();
            assert!((length / expected - 1.0).abs() < 1e-6, "{unit}: {length} {expected}");
        }
        // Today the rate is the Hubble constant, whatever the densities.
        let mut today = particles(Some("Mpc/h"), None, 1.0, None);
        today.meta.cosmology = Cosmology::default();
        assert!((displacement_of(&today).unwrap() - 0.01).abs() < 1e-9);
        let refusal_of = |p: &Particles| displacement_of(p).unwrap_err();
        assert_eq!(
            refusal_of(&particles(Some("Mpc/h"), None, 0.5, None)),
            "the files do not state whether lengths are comoving"
        );
        assert_eq!(refusal_of(&particles(Some("kpc"), Some(true), 1.0, None)), "the files do not state h");
        assert!(refusal_of(&particles(None, Some(true), 1.0, None)).contains("the unit of length"));
        let other = particles(Some("Mpc/h"), Some(true), 0.6, None);
        let pair = [Subject::Particles(&today), Subject::Particles(&other)];
        assert_eq!(
            displacement(pair, Some("km/s")).unwrap_err(),
            "the scale factor is 1 in the truth and 0.6 in the other"
        );
        let mut closed = particles(Some("Mpc/h"), Some(true), 0.5, None);
        closed.meta.cosmology.omega_lambda = Some(50.0);
        assert!(refusal_of(&closed).contains("no rate of expansion"));
    }

    #[test]
    fn velocities_are_read_from_fields_and_checked() {
        let p = particles(Some("Mpc/h"), Some(true), 1.0, None);
        let field = |name: &str, factor| SourceField {
            name: name.into(),
            number: Number::F32,
            components: 3,
            unit: Some("sqrt(a) km/s".into()),
            attributes: Vec::new(),
            physical: Some(PhysicalUnit { factor, note: String::new() }),
        };
        let layers = |name: &str, z: f64| {
            let columns = vec![vec![1.0, 2.0], vec![3.0, 4.0], vec![z, 6.0]];
            [LayerFields::from_columns(vec![field(name, 0.5)], columns)]
        };
        let read = |name: &str, z: f64| ParticleFields::read(&p, &layers(name, z), &StatsOptions::default());
        let fields = read("Velocities", 5.0).unwrap().unwrap();
        assert_eq!((fields.of(1), fields.unit.as_deref()), ([1.0, 2.0, 3.0], Some("km/s")));
        let moved_particles = fields.in_redshift_space(2, 0.1).unwrap();
        assert_eq!(moved_particles.position(0), [1.0, 0.0, f64::from(0.75f32)]);
        let still = read("heat", 5.0).unwrap().unwrap();
        let error = read("vel", f64::NAN).err().unwrap();
        assert!(error.to_string().contains("the velocity of particle 0"), "{error}");
        // What one side does not state is as in the other.
        let unstated = ParticleFields { unit: None, ..fields.clone() };
        let pair = velocity_pair(Subject::Particles(&p), [Some(&unstated), Some(&fields)]).unwrap().unwrap();
        assert_eq!(unit_of(&pair), Some("km/s"));
        let other = ParticleFields { unit: Some("m/s".into()), ..fields.clone() };
        let refused = |a, b| velocity_pair(Subject::Particles(&p), [a, b]).unwrap().err().unwrap();
        assert_eq!(refused(Some(&fields), Some(&other)), "velocities are in km/s in the truth and in m/s in the other");
        assert_eq!(refused(Some(&fields), None), "the other has no velocities");
        assert_eq!(refused(Some(&still), Some(&fields)), "the truth has no velocities");
    }
}

//! Particles with velocities: what is measured of them, and how far velocities move them in redshift space.

use super::{Domain, Subject};
use crate::model::{Cosmology, Epoch};
use crate::particles::{ChunkBuffer, Column, KM_S, LayerFields, Particles, RUN};
use crate::{Error, Result, parallel};
use particlegs_files::memory::require;
use std::borrow::Cow;

/// A megaparsec (IAU 2015, resolution B2) in metres.
const MEGAPARSEC: f64 = 3.085_677_581_491_367e22;
/// Numbers that two files state differ where they do by more than this share.
const SAME: f64 = 1e-5;

/// Particles and their velocities.
#[derive(Clone)]
pub struct ParticleVelocities {
    particles: Particles,
    /// Along x, y and z, one value a particle.
    velocity: [Vec<f32>; 3],
    /// Unit as text, where the source says.
    unit: Option<String>,
}

/// A side of a comparison: what is measured, and particles with velocities. Of a model these are drawn from it.
#[derive(Clone, Copy)]
pub struct StatsSide<'a> {
    /// Particles, or a model.
    pub subject: Subject<'a>,
    /// The same particles, or those of the model, with velocities, where there are any.
    pub velocities: Option<&'a ParticleVelocities>,
}

impl<'a> From<Subject<'a>> for StatsSide<'a> {
    fn from(subject: Subject<'a>) -> Self {
        StatsSide { subject, velocities: None }
    }
}

impl ParticleVelocities {
    /// Reads the velocities of particles from the fields of their layers; `None` where one of these has none.
    pub fn read(particles: &Particles, layers: &[LayerFields]) -> Result<Option<Self>> {
        if layers.len() != particles.layers().len() {
            return Ok(None);
        }
        let Some(found) = layers.iter().map(|l| l.find("velocity").ok()).collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let unit = found.first().and_then(|f| f.unit.clone());
        if found.iter().any(|f| f.columns.len() != 3 || f.unit != unit) {
            return Ok(None);
        }
        require("velocities", 12 * particles.len() as u64)?;
        let mut velocity = [0; 3].map(|_| vec![0f32; particles.len()]);
        let mut run = Vec::new();
        for ((layer, source), from) in particles.layers().iter().zip(layers).zip(&found) {
            for (id, start) in layer.content.clone().step_by(RUN).enumerate() {
                source.read(id as u64, &mut run)?;
                for (column, &c) in velocity.iter_mut().zip(&from.columns) {
                    let own = column[start..layer.content.end].iter_mut().zip(&run[c]);
                    own.for_each(|(to, v)| *to = (from.factor * v) as f32);
                }
            }
        }
        if let Some(i) = (0..particles.len()).find(|i| velocity.iter().any(|c| !c[*i].is_finite())) {
            let what = format!("the velocity of particle {i} is not a finite number");
            return Err(Error::input(&particles.meta.name, what));
        }
        Ok(Some(ParticleVelocities { particles: particles.clone(), velocity, unit }))
    }

    /// The particles.
    pub(super) fn particles(&self) -> &Particles {
        &self.particles
    }

    /// Particles whose velocities in km/s `velocity` gives.
    #[cfg(test)]
    pub(super) fn of_parts(particles: Particles, velocity: impl Fn(usize) -> [f64; 3]) -> Self {
        let column = |k: usize| (0..particles.len()).map(|i| velocity(i)[k] as f32).collect();
        ParticleVelocities { velocity: [column(0), column(1), column(2)], unit: Some(KM_S.into()), particles }
    }

    /// Shot noise of the momentum's power: V sum (w v)^2 / (sum w)^2.
    pub(super) fn momentum_noise(&self, domain: &Domain) -> f64 {
        let square = |i: usize| self.weight(i).powi(2) * self.of(i).map(|v| v * v).iter().sum::<f64>();
        let n = self.particles.len();
        let parts = parallel::map_range(n.div_ceil(RUN), |run| (run * RUN..n.min((run + 1) * RUN)).map(square).sum());
        domain.volume() * parts.iter().sum::<f64>() / self.particles.total_mass().powi(2)
    }

    /// The velocity of a particle.
    pub(super) fn of(&self, i: usize) -> [f64; 3] {
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
            let own = p.chunk(start..start + out[0].len(), &mut buffer);
            out.iter_mut().zip(own.position).for_each(|(to, from)| to.copy_from_slice(from));
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

/// The velocities of both sides, in the units of the truth; else why there are none that can be compared.
pub(super) fn velocity_pair<'a>(
    sides: [StatsSide<'a>; 2],
) -> Result<std::result::Result<[Cow<'a, ParticleVelocities>; 2], String>> {
    let [Some(truth), Some(other)] = sides.map(|s| s.velocities) else {
        let side = if sides[0].velocities.is_none() { "truth" } else { "other" };
        return Ok(Err(format!("the {side} has no velocities")));
    };
    if let (Some(a), Some(b)) = (&truth.unit, &other.unit)
        && a != b
    {
        return Ok(Err(format!("velocities are in {a} in the truth and in {b} in the other")));
    }
    let (converted, _) = Subject::Particles(&other.particles).in_units_of(sides[0].subject)?;
    let other = match converted.and_then(super::subject::ConvertedSubject::particles) {
        None => Cow::Borrowed(other),
        Some(particles) => Cow::Owned(ParticleVelocities { particles, ..other.clone() }),
    };
    Ok(Ok([Cow::Borrowed(truth), other]))
}

/// The unit of velocities of a pair: what one does not state is as in the other.
pub(super) fn unit_of<'a>(pair: &'a [Cow<'_, ParticleVelocities>; 2]) -> Option<&'a str> {
    pair.iter().find_map(|v| v.unit.as_deref())
}

/// The length, in the truth's unit, by which a velocity of 1 km/s moves a particle in redshift space: 1 / H(a), over a
/// where lengths are comoving. Matter, a cosmological constant and curvature make H(a). Else what it lacks, in words.
pub(super) fn displacement(subjects: [Subject<'_>; 2], unit: Option<&str>) -> std::result::Result<f64, String> {
    let km_s = |text: &str| text.replace("km s^-1", KM_S).replace("km s-1", KM_S).trim() == KM_S;
    match unit {
        Some(unit) if km_s(unit) => {}
        Some(unit) => return Err(format!("velocities are in {unit}, not in {KM_S}")),
        None => return Err(format!("the files do not say that velocities are in {KM_S}")),
    }
    let units = subjects[0].unit_system().units;
    let mut missing: Vec<&str> = Vec::new();
    let mut stated = |name: &'static str, needed: bool, of: fn(&Epoch, &Cosmology) -> Option<f64>| {
        let found = subjects.map(|s| s.moment()).map(|(epoch, cosmology)| of(epoch, cosmology));
        match found {
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
    let hubble = if power == 0.0 { 1.0 } else { h.powf(power) };
    let moved = MEGAPARSEC / (100.0 * square.sqrt() * size.factor) * hubble / a.powf(f64::from(size.a));
    if moved > 0.0 && moved.is_finite() { Ok(moved) } else { Err("its cosmology has no rate of expansion".into()) }
}

//! The columns of a catalogue of haloes, and what a reader of them must know.

use super::find::{Halo, HaloMeasures, HaloSearch, HaloSetting, LEAST_MASS};
use super::mass_curve::HaloSphere;
use super::members::LinkedHaloes;
use super::overdensity::Overdensity;
use super::properties::{HaloProperty, HaloPropertyKind, PROPERTIES};
use super::table::{HaloCatalogue, HaloColumn};
use crate::stats::Subject;
use particlegs_core::NamedValue;
use particlegs_core::math::each_axis;

impl HaloSearch<'_> {
    pub fn table(
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
        let is_model = matches!(self.source, Subject::Model(_));
        let members = |i: usize| haloes[i].1.members as f64;
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
            &members,
        );
        if is_model {
            add("num_p_err", "", "standard error", &|i| linked_error(members(i)));
        }
        if let Some(attached) = &found.attached {
            let attached = |i: usize| of_group(i, attached[haloes[i].0] as f64);
            add("num_attached", "", "particles of other types, each nearest to a linked one", &attached);
            if is_model {
                add("num_attached_err", "", "standard error", &|i| linked_error(attached(i)));
            }
        }
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            add(axis, &length, "density peak", &|i| centers[i][k]);
        }
        if is_model {
            add("position_err", &length, "standard error of x, of y and of z", &|i| measures[i].center_error);
        }
        if self.masses {
            let mass = |i: usize| of_group(i, found.masses[haloes[i].0] * mass_factor);
            add("mfof", &mass_unit, "mass of the group: particles that are linked and attached", &mass);
            if is_model {
                add("mfof_err", &mass_unit, "standard error", &|i| mass(i) * linked_error(members(i)) / members(i));
            }
        }
        let count = |i: usize| if measures[i].count > 0 { measures[i].count as f64 } else { f64::NAN };
        add("n200m", "", "particles within R200m", &count);
        if is_model {
            let share = |s: HaloSphere| s.error / s.sphere.mass;
            let share = |i: usize| measures[i].spheres[Overdensity::Mean200 as usize].map_or(f64::NAN, share);
            add("n200m_err", "", "standard error", &|i| count(i) * share(i));
        }
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
                measures[i].contamination[0]
            });
            if is_model {
                add("contamination_err", "", "standard error", &|i| measures[i].contamination[1]);
            }
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
        if matches!(self.source, Subject::Model(_)) {
            all.push(format!("of a model: centres, velocities, shapes and profiles of particles drawn from it (seed {}), masses integrated over its Gaussians; errors of masses are those of drawing particles, and of particles that are not spread like their Gaussian; those of centres are 0.55 of the radius that holds the root of n200m particles; those of a number n of linked particles are 0.45 n^0.7; the others are found by leaving out each eighth of the particles in turn", o.seed));
        }
        if o.sample_fraction != 1.0 {
            all.push(format!("masses are divided by {}, the share of the particles that were read", o.sample_fraction));
        }
        all.retain(|line| !line.is_empty());
        all
    }
}

/// Standard error of the number of a model's linked particles: tuned on the haloes of one snapshot, checked on others
/// (docs/results/haloes.md).
fn linked_error(number: f64) -> f64 {
    0.45 * number.powf(0.7)
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

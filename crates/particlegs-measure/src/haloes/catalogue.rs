//! A catalogue of haloes: named columns, how they are made, and remarks for a reader of them.

use super::find::{Halo, HaloMeasures, HaloSearch, HaloSetting, LEAST_MASS};
use super::members::LinkedHaloes;
use super::model::HaloSphere;
use super::overdensity::Overdensity;
use super::sphere::{HaloProperty, HaloPropertyKind, PROPERTIES};
use crate::stats::Subject;
use particlegs_core::NamedValue;
use particlegs_core::math::each_axis;
use std::collections::HashMap;

/// A column of a catalogue, one value a halo.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HaloColumn {
    /// Name, as other catalogues have it where they have the quantity.
    pub name: String,
    /// Unit; empty of numbers without one.
    pub unit: String,
    /// Description of the quantity.
    pub description: String,
    /// Whether the values are whole numbers.
    pub whole: bool,
    /// NaN where there are too few particles.
    pub values: Vec<f64>,
}

/// Haloes, by mass, the heaviest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HaloCatalogue {
    /// Columns of one length.
    pub columns: Vec<HaloColumn>,
    /// Method and definitions of its numbers: lines of text.
    pub remarks: Vec<String>,
    /// Notes for a user.
    pub notes: Vec<String>,
    /// Centre of each, world units.
    pub centers: Vec<[f64; 3]>,
}

impl HaloCatalogue {
    /// Number of haloes.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// Whether it has no haloes.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// Values of a column.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| &c.values[..])
    }

    /// The masses that haloes are compared by, and their unit: M200m, or particles within R200m where masses are not
    /// known. NaN of haloes with too few particles.
    pub fn masses(&self) -> Option<(Vec<f64>, &str)> {
        let (column, unit) = match self.columns.iter().find(|c| c.name == "m200m") {
            Some(column) => (column, &column.unit[..]),
            None => (self.columns.iter().find(|c| c.name == "n200m")?, "particles"),
        };
        let radii = self.column("r200m")?;
        let value = |(m, r): (&f64, &f64)| if r.is_nan() { f64::NAN } else { *m };
        Some((column.values.iter().zip(radii).map(value).collect(), unit))
    }
}

/// Particles within R200m over linked ones, above which a note tells a user.
const LOOSE: f64 = 3.0;
/// Columns of whole numbers.
const WHOLE_NUMBERS: [&str; 7] = ["id", "parent_id", "satellite", "fof_id", "num_p", "num_attached", "n200m"];

/// Haloes as the rows of a table, and the units of its columns.
struct HaloRows<'a> {
    search: &'a HaloSearch<'a>,
    groups: &'a LinkedHaloes,
    haloes: &'a [Halo],
    /// World units.
    centers: Vec<[f64; 3]>,
    /// Unit of length as text.
    length: String,
    /// Unit of mass as text, and a mass of 1 in it.
    mass_unit: String,
    mass_factor: f64,
    /// The source is a model: columns have standard errors.
    is_model: bool,
}

/// Columns of as many values as there are rows.
struct ColumnList {
    rows: usize,
    columns: Vec<HaloColumn>,
}

impl ColumnList {
    fn add(&mut self, name: &str, unit: &str, description: &str, value_of: &dyn Fn(usize) -> f64) {
        let values = (0..self.rows).map(value_of).collect();
        let whole = WHOLE_NUMBERS.contains(&name);
        let (name, unit, description) = (name.into(), unit.into(), description.into());
        self.columns.push(HaloColumn { name, unit, description, whole, values });
    }
}

impl<'a> HaloRows<'a> {
    fn new(search: &'a HaloSearch<'a>, groups: &'a LinkedHaloes, haloes: &'a [Halo]) -> Self {
        let setting = &search.setting;
        let world = |c: &[f64; 3]| -> [f64; 3] { each_axis(|k| search.domain.min[k] + c[k]) };
        let (mass_unit, mass_factor) = match (search.densities.units.mass, &setting.units.mass) {
            (Some(factor), _) => ("Msun/h".to_string(), factor),
            (None, Some(unit)) => (unit.text.clone(), 1.0),
            (None, None) => (String::new(), 1.0),
        };
        HaloRows {
            search,
            groups,
            haloes,
            centers: haloes.iter().map(|h| world(&h.center)).collect(),
            length: setting.units.length_text().unwrap_or("").to_string(),
            mass_unit,
            mass_factor,
            is_model: matches!(search.source, Subject::Model(_)),
        }
    }

    fn measures(&self, i: usize) -> &HaloMeasures {
        &self.haloes[i].measures
    }

    fn members(&self, i: usize) -> f64 {
        self.haloes[i].members as f64
    }

    /// A value of the group, which its densest halo has alone.
    fn of_group(&self, i: usize, value: f64) -> f64 {
        if self.haloes[i].is_main { value } else { f64::NAN }
    }

    /// Numbers of each halo, of the one that it belongs to and of the densest of its group.
    fn add_numbers(&self, columns: &mut ColumnList) {
        let haloes = self.haloes;
        let mut main = vec![0; self.groups.members.len()];
        haloes.iter().enumerate().filter(|(_, h)| h.is_main).for_each(|(i, h)| main[h.group] = i);
        let ranked: HashMap<usize, usize> = haloes.iter().enumerate().map(|(i, h)| (h.rank, i)).collect();
        let parent = |h: &Halo| h.parent.map(|rank| ranked[&rank]).or((!h.is_main).then(|| main[h.group]));
        columns.add("id", "", "number of the halo", &|i| (i + 1) as f64);
        columns.add(
            "parent_id",
            "",
            "of a satellite the heaviest halo in whose R200m the centre lies; else of a halo that is not the densest of its group that one; -1 = none",
            &|i| parent(&haloes[i]).map_or(-1.0, |p| (p + 1) as f64),
        );
        columns.add(
            "satellite",
            "",
            "1 where the centre lies within R200m of a halo of more linked particles, whose particles it shares; else 0",
            &|i| f64::from(haloes[i].parent.is_some()),
        );
        columns.add(
            "fof_id",
            "",
            "the densest halo of its group of linked particles: itself, or one that it is linked to",
            &|i| (main[haloes[i].group] + 1) as f64,
        );
    }

    /// Linked particles and those attached to them.
    fn add_members(&self, columns: &mut ColumnList) {
        columns.add(
            "num_p",
            "",
            "linked particles: of the whole group, or within R200m of a halo that is not its densest",
            &|i| self.members(i),
        );
        if self.is_model {
            columns.add("num_p_err", "", "standard error", &|i| linked_error(self.members(i)));
        }
        if let Some(attached) = &self.groups.attached {
            let attached = |i: usize| self.of_group(i, attached[self.haloes[i].group] as f64);
            columns.add("num_attached", "", "particles of other types, each nearest to a linked one", &attached);
            if self.is_model {
                columns.add("num_attached_err", "", "standard error", &|i| linked_error(attached(i)));
            }
        }
    }

    fn add_centers(&self, columns: &mut ColumnList) {
        for (k, axis) in ["x", "y", "z"].iter().enumerate() {
            columns.add(axis, &self.length, "density peak", &|i| self.centers[i][k]);
        }
        if self.is_model {
            let error = |i: usize| self.measures(i).center_error;
            columns.add("position_err", &self.length, "standard error of x, of y and of z", &error);
        }
    }

    fn add_group_masses(&self, columns: &mut ColumnList) {
        let mass = |i: usize| self.of_group(i, self.groups.masses[self.haloes[i].group] * self.mass_factor);
        columns.add("mfof", &self.mass_unit, "mass of the group: particles that are linked and attached", &mass);
        if self.is_model {
            let error = |i: usize| mass(i) * linked_error(self.members(i)) / self.members(i);
            columns.add("mfof_err", &self.mass_unit, "standard error", &error);
        }
    }

    fn add_counts(&self, columns: &mut ColumnList) {
        let count = |i: usize| if self.measures(i).count > 0 { self.measures(i).count as f64 } else { f64::NAN };
        columns.add("n200m", "", "particles within R200m", &count);
        if self.is_model {
            let share = |s: HaloSphere| s.error / s.sphere.mass;
            let share = |i: usize| self.measures(i).spheres[Overdensity::Mean200 as usize].map_or(f64::NAN, share);
            columns.add("n200m_err", "", "standard error", &|i| count(i) * share(i));
        }
    }

    /// Mass and radius of the sphere of a mean density.
    fn add_sphere(&self, kind: Overdensity, columns: &mut ColumnList) {
        let (name, units, length) = (kind.name(), &self.search.densities.units, &self.length);
        let sphere = |i: usize| self.measures(i).spheres[kind as usize].filter(|s| s.sphere.count >= LEAST_MASS);
        let value_of = |value: fn(HaloSphere) -> f64| move |i: usize| sphere(i).map_or(f64::NAN, value);
        let (mass, radius) = (value_of(|s| s.sphere.mass), value_of(|s| s.sphere.radius));
        let mass_error = value_of(|s| s.error);
        // The radius goes as the cube root of the mass.
        let radius_error = value_of(|s| s.sphere.radius * s.error / (3.0 * s.sphere.mass));
        let about = format!("whose mean density is {}", Overdensity::VALUES[kind as usize].2.replace("The", "the"));
        if self.search.masses {
            let (unit, factor, within) = (&self.mass_unit, self.mass_factor, format!("mass within r{name}"));
            columns.add(&format!("m{name}"), unit, &within, &|i| mass(i) * factor);
            if self.is_model {
                columns.add(&format!("m{name}_err"), unit, "standard error", &|i| mass_error(i) * factor);
            }
            if let (Some(factor), Some(h)) = (units.mass, units.hubble) {
                columns.add(&format!("m{name}_msun"), "Msun", &within, &|i| mass(i) * factor / h);
            }
        }
        columns.add(&format!("r{name}"), length, &format!("radius of the sphere {about}"), &radius);
        if self.is_model {
            columns.add(&format!("r{name}_err"), length, "standard error", &radius_error);
        }
        let physical = units.length.zip(units.scale_factor).zip(units.hubble).map(|((l, a), h)| 1e3 * l * a / h);
        if let Some(factor) = physical {
            columns.add(&format!("r{name}_kpc"), "kpc", "the same, physical", &|i| radius(i) * factor);
        }
    }

    fn add_properties(&self, columns: &mut ColumnList) {
        let search = self.search;
        let velocity_unit = search.velocities.map(|v| v.unit().unwrap_or("").to_string());
        let circular = search.densities.units.velocity_square().filter(|_| search.masses);
        for (k, p) in PROPERTIES.iter().enumerate() {
            let scale = scale_of(p, velocity_unit.as_deref(), circular, &self.length);
            let Some((unit, scale)) = scale else { continue };
            // The concentration alone takes so many particles, and needs R200c.
            if p.least >= 1000 && search.densities.density[Overdensity::Critical200 as usize].is_none() {
                continue;
            }
            columns.add(p.name, unit, p.description, &|i| scale(self.measures(i).properties.0[k]));
            if self.is_model {
                let error = |i: usize| {
                    let value = self.measures(i).properties.0[k];
                    let error = self.measures(i).errors.map_or(f64::NAN, |e| e.0[k]);
                    // To first order.
                    (scale(value + 0.5 * error) - scale(value - 0.5 * error)).abs()
                };
                columns.add(&format!("{}_err", p.name), unit, "standard error", &error);
            }
        }
    }

    fn add_contamination(&self, columns: &mut ColumnList) {
        let about = "share of the mass within R200m that is of the zoom's coarse particles";
        columns.add("contamination", "", about, &|i| self.measures(i).contamination[0]);
        if self.is_model {
            columns.add("contamination_err", "", "standard error", &|i| self.measures(i).contamination[1]);
        }
    }
}

impl HaloSearch<'_> {
    /// The catalogue of `haloes`; columns as docs/guide/haloes.md lists them.
    pub fn table(&self, groups: &LinkedHaloes, haloes: &[Halo], softening: f64) -> HaloCatalogue {
        let rows = HaloRows::new(self, groups, haloes);
        let mut columns = ColumnList { rows: haloes.len(), columns: Vec::new() };
        rows.add_numbers(&mut columns);
        rows.add_members(&mut columns);
        rows.add_centers(&mut columns);
        if self.masses {
            rows.add_group_masses(&mut columns);
        }
        rows.add_counts(&mut columns);
        for kind in Overdensity::ALL.into_iter().filter(|kind| self.densities.density[*kind as usize].is_some()) {
            rows.add_sphere(kind, &mut columns);
        }
        rows.add_properties(&mut columns);
        if groups.fine.is_some() {
            rows.add_contamination(&mut columns);
        }
        let (notes, remarks) = (self.notes(groups, haloes), self.remarks(groups, softening, &rows.length));
        HaloCatalogue { columns: columns.columns, remarks, notes, centers: rows.centers }
    }

    fn notes(&self, groups: &LinkedHaloes, haloes: &[Halo]) -> Vec<String> {
        let mut notes = self.densities.notes.clone();
        if !self.masses {
            notes.push(
                "the file does not state masses of the particles: masses are left out, n200m counts particles".into(),
            );
        }
        notes.extend(groups.note.clone());
        let is_loose = |h: &&Halo| h.parent.is_none() && h.measures.count as f64 > LOOSE * h.members as f64;
        match haloes.iter().filter(is_loose).count() {
            0 => {}
            n => notes.push(format!("{n} of {} haloes have n200m above three times num_p: most particles in their spheres are not linked to them", haloes.len())),
        }
        notes
    }

    /// Lines for a reader of the file: the definitions of its columns.
    fn remarks(&self, groups: &LinkedHaloes, softening: f64, length: &str) -> Vec<String> {
        let (meta, o) = (&self.particles.meta, self.o);
        let HaloSetting { epoch, cosmology, .. } = &self.setting;
        let stated = |name: &str, value: Option<f64>| value.map(|v| format!("{name} = {v}"));
        let numbers = [
            stated("a", epoch.scale_factor),
            stated("h", cosmology.hubble),
            stated("Omega_m", cosmology.omega_matter),
            stated("Omega_Lambda", cosmology.omega_lambda),
        ];
        let mut lines = vec![
            format!("haloes of {}", meta.name),
            format!("friends of friends, linking length {:.6} {length} ({} mean spacings), {} particles and more; spherical overdensities about density peaks", groups.linking_length, o.linking, o.smallest),
            "no unbinding, no subhaloes; where spheres overlap, the halo of more linked particles has the particles of both, and the other is measured without them; a satellite shares those of its parent".into(),
            "a quantity is empty where its sphere has too few particles: masses 100, dispersion, shape and vmax 300, concentration 1000".into(),
            numbers.into_iter().flatten().collect::<Vec<_>>().join("; "),
        ];
        let assumed = if o.softening.is_none() { ", assumed: a 25th of the mean spacing" } else { "" };
        lines
            .push(format!("softening length {softening:.6} {length}{assumed}; vmax and c200c begin at three of these"));
        if matches!(self.source, Subject::Model(_)) {
            lines.push(format!("of a model: centres, velocities, shapes and profiles of particles drawn from it (seed {}), masses integrated over its Gaussians; errors of masses are those of drawing particles, and of particles that are not spread like their Gaussian; those of centres are 0.55 of the radius that holds the root of n200m particles; those of a number n of linked particles are 0.45 n^0.7; the others are found by leaving out each eighth of the particles in turn", o.seed));
        }
        if o.sample_fraction != 1.0 {
            lines.push(format!(
                "masses are divided by {}, the share of the particles that were read",
                o.sample_fraction
            ));
        }
        lines.retain(|line| !line.is_empty());
        lines
    }
}

/// Standard error of the number of a model's linked particles: tuned on the haloes of one snapshot, checked on others
/// (docs/results/haloes.md).
fn linked_error(number: f64) -> f64 {
    0.45 * libm::pow(number, 0.7)
}

/// Unit of a property and the function that makes a column of its numbers; `None` where its unit is not known.
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

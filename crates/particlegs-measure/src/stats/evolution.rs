//! The frames of a series one after the other: P(k), groups of particles drawn, and means of fields. All are measured
//! by the lengths of the first frame, so that what changes is the frame and not the measure.

use super::comparison_job::ComparisonJob;
use super::likelihood::field_parts;
use super::points::local_positions;
use super::spectrum::CachedTransform;
use super::{Domain, Measure, StatsOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, LawKind, Mass, Model, Units};
use particlegs_core::{Error, Result};
use particlegs_fit::recover;

/// Statistics of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameStatistics {
    /// P(k) of the mixture, the longest waves first; empty where it is not asked for.
    pub spectrum: Vec<WaveShell>,
    /// Particles of each group of those drawn, descending. `None` where groups are not asked for, or links are too long
    /// for the box.
    pub groups: Option<Vec<u64>>,
    /// Means of the fields.
    pub fields: Vec<FieldMean>,
    /// Notes for a user, a sentence each.
    pub notes: Vec<String>,
}

/// A shell of wave numbers.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct WaveShell {
    /// Lowest and highest wave number, over the unit of length.
    pub edges: [f64; 2],
    /// Mean wave number of its modes.
    pub k: f64,
    /// Modes, of which half are independent.
    pub modes: u64,
    /// Power, the unit of length cubed.
    pub power: f64,
}

/// The mean of one component of a field over all that have it, weighted by mass; of a sum, such as a charge, the total.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FieldMean {
    /// The field.
    pub field: String,
    /// Its component, such as `velocity_x`; the field's own name where it has one.
    pub component: String,
    /// Unit, where it is known.
    pub unit: Option<String>,
    /// Whether it is a total.
    pub is_sum: bool,
    /// In that unit.
    pub value: f64,
}

/// Units, cosmology and masses, which must be alike in all frames, or their numbers could not be compared.
#[derive(Clone)]
struct FrameScale {
    units: Units,
    cosmology: Cosmology,
    masses: Vec<(String, Mass)>,
}

/// Measures frame after frame.
pub struct Evolution {
    /// With the lengths of the first frame, once it was measured.
    pub(super) options: StatsOptions,
    first: Option<FrameScale>,
}

impl Evolution {
    /// Measures what the options say: P(k) and groups where they name them, and the means of fields.
    ///
    /// # Errors
    /// [`Error::Argument`]: an option out of range.
    pub fn new(options: StatsOptions) -> Result<Evolution> {
        options.check()?;
        Ok(Evolution { options, first: None })
    }

    /// Measures a frame, which `place` names in errors.
    ///
    /// # Errors
    /// [`Error::Input`]: its units, cosmology or masses are not those of the first frame, or it has no particles; too
    /// little memory.
    pub fn measure(&mut self, model: &Model, place: &str, context: &Context<'_>) -> Result<FrameStatistics> {
        self.compare_scales(model, place)?;
        let wants = |measure| self.options.measures.contains(&measure);
        let (with_spectrum, with_groups) = (wants(Measure::Spectrum), wants(Measure::Groups));
        let subject = Subject::Model(model);
        if subject.count() == 0 {
            return Err(Error::input(place, "there are no particles to measure"));
        }
        let domain = if self.options.open { Domain::new(&subject.bounds(), None) } else { subject.domain() };
        let mut statistics = FrameStatistics { fields: field_means(model), ..FrameStatistics::default() };
        if with_spectrum {
            if domain.periodic.contains(&false) {
                statistics.notes.push("some axes are not periodic, but P(k) treats them as periodic".into());
            }
            let job = ComparisonJob { pair: [subject; 2], domain, o: &self.options, context };
            let k_max = job.o.k_max.unwrap_or(std::f64::consts::PI / job.spacing(0));
            let transform = CachedTransform::new(subject, &domain, &job.spectrum_options(), context)?;
            let shells = transform.against_itself(context)?.shells.into_iter();
            let shell = |s: super::Shell| WaveShell { edges: s.edges, k: s.k, modes: s.modes, power: s.power[0] };
            statistics.spectrum = shells.map(shell).collect();
            // Later frames go as far as the first, whatever their numbers of particles.
            self.options.k_max = Some(k_max);
        }
        if with_groups {
            statistics.groups = self.groups(model, &domain, &mut statistics.notes, context)?;
        }
        Ok(statistics)
    }

    fn groups(
        &mut self,
        model: &Model,
        domain: &Domain,
        notes: &mut Vec<String>,
        context: &Context<'_>,
    ) -> Result<Option<Vec<u64>>> {
        let options = recover::Options { seed: self.options.seed, ..recover::Options::default() };
        let particles = options.draw(model.clone(), context)?;
        let positions = local_positions(&particles, domain);
        let subject = Subject::Particles(&particles);
        let job = ComparisonJob { pair: [subject; 2], domain: *domain, o: &self.options, context };
        let linked_groups = job.find_groups(&positions, 0, notes)?;
        if let Some(linked_groups) = &linked_groups {
            let length = linked_groups.groups.linking_length;
            self.options.linking_length.get_or_insert_with(|| length.to_string());
        }
        Ok(linked_groups.map(|f| f.groups.sizes()))
    }

    fn compare_scales(&mut self, model: &Model, place: &str) -> Result<()> {
        let m = &model.metadata;
        if m.law == LawKind::AlphaBlend {
            let message = "an alpha-blend model has no masses to measure: its splats hold opacities";
            return Err(Error::input(place, message));
        }
        let masses = model.layers.iter().map(|l| (l.name.clone(), l.mass));
        let scale = FrameScale { units: m.units.clone(), cosmology: m.cosmology, masses: masses.collect() };
        let first = self.first.get_or_insert_with(|| scale.clone());
        let stated = |mass: &Mass| (mass.is_weighted(), mass.unit().is_some());
        let same_masses = scale.masses.iter().all(|(name, mass)| {
            let before = first.masses.iter().find(|(other, _)| other == name);
            before.is_none_or(|(_, other)| stated(other) == stated(mass))
        });
        let differing = [
            ("units", first.units != scale.units),
            ("cosmology", first.cosmology != scale.cosmology),
            ("masses", !same_masses),
        ];
        match differing.into_iter().find(|d| d.1) {
            Some(("masses", _)) => Err(Error::input(place, "it does not state masses as the first frame does")),
            Some((property, _)) => Err(Error::input(place, format!("its {property} are not those of the first frame"))),
            None => Ok(()),
        }
    }
}

fn field_means(model: &Model) -> Vec<FieldMean> {
    let mut means = Vec::new();
    for quantity in &model.metadata.fields {
        // Of chosen layers none may have it.
        let Ok(parts) = field_parts(model, &quantity.name) else { continue };
        for (c, component) in quantity.component_names().into_iter().enumerate() {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (unit, mixture, moments) in &parts {
                for i in 0..mixture.len() {
                    let mass = unit * mixture.mass_of(i);
                    sum += mass * moments.overall_value(c, i, &mixture.cov_of(i));
                    weight += mass;
                }
            }
            means.push(FieldMean {
                field: quantity.name.clone(),
                component,
                unit: quantity.unit.as_ref().map(|u| u.text.clone()),
                is_sum: quantity.extensive,
                value: if quantity.extensive { sum } else { sum / weight },
            });
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::model::{FieldMoments, Quantity, QuantityKind};
    use particlegs_particles::testing::model_of;

    /// Clumps in a box of 10, with the mean of a field rising from one to the next.
    fn model(slope: f64) -> Model {
        let clump = |i: u64| {
            let mut r = Random::new(7, 0, i);
            (std::array::from_fn(|_| 10.0 * r.uniform()), Sym3::scaled_identity(0.02), 50.0 + i as f64)
        };
        let mut model = model_of(&(0..40).map(clump).collect::<Vec<_>>(), [10.0; 3]);
        let mut field = FieldMoments::new(1);
        (field.mean[0], field.spread[0]) = ((0..40).map(|i| slope * f64::from(i)).collect(), vec![0.0; 40]);
        field.slope[0].fill(vec![0.0; 40]);
        model.metadata.fields = vec![Quantity::new("heat", QuantityKind::Scalar)];
        model.layers[0].content[0].gaussians.fields.set("heat", field);
        model
    }

    fn options() -> StatsOptions {
        StatsOptions {
            spectrum_cells: 16,
            measures: vec![Measure::Spectrum, Measure::Groups],
            ..StatsOptions::default()
        }
    }

    #[test]
    fn fields_are_weighted_by_mass_and_frames_share_one_linking_length() {
        let mut evolution = Evolution::new(options()).unwrap();
        let first = evolution.measure(&model(1.0), "frame 0", &Context::SILENT).unwrap();
        let (sum, mass) =
            (0..40).fold((0.0, 0.0), |(s, m), i| (s + (50.0 + f64::from(i)) * f64::from(i), m + 50.0 + f64::from(i)));
        assert!((first.fields[0].value / (sum / mass) - 1.0).abs() < 1e-12, "{:?}", first.fields);
        let length = evolution.options.linking_length.clone().unwrap();
        assert!(first.groups.as_ref().is_some_and(|g| (20..=60).contains(&g.len())), "{:?}", first.groups);
        // A sparser frame is linked as the first.
        let mut half = model(2.0);
        half.layers[0].content[0].gaussians.count.iter_mut().for_each(|n| *n = (*n / 2.0).floor());
        let count = half.layers[0].content[0].gaussians.count.iter().sum::<f64>() as u64;
        (half.layers[0].content[0].count, half.metadata.count) = (count, count);
        (half.layers[0].content[0].mass, half.metadata.mass) = (count as f64, count as f64);
        let second = evolution.measure(&half, "frame 1", &Context::SILENT).unwrap();
        assert_eq!(evolution.options.linking_length.as_ref(), Some(&length));
        assert_eq!(second.spectrum.len(), first.spectrum.len());
        let total = |f: &FrameStatistics| f.groups.iter().flatten().sum::<u64>();
        assert!(total(&second) < total(&first));
    }

    #[test]
    fn frames_of_other_units_or_masses_are_refused() {
        let mut evolution = Evolution::new(options()).unwrap();
        evolution.measure(&model(1.0), "frame 0", &Context::SILENT).unwrap();
        let refused = |evolution: &mut Evolution, m: &Model| {
            evolution.measure(m, "frame 1", &Context::SILENT).unwrap_err().to_string()
        };
        let mut other = model(1.0);
        other.metadata.units = Units::new(Some("kpc"), None, None);
        assert!(refused(&mut evolution, &other).contains("its units are not those of the first frame"));
        let mut other = model(1.0);
        other.layers[0].mass = Mass::Each(3.0);
        assert!(refused(&mut evolution, &other).contains("does not state masses as the first frame does"));
        let mut plain = model(1.0);
        plain.metadata.fields.clear();
        assert!(evolution.measure(&plain, "frame 1", &Context::SILENT).unwrap().fields.is_empty());
    }
}

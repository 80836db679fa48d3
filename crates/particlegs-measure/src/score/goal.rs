//! One figure that a compression is to reach, measured on one model after the other: the particles' side is measured
//! once, and what cannot be measured is refused before anything is fitted.

use super::cells::Cells;
use super::science::{MOST_DRAWN, linking, spectrum_options};
use super::{HeldOutPictures, ParticlesWithModel, held_out_views};
use crate::stats::{
    CachedTransform, FEWEST_GROUPS, Spectra, SpectrumOptions, Subject, largest_deviation_of_numbers, size_histogram,
};
use particlegs_core::context::Context;
use particlegs_core::model::{GROUP_CLASSES, Goal, GoalKind, GoalResult, Metadata, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::Scene;
use particlegs_core::{Error, Hint, Result};
use particlegs_particles::{Domain, Particles};
use std::f64::consts::PI;

/// Pictures that PSNR is measured on.
const SIZE: Size = Size { width: 1920, height: 1080 };
/// Held-out views an orbit.
const FRAMES: usize = 2;
/// Draws that are measured.
const DRAWS: u64 = 4;
/// Number that stands for the PSNR of pictures that are identical in every view, dB.
const IDENTICAL: f64 = 1000.0;

/// Measures how well candidate models reach a goal.
pub struct GoalMetric<'a> {
    /// The figure that is to be reached.
    pub goal: Goal,
    particles: &'a Particles,
    domain: Domain,
    seed: u64,
    truth: GoalTruth,
}

/// The particles' side of the goal's figure.
enum GoalTruth {
    Pictures(Box<HeldOutPictures>),
    Spectrum(Box<CachedTransform>),
    Cells(Box<Cells>),
    /// Sizes of groups, descending.
    Groups(Vec<u64>),
}

impl<'a> GoalMetric<'a> {
    /// Measures the particles. `metadata` says how their pictures are drawn; `seed` is that of the certificate.
    pub fn new(
        goal: Goal,
        particles: &'a Particles,
        metadata: &Metadata,
        seed: u64,
        context: &Context<'_>,
    ) -> Result<Self> {
        let domain = Domain::from_particles(particles);
        let truth = match goal.kind {
            GoalKind::Psnr => {
                let views = held_out_views(metadata, SIZE, seed, FRAMES);
                GoalTruth::Pictures(Box::new(HeldOutPictures::draw(particles, &views, SIZE, context)?))
            }
            GoalKind::PowerSpectrum => {
                let options = spectrum_to(goal.at, &domain, particles.len())?;
                GoalTruth::Spectrum(Box::new(power_of(particles, &domain, &options, context)?))
            }
            GoalKind::Correlation => GoalTruth::Cells(Box::new(Cells::new(goal.at, particles, &domain, context)?)),
            GoalKind::Groups => GoalTruth::Groups(sizes_of(goal.at, particles, &domain, context)?),
        };
        Ok(GoalMetric { goal, particles, domain, seed, truth })
    }

    /// The figure of a model.
    pub fn measure(&self, model: &Model, context: &Context<'_>) -> Result<GoalResult> {
        let reached = match &self.truth {
            GoalTruth::Pictures(views) => views.expected_masked_psnr(&Scene::new(model), context)?.unwrap_or(IDENTICAL),
            GoalTruth::Spectrum(truth) => self.deviation_of_power(truth, model, context)?,
            GoalTruth::Cells(truth) => truth.correlation(Subject::Model(model), context)?,
            GoalTruth::Groups(truth) => self.deviation_of_groups(truth, model, context)?,
        };
        Ok(GoalResult { goal: self.goal, reached })
    }

    /// As many particles as there are, drawn from the model; `None` of too many, and where nothing can be drawn.
    fn drawn(&self, model: &Model, draw: u64, context: &Context<'_>) -> Result<Option<Particles>> {
        if self.particles.len() as u64 > MOST_DRAWN {
            return Ok(None);
        }
        let scope = ParticlesWithModel::new(model, self.particles, self.seed, MOST_DRAWN, context)?;
        scope.map_or(Ok(None), |scope| scope.draw(self.seed.wrapping_add(draw), context))
    }

    /// The worst of several draws: one may be lucky. The first is the certificate's.
    fn deviation_of_power(&self, truth: &CachedTransform, model: &Model, context: &Context<'_>) -> Result<f64> {
        let deviation_of = |spectra: Spectra| spectra.largest_power_deviation().unwrap_or(f64::MAX);
        let mut largest = 0.0f64;
        for draw in 0..DRAWS {
            let Some(sample) = self.drawn(model, draw, context)? else {
                return Ok(deviation_of(truth.against(Subject::Model(model), context)?));
            };
            largest = largest.max(deviation_of(truth.against(Subject::Particles(&sample), context)?));
        }
        Ok(largest)
    }

    fn deviation_of_groups(&self, truth: &[u64], model: &Model, context: &Context<'_>) -> Result<f64> {
        let Some(linking) = linking(&self.domain, self.domain.spacing(self.particles.len())) else {
            return Ok(f64::MAX);
        };
        let mut sizes = Vec::new();
        for draw in 0..DRAWS {
            // Where tails of Gaussians lie at the end of float32 nothing is drawn.
            let Some(sample) = self.drawn(model, draw, context)? else {
                return Ok(f64::MAX);
            };
            sizes.append(&mut linking.sizes(&sample, context)?);
        }
        sizes.sort_unstable_by(|a, b| b.cmp(a));
        let histogram = size_histogram([truth, &sizes], self.goal.at as u64);
        Ok(largest_deviation_of_numbers(&histogram, DRAWS).unwrap_or(f64::MAX))
    }
}

/// Options of spectra up to `k_max`, which are taken as the certificate's.
fn spectrum_to(k_max: f64, domain: &Domain, particles: usize) -> Result<SpectrumOptions> {
    if domain.periodic != [true; 3] {
        let message = "a power spectrum needs a box that is periodic along all axes";
        return Err(Error::argument_with(message, Hint::state_box()));
    }
    let options = spectrum_options(domain, particles);
    let (longest, most) = (2.0 * PI / domain.longest(), options.k_max);
    if k_max > most * (1.0 + 1e-9) {
        return Err(Error::argument(format!(
            "P(k) up to k = {k_max} cannot be measured: the largest wave number for {particles} particles in this \
             box is {most:.4}"
        )));
    }
    if k_max < longest * (1.0 - 1e-9) {
        return Err(Error::argument(format!(
            "P(k) up to k = {k_max} cannot be measured: the smallest wave number of the box is {longest:.4}"
        )));
    }
    Ok(SpectrumOptions { k_max: k_max.max(longest), ..options })
}

/// The particles' transform, if they have any power to be compared.
fn power_of(
    particles: &Particles,
    domain: &Domain,
    options: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<CachedTransform> {
    let truth = CachedTransform::new(Subject::Particles(particles), domain, options, context)?;
    if truth.against_itself(context)?.largest_power_deviation().is_none() {
        let message = format!("up to k = {}, the power of the particles does not exceed their noise", options.k_max);
        return Err(Error::argument(message));
    }
    Ok(truth)
}

/// Sizes of the particles' groups, if there are enough from `from` particles on.
fn sizes_of(from: f64, particles: &Particles, domain: &Domain, context: &Context<'_>) -> Result<Vec<u64>> {
    let (least, count) = (GROUP_CLASSES[0], particles.len() as u64);
    if from < least as f64 {
        return Err(Error::argument(format!("the smallest group must have at least {least} particles, not {from}")));
    }
    if count > MOST_DRAWN {
        return Err(Error::argument(format!(
            "groups can be counted in at most {MOST_DRAWN} particles, but there are {count}"
        )));
    }
    let Some(linking) = linking(domain, domain.spacing(particles.len())) else {
        return Err(Error::argument("groups cannot be counted: the box is too thin for the linking length"));
    };
    let groups = linking.groups(particles, context)?;
    if groups.finest.is_some() {
        let message = "the number of groups cannot be a target for a zoom simulation: the model may mix its masses";
        return Err(Error::argument_with(message, "select only its lightest particles"));
    }
    let sizes = groups.sizes;
    let group_count = sizes.iter().take_while(|s| **s as f64 >= from).count() as u64;
    if group_count < FEWEST_GROUPS {
        let message = format!(
            "there are {group_count} groups of {from} particles or more, but a comparison needs {FEWEST_GROUPS}"
        );
        let hint = match sizes.get(FEWEST_GROUPS as usize - 1) {
            Some(size) => format!("use {size} as the smallest group").into(),
            None => Hint::default(),
        };
        return Err(Error::argument_with(message, hint));
    }
    Ok(sizes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wave_numbers_that_cannot_be_measured_are_refused() {
        let cube = Domain::upright([0.0; 3], [25.0; 3], [true; 3]);
        let refusal_of = |domain: &Domain, k: f64| spectrum_to(k, domain, 64 * 64 * 64).unwrap_err().to_string();
        // The same grid as the certificate's, to the wave number that is asked for.
        let options = spectrum_to(2.0, &cube, 64 * 64 * 64).unwrap();
        assert_eq!(options, SpectrumOptions { k_max: 2.0, ..spectrum_options(&cube, 64 * 64 * 64) });
        assert!(refusal_of(&cube, 8.1).contains("particles in this box is 8.0425"));
        assert!(refusal_of(&cube, 0.2).contains("smallest wave number of the box is 0.2513"));
        assert!(refusal_of(&Domain { periodic: [true, true, false], ..cube }, 2.0).contains("periodic along all axes"));
    }
}

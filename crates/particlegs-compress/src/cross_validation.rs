//! Models of halves of the particles, made as the file was made, for its certificate.

use super::{Options, SharingPolicy, Target, compress};
use particlegs_core::Result;
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::model::{CertificateLevel, CrossValidation, Effort, Model, SAMPLED_ABOVE};
use particlegs_measure::score::{Halves, ParticlesWithModel, spectrum_options};
use particlegs_particles::{Particles, Selection, Storage};

/// Particles whose halves are fitted: of fewer the halves say nothing.
const LEAST: usize = 2000;

/// Scores models of two random halves of the particles, of `seed`, by the other half, of a region's where the snapshot
/// is large; `None` for models that were trained, and less than [`LEAST`] particles.
pub(super) fn held_out(
    model: &Model,
    particles: &Particles,
    seed: u64,
    context: &Context<'_>,
) -> Result<Option<CrossValidation>> {
    let Some(effort) = model.metadata.recipe.fitted() else { return Ok(None) };
    match ParticlesWithModel::new(model, particles, seed, SAMPLED_ABOVE, context)? {
        Some(scope) if scope.particles.len() >= LEAST => of_scope(&scope, effort, seed, context).map(Some),
        _ => Ok(None),
    }
}

fn of_scope(
    scope: &ParticlesWithModel<'_>,
    effort: Effort,
    seed: u64,
    context: &Context<'_>,
) -> Result<CrossValidation> {
    let (m, particles) = (&scope.model.metadata, &*scope.particles);
    let sample = Some(particles.len() as u64 / 2);
    let half = |left_out| {
        particles.select(Selection { sample, left_out, seed, ..Selection::all() }, &Storage::Memory, context)
    };
    let halves = [half(false)?, half(true)?];
    let default_radius = m.bounds.default_radius(m.count);
    // Gaussians that reach into a region from outside are not its own.
    let share = particles.len() as f64 / m.count as f64;
    let options = Options {
        target: Target::Gaussians(((scope.model.gaussians() as f64 * share / 2.0) as u64).max(1)),
        effort,
        radius: (m.default_radius != default_radius).then_some(m.default_radius),
        certificate: CertificateLevel::None,
        seed,
        // Species of a model with fields share nothing.
        sharing: match m.recipe.read.contains_key("fields") {
            true => SharingPolicy::No,
            false => SharingPolicy::of_recipe(&m.recipe),
        },
        ..Options::default()
    };
    let model_of = |half: &Particles| {
        Ok::<_, particlegs_core::Error>(compress(half, &options, &mut NoCheckpoints, context)?.model)
    };
    let models = [model_of(&halves[0])?, model_of(&halves[1])?];
    let domain = scope.domain;
    let spectrum = spectrum_options(&domain, particles.len());
    let [a, b] = &halves;
    let halves =
        Halves { particles: [a, b], models: [&models[0], &models[1]], domain: &domain, spectrum: &spectrum, seed };
    halves.measure(context)
}

//! A file decoded again, measured, and put together with its certificate. For that, halves of the particles get models
//! of their own, made as the file was made.

use super::clock::Clock;
use super::{Options, SharingPolicy, Target, compress};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::model::{
    Certificate, CertificateLevel, CrossValidation, Effort, Goal, GoalResult, Metadata, Model, SAMPLED_ABOVE,
};
use particlegs_core::{Error, Result, codec};
use particlegs_measure::score::{CertificateInput, GoalMetric, Halves, ParticlesWithModel, spectrum_options};
use particlegs_particles::{Particles, Selection, Storage};

/// The name of a file in the making, in errors.
const PLACE: &str = "the file just coded";

/// Measures `model` against the snapshot that it was made from, as files of that level are measured when they are
/// made, and what they say was asked for; the same seed measures the same. The model is best the decoded one; `bytes`
/// are those of its file without a certificate, which are given to a subset of the particles, too.
pub fn certify(
    model: &Model,
    bytes: u64,
    particles: &Particles,
    seed: u64,
    level: CertificateLevel,
    context: &Context<'_>,
) -> Result<Certificate> {
    particles.check_files()?;
    let reached = match model.certificate.and_then(|c| c.goal) {
        Some(stored) => reached_again(stored.goal, model, particles, seed, context)?,
        None => None,
    };
    complete(&CertificateInput { particles, seed, level, memory: None, reached }, model, bytes, context)
}

/// Bytes of the file of a model when its certificate is measured: without a certificate and fields.
pub fn measured_bytes(bytes: &[u8], model: &Model, place: &str) -> Result<u64> {
    let mut layers = codec::coded_layers(bytes, place)?;
    for block in layers.iter_mut().flat_map(|l| &mut l.content) {
        // Fields are added after a file is measured.
        block.sections.retain(|s| ![codec::FIELD, codec::CORRELATION].contains(&s.tag));
    }
    let metadata = Metadata { fields: Vec::new(), fields_hash: None, ..codec::read_metadata(bytes, place)? };
    let network = model.vizmapper().map(|network| &**network);
    Ok(codec::assemble_with(&metadata, network, None, layers)?.len() as u64)
}

/// Measurements of a model on its particles, and at the full level those of models of their halves.
fn complete(measure: &CertificateInput<'_>, model: &Model, bytes: u64, context: &Context<'_>) -> Result<Certificate> {
    let certificate = measure.certificate(model, bytes, context)?;
    let held_out = match measure.level {
        CertificateLevel::Full => held_out(model, measure.particles, measure.seed, context)?,
        _ => None,
    };
    Ok(Certificate { held_out, ..certificate })
}

/// `None` for a goal that cannot be measured of these particles: no file of theirs was made for it.
fn reached_again(
    goal: Goal,
    model: &Model,
    particles: &Particles,
    seed: u64,
    context: &Context<'_>,
) -> Result<Option<GoalResult>> {
    match GoalMetric::new(goal, particles, &model.metadata, seed, context) {
        Ok(metric) => metric.measure(model, context).map(Some),
        Err(Error::Argument { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// A file and the model in it; where it is to be measured, with its certificate.
pub(crate) struct DecodedFile {
    pub bytes: Vec<u8>,
    pub model: Model,
    pub clock: Clock,
}

impl DecodedFile {
    /// Decodes the file that `file` gives for a certificate, at first none; measures it, and puts it together again.
    pub fn new(
        file: impl Fn(Option<&Certificate>) -> Result<Vec<u8>>,
        measure: Option<CertificateInput<'_>>,
        context: &Context<'_>,
    ) -> Result<DecodedFile> {
        let mut clock = Clock::default();
        let mut bytes = file(None)?;
        let mut model = clock.time("decode", || codec::decode_with(&bytes, PLACE, context))?;
        if let Some(measure) = measure {
            // The model and what is drawn of it take the rest of the memory.
            let measure = CertificateInput { memory: measure.memory.map(|m| m / 5), ..measure };
            let without = bytes.len() as u64;
            let certificate = clock.time("certificate", || complete(&measure, &model, without, context))?;
            bytes = file(Some(&certificate))?;
            // What is told is what the file holds, rounded as it is there.
            model.certificate = codec::read_info(&bytes, PLACE)?.certificate;
        }
        Ok(DecodedFile { bytes, model, clock })
    }
}

/// Particles whose halves are fitted: of fewer the halves say nothing.
const LEAST: usize = 2000;

/// Scores models of two random halves of the particles, of `seed`, by the other half, of a region's where the snapshot
/// is large; `None` for models that were trained, and less than [`LEAST`] particles.
fn held_out(model: &Model, particles: &Particles, seed: u64, context: &Context<'_>) -> Result<Option<CrossValidation>> {
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
        // Half the particles get half the Gaussians, so that each stands for as many as in the model.
        target: Target::Gaussians(((scope.model.gaussians() as f64 * share / 2.0) as u64).max(1)),
        effort,
        // A radius that follows from the number of particles is another for a half; a stated one stays.
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

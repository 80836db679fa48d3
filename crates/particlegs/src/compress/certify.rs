//! A file decoded again, measured, and put together with what was found.

use super::clock::Clock;
use super::halves::held_out;
use crate::model::{Certificate, CertificateLevel, Goal, Measures, Model, Reached};
use crate::particles::Particles;
use crate::progress::Progress;
use crate::score::Gauge;
use crate::{Error, Result, codec, score};

/// The name of a file in the making, in errors.
const PLACE: &str = "the file just coded";

/// What a decoded model is measured on.
#[derive(Clone, Copy)]
pub(crate) struct Measure<'a> {
    /// The particles that it was made of.
    pub particles: &'a Particles,
    /// Seed of the views.
    pub seed: u64,
    /// How much is measured.
    pub level: CertificateLevel,
    /// Memory to stay within, bytes.
    pub memory: Option<u64>,
    /// What was asked for, and what was measured of it on this model.
    pub reached: Option<Reached>,
}

impl Measure<'_> {
    fn certificate(&self, model: &Model, progress: &dyn Progress) -> Result<Certificate> {
        // The model and what is drawn of it take the rest.
        let memory = self.memory.map(|m| m / 5);
        let mut certificate = certify(model, self.particles, self.seed, self.level, memory, progress)?;
        certificate.measures.goal = self.reached;
        Ok(certificate)
    }
}

/// Measures `model` against the snapshot that it was made from, as files of that level are measured when they are
/// made, and what they say was asked for; the same seed measures the same. The model is best the decoded one. `memory` is what the pictures of all
/// particles may take; what is measured does not depend on it.
///
/// # Errors
/// [`crate::Error::Input`] for a box that does not hold the particles; [`crate::Error::Memory`],
/// [`crate::Error::Cancelled`].
pub fn certify(
    model: &Model,
    particles: &Particles,
    seed: u64,
    level: CertificateLevel,
    memory: Option<u64>,
    progress: &dyn Progress,
) -> Result<Certificate> {
    let certificate = score::certificate(model, particles, seed, level, memory, progress)?;
    let held_out = match level {
        CertificateLevel::Full => held_out(model, particles, seed, progress)?,
        _ => None,
    };
    let goal = match model.certificate.and_then(|c| c.measures.goal) {
        Some(stored) => reached_again(stored.goal, model, particles, seed, progress)?,
        None => None,
    };
    Ok(Certificate { measures: Measures { held_out, goal, ..certificate.measures }, ..certificate })
}

/// `None` for a goal that cannot be measured of these particles: no file of theirs was made for it.
fn reached_again(
    goal: Goal,
    model: &Model,
    particles: &Particles,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Option<Reached>> {
    match Gauge::new(goal, particles, &model.metadata, seed, progress) {
        Ok(gauge) => gauge.measure(model, progress).map(Some),
        Err(Error::Argument { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// A file and the model in it; where it is to be measured, with its certificate.
pub(crate) struct Decoded {
    /// The file, whole.
    pub bytes: Vec<u8>,
    /// What it decodes to.
    pub model: Model,
    /// Seconds by phase.
    pub clock: Clock,
}

impl Decoded {
    /// Decodes what `file` gives for a certificate, at first none; measures it, and puts it together again.
    ///
    /// # Errors
    /// Those of `file`, [`codec::decode_with`] and [`score::certificate`].
    pub fn of(
        file: impl Fn(Option<&Certificate>) -> Result<Vec<u8>>,
        measure: Option<Measure<'_>>,
        progress: &dyn Progress,
    ) -> Result<Decoded> {
        let mut clock = Clock::default();
        let mut bytes = file(None)?;
        let mut model = clock.time("decode", || codec::decode_with(&bytes, PLACE, progress))?;
        if let Some(measure) = measure {
            let certificate = clock.time("certificate", || measure.certificate(&model, progress))?;
            bytes = file(Some(&certificate))?;
            // What is told is what the file holds, rounded as it is there.
            model.certificate = codec::read_info(&bytes, PLACE)?.certificate;
        }
        Ok(Decoded { bytes, model, clock })
    }
}

//! A file decoded again, measured, and put together with what was found.

use super::clock::Clock;
use crate::model::{Certificate, Model};
use crate::particles::Particles;
use crate::progress::Progress;
use crate::{Result, codec, score};

/// The name of a file in the making, in errors.
const PLACE: &str = "the file just coded";

/// What a decoded model is measured on.
#[derive(Clone, Copy)]
pub(crate) struct Measure<'a> {
    /// The particles that it was made of.
    pub particles: &'a Particles,
    /// Seed of the views.
    pub seed: u64,
    /// Memory to stay within, bytes.
    pub memory: Option<u64>,
}

impl Measure<'_> {
    fn certificate(&self, model: &Model, progress: &dyn Progress) -> Result<Certificate> {
        // The model and what is drawn of it take the rest.
        score::certificate(model, self.particles, self.seed, self.memory.map(|m| m / 5), progress)
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

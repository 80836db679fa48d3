//! All frames of a series, against each other and against the index.

use super::figures;
use particlegs_core::codec::{FrameCoding, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::model::Epoch;
use particlegs_core::{Error, Result};
use particlegs_particles::Particles;
use serde::Serialize;

/// Results of the verification of a series' frames.
#[derive(Clone, Debug, Serialize)]
pub struct SeriesVerification {
    /// Frames, with those that are missing.
    pub frames: usize,
    /// Of these, keyframes.
    pub keyframes: usize,
    /// Numbers of those that are there.
    #[serde(skip)]
    pub there: Vec<usize>,
    /// Contradictions, a line each that begins with the number of the frame.
    pub contradictions: Vec<String>,
    /// Hash of the source of each of [`SeriesVerification::there`].
    #[serde(skip)]
    pub hashes: Vec<[u8; 32]>,
    /// The moment of each.
    #[serde(skip)]
    epochs: Vec<Epoch>,
}

impl SeriesVerification {
    /// Decodes every frame.
    ///
    /// # Errors
    /// Those of [`SeriesFile::check`].
    pub fn new(series: &SeriesFile<'_>, context: &Context<'_>) -> Result<SeriesVerification> {
        let frames = series.frames.len();
        let keyframes = series.frames.iter().filter(|f| f.kind == FrameCoding::Keyframe).count();
        let (mut present_frames, mut hashes, mut epochs): (Vec<_>, Vec<_>, Vec<_>) = Default::default();
        let mut contradictions = Vec::new();
        series.check(context, |number, frame| {
            present_frames.push(number);
            hashes.push(frame.metadata.source_hash);
            epochs.push(frame.metadata.epoch);
            let of_certificate = frame.certificate.map(|c| figures::contradictions(&c, &frame.metadata));
            let all = of_certificate.into_iter().flatten().chain(frame.lacking_fields());
            contradictions.extend(all.map(|contradiction| format!("frame {number} of {frames}: {contradiction}")));
            Ok(())
        })?;
        Ok(SeriesVerification { frames, keyframes, there: present_frames, contradictions, hashes, epochs })
    }

    /// The frame that was made of these particles; where several have their places, the one of their moment.
    pub fn frame_of(&self, particles: &Particles) -> Option<usize> {
        let hash = particles.source_hash();
        let alike = || (0..self.there.len()).filter(|&i| self.hashes[i] == hash);
        let of_moment = alike().find(|&i| self.epochs[i] == particles.meta.epoch);
        of_moment.or_else(|| alike().next()).map(|i| self.there[i])
    }

    /// [`Error::Differs`], of the series at `place`, if a frame contradicts itself.
    pub fn judge(&self, place: &str) -> Result<()> {
        if self.contradictions.is_empty() {
            return Ok(());
        }
        Err(Error::Differs {
            place: place.into(),
            what: format!("it contradicts itself: {}", self.contradictions.join("; ")),
            hint: "the series was altered: do not trust it before you know how".into(),
        })
    }
}

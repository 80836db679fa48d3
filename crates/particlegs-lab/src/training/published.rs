//! The published recipe on its own, in pieces: how far it is, and what it came to.

use super::{TrainingScore, TrainingTask, scaled, trained_on};
use crate::lab::Lab;
use crate::snapshot::Snapshot;
#[cfg(doc)]
use particlegs::Error;
use particlegs::Result;
use particlegs::model::LawKind;
use particlegs::train::{Config, Preset};
use serde::Serialize;
use std::time::Duration;

/// How far a run of the published recipe is.
#[derive(Clone, Debug, Serialize)]
pub struct PublishedRunStatus {
    /// Share of its pixels, steps and Gaussians.
    pub scale: f64,
    pub particles: u64,
    /// Steps done.
    pub iterations: u64,
    /// Steps of the whole run.
    pub of: u64,
    /// Wall-clock seconds of all pieces, start and coding included.
    pub seconds: f64,
    /// Gaussians of the best model so far.
    pub gaussians: u64,
    /// Its masked PSNR on held-out views, dB; none where nothing is lit there.
    pub held_out_masked_psnr: Option<f64>,
    pub curve: Vec<TrainingScore>,
}

/// Trains by the published recipe at a `scale` in (0, 1] for a `piece` of time; the next call goes on from there.
pub fn published(lab: &Lab<'_>, snapshot: &Snapshot, scale: f64, piece: Duration) -> Result<PublishedRunStatus> {
    let config = scaled(Config::preset(Preset::Paper, LawKind::AlphaBlend), scale)?;
    let of = config.iterations();
    let task = TrainingTask::published(config, 1, lab.settings.seed);
    let run = trained_on(lab, &snapshot.particles, &snapshot.hash, &task, Some(piece))?;
    Ok(PublishedRunStatus {
        scale,
        particles: snapshot.particles.len() as u64,
        iterations: run.unfinished.unwrap_or(of),
        of,
        seconds: run.made.seconds,
        gaussians: run.made.model.gaussians() as u64,
        held_out_masked_psnr: run.curve.iter().filter_map(|e| e.held_out_masked_psnr).reduce(f64::max),
        curve: run.curve,
    })
}

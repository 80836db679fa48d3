//! The published recipe on a card, in pieces.

use super::QuickRun;
use super::scenes::TiledScene;
use particlegs::Result;
use particlegs::particles::Particles;
use particlegs_lab::lab::Lab;
use particlegs_lab::snapshot::Snapshot;
use particlegs_lab::{PublishedRunStatus, published};
use std::time::Duration;

/// Particles that it is trained on.
const PARTICLES: [usize; 2] = [1 << 21, 20_000];
/// Share of the recipe.
const SCALE: [f64; 2] = [1.0, 0.004];
/// Minutes of a piece.
const MINUTES: [f64; 2] = [120.0, 2.0];

/// Trains for a piece on particles that are drawn of a scene.
pub fn piece(lab: &Lab<'_>, made: &TiledScene, quick: QuickRun) -> Result<PublishedRunStatus> {
    let own = usize::from(quick.0);
    let [x, y, z] = made.particles(PARTICLES[own]);
    let snapshot = Snapshot::new("tiled".into(), "tiled".into(), Particles::from_columns(x, y, z), None);
    let minutes = lab.settings.minutes.unwrap_or(MINUTES[own]);
    published(lab, &snapshot, lab.settings.scale.unwrap_or(SCALE[own]), Duration::from_secs_f64(60.0 * minutes))
}

/// How far it is, as people read it.
pub fn text(s: &PublishedRunStatus) -> String {
    let score = s.held_out_masked_psnr.map_or("not scored yet".into(), |v| format!("{v:.2} dB"));
    let goes_on = if s.iterations < s.of { "; the same command goes on" } else { "" };
    format!(
        "published recipe{}, {} particles: {} of {} steps in {:.0} s of all pieces, {} Gaussians, masked PSNR on \
         held-out views {score}{goes_on}",
        if s.scale < 1.0 { format!(" scaled by {}", s.scale) } else { String::new() },
        s.particles,
        s.iterations,
        s.of,
        s.seconds,
        s.gaussians
    )
}

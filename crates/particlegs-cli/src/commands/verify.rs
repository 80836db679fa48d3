//! `particlegs verify M.pgs [SNAPSHOT...]`.

use super::info;
use crate::common::{Common, SnapshotArgs};
use clap::Args;
use particlegs::model::Model;
use particlegs::{Error, Result, codec};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  particlegs verify M.pgs\n  particlegs verify M.pgs samples/nbody64\n\nA corrupt file ends with exit code 4."
)]
pub struct Arguments {
    /// Model file.
    model: PathBuf,
    /// The snapshot that it was made of: its hash is compared.
    snapshot: Vec<PathBuf>,
    #[command(flatten)]
    opening: SnapshotArgs,
    #[command(flatten)]
    common: Common,
}

/// The result.
#[derive(Serialize)]
struct Report {
    model_bytes: u64,
    gaussians: usize,
    particles: u64,
    counts_sum_to_particles: bool,
    mass_error: f64,
    source_matches: Option<bool>,
    certificate: &'static str,
}

/// Reads the whole file, decodes every block and checks the sums.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    let bytes = info::read(&a.model)?;
    let place = a.model.display().to_string();
    let model = codec::decode(&bytes, &place)?;
    let (counts, mass_error) = sums(&model);
    if counts != model.metadata.count || mass_error > 1e-9 {
        return Err(Error::corrupt(
            place,
            format!("its Gaussians hold {counts} particles, mass off by {mass_error:e}"),
        ));
    }
    let source_matches = match a.snapshot.is_empty() {
        true => None,
        false => Some(compare(&a, &model)?),
    };
    let certificate = match &model.certificate {
        None => "none in the file",
        Some(_) => "not measured again",
    };
    let report = Report {
        model_bytes: bytes.len() as u64,
        gaussians: model.gaussians(),
        particles: counts,
        counts_sum_to_particles: true,
        mass_error,
        source_matches,
        certificate,
    };
    let mut text = format!(
        "{}: sound: {} bytes, {} Gaussians whose counts sum to {} particles, mass within {mass_error:.1e}\n",
        place, report.model_bytes, report.gaussians, report.particles
    );
    if source_matches == Some(true) {
        text.push_str("source: the snapshot is the one that the file was made of\n");
    }
    text.push_str(&format!("certificate: {certificate}\n"));
    text.push_str(&info::certificate(model.certificate.as_ref()));
    context.finish(text.trim_end(), &report)
}

/// The particles that the Gaussians stand for, and the relative error of their mass.
fn sums(model: &Model) -> (u64, f64) {
    let mut counts = 0u64;
    let mut mass = 0.0;
    for block in model.blocks() {
        let g = &block.gaussians;
        counts += g.count.iter().map(|&c| c as u64).sum::<u64>();
        mass += match &g.mass {
            Some(m) => m.iter().sum::<f64>(),
            None => block.mass,
        };
    }
    (counts, (mass / model.metadata.mass - 1.0).abs())
}

/// Is the snapshot the source? An error where it is not.
fn compare(a: &Arguments, model: &Model) -> Result<bool> {
    let particles = a.opening.open(&a.snapshot)?;
    if particlegs::particles::source_hash(&particles) == model.metadata.source_hash {
        return Ok(true);
    }
    let what = format!("it is not the snapshot that {} was made of (their hashes differ)", a.model.display());
    Err(Error::input(a.snapshot[0].as_path(), what))
}

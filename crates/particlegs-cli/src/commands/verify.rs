//! `particlegs verify M.pgs [SNAPSHOT...]`.

use crate::common::{CommandContext, Common};
use crate::info_model;
use crate::snapshot_args::ParticleArgs;
use clap::Args;
use particlegs::input::{ModelOrSeries, is_series};
use particlegs::job::{Job, State};
use particlegs::{FileVerification, Snapshot, StatedFigure};
use particlegs_core::{Error, Result};
use particlegs_files::output::write_bytes;
use std::path::PathBuf;

#[derive(Args)]
#[command(mut_arg("particle_type", |a| a.alias("layer")))]
#[command(
    after_help = "Examples:\n  particlegs verify M.pgs\n  particlegs verify M.pgs samples/nbody64\n  particlegs verify M.pgs samples/nbody64 --full --store\n  particlegs verify JOB\n\nThe exit code is 4 for a corrupt file, and 9 for a certificate that differs from the\nmeasurement or contradicts itself (docs/guide/exit-codes.md)."
)]
pub struct Arguments {
    /// Model file or job folder.
    #[arg(value_name = "MODEL|JOB")]
    model: PathBuf,
    /// Snapshot that the model was made from, to compare its hash and measure the certificate again.
    #[arg(value_name = "SNAPSHOT")]
    snapshot: Vec<PathBuf>,
    /// Measure a full certificate, as `compress --certificate full` does.
    #[arg(long, requires = "snapshot")]
    full: bool,
    /// Store the new measurements in the file, if no stored value differs from them.
    #[arg(long, requires = "snapshot")]
    store: bool,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

/// Reads the whole file, decodes every block and checks the sums; with a snapshot also compares its hash and measures
/// the certificate again.
pub fn run(mut a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    if Job::is_job(&a.model) {
        return verify_job(&a, &context);
    }
    context
        .reads(a.snapshot.iter().chain([&a.model]).chain(&a.particles.opening.topology).map(PathBuf::as_path), false)?;
    if a.store && is_series(&a.model) {
        return Err(Error::argument("--store does not write into a series: its frames have their own certificates"));
    }
    if a.store {
        context.outputs.rewrites(&a.model)?;
    }
    let content = ModelOrSeries::open(&a.model, &context)?;
    let frame = match content {
        // --frame then names a frame of the series, not one of the snapshot.
        ModelOrSeries::Series(_) => a.particles.opening.frame.take(),
        ModelOrSeries::Model(_) => None,
    };
    let snapshot = match a.snapshot.is_empty() {
        true => None,
        false => Some(Snapshot::of_files(&a.snapshot, a.particles.choice(a.common.seed)?)),
    };
    let verification = content.verify(snapshot.as_ref(), frame, (a.full, a.common.seed), &context)?;
    let verdict = verification.judge();
    if let (true, Ok(()), ModelOrSeries::Model(model)) = (a.store, &verdict, &content) {
        let certified = model.with_certificate(verification.model.measured_again.as_ref())?;
        write_bytes(&a.model, certified.bytes())?;
        context.message(&format!("{}: stored the measured certificate", verification.place));
    }
    let mut of_series = String::new();
    if let (Some(all), ModelOrSeries::Series(series)) = (&verification.series, &content) {
        let (place, bytes, keyframes) = (series.name(), series.bytes().len(), all.keyframes);
        let missing = match all.frames - all.there.len() {
            0 => String::new(),
            n => format!(", {n} missing"),
        };
        of_series = format!(
            "{place}: intact: {bytes} bytes, a series of {} frames, {keyframes} of them keyframes{missing}; each was decoded and agrees with the index\n",
            all.frames
        );
    }
    // All differences are printed before the command fails because of them.
    context.finish((of_series + &text(&verification)).trim_end(), &verification)?;
    verdict
}

fn text(file: &FileVerification) -> String {
    let FileVerification { model: r, place, of_several, length_unit, .. } = file;
    let mut text = format!(
        "{place}: intact: {} bytes, law {}, {} Gaussians for {} particles, relative mass error {:.1e}\n",
        r.model_bytes, r.law, r.gaussians, r.particles, r.mass_error
    );
    if r.measured_again.is_some() && *of_several {
        text += "source: merged from several snapshots, so there is no hash to compare; the number of particles is the same\n";
    } else if r.measured_again.is_some() {
        text += "source: this is the snapshot that the file was made from\n";
    }
    text += &format!("certificate: {}\n", r.certificate);
    let unit = length_unit.as_deref();
    match (&r.stored, &r.measured_again) {
        (Some(_), Some(_)) => text += &beside(&r.figures),
        (Some(stored), None) => {
            text += "stored in the file, not measured now:\n";
            text += &info_model::certificate(Some(stored), unit);
        }
        (None, Some(measured)) => {
            text += "measured now, not stored in the file:\n";
            text += &info_model::certificate(Some(measured), unit);
            text += &beside(&r.figures);
        }
        (None, None) => {}
    }
    for [name, stored, actual] in &r.source_differences {
        text += &format!("{name}: {stored} in the file, {actual} in the snapshot: differs\n");
    }
    for (kind, lines) in [("impossible", &r.contradictions), ("suspicious", &r.doubts)] {
        lines.iter().for_each(|line| text += &format!("{kind}: {line}\n"));
    }
    match (&r.measured_again, &r.stored) {
        (None, Some(_)) => text + "verdict: not verified; name the snapshot to measure it again\n",
        _ => text + &info_model::verdict(&r.verdict),
    }
}

fn beside(figures: &[StatedFigure]) -> String {
    let mut text = format!("  {:<48} {:>18} {:>18} {:>14}\n", "figure", "stored", "measured", "tolerance");
    for f in figures {
        let differs = if f.differs { "  differs" } else { "" };
        text += &format!("  {:<48} {:>18} {:>18} {:>14}{differs}\n", f.name, f.stored, f.measured, f.tolerance);
    }
    text
}

fn verify_job(a: &Arguments, context: &CommandContext) -> Result<()> {
    if !a.snapshot.is_empty() {
        return Err(Error::argument("a job already names its snapshot: give only the folder"));
    }
    let job = Job::open(&a.model)?;
    context.reads_job(&a.model, job.snapshot_paths(), false)?;
    let status = job.verify(context)?;
    let done_count = |states: &[State]| states.iter().filter(|s| **s == State::Done).count();
    let text = format!(
        "{}: intact: the snapshot is the planned one; {} of {} chunks and {} of {} blocks are done",
        a.model.display(),
        done_count(&status.chunks),
        status.chunks.len(),
        done_count(&status.blocks),
        status.blocks.len()
    );
    context.finish(&text, &status)
}

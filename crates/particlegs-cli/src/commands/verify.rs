//! `particlegs verify M.pgs [SNAPSHOT...]`.

use crate::common::{Common, Context};
use crate::info_model;
use crate::inputs;
use crate::job_args::JobSnapshot;
use crate::snapshot_args::{SelectionArgs, SnapshotArgs, WindowArgs};
use crate::source;
use clap::Args;
use particlegs::input::name_of;
use particlegs::job::{Job, State};
use particlegs::model::{Certificate, Model};
use particlegs::particles::Particles;
use particlegs::{Error, Result, codec, score};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  particlegs verify M.pgs\n  particlegs verify M.pgs samples/nbody64\n  particlegs verify JOB\n\nThe exit code is 4 for a corrupt file (docs/guide/exit-codes.md)."
)]
pub struct Arguments {
    /// Model file, or the folder of a job.
    #[arg(value_name = "MODEL|JOB")]
    model: PathBuf,
    /// Snapshot that the model was made from: its hash is compared, its certificate measured again.
    #[arg(value_name = "SNAPSHOT")]
    snapshot: Vec<PathBuf>,
    #[command(flatten)]
    opening: SnapshotArgs,
    #[command(flatten)]
    selection: SelectionArgs,
    #[command(flatten)]
    window: WindowArgs,
    #[command(flatten)]
    common: Common,
}

/// The result.
#[derive(Serialize)]
struct Report {
    model_bytes: u64,
    law: &'static str,
    gaussians: usize,
    particles: u64,
    counts_sum_to_particles: bool,
    mass_error: f64,
    source_matches: Option<bool>,
    certificate: &'static str,
    measured_again: Option<Certificate>,
}

/// Reads the whole file, decodes every block and checks the sums.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.clone().start()?;
    if Job::is_job(&a.model) {
        return verify_job(&a, &context);
    }
    context.reads(a.snapshot.iter().map(PathBuf::as_path).chain([a.model.as_path()]), false)?;
    let bytes = inputs::model(&a.model, &context)?;
    let place = name_of(&a.model);
    let model = codec::decode(&bytes, &place)?;
    let (counts, mass_error) = sums(&model);
    if counts != model.metadata.count || mass_error > 1e-9 {
        return Err(Error::corrupt(
            place,
            format!("its Gaussians hold {counts} particles, mass off by {mass_error:e}"),
        ));
    }
    let of_several = source::is_of_several(&bytes, &model, &place)?;
    let measured_again = match a.snapshot.is_empty() {
        true => None,
        false => Some(measure(&a, &model, of_several, &context)?),
    };
    let certificate = match (&model.certificate, &measured_again) {
        (_, Some(_)) => "measured again",
        (Some(_), None) => "not measured again",
        (None, None) => "none in the file",
    };
    let report = Report {
        model_bytes: bytes.len() as u64,
        law: model.metadata.law.name(),
        gaussians: model.gaussians(),
        particles: counts,
        counts_sum_to_particles: true,
        mass_error,
        source_matches: measured_again.filter(|_| !of_several).map(|_| true),
        certificate,
        measured_again,
    };
    let mut text = format!(
        "{}: sound: {} bytes, law {}, {} Gaussians whose counts sum to {} particles, mass within {mass_error:.1e}\n",
        place, report.model_bytes, report.law, report.gaussians, report.particles
    );
    if measured_again.is_some() && of_several {
        text.push_str("source: merged from several snapshots, whose hashes it does not have; the number of particles is that of this one\n");
    } else if measured_again.is_some() {
        text.push_str("source: the snapshot is the one that the file was made of\n");
    }
    text.push_str(&format!("certificate: {certificate}\n"));
    let unit = model.metadata.length_unit.as_deref();
    text.push_str(&info_model::certificate(model.certificate.as_ref(), unit));
    if let Some(again) = &measured_again {
        text.push_str("\nmeasured again, now:\n");
        text.push_str(&info_model::certificate(Some(again), unit));
    }
    context.finish(text.trim_end(), &report)
}

/// Reads every file of a job, and its snapshot, through.
fn verify_job(a: &Arguments, context: &Context) -> Result<()> {
    if !a.snapshot.is_empty() {
        return Err(Error::argument("a job names its snapshot itself: give the folder alone"));
    }
    let job = Job::open(&a.model)?;
    let snapshot = JobSnapshot::of(&job)?;
    context.reads_job(&a.model, snapshot.paths(), false)?;
    job.verify(Some(snapshot.layered(context)?), context)?;
    let status = job.status()?;
    let done = |states: &[State]| states.iter().filter(|s| **s == State::Done).count();
    let text = format!(
        "{}: sound: the snapshot is the one that was planned; {} of {} chunks and {} of {} blocks are there, each whole",
        a.model.display(),
        done(&status.chunks),
        status.chunks.len(),
        done(&status.blocks),
        status.blocks.len()
    );
    context.finish(&text, &status)
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

/// The certificate of the same views, measured now. An error where the snapshot is not the source.
fn measure(a: &Arguments, model: &Model, of_several: bool, context: &Context) -> Result<Certificate> {
    let particles: Particles =
        a.opening.open_selected(&a.snapshot, (&a.selection, &a.window), a.common.seed, context)?;
    source::check(model, of_several, &particles, (a.snapshot[0].as_path(), &a.model))?;
    let seed = model.certificate.map_or(a.common.seed, |c| c.seed);
    score::certificate(model, &particles, seed, None, context)
}

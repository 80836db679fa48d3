//! `particlegs verify M.pgs [SNAPSHOT...]`.

use crate::common::{CommandContext, Common};
use crate::info_model;
use crate::inputs::{self, FrameChoice};
use crate::job_args::JobSnapshot;
use crate::snapshot_args::ParticleArgs;
use clap::Args;
use particlegs_compress::job::{Job, State};
use particlegs_compress::verify::{SeriesVerification, StatedFigure, StoredModel, Verification};
use particlegs_core::codec::{SeriesDecoder, SeriesFile};
use particlegs_core::model::{Certificate, Metadata, Model};
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::name_of;
use particlegs_files::output;
use particlegs_particles::{LayerFields, Particles, Storage};
use serde::Serialize;
use std::path::{Path, PathBuf};

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

#[derive(Serialize)]
struct VerifyReport<'a> {
    #[serde(flatten)]
    of_model: &'a Verification,
    #[serde(flatten)]
    of_series: Option<SeriesFrameReport<'a>>,
}

/// What is told of a series beside its frame.
#[derive(Serialize)]
struct SeriesFrameReport<'a> {
    frame: usize,
    series: &'a SeriesVerification,
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
    if a.store && inputs::is_series(&a.model) {
        return Err(Error::argument("--store does not write into a series: its frames have their own certificates"));
    }
    if a.store {
        context.outputs.rewrites(&a.model)?;
    }
    let (bytes, place) = (inputs::read_file(&a.model, &context)?, name_of(&a.model));
    if codec::is_series(&bytes) {
        return verify_series(&mut a, &bytes, &place, &context);
    }
    let stored = StoredModel::new(codec::decode_with(&bytes, &place, &context)?, &bytes, &place)?;
    let snapshot = a.snapshot(&stored.model.metadata, &context)?;
    let found = a.verify(&stored, snapshot.as_ref(), &context)?;
    let sound = found.judge(&place);
    if a.store && sound.is_ok() {
        store(&a.model, &bytes, &stored.model, found.measured_again.as_ref())?;
        context.message(&format!("{place}: stored the measured certificate"));
    }
    let report = VerifyReport { of_model: &found, of_series: None };
    context.finish(text(&found, &stored).trim_end(), &report)?;
    sound
}

/// A snapshot and the fields of its layers.
type Snapshot = (Particles, Vec<LayerFields>);

/// All frames of a series; then one of them as a model: that of --frame, or that which was made from the snapshot, or the
/// last.
fn verify_series(a: &mut Arguments, bytes: &[u8], place: &str, context: &CommandContext) -> Result<()> {
    let series = SeriesFile::read(bytes, place)?;
    let all = SeriesVerification::new(&series, context)?;
    all.judge(place)?;
    let mut decoder = SeriesDecoder::new(&series);
    let named = a.particles.opening.frame.take();
    let mut frame = match named {
        None if !a.snapshot.is_empty() => series.last()?,
        named => FrameChoice::from(named).number(&series, place, context)?,
    };
    let mut snapshot = None;
    if !a.snapshot.is_empty() {
        let metadata = decoder.frame(frame, context)?.metadata.clone();
        a.particles.opening.frame = inputs::frame_of_snapshot(&metadata, place, context);
        snapshot = a.snapshot(&metadata, context)?;
    }
    if let (Some((particles, _)), None) = (&snapshot, named) {
        frame = all.frame_of(particles).unwrap_or(frame);
        context.message(&format!("note: {place}: frame {frame} of {} is compared with the snapshot", all.frames));
    }
    let stored = StoredModel::of_frame(&mut decoder, frame, context)?;
    let found = a.verify(&stored, snapshot.as_ref(), context)?;
    let missing = match all.frames - all.there.len() {
        0 => String::new(),
        n => format!(", {n} missing"),
    };
    let whole = format!(
        "{place}: intact: {} bytes, a series of {} frames, {} of them keyframes{missing}; each was decoded and agrees with the index\n",
        bytes.len(),
        all.frames,
        all.keyframes
    );
    let report = VerifyReport { of_model: &found, of_series: Some(SeriesFrameReport { frame, series: &all }) };
    context.finish((whole + &text(&found, &stored)).trim_end(), &report)?;
    found.judge(&stored.place)
}

impl Arguments {
    /// The snapshot, with the fields that a model has.
    fn snapshot(&self, metadata: &Metadata, context: &CommandContext) -> Result<Option<Snapshot>> {
        if self.snapshot.is_empty() {
            return Ok(None);
        }
        let mut choice = self.particles.choice(self.common.seed)?;
        match metadata.fields.is_empty() {
            true => Ok(Some((choice.read(&self.snapshot, &Storage::Memory, context)?, Vec::new()))),
            false => choice.read_fields(&self.snapshot, &Storage::Memory, context).map(Some),
        }
    }

    fn verify(
        &self,
        stored: &StoredModel,
        snapshot: Option<&Snapshot>,
        context: &CommandContext,
    ) -> Result<Verification> {
        let snapshot = snapshot.map(|(particles, fields)| (particles, &fields[..]));
        stored.verify(snapshot, (self.full, self.common.seed), context)
    }
}

fn store(path: &Path, bytes: &[u8], model: &Model, certificate: Option<&Certificate>) -> Result<()> {
    output::write_bytes(path, &with_certificate(path, bytes, model, certificate)?)
}

/// The same blocks with another certificate, or none.
fn with_certificate(path: &Path, bytes: &[u8], model: &Model, certificate: Option<&Certificate>) -> Result<Vec<u8>> {
    let layers = codec::coded_layers(bytes, &name_of(path))?;
    let network = model.vizmapper().map(|v| &**v);
    codec::assemble_with(&codec::read_metadata(bytes, &name_of(path))?, network, certificate, layers)
}

fn text(r: &Verification, stored: &StoredModel) -> String {
    let StoredModel { model, place, of_several, .. } = stored;
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
    let unit = model.metadata.units.length_text();
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
    for [name, stored, found] in &r.source_differences {
        text += &format!("{name}: {stored} in the file, {found} in the snapshot: differs\n");
    }
    for (what, lines) in [("impossible", &r.contradictions), ("suspicious", &r.doubts)] {
        lines.iter().for_each(|line| text += &format!("{what}: {line}\n"));
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
    let snapshot = JobSnapshot::from_job(&job)?;
    context.reads_job(&a.model, snapshot.paths(), false)?;
    job.verify(Some(snapshot.layered(&job, context)?), context)?;
    let status = job.status()?;
    let done = |states: &[State]| states.iter().filter(|s| **s == State::Done).count();
    let text = format!(
        "{}: intact: the snapshot is the planned one; {} of {} chunks and {} of {} blocks are done",
        a.model.display(),
        done(&status.chunks),
        status.chunks.len(),
        done(&status.blocks),
        status.blocks.len()
    );
    context.finish(&text, &status)
}

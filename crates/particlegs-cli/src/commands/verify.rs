//! `particlegs verify M.pgs [SNAPSHOT...]`.

use crate::certificate_check::{self, CertificateFigure};
use crate::common::{CommandContext, Common};
use crate::info_model;
use crate::inputs;
use crate::job_args::JobSnapshot;
use crate::snapshot_args::ParticleArgs;
use crate::source_check;
use clap::Args;
use particlegs_files::input::name_of;
use particlegs_files::output;
use particlegs_pipeline::compress::FieldSelection;
use particlegs_pipeline::job::{Job, State};
use particlegs_pipeline::model::{Certificate, CertificateLevel, Model};
use particlegs_pipeline::particles::Storage;
use particlegs_pipeline::score::Assessment;
use particlegs_pipeline::{Error, Result, codec, compress};
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
struct VerifyReport {
    model_bytes: u64,
    law: &'static str,
    gaussians: usize,
    particles: u64,
    counts_sum_to_particles: bool,
    mass_error: f64,
    source_matches: Option<bool>,
    certificate: &'static str,
    stored: Option<Certificate>,
    measured_again: Option<Certificate>,
    figures: Vec<CertificateFigure>,
    /// Metadata that differs from the snapshot: name, stored, found.
    source_differences: Vec<[String; 3]>,
    contradictions: Vec<String>,
    doubts: Vec<String>,
    verdict: Vec<Assessment>,
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
        context.outputs().rewrites(&a.model)?;
    }
    let bytes = inputs::model_with_snapshot(&a.model, &mut a.particles.opening, &context)?;
    let place = name_of(&a.model);
    let model = codec::decode_with(&bytes, &place, &context)?;
    let (counts, mass_error) = sums(&model);
    if counts != model.metadata.count || mass_error > 1e-9 {
        return Err(Error::corrupt(
            place,
            format!(
                "its Gaussians stand for {counts} of {} particles, and their mass is off by {mass_error:e}",
                model.metadata.count
            ),
        ));
    }
    let of_several = codec::is_of_several(&bytes, &model.metadata, &place)?;
    let (measured_again, source_differences) = match a.snapshot.is_empty() {
        true => (None, Vec::new()),
        false => measure(&a, &model, &bytes, &context)?,
    };
    let stored = model.certificate;
    let (verdict, figures) = match (&stored, &measured_again) {
        (_, None) => (Assessment::unverified(), Vec::new()),
        (None, Some(measured)) => (Assessment::verdict(Some(measured), &model.metadata), Vec::new()),
        (Some(stored), Some(measured)) => {
            let completes = certificate_check::level_of(measured) != certificate_check::level_of(stored);
            // Each block's sum is rounded on its own.
            let exact = stored.blocks.is_none() && model.metadata.tool_version == env!("CARGO_PKG_VERSION");
            let figures = certificate_check::side_by_side(stored, measured, completes, exact);
            (Assessment::verdict(Some(measured), &model.metadata), figures)
        }
    };
    let report = VerifyReport {
        model_bytes: bytes.len() as u64,
        law: model.metadata.law.name(),
        gaussians: model.gaussians(),
        particles: counts,
        counts_sum_to_particles: true,
        mass_error,
        source_matches: measured_again.filter(|_| !of_several).map(|_| true),
        certificate: match (&stored, &measured_again) {
            (None, None) => "none in the file",
            (None, Some(_)) => "none in the file; measured now",
            (Some(_), None) => "not measured again",
            (Some(_), Some(_)) => "measured again",
        },
        stored,
        measured_again,
        figures,
        source_differences,
        contradictions: stored
            .as_ref()
            .map_or_else(Vec::new, |c| certificate_check::contradictions(c, &model.metadata)),
        doubts: stored.as_ref().map_or_else(Vec::new, certificate_check::doubts),
        verdict,
    };
    let sound = report.judge(&place);
    if a.store && sound.is_ok() {
        store(&a.model, &bytes, &model, report.measured_again.as_ref())?;
        context.message(&format!("{place}: stored the measured certificate"));
    }
    context.finish(text(&report, &model, of_several, &place).trim_end(), &report)?;
    sound
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

impl VerifyReport {
    /// An error if the stored values differ from the measurement or contradict themselves.
    fn judge(&self, place: &str) -> Result<()> {
        let hint = "the certificate was altered, or another version of the program measured it: do not trust the file before you know which";
        let differs = |what: String| Error::Differs { place: place.into(), what, hint: hint.into() };
        if !self.contradictions.is_empty() {
            return Err(differs(format!("its certificate contradicts itself: {}", self.contradictions.join("; "))));
        }
        if let Some([name, stored, found]) = self.source_differences.first() {
            return Err(Error::Differs {
                place: place.into(),
                what: format!("its {name} is {stored} in the file and {found} in the snapshot"),
                hint: "give the options that the model was made with (`info` shows them); if they are the same, its metadata was altered"
                    .into(),
            });
        }
        let off: Vec<String> = self
            .figures
            .iter()
            .filter(|f| f.differs)
            .map(|f| format!("{} is stored as {} and measured as {}", f.name, f.stored, f.measured))
            .collect();
        match off.first() {
            None => Ok(()),
            Some(first) => Err(differs(format!(
                "{} of {} values in its certificate differ: {first}",
                off.len(),
                self.figures.len()
            ))),
        }
    }
}

fn text(r: &VerifyReport, model: &Model, of_several: bool, place: &str) -> String {
    let mut text = format!(
        "{place}: intact: {} bytes, law {}, {} Gaussians for {} particles, relative mass error {:.1e}\n",
        r.model_bytes, r.law, r.gaussians, r.particles, r.mass_error
    );
    if r.measured_again.is_some() && of_several {
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

fn beside(figures: &[CertificateFigure]) -> String {
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

/// The particles that the Gaussians stand for, and the relative error of their mass.
fn sums(model: &Model) -> (u64, f64) {
    let mut counts = 0u64;
    let mut mass = 0.0;
    for block in model.blocks() {
        let g = &block.gaussians;
        counts += g.count.iter().map(|&c| c as u64).sum::<u64>();
        mass += match g.masses() {
            Some(m) => m.iter().sum::<f64>(),
            None => block.mass,
        };
    }
    (counts, (mass / model.metadata.mass - 1.0).abs())
}

/// The certificate measured now in the same views, rounded like the file, and metadata that differs from the snapshot.
/// An error if the snapshot is not the source.
fn measure(
    a: &Arguments,
    model: &Model,
    bytes: &[u8],
    context: &CommandContext,
) -> Result<(Option<Certificate>, Vec<[String; 3]>)> {
    let of_several = codec::is_of_several(bytes, &model.metadata, &name_of(&a.model))?;
    let without_certificate = compress::measured_bytes(bytes, model, &name_of(&a.model))?;
    let names: Vec<String> = model.metadata.fields.iter().map(|q| q.name.clone()).collect();
    let mut choice = a.particles.choice(a.common.seed)?;
    let (particles, sources) = match names.is_empty() {
        true => (choice.read(&a.snapshot, &Storage::Memory, context)?, Vec::new()),
        false => choice.read_fields(&a.snapshot, &Storage::Memory, context)?,
    };
    source_check::check(model, of_several, &particles, &a.snapshot[0], &a.model)?;
    let differences = particles.differences_from(model, of_several);
    if !differences.is_empty() {
        return Ok((None, differences));
    }
    context.message("this is the snapshot that the file was made from; measuring");
    let seed = model.certificate.map_or(a.common.seed, |c| c.views.seed);
    let stored = model.certificate.as_ref().map_or(CertificateLevel::Quick, certificate_check::level_of);
    let level = if a.full { CertificateLevel::Full } else { stored };
    let mut measured = compress::certify(model, without_certificate, &particles, seed, level, context)?;
    // Models of joined fields have none.
    let of_fields = model.certificate.is_none_or(|c| c.fields.is_some() || level != stored);
    if !names.is_empty() && of_fields {
        let chosen = model.metadata.recipe.read.get("star-forming").and_then(|text| text.parse().ok());
        let star_forming = chosen.unwrap_or_default();
        let fields = FieldSelection::new(&names, star_forming, &particles, &sources, model.metadata.law)?;
        measured.fields = fields.agreement(model, seed, context)?;
    }
    let file = with_certificate(&a.model, bytes, model, Some(&measured))?;
    let measured = codec::read_info(&file, &name_of(&a.model))?.certificate.unwrap_or(measured);
    Ok((Some(measured), differences))
}

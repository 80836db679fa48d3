//! A model scored against a snapshot.

use crate::camera::ViewSet;
use crate::{Context, Error, Evaluation, Model, Result, Size, Snapshot, Storage};
use particlegs_compress::source_difference;
use particlegs_core::model;
use particlegs_files::model_file;
use particlegs_measure::score::{self, LookScores, MeanViewScores};
use particlegs_train::Accelerator;
use serde::Serialize;

/// Views that a model is scored in.
#[derive(Clone, Debug)]
pub enum EvaluationViews {
    /// So many views of each orbit of the model's bounds, 1 to 10 000, with radii and opacities drawn by a seed.
    Orbits {
        /// Views of an orbit.
        frames: usize,
        /// Size of the pictures.
        size: Size,
        /// Seed of radii and opacities.
        seed: u64,
    },
    /// Views, and a text about their origin.
    Stated(ViewSet, String),
}

impl EvaluationViews {
    /// The views for a model, and a text about their origin.
    fn of(self, model: &model::Model) -> Result<(ViewSet, String)> {
        let (frames, size, seed) = match self {
            EvaluationViews::Stated(set, origin) => return Ok((set, origin)),
            EvaluationViews::Orbits { frames, size, seed } => (frames, size, seed),
        };
        if !(1..=10_000).contains(&frames) {
            return Err(Error::argument(format!("frames must be 1 to 10000, not {frames}")));
        }
        let origin = format!("{frames} view{} per orbit, seed {seed}", if frames == 1 { "" } else { "s" });
        Ok((ViewSet { size, views: score::evaluation_views(&model.metadata, size, seed, frames) }, origin))
    }
}

/// Scores of a model, and what it takes.
#[derive(Clone, Debug, Serialize)]
pub struct EvaluationReport {
    /// Scores of each view, and their means.
    #[serde(flatten)]
    pub evaluation: Evaluation,
    /// Bytes of the file.
    pub model_bytes: u64,
    /// Bytes of the particles as float32.
    pub raw_bytes: u64,
    /// `raw_bytes` over those of the file.
    pub compression_ratio: f64,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// `model_bytes` over `gaussians`.
    pub bytes_per_gaussian: f64,
    /// Number of particles.
    pub particles: u64,
    /// Whether these are the particles that the model was made from.
    pub source_matches: bool,
    /// Width of the pictures, pixels.
    pub width: usize,
    /// Height of the pictures, pixels.
    pub height: usize,
    /// Source of the views.
    pub views_from: String,
}

impl Model {
    /// Scores it, or some of its layers, against a snapshot in views; a `renderer` draws the model's pictures, else the
    /// CPU. That these are not the particles that it was made from is a warning.
    ///
    /// # Errors
    /// [`Error::Argument`] for views out of range, and layers that there are not; [`Error::Input`] for particles whose units
    /// cannot be converted to the model's; those of reading; [`Error::Memory`]; [`Error::Cancelled`].
    pub fn evaluate(
        &self,
        layers: &[String],
        snapshot: &Snapshot,
        views: EvaluationViews,
        renderer: Option<&dyn Accelerator>,
        context: &Context<'_>,
    ) -> Result<EvaluationReport> {
        let (name, whole) = (self.name(), self.decoded());
        let chosen = if layers.is_empty() { None } else { Some(whole.clone().only(layers)?) };
        let model = chosen.as_ref().unwrap_or(whole);
        let (ViewSet { views, size }, views_from) = views.of(model)?;
        let particles = snapshot.particles(context)?;
        // The hash is of all layers.
        let is_part = model.layers.len() < whole.layers.len();
        let of_several = is_part || model_file::is_of_several(self.bytes(), &model.metadata, name)?;
        let difference = source_difference(&particles, model, of_several);
        if let Some(why) = difference {
            context.warn(&format!(
                "{} is not the snapshot that {name} was made from ({why}: {} particles, made from {})",
                snapshot.place(),
                particles.len(),
                model.metadata.count,
            ));
        }
        let particles = particles.in_units(&model.metadata.unit_system(), &Storage::Memory, context)?;
        let info = self.info()?;
        let (model_bytes, gaussians) = (self.bytes().len() as u64, model.gaussians());
        Ok(EvaluationReport {
            evaluation: score::evaluate(model, &particles, &views, size, renderer, context)?,
            model_bytes,
            raw_bytes: info.raw_bytes(),
            compression_ratio: info.compression_ratio(),
            gaussians,
            bytes_per_gaussian: model_bytes as f64 / gaussians.max(1) as f64,
            particles: particles.len() as u64,
            source_matches: difference.is_none(),
            width: size.width,
            height: size.height,
            views_from,
        })
    }
}

impl EvaluationReport {
    /// Scores of each orbit against each style, a line each.
    pub fn text(&self) -> String {
        let r = self;
        let mut text = format!(
            "{} Gaussians, {} bytes: ratio {:.1}, {:.2} bytes per Gaussian\n{} views of {}x{} ({})\n{}",
            r.gaussians,
            r.model_bytes,
            r.compression_ratio,
            r.bytes_per_gaussian,
            r.evaluation.views.len(),
            r.width,
            r.height,
            r.views_from,
            if r.source_matches { "" } else { "these are not the particles that the model was made from\n" }
        );
        text += &format!(
            "\n{:<17} {:<6} {:>9} {:>8} {:>7} {:>10} {:>6} {:>10} {:>9} {:>8}",
            "against",
            "orbit",
            "masked dB",
            "PSNR dB",
            "SSIM",
            "noise-free",
            "gap",
            "shot noise",
            "all black",
            "uniform"
        );
        for (name, pick) in LOOKS {
            for (orbit, mean) in r.evaluation.by_orbit.iter().chain([&("mean", r.evaluation.mean)]) {
                text += &row(name, orbit, pick(mean));
            }
        }
        text + "\nMeans over views; noise-free, gap, shot noise, all black and uniform (box) are\nmasked PSNR in dB."
    }
}

type ScoreSelector = fn(&MeanViewScores) -> &LookScores;

const LOOKS: [(&str, ScoreSelector); 3] =
    [("paraview", |m| &m.paraview), ("paraview-no-fxaa", |m| &m.paraview_no_fxaa), ("expected", |m| &m.expected)];

fn row(look: &str, orbit: &str, s: &LookScores) -> String {
    let db = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.2}"));
    let ssim = s.model.ssim.map_or("-".into(), |v| format!("{v:.4}"));
    let noise_free = if look == "expected" { "identical".into() } else { db(s.noise_free.masked_psnr) };
    let mut row = format!(
        "\n{look:<17} {orbit:<6} {:>9} {:>8} {ssim:>7} {noise_free:>10} {:>6} {:>10} {:>9} {:>8}",
        db(s.model.masked_psnr),
        db(s.model.psnr),
        db(s.gap.masked_psnr),
        db(s.shot_noise.flatten()),
        db(s.all_black.masked_psnr),
        db(s.uniform_box.masked_psnr)
    );
    if let Some(n) = s.left_out.filter(|n| *n > 0) {
        row += &format!("   (without the {n} views that have no value)");
    }
    row
}

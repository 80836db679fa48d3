//! Compares trained models at the size that the paper scores, and at the largest size of their training.

use super::groups::{self, ViewGroup, in_pixels, masked, means_over, psnr, ssim};
use super::published::{self, BYTES_A_GAUSSIAN, same_sign};
use crate::lab::Lab;
use crate::results::{ResultTable, Spread, TableCell};
use crate::snapshot::Snapshot;
use crate::training::{self, TrainingResult};
use crate::views::{ReferenceViews, Score};
use particlegs_core::Result;
use particlegs_core::model::Metadata;
use particlegs_train::Config;

/// Factor from the settings' views per orbit to views per group.
const FRAMES: usize = 4;

/// Reference pictures at two sizes: that of the first training stage, which the paper scores, and that of the last.
pub(super) struct StageEvaluator<'a> {
    lab: &'a Lab<'a>,
    snapshot: &'a Snapshot,
    /// Sizes of the first and the last stage.
    pub truths: [ReferenceViews; 2],
}

/// Models of one recipe, one per seed, with their scores.
pub(super) struct AblationRow {
    pub label: String,
    /// Scores of each model at the two sizes.
    pub scores: [Vec<Vec<Score>>; 2],
    pub gaussians: Vec<f64>,
    pub bytes: Vec<f64>,
    /// Wall-clock seconds of each model.
    pub seconds: Vec<f64>,
    pub paper: Option<published::PublishedRow>,
    /// Whether one of them reached the limit of Gaussians.
    pub held: bool,
}

impl<'a> StageEvaluator<'a> {
    /// Models trained by `config`, in views of `groups`.
    pub fn new(
        lab: &'a Lab<'a>,
        snapshot: &'a Snapshot,
        config: &Config,
        metadata: &Metadata,
        groups: &[ViewGroup],
    ) -> Result<Self> {
        let views = groups::views(groups, metadata, lab.settings.seed, frames(lab));
        let [small, large] = training::sizes(config);
        let truth = |size| ReferenceViews::at_size(lab, snapshot, views.clone(), size);
        Ok(StageEvaluator { lab, snapshot, truths: [truth(small)?, truth(large)?] })
    }

    /// Scores of the models of one recipe.
    pub fn row(
        &self,
        label: &str,
        models: &[TrainingResult],
        paper: Option<published::PublishedRow>,
    ) -> Result<AblationRow> {
        let at = |truth: &ReferenceViews| -> Result<Vec<Vec<Score>>> {
            models.iter().map(|m| groups::scores(self.lab, self.snapshot, truth, &m.made)).collect()
        };
        let [small, large] = &self.truths;
        Ok(AblationRow {
            label: label.into(),
            scores: [at(small)?, at(large)?],
            gaussians: models.iter().map(|m| m.made.model.gaussians() as f64).collect(),
            bytes: models.iter().map(|m| m.made.bytes.len() as f64).collect(),
            seconds: models.iter().map(|m| m.made.seconds).collect(),
            paper,
            held: models.iter().any(|m| m.held),
        })
    }

    /// Scores of the noise-free picture at both sizes.
    pub fn noise_free(&self) -> Result<AblationRow> {
        let scores_of = |truth| Ok(vec![groups::noise_free(self.lab, self.snapshot, truth)?]);
        let [small, large] = &self.truths;
        let scores = [scores_of(small)?, scores_of(large)?];
        let label = "noise-free picture of all particles".into();
        Ok(AblationRow { label, scores, gaussians: vec![], bytes: vec![], seconds: vec![], paper: None, held: false })
    }

    pub fn sizes(&self) -> [String; 2] {
        [0, 1].map(|k| in_pixels(self.truths[k].size))
    }
}

/// Views of a group.
pub(super) fn frames(lab: &Lab<'_>) -> usize {
    FRAMES * lab.settings.frames
}

/// Whole pictures and lit pixels at the first size, lit pixels at the second.
const MEASURES: [(usize, fn(&Score) -> Option<f64>); 3] = [(0, psnr), (0, masked), (1, masked)];

impl AblationRow {
    /// One of [`MEASURES`] for each model, averaged over the trained orbits.
    pub fn measured(&self, number: usize) -> Vec<f64> {
        let (size, pick) = MEASURES[number];
        means_over(&self.scores[size], &groups::in_range(), pick)
    }

    /// SSIM at the first size.
    pub fn ssim(&self) -> Vec<f64> {
        means_over(&self.scores[0], &groups::in_range(), ssim)
    }

    /// Change of a measure from the median of another row, for each model.
    pub fn changes(&self, from: &AblationRow, number: usize) -> Vec<f64> {
        let median = Spread::new(&from.measured(number)).map(|s| s.median);
        self.measured(number).into_iter().filter_map(|v| Some(v - median?)).collect()
    }

    /// Spread of a measure over the models of a row: the noise of one run.
    pub fn noise(&self, number: usize) -> f64 {
        Spread::new(&self.measured(number)).map_or(0.0, |s| s.high - s.low)
    }
}

/// The rows with their changes from the first, and whether those agree in sign with the paper.
pub(super) fn table(name: &str, title: &str, rows: &[AblationRow], sizes: &[String; 2]) -> ResultTable {
    let [small, large] = sizes;
    let heads = [
        "recipe".into(),
        format!("PSNR at {small}, dB"),
        "change, dB".into(),
        format!("masked PSNR at {small}, dB"),
        "change, dB".into(),
        format!("SSIM at {small}"),
        format!("masked PSNR at {large}, dB"),
        "change, dB".into(),
        "Gaussians".into(),
        "bytes, coded".into(),
        "bytes as PLY".into(),
        "time, s".into(),
        "paper: PSNR, dB".into(),
        "paper: change, dB".into(),
        "paper: PLY, MB".into(),
        format!("same sign, PSNR at {small}"),
        format!("same sign, masked at {large}"),
    ];
    let heads = heads.each_ref().map(String::as_str);
    ResultTable::new(name, title, &heads).with(rows.iter().map(|row| cells(row, &rows[0])))
}

fn cells(row: &AblationRow, first: &AblationRow) -> Vec<TableCell> {
    let is_first = std::ptr::eq(row, first);
    let change = |k| if is_first { TableCell::Empty } else { TableCell::spread(&row.changes(first, k), 2) };
    let sign = |k| sign(row, first, k).map_or(TableCell::Empty, TableCell::text);
    let paper =
        |value: fn(&published::PublishedRow) -> f64, digits| TableCell::number(row.paper.as_ref().map(value), digits);
    let as_ply: Vec<f64> = row.gaussians.iter().map(|n| n * BYTES_A_GAUSSIAN as f64).collect();
    vec![
        TableCell::text(&row.label),
        TableCell::decibels(&row.measured(0)),
        change(0),
        TableCell::decibels(&row.measured(1)),
        change(1),
        TableCell::spread(&row.ssim(), 4),
        TableCell::decibels(&row.measured(2)),
        change(2),
        TableCell::spread(&row.gaussians, 0),
        TableCell::spread(&row.bytes, 0),
        TableCell::spread(&as_ply, 0),
        TableCell::spread(&row.seconds, 1),
        paper(|p| p.psnr, 2),
        if is_first { TableCell::Empty } else { paper(|p| p.change, 2) },
        paper(|p| p.megabytes, 1),
        sign(0),
        sign(2),
    ]
}

/// Whether the median change agrees in sign with the paper, in words; `None` if the paper has no such row.
pub(super) fn sign(row: &AblationRow, first: &AblationRow, number: usize) -> Option<&'static str> {
    let theirs = row.paper.filter(|p| p.change != 0.0)?.change;
    let ours = Spread::new(&row.changes(first, number))?.median;
    Some(same_sign(ours, theirs, first.noise(number)))
}

/// Notes for every table of trained models.
pub(super) fn notes(lab: &Lab<'_>, scale: f64, config: &Config, sizes: &[String; 2]) -> Vec<String> {
    let [small, large] = sizes;
    let (frames, steps) = (frames(lab), config.iterations());
    let start = config.start_gaussians.unwrap_or(0);
    let quick = "Quick settings: tiny pictures, to check that everything runs. These numbers are not results.";
    let mut notes = vec![
        format!(
            "The published recipe (preset `paper`, law `alpha-blend`) is scaled by {scale}: picture sides, steps, \
             schedules and the number of pictures are multiplied by it, and the number of first Gaussians by its \
             square, so that there are as many per pixel. Learning rates are unchanged. The whole recipe takes \
             {steps} steps from {start} Gaussians, first at {small}, then at {large}. Gaussians move less far than \
             in the paper, so signs can be compared, but not decibels."
        ),
        format!(
            "Scores compare the decoded files with ParaView's pictures of all particles: {frames} views on each of \
             the orbits 1.0, 0.7 and 0.5, with radius and opacity drawn from the published range, averaged over the \
             orbits. The paper scores the PSNR of whole pictures at the size of its first stage, here {small}. \
             Masked PSNR counts only lit pixels; {large} is the size that the last stages were trained for."
        ),
    ];
    notes.extend(lab.settings.quick.then(|| quick.to_string()));
    notes
}

/// Note on rows that reached the limit of Gaussians.
pub(super) fn held_note<'a>(rows: impl IntoIterator<Item = &'a AblationRow>) -> Option<String> {
    let held: Vec<&str> = rows.into_iter().filter(|r| r.held).map(|r| r.label.as_str()).collect();
    (!held.is_empty()).then(|| {
        format!(
            "These models reached this experiment's limit on Gaussians, so the recipe did not choose their number: {}.",
            held.join("; ")
        )
    })
}

/// Note on how far `first` is below the noise-free picture of all particles, which no model is expected to exceed.
pub(super) fn room_note(
    label: &str,
    first: &AblationRow,
    noise_free: &AblationRow,
    sizes: &[String; 2],
) -> Option<String> {
    let median = |row: &AblationRow| Some(Spread::new(&row.measured(0))?.median);
    let (from, to) = (median(first)?, median(noise_free)?);
    Some(format!(
        "Possible gain: the noise-free picture of all particles, an upper bound for models, has {:.2} dB more PSNR \
         at {} than {label}. The paper's eight blocks gain {:.2} dB.",
        to - from,
        sizes[0],
        published::EIGHT.psnr - published::SINGLE.psnr
    ))
}

/// Note on the noise of one run.
pub(super) fn noise_note(first: &AblationRow, sizes: &[String; 2]) -> String {
    let [small, large] = sizes;
    format!(
        "Noise of one run: {} runs of the first row that differ only in their seed agree within {:.2} dB of PSNR \
         and {:.2} dB of masked PSNR at {small}, and {:.2} dB of masked PSNR at {large}. Smaller changes are marked \
         as within noise. The paper's artifact states 0.3 dB.",
        first.gaussians.len(),
        first.noise(0),
        first.noise(1),
        first.noise(2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(psnrs: &[f64], paper: Option<published::PublishedRow>) -> AblationRow {
        let scores_of = |v: f64| -> Vec<Score> {
            let score =
                |g: ViewGroup| Score { view: format!("{}_00", g.name), psnr: Some(v), masked: Some(v), ssim: None };
            groups::in_range().into_iter().map(score).collect()
        };
        let all: Vec<Vec<Score>> = psnrs.iter().map(|v| scores_of(*v)).collect();
        let each = vec![1000.0; psnrs.len()];
        AblationRow {
            label: "r".into(),
            scores: [all.clone(), all],
            gaussians: each.clone(),
            bytes: each.clone(),
            seconds: each,
            paper,
            held: false,
        }
    }

    #[test]
    fn changes_are_from_the_median_and_noise_hides_signs() {
        let first = row(&[30.0, 30.5, 30.1], Some(published::SINGLE));
        let worse = row(&[28.0], Some(published::FAR_ORBIT));
        let alike = row(&[29.8], Some(published::FAR_ORBIT));
        let better = row(&[33.1], Some(published::FAR_ORBIT));
        assert!((first.noise(0) - 0.5).abs() < 1e-9);
        assert!((worse.changes(&first, 0)[0] + 2.1).abs() < 1e-9);
        let said = [&worse, &alike, &better].map(|r| sign(r, &first, 0));
        assert_eq!(said, [Some("yes"), Some("within noise"), Some("no")]);
        assert_eq!(sign(&first, &first, 0), None);
        let table = table("t", "T", &[first, worse], &["1 x 1".into(), "2 x 2".into()]);
        assert_eq!((table.rows[0].len(), table.rows[1].len()), (17, 17));
        assert_eq!((&table.rows[0][2], table.rows[1][10].describe()), (&TableCell::Empty, "68,000".into()));
    }
}

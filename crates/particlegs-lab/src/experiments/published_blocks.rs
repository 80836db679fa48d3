//! The published recipe in blocks: each is trained on its own, then they are merged and fine-tuned (paper, table and
//! figure of blocks).

use super::Experiment;
use super::ablation::{self, AblationRow, StageEvaluator};
use super::groups::{ViewGroup, masked, means_over};
use super::models::{fine_tuning, merged, whole};
use super::published::{self as paper, BYTES_A_GAUSSIAN, same_sign};
use super::sweep::{self, ScoreCurve, at_distances};
use crate::lab::Lab;
use crate::results::{ExperimentResults, Plot, PlotAxis, PlotSeries, Point, ResultTable, Spread, TableCell, spread};
use crate::snapshot::Snapshot;
use crate::training::{TrainingResult, scale, tuned};
use particlegs_core::Result;
use particlegs_train::Config;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "published-blocks",
    title: "The published recipe in blocks: merged, and fine-tuned",
    paper: "tab:block, fig:block_distance, fig:scale",
    trains: true,
    weight: 1200,
    run,
};

fn numbers(lab: &Lab<'_>) -> &'static [u32] {
    if lab.settings.quick { &[1, 2, 8] } else { &[1, 2, 4, 8, 16] }
}

/// A model of some blocks, merged and fine-tuned.
struct BlockTuningRow {
    blocks: u32,
    merged: AblationRow,
    tuned: AblationRow,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let (snapshot, seed) = (&snapshots[0], lab.settings.seed);
    let (recipe, tuning) = (whole(lab)?, fine_tuning(lab)?);
    let one: Vec<TrainingResult> =
        lab.settings.seeds().map(|seed| merged(lab, snapshot, 1, seed)).collect::<Result<_>>()?;
    let judge = StageEvaluator::new(lab, snapshot, &recipe, &one[0].made.model.metadata, &at_distances())?;
    let mut all = Vec::new();
    for &k in numbers(lab) {
        let merged_model = merged(lab, snapshot, k, seed)?;
        let after = tuned(lab, snapshot, &merged_model.made, &tuning, seed)?;
        let merged = judge.row(&format!("{k} merged"), &[merged_model], None)?;
        let tuned = judge.row(&format!("{k} fine-tuned"), &[after], None)?;
        all.push(BlockTuningRow { blocks: k, merged, tuned });
    }
    let one = judge.row("one block", &one, Some(paper::SINGLE))?;
    let (sizes, noise_free) = (judge.sizes(), judge.noise_free()?);
    let mut results =
        ExperimentResults { notes: notes(lab, &recipe, &tuning, &one, &sizes), ..ExperimentResults::default() };
    results.notes.extend(ablation::held_note(all.iter().flat_map(|m| [&m.merged, &m.tuned])));
    results.notes.extend(near_and_far(&all, &one));
    results.notes.extend(ablation::room_note("one block", &one, &noise_free, &sizes));
    results.tables.push(table(&all, &one, &sizes));
    for (stem, title, tuned) in [
        ("published-blocks-distance", "Fine-tuned blocks by camera distance", true),
        ("published-blocks-distance-merged", "Merged blocks, not fine-tuned, by camera distance", false),
    ] {
        let title = format!("{title}, {}", sizes[0]);
        let curves = curves(&all, &one, &noise_free, tuned);
        results.tables.push(sweep::table(stem, &title, &curves));
        results.plots.push(sweep::plot(stem, &title, &curves));
    }
    results.plots.push(growth(&all, snapshot.particles.len()));
    Ok(results)
}

fn table(all: &[BlockTuningRow], one: &AblationRow, sizes: &[String; 2]) -> ResultTable {
    let [small, large] = sizes;
    let heads = [
        "blocks".into(),
        format!("PSNR merged, {small}, dB"),
        "fine-tuned, dB".into(),
        "change from one block, dB".into(),
        format!("SSIM merged, {small}"),
        "SSIM fine-tuned".into(),
        format!("masked PSNR merged, {small}, dB"),
        "fine-tuned, dB".into(),
        format!("masked PSNR merged, {large}, dB"),
        "fine-tuned, dB".into(),
        "Gaussians merged".into(),
        "fine-tuned".into(),
        "bytes, coded".into(),
        "bytes as PLY".into(),
        "time, s: training".into(),
        "fine-tuning".into(),
        "paper: merged, dB".into(),
        "paper: fine-tuned, dB".into(),
        "paper: change, dB".into(),
        "paper: SSIM".into(),
        "paper: Gaussians, thousands".into(),
        "change has the same sign".into(),
    ];
    let title = "Blocks trained by the published recipe, merged and fine-tuned";
    let heads = heads.each_ref().map(String::as_str);
    ResultTable::new("published-blocks", title, &heads).with(all.iter().map(|m| cells(m, one)))
}

fn cells(m: &BlockTuningRow, one: &AblationRow) -> Vec<TableCell> {
    let changes = m.tuned.changes(one, 0);
    let p = paper::blocks(m.blocks);
    let theirs = p.map(|p| p.tuned - paper::SINGLE.psnr).filter(|c| *c != 0.0);
    let sign = Spread::new(&changes).zip(theirs).map(|(s, t)| same_sign(s.median, t, one.noise(0)));
    let as_ply: Vec<f64> = m.tuned.gaussians.iter().map(|n| n * BYTES_A_GAUSSIAN as f64).collect();
    vec![
        TableCell::count(m.blocks.into()),
        TableCell::spread(&m.merged.measured(0), 2),
        TableCell::spread(&m.tuned.measured(0), 2),
        TableCell::spread(&changes, 2),
        TableCell::spread(&m.merged.ssim(), 4),
        TableCell::spread(&m.tuned.ssim(), 4),
        TableCell::spread(&m.merged.measured(1), 2),
        TableCell::spread(&m.tuned.measured(1), 2),
        TableCell::spread(&m.merged.measured(2), 2),
        TableCell::spread(&m.tuned.measured(2), 2),
        TableCell::spread(&m.merged.gaussians, 0),
        TableCell::spread(&m.tuned.gaussians, 0),
        TableCell::spread(&m.tuned.bytes, 0),
        TableCell::spread(&as_ply, 0),
        TableCell::spread(&m.merged.seconds, 0),
        TableCell::spread(&m.tuned.seconds, 0),
        TableCell::number(p.and_then(|p| p.merged), 2),
        TableCell::number(p.map(|p| p.tuned), 2),
        TableCell::number(theirs, 2),
        TableCell::number(p.map(|p| p.ssim), 4),
        TableCell::number(p.map(|p| p.thousands), 0),
        sign.map_or(TableCell::Empty, TableCell::text),
    ]
}

/// One curve per number of blocks, one for a single block as trained (all seeds), and one for the noise-free picture.
fn curves<'a>(
    all: &'a [BlockTuningRow],
    one: &'a AblationRow,
    noise_free: &'a AblationRow,
    tuned: bool,
) -> Vec<ScoreCurve<'a>> {
    let curve = |label: String, row: &'a AblationRow, style, dashed| ScoreCurve {
        label,
        scores: &row.scores[0],
        style,
        dashed,
    };
    let block_curves = all.iter().enumerate().filter(|(_, m)| tuned || m.blocks > 1).map(|(style, m)| {
        let label = if m.blocks == 1 { "1 block, fine-tuned".into() } else { format!("{} blocks", m.blocks) };
        curve(label, if tuned { &m.tuned } else { &m.merged }, style + 1, false)
    });
    std::iter::once(curve("1 block, as trained".into(), one, 0, false))
        .chain(block_curves)
        .chain([curve("noise-free picture".into(), noise_free, 8, true)])
        .collect()
}

/// Gaussians per block over particles per block (paper, figure of scale).
fn growth(all: &[BlockTuningRow], particles: usize) -> Plot {
    let points: Vec<Point> = all
        .iter()
        .rev()
        .filter_map(|m| {
            let k = f64::from(m.blocks);
            let each: Vec<f64> = m.merged.gaussians.iter().map(|n| n / k).collect();
            spread(particles as f64 / k, &each)
        })
        .collect();
    let whole = points.last().copied();
    let linear = |p: &Point| Some(Point::new(p.x, whole?.y * p.x / whole?.x));
    let straight = points.iter().filter_map(linear).collect();
    Plot {
        name: "published-blocks-growth".into(),
        title: "Gaussians of a block by number of particles".into(),
        x: PlotAxis::logarithmic("particles per block"),
        y: PlotAxis::logarithmic("Gaussians per block, before fine-tuning"),
        series: vec![
            PlotSeries { name: "published recipe".into(), style: 0, dashed: false, points },
            PlotSeries { name: "proportional".into(), style: 7, dashed: true, points: straight },
        ],
        levels: vec![],
    }
}

fn notes(lab: &Lab<'_>, recipe: &Config, tuning: &Config, one: &AblationRow, sizes: &[String; 2]) -> Vec<String> {
    let mut notes = ablation::notes(lab, scale(lab), recipe, sizes);
    notes.push(format!(
        "Every block is trained for all those steps in its own frame. The blocks are merged by the published \
         transform with the first block's VizMapper, and the whole is fine-tuned for {} steps at {} (published: 60 \
         000 at 1920 x 1080). Each block follows the recipe of a single block; the paper's artifact uses other \
         rates and a higher least opacity for blocks in a set. Changes are relative to one block as trained. The \
         row of one block is fine-tuned equally long, which shows the gain from the steps alone; the paper has no \
         such row. Bytes are those of the fine-tuned file.",
        tuning.iterations(),
        sizes[0]
    ));
    notes.push(ablation::noise_note(one, sizes));
    notes
}

/// Note on the gain of eight blocks near and far.
fn near_and_far(all: &[BlockTuningRow], one: &AblationRow) -> Option<String> {
    let eight = all.iter().find(|m| m.blocks == 8)?;
    let [far, near] = sweep::gains(&one.scores[0], &eight.tuned.scores[0])?;
    let [paper_far, paper_near] = paper::EIGHT_GAINS;
    let alike =
        if (near > far) == (paper_near > paper_far) { "more near than far in both" } else { "not as in the paper" };
    let tuned = all.iter().find(|m| m.blocks == 1).and_then(|m| {
        let at = |row: &AblationRow| {
            Spread::new(&means_over(&row.scores[0], &[ViewGroup::orbit(0.5)], masked)).map(|s| s.median)
        };
        Some(at(&m.tuned)? - at(one)?)
    });
    let steps =
        tuned.map_or(String::new(), |t| format!(" One block that is fine-tuned equally long gains {t:+.2} dB near."));
    Some(format!(
        "Eight fine-tuned blocks compared with one: {far:+.2} dB far, {near:+.2} dB near (paper {paper_far:+.2} and \
         {paper_near:+.2} dB): {alike}.{steps}"
    ))
}

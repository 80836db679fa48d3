//! Models in several blocks, each fitted on its own, at the same file size (paper, table and figure of blocks).

use super::groups::{self, ViewGroup, in_pixels, masked, means_over, psnr, ssim};
use super::models::{describe_seeds, each_seed};
use super::rates::COMPARED as RATIO;
use super::sweep::{self, DISTANCES, ScoreCurve, at_distances};
use super::{Experiment, published as paper};
use crate::lab::{Lab, ModelBuild, ModelSettings};
use crate::results::{ExperimentResults, Plot, PlotAxis, PlotSeries, ResultTable, Spread, TableCell, spread};
use crate::snapshot::Snapshot;
use crate::views::{ReferenceViews, Score};
use particlegs_core::Result;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "blocks",
    title: "Separately fitted blocks at the same file size",
    paper: "tab:block, fig:block_distance",
    trains: false,
    weight: 60,
    run,
};

const BLOCKS: [u32; 5] = [1, 2, 4, 8, 16];

/// Models with one number of blocks, one per seed.
struct BlockCountScores {
    blocks: u32,
    scores: Vec<Vec<Score>>,
    gaussians: Vec<f64>,
    bytes: Vec<f64>,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let snapshot = &snapshots[0];
    let first = lab.model(snapshot, &recipe(1, lab.settings.seed))?;
    let frames = 2 * lab.settings.frames;
    let views = groups::views(&at_distances(), &first.model.metadata, lab.settings.seed, frames);
    let truth = ReferenceViews::in_views(lab, snapshot, views)?;
    let all: Vec<BlockCountScores> =
        BLOCKS.iter().map(|k| measured(lab, snapshot, &truth, *k)).collect::<Result<_>>()?;
    let noise_free = [groups::noise_free(lab, snapshot, &truth)?];
    let curves = curves(&all, &noise_free);
    let title = "Masked PSNR by distance of the camera and number of blocks";
    Ok(ExperimentResults {
        tables: vec![table(&all, &noise_free), sweep::table("blocks-distance", title, &curves)],
        plots: vec![sweep::plot("blocks-distance", title, &curves), changes_by_distance(&all)],
        notes: notes(lab, &truth, frames, &all),
        ..ExperimentResults::default()
    })
}

pub(super) fn recipe(blocks: u32, seed: u64) -> ModelSettings {
    ModelSettings { blocks, ..ModelSettings::ratio(RATIO, seed) }
}

fn measured(lab: &Lab<'_>, snapshot: &Snapshot, truth: &ReferenceViews, blocks: u32) -> Result<BlockCountScores> {
    let models = each_seed(lab, |build: &ModelBuild| &build.model, |seed| lab.model(snapshot, &recipe(blocks, seed)))?;
    Ok(BlockCountScores {
        blocks,
        scores: models.iter().map(|build| groups::scores(lab, snapshot, truth, build)).collect::<Result<_>>()?,
        gaussians: models.iter().map(|build| build.model.gaussians() as f64).collect(),
        bytes: models.iter().map(|build| build.bytes.len() as f64).collect(),
    })
}

fn table(all: &[BlockCountScores], noise_free: &[Vec<Score>]) -> ResultTable {
    let heads = [
        "blocks",
        "masked PSNR, dB",
        "change from 1, dB",
        "PSNR, dB",
        "SSIM",
        "far: masked PSNR, dB",
        "mid: masked PSNR, dB",
        "near: masked PSNR, dB",
        "Gaussians",
        "bytes",
        "paper: PSNR merged, dB",
        "paper: fine-tuned, dB",
        "paper: SSIM",
        "paper: Gaussians, thousands",
    ];
    let mut table = ResultTable::new("blocks", "Our law in blocks, at the same file size", &heads);
    let pictures = |scores: &[Vec<Score>], change: TableCell| {
        let means_of = |pick| means_over(scores, &groups::in_range(), pick);
        let decibels = |pick| TableCell::decibels(&means_of(pick));
        let mut cells = vec![decibels(masked), change, decibels(psnr), TableCell::spread(&means_of(ssim), 4)];
        let orbit = |g| TableCell::decibels(&means_over(scores, std::slice::from_ref(g), masked));
        cells.extend(groups::in_range().iter().map(orbit));
        cells
    };
    for m in all {
        let change = if m.blocks == 1 {
            TableCell::Empty
        } else {
            TableCell::spread(&changes(m, &all[0], &groups::in_range()), 2)
        };
        let p = paper::blocks(m.blocks);
        let mut row = vec![TableCell::count(m.blocks.into())];
        row.extend(pictures(&m.scores, change));
        row.extend([TableCell::spread(&m.gaussians, 0), TableCell::spread(&m.bytes, 0)]);
        row.extend([
            TableCell::number(p.and_then(|p| p.merged), 2),
            TableCell::number(p.map(|p| p.tuned), 2),
            TableCell::number(p.map(|p| p.ssim), 4),
            TableCell::number(p.map(|p| p.thousands), 0),
        ]);
        table.row(row);
    }
    let mut row = vec![TableCell::text("noise-free picture")];
    row.extend(pictures(noise_free, TableCell::Empty));
    row.resize(heads.len(), TableCell::Empty);
    table.row(row);
    table
}

/// Change of each model's masked PSNR from the median of one block, dB.
fn changes(m: &BlockCountScores, one: &BlockCountScores, groups: &[ViewGroup]) -> Vec<f64> {
    let means_of = |m: &BlockCountScores| means_over(&m.scores, groups, masked);
    let median = Spread::new(&means_of(one)).map(|s| s.median);
    means_of(m).into_iter().filter_map(|v| Some(v - median?)).collect()
}

/// The change by distance.
fn changes_by_distance(all: &[BlockCountScores]) -> Plot {
    let series = all.iter().enumerate().skip(1).map(|(style, m)| {
        let point = |d: f64| spread(d, &changes(m, &all[0], &[ViewGroup::orbit(d)]));
        let points = DISTANCES.iter().rev().filter_map(|d| point(*d)).collect();
        PlotSeries { name: format!("{} blocks", m.blocks), style, dashed: false, points }
    });
    Plot {
        name: "blocks-distance-change".into(),
        title: "Change from one block at the same bytes, by distance".into(),
        x: PlotAxis::linear("distance of the camera, base distances"),
        y: PlotAxis::linear("change of masked PSNR, dB"),
        series: series.collect(),
        levels: vec![("one block".into(), 0.0)],
    }
}

fn curves<'a>(all: &'a [BlockCountScores], noise_free: &'a [Vec<Score>]) -> Vec<ScoreCurve<'a>> {
    let curve = |(style, m): (usize, &'a BlockCountScores)| ScoreCurve {
        label: if m.blocks == 1 { "1 block".into() } else { format!("{} blocks", m.blocks) },
        scores: &m.scores,
        style,
        dashed: false,
    };
    let noise_free = ScoreCurve { label: "noise-free picture".into(), scores: noise_free, style: 8, dashed: true };
    all.iter().enumerate().map(curve).chain([noise_free]).collect()
}

fn notes(lab: &Lab<'_>, truth: &ReferenceViews, frames: usize, all: &[BlockCountScores]) -> Vec<String> {
    let mut notes = vec![
        format!(
            "All models follow the optical-depth law, at ratio {RATIO}. A k-d tree cuts the particles into blocks \
             of equal counts; each block is fitted separately with its share of the bytes, and the blocks are added \
             up. Nothing is trained or fine-tuned, because optical depths add exactly. In the paper, more blocks \
             make larger files, so its gain comes from blocks and bytes together; `published-blocks` repeats that \
             sweep."
        ),
        format!(
            "Scores compare with ParaView's pictures of all particles at {}: {frames} views at each distance, with \
             the same directions, radii and opacities; for each number of blocks {}. Masked PSNR, PSNR and SSIM are \
             means over far, mid and near (1.0, 0.7 and 0.5 base distances).",
            in_pixels(truth.size),
            describe_seeds(lab, &all.iter().map(|m| m.scores.len()).collect::<Vec<_>>())
        ),
    ];
    let change = |m: &BlockCountScores| Some((m.blocks, Spread::new(&changes(m, &all[0], &groups::in_range()))?));
    let said: Vec<String> =
        all[1..].iter().filter_map(change).map(|(k, s)| format!("{k} blocks {:+.2} dB", s.median)).collect();
    notes.push(format!("Change of masked PSNR from one block at the same bytes: {}.", said.join(", ")));
    let eight = all.iter().find(|m| m.blocks == 8);
    if let Some([far, near]) = eight.and_then(|m| sweep::gains(&all[0].scores, &m.scores)) {
        let [paper_far, paper_near] = paper::EIGHT_GAINS;
        notes.push(format!(
            "Eight blocks compared with one: {far:+.2} dB far, {near:+.2} dB near at the same size (paper, \
             fine-tuned and {:.1} times as large: {paper_far:+.2} and {paper_near:+.2} dB).",
            paper::EIGHT.megabytes / paper::SINGLE.megabytes
        ));
    }
    notes
}

//! Rate and distortion: file size against the quality of pictures and density, for models and other methods (paper,
//! table "Rate-distortion comparison" and its figure).

use super::Experiment;
use super::rates::{BY_SIZE, COMPARED, NOT_OF_THIS_SIZE, RatePoint, ReferenceScores, beside, rows, series};
use crate::density::{DensityMeasures, all_particles_bits};
use crate::lab::{Lab, ModelBuild, ModelSettings};
use crate::method::CompressionMethod;
use crate::results::{ExperimentResults, Plot, PlotAxis, Point, ResultTable, Spread, TableCell, decibels};
use crate::snapshot::Snapshot;
use crate::training;
use crate::views::{ReferenceViews, Score, identical_note, masked, mean, mean_of, psnr, ssim};
use particlegs_core::Result;
use particlegs_measure::score::evaluation_views;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "rate-distortion",
    title: "Rate and distortion: pictures and density of models and other compressors",
    paper: "tab:rd, fig:rd",
    trains: false,
    weight: 100,
    run,
};

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let snapshot = &snapshots[0];
    // The largest file, since for few particles the smallest cannot hold one Gaussian.
    let largest = lab.settings.ratios.first().copied().unwrap_or(COMPARED);
    let first = lab.model(snapshot, &ModelSettings::ratio(largest, lab.settings.seed))?;
    let truth = ReferenceViews::new(lab, snapshot, &first.model.metadata)?;
    let beside = beside(lab, snapshot, &truth, &first)?;
    let rows = rows(lab, snapshot, &truth, &lab.settings.ratios)?;
    let compared = lab.settings.ratios.contains(&COMPARED);
    let usual = if compared { Some(usual(lab, snapshot, &first)?) } else { None };
    let (densities, bits) = (densities(lab, snapshot, &rows)?, all_particles_bits(lab, snapshot)?);
    let raw = snapshot.position_bytes() as f64;
    let mut plots = vec![
        picture_plot(lab, &rows, raw, "masked", "masked PSNR, dB", &|s| mean(s, masked)),
        picture_plot(lab, &rows, raw, "psnr", "PSNR, dB", &|s| mean(s, psnr)),
        picture_plot(lab, &rows, raw, "ssim", "SSIM", &|s| mean(s, ssim)),
    ];
    plots[0].levels = levels(beside);
    plots.extend(density_plots(lab, &densities, bits));
    let mut tables =
        vec![pictures(lab, &rows, raw), bounds(lab, &rows, snapshot.unit()), density_table(lab, &densities)];
    if let Some((of_usual, beside_usual)) = &usual {
        tables.insert(0, margins(lab, [&rows, of_usual], raw, [beside, *beside_usual]));
    }
    Ok(ExperimentResults { tables, plots, pictures: Vec::new(), notes: notes(lab, snapshot, &rows, &truth) })
}

/// Every method at the compared ratio, with the same cameras at the default radius and opacity, which most users keep.
fn usual(lab: &Lab<'_>, snapshot: &Snapshot, any: &ModelBuild) -> Result<(Vec<RatePoint>, ReferenceScores)> {
    let (m, s) = (&any.model.metadata, &lab.settings);
    let mut views = evaluation_views(m, s.size, s.seed, s.frames);
    views.iter_mut().for_each(|v| (v.radius, v.opacity) = (m.default_radius, m.default_opacity));
    let truth = ReferenceViews::in_views(lab, snapshot, views)?;
    Ok((rows(lab, snapshot, &truth, &[COMPARED])?, beside(lab, snapshot, &truth, any)?))
}

fn levels(b: ReferenceScores) -> Vec<(String, f64)> {
    let named = [("noise-free", b.noise_free), ("uniform box", b.uniform_box), ("all black", b.all_black)];
    named.into_iter().filter_map(|(name, level)| Some((name.to_string(), level?))).collect()
}

fn notes(lab: &Lab<'_>, snapshot: &Snapshot, rows: &[RatePoint], truth: &ReferenceViews) -> Vec<String> {
    let size = truth.size;
    let mut notes = vec![
        format!(
            "Pictures: {} views of {}x{} on the far, mid and near orbits, with radius and opacity drawn from the \
             published ranges. The truth is all particles as ParaView draws them; the same renderer draws the \
             decoded particles of other compressors. Means are averages of decibels over views. Ratio: bytes of \
             float32 positions over bytes of the whole file.",
            truth.views.len(),
            size.width,
            size.height
        ),
        "`noise-free` is the score of a perfect model, which has every particle but not the sampling noise of one \
         picture; `uniform box` and `all black` contain nothing of the data."
            .into(),
        format!(
            "Pictures of randomised methods, and of models at ratio {COMPARED}, were measured with {} seeds: \
             median, smallest and largest. Density was measured only with the first seed.",
            lab.settings.seeds
        ),
        "Every compressor's bound was verified after decoding in this run, to half a float32 ulp; the table of \
         bounds shows failures. Times of SZ3 and ZFP include the pipe to their Python and, in Morton order, the \
         sort. The bound for every size was found by a search. If a compressor cannot reach a size, its nearest \
         size is used; the density tables omit sizes that differ by more than a tenth."
            .into(),
        "Density: counts in cells, P(k), r(k), groups and cores are measured on the decoded particles, and for a \
         model on as many particles drawn by `count`, which adds the noise of a draw. Held-out bits: a random half \
         of the particles was compressed to as many bytes, and the other half was scored, by a model's own density \
         or by an adaptive kernel to the 16th neighbour of decoded particles. Groups of a subset consist of its own \
         particles, each of which represents many."
            .into(),
    ];
    let sources: Vec<String> = lab.baselines.iter().map(|b| format!("{}: {}", b.name(), b.source())).collect();
    notes.push(format!("Compressors: {}.", sources.join("; ")));
    notes.extend(lab.left_out());
    if lab.settings.training {
        notes.push(format!(
            "`{}`: alpha-blend with VizMapper, trained by the published recipe at a scale of {}, with all schedules \
             in proportion. Files of low ratios have room for more Gaussians than it makes; other files limit their \
             number. Its density follows opacities that were fitted to pictures. At full scale the recipe has more \
             pictures and steps than these runs: see published-run.",
            CompressionMethod::AlphaBlend.name(lab),
            training::scale(lab)
        ));
    }
    notes.extend(snapshot.weights_note());
    notes.extend(identical_note(rows.iter().flat_map(|r| r.pictures(lab))));
    let failed: Vec<String> = rows
        .iter()
        .flat_map(|r| r.runs.iter().filter_map(move |m| Some((r, m.failure.as_ref()?))))
        .map(|(r, why)| format!("{} at ratio {}: {why}", r.method.name(lab), r.ratio))
        .collect();
    if !failed.is_empty() {
        notes.push(format!("Failures: {}.", failed.join("; ")));
    }
    notes
}

/// Difference of our models to each other method at the compared ratio, with drawn and with default radius and opacity.
fn margins(lab: &Lab<'_>, rows: [&[RatePoint]; 2], raw: f64, beside: [ReferenceScores; 2]) -> ResultTable {
    let mut table = ResultTable::new(
        "rate-distortion-margins",
        format!("Masked PSNR at ratio {COMPARED}, and the lead of our models"),
        &[
            "",
            "drawn radius and opacity, dB",
            "lead of ours, dB",
            "default radius and opacity, dB",
            "lead of ours there, dB",
        ],
    );
    let at =
        |side: usize, method: CompressionMethod| rows[side].iter().find(|r| r.method == method && r.ratio == COMPARED);
    let psnr_of = |side: usize, method: CompressionMethod| at(side, method).map(RatePoint::masked).unwrap_or_default();
    let ours =
        [0, 1].map(|side| Spread::new(&psnr_of(side, CompressionMethod::OpticalDepth)).map_or(f64::NAN, |s| s.median));
    let mut row = |name: String, values: [Vec<f64>; 2], missed: bool| {
        let cells = |side: usize| {
            let above: Vec<f64> = values[side].iter().map(|v| ours[side] - v).collect();
            let above = if missed { TableCell::text(NOT_OF_THIS_SIZE) } else { TableCell::spread(&above, 2) };
            [TableCell::decibels(&values[side]), above]
        };
        table.row([TableCell::text(name)].into_iter().chain(cells(0)).chain(cells(1)));
    };
    for method in CompressionMethod::all_and_trained(lab) {
        let missed = at(0, method).is_some_and(|r| r.bytes().is_some() && !r.met(raw));
        row(method.name(lab), [0, 1].map(|side| psnr_of(side, method)), missed);
    }
    let [sampled, usual] = beside.map(levels);
    for (name, level) in sampled {
        let usual_levels = usual.iter().filter(|(n, _)| *n == name).map(|(_, level)| *level).collect();
        row(name, [vec![level], usual_levels], false);
    }
    table
}

fn pictures(lab: &Lab<'_>, rows: &[RatePoint], raw: f64) -> ResultTable {
    ResultTable::new(
        "rate-distortion-pictures",
        "Pictures by file size",
        &[
            "method",
            "target ratio",
            "ratio",
            "bytes",
            "masked PSNR, dB",
            "far, dB",
            "mid, dB",
            "near, dB",
            "PSNR, dB",
            "SSIM",
        ],
    )
    .with(rows.iter().map(|r| {
        let orbit = |o: &'static str| TableCell::decibels(&r.values(&move |s| mean_of(s, o, masked)));
        [
            TableCell::text(r.method.name(lab)),
            TableCell::number(r.ratio, usize::from(r.ratio < 10.0)),
            TableCell::number(r.bytes().map(|b| raw / b), 1),
            TableCell::number(r.bytes(), 0),
            TableCell::decibels(&r.masked()),
            orbit("far"),
            orbit("mid"),
            orbit("near"),
            TableCell::decibels(&r.values(&|s| mean(s, psnr))),
            TableCell::spread(&r.values(&|s| mean(s, ssim)), 4),
        ]
    }))
}

/// Bounds of compressors that have one, once per size.
fn bounds(lab: &Lab<'_>, rows: &[RatePoint], unit: &str) -> ResultTable {
    let (bound, error) = (format!("bound, {unit}"), format!("largest error, {unit}"));
    let mut table = ResultTable::new(
        "rate-distortion-bounds",
        "Bounds, verified after decoding",
        &["method", "target ratio", &bound, &error, "held", "compression, s", "decompression, s"],
    );
    for r in rows.iter().filter(|r| matches!(r.method, CompressionMethod::Baseline { jitter: false, .. })) {
        let Some(run) = r.runs.first() else { continue };
        let (bound, failure) = (run.bound, run.failure.clone());
        table.row([
            TableCell::text(r.method.name(lab)),
            TableCell::number(r.ratio, usize::from(r.ratio < 10.0)),
            TableCell::number(bound.map(|b| b.asked), 5),
            TableCell::number(bound.map(|b| b.largest_error), 5),
            TableCell::text(failure.map_or("yes".into(), |why| format!("no: {why}"))),
            TableCell::number(bound.map(|b| b.seconds[0]), 3),
            TableCell::number(bound.map(|b| b.seconds[1]), 3),
        ]);
    }
    table
}

fn picture_plot(
    lab: &Lab<'_>,
    rows: &[RatePoint],
    raw: f64,
    name: &str,
    label: &str,
    measure: &dyn Fn(&[Score]) -> Option<f64>,
) -> Plot {
    let curve = |method: CompressionMethod| {
        let method_rows = rows.iter().filter(|r| r.method == method);
        series(lab, method, method_rows.filter_map(|r| decibels(raw / r.bytes()?, &r.values(measure))).collect())
    };
    Plot {
        name: format!("rate-distortion-{name}"),
        title: format!("{} of pictures by file size", label.split(',').next().unwrap_or(label)),
        x: PlotAxis::logarithmic(BY_SIZE),
        y: PlotAxis::linear(label),
        series: CompressionMethod::all_and_trained(lab).into_iter().map(curve).collect(),
        levels: Vec::new(),
    }
}

type MethodDensity = (CompressionMethod, f64, DensityMeasures);

/// Uses every ratio if they are few, else every second, since statistics are slow. Files far from the requested size
/// are left out.
fn densities(lab: &Lab<'_>, snapshot: &Snapshot, rows: &[RatePoint]) -> Result<Vec<MethodDensity>> {
    let ratios = &lab.settings.ratios;
    let (step, compared) = (ratios.len().div_ceil(4), ratios.iter().position(|r| *r == COMPARED).unwrap_or(0));
    // The offset makes sure that the compared ratio is among the chosen ones.
    let chosen: Vec<f64> = ratios.iter().copied().skip(compared % step).step_by(step).collect();
    let raw = snapshot.position_bytes() as f64;
    let methods = CompressionMethod::all_and_trained(lab);
    lab.context.begin("densities", (methods.len() * chosen.len()) as u64);
    let mut all = Vec::new();
    for method in methods {
        for &ratio in &chosen {
            let row = rows.iter().find(|r| r.method == method && r.ratio == ratio);
            let met = row.filter(|r| r.met(raw)).and_then(RatePoint::bytes);
            if let Some(reached) = met.map(|bytes| raw / bytes) {
                all.push((method, reached, DensityMeasures::new(lab, snapshot, method, (raw / ratio) as u64)?));
            }
            lab.context.advance(1);
        }
    }
    lab.context.end();
    Ok(all)
}

fn density_table(lab: &Lab<'_>, all: &[MethodDensity]) -> ResultTable {
    ResultTable::new(
        "rate-distortion-density",
        "Density by file size",
        &[
            "method",
            "ratio",
            "held-out bits per particle",
            "correlation in cells",
            "P(k), large scales, mean deviation",
            "P(k), largest deviation",
            "r(k) >= 0.99 to, of k max",
            "groups of 100 or more, found / truth",
            "core mass, found / truth",
        ],
    )
    .with(all.iter().map(|(method, ratio, d)| {
        [
            TableCell::text(method.name(lab)),
            TableCell::number(*ratio, 1),
            TableCell::number(d.held_out_bits, 2),
            TableCell::number(d.correlation, 4),
            TableCell::number(d.large_scales, 4),
            TableCell::number(d.power, 3),
            TableCell::number(d.correlated_to, 2),
            TableCell::number(d.groups, 2),
            TableCell::number(d.cores, 2),
        ]
    }))
}

/// Plots by ratio; `bits` are those of all particles.
fn density_plots(lab: &Lab<'_>, all: &[MethodDensity], bits: f64) -> Vec<Plot> {
    let plot = |name: &str, title: &str, y: PlotAxis, measure: fn(&DensityMeasures) -> Option<f64>| {
        let curve = |method: CompressionMethod| {
            let densities = all.iter().filter(|(m, ..)| *m == method);
            series(lab, method, densities.filter_map(|(_, ratio, d)| Some(Point::new(*ratio, measure(d)?))).collect())
        };
        let x = PlotAxis::logarithmic(BY_SIZE);
        let series =
            CompressionMethod::all_and_trained(lab).into_iter().map(curve).filter(|s| !s.points.is_empty()).collect();
        Plot { name: format!("rate-distortion-{name}"), title: title.into(), x, y, series, levels: Vec::new() }
    };
    let mut held_out = plot(
        "bits",
        "Density at held-out particles, by file size",
        PlotAxis::linear("held-out bits per particle"),
        |d| d.held_out_bits,
    );
    held_out.levels = vec![("all particles".into(), bits), ("uniform box".into(), 0.0)];
    let mut groups = plot(
        "groups",
        "Groups of 100 particles and more, by file size",
        PlotAxis::linear("groups, found / truth"),
        |d| d.groups,
    );
    groups.levels = vec![("truth".into(), 1.0)];
    let large = "mean |P / P truth - 1|, k to a quarter of the largest";
    vec![
        held_out,
        plot("large-scales", "Power spectrum at large scales, by file size", PlotAxis::logarithmic(large), |d| {
            d.large_scales
        }),
        plot("power", "Power spectrum, by file size", PlotAxis::logarithmic("largest |P / P truth - 1|"), |d| d.power),
        groups,
    ]
}

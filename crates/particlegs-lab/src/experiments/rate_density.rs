//! Quality of the density by file size.

use super::shared::rates::{BY_SIZE, COMPARED, RatePoint, series};
use crate::density::DensityMeasures;
use crate::lab::Lab;
use crate::method::CompressionMethod;
use crate::results::{Plot, PlotAxis, Point, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use particlegs_core::Result;

pub(super) type MethodDensity = (CompressionMethod, f64, DensityMeasures);

/// Uses every ratio if they are few, else every second, since statistics are slow. Files far from the requested size
/// are left out.
pub(super) fn densities(lab: &Lab<'_>, snapshot: &Snapshot, rows: &[RatePoint]) -> Result<Vec<MethodDensity>> {
    let ratios = &lab.settings.ratios;
    let (step, compared) = (ratios.len().div_ceil(4), ratios.iter().position(|r| *r == COMPARED).unwrap_or(0));
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

pub(super) fn density_table(lab: &Lab<'_>, all: &[MethodDensity]) -> ResultTable {
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
pub(super) fn density_plots(lab: &Lab<'_>, all: &[MethodDensity], bits: f64) -> Vec<Plot> {
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

//! Masked PSNR by camera distance, for models with different numbers of blocks (paper, figure of block distances).

use super::groups::{ViewGroup, masked, means_over};
use crate::results::{Plot, PlotAxis, PlotSeries, ResultTable, TableCell, decibels};
use crate::views::Score;

/// Distances of the figure, in base distances, far to near.
pub(super) const DISTANCES: [f64; 5] = [1.3, 1.0, 0.7, 0.5, 0.35];

pub(super) fn at_distances() -> Vec<ViewGroup> {
    DISTANCES.map(ViewGroup::orbit).to_vec()
}

/// Models of one kind with their scores.
pub(super) struct ScoreCurve<'a> {
    pub label: String,
    pub scores: &'a [Vec<Score>],
    pub style: usize,
    pub dashed: bool,
}

pub(super) fn plot(name: &str, title: &str, curves: &[ScoreCurve<'_>]) -> Plot {
    let series = curves.iter().map(|c| {
        let point = |d: f64| decibels(d, &means_over(c.scores, &[ViewGroup::orbit(d)], masked));
        let points = DISTANCES.iter().rev().filter_map(|d| point(*d)).collect();
        PlotSeries { name: c.label.clone(), style: c.style, dashed: c.dashed, points }
    });
    Plot {
        name: name.into(),
        title: title.into(),
        x: PlotAxis::linear("distance of the camera, base distances"),
        y: PlotAxis::linear("masked PSNR, dB"),
        series: series.collect(),
        levels: vec![],
    }
}

pub(super) fn table(name: &str, title: &str, curves: &[ScoreCurve<'_>]) -> ResultTable {
    let heads: Vec<String> =
        std::iter::once("masked PSNR, dB, at distance".into()).chain(DISTANCES.iter().map(f64::to_string)).collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let at = |c: &ScoreCurve<'_>, d: f64| TableCell::decibels(&means_over(c.scores, &[ViewGroup::orbit(d)], masked));
    let row = |c: &ScoreCurve<'_>| [vec![TableCell::text(&c.label)], DISTANCES.map(|d| at(c, d)).to_vec()].concat();
    ResultTable::new(name, title, &heads).with(curves.iter().map(row))
}

/// Gain of models over others far (1.0) and near (0.5), median against median, dB.
pub(super) fn gains(others: &[Vec<Score>], models: &[Vec<Score>]) -> Option<[f64; 2]> {
    let median = |all: &[Vec<Score>], d| {
        Some(crate::results::Spread::new(&means_over(all, &[ViewGroup::orbit(d)], masked))?.median)
    };
    let gain = |d| Some(median(models, d)? - median(others, d)?);
    Some([gain(1.0)?, gain(0.5)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scores(far: f64, near: f64) -> Vec<Score> {
        let score = |d: f64, v| Score { view: format!("orbit-{d}_00"), psnr: None, masked: Some(v), ssim: None };
        vec![score(1.0, far), score(0.5, near)]
    }

    #[test]
    fn gains_are_between_medians() {
        let (one, eight) = ([scores(26.0, 25.0), scores(26.2, 25.4)], [scores(27.0, 27.0)]);
        let [far, near] = gains(&one, &eight).unwrap();
        assert!((far - 0.9).abs() < 1e-9 && (near - 1.8).abs() < 1e-9, "{far} {near}");
        let curve = ScoreCurve { label: "1".into(), scores: &one, style: 0, dashed: false };
        let plot = plot("p", "P", &[curve]);
        // Near to far, where there are views.
        assert_eq!(plot.series[0].points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.5, 1.0]);
        assert_eq!(plot.series[0].points[1].range, Some([26.0, 26.2]));
    }
}

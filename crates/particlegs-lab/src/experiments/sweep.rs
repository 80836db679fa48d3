//! Scores of models over the distance, the radius or the opacity of views; and over the distance alone for models with
//! different numbers of blocks (paper, figure of block distances).

use super::groups::{ViewGroup, masked, means_over, psnr, ssim};
use crate::results::{Plot, PlotAxis, PlotSeries, Point, ResultTable, Spread, TableCell, decibels};
use crate::views::Score;

/// One value of the varied parameter.
#[derive(Clone)]
pub(super) struct SweepStep {
    pub at: f64,
    pub group: ViewGroup,
    /// Relation to the published training: trained, between or beyond.
    pub kind: &'static str,
    /// The paper's masked PSNR, dB, and SSIM.
    pub paper: [Option<f64>; 2],
}

/// A varied parameter.
pub(super) struct Sweep {
    /// Name for tables and figures.
    pub name: &'static str,
    /// Parameter with its unit.
    pub what: &'static str,
    /// Value to which changes refer, if any.
    pub base: Option<f64>,
    pub steps: Vec<SweepStep>,
}

/// Models of one kind with their scores.
pub(super) struct SweepModel {
    pub label: String,
    pub style: usize,
    pub scores: Vec<Vec<Score>>,
}

impl Sweep {
    /// Title: the parameter without its unit.
    fn title(&self, suffix: &str) -> String {
        format!("Quality by {}{suffix}", self.what.split(',').next().unwrap_or_default())
    }

    /// One row per value; `suffix` is appended to the title.
    pub fn table(&self, stem: &str, models: &[SweepModel], noise_free: &[Score], suffix: &str) -> ResultTable {
        let mut heads = vec![self.what.to_string(), "published training".into()];
        for m in models {
            let l = &m.label;
            heads.extend(["masked PSNR, dB", "PSNR, dB", "SSIM", "below noise-free, dB"].map(|h| format!("{l}: {h}")));
            heads.extend(self.base.map(|b| format!("{l}: change from {b}, dB")));
        }
        heads.extend(["noise-free: masked PSNR, dB".into(), "paper: masked PSNR, dB".into()]);
        heads.push(self.base.map_or("paper: SSIM".into(), |b| format!("paper: change from {b}, dB")));
        let title = self.title(suffix);
        let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
        let mut table = ResultTable::new(&format!("{stem}-{}", self.name), title, &heads);
        let noise_free = [noise_free.to_vec()];
        for step in &self.steps {
            let limit = median(&noise_free, &step.group);
            let mut row = vec![TableCell::number(step.at, 2), TableCell::text(step.kind)];
            for m in models {
                let score = median(&m.scores, &step.group);
                row.extend(cells(&m.scores, &step.group));
                row.push(TableCell::number(limit.zip(score).map(|(l, o)| l - o), 2));
                row.extend(self.base.map(|_| TableCell::number(self.fall(&m.scores, step.at), 2)));
            }
            row.extend([TableCell::number(limit, 2), TableCell::number(step.paper[0], 2)]);
            row.push(match self.base {
                Some(_) => TableCell::number(self.paper_fall(step.at), 2),
                None => TableCell::number(step.paper[1], 3),
            });
            table.row(row);
        }
        table
    }

    /// Curves of the models, the noise-free picture and the paper.
    pub fn plot(&self, stem: &str, models: &[SweepModel], noise_free: &[Score], suffix: &str) -> Plot {
        let points = |value: &dyn Fn(&SweepStep) -> Option<Point>| {
            let mut all: Vec<Point> = self.steps.iter().filter_map(value).collect();
            all.sort_by(|a, b| a.x.total_cmp(&b.x));
            all
        };
        let measured = |scores: &[Vec<Score>]| {
            points(&|s| decibels(s.at, &means_over(scores, std::slice::from_ref(&s.group), masked)))
        };
        let mut series: Vec<PlotSeries> = models
            .iter()
            .map(|m| PlotSeries { name: m.label.clone(), style: m.style, dashed: false, points: measured(&m.scores) })
            .collect();
        let noise_free = measured(&[noise_free.to_vec()]);
        series.push(PlotSeries { name: "noise-free picture".into(), style: 8, dashed: true, points: noise_free });
        let theirs = points(&|s| Some(Point::new(s.at, s.paper[0]?)));
        series.push(PlotSeries { name: "paper (HACC, 1080p)".into(), style: 7, dashed: true, points: theirs });
        Plot {
            name: format!("{stem}-{}", self.name),
            title: self.title(suffix),
            x: PlotAxis::linear(self.what),
            y: PlotAxis::linear("masked PSNR, dB"),
            series,
            levels: vec![],
        }
    }

    /// Masked PSNR at a value minus that at the base, median against median, dB; `None` without a base or at it.
    pub fn fall(&self, scores: &[Vec<Score>], at: f64) -> Option<f64> {
        let base = self.base.filter(|b| *b != at)?;
        Some(median(scores, &self.step(at)?.group)? - median(scores, &self.step(base)?.group)?)
    }

    /// The paper's change.
    pub fn paper_fall(&self, at: f64) -> Option<f64> {
        let base = self.base.filter(|b| *b != at)?;
        Some(self.step(at)?.paper[0]? - self.step(base)?.paper[0]?)
    }

    fn step(&self, at: f64) -> Option<&SweepStep> {
        self.steps.iter().find(|s| s.at == at)
    }
}

fn cells(scores: &[Vec<Score>], group: &ViewGroup) -> [TableCell; 3] {
    let groups = std::slice::from_ref(group);
    let means = |pick| means_over(scores, groups, pick);
    [TableCell::decibels(&means(masked)), TableCell::decibels(&means(psnr)), TableCell::spread(&means(ssim), 4)]
}

/// Masked PSNR at a step, median over models.
fn median(scores: &[Vec<Score>], group: &ViewGroup) -> Option<f64> {
    Some(Spread::new(&means_over(scores, std::slice::from_ref(group), masked))?.median)
}

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
    let median = |all: &[Vec<Score>], d| Some(Spread::new(&means_over(all, &[ViewGroup::orbit(d)], masked))?.median);
    let gain = |d| Some(median(models, d)? - median(others, d)?);
    Some([gain(1.0)?, gain(0.5)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep() -> Sweep {
        let step =
            |at: f64, paper| SweepStep { at, group: ViewGroup::radius(at), kind: "trained", paper: [paper, None] };
        let steps = vec![step(1.0, Some(26.0)), step(0.5, None), step(2.5, Some(20.5))];
        Sweep { name: "radius", what: "radius", base: Some(1.0), steps }
    }

    fn scores(values: [f64; 3]) -> Vec<Score> {
        let names = ["radius-1_00", "radius-0.5_00", "radius-2.5_00"];
        let one = |(n, v): (&str, f64)| Score { view: n.into(), psnr: Some(v), masked: Some(v), ssim: Some(0.5) };
        names.into_iter().zip(values).map(one).collect()
    }

    #[test]
    fn changes_are_from_the_base_and_separate_from_noise() {
        let (sweep, limit) = (sweep(), scores([33.0, 34.0, 32.0]));
        let model = SweepModel { label: "m".into(), style: 0, scores: vec![scores([30.0, 33.0, 24.0])] };
        assert_eq!(sweep.fall(&model.scores, 2.5), Some(-6.0));
        assert_eq!((sweep.fall(&model.scores, 1.0), sweep.paper_fall(2.5)), (None, Some(-5.5)));
        assert_eq!(sweep.paper_fall(0.5), None);
        let table = sweep.table("t", &[model], &limit, "");
        let words: Vec<String> = table.rows[2].iter().map(TableCell::describe).collect();
        assert_eq!(words, ["2.50", "trained", "24.00", "24.00", "0.5000", "8.00", "-6.00", "32.00", "20.50", "-5.50"]);
        assert!(table.rows.iter().all(|r| r.len() == table.columns.len()));
        let heads: std::collections::HashSet<&String> = table.columns.iter().collect();
        assert_eq!(heads.len(), table.columns.len());
    }

    #[test]
    fn curves_rise_along_their_axis() {
        let model = SweepModel { label: "m".into(), style: 0, scores: vec![scores([30.0, 33.0, 24.0])] };
        let plot = sweep().plot("t", &[model], &scores([1.0, 2.0, 3.0]), "");
        let at = |k: usize| plot.series[k].points.iter().map(|p| p.x).collect::<Vec<_>>();
        assert_eq!((at(0), at(2)), (vec![0.5, 1.0, 2.5], vec![1.0, 2.5]));
    }

    fn far_and_near(far: f64, near: f64) -> Vec<Score> {
        let score = |d: f64, v| Score { view: format!("orbit-{d}_00"), psnr: None, masked: Some(v), ssim: None };
        vec![score(1.0, far), score(0.5, near)]
    }

    #[test]
    fn gains_are_between_medians() {
        let (one, eight) = ([far_and_near(26.0, 25.0), far_and_near(26.2, 25.4)], [far_and_near(27.0, 27.0)]);
        let [far, near] = gains(&one, &eight).unwrap();
        assert!((far - 0.9).abs() < 1e-9 && (near - 1.8).abs() < 1e-9, "{far} {near}");
        let curve = ScoreCurve { label: "1".into(), scores: &one, style: 0, dashed: false };
        let plot = plot("p", "P", &[curve]);
        // Near to far, where there are views.
        assert_eq!(plot.series[0].points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.5, 1.0]);
        assert_eq!(plot.series[0].points[1].range, Some([26.0, 26.2]));
    }
}

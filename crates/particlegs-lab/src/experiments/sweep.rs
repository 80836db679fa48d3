//! Scores of models over the distance, the radius or the opacity of views.

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
}

//! Plots as data: axes, curves with bars, named levels and bands.

use serde::Serialize;

/// Are these the decibels of nothing but pictures that do not differ from the truth?
pub fn is_identical(values: &[f64]) -> bool {
    !values.is_empty() && values.iter().all(|v| *v == f64::INFINITY)
}

/// The median of some values, and how far they lie apart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Of an even number the mean of the two in the middle.
    pub median: f64,
    pub low: f64,
    pub high: f64,
}

impl Spread {
    /// Of values; `None` where there is none that is finite.
    pub fn new(values: &[f64]) -> Option<Spread> {
        let mut v: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        v.sort_by(f64::total_cmp);
        let (first, last) = (*v.first()?, *v.last()?);
        let median = 0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2]);
        Some(Spread { median, low: first, high: last })
    }
}

/// One pair of axes with curves.
#[derive(Clone, Debug, Serialize)]
pub struct Plot {
    /// File name without its ending.
    pub name: String,
    /// What stands above it.
    pub title: String,
    pub x: PlotAxis,
    pub y: PlotAxis,
    pub series: Vec<Series>,
    /// Horizontal lines with their names; those without a name are not in the legend, and neither are such curves.
    pub levels: Vec<(String, f64)>,
}

/// An axis of a plot.
#[derive(Clone, Debug, Serialize)]
pub struct PlotAxis {
    /// What it shows, with its unit.
    pub label: String,
    pub log: bool,
    /// Ends; `None` = as the values have it.
    pub range: Option<[f64; 2]>,
    /// Shaded bands across the plot from one value to another, with their names: the wider before the narrower.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<(String, [f64; 2])>,
    /// What stands at 1, 2, ... where the axis has no values but things without an order: points are not joined then.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
}

impl PlotAxis {
    pub fn linear(label: impl Into<String>) -> PlotAxis {
        PlotAxis { label: label.into(), log: false, range: None, bands: vec![], names: vec![] }
    }

    /// In equal factors.
    pub fn logarithmic(label: impl Into<String>) -> PlotAxis {
        PlotAxis { log: true, ..PlotAxis::linear(label) }
    }

    /// Of ratios, in bands of 5 % and 10 % about 1.
    pub fn ratios(label: impl Into<String>, range: [f64; 2]) -> PlotAxis {
        let bands = vec![("within 10 %".into(), [0.9, 1.1]), ("within 5 %".into(), [0.95, 1.05])];
        PlotAxis { range: Some(range), bands, ..PlotAxis::linear(label) }
    }

    /// Of things without an order.
    pub fn named(label: impl Into<String>, names: Vec<String>) -> PlotAxis {
        let range = Some([0.5, names.len() as f64 + 0.5]);
        PlotAxis { range, names, ..PlotAxis::linear(label) }
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Colour and mark: what is the same thing in several plots has the same.
    pub style: usize,
    pub dashed: bool,
    /// Points in order.
    pub points: Vec<Point>,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    /// Place along the horizontal axis.
    pub x: f64,
    /// Value; infinite decibels are those of a picture that does not differ from the truth.
    pub y: f64,
    /// Smallest and largest value, where there are several.
    pub range: Option<[f64; 2]>,
}

impl Point {
    pub fn new(x: f64, y: f64) -> Point {
        Point { x, y, range: None }
    }

    /// Of values of several seeds; `None` without one.
    pub fn spread(x: f64, values: &[f64]) -> Option<Point> {
        let s = Spread::new(values)?;
        Some(Point { x, y: s.median, range: (values.len() > 1).then_some([s.low, s.high]) })
    }

    /// Of decibels of several seeds; infinite where no picture of any differs from the truth.
    pub fn decibels(x: f64, values: &[f64]) -> Option<Point> {
        if is_identical(values) { Some(Point::new(x, f64::INFINITY)) } else { Point::spread(x, values) }
    }
}

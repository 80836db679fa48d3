//! Plots as data: axes, curves with bars, named levels and bands.

use serde::Serialize;

/// One pair of axes with curves.
#[derive(Clone, Debug, Serialize)]
pub struct Plot {
    /// File name without its ending.
    pub name: String,
    /// The text above it.
    pub title: String,
    pub x: PlotAxis,
    pub y: PlotAxis,
    pub series: Vec<PlotSeries>,
    /// Horizontal lines with their names; those without a name are not in the legend, and neither are such curves.
    pub levels: Vec<(String, f64)>,
}

/// An axis of a plot.
#[derive(Clone, Debug, Serialize)]
pub struct PlotAxis {
    /// The quantity that it shows, with its unit.
    pub label: String,
    pub log: bool,
    /// Ends; `None` = as the values have it.
    pub range: Option<[f64; 2]>,
    /// Shaded bands across the plot from one value to another, with their names: the wider before the narrower.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bands: Vec<(String, [f64; 2])>,
    /// Names at 1, 2, ... if the axis has no values but things without an order: points are not joined then.
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
}

#[derive(Clone, Debug, Serialize)]
pub struct PlotSeries {
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
}

//! How results are shown: tables as CSV, plots, and lines of text. Each measure has a [`Presentation`] beside what it
//! computes.

use super::Statistics;
use particlegs_core::Result;
use particlegs_core::model::per_length;
use particlegs_core::text::one_line;
use particlegs_figure::{FileKind, Plot, PlotAxis, Point, Series, write_plots};
use particlegs_files::output::write_bytes;
use std::path::Path;

/// What a measure shows of its results; nothing where they are not among the statistics.
pub(super) struct Presentation {
    /// Writes tables into a folder.
    pub tables: fn(&Statistics, &Path) -> Result<()>,
    pub plots: fn(&Statistics, &PlotFolder<'_>) -> Result<()>,
    pub lines: fn(&Statistics, &mut SummaryLines),
}

impl Presentation {
    pub const NONE: Presentation = Presentation { tables: |_, _| Ok(()), plots: |_, _| Ok(()), lines: |_, _| {} };
}

/// A table as CSV.
pub(super) struct Csv(pub String);

impl Csv {
    pub fn new(head: &str) -> Self {
        Csv(format!("{head}\n"))
    }

    pub fn write(&self, folder: &Path, name: &str) -> Result<()> {
        write_bytes(&folder.join(name), self.0.as_bytes())
    }
}

macro_rules! row {
    ($csv:ident: $($value:expr),*) => {
        $csv.0 += &([$($value.to_string()),*].join(",") + "\n")
    };
}
pub(super) use row;

/// A cell of a table: nothing where there is no value.
pub(super) fn maybe(v: Option<impl ToString>) -> String {
    v.map_or(String::new(), |v| v.to_string())
}

/// Lines of text, each a name and a value.
pub(super) struct SummaryLines {
    /// The unit behind a length and a wave number, if it is known.
    pub length: String,
    pub wave: String,
    text: String,
}

impl SummaryLines {
    pub fn new(first: String, unit: Option<&str>) -> Self {
        let unit = unit.map(one_line);
        let after = |of: fn(&str) -> String| unit.as_deref().map_or(String::new(), |u| format!(" {}", of(u)));
        SummaryLines { length: after(str::to_string), wave: after(per_length), text: first }
    }

    pub fn add(&mut self, name: &str, value: String) {
        self.text += &format!("\n{name:<36} {value}");
    }

    pub fn text(self) -> String {
        self.text
    }
}

/// Units of length in brackets, behind the names of axes, if they are known.
pub(super) struct AxisUnits {
    pub length: String,
    pub wave: String,
    pub volume: String,
}

impl AxisUnits {
    pub fn new(unit: Option<&str>) -> Self {
        let brackets = |of: fn(&str) -> String| unit.map_or(String::new(), |u| format!(" [{}]", of(u)));
        let cubed = |u: &str| if u.contains(['/', ' ']) { format!("({u})³") } else { format!("{u}³") };
        AxisUnits { length: brackets(str::to_string), wave: brackets(per_length), volume: brackets(cubed) }
    }
}

/// Where plots are written, and in which formats.
pub(super) struct PlotFolder<'a> {
    pub folder: &'a Path,
    pub kinds: &'a [FileKind],
    pub units: AxisUnits,
}

impl PlotFolder<'_> {
    /// Writes plots below one another, in every format.
    pub fn write(&self, figures: impl IntoIterator<Item = ChartParts>) -> Result<()> {
        figures.into_iter().try_for_each(|figure| write_plots(self.folder, &figure, self.kinds))
    }
}

/// Styles of the curves of both sides, and of a third.
pub(super) const TRUTH: usize = 8;
pub(super) const OTHER: usize = 1;
pub(super) const THIRD: usize = 0;

/// A plot, and below it the ratio of its curves, if any.
pub(super) type ChartParts = Vec<Plot>;
pub(super) type Points = Vec<(f64, f64)>;

pub(super) fn curve(name: &str, style: usize, dashed: bool, points: Points) -> Series {
    let points = points.into_iter().filter(|p| p.1.is_finite()).map(|(x, y)| Point::new(x, y)).collect();
    Series { name: name.into(), style, dashed, points }
}

pub(super) fn log(label: impl Into<String>) -> PlotAxis {
    PlotAxis::logarithmic(label)
}

pub(super) fn even(label: impl Into<String>) -> PlotAxis {
    PlotAxis::linear(label)
}

pub(super) fn pair([a, b]: [Points; 2]) -> Vec<Series> {
    vec![curve("truth", TRUTH, false, a), curve("other", OTHER, false, b)]
}

pub(super) fn chart(
    name: &str,
    title: &str,
    axes: [PlotAxis; 2],
    mut series: Vec<Series>,
    ratio: Points,
) -> ChartParts {
    let [x, y] = axes;
    // Lines skip values that a logarithmic axis cannot show.
    series.iter_mut().for_each(|s| s.points.retain(|p| !y.log || p.y > 0.0));
    let below = (!ratio.is_empty()).then(|| ratio_plot(&x, ratio));
    let plot = Plot { name: name.into(), title: title.into(), x, y, series, levels: Vec::new() };
    [plot].into_iter().chain(below).collect()
}

/// Values of both sides at the same places, and their ratio if the truth's is above `least`.
pub(super) fn compared(
    name: &str,
    title: &str,
    axes: [PlotAxis; 2],
    rows: &[(f64, [f64; 2])],
    least: f64,
) -> ChartParts {
    let side = |k: usize| rows.iter().map(|(at, values)| (*at, values[k])).collect();
    let known = rows.iter().filter(|(_, [truth, _])| *truth > least);
    chart(name, title, axes, pair([side(0), side(1)]), known.map(|(at, [truth, other])| (*at, other / truth)).collect())
}

/// other / truth, from 0.85 to 1.15 or as far as it goes within 0 to 2, in bands of 5 % and 10 %.
fn ratio_plot(x: &PlotAxis, mut ratio: Points) -> Plot {
    ratio.retain(|p| p.1.is_finite());
    let reach = (1.15 * ratio.iter().map(|p| (p.1 - 1.0).abs()).fold(0.0, f64::max)).clamp(0.15, 1.0);
    ratio.iter_mut().for_each(|p| p.1 = p.1.clamp(1.0 - reach, 1.0 + reach));
    Plot {
        name: String::new(),
        title: String::new(),
        x: x.clone(),
        y: PlotAxis::ratios("other / truth", [1.0 - reach, 1.0 + reach]),
        series: vec![curve("", OTHER, false, ratio)],
        levels: vec![(String::new(), 1.0)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_volume_are_cubes() {
        assert_eq!(["Mpc/h", "kpc"].map(|u| AxisUnits::new(Some(u)).volume), [" [(Mpc/h)³]", " [kpc³]"]);
        assert_eq!(AxisUnits::new(None).volume, "");
    }
}

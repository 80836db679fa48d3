//! Presentation of results: tables as CSV, plots, and lines of text. Each measure adds its own to a [`Presentation`],
//! by `show` in its module; a [`StatsReport`] writes all of a comparison.

use super::compare::show;
use super::{Statistics, StatsOptions, StatsSide, compare};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::per_length;
use particlegs_core::picture::{Rgb8, Size};
use particlegs_core::text::one_line;
use particlegs_figure::png_file::PngMetadata;
use particlegs_figure::{
    Figure, FigureImage, FigureSpace, FileKind, Plot, PlotAxis, PlotSeries, Point, layout, raster, write_plots,
};
use particlegs_files::output::{Outputs, write_bytes, write_json};
use particlegs_files::png::write_png;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Font size of figures, pixels; on a page, points, and its width.
const LETTERS: f64 = 16.0;
const POINTS: f64 = 9.0;
const PAGE: f64 = 500.0;

/// Statistics of two inputs, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatsReport {
    /// The truth's name.
    pub truth: String,
    /// The other's name.
    pub other: String,
    /// Unit of length of the truth, as text.
    pub length_unit: Option<String>,
    /// Version of the program.
    pub tool_version: &'static str,
    /// The statistics.
    #[serde(flatten)]
    pub statistics: Statistics,
}

impl StatsReport {
    /// Compares `other` with `truth`, each with its name, as [`compare`] does. Notes also go to the context.
    ///
    /// # Errors
    /// Those of [`compare`].
    pub fn new(
        truth: (StatsSide<'_>, &str),
        other: (StatsSide<'_>, &str),
        options: &StatsOptions,
        context: &Context<'_>,
    ) -> Result<StatsReport> {
        let statistics = compare(truth.0, other.0, options, context)?;
        statistics.notes.iter().for_each(|note| context.note(note));
        Ok(StatsReport {
            truth: truth.1.into(),
            other: other.1.into(),
            length_unit: truth.0.subject.unit_system().units.length_text().map(String::from),
            tool_version: env!("CARGO_PKG_VERSION"),
            statistics,
        })
    }

    /// Writes `stats.json`, a CSV table of each measure, pictures of the density, and plots of each kind into a folder,
    /// all or none. Lengths are in the unit of length.
    ///
    /// # Errors
    /// [`particlegs_core::Error::Output`] for a file that is there and was not made by this function;
    /// [`particlegs_core::Error::Io`].
    pub fn write(
        &self,
        folder: &Path,
        plots: &[FileKind],
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<Vec<PathBuf>> {
        let fill = |folder: &Path| {
            self.presentation().write(folder, plots)?;
            write_json(&folder.join("stats.json"), self)
        };
        outputs.write_set(folder, fill, context)
    }

    /// The most important figures, a line each.
    pub fn text(&self) -> String {
        self.presentation().text
    }

    fn presentation(&self) -> Presentation {
        let s = &self.statistics;
        let side =
            |side: usize| format!("{}{} particles", if s.model[side] { "model of " } else { "" }, s.particles[side]);
        let first = format!("truth {}, other {}", side(0), side(1));
        let mut presentation = Presentation::new(self.length_unit.as_deref(), first);
        show(s, &mut presentation);
        presentation
    }
}

/// Tables, plots and text of statistics; each measure adds its own, where it was taken.
pub(crate) struct Presentation {
    pub units: AxisUnits,
    /// The unit behind a length and a wave number in the text, if it is known.
    pub length: String,
    pub wave: String,
    /// Tables as CSV, by the names of their files.
    tables: Vec<(&'static str, String)>,
    plots: Vec<ChartParts>,
    /// Figures across an axis, as PNG alone.
    pub slices: Vec<(&'static str, Figure)>,
    pub figures: Vec<(&'static str, Figure)>,
    pub text: String,
}

impl Presentation {
    /// Lengths have this unit; the text begins with `first`.
    pub fn new(unit: Option<&str>, first: String) -> Self {
        let line = unit.map(one_line);
        let after = |text_of: fn(&str) -> String| line.as_deref().map_or(String::new(), |u| format!(" {}", text_of(u)));
        let (length, wave, units) = (after(str::to_string), after(per_length), AxisUnits::new(unit));
        let (tables, plots, slices, figures) = Default::default();
        Presentation { units, length, wave, tables, plots, slices, figures, text: first }
    }

    pub fn table(&mut self, name: &'static str, head: &str, rows: impl IntoIterator<Item = String>) {
        let lines = rows.into_iter().map(|row| row + "\n");
        self.tables.push((name, [format!("{head}\n")].into_iter().chain(lines).collect()));
    }

    pub fn plot(&mut self, parts: ChartParts) {
        self.plots.push(parts);
    }

    pub fn line(&mut self, name: &str, value: String) {
        self.text += &format!("\n{name:<36} {value}");
    }

    /// A line of shares of the truth, where there are any.
    pub fn median(&mut self, name: &str, median: Option<f64>, quartiles: Option<[f64; 2]>) {
        if let Some((median, [low, high])) = median.zip(quartiles) {
            self.line(name, format!("{median:.3} of the truth (median; quartiles {low:.3} and {high:.3})"));
        }
    }

    /// Writes the tables; where kinds of plots are wanted, these and the figures.
    pub fn write(&self, folder: &Path, kinds: &[FileKind]) -> Result<()> {
        self.tables.iter().try_for_each(|(name, csv)| write_bytes(&folder.join(name), csv.as_bytes()))?;
        if kinds.is_empty() {
            return Ok(());
        }
        self.plots.iter().try_for_each(|parts| write_plots(folder, parts, kinds))?;
        for (name, figure) in &self.slices {
            let picture = raster(&layout(figure, LETTERS, FigureSpace::Pixels)?)?;
            write_png(&folder.join(format!("slice_{name}.png")), picture.size, picture.data.as_flattened())?;
        }
        for ((name, figure), kind) in self.figures.iter().flat_map(|f| kinds.iter().map(move |kind| (f, kind))) {
            let (em, space) = match kind {
                FileKind::Png => (LETTERS, FigureSpace::Pixels),
                _ => (POINTS, FigureSpace::Width(PAGE)),
            };
            let bytes = layout(figure, em, space)?.bytes(*kind, &PngMetadata::default())?;
            write_bytes(&folder.join(format!("{name}.{}", kind.name())), &bytes)?;
        }
        Ok(())
    }
}

/// A row of a table.
macro_rules! row {
    ($($value:expr),*) => {
        [$($value.to_string()),*].join(",")
    };
}
pub(crate) use row;

/// A cell of a table: nothing where there is no value.
pub(crate) fn maybe(v: Option<impl ToString>) -> String {
    v.map_or(String::new(), |v| v.to_string())
}

/// Units of length in brackets, behind the names of axes, if they are known.
pub(crate) struct AxisUnits {
    pub length: String,
    pub wave: String,
    pub volume: String,
}

impl AxisUnits {
    pub fn new(unit: Option<&str>) -> Self {
        let brackets = |text_of: fn(&str) -> String| unit.map_or(String::new(), |u| format!(" [{}]", text_of(u)));
        let cubed = |u: &str| if u.contains(['/', ' ']) { format!("({u})³") } else { format!("{u}³") };
        AxisUnits { length: brackets(str::to_string), wave: brackets(per_length), volume: brackets(cubed) }
    }
}

/// Styles of the curves of both sides, and of a third.
pub(crate) const TRUTH: usize = 8;
pub(crate) const OTHER: usize = 1;
pub(crate) const THIRD: usize = 0;

/// A plot, and below it the ratio of its curves, if any.
pub(crate) type ChartParts = Vec<Plot>;
pub(crate) type Points = Vec<(f64, f64)>;

pub(crate) fn curve(name: &str, style: usize, dashed: bool, points: Points) -> PlotSeries {
    let points = points.into_iter().filter(|p| p.1.is_finite()).map(|(x, y)| Point::new(x, y)).collect();
    PlotSeries { name: name.into(), style, dashed, points }
}

pub(crate) fn log(label: impl Into<String>) -> PlotAxis {
    PlotAxis::logarithmic(label)
}

pub(crate) fn even(label: impl Into<String>) -> PlotAxis {
    PlotAxis::linear(label)
}

pub(crate) fn pair([a, b]: [Points; 2]) -> Vec<PlotSeries> {
    vec![curve("truth", TRUTH, false, a), curve("other", OTHER, false, b)]
}

pub(crate) fn chart(
    name: &str,
    title: &str,
    axes: [PlotAxis; 2],
    mut series: Vec<PlotSeries>,
    ratio: Points,
) -> ChartParts {
    let [x, y] = axes;
    // Lines skip values that a logarithmic axis cannot show.
    series.iter_mut().for_each(|s| s.points.retain(|p| !y.log || p.y > 0.0));
    let below = (!ratio.is_empty()).then(|| ratio_plot(&x, ratio));
    let plot = Plot { name: name.into(), title: title.into(), x, y, series, levels: Vec::new() };
    [plot].into_iter().chain(below.into_iter().flatten()).collect()
}

/// Values of both sides at the same places, and their ratio if the truth's is above `least`.
pub(crate) fn compared(
    name: &str,
    title: &str,
    axes: [PlotAxis; 2],
    rows: &[(f64, [f64; 2])],
    least: f64,
) -> ChartParts {
    let side = |k: usize| rows.iter().map(|(at, values)| (*at, values[k])).collect();
    let known_rows = rows.iter().filter(|(_, [truth, _])| *truth > least);
    chart(
        name,
        title,
        axes,
        pair([side(0), side(1)]),
        known_rows.map(|(at, [truth, other])| (*at, other / truth)).collect(),
    )
}

/// other / truth, from 0.85 to 1.15 or as far as it goes within 0 to 2, in bands of 5 % and 10 %.
fn ratio_plot(x: &PlotAxis, mut ratio: Points) -> ChartParts {
    ratio.retain(|p| p.1.is_finite());
    let reach = (1.15 * ratio.iter().map(|p| (p.1 - 1.0).abs()).fold(0.0, f64::max)).clamp(0.15, 1.0);
    // A ratio beyond the axis would be a gap: it stands at the edge.
    ratio.iter_mut().for_each(|p| p.1 = p.1.clamp(1.0 - reach, 1.0 + reach));
    let axes = [x.clone(), PlotAxis::ratios("other / truth", [1.0 - reach, 1.0 + reach])];
    let mut parts = chart("", "", axes, vec![curve("", OTHER, false, ratio)], Vec::new());
    parts[0].levels = vec![(String::new(), 1.0)];
    parts
}

/// A picture of values on a grid, the first axis across and slowest, each a square of pixels of `scale` pixels.
pub(crate) fn block_picture<T: Copy>(
    values: &[T],
    [columns, rows]: [usize; 2],
    scale: usize,
    color: impl Fn(T) -> [u8; 3],
) -> FigureImage {
    let size = Size { width: columns * scale, height: rows * scale };
    let pixel = |at: usize| {
        // Pictures begin at the top, and axes at the bottom.
        let (across, up) = (at % size.width / scale, rows - 1 - at / size.width / scale);
        color(values[across * rows + up])
    };
    FigureImage::Color(Rgb8 { size, data: (0..size.pixels()).map(pixel).collect() })
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

//! Results of an experiment as plain data: tables, plots, pictures and notes.

use particlegs_core::picture::{Colormap, Rgb8};
pub use particlegs_figure::{Plot, PlotAxis, PlotSeries, Point};
use serde::{Deserialize, Serialize};

/// Whether these are the decibels of nothing but pictures that do not differ from the truth.
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

/// A point of values of several seeds; `None` without one.
pub fn spread(x: f64, values: &[f64]) -> Option<Point> {
    let s = Spread::new(values)?;
    Some(Point { x, y: s.median, range: (values.len() > 1).then_some([s.low, s.high]) })
}

/// A point of decibels of several seeds; infinite where no picture of any differs from the truth.
pub fn decibels(x: f64, values: &[f64]) -> Option<Point> {
    if is_identical(values) { Some(Point::new(x, f64::INFINITY)) } else { spread(x, values) }
}

#[derive(Debug, Default, Serialize)]
pub struct ExperimentResults {
    /// Tables, in the order of reading.
    pub tables: Vec<ResultTable>,
    pub plots: Vec<Plot>,
    pub pictures: Vec<Pictures>,
    /// Notes on the measurements, and on what was left out and why.
    pub notes: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
pub struct ResultTable {
    /// File name without its ending.
    pub name: String,
    pub title: String,
    /// Headers of the columns, with units.
    pub columns: Vec<String>,
    /// Rows, as long as `columns`.
    pub rows: Vec<Vec<TableCell>>,
}

impl ResultTable {
    pub fn new(name: &str, title: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| (*c).to_string()).collect();
        ResultTable { name: name.into(), title: title.into(), columns, rows: Vec::new() }
    }

    pub fn with<R: IntoIterator<Item = TableCell>>(mut self, rows: impl IntoIterator<Item = R>) -> Self {
        rows.into_iter().for_each(|cells| self.row(cells));
        self
    }

    pub fn row(&mut self, cells: impl IntoIterator<Item = TableCell>) {
        let row: Vec<TableCell> = cells.into_iter().collect();
        debug_assert_eq!(row.len(), self.columns.len(), "{}", self.name);
        self.rows.push(row);
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum TableCell {
    Text(String),
    /// Median of several values, with their range.
    Spread {
        value: f64,
        /// Smallest and largest.
        range: [f64; 2],
        /// Digits after the point.
        digits: usize,
    },
    Number {
        value: f64,
        /// Digits after the point.
        digits: usize,
    },
    Empty,
}

impl TableCell {
    pub fn text(words: impl Into<String>) -> TableCell {
        TableCell::Text(words.into())
    }

    pub fn number(value: impl Into<Option<f64>>, digits: usize) -> TableCell {
        value.into().filter(|v| v.is_finite()).map_or(TableCell::Empty, |value| TableCell::Number { value, digits })
    }

    pub fn count(value: u64) -> TableCell {
        TableCell::number(value as f64, 0)
    }

    /// Median and range over seeds; a single value is a number. Values that are not finite are left out.
    pub fn spread(values: &[f64], digits: usize) -> TableCell {
        match Spread::new(values) {
            None => TableCell::Empty,
            Some(s) if values.len() == 1 => TableCell::number(s.median, digits),
            Some(s) => TableCell::Spread { value: s.median, range: [s.low, s.high], digits },
        }
    }

    /// Decibels over seeds; `identical` if no picture of any seed differs from the truth.
    pub fn decibels(values: &[f64]) -> TableCell {
        match is_identical(values) {
            true => TableCell::text("identical"),
            false => TableCell::spread(values, 2),
        }
    }

    /// Text for a table.
    pub fn describe(&self) -> String {
        match self {
            TableCell::Text(words) => words.clone(),
            TableCell::Number { value, digits } => grouped(*value, *digits),
            TableCell::Spread { value, range: [low, high], digits } => {
                let [value, low, high] = [value, low, high].map(|v| grouped(*v, *digits));
                // The range vanishes at this precision.
                if low == high { value } else { format!("{value} ({low} to {high})") }
            }
            TableCell::Empty => "–".into(),
        }
    }

    /// Text for a CSV file: every digit; empty if nothing was measured.
    pub fn plain(&self) -> String {
        match self {
            TableCell::Text(words) => words.clone(),
            TableCell::Number { value, .. } | TableCell::Spread { value, .. } => value.to_string(),
            TableCell::Empty => String::new(),
        }
    }

    pub fn is_number(&self) -> bool {
        matches!(self, TableCell::Number { .. } | TableCell::Spread { .. })
    }
}

/// Whole numbers of five digits or more, in groups of three.
pub(crate) fn grouped(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    // No sign for numbers that round to zero.
    let text = if text.contains(|c: char| ('1'..='9').contains(&c)) { text } else { text.replace('-', "") };
    let (whole, rest) = text.split_at(text.find('.').unwrap_or(text.len()));
    let (sign, whole) = whole.strip_prefix('-').map_or(("", whole), |w| ("-", w));
    if whole.len() < 5 {
        return text;
    }
    let digits: Vec<&str> =
        (0..whole.len()).rev().step_by(3).map(|end| &whole[(end + 1).saturating_sub(3)..=end]).collect();
    format!("{sign}{}{rest}", digits.into_iter().rev().collect::<Vec<_>>().join(","))
}

/// Logarithmic colour scale.
#[derive(Clone, Debug)]
pub struct Colours {
    /// The quantity, with its unit.
    pub title: String,
    pub map: Colormap,
    /// Lowest and highest value.
    pub range: [f64; 2],
}

/// Pictures of one size side by side.
#[derive(Debug, Serialize)]
pub struct Pictures {
    /// File name without its ending.
    pub name: String,
    /// Title.
    pub title: String,
    /// Caption that explains the pictures on its own.
    pub caption: String,
    /// Pictures per row.
    pub columns: usize,
    /// Colour scale, if they are not grey.
    #[serde(skip)]
    pub colours: Option<Colours>,
    /// Pictures with their labels.
    #[serde(skip)]
    pub panels: Vec<(String, Rgb8)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_spreads_shown() {
        let said = [0.0, 1234.0, 12345.0, -1_234_567.0].map(|v| TableCell::number(v, 0).describe());
        assert_eq!(said, ["0", "1234", "12,345", "-1,234,567"]);
        assert_eq!(TableCell::number(12345.678, 2).describe(), "12,345.68");
        assert_eq!([-0.004, -0.006].map(|v| TableCell::number(v, 2).describe()), ["0.00", "-0.01"]);
        assert_eq!(TableCell::spread(&[3.0, 1.0, 2.0], 1).describe(), "2.0 (1.0 to 3.0)");
        assert_eq!(TableCell::spread(&[3.01, 3.0, 3.02], 1).describe(), "3.0");
        assert_eq!(TableCell::spread(&[4.0], 1), TableCell::number(4.0, 1));
        assert_eq!(TableCell::number(f64::NAN, 1), TableCell::Empty);
        assert_eq!(TableCell::number(None, 1).plain(), "");
        assert_eq!(Spread::new(&[1.0, 2.0, f64::INFINITY, 4.0, 8.0]).unwrap().median, 3.0);
    }

    #[test]
    fn identical_pictures_have_a_cell_and_a_point() {
        let same = [f64::INFINITY; 2];
        assert_eq!(
            (TableCell::decibels(&same), TableCell::decibels(&[])),
            (TableCell::text("identical"), TableCell::Empty)
        );
        assert_eq!(TableCell::decibels(&[30.0, f64::INFINITY]).describe(), "30.00");
        assert_eq!(decibels(3.0, &same).map(|p| (p.x, p.y)), Some((3.0, f64::INFINITY)));
        assert!(decibels(3.0, &[]).is_none());
    }
}

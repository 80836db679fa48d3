//! A figure of two curves and, below it, their ratio in bands of 5 % and 10 %: as SVG and as PNG.

use crate::canvas::PictureCanvas;
use crate::figure::svg::is_of_xml;
use particlegs::Result;
use particlegs::picture::superscript;
use particlegs::picture::{Rgb8, Size, write_png};
use particlegs_files::output::write_bytes;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::path::Path;

/// Pixels across and down, of the PNG too.
const SIZE: (u32, u32) = (900, 720);
const TRUTH: RGBColor = RGBColor(40, 40, 40);
const OTHER: RGBColor = RGBColor(200, 60, 30);
const THIRD: RGBColor = RGBColor(40, 100, 190);
const BAND: RGBColor = RGBColor(90, 150, 210);

/// A curve.
pub struct ChartCurve {
    /// Its name in the legend.
    pub name: &'static str,
    /// Which side it is of: 0 = truth, 1 = other, 2 = anything else.
    pub side: usize,
    /// Drawn as dots instead of a line?
    pub dots: bool,
    /// Points; those that a logarithmic axis cannot show are left out.
    pub points: Vec<(f64, f64)>,
}

/// A figure.
pub struct Chart<'a> {
    /// File name without its ending.
    pub name: &'a str,
    /// Title.
    pub title: String,
    /// Horizontal axis, with its unit.
    pub x: String,
    /// Vertical axis, with its unit.
    pub y: String,
    /// Logarithmic horizontal axis?
    pub log_x: bool,
    /// Logarithmic vertical axis?
    pub log_y: bool,
    /// Curves.
    pub curves: Vec<ChartCurve>,
    /// other / truth; empty = no lower panel.
    pub ratio: Vec<(f64, f64)>,
    /// Horizontal lines worth a look.
    pub levels: Vec<f64>,
}

/// Writes NAME.svg and NAME.png; a figure without a point to show is left out.
pub fn write(folder: &Path, figure: &Chart<'_>) -> Result<()> {
    let mut svg = String::new();
    if draw(SVGBackend::with_string(&mut svg, SIZE), figure).is_none() {
        return Ok(());
    }
    let size = Size { width: SIZE.0 as usize, height: SIZE.1 as usize };
    let mut png = Rgb8 { size, data: vec![[0; 3]; size.pixels()] };
    draw(PictureCanvas::new(&mut png), figure);
    svg.retain(is_of_xml);
    write_bytes(&folder.join(format!("{}.svg", figure.name)), svg.as_bytes())?;
    write_png(&folder.join(format!("{}.png", figure.name)), size, png.data.as_flattened())
}

/// An axis as plotters sees it: logarithms are taken here, so that one kind of chart serves all.
#[derive(Clone, Copy)]
struct ChartAxis {
    log: bool,
    low: f64,
    high: f64,
}

impl ChartAxis {
    /// Around values; `None` where there is none to show.
    fn around(values: impl Iterator<Item = f64>, log: bool) -> Option<Self> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| v.is_finite() && (!log || *v > 0.0)) {
            let v = if log { v.log10() } else { v };
            (low, high) = (low.min(v), high.max(v));
        }
        if low > high {
            return None;
        }
        let size = low.abs().max(high.abs());
        // One value alone has an axis that shows how large it is.
        let room = if low == high { 0.1 * size.max(1.0) } else { (0.03 * (high - low)).max(1e-9 * size).max(1e-12) };
        Some(ChartAxis { log, low: low - room, high: high + room })
    }

    fn place(&self, v: f64) -> Option<f64> {
        if !v.is_finite() || (self.log && v <= 0.0) {
            return None;
        }
        Some(if self.log { v.log10() } else { v })
    }

    fn label(&self, v: f64) -> String {
        if !self.log {
            return plain(v, self.high - self.low);
        }
        // Ticks of logarithmic axes stand at whole and at halved powers.
        plain(10f64.powf(v), f64::INFINITY)
    }

    fn range(&self) -> ChartTicks {
        ChartTicks { inner: (self.low..self.high).into(), axis: *self }
    }
}

/// As few digits as tell ticks of an axis of some length apart, no exponent where the number is of
/// ordinary size.
fn plain(v: f64, length: f64) -> String {
    let size = v.abs();
    if size == 0.0 || v.abs() < 1e-12 {
        "0".into()
    } else if (1e-3..1e5).contains(&size) {
        let digits = (2 - size.min(length).log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{v:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    } else {
        let digits = (size.log10().floor() - length.log10().floor() + 1.0).clamp(0.0, 6.0) as usize;
        powers(&format!("{v:.digits$e}"))
    }
}

/// `1.20e5` as `1.20×10⁵`, and `1e-5` as `10⁻⁵`: as in the other pictures.
fn powers(text: &str) -> String {
    match text.split_once('e').map(|(front, exponent)| (front, exponent.parse())) {
        Some(("1", Ok(n))) => format!("10{}", superscript(n)),
        Some((front, Ok(n))) => format!("{front}×10{}", superscript(n)),
        _ => text.to_string(),
    }
}

/// plotters' linear axis with our ticks: 1, 2, 5 of each decade where it is logarithmic.
struct ChartTicks {
    inner: RangedCoordf64,
    axis: ChartAxis,
}

impl Ranged for ChartTicks {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.inner.map(value, limit)
    }

    fn key_points<Hint: plotters::coord::ranged1d::KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if !self.axis.log {
            return self.inner.key_points(hint);
        }
        let (low, high) = (self.axis.low.floor() as i32, self.axis.high.ceil() as i32);
        let steps: &[f64] = if high - low > 4 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let every = ((high - low) / 10 + 1).max(1);
        (low..=high)
            .filter(|p| p.rem_euclid(every) == 0)
            .flat_map(|p| steps.iter().map(move |s| f64::from(p) + s.log10()))
            .filter(|v| *v >= self.axis.low && *v <= self.axis.high)
            .collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.axis.low..self.axis.high
    }
}

impl ValueFormatter<f64> for ChartTicks {
    fn format_ext(&self, value: &f64) -> String {
        self.axis.label(*value)
    }
}

/// Draws the figure; `None` where nothing can be shown.
fn draw<B: DrawingBackend>(backend: B, f: &Chart<'_>) -> Option<()> {
    let points = || f.curves.iter().flat_map(|c| c.points.iter());
    let x = ChartAxis::around(points().filter(|p| p.1.is_finite() && (!f.log_y || p.1 > 0.0)).map(|p| p.0), f.log_x)?;
    let y = ChartAxis::around(points().map(|p| p.1).chain(f.levels.iter().copied()), f.log_y)?;
    let root = backend.into_drawing_area();
    root.fill(&WHITE).ok()?;
    let split = if f.ratio.is_empty() { SIZE.1 } else { SIZE.1 * 66 / 100 };
    let (upper, lower) = root.split_vertically(split);
    curves(&upper, f, x, y)?;
    if !f.ratio.is_empty() {
        ratio(&lower, f, x)?;
    }
    root.present().ok()
}

type ChartArea<B> = DrawingArea<B, plotters::coord::Shift>;

fn color(side: usize) -> RGBColor {
    [TRUTH, OTHER, THIRD][side.min(2)]
}

fn curves<B: DrawingBackend>(area: &ChartArea<B>, f: &Chart<'_>, x: ChartAxis, y: ChartAxis) -> Option<()> {
    let below = if f.ratio.is_empty() { 56 } else { 30 };
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .caption(&f.title, ("sans-serif", 22))
        .x_label_area_size(below)
        .y_label_area_size(86)
        .build_cartesian_2d(x.range(), y.range())
        .ok()?;
    let mut mesh = chart.configure_mesh();
    mesh.light_line_style(WHITE).label_style(("sans-serif", 15)).y_desc(&f.y).axis_desc_style(("sans-serif", 17));
    if f.ratio.is_empty() {
        mesh.x_desc(&f.x);
    }
    mesh.draw().ok()?;
    for level in f.levels.iter().filter_map(|l| y.place(*l)) {
        chart.draw_series(LineSeries::new([(x.low, level), (x.high, level)], TRUTH.mix(0.4))).ok()?;
    }
    for c in &f.curves {
        let shown: Vec<(f64, f64)> = c.points.iter().filter_map(|p| Some((x.place(p.0)?, y.place(p.1)?))).collect();
        let style = color(c.side).stroke_width(2);
        let series = if c.dots {
            chart.draw_series(shown.iter().map(|p| Circle::new(*p, 3, color(c.side).filled()))).ok()?
        } else {
            chart.draw_series(LineSeries::new(shown, style)).ok()?
        };
        let dots = c.dots;
        series.label(c.name).legend(move |(a, b)| {
            // A legend's mark is a path either way: a short one stands for dots.
            let from = if dots { a + 9 } else { a };
            PathElement::new(
                vec![(from, b), (if dots { a + 13 } else { a + 22 }, b)],
                style.stroke_width(if dots { 5 } else { 2 }),
            )
        });
    }
    if f.curves.len() > 1 {
        chart
            .configure_series_labels()
            .position(if f.ratio.is_empty() { SeriesLabelPosition::LowerLeft } else { SeriesLabelPosition::UpperRight })
            .background_style(WHITE.mix(0.85))
            .border_style(TRUTH.mix(0.3))
            .label_font(("sans-serif", 15))
            .draw()
            .ok()?;
    }
    Some(())
}

/// The lower panel: other / truth, from 0.7 to 1.3 or as far as it goes within 0 to 2.
fn ratio<B: DrawingBackend>(area: &ChartArea<B>, f: &Chart<'_>, x: ChartAxis) -> Option<()> {
    let far = f.ratio.iter().map(|p| (p.1 - 1.0).abs()).filter(|d| d.is_finite()).fold(0.0, f64::max);
    let reach = (1.15 * far).clamp(0.15, 1.0);
    let y = ChartAxis { log: false, low: 1.0 - reach, high: 1.0 + reach };
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .margin_top(0)
        .x_label_area_size(56)
        .y_label_area_size(86)
        .build_cartesian_2d(x.range(), y.range())
        .ok()?;
    chart
        .draw_series(
            [(0.1, 0.18), (0.05, 0.3)].map(|(half, shade)| {
                Rectangle::new([(x.low, 1.0 - half), (x.high, 1.0 + half)], BAND.mix(shade).filled())
            }),
        )
        .ok()?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .disable_mesh()
        .label_style(("sans-serif", 15))
        .axis_desc_style(("sans-serif", 17))
        .x_desc(&f.x)
        .y_desc("other / truth")
        .y_labels(5)
        .draw()
        .ok()?;
    chart.draw_series(LineSeries::new([(x.low, 1.0), (x.high, 1.0)], TRUTH.mix(0.6))).ok()?;
    let shown: Vec<(f64, f64)> = f
        .ratio
        .iter()
        .filter(|p| p.1.is_finite())
        .filter_map(|p| Some((x.place(p.0)?, p.1.clamp(y.low, y.high))))
        .filter(|p| p.0 >= x.low && p.0 <= x.high)
        .collect();
    chart.draw_series(LineSeries::new(shown, OTHER.stroke_width(2))).ok()?;
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.05, 1.0, 20.0, 12345.0, 0.0, -2.5, 1e-5, 1e7].map(|v| plain(v, f64::INFINITY));
        assert_eq!(shown, ["0.05", "1", "20", "12345", "0", "-2.5", "10⁻⁵", "10⁷"]);
        assert_eq!([32.0, 32.05, 32.1].map(|v| plain(v, 0.25)), ["32", "32.05", "32.1"]);
        assert_eq!([1e5, 1.2e5].map(|v| plain(v, 5e4)), ["1.00×10⁵", "1.20×10⁵"]);
    }

    #[test]
    fn one_value_alone_has_an_axis() {
        let axis = ChartAxis::around([22.0].into_iter(), false).unwrap();
        assert!(axis.high - axis.low > 4.0 && axis.label(22.0) == "22" && axis.label(21.5) == "21.5");
        assert!(ChartAxis::around([0.0].into_iter(), false).unwrap().high > 0.09);
    }

    #[test]
    fn figures_are_drawn_or_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let mut f = Chart {
            name: "a",
            title: "A".into(),
            x: "r [Mpc/h]".into(),
            y: "xi".into(),
            log_x: true,
            log_y: true,
            curves: vec![ChartCurve {
                name: "truth",
                side: 0,
                dots: false,
                points: vec![(0.1, 1.0), (1.0, -1.0), (2.0, 3.0)],
            }],
            ratio: vec![(0.1, 1.0), (2.0, f64::INFINITY)],
            levels: vec![],
        };
        write(dir.path(), &f).unwrap();
        let svg = std::fs::read_to_string(dir.path().join("a.svg")).unwrap();
        assert!(svg.contains("r [Mpc/h]") && svg.contains("other / truth"));
        assert!(std::fs::read(dir.path().join("a.png")).unwrap().len() > 5000);
        f.name = "b";
        f.curves[0].points = vec![(1.0, -1.0), (f64::NAN, 1.0)];
        write(dir.path(), &f).unwrap();
        assert!(!dir.path().join("b.svg").exists());
    }
}

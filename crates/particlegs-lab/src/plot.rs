//! Plots on any backend of plotters: curves with bars, logarithmic axes, named levels, a legend beside the axes.

use crate::results::{Plot, PlotAxis, Series, grouped};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::prelude::*;

/// Pixels of a plot, across and down.
pub const SIZE: (u32, u32) = (1000, 560);
/// Pixels of the legend, across.
const LEGEND: u32 = 270;
const INK: RGBColor = RGBColor(40, 40, 40);
/// Share of the room of a name on an axis that the series there take.
const SLOT: f64 = 0.7;
/// Share of ink in a band; a band within another is as much darker.
const SHADE: f64 = 0.1;
/// Colours that people who see few colours tell apart (Okabe and Ito 2008), and two greys.
const COLOURS: [RGBColor; 9] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 80, 40),
    RGBColor(110, 110, 110),
    RGBColor(40, 40, 40),
];

/// The plot as SVG; `None` where it has no point to show.
pub fn svg(plot: &Plot) -> Option<String> {
    let mut text = String::new();
    draw(SVGBackend::with_string(&mut text, SIZE), plot)?;
    Some(text)
}

/// Has it a point to show?
pub fn shows(plot: &Plot) -> bool {
    scales(plot).is_some()
}

/// Both axes; `None` where there is no point to show.
fn scales(plot: &Plot) -> Option<(AxisScale, AxisScale)> {
    let x = AxisScale::of(&plot.x, points(plot).map(|p| p.0))?;
    let y = AxisScale::of(&plot.y, points(plot).flat_map(|p| p.1).chain(plot.levels.iter().map(|l| l.1)))?;
    Some((x, y))
}

/// Draws it; `None` where it has no point to show.
pub fn draw<B: DrawingBackend>(backend: B, plot: &Plot) -> Option<()> {
    let (x, y) = scales(plot)?;
    let root = backend.into_drawing_area();
    root.fill(&WHITE).ok()?;
    let (axes, legend) = root.split_horizontally(SIZE.0 - LEGEND);
    curves(&axes, plot, x, y)?;
    names(&legend, plot, x, y)?;
    root.present().ok()
}

/// Places along the horizontal axis, with the values there and the ends of their bars.
fn points(plot: &Plot) -> impl Iterator<Item = (f64, Vec<f64>)> + '_ {
    let all = plot.series.iter().flat_map(|s| &s.points);
    all.map(|p| (p.x, p.range.into_iter().flatten().chain([p.y]).collect()))
}

/// An axis with its ends, of values or of their logarithms.
#[derive(Clone, Copy)]
struct AxisScale {
    log: bool,
    low: f64,
    high: f64,
    /// Are there whole numbers alone, of which halves are nothing?
    whole: bool,
}

impl AxisScale {
    fn of(axis: &PlotAxis, values: impl Iterator<Item = f64>) -> Option<AxisScale> {
        let place = |v: f64| if axis.log { v.log10() } else { v };
        let shown: Vec<f64> = values.filter(|v| v.is_finite() && (!axis.log || *v > 0.0)).collect();
        let (log, whole) = (axis.log, shown.iter().all(|v| v.fract() == 0.0));
        let placed = shown.into_iter().map(place);
        let (low, high) = placed.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if let Some([a, b]) = axis.range {
            return Some(AxisScale { log, low: place(a), high: place(b), whole });
        }
        let room = if low == high { 0.1 * low.abs().max(1.0) } else { 0.04 * (high - low) };
        (low <= high).then_some(AxisScale { log, low: low - room, high: high + room, whole })
    }

    /// Where a value stands; `None` where it does not.
    fn place(&self, v: f64) -> Option<f64> {
        let placed = if self.log { v.log10() } else { v };
        (placed.is_finite() && placed >= self.low && placed <= self.high).then_some(placed)
    }

    /// Where a value stands, or the nearer end of the axis.
    fn clamped(&self, v: f64) -> Option<f64> {
        let placed = if self.log { v.log10() } else { v };
        (!placed.is_nan()).then(|| placed.clamp(self.low, self.high))
    }

    fn ticks(self, names: &[String]) -> AxisTicks {
        // Of many, the beginning of each has room.
        let most = (96 / names.len().max(1)).max(4);
        let short = |name: &String| match name.chars().count() > most {
            true => format!("{}…", name.chars().take(most - 1).collect::<String>()),
            false => name.clone(),
        };
        AxisTicks { scale: self, names: names.iter().map(short).collect() }
    }
}

/// Ticks of our own: names, or where the axis is logarithmic as many of each decade as it is short.
struct AxisTicks {
    scale: AxisScale,
    names: Vec<String>,
}

impl Ranged for AxisTicks {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (value - self.scale.low) / (self.scale.high - self.scale.low);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let AxisScale { log, low, high, whole } = self.scale;
        if !self.names.is_empty() {
            return (1..=self.names.len()).map(|i| i as f64).collect();
        }
        if !log {
            let all = plotters::coord::types::RangedCoordf64::from(low..high).key_points(hint);
            return all.into_iter().filter(|v| !whole || v.fract() == 0.0).collect();
        }
        let steps: &[f64] = match high - low {
            ..1.0 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
            1.0..=3.0 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        (low.floor() as i32..=high.ceil() as i32)
            .flat_map(|decade| steps.iter().map(move |s| f64::from(decade) + s.log10()))
            .filter(|v| *v >= low && *v <= high)
            .collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.scale.low..self.scale.high
    }
}

impl ValueFormatter<f64> for AxisTicks {
    fn format_ext(&self, value: &f64) -> String {
        if let Some(name) = self.names.get((*value as usize).wrapping_sub(1)) {
            return name.clone();
        }
        let (v, length) = match self.scale.log {
            true => (10f64.powf(*value), f64::INFINITY),
            false => (*value, self.scale.high - self.scale.low),
        };
        label(v, length)
    }
}

/// As few digits as tell the ticks of an axis of some length apart; millions as `M`.
fn label(v: f64, length: f64) -> String {
    let size = v.abs();
    if size < 1e-12 {
        return "0".into();
    }
    if !(1e-4..1e8).contains(&size) {
        return format!("{v:.0e}");
    }
    if size >= 999_999.5 {
        return format!("{} M", label(v / 1e6, length / 1e6));
    }
    let digits = (2 - size.min(length).log10().floor() as i32).clamp(0, 6) as usize;
    let text = grouped(v, digits);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

type PlotArea<B> = DrawingArea<B, Shift>;

fn colour(style: usize) -> RGBColor {
    COLOURS[style % COLOURS.len()]
}

fn curves<B: DrawingBackend>(area: &PlotArea<B>, plot: &Plot, x: AxisScale, y: AxisScale) -> Option<()> {
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .caption(&plot.title, ("sans-serif", 21))
        .x_label_area_size(54)
        .y_label_area_size(74)
        .build_cartesian_2d(x.ticks(&plot.x.names), y.ticks(&[]))
        .ok()?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .label_style(("sans-serif", if plot.x.names.len() > 8 { 12 } else { 15 }))
        .axis_desc_style(("sans-serif", 17))
        .x_desc(&plot.x.label)
        .y_desc(&plot.y.label)
        .draw()
        .ok()?;
    for (_, [low, high]) in &plot.y.bands {
        let (Some(low), Some(high)) = (y.clamped(*low), y.clamped(*high)) else { continue };
        chart.draw_series([Rectangle::new([(x.low, low), (x.high, high)], INK.mix(SHADE).filled())]).ok()?;
    }
    for (i, (_, level)) in plot.levels.iter().enumerate() {
        if let Some(v) = y.place(*level) {
            let ends = [(x.low, v), (x.high, v)];
            chart.draw_series(DashedLineSeries::new(ends, 2 + 4 * i as u32, 4, INK.mix(0.7).into())).ok()?;
        }
    }
    for (i, s) in plot.series.iter().enumerate() {
        let aside = aside(plot, i);
        let (ink, runs) = (colour(s.style), runs(s, x, y));
        for run in runs.iter().filter(|_| plot.x.names.is_empty()) {
            match s.dashed {
                true => {
                    chart.draw_series(DashedLineSeries::new(run.clone(), 8, 5, ink.stroke_width(2))).ok().map(drop)?
                }
                false => chart.draw_series(LineSeries::new(run.clone(), ink.stroke_width(2))).ok().map(drop)?,
            }
        }
        for p in &s.points {
            let ends = p.range.map(|r| r.map(|v| y.clamped(v)));
            if let (Some(at), Some([Some(low), Some(high)])) = (x.place(p.x), ends)
                && low < high
            {
                let ends = vec![(at + aside, low), (at + aside, high)];
                chart.draw_series([PathElement::new(ends, ink.stroke_width(2))]).ok()?;
            }
        }
        let at_the_top = identical(s, x).map(|at| (at, y.high));
        for (at, v) in runs.into_iter().flatten().chain(at_the_top) {
            chart.draw_series(marks(s, (0, 0)).map(|mark| EmptyElement::at((at + aside, v)) + mark)).ok()?;
        }
    }
    Some(())
}

/// How far a series stands from the place of its points, beside the others of it: where points are not joined, those of
/// nearly one value would else hide each other.
fn aside(plot: &Plot, series: usize) -> f64 {
    let all = plot.series.len() as f64;
    if plot.x.names.is_empty() { 0.0 } else { SLOT * ((series as f64 + 0.5) / all - 0.5) }
}

/// Where along the axis a series has pictures that do not differ from the truth: they stand at the top edge.
fn identical(s: &Series, x: AxisScale) -> impl Iterator<Item = f64> {
    s.points.iter().filter(|p| p.y == f64::INFINITY).filter_map(move |p| x.place(p.x))
}

/// Points that the axes can show, in runs: a line does not go on past a point that they cannot.
fn runs(s: &Series, x: AxisScale, y: AxisScale) -> Vec<Vec<(f64, f64)>> {
    let placed: Vec<Option<(f64, f64)>> = s.points.iter().map(|p| Some((x.place(p.x)?, y.place(p.y)?))).collect();
    placed
        .split(Option::is_none)
        .filter(|run| !run.is_empty())
        .map(|run| run.iter().flatten().copied().collect())
        .collect()
}

/// A mark: circles, squares, triangles in turn, so that colour is not all that tells curves apart.
/// Those of broken lines are hollow.
fn marks(s: &Series, at: (i32, i32)) -> impl Iterator<Item = Polygon<(i32, i32)>> {
    let hole = s.dashed.then(|| mark(s.style, 0.5, at, WHITE));
    [mark(s.style, 1.0, at, colour(s.style))].into_iter().chain(hole)
}

fn mark(style: usize, size: f64, (x, y): (i32, i32), fill: RGBColor) -> Polygon<(i32, i32)> {
    let corners: &[(i32, i32)] = match style % 4 {
        0 => &[
            (-4, -1),
            (-3, -3),
            (-1, -4),
            (1, -4),
            (3, -3),
            (4, -1),
            (4, 1),
            (3, 3),
            (1, 4),
            (-1, 4),
            (-3, 3),
            (-4, 1),
        ],
        1 => &[(-4, -4), (4, -4), (4, 4), (-4, 4)],
        2 => &[(0, -5), (5, 4), (-5, 4)],
        _ => &[(0, -5), (5, 0), (0, 5), (-5, 0)],
    };
    let scaled = |v: i32| (size * f64::from(v)).round() as i32;
    let places: Vec<_> = corners.iter().map(|(a, b)| (x + scaled(*a), y + scaled(*b))).collect();
    Polygon::new(places, fill.filled())
}

/// What the legend says of a curve that is not to be seen: whether there is none, or none within the axes.
fn unseen(s: &Series, x: AxisScale, y: AxisScale) -> &'static str {
    match (runs(s, x, y).is_empty() && identical(s, x).next().is_none(), s.points.is_empty()) {
        (false, _) => "",
        (true, true) => " (none)",
        (true, false) => " (outside)",
    }
}

/// The legend: curves in the order of the plot, those that the axes do not reach told, then levels, then bands.
fn names<B: DrawingBackend>(area: &PlotArea<B>, plot: &Plot, x: AxisScale, y: AxisScale) -> Option<()> {
    let font = ("sans-serif", 15).into_font().color(&INK);
    let mut at = 58;
    for s in &plot.series {
        let line = |from, to| PathElement::new(vec![(from, at + 8), (to, at + 8)], colour(s.style).stroke_width(2));
        match s.dashed {
            _ if !plot.x.names.is_empty() => {}
            true => [line(2, 9), line(25, 32)].iter().try_for_each(|l| area.draw(l)).ok()?,
            false => area.draw(&line(4, 30)).ok()?,
        }
        marks(s, (17, at + 8)).try_for_each(|mark| area.draw(&mark)).ok()?;
        area.draw(&Text::new(format!("{}{}", s.name, unseen(s, x, y)), (38, at), font.clone())).ok()?;
        at += 24;
    }
    if plot.series.iter().any(|s| identical(s, x).next().is_some()) {
        area.draw(&Text::new("at the top edge: identical", (38, at), font.clone())).ok()?;
        at += 24;
    }
    for (i, (name, level)) in plot.levels.iter().enumerate() {
        let (step, mut from) = (2 + 4 * i as i32, 4);
        while from < 30 {
            area.draw(&PathElement::new(vec![(from, at + 8), ((from + step).min(30), at + 8)], INK.mix(0.7))).ok()?;
            from += step + 4;
        }
        area.draw(&Text::new(format!("{name} ({})", label(*level, 100.0)), (38, at), font.clone())).ok()?;
        at += 24;
    }
    for (i, (name, _)) in plot.y.bands.iter().enumerate() {
        for _ in 0..=i {
            area.draw(&Rectangle::new([(4, at), (30, at + 16)], INK.mix(SHADE).filled())).ok()?;
        }
        area.draw(&Text::new(name.clone(), (38, at), font.clone())).ok()?;
        at += 24;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Point;

    fn plot(points: Vec<Point>) -> Plot {
        Plot {
            name: "p".into(),
            title: "Quality by size".into(),
            x: PlotAxis::logarithmic("ratio"),
            y: PlotAxis::linear("masked PSNR, dB"),
            series: vec![Series { name: "model".into(), style: 1, dashed: false, points }],
            levels: vec![("noise-free".into(), 33.5)],
        }
    }

    #[test]
    fn what_can_be_shown_is_drawn() {
        let text =
            svg(&plot(vec![Point::new(20.0, 31.0), Point::spread(300.0, &[29.0, 30.0, 30.5]).unwrap()])).unwrap();
        // Text stands on lines of its own.
        let text = text.replace('\n', "");
        for said in ["Quality by size", "ratio", "masked PSNR, dB", "model", "noise-free (33.5)", ">100<", ">20<"] {
            assert!(text.contains(said), "{said}");
        }
        assert!(svg(&plot(vec![Point::new(-1.0, f64::NAN)])).is_none());
        // A curve that the axes do not reach is told.
        let low = Series { name: "low".into(), style: 2, dashed: false, points: vec![Point::new(30.0, 0.5)] };
        let mut both = plot(vec![Point::new(20.0, 31.0)]);
        both.y.range = Some([30.0, 34.0]);
        both.series.push(low);
        let both = svg(&both).unwrap().replace('\n', "");
        assert!(both.contains("low (outside)") && !both.contains("model (outside)"));
        // Things without an order have their names, and no line from one to the next.
        let joined = plot(vec![Point::new(1.0, 31.0), Point::new(2.0, 29.0)]);
        let x = PlotAxis::named("data set", vec!["box".into(), "melt".into()]);
        let apart = svg(&Plot { x, ..joined.clone() }).unwrap();
        let lines = |text: &str| text.matches("<polyline").count();
        assert!(apart.contains("box") && apart.contains("melt") && !apart.contains(">1.5<"));
        assert!(lines(&apart) < lines(&svg(&joined).unwrap()), "{apart}");
    }

    #[test]
    fn lines_end_where_the_axes_do() {
        let points = [1.0, 2.0, 50.0, 3.0].iter().enumerate().map(|(i, v)| Point::new(i as f64, *v)).collect();
        let series = Series { name: "s".into(), style: 0, dashed: false, points };
        let scale = |high| AxisScale { log: false, low: 0.0, high, whole: false };
        assert_eq!(runs(&series, scale(9.0), scale(9.0)), [vec![(0.0, 1.0), (1.0, 2.0)], vec![(3.0, 3.0)]]);
    }

    #[test]
    fn bands_are_shaded_and_named() {
        let mut banded = plot(vec![Point::new(20.0, 31.0), Point::new(50.0, 35.0)]);
        let plain = svg(&banded).unwrap();
        banded.y.bands = vec![("within 10 %".into(), [30.0, 34.0])];
        let text = svg(&banded).unwrap();
        assert!(text.contains("within 10 %") && !plain.contains("within 10 %"));
        // One across the plot, one in the legend.
        let shaded = |text: &str| text.matches("opacity=\"0.1\"").count();
        assert_eq!(shaded(&text), shaded(&plain) + 2);
    }

    #[test]
    fn ticks_are_short() {
        let said = [0.5, 20.0, 5000.0, 2e5, 5e6, 1e7, 1e8, 0.0].map(|v| label(v, f64::INFINITY));
        assert_eq!(said, ["0.5", "20", "5000", "200,000", "5 M", "10 M", "1e8", "0"]);
        assert_eq!((label(31.25, 2.0), label(1.25e6, 1e6)), ("31.25".into(), "1.25 M".into()));
    }

    /// Views are counted: there is none at one and a half. A short logarithmic axis has more than one tick.
    #[test]
    fn ticks_are_at_what_there_is() {
        let ticks = |points: &[f64], x: PlotAxis| {
            let points = points.iter().map(|x| Point::new(*x, 30.0 + x)).collect();
            svg(&Plot { x, ..plot(points) }).unwrap().replace('\n', "")
        };
        let views = ticks(&[1.0, 2.0, 3.0, 4.0], PlotAxis::linear("view"));
        assert!(views.contains(">3<") && !views.contains(">1.5<"), "{views}");
        assert!(ticks(&[1.0, 2.5], PlotAxis::linear("factor")).contains(">1.4<"));
        let short = ticks(&[1.1e5, 2.6e5], PlotAxis::logarithmic("particles"));
        assert!(short.contains(">150,000<") && short.contains(">200,000<"), "{short}");
    }

    /// A picture that is the truth has a place, and no curve runs to it.
    #[test]
    fn identical_pictures_stand_at_the_top_edge() {
        let some = plot(vec![Point::new(5.0, f64::INFINITY), Point::new(20.0, 40.0), Point::new(300.0, 29.0)]);
        let [with, without] = [&some.series[0].points[..], &some.series[0].points[1..]].map(|points| {
            let series = vec![Series { points: points.to_vec(), ..some.series[0].clone() }];
            svg(&Plot { series, ..some.clone() }).unwrap()
        });
        let count = |text: &str, what: &str| text.matches(what).count();
        assert_eq!(count(&with, "<polygon"), count(&without, "<polygon") + 1);
        assert_eq!(count(&with, "stroke-width=\"2\""), count(&without, "stroke-width=\"2\""));
        assert!(with.contains("at the top edge: identical") && !without.contains("top edge"));
        // Nothing but such has no axis to stand on.
        let all = Plot { levels: vec![], ..plot(vec![Point::new(5.0, f64::INFINITY)]) };
        assert!(!shows(&all) && shows(&some));
    }

    #[test]
    fn series_without_an_order_stand_beside_each_other() {
        let x = PlotAxis::named("data set", vec!["box".into(), "melt".into()]);
        let named = Plot { x, ..plot(vec![Point::new(1.0, 31.0)]) };
        let second = Series { style: 3, points: vec![], ..named.series[0].clone() };
        let two = Plot { series: vec![named.series[0].clone(), second], ..named.clone() };
        assert_eq!((aside(&named, 0), aside(&two, 0), aside(&two, 1)), (0.0, -0.25 * SLOT, 0.25 * SLOT));
        assert_eq!(aside(&plot(vec![]), 0), 0.0);
        assert!(svg(&two).unwrap().contains("model (none)"));
    }
}

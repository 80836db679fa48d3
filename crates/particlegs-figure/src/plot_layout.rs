//! Places of all parts of a plot: axes below one another, beside each the names of its curves, levels and bands.

use super::font::{self, CAPITALS};
use super::layout_parts::{MarkWriter, UNDER};
use super::panel::{BarPlacement, PaperColour};
use super::plot::{Plot, PlotAxis, PlotSeries};
use super::png_file::PngMetadata;
use super::sheet::{Anchor, FileKind, Mark, PageRectangle, RgbColour, Sheet};
use super::ticks::{TickMarks, even, logarithmic, number};
use particlegs_core::Result;
use particlegs_files::output::write_bytes;
use std::f64::consts::PI;
use std::path::Path;

/// In ems: axes across; down, the first and those below it; between them; the title; the legend's widest name, its
/// rows, and the lines in it.
const ACROSS: f64 = 50.0;
const DOWN: [f64; 2] = [32.0, 12.0];
const GAP: f64 = 1.2;
const TITLE: f64 = 2.8;
const LONGEST_NAME: f64 = 24.0;
const ROW: f64 = 1.7;
const SAMPLE: f64 = 2.4;
/// Height of an em in the pixels of a PNG, in the points of SVG and PDF.
const PIXELS: f64 = 14.0;
const POINTS: f64 = 8.0;
/// Size of marks, width of curves, and dashes of broken ones, ems.
const MARK: f64 = 0.32;
const CURVE: f64 = 0.15;
const BROKEN: [f64; 2] = [0.65, 0.45];
/// Share of the room of a name on an axis that the series there take.
const SLOT: f64 = 0.7;
/// Share of ink in a band, of which one within another is as much darker; of the grid; of levels.
const SHADE: f64 = 0.1;
const GRID: f64 = 0.1;
const LEVEL: f64 = 0.7;
/// Of a curve of more points, not each has its mark.
const MARKS: usize = 30;
/// Colours that people who see few colours tell apart (Okabe and Ito 2008), and two greys.
const COLOURS: [RgbColour; 9] = [
    [0, 114, 178],
    [213, 94, 0],
    [0, 158, 115],
    [204, 121, 167],
    [230, 159, 0],
    [86, 180, 233],
    [120, 80, 40],
    [110, 110, 110],
    [40, 40, 40],
];
const INK: RgbColour = COLOURS[8];

/// Writes the plots, which stand below one another, as one file of each kind with the first one's name; none where
/// there is no point to show.
pub fn write_plots(folder: &Path, plots: &[Plot], kinds: &[FileKind]) -> Result<()> {
    for kind in kinds {
        if let (Some(first), Some(bytes)) = (plots.first(), plot_bytes(plots, *kind)?) {
            write_bytes(&folder.join(format!("{}.{}", first.name, kind.name())), &bytes)?;
        }
    }
    Ok(())
}

/// The file of plots below one another; `None` where there is no point to show.
pub fn plot_bytes(plots: &[Plot], kind: FileKind) -> Result<Option<Vec<u8>>> {
    let title = plots.first().map(|p| p.title.clone());
    let em = if kind == FileKind::Png { PIXELS } else { POINTS };
    let sheet = plot_sheet(plots, em, kind != FileKind::Png);
    sheet.map(|s| s.bytes(kind, &PngMetadata { title, ..PngMetadata::default() })).transpose()
}

/// Whether it has a point to show.
pub fn shows(plot: &Plot) -> bool {
    scales(plot).is_some()
}

/// Plots below one another along the horizontal axis of the first; letters are `em` high, lines may be thinner than a
/// unit where they are `fine`. `None` where the first has no point to show; others that have none are left out.
fn plot_sheet(plots: &[Plot], em: f64, fine: bool) -> Option<Sheet> {
    let first = plots.first()?;
    let (x, _) = scales(first)?;
    let shown: Vec<(&Plot, AxisScale)> = plots.iter().filter_map(|p| Some((p, scales(p)?.1))).collect();
    let high = |i: usize| DOWN[i.min(1)];
    let across = x.ticks(&first.x.names, ACROSS, 3.4, |label| font::width(label, 1.0));
    let up: Vec<TickMarks> = shown.iter().enumerate().map(|(i, (_, y))| y.ticks(&[], high(i), 2.6, |_| 1.0)).collect();
    let entries: Vec<_> = shown.iter().map(|(plot, y)| entries(plot, x, *y)).collect();
    let longest = entries.iter().flatten().map(|e| font::width(&e.1, 1.0)).fold(0.0, f64::max).min(LONGEST_NAME);
    let left = (up.iter().map(|t| t.widest(em)).fold(0.0, f64::max) + 2.6 * em).ceil();
    // Half of the last number reaches beyond the axis.
    let right = if longest > 0.0 { longest + SAMPLE + 2.0 } else { 1.0 }.max(0.5 * across.widest(1.0) + 0.5);
    let width = (left + (ACROSS + right) * em).ceil();
    let heights = (0..shown.len()).map(high).sum::<f64>() + GAP * (shown.len() - 1) as f64;
    let height = ((TITLE + heights + UNDER + 0.4) * em).ceil();
    let mut sheet = Sheet { width, height, ground: PaperColour::White.paper(), marks: Vec::new() };
    let (page, place) = (PaperColour::White, BarPlacement::Outside);
    let mut writer = MarkWriter { page, ground: page, place, em, marks: &mut sheet.marks, fine };
    let middle = left + 0.5 * ACROSS * em;
    // The title stands over the middle of the axes: the nearer edge of the page limits it.
    let room = 2.0 * middle.min(width - middle) - em;
    writer.words_within(&first.title, [middle, 1.8 * em], 1.2 * em, Anchor::Middle, room);
    let mut top = (TITLE * em).ceil();
    for (i, (((plot, y), up), entries)) in shown.iter().zip(up).zip(entries).enumerate() {
        let area = PageRectangle { x: left, y: top, w: (ACROSS * em).round(), h: (high(i) * em).round() };
        let last = i + 1 == shown.len();
        let mut across = across.clone();
        // Plots below one another share the numbers under the lowest.
        if !last {
            across.major.iter_mut().for_each(|t| t.1.clear());
        }
        let ticks = [across, up];
        draw(&mut writer, area, plot, [x, *y], &ticks);
        writer.line(area.outline(), page.ink());
        writer.axes(area, [if last { &first.x.label } else { "" }, &plot.y.label], &ticks);
        legend(&mut writer, plot, area, &entries);
        top = area.bottom() + GAP * em;
    }
    Some(sheet)
}

/// Both axes; `None` where there is no point to show.
fn scales(plot: &Plot) -> Option<(AxisScale, AxisScale)> {
    let points = || plot.series.iter().flat_map(|s| &s.points);
    let values = points().flat_map(|p| p.range.into_iter().flatten().chain([p.y]));
    // Infinite values are identical pictures: they stand at the top edge and need a place along x.
    let seen = points().filter(|p| p.y == f64::INFINITY || p.y.is_finite() && (!plot.y.log || p.y > 0.0));
    let x = AxisScale::new(&plot.x, seen.map(|p| p.x))?;
    Some((x, AxisScale::new(&plot.y, values.chain(plot.levels.iter().map(|l| l.1)))?))
}

/// An axis with its ends, of values or of their logarithms.
#[derive(Clone, Copy)]
struct AxisScale {
    log: bool,
    low: f64,
    high: f64,
    /// Whether there are whole numbers alone, of which halves are nothing.
    whole: bool,
}

impl AxisScale {
    /// About values; `None` where there is none to show.
    fn new(axis: &PlotAxis, values: impl Iterator<Item = f64>) -> Option<AxisScale> {
        let place = |v: f64| if axis.log { v.log10() } else { v };
        let shown: Vec<f64> = values.filter(|v| v.is_finite() && (!axis.log || *v > 0.0)).collect();
        let (log, whole) = (axis.log, shown.iter().all(|v| v.fract() == 0.0));
        let placed = shown.into_iter().map(place);
        let (low, high) = placed.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if let Some([a, b]) = axis.range {
            return Some(AxisScale { log, low: place(a), high: place(b), whole });
        }
        let size = low.abs().max(high.abs());
        // One value alone has an axis that shows how large it is.
        let room = if low == high { 0.1 * size.max(1.0) } else { (0.04 * (high - low)).max(1e-9 * size).max(1e-12) };
        (low <= high).then_some(AxisScale { log, low: low - room, high: high + room, whole })
    }

    fn value(&self, v: f64) -> f64 {
        if self.log { v.log10() } else { v }
    }

    /// The place of a value; `None` if that is beyond the axis.
    fn place(&self, v: f64) -> Option<f64> {
        Some(self.value(v)).filter(|at| at.is_finite() && (self.low..=self.high).contains(at))
    }

    /// The place of a value, or the nearer end of the axis.
    fn clamped(&self, v: f64) -> Option<f64> {
        Some(self.value(v)).filter(|at| !at.is_nan()).map(|at| at.clamp(self.low, self.high))
    }

    fn share(&self, placed: f64) -> f64 {
        (placed - self.low) / (self.high - self.low)
    }

    /// Ticks of an axis so long, about so far apart, in ems. Labels that would touch are left out.
    fn ticks(&self, names: &[String], long: f64, apart: f64, wide: impl Fn(&str) -> f64) -> TickMarks {
        let mut ticks = match (self.log, self.whole) {
            _ if !names.is_empty() => {
                let shown = names.iter().map(|name| shortened(name, long / names.len() as f64 - 0.6));
                let major = shown.zip(1..).map(|(name, i)| (self.share(f64::from(i)), name)).collect();
                TickMarks { major, minor: Vec::new() }
            }
            (true, _) => logarithmic(10f64.powf(self.low), 10f64.powf(self.high)),
            (false, true) if self.high - self.low > 2.0 => {
                // No more ticks than whole numbers, or some would stand at halves.
                let most = (long / apart).min(self.high - self.low);
                TickMarks { minor: Vec::new(), ..even(self.low, self.high, most) }
            }
            (false, _) => even(self.low, self.high, long / apart),
        };
        let mut free = f64::NEG_INFINITY;
        for (share, label) in &mut ticks.major {
            let (at, half) = (*share * long, 0.5 * wide(label));
            if at - half < free {
                label.clear();
            } else {
                free = at + half + 0.3;
            }
        }
        ticks
    }
}

/// The beginning of a name where there is no room for all of it, in ems.
fn shortened(name: &str, room: f64) -> String {
    let mut text = name.to_string();
    while font::width(&text, 1.0) > room && text.chars().count() > 3 {
        // From the second round on, the first of these takes away the mark of the round before.
        text.pop();
        text.pop();
        text.push('…');
    }
    text
}

/// Ink seen through, on white.
fn faint(ink: RgbColour, share: f64) -> RgbColour {
    ink.map(|v| (255.0 - share * (255.0 - f64::from(v))).round() as u8)
}

/// The colour of a band that lies within so many others.
fn shade(within: usize) -> RgbColour {
    faint(INK, 1.0 - (1.0 - SHADE).powi(within as i32 + 1))
}

fn colour(style: usize) -> RgbColour {
    COLOURS[style % COLOURS.len()]
}

/// The pieces of a broken line: as long as `on`, `off` apart.
fn dashes(points: &[[f64; 2]], [on, off]: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    let (mut pieces, mut drawn, mut left) = (vec![points[..1].to_vec()], true, on);
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let long = (b[0] - a[0]).hypot(b[1] - a[1]);
        let mut at = 0.0;
        while at < long {
            // A dash goes on around corners: `left` is not reset for a new pair of points.
            let step = left.min(long - at);
            (at, left) = (at + step, left - step);
            let place = [0, 1].map(|k| a[k] + at / long * (b[k] - a[k]));
            if let Some(piece) = pieces.last_mut().filter(|_| drawn) {
                piece.push(place);
            }
            if left <= 0.0 {
                (drawn, left) = (!drawn, if drawn { off } else { on });
                if drawn {
                    pieces.push(vec![place]);
                }
            }
        }
    }
    pieces.retain(|p| p.len() > 1);
    pieces
}

/// Bands, the grid and levels, and over them the curves, each with its bars and marks.
fn draw(writer: &mut MarkWriter<'_>, area: PageRectangle, plot: &Plot, [x, y]: [AxisScale; 2], ticks: &[TickMarks; 2]) {
    let at = |(a, b): (f64, f64)| [area.x + x.share(a) * area.w, area.bottom() - y.share(b) * area.h];
    let across = |v: f64| [x.low, x.high].map(|x| at((x, v)));
    for (i, (_, ends)) in plot.y.bands.iter().enumerate() {
        let [Some(low), Some(high)] = ends.map(|v| y.clamped(v)) else { continue };
        let [bottom, top] = [low, high].map(|v| at((x.low, v))[1]);
        writer.marks.push(Mark::Fill(PageRectangle { y: top, h: bottom - top, ..area }, shade(i)));
    }
    for x in ticks[0].major.iter().map(|t| area.x + t.0 * area.w) {
        writer.line(vec![[x, area.y], [x, area.bottom()]], faint(INK, GRID));
    }
    for y in ticks[1].major.iter().map(|t| area.bottom() - t.0 * area.h) {
        writer.line(vec![[area.x, y], [area.right(), y]], faint(INK, GRID));
    }
    for (i, (_, level)) in plot.levels.iter().enumerate() {
        y.place(*level).into_iter().for_each(|v| level_line(writer, i, across(v)));
    }
    for (s, aside) in plot.series.iter().enumerate().map(|(i, s)| (s, aside(plot, i))) {
        let runs = runs(s, x, y);
        for run in runs.iter().filter(|_| plot.x.names.is_empty()) {
            curve(writer, s, &run.iter().map(|p| at(*p)).collect::<Vec<_>>(), s.dashed);
        }
        for p in &s.points {
            let ends = p.range.map(|r| r.map(|v| y.clamped(v)));
            if let (Some(place), Some([Some(low), Some(high)])) = (x.place(p.x), ends)
                && low < high
            {
                curve(writer, s, &[low, high].map(|v| at((place + aside, v))), false);
            }
        }
        let every = s.points.len() / MARKS + 1;
        let at_the_top = identical(s, x).map(|place| (place, y.high));
        for (a, b) in runs.into_iter().flat_map(|run| run.into_iter().step_by(every)).chain(at_the_top) {
            marks(writer, s, at((a + aside, b)));
        }
    }
}

fn curve(writer: &mut MarkWriter<'_>, s: &PlotSeries, points: &[[f64; 2]], broken: bool) {
    let parts = if broken { dashes(points, BROKEN.map(|d| d * writer.em)) } else { vec![points.to_vec()] };
    for points in parts.into_iter().filter(|p| p.len() > 1) {
        writer.marks.push(Mark::Line { points, width: CURVE * writer.em, ink: colour(s.style), opacity: 1.0 });
    }
}

fn level_line(writer: &mut MarkWriter<'_>, level: usize, ends: [[f64; 2]; 2]) {
    // Each level has dashes of another length, by which the legend tells them apart.
    let dash = [0.15 + 0.35 * level as f64, 0.35].map(|d| d * writer.em);
    dashes(&ends, dash).into_iter().for_each(|part| writer.line(part, faint(INK, LEVEL)));
}

/// A mark: circles, squares, triangles in turn, so that colour is not all that tells curves apart.
/// Those of broken lines are hollow.
fn marks(writer: &mut MarkWriter<'_>, s: &PlotSeries, at: [f64; 2]) {
    let circle: Vec<[f64; 2]> = (0..16).map(|i| f64::from(i) * PI / 8.0).map(|a| [a.cos(), a.sin()]).collect();
    let corners: &[[f64; 2]] = match s.style % 4 {
        0 => &circle,
        1 => &[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
        2 => &[[0.0, -1.2], [1.2, 0.9], [-1.2, 0.9]],
        _ => &[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]],
    };
    // A smaller mark in the page's colour over the first makes it hollow.
    let sizes = [(MARK, colour(s.style)), (0.5 * MARK, writer.page.paper())];
    for (size, ink) in sizes.into_iter().take(1 + usize::from(s.dashed)) {
        let place = |c: &[f64; 2]| [0, 1].map(|k| at[k] + size * writer.em * c[k]);
        writer.marks.push(Mark::Polygon(corners.iter().map(place).collect(), ink));
    }
}

/// Distance of a series from the place of its points, beside the others of it: points that are not joined and have
/// nearly one value would else hide each other.
fn aside(plot: &Plot, series: usize) -> f64 {
    let all = plot.series.len() as f64;
    if plot.x.names.is_empty() { 0.0 } else { SLOT * ((series as f64 + 0.5) / all - 0.5) }
}

/// Places along the axis at which a series has pictures that do not differ from the truth: they stand at the top edge.
fn identical(s: &PlotSeries, x: AxisScale) -> impl Iterator<Item = f64> {
    s.points.iter().filter(|p| p.y == f64::INFINITY).filter_map(move |p| x.place(p.x))
}

/// Points that the axes can show, in runs: a line does not go on past a point that they cannot.
fn runs(s: &PlotSeries, x: AxisScale, y: AxisScale) -> Vec<Vec<(f64, f64)>> {
    let placed: Vec<Option<(f64, f64)>> = s.points.iter().map(|p| Some((x.place(p.x)?, y.place(p.y)?))).collect();
    placed
        .split(Option::is_none)
        .filter(|run| !run.is_empty())
        .map(|run| run.iter().flatten().copied().collect())
        .collect()
}

/// Words of the legend for a curve that is not to be seen: whether there is none, or none within the axes.
fn unseen(s: &PlotSeries, x: AxisScale, y: AxisScale) -> &'static str {
    match (runs(s, x, y).is_empty() && identical(s, x).next().is_none(), s.points.is_empty()) {
        (false, _) => "",
        (true, true) => " (none)",
        (true, false) => " (outside)",
    }
}

/// The sample before a name in the legend.
enum LegendSample<'a> {
    PlotSeries(&'a PlotSeries),
    Level(usize),
    Band(usize),
    Nothing,
}

/// The legend: curves in the order of the plot, those that the axes do not reach told, then levels, then bands.
fn entries(plot: &Plot, x: AxisScale, y: AxisScale) -> Vec<(LegendSample<'_>, String)> {
    let named = plot.series.iter().filter(|s| !s.name.is_empty());
    let mut all: Vec<_> = named.map(|s| (LegendSample::PlotSeries(s), s.name.clone() + unseen(s, x, y))).collect();
    if plot.series.iter().any(|s| identical(s, x).next().is_some()) {
        all.push((LegendSample::Nothing, "top edge: identical".into()));
    }
    let levels = plot.levels.iter().enumerate().filter(|(_, (name, _))| !name.is_empty());
    all.extend(levels.map(|(i, (name, level))| (LegendSample::Level(i), format!("{name} ({})", number(*level)))));
    all.extend(plot.y.bands.iter().enumerate().map(|(i, (name, _))| (LegendSample::Band(i), name.clone())));
    all
}

/// Beside its plot; rows are closer where there are many.
fn legend(writer: &mut MarkWriter<'_>, plot: &Plot, area: PageRectangle, entries: &[(LegendSample<'_>, String)]) {
    let em = writer.em;
    let row = (ROW * em).min(area.h / entries.len().max(1) as f64);
    let (from, to) = (area.right() + 1.2 * em, area.right() + (1.2 + SAMPLE) * em);
    for (i, (sample, text)) in entries.iter().enumerate() {
        let y = area.y + (i as f64 + 0.5) * row;
        match sample {
            LegendSample::PlotSeries(s) => {
                if plot.x.names.is_empty() {
                    curve(writer, s, &[[from, y], [to, y]], s.dashed);
                }
                marks(writer, s, [0.5 * (from + to), y]);
            }
            LegendSample::Level(i) => level_line(writer, *i, [[from, y], [to, y]]),
            LegendSample::Band(i) => {
                let patch = PageRectangle { x: from, y: y - 0.6 * em, w: to - from, h: 1.2 * em };
                writer.marks.push(Mark::Fill(patch, shade(*i)));
            }
            LegendSample::Nothing => {}
        }
        let (at, em) = ([to + 0.5 * em, y + 0.5 * CAPITALS * em], em.min(row / 1.15));
        writer.words_within(text, at, em, Anchor::Start, LONGEST_NAME * writer.em);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Point;

    fn two_names() -> PlotAxis {
        let names = vec!["box".into(), "melt".into()];
        PlotAxis { range: Some([0.5, 2.5]), names, ..PlotAxis::linear("data set") }
    }

    fn plot(points: Vec<Point>) -> Plot {
        Plot {
            name: "p".into(),
            title: "Quality by size".into(),
            x: PlotAxis::logarithmic("ratio"),
            y: PlotAxis::linear("masked PSNR, dB"),
            series: vec![PlotSeries { name: "model".into(), style: 1, dashed: false, points }],
            levels: vec![("noise-free".into(), 33.5)],
        }
    }

    fn svg(plot: &Plot) -> Option<String> {
        plot_bytes(std::slice::from_ref(plot), FileKind::Svg).unwrap().map(|bytes| String::from_utf8(bytes).unwrap())
    }

    #[test]
    fn what_can_be_shown_is_drawn() {
        let text =
            svg(&plot(vec![Point::new(20.0, 31.0), Point { range: Some([29.0, 30.5]), ..Point::new(300.0, 30.0) }]))
                .unwrap();
        for said in ["Quality by size", "ratio", "masked PSNR, dB", "model", "noise-free (33.5)", ">100<", ">20<"] {
            assert!(text.contains(said), "{said}");
        }
        assert!(svg(&plot(vec![Point::new(-1.0, f64::NAN)])).is_none());
        // A curve that the axes do not reach is told.
        let low = PlotSeries { name: "low".into(), style: 2, dashed: false, points: vec![Point::new(30.0, 0.5)] };
        let mut both = plot(vec![Point::new(20.0, 31.0)]);
        both.y.range = Some([30.0, 34.0]);
        both.series.push(low);
        let both = svg(&both).unwrap();
        assert!(both.contains("low (outside)") && !both.contains("model (outside)"));
        // Things without an order have their names, and no line from one to the next.
        let joined = plot(vec![Point::new(1.0, 31.0), Point::new(2.0, 29.0)]);
        let x = two_names();
        let apart = svg(&Plot { x, ..joined.clone() }).unwrap();
        let lines = |text: &str| text.matches("<polyline").count();
        assert!(apart.contains("box") && apart.contains("melt") && !apart.contains(">1.5<"));
        assert!(lines(&apart) < lines(&svg(&joined).unwrap()), "{apart}");
    }

    #[test]
    fn lines_end_where_the_axes_do() {
        let points = [1.0, 2.0, 50.0, 3.0].iter().enumerate().map(|(i, v)| Point::new(i as f64, *v)).collect();
        let series = PlotSeries { name: "s".into(), style: 0, dashed: false, points };
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
        let shaded = |text: &str| text.matches("fill=\"#eaeaea\"").count();
        assert_eq!(shaded(&text), shaded(&plain) + 2);
    }

    #[test]
    fn ticks_are_short() {
        let said = [0.5, 20.0, 5000.0, 2e5, 5e6, 1e7, 1e8, 0.0].map(number);
        assert_eq!(said, ["0.5", "20", "5000", "2×10⁵", "5×10⁶", "10⁷", "10⁸", "0"]);
        assert_eq!((number(31.25), number(1.25e6)), ("31.25".into(), "1.25×10⁶".into()));
    }

    /// Views are counted: there is none at one and a half. A short logarithmic axis has more than one tick.
    #[test]
    fn ticks_are_at_what_there_is() {
        let ticks = |points: &[f64], x: PlotAxis| {
            let points = points.iter().map(|x| Point::new(*x, 30.0 + x)).collect();
            svg(&Plot { x, ..plot(points) }).unwrap()
        };
        let views = ticks(&[1.0, 2.0, 3.0, 4.0], PlotAxis::linear("view"));
        assert!(views.contains(">3<") && !views.contains(">1.5<"), "{views}");
        assert!(ticks(&[1.0, 2.5], PlotAxis::linear("factor")).contains(">1.4<"));
        let short = ticks(&[1.1e5, 2.6e5], PlotAxis::logarithmic("particles"));
        assert!(short.contains(">1.5×10⁵<") && short.contains(">2×10⁵<"), "{short}");
    }

    /// A picture that is the truth has a place, and no curve runs to it.
    #[test]
    fn identical_pictures_stand_at_the_top_edge() {
        let some = plot(vec![Point::new(5.0, f64::INFINITY), Point::new(20.0, 40.0), Point::new(300.0, 29.0)]);
        let [with, without] = [&some.series[0].points[..], &some.series[0].points[1..]].map(|points| {
            let series = vec![PlotSeries { points: points.to_vec(), ..some.series[0].clone() }];
            svg(&Plot { series, ..some.clone() }).unwrap()
        });
        let count = |text: &str, element: &str| text.matches(element).count();
        assert_eq!(count(&with, "<polygon"), count(&without, "<polygon") + 1);
        assert_eq!(count(&with, "stroke-width=\"1.2\""), count(&without, "stroke-width=\"1.2\""));
        assert!(with.contains("top edge: identical") && !without.contains("top edge"));
        // Nothing but such has no axis to stand on.
        let all = Plot { levels: vec![], ..plot(vec![Point::new(5.0, f64::INFINITY)]) };
        assert!(!shows(&all) && shows(&some));
    }

    #[test]
    fn series_without_an_order_stand_beside_each_other() {
        let x = two_names();
        let named = Plot { x, ..plot(vec![Point::new(1.0, 31.0)]) };
        let second = PlotSeries { style: 3, points: vec![], ..named.series[0].clone() };
        let two = Plot { series: vec![named.series[0].clone(), second], ..named.clone() };
        assert_eq!((aside(&named, 0), aside(&two, 0), aside(&two, 1)), (0.0, -0.25 * SLOT, 0.25 * SLOT));
        assert_eq!(aside(&plot(vec![]), 0), 0.0);
        assert!(svg(&two).unwrap().contains("model (none)"));
    }

    #[test]
    fn one_value_alone_has_an_axis() {
        let axis = |v: f64| AxisScale::new(&PlotAxis::linear(""), [v].into_iter()).unwrap();
        assert!(axis(22.0).high - axis(22.0).low > 4.0 && number(22.0) == "22" && number(21.5) == "21.5");
        assert!(axis(0.0).high > 0.09);
    }

    #[test]
    fn figures_are_drawn_or_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let points = |all: &[(f64, f64)]| all.iter().map(|p| Point::new(p.0, p.1)).collect::<Vec<_>>();
        let plot = |name: &str, y: PlotAxis, all: &[(f64, f64)]| Plot {
            name: name.into(),
            x: PlotAxis::logarithmic("r [Mpc/h]"),
            y,
            ..plot(points(all))
        };
        let kinds = [FileKind::Svg, FileKind::Png, FileKind::Pdf];
        let ratio = plot("a", PlotAxis::linear("other / truth"), &[(0.1, 1.0), (2.0, f64::INFINITY)]);
        let upper = plot("a", PlotAxis::logarithmic("xi"), &[(0.1, 1.0), (1.0, -1.0), (2.0, 3.0)]);
        write_plots(dir.path(), &[upper, ratio], &kinds).unwrap();
        let svg = std::fs::read_to_string(dir.path().join("a.svg")).unwrap();
        assert!(svg.contains("r [Mpc/h]") && svg.contains("other / truth"));
        assert!(std::fs::read(dir.path().join("a.png")).unwrap().len() > 5000);
        assert!(std::fs::read(dir.path().join("a.pdf")).unwrap().starts_with(b"%PDF"));
        let nothing = plot("b", PlotAxis::logarithmic("xi"), &[(1.0, -1.0), (f64::NAN, 1.0)]);
        write_plots(dir.path(), &[Plot { levels: vec![], ..nothing }], &kinds).unwrap();
        assert!(!dir.path().join("b.svg").exists());
    }
}

//! Places of all parts of a figure: pictures in rows, axes and captions about each, one colour bar beside all.

use super::font;
use super::layout_parts::{MarkWriter, UNDER, bar_width, legend_rows};
use super::panel::{BarPlacement, Figure, Panel};
use super::sheet::{Anchor, Mark, PageRectangle, Sheet};
use super::ticks::{self, TickMarks};
use particlegs_core::{Error, Hint, Result};

/// The room there is for a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FigureSpace {
    /// Each pixel of a picture is one of the figure's; the figure is as large as that makes it.
    Pixels,
    /// The figure is so wide; pictures take what is left.
    Width(f64),
}

/// Room about a picture and about all of them, in units of the sheet.
struct Margins {
    /// About each picture: left, above, right, below.
    each: [f64; 4],
    /// About all: left, above, right, below.
    all: [f64; 4],
    gap: f64,
    /// Ticks of each picture's axes.
    ticks: Vec<Option<[TickMarks; 2]>>,
}

/// Places a figure's parts; letters are `em` high.
pub fn layout(figure: &Figure, em: f64, room: FigureSpace) -> Result<Sheet> {
    let Some(first) = figure.panels.first() else { return Err(Error::argument("a figure needs at least one picture")) };
    let size = first.image.size();
    let [w, h] = [size.width as f64, size.height as f64];
    let columns = figure.columns.clamp(1, figure.panels.len());
    let rows = figure.panels.len().div_ceil(columns);
    let (mut scale, mut margins);
    match room {
        FigureSpace::Pixels => {
            scale = 1.0;
            // Whole margins, so that each pixel of a picture is one of the sheet's.
            margins = Margins::new(figure, em, [w, h]).rounded();
        }
        FigureSpace::Width(total) => {
            // How many ticks there are is decided by the picture's size, and that by the room that their labels take.
            scale = total / (columns as f64 * w);
            margins = Margins::new(figure, em, [w * scale, h * scale]);
            for _ in 0..3 {
                // A figure that is too narrow is refused below; until then the scale stays positive.
                scale = ((total - margins.across(columns)) / (columns as f64 * w)).max(1e-6);
                margins = Margins::new(figure, em, [w * scale, h * scale]);
            }
            // These margins are the last, and pictures take exactly what they leave.
            scale = (total - margins.across(columns)) / (columns as f64 * w);
            if scale * w < 2.0 * em {
                let message = format!("a figure {total:.0} points wide is too narrow for letters of {em} points");
                let hint = Hint::from("use a larger ").option("figure-width", "").words(" or a smaller ");
                return Err(Error::argument_with(message, hint.option("font-size", "")));
            }
        }
    }
    let (w, h) = (w * scale, h * scale);
    let [left, above, right, below] = margins.each;
    let cell = [left + w + right + margins.gap, above + h + below + margins.gap];
    let inner = [columns as f64 * cell[0] - margins.gap, rows as f64 * cell[1] - margins.gap];
    let places: Vec<PageRectangle> = (0..figure.panels.len())
        .map(|i| {
            let x = margins.all[0] + (i % columns) as f64 * cell[0] + left;
            PageRectangle { x, y: margins.all[1] + (i / columns) as f64 * cell[1] + above, w, h }
        })
        .collect();
    let mut sheet = Sheet {
        width: margins.all[0] + inner[0] + margins.all[2],
        height: margins.all[1] + inner[1] + margins.all[3],
        ground: figure.page.paper(),
        marks: Vec::new(),
    };
    let whole =
        PageRectangle { x: places[0].x, y: places[0].y, w: inner[0] - left - right, h: inner[1] - above - below };
    let (page, ground, place, fine) = (figure.page, figure.ground, figure.place, matches!(room, FigureSpace::Width(_)));
    let mut writer = MarkWriter { page, ground, place, em, marks: &mut sheet.marks, fine };
    for (i, (panel, at)) in figure.panels.iter().zip(&places).enumerate() {
        writer.panel(panel, *at, above, margins.ticks[i].as_ref());
    }
    for i in scales(figure) {
        writer.scale(&figure.panels[i], places[i]);
    }
    if let Some(bar) = &figure.bar {
        writer.bar(bar, whole, places[places.len() - 1], right);
    }
    writer.legend(&legend_rows(&figure.legend, em, whole.w), whole.x, sheet.height - 0.5 * em);
    if let Some(title) = &figure.title {
        let at = [whole.x + 0.5 * whole.w, 1.45 * em];
        writer.words_within(title, at, 1.1 * em, Anchor::Middle, whole.w.max(sheet.width - em));
    }
    grow(&mut sheet, em, room);
    Ok(sheet)
}

/// The pictures that have a scale bar: one in a row's first, where all have the same.
fn scales(figure: &Figure) -> Vec<usize> {
    let has = |p: &Panel| p.scale.is_some();
    let shown: Vec<usize> = (0..figure.panels.len()).filter(|i| has(&figure.panels[*i])).collect();
    let same = shown.windows(2).all(|p| figure.panels[p[0]].scale == figure.panels[p[1]].scale);
    if !same || shown.len() < 2 || figure.place == BarPlacement::Inside {
        return shown;
    }
    // Under the first picture of the last row.
    let columns = figure.columns.clamp(1, figure.panels.len());
    vec![(figure.panels.len() - 1) / columns * columns]
}

impl Margins {
    fn new(figure: &Figure, em: f64, [w, h]: [f64; 2]) -> Margins {
        let ticks_of = |p: &Panel| {
            let [x, y] = p.axes.as_ref()?;
            Some([ticks::even(x.low, x.high, w / (3.4 * em)), ticks::even(y.low, y.high, h / (2.2 * em))])
        };
        let ticks: Vec<Option<[TickMarks; 2]>> = figure.panels.iter().map(ticks_of).collect();
        let widest = |k: usize| ticks.iter().flatten().map(|t| t[k].widest(em)).fold(0.0, f64::max);
        let mut each = [0.0; 4];
        if figure.panels.iter().any(|p| p.axes.is_some()) {
            each = [widest(1) + 2.3 * em, 0.5 * em, 0.5 * widest(0), UNDER * em];
        }
        if figure.panels.iter().any(|p| p.caption.is_some()) {
            each[1] = 1.6 * em;
        }
        let outside = figure.place != BarPlacement::Inside;
        let bars = figure.bar.is_some() || figure.panels.iter().any(|p| p.scale.is_some());
        let about = figure.title.is_some() || !figure.legend.is_empty() || each != [0.0; 4] || figure.panels.len() > 1;
        // Where everything stands on the picture there is no page about it.
        let mut all = [if outside && bars || about { 0.5 * em } else { 0.0 }; 4];
        if figure.title.is_some() {
            all[1] += 1.6 * em;
        }
        if let Some(bar) = figure.bar.as_ref().filter(|_| outside) {
            all[2] += bar_width(bar, em);
        }
        if outside && !scales(figure).is_empty() {
            all[3] += 2.0 * em;
        }
        let columns = figure.columns.clamp(1, figure.panels.len()) as f64;
        all[3] += legend_rows(&figure.legend, em, columns * w).len() as f64 * 1.5 * em;
        Margins { each, all, gap: 0.7 * em, ticks }
    }

    /// The rest of a width beside pictures next to one another.
    fn across(&self, columns: usize) -> f64 {
        let n = columns as f64;
        self.all[0] + self.all[2] + n * (self.each[0] + self.each[2]) + (n - 1.0) * self.gap
    }

    fn rounded(self) -> Margins {
        let gap = self.gap.ceil();
        Margins { each: self.each.map(f64::ceil), all: self.all.map(f64::ceil), gap, ..self }
    }
}

/// A sheet is never smaller than what stands on it: labels of a small picture may be longer than it.
fn grow(sheet: &mut Sheet, em: f64, room: FigureSpace) {
    if room != FigureSpace::Pixels {
        return;
    }
    let (mut low, mut high) = ([0.0f64; 2], [sheet.width, sheet.height]);
    for mark in &sheet.marks {
        let Mark::Words(w) = mark else { continue };
        let long = font::width(&w.text, w.em);
        let from = -w.anchor.before(long);
        let [x, y] = w.at;
        let area = match w.turned {
            false => [x + from, y - w.em, x + from + long, y + 0.3 * w.em],
            // Turned text is read upwards: it ends above the place where it begins.
            true => [x - w.em, y - from - long, x + 0.3 * w.em, y - from],
        };
        let pad = 0.3 * em;
        low = [low[0].min(area[0] - pad), low[1].min(area[1] - pad)];
        high = [high[0].max(area[2] + pad), high[1].max(area[3] + pad)];
    }
    let shift = low.map(|v| (-v).ceil().max(0.0));
    sheet.width = high[0].ceil() + shift[0];
    sheet.height = high[1].ceil() + shift[1];
    if shift == [0.0; 2] {
        return;
    }
    for mark in &mut sheet.marks {
        match mark {
            Mark::Picture(a, _) | Mark::Fill(a, _) => (a.x, a.y) = (a.x + shift[0], a.y + shift[1]),
            Mark::Polygon(points, _) | Mark::Line { points, .. } => {
                points.iter_mut().for_each(|p| *p = [p[0] + shift[0], p[1] + shift[1]])
            }
            Mark::Words(w) => w.at = [w.at[0] + shift[0], w.at[1] + shift[1]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ColourBar, EdgeAxis, FigureImage, ScaleBar, raster};
    use particlegs_core::picture::{Gray8, Size};

    fn figure(size: Size, panels: usize, axes: bool) -> Figure {
        let panel = Panel {
            caption: Some("model of 20 000 Gaussians".into()),
            scale: Some(ScaleBar { share: 0.2, label: "20 Mpc h⁻¹ (comoving), at the focal point".into() }),
            axes: axes
                .then(|| ["x", "y"].map(|n| EdgeAxis { label: format!("{n} (Mpc h⁻¹)"), low: -12.5, high: 12.5 })),
            ..Panel::plain(FigureImage::Gray(Gray8::black(size)))
        };
        Figure {
            title: Some("Σ of the bundled sample".into()),
            bar: Some(ColourBar {
                title: "Σ (10¹⁰ M⊙ h Mpc⁻²)".into(),
                colours: (0..=255).map(|v| [v; 3]).collect(),
                ticks: ticks::logarithmic(1e6, 3e11),
            }),
            legend: vec![("dark matter".into(), [230, 159, 0]), ("gas".into(), [86, 180, 233])],
            ..Figure::plain(vec![panel; panels], 2)
        }
    }

    /// On a white page all that is dark was drawn, and none of it touches the edge, whatever the size.
    #[test]
    fn nothing_is_cut_off() {
        for (width, height, panels, axes) in [
            (64, 36, 1, false),
            (480, 270, 1, true),
            (270, 480, 3, false),
            (512, 512, 2, true),
            (1920, 1080, 1, true),
            (16, 400, 1, true),
        ] {
            let sheet = layout(&figure(Size { width, height }, panels, axes), 14.0, FigureSpace::Pixels).unwrap();
            let page = raster(&sheet).unwrap();
            let (w, h) = (page.size.width, page.size.height);
            for (i, _) in page.data.iter().enumerate().filter(|(_, p)| p[0] < 128) {
                let (x, y) = (i % w, i / w);
                assert!(x > 0 && y > 0 && x + 1 < w && y + 1 < h, "{width}x{height}: {x} {y} of {w} {h}");
            }
        }
    }

    #[test]
    fn a_figure_is_as_wide_as_it_is_told() {
        for width in [238.0, 504.0] {
            let sheet =
                layout(&figure(Size { width: 1920, height: 1080 }, 2, true), 8.0, FigureSpace::Width(width)).unwrap();
            assert!((sheet.width - width).abs() < 1e-6, "{}", sheet.width);
        }
        let small = layout(&figure(Size { width: 64, height: 64 }, 2, true), 8.0, FigureSpace::Width(60.0));
        assert!(small.unwrap_err().to_string().contains("too narrow"));
    }

    #[test]
    fn pixels_are_left_as_they_are() {
        let size = Size { width: 33, height: 21 };
        let mut f = figure(size, 1, false);
        let levels: Vec<u8> = (0..size.pixels()).map(|i| (i % 251) as u8).collect();
        f.panels[0].image = FigureImage::Gray(Gray8 { size, data: levels.clone() });
        let sheet = layout(&f, 11.0, FigureSpace::Pixels).unwrap();
        let page = raster(&sheet).unwrap();
        let Some(Mark::Picture(at, _)) = sheet.marks.iter().find(|m| matches!(m, Mark::Picture(..))) else { panic!() };
        for (i, level) in levels.iter().enumerate() {
            let (x, y) = (at.x as usize + i % size.width, at.y as usize + i / size.width);
            assert_eq!(page.data[y * page.size.width + x], [*level; 3]);
        }
    }
}

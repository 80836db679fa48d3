//! The parts of a figure as marks: a picture with its axes and lines, scale bars, the colour bar, the legend.

use super::FigureImage;
use super::font::{self, CAPITALS};
use super::panel::{BarPlacement, ColourBar, Panel, PaperColour};
use super::sheet::{Anchor, Mark, PageRectangle, RgbColour, TextLine};
use super::ticks::TickMarks;
use particlegs_core::picture::{Rgb8, Size};

/// In ems: from the pictures to the bar, its width, ticks, room before labels, and before the title.
const TO_BAR: f64 = 0.8;
const BAR: f64 = 0.9;
const TICK: f64 = 0.35;
const SPACE: f64 = 0.25;
/// Ticks, numbers and names under a picture, ems.
pub const UNDER: f64 = 3.1;
/// Darkness of the edges of a box on a picture.
const EDGES: f64 = 0.6;

/// Room that a colour bar takes beside the pictures.
pub fn bar_width(bar: &ColourBar, em: f64) -> f64 {
    bar.ticks.widest(em) + (TO_BAR + BAR + TICK + 2.0 * SPACE + 1.1) * em
}

/// Adds marks for a figure.
pub struct MarkWriter<'a> {
    /// The page about the pictures, and their own ground.
    pub page: PaperColour,
    pub ground: PaperColour,
    pub place: BarPlacement,
    /// Height of an em.
    pub em: f64,
    /// The marks that are drawn so far.
    pub marks: &'a mut Vec<Mark>,
    /// Whether lines may be thinner than a unit.
    pub fine: bool,
}

impl MarkWriter<'_> {
    fn thin(&self) -> f64 {
        if self.fine { 0.06 * self.em } else { (self.em / 16.0).round().max(1.0) }
    }

    pub fn line(&mut self, points: Vec<[f64; 2]>, ink: RgbColour) {
        let width = self.thin();
        self.marks.push(Mark::Line { points, width, ink, opacity: 1.0 });
    }

    fn text(&self, text: &str, at: [f64; 2], em: f64, anchor: Anchor) -> TextLine {
        TextLine { text: text.into(), at, em, ink: self.page.ink(), anchor, turned: false, rim: None }
    }

    fn write(&mut self, words: TextLine) {
        if !words.text.is_empty() {
            self.marks.push(Mark::Words(words));
        }
    }

    fn words(&mut self, text: &str, at: [f64; 2], anchor: Anchor) {
        self.write(self.text(text, at, self.em, anchor));
    }

    /// Text that is set smaller where it is too long, down to a half.
    pub fn words_within(&mut self, text: &str, at: [f64; 2], em: f64, anchor: Anchor, room: f64) {
        self.write(self.text(text, at, em * (room / font::width(text, em).max(1e-9)).clamp(0.5, 1.0), anchor));
    }

    /// Text on a picture.
    fn on_picture(&mut self, text: &str, at: [f64; 2], anchor: Anchor) {
        let (ink, rim) = (self.ground.ink(), Some(self.ground.paper()));
        self.write(TextLine { ink, rim, ..self.text(text, at, self.em, anchor) });
    }

    /// A picture, its caption, what is drawn on it and its axes.
    pub fn panel(&mut self, panel: &Panel, at: PageRectangle, above: f64, ticks: Option<&[TickMarks; 2]>) {
        let em = self.em;
        self.marks.push(Mark::Picture(at, panel.image.clone()));
        let place = |p: [f64; 2]| [at.x + p[0] * at.w, at.y + p[1] * at.h];
        for [from, to] in &panel.lines {
            let (width, ink) = (self.thin(), self.ground.ink());
            self.marks.push(Mark::Line { points: vec![place(*from), place(*to)], width, ink, opacity: EDGES });
        }
        for (p, name) in &panel.names {
            let [x, y] = place(*p);
            let half = 0.5 * font::width(name, em);
            // `clamp` panics where its ends are out of order: a picture may be narrower than the name.
            let x = x.clamp(at.x + half + 0.4 * em, (at.right() - half - 0.4 * em).max(at.x + half + 0.4 * em));
            let lowest = (at.bottom() - 0.7 * em).max(at.y + 1.4 * em);
            self.on_picture(name, [x, (y + 0.3 * em).clamp(at.y + 1.4 * em, lowest)], Anchor::Middle);
        }
        // On a page of its own colour a picture has no edge to be seen.
        if panel.axes.is_some() || self.page == self.ground {
            let ink = if panel.axes.is_some() { self.page.ink() } else { [128; 3] };
            self.line(at.outline(), ink);
        }
        if let Some(caption) = &panel.caption {
            let base = at.y - if above > 1.6 * em { above - 1.2 * em } else { 0.45 * em };
            self.words_within(caption, [at.x + 0.5 * at.w, base], em, Anchor::Middle, at.w);
        }
        if let (Some([x, y]), Some(ticks)) = (&panel.axes, ticks) {
            self.axes(at, [&x.label, &y.label], ticks);
        }
    }

    /// Ticks, numbers and names under and beside an area.
    pub fn axes(&mut self, at: PageRectangle, labels: [&str; 2], ticks: &[TickMarks; 2]) {
        let (em, ink) = (self.em, self.page.ink());
        let tick = TICK * em;
        for (k, ticks) in ticks.iter().enumerate() {
            let place = |share: f64, out: f64| match k {
                0 => [at.x + share * at.w, at.bottom() + out],
                _ => [at.x - out, at.bottom() - share * at.h],
            };
            for share in &ticks.minor {
                self.line(vec![place(*share, 0.0), place(*share, 0.5 * tick)], ink);
            }
            for (share, label) in &ticks.major {
                self.line(vec![place(*share, 0.0), place(*share, tick)], ink);
                match (k, place(*share, tick)) {
                    (0, [x, y]) => self.words(label, [x, y + em], Anchor::Middle),
                    (_, [x, y]) => self.words(label, [x - SPACE * em, y + 0.5 * CAPITALS * em], Anchor::End),
                }
            }
        }
        self.words(labels[0], [at.x + 0.5 * at.w, at.bottom() + tick + 2.3 * em], Anchor::Middle);
        let x = at.x - tick - ticks[1].widest(em) - (SPACE + 0.6) * em;
        self.turned(labels[1], [x, at.y + 0.5 * at.h], at.h);
    }

    fn turned(&mut self, text: &str, at: [f64; 2], height: f64) {
        let room = (height + 0.8 * self.em) / font::width(text, self.em).max(1e-9);
        // Sheets of pixels grow with it.
        let em = if self.fine { self.em * room.clamp(0.5, 1.0) } else { self.em };
        self.write(TextLine { turned: true, ..self.text(text, at, em, Anchor::Middle) });
    }

    /// A scale bar under its picture, or on it.
    pub fn scale(&mut self, panel: &Panel, at: PageRectangle) {
        let Some(scale) = &panel.scale else { return };
        let (em, long) = (self.em, scale.share * at.w);
        let thick = if self.fine { 0.16 * em } else { (em / 6.0).round().max(2.0) };
        match self.place {
            BarPlacement::Outside | BarPlacement::None => {
                let y = at.bottom() + 1.3 * em + if panel.axes.is_some() { UNDER * em } else { 0.0 };
                let ink = self.page.ink();
                self.length([at.x, y], long, thick, 0.0, ink);
                let room = at.w - long - 0.6 * em;
                let label_width = font::width(&scale.label, em);
                // Beside its bar; where that is too narrow, as small as it need be.
                let em = if self.fine { em * (room / label_width).clamp(0.6, 1.0) } else { em };
                let place = [at.x + long + 0.6 * self.em, y + 0.5 * CAPITALS * em];
                self.write(self.text(&scale.label, place, em, Anchor::Start));
            }
            BarPlacement::Inside => {
                let label = font::width(&scale.label, em);
                if at.h < 5.0 * em || at.w < label.max(long) + 2.0 * em {
                    return;
                }
                let (x, y) = (at.x + em, at.bottom() - em);
                let rim = if self.fine { 0.1 * em } else { (0.1 * em).round().max(1.0) };
                let (ink, paper) = (self.ground.ink(), self.ground.paper());
                self.length([x, y], long, thick, rim, paper);
                self.length([x, y], long, thick, 0.0, ink);
                self.on_picture(&scale.label, [x, y - 0.7 * em], Anchor::Start);
            }
        }
    }

    /// A bar with marks at its ends, so that the length reads exactly; all of it wider by a rim.
    fn length(&mut self, [x, y]: [f64; 2], long: f64, thick: f64, rim: f64, ink: RgbColour) {
        let mut part = |x: f64, y: f64, w: f64, h: f64| {
            let area = PageRectangle { x: x - rim, y: y - rim, w: w + 2.0 * rim, h: h + 2.0 * rim };
            self.marks.push(Mark::Fill(area, ink));
        };
        part(x, y - 0.5 * thick, long, thick);
        for end in [x, x + long - 0.5 * thick] {
            part(end, y - 1.25 * thick, 0.5 * thick, 2.5 * thick);
        }
    }

    /// The colour bar: beside all pictures, or on the last.
    pub fn bar(&mut self, bar: &ColourBar, all: PageRectangle, last: PageRectangle, right: f64) {
        let em = self.em;
        let outside = self.place != BarPlacement::Inside;
        let strip = match outside {
            true => PageRectangle { x: all.right() + right + TO_BAR * em, y: all.y, w: BAR * em, h: all.h },
            false => {
                PageRectangle { x: last.right() - (BAR + 1.0) * em, y: last.y + 2.2 * em, w: BAR * em, h: 0.6 * last.h }
            }
        };
        let title = font::width(&bar.title, em);
        // On a small picture the bar would hide most of it.
        if !outside && (last.h < 12.0 * em || last.w < title + 2.0 * em) {
            return;
        }
        // Between pixels the strip and its outline would be blurred.
        let strip = if self.fine { strip } else { PageRectangle { x: strip.x.round(), y: strip.y.round(), ..strip } };
        self.marks.push(Mark::Picture(strip, column(&bar.colours)));
        let ink = if outside { self.page.ink() } else { self.ground.ink() };
        self.line(strip.outline(), ink);
        let (x, r, b) = (strip.x, strip.right(), strip.bottom());
        // Ticks point away from the pictures, or, on one, into it.
        let (edge, away) = if outside { (r, 1.0) } else { (x, -1.0) };
        for share in &bar.ticks.minor {
            let y = b - share * strip.h;
            self.line(vec![[edge, y], [edge + away * 0.5 * TICK * em, y]], ink);
        }
        let mut free = f64::INFINITY;
        for (share, label) in &bar.ticks.major {
            let y = b - share * strip.h;
            self.line(vec![[edge, y], [edge + away * TICK * em, y]], ink);
            // Labels that would touch are left out.
            if y + 0.6 * em > free {
                continue;
            }
            free = y - 0.6 * em;
            let at = [edge + away * (TICK + SPACE) * em, y + 0.5 * CAPITALS * em];
            match outside {
                true => self.words(label, at, Anchor::Start),
                false => self.on_picture(label, at, Anchor::End),
            }
        }
        match outside {
            true => {
                let x = all.right() + right + bar_width(bar, em) - 0.3 * em;
                self.turned(&bar.title, [x, strip.y + 0.5 * strip.h], strip.h);
            }
            false => self.on_picture(&bar.title, [last.right() - em, last.y + 1.4 * em], Anchor::End),
        }
    }

    /// Squares of colour with what each stands for, in rows that end at `bottom`.
    pub fn legend(&mut self, rows: &[Vec<LegendEntry<'_>>], left: f64, bottom: f64) {
        let em = self.em;
        // From the last row up, since the place of the lowest is known.
        for (i, row) in rows.iter().rev().enumerate() {
            let base = bottom - i as f64 * 1.5 * em - 0.2 * em;
            for (x, name, ink) in row {
                let edge = CAPITALS * em;
                self.marks.push(Mark::Fill(PageRectangle { x: left + x, y: base - edge, w: edge, h: edge }, *ink));
                self.words(name, [left + x + 1.1 * em, base], Anchor::Start);
            }
        }
    }
}

/// The beginning of a name in its row of the legend, the name, and its colour.
pub type LegendEntry<'a> = (f64, &'a str, RgbColour);

/// The legend in rows no wider than this, where a name alone is not wider.
pub fn legend_rows(legend: &[(String, RgbColour)], em: f64, width: f64) -> Vec<Vec<LegendEntry<'_>>> {
    let (mut rows, mut used): (Vec<Vec<LegendEntry<'_>>>, f64) = (Vec::new(), 0.0);
    for (name, ink) in legend {
        let entry_width = font::width(name, em) + 2.4 * em;
        if rows.is_empty() || used > 0.0 && used + entry_width > width {
            rows.push(Vec::new());
            used = 0.0;
        }
        rows.last_mut().into_iter().for_each(|row| row.push((used, name, *ink)));
        used += entry_width;
    }
    rows
}

/// Colours from below to above, as a picture one pixel wide.
fn column(colours: &[RgbColour]) -> FigureImage {
    let size = Size { width: 1, height: colours.len() };
    FigureImage::Color(Rgb8 { size, data: colours.iter().rev().copied().collect() })
}

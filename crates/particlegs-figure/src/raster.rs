//! A sheet as pixels.

use super::sheet::{Mark, PageRectangle, RgbColour, Sheet, TextLine};
use super::{FigureImage, font};
use particlegs_core::picture::{Rgb8, Size};
use particlegs_core::{Error, Result};
use particlegs_files::memory;
use std::ops::Range;

/// Larger figures are refused before memory is taken.
const LARGEST_SIDE: f64 = 65_536.0;

/// Draws a sheet whose unit is a pixel.
pub fn raster(sheet: &Sheet) -> Result<Rgb8> {
    let (width, height) = (sheet.width.ceil(), sheet.height.ceil());
    // In this form the test refuses NaN as well.
    if !(width <= LARGEST_SIDE && height <= LARGEST_SIDE) {
        return Err(Error::argument(format!("a figure of {width} x {height} pixels is too large")));
    }
    let size = Size { width: width as usize, height: height as usize };
    // Colours, and how far a line covers them.
    memory::require("a figure", 7 * size.pixels() as u64)?;
    let mut page = Rgb8 { size, data: vec![sheet.ground; size.pixels()] };
    for mark in &sheet.marks {
        match mark {
            Mark::Picture(area, image) => picture(&mut page, *area, image),
            Mark::Fill(area, ink) => fill(&mut page, *area, *ink),
            Mark::Polygon(corners, ink) => polygon(&mut page, corners, *ink),
            Mark::Line { points, width, ink, opacity } => line(&mut page, points, *width, *ink, *opacity),
            Mark::Words(words) => write(&mut page, words),
        }
    }
    Ok(page)
}

/// The whole pixels of an area, as far as the page has them.
fn pixels(page: &Rgb8, area: PageRectangle) -> [Range<usize>; 2] {
    let range = |from: f64, to: f64, edge: usize| {
        let place = |v: f64| v.round().clamp(0.0, edge as f64) as usize;
        place(from)..place(to)
    };
    [range(area.x, area.right(), page.size.width), range(area.y, area.bottom(), page.size.height)]
}

fn picture(page: &mut Rgb8, area: PageRectangle, image: &FigureImage) {
    let [columns, rows] = pixels(page, area);
    let (size, [across, down]) = (image.size(), [columns.len(), rows.len()]);
    for (j, y) in rows.enumerate() {
        let row = j * size.height / down.max(1);
        let to = &mut page.data[y * page.size.width..][columns.clone()];
        match image {
            FigureImage::Color(c) if across == size.width => to.copy_from_slice(&c.data[row * across..][..across]),
            _ => to.iter_mut().enumerate().for_each(|(i, p)| *p = image.pixel(i * size.width / across, row)),
        }
    }
}

fn fill(page: &mut Rgb8, area: PageRectangle, ink: RgbColour) {
    let [columns, rows] = pixels(page, area);
    for y in rows {
        page.data[y * page.size.width..][columns.clone()].fill(ink);
    }
}

/// Level and upright lines lie on whole pixels, so that they are sharp; others are blended by how far they cover a
/// pixel.
fn line(page: &mut Rgb8, points: &[[f64; 2]], width: f64, ink: RgbColour, opacity: f64) {
    let pairs = || points.windows(2).map(|pair| (pair[0], pair[1]));
    if opacity < 1.0 || points.len() < 2 || !pairs().all(|(a, b)| a[0] == b[0] || a[1] == b[1]) {
        return stroke(page, points, width.max(1.0), ink, opacity);
    }
    for (a, b) in pairs() {
        let thick = width.round().max(1.0);
        let from = [a[0].min(b[0]), a[1].min(b[1])];
        let long = (a[0] - b[0]).abs() + (a[1] - b[1]).abs();
        let side = |v: f64| (v - 0.5 * thick).round();
        let area = match a[1] == b[1] {
            true => PageRectangle { x: from[0], y: side(a[1]), w: long.max(1.0), h: thick },
            false => PageRectangle { x: side(a[0]), y: from[1], w: thick, h: long.max(1.0) },
        };
        fill(page, area, ink);
    }
}

/// The pixels of the page within reach of points.
fn window(page: &Rgb8, points: &[[f64; 2]], reach: f64) -> [Range<i64>; 2] {
    [(0, page.size.width), (1, page.size.height)].map(|(k, edge)| {
        let low = points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min) - reach;
        let high = points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max) + reach;
        let place = |v: f64| v.clamp(0.0, edge as f64) as i64;
        place(low.floor())..place(high.ceil())
    })
}

/// Part of the pixels of a window that something covers, from 0 to 1.
struct Coverage {
    columns: Range<i64>,
    rows: Range<i64>,
    cover: Vec<f32>,
}

impl Coverage {
    fn new([columns, rows]: [Range<i64>; 2]) -> Coverage {
        let long = |r: &Range<i64>| (r.end - r.start).max(0) as usize;
        Coverage { cover: vec![0.0; long(&columns) * long(&rows)], columns, rows }
    }

    fn at(&mut self, x: i64, y: i64) -> Option<&mut f32> {
        let inside = self.columns.contains(&x) && self.rows.contains(&y);
        let at = (y - self.rows.start) * (self.columns.end - self.columns.start) + x - self.columns.start;
        if inside { self.cover.get_mut(at as usize) } else { None }
    }

    /// Pixels that are covered.
    fn pixels(&self) -> impl Iterator<Item = (i64, i64, f32)> {
        let all = self.rows.clone().flat_map(|y| self.columns.clone().map(move |x| (x, y)));
        all.zip(&self.cover).map(|((x, y), c)| (x, y, *c)).filter(|p| p.2 > 0.0)
    }

    /// The pixels within a distance of the covered ones.
    fn widened(&self, by: f64) -> Coverage {
        let reach = by.ceil() as i64;
        let mut wide = Coverage::new([self.columns.clone(), self.rows.clone()]);
        for (x, y, c) in self.pixels() {
            for (dx, dy) in (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy))) {
                // A disc whose edge is blended over one pixel.
                let share = (by + 0.5 - ((dx * dx + dy * dy) as f64).sqrt()).clamp(0.0, 1.0) as f32 * c;
                if let Some(here) = wide.at(x + dx, y + dy) {
                    *here = here.max(share);
                }
            }
        }
        wide
    }
}

/// A path with round ends and corners; where it crosses itself it is blended once. A single point is a disc.
fn stroke(page: &mut Rgb8, path: &[[f64; 2]], width: f64, ink: RgbColour, opacity: f64) {
    let reach = 0.5 * width + 0.5;
    let mut covered = Coverage::new(window(page, path, reach));
    // A single point makes a window of one, of which both ends are the same.
    for pair in path.windows(path.len().clamp(1, 2)) {
        let (a, b) = (pair[0], pair[pair.len() - 1]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        let [columns, rows] = window(page, pair, reach);
        for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
            let p = [x as f64 + 0.5 - a[0], y as f64 + 0.5 - a[1]];
            let t = if squared > 0.0 { ((p[0] * along[0] + p[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
            let away = (p[0] - t * along[0]).hypot(p[1] - t * along[1]);
            if let Some(here) = covered.at(x, y) {
                // The larger cover and not the sum: segments overlap at corners.
                *here = here.max((reach - away).clamp(0.0, 1.0) as f32);
            }
        }
    }
    covered.pixels().for_each(|(x, y, c)| blend(page, x, y, ink, f64::from(c) * opacity));
}

/// Each pixel by how many of sixteen points in it lie between the corners.
fn polygon(page: &mut Rgb8, corners: &[[f64; 2]], ink: RgbColour) {
    let [columns, rows] = window(page, corners, 0.0);
    let inside = |[x, y]: [f64; 2]| {
        let sides = corners.iter().zip(corners.iter().cycle().skip(1));
        let crossed = |(a, b): &(&[f64; 2], &[f64; 2])| {
            // A side has its lower end and not its upper one: a ray through a corner crosses once.
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        };
        sides.filter(crossed).count() % 2 == 1
    };
    for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
        let point = |i: usize| [x as f64 + ((i % 4) as f64 + 0.5) / 4.0, y as f64 + ((i / 4) as f64 + 0.5) / 4.0];
        let count = (0..16).filter(|i| inside(point(*i))).count();
        blend(page, x, y, ink, count as f64 / 16.0);
    }
}

fn blend(page: &mut Rgb8, x: i64, y: i64, ink: RgbColour, cover: f64) {
    let (width, height) = (page.size.width as i64, page.size.height as i64);
    if x < 0 || y < 0 || x >= width || y >= height || cover <= 0.0 {
        return;
    }
    let pixel = &mut page.data[(y * width + x) as usize];
    for (below, above) in pixel.iter_mut().zip(ink) {
        let old = f64::from(*below);
        *below = (old + (f64::from(above) - old) * cover.min(1.0)).round() as u8;
    }
}

fn write(page: &mut Rgb8, words: &TextLine) {
    let (glyphs, width) = font::placed(&words.text, words.em);
    let start = -words.anchor.before(width);
    // The fraction of a pixel that the place lies beyond a whole one, along the text.
    let (x, y) = (words.at[0].floor(), words.at[1].round());
    let offset = if words.turned { 0.0 } else { words.at[0] - x };
    let rim = if words.rim.is_some() { (0.11 * words.em).max(1.0) } else { 0.0 };
    let margin = rim.ceil() as i64 + 2;
    // Relative to the whole-numbered place.
    let mut covered = Coverage::new([
        start.floor() as i64 - margin..(start + width).ceil() as i64 + margin + 1,
        (-1.1 * words.em).floor() as i64 - margin..(0.4 * words.em).ceil() as i64 + margin,
    ]);
    for (id, pen) in glyphs {
        let Some(outline) = font::outline(id, words.em, [start + offset + pen, 0.0]) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|x, y, cover| {
            if let Some(here) = covered.at(corner.x as i64 + i64::from(x), corner.y as i64 + i64::from(y)) {
                // Letters that touch share a pixel.
                *here = (*here + cover).clamp(0.0, 1.0);
            }
        });
    }
    let mut put = |covered: &Coverage, ink: RgbColour| {
        for (u, v, cover) in covered.pixels() {
            let (px, py) = if words.turned { (x as i64 + v, y as i64 - u) } else { (x as i64 + u, y as i64 + v) };
            blend(page, px, py, ink, f64::from(cover));
        }
    };
    if let Some(ink) = words.rim {
        put(&covered.widened(rim), ink);
    }
    put(&covered, words.ink);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Anchor;
    use particlegs_core::picture::Gray8;

    fn page(marks: Vec<Mark>) -> Rgb8 {
        raster(&Sheet { width: 60.0, height: 40.0, ground: [255; 3], marks }).unwrap()
    }

    #[test]
    fn pictures_keep_their_pixels() {
        let size = Size { width: 7, height: 5 };
        let image = FigureImage::Gray(Gray8 { size, data: (0..35).map(|i| i * 7).collect() });
        let drawn = page(vec![Mark::Picture(PageRectangle { x: 11.0, y: 3.0, w: 7.0, h: 5.0 }, image.clone())]);
        for y in 0..5 {
            for x in 0..7 {
                assert_eq!(drawn.data[(y + 3) * 60 + x + 11], image.pixel(x, y));
            }
        }
        assert_eq!(drawn.data[3 * 60 + 10], [255; 3]);
    }

    #[test]
    fn turned_text_is_the_same_text() {
        let words = |turned| TextLine {
            text: "Σ (Mpc)".into(),
            at: [30.0, 20.0],
            em: 8.0,
            ink: [0; 3],
            anchor: Anchor::Middle,
            turned,
            rim: None,
        };
        let dark =
            |turned| -> u32 { page(vec![Mark::Words(words(turned))]).data.iter().map(|p| 255 - u32::from(p[0])).sum() };
        assert!(dark(false) > 2000);
        assert_eq!(dark(false), dark(true));
    }

    #[test]
    fn level_lines_are_sharp() {
        let line = Mark::Line { points: vec![[10.0, 20.0], [30.0, 20.0]], width: 2.0, ink: [0; 3], opacity: 1.0 };
        let drawn = page(vec![line]);
        assert!(drawn.data.iter().all(|p| *p == [0; 3] || *p == [255; 3]));
        assert_eq!(drawn.data.iter().filter(|p| **p == [0; 3]).count(), 40);
    }
    fn stroked(path: &[[f64; 2]], width: f64, opacity: f64) -> Vec<u8> {
        let size = Size { width: 9, height: 9 };
        let mut page = Rgb8 { size, data: vec![[255; 3]; size.pixels()] };
        // From the middles of pixels.
        let path: Vec<[f64; 2]> = path.iter().map(|p| p.map(|v| v + 0.5)).collect();
        stroke(&mut page, &path, width, [0; 3], opacity);
        page.data.iter().map(|p| p[0]).collect()
    }

    #[test]
    fn strokes_cover_what_they_are_wide() {
        let line = stroked(&[[2.0, 4.0], [6.0, 4.0]], 1.0, 1.0);
        assert_eq!(line.iter().filter(|v| **v == 0).count(), 5);
        assert_eq!(line.iter().filter(|v| **v < 255).count(), 5);
        let wide = stroked(&[[-3.0, 4.0], [20.0, 4.0]], 2.0, 1.0);
        assert!(wide[3 * 9..4 * 9].iter().all(|v| *v == 128) && wide[4 * 9..5 * 9].iter().all(|v| *v == 0));
        let disc = stroked(&[[4.0, 4.0]], 6.0, 1.0);
        let area: f32 = disc.iter().map(|v| 1.0 - f32::from(*v) / 255.0).sum();
        assert!((area - 28.3).abs() < 1.0, "{area}");
    }

    #[test]
    fn crossings_are_blended_once_and_the_outside_is_left_alone() {
        let cross = stroked(&[[0.0, 4.0], [8.0, 4.0], [4.0, 4.0], [4.0, 0.0], [4.0, 8.0]], 1.0, 0.5);
        assert!(cross.iter().all(|v| [255, 128].contains(v)) && cross[4 * 9 + 4] == 128);
        assert!(stroked(&[[-40.0, -40.0], [-20.0, 50.0]], 3.0, 1.0).iter().all(|v| *v == 255));
        assert!(stroked(&[], 3.0, 1.0).iter().all(|v| *v == 255));
    }
}

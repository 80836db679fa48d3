//! A sheet as pixels.

use super::FigureImage;
use super::font;
use super::sheet::{Anchor, Mark, PageRectangle, RgbColour, Sheet, TextLine};
use particlegs::picture::{Rgb8, Size};
use particlegs::{Error, Result};
use particlegs_files::memory;

/// Larger figures are refused before memory is taken.
const LARGEST_SIDE: f64 = 65_536.0;

/// Draws a sheet whose unit is a pixel.
pub fn raster(sheet: &Sheet) -> Result<Rgb8> {
    let (width, height) = (sheet.width.ceil(), sheet.height.ceil());
    if !(width <= LARGEST_SIDE && height <= LARGEST_SIDE) {
        return Err(Error::argument(format!("a figure of {width} x {height} pixels is too large")));
    }
    let size = Size { width: width as usize, height: height as usize };
    memory::require("a figure", 4 * size.pixels() as u64)?;
    let mut page = Rgb8 { size, data: vec![sheet.ground; size.pixels()] };
    for mark in &sheet.marks {
        match mark {
            Mark::Picture(area, image) => picture(&mut page, *area, image),
            Mark::Fill(area, ink) => fill(&mut page, *area, *ink),
            Mark::Line { points, width, ink, opacity } => line(&mut page, points, *width, *ink, *opacity),
            Mark::Words(words) => write(&mut page, words),
        }
    }
    Ok(page)
}

/// The whole pixels of an area, as far as the page has them.
fn pixels(page: &Rgb8, area: PageRectangle) -> [std::ops::Range<usize>; 2] {
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

/// Level lines lie on whole pixels, so that they are sharp; others are blended by how far they cover a pixel.
fn line(page: &mut Rgb8, points: &[[f64; 2]], width: f64, ink: RgbColour, opacity: f64) {
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let (level, upright) = (a[1] == b[1], a[0] == b[0]);
        if opacity == 1.0 && (level || upright) {
            let thick = width.round().max(1.0);
            let from = [a[0].min(b[0]), a[1].min(b[1])];
            let long = (a[0] - b[0]).abs() + (a[1] - b[1]).abs();
            let side = |v: f64| (v - 0.5 * thick).round();
            let area = match level {
                true => PageRectangle { x: from[0], y: side(a[1]), w: long.max(1.0), h: thick },
                false => PageRectangle { x: side(a[0]), y: from[1], w: thick, h: long.max(1.0) },
            };
            fill(page, area, ink);
        } else {
            stroke(page, a, b, width.max(1.0), ink, opacity);
        }
    }
}

fn stroke(page: &mut Rgb8, a: [f64; 2], b: [f64; 2], width: f64, ink: RgbColour, opacity: f64) {
    let reach = 0.5 * width + 0.5;
    let edges = |k: usize, edge: usize| {
        let (low, high) = (a[k].min(b[k]) - reach, a[k].max(b[k]) + reach);
        (low.floor().max(0.0) as usize)..(high.ceil().clamp(0.0, edge as f64) as usize)
    };
    let (columns, rows) = (edges(0, page.size.width), edges(1, page.size.height));
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    for y in rows {
        for x in columns.clone() {
            let p = [x as f64 + 0.5 - a[0], y as f64 + 0.5 - a[1]];
            let t = if squared > 0.0 { ((p[0] * along[0] + p[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
            let away = (p[0] - t * along[0]).hypot(p[1] - t * along[1]);
            blend(page, x as i64, y as i64, ink, (reach - away).clamp(0.0, 1.0) * opacity);
        }
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

/// How far a text covers the pixels about it, relative to its whole-numbered place.
struct GlyphCoverage {
    left: i64,
    top: i64,
    width: usize,
    cover: Vec<f32>,
}

fn write(page: &mut Rgb8, words: &TextLine) {
    let (glyphs, width) = font::placed(&words.text, words.em);
    let start = match words.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => -0.5 * width,
        Anchor::End => -width,
    };
    // The fraction of a pixel that the place lies beyond a whole one, along the text.
    let (x, y) = (words.at[0].floor(), words.at[1].round());
    let offset = if words.turned { 0.0 } else { words.at[0] - x };
    let rim = if words.rim.is_some() { (0.11 * words.em).max(1.0) } else { 0.0 };
    let margin = rim.ceil() as i64 + 2;
    let mut covered = {
        let (left, top) = (start.floor() as i64 - margin, (-1.1 * words.em).floor() as i64 - margin);
        let (right, bottom) = ((start + width).ceil() as i64 + margin + 1, (0.4 * words.em).ceil() as i64 + margin);
        let (w, h) = ((right - left) as usize, (bottom - top) as usize);
        GlyphCoverage { left, top, width: w, cover: vec![0.0; w * h] }
    };
    for (id, pen) in glyphs {
        let Some(outline) = font::outline(id, words.em, [start + offset + pen, 0.0]) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|gx, gy, cover| {
            let (cx, cy) =
                (corner.x as i64 + i64::from(gx) - covered.left, corner.y as i64 + i64::from(gy) - covered.top);
            if cx >= 0
                && cy >= 0
                && (cx as usize) < covered.width
                && let Some(here) = covered.cover.get_mut(cy as usize * covered.width + cx as usize)
            {
                *here = (*here + cover).clamp(0.0, 1.0);
            }
        });
    }
    let mut put = |covered: &GlyphCoverage, ink: RgbColour| {
        for (i, cover) in covered.cover.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            let (u, v) = (covered.left + (i % covered.width) as i64, covered.top + (i / covered.width) as i64);
            let (px, py) = if words.turned { (x as i64 + v, y as i64 - u) } else { (x as i64 + u, y as i64 + v) };
            blend(page, px, py, ink, f64::from(*cover));
        }
    };
    if let Some(ink) = words.rim {
        put(&covered.widened(rim), ink);
    }
    put(&covered, words.ink);
}

impl GlyphCoverage {
    /// What lies within a distance of what is covered.
    fn widened(&self, by: f64) -> GlyphCoverage {
        let (reach, height) = (by.ceil() as i64, self.cover.len() / self.width.max(1));
        let mut cover = vec![0f32; self.cover.len()];
        for (i, c) in self.cover.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            let (x, y) = ((i % self.width) as i64, (i / self.width) as i64);
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    let share = (by + 0.5 - ((dx * dx + dy * dy) as f64).sqrt()).clamp(0.0, 1.0) as f32 * c;
                    let (u, v) = (x + dx, y + dy);
                    if u >= 0 && v >= 0 && (u as usize) < self.width && (v as usize) < height {
                        let here = &mut cover[v as usize * self.width + u as usize];
                        *here = here.max(share);
                    }
                }
            }
        }
        GlyphCoverage { cover, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::picture::Gray8;

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
}

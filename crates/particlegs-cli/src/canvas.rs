//! Pixels that plotters draws on: antialiased strokes, discs and text in the embedded font.

use crate::annotate::text;
use ab_glyph::{Font, PxScale, ScaleFont, point};
use particlegs::picture::{Rgb8, Size};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind};
use std::convert::Infallible;

type DrawResult = Result<(), DrawingErrorKind<Infallible>>;

/// plotters' size of a text over an em, as its SVG has it.
const SIZE_OF_EM: f64 = 1.24;
/// Height of a small letter over an em, in the embedded font.
const X_HEIGHT: f32 = 0.547;

/// A picture to draw on. A coordinate is the middle of a pixel.
pub struct PictureCanvas<'a> {
    picture: &'a mut Rgb8,
}

impl<'a> PictureCanvas<'a> {
    /// Over a picture.
    pub fn new(picture: &'a mut Rgb8) -> Self {
        PictureCanvas { picture }
    }

    /// Blends a colour over a pixel that it covers in part; what lies outside is not drawn.
    fn blend(&mut self, (x, y): BackendCoord, color: BackendColor, cover: f32) {
        let Size { width, height } = self.picture.size;
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= width || y >= height {
            return;
        }
        let pixel = &mut self.picture.data[y * width + x];
        let alpha = color.alpha as f32 * cover.clamp(0.0, 1.0);
        let (r, g, b) = color.rgb;
        for (below, above) in pixel.iter_mut().zip([r, g, b]) {
            let (old, new) = (f32::from(*below), f32::from(above));
            *below = (old + (new - old) * alpha).round() as u8;
        }
    }

    /// A path as wide as `width` with round ends and corners; where it crosses itself it is blended once.
    fn stroke(&mut self, path: &[BackendCoord], width: f32, color: BackendColor) {
        let reach = 0.5 * width + 0.5;
        let far = reach.ceil() as i32;
        let side = |of: fn(&BackendCoord) -> i32, edge: usize| {
            let (low, high) = path.iter().map(of).fold((i32::MAX, i32::MIN), |(a, b), v| (a.min(v), b.max(v)));
            (low.saturating_sub(far).max(0), high.saturating_add(far).min(edge as i32 - 1))
        };
        let (x, y) = (side(|p| p.0, self.picture.size.width), side(|p| p.1, self.picture.size.height));
        if x.0 > x.1 || y.0 > y.1 {
            return;
        }
        let row = (x.1 - x.0 + 1) as usize;
        let mut cover = vec![0f32; row * (y.1 - y.0 + 1) as usize];
        // A single point is a disc.
        for pair in path.windows(2.min(path.len())) {
            let (a, b) = (pair[0], pair[pair.len() - 1]);
            for py in (a.1.min(b.1) - far).max(y.0)..=(a.1.max(b.1) + far).min(y.1) {
                for px in (a.0.min(b.0) - far).max(x.0)..=(a.0.max(b.0) + far).min(x.1) {
                    let here = &mut cover[(py - y.0) as usize * row + (px - x.0) as usize];
                    *here = here.max(reach - distance((px, py), a, b)).min(1.0);
                }
            }
        }
        for (at, c) in cover.into_iter().enumerate().filter(|(_, c)| *c > 0.0) {
            self.blend((x.0 + (at % row) as i32, y.0 + (at / row) as i32), color, c);
        }
    }
}

/// From a point to a piece of a line.
fn distance(p: BackendCoord, a: BackendCoord, b: BackendCoord) -> f32 {
    let minus = |u: BackendCoord, v: BackendCoord| ((u.0 - v.0) as f32, (u.1 - v.1) as f32);
    let (along, to) = (minus(b, a), minus(p, a));
    let squared = along.0 * along.0 + along.1 * along.1;
    let t = if squared > 0.0 { ((to.0 * along.0 + to.1 * along.1) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (to.0 - t * along.0).hypot(to.1 - t * along.1)
}

impl DrawingBackend for PictureCanvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.picture.size.width as u32, self.picture.size.height as u32)
    }

    fn ensure_prepared(&mut self) -> DrawResult {
        Ok(())
    }

    fn present(&mut self) -> DrawResult {
        Ok(())
    }

    fn draw_pixel(&mut self, at: BackendCoord, color: BackendColor) -> DrawResult {
        self.blend(at, color, 1.0);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> DrawResult {
        self.draw_path([from, to], style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> DrawResult {
        let path: Vec<BackendCoord> = path.into_iter().collect();
        self.stroke(&path, style.stroke_width() as f32, style.color());
        Ok(())
    }

    /// A disc, whether filled or not: no figure has rings.
    fn draw_circle<S: BackendStyle>(&mut self, centre: BackendCoord, radius: u32, style: &S, _: bool) -> DrawResult {
        self.stroke(&[centre], 2.0 * radius as f32, style.color());
        Ok(())
    }

    /// As plotters' SVG places text, its size and its anchor.
    fn draw_text<S: BackendTextStyle>(&mut self, words: &str, style: &S, at: BackendCoord) -> DrawResult {
        let em = (style.size() / SIZE_OF_EM) as f32;
        let font = text::font();
        let units = font.units_per_em().unwrap_or(1.0);
        let scale = PxScale::from(em * font.height_unscaled() / units);
        let scaled = font.as_scaled(scale);
        let (mut glyphs, mut pen, mut last) = (Vec::new(), 0.0, None);
        for id in words.chars().map(|c| scaled.glyph_id(c)) {
            pen += last.map_or(0.0, |l| scaled.kern(l, id));
            glyphs.push((id, pen));
            pen += scaled.h_advance(id);
            last = Some(id);
        }
        let anchor = style.anchor();
        let left = match anchor.h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * pen,
            HPos::Right => -pen,
        };
        let base = match anchor.v_pos {
            VPos::Top => 0.76 * em,
            VPos::Center => 0.5 * X_HEIGHT * em,
            VPos::Bottom => -0.5 * X_HEIGHT * em,
        };
        let turn = style.transform();
        for (id, x) in glyphs {
            let glyph = id.with_scale_and_position(scale, point(left + x, base));
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, cover| {
                let (x, y) = turn.transform(corner.x as i32 + x as i32, corner.y as i32 + y as i32);
                self.blend((at.0 + x, at.1 + y), style.color(), cover);
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(draw: impl FnOnce(&mut PictureCanvas<'_>)) -> Vec<u8> {
        let size = Size { width: 9, height: 9 };
        let mut picture = Rgb8 { size, data: vec![[255; 3]; size.pixels()] };
        draw(&mut PictureCanvas::new(&mut picture));
        picture.data.iter().map(|p| p[0]).collect()
    }

    const BLACK: BackendColor = BackendColor { alpha: 1.0, rgb: (0, 0, 0) };

    #[test]
    fn strokes_cover_what_they_are_wide() {
        let line = drawn(|c| c.stroke(&[(2, 4), (6, 4)], 1.0, BLACK));
        assert_eq!(line.iter().filter(|v| **v == 0).count(), 5);
        assert_eq!(line.iter().filter(|v| **v < 255).count(), 5);
        let wide = drawn(|c| c.stroke(&[(-3, 4), (20, 4)], 2.0, BLACK));
        assert!(wide[3 * 9..4 * 9].iter().all(|v| *v == 128) && wide[4 * 9..5 * 9].iter().all(|v| *v == 0));
        let disc = drawn(|c| c.stroke(&[(4, 4)], 6.0, BLACK));
        let area: f32 = disc.iter().map(|v| 1.0 - f32::from(*v) / 255.0).sum();
        assert!((area - 28.3).abs() < 1.0, "{area}");
    }

    #[test]
    fn crossings_are_blended_once_and_the_outside_is_left_alone() {
        let half = BackendColor { alpha: 0.5, ..BLACK };
        let cross = drawn(|c| c.stroke(&[(0, 4), (8, 4), (4, 4), (4, 0), (4, 8)], 1.0, half));
        assert!(cross.iter().all(|v| [255, 128].contains(v)) && cross[4 * 9 + 4] == 128);
        assert!(drawn(|c| c.stroke(&[(-40, -40), (-20, 50)], 3.0, BLACK)).iter().all(|v| *v == 255));
        assert!(drawn(|c| c.stroke(&[], 3.0, BLACK)).iter().all(|v| *v == 255));
    }
}

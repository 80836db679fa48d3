//! Pieces of annotated pictures: dark plates, colour bars with ticks, scale bars.

use super::text;
use particlegs::picture::{Rgb8, Size};

/// Ink of lines and letters.
pub const INK: [u8; 3] = [240; 3];

/// Letters' height for a picture: readable on the smallest, in proportion on larger ones.
pub fn letter_height(size: Size) -> f32 {
    (size.height.min(size.width * 9 / 16) as f32 / 40.0).max(11.0)
}

/// A rectangle of pixels: left, top, width, height.
#[derive(Clone, Copy, Debug)]
pub struct Box2 {
    /// Left.
    pub x: i64,
    /// Top.
    pub y: i64,
    /// Across.
    pub w: i64,
    /// Down.
    pub h: i64,
}

/// Sets every pixel of a rectangle (where the picture has one) to what `ink` makes of it, given the
/// place inside the rectangle.
pub fn paint(picture: &mut Rgb8, b: Box2, ink: impl Fn(i64, i64, [u8; 3]) -> [u8; 3]) {
    let (width, height) = (picture.size.width as i64, picture.size.height as i64);
    for y in b.y.max(0)..(b.y + b.h).min(height) {
        for x in b.x.max(0)..(b.x + b.w).min(width) {
            let pixel = &mut picture.data[(y * width + x) as usize];
            *pixel = ink(x - b.x, y - b.y, *pixel);
        }
    }
}

/// Darkens what lies under letters.
pub fn plate(picture: &mut Rgb8, b: Box2) {
    paint(picture, b, |_, _, p| p.map(|v| (f32::from(v) * 0.3) as u8));
}

/// A colour bar to draw: colours from bottom to top, ticks at shares of its height.
pub struct Bar<'a> {
    /// Above it.
    pub title: &'a str,
    /// Colour of a share in [0, 1].
    pub color: &'a dyn Fn(f32) -> [u8; 3],
    /// Share and label, rising.
    pub ticks: Vec<(f64, String)>,
}

/// Draws a colour bar on a plate at the right edge, inside the picture. Ticks whose labels would
/// touch are left out. Nothing is drawn where there is no room for it.
pub fn colour_bar(picture: &mut Rgb8, bar: &Bar) {
    let letters = letter_height(picture.size);
    let (width, height) = (picture.size.width as i64, picture.size.height as i64);
    let pad = (letters * 0.5).ceil() as i64;
    let line = text::extent("0", letters).height as i64;
    // A long title shrinks until it fits.
    let mut title_height = letters;
    while text::extent(bar.title, title_height).width as i64 > width - 4 * pad && title_height > 5.0 {
        title_height *= 0.9;
    }
    let title = text::extent(bar.title, title_height);
    let labels = bar.ticks.iter().map(|(_, l)| text::extent(l, letters).width as i64).max().unwrap_or(0);
    let across = (letters * 0.9) as i64;
    let tick = (letters * 0.3).ceil() as i64;
    let inner = (across + tick + pad / 2 + labels).max(title.width as i64);
    let plate_box = Box2 {
        x: width - inner - 3 * pad,
        y: pad,
        w: inner + 2 * pad,
        h: (height * 7 / 10).max(6 * line).min(height - 2 * pad),
    };
    if plate_box.x < 0 || plate_box.h < 5 * line {
        return;
    }
    plate(picture, plate_box);
    let left = plate_box.x + pad;
    text::draw(picture, bar.title, left, plate_box.y + pad / 2, title_height, INK);
    let top = plate_box.y + pad / 2 + line + line / 2 + pad / 2;
    let column = Box2 { x: left, y: top, w: across, h: plate_box.y + plate_box.h - line / 2 - pad / 2 - top };
    paint(picture, column, |_, y, _| (bar.color)(1.0 - (y as f32 + 0.5) / column.h as f32));
    let mut free_below = i64::MAX;
    for (share, label) in &bar.ticks {
        let y = column.y + ((1.0 - share) * (column.h - 1) as f64).round() as i64;
        if y + line / 2 > free_below {
            continue;
        }
        free_below = y - line / 2 - line / 4;
        let thick = (letters / 14.0).round().max(1.0) as i64;
        paint(picture, Box2 { x: column.x + across, y: y - thick / 2, w: tick, h: thick }, |_, _, _| INK);
        text::draw(picture, label, column.x + across + tick + pad / 2, y - line / 2, letters, INK);
    }
}

/// Draws a bar of `pixels` with its label on a plate at the lower left.
pub fn scale_bar(picture: &mut Rgb8, pixels: i64, label: &str) {
    let letters = letter_height(picture.size);
    let pad = (letters * 0.5).ceil() as i64;
    let words = text::extent(label, letters);
    let thick = (letters / 6.0).round().max(2.0) as i64;
    let inner = pixels.max(words.width as i64);
    let h = words.height as i64 + thick + 3 * pad / 2;
    let b = Box2 { x: pad, y: picture.size.height as i64 - pad - h, w: inner + 2 * pad, h };
    if b.y < 0 || b.x + b.w > picture.size.width as i64 {
        return;
    }
    plate(picture, b);
    text::draw(picture, label, b.x + pad, b.y + pad / 2, letters, INK);
    let y = b.y + b.h - pad / 2 - thick;
    paint(picture, Box2 { x: b.x + pad, y, w: pixels, h: thick }, |_, _, _| INK);
    // End marks, so that the length reads exactly.
    let mark = 2 * thick;
    for x in [b.x + pad, b.x + pad + pixels - thick / 2] {
        paint(picture, Box2 { x, y: y - mark / 2, w: (thick / 2).max(1), h: thick + mark / 2 }, |_, _, _| INK);
    }
}

/// The largest of 1, 2, 5 times a power of ten that is at most `value` (> 0).
pub fn round_below(value: f64) -> f64 {
    let power = 10f64.powi(value.log10().floor() as i32);
    [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|v| *v <= value * (1.0 + 1e-9)).unwrap_or(power)
}

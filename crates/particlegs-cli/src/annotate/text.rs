//! Anti-aliased text on pictures, in a subset of DejaVu Sans (licence beside it in assets/).

use ab_glyph::{Font, FontRef, PxScale, ScaleFont};
use particlegs::picture::Rgb8;
use std::sync::OnceLock;

/// The embedded font: a subset of DejaVu Sans, TrueType.
pub fn font() -> &'static FontRef<'static> {
    static PARSED: OnceLock<FontRef<'static>> = OnceLock::new();
    let bytes = include_bytes!("../../assets/DejaVuSans-subset.ttf");
    PARSED.get_or_init(|| FontRef::try_from_slice(bytes).expect("the embedded font is whole"))
}

/// A text's box in pixels for a font of `height` pixels (ascent to descent).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Pixels across, rounded up.
    pub width: usize,
    /// Pixels down, rounded up.
    pub height: usize,
}

/// The room that `text` takes.
pub fn extent(text: &str, height: f32) -> Extent {
    let scaled = font().as_scaled(PxScale::from(height));
    let mut width = 0.0;
    let mut last = None;
    for c in text.chars() {
        let id = scaled.glyph_id(c);
        width += last.map_or(0.0, |l| scaled.kern(l, id)) + scaled.h_advance(id);
        last = Some(id);
    }
    Extent { width: width.ceil() as usize + 1, height: height.ceil() as usize + 1 }
}

/// Blends `text` over the picture with its box's top left corner at (`x`, `y`); what lies outside
/// the picture is not drawn.
pub fn draw(picture: &mut Rgb8, text: &str, x: i64, y: i64, height: f32, color: [u8; 3]) {
    let scaled = font().as_scaled(PxScale::from(height));
    let size = picture.size;
    let mut pen = x as f32;
    let mut last = None;
    for c in text.chars() {
        let id = scaled.glyph_id(c);
        pen += last.map_or(0.0, |l| scaled.kern(l, id));
        let glyph = id.with_scale_and_position(height, ab_glyph::point(pen, y as f32 + scaled.ascent()));
        pen += scaled.h_advance(id);
        last = Some(id);
        let Some(outline) = font().outline_glyph(glyph) else { continue };
        let corner = outline.px_bounds().min;
        outline.draw(|gx, gy, cover| {
            let (px, py) = (corner.x as i64 + i64::from(gx), corner.y as i64 + i64::from(gy));
            if px >= 0 && py >= 0 && (px as usize) < size.width && (py as usize) < size.height {
                let pixel = &mut picture.data[py as usize * size.width + px as usize];
                let cover = cover.clamp(0.0, 1.0);
                *pixel = [0, 1, 2].map(|k| {
                    let (below, above) = (f32::from(pixel[k]), f32::from(color[k]));
                    (below + (above - below) * cover).round() as u8
                });
            }
        });
    }
}

/// A number as people write it in pictures: `0.02`, `300`, `10⁻⁷`, `2×10⁹`.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    if (1e-2..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).clamp(0, 5) as usize;
        let text = format!("{value:.digits$}");
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        return text.replace('-', "\u{2212}");
    }
    let mut exponent = size.log10().floor() as i32;
    let mut front = (value / 10f64.powi(exponent) * 100.0).round() / 100.0;
    if front.abs() >= 10.0 {
        front /= 10.0;
        exponent += 1;
    }
    let power = format!("10{}", superscript(exponent));
    match front {
        1.0 => power,
        -1.0 => format!("\u{2212}{power}"),
        _ => format!("{front}\u{d7}{power}").replace('-', "\u{2212}"),
    }
}

/// A whole number in superscript digits.
pub fn superscript(n: i32) -> String {
    n.to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            d => char::from_u32(0x2070 + (d as u32 - '0' as u32)).unwrap_or(d),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::picture::Size;

    #[test]
    fn numbers_read_well() {
        for (value, text) in [
            (0.02, "0.02"),
            (300.0, "300"),
            (1e-7, "10⁻⁷"),
            (2e9, "2×10⁹"),
            (1.5, "1.5"),
            (-3.0, "−3"),
            (9.999e9, "10¹⁰"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn every_symbol_has_a_glyph() {
        for c in "0123456789⁰¹²³⁴⁵⁶⁷⁸⁹⁻−×Σ☉⊙()/. abcXYZ|±".chars() {
            assert_ne!(font().glyph_id(c).0, 0, "{c}");
        }
    }

    #[test]
    fn text_stays_in_its_box() {
        for height in [9.0, 14.0, 40.0] {
            let text = "Σ [10¹⁰ M☉/h]";
            let box_ = extent(text, height);
            let size = Size { width: box_.width + 20, height: box_.height + 20 };
            let mut p = Rgb8 { size, data: vec![[0; 3]; size.pixels()] };
            draw(&mut p, text, 10, 10, height, [255; 3]);
            for (i, v) in p.data.iter().enumerate() {
                let (x, y) = (i % size.width, i / size.width);
                let inside = (9..=10 + box_.width).contains(&x) && (9..=10 + box_.height).contains(&y);
                assert!(inside || *v == [0; 3], "{x} {y}");
            }
            assert!(p.data.iter().any(|v| v[0] > 128));
        }
    }
}

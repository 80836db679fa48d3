//! The letters of figures, a subset of DejaVu Sans (licence beside it in assets/): widths and outlines, by the em.

use ab_glyph::{Font, FontRef, GlyphId, OutlinedGlyph, PxScale, point};
use std::sync::OnceLock;

/// The bytes of the embedded font: a subset of DejaVu Sans, TrueType.
pub const FONT: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");

pub fn font() -> &'static FontRef<'static> {
    static PARSED: OnceLock<FontRef<'static>> = OnceLock::new();
    PARSED.get_or_init(|| FontRef::try_from_slice(FONT).expect("the embedded font is whole"))
}

/// Height of capital letters over an em.
pub const CAPITALS: f64 = 0.729;

pub fn width(text: &str, em: f64) -> f64 {
    placed(text, em).1
}

/// The glyphs of a text with where each begins, and the width of all.
pub fn placed(text: &str, em: f64) -> (Vec<(GlyphId, f64)>, f64) {
    // In units of the font, where widths are whole numbers: the same on every machine.
    let font = font();
    let units = f64::from(font.units_per_em().unwrap_or(1.0));
    let mut pen = 0.0;
    let mut glyphs = Vec::new();
    for c in text.chars() {
        let id = font.glyph_id(c);
        glyphs.push((id, pen * em / units));
        pen += f64::from(font.h_advance_unscaled(id));
    }
    (glyphs, pen * em / units)
}

/// The outline of a glyph whose pen stands at a place.
pub fn outline(id: GlyphId, em: f64, at: [f64; 2]) -> Option<OutlinedGlyph> {
    let font = font();
    // `PxScale` counts the height from ascent to descent, not the em.
    let scale = em as f32 * font.height_unscaled() / font.units_per_em().unwrap_or(1.0);
    let scale = PxScale::from(scale);
    font.outline_glyph(id.with_scale_and_position(scale, point(at[0] as f32, at[1] as f32)))
}

/// Characters of a text that the font has no glyph for.
pub fn missing(text: &str) -> String {
    text.chars().filter(|c| font().glyph_id(*c).0 == 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_symbol_has_a_glyph() {
        for c in "0123456789⁰¹²³⁴⁵⁶⁷⁸⁹⁻−×Σ☉⊙()/. abcXYZ|±".chars() {
            assert_ne!(font().glyph_id(c).0, 0, "{c}");
        }
    }
}

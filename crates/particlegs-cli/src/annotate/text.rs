//! The letters of pictures, a subset of DejaVu Sans (licence beside it in assets/), and numbers as they have them.

use ab_glyph::FontRef;
use particlegs::picture::superscript;
use std::sync::OnceLock;

/// The bytes of the embedded font: a subset of DejaVu Sans, TrueType.
pub const FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-subset.ttf");

/// The embedded font.
pub fn font() -> &'static FontRef<'static> {
    static PARSED: OnceLock<FontRef<'static>> = OnceLock::new();
    PARSED.get_or_init(|| FontRef::try_from_slice(FONT).expect("the embedded font is whole"))
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

/// A label with its unit in brackets, or alone.
pub fn labelled(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} ({unit})") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ab_glyph::Font;

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
}

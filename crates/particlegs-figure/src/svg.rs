//! A sheet as SVG: pictures as embedded PNG, text as text. The unit is a point.

use super::png_file::{PngMetadata, coded};
use super::sheet::{Anchor, Mark, PageRectangle, RgbColour, Sheet, TextLine};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use particlegs_core::Result;
use particlegs_core::text::xml;
use std::fmt::Write;

/// The font of the embedded widths first, then those that are everywhere.
const FONTS: &str = "DejaVu Sans, Verdana, Arial, Helvetica, sans-serif";

pub fn svg(sheet: &Sheet, about: &PngMetadata) -> Result<String> {
    let (w, h) = (short(sheet.width), short(sheet.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" width=\"{w}pt\" \
         height=\"{h}pt\" viewBox=\"0 0 {w} {h}\" font-family=\"{FONTS}\" \
         stroke-linejoin=\"round\">\n"
    );
    if let Some(title) = &about.title {
        let _ = writeln!(out, "<title>{}</title>", xml(title));
    }
    if !about.software.is_empty() {
        let _ = writeln!(out, "<desc>{}</desc>", xml(&about.software));
        let _ = writeln!(out, "<metadata>{}</metadata>", xml(&about.provenance));
    }
    let _ = writeln!(out, "<rect width=\"{w}\" height=\"{h}\" fill=\"{}\"/>", colour(sheet.ground));
    for mark in &sheet.marks {
        self::mark(&mut out, mark)?;
    }
    out += "</svg>\n";
    Ok(out)
}

fn mark(out: &mut String, mark: &Mark) -> Result<()> {
    // Writing to a string cannot fail.
    let _ = match mark {
        Mark::Picture(area, image) => {
            let coded = BASE64_STANDARD.encode(coded(image, &PngMetadata::default())?);
            let area = within(area);
            writeln!(out, "<image {area} preserveAspectRatio=\"none\" xlink:href=\"data:image/png;base64,{coded}\"/>")
        }
        Mark::Fill(area, ink) => writeln!(out, "<rect {} fill=\"{}\"/>", within(area), colour(*ink)),
        Mark::Line { points, width, ink, opacity } => {
            let seen = if *opacity < 1.0 { format!(" stroke-opacity=\"{}\"", short(*opacity)) } else { String::new() };
            writeln!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{seen}/>",
                path(points),
                colour(*ink),
                short(*width)
            )
        }
        Mark::Polygon(corners, ink) => {
            writeln!(out, "<polygon points=\"{}\" fill=\"{}\"/>", path(corners), colour(*ink))
        }
        Mark::Words(words) => text(out, words),
    };
    Ok(())
}

fn text(out: &mut String, w: &TextLine) -> std::fmt::Result {
    let [x, y] = w.at.map(short);
    let anchor = match w.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let turn = if w.turned { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
    let rim = w.rim.map_or(String::new(), |ink| {
        let wide = short(0.22 * w.em);
        format!(" stroke=\"{}\" stroke-width=\"{wide}\" stroke-linejoin=\"round\" paint-order=\"stroke\"", colour(ink))
    });
    writeln!(
        out,
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" fill=\"{}\"{rim}{turn}>{}</text>",
        short(w.em),
        colour(w.ink),
        xml(&w.text)
    )
}

fn within(area: &PageRectangle) -> String {
    let [x, y, w, h] = [area.x, area.y, area.w, area.h].map(short);
    format!("x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"")
}

fn path(points: &[[f64; 2]]) -> String {
    points.iter().map(|p| format!("{},{}", short(p[0]), short(p[1]))).collect::<Vec<_>>().join(" ")
}

fn colour([r, g, b]: RgbColour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A number with at most three digits behind the point.
fn short(v: f64) -> String {
    let text = format!("{v:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_text_and_escaped() {
        let words = TextLine {
            text: "a < b & \"c\"\u{7}".into(),
            at: [1.0, 2.5],
            em: 8.0,
            ink: [0; 3],
            anchor: Anchor::End,
            turned: true,
            rim: Some([255; 3]),
        };
        let sheet = Sheet { width: 10.0, height: 20.0, ground: [255; 3], marks: vec![Mark::Words(words)] };
        let text = svg(&sheet, &PngMetadata::default()).unwrap();
        assert!(text.contains(">a &lt; b &amp; &quot;c&quot;\\u{7}</text>"), "{text}");
        assert!(text.contains("rotate(-90 1 2.5)") && text.contains("text-anchor=\"end\""), "{text}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([1.0, 0.1 + 0.2, -0.0001, 238.1102].map(short), ["1", "0.3", "0", "238.11"]);
    }
}

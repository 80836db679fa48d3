//! Density as a FITS cube (FITS Standard 4.0): one primary array of float32, x fastest, with linear world
//! coordinates.

use super::notes::ascii;
use super::{Density, Notes, written};
use particlegs::Result;
use particlegs::progress::Progress;
use std::path::Path;

/// Bytes of a card, and of a block of cards or numbers.
const CARD: usize = 80;
const BLOCK: u64 = 2880;
/// Letters of a text on a card.
const TEXT: usize = 67;
/// Letters of a comment on a card.
const COMMENT: usize = 72;
/// Units of length that the standard and its readers know. `Mpc/h` is not among them: h is the hour there.
const UNITS: [&str; 14] =
    ["Angstrom", "nm", "um", "mm", "cm", "m", "km", "AU", "pc", "kpc", "Mpc", "Gpc", "lyr", "solRad"];

/// Writes it.
///
/// # Errors
/// Those of [`written`].
pub fn write(density: &Density, notes: &Notes, out: &Path, progress: &dyn Progress) -> Result<u64> {
    let head = head(density, notes);
    let bytes = 4 * density.values.len() as u64;
    written(out, head.len() as u64 + bytes.next_multiple_of(BLOCK), progress, |sink| {
        sink.put(&head)?;
        density.for_each_run(|run| {
            sink.check()?;
            sink.put(&run.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>())
        })?;
        sink.put(&vec![0; (bytes.next_multiple_of(BLOCK) - bytes) as usize])
    })
}

/// All cards, to a whole number of blocks.
fn head(density: &Density, notes: &Notes) -> Vec<u8> {
    let grid = &density.grid;
    let length = notes.text("length_unit");
    let mut head = Head(Vec::new());
    head.card("SIMPLE", "T", "FITS Standard 4.0");
    head.card("BITPIX", "-32", "float32");
    head.card("NAXIS", "3", "x, y and z; x is the fastest");
    for (k, n) in grid.cells.iter().enumerate() {
        head.card(&format!("NAXIS{}", k + 1), &n.to_string(), "cells");
    }
    head.text("BUNIT", &density.unit, "");
    head.text("BTYPE", "density", "mean of each cell");
    for (k, axis) in ["X", "Y", "Z"].iter().enumerate() {
        let n = k + 1;
        head.text(&format!("CTYPE{n}"), axis, "linear");
        head.card(&format!("CRPIX{n}"), "1.0", "centre of the first cell");
        head.number(&format!("CRVAL{n}"), grid.min[k] + 0.5 * grid.side[k], "its coordinate");
        head.number(&format!("CDELT{n}"), grid.side[k], "edge of a cell");
        if let Some(unit) = length.filter(|u| UNITS.contains(u)) {
            head.text(&format!("CUNIT{n}"), unit, "");
        }
    }
    head.text("LENUNIT", length.unwrap_or("not stated"), "unit of length; h is the Hubble parameter");
    head.number("TOTAL", density.total, "mass or number in all cells");
    head.number("OUTSIDE", density.outside, "and beyond the edges of the grid");
    for (k, name) in ["PERIODX", "PERIODY", "PERIODZ"].iter().enumerate() {
        head.card(name, if grid.periodic[k] { "T" } else { "F" }, "does the axis repeat?");
    }
    for (name, key) in [("SCALEFAC", "scale_factor"), ("HUBBLE", "hubble"), ("SIMTIME", "time")] {
        if let Some(value) = notes.number(key) {
            head.number(name, value, &key.replace('_', " "));
        }
    }
    head.text("OBJECT", notes.text("source").unwrap_or_default(), "");
    head.text("CREATOR", concat!("particlegs ", env!("CARGO_PKG_VERSION")), "");
    notes.lines().iter().for_each(|line| head.comment(line));
    head.whole()
}

/// Cards, one after the other.
struct Head(Vec<u8>);

impl Head {
    /// A card; what does not fit of it is left out.
    fn push(&mut self, text: &str) {
        let card = format!("{text:<CARD$}");
        self.0.extend(&card.as_bytes()[..CARD]);
    }

    /// A number or a truth value in the fixed place of the standard.
    fn card(&mut self, name: &str, value: &str, comment: &str) {
        let comment = if comment.is_empty() { String::new() } else { format!(" / {comment}") };
        self.push(&format!("{name:<8}= {value:>20}{comment}"));
    }

    fn number(&mut self, name: &str, value: f64, comment: &str) {
        self.card(name, &real(value), comment);
    }

    /// A text, cut where it is longer than a card.
    fn text(&mut self, name: &str, text: &str, comment: &str) {
        let mut quoted = String::new();
        for c in ascii(text).chars() {
            let letter = if c == '\'' { "''".to_string() } else { c.to_string() };
            if quoted.len() + letter.len() > TEXT {
                break;
            }
            quoted += &letter;
        }
        let comment = if comment.is_empty() { String::new() } else { format!(" / {comment}") };
        let value = format!("'{quoted:<8}'");
        self.push(&format!("{name:<8}= {value:<20}{comment}"));
    }

    /// A comment, broken between words.
    fn comment(&mut self, text: &str) {
        let mut line = String::new();
        for word in text.split(' ') {
            if !line.is_empty() && line.len() + 1 + word.len() > COMMENT {
                self.push(&format!("COMMENT {line}"));
                line = String::from(" ");
            }
            if !line.trim().is_empty() {
                line.push(' ');
            }
            line += word;
            while line.len() > COMMENT {
                let rest = line.split_off(COMMENT);
                self.push(&format!("COMMENT {line}"));
                line = rest;
            }
        }
        self.push(&format!("COMMENT {line}"));
    }

    /// With the end, to a whole number of blocks.
    fn whole(mut self) -> Vec<u8> {
        self.push("END");
        let length = (self.0.len() as u64).next_multiple_of(BLOCK) as usize;
        self.0.resize(length, b' ');
        self.0
    }
}

/// A number as the standard writes reals: with a point, and an E before the power of ten.
fn real(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, power)) if digits.contains('.') => format!("{digits}E{power}"),
        Some((digits, power)) => format!("{digits}.0E{power}"),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_are_of_eighty_letters_and_blocks_whole() {
        let mut head = Head(Vec::new());
        head.text("OBJECT", &"it's ".repeat(40), "left out");
        head.comment(&"word ".repeat(60));
        head.comment(&"x".repeat(200));
        head.number("TOTAL", 1.5e-300, "");
        let whole = head.whole();
        assert!(whole.len().is_multiple_of(2880) && whole.iter().all(|b| (b' '..=b'~').contains(b)));
        let cards: Vec<&[u8]> = whole.chunks(80).collect();
        let object = String::from_utf8_lossy(cards[0]);
        assert_eq!(object.matches('\'').count() % 2, 0, "{object}");
        assert!(cards[1].starts_with(b"COMMENT word") && cards.iter().any(|c| c.starts_with(b"END ")));
    }

    #[test]
    fn reals_have_a_point() {
        let all = [(1.0, "1.0"), (1e-9, "1.0E-9"), (1.5e30, "1.5E30"), (0.0, "0.0"), (-2.5, "-2.5")];
        all.iter().for_each(|(value, text)| assert_eq!(real(*value), *text));
    }
}

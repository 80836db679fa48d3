//! Density as a FITS cube (FITS Standard 4.0): a primary array of float32, x fastest, with linear world coordinates,
//! and an image extension like it for the mean and the dispersion of each component of each field.

use super::{Density, Notes, ascii, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::{Dimension, Unit};
use particlegs_measure::stats::Grid;
use std::path::Path;

/// Bytes of a card, and of a block of cards or numbers.
const CARD: usize = 80;
const BLOCK: u64 = 2880;
/// Letters of a text on a card.
const TEXT: usize = 67;
/// Letters of a comment on a card.
const COMMENT: usize = 72;
/// Units that the standard and its readers know by the same names; what has another name is written in SI, ...
const SAME: &str = "nm um mm cm m km AU pc kpc Mpc Gpc g";
/// ... but for these.
const RENAMED: [(&str, &str); 5] =
    [("A", "Angstrom"), ("ly", "lyr"), ("Rsun", "solRad"), ("Msun", "solMass"), ("amu", "u")];

/// Factors on numbers that bring them to units that the standard knows: it has no h (that is the hour there) and no
/// factors.
struct UnitScale {
    length: f64,
    mass: f64,
    length_unit: Option<&'static str>,
    density_unit: Option<String>,
}

impl UnitScale {
    /// As the notes state units; all numbers as they are where one of the units has no size.
    fn from_notes(notes: &Notes) -> UnitScale {
        let hubble = notes.number("hubble");
        let unit = |key: &str, dimension: Dimension| {
            let (number, name, size, _, power) = Unit::parts(notes.text(key)?, dimension)?;
            let whole = power as i32;
            // Only whole powers of a stated h can be taken into the numbers.
            let h = if power == 0.0 { 1.0 } else { hubble.filter(|_| whole as f32 == power)?.powi(whole) };
            let renamed = RENAMED.iter().find(|n| n.0 == name).map(|n| n.1);
            let known = renamed.or_else(|| SAME.split(' ').find(|same| *same == name));
            Some(known.map_or((number * size * h, dimension.base()), |known| (number * h, known)))
        };
        // Numbers of particles need no unit.
        let counted = notes.facts.get("mass").is_none();
        let mass = if counted { Some((1.0, "")) } else { unit("mass_unit", Dimension::Mass) };
        match (unit("length_unit", Dimension::Length), mass) {
            (Some((length, name)), Some((mass, above))) => {
                let density_unit = Some(format!("{above} {name}-3").trim().to_string());
                UnitScale { length, mass, length_unit: Some(name), density_unit }
            }
            _ => UnitScale { length: 1.0, mass: 1.0, length_unit: None, density_unit: None },
        }
    }
}

pub fn write(density: &Density, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let scale = UnitScale::from_notes(notes);
    let head = head(density, notes, &scale);
    let by = scale.mass / scale.length.powi(3);
    let mut cubes = vec![(head, &density.values, by)];
    for field in &density.fields {
        for (k, name) in field.quantity.component_names().iter().enumerate() {
            let by = if field.quantity.by_mass { "mass" } else { "number of particles" };
            let content =
                if field.quantity.extensive { "sum per volume".into() } else { format!("mean, weighted by {by}") };
            let head = field_head(density, &scale, field.unit.as_deref(), (&content, name));
            cubes.push((head, &field.values.mean[k], 1.0));
            if let Some((columns, unit)) = field.dispersion() {
                let (content, name) = (format!("dispersion, weighted by {by}"), format!("dispersion_{name}"));
                let head = field_head(density, &scale, unit.as_deref(), (&content, &name));
                cubes.push((head, &columns[k], 1.0));
            }
        }
    }
    let bytes = 4 * density.values.len() as u64;
    let whole: u64 = cubes.iter().map(|(head, ..)| head.len() as u64 + bytes.next_multiple_of(BLOCK)).sum();
    written(out, whole, context, |sink| {
        for (head, values, by) in &cubes {
            sink.put(head)?;
            density.for_each_run(&[values], |run| {
                sink.check()?;
                sink.put(&run.iter().flat_map(|v| ((f64::from(*v) * by) as f32).to_be_bytes()).collect::<Vec<u8>>())
            })?;
            // The standard fills the last block of data with zeros.
            sink.put(&vec![0; (bytes.next_multiple_of(BLOCK) - bytes) as usize])?;
        }
        Ok(())
    })
}

/// The cards of an extension that holds the means or the dispersions of a component of a field.
fn field_head(density: &Density, scale: &UnitScale, unit: Option<&str>, (content, name): (&str, &str)) -> Vec<u8> {
    let mut head = FitsHeader(Vec::new());
    head.text("XTENSION", "IMAGE", "FITS Standard 4.0");
    head.axes(&density.grid.cells);
    head.card("PCOUNT", "0", "");
    head.card("GCOUNT", "1", "");
    head.text("EXTNAME", name, "");
    match unit.map(|unit| (unit, standard_unit(unit))) {
        Some((_, Some(unit))) => head.text("BUNIT", &unit, ""),
        Some((unit, None)) => head.text("FLDUNIT", unit, "unit of the field"),
        None => {}
    }
    head.text("BTYPE", content, "over each cell");
    head.coordinates(&density.grid, scale);
    head.whole()
}

/// A unit such as `km/s` as the standard writes it, if it knows all its parts.
fn standard_unit(unit: &str) -> Option<String> {
    let known =
        |part: &&str| SAME.split(' ').chain(["s", "K", "J", "erg", "yr", "Myr", "Gyr"]).any(|same| same == *part);
    let mut parts = unit.split('/');
    let first = parts.next().filter(known)?;
    parts.try_fold(first.to_string(), |all, part| known(&part).then(|| format!("{all} {part}-1")))
}

/// All cards, to a whole number of blocks.
fn head(density: &Density, notes: &Notes, scale: &UnitScale) -> Vec<u8> {
    let grid = &density.grid;
    let mut head = FitsHeader(Vec::new());
    head.card("SIMPLE", "T", "FITS Standard 4.0");
    head.axes(&grid.cells);
    if !density.fields.is_empty() {
        head.card("EXTEND", "T", "fields follow");
    }
    match &scale.density_unit {
        // BUNIT holds units of the standard; any other is under a name that it does not know.
        Some(unit) => head.text("BUNIT", unit, ""),
        None => head.text("DENUNIT", &density.unit, "unit of density"),
    }
    let weight_suffix = notes.text("weights").map_or_else(String::new, |name| format!(" of {name}"));
    head.text("BTYPE", &format!("density{weight_suffix}"), "mean of each cell");
    head.coordinates(grid, scale);
    let length = scale.length_unit.or(notes.text("length_unit"));
    head.text("LENUNIT", length.unwrap_or("not stated"), "unit of length");
    head.number("TOTAL", density.total * scale.mass, "mass or number in all cells");
    head.number("OUTSIDE", density.outside * scale.mass, "and beyond the edges of the grid");
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

struct FitsHeader(Vec<u8>);

impl FitsHeader {
    /// A card; what does not fit of it is left out.
    fn push(&mut self, text: &str) {
        let card = format!("{text:<CARD$}");
        self.0.extend(&card.as_bytes()[..CARD]);
    }

    /// A number or a truth value in the fixed place of the standard.
    fn card(&mut self, name: &str, value: &str, comment: &str) {
        let comment = if comment.is_empty() { String::new() } else { format!(" / {comment}") };
        // The standard puts numbers into columns 11 to 30, aligned to the right.
        self.push(&format!("{name:<8}= {value:>20}{comment}"));
    }

    /// Cards of the array's type and shape.
    fn axes(&mut self, cells: &[usize; 3]) {
        self.card("BITPIX", "-32", "float32");
        self.card("NAXIS", "3", "x, y and z; x is the fastest");
        for (k, n) in cells.iter().enumerate() {
            self.card(&format!("NAXIS{}", k + 1), &n.to_string(), "cells");
        }
    }

    /// Cards of the places of its cells.
    fn coordinates(&mut self, grid: &Grid, scale: &UnitScale) {
        for (k, axis) in ["X", "Y", "Z"].iter().enumerate() {
            let n = k + 1;
            self.text(&format!("CTYPE{n}"), axis, "linear");
            // Cells are counted from 1, and a whole number is the centre of one.
            self.card(&format!("CRPIX{n}"), "1.0", "centre of the first cell");
            self.number(&format!("CRVAL{n}"), (grid.min[k] + 0.5 * grid.side[k]) * scale.length, "its coordinate");
            self.number(&format!("CDELT{n}"), grid.side[k] * scale.length, "edge of a cell");
            if let Some(unit) = scale.length_unit {
                self.text(&format!("CUNIT{n}"), unit, "");
            }
        }
    }

    fn number(&mut self, name: &str, value: f64, comment: &str) {
        self.card(name, &real(value), comment);
    }

    /// A text, cut where it is longer than a card.
    fn text(&mut self, name: &str, text: &str, comment: &str) {
        let mut quoted = String::new();
        for c in ascii(text).chars() {
            // A quote is doubled, and the two are never parted.
            let letter = if c == '\'' { "''".to_string() } else { c.to_string() };
            if quoted.len() + letter.len() > TEXT {
                break;
            }
            quoted += &letter;
        }
        let comment = if comment.is_empty() { String::new() } else { format!(" / {comment}") };
        // At least eight letters: XTENSION must be `'IMAGE   '`.
        let value = format!("'{quoted:<8}'");
        self.push(&format!("{name:<8}= {value:<20}{comment}"));
    }

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
            // A word that is longer than a card is cut.
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
        let mut head = FitsHeader(Vec::new());
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
    fn units_of_fields_are_the_standards_or_none() {
        let all = [("km/s", Some("km s-1")), ("K", Some("K")), ("kpc/h", None), ("10^10 Msun", None), ("", None)];
        all.iter().for_each(|(unit, known)| assert_eq!(standard_unit(unit).as_deref(), *known, "{unit}"));
    }

    #[test]
    fn reals_have_a_point() {
        let all = [(1.0, "1.0"), (1e-9, "1.0E-9"), (1.5e30, "1.5E30"), (0.0, "0.0"), (-2.5, "-2.5")];
        all.iter().for_each(|(value, text)| assert_eq!(real(*value), *text));
    }
}

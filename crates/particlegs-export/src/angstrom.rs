//! Lengths of grids for viewers of molecules, which know no other unit than the Angstrom.

use super::{Density, Kind, Notes};
use particlegs_core::model::{Dimension, Unit};

/// A grid's lengths and densities in Angstrom, where their unit is one of molecules; as they are elsewhere.
pub struct AngstromGrid {
    /// The middle of the first cell.
    pub origin: [f64; 3],
    pub side: [f64; 3],
    /// Factor on values.
    pub by: f64,
    /// Notes of the file, a line each.
    pub lines: Vec<String>,
}

impl AngstromGrid {
    pub fn new(density: &Density, notes: &Notes) -> AngstromGrid {
        let scale = scale(notes.text("length_unit"));
        let length = scale.unwrap_or(1.0);
        let side = density.grid.side.map(|s| s * length);
        let origin = [0, 1, 2].map(|k| density.grid.min[k] * length + 0.5 * side[k]);
        let amount_unit = density.unit.split_once(" / ").map_or(&density.unit[..], |unit| unit.0);
        let unit_line = match scale {
            Some(_) => format!("this file: lengths in Angstrom, density in {amount_unit} / Angstrom^3"),
            None => format!("this file: lengths as they are, density in {}", density.unit),
        };
        let lines = std::iter::once(super::ascii::ascii(&unit_line)).chain(notes.lines()).collect();
        AngstromGrid { origin, side, by: length.powi(-3), lines }
    }
}

/// A unit of length in Angstrom, if it is one of molecules: below a micrometre.
fn scale(unit: Option<&str>) -> Option<f64> {
    let size = |text: &str| Unit::parts(text, Dimension::Length).filter(|unit| (unit.3, unit.4) == (0.0, 0.0));
    let (number, _, size, ..) = unit.and_then(size)?;
    // In as many digits as units have.
    let angstrom: f64 = format!("{:.11e}", number * size / 1e-10).parse().ok()?;
    Some(angstrom).filter(|length| *length > 0.0 && *length < 1e4)
}

/// A note on the unit of length, if a file of this kind loses it.
pub fn lost_unit(kind: Kind, unit: Option<&str>) -> Option<String> {
    let is_lost = matches!(kind, Kind::Dx | Kind::Mrc) && scale(unit).is_none();
    let unit = unit.map_or("an unstated unit".into(), super::ascii::ascii);
    is_lost.then(|| format!("the unit of length: numbers are in {unit}, and viewers take them for Angstrom"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_of_molecules_are_in_angstrom() {
        for (unit, length) in [
            (Some("nm"), Some(10.0)),
            (Some("Angstrom"), Some(1.0)),
            (Some("pm"), Some(0.01)),
            (Some("Mpc/h"), None),
            (Some("m"), None),
            (Some("sigma"), None),
            (None, None),
        ] {
            assert_eq!(scale(unit), length, "{unit:?}");
            assert_eq!(lost_unit(Kind::Mrc, unit).is_some(), length.is_none());
        }
        assert_eq!(lost_unit(Kind::Vti, None), None);
    }
}

//! A model's density on a grid, integrated over its cells, and the means of its fields over them; its lengths in
//! Angstrom, the only unit that viewers of molecules know.

use super::{Kind, Notes, ascii};
use particlegs_core::context::Context;
use particlegs_core::math::float32_holds;
use particlegs_core::model::{Dimension, Metadata, Model, Quantity, Unit};
use particlegs_core::{Error, Hint, Result};
use particlegs_measure::stats::{Assignment, Grid, MeanAndDispersion, Subject, deposit, field_in_cells};
use particlegs_particles::Domain;
use std::collections::BTreeSet;

/// Cells along an axis at most.
const MOST: usize = 65_536;
/// Cells along the longest edge where nobody says.
const USUAL: usize = 128;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cells {
    /// So many cells along the longest edge.
    Along(usize),
    /// So many cells along each axis.
    Numbers([usize; 3]),
    /// Cells of about this length.
    OfSide(f64),
}

impl Default for Cells {
    fn default() -> Self {
        Cells::Along(USUAL)
    }
}

impl Cells {
    /// The grid over a model's periodic box, or its bounds where it has none or a tilted one.
    pub fn over_model(self, model: &Model) -> Result<Grid> {
        // Grids of files are upright: a tilted box lies open in its bounds.
        let domain = Some(Domain::from_model(model)).filter(|d| !d.is_tilted());
        self.over(&domain.unwrap_or_else(|| Domain::new(&model.metadata.bounds, None)))
    }

    /// The grid over a domain. Cells of a given length become as long as divides the box.
    fn over(self, domain: &Domain) -> Result<Grid> {
        let checked = |n: usize| match n {
            1..=MOST => Ok(()),
            _ => Err(Error::argument(format!("{n} cells per edge is outside 1 to {MOST}"))),
        };
        match self {
            Cells::Along(n) => checked(n).map(|()| Grid::new(domain, n)),
            Cells::Numbers(cells) => {
                cells.into_iter().try_for_each(checked)?;
                Ok(Grid::stretched(domain, cells))
            }
            Cells::OfSide(side) if side.is_finite() && side > 0.0 => {
                let cells = domain.length.map(|l| (l / side).round().max(1.0));
                if let Some(n) = cells.iter().find(|n| **n > MOST as f64) {
                    let message = format!("cells of size {side} give {n:.0} along an axis, more than {MOST}");
                    return Err(Error::argument(message));
                }
                Ok(Grid::stretched(domain, cells.map(|n| n as usize)))
            }
            Cells::OfSide(side) => Err(Error::argument(format!("the cell size {side} is not positive"))),
        }
    }
}

pub struct Density {
    pub grid: Grid,
    /// Mass, or number, per volume in each cell; x slowest.
    pub values: Vec<f32>,
    pub unit: String,
    /// Mass, or number, in all cells.
    pub total: f64,
    /// Mass or number beyond the open edges of the grid.
    pub outside: f64,
    /// Means over the cells, weighted by density.
    pub fields: Vec<FieldGrid>,
}

/// A field in the cells of a density: NaN where no Gaussian that has it reaches.
pub struct FieldGrid {
    pub quantity: Quantity,
    /// The unit of the means, if it is known.
    pub unit: Option<String>,
    pub values: MeanAndDispersion<f32>,
}

impl FieldGrid {
    /// The dispersions with their unit, if that is known; a sum has none.
    pub fn dispersion(&self) -> Option<(&[Vec<f32>], Option<String>)> {
        (!self.quantity.extensive).then(|| (&self.values.dispersion[..], self.quantity.dispersion_unit()))
    }
}

/// The fields of a model, by names in upper or lower case, for the cells of a file of this kind; `all` means every one.
pub fn fields_named(kind: Kind, model: &Model, names: &[String]) -> Result<Vec<Quantity>> {
    if !names.is_empty() && !kind.has_fields_in_cells() {
        let message = format!("fields on a grid are written to .vti and .fits, not to .{}", kind.ending());
        return Err(Error::argument_with(message, ".npz and .csv contain the fields of the Gaussians anyway"));
    }
    // Not those that only other layers have.
    let is_there = |q: &&Quantity| model.blocks().any(|b| b.gaussians.fields.get(&q.name).is_some());
    let model_fields: Vec<&Quantity> = model.metadata.fields.iter().filter(is_there).collect();
    let mut chosen_fields: Vec<Quantity> = Vec::new();
    for name in names {
        let matching_fields = model_fields.iter().filter(|q| name == "all" || q.name.eq_ignore_ascii_case(name));
        let before = chosen_fields.len();
        chosen_fields.extend(matching_fields.copied().cloned());
        if chosen_fields.len() == before {
            return Err(match model_fields.is_empty() {
                true => {
                    let hint = Hint::from("compress the snapshot again with ").option("fields", "NAME");
                    Error::argument_with("the model has no fields", hint)
                }
                false => {
                    let names: Vec<&str> = model_fields.iter().map(|q| &q.name[..]).collect();
                    let hint = format!("its fields: {}", names.join(", "));
                    Error::argument_with(format!("the model has no field `{name}`"), hint)
                }
            });
        }
    }
    let mut unique_names = BTreeSet::new();
    chosen_fields.retain(|q| unique_names.insert(q.name.clone()));
    Ok(chosen_fields)
}

/// Values of a field as float32, where that holds them.
fn narrow(values: &[f64], name: &str) -> Result<Vec<f32>> {
    let finite_values = || values.iter().copied().filter(|v| v.is_finite());
    let [least, largest] =
        [finite_values().fold(f64::INFINITY, f64::min), finite_values().fold(f64::NEG_INFINITY, f64::max)];
    // No value is finite where the least is above the largest.
    match least > largest || float32_holds([least, largest]) {
        true => Ok(values.iter().map(|v| *v as f32).collect()),
        false => Err(Error::argument_with(
            format!("float32 does not hold the values of `{name}`, {least:e} to {largest:e}, and a grid has no others"),
            "export the Gaussians as .npz or .csv, whose numbers are float64",
        )),
    }
}

impl Density {
    /// Of all layers of a model.
    pub fn new(model: &Model, cells: Cells, context: &Context<'_>) -> Result<Density> {
        model.check_density(|_| true)?;
        let grid = cells.over_model(model)?;
        let subject = Subject::Model(model);
        context.begin("density", 0);
        // Of a model this is the integral over each cell, whatever the assignment.
        let field = deposit(subject, &grid, Assignment::Ngp, 0.0, context)?;
        context.end();
        let total = field.mass.iter().map(|m| f64::from(*m)).sum();
        let volume: f64 = grid.side.iter().product();
        let mut values = field.mass;
        // In f64, since float32 may not hold the volume of a cell.
        values.iter_mut().for_each(|v| *v = (f64::from(*v) / volume) as f32);
        if values.iter().any(|v| !v.is_finite()) || volume.is_nan() {
            return Err(Error::argument("the density in the units of the file does not fit into float32"));
        }
        Ok(Density {
            grid,
            values,
            unit: density_unit(&model.metadata, model.has_masses(), 3),
            total,
            outside: field.outside,
            fields: Vec::new(),
        })
    }

    /// Adds fields of the same model.
    pub fn add_fields(&mut self, model: &Model, fields: Vec<Quantity>, context: &Context<'_>) -> Result<()> {
        for quantity in fields {
            context.begin(&format!("field {}", quantity.name), 0);
            let values = field_in_cells(model, &quantity.name, &self.grid, context)?;
            context.end();
            let unit = quantity.place_unit(model.metadata.units.length_text());
            let mean = values.mean.iter().map(|c| narrow(c, &quantity.name)).collect::<Result<_>>()?;
            let dispersion = values.dispersion.iter().map(|c| c.iter().map(|v| *v as f32).collect()).collect();
            self.fields.push(FieldGrid { quantity, unit, values: MeanAndDispersion { mean, dispersion } });
        }
        Ok(())
    }

    /// Runs of values with x fastest, as VTK and FITS have them, some planes across z at a time; of several columns
    /// cell by cell.
    pub fn for_each_run(
        &self,
        columns: &[&[f32]],
        mut write: impl FnMut(&[f32]) -> std::io::Result<()>,
    ) -> std::io::Result<()> {
        /// Values held at once, where a plane has no more.
        const HELD: usize = 1 << 22;
        let [nx, ny, nz] = self.grid.cells;
        let width = columns.len();
        let planes = (HELD / (nx * ny * width)).clamp(1, nz);
        let mut run = vec![0f32; planes * nx * ny * width];
        for first in (0..nz).step_by(planes) {
            let number = planes.min(nz - first);
            for i in 0..nx {
                for j in 0..ny {
                    // Values lie with z fastest: these of one row are read together.
                    let row = (i * ny + j) * nz + first;
                    for (c, column) in columns.iter().enumerate() {
                        for (k, v) in column[row..row + number].iter().enumerate() {
                            run[((k * ny + j) * nx + i) * width + c] = *v;
                        }
                    }
                }
            }
            write(&run[..number * nx * ny * width])?;
        }
        Ok(())
    }
}

/// Unit of mass where it is known, else of particles, by a power of length, in ASCII: `Msun/h / (Mpc/h)^3`.
pub fn density_unit(m: &Metadata, masses_known: bool, power: u8) -> String {
    let mass = match masses_known {
        true => m.units.mass_text().unwrap_or("mass"),
        false => "particles",
    };
    match m.units.length_text() {
        None => format!("{mass} / length^{power}"),
        Some(l) if l.contains(['/', ' ']) => format!("{mass} / ({l})^{power}"),
        Some(l) => format!("{mass} / {l}^{power}"),
    }
}

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
        let lines = std::iter::once(ascii(&unit_line)).chain(notes.lines()).collect();
        AngstromGrid { origin, side, by: length.powi(-3), lines }
    }
}

/// A unit of length in Angstrom, if it is one of molecules: below a micrometre.
fn scale(unit: Option<&str>) -> Option<f64> {
    // Units with powers of a or h are those of cosmology.
    let size = |text: &str| Unit::parts(text, Dimension::Length).filter(|unit| (unit.3, unit.4) == (0.0, 0.0));
    let (number, _, size, ..) = unit.and_then(size)?;
    // In as many digits as units have.
    let angstrom: f64 = format!("{:.11e}", number * size / 1e-10).parse().ok()?;
    Some(angstrom).filter(|length| *length > 0.0 && *length < 1e4)
}

/// A note on the unit of length, if a file of this kind loses it.
pub fn lost_unit(kind: Kind, unit: Option<&str>) -> Option<String> {
    let is_lost = matches!(kind, Kind::Dx | Kind::Mrc) && scale(unit).is_none();
    let unit = unit.map_or("an unstated unit".into(), ascii);
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

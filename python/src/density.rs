//! Densities and fields of a model, in cells or at points.

use crate::arrays::{self, shaped};
use crate::work::WorkOptions;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn};
use particlegs_core::model::Model;
use particlegs_export::{Cells, Density};
use particlegs_measure::stats::{self, field_in_cells};
use particlegs_particles::Domain;
use pyo3::prelude::*;

/// Number of cells of a grid.
#[derive(FromPyObject)]
pub enum CellNumbers {
    /// Along the longest edge.
    Longest(usize),
    /// Along x, y and z.
    Each([usize; 3]),
}

impl From<CellNumbers> for Cells {
    fn from(numbers: CellNumbers) -> Cells {
        match numbers {
            CellNumbers::Longest(n) => Cells::Along(n),
            CellNumbers::Each(cells) => Cells::Numbers(cells),
        }
    }
}

/// A field's name, and whether its dispersion is meant; `None` for the density.
pub type FieldName = Option<(String, bool)>;

/// Values in cells: array, origin, cell edges, mass beyond the grid.
type CellValues<'py> = (Bound<'py, PyArrayDyn<f64>>, [f64; 3], [f64; 3], f64);

/// Density, or means (or dispersions) of a field, over cells: for a vector with a last axis of 3.
pub fn grid<'py>(
    py: Python<'py>,
    model: &Model,
    field: FieldName,
    cells: CellNumbers,
    threads: Option<usize>,
) -> PyResult<CellValues<'py>> {
    let (work, cells) = (WorkOptions::quietly(threads), Cells::from(cells));
    let Some((field, dispersion)) = field else {
        let density = work.run(py, |context| Density::new(model, cells, context))?;
        let values = density.values.iter().map(|v| f64::from(*v)).collect();
        return Ok((shaped(py, &density.grid.cells, values)?, density.grid.min, density.grid.side, density.outside));
    };
    let (grid, moments) = work.run(py, |context| {
        let grid = cells.over_model(model)?;
        Ok((grid, field_in_cells(model, &field, &grid, context)?))
    })?;
    let columns = if dispersion { moments.dispersion } else { moments.mean };
    Ok((columns_of(py, &grid.cells, &columns)?, grid.min, grid.side, f64::NAN))
}

/// Density, or means (or dispersions) of a field, at points: (n,), or (n, 3) of a vector.
pub fn at<'py>(
    py: Python<'py>,
    model: &Model,
    field: FieldName,
    points: &PyReadonlyArrayDyn<'py, f64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let (points, domain) = (arrays::points(points)?, Domain::from_model(model));
    let work = WorkOptions::quietly(threads);
    let Some((field, dispersion)) = field else {
        let values = work.run(py, |context| stats::density_at(&domain, model, &points, context))?;
        return shaped(py, &[points.len()], values);
    };
    let moments = work.run(py, |context| stats::field_at(&domain, model, &field, &points, context))?;
    columns_of(py, &[points.len()], if dispersion { &moments.dispersion } else { &moments.mean })
}

/// Columns of equal length as the last axis of an array, if there are several.
fn columns_of<'py>(py: Python<'py>, shape: &[usize], columns: &[Vec<f64>]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let rows = 0..shape.iter().product();
    let values = rows.flat_map(|i| columns.iter().map(move |c| c[i])).collect();
    let components = Some(columns.len()).filter(|n| *n > 1);
    shaped(py, &shape.iter().copied().chain(components).collect::<Vec<_>>(), values)
}

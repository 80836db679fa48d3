//! Densities and fields of a model, in cells or at points.

use crate::arrays;
use crate::errors::InputError;
use crate::work::WorkOptions;
use numpy::ndarray::{ArrayD, IxDyn};
use numpy::{IntoPyArray, PyArrayDyn, PyReadonlyArrayDyn};
use particlegs_core::model::{LawKind, Mass, Model};
use particlegs_export::{Cells, Density};
use particlegs_measure::stats;
use particlegs_measure::stats::field_in_cells;
use particlegs_particles::Domain;
use pyo3::prelude::*;

/// How many cells a grid has.
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

/// Refuses models without densities, and layers that cannot be added.
pub fn refuse_without_masses(model: &Model, shown: &[bool]) -> PyResult<()> {
    if model.metadata.law == LawKind::AlphaBlend {
        let what = "an alpha-blend model has no density, because its splats have opacities instead of masses: draw \
                    particles with Model.recover";
        return Err(InputError::new_err(what));
    }
    let layers: Vec<_> = model.layers.iter().zip(shown).filter(|(_, shown)| **shown).map(|(l, _)| l.mass).collect();
    let known = layers.iter().filter(|m| **m != Mass::Unknown).count();
    if known > 0 && known < layers.len() {
        let what = "some layers have masses and others do not, so they cannot be added: choose layers by layers=";
        return Err(InputError::new_err(what));
    }
    Ok(())
}

/// Density in cells: values, origin, cell edges, mass beyond the grid.
pub fn grid<'py>(
    py: Python<'py>,
    model: &Model,
    cells: CellNumbers,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, [f64; 3], [f64; 3], f64)> {
    refuse_without_masses(model, &vec![true; model.layers.len()])?;
    let how = WorkOptions::quietly(threads);
    let density = how.run(py, |progress| Density::new(model, cells.into(), progress))?;
    let values: Vec<f64> = density.values.iter().map(|v| f64::from(*v)).collect();
    let array = ArrayD::from_shape_vec(IxDyn(&density.grid.cells), values);
    let array = array.map_err(|e| InputError::new_err(e.to_string()))?.into_pyarray(py);
    Ok((array, density.grid.min, density.grid.side, density.outside))
}

/// Means (or dispersions) of a field over cells: values with a last axis of 3 for a vector, origin, cell edges.
pub fn field_grid<'py>(
    py: Python<'py>,
    model: &Model,
    (field, dispersion): (&str, bool),
    cells: CellNumbers,
    threads: Option<usize>,
) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, [f64; 3], [f64; 3])> {
    let (grid, found) = WorkOptions::quietly(threads).run(py, |progress| {
        let grid = Cells::from(cells).over_model(model)?;
        Ok((grid, field_in_cells(model, field, &grid, progress)?))
    })?;
    let columns = if dispersion { found.dispersion } else { found.mean };
    let values = (0..grid.len()).flat_map(|i| columns.iter().map(move |c| c[i])).collect();
    let components = Some(columns.len()).filter(|n| *n > 1);
    let shape: Vec<usize> = grid.cells.into_iter().chain(components).collect();
    let array = ArrayD::from_shape_vec(IxDyn(&shape), values);
    let array = array.map_err(|e| InputError::new_err(e.to_string()))?.into_pyarray(py);
    Ok((array, grid.min, grid.side))
}

/// Means (or dispersions) of a field at points: (n,) of a scalar, (n, 3) of a vector.
pub fn field_at<'py>(
    py: Python<'py>,
    model: &Model,
    (field, dispersion): (&str, bool),
    points: &PyReadonlyArrayDyn<'py, f64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let points = arrays::points(points)?;
    let found = WorkOptions::quietly(threads)
        .run(py, |progress| stats::field_at(&Domain::from_model(model), model, field, &points, progress))?;
    let columns = if dispersion { found.dispersion } else { found.mean };
    let rows: Vec<f64> = (0..points.len()).flat_map(|i| columns.iter().map(move |c| c[i])).collect();
    let shape = if columns.len() == 1 { vec![points.len()] } else { vec![points.len(), columns.len()] };
    let array = ArrayD::from_shape_vec(IxDyn(&shape), rows);
    Ok(array.map_err(|e| InputError::new_err(e.to_string()))?.into_pyarray(py))
}

/// Density at points, (n,).
pub fn at<'py>(
    py: Python<'py>,
    model: &Model,
    points: &PyReadonlyArrayDyn<'py, f64>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    refuse_without_masses(model, &vec![true; model.layers.len()])?;
    let points = arrays::points(points)?;
    let values = WorkOptions::quietly(threads)
        .run(py, |progress| stats::density_at(&Domain::from_model(model), model, &points, progress))?;
    let array = ArrayD::from_shape_vec(IxDyn(&[values.len()]), values);
    Ok(array.map_err(|e| InputError::new_err(e.to_string()))?.into_pyarray(py))
}

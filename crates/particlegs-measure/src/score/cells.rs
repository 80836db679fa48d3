//! A model's density against its particles' in cells of three sizes, which are given in the data's units and in
//! particles.

use crate::score::density::{density_agreement, model_and_uniform};
use crate::stats::{Assignment, Field, Grid, Subject, deposit, deposit_bytes, deposit_steps};
use particlegs_core::context::Context;
use particlegs_core::model::{CELL_SIZES, CellDensity, DrawnDensity, Model};
use particlegs_core::{Error, Result};
use particlegs_particles::{Domain, Particles};

/// Densities in cells of all sizes.
type CellDensities = [CellDensity; CELL_SIZES];

/// Compares the densities of the model and, where there are any, of particles drawn from it; `None` where the box holds
/// fewer cells than make a comparison.
pub(super) fn cell_densities(
    model: &Model,
    (particles, drawn): (&Particles, Option<&Particles>),
    domain: &Domain,
    context: &Context<'_>,
) -> Result<Option<(CellDensities, Option<[DrawnDensity; CELL_SIZES]>)>> {
    let Some(grid) = finest(domain, particles.len()) else { return Ok(None) };
    let [truth, other] = [Subject::Particles(particles), Subject::Model(model)];
    let subjects = [truth, other].into_iter().chain(drawn.map(Subject::Particles));
    context.begin("density in cells", subjects.map(|subject| deposit_steps(subject, &grid)).sum());
    let field_of = |subject| deposit(subject, &grid, Assignment::Ngp, 0.0, context);
    let truth = field_of(truth)?;
    let of_drawn = drawn.map(|drawn| field_of(Subject::Particles(drawn))).transpose()?;
    let of_drawn = of_drawn.and_then(|of_drawn| agreements([truth.clone(), of_drawn], particles.len()));
    let of_model = agreements([truth, field_of(other)?], particles.len());
    context.end();
    let of_drawn = of_drawn.map(|sizes| {
        sizes.map(|CellDensity { correlation, mean_absolute_error, .. }| DrawnDensity {
            correlation,
            mean_absolute_error,
        })
    });
    Ok(of_model.map(|of_model| (of_model, of_drawn)))
}

/// The agreement of the particles' field and the model's, both on the grid of the smallest cells; `particles` in all.
pub(super) fn agreements(pair: [Field; 2], particles: usize) -> Option<CellDensities> {
    let grid = pair[0].grid;
    let mut pair = pair.map(Masses::from_field);
    let mut densities = Vec::with_capacity(CELL_SIZES);
    for size in 0..CELL_SIZES {
        if size > 0 {
            // Larger cells are sums of the smaller ones: nothing is deposited again.
            pair = pair.map(|cells| cells.coarser());
        }
        let edge = grid.side.iter().fold(0.0, |a: f64, s| a.max(*s)) * (1 << size) as f64;
        densities.push(compared(&pair, edge, particles));
    }
    densities.try_into().ok()
}

/// The grid of the smallest cells; `None` where it has too few of them.
pub(super) fn finest(domain: &Domain, particles: usize) -> Option<Grid> {
    let grid = Grid::of_eight(domain, particles);
    (grid.len() >= 512 && domain.longest().is_normal()).then_some(grid)
}

/// The fewest cells whose correlation says something, and the most that are filled: 512 MB of each density.
const ASKED_CELLS: std::ops::RangeInclusive<f64> = 64.0..=134_217_728.0;

/// The particles' density in cells of an edge that was asked for.
pub(super) struct Cells {
    grid: Grid,
    truth: Vec<f32>,
}

impl Cells {
    /// Fills the fewest equal cells that are no longer than `edge`: 50 along a box of 50 for an edge of 1, 63 for 0.8.
    pub fn new(edge: f64, particles: &Particles, domain: &Domain, context: &Context<'_>) -> Result<Self> {
        let grid = grid_of_edge(edge, domain)?;
        // Both densities, and the sums while one is filled.
        let bytes = 8 * grid.len() as u64 + deposit_bytes(&grid, particles.len() as u64);
        particlegs_files::memory::require("the density in cells of that edge", bytes)?;
        let truth = filled(Subject::Particles(particles), &grid, context)?;
        Ok(Cells { grid, truth })
    }

    /// Pearson's coefficient of the particles' density and another's.
    pub fn correlation(&self, other: Subject<'_>, context: &Context<'_>) -> Result<f64> {
        Ok(density_agreement(&self.truth, &filled(other, &self.grid, context)?).correlation)
    }
}

fn filled(subject: Subject<'_>, grid: &Grid, context: &Context<'_>) -> Result<Vec<f32>> {
    context.begin("density in cells", 0);
    let field = deposit(subject, grid, Assignment::Ngp, 0.0, context)?;
    context.end();
    Ok(field.mass)
}

fn grid_of_edge(edge: f64, domain: &Domain) -> Result<Grid> {
    // An edge that divides the box but for rounding makes no further cell.
    let along = domain.length.map(|l| (l / edge * (1.0 - 1e-9)).ceil().max(1.0));
    let cells: f64 = along.iter().product();
    if ASKED_CELLS.contains(&cells) {
        return Ok(Grid::stretched(domain, along.map(|n| n as usize)));
    }
    let length = domain.longest();
    Err(Error::argument(if cells < *ASKED_CELLS.start() {
        format!(
            "cells of {edge} are too large: the longest edge of the box, {length:.4}, has {cells} of them, but \
             needs {}",
            ASKED_CELLS.start()
        )
    } else {
        format!(
            "cells of {edge} are too small: the longest edge of the box, {length:.4}, has {cells:.3e} of them; the \
             limit is {:.3e}",
            ASKED_CELLS.end()
        )
    }))
}

fn compared([truth, model]: &[Masses; 2], edge: f64, particles: usize) -> CellDensity {
    let [agreement, uniform] = model_and_uniform(&truth.mass, &model.mass);
    CellDensity {
        edge,
        particles: particles as f64 / truth.mass.len() as f64,
        correlation: agreement.correlation,
        mean_absolute_error: agreement.mean_absolute_error,
        uniform_mean_absolute_error: uniform.mean_absolute_error,
    }
}

/// Mass in cells, x slowest.
pub(super) struct Masses {
    cells: [usize; 3],
    pub mass: Vec<f64>,
}

impl Masses {
    pub fn from_field(field: Field) -> Masses {
        Masses { cells: field.grid.cells, mass: field.mass.into_iter().map(f64::from).collect() }
    }

    /// Eight cells as one; fewer where a number of cells is odd.
    pub fn coarser(&self) -> Masses {
        let cells = self.cells.map(|n| n.div_ceil(2));
        let mut mass = vec![0.0; cells.iter().product()];
        let (plane, row) = (self.cells[1] * self.cells[2], self.cells[2]);
        for (at, m) in self.mass.iter().enumerate() {
            let (i, j, k) = (at / plane, at % plane / row, at % row);
            mass[(i / 2 * cells[1] + j / 2) * cells[2] + k / 2] += m;
        }
        Masses { cells, mass }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_eight_particles_and_more() {
        let cube = Domain::upright([0.0; 3], [50.0; 3], [true; 3]);
        assert_eq!(finest(&cube, 1 << 21).unwrap().cells, [64; 3]);
        assert_eq!(finest(&cube, 1 << 30).unwrap().cells, [256; 3]);
        assert!(finest(&cube, 100).is_none());
        let plate = Domain::upright([0.0; 3], [50.0, 50.0, 1e-3], [false; 3]);
        assert_eq!(finest(&plate, 1 << 21).unwrap().cells, [256, 256, 4]);
    }

    #[test]
    fn cells_of_an_edge_are_no_longer_than_it() {
        let cube = Domain::upright([0.0; 3], [50.0; 3], [true; 3]);
        assert_eq!(grid_of_edge(1.0, &cube).unwrap().cells, [50; 3]);
        assert_eq!(grid_of_edge(0.8, &cube).unwrap().cells, [63; 3]);
        // A length that is no binary number.
        assert_eq!(grid_of_edge(0.1, &Domain { length: [30.0, 3.0, 0.05], ..cube }).unwrap().cells, [300, 30, 1]);
        let refusal_of = |edge| grid_of_edge(edge, &cube).unwrap_err().to_string();
        assert!(
            refusal_of(60.0).contains("too large") && refusal_of(20.0).contains("has 27 of them"),
            "{}",
            refusal_of(20.0)
        );
        assert!(refusal_of(0.01).contains("too small") && refusal_of(1e-300).contains("too small"));
    }

    #[test]
    fn coarser_cells_keep_the_mass() {
        let fine = Masses { cells: [4, 2, 2], mass: (0..16).map(f64::from).collect() };
        let coarse = fine.coarser();
        assert_eq!((coarse.cells, coarse.mass), ([2, 1, 1], vec![28.0, 92.0]));
    }
}

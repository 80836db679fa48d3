//! A model's density against its particles' in cells of three sizes, told in the data's units and in particles.

use crate::Result;
use crate::model::{CELL_SIZES, CellDensity, Model};
use crate::particles::Particles;
use crate::progress::Progress;
use crate::score::density::density_agreement;
use crate::stats::{Assignment, Domain, Field, Grid, Subject, deposit, deposit_steps};
use particlegs_core::math::each_axis;

/// Edge of the smallest cells in mean spacings: eight particles in a cell on average.
const SMALLEST: f64 = 2.0;
/// Cells along the longest edge at most: 200 MB while they are filled.
const MOST_CELLS: f64 = 256.0;
/// Each size of cells has twice the edge of the one before.
const COARSEST: usize = 1 << (CELL_SIZES - 1);

/// Compares the densities; `None` where the box holds fewer cells than make a comparison.
///
/// # Errors
/// [`crate::Error::Memory`], [`crate::Error::Cancelled`].
pub(super) fn cell_densities(
    model: &Model,
    particles: &Particles,
    domain: &Domain,
    progress: &dyn Progress,
) -> Result<Option<[CellDensity; CELL_SIZES]>> {
    let Some(grid) = finest(domain, particles.len()) else { return Ok(None) };
    let [truth, other] = [Subject::Particles(particles), Subject::Model(model)];
    progress.begin("density in cells", deposit_steps(truth, &grid) + deposit_steps(other, &grid));
    let of = |subject| deposit(subject, &grid, Assignment::Ngp, 0.0, progress);
    let mut pair = [of(truth)?, of(other)?].map(Cells::of);
    let mut found = Vec::with_capacity(CELL_SIZES);
    for size in 0..CELL_SIZES {
        if size > 0 {
            pair = pair.map(|cells| cells.coarser());
        }
        let edge = grid.side.iter().fold(0.0, |a: f64, s| a.max(*s)) * (1 << size) as f64;
        found.push(compared(&pair, edge, particles.len()));
    }
    progress.end();
    Ok(found.try_into().ok())
}

/// The grid of the smallest cells, in whole numbers of the largest.
fn finest(domain: &Domain, particles: usize) -> Option<Grid> {
    let edge = (SMALLEST * domain.spacing(particles)).max(domain.longest() / MOST_CELLS);
    let cells = each_axis(|k| COARSEST * (domain.length[k] / (edge * COARSEST as f64)).round().max(1.0) as usize);
    let enough = cells.iter().product::<usize>() >= 512;
    (enough && edge.is_normal()).then(|| Grid::stretched(domain, cells))
}

fn compared([truth, model]: &[Cells; 2], edge: f64, particles: usize) -> CellDensity {
    let uniform = vec![truth.mass.iter().sum::<f64>() / truth.mass.len() as f64; truth.mass.len()];
    let agreement = density_agreement(&truth.mass, &model.mass);
    CellDensity {
        edge,
        particles: particles as f64 / truth.mass.len() as f64,
        correlation: agreement.correlation,
        mean_absolute_error: agreement.mean_absolute_error,
        uniform_mean_absolute_error: density_agreement(&truth.mass, &uniform).mean_absolute_error,
    }
}

/// Mass in cells, x slowest.
struct Cells {
    cells: [usize; 3],
    mass: Vec<f64>,
}

impl Cells {
    fn of(field: Field) -> Cells {
        Cells { cells: field.grid.cells, mass: field.mass.into_iter().map(f64::from).collect() }
    }

    /// Eight cells as one.
    fn coarser(&self) -> Cells {
        let cells = self.cells.map(|n| n / 2);
        let mut mass = vec![0.0; cells.iter().product()];
        let (plane, row) = (self.cells[1] * self.cells[2], self.cells[2]);
        for (at, m) in self.mass.iter().enumerate() {
            let (i, j, k) = (at / plane, at % plane / row, at % row);
            mass[(i / 2 * cells[1] + j / 2) * cells[2] + k / 2] += m;
        }
        Cells { cells, mass }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_hold_eight_particles_and_more() {
        let cube = Domain { min: [0.0; 3], length: [50.0; 3], periodic: [true; 3] };
        assert_eq!(finest(&cube, 1 << 21).unwrap().cells, [64; 3]);
        assert_eq!(finest(&cube, 1 << 30).unwrap().cells, [256; 3]);
        assert!(finest(&cube, 100).is_none());
        let plate = Domain { min: [0.0; 3], length: [50.0, 50.0, 1e-3], periodic: [false; 3] };
        assert_eq!(finest(&plate, 1 << 21).unwrap().cells, [256, 256, 4]);
    }

    #[test]
    fn coarser_cells_keep_the_mass() {
        let fine = Cells { cells: [4, 2, 2], mass: (0..16).map(f64::from).collect() };
        let coarse = fine.coarser();
        assert_eq!((coarse.cells, coarse.mass), ([2, 1, 1], vec![28.0, 92.0]));
    }
}

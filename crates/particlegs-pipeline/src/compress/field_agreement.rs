//! How far the fields of a model are those of particles that they were not gathered from, for its certificate.

use super::FieldSelection;
use crate::context::Context;
use crate::fit::{FieldMeans, FieldShape, gather};
use crate::math::{Purpose, Random};
use crate::model::{CERTIFIED_FIELDS, FieldAgreement, FieldAgreements, Model};
use crate::particles::{ChunkBuffer, Particles, RUN};
use crate::stats::{Domain, Grid};
use crate::{Result, parallel};
use particlegs_core::math::each_axis;
use particlegs_files::memory::require;

/// Edge of a cell in mean spacings: 64 particles in a cell on average.
const CELL: f64 = 4.0;
/// Cells along the longest edge at most.
const MOST_CELLS: f64 = 256.0;
/// Particles of a layer that is looked at, and cells that say something, at least.
const LEAST_PARTICLES: usize = 200;
const LEAST_CELLS: usize = 8;
/// Particles that are looked at, about: of more, those of a slab about the middle of the longest edge.
const LOOKED_AT: usize = 1 << 19;
/// Positions that tell where it lies.
const POSITIONS: usize = 1 << 14;
/// Runs of particles that wait together.
const RUNS: usize = 4;

/// Of a cell: weights of the first half and the second; then, of each component, sums of weight times value of the first
/// half and the second, and of weight times the model's mean at the places of the second.
type CellSums = [f64; 11];

/// Cells over the box of all particles, the slab that is looked at, and the seed that halves its particles.
struct FieldCells {
    domain: Domain,
    grid: Grid,
    slab: FieldSlab,
    seed: u64,
}

/// Places between two along an axis.
#[derive(Clone, Copy)]
struct FieldSlab {
    axis: usize,
    from: f64,
    to: f64,
}

/// Which half a particle is of.
#[derive(Clone, Copy, PartialEq)]
enum Half {
    First,
    Second,
    /// It is not looked at.
    Neither,
}

impl FieldSlab {
    fn new(particles: &Particles, domain: &Domain) -> FieldSlab {
        let axis = (0..3).fold(0, |a, k| if domain.length[k] > domain.length[a] { k } else { a });
        let (n, all) = (particles.len(), FieldSlab { axis, from: f64::NEG_INFINITY, to: f64::INFINITY });
        if n <= LOOKED_AT {
            return all;
        }
        let place = |i: usize| particles.position(i * (n / POSITIONS))[axis];
        let mut places: Vec<f64> = (0..POSITIONS).map(place).collect();
        places.sort_unstable_by(f64::total_cmp);
        let wide = POSITIONS * LOOKED_AT / n / 2;
        FieldSlab { from: places[POSITIONS / 2 - wide], to: places[POSITIONS / 2 + wide], ..all }
    }

    fn holds(&self, x: [f64; 3]) -> bool {
        (self.from..self.to).contains(&x[self.axis])
    }
}

impl FieldCells {
    fn cell_of(&self, x: [f64; 3]) -> usize {
        let (local, g) = (self.domain.local(x), &self.grid);
        let place = |k: usize| (self.domain.along(&local, k) / g.side[k]).max(0.0) as usize;
        g.index(each_axis(|k| place(k).min(g.cells[k] - 1)))
    }

    fn half(&self, particles: &Particles, i: usize) -> Half {
        if !self.slab.holds(particles.position(i)) {
            return Half::Neither;
        }
        match Random::from_purpose(Purpose::FieldHalves, self.seed, i as u64).bits() & 1 {
            0 => Half::First,
            _ => Half::Second,
        }
    }
}

impl FieldSelection<'_> {
    /// Gathers the first fields from a random half of the particles, as [`FieldSelection::add_to_model`] does from all, for the
    /// Gaussians of a `model` that was made of all, and compares with the other half: means in cells, whose sampling noise
    /// is independent in the halves. Of many particles, those of a slab. `None` without fields.
    pub fn agreement(&self, model: &Model, seed: u64, context: &Context<'_>) -> Result<Option<FieldAgreements>> {
        if self.quantities().is_empty() {
            return Ok(None);
        }
        let domain = Domain::from_particles(self.particles);
        let slab = FieldSlab::new(self.particles, &domain);
        let edge = (CELL * domain.spacing(self.particles.len())).max(domain.longest() / MOST_CELLS);
        let grid = Grid::new(&domain, (domain.longest() / edge).round().max(1.0) as usize);
        let (fields, cells) = (self.quantities().len().min(CERTIFIED_FIELDS), FieldCells { slab, domain, grid, seed });
        require("fields in cells", (fields * grid.len() * size_of::<CellSums>()) as u64)?;
        let mut sums = vec![vec![CellSums::default(); grid.len()]; fields];
        for index in 0..self.particles.layers().len() {
            self.add_layer(index, model, &cells, &mut sums, context)?;
        }
        let mut agreements = FieldAgreements::default();
        for (to, sums) in agreements.each.iter_mut().zip(&sums) {
            let found = compared(sums);
            let edge = grid.side.iter().copied().fold(0.0, f64::max);
            *to = Some(FieldAgreement { edge, ..found });
        }
        Ok(Some(agreements))
    }

    fn add_layer(
        &self,
        index: usize,
        model: &Model,
        cells: &FieldCells,
        sums: &mut [Vec<CellSums>],
        context: &Context<'_>,
    ) -> Result<()> {
        let layer = &self.particles.layers()[index];
        let at = model.layers.iter().position(|l| l.name == layer.name);
        // Particles of the other half lack values.
        let shapes: Vec<FieldShape<'_>> =
            self.shapes(index).into_iter().map(|s| FieldShape { may_lack: true, ..s }).collect();
        let (Some(at), true) = (at, !shapes.is_empty() && layer.content.len() >= LEAST_PARTICLES) else {
            return Ok(());
        };
        let (blocks, particles) = (&model.layers[at].content, self.particles.of_layer(layer));
        let half = |i: usize| cells.half(self.particles, layer.content.start + i);
        let halves = parallel::map(0..particles.len().div_ceil(RUN), |run| {
            (run * RUN..particles.len().min((run + 1) * RUN)).map(half).collect::<Vec<Half>>()
        });
        let read = |run: u64, out: &mut Vec<Vec<f64>>| {
            self.read(index, run, out)?;
            for column in out {
                let others = column.iter_mut().zip(&halves[run as usize]).filter(|(_, half)| **half != Half::First);
                others.for_each(|(v, _)| *v = f64::NAN);
            }
            Ok(())
        };
        let gathered = gather(blocks, &particles, &shapes, &read, context)?;
        let numbers = self.numbers(index);
        let means = FieldMeans::new(blocks);
        let runs = particles.len().div_ceil(RUN);
        for first in (0..runs).step_by(RUNS) {
            let parts = parallel::try_map(first..runs.min(first + RUNS), |run| {
                context.check()?;
                let (mut values, mut buffer, mut shares) = (Vec::new(), ChunkBuffer::default(), Vec::new());
                self.read(index, run as u64, &mut values)?;
                let start = run * RUN;
                let chunk = particles.chunk(start..particles.len().min(start + RUN), &mut buffer);
                let mut found = Vec::with_capacity(chunk.len() * shapes.len());
                for i in 0..chunk.len() {
                    let x = each_axis(|k| particles.origin[k] + f64::from(chunk.position[k][i]));
                    let half = match halves[run][i] {
                        Half::First => 0,
                        Half::Second => 1,
                        Half::Neither => continue,
                    };
                    let weight = chunk.weight.map_or(1.0, |w| f64::from(w[i]));
                    let mut column = 0;
                    for (place, (number, shape)) in numbers.iter().zip(&shapes).enumerate() {
                        let first = column;
                        column += shape.columns();
                        if values[first][i].is_nan() {
                            continue;
                        }
                        let mut own = CellSums::default();
                        own[half] = weight;
                        let mean = if half == 1 { means.at(&gathered, place, x, &mut shares) } else { [0.0; 3] };
                        for c in 0..shape.components {
                            own[2 + 3 * c + half] = weight * values[first + c][i];
                            own[4 + 3 * c] = weight * mean[c];
                        }
                        found.push((cells.cell_of(x), *number, own));
                    }
                }
                Ok::<_, crate::Error>(found)
            })?;
            for (cell, number, own) in parts.iter().flatten() {
                if let Some(sums) = sums.get_mut(*number) {
                    sums[*cell].iter_mut().zip(own).for_each(|(a, b)| *a += b);
                }
            }
        }
        Ok(())
    }
}

/// Signal and error of the means in cells, both without sampling noise: the variance of the model's means, their
/// covariance with those of the second half, and that of the means of both halves.
fn compared(sums: &[CellSums]) -> FieldAgreement {
    let there: Vec<&CellSums> = sums.iter().filter(|s| s[0] > 0.0 && s[1] > 0.0).collect();
    let total: f64 = there.iter().map(|s| s[0] + s[1]).sum();
    let (mut signal, mut error) = (0.0, 0.0);
    for c in 0..3 {
        let means = |s: &CellSums| [s[2 + 3 * c] / s[0], s[3 + 3 * c] / s[1], s[4 + 3 * c] / s[1]];
        let mean: [f64; 3] = each_axis(|k| there.iter().map(|s| (s[0] + s[1]) * means(s)[k]).sum::<f64>() / total);
        let covariance = |a: usize, b: usize| {
            let product = |s: &&CellSums| {
                let m = means(s);
                (s[0] + s[1]) * (m[a] - mean[a]) * (m[b] - mean[b])
            };
            there.iter().map(product).sum::<f64>() / total
        };
        signal += covariance(0, 1);
        error += covariance(0, 1) + covariance(2, 2) - 2.0 * covariance(1, 2);
    }
    if there.len() < LEAST_CELLS || signal.is_nan() || signal <= 0.0 {
        return FieldAgreement::default();
    }
    // The file holds them as f32.
    let root = |v: f64| v.max(0.0).sqrt().min(f64::from(f32::MAX));
    FieldAgreement { edge: 0.0, cells: there.len() as u32, signal: root(signal), error: root(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells whose true means have a deviation of 3, measured with noise by both halves, by a model that has 0.9 of them.
    #[test]
    fn noise_is_taken_off() {
        let sums: Vec<CellSums> = (0..40_000)
            .map(|i| {
                let mut r = Random::new(2, 0, i);
                let (truth, mut cell) = (3.0 * r.normal(), CellSums::default());
                (cell[0], cell[1]) = (2.0, 5.0);
                cell[2] = 2.0 * (truth + 2.0 * r.normal());
                cell[3] = 5.0 * (truth + 1.5 * r.normal());
                cell[4] = 5.0 * (0.9 * truth + 0.4 * r.normal());
                cell
            })
            .collect();
        let found = compared(&sums);
        let error = f64::sqrt(0.3 * 0.3 + 0.4 * 0.4);
        assert!((found.signal - 3.0).abs() < 0.06 && (found.error - error).abs() < 0.12, "{found:?}");
        assert_eq!(found.cells, 40_000);
        let noise: Vec<CellSums> =
            sums.iter().map(|s| [1.0, 1.0, s[3], -s[3], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        assert_eq!(compared(&noise), FieldAgreement::default());
        assert_eq!(compared(&sums[..3]).explained(), None);
    }
}

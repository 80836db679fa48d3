//! Density on a grid: particles by nearest grid point, Gaussians integrated over the cells.

use crate::stats::{DepositScratch, Grid, Slab};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{DensityMetrics, Mixture, Model};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Result, parallel};
use particlegs_particles::{Domain, Particles};

/// Cells of the density grid along the longest extent.
pub(super) const GRID: u16 = 50;
/// Parallel parts of a sum, fixed so that results do not depend on threads.
const PARTS: usize = 32;

/// A grid over the bounds, or over the periodic box along axes that repeat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityGrid(Grid);

/// Agreement of two densities on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DensityAgreement {
    pub correlation: f64,
    /// Mean absolute difference of the contrast rho / mean - 1, `mean` being the first's.
    pub mean_absolute_error: f64,
}

impl DensityGrid {
    /// `longest` cells along the longest extent, about as long along the others. Along an axis whose
    /// box the particles fill less than half, as a cut-out or a zoom does, the grid is over them.
    pub fn new(bounds: &Bounds, cell: Option<&Cell>, longest: u16) -> Self {
        let (domain, center) = (Domain::new(bounds, cell), bounds.center());
        let grid = Grid::new(&domain, usize::from(longest));
        // An upright grid lies about the middle of the bounds.
        let min = each_axis(|k| if domain.tilt.is_some() { domain.min[k] } else { center[k] - 0.5 * domain.length[k] });
        DensityGrid(Grid { min, ..grid })
    }

    pub(super) fn grid(&self) -> &Grid {
        &self.0
    }

    /// Mass in each cell, x slowest: every particle in the cell that holds it.
    pub fn of_particles(&self, particles: &Particles, context: &Context<'_>) -> Result<Vec<f64>> {
        let unit_mass = particles.meta.particle_mass.unwrap_or(1.0);
        let scale = self.0.side.map(f64::recip);
        let corner: [f64; 3] = each_axis(|k| particles.origin[k] - self.0.min[k]);
        // One product and one sum a coordinate: this is done for every particle.
        let offset: [f64; 3] = each_axis(|k| corner[k] * scale[k]);
        self.sum_parts(particles.len(), |grid, range| {
            let mut buffer = Default::default();
            for start in range.clone().step_by(1 << 16) {
                context.check()?;
                let chunk = particles.chunk(start..range.end.min(start + (1 << 16)), &mut buffer);
                for i in 0..chunk.len() {
                    let raw: [f64; 3] = each_axis(|k| f64::from(chunk.position[k][i]));
                    let cell = match &self.0.tilt {
                        None => each_axis(|k| self.cell(k, raw[k] * scale[k] + offset[k])),
                        Some(tilt) => {
                            let along = tilt.upright(each_axis(|k| raw[k] + corner[k]));
                            each_axis(|k| self.cell(k, along[k] * scale[k]))
                        }
                    };
                    grid[self.0.index(cell)] += unit_mass * chunk.weight.map_or(1.0, |w| f64::from(w[i]));
                }
                context.advance(chunk.len() as u64);
            }
            Ok(())
        })
    }

    /// Mass in each cell of a model's Gaussians; what lies outside a grid that does not repeat is
    /// in no cell.
    pub fn of_model(&self, model: &Model, context: &Context<'_>) -> Result<Vec<f64>> {
        let mut sum = vec![0.0; self.0.len()];
        for layer in &model.layers {
            for block in &layer.content {
                let part = self.of_mixture(&block.gaussians, context)?;
                sum.iter_mut().zip(part).for_each(|(s, v)| *s += layer.mass.unit_or_one() * v);
            }
        }
        Ok(sum)
    }

    fn of_mixture(&self, mixture: &Mixture, context: &Context<'_>) -> Result<Vec<f64>> {
        self.sum_parts(mixture.len(), |grid, range| {
            let (mut splat, mut slab) = (DepositScratch::new(context.simd(), 0.0), Slab::whole(&self.0, grid));
            for i in range {
                if i.is_multiple_of(256) {
                    context.check()?;
                    context.advance(256);
                }
                let (mean, cov) = self.0.upright(mixture.mean_of(i), mixture.cov_of(i));
                splat.add(&mut slab, mean, &cov, mixture.mass_of(i));
            }
            Ok(())
        })
    }

    /// Sums of grids that `fill` makes of fixed parts of `0..n`, in order.
    fn sum_parts(
        &self,
        n: usize,
        fill: impl Fn(&mut [f64], std::ops::Range<usize>) -> Result<()> + Sync,
    ) -> Result<Vec<f64>> {
        let cells = self.0.len();
        let parts = PARTS.min(n.max(1));
        let grids = parallel::try_map_range(parts, |p| {
            let mut grid = vec![0.0; cells];
            fill(&mut grid, n * p / parts..n * (p + 1) / parts)?;
            Ok(grid)
        })?;
        Ok((0..cells).map(|c| grids.iter().map(|g| g[c]).sum()).collect())
    }

    /// The cell along `axis` that holds coordinate `u`, in cells: nearly always plainly inside.
    fn cell(&self, axis: usize, u: f64) -> usize {
        // A cast cuts towards zero, which is the floor of what is not negative.
        let i = u as i32;
        if u >= 0.0 && (i as usize) < self.0.cells[axis] { i as usize } else { self.cell_beyond(axis, u) }
    }

    /// The same beyond the grid: repeated, or the nearest at the edge (the bounds' own end).
    #[cold]
    fn cell_beyond(&self, axis: usize, u: f64) -> usize {
        self.0.wrap(axis, u.floor() as i64)
    }
}

/// Correlation and error of `model` against `truth`, cell by cell.
pub fn density_agreement<T: Copy + Into<f64>>(truth: &[T], model: &[T]) -> DensityAgreement {
    let n = truth.len().max(1) as f64;
    let mean = |values: &[T]| values.iter().map(|v| (*v).into()).sum::<f64>() / n;
    let (mt, mm) = (mean(truth), mean(model));
    let (mut tt, mut mm2, mut tm, mut error) = (0.0, 0.0, 0.0, 0.0);
    for (t, m) in truth.iter().zip(model) {
        let (t, m): (f64, f64) = ((*t).into(), (*m).into());
        tt += (t - mt) * (t - mt);
        mm2 += (m - mm) * (m - mm);
        tm += (t - mt) * (m - mm);
        error += (t - m).abs();
    }
    // A density without variation correlates with nothing but another.
    let correlation =
        if tt > 0.0 && mm2 > 0.0 { tm / (tt.sqrt() * mm2.sqrt()) } else { f64::from(u8::from(tt == mm2)) };
    DensityAgreement { correlation, mean_absolute_error: if mt > 0.0 { error / (n * mt) } else { 0.0 } }
}

/// Agreement with the truth of a model, and of a uniform density of the same mass.
pub(super) fn model_and_uniform(truth: &[f64], model: &[f64]) -> [DensityAgreement; 2] {
    let uniform = vec![truth.iter().sum::<f64>() / truth.len().max(1) as f64; truth.len()];
    [model, &uniform].map(|other| density_agreement(truth, other))
}

/// The certificate's figures of the densities of a model and of a uniform box.
pub(super) fn density_metrics([model, uniform]: [DensityAgreement; 2]) -> DensityMetrics {
    DensityMetrics {
        cells: GRID,
        correlation: model.correlation,
        mean_absolute_error: model.mean_absolute_error,
        uniform_mean_absolute_error: uniform.mean_absolute_error,
    }
}

/// The agreement of a model with its snapshot, and that of a uniform density, on a grid of `longest`
/// cells along the longest extent, over the snapshot's periodic box where it has one.
pub fn density_of(
    model: &Model,
    particles: &Particles,
    bounds: &Bounds,
    longest: u16,
    context: &Context<'_>,
) -> Result<[DensityAgreement; 2]> {
    let grid = DensityGrid::new(bounds, particles.meta.cell.as_ref(), longest);
    context.begin("density", (particles.len() + model.gaussians()) as u64);
    let truth = grid.of_particles(particles, context)?;
    let model = grid.of_model(model, context)?;
    context.end();
    Ok(model_and_uniform(&truth, &model))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Sym3;

    #[test]
    fn particles_fall_into_their_cells() {
        let mut p = Particles::from_columns(vec![0.0, 9.9, 10.0, 0.1], vec![0.0; 4], vec![0.0, 0.0, 0.0, 4.9]);
        let bounds = Bounds { min: [0.0; 3], max: [10.0, 5.0, 5.0] };
        let open = DensityGrid::new(&bounds, None, 10);
        assert_eq!(open.0.cells, [10, 5, 5]);
        let rho = open.of_particles(&p, &Context::SILENT).unwrap();
        let at = |rho: &[f64], i: usize, k: usize| rho[open.0.index([i, 0, k])];
        assert_eq!([at(&rho, 0, 0), at(&rho, 9, 0), at(&rho, 0, 4)], [1.0, 2.0, 1.0]);
        // The same in a box: 10.0 is 0.0 again.
        p.meta.cell = Some(Cell::orthogonal([10.0, 5.0, 5.0]));
        let rho = DensityGrid::new(&bounds, p.meta.cell.as_ref(), 10).of_particles(&p, &Context::SILENT).unwrap();
        assert_eq!([at(&rho, 0, 0), at(&rho, 9, 0), at(&rho, 0, 4)], [2.0, 1.0, 1.0]);
    }

    /// Cells of a tilted box hold alike what a gas has, and points as Gaussians are points.
    #[test]
    fn tilted_boxes_have_no_empty_corners() {
        for cell in particlegs_particles::testing::tilted_cells() {
            let p = particlegs_particles::testing::gas(40_000, &cell, 7);
            let grid = DensityGrid::new(&p.bounds(), p.meta.cell.as_ref(), 6);
            let masses = grid.of_particles(&p, &Context::SILENT).unwrap();
            let mean = 40_000.0 / masses.len() as f64;
            assert!(masses.iter().all(|n| (n - mean).abs() < 6.0 * mean.sqrt()), "{cell:?}: {masses:?}");
            let mut mixture = Mixture::default();
            (0..40_000).for_each(|i| mixture.push(p.position(i), Sym3::scaled_identity(0.0), 1.0, 1.0));
            let model = grid.of_mixture(&mixture, &Context::SILENT).unwrap();
            // Positions on a face of the box may go either way.
            let difference: f64 = masses.iter().zip(&model).map(|(a, b)| (a - b).abs()).sum();
            assert!(difference < 5.0, "{cell:?}: {difference}");
        }
    }

    #[test]
    fn known_densities_agree_as_they_should() {
        let a = density_agreement(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]);
        assert!((a.correlation - 1.0).abs() < 1e-15 && (a.mean_absolute_error - 1.0).abs() < 1e-15);
        assert_eq!(density_agreement(&[1.0, 1.0], &[1.0, 1.0]).correlation, 1.0);
        assert_eq!(density_agreement(&[1.0, 1.0], &[0.0, 2.0]).correlation, 0.0);
    }

    /// A mixture whose means follow the particles exactly gives their counts.
    #[test]
    fn points_as_gaussians_are_points() {
        let x: Vec<f32> = (0..500).map(|i| (i as f32 * 0.618_034).fract() * 10.0).collect();
        let y: Vec<f32> = (0..500).map(|i| (i as f32 * 0.414_213).fract() * 10.0).collect();
        let p = Particles::from_columns(x.clone(), y.clone(), x.clone());
        let mut mixture = Mixture::default();
        for i in 0..500 {
            mixture.push(p.position(i), Sym3::scaled_identity(0.0), 1.0, 1.0);
        }
        let grid = DensityGrid::new(&p.bounds(), Some(&Cell::orthogonal([10.0; 3])), 7);
        let truth = grid.of_particles(&p, &Context::SILENT).unwrap();
        let model = grid.of_mixture(&mixture, &Context::SILENT).unwrap();
        assert!(truth.iter().zip(&model).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}

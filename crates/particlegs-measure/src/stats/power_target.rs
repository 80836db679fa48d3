//! The power of a snapshot in shells of wave numbers, that of a mixture over it, and its response to the Gaussians' counts.

use super::deposit::deposit_mixture;
use super::spectrum::{WIDENED_FROM, mode_limits, modes_of, modes_of_fields, visit_plane};
use super::transform::{Modes, field_of_modes};
use super::{Assignment, Domain, Grid, SpectrumOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{each_axis, exp, floor};
use particlegs_core::model::Mixture;
use particlegs_core::{Result, parallel};
use particlegs_particles::Particles;
use std::f64::consts::PI;

/// Waves along the longest edge at most: those of 10^11 particles in a cube.
const MOST_WAVES: f64 = 1200.0;
/// The largest wave number, in the particles' Nyquist frequency.
const SHARE_OF_NYQUIST: f64 = 0.5;
/// Cells along the longest edge for each wave along it, at the largest wave number.
const CELLS_A_WAVE: usize = 3;

/// Power less shot noise that is held, in the scatter of shot noise: less of it may be chance.
const CLEAR: f64 = 3.0;

/// The power of particles, less their shot noise, in shells of wave numbers up to half their Nyquist frequency.
pub struct PowerTarget {
    domain: Domain,
    grid: Grid,
    options: SpectrumOptions,
    /// Of each bin of width 2 pi / longest edge: its shell, and what |delta|^2 of a mode counts in it. Shells sum to 1
    /// where a mixture has the power of the particles.
    bins: Vec<Option<(usize, f64)>>,
    /// Number of shells.
    pub shells: usize,
}

/// A mixture's power over that of the particles.
pub struct PowerDeviation {
    /// Power over that of the particles, less 1, in each shell.
    pub of_shell: Vec<f64>,
    modes: Modes,
    /// Mean square of the wave number in each shell, weighted by power.
    square: Vec<f64>,
}

impl PowerTarget {
    /// Of particles in a box that is periodic along all axes; `None` in others, where the box is too flat for a grid of
    /// Gaussians, or where no power is above the shot noise. In `most` shells at most.
    pub fn new(
        particles: &Particles,
        domain: &Domain,
        most: usize,
        context: &Context<'_>,
    ) -> Result<Option<PowerTarget>> {
        let subject = Subject::Particles(particles);
        let width = 2.0 * PI / domain.longest();
        let waves = (SHARE_OF_NYQUIST * PI / domain.spacing(particles.len()) / width).round();
        if !domain.periodic.iter().all(|p| *p) || !(1.0..=MOST_WAVES).contains(&waves) {
            return Ok(None);
        }
        let count = waves as usize;
        let grid = Grid::new(domain, (CELLS_A_WAVE * count).next_multiple_of(8));
        if grid.cells.iter().any(|n| *n < WIDENED_FROM) {
            return Ok(None);
        }
        let options = SpectrumOptions {
            cells: grid.cells.into_iter().max().unwrap_or(0),
            assignment: Assignment::Tsc,
            interlaced: true,
            deconvolved: true,
            shot_noise_subtracted: true,
            k_max: (count as f64 + 0.5) * width,
        };
        let limits = mode_limits(&grid, domain, options.k_max);
        let modes = modes_of(subject, None, &grid, limits, &options, context)?;
        let noise = subject.shot_noise(domain) / domain.volume();
        let unit = vec![Some((0, 1.0)); count];
        let mut target = PowerTarget { domain: *domain, grid, options, bins: unit, shells: 1 };
        let sums = target.sums(&modes, context)?;
        target.bins = vec![None; count];
        target.shells = 0;
        let mut first = 0;
        while first < count {
            // Of many bins those of short waves go together, an eighth of what is below them: they average over thousands
            // of modes.
            let width = if count <= most { 1 } else { 1.max(first / 8) };
            let end = if target.shells + 1 < most { count.min(first + width) } else { count };
            let held = |bin: usize| {
                let [modes, power, _] = sums[bin];
                power - modes * noise > CLEAR * (2.0 * modes).sqrt() * noise
            };
            let modes: f64 = (first..end).filter(|bin| held(*bin)).map(|bin| sums[bin][0]).sum();
            for bin in (first..end).filter(|bin| held(*bin)) {
                let [of_bin, power, _] = sums[bin];
                target.bins[bin] = Some((target.shells, of_bin / modes / (power - of_bin * noise)));
            }
            target.shells += usize::from(modes > 0.0);
            first = end;
        }
        Ok((target.shells > 0).then_some(target))
    }

    /// A mixture's power against it.
    pub fn deviation(&self, mixture: &Mixture, context: &Context<'_>) -> Result<PowerDeviation> {
        let most = mode_limits(&self.grid, &self.domain, self.options.k_max);
        let field = |moved: usize, _| deposit_mixture(mixture, &self.grid, 0.5 * moved as f64, context);
        let modes = modes_of_fields(&field, (None, None), most, &self.options, context)?;
        let (mut of_shell, mut square) = (vec![-1.0; self.shells], vec![0.0; self.shells]);
        for (bin, [_, power, by_square]) in self.bins.iter().zip(self.sums(&modes, context)?) {
            if let Some((shell, weight)) = bin {
                of_shell[*shell] += weight * power;
                square[*shell] += weight * by_square;
            }
        }
        square.iter_mut().zip(&of_shell).for_each(|(s, d)| *s /= 1.0 + d);
        Ok(PowerDeviation { of_shell, modes, square })
    }

    /// Number of modes, sum of |delta|^2 and of k^2 |delta|^2 in each bin.
    fn sums(&self, modes: &Modes, context: &Context<'_>) -> Result<Vec<[f64; 3]>> {
        let planes = parallel::try_map_range(2 * modes.most[0] + 1, |i| {
            let mut sums = vec![[0.0; 3]; self.bins.len()];
            visit_plane(modes, &self.domain, i, self.options.k_max, context, |at, _, k, times| {
                if let Some(sums) = sums.get_mut(self.bin(k)) {
                    let (times, power) = (times as f64, modes.value[at].norm_sqr());
                    let terms = [times, times * power, times * power * k * k];
                    (0..3).for_each(|t| sums[t] += terms[t]);
                }
            })?;
            Ok(sums)
        })?;
        let mut total = vec![[0.0; 3]; self.bins.len()];
        // In the order of the planes, so that sums do not depend on threads.
        for plane in planes {
            total.iter_mut().zip(plane).for_each(|(a, b)| (0..3).for_each(|t| a[t] += b[t]));
        }
        Ok(total)
    }

    fn bin(&self, k: f64) -> usize {
        (k * self.domain.longest() / (2.0 * PI) - 0.5).max(0.0) as usize
    }

    /// Change of each shell's power over the particles' for a change of the logarithm of each Gaussian's count, the sum
    /// of counts being kept: shells of the first Gaussian, of the second, and so on. Widths count as spheres', which is
    /// right to a few per cent.
    pub fn responses(&self, of: &PowerDeviation, mixture: &Mixture, context: &Context<'_>) -> Result<Vec<f32>> {
        let total: f64 = (0..mixture.len()).map(|i| mixture.mass_of(i)).sum();
        let columns = parallel::try_map_range(self.shells, |shell| {
            let field = self.field(of, shell, context)?;
            let response = |i: usize| {
                let size = mixture.cov_of(i).trace() / 3.0;
                let smoothed = exp(-0.5 * of.square[shell] * size) * self.at(&field, mixture.mean_of(i));
                (2.0 * mixture.mass_of(i) / total * (smoothed - 1.0 - of.of_shell[shell])) as f32
            };
            Ok((0..mixture.len()).map(response).collect::<Vec<f32>>())
        })?;
        Ok((0..mixture.len()).flat_map(|i| columns.iter().map(move |column| column[i])).collect())
    }

    /// The sum of a shell's modes, each times its weight.
    fn field(&self, of: &PowerDeviation, shell: usize, context: &Context<'_>) -> Result<Vec<f32>> {
        let mut modes = Modes::zero(of.modes.most);
        let (columns, depth) = modes.plane();
        let cells = self.grid.cells.map(|n| n as f64);
        // Values between cells are linear, which narrows modes by a square of sinc along each axis.
        let window: [Vec<f64>; 3] = each_axis(|k| {
            let inverse = |m: usize| {
                let x = PI * m as f64 / cells[k];
                if m == 0 { 1.0 } else { x * x / (libm::sin(x) * libm::sin(x)) }
            };
            (0..=modes.most[k]).map(inverse).collect()
        });
        for i in 0..=2 * modes.most[0] {
            visit_plane(&of.modes, &self.domain, i, self.options.k_max, context, |at, _, k, _| {
                if let Some(Some((of_bin, weight))) =
                    self.bins.get(self.bin(k)).filter(|b| b.is_some_and(|b| b.0 == shell))
                {
                    debug_assert_eq!(*of_bin, shell);
                    let y = (at / depth % columns).abs_diff(modes.most[1]);
                    let window = window[0][i.abs_diff(modes.most[0])] * window[1][y] * window[2][at % depth];
                    modes.value[at] = of.modes.value[at] * (weight * window);
                }
            })?;
        }
        Ok(field_of_modes(&modes, self.grid.cells))
    }

    /// A field at a place, linear between the centres of cells.
    fn at(&self, field: &[f32], place: [f64; 3]) -> f64 {
        let offset = self.grid.offset_from_corner(place);
        let axes: [(usize, usize, f64); 3] = each_axis(|k| {
            let n = self.grid.cells[k];
            let u = (offset[k] / self.grid.side[k] - 0.5).rem_euclid(n as f64);
            let low = floor(u);
            // Rounding may end at n.
            ((low as usize) % n, (low as usize + 1) % n, u - low)
        });
        let mut sum = 0.0;
        for corner in 0..8 {
            let side = |k: usize| corner >> k & 1 == 1;
            let cell = each_axis(|k| if side(k) { axes[k].1 } else { axes[k].0 });
            let share: f64 = (0..3).map(|k| if side(k) { axes[k].2 } else { 1.0 - axes[k].2 }).product();
            sum += share * f64::from(field[self.grid.index(cell)]);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::space::Cell;
    use particlegs_particles::testing::{from_points, gas, random_points, tilted_cells};

    const GAUSSIANS: usize = 200;

    /// Clumps in a cell, and particles of them.
    fn clumps(cell: &Cell) -> (Mixture, Particles) {
        let mut mixture = Mixture::default();
        for i in 0..GAUSSIANS {
            let mut r = Random::new(21, 0, i as u64);
            let f = [0; 3].map(|_| r.uniform());
            let mean = each_axis(|k| (0..3).map(|a| f[a] * cell.vectors[a][k]).sum::<f64>() + cell.origin[k]);
            let cov = Sym3([0.1 + 0.1 * r.uniform(), 0.02, 0.0, 0.1, -0.03, 0.05 + 0.1 * r.uniform()]);
            mixture.push(mean, cov, 100.0 + (200.0 * r.uniform()).floor(), 0.0);
        }
        let owners: Vec<usize> =
            (0..GAUSSIANS).flat_map(|i| std::iter::repeat_n(i, mixture.count[i] as usize)).collect();
        let points = random_points(owners.len(), 22, |at, r| {
            let i = owners[at as usize];
            let e = mixture.cov_of(i).eigen();
            let z = e.values.map(|v| v.sqrt() * r.normal());
            each_axis(|k| mixture.mean[k][i] + (0..3).map(|a| e.vectors[a][k] * z[a]).sum::<f64>())
        });
        let mut particles = from_points(points);
        particles.meta.cell = Some(*cell);
        (mixture, particles)
    }

    #[test]
    fn a_mixture_has_the_power_of_its_particles_and_answers_to_counts() {
        for cell in [Cell::orthogonal([10.0; 3]), tilted_cells()[0]] {
            let (mixture, particles) = clumps(&cell);
            let target = PowerTarget::new(&particles, &Domain::from_particles(&particles), 8, &Context::SILENT)
                .unwrap()
                .unwrap();
            assert!((4..=8).contains(&target.shells), "{}", target.shells);
            let deviation = target.deviation(&mixture, &Context::SILENT).unwrap();
            assert!(deviation.of_shell.iter().all(|d| d.abs() < 0.1), "{:?}", deviation.of_shell);
            let responses = target.responses(&deviation, &mixture, &Context::SILENT).unwrap();
            for shell in 0..target.shells {
                let largest = (0..GAUSSIANS).map(|i| responses[i * target.shells + shell].abs()).fold(0.0, f32::max);
                let i = (0..GAUSSIANS).find(|i| responses[i * target.shells + shell].abs() == largest).unwrap();
                let mut moved = mixture.clone();
                moved.count[i] *= 1.01;
                let after = target.deviation(&moved, &Context::SILENT).unwrap();
                let change = (after.of_shell[shell] - deviation.of_shell[shell]) / 0.01f64.ln_1p();
                assert!(((change / f64::from(largest)).abs() - 1.0).abs() < 0.25, "{shell}: {change} {largest}");
                assert!(change * f64::from(responses[i * target.shells + shell]) > 0.0, "{shell}");
            }
        }
    }

    #[test]
    fn what_is_open_flat_or_even_has_no_power_to_hold() {
        let held = |p: &Particles| {
            PowerTarget::new(p, &Domain::from_particles(p), 32, &Context::SILENT).unwrap().map_or(0, |t| t.shells)
        };
        let cell = Cell::orthogonal([10.0; 3]);
        let (_, mut particles) = clumps(&cell);
        assert!(held(&particles) > 3);
        particles.meta.cell = None;
        assert_eq!(held(&particles), 0);
        let (_, flat) = clumps(&Cell::orthogonal([10.0, 10.0, 0.1]));
        assert_eq!(held(&flat), 0);
        assert!(held(&gas(30_000, &cell, 5)) <= 1);
    }
}

//! The power of a snapshot in shells of wave numbers, that of a mixture over it, and its response to the Gaussians' counts.

use super::deposit::{add_widened, deposit_bytes};
use super::spectrum::{WIDENED_FROM, mode_limits, modes_of, modes_of_fields, visit_plane};
use super::transform::{Modes, field_of_modes};
use super::{Assignment, Domain, Field, Grid, SpectrumOptions, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{each_axis, exp};
use particlegs_core::model::Mixture;
use particlegs_core::{Result, parallel};
use particlegs_particles::Particles;
use std::f64::consts::PI;

/// Waves along the longest edge at most: those of 10^11 particles in a cube.
const MOST_WAVES: f64 = 1200.0;
/// The largest wave number, in the particles' Nyquist frequency.
const SHARE_OF_NYQUIST: f64 = 0.5;
/// Cells along the longest edge for each wave along it: a widened mixture has no images then.
const CELLS_A_WAVE: f64 = 2.9;
/// Differences of a Gaussian, in its mass and its widths, that are not seen in the power.
const UNSEEN: f64 = 5e-4;

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
    /// The mixture and its field: Gaussians that hardly differ are as they were deposited first.
    deposited: (Mixture, Field),
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
        let grid = grid_of_waves(domain, count);
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

    /// A mixture's power against it; with that of a `previous` mixture from which it differs in a few Gaussians, sooner.
    /// One of another number of Gaussians is of no use.
    pub fn deviation(
        &self,
        mixture: &Mixture,
        previous: Option<PowerDeviation>,
        context: &Context<'_>,
    ) -> Result<PowerDeviation> {
        let (mut deposited, mut field) = match previous.filter(|p| p.deposited.0.len() == mixture.len()) {
            Some(previous) => previous.deposited,
            None => {
                particlegs_files::memory::require("a density grid", deposit_bytes(&self.grid, 0))?;
                let mass = vec![0.0; self.grid.len()];
                (Mixture::default(), Field { grid: self.grid, mass, outside: 0.0 })
            }
        };
        add_widened(&mut field, &replace(&mut deposited, mixture), context)?;
        let most = mode_limits(&self.grid, &self.domain, self.options.k_max);
        let options = SpectrumOptions { interlaced: false, ..self.options };
        let modes = modes_of_fields(&|_, _| Ok(field.clone()), (None, None), most, &options, context)?;
        let (mut of_shell, mut square) = (vec![-1.0; self.shells], vec![0.0; self.shells]);
        for (bin, [_, power, by_square]) in self.bins.iter().zip(self.sums(&modes, context)?) {
            if let Some((shell, weight)) = bin {
                of_shell[*shell] += weight * power;
                square[*shell] += weight * by_square;
            }
        }
        square.iter_mut().zip(&of_shell).for_each(|(s, d)| *s /= 1.0 + d);
        Ok(PowerDeviation { of_shell, deposited: (deposited, field), modes, square })
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
            let (grid, field) = self.field(of, shell, context)?;
            let response = |i: usize| {
                let size = mixture.cov_of(i).trace() / 3.0;
                let smoothed = exp(-0.5 * of.square[shell] * size) * at(&grid, &field, mixture.mean_of(i));
                (2.0 * mixture.mass_of(i) / total * (smoothed - 1.0 - of.of_shell[shell])) as f32
            };
            Ok((0..mixture.len()).map(response).collect::<Vec<f32>>())
        })?;
        Ok((0..mixture.len()).flat_map(|i| columns.iter().map(move |column| column[i])).collect())
    }

    /// The sum of a shell's modes, each times its weight, on a grid that resolves them.
    fn field(&self, of: &PowerDeviation, shell: usize, context: &Context<'_>) -> Result<(Grid, Vec<f32>)> {
        let is_of_shell = |bin: &Option<(usize, f64)>| bin.is_some_and(|b| b.0 == shell);
        let waves = 1 + self.bins.iter().rposition(is_of_shell).unwrap_or(0);
        let grid = grid_of_waves(&self.domain, waves);
        let k_max = (waves as f64 + 0.5) * 2.0 * PI / self.domain.longest();
        let limits = mode_limits(&grid, &self.domain, k_max);
        let mut modes = Modes::zero(each_axis(|k| limits[k].min(of.modes.most[k])));
        let (columns, depth) = modes.plane();
        // Values between cells are means by the scheme, which narrows modes by a cube of sinc along each axis.
        let window: [Vec<f64>; 3] = each_axis(|k| {
            let inverse = |m: usize| {
                let x = PI * m as f64 / grid.cells[k] as f64;
                if m == 0 { 1.0 } else { x * x * x / (libm::sin(x) * libm::sin(x) * libm::sin(x)) }
            };
            (0..=modes.most[k]).map(inverse).collect()
        });
        let all = of.modes.plane();
        let [x_offset, y_offset] = [0, 1].map(|k| of.modes.most[k] - modes.most[k]);
        let mut value = std::mem::take(&mut modes.value);
        for i in 0..=2 * modes.most[0] {
            visit_plane(&modes, &self.domain, i, k_max, context, |at, _, k, _| {
                let Some((_, weight)) = self.bins.get(self.bin(k)).copied().flatten().filter(|b| b.0 == shell) else {
                    return;
                };
                let (y, z) = (at / depth % columns, at % depth);
                let [x, y] = [i + x_offset, y + y_offset];
                let window =
                    window[0][x.abs_diff(of.modes.most[0])] * window[1][y.abs_diff(of.modes.most[1])] * window[2][z];
                value[at] = of.modes.value[(x * all.0 + y) * all.1 + z] * (weight * window);
            })?;
        }
        modes.value = value;
        let field = field_of_modes(&modes, grid.cells);
        Ok((grid, field))
    }
}

/// A grid for so many waves along the longest edge.
fn grid_of_waves(domain: &Domain, waves: usize) -> Grid {
    Grid::new(domain, ((CELLS_A_WAVE * (waves as f64 + 0.5)).ceil() as usize).next_multiple_of(8))
}

/// Puts Gaussians that differ into `deposited`, their masses as counts; what that adds to its field, with what it takes
/// away below 0.
fn replace(deposited: &mut Mixture, mixture: &Mixture) -> Mixture {
    let mut difference = Mixture::default();
    for i in 0..mixture.len() {
        let (mean, cov, mass) = (mixture.mean_of(i), mixture.cov_of(i), mixture.mass_of(i));
        if i == deposited.len() {
            deposited.push(mean, cov, mass, 0.0);
        } else {
            let (last_mean, last_cov, last_mass) = (deposited.mean_of(i), deposited.cov_of(i), deposited.count[i]);
            let is_close = |a: f64, b: f64, scale: f64| (a - b).abs() <= UNSEEN * scale;
            if is_close(mass, last_mass, mass)
                && (0..6).all(|k| is_close(cov.0[k], last_cov.0[k], cov.trace()))
                && (0..3).all(|k| is_close(mean[k], last_mean[k], cov.trace().sqrt()))
            {
                continue;
            }
            difference.push(last_mean, last_cov, -last_mass, 0.0);
            (0..3).for_each(|k| deposited.mean[k][i] = mean[k]);
            (0..6).for_each(|k| deposited.cov[k][i] = cov.0[k]);
            deposited.count[i] = mass;
        }
        difference.push(mean, cov, mass, 0.0);
    }
    difference
}

/// A field at a place, by [`Assignment::Tsc`].
fn at(grid: &Grid, field: &[f32], place: [f64; 3]) -> f64 {
    let offset = grid.offset_from_corner(place);
    let axes: [([usize; 3], [f64; 3]); 3] = each_axis(|k| {
        let u = (offset[k] / grid.side[k]).rem_euclid(grid.cells[k] as f64);
        let (first, weights) = Assignment::Tsc.weights(u);
        (std::array::from_fn(|a| grid.wrap(k, first + a as i64)), weights)
    });
    let [x, y, z] = axes;
    let mut sum = 0.0;
    for (i, x_weight) in x.0.into_iter().zip(x.1) {
        for (j, y_weight) in y.0.into_iter().zip(y.1) {
            let row = &field[grid.index([i, j, 0])..];
            let along: f64 = z.0.into_iter().zip(z.1).map(|(k, weight)| weight * f64::from(row[k])).sum();
            sum += x_weight * y_weight * along;
        }
    }
    sum
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
            let deviation = target.deviation(&mixture, None, &Context::SILENT).unwrap();
            assert!(deviation.of_shell.iter().all(|d| d.abs() < 0.1), "{:?}", deviation.of_shell);
            let responses = target.responses(&deviation, &mixture, &Context::SILENT).unwrap();
            for shell in 0..target.shells {
                let largest = (0..GAUSSIANS).map(|i| responses[i * target.shells + shell].abs()).fold(0.0, f32::max);
                let i = (0..GAUSSIANS).find(|i| responses[i * target.shells + shell].abs() == largest).unwrap();
                let mut moved = mixture.clone();
                moved.count[i] *= 1.01;
                let after = target.deviation(&moved, None, &Context::SILENT).unwrap();
                let previous = target.deviation(&mixture, None, &Context::SILENT).unwrap();
                let sooner = target.deviation(&moved, Some(previous), &Context::SILENT).unwrap();
                assert!((sooner.of_shell[shell] - after.of_shell[shell]).abs() < 1e-6);
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

//! Density along an axis: mass per volume in slabs, of particles by counting, of a mixture by error functions.

use super::gaussian::shares;
use super::presentation::*;
use super::subject::mixtures;
use super::{Domain, Grid, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{Mixture, Model, decimals};
use particlegs_core::{Result, parallel};
use particlegs_particles::{ChunkBuffer, Particles, RUN};
use std::f64::consts::TAU;
use std::ops::Range;

/// Parts of a subject that are summed apart, so that sums do not depend on threads.
const PARTS: usize = 64;

/// Density of truth and other along one axis.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AxisProfile {
    /// Edges of the slabs, world units: one more than slabs.
    pub edges: Vec<f64>,
    /// Mass per volume in each slab.
    pub density: [Vec<f64>; 2],
    /// Mean over the slabs.
    pub mean: [f64; 2],
    /// Root of the mean squared difference of density / mean.
    pub relative_difference: f64,
    /// That difference by shot noise alone: of two sets of particles, or of one and a mixture, of one density.
    pub shot_noise: f64,
    /// Half the distance between the quartiles of mass: half of it lies so near to the middle.
    pub half_mass_height: [f64; 2],
}

/// Masses in the slabs along x, y and z.
type AxisSlabs = [Vec<f64>; 3];

/// Profiles along x, y and z, or the edges of a tilted domain, in `bins` slabs of it; mass beyond open edges is in
/// none.
pub fn axis_profiles(
    pair: [Subject<'_>; 2],
    domain: &Domain,
    bins: usize,
    context: &Context<'_>,
) -> Result<[AxisProfile; 3]> {
    let grid = Grid::stretched(domain, [bins; 3]);
    context.begin("profiles", 2 * PARTS as u64);
    let slabs_of = |subject: Subject<'_>| match subject {
        Subject::Particles(p) => of_particles(p, &grid, context),
        Subject::Model(m) => of_model(m, &grid, context),
    };
    let (truth, other) = (slabs_of(pair[0])?, slabs_of(pair[1])?);
    context.end();
    let noise = pair.map(|s| s.shot_noise(domain) / domain.volume()).iter().sum::<f64>();
    Ok([0, 1, 2].map(|k| AxisProfile::new(domain, k, [&truth[k], &other[k]], noise)))
}

impl AxisProfile {
    fn new(domain: &Domain, axis: usize, mass: [&Vec<f64>; 2], noise: f64) -> Self {
        let bins = mass[0].len();
        let side = domain.length[axis] / bins as f64;
        let volume = domain.volume() / bins as f64;
        let density = mass.map(|m| m.iter().map(|v| v / volume).collect::<Vec<f64>>());
        let mean = density.each_ref().map(|d| d.iter().sum::<f64>() / bins as f64);
        let relative = |s: usize, i: usize| if mean[s] > 0.0 { density[s][i] / mean[s] } else { 0.0 };
        let square = |i: usize| (relative(1, i) - relative(0, i)).powi(2);
        // Half of an axis that repeats lies before the truth's middle, half behind it, for both.
        let first = if domain.periodic[axis] { opposite(&density[0]) } else { 0 };
        AxisProfile {
            // Along a tilted box's edges places are lengths from its corner.
            edges: (0..=bins).map(|i| domain.tilt.map_or(domain.min[axis], |_| 0.0) + i as f64 * side).collect(),
            relative_difference: ((0..bins).map(square).sum::<f64>() / bins as f64).sqrt(),
            shot_noise: (bins as f64 * noise).sqrt(),
            half_mass_height: density.each_ref().map(|d| 0.5 * side * between_quartiles(d, first)),
            density,
            mean,
        }
    }
}

/// The slab opposite to the middle of the mass on an axis that repeats: the mean angle's.
fn opposite(density: &[f64]) -> usize {
    let n = density.len();
    let angle = |i: usize| TAU * (i as f64 + 0.5) / n as f64;
    let sum = |component: fn(f64) -> f64| density.iter().enumerate().map(|(i, d)| d * component(angle(i))).sum::<f64>();
    let middle = libm::atan2(sum(libm::sin), sum(libm::cos)) / TAU;
    (((middle + 0.5).rem_euclid(1.0) * n as f64).round() as usize) % n
}

/// Distance between the quartiles, in slabs, of which `first` comes first; evenly spread within a slab.
fn between_quartiles(density: &[f64], first: usize) -> f64 {
    let n = density.len();
    let total: f64 = density.iter().sum();
    let at = |share: f64| {
        let mut left = share * total;
        for i in 0..n {
            let here = density[(first + i) % n];
            if left <= here && here > 0.0 {
                return i as f64 + left / here;
            }
            left -= here;
        }
        n as f64
    };
    if total > 0.0 { at(0.75) - at(0.25) } else { 0.0 }
}

/// The sum of what `add` adds for each part of `n` things.
fn summed(
    n: usize,
    grid: &Grid,
    context: &Context<'_>,
    add: impl Fn(Range<usize>, &mut AxisSlabs) + Sync,
) -> Result<AxisSlabs> {
    let empty = || grid.cells.map(|n| vec![0.0; n]);
    let parts = parallel::try_map_range(PARTS, |part| {
        context.check()?;
        let mut slabs = empty();
        add(part * n / PARTS..(part + 1) * n / PARTS, &mut slabs);
        context.advance(1);
        Ok::<_, particlegs_core::Error>(slabs)
    })?;
    let mut all = empty();
    for part in parts {
        (0..3).for_each(|k| all[k].iter_mut().zip(&part[k]).for_each(|(s, v)| *s += v));
    }
    Ok(all)
}

fn of_particles(p: &Particles, grid: &Grid, context: &Context<'_>) -> Result<AxisSlabs> {
    let scale = grid.side.map(f64::recip);
    let corner: [f64; 3] = each_axis(|k| p.origin[k] - grid.min[k]);
    let unit = p.meta.particle_mass.unwrap_or(1.0);
    summed(p.len().div_ceil(RUN), grid, context, |runs, slabs| {
        let mut buffer = ChunkBuffer::default();
        for run in runs {
            let chunk = p.chunk(run * RUN..p.len().min((run + 1) * RUN), &mut buffer);
            for (k, slabs) in slabs.iter_mut().enumerate() {
                let place = |axis: usize, i: usize| f64::from(chunk.position[axis][i]) + corner[axis];
                for i in 0..chunk.len() {
                    let along = match &grid.tilt {
                        None => place(k, i),
                        Some(tilt) => tilt.along(&each_axis(|axis| place(axis, i)), k),
                    };
                    if let Some(slab) = grid.slab(k, along * scale[k]) {
                        slabs[slab] += unit * chunk.weight.map_or(1.0, |w| f64::from(w[i]));
                    }
                }
            }
        }
    })
}

fn of_model(m: &Model, grid: &Grid, context: &Context<'_>) -> Result<AxisSlabs> {
    let parts: Vec<(f64, &Mixture)> = mixtures(m).collect();
    let mut first = vec![0];
    parts.iter().for_each(|(_, g)| first.push(first[first.len() - 1] + g.len()));
    summed(first[parts.len()], grid, context, |range, slabs| {
        let mut cells = Vec::new();
        for (at, (unit, g)) in parts.iter().enumerate() {
            for i in range.start.max(first[at])..range.end.min(first[at + 1]) {
                let (i, mass) = (i - first[at], unit * g.mass_of(i - first[at]));
                let (mean, Sym3(cov)) = grid.upright(g.mean_of(i), g.cov_of(i));
                for k in 0..3 {
                    shares(&mut cells, grid, k, mean[k], cov[[0, 3, 5][k]].max(0.0).sqrt());
                    cells.iter().for_each(|(slab, share)| slabs[k][*slab] += mass * share);
                }
            }
        }
    })
}

/// Shows them.
pub(super) fn show(profiles: &[AxisProfile; 3], chosen: usize, to: &mut Presentation) {
    let share = |p: &AxisProfile, side: usize, i: usize| {
        if p.mean[side] > 0.0 { p.density[side][i] / p.mean[side] } else { 0.0 }
    };
    let along = ["x", "y", "z"].into_iter().zip(profiles);
    let rows = along.clone().flat_map(|(axis, p)| {
        let [a, b] = &p.density;
        (0..a.len()).map(move |i| row![axis, p.edges[i], p.edges[i + 1], share(p, 0, i), share(p, 1, i), a[i], b[i]])
    });
    to.table("profiles.csv", "axis,low,high,truth,other,density_truth,density_other", rows);
    for (axis, p) in along {
        let middles = p.edges.windows(2).map(|e| 0.5 * (e[0] + e[1]));
        let rows: Vec<_> = middles.enumerate().map(|(i, at)| (at, [share(p, 0, i), share(p, 1, i)])).collect();
        let axes = [even(format!("{axis}{}", to.units.length)), even("density / mean")];
        to.plot(compared(&format!("profile_{axis}"), &format!("Density along {axis}"), axes, &rows, 0.0));
    }
    let Some((p, axis)) = profiles.get(chosen).zip(["x", "y", "z"].get(chosen)) else { return };
    let [difference, noise] = [p.relative_difference, p.shot_noise].map(|v| 100.0 * v);
    to.line(
        &format!("profile along {axis}: RMS difference"),
        format!("{difference:.2} % of the mean density, shot noise {noise:.2} %"),
    );
    let [truth, other] = p.half_mass_height;
    let heights = format!("{}{}, truth {}", decimals(other), to.length, decimals(truth));
    to.line(&format!("profile along {axis}: half-mass height"), heights);
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use particlegs_core::splat::erf;
    use particlegs_particles::SnapshotMeta;
    use particlegs_particles::testing::{model_of, on_threads};

    fn domain(periodic: bool) -> Domain {
        Domain::upright([0.0; 3], [2.0, 3.0, 10.0], [periodic; 3])
    }

    #[test]
    fn a_mixtures_profile_is_its_closed_form() {
        let s: f64 = 0.7;
        let cov = Sym3([0.04, 0.01, -0.02, 0.09, 0.03, s * s]);
        for (periodic, z) in [(true, 9.7), (true, -0.3), (false, 4.2)] {
            let model = model_of(&[([1.0, 1.0, z], cov, 600.0)], [2.0, 3.0, 10.0]);
            let d = domain(periodic);
            let p = &axis_profiles([Subject::Model(&model); 2], &d, 50, &Context::SILENT).unwrap()[2];
            let below = |x: f64| 0.5 * erf((x - z) / (s * 2.0f64.sqrt()));
            for i in 0..50 {
                let images = if periodic { -2..=2 } else { 0..=0 };
                let share = |t: i32| {
                    let shift = 10.0 * f64::from(t);
                    below(p.edges[i + 1] + shift) - below(p.edges[i] + shift)
                };
                let expected = 600.0 * images.map(share).sum::<f64>() / (60.0 / 50.0);
                assert!((p.density[0][i] - expected).abs() < 2e-3, "{periodic} {i}: {} {expected}", p.density[0][i]);
            }
            assert!((p.mean[0] - 10.0).abs() < 1e-3 && p.relative_difference == 0.0 && p.shot_noise == 0.0);
            // The quartile of a Gaussian, 0.6745 deviations from its middle, across the seam too.
            assert!((p.half_mass_height[0] / (0.674_49 * s) - 1.0).abs() < 0.01, "{:?}", p.half_mass_height);
        }
    }

    /// A self-gravitating sheet, sech^2(z / h): its quartiles are h atanh(1/2) from its middle.
    #[test]
    fn particles_of_a_sheet_have_its_height() {
        let (n, h) = (200_000, 0.4);
        let mut r = Random::new(7, 0, 0);
        let mut column = |length: f64| (0..n).map(|_| (length * r.uniform()) as f32).collect::<Vec<f32>>();
        let (x, y) = (column(2.0), column(3.0));
        let height = |u: f32| (9.9 + h * (f64::from(u) * 1.999_999 - 0.999_999).atanh()).rem_euclid(10.0) as f32;
        let z = column(1.0).into_iter().map(height).collect();
        let mut p = Particles::from_columns(x, y, z);
        p.meta = SnapshotMeta { particle_mass: Some(3.0), ..SnapshotMeta::default() };
        let profiles = axis_profiles([Subject::Particles(&p); 2], &domain(true), 400, &Context::SILENT).unwrap();
        let [x, _, z] = &profiles;
        assert!((z.half_mass_height[0] / (h * 0.5f64.atanh()) - 1.0).abs() < 0.01, "{:?}", z.half_mass_height);
        assert!((z.mean[0] - 3.0 * n as f64 / 60.0).abs() < 1e-6 && z.relative_difference == 0.0);
        assert!((x.half_mass_height[0] - 0.5).abs() < 0.01);
        let model = model_of(&[([1.0, 1.5, 9.9], Sym3::scaled_identity(400.0), n as f64)], [2.0, 3.0, 10.0]);
        let [x, _, _] =
            axis_profiles([Subject::Particles(&p), Subject::Model(&model)], &domain(true), 400, &Context::SILENT)
                .unwrap();
        // Uniform along x on either side: shot noise alone.
        assert!(
            (x.relative_difference / x.shot_noise - 1.0).abs() < 0.15,
            "{} {}",
            x.relative_difference,
            x.shot_noise
        );
        assert!((x.shot_noise - (400.0 / n as f64).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn threads_change_nothing() {
        let mut r = Random::new(2, 0, 0);
        let mut column = || (0..200_000).map(|_| (2.0 * r.uniform()) as f32).collect::<Vec<f32>>();
        let p = Particles::from_columns(column(), column(), column());
        let model = model_of(&[([1.0; 3], Sym3::scaled_identity(0.3), 9.0); 500], [2.0, 3.0, 10.0]);
        let pair = [Subject::Particles(&p), Subject::Model(&model)];
        let run = |threads| on_threads(threads, || axis_profiles(pair, &domain(false), 30, &Context::SILENT).unwrap());
        assert_eq!(run(1), run(5));
    }
}

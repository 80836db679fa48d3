//! Mass in the cells of a grid: of particles by an assignment scheme, of Gaussians by integrals.
//!
//! Every task owns a run of planes and adds to them alone, in the order of the particles: no
//! atomics, no copies of the grid, and the same bits whatever the threads.

use super::gaussian::{DepositScratch, Slab};
use super::{Assignment, Grid, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::{Result, parallel};
use particlegs_particles::{ChunkBuffer, Particles, RUN};
use std::ops::Range;

/// Chunks of particles that are sorted by plane before any is deposited: bounds the memory.
const BATCH: usize = 32;
/// Tasks at most when Gaussians are deposited, and planes that one owns at least: thin slabs repeat what a Gaussian
/// has along the other axes, once for every slab that it reaches.
const MODEL_SLABS: usize = 32;
const MODEL_PLANES: usize = 8;
/// The same for particles.
const SLABS: usize = 128;

/// Deviation, in the longest edges of cells, by which a Gaussian is widened for a spectrum: the grid then resolves it, and
/// the window of its modes is a Gaussian that takes all but 1e-4 of the power of the images below two thirds of the
/// grid's Nyquist frequency.
pub(super) const WIDENED: f64 = 0.8;

/// Mass in each cell of a grid, as f32 (the grid is the largest thing that statistics hold).
#[derive(Clone, Debug)]
pub struct Field {
    /// The grid whose cells hold the mass.
    pub grid: Grid,
    /// Mass in each cell, x slowest.
    pub mass: Vec<f32>,
    /// Mass that lay beyond an open edge and is in no cell.
    pub outside: f64,
}

/// Bytes that [`deposit`] takes at most, of `particles` or of a model (0).
pub fn deposit_bytes(grid: &Grid, particles: u64) -> u64 {
    let sums = if sums_stay(grid, particles) { 8 } else { 0 };
    (4 + sums) * grid.len() as u64 + (BATCH * RUN * (size_of::<CellRecord>() + 16)) as u64
}

/// Whether sums stay in f64 from batch to batch: they cost less than a third of the particles' own bytes then, and save
/// a pass over the grid for every batch.
fn sums_stay(grid: &Grid, particles: u64) -> bool {
    particles >= 2 * grid.len() as u64 && particles > (BATCH * RUN) as u64
}

/// Mass of a subject on a grid whose cells are moved by `shift` cells downwards (0 or 0.5 for
/// interlacing). A model's Gaussians are integrated over the cells, which is the window of
/// [`Assignment::Ngp`] whatever `scheme` says.
pub fn deposit(
    subject: Subject<'_>,
    grid: &Grid,
    scheme: Assignment,
    shift: f64,
    context: &Context<'_>,
) -> Result<Field> {
    deposit_again(subject, empty_field(grid), Some(scheme), shift, context)
}

/// [`deposit`] for a spectrum: without a `scheme` for particles, Gaussians are widened by [`WIDENED`].
pub(crate) fn deposit_for_modes(
    subject: Subject<'_>,
    grid: &Grid,
    scheme: Option<Assignment>,
    shift: f64,
    context: &Context<'_>,
) -> Result<Field> {
    deposit_again(subject, empty_field(grid), scheme, shift, context)
}

/// Adds a mixture to a field, its Gaussians widened by [`WIDENED`]. Counts below 0 take Gaussians away.
pub(super) fn add_widened(field: &mut Field, mixture: &Mixture, context: &Context<'_>) -> Result<()> {
    let widened = WIDENED * field.grid.coarsest();
    add_mixtures(field, &[mixture], (1.0, widened), 0.0, context)
}

fn empty_field(grid: &Grid) -> Field {
    Field { grid: *grid, mass: Vec::new(), outside: 0.0 }
}

/// [`deposit_for_modes`] on the grid of a field that is no longer wanted, in its memory.
pub(super) fn deposit_again(
    subject: Subject<'_>,
    mut field: Field,
    scheme: Option<Assignment>,
    shift: f64,
    context: &Context<'_>,
) -> Result<Field> {
    let particles = subject.particles().map_or(0, |p| p.len() as u64);
    particlegs_files::memory::require("a density grid", deposit_bytes(&field.grid, particles))?;
    field.outside = 0.0;
    match field.mass.len() {
        0 => field.mass = vec![0.0; field.grid.len()],
        _ => field.mass.fill(0.0),
    }
    match subject {
        Subject::Particles(p) => add_particles(&mut field, p, scheme.unwrap_or(Assignment::Cic), shift, context)?,
        Subject::Model(m) => {
            let widened = if scheme.is_none() { WIDENED * field.grid.coarsest() } else { 0.0 };
            for layer in &m.layers {
                let parts: Vec<&Mixture> = layer.content.iter().map(|b| &b.gaussians).collect();
                add_mixtures(&mut field, &parts, (layer.mass.unit_or_one(), widened), shift, context)?;
            }
        }
    }
    Ok(field)
}

/// Steps of progress that a deposit makes: particles, or Gaussians of a model once a slab.
pub(crate) fn deposit_steps(subject: Subject<'_>, grid: &Grid) -> u64 {
    match subject {
        Subject::Particles(p) => p.len() as u64,
        Subject::Model(m) => m.gaussians() as u64 * grid.cells[0].div_ceil(model_planes(grid)) as u64,
    }
}

/// Planes that a task owns when Gaussians are deposited.
pub(super) fn model_planes(grid: &Grid) -> usize {
    grid.cells[0].div_ceil(MODEL_SLABS).max(MODEL_PLANES)
}

/// A particle's place in units of cells, and its weight. (Float32 rounds by a ten-thousandth of a cell on a grid of 2000.)
type CellRecord = ([f32; 3], f32);

/// The place of particles that are in no cell.
const OUTSIDE: [f32; 3] = [-1.0; 3];

/// A chunk's particles sorted by plane, and where each plane begins.
struct SortedChunk {
    records: Vec<CellRecord>,
    /// Mass of weight 1.
    unit: f64,
    start: Vec<u32>,
    outside: f64,
}

fn add_particles(
    field: &mut Field,
    p: &Particles,
    scheme: Assignment,
    shift: f64,
    context: &Context<'_>,
) -> Result<()> {
    let grid = field.grid;
    // Particles reach one plane further on either side: with thinner slabs most would be visited twice.
    let (plane, depth) = (grid.cells[1] * grid.cells[2], grid.cells[0].div_ceil(SLABS).max(8));
    let chunks = p.len().div_ceil(RUN);
    // Thousands of small shares meet in a cell: they are summed in f64.
    let mut sums = if sums_stay(&grid, p.len() as u64) { vec![0.0f64; grid.len()] } else { Vec::new() };
    for first in (0..chunks).step_by(BATCH) {
        context.check()?;
        let sort = |c| sort_by_plane(&grid, p, c * RUN..p.len().min((c + 1) * RUN), shift);
        let sorted: Vec<SortedChunk> = parallel::map(first..chunks.min(first + BATCH), sort);
        field.outside += sorted.iter().map(|s| s.outside).sum::<f64>();
        // Each task owns a slab and adds the batch's particles in their order: threads change no bit.
        let add = |slab: usize, out: &mut [f64]| {
            let planes = slab * depth..slab * depth + out.len() / plane;
            sorted.iter().for_each(|s| add_to_planes(&grid, s, scheme, planes.clone(), out));
        };
        if sums.is_empty() {
            parallel::for_each(field.mass.chunks_mut(depth * plane).enumerate(), |(slab, out)| {
                let mut sum = vec![0.0f64; out.len()];
                add(slab, &mut sum);
                out.iter_mut().zip(sum).for_each(|(o, s)| *o = (f64::from(*o) + s) as f32);
            });
        } else {
            parallel::for_each(sums.chunks_mut(depth * plane).enumerate(), |(slab, out)| add(slab, out));
        }
        context.advance(sorted.iter().map(|s| s.records.len() as u64).sum());
    }
    if !sums.is_empty() {
        field.mass.iter_mut().zip(&sums).for_each(|(o, s)| *o = *s as f32);
    }
    Ok(())
}

fn sort_by_plane(grid: &Grid, p: &Particles, range: Range<usize>, shift: f64) -> SortedChunk {
    let mut buffer = ChunkBuffer::default();
    let chunk = p.chunk(range, &mut buffer);
    let scale = grid.side.map(f64::recip);
    let unit = p.meta.particle_mass.unwrap_or(1.0);
    let weight = |i: usize| chunk.weight.map_or(1.0, |w| w[i]);
    let corner: [f64; 3] = each_axis(|k| p.origin[k] - grid.min[k]);
    let place_of = |i: usize| {
        let mut d: [f64; 3] = each_axis(|k| f64::from(chunk.position[k][i]) + corner[k]);
        if let Some(tilt) = &grid.tilt {
            d = tilt.upright(d);
        }
        let u: [f32; 3] = each_axis(|k| place(grid, k, d[k] * scale[k] + shift));
        if u.iter().all(|u| *u >= 0.0) { u } else { OUTSIDE }
    };
    let places: Vec<[f32; 3]> = (0..chunk.len()).map(place_of).collect();
    let (mut start, mut outside) = (vec![0u32; grid.cells[0] + 1], 0.0);
    for (i, u) in places.iter().enumerate() {
        match *u == OUTSIDE {
            false => start[u[0] as usize + 1] += 1,
            true => outside += unit * f64::from(weight(i)),
        }
    }
    for i in 0..grid.cells[0] {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut records = vec![([0.0; 3], 0.0); start[grid.cells[0]] as usize];
    for (i, u) in places.into_iter().enumerate().filter(|(_, u)| *u != OUTSIDE) {
        let at = &mut next[u[0] as usize];
        records[*at as usize] = (u, weight(i));
        *at += 1;
    }
    SortedChunk { records, unit, start, outside }
}

/// A coordinate in [0, cells), or -1 outside. An open grid's far end belongs to its last cell.
#[inline]
fn place(grid: &Grid, axis: usize, u: f64) -> f32 {
    let n = grid.cells[axis] as f32;
    // Rounding may end at n.
    let below = |u: f64| (u as f32).min(n.next_down());
    if u >= 0.0 && u < f64::from(n) {
        below(u)
    } else if grid.periodic[axis] {
        below(u.rem_euclid(f64::from(n)))
    } else if u == f64::from(n) {
        n.next_down()
    } else {
        -1.0
    }
}

/// Adds a sorted chunk's particles in some planes; `out` holds those planes alone.
fn add_to_planes(grid: &Grid, sorted: &SortedChunk, scheme: Assignment, planes: Range<usize>, out: &mut [f64]) {
    // A constant in each call, so that the compiler unrolls the loops over cells.
    match scheme {
        Assignment::Ngp => add_by_scheme(grid, sorted, Assignment::Ngp, planes, out),
        Assignment::Cic => add_by_scheme(grid, sorted, Assignment::Cic, planes, out),
        Assignment::Tsc => add_by_scheme(grid, sorted, Assignment::Tsc, planes, out),
    }
}

#[inline(always)]
fn add_by_scheme(grid: &Grid, sorted: &SortedChunk, scheme: Assignment, planes: Range<usize>, out: &mut [f64]) {
    let n = grid.cells[0];
    let reach = usize::from(scheme != Assignment::Ngp);
    let mut visit = |plane: usize| {
        for r in &sorted.records[sorted.start[plane] as usize..sorted.start[plane + 1] as usize] {
            add_record(grid, (r.0, sorted.unit * f64::from(r.1)), scheme, &planes, out);
        }
    };
    if planes.len() + 2 * reach >= n {
        return (0..n).for_each(visit);
    }
    // Particles of the planes beside these reach into them.
    let (first, last) = (planes.start as i64 - reach as i64, planes.end as i64 + reach as i64);
    for i in first..last {
        if (0..n as i64).contains(&i) {
            visit(i as usize);
        } else if grid.periodic[0] {
            visit(i.rem_euclid(n as i64) as usize);
        }
    }
}

#[inline(always)]
fn add_record(grid: &Grid, (u, mass): ([f32; 3], f64), scheme: Assignment, planes: &Range<usize>, out: &mut [f64]) {
    let order = scheme.order();
    let axes: [(i64, [f64; 3]); 3] = each_axis(|k| scheme.weights(f64::from(u[k])));
    let cells_along = |k: usize| -> [usize; 3] { std::array::from_fn(|a| grid.wrap(k, axes[k].0 + a as i64)) };
    let (columns, depths) = (cells_along(1), cells_along(2));
    // All but the particles at an edge reach cells that lie side by side.
    let side_by_side = depths[order - 1] == depths[0] + order - 1;
    for a in 0..order {
        let i = grid.wrap(0, axes[0].0 + a as i64);
        if !planes.contains(&i) {
            continue;
        }
        for b in 0..order {
            let row = ((i - planes.start) * grid.cells[1] + columns[b]) * grid.cells[2];
            let share = mass * axes[0].1[a] * axes[1].1[b];
            if side_by_side {
                let cells = &mut out[row + depths[0]..][..order];
                cells.iter_mut().zip(axes[2].1).for_each(|(cell, weight)| *cell += share * weight);
            } else {
                (0..order).for_each(|c| out[row + depths[c]] += share * axes[2].1[c]);
            }
        }
    }
}

/// Adds Gaussians, each mass times `unit_mass`, `widened` by a deviation in world units.
fn add_mixtures(
    field: &mut Field,
    parts: &[&Mixture],
    (unit_mass, widened): (f64, f64),
    shift: f64,
    context: &Context<'_>,
) -> Result<()> {
    let grid = field.grid;
    let moved_grid = Grid { min: each_axis(|k| grid.min[k] - shift * grid.side[k]), ..grid };
    let (plane, depth) = (grid.cells[1] * grid.cells[2], model_planes(&grid));
    parallel::try_for_each(field.mass.chunks_mut(depth * plane).enumerate(), |(slab, out)| {
        let planes = slab * depth..slab * depth + out.len() / plane;
        // Sums of many small shares: f64, rounded once.
        let (mut sum, mut splat) = (vec![0.0f64; out.len()], DepositScratch::new(context.simd(), widened));
        let mut slab = Slab { grid: &moved_grid, planes, cells: &mut sum };
        for m in parts {
            for i in 0..m.len() {
                // A Gaussian as wide as the box takes milliseconds.
                if i.is_multiple_of(8) {
                    context.check()?;
                    context.advance((m.len() - i).min(8) as u64);
                }
                let (mean, cov) = grid.upright(m.mean_of(i), m.cov_of(i));
                let cov = cov.add(&Sym3::scaled_identity(widened * widened));
                if slab.may_hold(mean, &cov) {
                    splat.add(&mut slab, mean, &cov, unit_mass * m.mass_of(i));
                }
            }
        }
        out.iter_mut().zip(sum).for_each(|(o, s)| *o += s as f32);
        Ok(())
    })?;
    let total: f64 = parts.iter().flat_map(|m| (0..m.len()).map(|i| m.mass_of(i))).sum::<f64>() * unit_mass;
    // Axes that repeat keep everything; what an open grid lost is the difference.
    if !grid.periodic.iter().all(|p| *p) {
        let inside: f64 = field.mass.iter().map(|v| f64::from(*v)).sum();
        field.outside = (field.outside + total - inside).max(0.0);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_particles::testing::{on_threads, poisson};
    use particlegs_particles::{Column, Domain};

    fn domain(length: [f64; 3], periodic: bool) -> Domain {
        Domain::upright([0.0; 3], length, [periodic; 3])
    }

    /// The plain twin: one particle after the other.
    fn plain(p: &Particles, grid: &Grid, scheme: Assignment, shift: f64) -> Vec<f64> {
        let mut out = vec![0.0; grid.len()];
        for i in 0..p.len() {
            let x = p.position(i);
            let axes: [_; 3] = each_axis(|k| {
                let u = (x[k] - grid.min[k]) / grid.side[k] + shift;
                scheme.weights(u)
            });
            for a in 0..27 {
                let o = [a / 9, a / 3 % 3, a % 3];
                let w: f64 = (0..3).map(|k| axes[k].1[o[k]]).product();
                let at = each_axis(|k| grid.wrap(k, axes[k].0 + o[k] as i64));
                out[grid.index(at)] += w * p.weights().map_or(1.0, |c| f64::from(c[i]));
            }
        }
        out
    }

    #[test]
    fn every_scheme_agrees_with_its_plain_twin() {
        let length = [3.0, 10.0, 7.0];
        let p = poisson(5000, length, 1).with_weights(Column::owned((0..5000).map(|i| 0.5 + (i % 7) as f32).collect()));
        for periodic in [true, false] {
            for longest in [1, 2, 5, 40] {
                let grid = Grid::new(&domain(length, periodic), longest);
                for scheme in [Assignment::Ngp, Assignment::Cic, Assignment::Tsc] {
                    for shift in [0.0, 0.5] {
                        if shift > 0.0 && !periodic {
                            continue;
                        }
                        let fast = deposit(Subject::Particles(&p), &grid, scheme, shift, &Context::SILENT).unwrap();
                        let plain = plain(&p, &grid, scheme, shift);
                        let worst = fast
                            .mass
                            .iter()
                            .zip(&plain)
                            .map(|(a, b)| (f64::from(*a) - b).abs() / b.max(1.0))
                            .fold(0.0, f64::max);
                        assert!(worst < 1e-5, "{scheme:?} {longest} {periodic} {shift}: {worst}");
                    }
                }
            }
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let p = poisson(300_000, [4.0, 4.0, 4.0], 1);
        let grid = Grid::new(&domain([4.0; 3], true), 24);
        let run = |threads| {
            on_threads(threads, || {
                deposit(Subject::Particles(&p), &grid, Assignment::Tsc, 0.5, &Context::SILENT).unwrap().mass
            })
        };
        assert_eq!(run(1), run(5));
    }

    #[test]
    fn what_lies_beyond_an_open_edge_is_counted() {
        let p = Particles::from_columns(vec![-0.5, 0.5, 4.0, 4.1], vec![1.0; 4], vec![1.0; 4]);
        let grid = Grid::new(&domain([4.0; 3], false), 4);
        let f = deposit(Subject::Particles(&p), &grid, Assignment::Tsc, 0.0, &Context::SILENT).unwrap();
        assert_eq!(f.outside, 2.0);
        assert!((f.mass.iter().sum::<f32>() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_model_keeps_its_mass_and_its_place() {
        let mut m = Mixture::default();
        m.push([1.0, 9.5, 3.0], Sym3([0.3, 0.1, 0.0, 0.2, 0.0, 0.4]), 100.0, 100.0);
        m.push([2.9, 0.6, 6.6], Sym3::scaled_identity(1e-6), 50.0, 50.0);
        let grid = Grid::new(&domain([3.0, 10.0, 7.0], true), 40);
        let mut field = Field { grid, mass: vec![0.0; grid.len()], outside: 0.0 };
        add_mixtures(&mut field, &[&m], (2.0, 0.0), 0.0, &Context::SILENT).unwrap();
        assert!((field.mass.iter().map(|v| f64::from(*v)).sum::<f64>() - 300.0).abs() < 1e-3);
        assert!((field.mass[grid.index([11, 2, 26])] - 100.0).abs() < 0.5);
        let mut whole = vec![0.0; grid.len()];
        let (mut splat, mut slab) = (DepositScratch::new(Context::SILENT.simd(), 0.0), Slab::whole(&grid, &mut whole));
        (0..2).for_each(|i| splat.add(&mut slab, m.mean_of(i), &m.cov_of(i), 2.0 * m.mass_of(i)));
        assert!(field.mass.iter().zip(&whole).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
    }

    #[test]
    fn a_grid_beyond_memory_says_what_it_needs() {
        let grid = Grid::new(&domain([1.0; 3], true), 65_000);
        let p = poisson(10, [1.0; 3], 1);
        // Refused before anything is taken, where the system tells what it has.
        if particlegs_files::memory::available_bytes().is_some() {
            let error = deposit(Subject::Particles(&p), &grid, Assignment::Ngp, 0.0, &Context::SILENT).unwrap_err();
            assert!(matches!(error, particlegs_core::Error::Memory { .. }));
        }
    }
}

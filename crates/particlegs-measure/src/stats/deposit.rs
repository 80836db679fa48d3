//! Mass in the cells of a grid: of particles by an assignment scheme, of Gaussians by integrals.
//!
//! Every task owns a run of planes and adds to them alone, in the order of the particles: no
//! atomics, no copies of the grid, and the same bits whatever the threads.

use super::gaussian::DepositScratch;
use super::slab::Slab;
use super::{Assignment, Grid, Subject};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
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
    deposit_again(subject, Field { grid: *grid, mass: Vec::new(), outside: 0.0 }, scheme, shift, context)
}

/// [`deposit`] on the grid of a field that is no longer wanted, in its memory.
pub(super) fn deposit_again(
    subject: Subject<'_>,
    mut field: Field,
    scheme: Assignment,
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
        Subject::Particles(p) => add_particles(&mut field, p, scheme, shift, context)?,
        Subject::Model(m) => {
            for layer in &m.layers {
                let parts: Vec<&Mixture> = layer.content.iter().map(|b| &b.gaussians).collect();
                add_mixtures(&mut field, &parts, layer.mass.unit_or_one(), shift, context)?;
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

/// A particle in units of cells.
type CellRecord = ([f64; 3], f64);

/// A chunk's particles sorted by plane, and where each plane begins.
struct SortedChunk {
    records: Vec<CellRecord>,
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
    let (plane, depth) = (grid.cells[1] * grid.cells[2], grid.cells[0].div_ceil(SLABS).max(4));
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
    let weight = |i: usize| unit * chunk.weight.map_or(1.0, |w| f64::from(w[i]));
    let corner: [f64; 3] = each_axis(|k| p.origin[k] - grid.min[k]);
    let cell = |i: usize| {
        let mut d: [f64; 3] = each_axis(|k| f64::from(chunk.position[k][i]) + corner[k]);
        if let Some(tilt) = &grid.tilt {
            d = tilt.upright(d);
        }
        let mut u: [f64; 3] = each_axis(|k| d[k] * scale[k] + shift);
        (0..3).all(|k| place(grid, k, &mut u[k])).then_some(u)
    };
    // Counted first and computed again: quicker than records that are written twice.
    let (mut start, mut outside) = (vec![0u32; grid.cells[0] + 1], 0.0);
    for i in 0..chunk.len() {
        match cell(i) {
            Some(u) => start[u[0] as usize + 1] += 1,
            None => outside += weight(i),
        }
    }
    for i in 0..grid.cells[0] {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut records = vec![([0.0; 3], 0.0); start[grid.cells[0]] as usize];
    for i in 0..chunk.len() {
        if let Some(u) = cell(i) {
            let at = &mut next[u[0] as usize];
            records[*at as usize] = (u, weight(i));
            *at += 1;
        }
    }
    SortedChunk { records, start, outside }
}

/// Brings a coordinate into [0, cells), or says that it lies outside. An open grid's far end
/// belongs to its last cell.
fn place(grid: &Grid, axis: usize, u: &mut f64) -> bool {
    let n = grid.cells[axis] as f64;
    if *u >= 0.0 && *u < n {
        return true;
    }
    if grid.periodic[axis] {
        *u = u.rem_euclid(n);
        if *u >= n {
            *u = 0.0;
        }
        return true;
    }
    if *u == n {
        *u = n.next_down();
        return true;
    }
    false
}

/// Adds a sorted chunk's particles in some planes; `out` holds those planes alone.
fn add_to_planes(grid: &Grid, sorted: &SortedChunk, scheme: Assignment, planes: Range<usize>, out: &mut [f64]) {
    let n = grid.cells[0];
    let reach = usize::from(scheme != Assignment::Ngp);
    let mut visit = |plane: usize| {
        for r in &sorted.records[sorted.start[plane] as usize..sorted.start[plane + 1] as usize] {
            add_record(grid, r, scheme, &planes, out);
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

#[inline]
fn add_record(grid: &Grid, (u, weight): &CellRecord, scheme: Assignment, planes: &Range<usize>, out: &mut [f64]) {
    let order = scheme.order();
    let axes: [(i64, [f64; 3]); 3] = each_axis(|k| scheme.weights(u[k]));
    for a in 0..order {
        let i = grid.wrap(0, axes[0].0 + a as i64);
        if !planes.contains(&i) {
            continue;
        }
        for b in 0..order {
            let j = grid.wrap(1, axes[1].0 + b as i64);
            let row = ((i - planes.start) * grid.cells[1] + j) * grid.cells[2];
            let share = weight * axes[0].1[a] * axes[1].1[b];
            for c in 0..order {
                out[row + grid.wrap(2, axes[2].0 + c as i64)] += share * axes[2].1[c];
            }
        }
    }
}

fn add_mixtures(
    field: &mut Field,
    parts: &[&Mixture],
    unit_mass: f64,
    shift: f64,
    context: &Context<'_>,
) -> Result<()> {
    let grid = field.grid;
    let moved_grid = Grid { min: each_axis(|k| grid.min[k] - shift * grid.side[k]), ..grid };
    let (plane, depth) = (grid.cells[1] * grid.cells[2], model_planes(&grid));
    parallel::try_for_each(field.mass.chunks_mut(depth * plane).enumerate(), |(slab, out)| {
        let planes = slab * depth..slab * depth + out.len() / plane;
        // Sums of many small shares: f64, rounded once.
        let (mut sum, mut splat) = (vec![0.0f64; out.len()], DepositScratch::default());
        let mut slab = Slab { grid: &moved_grid, planes, cells: &mut sum };
        for m in parts {
            for i in 0..m.len() {
                // A Gaussian as wide as the box takes milliseconds.
                if i.is_multiple_of(8) {
                    context.check()?;
                    context.advance((m.len() - i).min(8) as u64);
                }
                let (mean, cov) = grid.upright(m.mean_of(i), m.cov_of(i));
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
#[path = "deposit_tests.rs"]
mod tests;

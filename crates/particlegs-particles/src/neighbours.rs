//! k-d trees in the cells of a grid: nearest neighbours in a periodic or an open domain.
//!
//! Points are the particles' own float32 numbers, sorted into cells of about 64 by counting, and
//! those of a cell into a tree in place: 13 bytes a particle, and a third of the time of one tree. No
//! index is kept: of the points at a particle's own place, one is itself. Threads decide the order
//! within a cell, and no distance depends on it.

use super::{CHUNK, Chunk, ChunkBuffer, Domain, Particles};
use particlegs_core::context::Context;
use particlegs_core::math::{each_axis, floor};
use particlegs_core::memory::filled;
use particlegs_core::{Error, Result, parallel};
use std::collections::BinaryHeap;
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Points in a cell, about, were they evenly spread.
const IN_CELL: usize = 64;
/// Points in a leaf, at most.
const LEAF: usize = 16;
/// Points below which a part is built by one thread.
const ALONE: usize = 1 << 14;
/// Places that one thread looks from at a time.
const TOGETHER: usize = 1024;
/// Bytes a particle that a tree takes while it is built.
const TREE_BYTES: u64 = 14;

/// A position relative to the particles' origin, inside the domain along axes that repeat.
pub(crate) type LocalPosition = [f32; 3];

struct PlaceFinder<'a> {
    domain: &'a Domain,
    /// Its lowest corner relative to the particles' origin.
    corner: [f64; 3],
}

impl<'a> PlaceFinder<'a> {
    fn new(p: &Particles, domain: &'a Domain) -> Self {
        PlaceFinder { domain, corner: each_axis(|k| domain.min[k] - p.origin[k]) }
    }

    /// The places of a run, in place of what `places` holds.
    fn places(&self, chunk: &Chunk<'_>, places: &mut Vec<LocalPosition>) {
        let Domain { length, periodic, tilt, .. } = self.domain;
        places.clear();
        if let Some(tilt) = tilt {
            return places.extend((0..chunk.len()).map(|i| {
                let raw: [f64; 3] = each_axis(|k| f64::from(chunk.position[k][i]));
                let along = tilt.upright(each_axis(|k| raw[k] - self.corner[k]));
                let turns = each_axis(|a| if periodic[a] { floor(along[a] / length[a]) } else { 0.0 });
                let back = self.domain.turned(turns);
                each_axis(|k| (raw[k] - back[k]) as f32)
            }));
        }
        let inside = |k: usize, raw: f32| {
            let turns = floor((f64::from(raw) - self.corner[k]) / length[k]);
            if periodic[k] && turns != 0.0 { (f64::from(raw) - turns * length[k]) as f32 } else { raw }
        };
        places.extend((0..chunk.len()).map(|i| [0, 1, 2].map(|k| inside(k, chunk.position[k][i])) as LocalPosition));
    }
}

/// Calls `visit` with runs of places, the index of the first, in parallel.
fn visit_places(p: &Particles, domain: &Domain, visit: impl Fn(usize, &[LocalPosition]) + Sync) {
    let finder = PlaceFinder::new(p, domain);
    let scratch = parallel::Scratch::<Vec<LocalPosition>>::default();
    p.par_chunks(|first, chunk| {
        scratch.with(|places| {
            finder.places(&chunk, places);
            visit(first, places);
        });
    });
}

/// The cubic spline kernel's density at a distance, for a mass of 1 and a support of radius 1 (Monaghan and Lattanzio 1985).
pub fn cubic_spline(q: f64) -> f64 {
    let share = match q {
        q if q < 0.5 => 1.0 - 6.0 * q * q * (1.0 - q),
        q if q < 1.0 => 2.0 * (1.0 - q).powi(3),
        _ => 0.0,
    };
    8.0 / PI * share
}

/// The places of some particles, `chosen` in ascending order.
pub fn places_of(p: &Particles, domain: &Domain, chosen: &[u32]) -> Vec<LocalPosition> {
    let out: Vec<[AtomicU32; 3]> = chosen.iter().map(|_| Default::default()).collect();
    visit_places(p, domain, |first, places| {
        let from = chosen.partition_point(|i| (*i as usize) < first);
        for (at, i) in chosen[from..].iter().enumerate().take_while(|(_, i)| (**i as usize) < first + places.len()) {
            store(&out[from + at], places[*i as usize - first]);
        }
    });
    loaded(out)
}

fn store(to: &[AtomicU32; 3], place: LocalPosition) {
    (0..3).for_each(|k| to[k].store(place[k].to_bits(), Relaxed));
}

/// In place: one column turns into the other.
fn loaded(all: Vec<[AtomicU32; 3]>) -> Vec<LocalPosition> {
    all.into_iter().map(|x| x.map(|v| f32::from_bits(v.into_inner()))).collect()
}

/// Points by cell, and in each cell ordered so that every subtree is a run that its median divides.
pub struct Neighbours {
    points: Vec<LocalPosition>,
    /// The axis of each median.
    axes: Vec<u8>,
    /// First point of each cell, x slowest, and the number of points.
    start: Vec<u32>,
    grid: CellGrid,
}

/// Cells over a domain, or over the points along edges that do not repeat.
struct CellGrid {
    domain: Domain,
    /// Lowest corner, as points are.
    low: [f64; 3],
    side: [f64; 3],
    /// Edges of a cell over distances between its faces.
    stretch: [f64; 3],
    cells: [usize; 3],
}

/// The points that a search has found so far.
trait NeighbourCollector {
    /// Another point, by the square of its distance.
    fn take(&mut self, square: f64);

    /// Points whose square is not below this change nothing any more.
    fn limit(&self) -> f64;
}

struct NearestPoint {
    /// Points at the place itself.
    here: u32,
    /// Smallest square of a distance above zero.
    square: f64,
}

impl NeighbourCollector for NearestPoint {
    #[inline(always)]
    fn take(&mut self, square: f64) {
        if square == 0.0 {
            self.here += 1;
        } else if square < self.square {
            self.square = square;
        }
    }

    /// Two at one place: no distance is smaller.
    #[inline(always)]
    fn limit(&self) -> f64 {
        if self.here > 1 { 0.0 } else { self.square }
    }
}

/// The nearest points of a number, the point itself among them: a heap with the farthest first. Squares are
/// kept as their bits, which are in the order of the squares.
#[derive(Default)]
struct NearestHeap {
    wanted: usize,
    squares: BinaryHeap<u64>,
}

impl NearestHeap {
    /// The square of the farthest; infinite until there are enough.
    #[inline(always)]
    fn farthest(&self) -> f64 {
        match self.squares.peek() {
            Some(bits) if self.squares.len() == self.wanted => f64::from_bits(*bits),
            _ => f64::INFINITY,
        }
    }
}

impl NeighbourCollector for NearestHeap {
    #[inline(always)]
    fn take(&mut self, square: f64) {
        if self.squares.len() < self.wanted {
            self.squares.push(square.to_bits());
        } else if let Some(mut farthest) = self.squares.peek_mut()
            && square.to_bits() < *farthest
        {
            *farthest = square.to_bits();
        }
    }

    #[inline(always)]
    fn limit(&self) -> f64 {
        self.farthest()
    }
}

impl CellGrid {
    fn new(p: &Particles, domain: &Domain) -> Self {
        let (low, length) = Self::region(p, domain);
        let most = (p.len() / IN_CELL).max(1) as f64;
        // Roots are taken before the product, which may leave the range of f64.
        let mut side = length.map(libm::cbrt).iter().product::<f64>() / libm::cbrt(most);
        let count = |side: f64| length.map(|l| (l / side).floor().max(1.0));
        // Axes shorter than a cell leave more of them to the others.
        while count(side).iter().product::<f64>() > 2.0 * most {
            side *= 1.25;
        }
        let cells = count(side).map(|c| c as usize);
        CellGrid {
            domain: *domain,
            low: each_axis(|k| low[k] - p.origin[k]),
            side: each_axis(|k| length[k] / cells[k] as f64),
            stretch: each_axis(|k| domain.stretch(k)),
            cells,
        }
    }

    /// Lowest corner and edges of the domain where it repeats, else of where the points are.
    fn region(p: &Particles, domain: &Domain) -> ([f64; 3], [f64; 3]) {
        let (mut low, mut length) = (domain.min, domain.length);
        let open: Vec<usize> = (0..3).filter(|k| !domain.periodic[*k]).collect();
        if open.is_empty() {
            return (low, length);
        }
        let Some(tilt) = &domain.tilt else {
            let bounds = p.bounds();
            open.iter().for_each(|&k| (low[k], length[k]) = (bounds.min[k], bounds.extent_nonzero()[k]));
            return (low, length);
        };
        let bounds = tilt.bounds(p, domain.min);
        let first = tilt.world(each_axis(|k| if domain.periodic[k] { 0.0 } else { bounds.min[k] }));
        open.iter().for_each(|&k| length[k] = bounds.extent_nonzero()[k]);
        (each_axis(|k| low[k] + first[k]), length)
    }

    /// A place along the edges, from the lowest corner.
    fn along(&self, x: &[f64; 3]) -> [f64; 3] {
        let d = each_axis(|k| x[k] - self.low[k]);
        self.domain.tilt.as_ref().map_or(d, |t| t.upright(d))
    }

    /// The cell of what lies there along the edges.
    fn cell(&self, along: &[f64; 3]) -> [usize; 3] {
        each_axis(|k| ((along[k] / self.side[k]) as usize).min(self.cells[k] - 1))
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.cells[1] + j) * self.cells[2] + k
    }

    /// Steps from cell `home` along an axis to the ends of a shell, or to those of the axis: around the
    /// box once where it repeats.
    fn steps(&self, axis: usize, home: usize, shell: i64) -> (i64, i64) {
        let (n, home) = (self.cells[axis] as i64, home as i64);
        let (down, up) = if self.domain.periodic[axis] { (n, n) } else { (home, n - 1 - home) };
        (-down.min(shell), up.min(shell))
    }

    /// No cell of a shell about `home` is nearer to what lies there along the edges; infinite where it has no cells.
    fn nearest_of_shell(&self, along: &[f64; 3], home: [usize; 3], shell: i64) -> f64 {
        let of_axis = |k: usize| {
            let (down, up) = self.steps(k, home[k], shell);
            let from = along[k] - home[k] as f64 * self.side[k];
            let side = |is_end: bool, d: f64| {
                if is_end { d.max(0.0) + (shell - 1) as f64 * self.side[k] } else { f64::INFINITY }
            };
            side(down == -shell, from).min(side(up == shell, self.side[k] - from)) / self.stretch[k]
        };
        (0..3).map(of_axis).fold(f64::INFINITY, f64::min)
    }

    /// No point of a cell is nearer to `x` than by this square.
    fn away(&self, x: &[f64; 3], cell: [usize; 3]) -> f64 {
        let along = self.along(x);
        let squares: [f64; 3] = each_axis(|k| {
            let from = along[k] - cell[k] as f64 * self.side[k];
            let d = (-from).max(from - self.side[k]).max(0.0) / self.stretch[k];
            d * d
        });
        // Across faces that are not at right angles distances do not add up.
        let upright = self.domain.tilt.is_none();
        if upright { squares.iter().sum() } else { squares.into_iter().fold(0.0, f64::max) }
    }

    /// The cell at `i`, which may lie beyond the ends, and the turns of the box to reach it.
    fn image(&self, axis: usize, i: i64) -> Option<(usize, f64)> {
        let n = self.cells[axis] as i64;
        if (0..n).contains(&i) {
            return Some((i as usize, 0.0));
        }
        self.domain.periodic[axis].then(|| (i.rem_euclid(n) as usize, i.div_euclid(n) as f64))
    }
}

impl Neighbours {
    /// Sorts particles into cells of the domain.
    pub fn new(p: &Particles, domain: &Domain) -> Self {
        let grid = CellGrid::new(p, domain);
        let next: Vec<AtomicU32> = (0..grid.cells.iter().product::<usize>()).map(|_| AtomicU32::new(0)).collect();
        let key = |x: &LocalPosition| grid.index(grid.cell(&grid.along(&x.map(f64::from))));
        // A counting sort in two passes: how many a cell holds, then where each of them goes.
        visit_places(p, domain, |_, places| {
            places.iter().for_each(|x| {
                next[key(x)].fetch_add(1, Relaxed);
            });
        });
        let mut start = Vec::with_capacity(next.len() + 1);
        let mut sum = 0;
        for cell in &next {
            start.push(sum);
            sum += cell.swap(sum, Relaxed);
        }
        start.push(sum);
        // From here on `next` holds the place of each cell's next point.
        let points: Vec<[AtomicU32; 3]> = (0..p.len()).map(|_| Default::default()).collect();
        visit_places(p, domain, |_, places| {
            places.iter().for_each(|x| store(&points[next[key(x)].fetch_add(1, Relaxed) as usize], *x));
        });
        drop(next);
        let (mut points, mut axes) = (loaded(points), vec![0; p.len()]);
        build_cells(&mut points, &mut axes, &start);
        Neighbours { points, axes, start, grid }
    }

    /// Distance from the point at `x`, one of these, to its nearest other; infinite where there is
    /// none.
    pub fn nearest(&self, x: LocalPosition) -> f64 {
        let mut nearest_point = NearestPoint { here: 0, square: f64::INFINITY };
        self.search_all(x, &mut nearest_point);
        if nearest_point.here > 1 { 0.0 } else { nearest_point.square.sqrt() }
    }

    /// Particles in a volume at `x`, by [`cubic_spline`]s that reach to the `rank`-th point from there; infinite where
    /// so many lie at one place, 0 where there are fewer.
    pub fn density(&self, x: LocalPosition, rank: usize) -> f64 {
        let mut nearest_heap = NearestHeap { wanted: rank, ..NearestHeap::default() };
        self.search_all(x, &mut nearest_heap);
        let reach = nearest_heap.farthest().sqrt();
        if reach.is_infinite() {
            return 0.0;
        }
        let at = |square: u64| cubic_spline(f64::from_bits(square).sqrt() / reach);
        // Sorted, so that the sum has the same bits whatever order the search found them in.
        let sum: f64 = nearest_heap.squares.into_sorted_vec().into_iter().map(at).sum();
        if reach > 0.0 { sum / reach.powi(3) } else { f64::INFINITY }
    }

    /// Searches the cells about `x`, a place in the box.
    fn search_all(&self, x: LocalPosition, collector: &mut impl NeighbourCollector) {
        let x = x.map(f64::from);
        let along = self.grid.along(&x);
        let home = self.grid.cell(&along);
        self.search(self.run(home), &x, [0.0; 3], collector);
        // Shells of cells, until they are further away than what was found.
        let widest = *self.grid.cells.iter().max().expect("three axes");
        for shell in 1..=widest as i64 {
            let inner = self.grid.nearest_of_shell(&along, home, shell);
            if inner * inner >= collector.limit() {
                break;
            }
            self.search_shell(&x, home, shell, collector);
        }
    }

    fn run(&self, cell: [usize; 3]) -> Range<usize> {
        let at = self.grid.index(cell);
        self.start[at] as usize..self.start[at + 1] as usize
    }

    /// The cells `shell` steps from home.
    fn search_shell(&self, x: &[f64; 3], home: [usize; 3], shell: i64, collector: &mut impl NeighbourCollector) {
        let g = &self.grid;
        let at = |k: usize, d: i64| g.image(k, home[k] as i64 + d);
        // Axes of few cells end long before the shell does.
        let [x_steps, y_steps, z_steps] = [0, 1, 2].map(|k| g.steps(k, home[k], shell));
        for a in x_steps.0..=x_steps.1 {
            let Some((i, turn_x)) = at(0, a) else { continue };
            for b in y_steps.0..=y_steps.1 {
                let Some((j, turn_y)) = at(1, b) else { continue };
                // Inside the shell only its two ends.
                let whole = a.abs() == shell || b.abs() == shell;
                let ends = [-shell, shell].into_iter().filter(|c| !whole && (z_steps.0..=z_steps.1).contains(c));
                let all = (z_steps.0..=z_steps.1).filter(|_| whole);
                for c in all.chain(ends) {
                    let Some((k, turn_z)) = at(2, c) else { continue };
                    let (cell, turn) = ([i, j, k], [turn_x, turn_y, turn_z]);
                    let run = self.run(cell);
                    if run.is_empty() {
                        continue;
                    }
                    // The place is moved into the image's frame instead of all its points.
                    let back = g.domain.turned(turn);
                    let moved: [f64; 3] = each_axis(|k| x[k] - back[k]);
                    let away = g.away(&moved, cell);
                    if away < collector.limit() {
                        self.search(run, &moved, [0.0; 3], collector);
                    }
                }
            }
        }
    }

    /// `off` holds the distance to the run's region along each axis.
    fn search(&self, run: Range<usize>, x: &[f64; 3], off: [f64; 3], collector: &mut impl NeighbourCollector) {
        let points = &self.points[run.clone()];
        let square = |p: &LocalPosition| {
            let d: [f64; 3] = each_axis(|k| f64::from(p[k]) - x[k]);
            d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        };
        if collector.limit() == 0.0 {
            return;
        }
        if points.len() <= LEAF {
            return points.iter().for_each(|p| collector.take(square(p)));
        }
        let middle = run.start + points.len() / 2;
        let (axis, median) = (self.axes[middle] as usize, &self.points[middle]);
        collector.take(square(median));
        let d = x[axis] - f64::from(median[axis]);
        let (left, right) = (run.start..middle, middle + 1..run.end);
        let (near, far) = if d < 0.0 { (left, right) } else { (right, left) };
        self.search(near, x, off, collector);
        // The far half begins at the median's plane: it is as far away as that along this axis.
        let mut beyond = off;
        beyond[axis] = d;
        if beyond[0] * beyond[0] + beyond[1] * beyond[1] + beyond[2] * beyond[2] < collector.limit() {
            self.search(far, x, beyond, collector);
        }
    }
}

/// Distance from every particle to its neighbour of a rank: the `rank`-th nearest other particle. Copies of
/// particles in a domain that repeats count as others, and particles at one place as neighbours at distance
/// zero.
pub fn distances_to(rank: usize, p: &Particles, domain: &Domain, context: &Context<'_>) -> Result<Vec<f32>> {
    let n = p.len();
    // Cells hold the number of their first point as u32.
    if rank >= n || n >= u32::MAX as usize {
        let message = format!("{rank} neighbours per particle need more than {rank} particles and fewer than 2^32 - 1");
        return Err(Error::argument(format!("{message}, not {n}")));
    }
    context.require_memory("a tree of neighbours", n as u64 * (TREE_BYTES + 4))?;
    context.begin("neighbours", n as u64);
    let tree = Neighbours::new(p, domain);
    let (finder, mut buffer, mut places) = (PlaceFinder::new(p, domain), ChunkBuffer::default(), Vec::new());
    let scratch = parallel::Scratch::<NearestHeap>::default();
    let mut out = filled("distances to neighbours", 0.0f32, n, context)?;
    for (k, run) in out.chunks_mut(CHUNK).enumerate() {
        let start = k * CHUNK;
        finder.places(&p.chunk(start..start + run.len(), &mut buffer), &mut places);
        parallel::try_for_each(run.chunks_mut(TOGETHER).zip(places.chunks(TOGETHER)), |(out, places)| {
            scratch.with(|heap| {
                // The point itself is among those found.
                heap.wanted = rank + 1;
                for (out, x) in out.iter_mut().zip(places) {
                    context.check()?;
                    heap.squares.clear();
                    tree.search_all(*x, heap);
                    *out = heap.farthest().sqrt() as f32;
                }
                context.advance(out.len() as u64);
                Ok(())
            })
        })?;
    }
    context.end();
    Ok(out)
}

/// Builds the trees of the cells that begin at `start`, whose points these are.
fn build_cells(points: &mut [LocalPosition], axes: &mut [u8], start: &[u32]) {
    if points.is_empty() {
        return;
    }
    if start.len() == 2 {
        return build(points, axes);
    }
    let half = start.len() / 2;
    let middle = (start[half] - start[0]) as usize;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    let mut work = || build_cells(left, left_axes, &start[..=half]);
    if right.len() > ALONE {
        parallel::join(work, || build_cells(right, right_axes, &start[half..]));
    } else {
        work();
        build_cells(right, right_axes, &start[half..]);
    }
}

fn build(points: &mut [LocalPosition], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let (axis, middle) = (widest(points), points.len() / 2);
    points.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    // Only medians have an axis; leaves are looked through point by point.
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    let mut work = || build(left, left_axes);
    if right.len() > ALONE {
        parallel::join(work, || build(&mut right[1..], &mut right_axes[1..]));
    } else {
        work();
        build(&mut right[1..], &mut right_axes[1..]);
    }
}

/// The axis along which a run is longest.
fn widest(points: &[LocalPosition]) -> usize {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for x in points {
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(x[k]), high[k].max(x[k]));
        }
    }
    let extent: [f32; 3] = each_axis(|k| high[k] - low[k]);
    (1..3).fold(0, |a, k| if extent[k] > extent[a] { k } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;

    /// Against all pairs, copies of a box that repeats included.
    #[test]
    fn distances_are_those_of_all_pairs() {
        let length = [1.0, 1.5, 2.0];
        for periodic in [[true; 3], [false; 3], [true, false, true]] {
            let draw = |k: usize| -> Vec<f32> {
                let edge = |i: u64| if i.is_multiple_of(3) { 0.05 * length[k] } else { length[k] };
                (0..700).map(|i| (edge(i) * Random::new(4, k as u32, i).uniform()) as f32).collect()
            };
            let p = Particles::from_columns(draw(0), draw(1), draw(2));
            let domain = Domain::upright([0.0; 3], length, periodic);
            let turns = |k: usize| if periodic[k] { -1..=1 } else { 0..=0 };
            let all = |i: usize| {
                let (mut squares, x) = (Vec::new(), p.position(i));
                for (j, turn) in (0..700).flat_map(|j| turns(0).map(move |a| (j, a))) {
                    for (b, c) in turns(1).flat_map(|b| turns(2).map(move |c| (b, c))) {
                        let (y, n) = (p.position(j), [turn, b, c].map(f64::from));
                        squares.push((0..3).map(|k| (y[k] + n[k] * length[k] - x[k]).powi(2)).sum::<f64>());
                    }
                }
                squares.sort_unstable_by(f64::total_cmp);
                squares
            };
            let expected: Vec<Vec<f64>> = (0..40).map(all).collect();
            for rank in [1, 2, 16, 150] {
                let distances = distances_to(rank, &p, &domain, &Context::SILENT).unwrap();
                for (i, squares) in expected.iter().enumerate() {
                    assert!((f64::from(distances[i]) - squares[rank].sqrt()).abs() < 1e-6, "{periodic:?} {rank} {i}");
                }
            }
        }
    }

    /// The same in tilted boxes, particles of other images among them.
    #[test]
    fn distances_in_tilted_boxes_are_those_of_all_pairs() {
        use crate::testing::{from_points, gas, square_between, tilted_cells};
        for mut cell in tilted_cells() {
            cell.origin = [-3.0, 1.0, 0.5];
            let mut p = gas(900, &cell, 5);
            let domain = Domain::from_particles(&p);
            assert!(domain.tilt.is_some());
            let x: Vec<[f64; 3]> = (0..900).map(|i| p.position(i)).collect();
            let moved = |i: usize| each_axis(|k| x[i][k] + if i.is_multiple_of(7) { cell.vectors[1][k] } else { 0.0 });
            p = from_points((0..900).map(moved));
            for rank in [1, 16] {
                let distances = distances_to(rank, &p, &domain, &Context::SILENT).unwrap();
                for i in 0..40 {
                    let mut squares: Vec<f64> = (0..900).map(|j| square_between(&domain, x[i], x[j])).collect();
                    squares.sort_unstable_by(f64::total_cmp);
                    assert!((f64::from(distances[i]) - squares[rank].sqrt()).abs() < 1e-5, "{cell:?} {rank} {i}");
                }
            }
        }
    }

    #[test]
    fn particles_at_one_place_are_neighbours() {
        let p = Particles::from_columns(vec![0.0, 0.0, 0.0, 3.0], vec![0.0; 4], vec![0.0; 4]);
        let domain = Domain::from_particles(&p);
        assert_eq!(distances_to(2, &p, &domain, &Context::SILENT).unwrap(), [0.0, 0.0, 0.0, 3.0]);
        assert_eq!(distances_to(3, &p, &domain, &Context::SILENT).unwrap(), [3.0, 3.0, 3.0, 3.0]);
        assert!(distances_to(4, &p, &domain, &Context::SILENT).is_err());
    }
}

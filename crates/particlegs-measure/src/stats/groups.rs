//! Friends of friends: groups of particles joined by links of a given length (Davis et al. 1985).
//!
//! Particles are sorted into cells whose diagonal is the linking length, so that a cell's own are
//! friends without a look; two cells are joined once one pair between them is found. Cells are
//! found by rows: along z they lie sorted, and two rows are walked side by side. Cells that touch are
//! joined first: of those further apart most are then of one group already, and need no look.

use super::Domain;
use super::points::{by_cell, gathered};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::RUN;
use std::ops::Range;

/// Groups of at least the smallest size asked for, the largest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Groups {
    /// Linking length, world units.
    pub linking_length: f64,
    /// Members of each group: indices of particles, ascending.
    pub members: Vec<Vec<u32>>,
}

impl Groups {
    /// Particles of each group, descending.
    pub fn sizes(&self) -> Vec<u64> {
        self.members.iter().map(|m| m.len() as u64).collect()
    }
}

/// Pairs of particles above which two cells count as crowded.
const MANY: usize = 1 << 12;
/// Rows that are walked between two looks at whether the work was stopped.
const TOGETHER: usize = 64;
/// Cells along an axis that repeats, at most: f64 tells no more places apart.
const MOST_CELLS: i64 = 1 << 53;

/// An occupied cell: its place along z and its particles in the sorted order.
#[derive(Clone, Copy)]
struct CellRun {
    z: i64,
    first: u32,
    end: u32,
}

/// Cells that are looked at: those with a face, edge or corner in common, or the others.
#[derive(Clone, Copy, PartialEq)]
enum NeighbourCells {
    Touching,
    Apart,
}

/// Options of a walk along two rows, and the sets so far.
struct RowWalk<'a> {
    length: f64,
    /// Square of the rows' distance.
    gap: f64,
    reach: NeighbourCells,
    /// The rows do not touch.
    apart: bool,
    /// Set of each cell so far.
    roots: &'a [u32],
    context: &'a Context<'a>,
}

struct CellRows<'a> {
    domain: &'a Domain,
    cells: [i64; 3],
    /// Distances between a cell's faces.
    height: [f64; 3],
    /// Cells on either side that a link reaches.
    most: [i64; 3],
    /// Occupied cells, row after row.
    runs: Vec<CellRun>,
    /// Occupied rows in ascending order: (x, y) and the first of their runs; one more at the end.
    rows: Vec<([i64; 2], u32)>,
    /// Occupied planes in ascending order: x and the first of their rows; one more at the end.
    planes: Vec<(i64, u32)>,
    position: Vec<[f64; 3]>,
    index: Vec<u32>,
}

/// The longest link that [`find_groups`] takes: a third of the smallest distance between faces that repeat.
pub fn longest_link(domain: &Domain) -> f64 {
    let heights = domain.heights();
    (0..3).filter(|k| domain.periodic[*k]).map(|k| heights[k] / 3.0).fold(f64::INFINITY, f64::min)
}

/// Finds the groups of at least `smallest` particles.
pub fn find_groups(
    positions: &[[f64; 3]],
    domain: &Domain,
    linking_length: f64,
    smallest: usize,
    context: &Context<'_>,
) -> Result<Groups> {
    let longest = longest_link(domain);
    if !(linking_length > 0.0 && linking_length <= longest) {
        return Err(Error::argument(format!(
            "the linking length {linking_length} must be above 0 and at most {longest:.6}"
        )));
    }
    if positions.len() >= u32::MAX as usize {
        return Err(Error::argument("groups need fewer than 4294967295 particles; use a sample"));
    }
    particlegs_files::memory::require("friends of friends", positions.len() as u64 * 80)?;
    let rows = CellRows::new(positions, domain, linking_length);
    context.check()?;
    context.begin("friends of friends", 2 * (rows.rows.len() - 1) as u64);
    let mut sets = DisjointSets::new(rows.runs.len());
    // Links of cells that touch join most of those further apart, which then need no look.
    for reach in [NeighbourCells::Touching, NeighbourCells::Apart] {
        let links = rows.links(linking_length, reach, &sets.roots(), context)?;
        links.iter().flatten().for_each(|(a, b)| sets.join(*a, *b));
    }
    context.end();
    Ok(Groups { linking_length, members: rows.members(&mut sets, smallest) })
}

impl<'a> CellRows<'a> {
    fn new(positions: &[[f64; 3]], domain: &'a Domain, linking_length: f64) -> Self {
        // A little under the diagonal, so that rounding makes no friends.
        let cell_side = linking_length / domain.diagonal() * (1.0 - 1e-9);
        let least = |k: usize| positions.iter().map(|x| domain.along(x, k)).fold(0.0, f64::min);
        // An open axis begins at its lowest point, so that particles beyond the box have cells, too.
        let low: [f64; 3] = each_axis(|k| if domain.periodic[k] { 0.0 } else { least(k) });
        // Axes that repeat need whole cells; open ones may have any number.
        let cells: [i64; 3] = each_axis(|k| {
            if domain.periodic[k] { ((domain.length[k] / cell_side).ceil() as i64).min(MOST_CELLS) } else { i64::MAX }
        });
        let side: [f64; 3] =
            each_axis(|k| if domain.periodic[k] { domain.length[k] / cells[k] as f64 } else { cell_side });
        let height: [f64; 3] = each_axis(|k| side[k] / domain.stretch(k));
        // 2 in an upright box, but for edges that rounding makes a little short.
        let most =
            each_axis(|k| if domain.tilt.is_none() { 2 } else { (linking_length / height[k]).floor() as i64 + 1 });
        let place =
            |x: &[f64; 3], k: usize| cell_number((domain.along(x, k) - low[k]) / side[k]).clamp(0, cells[k] - 1);
        let order = sorted(positions, &|x| [0, 1, 2].map(|k| place(x, k)), occupied(positions, &place, &cells));
        let (mut runs, mut rows): (Vec<CellRun>, Vec<([i64; 2], u32)>) = Default::default();
        for (at, i) in order.iter().enumerate() {
            let cell = [0, 1, 2].map(|k| place(&positions[*i as usize], k));
            let row = [cell[0], cell[1]];
            let new_row = rows.last().is_none_or(|r| r.0 != row);
            if new_row {
                rows.push((row, runs.len() as u32));
            }
            match runs.last_mut() {
                Some(run) if !new_row && run.z == cell[2] => run.end += 1,
                _ => runs.push(CellRun { z: cell[2], first: at as u32, end: at as u32 + 1 }),
            }
        }
        // The runs of a row end where the next one's begin: the last row needs a next one.
        rows.push(([i64::MAX; 2], runs.len() as u32));
        let mut planes: Vec<(i64, u32)> = Vec::new();
        for (i, (place, _)) in rows.iter().enumerate() {
            if planes.last().is_none_or(|p| p.0 != place[0]) {
                planes.push((place[0], i as u32));
            }
        }
        let position = gathered(positions, &order);
        CellRows { domain, cells, height, most, runs, rows, planes, position, index: order }
    }

    /// Pairs of cells that hold friends and are not in one set yet, row by row.
    fn links(
        &self,
        length: f64,
        reach: NeighbourCells,
        roots: &[u32],
        context: &Context<'_>,
    ) -> Result<Vec<Vec<(u32, u32)>>> {
        let most = if reach == NeighbourCells::Touching { [1; 3] } else { self.most };
        let rows = self.rows.len() - 1;
        parallel::try_map_range(rows.div_ceil(TOGETHER), |part| {
            context.check()?;
            let mut links = Vec::new();
            let part = part * TOGETHER..rows.min((part + 1) * TOGETHER);
            for (row, dx) in part.clone().flat_map(|row| (0..=most[0]).map(move |dx| (row, dx))) {
                let Some((plane, tx)) = self.plane_beside(row, dx) else { continue };
                let mut near = plane.start;
                // Each pair of rows from one of its two sides.
                for dy in if dx == 0 { 0 } else { -most[1] }..=most[1] {
                    let Some((other, ty)) = self.row_beside(self.rows[row].0[1] + dy, &plane, &mut near) else {
                        continue;
                    };
                    let gap = self.least_square(
                        gap(dx) * self.height[0] * gap(dx) * self.height[0],
                        gap(dy) * self.height[1] * gap(dy) * self.height[1],
                    );
                    // Rows that touch have cells apart along z alone.
                    let apart = dx.abs() > 1 || dy.abs() > 1;
                    let walk = RowWalk { length, gap, reach, apart, roots, context };
                    self.link_rows(row, other, [tx, ty], &walk, &mut links);
                }
            }
            // What a stop cut short is no list of links.
            context.check()?;
            context.advance(part.len() as u64);
            Ok(links)
        })
    }

    /// The least square of a distance whose parts across two pairs of faces have these: they are at right angles in an
    /// upright box alone.
    fn least_square(&self, a: f64, b: f64) -> f64 {
        if self.domain.tilt.is_none() { a + b } else { a.max(b) }
    }

    /// The rows of the plane dx away, and the turns that bring its particles beside this row's.
    fn plane_beside(&self, row: usize, dx: i64) -> Option<(Range<usize>, f64)> {
        let (x, turns) = self.wrapped(0, self.rows[row].0[0] + dx)?;
        let plane = self.planes[..self.planes.len() - 1].binary_search_by_key(&x, |p| p.0).ok()?;
        Some((self.planes[plane].1 as usize..self.planes[plane + 1].1 as usize, turns))
    }

    /// The row of a plane at y, and the turns that bring it there; the search begins at `near`.
    fn row_beside(&self, y: i64, plane: &Range<usize>, near: &mut usize) -> Option<(usize, f64)> {
        let (y, turns) = self.wrapped(1, y)?;
        let at = |i: usize| self.rows[i].0[1];
        if *near > plane.start && at(*near - 1) >= y || *near < plane.end && at(*near) < y {
            *near = plane.start + self.rows[plane.clone()].partition_point(|r| r.0[1] < y);
        }
        let row = (*near < plane.end && at(*near) == y).then_some((*near, turns));
        *near += usize::from(row.is_some());
        row
    }

    fn wrapped(&self, axis: usize, i: i64) -> Option<(i64, f64)> {
        let n = self.cells[axis];
        if (0..n).contains(&i) {
            return Some((i, 0.0));
        }
        self.domain.periodic[axis].then(|| (i.rem_euclid(n), i.div_euclid(n) as f64))
    }

    /// Walks two rows side by side and joins cells that a link reaches along z.
    fn link_rows(&self, a: usize, b: usize, turns: [f64; 2], walk: &RowWalk<'_>, links: &mut Vec<(u32, u32)>) {
        let most = self.most[2];
        let runs_of = |row: usize| self.rows[row].1 as usize..self.rows[row + 1].1 as usize;
        let (runs, other_runs) = (runs_of(a), runs_of(b));
        for image in [-1i64, 0, 1] {
            let turn = if image == 0 { 0 } else { image * self.cells[2] };
            let beside = |run: usize, turn: i64, reference: usize| {
                (self.runs[run].z + turn - self.runs[reference].z).abs() <= most
            };
            // Other images of the box matter at its seam alone.
            let seam = match image {
                -1 => self.domain.periodic[2] && beside(other_runs.end - 1, turn, runs.start),
                0 => true,
                _ => self.domain.periodic[2] && beside(other_runs.start, turn, runs.end - 1),
            };
            if !seam {
                continue;
            }
            let shift = self.domain.turned([turns[0], turns[1], image as f64]);
            let same = a == b && turns == [0.0; 2];
            // Both rows ascend along z: the first cell that a link reaches never lies before that of the cell before.
            let mut low = other_runs.start;
            for i in runs.clone() {
                let cell = self.runs[i];
                while low < other_runs.end && self.runs[low].z + turn < cell.z - most {
                    low += 1;
                }
                for j in (low..other_runs.end).take_while(|j| self.runs[*j].z + turn <= cell.z + most) {
                    // Within one row each pair once, and never a cell with itself.
                    let once = !same || image > 0 || (image == 0 && j > i);
                    let steps = self.runs[j].z + turn - cell.z;
                    let dz = gap(steps) * self.height[2];
                    // The cheap tests come first: looking at particles costs most.
                    if once
                        && (walk.apart || steps.abs() > 1) == (walk.reach == NeighbourCells::Apart)
                        && self.least_square(walk.gap, dz * dz) <= walk.length * walk.length
                        && walk.roots[i] != walk.roots[j]
                        && self.friends(cell, self.runs[j], shift, walk)
                    {
                        links.push((i as u32, j as u32));
                    }
                }
            }
        }
    }

    /// Whether a particle of one cell is within the linking length of one of the other; false after a stop.
    fn friends(&self, a: CellRun, b: CellRun, shift: [f64; 3], walk: &RowWalk<'_>) -> bool {
        let square = walk.length * walk.length;
        let [positions, others] = [a, b].map(|c| &self.position[c.first as usize..c.end as usize]);
        let moved = |x: &[f64; 3]| -> [f64; 3] { each_axis(|k| x[k] - shift[k]) };
        let any = |x: [f64; 3], others: &[[f64; 3]]| others.iter().any(|y| square_between(&x, y) <= square);
        if positions.len() * others.len() <= MANY {
            return positions.iter().any(|x| any(moved(x), others));
        }
        // Of crowded cells only those that are near the other's crowd: clumps apart are told so at once.
        let moved_positions: Vec<[f64; 3]> = positions.iter().map(moved).collect();
        let near = |points: &[[f64; 3]], crowd: &[[f64; 3]]| -> Vec<[f64; 3]> {
            let mut bounds = Bounds::empty();
            crowd.iter().for_each(|x| bounds.include(*x));
            let nearest = |x: &[f64; 3]| each_axis(|k| x[k].clamp(bounds.min[k], bounds.max[k]));
            points.iter().filter(|x| square_between(x, &nearest(x)) <= square).copied().collect()
        };
        let others = near(others, &moved_positions);
        // Without one there are no bounds to be near to.
        let near_positions = if others.is_empty() { vec![] } else { near(&moved_positions, &others) };
        near_positions.iter().any(|x| !walk.context.cancelled() && any(*x, &others))
    }

    /// Particles of each large set, ascending; sets by size, then by their first particle.
    fn members(&self, sets: &mut DisjointSets, smallest: usize) -> Vec<Vec<u32>> {
        let n = self.runs.len();
        let root = sets.roots();
        let mut size = vec![0usize; n];
        (0..n).for_each(|i| size[root[i] as usize] += (self.runs[i].end - self.runs[i].first) as usize);
        let mut slot = vec![u32::MAX; n];
        let mut members: Vec<Vec<u32>> = Vec::new();
        for i in 0..n {
            let r = root[i] as usize;
            if size[r] < smallest {
                continue;
            }
            if slot[r] == u32::MAX {
                slot[r] = members.len() as u32;
                members.push(Vec::with_capacity(size[r]));
            }
            members[slot[r] as usize]
                .extend_from_slice(&self.index[self.runs[i].first as usize..self.runs[i].end as usize]);
        }
        parallel::for_each(&mut members, |m| m.sort_unstable());
        // Groups of one size are ordered by their first particles, so that their order is always the same.
        members.sort_by(|a, b| b.len().cmp(&a.len()).then(a.first().cmp(&b.first())));
        members
    }
}

/// Cells that positions reach on each axis.
fn occupied(positions: &[[f64; 3]], place: &(impl Fn(&[f64; 3], usize) -> i64 + Sync), cells: &[i64; 3]) -> [i64; 3] {
    // Open axes have any number of cells: those up to the last point.
    [0, 1, 2].map(|k| match cells[k] {
        i64::MAX => {
            let last = |run: &[[f64; 3]]| run.iter().map(|x| place(x, k)).max();
            parallel::map(positions.chunks(RUN), last).into_iter().flatten().max().unwrap_or(0) + 1
        }
        n => n,
    })
}

/// Particles by cell, x slowest, and by number within one.
fn sorted(positions: &[[f64; 3]], cell: &(impl Fn(&[f64; 3]) -> [i64; 3] + Sync), cells: [i64; 3]) -> Vec<u32> {
    let all = cells.iter().try_fold(1u64, |n, c| n.checked_mul(*c as u64));
    if all.is_none_or(|n| n > i64::MAX as u64) {
        // The number of a cell among all does not fit into 64 bits: its three numbers are compared.
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        order.sort_by_cached_key(|i| cell(&positions[*i as usize]));
        return order;
    }
    // Rows that are not more than the particles are counted, and sorted within.
    if let Some(rows) = cells[0].checked_mul(cells[1]).filter(|rows| *rows <= positions.len() as i64) {
        let each = |key_of: fn([i64; 3], i64) -> i64| {
            parallel::map_range(positions.len(), |i| key_of(cell(&positions[i]), cells[1]))
        };
        let (start, mut order) = by_cell(&each(|[x, y, _], row| x * row + y), rows as usize);
        let along = each(|cell, _| cell[2]);
        for ends in start.windows(2) {
            order[ends[0] as usize..ends[1] as usize].sort_by_key(|i| along[*i as usize]);
        }
        return order;
    }
    let key = |i: usize| {
        let [x, y, z] = cell(&positions[i]);
        (((x * cells[1] + y) * cells[2] + z) as u64, i as u32)
    };
    let mut keys = parallel::map_range(positions.len(), key);
    parallel::sort_keys(&mut keys);
    keys.into_iter().map(|k| k.1).collect()
}

fn square_between(x: &[f64; 3], y: &[f64; 3]) -> f64 {
    let d = [y[0] - x[0], y[1] - x[1], y[2] - x[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// The number of the cell at `q` cells from the first: whole numbers as far as f64 tells all of them
/// apart, and beyond that the order of what it does tell apart.
fn cell_number(q: f64) -> i64 {
    const WHOLE: f64 = (1i64 << 55) as f64;
    if q < WHOLE { q as i64 } else { (1 << 55) + 2 * (q.to_bits() - WHOLE.to_bits()) as i64 }
}

/// Cells between two that are `d` apart.
fn gap(d: i64) -> f64 {
    (d.abs() - 1).max(0) as f64
}

/// Disjoint sets: the smaller number is the root, paths are halved.
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn new(n: usize) -> Self {
        DisjointSets((0..n as u32).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let above = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = above;
            i = above;
        }
        i
    }

    /// The root of every member.
    fn roots(&mut self) -> Vec<u32> {
        (0..self.0.len() as u32).map(|i| self.root(i)).collect()
    }

    fn join(&mut self, a: u32, b: u32) {
        // The smaller root stays, so that roots do not depend on the order of links.
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::local_positions;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;
    use particlegs_particles::testing::{gas, on_threads, square_between, tilted_cells};

    /// The plain twin: every pair.
    fn plain(x: &[[f64; 3]], domain: &Domain, length: f64, smallest: usize) -> Vec<Vec<u32>> {
        let mut sets = DisjointSets::new(x.len());
        for i in 0..x.len() {
            for j in 0..i {
                if square_between(domain, x[j], x[i]) <= length * length {
                    sets.join(i as u32, j as u32);
                }
            }
        }
        let mut by_root: Vec<Vec<u32>> = vec![Vec::new(); x.len()];
        (0..x.len() as u32).for_each(|i| by_root[sets.root(i) as usize].push(i));
        by_root.retain(|m| m.len() >= smallest);
        by_root.sort_by(|a, b| b.len().cmp(&a.len()).then(a.first().cmp(&b.first())));
        by_root
    }

    fn clustered(n: usize, length: [f64; 3]) -> Vec<[f64; 3]> {
        (0..n)
            .map(|i| {
                let mut center = Random::new(4, 1, (i % 40) as u64);
                let mut r = Random::new(4, 2, i as u64);
                let spread = if i % 3 == 0 { 1.0 } else { 0.03 };
                length.map(|l| (center.uniform() * l + spread * r.normal()).rem_euclid(l))
            })
            .collect()
    }

    #[test]
    fn groups_are_those_of_all_pairs() {
        for periodic in [[true; 3], [false; 3], [true, false, true]] {
            let length = [2.0, 3.0, 1.5];
            let domain = Domain::upright([0.0; 3], length, periodic);
            let x = clustered(1500, length);
            for link in [0.02, 0.06, 0.11, 0.3] {
                let fast = find_groups(&x, &domain, link, 2, &Context::SILENT).unwrap();
                assert_eq!(fast.members, plain(&x, &domain, link, 2), "{periodic:?} {link}");
            }
        }
    }

    #[test]
    fn groups_in_tilted_boxes_are_those_of_all_pairs() {
        for cell in tilted_cells() {
            let p = gas(400, &cell, 6);
            let domain = Domain::from_particles(&p);
            let x = local_positions(&p, &domain);
            for share in [0.1, 0.3, 1.0] {
                let link = share * longest_link(&domain);
                let fast = find_groups(&x, &domain, link, 2, &Context::SILENT).unwrap();
                assert_eq!(fast.members, plain(&x, &domain, link, 2), "{cell:?} {link}");
            }
        }
    }

    #[test]
    fn a_chain_across_the_seam_is_one_group_and_threads_do_not_matter() {
        let domain = Domain::upright([0.0; 3], [10.0, 1.0, 1.0], [true; 3]);
        let x: Vec<[f64; 3]> = (0..20).map(|i| [(9.0 + 0.1 * i as f64) % 10.0, 0.0, 0.999]).collect();
        let run = |threads| on_threads(threads, || find_groups(&x, &domain, 0.11, 2, &Context::SILENT).unwrap());
        assert_eq!(run(1).members, vec![(0..20).collect::<Vec<u32>>()]);
        assert_eq!(run(1), run(4));
        assert!(find_groups(&x, &domain, 0.09, 2, &Context::SILENT).unwrap().members.is_empty());
    }

    /// Clumps in neighbouring cells, further apart than a link, and outliers beyond what whole numbers of
    /// cells reach.
    #[test]
    fn crowds_and_outliers_are_told_apart() {
        let domain = Domain::upright([0.0; 3], [1e20, 1.0, 1.0], [false; 3]);
        // 1.1e-3: cells that are compared, and no particle of the one near the other's crowd.
        for apart in [1.1e-3, 1.4e-3] {
            let mut x: Vec<[f64; 3]> = (0..4000).map(|i| [0.3 + 1e-6 * f64::from(i % 2), 0.5, 0.5]).collect();
            x.extend((0..4000).map(|i| [0.3 + apart, 0.5 + 1e-6 * f64::from(i % 3), 0.5]));
            x.extend([[1e20; 3], [0.9e20; 3], [1e20; 3]]);
            let members = find_groups(&x, &domain, 1e-3, 2, &Context::SILENT).unwrap().members;
            assert_eq!(members.iter().map(Vec::len).collect::<Vec<_>>(), [4000, 4000, 2]);
            assert_eq!(find_groups(&x, &domain, 1.5e-3, 2, &Context::SILENT).unwrap().members.len(), 2);
        }
    }

    #[test]
    fn absurd_links_are_refused() {
        let domain = Domain::upright([0.0; 3], [1.0; 3], [true; 3]);
        for link in [0.0, -1.0, f64::NAN, 0.5] {
            assert!(matches!(
                find_groups(&[[0.5; 3]], &domain, link, 2, &Context::SILENT).unwrap_err(),
                particlegs_core::Error::Argument { .. }
            ));
        }
        assert!(find_groups(&[], &domain, 0.1, 1, &Context::SILENT).unwrap().members.is_empty());
    }
}

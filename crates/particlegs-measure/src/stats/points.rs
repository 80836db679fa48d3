//! Positions sorted into the cells of a grid, for whatever looks at neighbours.

use super::Domain;
use particlegs_core::math::each_axis;
use particlegs_core::{Result, parallel};
use particlegs_particles::{ChunkBuffer, Particles, RUN};

/// Positions relative to the domain's corner, in [0, length) along axes that repeat, in the order
/// of the particles.
pub fn local_positions(p: &Particles, domain: &Domain) -> Vec<[f64; 3]> {
    let mut all = vec![[0.0; 3]; p.len()];
    parallel::for_each_chunk_with(&mut all, RUN, ChunkBuffer::default, |buffer, run, out| {
        let chunk = p.chunk(run * RUN..run * RUN + out.len(), buffer);
        for (i, x) in out.iter_mut().enumerate() {
            *x = domain.local(each_axis(|k| p.origin[k] + f64::from(chunk.position[k][i])));
        }
    });
    all
}

/// The positions of some particles, in the order of `index`.
pub fn gathered(positions: &[[f64; 3]], index: &[u32]) -> Vec<[f64; 3]> {
    let mut all = vec![[0.0; 3]; index.len()];
    parallel::for_each(all.chunks_mut(RUN).zip(index.chunks(RUN)), |(out, index)| {
        out.iter_mut().zip(index).for_each(|(x, i)| *x = positions[*i as usize]);
    });
    all
}

pub(crate) struct PointGrid {
    pub domain: Domain,
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Lowest corner of the first cell, relative to the domain's, along its edges.
    pub low: [f64; 3],
    /// Edges of a cell.
    pub side: [f64; 3],
    /// Distances between a cell's faces.
    height: [f64; 3],
    /// First point of each cell, x slowest, and the number of points.
    pub start: Vec<u32>,
    /// Positions by cell and, within a cell, in the order of the particles.
    pub position: Vec<[f64; 3]>,
    /// Number of the particle of each.
    pub index: Vec<u32>,
}

/// Bytes of the points of `n` particles.
pub(super) fn points_bytes(n: usize) -> u64 {
    // Two columns of positions, indices, keys, and two of up to four cells a point.
    n as u64 * (24 + 24 + 4 + 8 + 32)
}

/// The first particle of each cell and their number, and the particles by cell and by number within one, from the cell
/// of each.
pub(super) fn by_cell(cell: &[i64], cells: usize) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; cells + 1];
    cell.iter().for_each(|c| start[*c as usize + 1] += 1);
    (1..start.len()).for_each(|i| start[i] += start[i - 1]);
    let (mut next, mut index) = (start.clone(), vec![0; cell.len()]);
    for (i, c) in cell.iter().enumerate() {
        let next = &mut next[*c as usize];
        index[*next as usize] = i as u32;
        *next += 1;
    }
    (start, index)
}

impl PointGrid {
    /// Cells at least `side` long; longer where there would be more than four a point.
    pub fn new(positions: &[[f64; 3]], domain: &Domain, side: f64) -> Result<Self> {
        if positions.len() >= u32::MAX as usize {
            return Err(particlegs_core::Error::argument(
                "neighbours need fewer than 4294967295 particles; use a sample",
            ));
        }
        particlegs_files::memory::require("a grid of neighbours", points_bytes(positions.len()))?;
        let (low, length) = extent(positions, domain);
        // The edge of a cell where there are four a point; roots come first, as the volume may overflow.
        let least = length.map(libm::cbrt).iter().product::<f64>() / libm::cbrt(4.0 * positions.len().max(1) as f64);
        let mut side = side.max(least).max(f64::MIN_POSITIVE);
        let count = |side: f64| length.map(|l| (l / side).floor().max(1.0));
        // An axis thinner than a cell leaves more cells to the others than that bound foresees.
        while count(side).iter().product::<f64>() > 4.0 * positions.len() as f64 + 64.0 {
            side *= 1.25;
        }
        let cells = count(side).map(|c| c as usize);
        let mut p = PointGrid {
            domain: *domain,
            cells,
            low,
            side: each_axis(|k| length[k] / cells[k] as f64),
            height: each_axis(|k| length[k] / cells[k] as f64 / domain.stretch(k)),
            start: Vec::new(),
            position: Vec::new(),
            index: Vec::new(),
        };
        let keys = parallel::map_range(positions.len(), |i| p.key(p.cell_of(positions[i])) as i64);
        (p.start, p.index) = by_cell(&keys, cells.iter().product());
        p.position = gathered(positions, &p.index);
        Ok(p)
    }

    pub fn cell_of(&self, x: [f64; 3]) -> [usize; 3] {
        let place = |k: usize| ((self.domain.along(&x, k) - self.low[k]) / self.side[k]).max(0.0) as usize;
        each_axis(|k| place(k).min(self.cells[k] - 1))
    }

    fn key(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.cells[1] + j) * self.cells[2] + k
    }

    /// The points of cells `k` in row (i, j).
    pub fn row(&self, i: usize, j: usize, k: std::ops::Range<usize>) -> std::ops::Range<usize> {
        let row = self.key([i, j, 0]);
        self.start[row + k.start] as usize..self.start[row + k.end] as usize
    }

    /// Cells of an axis within `reach` world units of cell `i`, each once, and the turns around it that bring
    /// their points beside it.
    pub fn beside(&self, axis: usize, i: usize, reach: f64) -> Vec<(usize, f64)> {
        let n = self.cells[axis] as i64;
        let steps = (reach / self.height[axis]).ceil() as i64;
        let i = i as i64;
        if !self.domain.periodic[axis] {
            // Points that share a coordinate, or nearly, have cells of next to no width.
            let steps = steps.min(n);
            return ((i - steps).max(0)..=(i + steps).min(n - 1)).map(|c| (c as usize, 0.0)).collect();
        }
        // Up to half the axis is reached: a cell seen from both sides is listed for each image.
        (i - steps..=i + steps).map(|c| (c.rem_euclid(n) as usize, c.div_euclid(n) as f64)).collect()
    }

    /// Calls `visit` with the number of each point within `radius` of a place, its offset from there and the square of
    /// its distance. Each image of each point comes once.
    pub fn within(&self, center: [f64; 3], radius: f64, mut visit: impl FnMut(usize, [f64; 3], f64)) {
        self.near(self.cell_of(center), radius, |run, shift| {
            for at in run {
                let offset: [f64; 3] = each_axis(|k| self.position[at][k] + shift[k] - center[k]);
                let square = offset.iter().map(|d| d * d).sum::<f64>();
                if square <= radius * radius {
                    visit(self.index[at] as usize, offset, square);
                }
            }
        });
    }

    /// Calls `visit` with runs of points that may lie within `reach` of one in row (i, j), cell k,
    /// and the shift to add to them. Each image of each point comes once.
    pub fn near(&self, [i, j, k]: [usize; 3], reach: f64, mut visit: impl FnMut(std::ops::Range<usize>, [f64; 3])) {
        let z = self.beside(2, k, reach);
        for (x, tx) in self.beside(0, i, reach) {
            for (y, ty) in self.beside(1, j, reach) {
                // Neighbours along z lie together, up to the seam.
                for together in z.chunk_by(|a, b| a.1 == b.1) {
                    let (first, tz) = together[0];
                    let run = self.row(x, y, first..first + together.len());
                    if !run.is_empty() {
                        visit(run, self.domain.turned([tx, ty, tz]));
                    }
                }
            }
        }
    }
}

/// The domain where the axis repeats, else where the points are, along its edges.
fn extent(positions: &[[f64; 3]], domain: &Domain) -> ([f64; 3], [f64; 3]) {
    let (mut low, mut length) = ([0.0; 3], domain.length);
    for k in (0..3).filter(|k| !domain.periodic[*k]) {
        let ends = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            let along = domain.along(x, k);
            (a.min(along), b.max(along))
        });
        if ends.1 > ends.0 {
            (low[k], length[k]) = (ends.0, ends.1 - ends.0);
        }
    }
    (low, length)
}

/// A place, relative to the domain's corner, and how far from it a counterpart may lie.
pub(crate) type SearchSphere = ([f64; 3], f64);

/// The counterpart of each of `wanted` among `centers`: one after the other takes the nearest that is left, within its
/// radius, and `alike`, which is asked for the numbers of both.
pub(crate) fn counterparts(
    wanted: impl IntoIterator<Item = SearchSphere>,
    centers: &[[f64; 3]],
    domain: &Domain,
    alike: impl Fn(usize, usize) -> bool,
) -> Result<Vec<Option<usize>>> {
    let points = PointGrid::new(centers, domain, 0.0)?;
    let mut is_taken = vec![false; centers.len()];
    let find = |(number, (center, radius)): (usize, SearchSphere)| {
        let mut nearest: Option<(f64, usize)> = None;
        points.within(center, radius, |other, _, square| {
            if nearest.is_none_or(|n| (square, other) < n) && !is_taken[other] && alike(number, other) {
                nearest = Some((square, other));
            }
        });
        nearest.map(|(_, other)| {
            is_taken[other] = true;
            other
        })
    };
    Ok(wanted.into_iter().enumerate().map(find).collect())
}

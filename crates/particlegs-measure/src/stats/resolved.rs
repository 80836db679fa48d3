//! A Gaussian that the grid resolves, or cells of a half, a quarter or an eighth: its density at their centres.
//!
//! A cell's integral smooths by a box of variance 1/12; a Gaussian wider by that is the same to a few
//! parts in ten thousand where its smallest deviation is near a cell or above. Along a row the
//! exponent is a parabola, so that each cell costs two products. Where the grid is too coarse its cells are
//! divided, and what the parts hold is added up.

use super::Grid;
use super::gaussian::{CellQuantity, Slab};
use fearless_simd::{Level, Simd, dispatch};
use particlegs_core::math::{Sym3, each_axis, exp, floor_index};
use std::f64::consts::TAU;
use std::ops::Range;

/// Smallest deviation in cells: sums over cells then keep mass to 1e-6.
const FINEST: f64 = 0.8;
/// Gaussians end here, in deviations; ...
const REACH: f64 = 5.0;
/// ... where this share of their mass is inside.
const INSIDE: f64 = 0.999_984_559_501_709;

/// Cells are divided into at most so many along each axis, as a power of two.
const MOST_HALVINGS: u32 = 3;
/// Parts of cells that a Gaussian may reach: more are for coarser means.
const MOST_PARTS: f64 = 4e6;

/// Parts of a row whose densities are computed side by side.
pub(super) const LANES: usize = 4;

/// A Gaussian in units of cells, or of the parts that they are divided into.
pub(super) struct ResolvedGaussian<Q> {
    /// The grid of the parts.
    fine: Grid,
    /// Parts of a cell along an axis, as a power of two.
    halvings: u32,
    mean: [f64; 3],
    /// Inverse of the covariance with the cells' variance.
    inverse: Sym3,
    /// The exponent's least value along z, of x and y: xx, xy, yy.
    projected: [f64; 3],
    /// The exponent's least value along y and z, a form of x.
    line: f64,
    /// Half its extent along x.
    half: f64,
    peak: f64,
    /// Ratios of neighbours along z have this ratio from one cell to the next.
    step: f64,
    /// The quantity that its mass carries, by distances in parts.
    quantity: Q,
}

impl<Q: CellQuantity> ResolvedGaussian<Q> {
    /// `None` where the smallest parts are too coarse for it, or it is many boxes wide.
    pub fn new(grid: &Grid, mean: [f64; 3], cov: &Sym3, smallest: f64, (mass, quantity): (f64, &Q)) -> Option<Self> {
        let enough = |h: &u32| smallest * f64::from(1u32 << h) >= FINEST * grid.coarsest() * (1.0 - 1e-9);
        let halvings = (0..=MOST_HALVINGS).find(enough)?;
        let parts = f64::from(1u32 << halvings);
        let fine = Grid { side: grid.side.map(|s| s / parts), cells: grid.cells.map(|n| n << halvings), ..*grid };
        let g = &fine;
        let [a, b, c] = g.side.map(f64::recip);
        let v = &cov.0;
        let within = 1.0 / 12.0;
        let wide = Sym3([
            v[0] * a * a + within,
            v[1] * a * b,
            v[2] * a * c,
            v[3] * b * b + within,
            v[4] * b * c,
            v[5] * c * c + within,
        ]);
        let half = [wide.0[0], wide.0[3], wide.0[5]].map(|v| REACH * v.sqrt());
        let mut middle: [f64; 3] = each_axis(|k| (mean[k] - g.min[k]) / g.side[k]);
        for k in 0..3 {
            let n = g.cells[k] as f64;
            if g.periodic[k] {
                middle[k] = middle[k].rem_euclid(n);
            }
            // Wider than the box it is folded many times, which is not for here. Neither is what is no number.
            if !(half[k] <= n * Q::WIDEST && middle[k].abs() < 1e9) {
                return None;
            }
        }
        let (inverse, det) = (wide.inverse()?, wide.det());
        let peak = mass / (INSIDE * TAU * TAU.sqrt() * det.sqrt());
        let [xx, xy, xz, yy, yz, zz] = inverse.0;
        // The parabola's least value along z is a form of x and y, and along y then one of x.
        let projected = [xx - xz * xz / zz, xy - xz * yz / zz, yy - yz * yz / zz];
        let line = projected[0] - projected[1] * projected[1] / projected[2];
        let sound = zz > 0.0 && projected[2] > 0.0 && line > 0.0 && peak.is_finite();
        // The ellipsoid's volume, 4/3 pi times its half-axes.
        let few = halvings == 0 || 4.2 * REACH.powi(3) * det.sqrt() <= MOST_PARTS;
        (sound && few).then_some(ResolvedGaussian {
            fine,
            halvings,
            mean: middle,
            inverse,
            projected,
            line,
            half: half[0],
            peak,
            step: exp(-zz),
            quantity: quantity.widened(&inverse, g.side),
        })
    }

    /// Adds what lies in a slab.
    pub fn add_to(&self, simd: Level, slab: &mut Slab<'_, Q::Sum>) {
        dispatch!(simd, simd => self.add_kernel(simd, slab));
    }

    #[inline(always)]
    fn add_kernel<S: Simd>(&self, _simd: S, slab: &mut Slab<'_, Q::Sum>) {
        let (g, planes, held) = (&self.fine, &slab.planes, &mut *slab.cells);
        let [.., xz, _, yz, zz] = self.inverse.0;
        let [pxx, pxy, pyy] = self.projected;
        let most = REACH * REACH;
        for i in cells(self.mean[0], self.half) {
            let plane = place(g, 0, i).map(|p| p >> self.halvings);
            let Some(plane) = plane.filter(|p| planes.contains(p)) else { continue };
            let dx = i as f64 + 0.5 - self.mean[0];
            // The rest of the exponent that y and z may use up in this plane.
            let left = most - self.line * dx * dx;
            if left <= 0.0 {
                continue;
            }
            let lines = cells(self.mean[1] - pxy / pyy * dx, (left / pyy).sqrt());
            for first in lines.clone().step_by(LANES) {
                let dy: [f64; LANES] = std::array::from_fn(|lane| (first + lane as i64) as f64 + 0.5 - self.mean[1]);
                // The exponent's least value in each row, and where it is.
                let least = dy.map(|dy| pxx * dx * dx + 2.0 * pxy * dx * dy + pyy * dy * dy);
                let middle = dy.map(|dy| self.mean[2] - (xz * dx + yz * dy) / zz);
                let rows = self.rows(least, middle);
                for lane in 0..LANES.min((lines.end - first) as usize) {
                    let Some(line) = place(g, 1, first + lane as i64).filter(|_| least[lane] < REACH * REACH) else {
                        continue;
                    };
                    let row = slab.grid.index([plane - planes.start, line >> self.halvings, 0]);
                    let sums = &mut held[row..row + slab.grid.cells[2]];
                    self.add_row(sums, &rows[lane], [dx, dy[lane]]);
                }
            }
        }
    }

    /// Runs of rows about `middle`, where the exponent is -`least` / 2, side by side.
    #[inline(always)]
    fn rows(&self, least: [f64; LANES], middle: [f64; LANES]) -> [RowParts; LANES] {
        let (zz, count) = (self.inverse.0[5], self.fine.cells[2] as i64);
        let half = least.map(|least| ((REACH * REACH - least).max(0.0) / zz).sqrt());
        let run_of = |lane: usize| {
            let run = cells(middle[lane], half[lane]);
            if self.fine.periodic[2] { run } else { run.start.max(0)..run.end.min(count) }
        };
        let runs: [Range<i64>; LANES] = std::array::from_fn(run_of);
        // Parts of one cell side by side, where cells have so many.
        let aside = |start: i64| if self.has_lanes_of_one_cell() { start.rem_euclid(LANES as i64) } else { 0 };
        let first: [i64; LANES] = std::array::from_fn(|lane| runs[lane].start - aside(runs[lane].start));
        let dz: [f64; LANES] = std::array::from_fn(|lane| first[lane] as f64 + 0.5 - middle[lane]);
        let (mut values, mut ratios) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            values[lane] = self.peak * exp(-0.5 * (least[lane] + zz * dz[lane] * dz[lane]));
            // exp(-zz (dz + 1)^2 / 2) over exp(-zz dz^2 / 2): the step to the next part.
            ratios[lane] = exp(-zz * (dz[lane] + 0.5));
        }
        std::array::from_fn(|lane| RowParts {
            parts: runs[lane].clone(),
            first: first[lane],
            value: values[lane],
            ratio: ratios[lane],
        })
    }

    #[inline(always)]
    fn has_lanes_of_one_cell(&self) -> bool {
        1 << self.halvings >= LANES
    }

    /// One row along z, `dx` and `dy` from the mean.
    #[inline(always)]
    fn add_row(&self, row: &mut [Q::Sum], run: &RowParts, [dx, dy]: [f64; 2]) {
        let (parts, count) = (&run.parts, self.fine.cells[2]);
        if parts.is_empty() {
            return;
        }
        // Chains of products side by side, each with the steps to four parts on.
        let (mut value, mut ratio) = (run.value, run.ratio);
        let (mut values, mut steps) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            (values[lane], steps[lane]) = (value, ratio);
            (value, ratio) = (value * ratio, ratio * self.step);
        }
        let square = self.step * self.step;
        let fourth = square * square;
        steps = steps.map(|r| (r * r) * (r * r) * (square * fourth));
        let further = (fourth * fourth) * (fourth * fourth);
        let mut k = place(&self.fine, 2, run.first).unwrap_or(0);
        for part in (run.first..parts.end).step_by(LANES) {
            let from_mean = [dx, dy, part as f64 + 0.5 - self.mean[2]];
            if self.has_lanes_of_one_cell() {
                let mut masses = values;
                // What lies beyond the reach is left out of the first and the last lanes.
                if part < parts.start || part + LANES as i64 > parts.end {
                    let is_in = |lane: usize| parts.contains(&(part + lane as i64));
                    masses.iter_mut().enumerate().filter(|(lane, _)| !is_in(*lane)).for_each(|(_, mass)| *mass = 0.0);
                }
                self.quantity.add_parts(&mut row[k >> self.halvings], masses, from_mean);
                k = if k + LANES == count { 0 } else { k + LANES };
            } else {
                for (lane, value) in values[..LANES.min((parts.end - part) as usize)].iter().enumerate() {
                    let from_mean = [dx, dy, from_mean[2] + lane as f64];
                    self.quantity.add(&mut row[k >> self.halvings], *value, from_mean);
                    k = if k + 1 == count { 0 } else { k + 1 };
                }
            }
            for lane in 0..LANES {
                (values[lane], steps[lane]) = (values[lane] * steps[lane], steps[lane] * further);
            }
        }
    }
}

/// The parts of a row that a Gaussian reaches.
struct RowParts {
    parts: Range<i64>,
    /// The first part that is computed, which may lie before them.
    first: i64,
    /// The mass there, and the ratio of the next part's to it.
    value: f64,
    ratio: f64,
}

/// Cells whose centres lie within `half` of `middle`.
#[inline(always)]
fn cells(middle: f64, half: f64) -> Range<i64> {
    -floor_index(half + 0.5 - middle)..floor_index(middle + half - 0.5) + 1
}

/// The stored cell, or `None` beyond an open edge.
#[inline(always)]
fn place(g: &Grid, axis: usize, i: i64) -> Option<usize> {
    let n = g.cells[axis] as i64;
    if (0..n).contains(&i) {
        return Some(i as usize);
    }
    g.periodic[axis].then(|| i.rem_euclid(n) as usize)
}

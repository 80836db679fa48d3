//! One Gaussian's mass, and the quantity that goes with it, in the cells of a grid: of the slab that one thread fills.
//!
//! A box integral of a turned Gaussian has no closed form, that of a round one is a product of
//! three error functions. So each Gaussian is split along its principal axes into round ones of
//! its smallest deviation, a lattice whose sum is the Gaussian to a few parts in a thousand. Where the
//! grid resolves the Gaussian, the density at the cells' centres is closer and faster (`resolved`).

use super::Grid;
use super::resolved::{LANES, ResolvedGaussian};
use particlegs_core::context::Level;
use particlegs_core::math::{Eigen, Sym3, each_axis, normal_share};
use std::ops::Range;

/// Lattice step in deviations of the round kernel: aliases are below exp(-2 pi^2 / 1.5^2) = 2e-4.
const STEP: f64 = 1.5;
/// Gaussians end here, in deviations; the rest of their mass is in the last cell.
const TAIL: f64 = 4.5;
/// Kernels are never narrower than this share of a cell: what is smaller is a point to the grid.
const SMALLEST: f64 = 0.1;
/// Nor than this share of the largest deviation: a bound on the lattice, for flat Gaussians.
const FLATTEST: f64 = 1.0 / 16.0;

pub(crate) struct DepositScratch {
    simd: Level,
    /// A deviation that no Gaussian is narrower than, or 0: where the grid resolves it no principal axes are sought.
    narrowest: f64,
    nodes: [Vec<(f64, f64)>; 3],
    shares: [Vec<(usize, f64)>; 3],
}

impl DepositScratch {
    pub fn new(simd: Level, narrowest: f64) -> Self {
        DepositScratch { simd, narrowest, nodes: Default::default(), shares: Default::default() }
    }

    pub fn add(&mut self, slab: &mut Slab<'_>, mean: [f64; 3], cov: &Sym3, mass: f64) {
        self.add_quantity(slab, mean, cov, (mass, &()));
    }

    /// Adds a Gaussian's mass and the quantity that it carries.
    pub fn add_quantity<Q: CellQuantity>(
        &mut self,
        slab: &mut Slab<'_, Q::Sum>,
        mean: [f64; 3],
        cov: &Sym3,
        (mass, quantity): (f64, &Q),
    ) {
        let g = slab.grid;
        if self.narrowest > 0.0
            && let Some(resolved) = ResolvedGaussian::new(g, mean, cov, self.narrowest, (mass, quantity))
        {
            return resolved.add_to(self.simd, slab);
        }
        let cell = g.side[0].min(g.side[1]).min(g.side[2]);
        let diagonal = [cov.0[0], cov.0[3], cov.0[5]].map(|v| v.max(0.0).sqrt());
        if diagonal.iter().all(|s| *s <= SMALLEST * cell) {
            return self.add_straight(slab, mean, diagonal, (mass, quantity));
        }
        let eigen = cov.eigen();
        let deviation = eigen.values.map(|v| v.max(0.0).sqrt());
        // What is thinner than the kernel is made as thick: the lattice of kernels must not be endless.
        let kernel = deviation[2].max(SMALLEST * cell).max(FLATTEST * deviation[0]);
        let thick = eigen.values.map(|v| v.max(kernel * kernel));
        let cov = if deviation[2] < kernel { &Sym3::from_eigen(&Eigen { values: thick, ..eigen }) } else { cov };
        if let Some(resolved) = ResolvedGaussian::new(g, mean, cov, kernel, (mass, quantity)) {
            return resolved.add_to(self.simd, slab);
        }
        for k in 0..3 {
            nodes(&mut self.nodes[k], deviation[k] * deviation[k] - kernel * kernel, kernel);
        }
        // Taken out, because `add_straight` borrows the whole scratch.
        let nodes = std::mem::take(&mut self.nodes);
        let v = &eigen.vectors;
        let inverse = cov.inverse().unwrap_or_default();
        let quantity = quantity.widened(&inverse, [1.0; 3]);
        for &(a, wa) in &nodes[0] {
            for &(b, wb) in &nodes[1] {
                for &(c, wc) in &nodes[2] {
                    let from_mean: [f64; 3] = each_axis(|k| a * v[0][k] + b * v[1][k] + c * v[2][k]);
                    let at = each_axis(|k| mean[k] + a * v[0][k] + b * v[1][k] + c * v[2][k]);
                    let part = quantity.part(from_mean, kernel);
                    self.add_straight(slab, at, [kernel; 3], (mass * wa * wb * wc, &part));
                }
            }
        }
        self.nodes = nodes;
    }

    /// Adds a Gaussian whose axes are the grid's: exact, but the quantity that it carries is the same all over it.
    fn add_straight<Q: CellQuantity>(
        &mut self,
        slab: &mut Slab<'_, Q::Sum>,
        mean: [f64; 3],
        deviation: [f64; 3],
        (mass, quantity): (f64, &Q),
    ) {
        let (g, planes, cells) = (slab.grid, &slab.planes, &mut *slab.cells);
        if !touches(g, planes, mean[0], deviation[0]) {
            return;
        }
        shares(&mut self.shares[0], g, 0, mean[0], deviation[0]);
        self.shares[0].retain(|(i, _)| planes.contains(i));
        if self.shares[0].is_empty() {
            return;
        }
        for k in 1..3 {
            shares(&mut self.shares[k], g, k, mean[k], deviation[k]);
        }
        let [x, y, z] = &self.shares;
        for &(i, wi) in x {
            for &(j, wj) in y {
                let row = g.index([i - planes.start, j, 0]);
                for &(k, wk) in z {
                    quantity.add(&mut cells[row + k], mass * wi * wj * wk, [0.0; 3]);
                }
            }
        }
    }
}

/// Some planes of a grid across x, and the sums in their cells.
pub struct Slab<'a, S = f64> {
    pub(crate) grid: &'a Grid,
    /// Numbers of its planes.
    pub(crate) planes: Range<usize>,
    /// The cells of those planes alone.
    pub(crate) cells: &'a mut [S],
}

impl<'a, S> Slab<'a, S> {
    pub(crate) fn whole(grid: &'a Grid, cells: &'a mut [S]) -> Self {
        Slab { grid, planes: 0..grid.cells[0], cells }
    }

    /// False where a Gaussian has nothing in the slab, by a generous bound.
    pub(crate) fn may_hold(&self, mean: [f64; 3], cov: &Sym3) -> bool {
        let (g, planes) = (self.grid, &self.planes);
        // The lattice ends 3.5 deviations and a step from the mean along each principal axis, its
        // kernel TAIL further; a kernel is at most the deviation along x or one of the two floors.
        let kernel = cov.0[0].max(0.0).sqrt() + SMALLEST * g.side[0] + FLATTEST * cov.trace().max(0.0).sqrt();
        let reach = (7.0 * cov.0[0].max(0.0).sqrt() + 7.5 * kernel) / g.side[0] + 1.0;
        let (n, x) = (g.cells[0] as f64, (mean[0] - g.min[0]) / g.side[0]);
        let (low, high) = (planes.start as f64 - reach, planes.end as f64 + reach);
        if !g.periodic[0] {
            return x >= low && x <= high;
        }
        high - low >= n || (x - low).rem_euclid(n) <= high - low
    }
}

/// A quantity that goes with the mass of a Gaussian into cells: nothing, or a field.
pub(crate) trait CellQuantity {
    /// The sum in a cell.
    type Sum: Copy + Default + Send;
    /// Boxes that half a resolved Gaussian may fill along an axis.
    const WIDEST: f64;
    /// As it is where the Gaussian's covariance is widened to one of this inverse, which counts lengths in `side`.
    fn widened(&self, inverse: &Sym3, side: [f64; 3]) -> Self;
    /// As a round part of the Gaussian has it, `from_mean` from the mean and of this deviation.
    fn part(&self, from_mean: [f64; 3], deviation: f64) -> Self;
    fn add(&self, sum: &mut Self::Sum, mass: f64, from_mean: [f64; 3]);

    /// Adds parts of one cell, one behind the other along z, the first of them `from_mean` from the mean.
    #[inline(always)]
    fn add_parts(&self, sum: &mut Self::Sum, masses: [f64; LANES], [x, y, z]: [f64; 3]) {
        masses.iter().enumerate().for_each(|(lane, mass)| self.add(sum, *mass, [x, y, z + lane as f64]));
    }
}

impl CellQuantity for () {
    type Sum = f64;
    const WIDEST: f64 = 1.0;

    fn widened(&self, _: &Sym3, _: [f64; 3]) {}

    fn part(&self, _: [f64; 3], _: f64) {}

    #[inline(always)]
    fn add(&self, sum: &mut f64, mass: f64, _: [f64; 3]) {
        *sum += mass;
    }

    #[inline(always)]
    fn add_parts(&self, sum: &mut f64, [a, b, c, d]: [f64; LANES], _: [f64; 3]) {
        *sum += (a + b) + (c + d);
    }
}

/// Whether any of the cells that [`shares`] gives along x is among the planes.
fn touches(g: &Grid, planes: &Range<usize>, mean: f64, deviation: f64) -> bool {
    let n = g.cells[0] as i64;
    let (x, reach) = ((mean - g.min[0]) / g.side[0], TAIL * deviation / g.side[0]);
    let (first, last) = ((x - reach).floor(), (x + reach).floor());
    let (start, end) = (planes.start as i64, planes.end as i64);
    // Far away, or wider than the box: not for the arithmetic below.
    if end - start == n || first.is_nan() || first.abs().max(last.abs()) > 1e15 || last - first >= (n - 1) as f64 {
        return true;
    }
    // A cell more on either side: `shares` wraps the mean first, which rounds.
    let (first, last) = (first as i64 - 1, last as i64 + 1);
    if !g.periodic[0] {
        return first < end && last >= start;
    }
    (start - first).rem_euclid(n) <= last - first || (first - start).rem_euclid(n) < end - start
}

/// Offsets and weights of kernels of deviation `kernel` whose sum has `variance` more.
fn nodes(out: &mut Vec<(f64, f64)>, variance: f64, kernel: f64) {
    out.clear();
    if variance <= 1e-9 * kernel * kernel {
        out.push((0.0, 1.0));
    } else if variance < 0.9 * kernel * kernel {
        // Three points of Gauss and Hermite: exact to the fifth moment, and closer than the lattice.
        let d = (3.0 * variance).sqrt();
        out.extend([(-d, 1.0 / 6.0), (0.0, 2.0 / 3.0), (d, 1.0 / 6.0)]);
    } else {
        let step = STEP * kernel;
        let reach = (3.5 * variance.sqrt() / step).ceil() as i64;
        out.extend((-reach..=reach).map(|j| {
            let x = j as f64 * step;
            (x, libm::exp(-0.5 * x * x / variance))
        }));
        let sum: f64 = out.iter().map(|n| n.1).sum();
        out.iter_mut().for_each(|n| n.1 /= sum);
    }
}

/// Cells along axis `k` and a one-dimensional Gaussian's share in each, folded where the axis
/// repeats and cut where it does not.
pub(super) fn shares(out: &mut Vec<(usize, f64)>, g: &Grid, k: usize, mean: f64, deviation: f64) {
    out.clear();
    let (n, side) = (g.cells[k] as i64, g.side[k]);
    let (mut x, s) = ((mean - g.min[k]) / side, deviation / side);
    if g.periodic[k] {
        x = x.rem_euclid(n as f64);
    }
    let (mut first, mut last) = ((x - TAIL * s).floor() as i64, (x + TAIL * s).floor() as i64);
    if !g.periodic[k] {
        // One cell beyond each open edge takes in what the grid loses there.
        (first, last) = (first.max(-1), last.min(n));
    }
    // Wider than this the box is uniform to the model; a bound on the work of absurd files.
    let widest = 64 * n;
    if last.saturating_sub(first) > widest {
        out.extend((0..g.cells[k]).map(|i| (i, 1.0 / n as f64)));
        return;
    }
    let fold = last - first >= n && g.periodic[k];
    if fold {
        out.extend((0..g.cells[k]).map(|i| (i, 0.0)));
    }
    let mut below = 0.0;
    for i in first..=last {
        // The last cell takes the rest of the tail, unless an open edge cuts that off.
        let up_to = if i == last && (g.periodic[k] || last < n) { 1.0 } else { normal_share((i + 1) as f64 - x, s) };
        let share = up_to - below;
        below = up_to;
        if fold {
            out[i.rem_euclid(n) as usize].1 += share;
        } else if g.periodic[k] {
            out.push((i.rem_euclid(n) as usize, share));
        } else if (0..n).contains(&i) {
            out.push((i as usize, share));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_particles::Domain;

    fn grid(periodic: bool) -> Grid {
        Grid::new(&Domain::upright([0.0; 3], [12.0; 3], [periodic; 3]), 12)
    }

    fn deposit(g: &Grid, mean: [f64; 3], cov: &Sym3) -> Vec<f64> {
        let mut out = vec![0.0; g.cells.iter().product()];
        DepositScratch::new(Level::new(), 0.0).add(&mut Slab::whole(g, &mut out), mean, cov, 1.0);
        out
    }

    /// The plain twin: a midpoint sum over 8 x 8 x 8 points a cell.
    fn plain(g: &Grid, mean: [f64; 3], cov: &Sym3) -> Vec<f64> {
        const FINE: usize = 8;
        let inverse = cov.inverse().unwrap();
        let scale = (2.0 * std::f64::consts::PI).powf(-1.5) / cov.det().sqrt() / (FINE * FINE * FINE) as f64;
        let mut out = vec![0.0; g.cells.iter().product()];
        let n = 12 * FINE;
        for i in 0..n * n * n {
            let at = [i / (n * n), i / n % n, i % n];
            let d = each_axis(|k| (at[k] as f64 + 0.5) / FINE as f64 - mean[k]);
            let q = inverse.quadratic(d);
            if q < 30.0 {
                out[g.index(at.map(|v| v / FINE))] += scale * (-0.5 * q).exp();
            }
        }
        out
    }

    fn turned(deviations: [f64; 3]) -> Sym3 {
        let (a, b) = (0.6f64.sin_cos(), 0.9f64.sin_cos());
        let vectors = [[a.1, a.0, 0.0], [-a.0 * b.1, a.1 * b.1, b.0], [a.0 * b.0, -a.1 * b.0, b.1]];
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| deviations[j].total_cmp(&deviations[i]));
        let values = order.map(|k| deviations[k] * deviations[k]);
        Sym3::from_eigen(&particlegs_core::math::Eigen { values, vectors: order.map(|k| vectors[k]) })
    }

    #[test]
    fn turned_gaussians_fill_cells_as_the_plain_twin_says() {
        let g = grid(false);
        for deviations in
            [[1.0, 1.0, 1.0], [1.4, 1.1, 0.81], [1.2, 0.7, 0.3], [1.0, 0.3, 0.35], [0.9, 0.85, 0.8], [1.1, 0.9, 0.25]]
        {
            let (mean, cov) = ([6.1, 5.7, 6.4], turned(deviations));
            let (fast, plain) = (deposit(&g, mean, &cov), plain(&g, mean, &cov));
            let error: f64 = fast.iter().zip(&plain).map(|(a, b)| (a - b).abs()).sum();
            let worst = fast.iter().zip(&plain).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 0.01 && worst < 0.002, "{deviations:?}: {error} in all, {worst} in a cell");
        }
    }

    #[test]
    fn planes_apart_are_the_whole() {
        for periodic in [false, true] {
            let g = grid(periodic);
            for (mean, s) in
                [([0.3, 6.0, 6.0], 0.2), ([11.0, 3.0, 6.0], 1.5), ([5.0, 5.0, 5.0], 4.0), ([3.0; 3], 0.001)]
            {
                let cov = turned([s, 0.5 * s, 0.02 * s]);
                let whole = deposit(&g, mean, &cov);
                for number in 0..4 {
                    let planes = 3 * number..3 * number + 3;
                    let mut part = vec![0.0; 3 * 144];
                    let mut slab = Slab { grid: &g, planes, cells: &mut part };
                    if slab.may_hold(mean, &cov) {
                        DepositScratch::new(Level::new(), 0.0).add(&mut slab, mean, &cov, 1.0);
                    }
                    assert_eq!(part, whole[432 * number..432 * (number + 1)]);
                }
            }
        }
    }

    #[test]
    fn boxes_keep_all_mass_and_wrap() {
        let g = grid(true);
        for (s, far) in
            [(0.0, 0.0), (0.05, 12.0), (0.4, -24.0), (1.7, 0.0), (3.0, 0.0), (90.0, 0.0), (500.0, 0.0), (1e30, 1e30)]
        {
            let out = deposit(&g, [0.1 + far, 11.9, 6.0], &turned([s, 0.5 * s, 0.5 * s]));
            assert!((out.iter().sum::<f64>() - 1.0).abs() < 1e-5, "{s}: {}", out.iter().sum::<f64>());
            assert!(out.iter().all(|v| *v >= -1e-7 && v.is_finite()));
        }
        let (at_corner, in_middle) =
            (deposit(&g, [0.0; 3], &turned([1.0, 0.5, 0.4])), deposit(&g, [6.0; 3], &turned([1.0, 0.5, 0.4])));
        let moved = |i: usize| (i + 6) % 12;
        for i in 0..1728 {
            let at = [i / 144, i / 12 % 12, i % 12];
            assert!((at_corner[i] - in_middle[g.index(at.map(moved))]).abs() < 1e-6);
        }
    }

    #[test]
    fn open_grids_hold_what_is_inside() {
        let g = grid(false);
        let half: f64 = deposit(&g, [0.0, 6.0, 6.0], &Sym3::scaled_identity(0.25)).iter().sum();
        assert!((half - 0.5).abs() < 1e-3, "{half}");
        for s in [0.0, 0.5, 1e200] {
            assert_eq!(deposit(&g, [1e30, 6.0, 6.0], &Sym3::scaled_identity(s)).iter().sum::<f64>(), 0.0, "{s}");
        }
    }
}

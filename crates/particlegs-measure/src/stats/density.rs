//! How two densities on one grid agree, how they are distributed, and what a slice of them shows.

use super::Field;
use particlegs_core::parallel;

/// Cells in one step of a sum; fixed, so that sums do not depend on threads.
const STEP: usize = 1 << 16;

/// Agreement of two densities, cell by cell, each in units of its own mean: delta = rho / mean - 1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DensityComparison {
    /// Pearson correlation over the cells; 1 for two densities without variation.
    pub correlation: f64,
    /// Mean absolute difference of delta.
    pub mean_absolute_error: f64,
    /// Root of the mean squared difference of delta.
    pub root_mean_square_error: f64,
    /// Correlation of ln(1 + delta) over cells where both are above zero; `None` without such.
    pub correlation_of_logarithm: Option<f64>,
    /// Cells that the correlation of logarithms leaves out.
    pub cells_without_logarithm: u64,
    /// Variance of delta, of the first and of the second.
    pub variance: [f64; 2],
}

/// Distribution of 1 + delta over cells, volume-weighted.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DensityPdf {
    /// log10(1 + delta) at the bins' edges, one more than bins.
    pub edges: Vec<f64>,
    /// Cells in each bin, one column a density.
    pub cells: [Vec<u64>; 2],
    /// Cells without mass.
    pub empty: [u64; 2],
    /// Cells that hold mass below the first edge.
    pub below: [u64; 2],
    /// Cells above the last edge.
    pub above: [u64; 2],
}

fn sums<const N: usize>(n: usize, term: impl Fn(usize) -> [f64; N] + Sync) -> [f64; N] {
    let parts = parallel::map_range(n.div_ceil(STEP), |s| {
        let mut sum = [0.0; N];
        for i in s * STEP..n.min((s + 1) * STEP) {
            let t = term(i);
            (0..N).for_each(|k| sum[k] += t[k]);
        }
        sum
    });
    let mut all = [0.0; N];
    parts.iter().for_each(|p| (0..N).for_each(|k| all[k] += p[k]));
    all
}

/// Mean mass of a cell.
pub(super) fn mean_mass(f: &Field) -> f64 {
    sums(f.mass.len(), |i| [f64::from(f.mass[i])])[0] / f.mass.len() as f64
}

fn correlation(aa: f64, bb: f64, ab: f64) -> f64 {
    if aa > 0.0 && bb > 0.0 { (ab / (aa.sqrt() * bb.sqrt())).clamp(-1.0, 1.0) } else { f64::from(u8::from(aa == bb)) }
}

/// 1 / mean, or 0 where there is no mass.
fn per_mean(f: &Field) -> f64 {
    let mean = mean_mass(f);
    if mean > 0.0 { 1.0 / mean } else { 0.0 }
}

/// Compares two fields on one grid.
pub fn compare_density(a: &Field, b: &Field) -> DensityComparison {
    assert_eq!(a.mass.len(), b.mass.len(), "fields on one grid");
    let (n, pa, pb) = (a.mass.len(), per_mean(a), per_mean(b));
    let at = |i: usize| (f64::from(a.mass[i]) * pa, f64::from(b.mass[i]) * pb);
    let [abs, square, aa, bb, ab] = sums(n, |i| {
        let (x, y) = at(i);
        let (d, e) = (x - 1.0, y - 1.0);
        [(x - y).abs(), (x - y) * (x - y), d * d, e * e, d * e]
    });
    let logs = |i: usize| {
        let (x, y) = at(i);
        (x > 0.0 && y > 0.0).then(|| (x.ln(), y.ln()))
    };
    let [m, sx, sy] = sums(n, |i| logs(i).map_or([0.0; 3], |(x, y)| [1.0, x, y]));
    let (mx, my) = (sx / m.max(1.0), sy / m.max(1.0));
    let [xx, yy, xy] =
        sums(n, |i| logs(i).map_or([0.0; 3], |(x, y)| [(x - mx) * (x - mx), (y - my) * (y - my), (x - mx) * (y - my)]));
    let cells = n as f64;
    DensityComparison {
        correlation: correlation(aa, bb, ab),
        mean_absolute_error: abs / cells,
        root_mean_square_error: (square / cells).sqrt(),
        correlation_of_logarithm: (m > 0.0).then(|| correlation(xx, yy, xy)),
        cells_without_logarithm: n as u64 - m as u64,
        variance: [aa / cells, bb / cells],
    }
}

/// Distribution of both over bins of 0.1 in log10(1 + delta), from -3 to the highest of both.
pub fn density_pdf(a: &Field, b: &Field) -> DensityPdf {
    const LOW: f64 = -3.0;
    const WIDTH: f64 = 0.1;
    let per = [per_mean(a), per_mean(b)];
    let highest =
        [a, b].iter().zip(per).map(|(f, p)| f.mass.iter().copied().fold(0.0, f32::max) as f64 * p).fold(1.0, f64::max);
    let bins = ((highest.log10() - LOW) / WIDTH).floor() as usize + 1;
    let count = |f: &Field, per: f64| {
        let parts = parallel::map(f.mass.chunks(STEP), |run| {
            let (mut cells, mut rest) = (vec![0u64; bins], [0u64; 3]);
            for v in run {
                let x = f64::from(*v) * per;
                let at = (x.log10() - LOW) / WIDTH;
                if x <= 0.0 {
                    rest[0] += 1;
                } else if at < 0.0 {
                    rest[1] += 1;
                } else if at as usize >= bins {
                    rest[2] += 1;
                } else {
                    cells[at as usize] += 1;
                }
            }
            (cells, rest)
        });
        let (mut cells, mut rest) = (vec![0u64; bins], [0u64; 3]);
        for (c, r) in parts {
            cells.iter_mut().zip(c).for_each(|(s, v)| *s += v);
            rest.iter_mut().zip(r).for_each(|(s, v)| *s += v);
        }
        (cells, rest)
    };
    let ((ca, ra), (cb, rb)) = (count(a, per[0]), count(b, per[1]));
    DensityPdf {
        edges: (0..=bins).map(|i| LOW + WIDTH * i as f64).collect(),
        cells: [ca, cb],
        empty: [ra[0], rb[0]],
        below: [ra[1], rb[1]],
        above: [ra[2], rb[2]],
    }
}

/// 1 + delta in the plane of cells through the middle across `axis`, the first of the two others slowest.
pub fn central_slice(f: &Field, axis: usize) -> Vec<f32> {
    let (n, per) = (f.grid.cells, per_mean(f));
    let (u, v) = ([1, 0, 0][axis], [2, 2, 1][axis]);
    let plane = n[axis] / 2;
    let mut values = Vec::with_capacity(n[u] * n[v]);
    for i in 0..n[u] {
        for j in 0..n[v] {
            let mut at = [plane; 3];
            (at[u], at[v]) = (i, j);
            values.push((f64::from(f.mass[f.grid.index(at)]) * per) as f32);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Grid;
    use particlegs_particles::Domain;

    fn field(mass: Vec<f32>) -> Field {
        let domain = Domain::upright([0.0; 3], [1.0, 1.0, mass.len() as f64], [true; 3]);
        Field { grid: Grid::stretched(&domain, [1, 1, mass.len()]), mass, outside: 0.0 }
    }

    #[test]
    fn known_fields_agree_as_they_should() {
        let c = compare_density(&field(vec![1.0, 2.0, 3.0]), &field(vec![2.0, 4.0, 6.0]));
        assert!((c.correlation - 1.0).abs() < 1e-12 && c.mean_absolute_error < 1e-12);
        assert!((c.correlation_of_logarithm.unwrap() - 1.0).abs() < 1e-12);
        assert!((c.variance[0] - 1.0 / 6.0).abs() < 1e-12);
        let c = compare_density(&field(vec![0.0, 2.0]), &field(vec![2.0, 0.0]));
        assert!((c.correlation + 1.0).abs() < 1e-12);
        assert_eq!((c.mean_absolute_error, c.root_mean_square_error), (2.0, 2.0));
        assert_eq!((c.correlation_of_logarithm, c.cells_without_logarithm), (None, 2));
        assert_eq!(compare_density(&field(vec![1.0, 1.0]), &field(vec![3.0, 3.0])).correlation, 1.0);
    }

    #[test]
    fn every_cell_is_in_the_distribution() {
        let (a, b) = (field(vec![0.0, 1e-5, 0.5, 3.499_99]), field(vec![1.0; 4]));
        let p = density_pdf(&a, &b);
        assert_eq!((p.empty, p.below, p.above), ([1, 0], [1, 0], [0, 0]));
        assert_eq!(p.cells[0].iter().sum::<u64>(), 2);
        assert_eq!(p.cells[1].iter().sum::<u64>(), 4);
    }

    #[test]
    fn slices_follow_the_axes() {
        let domain = Domain::upright([0.0; 3], [2.0, 3.0, 4.0], [true; 3]);
        let grid = Grid::stretched(&domain, [2, 3, 4]);
        let f = Field { grid, mass: (0..24).map(|i| i as f32).collect(), outside: 0.0 };
        let mean = 11.5;
        let s = central_slice(&f, 1);
        assert_eq!(s.len(), 2 * 4);
        assert!((f64::from(s[4 + 3]) - f64::from(f.mass[grid.index([1, 1, 3])]) / mean).abs() < 1e-6);
    }
}

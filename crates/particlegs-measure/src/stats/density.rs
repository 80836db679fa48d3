//! Agreement and distribution of two densities on one grid, and slices of them.

use super::comparison_job::ComparisonJob;
use super::deposit::{deposit, deposit_bytes, deposit_steps};
use super::presentation::*;
use super::{Field, Grid, Subject};
use particlegs_core::Result;
use particlegs_core::model::decimals;
use particlegs_core::parallel;
use particlegs_core::picture::Colormap;
use particlegs_figure::{ColourBar, Figure, Panel};

/// Cells along each edge for densities of the published table.
pub(crate) const PAPER_CELLS: usize = 256;

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
        (x > 0.0 && y > 0.0).then(|| (libm::log(x), libm::log(y)))
    };
    // The means come first: squares about them keep their digits.
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
    // The mean itself is above the first edge, so that empty fields have bins as well.
    let highest =
        [a, b].iter().zip(per).map(|(f, p)| f.mass.iter().copied().fold(0.0, f32::max) as f64 * p).fold(1.0, f64::max);
    let bins = ((libm::log10(highest) - LOW) / WIDTH).floor() as usize + 1;
    let count = |f: &Field, per: f64| {
        let parts = parallel::map(f.mass.chunks(STEP), |run| {
            let (mut cells, mut rest) = (vec![0u64; bins], [0u64; 3]);
            for v in run {
                let x = f64::from(*v) * per;
                let at = (libm::log10(x) - LOW) / WIDTH;
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

/// Densities on one grid.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DensityReport {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Edges of a cell, world units.
    pub side: [f64; 3],
    /// Agreement of the two densities, cell by cell.
    pub agreement: DensityComparison,
    /// Mass of other / truth.
    pub mass_ratio: f64,
    /// Share of the mass beyond open edges.
    pub outside: [f64; 2],
    /// Distribution of 1 + delta over the cells.
    pub pdf: DensityPdf,
    /// 1 + delta of both in the central planes of cells across x, y and z, the first of the two other axes slowest.
    #[serde(skip)]
    pub slices: [[Vec<f32>; 2]; 3],
}

impl ComparisonJob<'_> {
    /// Densities of both sides on one grid.
    pub fn density(&self) -> Result<DensityReport> {
        let grid = match self.o.cells {
            n if self.paper() => Grid::stretched(&self.domain, [n.unwrap_or(PAPER_CELLS); 3]),
            Some(n) => Grid::new(&self.domain, n),
            None => Grid::of_eight(&self.domain, self.pair[0].count() as usize),
        };
        particlegs_files::memory::require(
            "two density grids",
            deposit_bytes(&grid, self.most_particles()) + 4 * grid.len() as u64,
        )?;
        self.context.begin("density grids", self.pair.iter().map(|s| deposit_steps(*s, &grid)).sum());
        let field_of = |s: Subject<'_>| deposit(s, &grid, self.o.assignment, 0.0, self.context);
        let (a, b) = (field_of(self.pair[0])?, field_of(self.pair[1])?);
        self.context.end();
        let inside = |f: &Field| mean_mass(f) * f.grid.len() as f64;
        let [(of_a, mass_a), (of_b, mass_b)] = self.pair.map(|s| s.density_of());
        // Masses that one side does not state are those of the other.
        let unit = if of_a == of_b { 1.0 } else { mass_b.unwrap_or(1.0) / mass_a.unwrap_or(1.0) };
        Ok(DensityReport {
            cells: grid.cells,
            side: grid.side,
            agreement: compare_density(&a, &b),
            mass_ratio: (inside(&b) + b.outside) / (inside(&a) + a.outside) / unit,
            outside: [&a, &b].map(|f| f.outside / (inside(f) + f.outside)),
            pdf: density_pdf(&a, &b),
            slices: [0, 1, 2].map(|axis| [central_slice(&a, axis), central_slice(&b, axis)]),
        })
    }
}

/// Shows them.
pub(super) fn show(d: &DensityReport, particles: u64, to: &mut Presentation) {
    let [truth, other] = &d.pdf.cells;
    let bins = d.pdf.edges.windows(2).zip(truth.iter().zip(other));
    to.table(
        "density_pdf.csv",
        "log10_density_low,log10_density_high,cells_truth,cells_other",
        bins.clone().map(|(e, (a, b))| row![e[0], e[1], a, b]),
    );
    let cell_count: f64 = d.cells.iter().map(|n| *n as f64).product();
    let row_of = |(e, (a, b)): (&[f64], (&u64, &u64))| {
        (libm::pow(10f64, 0.5 * (e[0] + e[1])), [*a, *b].map(|n| n as f64 / cell_count))
    };
    let axes = [log("density / mean"), log("share of cells per bin (10 per decade)")];
    to.plot(compared("density_pdf", "Distribution of density", axes, &bins.map(row_of).collect::<Vec<_>>(), 0.0));
    to.slices.extend(["x", "y", "z"].into_iter().zip(0..3).map(|(name, axis)| (name, slices(d, axis))));
    let [x, y, z] = d.cells;
    let each = particles as f64 / (x * y * z) as f64;
    let DensityComparison { correlation, mean_absolute_error, root_mean_square_error, .. } = &d.agreement;
    to.line("density: grid; particles per cell", format!("{x}x{y}x{z}; {}", decimals(each)));
    to.line("density: correlation; MAE of delta", format!("{correlation:.4}; {mean_absolute_error:.4}"));
    to.line("density: RMSE of delta", format!("{root_mean_square_error:.4}"));
}

/// Truth and other side by side, the logarithm of density from a tenth to a thousand times the mean.
fn slices(d: &DensityReport, axis: usize) -> Figure {
    let [columns, rows] = [[1, 2], [0, 2], [0, 1]][axis].map(|k: usize| d.cells[k]);
    // About 480 pixels along the longer side, each cell a square of pixels; the first axis is horizontal.
    let scale = (480 / columns.max(rows).max(1)).max(1);
    let color = |v: f32| Colormap::Inferno.color((libm::log10f(v) + 1.0) / 4.0);
    let panel = |(values, name): (&Vec<f32>, &str)| Panel {
        caption: Some(name.to_string()),
        ..Panel::plain(block_picture(values, [columns, rows], scale, color))
    };
    let bar = ColourBar::logarithmic("density / mean".into(), [0.1, 1000.0], |share| Colormap::Inferno.color(share));
    let panels = d.slices[axis].iter().zip(["truth", "other"]).map(panel).collect();
    Figure { bar: Some(bar), ..Figure::plain(panels, 2) }
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

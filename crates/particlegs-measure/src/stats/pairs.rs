//! xi(r) by pair counts: whole numbers, the same for any threads and instruction set.
//!
//! Every pair of a primary and another particle is put into a bin of its separation. Where all
//! pairs would be too many, primaries are a seeded sample; their partners are always all. The count
//! expected of a uniform distribution is in closed form, so no random catalogue is needed:
//! 4 pi r^2 dr per volume, less what an open box's edges cut off.

use super::comparison_job::ComparisonJob;
use super::points::PointGrid;
use super::presentation::*;
use super::{Domain, XiByTransform};
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Random, each_axis};
use particlegs_core::model::decimals;
use particlegs_core::{Error, Result, parallel};
use serde::{Serialize, Serializer};
use std::f64::consts::PI;

/// xi of the truth below which a ratio of xi says nothing.
const LEAST_XI: f64 = 0.1;
/// Primaries in one step of parallel work.
const STEP: usize = 256;
/// Parts of the square of a distance that are told apart before edges are compared.
const PARTS: usize = 1024;

/// Pair counts of one set of particles.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PairCounts {
    /// Edges of the bins, world units: a pair is in a bin where low <= r < high.
    pub edges: Vec<f64>,
    /// Pairs in each bin, primary and other (a pair of two primaries counts twice).
    pub pairs: Vec<u64>,
    /// Primaries in each bin's band: all particles, or a sample.
    pub primaries: Vec<u64>,
    /// Pairs expected of a uniform distribution.
    pub expected: Vec<f64>,
    /// pairs / expected - 1.
    pub xi: Vec<f64>,
    /// Number of particles.
    pub particles: u64,
}

impl PairCounts {
    /// Some band of separations counts the pairs of a sample only.
    pub(super) fn sampled(&self) -> bool {
        self.primaries.iter().any(|p| *p < self.particles)
    }
}

pub struct PairOptions {
    /// Edges of the bins, ascending.
    pub edges: Vec<f64>,
    /// Largest over smallest separation of a band, but for what one bin spans.
    pub band: f64,
    /// Distances that may be taken, about; above it, primaries are a sample.
    pub budget: u64,
    pub seed: u64,
}

/// Bins of equal ratio, `per_decade` of them.
pub fn logarithmic_edges(low: f64, high: f64, per_decade: usize) -> Vec<f64> {
    let bins = (libm::log10(high / low) * per_decade as f64).round().max(1.0) as usize;
    (0..=bins).map(|i| low * libm::pow(high / low, i as f64 / bins as f64)).collect()
}

/// The mean over directions of the share of a box that a displacement of length `r` keeps inside:
/// 1 for a periodic box, the isotropised set covariance of an open one (valid for r up to its
/// shortest open edge).
fn share_inside(domain: &Domain, r: f64) -> f64 {
    // Means of |x|, |x y| and |x y z| over the unit sphere: 1/2, 2/(3 pi), 1/(4 pi).
    let a: [f64; 3] = each_axis(|k| if domain.periodic[k] { 0.0 } else { r / domain.length[k] });
    1.0 - 0.5 * (a[0] + a[1] + a[2]) + 2.0 / (3.0 * PI) * (a[0] * a[1] + a[1] * a[2] + a[2] * a[0])
        - a[0] * a[1] * a[2] / (4.0 * PI)
}

/// The volume of a shell, weighted with [`share_inside`]: the integrand is a polynomial of degree 5, which
/// three points of Gauss and Legendre take exactly.
fn shell_volume(domain: &Domain, low: f64, high: f64) -> f64 {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let node = (0.6f64).sqrt();
    [(-node, 5.0 / 9.0), (0.0, 8.0 / 9.0), (node, 5.0 / 9.0)]
        .iter()
        .map(|(x, w)| {
            let r = middle + half * x;
            w * half * 4.0 * PI * r * r * share_inside(domain, r)
        })
        .sum()
}

/// The longest separation that can be counted: half of the shortest edge that repeats, or the
/// shortest open one.
pub fn longest_separation(domain: &Domain) -> f64 {
    (0..3).map(|k| domain.length[k] * if domain.periodic[k] { 0.5 } else { 1.0 }).fold(f64::INFINITY, f64::min)
}

/// Counts pairs. Bins are worked in bands of at most a factor of `band` in separation, each with its own
/// grid and, where it must be, its own sample of primaries.
pub fn count_pairs(
    positions: &[[f64; 3]],
    domain: &Domain,
    o: &PairOptions,
    context: &Context<'_>,
) -> Result<PairCounts> {
    let (edges, bins) = (&o.edges, o.edges.len().saturating_sub(1));
    let ascending = edges.windows(2).all(|e| e[0] < e[1]) && edges.first().is_some_and(|e| *e >= 0.0);
    if bins == 0 || !ascending || edges[bins] > longest_separation(domain) * (1.0 + 1e-9) {
        return Err(Error::argument(format!(
            "separations must be in ascending order, from 0 or more to at most {:.6}",
            longest_separation(domain)
        )));
    }
    let n = positions.len() as u64;
    let mut counts = PairCounts {
        edges: edges.clone(),
        pairs: vec![0; bins],
        primaries: vec![0; bins],
        expected: vec![0.0; bins],
        xi: vec![0.0; bins],
        particles: n,
    };
    let mut first = 0;
    while first < bins {
        // The first edge may be 0, so a band is measured from the end of its first bin.
        let last =
            (first + 1..=bins).take_while(|b| edges[*b] <= o.band * edges[first + 1]).last().unwrap_or(first + 1);
        let band = &edges[first..=last];
        let points = PointGrid::new(positions, domain, 0.5 * band[band.len() - 1])?;
        context.check()?;
        let primaries = choose(&points, band[band.len() - 1], o, first as u64);
        let pairs = count_band(&points, &primaries, band, context)?;
        for b in first..last {
            counts.pairs[b] = pairs[b - first];
            counts.primaries[b] = primaries.len() as u64;
            // A primary makes pairs with all particles but itself.
            let density = n.saturating_sub(1) as f64 / domain.volume();
            counts.expected[b] = primaries.len() as f64 * density * shell_volume(domain, edges[b], edges[b + 1]);
            counts.xi[b] =
                if counts.expected[b] > 0.0 { pairs[b - first] as f64 / counts.expected[b] - 1.0 } else { 0.0 };
        }
        first = last;
    }
    Ok(counts)
}

/// The primaries of a band, as places in the sorted points: all, or as many as the budget allows.
fn choose(points: &PointGrid, reach: f64, o: &PairOptions, band: u64) -> Vec<u32> {
    let n = points.position.len();
    // Work of all, from a few thousand of them.
    let probe = n.clamp(1, 4096);
    let work = parallel::map_range(probe.min(n), |i| {
        let at = points.position[(i as u64 * n as u64 / probe as u64) as usize];
        let mut near = 0;
        points.near(points.cell_of(at), reach, |run, _| near += run.len() as u64);
        near
    });
    let work: u64 = work.into_iter().sum();
    let each = work as f64 / probe as f64;
    let most = (o.budget as f64 / each.max(1.0)).max(1000.0);
    if most >= n as f64 {
        return (0..n as u32).collect();
    }
    // Each particle on its own: by its index in the snapshot, so that the sample is of particles.
    let share = most / n as f64;
    let seed = Random::from_purpose(Purpose::PairSample, o.seed, band).bits();
    (0..n as u32).filter(|i| uniform(seed, points.index[*i as usize]) < share).collect()
}

/// A cheap hash of an index under a seed, in [0, 1) (SplitMix64's mixer).
fn uniform(seed: u64, index: u32) -> f64 {
    let mut z = seed.wrapping_add((u64::from(index) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Bins by the square of a distance.
struct DistanceBins {
    squares: Vec<f64>,
    /// Square of the last edge.
    end: f64,
    /// Edges at or below the beginning of each of [`PARTS`] parts of the whole.
    below: Vec<u32>,
    parts_per: f64,
}

impl DistanceBins {
    fn new(edges: &[f64]) -> Self {
        let squares: Vec<f64> = edges.iter().map(|e| e * e).collect();
        let end = squares[squares.len() - 1];
        // A little lower, so that rounding passes over no edge.
        let begins = |part: usize| (part as f64 - 1e-6) * (end / PARTS as f64);
        let below = (0..=PARTS).map(|p| squares.iter().take_while(|s| **s <= begins(p)).count() as u32).collect();
        DistanceBins { squares, end, below, parts_per: PARTS as f64 / end }
    }

    /// 1 + the bin that holds the square of a distance below the last edge; 0 below the first.
    #[inline]
    fn bin(&self, square: f64) -> usize {
        // Squares of the tiniest distances have parts without end.
        let part = ((square * self.parts_per) as usize).min(PARTS);
        let mut bin = if self.parts_per.is_finite() { self.below[part] as usize } else { 0 };
        while square >= self.squares[bin] {
            bin += 1;
        }
        bin
    }
}

fn count_band(points: &PointGrid, primaries: &[u32], edges: &[f64], context: &Context<'_>) -> Result<Vec<u64>> {
    let bins = DistanceBins::new(edges);
    let reach = edges[edges.len() - 1];
    context.begin("pair counts", primaries.len() as u64);
    let parts = parallel::try_map(primaries.chunks(STEP), |run| {
        // One more bin before the first takes what is nearer.
        let mut counts = vec![0u64; edges.len()];
        for &i in run {
            context.check()?;
            let at = points.position[i as usize];
            points.near(points.cell_of(at), reach, |others, shift| {
                let origin: [f64; 3] = each_axis(|k| at[k] - shift[k]);
                for o in &points.position[others] {
                    let d = [o[0] - origin[0], o[1] - origin[1], o[2] - origin[2]];
                    let r = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                    if r < bins.end {
                        counts[bins.bin(r)] += 1;
                    }
                }
            });
            // The primary itself, unless its square of a distance was no less than the last edge's, 0.
            if bins.end > 0.0 {
                counts[bins.bin(0.0)] -= 1;
            }
        }
        context.advance(run.len() as u64);
        Ok(counts)
    })?;
    context.end();
    let mut pairs = vec![0; edges.len() - 1];
    parts.iter().for_each(|p| pairs.iter_mut().zip(&p[1..]).for_each(|(s, v)| *s += v));
    Ok(pairs)
}

impl ComparisonJob<'_> {
    /// Edges of the bins of separation.
    pub fn edges(&self) -> Vec<f64> {
        let longest = longest_separation(&self.domain);
        let [low, high] =
            self.o.separations.unwrap_or([0.05 * self.spacing(0), longest.min(0.125 * self.domain.shortest())]);
        let high = high.min(longest);
        logarithmic_edges(low.min(0.5 * high), high, self.o.bins_per_decade)
    }

    /// Pairs of both sides in the same bins.
    pub fn pairs(&self, positions: [&[[f64; 3]]; 2], notes: &mut Vec<String>) -> Result<[PairCounts; 2]> {
        let options = PairOptions { edges: self.edges(), band: 3.0, budget: self.o.pair_budget, seed: self.o.seed };
        let count = |side: usize| count_pairs(positions[side], &self.domain, &options, self.context);
        let counts = [count(0)?, count(1)?];
        if counts.iter().any(PairCounts::sampled) {
            notes.push("pairs at large separations are counted for a random sample of particles".into());
        }
        Ok(counts)
    }
}

/// xi of other / truth in each bin; `None` where the truth's is not above zero.
pub(super) fn xi_ratio([truth, other]: &[PairCounts; 2]) -> Vec<Option<f64>> {
    truth.xi.iter().zip(&other.xi).map(|(truth, other)| (*truth > 0.0).then(|| other / truth)).collect()
}

pub(super) fn with_xi_ratio<S: Serializer>(
    pair: &Option<[PairCounts; 2]>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct PairCountsForm<'a> {
        counts: &'a [PairCounts; 2],
        ratio: Vec<Option<f64>>,
    }
    pair.as_ref().map(|counts| PairCountsForm { counts, ratio: xi_ratio(counts) }).serialize(serializer)
}

/// The separation from which on xi is within 10 %, where the truth's says something: by pairs where all
/// are counted, by transform where pairs are of a sample, which scatters as much.
pub(super) fn xi_from(pairs: &[PairCounts; 2], transform: Option<&XiByTransform>) -> Option<f64> {
    let (truth, ratio) = (&pairs[0], xi_ratio(pairs));
    let sampled = |b: &usize| pairs.iter().any(|c| c.primaries[*b] < c.particles);
    // The transform's bins are as wide as its shortest wave's half: the first two hold too little.
    let join = match ((0..ratio.len()).find(sampled), transform) {
        (Some(first), Some(t)) => t.edges.get(2).map_or(f64::INFINITY, |e| e.max(truth.edges[first])),
        _ => f64::INFINITY,
    };
    let near = (0..ratio.len()).map(|b| (truth.edges[b], truth.xi[b], ratio[b]));
    let far = transform.into_iter().flat_map(|t| {
        let ratio = |i: usize| (t.xi[0][i] > 0.0).then(|| t.xi[1][i] / t.xi[0][i]);
        (0..t.xi[0].len()).map(move |i| (t.edges[i], t.xi[0][i], ratio(i)))
    });
    let judged = near.filter(|b| b.0 < join).chain(far.filter(|b| b.0 >= join)).filter(|b| b.1 >= LEAST_XI);
    let judged: Vec<(f64, bool)> =
        judged.map(|(r, _, ratio)| (r, ratio.is_some_and(|r| (r - 1.0).abs() <= 0.1))).collect();
    judged.iter().rev().take_while(|b| b.1).last().map(|b| b.0)
}

/// Shows them.
pub(super) fn show(pairs: Option<&[PairCounts; 2]>, transform: Option<&XiByTransform>, to: &mut Presentation) {
    if let Some(pair) = pairs {
        let ([a, b], ratio) = (pair, xi_ratio(pair));
        let row = |i: usize| {
            let edges = row![a.edges[i], a.edges[i + 1], a.pairs[i], b.pairs[i], a.primaries[i], b.primaries[i]];
            row![edges, a.expected[i], b.expected[i], a.xi[i], b.xi[i], maybe(ratio[i])]
        };
        let head = "r_low,r_high,pairs_truth,pairs_other,primaries_truth,primaries_other,expected_truth,expected_other,xi_truth,xi_other,ratio";
        to.table("xi_pairs.csv", head, (0..ratio.len()).map(row));
        let from = xi_from(pair, transform).map_or("nowhere".into(), |r| decimals(r) + &to.length);
        to.line("xi(r): within 10 % from r on", from);
    }
    if let Some(x) = transform {
        let row = |i: usize| row![x.edges[i], x.edges[i + 1], x.xi[0][i], x.xi[1][i]];
        to.table("xi_transform.csv", "r_low,r_high,xi_truth,xi_other", (1..x.edges.len()).map(|i| row(i - 1)));
    }
    let middle = |e: &[f64], i: usize| (e[i] * e[i + 1]).sqrt();
    let axes = [log(format!("r{}", to.units.length)), log("xi(r)")];
    let chart_of = |edges: &[f64], xi: [&[f64]; 2]| {
        let rows: Vec<_> = (0..xi[0].len()).map(|i| (middle(edges, i), [xi[0][i], xi[1][i]])).collect();
        compared("xi", "Two-point correlation", axes.clone(), &rows, 0.0)
    };
    let by_pairs = pairs.map(|[a, b]| chart_of(&a.edges, [&a.xi, &b.xi]));
    let mut by_transform = transform.map(|x| chart_of(&x.edges, x.xi.each_ref().map(|v| &v[..])));
    for curve in by_transform.iter_mut().flat_map(|parts| &mut parts[0].series) {
        (curve.name, curve.dashed) = (format!("{}, by transform", curve.name), true);
    }
    // One plot has the curves of both; below it stands the ratio of pairs, if it has any.
    let mut all = by_pairs.into_iter().chain(by_transform);
    let Some(mut whole) = all.next() else { return };
    let mut more = all.flatten();
    whole[0].series.extend(more.next().into_iter().flat_map(|plot| plot.series));
    if whole.len() == 1 {
        whole.extend(more);
    }
    to.plot(whole);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::local_positions;
    use particlegs_core::context::Context;
    use particlegs_particles::testing::{gas, on_threads, random_points, square_between, tilted_cells};

    fn random(n: usize, length: [f64; 3], seed: u64) -> Vec<[f64; 3]> {
        random_points(n, seed, |_, r| length.map(|l| f64::from((r.uniform() * l) as f32)))
    }

    fn plain(x: &[[f64; 3]], domain: &Domain, edges: &[f64]) -> Vec<u64> {
        let mut out = vec![0; edges.len() - 1];
        for i in 0..x.len() {
            for j in (0..x.len()).filter(|j| *j != i) {
                let r = square_between(domain, x[i], x[j]);
                (0..out.len())
                    .filter(|b| r >= edges[*b].powi(2) && r < edges[*b + 1].powi(2))
                    .for_each(|b| out[b] += 1);
            }
        }
        out
    }

    #[test]
    fn counts_are_those_of_all_pairs_in_any_box() {
        for (length, periodic, n) in [
            ([5.0, 5.0, 5.0], [true; 3], 700),
            ([2.0, 9.0, 6.0], [true, true, false], 500),
            ([3.0, 4.0, 5.0], [false; 3], 400),
            ([1.0, 1.0, 1.0], [true; 3], 3),
        ] {
            let domain = Domain::upright([0.0; 3], length, periodic);
            let x = random(n, length, 3);
            let mut edges = logarithmic_edges(0.02, 0.98 * longest_separation(&domain), 6);
            edges.insert(0, 0.0);
            let o = PairOptions { edges: edges.clone(), band: 3.0, budget: u64::MAX, seed: 1 };
            let c = count_pairs(&x, &domain, &o, &Context::SILENT).unwrap();
            assert_eq!(c.pairs, plain(&x, &domain, &edges), "{length:?}");
            assert!(c.primaries.iter().all(|p| *p == n as u64));
        }
    }

    #[test]
    fn counts_in_tilted_boxes_are_those_of_all_pairs_and_a_gas_has_no_correlation() {
        for cell in tilted_cells() {
            let p = gas(500, &cell, 2);
            let domain = Domain::from_particles(&p);
            let x = local_positions(&p, &domain);
            let longest = longest_separation(&domain);
            let edges: Vec<f64> = (0..=6).map(|i| longest * f64::from(i) / 6.0).collect();
            let o = PairOptions { edges: edges.clone(), band: 10.0, budget: u64::MAX, seed: 1 };
            let c = count_pairs(&x, &domain, &o, &Context::SILENT).unwrap();
            assert_eq!(c.pairs, plain(&x, &domain, &edges), "{cell:?}");
            for b in 0..6 {
                let sigma = (2.0 / c.expected[b]).sqrt();
                assert!(c.xi[b].abs() < 3.0 * sigma + 0.01, "{cell:?} {b}: {} {sigma}", c.xi[b]);
            }
        }
    }

    #[test]
    fn threads_change_no_count() {
        let domain = Domain::upright([0.0; 3], [4.0; 3], [true; 3]);
        let x = random(20_000, [4.0; 3], 5);
        let o = PairOptions { edges: logarithmic_edges(0.05, 1.0, 8), band: 3.0, budget: 2_000_000, seed: 1 };
        let run = |threads| on_threads(threads, || count_pairs(&x, &domain, &o, &Context::SILENT).unwrap());
        let (one, many) = (run(1), run(6));
        assert_eq!(one, many);
        assert!(one.primaries[0] > one.primaries[one.primaries.len() - 1], "{:?}", one.primaries);
    }

    /// Uniform points have no correlation, in an open slab neither: its edges are accounted for.
    #[test]
    fn uniform_points_have_no_correlation() {
        for periodic in [[true; 3], [false; 3], [false, true, true]] {
            let domain = Domain::upright([0.0; 3], [1.0, 3.0, 2.0], periodic);
            let x = random(6000, domain.length, 9);
            let o = PairOptions { edges: vec![0.1, 0.2, 0.3, 0.4, 0.5], band: 3.0, budget: u64::MAX, seed: 1 };
            let c = count_pairs(&x, &domain, &o, &Context::SILENT).unwrap();
            for b in 0..4 {
                let sigma = (2.0 / c.expected[b]).sqrt();
                assert!(c.xi[b].abs() < 4.0 * sigma + 0.006, "{periodic:?} {b}: {} {sigma}", c.xi[b]);
            }
        }
    }

    /// A lattice: 6 neighbours at 1, 12 at sqrt 2, 8 at sqrt 3, none between.
    #[test]
    fn a_lattice_has_its_shells() {
        let x: Vec<[f64; 3]> = (0..512).map(|i| [i / 64, i / 8 % 8, i % 8].map(|v| v as f64)).collect();
        let domain = Domain::upright([0.0; 3], [8.0; 3], [true; 3]);
        let o = PairOptions { edges: vec![0.5, 0.9, 1.1, 1.3, 1.5, 1.6, 1.8], band: 3.0, budget: u64::MAX, seed: 1 };
        let c = count_pairs(&x, &domain, &o, &Context::SILENT).unwrap();
        assert_eq!(c.pairs, [0, 6 * 512, 0, 12 * 512, 0, 8 * 512]);
        assert_eq!(c.xi[0], -1.0);
    }

    #[test]
    fn separations_beyond_the_box_are_refused() {
        let domain = Domain::upright([0.0; 3], [1.0, 2.0, 2.0], [true; 3]);
        for edges in [vec![0.1, 0.6], vec![0.2, 0.1], vec![0.1], vec![]] {
            let o = PairOptions { edges, band: 3.0, budget: 1, seed: 1 };
            assert!(matches!(
                count_pairs(&[[0.5; 3]; 2], &domain, &o, &Context::SILENT).unwrap_err(),
                particlegs_core::Error::Argument { .. }
            ));
        }
    }

    #[test]
    fn xi_of_a_sample_is_judged_by_transform() {
        let counts = |xi: [f64; 3], primaries: [u64; 3]| PairCounts {
            edges: vec![0.1, 1.0, 2.0, 3.0],
            pairs: vec![9; 3],
            primaries: primaries.to_vec(),
            expected: vec![1.0; 3],
            xi: xi.to_vec(),
            particles: 50,
        };
        // The last bin is of a sample, and off by its scatter.
        let truth = counts([9.0, 4.0, 1.0], [50, 50, 7]);
        let pairs = [truth, counts([18.0, 4.2, 0.8], [50, 50, 7])];
        assert_eq!(xi_from(&pairs, None), None);
        let edges: Vec<f64> = (1..8).map(|i| 0.5 * f64::from(i)).collect();
        let transform =
            XiByTransform { edges, xi: [vec![1.0, 1.0, 1.0, 1.0, 1.0, 0.05], vec![9.0, 9.0, 9.0, 1.02, 0.95, 0.5]] };
        assert_eq!(xi_from(&pairs, Some(&transform)), Some(1.0));
    }
}

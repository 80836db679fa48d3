//! g(r), the radial distribution function of molecular dynamics: pair counts in linear bins over those of an
//! ideal gas.

use super::PairCounts;
use super::comparison_job::ComparisonJob;
use super::pairs::{PairOptions, count_pairs, longest_separation};
use super::presentation::*;
use particlegs_core::Result;
use particlegs_core::model::decimals;
use particlegs_figure::PlotAxis;
use serde::ser::{SerializeMap, Serializer};

const BINS: usize = 200;
/// Largest distance of g(r), in mean spacings.
const RDF_SPACINGS: f64 = 4.0;
/// A peak is higher than lower values before and behind it by this share of its height, at least ...
const PROMINENCE: f64 = 0.1;
/// ... and by so many standard deviations of its pairs' number: 200 bins of noise span about six.
const SIGMAS: f64 = 8.0;
/// Pairs of an ideal gas below which a bin's g says nothing: one pair alone makes a peak.
const FEWEST_PAIRS: f64 = 100.0;

/// Edges of the bins, from 0 to `longest`.
pub(super) fn rdf_edges(longest: f64) -> Vec<f64> {
    (0..=BINS).map(|i| longest * i as f64 / BINS as f64).collect()
}

impl PairCounts {
    /// g(r) = xi(r) + 1 of each bin.
    pub fn g(&self) -> Vec<f64> {
        self.xi.iter().map(|xi| xi + 1.0).collect()
    }

    /// Middle of the bin and g(r) of the first peak: the first maximum with lower values on either side, a tenth of
    /// its height and more below it and by more than noise. `None` of a gas, and where g(r) only falls.
    pub fn first_peak(&self) -> Option<[f64; 2]> {
        let g = self.g();
        let least = |i: usize| {
            // Each pair counts from both its ends, so that counts scatter by the root of twice their number.
            let deviation = (2.0 * self.pairs[i] as f64).sqrt() / self.expected[i].max(f64::MIN_POSITIVE);
            (PROMINENCE * g[i]).max(SIGMAS * deviation)
        };
        // A top is far enough above the lowest value before it; it is the peak once a value is far enough below it.
        let (mut lowest, mut top) = (f64::INFINITY, None);
        for i in 0..g.len() {
            match top {
                None if g[i] > 0.0 && g[i] >= lowest + least(i) => top = Some(i),
                None => lowest = lowest.min(g[i]),
                Some(t) if g[i] > g[t] => top = Some(i),
                Some(t) if g[i] <= g[t] - least(t) => return Some([0.5 * (self.edges[t] + self.edges[t + 1]), g[t]]),
                Some(_) => {}
            }
        }
        None
    }
}

/// Middle of the bin and the difference of g(r), other - truth, where it is largest; bins in which an ideal gas
/// would have fewer than 100 pairs are not looked at.
pub(super) fn largest_difference([truth, other]: &[PairCounts; 2]) -> Option<[f64; 2]> {
    let judged = |i: &usize| truth.expected[*i].min(other.expected[*i]) >= FEWEST_PAIRS;
    let at = |i: usize| [0.5 * (truth.edges[i] + truth.edges[i + 1]), other.xi[i] - truth.xi[i]];
    (0..truth.xi.len()).filter(judged).map(at).max_by(|a, b| a[1].abs().total_cmp(&b[1].abs()))
}

impl ComparisonJob<'_> {
    /// g(r), of fewer pairs than xi(r): its bands are wider and its bins narrower.
    pub fn rdf(&self, positions: [&[[f64; 3]]; 2], notes: &mut Vec<String>) -> Result<[PairCounts; 2]> {
        let longest = longest_separation(&self.domain);
        if let Some(wanted) = self.o.rdf_max.filter(|r| *r > longest) {
            notes.push(format!("g(r) ends at {longest:.4e} instead of {wanted:.4e}, because the box is too small"));
        }
        let edges = rdf_edges(self.o.rdf_max.unwrap_or(RDF_SPACINGS * self.spacing(0)).min(longest));
        let options = PairOptions { edges, band: 10.0, budget: self.o.pair_budget / 3, seed: self.o.seed };
        let count = |side: usize| count_pairs(positions[side], &self.domain, &options, self.context);
        let counts = [count(0)?, count(1)?];
        if counts.iter().any(PairCounts::sampled) {
            notes.push("g(r) is measured for a random sample of particles".into());
        }
        Ok(counts)
    }
}

pub(super) fn with_g<S: Serializer>(
    pair: &Option<[PairCounts; 2]>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    let Some(counts) = pair else { return serializer.serialize_none() };
    let mut map = serializer.serialize_map(Some(4))?;
    map.serialize_entry("edges", &counts[0].edges)?;
    map.serialize_entry("pairs", &counts.each_ref().map(|c| &c.pairs))?;
    map.serialize_entry("expected", &counts.each_ref().map(|c| &c.expected))?;
    map.serialize_entry("g", &counts.each_ref().map(PairCounts::g))?;
    map.end()
}

/// Above this g(r), a linear axis would show only the peak.
const TALL: f64 = 30.0;
/// Below this g(r) of the truth, ratios mean nothing.
const LEAST_G: f64 = 0.2;

/// Shows them.
pub(super) fn show(counts: &[PairCounts; 2], to: &mut Presentation) {
    let ([truth, other], [a, b]) = (counts, counts.each_ref().map(PairCounts::g));
    let row = |i: usize| {
        let pairs = row![truth.edges[i], truth.edges[i + 1], truth.pairs[i], other.pairs[i]];
        row![pairs, truth.expected[i], other.expected[i], a[i], b[i]]
    };
    let head = "r_low,r_high,pairs_truth,pairs_other,ideal_truth,ideal_other,g_truth,g_other";
    to.table("rdf.csv", head, (0..a.len()).map(row));
    let middles = counts[0].edges.windows(2).map(|e| 0.5 * (e[0] + e[1]));
    let rows: Vec<_> = middles.zip(a.iter().zip(&b)).map(|(r, (a, b))| (r, [*a, *b])).collect();
    let g = PlotAxis { log: a.iter().chain(&b).any(|g| *g > TALL), ..even("g(r)") };
    let axes = [even(format!("r{}", to.units.length)), g];
    let mut parts = compared("rdf", "Radial distribution function", axes, &rows, LEAST_G);
    parts[0].levels = vec![(String::new(), 1.0)];
    to.plot(parts);
    let peak = |side: usize| match counts[side].first_peak() {
        Some([r, g]) => format!("{g:.3} at {}{}", decimals(r), to.length),
        None => "none".into(),
    };
    let peaks = format!("{}, truth {}", peak(1), peak(0));
    to.line("g(r): first peak", peaks);
    to.line("g(r): largest difference", largest_difference(counts).map_or("-".into(), |[_, d]| format!("{d:+.3}")));
}

#[cfg(test)]
mod tests {
    use super::super::Domain;
    use super::super::pairs::{PairOptions, count_pairs};
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::Random;

    fn counted(x: &[[f64; 3]], length: f64, longest: f64) -> PairCounts {
        let domain = Domain::upright([0.0; 3], [length; 3], [true; 3]);
        let o = PairOptions { edges: rdf_edges(longest), band: 10.0, budget: u64::MAX, seed: 1 };
        count_pairs(x, &domain, &o, &Context::SILENT).unwrap()
    }

    fn uniform(n: usize, length: f64, seed: u64) -> Vec<[f64; 3]> {
        let mut r = Random::new(seed, 0, 0);
        (0..n).map(|_| [0; 3].map(|_| length * r.uniform())).collect()
    }

    /// A simple cubic lattice: 6 neighbours at 1, 12 at sqrt 2, 8 at sqrt 3, and nothing between.
    #[test]
    fn a_lattice_peaks_at_its_shells() {
        let x: Vec<[f64; 3]> = (0..1000).map(|i| [i / 100, i / 10 % 10, i % 10].map(f64::from)).collect();
        let c = counted(&x, 10.0, 2.01);
        let g = c.g();
        let full: Vec<usize> = (0..g.len()).filter(|i| g[*i] > 0.0).collect();
        let shells = [1.0, 2.0f64.sqrt(), 3.0f64.sqrt(), 2.0].map(|r| (r / 2.01 * 200.0) as usize);
        assert_eq!(full, shells);
        let [at, height] = c.first_peak().unwrap();
        let shell = 4.0 / 3.0 * std::f64::consts::PI * (c.edges[shells[0] + 1].powi(3) - c.edges[shells[0]].powi(3));
        assert!((at - 1.0).abs() < 0.011 && (height * shell * 0.999 / 6.0 - 1.0).abs() < 1e-9, "{at} {height}");
    }

    #[test]
    fn an_ideal_gas_is_flat_and_has_no_peak() {
        let c = counted(&uniform(20_000, 10.0, 4), 10.0, 1.5);
        for (i, g) in c.g().iter().enumerate() {
            let deviation = (2.0 / c.expected[i]).sqrt();
            assert!(c.expected[i] < 100.0 || (g - 1.0).abs() < 5.0 * deviation, "{i}: {g} {deviation}");
        }
        assert_eq!(c.first_peak(), None);
    }

    /// Pairs of points at a distance of about 0.3, in a gas of them.
    #[test]
    fn molecules_have_the_length_of_their_bond() {
        let mut x = uniform(5000, 10.0, 4);
        for i in 0..5000u64 {
            let mut r = Random::new(9, 1, i);
            let turned = [r.normal(), r.normal(), r.normal()];
            let scale = (0.3 + 0.01 * r.normal()) / turned.iter().map(|v| v * v).sum::<f64>().sqrt();
            let at = x[i as usize];
            x.push([0, 1, 2].map(|k: usize| (at[k] + scale * turned[k]).rem_euclid(10.0)));
        }
        let c = counted(&x, 10.0, 1.5);
        let [at, height] = c.first_peak().unwrap();
        assert!((at - 0.3).abs() < 0.012 && height > 4.0, "{at} {height}");
        let gas = counted(&uniform(10_000, 10.0, 5), 10.0, 1.5);
        let [r, difference] = largest_difference(&[c, gas]).unwrap();
        assert!((r - 0.3).abs() < 0.012 && difference < -3.0, "{r} {difference}");
    }
}

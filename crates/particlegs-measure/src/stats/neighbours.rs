//! Distances to the nearest neighbour, of all particles or of a sample of them.

use super::Domain;
use super::aperture::quantile;
use super::comparison_job::ComparisonJob;
use super::presentation::*;
use particlegs_core::context::Context;
use particlegs_core::math::{Purpose, Random};
use particlegs_core::model::decimals;
use particlegs_core::{Error, Result, parallel};
use particlegs_particles::{Neighbours, Particles, places_of};
use serde::ser::{SerializeMap, Serializer};

/// Bins of the histogram, a decade.
const PER_DECADE: f64 = 20.0;

/// Distances to the nearest other particle.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct NearestDistances {
    /// Particles whose neighbour was sought.
    pub sampled: u64,
    /// Particles among which it was sought.
    pub among: u64,
    /// Mean distance, world units.
    pub mean: f64,
    /// Median distance, world units.
    pub median: f64,
    /// 1, 5, 25, 75, 95 and 99 % of the distances are below these.
    pub percentiles: [f64; 6],
    /// Edges of the histogram's bins, world units, one more than bins: 20 a decade, of one lattice whatever is
    /// compared.
    pub edges: Vec<f64>,
    /// Distances in each bin.
    pub counts: Vec<u64>,
    /// Distances of zero.
    pub zero: u64,
}

pub struct NeighbourOptions {
    /// Particles to look from, at most.
    pub sample: usize,
    /// Thin the particles to the sample first and look among it alone, as the published table does:
    /// its distances are those of the thinned set.
    pub among_sample: bool,
    pub seed: u64,
}

/// A sample of `wanted` of `n` indices, ascending: each step keeps with the chance that is left.
pub(super) fn sample(n: usize, wanted: usize, purpose: Purpose, seed: u64) -> Vec<u32> {
    if wanted >= n {
        return (0..n as u32).collect();
    }
    let mut random = Random::from_purpose(purpose, seed, 0);
    let (mut out, mut left) = (Vec::with_capacity(wanted), wanted);
    for i in 0..n {
        if random.uniform() * ((n - i) as f64) < left as f64 {
            out.push(i as u32);
            left -= 1;
        }
    }
    out
}

/// Distances to nearest neighbours.
pub fn nearest_distances(
    particles: &Particles,
    domain: &Domain,
    o: &NeighbourOptions,
    context: &Context<'_>,
) -> Result<NearestDistances> {
    let n = particles.len();
    if n < 2 || n >= u32::MAX as usize || o.sample < 2 {
        return Err(Error::argument("nearest neighbours need 2 to 4294967294 particles"));
    }
    particlegs_files::memory::require("a tree of neighbours", n as u64 * 14 + o.sample.min(n) as u64 * 28)?;
    context.begin("nearest neighbours", o.sample.min(n) as u64);
    let places = places_of(particles, domain, &sample(n, o.sample, Purpose::NeighbourSample, o.seed));
    context.check()?;
    let thinned = o.among_sample.then(|| {
        let column = |k: usize| places.iter().map(|x| x[k]).collect();
        let mut thinned = Particles::from_columns(column(0), column(1), column(2));
        thinned.origin = particles.origin;
        thinned
    });
    let among = thinned.as_ref().unwrap_or(particles);
    let tree = Neighbours::new(among, domain);
    let mut distances = parallel::try_map(places.chunks(1024), |run| {
        let one = |x| context.check().map(|()| tree.nearest(x));
        let distances = run.iter().map(|x| one(*x)).collect::<Result<Vec<f64>>>()?;
        context.advance(run.len() as u64);
        Ok(distances)
    })?
    .concat();
    context.end();
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    distances.sort_unstable_by(f64::total_cmp);
    Ok(summary(&distances, mean, among.len()))
}

fn summary(sorted: &[f64], mean: f64, among: usize) -> NearestDistances {
    let n = sorted.len();
    let at = |share| quantile(sorted, share).expect("at least one distance");
    let zero = sorted.iter().take_while(|d| **d == 0.0).count();
    let bin = |d: f64| (libm::log10(d) * PER_DECADE).floor() as i64;
    let (mut edges, mut counts) = (Vec::new(), Vec::new());
    if zero < n {
        let (low, high) = (bin(sorted[zero]), bin(sorted[n - 1]));
        edges = (low..=high + 1).map(|b| libm::pow(10f64, b as f64 / PER_DECADE)).collect();
        counts = vec![0; (high - low + 1) as usize];
        sorted[zero..].iter().for_each(|d| counts[(bin(*d) - low) as usize] += 1);
    }
    NearestDistances {
        sampled: n as u64,
        among: among as u64,
        mean,
        median: at(0.5),
        percentiles: [0.01, 0.05, 0.25, 0.75, 0.95, 0.99].map(at),
        edges,
        counts,
        zero: zero as u64,
    }
}

impl ComparisonJob<'_> {
    pub fn neighbours(&self, particles: [&Particles; 2]) -> Result<[NearestDistances; 2]> {
        let options =
            NeighbourOptions { sample: self.o.neighbour_sample, among_sample: self.paper(), seed: self.o.seed };
        let distances_of = |side: usize| nearest_distances(particles[side], &self.domain, &options, self.context);
        Ok([distances_of(0)?, distances_of(1)?])
    }
}

pub(super) fn with_distance_ratios<S: Serializer>(
    pair: &Option<[NearestDistances; 2]>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    let Some(distances) = pair else { return serializer.serialize_none() };
    let [truth, other] = distances;
    let mut map = serializer.serialize_map(Some(3))?;
    map.serialize_entry("distances", distances)?;
    map.serialize_entry("mean_ratio", &(other.mean / truth.mean))?;
    map.serialize_entry("median_ratio", &(other.median / truth.median))?;
    map.end()
}

/// Shows them.
pub(super) fn show(both: &[NearestDistances; 2], to: &mut Presentation) {
    let rows = ["truth", "other"]
        .into_iter()
        .zip(both)
        .flat_map(|(side, d)| (0..d.counts.len()).map(move |i| row![side, d.edges[i], d.edges[i + 1], d.counts[i]]));
    to.table("neighbours.csv", "side,low,high,particles", rows);
    let shares_of = |d: &NearestDistances| {
        (0..d.counts.len())
            .map(|i| ((d.edges[i] * d.edges[i + 1]).sqrt(), d.counts[i] as f64 / d.sampled as f64))
            .collect::<Vec<_>>()
    };
    let [a, b] = both.each_ref().map(shares_of);
    // Both histograms share one grid of edges, but may have other ends.
    let ratio = a
        .iter()
        .filter(|p| p.1 > 1e-4)
        .filter_map(|p| Some((p.0, b.iter().find(|q| (q.0 / p.0 - 1.0).abs() < 1e-6)?.1 / p.1)))
        .collect();
    let axes = [log(format!("distance{}", to.units.length)), even("share per bin (20 per decade)")];
    to.plot(chart("neighbours", "Distance to the nearest neighbour", axes, pair([a, b]), ratio));
    let [truth, other] = both;
    for (name, pick) in [("mean", (|d| d.mean) as fn(&NearestDistances) -> f64), ("median", |d| d.median)] {
        let (a, b) = (pick(truth), pick(other));
        let value = format!("{}{}, truth {}: {:.3}", decimals(b), to.length, decimals(a), b / a);
        to.line(&format!("nearest neighbour, {name}"), value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_particles::testing::{from_points, random_points, square_between};

    fn nearest(x: &[[f64; 3]], domain: &Domain, sample: usize, among_sample: bool) -> Result<NearestDistances> {
        let options = NeighbourOptions { sample, among_sample, seed: 1 };
        nearest_distances(&from_points(x.iter().copied()), domain, &options, &Context::SILENT)
    }

    #[test]
    fn distances_are_those_of_all_pairs() {
        for periodic in [[true; 3], [false; 3], [true, false, true]] {
            let domain = Domain::upright([0.0; 3], [1.0, 2.0, 3.0], periodic);
            let mut x = random_points(900, 8, |i, r| {
                let share = if i % 2 == 0 { 0.02 } else { 1.0 };
                domain.length.map(|l| f64::from((l * share * r.uniform()) as f32))
            });
            // Some lie in another image of the box, and about another origin.
            (0..3).filter(|k| periodic[*k]).for_each(|k| x[7][k] += domain.length[k]);
            let mut p = from_points(x.iter().copied());
            p.origin = [5.0, 0.0, -3.0];
            let moved = Domain { min: p.origin, ..domain };
            let all = places_of(&p, &moved, &(0..900).collect::<Vec<u32>>());
            let tree = Neighbours::new(&p, &moved);
            for i in 0..x.len() {
                let others = (0..x.len()).filter(|j| *j != i).map(|j| square_between(&domain, x[i], x[j]));
                let plain = others.fold(f64::INFINITY, f64::min).sqrt();
                assert!((tree.nearest(all[i]) - plain).abs() < 1e-6, "{i}");
            }
        }
    }

    /// Poisson points: the mean distance is 0.55396 of the mean spacing (Chandrasekhar 1943).
    #[test]
    fn poisson_points_have_their_mean() {
        let domain = Domain::upright([0.0; 3], [2.0; 3], [true; 3]);
        let x = random_points(30_000, 2, |_, r| [0; 3].map(|_| 2.0 * r.uniform()));
        let d = nearest(&x, &domain, 20_000, false).unwrap();
        assert!((d.mean / domain.spacing(30_000) / 0.55396 - 1.0).abs() < 0.01, "{d:?}");
        assert_eq!((d.sampled, d.among), (20_000, 30_000));
        assert_eq!(d.counts.iter().sum::<u64>() + d.zero, 20_000);
        let thin = nearest(&x, &domain, 3750, true).unwrap();
        assert!((thin.mean / d.mean - 2.0).abs() < 0.06);
    }

    /// Cells lie in a row of many: shells about one are as long as the row, and no wider than it.
    #[test]
    fn searches_in_a_needle_of_cells_end_soon() {
        let (n, step) = (60_000, 2.0f64.powi(100));
        for periodic in [[false; 3], [true, false, true]] {
            let x: Vec<[f64; 3]> = (0..n).map(|i| [i as f64 * step, (i % 2) as f64 * 1e-38, 0.0]).collect();
            let domain = Domain::upright([0.0; 3], [n as f64 * step, 1e-38, 1e-38], periodic);
            let d = nearest(&x, &domain, n, false).unwrap();
            if !periodic[0] {
                assert_eq!(d.median, step);
            }
        }
    }

    #[test]
    fn a_lattice_has_one_distance_and_doubles_none() {
        let domain = Domain::upright([0.0; 3], [4.0; 3], [true; 3]);
        let mut x: Vec<[f64; 3]> = (0..64).map(|i| [i / 16, i / 4 % 4, i % 4].map(|v| v as f64)).collect();
        let d = nearest(&x, &domain, 1000, false).unwrap();
        assert_eq!((d.mean, d.median, d.zero), (1.0, 1.0, 0));
        x.push([1.0; 3]);
        assert_eq!(nearest(&x, &domain, 1000, false).unwrap().zero, 2);
        assert!(nearest(&x[..1], &domain, 1000, false).is_err());
    }
}

//! The numbers of a comparison that are cached.

use particlegs_measure::stats::{PairCounts, Shell, SizeClass, Statistics, XiByTransform};
use serde::{Deserialize, Serialize};

/// Numbers of a comparison for tables and plots; unmeasured ones are empty. Pairs are truth, then other.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Facts {
    /// Pearson correlation of the densities.
    pub correlation: Option<f64>,
    /// Mean absolute error of delta.
    pub mae: Option<f64>,
    pub shells: Vec<Power>,
    /// P(k) is within 1, 5 and 10 % up to these k; `None` = not even in the first shell.
    pub power_to: [Option<f64>; 3],
    /// r(k) is at least 0.99 and 0.9 up to these k.
    pub r_to: [Option<f64>; 2],
    pub xi: Vec<Xi>,
    /// xi is within 10 % from this r on, in bins where the truth's is above 0.1.
    pub xi_from: Option<f64>,
    /// Groups of 20 to 49, 50 to 99, 100 or more.
    pub classes: Vec<GroupCounts>,
    /// Groups by size in steps of the square root of 2.
    pub sizes: Vec<GroupCounts>,
    /// Numbers of groups are within 10 % from this size on.
    pub groups_from: Option<u64>,
    /// Median of other / truth in the cores of groups of 100 to 299.
    pub core_mass: Option<f64>,
    /// Mean distance to the nearest neighbour, world units.
    pub nearest: Option<[f64; 2]>,
    /// Median distance, other / truth.
    pub nearest_median: Option<f64>,
}

/// One shell of wave numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Power {
    /// Mean wave number.
    pub k: f64,
    /// P(k), other / truth.
    pub ratio: Option<f64>,
    /// Correlation coefficient, noise included.
    pub r: Option<f64>,
}

/// One bin of separations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Xi {
    /// Its edges, world units.
    pub edges: [f64; 2],
    pub xi: [f64; 2],
}

impl Xi {
    /// The geometric middle of the bin.
    pub fn middle(&self) -> f64 {
        (self.edges[0] * self.edges[1]).sqrt()
    }

    /// Other / truth, if the truth's is above 0.
    pub fn ratio(&self) -> Option<f64> {
        (self.xi[0] > 0.0).then(|| self.xi[1] / self.xi[0])
    }
}

/// Groups of a range of sizes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct GroupCounts {
    /// Smallest size, particles.
    pub from: u64,
    /// Largest size; `None` = no limit.
    pub to: Option<u64>,
    pub number: [u64; 2],
}

impl GroupCounts {
    fn from_class(class: &SizeClass) -> GroupCounts {
        GroupCounts { from: class.from, to: class.to, number: class.groups }
    }

    /// Other / truth - 1; `None` if the truth has none.
    pub fn off(&self) -> Option<f64> {
        (self.number[0] > 0).then(|| self.number[1] as f64 / self.number[0] as f64 - 1.0)
    }

    pub fn describe(&self) -> String {
        self.to.map_or(format!("{} or more", self.from), |to| format!("{} to {to}", self.from))
    }
}

impl Facts {
    pub fn from_statistics(s: &Statistics) -> Facts {
        let y = &s.summary;
        let groups = |list: fn(&particlegs_measure::stats::GroupReport) -> &Vec<SizeClass>| {
            s.groups.iter().flat_map(|g| list(g).iter().map(GroupCounts::from_class)).collect()
        };
        Facts {
            correlation: y.density_correlation,
            mae: y.density_mean_absolute_error,
            shells: s.spectra.iter().flat_map(|p| p.shells.iter().map(power)).collect(),
            power_to: [y.power_within_1_percent_to, y.power_within_5_percent_to, y.power_within_10_percent_to],
            r_to: [y.r_above_0_99_to, y.r_above_0_9_to],
            xi: s.xi_by_pairs.as_ref().map_or(vec![], |pairs| joined(pairs, s.xi_by_transform.as_ref())),
            xi_from: y.xi_within_10_percent_from,
            classes: groups(|g| &g.classes),
            sizes: groups(|g| &g.histogram),
            groups_from: y.groups_within_10_percent_from,
            core_mass: y.core_mass,
            nearest: s.neighbours.as_ref().map(|n| [n[0].mean, n[1].mean]),
            nearest_median: y.nearest_median,
        }
    }

    /// The largest |P / P_truth - 1| and its k; `None` without comparable shells.
    pub fn power_worst(&self) -> Option<(f64, f64)> {
        let off = self.shells.iter().filter_map(|s| Some(((s.ratio? - 1.0).abs(), s.k)));
        off.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The last shell's wave number.
    pub fn k_max(&self) -> Option<f64> {
        self.shells.last().map(|s| s.k)
    }

    /// Mean |xi / xi_truth - 1| over bins from `from` on where the truth's xi is above 0 (paper, table "Recovery
    /// algorithm comparison"); `None` without any.
    pub fn xi_deviation(&self, from: f64) -> Option<f64> {
        let chosen = self.xi.iter().filter(|b| b.edges[0] >= from);
        let off: Vec<f64> = chosen.filter_map(|b| Some((b.ratio()? - 1.0).abs())).collect();
        (!off.is_empty()).then(|| off.iter().sum::<f64>() / off.len() as f64)
    }

    /// Mean distance to the nearest neighbour, other / truth.
    pub fn nearest_mean(&self) -> Option<f64> {
        self.nearest.map(|[truth, other]| other / truth)
    }
}

fn power(s: &Shell) -> Power {
    Power { k: s.k, ratio: s.ratio.filter(|v| v.is_finite()), r: s.r.filter(|v| v.is_finite()) }
}

/// xi by pair counts as long as all particles are primaries, then by transform: counts of a sample of primaries scatter
/// by 5 to 10 %. The first two bins of the transform are too noisy.
fn joined([truth, other]: &[PairCounts; 2], transform: Option<&XiByTransform>) -> Vec<Xi> {
    let sampled = |b: &usize| [truth, other].iter().any(|c| c.primaries[*b] < c.particles);
    let join = match ((0..truth.xi.len()).find(sampled), transform) {
        (Some(first), Some(t)) => t.edges.get(2).map_or(f64::INFINITY, |e| e.max(truth.edges[first])),
        _ => f64::INFINITY,
    };
    let near = (0..truth.xi.len())
        .map(|b| Xi { edges: [truth.edges[b], truth.edges[b + 1]], xi: [truth.xi[b], other.xi[b]] })
        .filter(|b| b.edges[0] < join);
    let far = transform.into_iter().flat_map(|t| {
        (0..t.xi[0].len()).map(|b| Xi { edges: [t.edges[b], t.edges[b + 1]], xi: [t.xi[0][b], t.xi[1][b]] })
    });
    near.chain(far.filter(|b| b.edges[0] >= join)).filter(|b| b.xi.iter().all(|v| v.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(xi: [f64; 3], primaries: [u64; 3]) -> PairCounts {
        PairCounts {
            edges: vec![0.5, 1.0, 2.0, 4.0],
            pairs: vec![9; 3],
            primaries: primaries.to_vec(),
            expected: vec![1.0; 3],
            xi: xi.to_vec(),
            particles: 50,
        }
    }

    #[test]
    fn xi_uses_pairs_and_then_the_transform() {
        let all = [counts([8.0, 4.0, 1.0], [50; 3]), counts([8.8, 4.0, -1.0], [50; 3])];
        let facts = Facts { xi: joined(&all, None), ..Facts::default() };
        // |8.8/8 - 1|, 0 and |-1/1 - 1|: 0.1, 0 and 2.
        assert!((facts.xi_deviation(0.0).unwrap() - 0.7).abs() < 1e-12);
        assert!((facts.xi_deviation(2.0).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!((facts.xi_deviation(3.0), facts.xi[1].middle()), (None, 2f64.sqrt()));
        // From the first sampled bin on: the transform's, but for its first two bins; bins where xi is below 0 say
        // nothing.
        let sampled = [counts([8.0, 4.0, 1.0], [50, 50, 7]), counts([8.0, 4.0, 9.0], [50, 50, 7])];
        let transform = XiByTransform {
            edges: vec![0.9, 1.8, 2.7, 3.6, 4.5],
            xi: [vec![9.0, 9.0, 0.5, -0.1], vec![0.0, 0.0, 0.6, 0.1]],
        };
        let facts = Facts { xi: joined(&sampled, Some(&transform)), ..Facts::default() };
        assert_eq!(facts.xi.iter().map(|b| b.edges[0]).collect::<Vec<_>>(), [0.5, 1.0, 2.0, 2.7, 3.6]);
        assert_eq!(facts.xi[4].ratio(), None);
        assert!((facts.xi_deviation(2.5).unwrap() - 0.2).abs() < 1e-12);
    }

    #[test]
    fn the_worst_shell_and_groups_are_found() {
        let shell = |k: f64, ratio| Power { k, ratio, r: None };
        let shells = vec![shell(1.0, Some(1.02)), shell(2.0, Some(0.9)), shell(3.0, None)];
        let facts = Facts { shells, ..Facts::default() };
        let (off, k) = facts.power_worst().unwrap();
        assert!((off - 0.1).abs() < 1e-12 && k == 2.0 && facts.k_max() == Some(3.0));
        let class = GroupCounts { from: 50, to: Some(99), number: [200, 150] };
        assert_eq!((class.off(), class.describe().as_str()), (Some(-0.25), "50 to 99"));
        assert_eq!(GroupCounts { number: [0, 3], to: None, ..class }.off(), None);
    }
}

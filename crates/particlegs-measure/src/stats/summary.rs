//! The figures of a table: how far each statistic is to be trusted.

use super::rdf::largest_difference;
use super::report::{Statistics, Summary, XiByTransform, xi_ratio};
use super::{MultipoleShell, Multipoles, PairCounts, Shell, SizeClass, Spectra};

/// Truth groups that sizes are joined to hold before their ratio says anything: the scatter of a
/// number is its root.
pub const FEWEST_GROUPS: u64 = 100;
/// xi of the truth below which a ratio of xi says nothing.
const LEAST_XI: f64 = 0.1;

impl Summary {
    /// The figures of `s`, whose own summary is not looked at.
    pub(super) fn new(s: &Statistics) -> Self {
        let (density, spectra, groups) = (s.density.as_ref(), s.spectra.as_ref(), s.groups.as_ref());
        let power_to = |limit: f64| spectra.and_then(|s| s.power_within(limit));
        let r_to = |limit: f64| spectra.and_then(|s| s.r_above(limit));
        let peaks = [0, 1].map(|side| s.rdf.as_ref().and_then(|pair: &[PairCounts; 2]| pair[side].first_peak()));
        let profile = s.profiles.as_ref().and_then(|p| p.get(s.options.profile_axis));
        Summary {
            density_correlation: density.map(|d| d.agreement.correlation),
            density_mean_absolute_error: density.map(|d| d.agreement.mean_absolute_error),
            largest_power_deviation: spectra.and_then(Spectra::largest_power_deviation),
            power_within_1_percent_to: power_to(0.01),
            power_within_5_percent_to: power_to(0.05),
            power_within_10_percent_to: power_to(0.1),
            r_above_0_99_to: r_to(0.99),
            r_above_0_9_to: r_to(0.9),
            r_at_k_max: spectra.and_then(|s| s.shells.last()?.r),
            xi_within_10_percent_from: s.xi_by_pairs.as_ref().and_then(|p| xi_from(p, s.xi_by_transform.as_ref())),
            groups_within_10_percent_from: groups.and_then(|g| sizes_within(&g.histogram, 0.1).flatten()),
            core_mass: groups.and_then(|g| g.apertures.iter().find(|a| a.sizes == [100, 299])?.median),
            nearest_mean: s.neighbours.as_ref().map(|[truth, other]| other.mean / truth.mean),
            nearest_median: s.neighbours.as_ref().map(|[truth, other]| other.median / truth.median),
            rdf_peak_at: peaks.map(|p| p.map(|[r, _]| r)),
            rdf_peak_height: peaks.map(|p| p.map(|[_, g]| g)),
            rdf_largest_difference: s.rdf.as_ref().and_then(largest_difference).map(|[_, d]| d),
            profile_relative_difference: profile.map(|p| p.relative_difference),
            profile_half_mass_height: [0, 1].map(|side| profile.map(|p| p.half_mass_height[side])),
            halo_mass: s.haloes.as_ref().and_then(|h| *h.median.last()?),
            monopole_within_1_percent_to: s.multipoles.as_ref().and_then(|m| m.monopole_within(0.01)),
            monopole_within_5_percent_to: s.multipoles.as_ref().and_then(|m| m.monopole_within(0.05)),
            largest_quadrupole_deviation: s.multipoles.as_ref().and_then(Multipoles::largest_quadrupole_deviation),
            momentum_within_5_percent_to: s.momentum.as_ref().and_then(|m| m.power_within(0.05)),
            halo_dispersion: s.dispersion.as_ref().and_then(|d| d.median),
            joint_difference: s.joint.iter().flatten().map(|j| j.difference).reduce(f64::max),
        }
    }
}

/// |P_other / P_truth - 1| of a shell.
fn deviation(shell: &Shell) -> f64 {
    shell.ratio.map_or(f64::INFINITY, |r| (r - 1.0).abs())
}

impl Spectra {
    /// Shells in which the truth has power to be compared: more than its shot noise scatters. (A tiled
    /// box has none between the harmonics of its tiles.)
    fn judged(&self) -> impl Iterator<Item = &Shell> {
        let scatter = |s: &Shell| self.shot_noise[0] / (0.5 * s.modes as f64).sqrt();
        self.shells.iter().filter(move |s| s.power[0] > scatter(s))
    }

    /// The largest |P_other / P_truth - 1| of the judged shells.
    pub(crate) fn largest_power_deviation(&self) -> Option<f64> {
        self.judged().map(deviation).reduce(f64::max).filter(|d| d.is_finite())
    }

    /// The last shell's k up to which every shell's P(k) is within `limit` of the truth's (0.01 = 1 %),
    /// shells apart in which the truth has no power above the scatter of its shot noise; `None` = not
    /// even the first's.
    pub fn power_within(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, deviation(s) <= limit)))
    }

    /// The same for r(k), noise included, of at least `limit`.
    pub fn r_above(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, s.r.is_some_and(|r| r >= limit))))
    }
}

impl Multipoles {
    /// Shells in which P0 of the truth is more than its shot noise scatters.
    fn judged(&self) -> impl Iterator<Item = &MultipoleShell> {
        let scatter = |s: &MultipoleShell| self.shot_noise[0] / (0.5 * s.modes as f64).sqrt();
        self.shells.iter().filter(move |s| s.monopole[0] > scatter(s))
    }

    /// The last judged shell's k up to which every P0 is within `limit` of the truth's.
    pub fn monopole_within(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, (s.monopole[1] / s.monopole[0] - 1.0).abs() <= limit)))
    }

    /// The largest difference of P2 in any judged shell, in units of the truth's P0.
    fn largest_quadrupole_deviation(&self) -> Option<f64> {
        let of = |s: &MultipoleShell| ((s.quadrupole[1] - s.quadrupole[0]) / s.monopole[0]).abs();
        self.judged().map(of).reduce(f64::max)
    }
}

/// The last place up to which all is well.
fn last_while(places: impl Iterator<Item = (f64, bool)>) -> Option<f64> {
    places.take_while(|(_, good)| *good).last().map(|(k, _)| k)
}

/// The separation from which on xi is within 10 %, where the truth's says something: by pairs where all
/// are counted, by transform where pairs are of a sample, which scatters as much.
fn xi_from(pairs: &[PairCounts; 2], transform: Option<&XiByTransform>) -> Option<f64> {
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

/// Classes joined, from the largest sizes down, until they hold 100 of the truth's groups: the smallest size of each
/// and its groups, and what is left at the small end.
fn joined(histogram: &[SizeClass]) -> (Vec<(u64, [u64; 2])>, [u64; 2]) {
    let (mut classes, mut sum) = (Vec::new(), [0; 2]);
    for class in histogram.iter().rev() {
        (0..2).for_each(|side| sum[side] += class.groups[side]);
        if sum[0] >= FEWEST_GROUPS {
            classes.push((class.from, std::mem::take(&mut sum)));
        }
    }
    (classes, sum)
}

/// The smallest size from which on the number of groups is within `limit` of the truth's in every
/// class. Classes are joined, from the largest sizes down, until they hold 100 of the truth's groups;
/// what is left at the small end is not judged. `Some(None)` = not even in the largest, `None` = there
/// are not enough groups.
pub fn sizes_within(histogram: &[SizeClass], limit: f64) -> Option<Option<u64>> {
    let (classes, _) = joined(histogram);
    let good = |c: &&(u64, [u64; 2])| (c.1[1] as f64 / c.1[0] as f64 - 1.0).abs() <= limit;
    let last = classes.iter().take_while(good).last().map(|c| c.0);
    (!classes.is_empty()).then_some(last)
}

/// The largest deviation of the number of groups from the truth's in any class: classes joined as for [`sizes_within`],
/// and what is left at the small end with the last of them, so that none is left out. The other's groups are of so many
/// `draws`. `None` = there are not enough groups.
pub fn largest_deviation_of_numbers(histogram: &[SizeClass], draws: u64) -> Option<f64> {
    let (mut classes, left) = joined(histogram);
    let last = classes.last_mut()?;
    (0..2).for_each(|side| last.1[side] += left[side]);
    let deviation = |g: &[u64; 2]| (g[1] as f64 / (draws * g[0]) as f64 - 1.0).abs();
    classes.iter().map(|c| deviation(&c.1)).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::{Assignment, SpectrumOptions};
    use super::*;

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

    #[test]
    fn shells_without_power_are_not_judged() {
        let shell = |k: f64, truth: f64, other: f64| Shell {
            edges: [k - 0.5, k + 0.5],
            k,
            modes: 200,
            power: [truth, other],
            cross: 0.0,
            ratio: Some(other / truth),
            r: Some(if truth > 1.0 { 0.999 } else { 0.2 }),
            r_without_noise: None,
        };
        let options = SpectrumOptions {
            cells: 8,
            assignment: Assignment::Tsc,
            interlaced: true,
            deconvolved: true,
            shot_noise_subtracted: true,
            k_max: 4.0,
        };
        // The second holds the scatter of a noise of 1 in 100 independent modes, the third less than none.
        let shells = vec![shell(1.0, 50.0, 50.2), shell(2.0, 0.09, 0.3), shell(3.0, -0.2, 0.3), shell(4.0, 9.0, 9.3)];
        let spectra = Spectra { options, cells: [8; 3], shot_noise: [1.0, 1.0], shells };
        assert_eq!((spectra.power_within(0.01), spectra.power_within(0.05)), (Some(1.0), Some(4.0)));
        assert_eq!(spectra.r_above(0.99), Some(4.0));
    }

    #[test]
    fn small_classes_are_joined_before_they_are_judged() {
        let class =
            |from: u64, truth: u64, other: u64| SizeClass { from, to: None, groups: [truth, other], ratio: None };
        let few = class(400, 50, 30);
        let (good, bad) = (class(200, 100, 109), class(100, 100, 89));
        // 139 of 150, then 89 of 100.
        assert_eq!(sizes_within(&[bad, good, few], 0.1), Some(Some(200)));
        assert_eq!(sizes_within(&[class(20, 900, 900), bad, good], 0.1), Some(Some(200)));
        assert_eq!(sizes_within(&[class(20, 900, 900), bad], 0.1), Some(None));
        assert_eq!(sizes_within(&[class(20, 60, 0), class(50, 500, 500), good], 0.1), Some(Some(50)));
        assert_eq!((sizes_within(&[few], 0.1), sizes_within(&[], 0.1)), (None, None));
        // 139 of 150 and 89 of 100; of two draws 139 of 300; what is left joins the last class.
        let largest = |classes: &[SizeClass], draws| largest_deviation_of_numbers(classes, draws);
        assert!((largest(&[bad, good, few], 1).unwrap() - 0.11).abs() < 1e-12);
        assert!((largest(&[good, few], 2).unwrap() - (1.0 - 139.0 / 300.0)).abs() < 1e-12);
        assert!((largest(&[class(20, 50, 0), good, few], 1).unwrap() - (1.0 - 139.0 / 200.0)).abs() < 1e-12);
        assert_eq!(largest(&[few], 1), None);
    }
}

//! Groups by size.

/// Truth groups that sizes are joined to hold before their ratio says anything: the scatter of a
/// number is its root.
pub const FEWEST_GROUPS: u64 = 100;

/// Groups of a range of sizes.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SizeClass {
    /// Smallest size, particles.
    pub from: u64,
    /// Largest size; `None` = no end.
    pub to: Option<u64>,
    /// Number of groups of those sizes, truth and other.
    pub groups: [u64; 2],
    /// Groups of the other over those of the truth.
    pub ratio: Option<f64>,
}

impl SizeClass {
    /// Counts the groups of `from` to `to` particles. `sizes` are the truth's and the other's.
    pub fn new(sizes: [&[u64]; 2], from: u64, to: Option<u64>) -> Self {
        let within = |n: &&u64| **n >= from && to.is_none_or(|t| **n <= t);
        let groups = sizes.map(|s| s.iter().filter(within).count() as u64);
        SizeClass { from, to, groups, ratio: (groups[0] > 0).then(|| groups[1] as f64 / groups[0] as f64) }
    }
}

/// Classes that grow by a factor of the square root of 2 from `smallest` to the largest group of
/// both. `sizes` descend.
pub fn size_histogram(sizes: [&[u64]; 2], smallest: u64) -> Vec<SizeClass> {
    let largest = sizes.iter().filter_map(|s| s.first()).copied().max().unwrap_or(0);
    let mut bounds: Vec<u64> = (0..)
        .map(|i| (smallest as f64 * libm::pow(2f64, 0.5 * f64::from(i))).round() as u64)
        .take_while(|b| *b <= largest)
        .collect();
    bounds.dedup();
    (0..bounds.len()).map(|i| SizeClass::new(sizes, bounds[i], bounds.get(i + 1).map(|b| b - 1))).collect()
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
    use super::*;

    #[test]
    fn every_group_is_in_one_class() {
        let (a, b) = ([100u64, 41, 40, 28, 27, 20], [57u64, 56, 20]);
        let classes = size_histogram([&a, &b], 20);
        assert_eq!(classes.iter().map(|c| c.from).collect::<Vec<_>>(), [20, 28, 40, 57, 80]);
        assert_eq!(classes.iter().map(|c| c.groups).collect::<Vec<_>>(), [[2, 1], [1, 0], [2, 1], [0, 1], [1, 0]]);
        assert_eq!((classes[4].to, classes[3].ratio, classes[0].ratio), (None, None, Some(0.5)));
        assert!(size_histogram([&[], &[]], 20).is_empty());
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

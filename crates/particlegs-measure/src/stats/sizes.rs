//! Groups by size.

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
        .map(|i| (smallest as f64 * 2f64.powf(0.5 * f64::from(i))).round() as u64)
        .take_while(|b| *b <= largest)
        .collect();
    bounds.dedup();
    (0..bounds.len()).map(|i| SizeClass::new(sizes, bounds[i], bounds.get(i + 1).map(|b| b - 1))).collect()
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
}

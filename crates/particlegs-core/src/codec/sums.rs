//! Whole counts that sum to the particles, masses that sum to theirs, and opacities (docs/format.md,
//! section 10).

use crate::math::exp;

/// A sum that does not lose small terms (Neumaier), in the order of the slice.
pub fn compensated(values: &[f64]) -> f64 {
    let (mut sum, mut lost) = (0.0f64, 0.0f64);
    for &v in values {
        let next = sum + v;
        lost += if sum.abs() >= v.abs() { (sum - next) + v } else { (v - next) + sum };
        sum = next;
    }
    sum + lost
}

/// Whole numbers in proportion to `weights` that sum to `total` (at most 2^53): rounded down, and
/// the rest one each to the largest remainders, the earlier Gaussian first where they are equal.
pub fn whole_counts(weights: &mut [f64], total: u64) {
    let sum = compensated(weights);
    if !(sum > 0.0 && sum.is_finite()) {
        // Without any weight all have the same share.
        weights.fill(1.0);
    }
    let sum = compensated(weights);
    let mut remainders: Vec<(f64, u32)> = Vec::with_capacity(weights.len());
    let mut floor_sum = 0u64;
    for (i, w) in weights.iter_mut().enumerate() {
        let share = *w / sum * total as f64;
        let whole = share.floor();
        remainders.push((share - whole, i as u32));
        *w = whole;
        floor_sum += whole as u64;
    }
    let by_size = |a: &(f64, u32), b: &(f64, u32)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if floor_sum > total {
        // Rounding of very large counts may give too much: the largest pay it back.
        take_back(weights, floor_sum - total);
        return;
    }
    let mut rest = total - floor_sum;
    while rest > 0 {
        let n = (rest.min(weights.len() as u64)) as usize;
        // It matters only which are the largest, so they need not be sorted.
        if n < remainders.len() {
            remainders.select_nth_unstable_by(n, by_size);
        }
        for &(_, i) in &remainders[..n] {
            weights[i as usize] += 1.0;
        }
        rest -= n as u64;
    }
}

/// Takes `excess` away, from the largest first, each down to no less than 0.
fn take_back(counts: &mut [f64], mut excess: u64) {
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|&a, &b| counts[b].total_cmp(&counts[a]).then(a.cmp(&b)));
    for i in order {
        let part = (counts[i] as u64).min(excess);
        counts[i] -= part as f64;
        excess -= part;
    }
}

/// Depths `-ln(1 - opacity)` that are told apart: opacities from 1e-6 to 1 - 1e-7.
const DEPTHS: (f64, f64) = (1.0 / (1 << 20) as f64, 16.0);

/// The opacity of a depth, in (0, 1).
pub fn opacity_of(depth: f64) -> f64 {
    1.0 - exp(-depth.clamp(DEPTHS.0, DEPTHS.1))
}

/// The depth of an opacity in [0, 1].
pub fn depth_of(opacity: f64) -> f64 {
    (-libm::log1p(-opacity)).clamp(DEPTHS.0, DEPTHS.1)
}

/// Scales masses so that they sum to `total`.
pub fn rescale(masses: &mut [f64], total: f64) {
    // The second time makes up for the rounding of the first.
    for _ in 0..2 {
        let sum = compensated(masses);
        let factor = total / sum;
        if !(sum > 0.0 && sum.is_finite() && factor.is_finite()) {
            let n = masses.len() as f64;
            masses.fill(total / n);
            return;
        }
        masses.iter_mut().for_each(|m| *m *= factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn counts_sum_exactly(
            w in proptest::collection::vec(prop_oneof![0.0f64..10.0, 1e-300f64..1e-290, 1e200f64..1e210], 1..200),
            total in prop_oneof![1u64..1000, 1u64..(1 << 53)],
        ) {
            let mut counts = w.clone();
            whole_counts(&mut counts, total);
            prop_assert!(counts.iter().all(|c| *c >= 0.0 && c.fract() == 0.0));
            prop_assert_eq!(counts.iter().map(|&c| c as u64).sum::<u64>(), total);
        }

        #[test]
        fn masses_sum_closely(w in proptest::collection::vec(1e-12f64..1e12, 1..200), total in 1e-20f64..1e20) {
            let mut masses = w;
            rescale(&mut masses, total);
            prop_assert!((compensated(&masses) / total - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn equal_remainders_go_to_the_first() {
        let mut c = [1.0; 4];
        whole_counts(&mut c, 6);
        assert_eq!(c, [2.0, 2.0, 1.0, 1.0]);
    }
}

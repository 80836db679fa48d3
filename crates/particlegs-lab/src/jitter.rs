//! Spreads decoded particles over their bins: at bin centres they would show up as a lattice.

use crate::PositionColumns;
use particlegs_core::math::{Purpose, Random};
use particlegs_core::parallel;

/// Moves every coordinate by a uniform draw of at most `bound`, also after rounding to float32: the error is then at
/// most twice the bound.
pub fn jittered(decoded: &PositionColumns, bound: f64, seed: u64) -> PositionColumns {
    let columns = parallel::map(0..3, |k| {
        let mut random = Random::from_purpose(Purpose::Jitter, seed, k as u64);
        decoded[k].iter().map(|v| moved(*v, (2.0 * random.uniform() - 1.0) * bound, bound)).collect()
    });
    columns.try_into().expect("three axes")
}

/// A moved coordinate, rounded back towards the original if rounding exceeds the bound.
fn moved(from: f32, by: f64, bound: f64) -> f32 {
    let to = (f64::from(from) + by) as f32;
    match (f64::from(to) - f64::from(from)).abs() <= bound {
        true => to,
        false if to > from => to.next_down().max(from),
        false if to < from => to.next_up().min(from),
        false => from,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Baseline, largest_error, lcp::Lcp, testing};
    use proptest::prelude::*;

    #[test]
    fn moved_particles_stay_within_twice_the_bound() {
        let particles = testing::clustered(5000);
        let coded = Lcp.compress(&particles, 0.3).unwrap();
        let decoded = Lcp.decompress(&coded.bytes).unwrap();
        let spread = jittered(&decoded, 0.3, 1);
        assert!(largest_error(&particles, &spread, coded.order.as_deref()) <= 0.6);
        // Uniform within the bound: a variance of a third of its square.
        let squares = decoded[1].iter().zip(&spread[1]).map(|(a, b)| f64::from(a - b).powi(2));
        let share = squares.sum::<f64>() / 5000.0 / (0.3 * 0.3 / 3.0);
        assert!((share - 1.0).abs() < 0.05, "{share}");
        assert_eq!(spread, jittered(&decoded, 0.3, 1));
        assert_ne!(spread, jittered(&decoded, 0.3, 2));
    }

    proptest! {
        #[test]
        fn none_moves_by_more_than_the_bound(from: f32, by in -1.0f64..1.0, bound in 1e-9f64..1e9) {
            prop_assume!(from.is_finite());
            let to = moved(from, by * bound, bound);
            prop_assert!((f64::from(to) - f64::from(from)).abs() <= bound, "{from} {to}");
        }
    }
}

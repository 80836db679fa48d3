use super::*;
use crate::testing::{self, clustered};
use proptest::prelude::*;

fn held(particles: &PositionColumns, bound: f64) -> usize {
    testing::held(&Lcp, particles, bound)
}

#[test]
fn the_bound_is_kept_and_larger_bounds_give_smaller_files() {
    let particles = clustered(5000);
    let sizes = [0.001, 0.03, 0.5, 4.0, 100.0].map(|bound| held(&particles, bound));
    assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
    assert!(sizes[2] * 4 < 12 * 5000);
}

#[test]
fn unusual_particles_survive_a_round_trip() {
    let one = |x: f32| [vec![x], vec![-x], vec![0.0]];
    held(&one(3.0), 0.1);
    held(&[vec![5.0; 100], vec![5.0; 100], vec![5.0; 100]], 0.1);
    held(&[vec![0.0, 1e7], vec![0.0, 1.0], vec![0.0, 1.0]], 0.1);
    held(&[vec![0.0, 1e-6, 9e5], vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 2.0]], 1e-7);
    assert!(Lcp.compress(&one(1.0), 0.0).is_err() && Lcp.compress(&one(1.0), f64::NAN).is_err());
}

#[test]
fn damaged_bytes_are_refused() {
    let good = Lcp.compress(&clustered(300), 0.3).unwrap().bytes;
    let plain = unpacked(&good).unwrap();
    for i in 0..plain.len() {
        for flip in [1, 0x80, 0xff] {
            let mut bad = plain.clone();
            bad[i] ^= flip;
            // Nothing may panic.
            let _ = Lcp.decompress(&packed(&bad));
        }
        let _ = Lcp.decompress(&packed(&plain[..i]));
    }
    assert!(Lcp.decompress(&[]).is_err() && Lcp.decompress(&good[..20]).is_err());
}

proptest! {
    #[test]
    fn any_particles_are_within_the_bound(
        rows in prop::collection::vec([-1e3f32..1e3, -1.0f32..1.0, 0.0f32..1e-3], 1..200),
        bound in 1e-4f64..10.0,
    ) {
        let column = |k: usize| rows.iter().map(|r| r[k]).collect();
        held(&[0, 1, 2].map(column), bound);
    }
}

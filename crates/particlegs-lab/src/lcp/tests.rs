use super::*;
use crate::largest_error;
use proptest::prelude::*;

fn held(particles: &Columns, bound: f64) -> usize {
    let coded = Lcp.compress(particles, bound).unwrap();
    let decoded = Lcp.decompress(&coded.bytes).unwrap();
    assert_eq!(decoded[0].len(), particles[0].len());
    let error = largest_error(particles, &decoded, coded.order.as_deref());
    // The decoder rounds to float32.
    let ulp = particles.iter().flatten().fold(0f32, |m, v| m.max(v.abs())) * f32::EPSILON;
    assert!(error <= bound * (1.0 + 1e-12) + f64::from(ulp), "{error} for {bound}");
    coded.bytes.len()
}

fn clustered(n: usize) -> Columns {
    let mut random = particlegs::math::Random::new(7, 0, 0);
    let centres: Vec<[f64; 3]> = (0..20).map(|_| [0, 1, 2].map(|_| 50.0 * random.uniform())).collect();
    let mut columns = [Vec::new(), Vec::new(), Vec::new()];
    for i in 0..n {
        for k in 0..3 {
            columns[k].push((centres[i % 20][k] + random.normal()) as f32);
        }
    }
    columns
}

#[test]
fn the_bound_is_kept_and_larger_bounds_give_smaller_files() {
    let particles = clustered(5000);
    let sizes = [0.001, 0.03, 0.5, 4.0, 100.0].map(|bound| held(&particles, bound));
    assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
    assert!(sizes[2] * 4 < 12 * 5000);
}

#[test]
fn odd_particles_come_back() {
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
            // Whatever comes, it is no panic.
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

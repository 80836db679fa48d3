//! Particles and checks that the tests of all baselines share.

use crate::snapshot::Snapshot;
use crate::{Baseline, PositionColumns, largest_error};
use particlegs_core::math::Random;
use particlegs_particles::Particles;

/// `n` particles on a lattice that repeats itself, their numbers changed by `f`.
pub fn lattice(n: u32, f: fn(f32) -> f32) -> Particles {
    let column = |k: u32| (0..n).map(|i| f((i * (k + 7) % 997) as f32)).collect::<Vec<f32>>();
    Particles::from_columns(column(1), column(2), column(3))
}

/// 3000 of them as a snapshot.
pub fn snapshot() -> Snapshot {
    Snapshot::new("s".into(), "s".into(), lattice(3000, |v| v), None)
}

/// Twenty clumps of radius 1 in a box of edge 50.
pub fn clustered(n: usize) -> PositionColumns {
    let mut random = Random::new(7, 0, 0);
    let centres: Vec<[f64; 3]> = (0..20).map(|_| [0, 1, 2].map(|_| 50.0 * random.uniform())).collect();
    let mut columns: PositionColumns = Default::default();
    for i in 0..n {
        for (k, column) in columns.iter_mut().enumerate() {
            column.push((centres[i % 20][k] + random.normal()) as f32);
        }
    }
    columns
}

/// Unusual particles, each with a bound: none, one, two, all in one place, on a line, far from the origin, of a huge
/// range.
pub fn odd() -> Vec<(PositionColumns, f64)> {
    let noise = clustered(300);
    let far = noise.clone().map(|c| c.into_iter().map(|v| v + 1e7).collect());
    vec![
        (Default::default(), 0.1),
        ([vec![3.0], vec![-3.0], vec![0.0]], 0.1),
        ([vec![0.0, 1e7], vec![0.0, 1.0], vec![0.0, 1.0]], 0.1),
        ([vec![5.0; 100], vec![5.0; 100], vec![5.0; 100]], 0.1),
        ([vec![5.0; 300], vec![-2.5; 300], noise[2].clone()], 0.01),
        (far, 0.3),
        ([vec![0.0, 1e-6, 9e5], vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 2.0]], 1e-7),
        ([vec![-3e38, 3e38, 1.0], vec![0.0; 3], vec![1e-40; 3]], 1.0),
        ([vec![-3e38, 3e38, 1.0], vec![0.0; 3], vec![1e-40; 3]], 1e38),
    ]
}

/// Checks the bound of a round trip, within half a float32 ulp of the largest coordinate; returns its bytes.
pub fn held(baseline: &dyn Baseline, particles: &PositionColumns, bound: f64) -> usize {
    let coded = baseline.compress(particles, bound).unwrap();
    let decoded = baseline.decompress(&coded.bytes).unwrap();
    decoded.iter().for_each(|c| assert_eq!(c.len(), particles[0].len()));
    if let Some(order) = &coded.order {
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..particles[0].len() as u32), "the order does not list every particle once");
    }
    let error = largest_error(particles, &decoded, coded.order.as_deref());
    let largest = particles.iter().flatten().fold(0f32, |m, v| m.max(v.abs()));
    assert!(error <= bound + 0.5 * f64::from(largest * f32::EPSILON), "{error} for {bound}");
    assert_eq!(coded.bytes, baseline.compress(particles, bound).unwrap().bytes, "not the same bytes twice");
    coded.bytes.len()
}

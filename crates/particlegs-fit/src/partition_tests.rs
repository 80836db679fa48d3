//! The partition: nothing lost, any input, any number of threads.

use crate::partition::partition;
use crate::{Moments, ParticleStore, Partition, PartitionOptions};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, each_axis};
use particlegs_core::model::{Columns, Law, MASS, Mixture};
use particlegs_particles::testing::{on_threads, sample};
use particlegs_particles::{Column, Particles};
use proptest::prelude::*;

impl Partition {
    /// The cells as Gaussians, world units.
    pub(crate) fn mixture(&self) -> Mixture {
        let unit = 1.0 / self.store.scale;
        let column = |f: &dyn Fn(&Moments) -> f64| self.moments.iter().map(f).collect::<Vec<f64>>();
        let mut columns = Columns::default();
        if self.store.weight.is_some() {
            columns.set(MASS, column(&|m| m.mass));
        }
        Mixture {
            mean: each_axis(|k| column(&|m| self.store.origin[k] + m.mean[k] * unit)),
            cov: std::array::from_fn(|k| column(&|m| m.cov.0[k] * unit * unit)),
            count: column(&|m| m.count as f64),
            columns,
            law: Law::OpticalDepth,
            fields: Columns::default(),
        }
    }
}

fn cut(p: &Particles, gaussians: usize) -> Partition {
    cut_with(p, gaussians, &Context::SILENT)
}

fn cut_with(p: &Particles, gaussians: usize, context: &Context<'_>) -> Partition {
    let radius = p.bounds().default_radius(p.len() as u64);
    partition(ParticleStore::new(p, &p.local_bounds()), gaussians, radius, PartitionOptions::default(), context)
        .unwrap()
}

/// Cells tile the store, the store is a permutation of the particles, sums are kept.
fn check(p: &Particles, part: &Partition) {
    assert_eq!(part.cells.len(), part.moments.len());
    assert_eq!(part.cells.first().unwrap().start, 0);
    assert_eq!(part.cells.last().unwrap().end, p.len());
    for w in part.cells.windows(2) {
        assert_eq!(w[0].end, w[1].start);
    }
    assert!(part.cells.iter().all(|c| !c.is_empty()));
    let key = |q: [f64; 3], w: f32| (q.map(f64::to_bits), w.to_bits());
    let weight = |w: &Option<Vec<f32>>, i: usize| w.as_ref().map_or(1.0, |w| w[i]);
    let mut before: Vec<_> = (0..p.len()).map(|i| key(p.position(i), p.weights().map_or(1.0, |w| w[i]))).collect();
    let store = &part.store;
    let mut after: Vec<_> =
        (0..store.len()).map(|i| key(store.to_world(store.xyz[i].map(f64::from)), weight(&store.weight, i))).collect();
    before.sort_unstable();
    after.sort_unstable();
    assert!(before == after, "the store is a permutation");
    let mixture = part.mixture();
    assert_eq!(mixture.count.iter().sum::<f64>(), p.len() as f64);
    let mass: f64 = (0..mixture.len()).map(|i| mixture.mass_of(i)).sum();
    assert!((mass / p.total_mass() - 1.0).abs() < 1e-12);
    for i in 0..mixture.len() {
        assert!(mixture.mean_of(i).iter().all(|v| v.is_finite()));
        let e = mixture.cov_of(i).eigen();
        assert!(e.values[2] >= -1e-9 * e.values[0], "{e:?}");
    }
}

fn cloud(seed: u64, n: u64, unit: f32, flat: [bool; 3]) -> Particles {
    let column = |k: u32| -> Vec<f32> {
        (0..n)
            .map(|i| {
                let mut r = Random::new(seed, k, i);
                if flat[k as usize] { unit } else { (r.normal() as f32 + 3.0 * (i % 5) as f32) * unit }
            })
            .collect()
    };
    Particles::from_columns(column(0), column(1), column(2))
}

#[test]
fn degenerate_clouds_give_as_many_cells_as_they_have_places() {
    for (p, most) in [
        (cloud(1, 1, 1.0, [false; 3]), 1),
        (cloud(1, 1, 0.0, [true; 3]), 1),
        (cloud(1, 1000, 0.0, [true; 3]), 1),
        (cloud(1, 1000, 7.5, [true; 3]), 1),
        (cloud(1, 2, 1.0, [false; 3]), 2),
        (cloud(1, 50, 1.0, [false; 3]), 50),
        (cloud(1, 1000, 1.0, [true, true, false]), 1000),
        (cloud(1, 1000, 1.0, [true, false, false]), 1000),
        (cloud(1, 1000, 1e-30, [false; 3]), 1000),
        (cloud(1, 1000, 1e30, [false; 3]), 1000),
    ] {
        for gaussians in [1, 2, 3, 40, 5000] {
            let part = cut(&p, gaussians);
            check(&p, &part);
            assert_eq!(part.cells.len(), gaussians.min(most), "of {gaussians} for {} particles", p.len());
        }
    }
}

#[test]
fn repeated_places_give_one_cell_each() {
    let x: Vec<f32> = (0..900).map(|i| 1000.0 + (i % 7) as f32).collect();
    let p = Particles::from_columns(x, vec![1e5; 900], vec![-3e-3; 900]);
    let part = cut(&p, 100);
    check(&p, &part);
    assert_eq!(part.cells.len(), 7);
}

#[test]
fn weights_are_carried_and_change_no_cut() {
    let mut p = cloud(3, 5000, 2.0, [false; 3]);
    p = p.with_weights(Column::owned((0..5000).map(|i| 0.5 + (i % 13) as f32).collect()));
    let part = cut(&p, 300);
    check(&p, &part);
    let plain = p.clone().without_weights();
    assert_eq!(cut(&plain, 300).store.xyz, part.store.xyz, "the geometry counts particles");
}

#[test]
fn the_origin_changes_no_cut() {
    let mut p = cloud(4, 3000, 1.0, [false; 3]);
    p.origin = [1e9, -1e9, 3.0];
    let part = cut(&p, 100);
    let mut near = p.clone();
    near.origin = [0.0; 3];
    let near_partition = cut(&near, 100);
    check(&near, &near_partition);
    assert!(part.store.xyz == near_partition.store.xyz && part.cells == near_partition.cells);
}

#[test]
fn threads_change_no_cell() {
    let p = sample();
    let (one, three) = (on_threads(1, || cut(&p, 2000)), on_threads(3, || cut(&p, 2000)));
    check(&p, &one);
    assert_eq!(one.cells.len(), 2000);
    assert!(one.store == three.store && one.cells == three.cells && one.moments == three.moments);
    let plain = cut_with(&p, 2000, &Context::scalar());
    assert!(one.store == plain.store && one.cells == plain.cells && one.moments == plain.moments);
}

#[test]
fn radii_that_are_not_positive_and_no_gaussians_are_refused() {
    let p = cloud(5, 10, 1.0, [false; 3]);
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            partition(
                ParticleStore::new(&p, &p.local_bounds()),
                3,
                radius,
                PartitionOptions::default(),
                &Context::SILENT
            )
            .is_err()
        );
    }
    assert!(
        partition(ParticleStore::new(&p, &p.local_bounds()), 0, 1.0, PartitionOptions::default(), &Context::SILENT)
            .is_err()
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..Default::default() })]
    #[test]
    fn any_cloud_is_kept(seed in 0u64..1000, n in 1u64..800, gaussians in 1usize..900, power in -30i32..30) {
        let p = cloud(seed, n, 10f32.powi(power), [false; 3]);
        let part = cut(&p, gaussians);
        check(&p, &part);
        prop_assert!(part.cells.len() <= gaussians.min(n as usize));
    }
}

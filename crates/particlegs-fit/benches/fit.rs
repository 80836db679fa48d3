//! Speed of the partition on the sample and on a cloud of four million particles.

use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_fit::{Effort, FitOptions, fit};
use particlegs_particles::Particles;
use std::path::Path;

fn main() {
    divan::main();
}

fn cells(bencher: divan::Bencher, p: &Particles, gaussians: usize) {
    let radius = p.bounds().default_radius(p.len() as u64);
    let options = FitOptions { effort: Effort::Fast, ..FitOptions::new(gaussians, radius) };
    bencher.counter(divan::counter::ItemsCount::new(p.len())).bench(|| fit(p, &options, &Context::SILENT).unwrap());
}

#[divan::bench(args = [250, 2500, 25_000], sample_count = 10)]
fn sample(bencher: divan::Bencher, gaussians: usize) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    cells(bencher, &Particles::open_raw(&[folder]).unwrap(), gaussians);
}

#[divan::bench(args = [4_000, 40_000], sample_count = 3)]
fn cloud(bencher: divan::Bencher, gaussians: usize) {
    // Clumps of 1000 particles of different sizes.
    let n = 4_000_000u64;
    let column = |k: u32| {
        let clump = |c: u64| {
            let mut r = Random::new(1, k, c);
            (r.uniform() as f32, 0.1 * (Random::new(1, 9, c).uniform() as f32).powi(3))
        };
        let clumps: Vec<_> = (0..n / 1000).map(clump).collect();
        (0..n)
            .map(|i| {
                let (centre, size) = clumps[(i / 1000) as usize];
                centre + size * Random::new(2, k, i).normal() as f32
            })
            .collect::<Vec<f32>>()
    };
    cells(bencher, &Particles::from_columns(column(0), column(1), column(2)), gaussians);
}

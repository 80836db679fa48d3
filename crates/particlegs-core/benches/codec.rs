//! Coding and decoding of a synthetic block: `cargo bench -p particlegs-core --bench codec`.

#![allow(clippy::disallowed_methods)]

use particlegs_core::codec::{Encoder, Precision, decode_block};
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::{Block, Mixture};
use particlegs_core::space::Bounds;

fn main() {
    divan::main();
}

fn block(n: usize) -> Block {
    let mut gaussians = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(1, 1, i as u64);
        let cluster = Random::new(1, 2, i as u64 / 20).uniform();
        let size = 1e-3 * (0.8 * r.normal()).exp();
        let v: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| size * r.normal()));
        let cov = v.iter().fold(Sym3::default(), |s, &v| s.add(&Sym3::outer(v)));
        let mean = std::array::from_fn(|_| cluster + 0.03 * r.normal());
        gaussians.push(mean, cov, (4.0 + 0.5 * r.normal()).exp(), 0.0);
    }
    let mut bounds = Bounds::empty();
    (0..n).for_each(|i| bounds.include(gaussians.mean_of(i)));
    let count = gaussians.count.iter().sum::<f64>() as u64;
    Block { bounds, count, mass: count as f64, gaussians }
}

#[divan::bench(args = [20_000, 171_000], sample_count = 10)]
fn prepare(bencher: divan::Bencher, n: usize) {
    let b = block(n);
    bencher.bench(|| Encoder::new(&b).map(|e| e.len()));
}

#[divan::bench(args = [20_000, 171_000], sample_count = 10)]
fn encode(bencher: divan::Bencher, n: usize) {
    let Ok(encoder) = Encoder::new(&block(n)) else { return };
    bencher.bench(|| encoder.encode(&Precision::BALANCED));
}

#[divan::bench(args = [20_000, 171_000], sample_count = 10)]
fn decode(bencher: divan::Bencher, n: usize) {
    let Ok(encoder) = Encoder::new(&block(n)) else { return };
    let bytes = encoder.encode(&Precision::BALANCED);
    bencher.bench(|| decode_block(&bytes, "bench"));
}

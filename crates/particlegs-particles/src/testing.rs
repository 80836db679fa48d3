//! Particles and models that tests of several crates share.

use crate::{Column, Domain, Particles};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
use particlegs_core::space::{Bounds, Cell};
use std::path::Path;

/// A model of given Gaussians (mean, covariance, count) in a periodic box.
pub fn model_of(gaussians: &[([f64; 3], Sym3, f64)], length: [f64; 3]) -> Model {
    let mut m = Mixture::default();
    gaussians.iter().for_each(|(mean, cov, count)| m.push(*mean, *cov, *count, *count));
    let count = m.count.iter().sum::<f64>() as u64;
    let bounds = Bounds { min: [0.0; 3], max: length };
    let cell = Some(Cell::orthogonal(length));
    let metadata = Metadata { cell, default_radius: 0.01, ..Metadata::new(LawKind::OpticalDepth, count, bounds) };
    let block = Block { bounds, count, mass: count as f64, gaussians: m };
    let layer = Layer { name: "all".into(), mass: Mass::Unknown, content: vec![block] };
    Model { metadata, layers: vec![layer], certificate: None }
}

/// A triclinic, a hexagonal and a truncated octahedral cell, and a hexagonal slab whose third vector leans.
pub fn tilted_cells() -> [Cell; 4] {
    let cell_of = |vectors, periodic| Cell { vectors, periodic, ..Cell::orthogonal([0.0; 3]) };
    let hexagonal = [[6.0, 0.0, 0.0], [3.0, 27f64.sqrt(), 0.0]];
    let third = 7.0 / 3.0;
    [
        cell_of([[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]], [true; 3]),
        cell_of([hexagonal[0], hexagonal[1], [0.0, 0.0, 5.0]], [true; 3]),
        cell_of(
            [[7.0, 0.0, 0.0], [third, third * 8f64.sqrt(), 0.0], [-third, third * 2f64.sqrt(), third * 6f64.sqrt()]],
            [true; 3],
        ),
        cell_of([hexagonal[0], hexagonal[1], [0.3, 0.5, 5.0]], [true, true, false]),
    ]
}

/// An ideal gas in a cell.
pub fn gas(n: usize, cell: &Cell, seed: u64) -> Particles {
    // What does not repeat stands upright on the others.
    let vectors = cell.reduced().vectors;
    let mut p = from_points(random_points(n, seed, |_, r| {
        let f = [0; 3].map(|_| r.uniform());
        each_axis(|k| cell.origin[k] + (0..3).map(|a| f[a] * vectors[a][k]).sum::<f64>())
    }));
    p.meta.cell = Some(*cell);
    p
}

/// `n` points, each of its own number and its own random numbers.
pub fn random_points(n: usize, seed: u64, place: impl Fn(u64, &mut Random) -> [f64; 3]) -> Vec<[f64; 3]> {
    (0..n as u64).map(|i| place(i, &mut Random::new(seed, 0, i))).collect()
}

/// The square of the distance by the shortest way.
pub fn square_between(domain: &Domain, a: [f64; 3], b: [f64; 3]) -> f64 {
    domain.shortest_way(each_axis(|k| b[k] - a[k])).iter().map(|v| v * v).sum()
}

/// Particles all over a box of a million, the first 70 000 in layer `a` and the others in `b`, each with a weight.
pub fn two_layers(n: usize, weight: impl Fn(usize) -> f32) -> Particles {
    let column = |k: usize| (0..n).map(|i| ((i * (7 + k) * 2_654_435_761) % 1_000_003) as f32).collect::<Vec<f32>>();
    let layer = |name: &str, content| Layer { name: name.into(), mass: Mass::Weights(None), content };
    Particles::from_columns(column(0), column(1), column(2))
        .with_weights(Column::owned((0..n).map(weight).collect()))
        .with_layers(vec![layer("a", 0..70_000), layer("b", 70_000..n)])
}

/// Even particles at random in a box from 0.
pub fn poisson(n: usize, length: [f64; 3], seed: u64) -> Particles {
    let place = |i| each_axis(|k| Random::new(seed, k as u32, i).uniform() * length[k]);
    from_points((0..n as u64).map(place))
}

/// Particles at these places, rounded to f32, about the origin 0.
pub fn from_points(places: impl IntoIterator<Item = [f64; 3]>) -> Particles {
    let places: Vec<[f64; 3]> = places.into_iter().collect();
    let [x, y, z] = [0, 1, 2].map(|k| places.iter().map(|p| p[k] as f32).collect());
    Particles::from_columns(x, y, z)
}

/// The sample of 64³ particles.
pub fn sample() -> Particles {
    Particles::open_raw(&[Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")]).unwrap()
}

/// The result of `work` with so many threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon_core::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// The context of work that is cancelled from its beginning.
pub fn cancelled() -> Context<'static> {
    Context::SILENT.with_cancel(&|| true)
}

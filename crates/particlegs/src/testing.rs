//! What the tests of this module share.

use crate::math::{Random, Sym3};
use crate::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
use crate::particles::Particles;
use crate::space::{Bounds, Cell};

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
pub(crate) fn tilted_cells() -> [Cell; 4] {
    let of = |vectors, periodic| Cell { vectors, periodic, ..Cell::orthogonal([0.0; 3]) };
    let hexagonal = [[6.0, 0.0, 0.0], [3.0, 27f64.sqrt(), 0.0]];
    let third = 7.0 / 3.0;
    [
        of([[10.0, 0.0, 0.0], [4.0, 9.0, 0.0], [2.0, 3.0, 8.0]], [true; 3]),
        of([hexagonal[0], hexagonal[1], [0.0, 0.0, 5.0]], [true; 3]),
        of(
            [[7.0, 0.0, 0.0], [third, third * 8f64.sqrt(), 0.0], [-third, third * 2f64.sqrt(), third * 6f64.sqrt()]],
            [true; 3],
        ),
        of([hexagonal[0], hexagonal[1], [0.3, 0.5, 5.0]], [true, true, false]),
    ]
}

/// An ideal gas in a cell.
pub(crate) fn gas(n: usize, cell: &Cell, seed: u64) -> Particles {
    let mut columns = [vec![], vec![], vec![]];
    // What does not repeat stands upright on the others.
    let vectors = cell.reduced().vectors;
    for i in 0..n as u64 {
        let mut r = Random::new(seed, 0, i);
        let f = [0; 3].map(|_| r.uniform());
        (0..3).for_each(|k| {
            columns[k].push((cell.origin[k] + (0..3).map(|a| f[a] * vectors[a][k]).sum::<f64>()) as f32);
        });
    }
    let [x, y, z] = columns;
    let mut p = Particles::from_columns(x, y, z);
    p.meta.cell = Some(*cell);
    p
}

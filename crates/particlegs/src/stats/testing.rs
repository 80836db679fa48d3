//! What the tests of this module share.

use crate::math::Sym3;
use crate::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
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

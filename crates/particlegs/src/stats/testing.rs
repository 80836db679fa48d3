//! What the tests of this module share.

use crate::math::Sym3;
use crate::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model, Recipe};
use crate::space::{Bounds, Cell};

/// A model of given Gaussians (mean, covariance, count) in a periodic box.
pub fn model_of(gaussians: &[([f64; 3], Sym3, f64)], length: [f64; 3]) -> Model {
    let mut m = Mixture::default();
    gaussians.iter().for_each(|(mean, cov, count)| m.push(*mean, *cov, *count, *count));
    let count = m.count.iter().sum::<f64>() as u64;
    let bounds = Bounds { min: [0.0; 3], max: length };
    let metadata = Metadata {
        law: LawKind::OpticalDepth,
        count,
        mass: count as f64,
        bounds,
        cell: Some(Cell::orthogonal(length)),
        default_radius: 0.01,
        default_opacity: 0.05,
        source: String::new(),
        source_hash: [0; 32],
        length_unit: None,
        mass_unit: None,
        comoving: None,
        scale_factor: None,
        hubble: None,
        time: None,
        recipe: Recipe::default(),
        tool_version: String::new(),
    };
    let block = Block { bounds, count, mass: count as f64, gaussians: m };
    let layer = Layer { name: "all".into(), mass: Mass::Unknown, content: vec![block] };
    Model { metadata, layers: vec![layer], certificate: None }
}

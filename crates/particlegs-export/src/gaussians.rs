//! What the tables of Gaussians share.

use particlegs::model::{Block, LawKind, Layer, Mixture, Model};

/// A Gaussian of a layer.
pub struct One<'a> {
    /// Its mixture.
    pub of: &'a Mixture,
    /// Its number there.
    pub i: usize,
    /// The number of its layer.
    pub layer: usize,
    /// The mass of weight 1 in its layer, 1 where none is known.
    pub unit: f64,
}

impl One<'_> {
    /// Its mass in the unit of mass.
    pub fn mass(&self) -> f64 {
        self.unit * self.of.mass_of(self.i)
    }

    /// Its opacity and its grey level, of the alpha-blend law.
    pub fn splat(&self) -> [f64; 2] {
        self.of.law.alpha_blend().map_or([0.0; 2], |own| [own.opacity[self.i], own.grey[self.i]])
    }
}

/// All of them, layer by layer and block by block.
pub fn all(model: &Model) -> impl Iterator<Item = One<'_>> {
    let of_layer = |(layer, l): (usize, &'_ Layer<Vec<Block>>)| (layer, l.mass.unit_or_one());
    model.layers.iter().enumerate().flat_map(move |(number, l)| {
        let (layer, unit) = of_layer((number, l));
        l.content
            .iter()
            .flat_map(move |b| (0..b.gaussians.len()).map(move |i| One { of: &b.gaussians, i, layer, unit }))
    })
}

/// Is it a model whose Gaussians have opacities and grey levels?
pub fn has_opacities(model: &Model) -> bool {
    model.metadata.law == LawKind::AlphaBlend
}

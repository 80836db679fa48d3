//! What the tables of Gaussians share.

use particlegs_pipeline::model::{LawKind, Mixture, Model};

pub struct LayerGaussian<'a> {
    pub of: &'a Mixture,
    pub i: usize,
    pub layer: usize,
    /// The mass of weight 1 in its layer, 1 where none is known.
    pub unit: f64,
}

impl LayerGaussian<'_> {
    pub fn mass(&self) -> f64 {
        self.unit * self.of.mass_of(self.i)
    }

    pub fn splat(&self) -> [f64; 2] {
        self.of.law.alpha_blend().map_or([0.0; 2], |own| [own.opacity[self.i], own.grey[self.i]])
    }
}

/// All of them, layer by layer and block by block.
pub fn all(model: &Model) -> impl Iterator<Item = LayerGaussian<'_>> {
    model.layers.iter().enumerate().flat_map(|(layer, l)| {
        let unit = l.mass.unit_or_one();
        let of = move |g| (0..Mixture::len(g)).map(move |i| LayerGaussian { of: g, i, layer, unit });
        l.content.iter().flat_map(move |b| of(&b.gaussians))
    })
}

pub fn has_opacities(model: &Model) -> bool {
    model.metadata.law == LawKind::AlphaBlend
}

//! Numbers of a Gaussian, for all tables of Gaussians.

use particlegs_core::math::Sym3;
use particlegs_core::model::{LawKind, Mixture, Model, Quantity};

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

    /// The numbers of a field: means of its values, slopes (x, y, z of each component), and the variance or the rows of
    /// the covariance, the latter two of natural logarithms where it is logarithmic; of a sum its totals and their
    /// slopes, without a variance; NaN where the layer lacks it.
    pub fn field(&self, q: &Quantity) -> FieldNumbers {
        let components = q.component_names().len();
        let Some(f) = self.of.fields.get(&q.name) else {
            return FieldNumbers {
                mean: vec![f64::NAN; components],
                slope: vec![f64::NAN; 3 * components],
                spread: vec![f64::NAN; components * components],
            };
        };
        let spread = match components {
            1 => vec![f.spread[0][self.i]],
            _ => Sym3(std::array::from_fn(|k| f.spread[k][self.i])).rows().as_flattened().to_vec(),
        };
        let mean = (0..components).map(|k| f.overall_value(k, self.i, &self.of.cov_of(self.i)));
        let slope = f.slope.iter().flatten().map(|c| c[self.i]);
        if q.extensive {
            let weight = self.of.mass_of(self.i);
            let weighted_value = |v: f64| weight * v;
            return FieldNumbers {
                mean: mean.map(weighted_value).collect(),
                slope: slope.map(weighted_value).collect(),
                spread: vec![f64::NAN],
            };
        }
        FieldNumbers { mean: mean.collect(), slope: slope.collect(), spread }
    }

    pub fn splat(&self) -> [f64; 2] {
        self.of.law.alpha_blend().map_or([0.0; 2], |a| [a.opacity[self.i], a.grey[self.i]])
    }
}

/// Numbers of a Gaussian's field.
pub struct FieldNumbers {
    pub mean: Vec<f64>,
    pub slope: Vec<f64>,
    pub spread: Vec<f64>,
}

/// All of them, layer by layer and block by block.
pub fn all(model: &Model) -> impl Iterator<Item = LayerGaussian<'_>> {
    model.layers.iter().enumerate().flat_map(|(layer, l)| {
        let unit = l.mass.unit_or_one();
        let gaussians_of = move |g| (0..Mixture::len(g)).map(move |i| LayerGaussian { of: g, i, layer, unit });
        l.content.iter().flat_map(move |b| gaussians_of(&b.gaussians))
    })
}

pub fn has_opacities(model: &Model) -> bool {
    model.metadata.law == LawKind::AlphaBlend
}

//! The thickness of a flat box: there Gaussians that are a few per cent too wide show at once.

use particlegs_core::model::{Mixture, Model};
use particlegs_core::space::Bounds;
use particlegs_particles::Particles;

#[derive(Clone, Copy, Debug)]
pub(super) struct Thickness {
    pub axis: usize,
    variance: f64,
}

impl Thickness {
    /// Codings at most until the Gaussians have it.
    pub const TRIALS: usize = 5;

    /// `None` where the bounds are not flat.
    pub fn new(particles: &Particles, bounds: &Bounds) -> Option<Thickness> {
        let axis = bounds.thin_axis()?;
        // About the middle, so that the difference of the squares keeps its digits.
        let pivot = bounds.center()[axis] - particles.origin[axis];
        let parts = particles.par_chunks(|_, chunk| {
            let places = chunk.position[axis].iter().map(|&v| f64::from(v) - pivot);
            places.fold([0.0; 2], |s, d| [s[0] + d, s[1] + d * d])
        });
        let [first, second] = [0, 1].map(|k| parts.iter().map(|s| s[k]).sum::<f64>() / particles.len() as f64);
        Some(Thickness { axis, variance: second - first * first }).filter(|t| t.variance > 0.0)
    }

    /// The factor on Gaussians' widths along the axis that gives the particles' variance, 1/4 to 4.
    pub fn factor(&self, gaussians: &[&Mixture]) -> f64 {
        let [between, within] = self.variances(gaussians);
        ((self.variance - between) / within.max(f64::MIN_POSITIVE)).clamp(0.0625, 16.0).sqrt()
    }

    /// A note for the user if a model is a tenth thicker or thinner than its particles.
    pub fn note(&self, model: &Model) -> Option<String> {
        let gaussians: Vec<_> = model.layers.iter().flat_map(|l| &l.content).map(|b| &b.gaussians).collect();
        let ratio = (self.variances(&gaussians).iter().sum::<f64>() / self.variance).sqrt();
        let axis = ["x", "y", "z"][self.axis];
        let note = format!("the box is flat: along {axis} the model is {ratio:.2} times as wide as the particles");
        (!(0.9..1.1).contains(&ratio)).then_some(note)
    }

    /// The variance of the Gaussians' means, and the mean of their variances.
    fn variances(&self, gaussians: &[&Mixture]) -> [f64; 2] {
        let k = self.axis;
        let sum = |value: &dyn Fn(&Mixture, usize) -> f64| -> f64 {
            gaussians.iter().map(|g| (0..g.len()).map(|i| g.count[i] * value(g, i)).sum::<f64>()).sum()
        };
        let count = sum(&|_, _| 1.0);
        let centre = sum(&|g, i| g.mean[k][i]) / count;
        [sum(&|g, i| (g.mean[k][i] - centre).powi(2)), sum(&|g, i| g.cov_of(i).variance(k))].map(|s| s / count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Options, compress};
    use particlegs_core::checkpoint::NoCheckpoints;

    use particlegs_core::context::Context;
    use particlegs_core::model::CertificateLevel;
    use particlegs_particles::testing::{from_points, random_points};

    /// Uniform in a box, and the model's deviation along `axis` over theirs; a note says where they differ.
    fn thickness(edges: [f64; 3], axis: usize) -> f64 {
        let particles = from_points(random_points(20_000, 21, |_, r| edges.map(|e| e * r.uniform())));
        let options = Options { certificate: CertificateLevel::None, ..Options::default() };
        let compressed_model = compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap();
        let thickness = Thickness::new(&particles, &particles.bounds()).unwrap();
        assert_eq!(thickness.axis, axis);
        let gaussians = compressed_model.model.layers[0].content.iter().map(|b| &b.gaussians).collect::<Vec<_>>();
        let ratio = (thickness.variances(&gaussians).iter().sum::<f64>() / thickness.variance).sqrt();
        let is_noted = compressed_model.notes.iter().any(|n| n.contains("the box is flat"));
        assert_eq!(is_noted, (ratio - 1.0).abs() > 0.1, "{ratio}");
        ratio
    }

    #[test]
    fn models_of_flat_boxes_are_as_thick_as_their_particles() {
        for (edges, axis) in [([1e3, 1e3, 0.1], 2), ([0.01, 1e3, 1e3], 0), ([1e3, 1.0, 1e3], 1)] {
            let ratio = thickness(edges, axis);
            assert!((ratio - 1.0).abs() < 0.03, "{edges:?}: {ratio}");
        }
        // Flatter than a file's numbers reach.
        assert!(thickness([1e3, 1e3, 1e-9], 2) > 1.1);
    }
}

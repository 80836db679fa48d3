//! Models made without a fit: small ones of the sample, and many equal Gaussians.

use crate::common::sample;
use particlegs_core::codec;
use particlegs_core::codec::Precision;
use particlegs_core::math::Sym3;
use particlegs_core::model::{
    AlphaBlend, Block, Law, LawKind, Layer, Mass, Metadata, Mixture, Model, VIZMAPPER_PARAMETERS, VizMapper, VizRanges,
};
use particlegs_core::space::Bounds;
use particlegs_particles::Particles;

/// A model of one layer and one block.
fn model(metadata: Metadata, gaussians: Mixture) -> Model {
    let (bounds, count, mass) = (metadata.bounds, metadata.count, metadata.mass);
    let blocks = vec![Block { bounds, count, mass, gaussians }];
    let layers = vec![Layer { name: "particles".into(), mass: Mass::Unknown, content: blocks }];
    Model { metadata, layers, certificate: None }
}

fn encoded(model: &Model) -> Vec<u8> {
    codec::encode(model, &Precision::BALANCED).unwrap()
}

/// The file of a model of `n` equal Gaussians.
pub fn equal_gaussians(n: usize) -> Vec<u8> {
    let mut gaussians = Mixture::default();
    (0..n).for_each(|_| gaussians.push([1.0; 3], Sym3::scaled_identity(0.01), 1.0, 1.0));
    let bounds = Bounds { min: [0.0; 3], max: [2.0; 3] };
    encoded(&model(Metadata::new(LawKind::OpticalDepth, n as u64, bounds), gaussians))
}

/// Runs of the sample's particles, which are compact.
const RUN: usize = 4096;

/// The file of a model: moments of some of the sample's runs, with rising opacities if the law has any.
pub fn tiny(runs: std::ops::Range<usize>, law: LawKind) -> Vec<u8> {
    let particles = Particles::open_raw(&[sample()]).unwrap();
    let mut gaussians = Mixture::default();
    let network = VizMapper {
        parameters: (0..VIZMAPPER_PARAMETERS).map(|i| 0.01 * (i % 13) as f32).collect(),
        ranges: VizRanges::TRAINING,
    };
    let mut columns = AlphaBlend { vizmapper: Some(network.into()), ..AlphaBlend::default() };
    let mut bounds = Bounds::empty();
    for run in runs {
        let all: Vec<[f64; 3]> = (RUN * run..RUN * (run + 1)).map(|i| particles.position(i)).collect();
        let mean: [f64; 3] = std::array::from_fn(|k| all.iter().map(|p| p[k]).sum::<f64>() / RUN as f64);
        let outer = |p: &[f64; 3]| Sym3::outer(std::array::from_fn(|k| p[k] - mean[k]));
        let sum = all.iter().fold(Sym3::default(), |s, p| s.add(&outer(p)));
        all.iter().for_each(|p| bounds.include(*p));
        gaussians.push(mean, sum.scale(1.0 / RUN as f64), RUN as f64, RUN as f64);
        columns.opacity.push(0.02 + 0.01 * run as f64);
        columns.grey.push(0.9);
    }
    let count = (RUN * gaussians.len()) as u64;
    if law == LawKind::AlphaBlend {
        gaussians.law = Law::AlphaBlend(columns);
    }
    let metadata = Metadata {
        cell: particles.meta.cell,
        source: "nbody64".into(),
        units: particles.meta.units.clone(),
        cosmology: particles.meta.cosmology,
        epoch: particles.meta.epoch,
        source_hash: particles.source_hash(),
        ..Metadata::new(law, count, bounds)
    };
    encoded(&model(metadata, gaussians))
}

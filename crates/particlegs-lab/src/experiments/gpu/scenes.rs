//! Built-in scenes.

use particlegs_core::camera::{Camera, View, base_distance, spiral};
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{AlphaBlend, Law, Mixture, VizMapper, VizRanges};
use particlegs_core::picture::Size;
use particlegs_core::space::Bounds;
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Result, codec, parallel};
use std::f64::consts::PI;
use std::sync::Arc;

/// Models of the bundled sample, with 751 and 668 Gaussians.
const SAMPLES: [&[u8]; 2] =
    [include_bytes!("../../../assets/gpu-751.pgs"), include_bytes!("../../../assets/gpu-668.pgs")];

/// Default opacity.
pub const OPACITY: f64 = 0.05;
/// Range of opacities of the alpha-blend law, as at the start of training from depths.
const OPACITIES: [f64; 2] = [0.02, 0.95];

/// A scene: a model of the sample, tiled.
pub struct TiledScene {
    pub gaussians: Mixture,
    pub bounds: Bounds,
    pub particles: u64,
    pub radius: f64,
}

/// Copies of a sample's model along the axes, as one snapshot.
pub fn tiled(sample: usize, tiles: [usize; 3]) -> Result<TiledScene> {
    let model = codec::decode(SAMPLES[sample], "the sample")?;
    let m = &model.metadata;
    let side = m.cell.and_then(|c| c.lengths()).unwrap_or(m.bounds.extent());
    let mut gaussians = Mixture::default();
    for x in 0..tiles[0] {
        for y in 0..tiles[1] {
            for z in 0..tiles[2] {
                for mixture in model.blocks().map(|b| &b.gaussians) {
                    for i in 0..mixture.len() {
                        let (at, tile) = (mixture.mean_of(i), [x, y, z]);
                        let mean = each_axis(|k| at[k] + tile[k] as f64 * side[k]);
                        gaussians.push(mean, mixture.cov_of(i), mixture.count[i], mixture.count[i]);
                    }
                }
            }
        }
    }
    let max = each_axis(|k| m.bounds.max[k] + (tiles[k] - 1) as f64 * side[k]);
    let bounds = Bounds { min: m.bounds.min, max };
    let particles = m.count * tiles.iter().product::<usize>() as u64;
    Ok(TiledScene { gaussians, bounds, particles, radius: bounds.default_radius(particles) })
}

/// Views from the far orbit: around it, or from one position with changing radius and opacity.
pub fn views(scene: &TiledScene, size: Size, around: bool) -> Vec<View> {
    let cameras: Vec<Camera> = spiral(scene.bounds.center(), base_distance(&scene.bounds, size), 64, None);
    let view = |(i, camera): (usize, &Camera)| {
        let change = if around { 1.0 } else { 0.5 + i as f64 / 64.0 };
        // The camera of the view whose work frames.rs counts.
        let camera = if around { *camera } else { cameras[16] };
        View { name: "far".into(), camera, radius: scene.radius * change, opacity: OPACITY * change }
    };
    cameras.iter().enumerate().map(view).collect()
}

impl TiledScene {
    /// The same scene by the alpha-blend law, as training starts from depths: widened by the particle radius, with the
    /// opacity of their depth, here with grey levels from 0.5 to 1 and an untrained network, which is as slow as a
    /// trained one.
    pub fn published(&self) -> TiledScene {
        let (m, r2) = (&self.gaussians, self.radius * self.radius);
        let (mut gaussians, mut law) = (Mixture::default(), AlphaBlend::default());
        for i in 0..m.len() {
            let cov = m.cov_of(i).add(&Sym3::scaled_identity(r2));
            let depth = m.count[i] * opacity_integral(OPACITY) * r2 / (2.0 * PI * cov.det().cbrt());
            gaussians.push(m.mean_of(i), cov, m.count[i], m.count[i]);
            law.opacity.push((-(-depth).exp_m1()).clamp(OPACITIES[0], OPACITIES[1]));
            law.grey.push(0.5 + 0.5 * Random::new(1, 2, i as u64).uniform());
        }
        law.vizmapper = Some(Arc::new(VizMapper::new(VizRanges::TRAINING, 1)));
        gaussians.law = Law::AlphaBlend(law);
        TiledScene { gaussians, ..*self }
    }

    /// Draws particles from its Gaussians, as columns relative to its centre.
    pub fn particles(&self, number: usize) -> [Vec<f32>; 3] {
        let (m, center) = (&self.gaussians, self.bounds.center());
        let one = |i: usize| -> [f32; 3] {
            let mut r = Random::new(1, 1, i as u64);
            let index = (r.uniform() * m.len() as f64) as usize % m.len();
            let (mean, e) = (m.mean_of(index), m.cov_of(index).eigen());
            let along = e.values.map(|v| v.max(0.0).sqrt() * r.normal());
            let at = |k: usize| mean[k] - center[k] + (0..3).map(|a| along[a] * e.vectors[a][k]).sum::<f64>();
            each_axis(at).map(|v| v as f32)
        };
        let rows = parallel::map_range(number, one);
        [0, 1, 2].map(|k| rows.iter().map(|r| r[k]).collect())
    }
}

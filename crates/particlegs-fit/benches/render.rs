//! Frames of a mixture: `cargo bench --bench render`.

use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::model::{AlphaBlend, Law, Mixture, VizMapper, VizRanges};
use particlegs_core::picture::Size;
use particlegs_core::render::{Scene, optical_depth};
use particlegs_core::space::Bounds;
use particlegs_fit::{Effort, FitOptions, fit};
use particlegs_particles::Particles;

fn main() {
    divan::main();
}

/// The sample's partition at 1080p, from the far orbit's distance.
#[divan::bench(args = [2_000, 20_000, 171_000], sample_count = 10)]
fn far_1080p(bencher: divan::Bencher, gaussians: usize) {
    let (mixture, bounds, size, view) = far(gaussians);
    let scene = Scene::from_mixture(&mixture, bounds);
    bencher.bench(|| optical_depth(&scene, &view, size, &Context::SILENT).expect("a picture"));
}

/// The same Gaussians drawn by the alpha-blend law, all of one opacity, with the network.
#[divan::bench(args = [2_000, 20_000, 171_000], sample_count = 10)]
fn alpha_blend_far_1080p(bencher: divan::Bencher, gaussians: usize) {
    let (mut mixture, bounds, size, view) = far(gaussians);
    let n = mixture.len();
    let network = VizMapper::new(VizRanges::TRAINING, 1);
    let vizmapper = Some(std::sync::Arc::new(network));
    mixture.law = Law::AlphaBlend(AlphaBlend { opacity: vec![0.3; n], grey: vec![1.0; n], vizmapper });
    let scene = Scene::from_law(&mixture, bounds, view.radius, view.opacity);
    bencher.bench(|| optical_depth(&scene, &view, size, &Context::SILENT).expect("a picture"));
}

/// A partition of the sample, and a view of it from the far orbit.
fn far(gaussians: usize) -> (Mixture, Bounds, Size, View) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/nbody64");
    let particles = Particles::open_raw(&[folder.into()]).expect("the sample");
    let bounds = particles.bounds();
    let radius = bounds.default_radius(particles.len() as u64);
    let options = FitOptions { effort: Effort::Fast, ..FitOptions::new(gaussians, radius) };
    let mixture = fit(&particles, &options, &Context::SILENT).expect("a partition");
    let size = Size { width: 1920, height: 1080 };
    let camera = spherical_camera(bounds.center(), 30.0, 20.0, base_distance(&bounds, size));
    let view = View { name: "far".into(), camera, radius, opacity: 0.05 };
    (mixture, bounds, size, view)
}

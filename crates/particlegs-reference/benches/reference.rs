//! Speed of pictures of all particles: `cargo bench --bench reference`.

use divan::{Bencher, counter::ItemsCount};
use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::picture::Size;
use particlegs_core::splat::ToneStyle;
use particlegs_particles::Particles;
use particlegs_reference::Reference;
use std::path::Path;

const SIZE: Size = Size { width: 1920, height: 1080 };

fn main() {
    divan::main();
}

/// The sample repeated 2 x 4 x 4 times: 8.4 million particles.
fn tiled() -> Particles {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    let sample = Particles::open_raw(&[folder]).expect("the bundled sample");
    let side = 25.0f32;
    let positions = sample.columns(0..sample.len());
    let [x, y, z] = [0, 1, 2].map(|k| {
        let shifts = (0..32).map(|tile| [tile / 16, tile / 4 % 4, tile % 4][k] as f32 * side);
        shifts.flat_map(|shift| positions[k].iter().map(move |v| v + shift)).collect()
    });
    Particles::from_columns(x, y, z)
}

fn far(reference: &Reference<'_>, count: usize, times: f64) -> View {
    let b = reference.bounds();
    let camera = spherical_camera(b.center(), 30.0, 20.0, base_distance(b, SIZE));
    View { name: "far".into(), camera, radius: times * b.default_radius(count as u64), opacity: 0.05 }
}

fn draw(bencher: Bencher, style: ToneStyle, times: f64) {
    let particles = tiled();
    let reference = Reference::new(&particles);
    let view = far(&reference, particles.len(), times);
    bencher
        .counter(ItemsCount::new(particles.len()))
        .bench(|| reference.draw(&view, SIZE, style, &Context::SILENT).expect("a picture"));
}

#[divan::bench(sample_count = 3, args = [0.25, 1.0, 4.0])]
fn paraview(bencher: Bencher, radius: f64) {
    draw(bencher, ToneStyle::Paraview, radius);
}

#[divan::bench(sample_count = 3, args = [0.25, 1.0, 4.0])]
fn expected(bencher: Bencher, radius: f64) {
    draw(bencher, ToneStyle::Expected, radius);
}

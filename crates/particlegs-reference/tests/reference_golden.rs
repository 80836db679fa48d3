//! The sample drawn by VTK 9.7 set up as ParaView 6.0.1 (Mesa llvmpipe), against our pictures.

#![allow(clippy::disallowed_methods)]

use particlegs_core::context::Context;
use particlegs_core::picture::Gray8;
use particlegs_core::splat::ToneStyle;
use particlegs_files::ViewsFile;
use particlegs_files::png::read_png;
use particlegs_particles::Particles;
use particlegs_reference::Reference;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Full PSNR in decibels; infinite for equal pictures.
fn decibels(a: &Gray8, b: &Gray8) -> f64 {
    assert_eq!(a.size, b.size);
    let sum: f64 = a.data.iter().zip(&b.data).map(|(&x, &y)| (f64::from(x) - f64::from(y)).powi(2)).sum();
    10.0 * (255.0 * 255.0 * a.data.len() as f64 / sum).log10()
}

/// (view, least decibels of the noise-free pictures without and with FXAA).
const NOISE_FREE: [(&str, f64, f64); 6] = [
    ("far_00", 37.0, 39.3),
    ("mid_00", 37.2, 39.2),
    ("near_00", 38.6, 40.0),
    ("near_01", 36.6, 38.9),
    ("large_radius", 41.2, 40.1),
    ("inside", 45.9, 44.7),
];

#[test]
fn pictures_of_the_sample() {
    let particles = Particles::open_raw(&[root().join("../../samples/nbody64")]).unwrap();
    let golden = root().join("tests/golden/nbody64");
    let ViewsFile(set) = ViewsFile::read(&golden.join("views.json"), &Context::SILENT).unwrap();
    let reference = Reference::new(&particles);
    for (name, noise_free, noise_free_fxaa) in NOISE_FREE {
        let view = set.views.iter().find(|v| v.name == name).unwrap();
        let truth = |style: &str| read_png(&golden.join(style).join(format!("{name}.png"))).unwrap();
        let (plain, smooth) = (truth("paraview-no-fxaa"), truth("paraview"));

        let ours = |style| reference.draw(view, set.size, style, &Context::SILENT).unwrap();
        let (d, f) =
            (decibels(&ours(ToneStyle::ParaviewNoFxaa), &plain), decibels(&ours(ToneStyle::Paraview), &smooth));
        println!("{name}: {d:.2} dB, with FXAA {f:.2} dB");
        assert!(d > 84.0, "{name}: {d:.2} dB");
        assert!(f > 80.0, "{name} with FXAA: {f:.2} dB");

        let mean = |style| reference.response(view, set.size, style, &Context::SILENT).unwrap();
        let (d, f) =
            (decibels(&mean(ToneStyle::ParaviewNoFxaa), &plain), decibels(&mean(ToneStyle::Paraview), &smooth));
        println!("{name}: noise-free {d:.2} dB, with FXAA {f:.2} dB");
        assert!(d > noise_free && f > noise_free_fxaa, "{name}: noise-free {d:.2} dB, with FXAA {f:.2} dB");
    }
}

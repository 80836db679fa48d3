//! Depth and pictures of all particles against particlegs' own.

use super::*;
use crate::tests::{columns, device, particles, view};
use particlegs_core::camera::clipping_range;
use particlegs_core::context::Context;
use particlegs_reference as reference;

/// Splats below a pixel, of some pixels, large and turned; faint and opaque; in one piece and in several.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn kernels_agree_with_their_twins() {
    let device = device();
    let renderer = ReferenceRenderer::new(&device).unwrap();
    let (columns, size) = (columns(4000), Size { width: 320, height: 180 });
    let particles = particles(&columns);
    let cpu_reference = reference::Reference::new(&particles);
    let canvas = renderer.canvas(size).unwrap();
    for (position, radius, opacity) in [
        ([1.0, 2.0, 6.0], 0.002, 0.05),
        ([1.0, 2.0, 6.0], 0.02, 0.05),
        ([1.0, 2.0, 6.0], 0.02, 0.9),
        ([1.0, 2.0, 6.0], 0.1, 0.3),
        ([0.3, 0.2, 0.9], 0.01, 0.05),
        ([0.3, 0.2, 0.9], 0.05, 0.2),
    ] {
        let view = view(position, [radius, opacity]);
        let range = clipping_range(cpu_reference.bounds(), &view.camera);
        let tau = cpu_reference.optical_depth(&view, size, &Context::SILENT).unwrap();
        let mut whole = None;
        for pieces in [1, 3] {
            let begin = || renderer.begin(&canvas, &view, [0.0; 3], range).unwrap();
            let add = |sum: &mut Sum<'_>| {
                let n = 4000usize.div_ceil(pieces);
                for k in 0..pieces {
                    let piece = columns.each_ref().map(|c| &c[k * n..4000.min((k + 1) * n)]);
                    sum.add(&DeviceParticles::upload(&device, piece).unwrap()).unwrap();
                }
            };
            let mut sum = begin();
            add(&mut sum);
            let depth = sum.depth().unwrap();
            let seen = |t: f32| 255.0 * (1.0 - f64::from(-t).exp());
            let apart = depth.data.iter().zip(&tau.data).map(|(a, b)| (seen(*a) - seen(*b)).abs());
            let worst = apart.fold(0.0, f64::max);
            println!("{position:?} radius {radius} opacity {opacity}: largest {worst:.4} levels");
            assert!(worst < 0.1, "{position:?} radius {radius} opacity {opacity}: largest {worst:.4} levels");
            assert!(whole.get_or_insert_with(|| depth.data.clone()) == &depth.data, "pieces show");
            for style in ToneStyle::ALL {
                let mut sum = begin();
                add(&mut sum);
                let (a, b) =
                    (sum.finish(style).unwrap(), cpu_reference.response(&view, size, style, &Context::SILENT).unwrap());
                let apart = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(apart <= 1, "{}: largest {apart}", style.name());
            }
        }
    }
}

/// The largest usual picture is drawn where a card sees no more than 128 MiB at once.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_picture_of_8k_is_drawn() {
    let device = device();
    let renderer = ReferenceRenderer::new(&device).unwrap();
    let (columns, size) = (columns(1000), Size { width: 7680, height: 4320 });
    let view = view([1.0, 2.0, 6.0], [0.002, 0.05]);
    let particles = particles(&columns);
    let cpu_reference = reference::Reference::new(&particles);
    let canvas = renderer.canvas(size).unwrap();
    let mut sum =
        renderer.begin(&canvas, &view, [0.0; 3], clipping_range(cpu_reference.bounds(), &view.camera)).unwrap();
    sum.add(&DeviceParticles::upload(&device, columns.each_ref().map(|c| &c[..])).unwrap()).unwrap();
    let (a, b) = (
        sum.finish(ToneStyle::Expected).unwrap(),
        cpu_reference.response(&view, size, ToneStyle::Expected, &Context::SILENT).unwrap(),
    );
    assert!(b.data.iter().any(|v| *v > 0) && a.data.iter().zip(&b.data).all(|(a, b)| a.abs_diff(*b) <= 1));
}

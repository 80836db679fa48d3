//! Kernels against their twins in core, on whatever adapter there is.

use super::*;
use crate::tests::{device, gaussian, view};
use particlegs_core::camera::Projection;
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::Mixture;
use particlegs_core::picture::psnr;
use particlegs_core::render::project::slices::{ClipClass, clip_class};
use particlegs_core::render::{self, Scene};
use particlegs_core::space::Bounds;

/// A picture that both draw.
struct DepthRenderCase {
    name: &'static str,
    gaussians: Mixture,
    view: View,
    size: Size,
}

/// Gaussians in the unit cube: round, flat, long, and without extent.
fn mixture(seed: u64, n: u64, spread: f64) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let (mean, cov) = gaussian(&mut r, i, spread);
        m.push(mean, cov, (1.0 + 40.0 * r.uniform()).floor(), 0.0);
    }
    m
}

/// As long as the cube is half, and a millionth as wide.
fn needles(n: u64) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(9, 1, i);
        let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
        let cov = [0.5, 1e-6, 1e-6].map(|s| Sym3::outer([0; 3].map(|_| s * r.normal())));
        m.push(mean, cov[0].add(&cov[1]).add(&cov[2]), 2e4, 0.0);
    }
    m
}

fn cases() -> Vec<DepthRenderCase> {
    let (far, near, inside) = ([1.0, 2.0, 6.0], [0.3, 0.2, 1.6], [0.1, 0.2, 0.5]);
    let (usual, size) = ([0.002, 0.05], Size { width: 192, height: 108 });
    let case = |name, gaussians, view| DepthRenderCase { name, gaussians, view, size };
    let mut flat = view(far, usual);
    flat.camera.projection = Projection::Orthographic { height_world: 2.5 };
    let mut slab = view(far, usual);
    slab.camera.clipping_range = Some([5.9, 6.6]);
    let mut flat_slab = slab.clone();
    flat_slab.camera.projection = flat.camera.projection;
    vec![
        case("small, from afar", mixture(1, 5000, 0.05), view(far, usual)),
        case("large radius", mixture(1, 5000, 0.05), view(far, [0.02, 0.5])),
        case("near", mixture(2, 5000, 0.05), view(near, usual)),
        case("inside", mixture(3, 3000, 0.1), view(inside, usual)),
        case("large Gaussians, inside", mixture(4, 200, 0.8), view(inside, usual)),
        case("needles", needles(300), view(far, usual)),
        case("parallel", mixture(5, 5000, 0.05), flat),
        case("a slab", mixture(6, 3000, 0.2), slab),
        case("a slab, parallel", mixture(6, 3000, 0.2), flat_slab),
        case("deep", mixture(7, 5000, 0.02), view(far, [0.05, 1.0])),
        DepthRenderCase {
            size: Size { width: 9, height: 7 },
            ..case("one plane", mixture(1, 500, 0.05), view(far, usual))
        },
        DepthRenderCase {
            size: Size { width: 643, height: 351 },
            ..case("odd sides", mixture(8, 5000, 0.05), view(far, usual))
        },
    ]
}

fn scene(m: &Mixture) -> Scene<'_> {
    Scene::from_mixture(m, Bounds { min: [-1.0; 3], max: [1.0; 3] })
}

/// Depth and pictures of all looks against core's.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn kernels_agree_with_their_twins() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    for DepthRenderCase { name, gaussians, view, size } in cases() {
        let scene = scene(&gaussians);
        let device_gaussians = Gaussians::upload(&device, &scene).unwrap();
        let canvas = renderer.canvas(&device_gaussians, size).unwrap();
        renderer.submit(&device_gaussians, &canvas, &view, ToneStyle::Expected).unwrap();
        let mut tau = renderer.depth(&canvas).unwrap();
        let lens = Lens::optical(&view, size, scene.bounds()).unwrap();
        if lens.perspective {
            render::depth::grow(&mut tau, &lens);
        }
        let twin = render::optical_depth(&scene, &view, size, &Context::SILENT).unwrap();
        let seen = |t: f32| 255.0 * (1.0 - f64::from(-t).exp());
        let apart = tau.data.iter().zip(&twin.data).map(|(a, b)| (seen(*a) - seen(*b)).abs());
        let (worst, sum) = apart.fold((0.0f64, 0.0), |(w, s), d| (w.max(d), s + d * d));
        let db = 20.0 * (255.0 / (sum / size.pixels() as f64).sqrt()).log10();
        println!("{name}: largest {worst:.3} levels, {db:.1} dB");
        assert!(worst < 0.5 && db > 76.0, "{name}: largest {worst:.3} levels, {db:.1} dB");
        for style in ToneStyle::ALL {
            let (a, b) = (
                renderer.draw(&device_gaussians, &canvas, &view, style).unwrap(),
                render::draw(&scene, &view, size, style, &Context::SILENT).unwrap(),
            );
            let apart = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
            let db = psnr(&a, &b).unwrap_or(f64::INFINITY);
            println!("  {}: largest {apart}, {db:.1} dB", style.name());
            assert!(apart <= 1 && db > 60.0, "{name}, {}: largest {apart}, {db:.1} dB", style.name());
        }
    }
}

/// The largest usual picture is drawn where a GPU binds no more than 128 MiB at once.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_picture_of_8k_is_drawn() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    let (gaussians, size) = (mixture(1, 500, 0.05), Size { width: 7680, height: 4320 });
    assert!(PlaneLayout::new(size).words().iter().all(|w| 4 * w <= 128 << 20));
    let (scene, view) = (scene(&gaussians), view([1.0, 2.0, 6.0], [0.002, 0.05]));
    let device_gaussians = Gaussians::upload(&device, &scene).unwrap();
    let canvas = renderer.canvas(&device_gaussians, size).unwrap();
    let a = renderer.draw(&device_gaussians, &canvas, &view, ToneStyle::Expected).unwrap();
    let b = render::draw(&scene, &view, size, ToneStyle::Expected, &Context::SILENT).unwrap();
    assert!(b.data.iter().any(|v| *v > 0) && a.data.iter().zip(&b.data).all(|(a, b)| a.abs_diff(*b) <= 1));
}

/// `may_be_cut` is true wherever some Gaussian is cut, and false from afar where none is.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn what_is_cut_is_known_before() {
    let device = device();
    for DepthRenderCase { name, gaussians, view, size } in cases() {
        let scene = scene(&gaussians);
        let lens = Lens::optical(&view, size, scene.bounds()).unwrap();
        let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(&b).map(|(a, b)| a * b).sum::<f64>();
        let cut = (0..gaussians.len()).any(|i| {
            let away = each_axis(|k| gaussians.mean_of(i)[k] - lens.position[k]);
            let (forward, cov) = (lens.axes[2], gaussians.cov_of(i));
            clip_class(&lens, dot(forward, away), dot(forward, cov.apply(forward))) == ClipClass::Cut
        });
        let may_cut = Gaussians::upload(&device, &scene).unwrap().may_be_cut(&lens);
        println!("{name}: {cut}, {may_cut}");
        assert!(may_cut || !cut, "{name}");
        assert!(cut || !may_cut || !name.contains("afar"), "{name}");
    }
}

/// A picture that is drawn in several buffers is that of one, to the last bit; so is one whose Gaussians come in another
/// order, and one after what a buffer held before.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn nothing_depends_on_order_or_on_what_was_there() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    let (gaussians, size) = (mixture(3, 1500, 0.1), Size { width: 160, height: 90 });
    let mut turned = Mixture::default();
    for i in (0..gaussians.len()).rev() {
        turned.push(gaussians.mean_of(i), gaussians.cov_of(i), gaussians.count[i], 0.0);
    }
    let inside = view([0.1, 0.2, 0.5], [0.002, 0.05]);
    let drawn = |m: &Mixture, most: usize, poison: bool| {
        let device_gaussians = Gaussians::upload_in(&device, &scene(m), most).unwrap();
        let canvas = renderer.canvas(&device_gaussians, size).unwrap();
        if poison {
            // All ones are not a number, and out of every range.
            let all = canvas.scratch.iter().chain([
                &canvas.cuts,
                &canvas.sums[0],
                &canvas.sums[1],
                &canvas.tiles,
                &canvas.picture,
                &canvas.cut_count,
            ]);
            for buffer in all {
                device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
            }
        }
        renderer.submit(&device_gaussians, &canvas, &inside, ToneStyle::Expected).unwrap();
        (renderer.depth(&canvas).unwrap().data, renderer.picture(&canvas).unwrap().data)
    };
    let once = drawn(&gaussians, 1 << 20, false);
    assert!(once.1.iter().any(|v| *v > 20));
    assert!(once == drawn(&gaussians, 1 << 20, true), "what was there shows");
    assert!(once == drawn(&turned, 1 << 20, false), "the order shows");
    assert!(once == drawn(&gaussians, 400, false), "several buffers show");
}

/// Sums by tiles are those by atomic adds, to the last bit; in several buffers too.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_tiles_have_the_bits_of_atomic_adds() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    for DepthRenderCase { name, gaussians, view, size } in cases() {
        for most in [1 << 20, 1700] {
            let device_gaussians = Gaussians::upload_in(&device, &scene(&gaussians), most).unwrap();
            let canvas = renderer.canvas(&device_gaussians, size).unwrap();
            let mut tiles = DepthTiles::new(&renderer, &device_gaussians, &canvas).unwrap();
            for style in [ToneStyle::Expected, ToneStyle::Paraview] {
                // In that look the plane holds depth.
                let depth = || (style == ToneStyle::Expected).then(|| renderer.depth(&canvas).unwrap().data);
                let drawn = || (depth(), renderer.picture(&canvas).unwrap().data);
                renderer.submit(&device_gaussians, &canvas, &view, style).unwrap();
                let by_adds = drawn();
                for buffer in [&canvas.sums[0], &canvas.sums[1], &canvas.picture] {
                    device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
                }
                tiles.submit(&view, style).unwrap();
                assert!(by_adds.1.iter().any(|v| *v > 0), "{name}: nothing is seen");
                assert!(by_adds == drawn(), "{name}, {}: tiles show", style.name());
            }
        }
    }
}

/// Lists that are too long are told, and the next picture is drawn all the same.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn lists_of_tiles_have_an_end() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    let (gaussians, size) = (mixture(5, 300, 0.05), Size { width: 160, height: 90 });
    let device_gaussians = Gaussians::upload(&device, &scene(&gaussians)).unwrap();
    let canvas = renderer.canvas(&device_gaussians, size).unwrap();
    let view = view([1.0, 2.0, 6.0], [0.01, 0.05]);
    let by_adds = renderer.draw(&device_gaussians, &canvas, &view, ToneStyle::Expected).unwrap();
    let mut tiles = DepthTiles::new(&renderer, &device_gaussians, &canvas).unwrap();
    let most = std::mem::replace(&mut tiles.most, 100);
    let long = tiles.submit(&view, ToneStyle::Expected).unwrap_err().to_string();
    assert!(long.contains("160x90") && long.contains("the 100 that") && !long.contains('\n'), "{long}");
    tiles.most = most;
    tiles.submit(&view, ToneStyle::Expected).unwrap();
    assert_eq!(renderer.picture(&canvas).unwrap().data, by_adds.data);
}

/// Periodic images are drawn where core draws them.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn images_are_repeated() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    let (gaussians, size) = (mixture(5, 800, 0.05), Size { width: 160, height: 90 });
    let shifts = vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, -2.0, 0.0]];
    let scene = scene(&gaussians).repeated(shifts);
    let view = view([1.0, 2.0, 9.0], [0.01, 0.05]);
    let device_gaussians = Gaussians::upload(&device, &scene).unwrap();
    let canvas = renderer.canvas(&device_gaussians, size).unwrap();
    let a = renderer.draw(&device_gaussians, &canvas, &view, ToneStyle::Paraview).unwrap();
    let b = render::draw(&scene, &view, size, ToneStyle::Paraview, &Context::SILENT).unwrap();
    assert!(a.data.iter().zip(&b.data).all(|(a, b)| a.abs_diff(*b) <= 1));
    assert!(psnr(&a, &b).is_none_or(|db| db > 70.0));
}

/// Limits are errors of one line.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn limits_are_told() {
    let device = device();
    let renderer = DepthRenderer::new(&device).unwrap();
    let gaussians = mixture(5, 80, 0.05);
    let device_gaussians = Gaussians::upload(&device, &scene(&gaussians)).unwrap();
    let huge = renderer.canvas(&device_gaussians, Size { width: 100_000, height: 100_000 }).map(drop).unwrap_err();
    let huge = format!("{huge}; {}", huge.hint());
    assert!(huge.contains("100000x100000") && huge.contains("`device cpu`"), "{huge}");
    let none = Gaussians::upload(&device, &scene(&Mixture::default())).unwrap();
    assert!(none.is_empty() && renderer.canvas(&none, Size { width: 16, height: 9 }).is_err());
    let canvas = renderer.canvas(&device_gaussians, Size { width: 16, height: 9 }).unwrap();
    let wrong = view([1.0, 2.0, 6.0], [0.01, 2.0]);
    assert!(renderer.submit(&device_gaussians, &canvas, &wrong, ToneStyle::Expected).is_err());
}

//! Kernels against their twins in core, on whatever adapter there is.

use super::backward::BackwardBuffers;
use super::*;
use crate::tests::{self, device, gaussian};
use particlegs_core::camera::Projection;
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::{AlphaBlend, Law, Mixture, VizMapper, VizRanges};
use particlegs_core::picture::psnr;
use particlegs_core::render::alpha::network::twin::stirred;
use particlegs_core::render::alpha::{BRIGHTEST, CutOffs, Plan};
use particlegs_core::render::{self, Renderer, Scene};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;

/// Default radius and opacity.
const USUAL: [f64; 2] = [0.02, 0.05];
const BOUNDS: Bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
const SIZE: Size = Size { width: 192, height: 108 };

/// A picture that both draw.
struct AlphaRenderCase {
    name: &'static str,
    gaussians: Mixture,
    view: View,
    size: Size,
}

fn view(position: [f64; 3]) -> View {
    tests::view(position, USUAL)
}

/// Those of `shape`, with opacities up to `most` and grey levels.
fn mixture(seed: u64, n: u64, most: f64, shape: impl Fn(&mut Random, u64) -> ([f64; 3], Sym3)) -> Mixture {
    let (mut m, mut law) = (Mixture::default(), AlphaBlend::default());
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let (mean, cov) = shape(&mut r, i);
        m.push(mean, cov, 1.0, 1.0);
        law.opacity.push(if i.is_multiple_of(5) { most } else { most * r.uniform() * r.uniform() });
        law.grey.push(0.2 + r.uniform());
    }
    m.law = Law::AlphaBlend(law);
    m
}

fn usual(seed: u64, n: u64, spread: f64) -> Mixture {
    mixture(seed, n, 0.95, |r, i| gaussian(r, i, spread))
}

/// As long as half of the cube, and narrower than a pixel.
fn needle(r: &mut Random, _: u64) -> ([f64; 3], Sym3) {
    let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
    let cov = [0.5, 0.005, 0.003].map(|s| Sym3::outer([0; 3].map(|_| s * r.normal())));
    (mean, cov[0].add(&cov[1]).add(&cov[2]))
}

/// With a network of these ranges that does something.
fn with_network(mut m: Mixture, ranges: VizRanges) -> Mixture {
    let network = VizMapper { ranges, ..stirred(3) };
    m.law.alpha_blend_mut().unwrap().vizmapper = Some(Arc::new(network));
    m
}

fn scene(m: &Mixture) -> Scene<'_> {
    Scene::from_law(m, BOUNDS, USUAL[0], USUAL[1])
}

fn cases() -> Vec<AlphaRenderCase> {
    let (far, near, inside) = ([1.0, 2.0, 6.0], [0.3, 0.2, 1.6], [0.1, 0.2, 0.5]);
    let case = |name, gaussians, view| AlphaRenderCase { name, gaussians, view, size: SIZE };
    let view_with = |position, radius, opacity| View { radius, opacity, ..view(position) };
    let mut slab = view(far);
    slab.camera.clipping_range = Some([5.9, 6.6]);
    let first = VizRanges::TRAINING;
    let tuned = VizRanges::FINE_TUNING;
    let everywhere = |r: &mut Random, i: u64| ([0.1, 0.0, -0.1], gaussian(r, i, 0.1).1);
    let mut telephoto = view(far.map(|v| 100.0 * v));
    telephoto.camera.projection = Projection::Perspective { fov_deg: 0.3 };
    // Many at one depth, to rounding: what is nearest is decided by their numbers.
    let lattice = |r: &mut Random, i: u64| {
        let mean = [i % 15, i / 15 % 15, i / 225].map(|k| k as f64 / 7.0 - 1.0);
        (mean, gaussian(r, i, 0.15).1)
    };
    vec![
        case("small, from afar", usual(1, 5000, 0.05), view(far)),
        case("near", usual(2, 5000, 0.05), view(near)),
        case("inside", usual(3, 3000, 0.1), view(inside)),
        case("large Gaussians, inside", usual(4, 2000, 0.8), view(inside)),
        case("needles", mixture(9, 2000, 0.95, needle), view(far)),
        case("needles, inside", mixture(9, 2000, 0.95, needle), view(inside)),
        case("opaque", mixture(5, 5000, 1.0, |r, i| gaussian(r, i, 0.1)), view(far)),
        case("faint", mixture(5, 5000, 0.1, |r, i| gaussian(r, i, 0.1)), view(far)),
        case("in one place", mixture(6, 3000, 0.3, everywhere), view(far)),
        case("a lattice", mixture(6, 3375, 0.95, lattice), view(far)),
        case("a lattice, along an axis", mixture(6, 3375, 0.95, lattice), view([0.0, 0.0, 6.0])),
        case("wider than all", mixture(10, 2000, 0.3, |r, i| gaussian(r, i, 1e4)), view(far)),
        case("through a telescope", usual(8, 3000, 0.05), telephoto),
        case("a slab", usual(6, 3000, 0.2), slab),
        case("network, as usual", with_network(usual(1, 3000, 0.05), first), view(far)),
        case("network, large and opaque", with_network(usual(1, 3000, 0.05), first), view_with(far, 0.035, 0.0875)),
        case("network, small and faint", with_network(usual(1, 3000, 0.1), first), view_with(near, 0.005, 0.0125)),
        case("network, wide ranges", with_network(usual(2, 3000, 0.05), tuned), view_with(inside, 0.03, 0.02)),
        AlphaRenderCase { size: Size { width: 9, height: 7 }, ..case("one tile", usual(1, 2000, 0.05), view(far)) },
        AlphaRenderCase {
            size: Size { width: 643, height: 351 },
            ..case("odd sides", usual(8, 5000, 0.05), view(far))
        },
    ]
}

/// Differences of a picture from core's: the largest in levels before rounding, pixels off by more than a
/// hundredth of one, decibels, and the largest difference after rounding.
fn apart(renderer: &AlphaRenderer, case: &AlphaRenderCase) -> (f64, usize, f64, u8) {
    let scene = scene(&case.gaussians);
    let device_gaussians = Gaussians::upload(&renderer.device, &scene).unwrap();
    let mut canvas = renderer.canvas(&device_gaussians, case.size).unwrap();
    renderer.submit(&device_gaussians, &mut canvas, &case.view).unwrap();
    let seen = renderer.brightness(&canvas).unwrap();
    let twin = render::optical_depth(&scene, &case.view, case.size, &Context::SILENT).unwrap();
    let both = seen.data.iter().zip(&twin.data);
    let levels: Vec<f64> =
        both.map(|(a, t)| 255.0 * (f64::from(a.clamp(0.0, BRIGHTEST)) + f64::from(-t).exp_m1()).abs()).collect();
    let worst = levels.iter().fold(0.0f64, |w, d| w.max(*d));
    let off = levels.iter().filter(|d| **d > 0.01).count();
    let squares: f64 = levels.iter().map(|d| d * d).sum();
    let a = renderer.picture(&canvas).unwrap();
    let b = render::draw(&scene, &case.view, case.size, ToneStyle::Paraview, &Context::SILENT).unwrap();
    assert!(b.data.iter().any(|v| *v > 20), "{}: nothing is seen", case.name);
    let rounded = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let decibels = -10.0 * (squares / 255.0 / 255.0 / case.size.pixels() as f64).log10();
    println!(
        "{}: largest {worst:.4} levels, {off} of {} pixels off by 0.01, {decibels:.1} dB; rounded {rounded}, {:.1} dB",
        case.name,
        levels.len(),
        psnr(&a, &b).unwrap_or(f64::INFINITY),
    );
    (worst, off, decibels, rounded)
}

/// Rounding may decide whether a footprint's faintest pixel is drawn: then that pixel differs by an alpha of 1/255,
/// times a grey level of up to 1.2.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn kernels_agree_with_their_twins() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    for case in cases() {
        let (worst, off, decibels, rounded) = apart(&renderer, &case);
        assert!(worst < 1.3 && off <= 20 && rounded <= 2, "{}: largest {worst:.4} levels, {off} off", case.name);
        assert!(decibels > 90.0, "{}: {decibels:.1} dB", case.name);
    }
}

/// Gaussians and their order are those of the processor, one by one: of depths that are equal, of those that are a
/// rounding apart, and of those that the network bends.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn the_order_is_the_cpus() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    for case in cases() {
        let scene = scene(&case.gaussians);
        let device_gaussians = Gaussians::upload(&device, &scene).unwrap();
        let mut canvas = renderer.canvas(&device_gaussians, case.size).unwrap();
        renderer.submit(&device_gaussians, &mut canvas, &case.view).unwrap();
        let blend = scene.blend().unwrap();
        let eye = Eye::new(&case.view, case.size, &blend.frame).unwrap();
        let camera_gaussians = blend.gaussians(&[(&case.gaussians, 1.0)], &case.view, &eye, &Context::SILENT).unwrap();
        let plan = Plan::new(
            &eye,
            camera_gaussians.len(),
            |i| Some(camera_gaussians[i]),
            CutOffs::PUBLISHED,
            &Context::SILENT,
        )
        .unwrap();
        let read = |b: &wgpu::Buffer| -> Vec<u32> {
            bytemuck::pod_collect_to_vec(&device.read(b, 4 * camera_gaussians.len() as u64).unwrap())
        };
        let (keys, order) = (read(&canvas.order.keys), read(&canvas.order.values));
        let seen = keys.iter().filter(|k| **k != u32::MAX).count();
        // Rounding may decide that the faintest is seen by one alone.
        let both = |a: &[u32], b: &[u32]| {
            let b: std::collections::HashSet<u32> = b.iter().copied().collect();
            a.iter().copied().filter(|i| b.contains(i)).collect::<Vec<_>>()
        };
        let (a, b) = (both(&order[..seen], &plan.indices), both(&plan.indices, &order[..seen]));
        assert!(a == b, "{}: out of order", case.name);
        assert!(seen.max(plan.indices.len()) - a.len() <= 2, "{}: {} of {seen} seen", case.name, a.len());
    }
}

/// The network runs again if radius or opacity changed, and else it does not.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn the_network_runs_where_it_must() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    let gaussians = with_network(usual(1, 800, 0.05), VizRanges::TRAINING);
    let device_gaussians = Gaussians::upload(&device, &scene(&gaussians)).unwrap();
    let mut canvas = renderer.canvas(&device_gaussians, SIZE).unwrap();
    let mut draw = |v: &View| renderer.draw(&device_gaussians, &mut canvas, v).unwrap();
    let first = view([1.0, 2.0, 6.0]);
    let second = View { radius: 0.03, ..first.clone() };
    let drawn = draw(&first);
    assert_ne!(drawn, draw(&second));
    assert!(drawn == draw(&first), "what the network said of another view shows");
    let poison = || {
        let bent = &device_gaussians.chunks[0].bent;
        device.queue.write_buffer(bent, 0, &vec![0; bent.size() as usize]);
    };
    poison();
    assert!(draw(&first).data.iter().all(|v| *v == 0), "the network ran again");
    poison();
    assert_ne!(drawn, draw(&View { opacity: 0.07, ..first.clone() }));
    assert!(drawn == draw(&first));
}

/// A picture that is drawn in several buffers and in several slabs is that of one, to the last bit; so is one whose
/// Gaussians come in another order, one that is drawn again, and one after what a buffer held before.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn nothing_depends_on_order_or_on_what_was_there() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    let in_slabs = AlphaRenderer { most: 700, ..AlphaRenderer::new(&device).unwrap() };
    let gaussians = with_network(usual(3, 1500, 0.1), VizRanges::TRAINING);
    let mut turned = Mixture::default();
    let (from, mut law) = (gaussians.law.alpha_blend().unwrap(), AlphaBlend::default());
    for i in (0..gaussians.len()).rev() {
        turned.push(gaussians.mean_of(i), gaussians.cov_of(i), 1.0, 1.0);
        law.opacity.push(from.opacity[i]);
        law.grey.push(from.grey[i]);
    }
    law.vizmapper = from.vizmapper.clone();
    turned.law = Law::AlphaBlend(law);
    let inside = View { radius: 0.03, ..view([0.1, 0.2, 0.5]) };
    let drawn = |renderer: &AlphaRenderer, m: &Mixture, most: usize, poison: bool| {
        let device_gaussians = Gaussians::upload_in(&device, &scene(m), most).unwrap();
        let mut canvas = renderer.canvas(&device_gaussians, Size { width: 160, height: 90 }).unwrap();
        if poison {
            canvas.lists(&device, &renderer.kernels, 1 << 15).unwrap();
            poisoned(&device, &device_gaussians, &canvas);
        }
        renderer.submit(&device_gaussians, &mut canvas, &inside).unwrap();
        let first = (renderer.brightness(&canvas).unwrap().data, renderer.picture(&canvas).unwrap().data);
        renderer.submit(&device_gaussians, &mut canvas, &inside).unwrap();
        assert!(first.0 == renderer.brightness(&canvas).unwrap().data, "the first shows in the second");
        first
    };
    let once = drawn(&renderer, &gaussians, 1 << 20, false);
    assert!(once.1.iter().any(|v| *v > 20));
    assert!(once == drawn(&renderer, &gaussians, 1 << 20, true), "what was there shows");
    assert!(once == drawn(&renderer, &turned, 1 << 20, false), "the order shows");
    assert!(once == drawn(&renderer, &gaussians, 400, false), "several buffers show");
    assert!(once == drawn(&in_slabs, &gaussians, 1 << 20, true), "several slabs show");
}

/// All ones, which are not a number and out of every range, in whatever is written before it is read.
fn poisoned(device: &Device, gaussians: &Gaussians, canvas: &AlphaCanvas) {
    let lists = canvas.lists.as_ref().unwrap();
    let sorts = [&canvas.order, &lists.sort].into_iter().flat_map(|s| s.scratch.iter().chain([&s.keys, &s.values]));
    let bent = gaussians.chunks.iter().map(|c| &c.bent);
    let footprint_buffers = [&canvas.splats, &canvas.touched, &canvas.block_sums, &canvas.starts, &canvas.ranges];
    let pixels = [&canvas.sums, &canvas.lefts, &canvas.picture];
    for buffer in footprint_buffers.into_iter().chain(pixels).chain(sorts).chain(bent) {
        device.queue.write_buffer(buffer, 0, &vec![0xff; buffer.size() as usize]);
    }
}

/// One scene at one size after another, by its law whatever look is asked for.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn pictures_are_by_the_scenes_law() {
    let device = device();
    let (gaussians, view) = (usual(1, 500, 0.1), view([1.0, 2.0, 6.0]));
    let mut depths = gaussians.clone();
    depths.law = Law::OpticalDepth;
    let scenes = [scene(&gaussians), scene(&depths)];
    let pictures = scenes.each_ref().map(|s| crate::render::ScenePictures::new(&device, s).unwrap());
    for size in [Size { width: 33, height: 17 }, SIZE, Size { width: 64, height: 64 }] {
        for style in ToneStyle::ALL {
            for (scene_pictures, scene) in pictures.iter().zip(&scenes) {
                let (a, b) = (
                    scene_pictures.draw(&view, size, style, &Context::SILENT).unwrap(),
                    render::draw(scene, &view, size, style, &Context::SILENT),
                );
                let b = b.unwrap();
                assert!(a.data.iter().zip(&b.data).all(|(a, b)| a.abs_diff(*b) <= 2), "{}", style.name());
                assert!(psnr(&a, &b).is_none_or(|db| db > 70.0), "{}", style.name());
            }
        }
    }
    let none = Mixture { law: Law::AlphaBlend(AlphaBlend::default()), ..Mixture::default() };
    let none = crate::render::ScenePictures::new(&device, &scene(&none)).unwrap();
    assert!(none.draw(&view, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap().data.iter().all(|v| *v == 0));
}

/// Gaussians beyond float32, and those behind, beside or before the range, are not drawn; none at all is black.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn what_is_not_seen_is_not_drawn() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    let draw = |m: &Mixture| {
        let device_gaussians = Gaussians::upload(&device, &scene(m)).unwrap();
        let mut canvas = renderer.canvas(&device_gaussians, SIZE).unwrap();
        renderer.draw(&device_gaussians, &mut canvas, &view([0.0, 0.0, 6.0])).unwrap()
    };
    let small = Sym3::scaled_identity(1e-4);
    let mixture_of = |all: &[([f64; 3], f64)]| {
        let mut m = mixture(1, all.len() as u64, 0.9, |_, i| (all[i as usize].0, small));
        m.law.alpha_blend_mut().unwrap().opacity = all.iter().map(|(_, o)| *o).collect();
        m
    };
    let unseen = [([0.0, 0.0, 9.0], 0.9), ([40.0, 0.0, 0.0], 0.9), ([0.0, 0.0, 5.99], 0.9), ([0.0; 3], 0.001)];
    assert!(draw(&mixture_of(&unseen)).data.iter().all(|v| *v == 0));
    let seen = [([0.1, 0.2, 0.3], 0.9)];
    let alone = draw(&mixture_of(&seen));
    assert!(alone.data.iter().any(|v| *v > 5));
    let mut with = mixture_of(&[&seen[..], &unseen[..]].concat());
    with.law.alpha_blend_mut().unwrap().grey[0] = mixture_of(&seen).law.alpha_blend().unwrap().grey[0];
    assert!(alone == draw(&with));
}

/// Limits are errors of one line.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn limits_are_told() {
    let device = device();
    let renderer = AlphaRenderer::new(&device).unwrap();
    let gaussians = usual(5, 80, 0.05);
    let device_gaussians = Gaussians::upload(&device, &scene(&gaussians)).unwrap();
    let message_of = |e: particlegs_core::Error| {
        let text = if e.hint().is_empty() { e.to_string() } else { format!("{e}; {}", e.hint()) };
        assert!(!text.contains('\n'), "{text}");
        text
    };
    let huge =
        message_of(renderer.canvas(&device_gaussians, Size { width: 100_000, height: 100_000 }).map(drop).unwrap_err());
    assert!(huge.contains("100000x100000") && huge.contains("`device cpu`"), "{huge}");
    let mut canvas = renderer.canvas(&device_gaussians, SIZE).unwrap();
    let entries = (device.largest_binding() / 4 + 1).min(u64::from(u32::MAX)) as u32;
    if u64::from(entries) * 4 > device.largest_binding() {
        let long = message_of(canvas.lists(&device, &renderer.kernels, entries).map(drop).unwrap_err());
        assert!(long.contains("entries") && long.contains("`device cpu`"), "{long}");
    }
    let mut flat = view([0.0, 0.0, 6.0]);
    flat.camera.projection = Projection::Orthographic { height_world: 2.5 };
    let flat = message_of(renderer.submit(&device_gaussians, &mut canvas, &flat).unwrap_err());
    assert!(flat.contains("only be drawn in perspective"), "{flat}");
    let wrong = View { opacity: 2.0, ..view([0.0, 0.0, 6.0]) };
    message_of(renderer.submit(&device_gaussians, &mut canvas, &wrong).unwrap_err());
    let mut bad = gaussians.clone();
    bad.mean[1][17] = f64::NAN;
    let bad = message_of(Gaussians::upload_in(&device, &scene(&bad), 10).map(drop).unwrap_err());
    assert_eq!(bad, "Gaussian 17: the mean is not finite");
    let mut beyond = gaussians.clone();
    beyond.mean[2][3] = 1e9;
    let beyond = message_of(Gaussians::upload(&device, &scene(&beyond)).map(drop).unwrap_err());
    assert!(beyond.starts_with("Gaussian 3: ") && beyond.contains("`device cpu`"), "{beyond}");
    let away = message_of(renderer.submit(&device_gaussians, &mut canvas, &view([0.0, 0.0, 1e9])).unwrap_err());
    assert!(away.contains("`device cpu`"), "{away}");
    let mut depths = gaussians;
    depths.law = Law::OpticalDepth;
    message_of(Gaussians::upload(&device, &scene(&depths)).map(drop).unwrap_err());
}

/// A footprint of the device, and the pixels of the tiles that it touches.
struct TileFootprint {
    number: usize,
    splat: [f64; 8],
    columns: std::ops::Range<usize>,
    rows: std::ops::Range<usize>,
}

/// The footprints of the last picture, front to back.
fn drawn(renderer: &AlphaRenderer, canvas: &AlphaCanvas) -> Vec<TileFootprint> {
    let read =
        |b: &wgpu::Buffer| -> Vec<u32> { bytemuck::pod_collect_to_vec(&renderer.device.read(b, b.size()).unwrap()) };
    let (order, keys) = (read(&canvas.order.values), read(&canvas.order.keys));
    let (touched, splats) = (read(&canvas.touched), read(&canvas.splats));
    let seen = order.iter().zip(&keys).filter(|(_, key)| **key != u32::MAX);
    let one = |number: usize| {
        let [columns, rows] = [0, 1].map(|k| touched[2 * number + k]);
        let pixels = |t: u32, most: usize| TILE * (t & 0xffff) as usize..(TILE * ((t >> 16) as usize + 1)).min(most);
        TileFootprint {
            number,
            splat: std::array::from_fn(|k| f32::from_bits(splats[8 * number + k]).into()),
            columns: pixels(columns, canvas.size.width),
            rows: pixels(rows, canvas.size.height),
        }
    };
    seen.map(|(i, _)| one(*i as usize)).collect()
}

/// Sums that pixels want of each Gaussian, pixel by pixel in f64.
fn wanted(drawn: &[TileFootprint], gaussians: usize, size: Size, by_pixel: &[f32]) -> Vec<[f64; 7]> {
    let cut = CutOffs::PUBLISHED;
    let (least, most, pixels) = (f64::from(cut.least_transmittance), f64::from(cut.most_alpha), size.pixels());
    let mut out = vec![[0.0; 7]; gaussians];
    let mut all = vec![0.0; pixels];
    for back in [false, true] {
        let mut at = vec![(0.0, 1.0); pixels];
        for d in drawn {
            let [x, y, lean, along, down, peak, end, grey] = d.splat;
            for row in d.rows.clone() {
                for column in d.columns.clone() {
                    let pixel = row * size.width + column;
                    let (sum, left) = at[pixel];
                    let [dx, dy] = [column as f64 - x, row as f64 - y];
                    let crest = dx - lean * dy;
                    let power = along * crest * crest + down * dy * dy;
                    if left == 0.0 || power < end {
                        continue;
                    }
                    let raw = peak * power.exp2();
                    let alpha = raw.min(most);
                    let next = left * (1.0 - alpha);
                    if next < least {
                        at[pixel].1 = 0.0;
                        continue;
                    }
                    at[pixel] = (sum + left * alpha * grey, next);
                    let want = f64::from(by_pixel[pixel]);
                    let behind: f64 = all[pixel] - at[pixel].0;
                    let moves = if raw <= most { alpha } else { 0.0 };
                    let h = moves * want * (left * grey - behind / (1.0 - alpha));
                    let terms = [h, h * dx, h * dy, h * dx * dx, h * dx * dy, h * dy * dy, want * left * alpha];
                    if back {
                        out[d.number].iter_mut().zip(terms).for_each(|(o, v)| *o += v);
                    }
                }
            }
        }
        all = at.into_iter().map(|(sum, _)| sum).collect();
    }
    out
}

/// Sums that pixels want of footprints, whole and in slabs.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn footprints_are_wanted_as_pixels_want_them() {
    let device = device();
    let mut renderer = AlphaRenderer::new(&device).unwrap();
    let whole = renderer.most;
    for case in cases() {
        let device_gaussians = Gaussians::upload(&device, &scene(&case.gaussians)).unwrap();
        let n = device_gaussians.len();
        let mut r = Random::new(12, 1, 0);
        let pixels = (0..case.size.pixels()).map(|i| if i % 9 == 0 { 0.0 } else { r.normal() as f32 });
        let by_pixel: Vec<f32> = pixels.collect();
        let mut sums = Vec::new();
        for most in [whole, 2000] {
            renderer.most = most;
            let mut canvas = renderer.canvas(&device_gaussians, case.size).unwrap();
            renderer.submit(&device_gaussians, &mut canvas, &case.view).unwrap();
            let mut back = BackwardBuffers::new(&device, &canvas).unwrap();
            device.queue.write_buffer(&back.by_pixel, 0, bytemuck::cast_slice(&by_pixel));
            back.poison(&device);
            renderer.backward(&canvas, &mut back).unwrap();
            back.poison(&device);
            renderer.backward(&canvas, &mut back).unwrap();
            sums.push(bytemuck::pod_collect_to_vec::<u8, u32>(&device.read(&back.sums, 28 * n as u64).unwrap()));
            if most == whole {
                let twin = wanted(&drawn(&renderer, &canvas), n, case.size, &by_pixel);
                let off: [f64; 7] = std::array::from_fn(|k| {
                    let (mut apart, mut all) = (0.0, 0.0);
                    for (i, twin) in twin.iter().enumerate() {
                        apart += (twin[k] - f64::from(f32::from_bits(sums[0][k * n + i]))).powi(2);
                        all += twin[k].powi(2);
                    }
                    f64::sqrt(apart / all)
                });
                println!("{}: {}", case.name, off.map(|v| format!("{v:.1e}")).join(" "));
                assert!(off.iter().all(|v| *v < 2e-3), "{}: {off:?}", case.name);
            }
        }
        // Slab by slab the walk goes on where it was.
        assert!(sums[0] == sums[1], "{}: slabs", case.name);
    }
}

//! Kernels against their twins in core, on whatever adapter there is.

use super::*;
use crate::tests::{device, gaussian, view};
use crate::{AdapterChoice, Checks, KernelWatch};
use particlegs_core::camera::{DensityView, Projection, Window};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{Block, FieldMoments, LawKind, Layer, Mass, Metadata, Mixture, Model};
use particlegs_core::picture::{Plane, psnr};
use particlegs_core::render::bin::place;
use particlegs_core::render::project::CameraGaussian;
use particlegs_core::render::project::slices::{ClipClass, clip_class, pieces};
use particlegs_core::render::raster::pyramid::levels;
use particlegs_core::render::{self, FieldQuery, MapComponent, Renderer, Scene, SceneRenderer};
use particlegs_core::space::{Bounds, Cell};
use std::sync::Mutex;

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

/// A model of layers about the middle of a cube of side 2, whose particles have these masses.
fn model(layers: &[(&Mixture, f64)]) -> Model {
    let bounds = Bounds { min: [-1.0; 3], max: [1.0; 3] };
    let layer = |(k, (m, mass)): (usize, &(&Mixture, f64))| {
        let count = m.count.iter().sum::<f64>();
        let block = Block { bounds, count: count as u64, mass: count * mass, gaussians: (*m).clone() };
        Layer { name: format!("layer {k}"), mass: Mass::Each(*mass), content: vec![block] }
    };
    let layers: Vec<_> = layers.iter().enumerate().map(layer).collect();
    let metadata = Metadata::new(LawKind::OpticalDepth, layers.iter().map(Layer::count).sum(), bounds);
    Model { metadata, layers, certificate: None }
}

/// The largest difference of two planes over the largest pixel, but for the share `aside` of pixels that differ most.
fn apart(a: &Plane, b: &Plane, aside: f64) -> f64 {
    let highest = b.data.iter().fold(0.0f32, |h, v| h.max(*v));
    let mut far: Vec<f32> = a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).collect();
    far.sort_by(f32::total_cmp);
    f64::from(far[far.len() - 1 - (aside * far.len() as f64) as usize]) / f64::from(highest)
}

/// Surface densities against core's, in perspective and parallel, of slabs and of boxes that repeat, in any unit of mass.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn densities_are_those_of_the_cpu() {
    let renderer = Arc::new(DepthRenderer::new(&device()).unwrap());
    let compared = |name: &str, scene: &Scene<'_>, view: &DensityView, (size, aside): (Size, f64)| {
        let a = ScenePictures::of_depth(renderer.clone(), scene).surface_density(view, size, &Context::SILENT).unwrap();
        let b = render::surface_density(scene, view, size, &Context::SILENT).unwrap();
        let far = apart(&a, &b, aside);
        println!("{name}: {far:.1e} of the largest pixel");
        assert!(far < 1e-4, "{name}: {far:.1e} of the largest pixel");
    };
    for DepthRenderCase { name, gaussians, view, size } in cases() {
        // In the last unit footprints end nearest, at a hundredth of their peak: a pixel there may be in or out.
        for (mass, aside) in [(1.0, 0.0), (1e20, 0.0), (1e-20, 1e-4)] {
            let model = model(&[(&gaussians, mass), (&gaussians, 3.0 * mass)]);
            let scene = Scene::new(&model);
            compared(&format!("{name}, {mass:e}"), &scene, &DensityView::of_view(&view, scene.bounds()), (size, aside));
        }
    }
    let (gaussians, size) = (mixture(6, 800, 0.1), Size { width: 96, height: 80 });
    let scene = scene(&gaussians);
    for (name, width, depth, angles_deg) in [
        ("a whole box", 2.4, None, [0.0; 2]),
        ("a whole box, obliquely", 4.0, None, [30.0, 20.0]),
        ("a part of a box", 1.5, None, [0.0; 2]),
        ("copies of a slab", 5.0, Some(0.7), [0.0; 2]),
    ] {
        let window = Window { center: [0.7, -0.2, 0.4], angles_deg, width, depth };
        let cell = Some(Cell::orthogonal([2.0; 3]));
        let view = DensityView::orthographic("w", &window, size, scene.bounds(), cell).unwrap();
        compared(name, &scene, &view, (size, 0.0));
    }
    compared(
        "by number",
        &scene.clone().by_number(),
        &DensityView::of_view(&cases()[0].view, scene.bounds()),
        (size, 0.0),
    );
    let none = Mixture::default();
    let none = Scene::from_mixture(&none, *scene.bounds());
    let none = ScenePictures::of_depth(renderer, &none);
    let view = DensityView::of_view(&cases()[0].view, scene.bounds());
    assert!(none.surface_density(&view, size, &Context::SILENT).unwrap().data.iter().all(|v| *v == 0.0));
}

/// A density keeps its digits a million times below its highest pixel, where wide Gaussians lie beside dense points.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn faint_densities_are_those_of_the_cpu() {
    let (mut gaussians, size) = (mixture(1, 3000, 0.3), Size { width: 1280, height: 720 });
    for i in 0..200 {
        let mean = gaussians.mean_of(i).map(|v| 0.1 * v);
        gaussians.push(mean, Sym3::scaled_identity(1e-6), 2000.0, 0.0);
    }
    let scene = scene(&gaussians);
    let view = DensityView::of_view(&view([1.0, 2.0, 6.0], [0.002, 0.05]), scene.bounds());
    let a = ScenePictures::new(&device(), &scene).unwrap().surface_density(&view, size, &Context::SILENT).unwrap();
    let b = render::surface_density(&scene, &view, size, &Context::SILENT).unwrap();
    let highest = b.data.iter().fold(0.0f32, |h, v| h.max(*v));
    for least in [1e-5, 1e-6] {
        let both = a.data.iter().zip(&b.data).filter(|(_, b)| (least..10.0 * least).contains(&(*b / highest)));
        let mut far: Vec<f32> = both.map(|(a, b)| (a / b - 1.0).abs()).collect();
        far.sort_by(f32::total_cmp);
        println!(
            "from {least:e} of the largest pixel: {} pixels, half of them within {:.1e}",
            far.len(),
            far[far.len() / 2]
        );
        assert!(far.len() > 1000 && far[far.len() / 2] < 1e-3);
    }
}

/// Gaussians with fields that change across them: a scalar, one over decades and a vector.
fn with_fields(mut m: Mixture) -> Mixture {
    let (mut scalar, mut flow) = (FieldMoments::new(1), FieldMoments::new(3));
    for i in 0..m.len() {
        let mut r = Random::new(12, 0, i as u64);
        for (field, components) in [(&mut scalar, 1), (&mut flow, 3)] {
            for k in 0..components {
                field.mean[k].push(3.0 + 2.0 * r.normal());
                (0..3).for_each(|a| field.slope[k][a].push(4.0 * r.normal()));
            }
            let spread = Sym3::outer(each_axis(|_| r.normal())).add(&Sym3::scaled_identity(0.2));
            field.spread.iter_mut().enumerate().for_each(|(k, column)| column.push(spread.0[k]));
            field.range.fill([-30.0, 40.0]);
        }
    }
    let excess = Some((0..m.len()).map(|i| 0.1 * (i as f64).cos()).collect());
    m.fields.set("heat", FieldMoments { range: vec![[-9.0, 12.0]], excess, ..scalar.clone() });
    m.fields.set("scalar", scalar);
    m.fields.set("velocity", flow);
    m
}

fn field_query(name: &str, component: MapComponent, dispersion: bool) -> FieldQuery {
    let (bulk, weight) = ([0.5, 0.0, -0.3], Default::default());
    FieldQuery { name: name.into(), component, dispersion, bulk, per_area: false, weight, by: None }
}

/// Maps of fields against core's: means, exponentials of logarithms, components of vectors and dispersions.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn fields_are_those_of_the_cpu() {
    let renderer = Arc::new(DepthRenderer::new(&device()).unwrap());
    let compared = |name: &str, scene: &Scene<'_>, view: &DensityView, size: Size| {
        let pictures = ScenePictures::of_depth(renderer.clone(), scene);
        for (field, component, dispersion) in [
            ("scalar", MapComponent::Scalar, true),
            ("heat", MapComponent::Scalar, false),
            ("velocity", MapComponent::LineOfSight, false),
        ] {
            let query = field_query(field, component, dispersion);
            let [a, b] = [&pictures as &dyn SceneRenderer, scene]
                .map(|renderer| renderer.field_map(&query, view, size, &Context::SILENT).unwrap());
            // Values over decades have colours by their logarithms.
            let shade = |v: f64| if field == "heat" { v.ln() } else { v };
            let both = a.values.data.iter().zip(&b.values.data).map(|(a, b)| [shade(*a), shade(*b)]);
            let values: Vec<_> = both.clone().filter(|[a, b]| a.is_finite() && b.is_finite()).collect();
            let ends = values.iter().fold([f64::INFINITY, -f64::INFINITY], |[l, h], [_, b]| [l.min(*b), h.max(*b)]);
            let far = values.iter().fold(0.0f64, |far, [a, b]| far.max((a - b).abs())) / (ends[1] - ends[0]);
            let one_empty = both.filter(|[a, b]| a.is_finite() != b.is_finite()).count();
            println!("{name}, {}: {far:.1e} of the range, {one_empty} of {} empty", query.title(), values.len());
            assert!(values.len() > size.pixels() / 50, "{name}: hardly a picture");
            assert!(far < 1e-3 && one_empty <= 1, "{name}, {}: {far:.1e}, {one_empty}", query.title());
            let far = apart(&a.density, &b.density, 0.0);
            assert!(far < 1e-5, "{name}, {}: density {far:.1e}", query.title());
        }
        let weighed = FieldQuery { by: Some("heat".into()), ..field_query("scalar", MapComponent::Scalar, false) };
        let error = pictures.field_map(&weighed, view, size, &Context::SILENT).unwrap_err();
        assert!(error.to_string().contains("weighted by another field"), "{error}");
    };
    for DepthRenderCase { name, gaussians, view, size } in cases() {
        let gaussians = with_fields(gaussians);
        let scene = scene(&gaussians);
        compared(name, &scene, &DensityView::of_view(&view, scene.bounds()), size);
    }
    let gaussians = with_fields(mixture(6, 800, 0.1));
    let (scene, size) = (scene(&gaussians), Size { width: 96, height: 80 });
    for (name, width, depth) in [("a whole box", 2.4, None), ("a thin slab of copies", 5.0, Some(1e-3))] {
        let window = Window { center: [0.7, -0.2, 0.4], angles_deg: [0.0; 2], width, depth };
        let view =
            DensityView::orthographic("w", &window, size, scene.bounds(), Some(Cell::orthogonal([2.0; 3]))).unwrap();
        compared(name, &scene, &view, size);
    }
    // Strips give the bits of the whole, as does a second time.
    let view = DensityView::of_view(&cases()[3].view, scene.bounds());
    let query = field_query("heat", MapComponent::Scalar, false);
    let [once, again, strips] = [u64::MAX, u64::MAX, 20_000].map(|most| {
        let map = render::field_map_by(&scene, &query, &view, size, &Context::SILENT, |strokes, terms, canvas| {
            renderer.sum_field(strokes, terms, canvas, most, &Context::SILENT)
        });
        map.unwrap().values.data.into_iter().map(f64::to_bits).collect::<Vec<_>>()
    });
    assert!(once == again && once == strips);
}

/// Planes of single layers against core's; one renderer gives depth and density in turn.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn layers_are_those_of_the_cpu() {
    let renderer = Arc::new(DepthRenderer::new(&device()).unwrap());
    let size = Size { width: 192, height: 108 };
    let [gas, stars] = [mixture(1, 5000, 0.05), mixture(4, 200, 0.8)];
    let model = model(&[(&gas, 1.0), (&stars, 20.0)]);
    let view = view([1.0, 2.0, 6.0], [0.002, 0.05]);
    for place in 0..2 {
        let scene = Scene::from_layers(&model, |layer| layer == place);
        let pictures = ScenePictures::of_depth(renderer.clone(), &scene);
        let depth = || pictures.optical_depth(&view, size, &Context::SILENT).unwrap();
        let (first, twin) = (depth(), render::optical_depth(&scene, &view, size, &Context::SILENT).unwrap());
        let far = apart(&first, &twin, 0.0);
        println!("layer {place}: {far:.1e} of the largest pixel");
        assert!(far < 1e-4, "layer {place}: {far:.1e} of the largest pixel");
        let density = DensityView::of_view(&view, scene.bounds());
        assert_ne!(pictures.surface_density(&density, size, &Context::SILENT).unwrap(), first);
        assert_eq!(depth(), first);
    }
}

/// Counts dispatches and bytes that are read back.
#[derive(Default)]
struct Tally(Mutex<[u64; 2]>);

impl Tally {
    fn take(&self) -> [u64; 2] {
        std::mem::take(&mut self.0.lock().unwrap())
    }
}

impl KernelWatch for Tally {
    fn around(&self, _: &'static str, pass: &mut wgpu::ComputePass<'_>, run: &dyn Fn(&mut wgpu::ComputePass<'_>)) {
        self.0.lock().unwrap()[0] += 1;
        run(pass);
    }

    fn reads(&self, bytes: u64) {
        self.0.lock().unwrap()[1] += bytes;
    }
}

/// Pixels that footprints add to, over all planes.
fn additions(m: &Mixture, lens: &Lens, size: Size) -> f64 {
    let (levels, mut sum) = (levels(size), 0.0);
    for g in (0..m.len()).filter_map(|i| CameraGaussian::from_mixture(lens, m, i, m.count[i])) {
        pieces(lens, &g, |moments| {
            let Some(placed) = place(&levels, &g.footprint(lens, &moments)) else { return };
            let [along, down, end] = [placed.stroke.along, placed.stroke.down, placed.stroke.end].map(f64::from);
            // The area of the ellipse where the exponent is above `end`.
            sum -= std::f64::consts::PI * end / (along * down).sqrt();
        });
    }
    sum
}

/// A picture comes back as grey levels, a density as one plane with its pad, and a field as its sums on every plane.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn one_plane_of_a_picture_is_read_back() {
    let tally = Arc::new(Tally::default());
    let watch = |_: &_| Some(tally.clone() as Arc<dyn KernelWatch>);
    let device = Device::open_watched(AdapterChoice::Number(0), Checks::On, wgpu::Features::empty(), watch).unwrap();
    let (gaussians, size) = (with_fields(mixture(1, 500, 0.05)), Size { width: 1920, height: 1080 });
    let scene = scene(&gaussians);
    let pictures = ScenePictures::new(&Arc::new(device), &scene).unwrap();
    let view = view([1.0, 2.0, 6.0], [0.002, 0.05]);
    let density = DensityView::of_view(&view, scene.bounds());
    let plane = PlaneLayout::new(size).words()[0];
    let lenses = [Lens::optical(&view, size, scene.bounds()), Lens::density(&density, size, [0.0; 3])];
    let adds = lenses.map(|lens| additions(&gaussians, &lens.unwrap(), size));
    let checked_frame = |what: &str, adds: f64, least: u64| {
        let [dispatches, bytes] = tally.take();
        println!("{what}: {dispatches} dispatches, {:.0} thousand additions, {bytes} bytes read back", 1e-3 * adds);
        assert_eq!(bytes, least, "{what}");
    };
    // The second frame finds what the first one sent.
    for _ in 0..2 {
        for style in ToneStyle::ALL {
            pictures.draw(&view, size, style, &Context::SILENT).unwrap();
            checked_frame(style.name(), adds[0], size.pixels() as u64);
        }
        pictures.optical_depth(&view, size, &Context::SILENT).unwrap();
        checked_frame("a layer", adds[0], 4 * plane);
        pictures.surface_density(&density, size, &Context::SILENT).unwrap();
        checked_frame("a density", adds[1], 4 * plane);
        let query = field_query("scalar", MapComponent::Scalar, false);
        pictures.field_map(&query, &density, size, &Context::SILENT).unwrap();
        // The coarsest planes have no strokes.
        let planes = levels(size).into_iter().take(3).map(|level| 8 * (level.stride * level.rows) as u64);
        checked_frame("a field", 0.0, planes.sum());
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

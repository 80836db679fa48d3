//! The renderer against the plain law, and what must not change it.

use super::testing::view;
use super::*;
use crate::camera::{DensityView, Extent, Projection, View, Window, spherical_camera};
use crate::context::Context;
use crate::math::{Random, Sym3};
use crate::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
use crate::picture::{Plane, Size};
use crate::space::{Bounds, Cell};
use crate::splat::ToneStyle;

const SIZE: Size = Size { width: 96, height: 64 };

fn bounds() -> Bounds {
    Bounds { min: [-1.0; 3], max: [1.0; 3] }
}

/// Gaussians in the unit cube: round, flat, long, and without extent.
fn random_mixture(seed: u64, n: u64, spread: f64) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
        let base = spread * (0.1 + r.uniform());
        let sizes = [base, base * r.uniform(), base * r.uniform() * r.uniform()];
        let mut cov = Sym3::default();
        for s in sizes {
            let v = [0; 3].map(|_| r.normal());
            cov = cov.add(&Sym3::outer(v.map(|x| x * s / 1.7)));
        }
        if i % 7 == 0 {
            cov = Sym3::default();
        }
        m.push(mean, cov, (1.0 + 40.0 * r.uniform()).floor(), 0.0);
    }
    m
}

/// As long as the cube is half, and a millionth as wide: far below a pixel.
fn needles(seed: u64, n: u64) -> Mixture {
    let mut m = Mixture::default();
    for i in 0..n {
        let mut r = Random::new(seed, 1, i);
        let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
        let cov = [0.5, 1e-6, 1e-6].map(|s| Sym3::outer([0; 3].map(|_| s * r.normal())));
        m.push(mean, cov[0].add(&cov[1]).add(&cov[2]), 2e5, 0.0);
    }
    m
}

/// The largest and the mean difference of 1 - exp(-tau) from the plain law.
fn difference(m: &Mixture, view: &View) -> (f64, f64) {
    let scene = Scene::from_mixture(m, bounds());
    let fast = optical_depth(&scene, view, SIZE, &Context::SILENT).unwrap();
    let slow = plain::optical_depth(&scene, view, SIZE);
    let d = fast.data.iter().zip(&slow).map(|(f, s)| ((-s).exp() - (-f64::from(*f)).exp()).abs());
    d.fold((0.0, 0.0), |(w, sum), d| (d.max(w), sum + d / SIZE.pixels() as f64))
}

#[test]
fn small_gaussians_from_afar() {
    let m = random_mixture(1, 60, 0.05);
    for radius in [0.002, 0.02, 0.2] {
        let (worst, mean) = difference(&m, &view([1.0, 2.0, 6.0], radius, 0.05));
        assert!(worst < 1.5e-3 && mean < 2e-4, "radius {radius}: worst {worst:.1e}, mean {mean:.1e}");
    }
}

/// The rest is the skewness of single pieces, seen where one bright Gaussian stands alone.
#[test]
fn large_gaussians_and_a_camera_among_them() {
    for (seed, spread, position) in
        [(2, 0.4, [1.0, 2.0, 6.0]), (3, 0.4, [0.3, 0.2, 0.9]), (4, 0.1, [0.1, 0.2, 0.5]), (5, 1.5, [0.1, 0.2, 0.5])]
    {
        let (worst, mean) = difference(&random_mixture(seed, 25, spread), &view(position, 0.01, 0.1));
        assert!(worst < 3e-2 && mean < 5e-4, "spread {spread} from {position:?}: worst {worst:.1e}, mean {mean:.1e}");
    }
}

/// A cut is sharp in the law; pieces blur it by a fraction of the Gaussian's depth.
#[test]
fn the_clipping_range_cuts_gaussians() {
    let m = random_mixture(6, 40, 0.3);
    let mut v = view([1.0, 2.0, 6.0], 0.01, 0.3);
    v.camera.clipping_range = Some([5.9, 6.6]);
    for projection in [v.camera.projection, Projection::Orthographic { height_world: 2.5 }] {
        v.camera.projection = projection;
        let (worst, mean) = difference(&m, &v);
        assert!(worst < 2e-2 && mean < 1e-3, "{projection:?}: worst {worst:.1e}, mean {mean:.1e}");
    }
}

/// Stages that hand over f32 against f64 from end to end, drawn by the same raster.
#[test]
fn rounding_between_stages_does_not_show() {
    use super::bin::Binner;
    let wide = Size { width: 1920, height: 1080 };
    // Points, needles and blots; from afar, from close by, among them, and past the box's far corner.
    let trials = [
        (random_mixture(1, 3000, 0.02), [1.0, 2.0, 6.0], 0.0005, 0.05),
        (random_mixture(2, 3000, 0.002), [1.0, 2.0, 6.0], 0.004, 0.9),
        (random_mixture(3, 400, 0.3), [0.3, 0.2, 0.9], 0.01, 0.1),
        (random_mixture(4, 1000, 0.05), [0.05, 0.02, 0.04], 0.001, 1.0),
        (random_mixture(5, 300, 1.5), [0.9, 0.9, 1.2], 0.002, 0.05),
        (needles(6, 300), [1.0, 2.0, 6.0], 0.0001, 1.0),
        (needles(7, 300), [0.3, 0.2, 0.9], 0.0001, 1.0),
    ];
    for (trial, (m, position, radius, opacity)) in trials.into_iter().enumerate() {
        let view = view(position, radius, opacity);
        let scene = Scene::from_mixture(&m, bounds());
        let lens = lens::Lens::optical(&view, wide, &bounds()).unwrap();
        let levels = raster::pyramid::levels(wide);
        let mut binner = Binner::new(&levels, m.len());
        for f in (0..m.len()).flat_map(|i| plain::footprints(&lens, &m, i, m.count[i])) {
            binner.add_placed(&plain::place(&levels, &f));
        }
        let mut exact = depth::paint(wide, &[binner.finish()], &mut Scratch::default(), &Context::SILENT).unwrap();
        depth::grow(&mut exact, &lens);
        let tau = optical_depth(&scene, &view, wide, &Context::SILENT).unwrap();
        let bright = |p: &Plane| p.data.iter().map(|t| -f64::from(-t).exp_m1()).collect::<Vec<_>>();
        let (a, b) = (bright(&exact), bright(&tau));
        let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum();
        let decibels = -10.0 * (squares / wide.pixels() as f64).log10();
        assert!(a.iter().any(|v| *v > 0.1), "trial {trial}: nothing is seen");
        assert!(decibels > 95.0, "trial {trial}: {decibels:.1} dB");
        for style in [ToneStyle::Expected, ToneStyle::Paraview, ToneStyle::ParaviewNoFxaa] {
            let tones = Tones::new(view.opacity, view.radius_pixels(wide));
            let [a, b] = [&exact, &tau].map(|p| scene.tone(p, style, &tones).data);
            assert!(a.iter().zip(&b).all(|(a, b)| a.abs_diff(*b) <= 1), "trial {trial}, {style:?}");
        }
    }
}

/// Records without padding, of the sizes that are told to a GPU.
#[test]
fn what_stages_hand_over_is_plain() {
    fn size<T: bytemuck::Pod>() -> usize {
        size_of::<T>()
    }
    use super::alpha::project::{GreyCameraGaussian, ProjectedSplat, Splat};
    assert_eq!(
        [size::<project::CameraGaussian>(), size::<project::Footprint>(), size::<bin::RasterSplat>()],
        [40, 24, 32]
    );
    assert_eq!([size::<GreyCameraGaussian>(), size::<ProjectedSplat>(), size::<Splat>()], [44, 44, 32]);
}

#[test]
fn threads_and_vectors_do_not_change_a_bit() {
    let m = random_mixture(7, 9000, 0.1);
    let scene = Scene::from_mixture(&m, bounds());
    let v = view([0.1, 0.2, 2.0], 0.01, 0.1);
    let draw = |how: &Context<'_>| optical_depth(&scene, &v, SIZE, how).unwrap();
    let many = draw(&Context::SILENT);
    let plain = draw(&Context::scalar());
    let one = rayon_core::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| draw(&Context::SILENT));
    let bits = |p: &Plane| p.data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&many), bits(&one));
    assert_eq!(bits(&many), bits(&plain));
}

/// The sum over pixels is what the law says, whatever the footprint's size or place.
#[test]
fn depth_is_conserved() {
    for (i, sigma) in [0.0, 0.003, 0.01, 0.03, 0.1].into_iter().enumerate() {
        for k in 0..5 {
            let mut m = Mixture::default();
            let offset = 0.013 * k as f64;
            m.push([offset, 0.5 * offset, 0.0], Sym3::scaled_identity(sigma * sigma), 10.0, 10.0);
            let scene = Scene::from_mixture(&m, bounds());
            let v = view([0.0, 0.0, 6.0], 0.002, 0.05);
            let sum: f64 =
                optical_depth(&scene, &v, SIZE, &Context::SILENT).unwrap().data.iter().map(|v| f64::from(*v)).sum();
            let r = v.radius_pixels(SIZE);
            let law =
                10.0 * 2.0 * std::f64::consts::PI * 0.05 * 0.994_607_9 * r * r * (1.0 + 3.0 * sigma * sigma / 36.0);
            assert!((sum / law - 1.0).abs() < 2e-3, "{i} {k}: {sum} for {law}");
        }
    }
}

/// Tiny and huge units, and a box far from the origin.
#[test]
fn units_do_not_matter() {
    let m = random_mixture(8, 60, 0.1);
    let v = view([1.0, 2.0, 6.0], 0.01, 0.1);
    let draw = |scale: f64, shift: f64| {
        let mut n = m.clone();
        for c in &mut n.mean {
            c.iter_mut().for_each(|x| *x = *x * scale + shift);
        }
        for c in &mut n.cov {
            c.iter_mut().for_each(|x| *x *= scale * scale);
        }
        let b = Bounds { min: [shift - scale; 3], max: [shift + scale; 3] };
        let mut v = v.clone();
        v.radius *= scale;
        v.camera.position = v.camera.position.map(|x| x * scale + shift);
        v.camera.focal_point = v.camera.focal_point.map(|x| x * scale + shift);
        optical_depth(&Scene::from_mixture(&n, b), &v, SIZE, &Context::SILENT).unwrap().data
    };
    let base = draw(1.0, 0.0);
    for (scale, shift, limit) in [(1e-30, 0.0, 1e-5), (1e30, 0.0, 1e-5), (1.0, 1e6, 1e-5)] {
        let other = draw(scale, shift);
        let w = base.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(w < limit, "{scale} {shift}: {w}");
    }
}

/// A window of one box holds all mass wherever its centre is, and Gaussians near the box's edge
/// appear on both sides.
#[test]
fn periodic_windows_wrap() {
    let m = random_mixture(9, 50, 0.05);
    let total: f64 = m.count.iter().sum();
    let size = Size { width: 80, height: 80 };
    let window = |center: [f64; 3]| {
        let cell = Some(Cell::orthogonal([2.0; 3]));
        let window = Window { center, angles_deg: [0.0; 2], width: 2.0, depth: None };
        let view = DensityView::orthographic("w", &window, size, &bounds(), cell).unwrap();
        surface_density(&Scene::from_mixture(&m, bounds()), &view, size, &Context::SILENT).unwrap().data
    };
    let first = window([0.0; 3]);
    let second = window([1.0, -0.5, 3.7]);
    for plane in [&first, &second] {
        let mass = plane.iter().map(|v| f64::from(*v)).sum::<f64>() / 1600.0;
        assert!((mass / total - 1.0).abs() < 1e-5, "{mass} of {total}");
    }
    // The second window is the first, turned around by 40 and 20 pixels (y points up).
    // Gaussians that the slab cuts fall into other pieces there.
    let highest = first.iter().fold(0.0f32, |a, b| a.max(*b));
    for y in 0..80 {
        for x in 0..80 {
            let (a, b) = (first[y * 80 + x], second[(y + 60) % 80 * 80 + (x + 40) % 80]);
            assert!((a - b).abs() < 3e-2 * highest, "{x} {y}: {a} {b}");
        }
    }
}

/// A map that shows more than the box is that of the box, repeated, within it, and empty beyond.
#[test]
fn tails_that_leave_a_whole_box_come_in_on_the_other_side() {
    let m = random_mixture(9, 50, 0.1);
    let map = |width: usize| {
        let size = Size { width, height: 80 };
        let window = Window { center: [0.3, 0.0, 0.0], angles_deg: [0.0; 2], width: width as f64 / 40.0, depth: None };
        let view = DensityView::orthographic("w", &window, size, &bounds(), Some(Cell::orthogonal([2.0; 3]))).unwrap();
        surface_density(&Scene::from_mixture(&m, bounds()), &view, size, &Context::SILENT).unwrap().data
    };
    let (repeated, whole) = (map(80), map(120));
    let highest = repeated.iter().fold(0.0f32, |a, b| a.max(*b));
    for (at, value) in whole.iter().enumerate() {
        let expected = (at % 120).checked_sub(20).filter(|x| *x < 80).map_or(0.0, |x| repeated[at / 120 * 80 + x]);
        assert!((value - expected).abs() < 2e-3 * highest, "{at}: {value} for {expected} of {highest}");
    }
}

/// As few Gaussians make a model: what the interpolation leaves beyond the tails counts, too.
#[test]
fn a_wide_gaussian_keeps_its_mass_in_a_map_of_the_whole_box() {
    let mut m = Mixture::default();
    m.push([0.2, 0.3, -0.1], Sym3([0.25, 0.0, 0.0, 0.4, 0.0, 0.2]), 1e4, 1e4);
    let size = Size { width: 1280, height: 720 };
    let window = Window { center: [0.0; 3], angles_deg: [0.0; 2], width: 2.0 * 16.0 / 9.0, depth: None };
    let view = DensityView::orthographic("w", &window, size, &bounds(), Some(Cell::orthogonal([2.0; 3]))).unwrap();
    let plane = surface_density(&Scene::from_mixture(&m, bounds()), &view, size, &Context::SILENT).unwrap();
    let mass = plane.data.iter().map(|v| f64::from(*v)).sum::<f64>() / 360.0 / 360.0;
    assert!((mass / 1e4 - 1.0).abs() < 1e-5, "{}", mass / 1e4 - 1.0);
}

/// Boxes of any shape, from every side and obliquely, in pictures of any shape: the map that shows all of a periodic box
/// has its mass, with what Gaussians leave beyond its faces; from the sides it has the window of its particles.
#[test]
fn maps_of_whole_boxes_have_their_mass() {
    let m = random_mixture(9, 100, 0.08);
    let total: f64 = m.count.iter().sum();
    for sides in [[1.0, 1.0, 1.0], [2.0, 1.0, 0.5], [4.0, 2.0, 1.0]] {
        let mut m = m.clone();
        for i in 0..m.len() {
            // From the cube about 0 of edge 2 to this box.
            (0..3).for_each(|k| m.mean[k][i] = 0.5 * sides[k] * (m.mean[k][i].clamp(-1.0, 1.0) + 1.0));
        }
        let bounds = Bounds { min: [0.0; 3], max: sides };
        let (cell, scene) = (Cell::orthogonal(sides), Scene::from_mixture(&m, bounds));
        let extent = super::extent(&scene, Some(&cell));
        for (angles_deg, side) in [
            ([0.0, 0.0], [160, 90]),
            ([90.0, 0.0], [90, 90]),
            ([180.0, 0.0], [500, 900]),
            ([270.0, 0.0], [160, 90]),
            ([0.0, 90.0], [100, 50]),
            ([0.0, -90.0], [1280, 720]),
            ([30.0, 20.0], [160, 90]),
            ([30.0, 0.0], [64, 200]),
        ] {
            let size = Size { width: side[0], height: side[1] };
            let frame = spherical_camera([0.0; 3], angles_deg[0], angles_deg[1], 1.0).frame().unwrap();
            let width = extent.width(&frame, size);
            let of_particles = Extent::new(&bounds, Some(&cell)).width(&frame, size);
            assert!(width == of_particles || angles_deg[0] == 30.0, "{angles_deg:?}: {width} {of_particles}");
            let window = Window { center: extent.center, angles_deg, width, depth: None };
            let view = DensityView::orthographic("w", &window, size, &bounds, Some(cell)).unwrap();
            let plane = surface_density(&scene, &view, size, &Context::SILENT).unwrap();
            let area = (width / side[0] as f64).powi(2);
            let mass = plane.data.iter().map(|v| f64::from(*v)).sum::<f64>() * area;
            assert!((mass / total - 1.0).abs() < 1e-5, "{sides:?} {angles_deg:?} {side:?}: {}", mass / total - 1.0);
        }
    }
}

#[test]
fn densities_count_particles_where_a_layer_has_no_masses() {
    let gaussians = random_mixture(4, 60, 0.05);
    let number: f64 = gaussians.count.iter().sum();
    let block = Block { bounds: bounds(), count: number as u64, mass: number, gaussians };
    let layer = |name: &str, mass| Layer { name: name.into(), mass, content: vec![block.clone()] };
    let layers = vec![layer("dm", Mass::Each(5.0)), layer("tracers", Mass::Unknown)];
    let metadata = Metadata::new(LawKind::OpticalDepth, 2 * block.count, bounds());
    let model = Model { metadata, layers, certificate: None };
    let window = Window { center: [0.0; 3], angles_deg: [0.0; 2], width: 4.0, depth: None };
    let view = DensityView::orthographic("w", &window, SIZE, &bounds(), None).unwrap();
    let sum = |scene: Scene<'_>| {
        let plane = surface_density(&scene, &view, SIZE, &Context::SILENT).unwrap();
        plane.data.iter().map(|v| f64::from(*v)).sum::<f64>() * (4.0 / SIZE.width as f64).powi(2) / number
    };
    let both = sum(Scene::new(&model));
    assert!((both - 2.0).abs() < 0.01, "{both}");
    let alone = sum(Scene::from_layers(&model, |layer| layer == 0));
    assert!((alone - 5.0).abs() < 0.03, "{alone}");
    // As the page shows it, whose unit is that of all layers.
    assert!((sum(Scene::from_layers(&model, |layer| layer == 0).by_number()) - 1.0).abs() < 0.01);
}

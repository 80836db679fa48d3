//! Tests that hold the module's files together; of the noise-free optical depth against its plain twin in f64, which adds
//! every splat to every pixel.

use super::{Reference, fxaa};
use particlegs_core::camera::{Projection, View, base_distance, clipping_range, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::picture::{Plane, Size};
use particlegs_core::splat::{CUT_SIGMA, LARGEST_MEAN_ALPHA, ToneStyle, erf};
use particlegs_particles::Particles;
use particlegs_particles::testing::{from_points, on_threads};

const SIZE: Size = Size { width: 240, height: 136 };

/// Particles in a unit cube, half of them in a clump.
fn cube(n: usize, seed: u64) -> Particles {
    from_points((0..n as u64).map(|i| {
        let mut random = Random::new(seed, 1, i);
        [0; 3].map(|_| if i % 2 == 0 { 0.3 + 0.05 * random.normal() } else { random.uniform() })
    }))
}

/// A view of the cube whose splats have `radius_px` at the centre.
fn view(particles: &Particles, distance: f64, radius_px: f64, opacity: f64) -> View {
    let bounds = particles.bounds();
    let camera = spherical_camera(bounds.center(), 35.0, 20.0, distance * base_distance(&bounds, SIZE));
    let radius = radius_px * camera.distance() / camera.focal_pixels(SIZE);
    View { name: "test".into(), camera, radius, opacity }
}

/// The largest difference of 1 - exp(-tau).
fn largest_difference(a: &Plane, b: &Plane) -> f64 {
    let shade = |t: f32| -(-f64::from(t)).exp_m1();
    a.data.iter().zip(&b.data).map(|(&x, &y)| (shade(x) - shade(y)).abs()).fold(0.0, f64::max)
}

fn against_twin(particles: &Particles, view: &View) -> f64 {
    let reference = Reference::new(particles);
    let fast = reference.optical_depth(view, SIZE, &Context::SILENT).unwrap();
    let range = clipping_range(reference.bounds(), &view.camera);
    largest_difference(&fast, &twin_depth(particles, view, SIZE, range))
}

#[test]
fn optical_depth_agrees_with_brute_force() {
    for (n, radius_px) in
        [(20_000, 0.1), (20_000, 0.3), (10_000, 0.7), (2000, 2.5), (500, 6.0), (600, 15.0), (200, 40.0)]
    {
        for opacity in [0.05, 0.5] {
            if opacity > 0.1 && radius_px > 10.0 {
                continue; // The twin takes minutes; few splats of high opacity are tested below.
            }
            let particles = cube(n, 5);
            let d = against_twin(&particles, &view(&particles, 1.0, radius_px, opacity));
            println!("n {n} r {radius_px} px a {opacity}: {d:.2e}");
            assert!(d < 1e-3, "n {n}, {radius_px} px, opacity {opacity}: {d:.2e}");
        }
    }
}

#[test]
fn optical_depth_is_right_for_few_splats_and_inside() {
    for radius_px in [0.1, 0.5, 1.0, 3.0, 5.0, 9.0, 20.0, 40.0] {
        let few = cube(3, 9);
        let d = against_twin(&few, &view(&few, 0.8, radius_px, 0.9));
        println!("few {radius_px}: {d:.2e}");
        assert!(d < 1e-3, "few, {radius_px} px: {d:.2e}");
        let many = cube(1000, 3);
        let d = against_twin(&many, &view(&many, 0.12, radius_px.min(4.0), 0.05));
        println!("inside {radius_px}: {d:.2e}");
        assert!(d < 1e-3, "inside, {radius_px} px: {d:.2e}");
    }
}

/// Coarse planes blur the steps at the squares' edges; a clump's edges lie together.
#[test]
fn coarse_planes_agree_with_full_resolution() {
    for (n, radius_px, distance) in [(3000, 6.0, 1.0), (600, 15.0, 1.0), (600, 40.0, 1.0), (2000, 10.0, 0.3)] {
        let particles = cube(n, 5);
        let reference = Reference::new(&particles);
        let view = view(&particles, distance, radius_px, 0.05);
        let fine = reference.optical_depth_within(&view, SIZE, f64::INFINITY, &Context::SILENT).unwrap();
        let coarse = reference.optical_depth_within(&view, SIZE, 0.0, &Context::SILENT).unwrap();
        let d = largest_difference(&fine, &coarse);
        println!("coarse, n {n} r {radius_px} px: {d:.2e}");
        assert!(d < 2e-3, "n {n}, {radius_px} px: {d:.2e}");
    }
}

#[test]
fn threads_and_vectors_change_no_bit() {
    let particles = cube(200_000, 7);
    let reference = Reference::new(&particles);
    for (radius_px, distance) in [(0.2, 1.0), (3.0, 0.4)] {
        let view = view(&particles, distance, radius_px, 0.05);
        let draw = |how: &Context<'_>| {
            let tau = reference.optical_depth(&view, SIZE, how).unwrap();
            let exact = reference.draw(&view, SIZE, ToneStyle::Paraview, how).unwrap();
            (tau.data.iter().map(|t| t.to_bits()).collect::<Vec<_>>(), exact)
        };
        let many = draw(&Context::SILENT);
        let one = on_threads(1, || draw(&Context::SILENT));
        assert!(many == one, "threads change the picture");
        let plain = draw(&Context::scalar());
        assert!(many == plain, "vector instructions change the picture");
    }
}

#[test]
fn an_origin_moves_nothing() {
    let particles = cube(3000, 4);
    let mut far = particles.clone();
    far.origin = [1e6, -2e6, 3e6];
    let (a, b) = (Reference::new(&particles), Reference::new(&far));
    let (near_view, mut far_view) = (view(&particles, 1.0, 1.0, 0.05), view(&far, 1.0, 1.0, 0.05));
    far_view.radius = near_view.radius;
    let x = a.optical_depth(&near_view, SIZE, &Context::SILENT).unwrap();
    let y = b.optical_depth(&far_view, SIZE, &Context::SILENT).unwrap();
    assert!(largest_difference(&x, &y) < 1e-3);
}

#[test]
fn degenerate_snapshots_draw() {
    for particles in [cube(1, 1), Particles::from_columns(vec![2.0; 9], vec![2.0; 9], vec![2.0; 9])] {
        let v = view(&particles, 1.0, 2.0, 0.5);
        let reference = Reference::new(&particles);
        for style in ToneStyle::ALL {
            assert!(
                reference.draw(&v, SIZE, style, &Context::SILENT).unwrap().data.iter().any(|&p| p > 0),
                "{style:?}"
            );
        }
    }
}

#[test]
fn fxaa_leaves_smooth_pictures_alone() {
    let data = (0..SIZE.pixels()).map(|i| (i % SIZE.width) as u8).collect();
    let ramp = particlegs_core::picture::Gray8 { size: SIZE, data };
    assert_eq!(fxaa(&ramp), ramp);
}

/// tau* by the formula of docs/law/depth.md, from f64 cameras. Rotated splats (docs/law/splat.md,
/// "Shape") are averaged over points of a grid in each pixel.
fn twin_depth(particles: &Particles, view: &View, size: Size, range: [f64; 2]) -> Plane {
    let frame = view.camera.frame().unwrap();
    let Projection::Perspective { fov_deg } = view.camera.projection else { panic!("perspective") };
    let (w, h) = (size.width as f64, size.height as f64);
    let f = 0.5 * h / libm::tan(0.5 * fov_deg.to_radians());
    let mut tau = vec![0.0f64; size.pixels()];
    for i in 0..particles.len() {
        let [x, y, z] = frame.to_camera(particles.position(i));
        let depth = -z;
        let (tx, ty) = (x / depth, y / depth);
        if depth < range[0] || depth > range[1] || tx.abs() * f > 1.3 * 0.5 * w || ty.abs() * f > 1.3 * 0.5 * h {
            continue;
        }
        let (px, py) = (0.5 * w + f * tx, 0.5 * h + f * ty);
        let s = view.radius * f / depth;
        let (sx, sy) = (s * (1.0 + tx * tx).sqrt(), s * (1.0 + ty * ty).sqrt());
        let c01 = s * s * tx * ty / (0.25 * w * h);
        if c01.abs() <= 1e-6 {
            add_aligned(&mut tau, size, [px, py], [sx, sy], view.opacity);
        } else {
            let device = [(sx / (0.5 * w)).powi(2), (sy / (0.5 * h)).powi(2), c01];
            add_rotated(&mut tau, size, [px, py], device, view.opacity);
        }
    }
    let data = (0..size.height).rev().flat_map(|y| tau[y * size.width..(y + 1) * size.width].to_vec());
    Plane { size, data: data.map(|t| t as f32).collect() }
}

fn reach(center: f64, extent: f64, count: usize) -> std::ops::Range<usize> {
    let first = (center - extent).floor().max(0.0) as usize;
    first..((center + extent).floor() + 1.0).clamp(0.0, count as f64) as usize
}

fn minus_ln(m: f64) -> f64 {
    -libm::log1p(-m.min(LARGEST_MEAN_ALPHA))
}

/// The mean of exp(-u^2/2) over a pixel, cut.
fn share(pixel: usize, center: f64, sigma: f64) -> f64 {
    let edge = |e: f64| ((e - center) / sigma).clamp(-CUT_SIGMA, CUT_SIGMA) * std::f64::consts::FRAC_1_SQRT_2;
    let root = (0.5 * std::f64::consts::PI).sqrt();
    sigma * root * (erf(edge(pixel as f64 + 1.0)) - erf(edge(pixel as f64)))
}

fn add_aligned(tau: &mut [f64], size: Size, [px, py]: [f64; 2], [sx, sy]: [f64; 2], opacity: f64) {
    let columns = reach(px, CUT_SIGMA * sx, size.width);
    let across: Vec<f64> = columns.clone().map(|x| share(x, px, sx)).collect();
    for y in reach(py, CUT_SIGMA * sy, size.height) {
        let up = opacity * share(y, py, sy);
        for (x, a) in columns.clone().zip(&across) {
            tau[y * size.width + x] += minus_ln(up * a);
        }
    }
}

fn add_rotated(tau: &mut [f64], size: Size, [px, py]: [f64; 2], [c00, c11, c01]: [f64; 3], opacity: f64) {
    let (w, h) = (0.5 * size.width as f64, 0.5 * size.height as f64);
    let half = 0.5 * (c00 + c11);
    let term = (half * half - (c00 * c11 - c01 * c01)).sqrt();
    let (s1, s2) = ((half + term).sqrt(), (half - term).sqrt());
    let n = libm::hypot(half + term - c11, c01);
    let (ux, uy) = ((half + term - c11) / n, c01 / n);
    let [a, b, c, d] = [s1 * ux * w, s2 * uy * w, s1 * uy * h, -s2 * ux * h];
    let det = a * d - b * c;
    let fine: usize = if opacity < 0.1 && s2 * w > 4.0 { 4 } else { 16 };
    let (rx, ry) = (CUT_SIGMA * (a.abs() + b.abs()), CUT_SIGMA * (c.abs() + d.abs()));
    for y in reach(py, ry, size.height) {
        for x in reach(px, rx, size.width) {
            let mut sum = 0.0;
            for k in 0..fine * fine {
                let at = |n: usize| (n as f64 + 0.5) / fine as f64;
                let (dx, dy) = (x as f64 + at(k % fine) - px, y as f64 + at(k / fine) - py);
                let (u, v) = ((d * dx - b * dy) / det, (a * dy - c * dx) / det);
                if u.abs() <= CUT_SIGMA && v.abs() <= CUT_SIGMA {
                    sum += libm::exp(-0.5 * (u * u + v * v));
                }
            }
            tau[y * size.width + x] += minus_ln(opacity * sum / (fine * fine) as f64);
        }
    }
}

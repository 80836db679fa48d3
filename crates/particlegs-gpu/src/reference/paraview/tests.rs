//! ParaView's pictures of all particles against particlegs' own.

use super::*;
use crate::reference::source::ParticleStream;
use crate::tests::{self, device, particles};
use particlegs_core::context::Context;
use particlegs_core::splat::ToneStyle;
use particlegs_reference as reference;

const SIZE: Size = Size { width: 320, height: 180 };
const FAR: [f64; 3] = [1.0, 2.0, 6.0];
const NEAR: [f64; 3] = [0.3, 0.2, 0.9];

/// Those of the tests of depth, of which some are in one place, and some nowhere.
fn columns(n: usize) -> [Vec<f32>; 3] {
    let mut all = tests::columns(n);
    all.iter_mut().for_each(|column| column.iter_mut().skip(7).step_by(50).for_each(|v| *v = 0.125));
    all[1][n / 2] = f32::NAN;
    all[2][n / 3] = f32::INFINITY;
    all
}

fn view(position: [f64; 3], radius: f64, opacity: f64) -> View {
    let mut view = tests::view(position, [radius, opacity]);
    view.camera.clipping_range = Some(if position == FAR { [3.0, 9.0] } else { [0.01, 3.0] });
    view
}

fn points(device: &Device, columns: &[Vec<f32>; 3], pieces: usize) -> Vec<DeviceParticles> {
    let n = columns[0].len();
    let each = n.div_ceil(pieces);
    let piece = |k: usize| columns.each_ref().map(|c| &c[k * each..n.min((k + 1) * each)]);
    (0..pieces).map(|k| DeviceParticles::upload(device, piece(k)).unwrap()).collect()
}

fn draw(paraview: &Paraview, canvas: &ParaviewCanvas, view: &View, source: &dyn ParticleSource, fxaa: bool) -> Gray8 {
    let range = view.camera.clipping_range.unwrap();
    paraview.shot(canvas, view, [0.0; 3], range).unwrap().draw(source, fxaa).unwrap()
}

/// Pixels that differ, those that are lit, and the largest difference.
fn apart(a: &Gray8, b: &Gray8) -> (usize, usize, u8) {
    let apart = || a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b));
    (apart().filter(|d| *d > 0).count(), b.data.iter().filter(|v| **v > 0).count(), apart().max().unwrap_or(0))
}

/// Draws a view of both, in both looks; the lit pixels, of which as good as none may differ.
fn compare(device: &Arc<Device>, columns: &[Vec<f32>; 3], view: &View) -> usize {
    let paraview = Paraview::new(device).unwrap();
    let (particles, canvas) = (particles(columns), paraview.canvas(SIZE).unwrap());
    let cpu_reference = reference::Reference::new(&particles);
    let mut most = 0;
    for (fxaa, style) in [(false, ToneStyle::ParaviewNoFxaa), (true, ToneStyle::Paraview)] {
        let card = draw(&paraview, &canvas, view, &points(device, columns, 1), fxaa);
        let (differ, lit, worst) = apart(&card, &cpu_reference.draw(view, SIZE, style, &Context::SILENT).unwrap());
        let (at, radius, opacity) = (view.camera.position, view.radius, view.opacity);
        let summary =
            format!("{at:?} radius {radius} opacity {opacity} {}: {differ} of {lit}, largest {worst}", style.name());
        println!("{summary}");
        // None does on Mesa's software; a card's last bits may tell otherwise where two roundings are as near.
        assert!(differ * 10_000 <= lit, "{summary}");
        most = most.max(lit);
    }
    most
}

/// Splats below a pixel, of some pixels and large; faint, and opaque as they come.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn kernels_agree_with_their_twins() {
    let device = device();
    let columns = columns(4000);
    for (radius, opacity, least) in [
        (0.002, 0.05, 300),
        (0.02, 0.05, 10_000),
        (0.02, 1.0, 10_000),
        (0.1, 0.3, 20_000),
        (0.1, 0.005, 10_000),
        (0.1, 1.0, 20_000),
    ] {
        assert!(compare(&device, &columns, &view(FAR, radius, opacity)) > least, "{radius} {opacity}");
    }
}

/// From within, where splats are turned and reach far outside the picture, and depths crowd together.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_large_turned_splats_agree() {
    let device = device();
    assert!(compare(&device, &columns(4000), &view(NEAR, 0.01, 0.05)) > 40_000);
    assert!(compare(&device, &columns(300), &view(NEAR, 0.05, 0.2)) > 50_000);
    assert!(compare(&device, &columns(60), &view(NEAR, 0.3, 1.0)) > 50_000);
}

/// VTK stops once a peel writes no back layer anywhere: few particles, and particles that are nearly transparent.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn pictures_that_stop_early_agree() {
    let device = device();
    for (n, radius, opacity) in [(9, 0.02, 0.5), (60, 0.1, 0.5), (2000, 0.1, 0.002)] {
        assert!(compare(&device, &columns(n), &view(FAR, radius, opacity)) > 20, "{n} {radius} {opacity}");
    }
    let nothing = [vec![9.0], vec![9.0], vec![9.0]];
    assert_eq!(compare(&device, &nothing, &view(FAR, 0.1, 0.5)), 0);
}

/// Pieces, what is sorted at a time, and what stays on the device leave no trace; nor does the picture before.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_no_division_of_the_work_shows() {
    let device = device();
    let columns = columns(1500);
    let views = [view(FAR, 0.06, 0.3), view(FAR, 0.02, 1.0), view(FAR, 0.06, 0.3)];
    let small = DispatchLimits { slices: 7, pixels: 20_000, keys: 5000, band: 6400, strip: 13_000 };
    let mut all = Vec::new();
    for (limits, pieces) in [(LIMITS, 1), (LIMITS, 3), (small, 1), (small, 3)] {
        let paraview = Paraview::within(&device, limits).unwrap();
        let canvas = paraview.canvas(SIZE).unwrap();
        poison(&device, &canvas);
        let points = points(&device, &columns, pieces);
        all.push(views.each_ref().map(|v| draw(&paraview, &canvas, v, &points, true)));
    }
    let paraview = Paraview::new(&device).unwrap();
    let canvas = paraview.canvas(SIZE).unwrap();
    let columns_of = |range: std::ops::Range<usize>| columns.each_ref().map(|c| c[range.clone()].to_vec());
    let mut snapshot = ParticleStream::new(&device, 1500, Box::new(columns_of)).in_pieces(400);
    for bytes in [0, 12 * 800, 1 << 30] {
        snapshot.keep(bytes, &mut |_| Ok(())).unwrap();
        all.push(views.each_ref().map(|v| draw(&paraview, &canvas, v, &snapshot, true)));
    }
    for (k, drawn) in all.iter().enumerate() {
        assert!(drawn == &all[0], "pictures {k} differ");
        assert!(drawn[0] == drawn[2] && drawn[0] != drawn[1], "pictures {k}: the one before shows");
    }
}

/// Strips whose words of levels do not end with their rows; one peel more or less of one strip would show.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_strips_of_odd_pictures_leave_no_trace() {
    let device = device();
    let size = Size { width: 61, height: 45 };
    for (n, radius, opacity) in [(9, 0.02, 0.5), (300, 0.1, 0.3), (2000, 0.1, 0.002), (4000, 0.05, 1.0)] {
        let columns = columns(n);
        let particles = particles(&columns);
        let cpu_reference = reference::Reference::new(&particles);
        let view = view(FAR, radius, opacity);
        for (fxaa, style) in [(false, ToneStyle::ParaviewNoFxaa), (true, ToneStyle::Paraview)] {
            let expected = cpu_reference.draw(&view, size, style, &Context::SILENT).unwrap();
            for (strip, strips) in [(u64::MAX, 1), (1000, 3), (1, 12)] {
                let paraview = Paraview::within(&device, DispatchLimits { strip, ..LIMITS }).unwrap();
                let canvas = paraview.canvas(size).unwrap();
                assert_eq!(canvas.strips.len(), strips);
                let drawn = draw(&paraview, &canvas, &view, &points(&device, &columns, 2), fxaa);
                let (differ, lit, worst) = apart(&drawn, &expected);
                assert!(differ * 1000 <= lit, "{n} {radius} {opacity} {fxaa} {strips}: {differ} of {lit}, {worst}");
            }
        }
    }
}

/// The largest usual picture is drawn where a GPU binds no more than 128 MiB at once.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_picture_of_8k_is_drawn() {
    let device = device();
    let (columns, size) = (columns(300), Size { width: 7680, height: 4320 });
    let view = view(FAR, 0.02, 0.3);
    let paraview = Paraview::new(&device).unwrap();
    let canvas = paraview.canvas(size).unwrap();
    let card = draw(&paraview, &canvas, &view, &points(&device, &columns, 1), true);
    let particles = particles(&columns);
    let (differ, lit, worst) = apart(
        &card,
        &reference::Reference::new(&particles).draw(&view, size, ToneStyle::Paraview, &Context::SILENT).unwrap(),
    );
    assert!(lit > 100_000 && differ * 10_000 <= lit, "{differ} of {lit}, largest {worst}");
}

/// The order of particles matters, as in VTK: a card that blended in any would not see it.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_the_order_of_particles_is_kept() {
    let device = device();
    let columns = columns(4000);
    let turned = columns.each_ref().map(|c| c.iter().rev().copied().collect::<Vec<_>>());
    let view = view(FAR, 0.1, 0.3);
    let paraview = Paraview::new(&device).unwrap();
    let canvas = paraview.canvas(SIZE).unwrap();
    let [a, b] = [&columns, &turned].map(|c| draw(&paraview, &canvas, &view, &points(&device, c, 1), false));
    assert!(apart(&a, &b).0 > 100, "{:?}", apart(&a, &b));
    assert!(compare(&device, &turned, &view) > 20_000);
}

/// Whatever stands in buffers before a picture: not numbers.
fn poison(device: &Device, canvas: &ParaviewCanvas) {
    let of_strip = |s: &'_ Strip| [&s.ranges, &s.next_ranges, &s.layers, &s.next_layers].map(Clone::clone);
    let strips = canvas.strips.iter().flat_map(of_strip);
    for buffer in strips.chain([&canvas.found, &canvas.counts].map(Clone::clone)) {
        device.queue.write_buffer(&buffer, 0, &vec![0xff; buffer.size() as usize]);
    }
}

#[test]
fn every_pixel_is_in_one_slice() {
    let limits = DispatchLimits { slices: 3, pixels: 9000, keys: 0, band: 0, strip: 0 };
    let counts = [0, 1, 4096, 0, 4097, 20_000, 0];
    let batches: Vec<_> = Batches::new(&counts, &limits).collect();
    assert!(batches.iter().all(|b| (1..=3).contains(&b.len())), "{batches:?}");
    let mut next = [0; 7];
    for &[group, first] in batches.iter().flatten() {
        assert_eq!(next[group as usize], first);
        next[group as usize] = counts[group as usize].min(first + SLICE);
    }
    assert_eq!(next, counts);
}

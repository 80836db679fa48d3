//! The renderer against the plain law, and what must not change it.

use super::plain;
use super::raster::blend;
use super::*;
use crate::camera::{Normalisation, Projection, View};
use crate::context::Context;
use crate::math::{Random, Sym3, each_axis};
use crate::model::{AlphaBlend, Block, Law, Layer, Mass, Mixture, Model, VizMapper, VizRanges};
use crate::picture::{Plane, Size};
use crate::render::testing::{self, empty_model};
use crate::render::{self, Scene};
use crate::space::Bounds;
use crate::splat::ToneStyle;
use std::sync::Arc;

const SIZE: Size = Size { width: 83, height: 61 };
const FRAME: Normalisation = Normalisation { center: [0.0; 3], scale: 1.0 };

fn view(position: [f64; 3]) -> View {
    testing::view(position, 0.01, 0.05)
}

fn eye(position: [f64; 3]) -> Eye {
    Eye::new(&view(position), SIZE, &FRAME).unwrap()
}

/// Gaussians in the cube [-1, 1]^3: round, flat, long, without extent, faint, and nearly opaque.
fn gaussians(seed: u64, n: u64, spread: f64) -> Vec<Gaussian> {
    (0..n)
        .map(|i| {
            let mut r = Random::new(seed, 1, i);
            let mean = [0; 3].map(|_| 2.0 * r.uniform() - 1.0);
            let mut cov = Sym3::default();
            for k in 0..3 {
                let v = [0; 3].map(|_| r.normal());
                cov = cov.add(&Sym3::outer(v.map(|x| x * spread * 0.5f64.powi(k))));
            }
            if i % 7 == 0 {
                cov = Sym3::default();
            }
            let opacity = if i % 5 == 0 { 0.999 } else { r.uniform() * r.uniform() };
            Gaussian { mean, cov, opacity, grey: 0.2 + r.uniform() }
        })
        .collect()
}

fn draw(eye: &Eye, g: &[Gaussian], cut: CutOffs) -> Plane {
    draw_with(eye, g, cut, &Context::SILENT)
}

fn draw_with(eye: &Eye, g: &[Gaussian], cut: CutOffs, context: &Context<'_>) -> Plane {
    let plan = Plan::new(eye, g.len(), |i| Some(g[i].seen(eye)), cut, context).unwrap();
    blend(&plan, eye.size, context).unwrap()
}

/// The largest difference from the plain law, but for a few pixels at which rounding decides a
/// threshold.
fn difference(eye: &Eye, g: &[Gaussian], cut: CutOffs) -> f64 {
    let slow = plain::blend(eye, g, &cut);
    let fast = draw(eye, g, cut);
    let mut d: Vec<f64> = fast.data.iter().zip(&slow).map(|(f, s)| (f64::from(*f) - s).abs()).collect();
    d.sort_by(f64::total_cmp);
    assert!(d[d.len() - 1] < 6e-3, "{}", d[d.len() - 1]);
    assert!(g.len() == 1 || slow.iter().any(|v| *v > 0.05));
    d[d.len() - 6]
}

#[test]
fn agrees_with_the_plain_law() {
    for (seed, n, spread) in [(1, 1, 0.2), (2, 300, 0.05), (3, 100, 0.3), (4, 3000, 0.02)] {
        for position in [[1.0, 2.0, 4.0], [0.1, 0.3, 0.2]] {
            let g = gaussians(seed, n, spread);
            let d = difference(&eye(position), &g, CutOffs::PUBLISHED);
            assert!(d < 3e-5, "seed {seed} from {position:?}: {d:.1e}");
            let all = CutOffs { least_alpha: 1e-6, most_alpha: 1.0, least_transmittance: 0.0 };
            let d = difference(&eye(position), &g, all);
            assert!(d < 3e-5, "seed {seed} from {position:?}, all: {d:.1e}");
        }
    }
}

/// Stages that hand over f32 against f64 from end to end. Where rounding decides whether a footprint's
/// faintest pixel, or the last footprint of a pixel that is nearly done, is drawn, a pixel may differ by that.
#[test]
fn rounding_between_stages_does_not_show() {
    let size = Size { width: 1920, height: 1080 };
    for (seed, n, spread, position) in [
        (1, 60, 0.02, [1.0, 2.0, 4.0]),
        (2, 60, 0.002, [1.0, 2.0, 4.0]),
        (3, 60, 0.1, [0.3, 0.2, 0.9]),
        (4, 60, 0.01, [0.1, 0.3, 0.2]),
    ] {
        let (e, g) = (Eye::new(&view(position), size, &FRAME).unwrap(), gaussians(seed, n, spread));
        let (slow, fast) = (plain::blend(&e, &g, &CutOffs::PUBLISHED), draw(&e, &g, CutOffs::PUBLISHED));
        let pairs = || fast.data.iter().zip(&slow).map(|(f, s)| (f64::from(*f).clamp(0.0, 1.0), s.clamp(0.0, 1.0)));
        let squares: f64 = pairs().map(|(f, s)| (f - s) * (f - s)).sum();
        let decibels = -10.0 * (squares / size.pixels() as f64).log10();
        assert!(pairs().any(|(_, s)| s > 0.05), "seed {seed}: nothing is seen");
        assert!(decibels > 107.0, "seed {seed}: {decibels:.1} dB");
        assert!(pairs().all(|(f, s)| ((255.0 * f).round() - (255.0 * s).round()).abs() <= 1.0), "seed {seed}");
    }
}

fn bits(p: &Plane) -> Vec<u32> {
    p.data.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn threads_and_vectors_do_not_change_a_bit() {
    let g = gaussians(7, 9000, 0.03);
    let e = eye([1.0, 2.0, 4.0]);
    let many = draw(&e, &g, CutOffs::PUBLISHED);
    let one = rayon_core::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let one = one.install(|| draw(&e, &g, CutOffs::PUBLISHED));
    let plain = draw_with(&e, &g, CutOffs::PUBLISHED, &Context::scalar());
    assert_eq!(bits(&many), bits(&one));
    assert_eq!(bits(&many), bits(&plain));
}

#[test]
fn order_and_what_is_not_seen_do_not_matter() {
    let g = gaussians(8, 500, 0.05);
    let e = eye([1.0, 2.0, 4.0]);
    let here = bits(&draw(&e, &g, CutOffs::PUBLISHED));
    let mut turned: Vec<Gaussian> = g.iter().rev().copied().collect();
    assert_eq!(here, bits(&draw(&e, &turned, CutOffs::PUBLISHED)));
    // Behind the camera, beside the picture, and too faint.
    let small = Sym3::scaled_identity(1e-4);
    turned.push(Gaussian { mean: [2.0, 4.0, 8.0], cov: small, opacity: 0.9, grey: 1.0 });
    turned.push(Gaussian { mean: [40.0, 0.0, 0.0], cov: small, opacity: 0.9, grey: 1.0 });
    turned.push(Gaussian { mean: [0.0; 3], cov: small, opacity: 0.003, grey: 1.0 });
    assert_eq!(here, bits(&draw(&e, &turned, CutOffs::PUBLISHED)));
    // Behind a wall that leaves less than 1e-4.
    let wall: Vec<Gaussian> = (0..3)
        .map(|k| {
            let mean = [0.5, 1.0 + 1e-3 * f64::from(k), 2.0];
            Gaussian { mean, cov: Sym3::scaled_identity(4.0), opacity: 1.0, grey: 0.7 }
        })
        .collect();
    let alone = draw(&e, &wall, CutOffs::PUBLISHED);
    let mut both = wall;
    both.extend(&g[..100]);
    both.iter_mut().skip(3).for_each(|g| g.mean = g.mean.map(|v| 0.2 * v));
    assert_eq!(bits(&alone), bits(&draw(&e, &both, CutOffs::PUBLISHED)));
}

/// A part of a picture is that part of the picture, to the rounding of pixel coordinates.
#[test]
fn parts_are_cut_out() {
    let g = gaussians(12, 400, 0.06);
    let e = eye([1.0, 2.0, 4.0]);
    let whole = draw(&e, &g, CutOffs::PUBLISHED);
    let (corner, size) = ([21, 9], Size { width: 40, height: 33 });
    let part = draw(&e.part(corner, size), &g, CutOffs::PUBLISHED);
    let mut far = 0;
    for (i, v) in part.data.iter().enumerate() {
        let at = (i / size.width + corner[1]) * SIZE.width + i % size.width + corner[0];
        far += usize::from((v - whole.data[at]).abs() > 1e-5);
    }
    assert!(far < 4, "{far}");
}

#[test]
fn none_at_all_is_black() {
    assert!(draw(&eye([0.0, 0.0, 4.0]), &[], CutOffs::PUBLISHED).data.iter().all(|v| *v == 0.0));
}

/// One round Gaussian straight ahead: its peak and its width are those of the formula.
#[test]
fn one_gaussian_by_hand() {
    let size = Size { width: 65, height: 65 };
    let e = Eye::new(&view([0.0, 0.0, 4.0]), size, &FRAME).unwrap();
    let sigma = 0.1;
    let g = [Gaussian { mean: [0.0; 3], cov: Sym3::scaled_identity(sigma * sigma), opacity: 0.6, grey: 0.5 }];
    let drawn = draw(&e, &g, CutOffs::PUBLISHED);
    let variance = (sigma * e.focal / 4.0).powi(2);
    let peak = 0.5 * 0.6 * variance / (variance + 1.0);
    for d in 0..6 {
        let law = peak * (-0.5 * f64::from(d * d) / (variance + 1.0)).exp();
        let brightness = f64::from(drawn.data[32 * 65 + 32 + d as usize]);
        assert!((brightness - law).abs() < 1e-6, "{d}: {brightness} for {law}");
    }
}

fn model(n: usize, vizmapper: Option<VizMapper>) -> Model {
    let bounds = Bounds { min: [10.0; 3], max: [60.0; 3] };
    let frame = Normalisation::new(&bounds);
    let mut gaussians = Mixture::default();
    let mut law = AlphaBlend { vizmapper: vizmapper.map(Arc::new), ..AlphaBlend::default() };
    for g in self::gaussians(11, n as u64, 0.05) {
        let mean = each_axis(|k| frame.center[k] + g.mean[k] / frame.scale);
        gaussians.push(mean, g.cov.scale(frame.scale.powi(-2)), 1.0, 1.0);
        law.opacity.push(g.opacity);
        law.grey.push(g.grey);
    }
    gaussians.law = Law::AlphaBlend(law);
    let block = Block { bounds, count: n as u64, mass: n as f64, gaussians };
    let mut model = empty_model(bounds, n as u64);
    model.layers = vec![Layer { name: "dm".into(), mass: Mass::Unknown, content: vec![block] }];
    model
}

fn world_view(model: &Model) -> View {
    let frame = Normalisation::new(&model.metadata.bounds);
    let mut v = view([1.0, 2.0, 4.0]);
    v.camera.position = each_axis(|k| frame.center[k] + v.camera.position[k] / frame.scale);
    v.camera.focal_point = frame.center;
    v.radius = 0.03;
    v.opacity = 0.04;
    v
}

/// A model of a file, in world units, is what the law says of its Gaussians; every look is the same.
#[test]
fn models_are_drawn_by_their_law() {
    use crate::render::alpha::network::twin::stirred;
    for vizmapper in [None, Some(VizMapper::new(VizRanges::TRAINING, 1)), Some(stirred(2))] {
        let m = model(200, vizmapper.clone());
        let v = world_view(&m);
        let drawn = render::draw(&Scene::new(&m), &v, SIZE, ToneStyle::Paraview, &Context::SILENT).unwrap();
        assert_eq!(drawn, render::draw(&Scene::new(&m), &v, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap());
        let (fr, fa) = (1.5, 0.8);
        let adapted: Vec<Gaussian> = gaussians(11, 200, 0.05)
            .into_iter()
            .map(|mut g| {
                let Some(net) = &vizmapper else { return g };
                let parameters: Vec<f64> = net.parameters.iter().map(|v| f64::from(*v)).collect();
                let log_scale = g.cov.det().max(1e-72).ln() / 6.0;
                let logit = (g.opacity / (1.0 - g.opacity)).ln();
                let x = [fr - 1.0, fa - 1.0, (log_scale + 8.0) / 2.0, (logit + 3.0) / 4.0];
                let out = crate::render::alpha::network::twin::plain(&parameters, x);
                g.cov = g.cov.scale((fr * (1.0 + 0.1 * out[0])).powi(2));
                g.opacity = 1.0 / (1.0 + (-logit - (fa * (1.0 + 0.3 * out[1])).max(0.4).ln()).exp());
                g
            })
            .collect();
        let law = plain::blend(&eye([1.0, 2.0, 4.0]), &adapted, &CutOffs::PUBLISHED);
        let far = drawn.data.iter().zip(&law).filter(|(d, l)| (f64::from(**d) - 255.0 * l.min(1.0)).abs() > 0.55);
        assert!(far.count() <= 4);
    }
}

/// A model that the network bent for a view is that view, drawn at any radius and opacity.
#[test]
fn a_bent_model_needs_no_network() {
    let m = model(200, Some(crate::render::alpha::network::twin::stirred(2)));
    let mut v = world_view(&m);
    let wanted = render::draw(&Scene::new(&m), &v, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap();
    let plain = m.clone().bent(v.radius, v.opacity, &Context::SILENT).unwrap();
    assert!(plain.vizmapper().is_none());
    v.radius = 0.5;
    let got = render::draw(&Scene::new(&plain), &v, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap();
    let far = wanted.data.iter().zip(&got.data).filter(|(a, b)| a.abs_diff(**b) > 1);
    assert!(far.count() <= 2);
    assert_ne!(plain, model(200, None));
    assert_eq!(model(20, None).bent(1.0, 0.5, &Context::SILENT).unwrap(), model(20, None));
}

#[test]
fn faults_are_named() {
    let fault = |m: &Model, v: &View| {
        render::draw(&Scene::new(m), v, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap_err().to_string()
    };
    let mut m = model(20, None);
    let mut v = world_view(&m);
    m.layers[0].content[0].gaussians.mean[1][17] = f64::NAN;
    assert_eq!(fault(&m, &v), "Gaussian 17: the mean is not finite");
    m.layers[0].content[0].gaussians.law.alpha_blend_mut().unwrap().opacity[3] = f64::INFINITY;
    assert_eq!(fault(&m, &v), "Gaussian 3: the opacity is not finite");
    m.layers[0].content[0].gaussians.law = Law::OpticalDepth;
    assert!(fault(&m, &v).contains("no opacities"));
    v.camera.projection = Projection::Orthographic { height_world: 50.0 };
    assert!(fault(&m, &v).contains("only be drawn in perspective"));
}

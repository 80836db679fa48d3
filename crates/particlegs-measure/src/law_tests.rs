//! docs/law says what the program does: every table there that is announced as "(checked)" is computed
//! again.

use crate::score::{evaluation_views, shot_noise};
use crate::stats::StatsOptions;
use particlegs_core::camera::{
    Camera, FOV_DEG, ORBITS, Projection, View, base_distance, clipping_range, spherical_camera, spiral,
};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::{AlphaBlend, Law, LawKind, Metadata, Mixture, VizMapper, VizRanges};
use particlegs_core::picture::{DensityScores, Gray8, Plane, Size, masked_psnr, psnr, ssim};
use particlegs_core::render;
use particlegs_core::render::{Scene, tone};
use particlegs_core::space::Bounds;
use particlegs_core::splat::{
    CUT_SHARE, CUT_SHARE_2D, CUT_SIGMA, DEFAULT_OPACITY, DEPTH_TOLERANCE, FxaaMean, LARGEST_MEAN_ALPHA,
    MEAN_COVERED_ALPHA, PEELS, PIXEL_VARIANCE, Response, ToneStyle, erf, fxaa_blur, opacity_integral,
};
use particlegs_fit::recover::Method;
use particlegs_particles::Particles;
use particlegs_particles::testing::{from_points, model_of};
use particlegs_reference::{Reference, fxaa, uniform_box};
use particlegs_train::{Config, Preset};
use serde_json::Value;
use std::f64::consts::PI;
use std::sync::Arc;

const SPLAT: &str = include_str!("../../../docs/law/splat.md");
const DEPTH: &str = include_str!("../../../docs/law/depth.md");
const RESPONSE: &str = include_str!("../../../docs/law/response.md");
const FXAA: &str = include_str!("../../../docs/law/fxaa.md");
const SCORES: &str = include_str!("../../../docs/law/scores.md");
const CAMERAS: &str = include_str!("../../../docs/law/cameras.md");
const PUBLISHED: &str = include_str!("../../../docs/law/published.md");

/// The pages and the words that announce their tables.
const TABLES: [(&str, &[&str]); 7] = [
    (SPLAT, &["## Constants", "## Examples"]),
    (DEPTH, &["## Constants", "A2 / A1, by how much", "Sum over all pixels of `tau*`", "## Examples"]),
    (RESPONSE, &["## R (", "## Examples", "## Held to the exact rules"]),
    (FXAA, &["### Examples", "### Ratio", "### The blur", "### Held to the exact rules"]),
    (SCORES, &["## Examples", "Decibels of an even plane"]),
    (CAMERAS, &["## Constants", "## Examples"]),
    (PUBLISHED, &["### Examples", "## Training", "`recover --method`", "Its defaults"]),
];

/// The rows of the table that the line with `announced` and "(checked" announces; code marks are left out.
fn table(page: &str, announced: &str) -> Vec<Vec<String>> {
    let mut lines = page.lines().skip_while(|l| !(l.contains(announced) && l.contains("(checked"))).skip(1);
    let rows: Vec<&str> =
        lines.by_ref().skip_while(|l| !l.starts_with('|')).take_while(|l| l.starts_with('|')).collect();
    assert!(rows.len() > 2, "no table after `{announced}`");
    let cells = |row: &str| {
        let inner = row.trim_matches('|').replace("\\|", "\u{1}").replace('`', "");
        inner.split('|').map(|c| c.trim().replace('\u{1}', "|")).collect()
    };
    rows[2..].iter().map(|r| cells(r)).collect()
}

fn number(text: &str) -> f64 {
    text.trim_end_matches('…').parse().unwrap_or_else(|_| panic!("`{text}` is no number"))
}

/// Whether a page's number is `value`, to `slack`; one that goes on may differ in its last digit.
fn agrees(text: &str, value: f64, slack: f64) -> bool {
    let decimals = text.trim_end_matches('…').split_once('.').map_or(0, |(_, d)| d.len());
    let last = if text.ends_with('…') { 0.1f64.powi(decimals as i32) } else { 0.0 };
    (number(text) - value).abs() <= last + slack + 1e-12 * value.abs()
}

fn compare(page: &str, announced: &str, slack: f64, values: &[(&str, f64)]) {
    let rows = table(page, announced);
    for row in &rows {
        let value = values.iter().find(|(name, _)| *name == row[0]);
        let (_, value) = value.unwrap_or_else(|| panic!("`{}` is not checked", row[0]));
        assert!(agrees(&row[1], *value, slack), "{}: {} on the page, {value} here", row[0], row[1]);
    }
    assert_eq!(rows.len(), values.len(), "{announced}: what is checked is on the page");
}

#[test]
fn every_table_that_is_announced_is_checked() {
    for (page, announced) in TABLES {
        let lines: Vec<&str> = page.lines().filter(|l| l.contains("(checked")).collect();
        assert_eq!(lines.len(), announced.len(), "{lines:?}");
        for (line, words) in lines.iter().zip(announced) {
            assert!(line.contains(words), "`{line}` is not checked");
        }
    }
}

// ---------------------------------------------------------------- scenes

/// Nine pixels square: the middle one's centre lies on the axis.
const SMALL: Size = Size { width: 9, height: 9 };
const MIDDLE: usize = 40;

/// A camera at the origin that looks along -z.
fn ahead(fov_deg: f64, clipping_range: [f64; 2]) -> Camera {
    let (projection, clipping_range) = (Projection::Perspective { fov_deg }, Some(clipping_range));
    Camera { projection, clipping_range, ..Camera::looking_at([0.0, 0.0, -1.0], [0.0; 3]) }
}

/// One that sees a world unit a pixel, whatever the depth.
fn orthographic(size: Size) -> Camera {
    Camera { projection: Projection::Orthographic { height_world: size.height as f64 }, ..ahead(30.0, [1.0, 1000.0]) }
}

fn view(camera: Camera, radius: f64, opacity: f64) -> View {
    View { name: "law".into(), camera, radius, opacity }
}

/// Sum over all pixels.
fn sum(plane: &Plane) -> f64 {
    plane.data.iter().map(|v| f64::from(*v)).sum()
}

/// tau* of one splat of `sigma` pixels at x/z = `slope`, over its A1 sigma^2: summed over the picture.
fn one_splat(size: Size, sigma: f64, opacity: f64, slope: f64) -> f64 {
    let camera = ahead(30.0, [0.5, 20.0]);
    let radius = sigma * 5.0 / camera.focal_pixels(size);
    let particle = Particles::from_columns(vec![(5.0 * slope) as f32], vec![0.0], vec![-5.0]);
    let tau = Reference::new(&particle).optical_depth(&view(camera, radius, opacity), size, &Context::SILENT).unwrap();
    sum(&tau) / (opacity_integral(opacity) * sigma * sigma)
}

/// One Gaussian of `count` particles on the axis.
fn gaussian(depth: f64, cov: Sym3, count: f64) -> Mixture {
    let mut m = Mixture::default();
    m.push([0.0, 0.0, -depth], cov, count, count);
    m
}

fn cube() -> Bounds {
    Bounds { min: [-1.0; 3], max: [1.0; 3] }
}

// ---------------------------------------------------------------- splat.md

/// ParaView's picture, without FXAA, of particles at (x, 0, -depth).
fn drawn(fov_deg: f64, x: f64, depths: &[f64], radius: f64, opacity: f64) -> Gray8 {
    let particles = from_points(depths.iter().map(|d| [x, 0.0, -d]));
    let view = view(ahead(fov_deg, [0.5, 20.0]), radius, opacity);
    Reference::new(&particles).draw(&view, SMALL, ToneStyle::ParaviewNoFxaa, &Context::SILENT).unwrap()
}

/// The place between `low` and `high` where something ceases to be.
fn end_of(is: impl Fn(f64) -> bool, low: f64, high: f64) -> f64 {
    assert!(is(low) && !is(high));
    let halve = |(a, b): (f64, f64)| if is(0.5 * (a + b)) { (0.5 * (a + b), b) } else { (a, 0.5 * (a + b)) };
    (0..30).fold((low, high), |ends, _| halve(ends)).0
}

#[test]
fn constants_of_a_splat_are_those_of_the_page() {
    // Centres farther out than this are dropped, however large the splat.
    let half = 5.0 * (0.5 * FOV_DEG.to_radians()).tan();
    let margin = end_of(|m| drawn(FOV_DEG, m * half, &[5.0], 1.0, 0.5).data.iter().any(|v| *v > 0), 1.0, 2.0);
    // A splat whose left edge stands right of a pixel's centre covers it up to half a step.
    let pixel = 5.0 / ahead(1.0, [0.5, 20.0]).focal_pixels(SMALL);
    let beyond = end_of(|d| drawn(1.0, (0.6 + d) * pixel, &[5.0], 0.2 * pixel, 1.0).data[MIDDLE] > 0, 0.0, 0.1);
    let steps = 0.5 / beyond;
    assert!((margin - 1.3).abs() < 1e-4 && (steps - 256.0).abs() < 1.0, "{margin} {steps}");
    let values = [
        ("CUT_SIGMA", CUT_SIGMA),
        ("CUT_SHARE", CUT_SHARE),
        ("CUT_SHARE_2D", CUT_SHARE_2D),
        ("MEAN_COVERED_ALPHA", MEAN_COVERED_ALPHA),
        ("PEELS", PEELS as f64),
        ("DEPTH_TOLERANCE", format!("{DEPTH_TOLERANCE:e}").parse().unwrap()),
        ("DEFAULT_OPACITY", DEFAULT_OPACITY),
        ("frustum margin", (1e3 * margin).round() / 1e3),
        ("steps of a pixel", steps.round()),
    ];
    compare(SPLAT, "## Constants", 0.0, &values);
}

#[test]
fn fragments_on_one_pixel_have_the_levels_of_the_page() {
    for row in table(SPLAT, "## Examples") {
        let (count, rest) = row[0].split_once(" of opacity ").unwrap();
        let opacity = rest.split([' ', ':']).next().unwrap();
        let n: usize = count.parse().unwrap();
        let together = rest.contains("in one place");
        let depths: Vec<f64> = (0..n).map(|i| if together { 5.0 } else { 2.0 + 10.0 * i as f64 / n as f64 }).collect();
        let level = drawn(FOV_DEG, 0.0, &depths, 0.02, number(opacity)).data[MIDDLE];
        assert!(agrees(&row[1], level.into(), 0.0), "{}: {level}", row[0]);
    }
}

// ---------------------------------------------------------------- depth.md

#[test]
fn constants_of_depth_are_those_of_the_page() {
    let values = [
        ("PIXEL_VARIANCE", PIXEL_VARIANCE),
        ("LARGEST_MEAN_ALPHA", LARGEST_MEAN_ALPHA),
        ("A1 at opacity 0.05", opacity_integral(0.05)),
    ];
    compare(DEPTH, "## Constants", 0.0, &values);
}

/// The page's series; a splat of 20 pixels has its sum.
#[test]
fn an_extended_splat_has_the_depth_of_the_page() {
    for row in table(DEPTH, "A2 / A1, by how much") {
        let a = number(&row[0]);
        let term = |k: i32| a.powi(k) / f64::from(k * k) * erf(3.0 * (0.5 * f64::from(k)).sqrt()).powi(2);
        let over = (1..100).map(term).sum::<f64>() / (a * CUT_SHARE_2D);
        assert!(agrees(&row[1], over, 0.0), "{a}: {over}");
        let large = one_splat(Size { width: 161, height: 161 }, 20.0, a, 0.0);
        assert!((large / over - 1.0).abs() < 1e-3, "{a}: {large} for {over}");
    }
}

#[test]
fn one_splat_has_the_depth_of_the_page() {
    for row in table(DEPTH, "Sum over all pixels of `tau*`") {
        let (sigma, opacity) = row[0].split_once(" pixel").unwrap();
        let opacity = opacity.split(' ').next_back().unwrap();
        let depth_sum = one_splat(Size { width: 161, height: 161 }, number(sigma), number(opacity), 0.0);
        assert!(agrees(&row[1], depth_sum, 1e-3), "{}: {depth_sum}", row[0]);
    }
}

#[test]
fn gaussians_have_the_depth_of_the_page() {
    let size = Size { width: 101, height: 101 };
    let parallel = |mixture: &Mixture, radius: f64| {
        let scene = Scene::from_mixture(mixture, cube());
        render::optical_depth(&scene, &view(orthographic(size), radius, 0.05), size, &Context::SILENT).unwrap()
    };
    let wide = parallel(&gaussian(500.0, Sym3::scaled_identity(100.0), 1000.0), 2.0);
    let narrow = parallel(&gaussian(500.0, Sym3::default(), 1000.0), 0.3);
    let spread = |share: f64| {
        let cov = Sym3([1e-6, 0.0, 0.0, 1e-6, 0.0, (10.0 * share).powi(2)]);
        let mixture = gaussian(10.0, cov, 1000.0);
        let view = view(ahead(30.0, [0.5, 60.0]), 0.1, 0.05);
        sum(&render::optical_depth(&Scene::from_mixture(&mixture, cube()), &view, size, &Context::SILENT).unwrap())
    };
    let wide_picture = Size { width: 161, height: 91 };
    let hacc = Bounds { min: [0.0; 3], max: [64.0, 256.0, 256.0] };
    let mut camera = spherical_camera(hacc.center(), 90.0, 0.0, 400.0);
    camera.projection = Projection::Orthographic { height_world: 128.0 };
    let even =
        uniform_box(&particlegs_particles::Domain::new(&hacc, None), 280_953_867.0, &view(camera, 0.01, 0.05), SMALL)
            .unwrap();
    let values = [
        (
            "tau at the middle of 1000 particles, S = (10 pixels)^2, r_px = 2, opacity 0.05, orthographic: \
             n A1 r_px^2 / (2 pi (100 + 4 + 1/12))",
            f64::from(wide.data[50 * 101 + 50]),
        ),
        ("the same with S = 0 and r_px = 0.3, all pixels' sum", sum(&narrow)),
        ("weight of a Gaussian with a spread of 0.02 of its depth, over one without", spread(0.02) / spread(0.0)),
        ("the same at 0.1: cut into pieces", spread(0.1) / spread(0.0)),
        (
            "growth of the sum of a splat at X = 0.4, Y = 0",
            one_splat(wide_picture, 0.3, 0.05, 0.4) / one_splat(wide_picture, 0.3, 0.05, 0.0),
        ),
        (
            "tau of 280 953 867 particles even in 64 x 256 x 256, along the short edge, r = 0.01, opacity 0.05",
            f64::from(even.data[MIDDLE]),
        ),
    ];
    let rows = table(DEPTH, "## Examples");
    assert_eq!(rows.len(), values.len());
    for (row, (name, value)) in rows.iter().zip(values) {
        assert_eq!(row[0], name);
        assert!((number(&row[1]) / value - 1.0).abs() < 1e-3, "{name}: {value}");
    }
}

// ---------------------------------------------------------------- response.md

#[test]
fn the_level_curve_is_that_of_the_page() {
    let opacities = [0.0125, 0.03, 0.05, 0.0875, 0.2, 0.5];
    let head = opacities.map(|a| a.to_string()).join(" | ");
    assert!(RESPONSE.contains(&format!("| tau | 255 (1 - exp(-tau)) | {head} |")));
    let curves = opacities.map(Response::new);
    for row in table(RESPONSE, "## R (") {
        let tau = number(&row[0]);
        assert!(agrees(&row[1], 255.0 * -(-tau).exp_m1(), 0.005), "{row:?}");
        for ((curve, a), text) in curves.iter().zip(opacities).zip(&row[2..]) {
            let level = curve.level(tau as f32).into();
            assert!(agrees(text, level, 0.0051), "tau {tau}, opacity {a}: {text} on the page, {level} here");
        }
    }
    // Where the table ends, and what is rounded away.
    assert_eq!(curves[2].level(16.0), curves[2].level(1e9));
    assert_eq!(curves[2].level(0.5f32.powi(16)), 0.25 * curves[2].level(0.5f32.powi(14)));
    assert_eq!(Response::new(0.5 / 255.0).level(8.0), 0.0);
    assert!(Response::new(0.51 / 255.0).level(8.0) > 0.0);
}

#[test]
fn even_planes_have_the_levels_of_the_page() {
    for row in table(RESPONSE, "## Examples") {
        let plane = Plane { size: SMALL, data: vec![number(&row[0]) as f32; SMALL.pixels()] };
        for (text, look) in row[1..].iter().zip([ToneStyle::Expected, ToneStyle::ParaviewNoFxaa, ToneStyle::Paraview]) {
            let picture = tone(&plane, look, 0.05, 0.3);
            assert!(picture.data.iter().all(|v| agrees(text, (*v).into(), 0.0)), "{row:?}: {}", picture.data[0]);
        }
    }
}

/// A picture by the exact rules of splats at random in a slab seen through a long lens.
fn sheet(opacity: f64, radius_px: f64, tau: f64) -> Gray8 {
    let size = Size { width: 256, height: 256 };
    let camera = ahead(2.0, [98.0, 102.0]);
    let (distance, pixel) = (100.0, 100.0 / camera.focal_pixels(size));
    let reach = 0.5 * size.width as f64 + 4.0 * radius_px + 2.0;
    let n = tau * (2.0 * reach).powi(2) / (opacity_integral(opacity) * radius_px * radius_px);
    let mut random = Random::new(7, 1, 0);
    let particles = from_points((0..n.round() as usize).map(|_| {
        let depth = 1.0 + 0.02 * (random.uniform() - 0.5);
        let mut aside = || (2.0 * random.uniform() - 1.0) * reach * pixel * depth;
        [aside(), aside(), -distance * depth]
    }));
    let view = view(camera, radius_px * pixel, opacity);
    Reference::new(&particles).draw(&view, size, ToneStyle::ParaviewNoFxaa, &Context::SILENT).unwrap()
}

/// Mean level and standard deviation.
fn moments(picture: &Gray8) -> [f64; 2] {
    let n = picture.data.len() as f64;
    let mean = picture.data.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    [mean, (picture.data.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n).sqrt()]
}

#[test]
fn random_splats_have_the_mean_level_and_the_noise_told() {
    for row in table(RESPONSE, "## Held to the exact rules") {
        let [a, radius, tau] = [0, 1, 2].map(|k| number(&row[k]));
        let [mean, deviation] = moments(&sheet(a, radius, tau));
        let level = f64::from(Response::new(a).level(tau as f32));
        let law = 255.0 * ((-2.0 * tau).exp() * (0.5 * a * tau).exp_m1()).sqrt();
        println!("| {a} | {radius} | {tau} | {mean:.2} | {level:.2} | {deviation:.2} | {law:.2} |");
        for (text, value) in row[3..].iter().zip([mean, level, deviation, law]) {
            assert!(agrees(text, value, 0.0151), "{row:?}: {value}");
        }
        // Pixels that share splats do not count apart.
        let error = deviation * ((4.0 * PI * radius * radius + 1.0) / 65_536.0).sqrt();
        assert!((mean - level).abs() < 3.0 * error, "{row:?}: {} errors", (mean - level) / error);
    }
}

// ---------------------------------------------------------------- fxaa.md

#[test]
fn fxaa_changes_pixels_and_edges_as_on_the_page() {
    let pixel = |level: u8, ground: u8| {
        let mut picture = Gray8 { size: SMALL, data: vec![ground; SMALL.pixels()] };
        picture.data[MIDDLE] = level;
        f64::from(fxaa(&picture).data[MIDDLE])
    };
    let size = Size { width: 64, height: 8 };
    let bright = |i: usize| i / 64 > 4 || (i / 64 == 4 && i % 64 >= 32);
    let stair = Gray8 { size, data: (0..size.pixels()).map(|i| if bright(i) { 200 } else { 0 }).collect() };
    let row = 4 * 64..5 * 64;
    let changed = fxaa(&stair).data[row.clone()].iter().zip(&stair.data[row]).filter(|(a, b)| a != b).count();
    let values = [
        ("one pixel of 255 on black, 9 x 9 pixels", pixel(255, 0)),
        ("one pixel of 100 on black", pixel(100, 0)),
        ("one pixel of 12 on black", pixel(12, 0)),
        ("one pixel of 11 on black: below 0.045 x 255 = 11.5", pixel(11, 0)),
        ("one pixel of 255 on 223", pixel(255, 223)),
        ("one pixel of 255 on 224: below 0.125 x 255 = 31.9", pixel(255, 224)),
        ("an edge that steps by a row: pixels of that row that change, 12 to either side", changed as f64),
    ];
    compare(FXAA, "### Examples", 0.0, &values);
}

#[test]
fn fxaas_mean_at_the_nodes_is_that_of_the_page() {
    let rows = table(FXAA, "### Ratio");
    assert_eq!(rows.len(), 28);
    for row in rows {
        let mean = FxaaMean::new(number(&row[0]), number(&row[1]));
        for (text, tau) in row[2..].iter().zip([0.01, 0.03, 0.1, 0.3, 1.0, 3.0]) {
            let ratio = mean.ratio(tau).into();
            assert!(agrees(text, ratio, 1e-5), "{row:?}, tau {tau}: {ratio}");
        }
    }
    // Beyond the table: faint single fragments, and wide splats.
    let loss = |a, radius| 1.0 - FxaaMean::new(a, radius).ratio(0.01);
    assert!((loss(0.00625, 0.3) / loss(0.0125, 0.3) - 0.5).abs() < 1e-3);
    let wide = 1.0 - FxaaMean::new(0.5, 4.0).ratio(0.1);
    assert!((wide / (1.0 - FxaaMean::new(0.5, 2.0).ratio(0.1)) - 0.25).abs() < 1e-3);
}

#[test]
fn fxaas_blur_is_that_of_the_page() {
    for row in table(FXAA, "### The blur") {
        let tap = fxaa_blur(number(&row[0]), number(&row[1]));
        assert!(agrees(&row[2], tap.into(), 1e-7), "{row:?}: {tap}");
    }
    // On the picture: a line of white is spread to its neighbours.
    let mut plane = Plane::zeros(SMALL);
    (0..9).for_each(|x| plane.data[4 * 9 + x] = 8.0);
    let picture = tone(&plane, ToneStyle::Paraview, 0.05, 0.3);
    let level = 245.92f64;
    for (row, share) in [(2, 0.0), (3, 0.0404), (4, 1.0 - 2.0 * 0.0404)] {
        assert_eq!(picture.data[row * 9 + 4], (share * level).round() as u8, "row {row}");
    }
}

#[test]
fn random_splats_lose_what_is_told() {
    for row in table(FXAA, "### Held to the exact rules") {
        let [a, radius, tau] = [0, 1, 2].map(|k| number(&row[k]));
        let noisy = sheet(a, radius, tau);
        let ([mean, deviation], [smooth, less]) = (moments(&noisy), moments(&fxaa(&noisy)));
        let estimate = f64::from(FxaaMean::new(a, radius).ratio(tau as f32));
        println!("| {a} | {radius} | {tau} | {:.3} | {estimate:.3} | {:.2} |", smooth / mean, less / deviation);
        for ((text, value), slack) in
            row[3..].iter().zip([smooth / mean, estimate, less / deviation]).zip([0.0021, 0.0006, 0.0101])
        {
            assert!(agrees(text, value, slack), "{row:?}: {value}");
        }
        // What the page says of the table's estimates.
        let off = (smooth / mean - estimate).abs();
        assert!(off < if a == 0.05 { 0.0061 } else { 0.0451 }, "{row:?}: off by {off}");
    }
}

// ---------------------------------------------------------------- scores.md

#[test]
fn scores_are_those_of_the_page() {
    let even = |level: u8| Gray8 { size: SMALL, data: vec![level; SMALL.pixels()] };
    let row = |data: &[u8]| Gray8 { size: Size { width: data.len(), height: 1 }, data: data.to_vec() };
    let (a, b) = (row(&[0, 0, 3, 2]), row(&[255, 0, 0, 2]));
    let plane = |v: &[f32]| Plane { size: Size { width: v.len(), height: 1 }, data: v.to_vec() };
    let densities = |a: &[f32], b: &[f32]| DensityScores::new(&plane(a), &plane(b), &Context::SILENT).unwrap();
    let values = [
        ("PSNR of pictures one level apart everywhere", psnr(&even(7), &even(8)).unwrap()),
        ("PSNR of black and white", psnr(&even(0), &even(255)).unwrap()),
        ("PSNR of 0, 0, 3, 2 and 255, 0, 0, 2", psnr(&a, &b).unwrap()),
        ("masked PSNR of the same: two of the four are lit", masked_psnr(&a, &b).unwrap()),
        ("masked PSNR of even 2 and even 3: lit", masked_psnr(&even(2), &even(3)).unwrap()),
        ("SSIM of black and white: K1^2 / (1 + K1^2)", ssim(&even(0), &even(255)).unwrap()),
        ("SSIM of equal pictures", ssim(&even(9), &even(9)).unwrap()),
        (
            "RMS of densities 10, 100, 1000, 77 against 1, 10, 100, 0, dex",
            densities(&[10.0, 100.0, 1000.0, 77.0], &[1.0, 10.0, 100.0, 0.0]).rms_dex.unwrap(),
        ),
        (
            "mean of densities 1, 1, 0 against 1, 1, 1, dex: a hole is a factor of 1000",
            densities(&[1.0, 1.0, 0.0], &[1.0; 3]).mean_dex.unwrap(),
        ),
    ];
    compare(SCORES, "## Examples", 0.0, &values);
    // 2 is not lit; a side below the window has no SSIM.
    assert_eq!(masked_psnr(&even(2), &even(1)), None);
    assert_eq!(ssim(&a, &b), None);
    let c1 = 0.01f64 * 0.01;
    assert!((ssim(&even(0), &even(255)).unwrap() - c1 / (1.0 + c1)).abs() < 1e-12);
}

#[test]
fn shot_noise_floors_are_those_of_the_page() {
    let lit = Gray8 { size: SMALL, data: vec![100; SMALL.pixels()] };
    for row in table(SCORES, "Decibels of an even plane") {
        let plane = Plane { size: SMALL, data: vec![number(&row[0]) as f32; SMALL.pixels()] };
        let floor = shot_noise(&plane, 0.05, &lit, &lit).unwrap();
        assert!(agrees(&row[1], floor, 0.0), "{row:?}: {floor}");
    }
}

// ---------------------------------------------------------------- cameras.md

const HD: Size = Size { width: 1920, height: 1080 };

/// Ends of the interval that Beta(3, 3) draws come from, by their mean and variance (1/28 of its square).
fn ends(draws: &[f64]) -> [f64; 2] {
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<f64>() / n;
    let half = (7.0 * draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n).sqrt();
    [mean - half, mean + half]
}

#[test]
fn constants_of_cameras_are_those_of_the_page() {
    let bounds = cube();
    let share = base_distance(&bounds, HD) * (0.5 * FOV_DEG.to_radians()).sin() / 3f64.sqrt();
    // A box of 8 with 8 particles has a spacing of 1.
    let radius = bounds.default_radius(8);
    let model = Metadata { bounds, default_radius: 1.0, ..model_of(&[], [1.0; 3]).metadata };
    let views = evaluation_views(&model, HD, 1, 1000);
    let radii: Vec<f64> = views.iter().map(|v| v.radius).collect();
    let opacities: Vec<f64> = views.iter().map(|v| v.opacity).collect();
    let rows = table(CAMERAS, "## Constants");
    let value = |name: &str| number(&rows.iter().find(|r| r[0] == name).unwrap()[1]);
    for (draws, quantity) in [(&radii, "radius"), (&opacities, "opacity")] {
        let range = [value(&format!("least {quantity} drawn")), value(&format!("greatest {quantity} drawn"))];
        assert!(draws.iter().all(|d| (range[0]..=range[1]).contains(d)), "{quantity}");
        let interval = ends(draws);
        let off = (0..2).map(|k| (interval[k] - range[k]).abs()).fold(0.0, f64::max);
        assert!(off < 0.02 * (range[1] - range[0]), "{quantity}: {interval:?}");
    }
    let orbit = |name: &str| ORBITS.iter().find(|o| o.name == name).unwrap().factor;
    let values = [
        ("FOV_DEG", FOV_DEG),
        ("share of ResetCamera's distance", share),
        ("orbit far", orbit("far")),
        ("orbit mid", orbit("mid")),
        ("orbit near", orbit("near")),
        ("default radius", radius),
        // Found in the draws above.
        ("least radius drawn", value("least radius drawn")),
        ("greatest radius drawn", value("greatest radius drawn")),
        ("least opacity drawn", value("least opacity drawn")),
        ("greatest opacity drawn", value("greatest opacity drawn")),
    ];
    compare(CAMERAS, "## Constants", 1e-12, &values);
}

#[test]
fn cameras_stand_and_clip_as_on_the_page() {
    let hacc = Bounds { min: [0.0; 3], max: [64.0, 256.0, 256.0] };
    let base = base_distance(&hacc, HD);
    let radius = hacc.default_radius(280_953_867);
    let far_view = view(spherical_camera(hacc.center(), 0.0, 0.0, base), radius, 0.05);
    let unit = Bounds { min: [0.0; 3], max: [1.0; 3] };
    let clip = |distance: f64| clipping_range(&unit, &spherical_camera(unit.center(), 0.0, 0.0, distance));
    let published = spiral([0.0; 3], 1.0, 80, None);
    let [x, y, z] = published[1].position;
    let values = [
        ("base distance of 64 x 256 x 256 at 1920 x 1080", base),
        ("the same at 1080 x 1920", base_distance(&hacc, Size { width: 1080, height: 1920 })),
        ("default radius there, 280 953 867 particles", radius),
        ("pixels of the default radius at the far orbit, 1080 high", far_view.radius_pixels(HD)),
        ("near of a unit cube seen from 3, along an axis", clip(3.0)[0]),
        ("far of the same", clip(3.0)[1]),
        ("near of a unit cube seen from 0.4: within", clip(0.4)[0]),
        ("far of that", clip(0.4)[1]),
        ("first y of a published spiral", published[0].position[1]),
        ("second x of 80 frames at distance 1", x),
        ("second y", y),
        ("second z", z),
    ];
    compare(CAMERAS, "## Examples", 1e-12, &values);
    assert_eq!(published[1].view_up, [0.0, 0.0, 1.0]);
    assert_eq!(published[40].view_up, [0.0, 1.0, 0.0]);
}

// ---------------------------------------------------------------- published.md

/// The level at the middle of one white Gaussian of opacity 0.5 and 4 pixels squared.
fn blended(network: Option<&VizMapper>, [radius, opacity]: [f64; 2], depth: f64) -> f64 {
    let camera = Camera { clipping_range: None, ..ahead(FOV_DEG, [1.0, 2.0]) };
    let pixel = depth / camera.focal_pixels(SMALL);
    let mut mixture = gaussian(depth, Sym3::scaled_identity(4.0 * pixel * pixel), 1.0);
    let vizmapper = network.cloned().map(Arc::new);
    mixture.law = Law::AlphaBlend(AlphaBlend { opacity: vec![0.5], grey: vec![1.0], vizmapper });
    let scene = Scene::from_law(&mixture, cube(), 1.0, 0.05);
    let view = view(camera, radius, 0.05 * opacity);
    f64::from(render::draw(&scene, &view, SMALL, ToneStyle::Expected, &Context::SILENT).unwrap().data[MIDDLE])
}

#[test]
fn one_gaussian_of_the_published_law_is_drawn_as_on_the_page() {
    let untrained = VizMapper::new(VizRanges::TRAINING, 1);
    assert!(PUBLISHED.contains(&format!("4-64-64-2, SiLU between, tanh at its end, {} p", untrained.parameters.len())));
    // A unit of the training frame.
    let unit = base_distance(&cube(), HD) / 4.0;
    assert!(blended(None, [1.0; 2], 0.201 * unit) > 0.0);
    let values = [
        ("without a network: 255 x 0.5 x sqrt(4 x 4 / (5 x 5))", blended(None, [1.0; 2], 10.0)),
        ("without a network, radius and opacity doubled", blended(None, [2.0; 2], 10.0)),
        ("with one, radius 1.5 times: 9 pixels squared", blended(Some(&untrained), [1.5, 1.0], 10.0)),
        ("with one, opacity 2 times: odds of 2", blended(Some(&untrained), [1.0, 2.0], 10.0)),
        ("with one, opacity 0.25 times: odds of 0.4, the floor", blended(Some(&untrained), [1.0, 0.25], 10.0)),
        ("nearer than 0.2 in the training frame", blended(None, [1.0; 2], 0.199 * unit)),
    ];
    compare(PUBLISHED, "### Examples", 0.0, &values);
}

/// Names and values of all hyper-parameters, as the page writes them.
fn leaves(value: &Value, name: &str, into: &mut Vec<(String, String)>) {
    match value {
        Value::Object(table) => table.iter().for_each(|(key, value)| {
            leaves(value, &format!("{name}{}{key}", if name.is_empty() { "" } else { "." }), into);
        }),
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            items.iter().enumerate().for_each(|(i, item)| leaves(item, &format!("{name}[{i}]"), into));
        }
        _ => into.push((name.to_string(), said(value))),
    }
}

fn said(value: &Value) -> String {
    match value {
        Value::Array(items) => items.iter().map(said).collect::<Vec<_>>().join(", "),
        Value::String(text) => text.clone(),
        Value::Number(n) => n.as_f64().unwrap().to_string(),
        other => other.to_string(),
    }
}

#[test]
fn the_published_recipe_is_that_of_the_page() {
    let own_prefixes = ["optical_depth.", "evaluate_", "checkpoint_", "cache_"];
    let settings_of = |config: Config| {
        let mut all = Vec::new();
        leaves(&serde_json::to_value(config).unwrap(), "", &mut all);
        all.retain(|(name, _)| !own_prefixes.iter().any(|o| name.starts_with(o)) && !name.ends_with(".crop"));
        all
    };
    let (single, tuning) =
        (settings_of(Config::preset(Preset::Paper, LawKind::AlphaBlend)), settings_of(Config::fine_tuning()));
    let rows = table(PUBLISHED, "## Training");
    let find = |all: &[(String, String)], name: &str| {
        all.iter().find(|(n, _)| n == name).map_or("-".to_string(), |(_, value)| value.clone())
    };
    for (name, value) in &single {
        let row = rows.iter().find(|r| r[0] == *name).unwrap_or_else(|| panic!("`{name}` is not on the page"));
        assert_eq!([&row[1], &row[2]], [value, &find(&tuning, name)], "{name}");
    }
    assert!(tuning.iter().all(|(name, _)| find(&single, name) != "-"));
    assert_eq!(rows.len(), single.len());
}

#[test]
fn methods_and_conventions_are_those_of_the_page() {
    let methods = [Method::Count, Method::Volume, Method::Ellipsoid, Method::Grid, Method::Stratified, Method::Spaced];
    let rows = table(PUBLISHED, "`recover --method`");
    assert_eq!(rows.iter().map(|r| r[0].as_str()).collect::<Vec<_>>(), methods.map(Method::name));
    let options = StatsOptions::default();
    let values = [("cells", crate::stats::PAPER_CELLS as f64), ("neighbour_sample", options.neighbour_sample as f64)];
    compare(PUBLISHED, "Its defaults", 0.0, &values);
}

//! The page as a file: size, content and security policy.

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use particlegs_core::camera::{DensityView, View, base_distance, spherical_camera};
use particlegs_core::context::Context;
use particlegs_core::model::{LawKind, Model};
use particlegs_core::picture::{Colormap, DensityColors, Size};
use particlegs_core::render::{Scene, draw, surface_density};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, codec};
use particlegs_view::page::{ModelFile, PageOpening, PageStyle, Snapshot, offline, served};
use particlegs_view::poster;
use sha2::{Digest, Sha256};

/// A model file of real particles.
const MODEL: &[u8] = include_bytes!("../../particlegs-compress/tests/fixtures/format-1.0.pgs");
const OTHER: &[u8] = include_bytes!("../../particlegs-compress/tests/fixtures/format-1.0-alpha.pgs");

fn page(models: &[ModelFile<'_>]) -> String {
    let decoded: Vec<Model> = models.iter().map(|m| codec::decode(m.bytes, m.name).unwrap()).collect();
    let models: Vec<_> = models.iter().copied().zip(&decoded).collect();
    String::from_utf8(offline(&models, &PageOpening::default(), &Context::SILENT).unwrap()).unwrap()
}

/// The text of an element.
fn element<'a>(html: &'a str, id: &str) -> &'a str {
    let after = html.split_once(&format!("id=\"{id}\">")).unwrap_or_else(|| panic!("no element {id}")).1;
    after.split_once("</script>").unwrap().0
}

fn setup(html: &str) -> serde_json::Value {
    serde_json::from_str(element(html, "setup")).unwrap()
}

#[test]
fn a_page_is_the_models_and_a_shell() {
    let shell = page(&[]).len();
    for models in [&[MODEL][..], &[MODEL, OTHER], &[MODEL; 20]] {
        let files: Vec<ModelFile<'_>> = models.iter().map(|bytes| ModelFile { name: "model.pgs", bytes }).collect();
        let html = page(&files);
        let bytes: usize = models.iter().map(|m| m.len()).sum();
        // Besides its bytes, each model needs a name, a number, a verdict and two tags.
        let most = (1.35 * bytes as f64) as usize + shell + 1200 * models.len();
        assert!(html.len() <= most, "{} of {bytes} and a shell of {shell}", html.len());
        for (i, model) in models.iter().enumerate() {
            assert_eq!(BASE64_STANDARD.decode(element(&html, &format!("model-{i}"))).unwrap(), *model);
            assert_eq!(setup(&html)["models"][i]["element"], format!("model-{i}"));
            assert_eq!(setup(&html)["models"][i]["bytes"], model.len());
        }
        assert_eq!(setup(&html)["engine"]["element"], "engine");
        assert_eq!(BASE64_STANDARD.decode(element(&html, "engine")).unwrap()[..2], [0x1f, 0x8b]);
        assert_eq!((setup(&html)["served"].as_bool(), setup(&html)["truth"].is_null()), (Some(false), true));
    }
}

/// A browser runs only scripts with the policy's hashes.
#[test]
fn the_policy_names_the_script_and_the_style_that_are_there() {
    let offline = page(&[ModelFile { name: "model.pgs", bytes: MODEL }]);
    let snapshot = Snapshot { name: "snapshot".into(), particles: 7, density_of: "particles".into() };
    let served =
        served([ModelFile { name: "model.pgs", bytes: MODEL }], Some(&snapshot), &PageOpening::default(), true);
    assert_eq!(setup(&served.html)["truth"]["particles"], 7);
    assert!(served.html.contains("<img id=\"poster\" alt=\"model.pgs\" src=\"poster\">"));
    for (html, is_served) in [(&offline, false), (&served.html, true)] {
        let policy = html.split_once("Content-Security-Policy\" content=\"").unwrap().1.split_once('"').unwrap().0;
        let policy = policy.replace("&#39;", "'");
        let between = |from: &str, to: &str| {
            let after = html.split_once(from).unwrap().1;
            let hash = BASE64_STANDARD.encode(Sha256::digest(after.split_once(to).unwrap().0.as_bytes()));
            format!("'sha256-{hash}'")
        };
        let (script, style) = (between("<script>", "</script>"), between("<style>", "</style>"));
        let directive = |name: &str| {
            let source_list = policy.split("; ").find_map(|d| d.strip_prefix(name)?.strip_prefix(' '));
            source_list.map(str::to_string)
        };
        assert_eq!(directive("default-src").as_deref(), Some("'none'"));
        assert_eq!(directive("script-src"), Some(format!("{script} 'wasm-unsafe-eval'")));
        assert_eq!(directive("style-src"), Some(style));
        assert_eq!(directive("worker-src").as_deref(), Some("blob:"));
        assert_eq!(directive("connect-src").is_some(), is_served);
        for never in ["'unsafe-eval'", "'unsafe-inline'", "*", "http"] {
            assert!(!policy.contains(never), "{never} in {policy}");
        }
        // One script runs; the others are data.
        assert_eq!(
            (html.matches("<script>").count(), html.matches("<script").count()),
            (1, if is_served { 3 } else { 5 })
        );
    }
    assert!(served.policy.contains("connect-src 'self'"));
}

#[test]
fn hostile_names_stay_names() {
    let names = [
        "</script><script>alert(1)</script>",
        "</title><img src=x onerror=alert(1)>",
        "\"><b>' & <!-- <script>",
        "\u{202e}\u{2028}\0\u{7}名前.pgs",
    ];
    let plain = page(&[ModelFile { name: "plain", bytes: MODEL }]);
    let count = |html: &str, tag: &str| html.to_ascii_lowercase().matches(tag).count();
    for name in names {
        let html = page(&[ModelFile { name, bytes: MODEL }]);
        for tag in ["<script", "</script", "<title", "</title", "<img", "<b>", "<!--"] {
            assert_eq!(count(&html, tag), count(&plain, tag), "{tag} of {name:?}");
        }
        assert_eq!(setup(&html)["models"][0]["name"], name);
    }
}

#[test]
fn a_page_is_not_made_once_it_is_cancelled() {
    let model = codec::decode(MODEL, "m").unwrap();
    let (file, opening) = (ModelFile { name: "m", bytes: MODEL }, PageOpening::default());
    assert!(matches!(
        offline(&[(file, &model)], &opening, &Context::SILENT.with_cancel(&|| true)),
        Err(Error::Cancelled)
    ));
}

/// A model large enough for a poster.
fn large() -> Vec<u8> {
    let mut model = codec::decode(MODEL, "model").unwrap();
    model.certificate = None;
    let block = &mut model.layers[0].content[0];
    let one = block.gaussians.clone();
    // Shifted copies of the same Gaussians.
    for copy in 1.. {
        if block.gaussians.len() > poster::MORE_THAN {
            break;
        }
        for i in 0..one.len() {
            let step = copy as f64 / (1 << 20) as f64 * (block.bounds.max[0] - block.bounds.min[0]);
            let mut mean = one.mean_of(i);
            mean[0] += step;
            block.gaussians.push(mean, one.cov_of(i), one.count[i], one.mass_of(i));
        }
    }
    block.count = block.gaussians.count.iter().sum::<f64>() as u64;
    block.mass = (0..block.gaussians.len()).map(|i| block.gaussians.mass_of(i)).sum();
    model.layers.truncate(1);
    model.layers[0].content.truncate(1);
    (model.metadata.count, model.metadata.mass) = (model.layers[0].content[0].count, model.layers[0].content[0].mass);
    codec::encode(&model, &codec::Precision::BALANCED).unwrap()
}

#[test]
fn a_large_model_has_its_poster_in_the_page() {
    let model = large();
    let alone = page(&[ModelFile { name: "large.pgs", bytes: &model }]);
    let (before, after) =
        alone.split_once("<img id=\"poster\" alt=\"large.pgs\" src=\"data:image/png;base64,").unwrap();
    let png = BASE64_STANDARD.decode(after.split_once('"').unwrap().0).unwrap();
    assert!(png.starts_with(b"\x89PNG") && png.len() < 100_000, "{}", png.len());
    // The poster comes before the model.
    assert!(before.len() < alone.find("id=\"model-0\"").unwrap());
    // A page with two models has no poster.
    let both = page(&[ModelFile { name: "large.pgs", bytes: &model }, ModelFile { name: "other.pgs", bytes: OTHER }]);
    assert!(!both.contains("id=\"poster\" "));
}

/// The page contains only the given settings of the opening.
#[test]
fn a_page_says_how_it_opens() {
    let model = codec::decode(MODEL, "model").unwrap();
    let opening_of = |opening: &PageOpening| {
        let file = ModelFile { name: "m", bytes: MODEL };
        setup(std::str::from_utf8(&offline(&[(file, &model)], opening, &Context::SILENT).unwrap()).unwrap())["opening"]
            .clone()
    };
    assert_eq!(opening_of(&PageOpening::default()), serde_json::json!({}));
    let (style, colormap) = (Some(PageStyle::Paraview), Some(Colormap::Viridis));
    let opening = PageOpening {
        style,
        colormap,
        azimuth: Some(30.0),
        layers: vec!["</script>".into()],
        ..PageOpening::default()
    };
    let settings =
        serde_json::json!({ "style": "paraview", "colormap": "viridis", "azimuth": 30.0, "layers": ["</script>"] });
    assert_eq!(opening_of(&opening), settings);
}

/// The poster equals the command's picture of the default view: surface density, or style `paraview` for splats.
#[test]
fn the_poster_is_the_default_view() {
    let size = Size { width: 96, height: 54 };
    let pixels = |png: Vec<u8>| {
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    for file in [MODEL, OTHER] {
        let model = codec::decode(file, "model").unwrap();
        let (m, scene) = (&model.metadata, Scene::new(&model));
        let camera = spherical_camera(m.bounds.center(), 0.0, 0.0, base_distance(&m.bounds, size));
        let view = View { name: "view".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
        let poster = poster::draw(&model, size, &Context::SILENT).unwrap();
        let expected: Vec<u8> = if m.law == LawKind::AlphaBlend {
            assert_eq!(poster.range, None);
            draw(&scene, &view, size, ToneStyle::Paraview, &Context::SILENT).unwrap().data
        } else {
            let plane =
                surface_density(&scene, &DensityView::of_view(&view, &m.bounds), size, &Context::SILENT).unwrap();
            assert_eq!(poster.range, plane.first_range());
            let colors = DensityColors::new(Colormap::Inferno, false, plane.first_range().unwrap());
            plane.data.iter().flat_map(|v| colors.of(*v)).collect()
        };
        assert!(expected.iter().any(|&v| v > 9) && pixels(poster.png) == expected);
    }
    let (usual, other) = (PageOpening::default(), PageOpening { white: Some(true), ..PageOpening::default() });
    let circles = PageOpening { circles: vec![([0.0; 3], 1.0)], ..PageOpening::default() };
    assert!(!poster::wanted(100_000, &usual) && poster::wanted(100_001, &usual) && !poster::wanted(100_001, &other));
    assert!(poster::wanted(100_001, &circles));
}

//! Every command that reads a model, with a tiny untrained alpha-blend model of the sample.

use crate::common::{TestFolder, listing, tiny};
use particlegs_core::model::LawKind;
use particlegs_particles::Particles;
use serde_json::Value;

/// A folder with the model `m.pgs` of 64 runs.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    dir.write("m.pgs", tiny(0..64, LawKind::AlphaBlend));
    dir
}

#[test]
fn info_and_verify_describe_the_model() {
    let dir = folder();
    let [text, _] = dir.runs("info m.pgs");
    assert!(text.contains("1.0, image law alpha-blend"), "{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let network = "layers of 4, 64, 64, 2 values, 4610 parameters in 4812 bytes; scale within 0.1, opacity within 0.3";
    assert!(words.contains(network), "{text}");
    assert!(text.contains("4352 bytes as PLY, 68 per Gaussian"), "{text}");
    let info = dir.says("info m.pgs");
    assert_eq!((info["metadata"]["law"].as_str(), info["published_bytes"].as_u64()), (Some("alpha-blend"), Some(4352)));
    assert_eq!((&info["vizmapper"]["parameters"], &info["vizmapper"]["ranges"]["floor"]), (&4610.into(), &0.4.into()));
    let [text, _] = dir.runs("verify m.pgs");
    assert!(text.contains("64 Gaussians for 262144 particles"), "{text}");
    // Pictures are scored by its own law, densities and particles by its counts.
    let measured = &dir.says("verify m.pgs SAMPLE --quiet")["measured_again"];
    assert!(measured["orbits"][0]["expected"]["masked_psnr"].is_number(), "{measured}");
    let correlation = measured["density"]["correlation"].as_f64().unwrap();
    assert!(correlation > 0.0 && correlation < 1.0, "{measured}");
    let mut bytes = dir.bytes("m.pgs");
    bytes[700] ^= 1;
    dir.write("bad.pgs", bytes);
    dir.fails("verify bad.pgs", 4, "VIZM");
}

#[test]
fn it_is_drawn_and_scored() {
    let dir = folder();
    let render = |style: &str| format!("render m.pgs --out pictures --size 160x90 --quiet --style {style}");
    for style in ["paraview", "paraview-no-fxaa", "expected"] {
        dir.runs(&render(style));
    }
    assert_eq!(listing(&dir.at("pictures")), ["view.png"]);
    std::fs::remove_dir_all(dir.at("pictures")).unwrap();
    dir.fails(&render("density"), 2, "no density");
    assert!(!dir.at("pictures").exists());
    let scores = dir.says("eval m.pgs SAMPLE --frames 1 --size 96x54 --quiet");
    for style in ["paraview", "paraview_no_fxaa", "expected"] {
        assert!(scores["mean"][style]["masked_psnr"].is_number(), "{scores}");
    }
}

#[test]
fn merging_takes_the_network_of_the_first_block() {
    let dir = TestFolder::new();
    for (name, runs) in [("a.pgs", 0..30), ("b.pgs", 30..64)] {
        dir.write(name, tiny(runs, LawKind::AlphaBlend));
    }
    let merged = |parts: &str, name: &str| {
        let [_, said] = dir.runs(&format!("merge {parts} -o {name}"));
        assert!(said.contains("note: the VizMapper is that of the part with the first block"), "{said}");
        dir.bytes(name)
    };
    assert_eq!(merged("a.pgs b.pgs", "ab.pgs"), merged("b.pgs a.pgs", "ba.pgs"));
    let whole = dir.model("ab.pgs");
    assert_eq!((whole.gaussians(), whole.metadata.count, whole.vizmapper().is_some()), (64, 262_144, true));
    dir.runs("verify ab.pgs");
    dir.write("c.pgs", tiny(30..64, LawKind::OpticalDepth));
    dir.fails("merge a.pgs c.pgs -o no.pgs", 3, "the image law is optical-depth");
    assert!(!dir.at("no.pgs").exists());
}

#[test]
fn particles_are_recovered_by_opacity() {
    let dir = folder();
    for method in ["count", "volume", "ellipsoid", "grid", "stratified", "spaced"] {
        dir.runs(&format!("recover m.pgs -o {method} --method {method} --quiet"));
        let p = Particles::open_raw(&[dir.at(method)]).unwrap();
        assert_eq!(p.len(), 262_144);
        let from = &dir.json(&format!("{method}/meta.json"))["recovered_from"];
        let has_own_counts = !["volume", "grid"].contains(&method);
        assert_eq!(
            (&from["law"], &from["each_gaussian_has_its_own_count"]),
            (&"alpha-blend".into(), &has_own_counts.into())
        );
    }
    let meta = dir.json("count/meta.json");
    let supports: Vec<&str> = meta["supports"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(supports.last().unwrap().contains("opacities"), "{supports:?}");
    dir.runs("recover m.pgs -o wide --scale 1.5 --particles 1000 --quiet");
}

#[test]
fn statistics_are_labelled_and_reduction_is_refused() {
    let dir = folder();
    dir.runs("stats SAMPLE m.pgs -o stats --only density --grid 16 --no-plots");
    let stats = dir.json("stats/stats.json");
    let notes: Vec<&str> = stats["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(notes.iter().any(|n| n.contains("density of an alpha-blend model follows its opacities")), "{notes:?}");
    let refused = "a model of the alpha-blend law cannot be simplified";
    dir.fails("simplify m.pgs -o small.pgs --gaussians 10", 2, refused);
    assert!(!dir.at("small.pgs").exists());
}

#[test]
fn splats_are_written_as_published() {
    let dir = folder();
    let [text, _] = dir.runs("convert m.pgs -o m.ply");
    assert!(text.contains("64 splats"), "{text}");
    let bytes = dir.bytes("m.ply");
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    assert_eq!(bytes.len() - end, 64 * 68);
    // Other commands read it as a snapshot of 64 points, in the frame of an alpha-blend model.
    dir.runs("convert m.ply -o points --quiet");
    let (model, points) = (dir.model("m.pgs"), Particles::open_raw(&[dir.at("points")]).unwrap());
    let frame = particlegs_core::camera::Normalisation::new(&model.metadata.bounds);
    let g = &model.layers[0].content[0].gaussians;
    for i in 0..64 {
        let p = points.position(i);
        let signs = [-1.0, -1.0, 1.0];
        assert!((0..3).all(|k| (signs[k] * p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-4));
    }
    dir.fails("convert m.pgs -o no", 2, "ends in .ply");
    dir.fails("convert m.pgs -o no.ply --tile 2,1,1", 2, "converted to splats");
    dir.write("depth.pgs", tiny(0..64, LawKind::OpticalDepth));
    dir.fails("convert depth.pgs -o no.ply", 2, "has no opacities");
    assert!(!dir.at("no.ply").exists());
}

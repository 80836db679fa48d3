//! `merge`, `simplify` and `recover`: what is made of models without their snapshots.

use crate::common::{TestFolder, listing, words};

#[test]
fn merging_is_exact_whatever_the_order() {
    let dir = TestFolder::new();
    // Models of the lower and upper half of the sample along x, and of a thin slab apart from them.
    for (name, region) in [("a", "0,12,0,25,0,25"), ("b", "12,20,0,25,0,25"), ("c", "20,25,0,25,0,25")] {
        let fit = "--effort fast --ratio 100 --certificate=none --quiet";
        dir.runs(&format!("compress SAMPLE -o {name}.pgs {fit} --region {region}"));
    }
    dir.runs("merge a.pgs b.pgs -o ab.pgs --quiet");
    let one = dir.makes("merge ab.pgs c.pgs -o whole.pgs --quiet");
    assert_eq!(one, dir.makes("merge c.pgs a.pgs b.pgs -o again.pgs --quiet"));
    dir.runs("verify whole.pgs");

    // The depths of the parts add up.
    use particlegs_core::camera::{View, base_distance, spherical_camera};
    use particlegs_core::context::Context;
    use particlegs_core::picture::Size;
    use particlegs_core::render::{Scene, optical_depth};
    let size = Size { width: 320, height: 240 };
    let all = dir.model("whole.pgs");
    let m = &all.metadata;
    let distance = base_distance(&m.bounds, size);
    let camera = spherical_camera(m.bounds.center(), 25.0, 15.0, distance);
    let view = View { name: "far".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
    let together = optical_depth(&Scene::new(&all), &view, size, &Context::SILENT).unwrap();
    let parts = ["a.pgs", "b.pgs", "c.pgs"].map(|name| {
        let model = dir.model(name);
        // The same clipping range for all.
        let scene = Scene::from_mixture(&model.layers[0].content[0].gaussians, m.bounds);
        optical_depth(&scene, &view, size, &Context::SILENT).unwrap()
    });
    let brightest = together.data.iter().cloned().fold(0.0, f32::max);
    assert!(brightest > 0.0);
    for i in 0..together.data.len() {
        let sum: f32 = parts.iter().map(|p| p.data[i]).sum();
        // Interpolation undershoots beside a bright edge: a negative depth is drawn as 0 in a part, but is subtracted
        // in the whole.
        let cut = parts.iter().any(|p| p.data[i] == 0.0);
        let tolerance = if cut { 1e-5 } else { 1e-6 };
        assert!((together.data[i] - sum).abs() <= tolerance * brightest.max(1.0), "{} {sum}", together.data[i]);
    }

    dir.fails("merge a.pgs a.pgs -o no.pgs", 2, "the files hold the same block twice");
    dir.fails("merge a.pgs none.pgs -o no.pgs", 6, "none.pgs");
    dir.write("half.pgs", &one[..one.len() / 2]);
    dir.fails("merge a.pgs half.pgs -o no.pgs", 4, "half.pgs");
    assert!(!dir.at("no.pgs").exists());
}

fn columns(dir: &TestFolder, name: &str) -> [Vec<f32>; 3] {
    ["xx.f32", "yy.f32", "zz.f32"].map(|axis| {
        let bytes = dir.bytes(&format!("{name}/{axis}"));
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    })
}

#[test]
fn recovered_particles_are_marked_as_synthetic() {
    let dir = TestFolder::new();
    dir.once("compress SAMPLE -o m.pgs --effort fast --ratio 300 --quiet");
    let run = |name: &str, more: &str| {
        dir.runs(&format!("recover m.pgs -o {name} --quiet {more}"));
        columns(&dir, name)
    };
    let p = run("own", "--threads 1");
    assert!(p.iter().all(|c| c.len() == 262_144 && c.iter().all(|v| (0.0..25.0).contains(v))));
    // SIMD and threads change nothing; another seed does.
    let mut plain = dir.command("recover m.pgs -o plain --quiet --threads 3");
    plain.env("PARTICLEGS_SIMD", "off").assert().success();
    assert_eq!(p, columns(&dir, "plain"));
    assert_ne!(p, run("other", "--seed 1"));
    assert_eq!(listing(&dir.at("own")), ["meta.json", "xx.f32", "yy.f32", "zz.f32"]);
    let meta = dir.json("own/meta.json");
    assert!(meta["synthetic"].as_str().unwrap().starts_with("SYNTHETIC"));
    let from = &meta["recovered_from"];
    assert_eq!((&from["model"], &from["method"]), (&"m.pgs".into(), &"count".into()));
    assert_eq!(meta["box"], serde_json::json!([25.0, 25.0, 25.0]));
    let supports: Vec<&str> = meta["supports"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
    assert!(supports[0].contains("correlation") && supports[1].contains("of particles drawn"));
    assert!(supports[1].contains(" h/Mpc") && supports[1].contains("number of groups"), "{supports:?}");
    // Other commands read it as a snapshot.
    dir.runs("info own");

    for method in ["volume", "ellipsoid", "grid", "stratified", "spaced"] {
        let few = run(method, &format!("--method {method} --particles 12345"));
        assert!(few.iter().all(|c| c.len() == 12_345 && c.iter().all(|v| (0.0..25.0).contains(v))), "{method}");
    }
    dir.runs("recover m.pgs -o npy --form npy --particles 10");
    assert_eq!(listing(&dir.at("npy")), ["meta.json", "positions.npy"]);

    for (code, text, more) in [
        (2, "1 to 2^53, not 0", "--particles 0"),
        (2, "no layer `gas`", "--layer gas"),
        (2, "scale", "--scale 0"),
        (6, "", "--particles 900000000000000"),
    ] {
        dir.fails(&format!("recover m.pgs -o no {more}"), code, text);
        assert!(!dir.at("no").exists());
    }
    dir.fails("recover m.pgs -o m.pgs", 8, "is an input");
    dir.fails("recover m.pgs -o missing/deep", 6, "missing");
}

/// A file of a newer program, with an index and unknown sections.
#[test]
fn unknown_sections_survive_merging_or_are_named_if_dropped() {
    let dir = TestFolder::new();
    let room = "FIXTURES/../../../particlegs-compress/tests/fixtures/format-1.0-room.pgs";
    dir.runs(&format!("merge {room} -o merged.pgs --quiet"));
    for path in [room, "merged.pgs"] {
        let [text, _] = dir.runs(&format!("info {path}"));
        for tag in ["`fiLD`", "`paRT`", "`nOTe`"] {
            assert!(text.contains(tag), "{text}");
        }
    }
    let [_, text] = dir.runs(&format!("simplify {room} --gaussians 9 -o small.pgs"));
    assert!(text.contains("dropped: `fiLD` (18 bytes), `paRT` (13 bytes), `nOTe` (17 bytes)"), "{text}");
    assert!(!dir.runs("info small.pgs")[0].contains("`fiLD`"));
    // Truncated in its only block, it is refused.
    let bytes = std::fs::read(&words(room)[0]).unwrap();
    dir.write("cut.pgs", &bytes[..bytes.len() / 2]);
    dir.fails("info cut.pgs", 4, "the file ends before the first block");
}

#[test]
fn a_smaller_model_stands_for_the_same_particles() {
    let dir = TestFolder::new();
    dir.runs("compress SAMPLE -o m.pgs --effort fast --ratio 100 --quiet");
    let run = |out: &str, more: &str| dir.makes(&format!("simplify m.pgs -o {out} --quiet {more}"));
    let bytes = run("small.pgs", "--ratio 400 --threads 1");
    let target = 262_144 * 12 / 400;
    assert!(bytes.len() <= target && bytes.len() >= target * 97 / 100, "{}", bytes.len());
    assert_eq!(bytes, run("again.pgs", "--ratio 400 --threads 3"));
    run("few.pgs", "--gaussians 77");
    let [whole, small, few] = ["m.pgs", "small.pgs", "few.pgs"].map(|name| dir.model(name));
    assert_eq!(few.gaussians(), 77);
    for m in [&small, &few] {
        assert_eq!((m.metadata.count, m.metadata.mass), (whole.metadata.count, whole.metadata.mass));
        assert_eq!((m.metadata.source_hash, m.metadata.bounds), (whole.metadata.source_hash, whole.metadata.bounds));
        assert!(m.certificate.is_none() && m.metadata.recipe.to_string().starts_with("simplify --"));
        let counts: f64 = m.blocks().flat_map(|b| &b.gaussians.count).sum();
        assert_eq!(counts, 262_144.0);
    }

    for (code, text, more) in [
        (2, "Gaussians for this model", "--gaussians 1000000"),
        (2, "positive", "--gaussians 0"),
        (2, "positive", "--ratio 0"),
        (5, "has", "--ratio 50"),
        (5, "smallest", "--ratio 100000"),
    ] {
        dir.fails(&format!("simplify m.pgs -o no.pgs {more}"), code, text);
        assert!(!dir.at("no.pgs").exists());
    }
    dir.fails("simplify m.pgs -o missing/m.pgs --gaussians 5", 6, "missing");
}

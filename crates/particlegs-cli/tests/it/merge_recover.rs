//! `merge` and `recover` as a user runs them.

use crate::common::{fails, listing, particlegs, sample};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Models of the lower and upper half of the sample along x, and of a thin slab apart from them.
fn halves(dir: &Path) -> [PathBuf; 3] {
    let cut = [("a", "0,12,0,25,0,25"), ("b", "12,20,0,25,0,25"), ("c", "20,25,0,25,0,25")];
    cut.map(|(name, region)| {
        let out = dir.join(format!("{name}.pgs"));
        let mut c = particlegs();
        c.args(["compress", "--effort", "fast", "--ratio", "100", "--certificate=none", "--quiet", "--region", region]);
        c.arg(sample()).arg("-o").arg(&out).assert().success();
        out
    })
}

fn merged(parts: &[&Path], out: &Path) -> Vec<u8> {
    particlegs().arg("merge").args(parts).arg("-o").arg(out).arg("--quiet").assert().success();
    std::fs::read(out).unwrap()
}

#[test]
fn merging_is_exact_whatever_the_order() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b, c] = halves(dir.path());
    let (ab, whole, again) = (dir.path().join("ab.pgs"), dir.path().join("whole.pgs"), dir.path().join("again.pgs"));
    merged(&[&a, &b], &ab);
    let one = merged(&[&ab, &c], &whole);
    assert_eq!(one, merged(&[&c, &a, &b], &again));
    particlegs().arg("verify").arg(&whole).assert().success();

    // The picture is that of the parts together: depths add up.
    use particlegs::camera::{View, base_distance, spherical_camera};
    use particlegs::picture::Size;
    use particlegs::progress::Silent;
    use particlegs::render::{Scene, optical_depth};
    let size = Size { width: 320, height: 240 };
    let decode = |path: &Path| particlegs::codec::decode(&std::fs::read(path).unwrap(), "file").unwrap();
    let all = decode(&whole);
    let m = &all.metadata;
    let distance = base_distance(&m.bounds, size);
    let camera = spherical_camera(m.bounds.center(), 25.0, 15.0, distance);
    let view = View { name: "far".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
    let together = optical_depth(&Scene::new(&all), &view, size, &Silent).unwrap();
    let part = |path: &PathBuf| {
        let model = decode(path);
        // The same clipping range for all.
        let scene = Scene::from_mixture(&model.layers[0].content[0].gaussians, m.bounds);
        optical_depth(&scene, &view, size, &Silent).unwrap()
    };
    let parts = [&a, &b, &c].map(part);
    let brightest = together.data.iter().cloned().fold(0.0, f32::max);
    assert!(brightest > 0.0);
    for i in 0..together.data.len() {
        let sum: f32 = parts.iter().map(|p| p.data[i]).sum();
        // Interpolation undershoots beside a bright edge and a depth below 0 is drawn as 0, in a part
        // where the whole has something to take it from.
        let cut = parts.iter().any(|p| p.data[i] == 0.0);
        let tolerance = if cut { 1e-5 } else { 1e-6 };
        assert!((together.data[i] - sum).abs() <= tolerance * brightest.max(1.0), "{} {sum}", together.data[i]);
    }

    let out = dir.path().join("no.pgs");
    fails(particlegs().arg("merge").args([&a, &a]).arg("-o").arg(&out), 2, "twice");
    fails(particlegs().arg("merge").arg(&a).arg(dir.path().join("none.pgs")).arg("-o").arg(&out), 6, "none.pgs");
    std::fs::write(dir.path().join("half.pgs"), &one[..one.len() / 2]).unwrap();
    fails(particlegs().arg("merge").arg(&a).arg(dir.path().join("half.pgs")).arg("-o").arg(&out), 4, "half.pgs");
    assert!(!out.exists());
}

fn columns(folder: &Path) -> [Vec<f32>; 3] {
    ["xx.f32", "yy.f32", "zz.f32"].map(|n| {
        let bytes = std::fs::read(folder.join(n)).unwrap();
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    })
}

#[test]
fn recovered_particles_say_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let model = dir.path().join("m.pgs");
    let mut c = particlegs();
    c.args(["compress", "--effort", "fast", "--ratio", "300", "--quiet"])
        .arg(sample())
        .arg("-o")
        .arg(&model)
        .assert()
        .success();
    let out = |name: &str| dir.path().join(name);
    let run = |name: &str, more: &[&str]| {
        particlegs().arg("recover").arg(&model).arg("-o").arg(out(name)).arg("--quiet").args(more).assert().success();
        columns(&out(name))
    };
    let p = run("own", &["--threads", "1"]);
    assert!(p.iter().all(|c| c.len() == 262_144 && c.iter().all(|v| (0.0..25.0).contains(v))));
    // SIMD and threads change nothing; a seed does.
    let mut plain = particlegs();
    plain.env("PARTICLEGS_SIMD", "off").arg("recover").arg(&model).arg("-o").arg(out("plain"));
    plain.args(["--quiet", "--threads", "3"]).assert().success();
    assert_eq!(p, columns(&out("plain")));
    assert_ne!(p, run("other", &["--seed", "1"]));
    assert_eq!(listing(&out("own")), ["meta.json", "xx.f32", "yy.f32", "zz.f32"]);
    let meta: Value = serde_json::from_slice(&std::fs::read(out("own").join("meta.json")).unwrap()).unwrap();
    assert!(meta["synthetic"].as_str().unwrap().starts_with("SYNTHETIC"));
    assert_eq!(
        (&meta["recovered_from"]["model"], &meta["recovered_from"]["method"]),
        (&"m.pgs".into(), &"count".into())
    );
    assert_eq!(meta["box"], serde_json::json!([25.0, 25.0, 25.0]));
    let supports: Vec<&str> = meta["supports"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
    assert!(supports[0].contains("correlation") && supports[1].contains("of particles drawn"));
    assert!(supports[1].contains(" h/Mpc") && supports[1].contains("number of groups"), "{supports:?}");
    // It is a snapshot that the other commands read.
    particlegs().arg("info").arg(out("own")).assert().success();

    for method in ["volume", "ellipsoid", "grid", "stratified", "spaced"] {
        let few = run(method, &["--method", method, "--particles", "12345"]);
        assert!(few.iter().all(|c| c.len() == 12_345 && c.iter().all(|v| (0.0..25.0).contains(v))), "{method}");
    }
    particlegs()
        .arg("recover")
        .arg(&model)
        .arg("-o")
        .arg(out("npy"))
        .args(["--form", "npy", "--particles", "10"])
        .assert()
        .success();
    assert_eq!(listing(&out("npy")), ["meta.json", "positions.npy"]);

    let fail = |code: i32, text: &str, more: &[&str]| {
        fails(particlegs().arg("recover").arg(&model).arg("-o").arg(out("no")).args(more), code, text);
        assert!(!out("no").exists());
    };
    fail(2, "0 particles", &["--particles", "0"]);
    fail(2, "no layer `gas`", &["--layer", "gas"]);
    fail(2, "scale", &["--scale", "0"]);
    fail(6, "", &["--particles", "900000000000000"]);
    fails(particlegs().arg("recover").arg(&model).arg("-o").arg(&model), 8, "is an input");
    fails(particlegs().arg("recover").arg(&model).arg("-o").arg(out("missing/deep")), 6, "missing");
}

/// A file of a newer program: open, with an index and sections that this one does not know.
#[test]
fn what_newer_programs_add_survives_merging_and_is_named_where_it_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs/tests/fixtures/format-1.0-room.pgs");
    let info = |path: &Path| {
        let out = particlegs().arg("info").arg(path).output().unwrap();
        String::from_utf8(out.stdout).unwrap()
    };
    let out = dir.path().join("merged.pgs");
    merged(&[&room], &out);
    for path in [&room, &out] {
        let text = info(path);
        for tag in ["`fiLD`", "`paRT`", "`nOTe`"] {
            assert!(text.contains(tag), "{text}");
        }
    }
    let small = dir.path().join("small.pgs");
    let simplified =
        particlegs().arg("simplify").arg(&room).args(["--gaussians", "9", "-o"]).arg(&small).output().unwrap();
    let text = String::from_utf8(simplified.stderr).unwrap();
    assert!(text.contains("left out: `fiLD` (18 bytes), `paRT` (13 bytes), `nOTe` (17 bytes)"), "{text}");
    assert!(!info(&small).contains("`fiLD`"));
    // Cut within its only block, it is refused.
    let bytes = std::fs::read(&room).unwrap();
    let cut = dir.path().join("cut.pgs");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    fails(particlegs().arg("info").arg(&cut), 4, "it ends before its first block");
}

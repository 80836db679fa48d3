//! `simplify` as a user runs it.

use crate::common::{fails, particlegs, sample};
use particlegs::model::Model;
use std::path::Path;

fn decode(path: &Path) -> Model {
    particlegs::codec::decode(&std::fs::read(path).unwrap(), "file").unwrap()
}

#[test]
fn a_smaller_model_stands_for_the_same_particles() {
    let dir = tempfile::tempdir().unwrap();
    let [model, small, few, again] = ["m.pgs", "small.pgs", "few.pgs", "again.pgs"].map(|n| dir.path().join(n));
    let mut c = particlegs();
    c.args(["compress", "--effort", "fast", "--ratio", "100", "--quiet"]).arg(sample()).arg("-o").arg(&model);
    c.assert().success();
    let run = |out: &Path, more: &[&str]| {
        particlegs().arg("simplify").arg(&model).arg("-o").arg(out).arg("--quiet").args(more).assert().success();
        std::fs::read(out).unwrap()
    };
    let bytes = run(&small, &["--ratio", "400", "--threads", "1"]);
    let target = 262_144 * 12 / 400;
    assert!(bytes.len() <= target && bytes.len() >= target * 97 / 100, "{}", bytes.len());
    assert_eq!(bytes, run(&again, &["--ratio", "400", "--threads", "3"]));
    run(&few, &["--gaussians", "77"]);
    let (whole, small, few) = (decode(&model), decode(&small), decode(&few));
    assert_eq!(few.gaussians(), 77);
    for m in [&small, &few] {
        assert_eq!((m.metadata.count, m.metadata.mass), (whole.metadata.count, whole.metadata.mass));
        assert_eq!((m.metadata.source_hash, m.metadata.bounds), (whole.metadata.source_hash, whole.metadata.bounds));
        assert!(m.certificate.is_none() && m.metadata.recipe.to_string().starts_with("simplify --"));
        let counts: f64 = m.blocks().flat_map(|b| &b.gaussians.count).sum();
        assert_eq!(counts, 262_144.0);
    }

    let out = dir.path().join("no.pgs");
    let fail = |code: i32, text: &str, more: &[&str]| {
        fails(particlegs().arg("simplify").arg(&model).arg("-o").arg(&out).args(more), code, text);
        assert!(!out.exists());
    };
    fail(2, "were asked for: the model has", &["--gaussians", "1000000"]);
    fail(2, "positive", &["--gaussians", "0"]);
    fail(2, "positive", &["--ratio", "0"]);
    fail(5, "has", &["--ratio", "50"]);
    fail(5, "smallest", &["--ratio", "100000"]);
    let deep = dir.path().join("missing/m.pgs");
    fails(particlegs().arg("simplify").arg(&model).arg("-o").arg(&deep).args(["--gaussians", "5"]), 6, "missing");
}

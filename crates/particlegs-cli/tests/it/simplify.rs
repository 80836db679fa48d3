//! `simplify`.

use crate::common::TestFolder;

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

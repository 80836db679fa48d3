//! A model that shows nothing is said to, and a forged certificate is refused.

use crate::common::{fails, particlegs, snapshot};
use particlegs::codec;
use particlegs::model::PictureScore;

/// A cubic crystal of 16^3 atoms: what no mixture of fewer Gaussians shows.
#[test]
fn a_crystal_is_warned_of_and_forged_scores_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let column = |stride: usize| (0..4096).map(|i| ((i / stride) % 16) as f32 + 0.5).collect::<Vec<f32>>();
    snapshot(&dir.path().join("in"), &[column(1), column(16), column(256)]);
    let run = |args: &[&str]| particlegs().current_dir(&dir).args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();

    let out = run(&["compress", "in", "-o", "m.pgs", "--effort", "fast", "--json", "c.json"]);
    let (said, warned) = (text(&out.stdout), text(&out.stderr));
    assert!(out.status.success(), "{warned}");
    assert!(warned.contains("no target given: ratio 8.0, 6115 bytes") && warned.contains("too few"), "{warned}");
    assert!(warned.contains("warning: the model shows little") && warned.contains("uniform box"), "{warned}");
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(dir.path().join(name)).unwrap()).unwrap()
    };
    let compressed = json("c.json");
    assert_eq!(compressed["verdict"][0]["use"], "pictures");
    assert_eq!(compressed["verdict"][0]["word"], "does not");
    let trivial = &compressed["certificate"]["orbits"][0]["expected"];
    assert!(trivial["all_black"]["masked_psnr"].is_number() && trivial["uniform_box"]["ssim"].is_number());
    assert!(said.lines().count() <= 12 && said.lines().all(|l| l.chars().count() <= 100), "{said}");
    assert!(said.contains("does not       ") && said.contains("groups: it takes a full certificate"), "{said}");
    assert!(said.contains("\nparticlegs info m.pgs shows the rest\nwrote c.json"), "{said}");

    // What compress told is what the file holds, to the last digit.
    let out = run(&["info", "m.pgs", "--json", "i.json"]);
    assert!(out.status.success());
    let info = json("i.json");
    assert_eq!((&info["certificate"], &info["verdict"]), (&compressed["certificate"], &compressed["verdict"]));
    let shown = text(&out.stdout);
    assert!(shown.contains("all black") && shown.lines().all(|l| l.chars().count() <= 100), "{shown}");

    // Measured again it is the same; a forged score is not, nor another snapshot measured at all.
    let out = run(&["verify", "m.pgs", "in"]);
    let verified = text(&out.stdout);
    assert!(out.status.success(), "{verified}{}", text(&out.stderr));
    assert!(
        verified.contains("stored") && verified.contains("tolerance") && !verified.contains("differs"),
        "{verified}"
    );
    let forged = |name: &str, change: &dyn Fn(&mut particlegs::model::Certificate)| {
        let bytes = std::fs::read(dir.path().join("m.pgs")).unwrap();
        let model = codec::decode(&bytes, "m").unwrap();
        let mut certificate = model.certificate.unwrap();
        change(&mut certificate);
        let layers = codec::coded_layers(&bytes, "m").unwrap();
        let bytes = codec::assemble(&model.metadata, Some(&certificate), layers).unwrap();
        std::fs::write(dir.path().join(name), bytes).unwrap();
    };
    fn score(s: &mut Option<PictureScore>) -> &mut PictureScore {
        s.as_mut().unwrap()
    }
    forged("f.pgs", &|c| score(&mut c.views.orbits[1].paraview.model).masked_psnr = Some(45.0));
    let mut c = particlegs();
    fails(c.current_dir(&dir).args(["verify", "f.pgs", "in"]), 9, "pictures mid paraview: model is stored as 45.00 dB");
    forged("s.pgs", &|c| score(&mut c.views.orbits[2].expected.subset).masked_psnr = Some(3.0));
    let mut c = particlegs();
    fails(
        c.current_dir(&dir).args(["verify", "s.pgs", "in"]),
        9,
        "pictures near expected: subset is stored as 3.00 dB",
    );
    forged("k.pgs", &|c| c.subset.as_mut().unwrap().kept -= 1);
    let mut c = particlegs();
    fails(c.current_dir(&dir).args(["verify", "k.pgs", "in"]), 9, "subset: particles is stored as");
    // What no certificate can say no file can hold, whatever wrote it.
    let bytes = std::fs::read(dir.path().join("m.pgs")).unwrap();
    let model = codec::decode(&bytes, "m").unwrap();
    let mut impossible = model.certificate.unwrap();
    score(&mut impossible.views.orbits[1].expected.noise_free).masked_psnr = Some(40.0);
    let layers = codec::coded_layers(&bytes, "m").unwrap();
    let refused = codec::assemble(&model.metadata, Some(&impossible), layers).unwrap_err();
    assert!(refused.to_string().contains("a noise-free picture that is not itself"), "{refused}");
    let column = |stride: usize| (0..4096).map(|i| ((i / stride) % 16) as f32 + 0.25).collect::<Vec<f32>>();
    snapshot(&dir.path().join("other"), &[column(1), column(16), column(256)]);
    let mut c = particlegs();
    fails(c.current_dir(&dir).args(["verify", "m.pgs", "other"]), 3, "it is not the snapshot");
}

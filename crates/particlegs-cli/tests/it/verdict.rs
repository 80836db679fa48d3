//! A useless model gets a warning, and a forged certificate is refused.

use crate::common::{TestFolder, recertified, snapshot};
use particlegs_core::model::{Certificate, PictureScore};

/// A cubic crystal of 16^3 atoms, which no smaller mixture can represent.
#[test]
fn a_crystal_is_warned_of_and_forged_scores_are_refused() {
    let dir = TestFolder::new();
    let crystal = |name: &str, shift: f32| {
        let column = |stride: usize| (0..4096).map(|i| ((i / stride) % 16) as f32 + shift).collect::<Vec<f32>>();
        snapshot(&dir.at(name), &[column(1), column(16), column(256)]);
    };
    crystal("in", 0.5);

    let [said, warned] = dir.runs("compress in -o m.pgs --effort fast --json c.json");
    assert!(warned.contains("no target given: using ratio 8.0, 6115 bytes") && warned.contains("too few"), "{warned}");
    assert!(warned.contains("warning: the model shows little") && warned.contains("uniform box"), "{warned}");
    let compressed = dir.json("c.json");
    assert_eq!(compressed["verdict"][0]["use"], "pictures");
    assert_eq!(compressed["verdict"][0]["word"], "does not");
    let trivial = &compressed["certificate"]["orbits"][0]["expected"];
    assert!(trivial["all_black"]["masked_psnr"].is_number() && trivial["uniform_box"]["ssim"].is_number());
    assert!(said.lines().count() <= 12 && said.lines().all(|l| l.chars().count() <= 100), "{said}");
    assert!(said.contains("does not       ") && said.contains("groups: needs a full certificate"), "{said}");
    assert!(said.contains("\nparticlegs info m.pgs shows the rest\nwrote c.json"), "{said}");

    // The file has the numbers that `compress` reported, to the last digit.
    let [shown, _] = dir.runs("info m.pgs --json i.json");
    let info = dir.json("i.json");
    assert_eq!((&info["certificate"], &info["verdict"]), (&compressed["certificate"], &compressed["verdict"]));
    assert!(shown.contains("all black") && shown.lines().all(|l| l.chars().count() <= 100), "{shown}");

    // Measured again it is the same; a forged score differs, and another snapshot is refused.
    let [verified, _] = dir.runs("verify m.pgs in");
    assert!(verified.contains("stored") && verified.contains("tolerance"), "{verified}");
    assert!(!verified.contains("differs"), "{verified}");
    let file = dir.bytes("m.pgs");
    let forged = |change: &dyn Fn(&mut Certificate), text: &str| {
        dir.write("f.pgs", recertified(&file, change).unwrap());
        dir.fails("verify f.pgs in", 9, text);
    };
    fn score(s: &mut Option<PictureScore>) -> &mut PictureScore {
        s.as_mut().unwrap()
    }
    forged(
        &|c| score(&mut c.views.orbits[1].paraview.model).masked_psnr = Some(45.0),
        "pictures mid paraview: model is stored as 45.00 dB",
    );
    forged(
        &|c| score(&mut c.views.orbits[2].expected.subset).masked_psnr = Some(3.0),
        "pictures near expected: subset is stored as 3.00 dB",
    );
    forged(&|c| c.subset.as_mut().unwrap().kept -= 1, "subset: particles is stored as");
    // Impossible certificates are refused, whatever wrote them.
    let impossible = |c: &mut Certificate| score(&mut c.views.orbits[1].expected.noise_free).masked_psnr = Some(40.0);
    let refused = recertified(&file, impossible).unwrap_err();
    assert!(refused.to_string().contains("a noise-free picture must match itself"), "{refused}");
    crystal("other", 0.25);
    dir.fails("verify m.pgs other", 3, "it is not the snapshot");
}

//! Particle types that share Gaussians, and categories: shares of Gaussians.

use crate::common::{TestFolder, snapshot};
use particlegs_core::math::Random;

const COUNT: usize = 16_000;

/// Particles in clumps, of which every third is of the first type: two types that lie in the same places.
fn mixed(dir: &TestFolder) {
    let mut types = [Vec::new(), Vec::new()];
    for i in 0..COUNT as u64 {
        let (mut clump, mut r) = (Random::new(1, 0, i % 601), Random::new(2, 0, i));
        let size = 0.3 * clump.uniform();
        let place = [0, 1, 2].map(|_| 10.0 * clump.uniform() + size * r.normal());
        types[usize::from(i % 3 > 0)].push(place.map(|v| v as f32));
    }
    write(dir, &types);
}

fn write(dir: &TestFolder, types: &[Vec<[f32; 3]>]) {
    let all: Vec<&[f32; 3]> = types.iter().flatten().collect();
    let columns: Vec<Vec<f32>> = (0..3).map(|k| all.iter().map(|p| p[k]).collect()).collect();
    snapshot(&dir.at("snap"), &columns);
    let layer = |(name, mass, n): (&str, f64, usize)| serde_json::json!({ "name": name, "particles": n, "particle_mass": mass });
    let layers = [layer(("dm", 5.0, types[0].len())), layer(("gas", 1.0, types[1].len()))];
    dir.write("snap/meta.json", serde_json::json!({ "layers": layers }).to_string());
}

#[test]
fn types_in_the_same_places_share_gaussians() {
    let dir = TestFolder::new();
    mixed(&dir);
    let [_, said] = dir.runs("compress snap -o m.pgs --ratio 60 --certificate quick");
    assert!(said.contains("the particle types share Gaussians"), "{said}");
    dir.runs("compress snap -o separate.pgs --ratio 60 --share-gaussians no --certificate quick");
    let (shared, separate) = (dir.model("m.pgs"), dir.model("separate.pgs"));
    for (a, b) in shared.layers.iter().zip(&separate.layers) {
        assert_eq!((&a.name, a.mass, a.count()), (&b.name, b.mass, b.count()));
    }
    assert!(
        shared.layers[0].content[0].gaussians.len() as f64 > 1.5 * separate.layers[0].content[0].gaussians.len() as f64
    );
    // They do not look different where they are not: the error of their ratio is below the particles' noise.
    let ratio = |m: &particlegs_core::model::Model| {
        m.certificate.unwrap().layer_ratios.unwrap().to_first.into_iter().flatten().next().unwrap()
    };
    assert!(ratio(&shared).error < ratio(&separate).error);
    let info = dir.says("info m.pgs");
    assert_eq!(info["layers"][0]["name"], "dm+gas");
    assert_eq!(
        info["layers"][0]["species"][1],
        serde_json::json!({ "name": "gas", "count": COUNT * 2 / 3, "mass": 1.0 })
    );
    let [text, _] = dir.runs("info m.pgs");
    assert!(text.contains("`gas`: 10666 particles, of mass 1 each") && text.contains("bytes, 0."), "{text}");
    // Every command has two layers.
    dir.runs("recover m.pgs -o again --quiet");
    assert_eq!(dir.says("recover m.pgs -o gas --layer gas --force")["particles"], 10_666);
    dir.runs("render m.pgs --layer dm --size 32x32 -o picture.png");
    dir.runs("verify m.pgs snap");
    dir.runs("simplify m.pgs --gaussians 100 -o small.pgs");
    assert_eq!(dir.model("small.pgs").layers[1].count(), 10_666);
}

#[test]
fn types_in_different_places_keep_gaussians_of_their_own() {
    let dir = TestFolder::new();
    let place = |i: u64, from: f64| {
        let mut r = Random::new(4, 0, i);
        [from + r.normal(), r.normal(), r.normal()].map(|v| v as f32)
    };
    write(&dir, &[0.0, 4.0].map(|from| (0..8000).map(|i| place(i + from as u64 * 8000, from)).collect()));
    let [_, said] = dir.runs("compress snap -o m.pgs --ratio 60 --certificate none");
    assert!(!said.contains("share Gaussians"), "{said}");
    let [_, said] = dir.runs("compress snap -o m.pgs --ratio 60 --share-gaussians yes --force --certificate none");
    assert!(said.contains("share Gaussians"), "{said}");
    let model = dir.model("m.pgs");
    // Each type has its own side.
    for (layer, from) in model.layers.iter().zip([0.0, 4.0]) {
        let g = &layer.content[0].gaussians;
        let mean = (0..g.len()).map(|i| g.count[i] * g.mean[0][i]).sum::<f64>() / layer.count() as f64;
        assert!((mean - from).abs() < 0.1, "{}: {mean}", layer.name);
    }
}

#[test]
fn sharing_that_cannot_be_is_refused() {
    let dir = TestFolder::new();
    mixed(&dir);
    let yes = "compress snap -o no.pgs --share-gaussians yes";
    dir.fails(&format!("{yes} --fields density"), 2, "the snapshot has no field `density`");
    dir.fails(&format!("{yes} --particle-type gas"), 2, "one type instead of 2 to 16");
    dir.fails("compress snap -o no.pgs --share-gaussians maybe", 2, "use `auto`, `yes` or `no`");
}

#[test]
fn parts_whose_types_share_gaussians_are_merged() {
    let dir = TestFolder::new();
    mixed(&dir);
    dir.runs("compress snap -o whole.pgs --ratio 60 --share-gaussians yes --certificate none --quiet --blocks 2");
    let part = |name: &str, region: &str| {
        dir.runs(&format!(
            "compress snap -o {name}.pgs --region {region} --ratio 60 --share-gaussians yes --certificate none --quiet"
        ));
    };
    part("low", "-9,5,-9,19,-9,19");
    part("high", "5,19,-9,19,-9,19");
    let merged = dir.makes("merge low.pgs high.pgs -o m.pgs -q");
    assert_eq!(merged, dir.makes("merge high.pgs low.pgs -o again.pgs -q"));
    let (whole, both) = (dir.model("whole.pgs"), dir.model("m.pgs"));
    let counts = |m: &particlegs_core::model::Model| m.layers.iter().map(|l| l.count()).collect::<Vec<_>>();
    assert_eq!(counts(&whole), counts(&both));
    dir.runs(
        "compress snap -o other.pgs --region 5,19,-9,19,-9,19 --ratio 60 --share-gaussians no --certificate none -q",
    );
    dir.fails("merge low.pgs other.pgs -o no.pgs", 3, "list of species that share Gaussians");
}

/// Particles with a category of three values, which changes along x.
fn states(dir: &TestFolder) -> Vec<u8> {
    let (mut text, mut values) = (String::new(), Vec::new());
    for i in 0..6000u64 {
        let mut r = Random::new(5, 0, i);
        let x = 3.0 * r.uniform();
        let state = if r.uniform() < 0.2 {
            7
        } else if r.uniform() * 3.0 < x {
            2
        } else {
            1
        };
        text += &format!("{x} {} {}\n", r.uniform(), r.uniform());
        values.push(state);
    }
    let column: String = values.iter().map(|v| format!("{v}\n")).collect();
    let head = "# vtk DataFile Version 3.0\nstates\nASCII\nDATASET POLYDATA\nPOINTS 6000 float\n";
    dir.write(
        "states.vtk",
        format!("{head}{text}POINT_DATA 6000\nSCALARS state int 1\nLOOKUP_TABLE default\n{column}"),
    );
    values
}

#[test]
fn categories_are_shares_and_recovered_as_their_values() {
    let dir = TestFolder::new();
    let values = states(&dir);
    let [_, said] = dir.runs("compress states.vtk -o m.pgs --gaussians 60 --certificate quick --fields state");
    assert!(said.contains("state is a category: the model stores the share of each of its 3 values"), "{said}");
    let model = dir.model("m.pgs");
    let names = ["state=1", "state=2", "state=7"];
    assert!(model.metadata.fields.iter().map(|q| &q.name[..]).eq(names));
    let g = &model.layers[0].content[0].gaussians;
    let share = |name: &str, i: usize| g.fields.get(name).unwrap().mean[0][i];
    for i in 0..g.len() {
        // Steps of classes may sum to a little more than 1.
        assert!((1.0 - 1e-9..1.1).contains(&names.iter().map(|name| share(name, i)).sum::<f64>()));
    }
    // What rises along x has its particles there.
    let middle = |name: &str| {
        let weight = |i: usize| g.count[i] * share(name, i);
        (0..g.len()).map(|i| weight(i) * g.mean[0][i]).sum::<f64>() / (0..g.len()).map(weight).sum::<f64>()
    };
    let [one, two, seven] = names.map(middle);
    assert!((one - 1.0).abs() < 0.1 && (two - 2.0).abs() < 0.1 && (seven - 1.5).abs() < 0.1, "{one} {two} {seven}");
    for (name, value) in [("state=1", 1), ("state=2", 2), ("state=7", 7)] {
        let sum: f64 = (0..g.len()).map(|i| g.count[i] * share(name, i)).sum();
        let expected_count = values.iter().filter(|v| **v == value).count() as f64;
        assert!((sum - expected_count).abs() < 1e-6 * expected_count, "{name}: {sum} {expected_count}");
    }
    // Particles that are drawn have one of the values, as often.
    dir.runs("recover m.pgs -o again --quiet");
    let column = dir.bytes("again/state.f32");
    let states: Vec<f32> = column.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    for value in [1u8, 2, 7] {
        let (is, was) =
            (states.iter().filter(|v| **v == f32::from(value)).count(), values.iter().filter(|v| **v == value).count());
        assert!((is as f64 / was as f64 - 1.0).abs() < 0.08, "{value}: {is} {was}");
    }
    // Maps of the shares, of the model and of the particles.
    dir.runs("render m.pgs --field state=2 --projection orthographic --size 32x32 -o m.png");
    dir.runs("reference states.vtk --field state=2 --projection orthographic --size 32x32 -o r.png");
    dir.fails("render m.pgs --field state -o no.png", 2, "the model has no field `state`");
    // A category is merged whole.
    dir.runs("merge m.pgs --fields state -o whole.pgs -q");
    assert_eq!(dir.model("whole.pgs").metadata.fields.len(), 3);
    let options = "--blocks 2 --effort fast --gaussians 60 --fields state --certificate none";
    crate::fields::same_by_job(&dir, "states.vtk", "job", options);
    dir.runs("simplify m.pgs --gaussians 20 -o small.pgs");
    let small = dir.model("small.pgs");
    let g = &small.layers[0].content[0].gaussians;
    let sum: f64 = names
        .iter()
        .map(|n| g.fields.get(n).unwrap().mean[0].iter().zip(&g.count).map(|(v, c)| v * c).sum::<f64>())
        .sum();
    assert!((sum - 6000.0).abs() < 1e-3, "{sum}");
}

//! Fields: `compress --fields`, `info` and `recover`.

use crate::common::TestFolder;
use particlegs_pipeline::math::Random;
use std::path::Path;

const COUNT: usize = 6000;

fn write(folder: &Path, name: &str, column: &[f32]) {
    let bytes: Vec<u8> = column.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(folder.join(name).with_extension("f32"), bytes).unwrap();
}

fn read(folder: &Path, name: &str) -> Vec<f64> {
    let bytes = std::fs::read(folder.join(name).with_extension("f32")).unwrap();
    bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
}

/// Two clouds that fall towards each other along x, and a temperature that rises along y.
fn snapshot(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    let mut columns = vec![Vec::new(); 7];
    for i in 0..COUNT as u64 {
        let mut r = Random::new(3, 0, i);
        let side = if i % 3 == 0 { 1.0 } else { -1.0 };
        let place = [side * 2.0 + 0.5 * r.normal(), r.normal(), 0.7 * r.normal()];
        let velocity = [-150.0 * side + 20.0 * r.normal(), 10.0 * r.normal(), 30.0 * place[1] + 5.0 * r.normal()];
        let row = place.into_iter().chain(velocity).chain([1e4 + 1e3 * place[1] + 50.0 * r.normal()]);
        columns.iter_mut().zip(row).for_each(|(column, v)| column.push(v as f32));
    }
    let names = ["xx", "yy", "zz", "vx", "vy", "vz", "temperature"];
    names.iter().zip(&columns).for_each(|(name, column)| write(folder, name, column));
}

fn sums(folder: &Path, names: &[&str]) -> Vec<f64> {
    names.iter().map(|name| read(folder, name).iter().sum()).collect()
}

#[test]
fn fields_are_compressed_listed_and_recovered_with_positions() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    let [_, said] = dir.runs("compress snap -o plain.pgs --gaussians 60 --certificate none");
    assert!(said.contains("the model omits these fields: temperature, vx, vy, vz"), "{said}");
    let [_, said] = dir.runs("compress snap -o m.pgs --gaussians 60 --certificate none --fields velocity");
    assert!(said.contains("the model omits these fields: temperature\n"), "{said}");
    let [_, said] = dir.runs("compress snap -o all.pgs --gaussians 60 --certificate none --fields all");
    assert!(!said.contains("omits"), "{said}");
    // The positions keep their bytes, and sums are the particles'.
    let (plain, all) = (dir.model("plain.pgs"), dir.model("all.pgs"));
    let (g, of_all) = (&plain.layers[0].content[0].gaussians, &all.layers[0].content[0].gaussians);
    assert_eq!((&g.mean, &g.cov, &g.count), (&of_all.mean, &of_all.cov, &of_all.count));
    let velocity = of_all.fields.get("velocity").unwrap();
    for (mean, name) in velocity.mean.iter().zip(["vx", "vy", "vz"]) {
        let values = read(&dir.at("snap"), name);
        let sum: f64 = mean.iter().zip(&g.count).map(|(v, n)| v * n).sum();
        let size: f64 = values.iter().map(|v| v.abs()).sum();
        assert!((sum - values.iter().sum::<f64>()).abs() < 1e-9 * size, "{name}");
    }
    // The flow of vz along y, within its noise.
    let along_y: f64 = velocity.slope[2][1].iter().zip(&g.count).map(|(v, n)| v * n).sum::<f64>() / COUNT as f64;
    assert!((20.0..35.0).contains(&along_y), "{along_y}");
    let info = dir.says("info all.pgs");
    let listed: Vec<&str> =
        info["metadata"]["kept"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
    assert_eq!(listed, ["positions", "velocity", "temperature"]);
    let [text, _] = dir.runs("info all.pgs");
    assert!(text.contains("per Gaussian; vector, weighted by count"), "{text}");

    let names = ["velocity_x", "velocity_y", "velocity_z", "temperature"];
    dir.runs("recover all.pgs -o drawn");
    let drawn = sums(&dir.at("drawn"), &names);
    let was = sums(&dir.at("snap"), &["vx", "vy", "vz", "temperature"]);
    for (a, b) in drawn.iter().zip(&was) {
        assert!((a - b).abs() < 5.0 * COUNT as f64, "{drawn:?} {was:?}");
    }
    let squares = |folder: &str, name: &str| read(&dir.at(folder), name).iter().map(|v| v * v).sum::<f64>();
    for (ours, theirs) in [("velocity_x", "vx"), ("velocity_y", "vy"), ("velocity_z", "vz")] {
        let ratio = squares("drawn", ours) / squares("snap", theirs);
        assert!((ratio - 1.0).abs() < 0.1, "{ours} {ratio}");
    }
    // The same seed gives the same particles in every form.
    dir.runs("recover all.pgs -o drawn.hdf5");
    dir.runs("convert drawn.hdf5 -o again.dump");
    dir.runs("recover all.pgs -o drawn.dump");
    assert_eq!(dir.text("again.dump").lines().count(), dir.text("drawn.dump").lines().count());
    let [text, _] = dir.runs("info drawn.hdf5");
    assert!(text.contains("Velocities f32[3]") && text.contains("temperature f32"), "{text}");
    // What was recovered is compressed again.
    dir.runs("compress drawn -o twice.pgs --gaussians 60 --certificate none --fields velocity,temperature");
    dir.runs("verify twice.pgs");
}

#[test]
fn blocks_and_threads_do_not_change_what_fields_are() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    let fit = "--gaussians 60 --certificate none --fields all --quiet";
    let one = dir.makes(&format!("compress snap -o one.pgs {fit} --threads 1"));
    assert_eq!(one, dir.makes(&format!("compress snap -o two.pgs {fit} --threads 2")));
    dir.runs(&format!("compress snap -o blocks.pgs {fit} --blocks 3"));
    let model = dir.model("blocks.pgs");
    assert_eq!(model.layers[0].content.len(), 3);
    let sum: f64 = model
        .blocks()
        .map(|b| {
            let mean = &b.gaussians.fields.get("temperature").unwrap().mean[0];
            mean.iter().zip(&b.gaussians.count).map(|(v, n)| v * n).sum::<f64>()
        })
        .sum();
    let was = sums(&dir.at("snap"), &["temperature"])[0];
    assert!((sum / was - 1.0).abs() < 1e-9, "{sum} {was}");
    let [_, said] = dir.runs("simplify one.pgs -o small.pgs --gaussians 20");
    assert!(said.contains("the smaller model omits the fields"), "{said}");
    assert!(dir.model("small.pgs").metadata.fields.is_empty());
}

#[test]
fn fields_that_cannot_be_stored_are_refused_before_the_fit() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    dir.fails("compress snap -o no.pgs --fields entropy", 2, "the snapshot has no field `entropy`");
    dir.fails("compress snap -o no.pgs --fields vx --law alpha-blend --train fast", 2, "cannot store fields");
    dir.fails("compress snap -o no.pgs --fields vx --every 2", 2, "fields cannot be read from this selection");
    let mut hot = vec![1.0f32; COUNT];
    hot[1234] = f32::NAN;
    write(&dir.at("snap"), "temperature", &hot);
    let fit = "--gaussians 60 --certificate none";
    dir.fails(&format!("compress snap -o no.pgs {fit} --fields temperature"), 2, "particle 1234 has the value NaN");
    assert!(!dir.at("no.pgs").exists());
    // Values that are all alike stay so.
    write(&dir.at("snap"), "temperature", &vec![12.5f32; COUNT]);
    dir.runs(&format!("compress snap -o flat.pgs {fit} --fields temperature"));
    dir.runs("recover flat.pgs -o flat");
    assert!(read(&dir.at("flat"), "temperature").iter().all(|v| (v - 12.5).abs() < 1e-5));
}

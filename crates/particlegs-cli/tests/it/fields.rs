//! Fields: `compress --fields`, `info` and `recover`.

use crate::common::TestFolder;
use particlegs_core::math::Random;
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
pub fn snapshot(folder: &Path) {
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
    let drawn_sums = sums(&dir.at("drawn"), &names);
    let sources = ["vx", "vy", "vz", "temperature"];
    let source_sums = sums(&dir.at("snap"), &sources);
    for (name, (drawn, source)) in sources.iter().zip(drawn_sums.iter().zip(&source_sums)) {
        // Three times the scatter of a sum of so many drawn values.
        let mean = source / COUNT as f64;
        let scatter = read(&dir.at("snap"), name).iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt();
        assert!((drawn - source).abs() < 3.0 * scatter, "{name}: {drawn} {source}");
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

/// The printed ratio counts fields on both sides, wherever it is printed; a target speaks of positions alone.
#[test]
fn the_ratio_is_one_number_everywhere() {
    let dir = TestFolder::new();
    snapshot(&dir.at("in"));
    let command = "compress in -o m.pgs --ratio 20 --fields velocity --effort fast --certificate none";
    let [text, _] = dir.runs(&format!("{command} --json made.json"));
    let (report, info) = (dir.json("made.json"), dir.says("info m.pgs"));
    for key in ["raw_bytes", "compression_ratio"] {
        assert_eq!(report[key], info[key], "{key}");
    }
    let (ratio, bytes) = (info["compression_ratio"].as_f64().unwrap(), dir.bytes("m.pgs").len() as f64);
    assert_eq!(info["raw_bytes"].as_f64().unwrap() / bytes, ratio);
    assert!(text.contains(&format!("ratio {ratio:.1} with fields (19.")), "{text}");
    let again = dir.says("compress in -o m.pgs --ratio 20 --fields velocity --effort fast --certificate none");
    assert_eq!((&again["there_already"], &again["compression_ratio"]), (&true.into(), &info["compression_ratio"]));
    let scores = dir.says("eval m.pgs in --frames 1 --size 64x36");
    assert_eq!(scores["compression_ratio"], info["compression_ratio"]);
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
    // A smaller model joins the fields: sums stay, and so does the dispersion of all.
    dir.runs("simplify one.pgs -o small.pgs --gaussians 20");
    let total = |name: &str| {
        let model = dir.model(name);
        let g = &model.layers[0].content[0].gaussians;
        let f = g.fields.get("velocity").unwrap();
        let (mut sum, mut square) = (0.0, 0.0);
        for i in 0..g.len() {
            let slope = [0, 1, 2].map(|k| f.slope[0][k][i]);
            let variance = g.cov_of(i).quadratic(slope) + f.spread[0][i];
            sum += g.count[i] * f.mean[0][i];
            square += g.count[i] * (f.mean[0][i] * f.mean[0][i] + variance);
        }
        (sum, square, g.len())
    };
    let ((sum, square, n), (sum_of_small, square_of_small, n_of_small)) = (total("one.pgs"), total("small.pgs"));
    assert!((sum - sum_of_small).abs() < 1e-6 * square.sqrt() * COUNT as f64, "{sum} {sum_of_small}");
    assert!((square_of_small / square - 1.0).abs() < 0.1, "{square} {square_of_small}");
    assert!(n == 60 && n_of_small == 20);
}

#[test]
fn each_field_has_its_verdict() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    let fit = "--gaussians 60 --effort fast --fields velocity,temperature --radius 0.005";
    let [text, _] = dir.runs(&format!("compress snap -o m.pgs {fit}"));
    assert!(text.contains("\n  field           good           velocity: "), "{text}");
    let info = dir.says("info m.pgs");
    let findings: Vec<&serde_json::Value> =
        info["verdict"].as_array().unwrap().iter().filter(|f| f["use"] == "field").collect();
    assert!(findings.len() == 2 && findings[1]["why"].as_str().unwrap().starts_with("temperature: "), "{findings:?}");
    // Bulk motions of 150 along x and 30 along z, noise of 20.
    let velocity = &info["certificate"]["fields"]["each"][0];
    let [signal, error] = ["signal", "error"].map(|name| velocity[name].as_f64().unwrap());
    assert!((signal - 145.0).abs() < 15.0 && error < 20.0, "{velocity}");
    let [text, _] = dir.runs("verify m.pgs snap");
    assert!(text.contains("fields field 2: error") && !text.contains("differs"), "{text}");
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

#[test]
fn maps_of_a_model_are_those_of_its_particles() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    dir.runs("compress snap -o m.pgs --gaussians 60 --certificate none --fields all");
    let window = "--projection orthographic --center 0,0,0 --width 8 --size 40x30 --raw";
    let values = |folder: &str| {
        let raw: Vec<f64> = read(&dir.at(folder), "view");
        raw
    };
    dir.runs(&format!("render m.pgs --field velocity.x {window} -o model"));
    dir.runs(&format!("reference snap --field velocity.x {window} -o truth"));
    let both: Vec<(f64, f64)> = values("model").into_iter().zip(values("truth")).collect();
    let both: Vec<(f64, f64)> = both.into_iter().filter(|(a, b)| a.is_finite() && b.is_finite()).collect();
    let off = both.iter().map(|(a, b)| (a - b).abs()).sum::<f64>() / both.len() as f64;
    assert!(both.len() > 300 && off < 20.0, "{} pixels, {off}", both.len());
    let description = dir.json("model/view.json");
    assert_eq!(description["quantity"], "velocity along x");
    // Seen along x, what moves to the right moves away; subtracting the mean shifts all alike.
    let along_x = "--azimuth 90 --projection orthographic --center 0,0,0 --width 8 --size 20x20 --raw";
    dir.runs(&format!("render m.pgs --field velocity.los {along_x} -o los"));
    dir.runs(&format!("render m.pgs --field velocity.los --bulk 100,0,0 {along_x} -o moved"));
    let shifts: Vec<f64> =
        values("los").iter().zip(values("moved")).map(|(a, b)| a - b).filter(|v| v.is_finite()).collect();
    assert!(!shifts.is_empty() && shifts.iter().all(|v| (v + 100.0).abs() < 0.01), "{shifts:?}");

    dir.runs("render m.pgs --field temperature --scale log --size 64x48 -o t.png");
    dir.runs("render m.pgs --field velocity.los --bulk mean --shade --size 64x48 -o v.png");
    dir.runs("render m.pgs --like v.png -o again.png");
    assert_eq!(std::fs::read(dir.at("v.png")).unwrap(), std::fs::read(dir.at("again.png")).unwrap());
    dir.runs("render m.pgs --like v.png --scale linear -o linear.png");
    dir.fails("render m.pgs --shade -o no.png", 2, "--shade has no effect here; it applies to maps of a field");
    dir.runs("render m.pgs --field dispersion.los --turntable 3 --size 64x48 -o frames");
    dir.runs("reference snap --field dispersion.temperature --size 64x48 --background white -o d.pdf");
    for (options, message) in [
        ("--field velocity", "field `velocity` is a vector"),
        ("--field entropy", "the model has no field `entropy`"),
        ("--field temperature --bulk mean", "a bulk motion is subtracted from a vector"),
        ("--field velocity.x --bulk 1,2", "the bulk motion is `mean` or three numbers"),
        ("--field temperature --style expected", "--style has no effect"),
        ("--field temperature --radius 0.1", "--radius has no effect"),
        ("--field temperature --range=5,1", "the range of colours takes LO,HI"),
        ("--field temperature --scale log --range=-5,1", "both positive on a logarithmic scale"),
    ] {
        dir.fails(&format!("render m.pgs {options} -o no.png"), 2, message);
    }
    dir.fails("reference snap --field speed -o no.png", 2, "the snapshot has no field `speed`");
}

#[test]
fn joint_histograms_compare_two_fields() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    // Pressures over four decades that rise with temperature.
    let temperature = read(&dir.at("snap"), "temperature");
    let pressure: Vec<f32> = temperature.iter().map(|t| 10f64.powf(5e-4 * (t - 1e4)) as f32).collect();
    write(&dir.at("snap"), "pressure", &pressure);
    dir.runs("compress snap -o m.pgs --gaussians 60 --certificate none --fields temperature,pressure,velocity");
    let joint = "--only joint --joint temperature,pressure --joint-bins 8";
    let [text, _] = dir.runs(&format!("stats snap m.pgs -o s {joint} --plots png,svg,pdf"));
    assert!(
        text.contains(": temperature and log pressure") && text.contains("% of the mass is in other cells"),
        "{text}"
    );
    let stats = dir.json("s/stats.json");
    let distribution = &stats["joint"][0];
    assert_eq!(distribution["logarithmic"], serde_json::json!([false, true]));
    let number = |name: &str| distribution[name].as_f64().unwrap();
    assert!(number("difference") < 0.3 && number("noise") > 0.01, "{} {}", number("difference"), number("noise"));
    assert!(
        distribution["correlation"].as_array().unwrap().iter().all(|r| r.as_f64().unwrap() > 0.9),
        "{}",
        distribution["correlation"]
    );
    assert_eq!(dir.text("s/joint.csv").lines().count(), 65);
    for ending in ["png", "svg", "pdf"] {
        assert!(dir.at(&format!("s/joint.{ending}")).is_file(), "{ending}");
    }
    dir.runs(&format!("stats snap m.pgs -o again {joint} --plots png,svg,pdf --threads 1"));
    for name in ["stats.json", "joint.csv", "joint.png", "joint.svg"] {
        assert_eq!(dir.bytes(&format!("s/{name}")), dir.bytes(&format!("again/{name}")), "{name}");
    }
    // Without a choice, the first two that both have; those of a model that do not correlate are refused, and the rest goes on.
    let [text, _] = dir.runs("stats snap m.pgs -o first --only joint,moments --no-plots");
    assert!(text.contains("log pressure and temperature"), "{text}");
    dir.runs("compress snap -o one.pgs --gaussians 60 --certificate none --fields temperature");
    let [_, said] = dir.runs("stats snap one.pgs -o none --only joint,moments");
    assert!(
        said.contains("no joint histogram: no particle type has the same two scalar fields on both sides"),
        "{said}"
    );
    assert!(dir.json("none/stats.json")["joint"].is_null() && !dir.json("none/stats.json")["moments"].is_null());
    dir.fails("stats snap m.pgs -o no --joint pressure", 2, "--joint takes two fields X,Y");
    dir.fails("stats snap m.pgs -o no --joint pressure,Pressure", 2, "two different fields");
    dir.fails("stats snap m.pgs -o no --only moments --joint-bins 5", 2, "the measure `joint`");
    assert!(!dir.at("no").exists());
}

#[test]
fn exported_gaussians_have_their_fields() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    dir.runs("compress snap -o m.pgs --gaussians 60 --certificate none --fields all");
    dir.runs("export m.pgs -o g.csv");
    let text = dir.text("g.csv");
    let head = text.lines().find(|l| !l.starts_with('#')).unwrap();
    assert!(head.contains("velocity_x,dispersion_velocity_x,") && head.contains("temperature,dispersion_temperature,"));
    let row = text.lines().filter(|l| !l.starts_with('#')).nth(1).unwrap();
    assert_eq!(row.split(',').count(), head.split(',').count());
    dir.runs("export m.pgs -o g.npz");
    let [_, said] = dir.runs("export m.pgs -o density.npy --grid 8");
    assert!(said.contains("the fields: velocity, temperature") || dir.text("density.json").contains("the fields:"));
}

/// Energies, electrons and star formation of warm gas with a hot, ionised half of which a tenth forms stars.
#[test]
fn temperatures_are_computed_from_energies_and_described_by_logarithms() {
    let dir = TestFolder::new();
    snapshot(&dir.at("gas"));
    let place = read(&dir.at("gas"), "xx");
    std::fs::remove_file(dir.at("gas").join("temperature.f32")).unwrap();
    let array_of = |f: &dyn Fn(usize) -> f64| (0..COUNT).map(|i| f(i) as f32).collect::<Vec<f32>>();
    let is_hot = |i: usize| place[i] > 0.0;
    let electrons = array_of(&|i| if is_hot(i) { 1.158 } else { 0.0 });
    let energy = array_of(&|i| if is_hot(i) { 2e4 } else { 50.0 } * (0.4 * Random::new(5, 0, i as u64).normal()).exp());
    let rate = array_of(&|i| f64::from(u8::from(is_hot(i) && i % 10 == 0)));
    for (name, column) in [("InternalEnergy", &energy), ("ElectronAbundance", &electrons), ("StarFormationRate", &rate)]
    {
        write(&dir.at("gas"), name, column);
    }
    // T = 2/3 u mu m_p / k_B, with mu = 4 / (1 + 3 X + 4 X x_e).
    let kelvin = array_of(&|i| {
        let (u, x) = (f64::from(energy[i]), f64::from(electrons[i]));
        2.0 / 3.0 * u * 121.147 * 4.0 / (3.28 + 3.04 * x)
    });
    let fit = "--gaussians 60 --certificate none --fields temperature";
    let choices = [("", None), ("--star-forming 1e4", Some(1e4)), ("--star-forming drop", Some(f64::NAN))];
    for (k, (choice, of_forming)) in choices.into_iter().enumerate() {
        let [_, said] = dir.runs(&format!("compress gas -o m{k}.pgs {fit} {choice}"));
        assert!(said.contains("mu = 4 / (1 + 3 X + 4 X x_e), X = 0.76, x_e from ElectronAbundance"), "{said}");
        let model = dir.model(&format!("m{k}.pgs"));
        assert!(model.metadata.fields[0].logarithmic);
        let g = &model.layers[0].content[0].gaussians;
        let field = g.fields.get("temperature").unwrap();
        let total: f64 = (0..g.len()).map(|i| g.count[i] * field.overall_value(0, i, &g.cov_of(i))).sum();
        let truth = (0..COUNT).map(|i| match of_forming {
            Some(temperature) if rate[i] > 0.0 => temperature,
            _ => f64::from(kelvin[i]),
        });
        let temperatures: Vec<f64> = truth.filter(|v| !v.is_nan()).collect();
        let mean = temperatures.iter().sum::<f64>() / temperatures.len() as f64;
        assert!((total / COUNT as f64 / mean - 1.0).abs() < 1e-4, "{choice}: {total} {mean}");
        dir.runs(&format!("recover m{k}.pgs -o drawn{k}"));
        let drawn_values = read(&dir.at(&format!("drawn{k}")), "temperature");
        let above = |all: &[f64]| all.iter().filter(|v| **v > 1e5).count() as f64 / all.len() as f64;
        assert!(
            (above(&drawn_values) / above(&temperatures) - 1.0).abs() < 0.1,
            "{choice}: {} {}",
            above(&drawn_values),
            above(&temperatures)
        );
        let ratio = drawn_values.iter().sum::<f64>() / COUNT as f64 / mean;
        assert!((ratio - 1.0).abs() < 0.05, "{choice}: {ratio}");
    }
    dir.runs("simplify m0.pgs -o small.pgs --gaussians 20");
    let wrong = "compress gas -o x.pgs --fields temperature --star-forming cold";
    dir.fails(wrong, 2, "use `keep`, `drop`, or a temperature in K above 0");
}

#[test]
fn sums_such_as_charges_are_drawn_per_area_and_recovered() {
    let dir = TestFolder::new();
    snapshot(&dir.at("ions"));
    let place = read(&dir.at("ions"), "xx");
    let charge: Vec<f32> = place.iter().map(|x| if *x > 0.0 { 2.0 } else { -1.0 }).collect();
    let mass: Vec<f32> = (0..COUNT).map(|i| 1.0 + (i % 4) as f32).collect();
    write(&dir.at("ions"), "q", &charge);
    write(&dir.at("ions"), "ww", &mass);
    dir.runs("compress ions -o m.pgs --gaussians 80 --certificate none --fields q");
    assert!(dir.model("m.pgs").metadata.fields[0].extensive);
    let total: f64 = charge.iter().map(|v| f64::from(*v)).sum();
    dir.runs("recover m.pgs -o drawn");
    let drawn_total: f64 = read(&dir.at("drawn"), "q").iter().sum();
    assert!((drawn_total - total).abs() < 0.05 * COUNT as f64, "{drawn_total} {total}");
    let view = "--field q --projection orthographic --center 0,0,0 --width 16 --size 80x80 --raw";
    for (command, folder) in [("render m.pgs", "model"), ("reference ions", "truth")] {
        dir.runs(&format!("{command} -o {folder} {view}"));
        let folder = dir.at(folder);
        let file =
            std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path()).find(|p| p.extension().unwrap() == "f32");
        let map = read(&folder, file.unwrap().file_stem().unwrap().to_str().unwrap());
        // A pixel has an area of 0.04.
        let sum: f64 = map.iter().filter(|v| !v.is_nan()).sum::<f64>() * 0.04;
        assert!((sum - total).abs() < 1e-3 * COUNT as f64, "{command}: {sum} {total}");
    }
    dir.fails("render m.pgs --field dispersion.q -o d.png", 2, "it has no dispersion");
}

/// The numbers of a VTI's arrays, after the underscore that they begin behind.
fn appended(bytes: &[u8], name: &str) -> Vec<f64> {
    let begin = bytes.windows(15).position(|w| w == b"encoding=\"raw\">").unwrap() + 16;
    let head = String::from_utf8_lossy(&bytes[..begin]).into_owned();
    let line = head.lines().find(|l| l.contains(&format!("Name=\"{name}\"")) && l.contains("appended")).unwrap();
    let offset: usize = line.split("offset=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    let from = begin + offset;
    let length = u64::from_le_bytes(bytes[from..from + 8].try_into().unwrap()) as usize;
    bytes[from + 8..][..length].as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
}

#[test]
fn grids_have_the_means_of_fields_in_their_cells() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    dir.runs("compress snap -o m.pgs --gaussians 60 --certificate none --fields all");
    let vti = dir.makes("export m.pgs -o g.vti --grid 40 --fields all -q");
    let report = dir.says("export m.pgs -o g.fits --grid 12 --fields Temperature,velocity");
    assert_eq!(report["grid"]["fields"][0]["name"], "temperature");
    let vti_text = String::from_utf8_lossy(&vti).into_owned();
    assert!(vti_text.contains("Name=\"velocity\" NumberOfComponents=\"3\"") && !vti_text.contains("the fields:"));
    let density = appended(&vti, "density");
    // What cells have adds up to what particles have, but for the thousandth that lies beyond the open grid.
    let mut dispersions = appended(&vti, "dispersion_velocity").into_iter().filter(|v| v.is_finite());
    assert!(dispersions.all(|v| (0.0..200.0).contains(&v)));
    let velocity = appended(&vti, "velocity");
    let was = sums(&dir.at("snap"), &["vx", "vy", "vz"]);
    let total: f64 = density.iter().sum();
    for k in 0..3 {
        let momentum = |i: usize| density[i] * velocity[3 * i + k];
        let mean = (0..density.len()).map(momentum).filter(|v| v.is_finite()).sum::<f64>() / total;
        assert!((mean - was[k] / COUNT as f64).abs() < 1.0, "{k}: {mean} {}", was[k] / COUNT as f64);
    }
    let fits = dir.bytes("g.fits");
    let cards: Vec<&[u8]> = fits.chunks(80).collect();
    let names = cards.iter().filter(|c| c.starts_with(b"EXTNAME")).map(|c| String::from_utf8_lossy(&c[11..35]));
    let names: Vec<String> = names.map(|n| n.trim().trim_matches('\'').trim().to_string()).collect();
    let axes = ["x", "y", "z"].map(|k| [format!("velocity_{k}"), format!("dispersion_velocity_{k}")]);
    let expected = ["temperature".to_string(), "dispersion_temperature".to_string()];
    assert_eq!(names, [&expected[..], axes.as_flattened()].concat());
    for (options, message) in [
        ("-o no.vti --fields entropy", "the model has no field `entropy`"),
        ("-o no.npy --fields velocity", "fields on a grid are written to .vti and .fits"),
    ] {
        dir.fails(&format!("export m.pgs {options}"), 2, message);
    }
    dir.runs("compress snap -o plain.pgs --gaussians 60 --certificate none");
    dir.fails("export plain.pgs -o no.vti --fields all", 2, "the model has no fields");
}

#[test]
fn parts_with_different_fields_are_merged_by_the_common_ones() {
    let dir = TestFolder::new();
    ["west", "east"].iter().for_each(|name| snapshot(&dir.at(name)));
    // The same cloud elsewhere.
    let shifted_x: Vec<f32> = read(&dir.at("east"), "xx").iter().map(|x| *x as f32 + 20.0).collect();
    write(&dir.at("east"), "xx", &shifted_x);
    let fit = "--gaussians 30 --certificate none --quiet";
    dir.runs(&format!("compress west -o w.pgs {fit} --fields temperature,velocity"));
    dir.runs(&format!("compress east -o e.pgs {fit} --fields velocity"));
    dir.runs(&format!("compress east -o none.pgs {fit}"));
    for (parts, message, hint) in [
        ("w.pgs e.pgs", "e.pgs: the model has no field `temperature`, which w.pgs has", "`--fields velocity`"),
        ("e.pgs w.pgs", "w.pgs: the model has the field `temperature`, which e.pgs lacks", "`--fields velocity`"),
        ("w.pgs none.pgs", "none.pgs: the model has no field `temperature`", "`--fields none`"),
    ] {
        dir.fails(&format!("merge {parts} -o no.pgs"), 3, message);
        let stderr = dir.command(&format!("merge {parts} -o no.pgs")).output().unwrap().stderr;
        assert!(String::from_utf8_lossy(&stderr).contains(hint), "{parts}");
    }
    dir.fails("merge w.pgs e.pgs --fields temperature -o no.pgs", 3, "e.pgs: the model has no field `temperature`");
    let merged = dir.makes("merge w.pgs e.pgs --fields velocity -o m.pgs -q");
    assert_eq!(merged, dir.makes("merge e.pgs w.pgs --fields VELOCITY -o again.pgs -q"));
    let (west, east, both) = (dir.model("w.pgs"), dir.model("e.pgs"), dir.model("m.pgs"));
    assert_eq!(both.metadata.fields, east.metadata.fields);
    let velocities_of = |model: &particlegs_core::model::Model| {
        let field = |g: &particlegs_core::model::Mixture| g.fields.get("velocity").unwrap().clone();
        model.blocks().map(|b| field(&b.gaussians)).collect::<Vec<_>>()
    };
    assert_eq!(velocities_of(&both), [velocities_of(&west), velocities_of(&east)].concat());
    assert!(both.blocks().all(|b| b.gaussians.fields.get("temperature").is_none()));
    dir.runs("merge w.pgs none.pgs --fields none -o plain.pgs");
    assert!(dir.model("plain.pgs").metadata.fields.is_empty());
}

/// The file of a job is that of `compress`.
pub fn same_by_job(dir: &TestFolder, input: &str, job: &str, options: &str) {
    let direct = dir.makes(&format!("compress {input} -o direct.pgs {options} --quiet --force"));
    let blocks = dir.says(&format!("plan {input} -o {job} {options}"))["blocks"].as_u64().unwrap();
    dir.runs(&format!("scatter {job} --quiet"));
    (0..blocks).rev().for_each(|block| drop(dir.runs(&format!("block {job} {block} --quiet"))));
    assert_eq!(dir.makes(&format!("merge {job} -o merged.pgs --quiet --force")), direct, "{input}");
}

#[test]
fn a_job_gives_the_fields_that_compress_gives() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    // Masses weigh the means.
    write(&dir.at("snap"), "ww", &(0..COUNT).map(|i| 1.0 + (i % 5) as f32).collect::<Vec<_>>());
    let options = "--blocks 3 --effort fast --gaussians 60 --fields velocity,temperature --certificate none";
    same_by_job(&dir, "snap", "job", options);
    // A block is a model with its own fields.
    assert!(dir.model("job/blocks/00001.pgs").blocks().all(|b| b.gaussians.fields.get("velocity").is_some()));
    dir.runs("verify job");
    // What blocks measure of fields adds up to what `compress` measures.
    let options = options.replace("none", "quick") + " --radius 0.005";
    same_by_job(&dir, "snap", "quick", &options);
    dir.runs(&format!("plan snap -o blocks {}", options.replace("quick", "blocks")));
    dir.runs("scatter blocks -q");
    (0..3).for_each(|block| drop(dir.runs(&format!("block blocks {block} -q"))));
    dir.runs("merge blocks -o added.pgs -q");
    let figures = |name: &str, field: usize| {
        let field_certificate = &dir.says(&format!("info {name}"))["certificate"]["fields"]["each"][field];
        ["edge", "cells", "signal", "error"].map(|figure| field_certificate[figure].as_f64().unwrap())
    };
    for field in 0..2 {
        let [a, b] = ["merged.pgs", "added.pgs"].map(|name| figures(name, field));
        assert!(a.iter().zip(b).all(|(a, b)| (b - a).abs() <= 1e-5 * a) && a[2] > a[3], "{a:?} {b:?}");
    }
    let [text, _] = dir.runs("verify added.pgs snap");
    assert!(text.contains("fields field 2: error") && !text.contains("differs"), "{text}");
    // Text has float64.
    let columns = ["xx", "yy", "zz", "vx"].map(|name| read(&dir.at("snap"), name));
    let rows =
        (0..COUNT).map(|i| format!("{},{},{},{}\n", columns[0][i], columns[1][i], columns[2][i], columns[3][i] / 3.0));
    dir.write("rows.csv", "x,y,z,vx\n".to_string() + &rows.collect::<String>());
    same_by_job(&dir, "rows.csv", "text", "--blocks 2 --effort fast --gaussians 40 --fields vx --certificate none");
}

#[test]
fn fields_go_through_the_buckets_of_a_job() {
    let dir = TestFolder::new();
    let n = 140_000u64;
    std::fs::create_dir(dir.at("snap")).unwrap();
    // Shuffled along x, so that blocks need buckets.
    let along = |from: u64, step: u64| (0..n).map(|i| ((i * step + from) % n) as f32).collect::<Vec<_>>();
    for (name, column) in
        [("xx", along(0, 7919)), ("yy", along(5, 104_729)), ("zz", along(9, 31)), ("heat", along(0, 15_838))]
    {
        write(&dir.at("snap"), name, &column);
    }
    let options = "--blocks 3 --effort fast --gaussians 60 --fields heat --certificate none";
    same_by_job(&dir, "snap", "job", options);
    assert!(dir.says("plan snap -o again --blocks 3 --fields heat")["scatter_bytes"].as_u64() == Some(16 * n));
    let mut cold = along(0, 15_838);
    cold[70_077] = f32::INFINITY;
    write(&dir.at("snap"), "heat", &cold);
    dir.fails("scatter again", 2, "particle 70077 has the value inf in field `heat`");
    std::fs::rename(dir.at("snap/heat.f32"), dir.at("snap/cold.f32")).unwrap();
    dir.fails("scatter again", 3, "its field `heat` is different");
    dir.fails("plan snap -o no --blocks 2 --fields entropy", 2, "the snapshot has no field `entropy`");
}

#[test]
fn positions_and_fields_meet_a_size_together() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    let options = "--effort fast --certificate none --fields velocity,temperature";
    for total in [4000, 8000] {
        let report = dir.says(&format!("compress snap -o t{total}.pgs {options} --size-total {total}"));
        let bytes = dir.bytes(&format!("t{total}.pgs")).len();
        assert_eq!(report["model_bytes"], bytes);
        assert!((total * 95 / 100..=total).contains(&bytes), "{total}: {bytes}");
    }
    // The file says the size of its positions, which gives it again.
    let info = dir.says("info t8000.pgs");
    let command = info["metadata"]["command"].as_str().unwrap().to_string();
    let size = command.split("--size ").nth(1).unwrap().split(' ').next().unwrap();
    assert_eq!(dir.makes(&format!("compress snap -o again.pgs {options} --size {size}")), dir.bytes("t8000.pgs"));
    dir.fails(&format!("compress snap -o no.pgs {options} --size-total 500"), 5, "no file of at most 500 bytes");
    dir.fails("compress snap -o no.pgs --size-total 5kB", 2, "required arguments were not provided");
    dir.fails(&format!("compress snap -o no.pgs {options} --size-total 5kB --ratio 3"), 2, "cannot be used with");
}

#[test]
fn cold_gas_is_dense_in_weighted_maps_and_recovered_particles() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"));
    let (y, t) = (read(&dir.at("snap"), "yy"), read(&dir.at("snap"), "temperature"));
    // What the temperature differs by at its place, in deviations, and the density with it.
    let off = |y: &[f64], t: &[f64]| -> Vec<f64> { y.iter().zip(t).map(|(y, t)| (t - 1e4 - 1e3 * y) / 50.0).collect() };
    let density = |(i, e): (usize, &f64)| (0.5 * Random::new(8, 0, i as u64).normal() - e).exp() as f32;
    write(&dir.at("snap"), "Density", &off(&y, &t).iter().enumerate().map(density).collect::<Vec<_>>());
    let [said, _] =
        dir.runs("compress snap -o m.pgs --gaussians 40 --certificate none --fields temperature,Density,velocity");
    assert!(said.contains("correlations: "), "{said}");

    let window = "--projection orthographic --center 0,0,0 --width 6 --size 12x9 --raw --field temperature";
    let mean_change = |command: &str| {
        let [plain, dense] = ["mass", "density"].map(|weight| {
            let folder = format!("{}-{weight}", command.replace(' ', "-"));
            dir.runs(&format!("{command} {window} --field-weight {weight} -o {folder}"));
            read(&dir.at(&folder), "view")
        });
        let off: Vec<f64> = plain.iter().zip(dense).map(|(a, b)| b - a).filter(|v| v.is_finite()).collect();
        off.iter().sum::<f64>() / off.len() as f64
    };
    // A deviation colder.
    let truth = mean_change("reference snap");
    assert!((truth + 50.0).abs() < 15.0, "{truth}");
    let model = mean_change("render m.pgs");
    assert!((model - truth).abs() < 12.0, "{model}, not {truth}");
    dir.runs("merge m.pgs --fields Density,temperature -o swapped.pgs");
    let swapped = mean_change("render swapped.pgs");
    assert!((swapped - model).abs() < 1e-3, "{swapped}");
    dir.runs("simplify m.pgs -o small.pgs --gaussians 20");
    let small = mean_change("render small.pgs");
    assert!((small - truth).abs() < 20.0, "{small}, not {truth}");

    dir.runs("recover m.pgs -o again");
    let [y, t, d] = ["yy", "temperature", "Density"].map(|name| read(&dir.at("again"), name));
    let (e, d): (Vec<f64>, Vec<f64>) = (off(&y, &t), d.iter().map(|v| v.ln()).collect());
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let with = |a: &[f64], b: &[f64]| {
        let (x, y) = (mean(a), mean(b));
        a.iter().zip(b).map(|(a, b)| (a - x) * (b - y)).sum::<f64>()
    };
    let covariance = with(&e, &d) / COUNT as f64;
    assert!((-1.1..-0.7).contains(&covariance), "{covariance}");
    for (options, message) in [
        ("--field velocity.x --field-weight Density", "is a vector: its means are weighted by mass or count alone"),
        ("--field temperature --field-weight velocity", "field `velocity` is not a scalar"),
        ("--field temperature --field-weight heat", "there is no field `heat` to weigh means by"),
    ] {
        dir.fails(&format!("render m.pgs {options} -o no.png"), 2, message);
    }
}

/// Columns of float64 of two clouds of 300 particles, and what they are called.
fn with_columns(dir: &TestFolder, columns: &[(&str, &dyn Fn(usize) -> f64)]) {
    let folder = dir.at("snap");
    std::fs::create_dir(&folder).unwrap();
    for (axis, name) in ["xx", "yy", "zz"].iter().enumerate() {
        let place = |i: u64| {
            let mut r = Random::new(5, axis as u32, i);
            (if i.is_multiple_of(2) { 2.0 } else { 8.0 }) + 0.3 * r.normal()
        };
        write(&folder, name, &(0..300).map(|i| place(i) as f32).collect::<Vec<_>>());
    }
    for (name, value) in columns {
        let bytes: Vec<u8> = (0..300).flat_map(|i| value(i).to_le_bytes()).collect();
        std::fs::write(folder.join(format!("{name}.f64")), bytes).unwrap();
    }
}

fn read_double(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).filter(|v| !v.is_nan()).collect()
}

#[test]
fn numbers_of_cgs_are_float64_in_maps_and_recovered_particles() {
    let dir = TestFolder::new();
    let luminous = |i: usize| if i.is_multiple_of(2) { 1e45 } else { 3e45 };
    let wide = |i: usize| if i.is_multiple_of(2) { 1e40 } else { 1e46 };
    let deep = |i: usize| -1e8 + if i.is_multiple_of(2) { -1.0 } else { 1.0 };
    with_columns(&dir, &[("luminous", &luminous), ("wide", &wide), ("deep", &deep)]);
    dir.runs("compress snap -o m.pgs --gaussians 20 --fields all --certificate none");
    dir.runs("recover m.pgs -o drawn");
    dir.runs("recover m.pgs -o drawn.hdf5");
    let [text, _] = dir.runs("info drawn.hdf5");
    assert!(text.contains("luminous f64") && text.contains("deep f64"), "{text}");
    for (name, ends) in [("luminous", [1e45, 3e45]), ("wide", [1e40, 1e46]), ("deep", [-1e8 - 1.0, -1e8 + 1.0])] {
        dir.runs(&format!("render m.pgs --field {name} -o map_{name} --raw --size 64x64"));
        dir.runs(&format!("render m.pgs --field {name} -o {name}.png --size 64x64"));
        dir.runs(&format!("reference snap --field {name} -o truth_{name} --raw --size 64x64"));
        let all = ["drawn", "map", "truth"].map(|from| match from {
            "drawn" => read_double(&dir.at(&format!("drawn/{name}.f64"))),
            _ => read_double(&dir.at(&format!("{from}_{name}/view.f64"))),
        });
        for values in all {
            let slack = 1e-3 * (ends[1] - ends[0]);
            let inside = |v: &f64| (ends[0] - slack..=ends[1] + slack).contains(v);
            let spread = values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
                - values.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(values.len() > 5 && values.iter().all(inside), "{name}: {values:?}");
            assert!(spread > 0.8 * (ends[1] - ends[0]), "{name}: {spread}");
        }
    }
    // What was recovered is a snapshot again.
    dir.runs("compress drawn -o again.pgs --gaussians 20 --fields all --certificate none");
}

#[test]
fn whole_numbers_of_64_bits_are_mapped_and_recovered_as_numbers() {
    let dir = TestFolder::new();
    let header =
        "{'descr': [('pos', '<f8', (3,)), ('many', '<i8'), ('two', '<i8')], 'fortran_order': False, 'shape': (400,), }";
    let mut bytes = b"\x93NUMPY\x01\x00\xf6\x00".to_vec();
    bytes.extend(format!("{header:<245}\n").bytes());
    for i in 0..400u64 {
        let mut r = Random::new(6, 0, i);
        let side = if i % 2 == 0 { 2.0 } else { 8.0 };
        (0..3).for_each(|_| bytes.extend((side + 0.3 * r.normal()).to_le_bytes()));
        let many = i64::from(i % 2 == 0) * 1000 - (i / 2 % 20) as i64;
        bytes.extend(many.to_le_bytes());
        bytes.extend((if i % 2 == 0 { 2i64 } else { -5 }).to_le_bytes());
    }
    dir.write("a.npy", bytes);
    // One for each side: more would have counts that are rounded, and the mean over all is kept.
    dir.runs("compress a.npy -o m.pgs --gaussians 2 --fields many,two --certificate none");
    dir.runs("recover m.pgs -o drawn");
    let (x, many, two) = (read(&dir.at("drawn"), "xx"), read(&dir.at("drawn"), "many"), read(&dir.at("drawn"), "two"));
    for (side, of_many, of_two) in [(false, 990.5, 2.0), (true, -9.5, -5.0)] {
        let indices: Vec<usize> = (0..x.len()).filter(|&i| (x[i] > 5.0) == side).collect();
        let mean = indices.iter().map(|&i| many[i]).sum::<f64>() / indices.len() as f64;
        assert!((mean - of_many).abs() < 3.0, "{mean}");
        assert!(indices.iter().all(|&i| [2.0, -5.0].contains(&two[i])));
        let share = indices.iter().filter(|&&i| two[i] == of_two).count() as f64 / indices.len() as f64;
        assert!(share > 0.9, "{share}");
    }
}

//! `devices` and `--device`.

#[cfg(feature = "gpu")]
use crate::common::tiny;
use crate::common::{TestFolder, said};
#[cfg(feature = "gpu")]
use particlegs_core::{codec, model::LawKind};

/// A folder with a small model of the sample.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    dir.once("compress SAMPLE -o model.pgs --gaussians 500 --effort fast --certificate none -q");
    dir
}

#[test]
fn the_cpu_draws_unless_a_gpu_is_asked_for() {
    let dir = folder();
    let render = |device: &str, out: &str| {
        let words = format!("render model.pgs --azimuth 30 --size 96x54 -q -o {out} {device}");
        let output = dir.command(&words).output().unwrap();
        (output.status.code(), said(&output), std::fs::read(dir.at(out)).ok())
    };
    let (code, _, plain) = render("", "plain.png");
    assert_eq!(code, Some(0));
    assert_eq!(render("--device cpu", "cpu.png").2, plain);
    let (code, error, none) = render("--device 999", "no.png");
    assert!(code == Some(2) && none.is_none(), "{error}");
    let (code, error, none) = render("--device fastest", "no.png");
    assert!(code == Some(2) && none.is_none() && error.contains("cpu, gpu, auto or a number"), "{error}");
}

#[cfg(not(feature = "gpu"))]
#[test]
fn a_program_without_gpu_support_says_how_to_get_it() {
    let dir = folder();
    for words in ["devices", "render model.pgs --device gpu -o no.png"] {
        let out = dir.command(words).output().unwrap();
        let error = said(&out);
        assert!(error.contains("without GPU support") && error.contains("--features gpu"), "{error}");
        assert_eq!(out.status.code(), Some(2));
    }
}

/// ParaView's pictures of all particles, and scores against them.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_gpu_draws_and_scores_all_particles() {
    let dir = folder();
    for style in ["paraview", "paraview-no-fxaa"] {
        let draw = |device: &str| {
            let out = format!("{style}-{device}.png");
            let view = format!("--azimuth 30 --size 160x90 -q --style {style} --device {device}");
            dir.runs(&format!("reference SAMPLE {view} -o {out}"));
            particlegs_files::png::read_png(&dir.at(&out)).unwrap()
        };
        let (on_gpu, on_cpu) = (draw("0"), draw("cpu"));
        let differ = on_gpu.data.iter().zip(&on_cpu.data).filter(|(a, b)| a != b).count();
        assert!(on_cpu.data.iter().filter(|v| **v > 0).count() > 2000, "{style}: hardly a picture");
        assert!(differ <= 3, "{style}: {differ} pixels differ");
    }
    let score = |device: &str| {
        let scores = dir.says(&format!("eval model.pgs SAMPLE --frames 1 --size 160x90 -q --device {device}"));
        ["paraview", "paraview_no_fxaa", "expected"].map(|style| scores["mean"][style]["psnr"].as_f64().unwrap())
    };
    let (on_gpu, on_cpu) = (score("0"), score("cpu"));
    assert!(on_gpu.iter().zip(on_cpu).all(|(a, b)| (a - b).abs() < 0.02), "{on_gpu:?} {on_cpu:?}");
}

/// Models of either law.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_gpu_draws_what_the_cpu_draws() {
    let dir = folder();
    let first = &dir.says("devices")["devices"][0];
    assert!(first["largest_binding_bytes"].as_u64().unwrap() >= 1 << 27, "{first}");
    dir.write("published.pgs", tiny(0..64, LawKind::AlphaBlend));
    for (model, most) in [("model", 1), ("published", 2)] {
        for device in ["0", "cpu"] {
            dir.runs(&format!("render {model}.pgs --size 160x90 -q --device {device} -o {model}-{device}"));
        }
        let comparison = dir.says(&format!("compare {model}-0 {model}-cpu"));
        let views = comparison["views"].as_array().unwrap();
        assert!(!views.is_empty());
        assert!(views.iter().all(|v| v["largest_difference"].as_u64().unwrap() <= most), "{comparison}");
    }
}

/// Surface densities, of a part of a box too, and coloured layers.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_gpu_draws_densities_and_coloured_layers() {
    let dir = folder();
    dir.runs("compress FIXTURES/species.hdf5 -o species.pgs --gaussians 60 --effort fast --certificate none -q");
    let density = "--style density --colormap grey --no-annotations";
    for words in [
        format!("model.pgs {density}"),
        format!("model.pgs {density} --projection orthographic --width 0.3 --depth 0.4"),
        format!("species.pgs {density} --projection orthographic"),
        "species.pgs --color-by-layer --style expected".into(),
        "species.pgs --color-by-layer".into(),
    ] {
        agrees(&dir, &words);
    }
}

/// Maps of fields in perspective, parallel and of a slab; what another field weighs is refused.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_gpu_draws_fields() {
    let dir = TestFolder::new();
    crate::fields::snapshot(&dir.at("snap"));
    dir.runs("compress snap -o m.pgs --gaussians 60 --effort fast --certificate none --fields all -q");
    for words in [
        "--field temperature",
        "--field temperature --field-weight count --scale log --shade",
        "--field velocity.los --projection orthographic --width 5 --depth 0.4",
        "--field dispersion.velocity.z --projection orthographic --colormap grey",
    ] {
        agrees(&dir, &format!("m.pgs {words} --no-annotations"));
    }
    let weighted = "render m.pgs --field temperature --field-weight temperature --device 0 -q -o no.png";
    dir.fails(weighted, 2, "means weighted by another field are drawn on the CPU only");
}

/// Draws a picture on the GPU and on the CPU: no byte of a pixel may be off by more than one.
#[cfg(feature = "gpu")]
fn agrees(dir: &TestFolder, words: &str) {
    let drawn = ["0", "cpu"].map(|device| {
        let png = dir.makes(&format!("render {words} --size 160x90 -q --device {device} -o out.png"));
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        bytes
    });
    let largest = drawn[0].iter().zip(&drawn[1]).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let lit = drawn[1].iter().filter(|v| **v > 0).count();
    println!("{words}: {lit} lit, {largest} levels apart");
    assert!(lit > 200, "{words}: hardly a picture");
    assert!(drawn[0].len() == drawn[1].len() && largest <= 1, "{words}: {largest} levels apart");
}

/// A run on the device and one on the CPU: held-out scores within 0.05 dB.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn a_gpu_trains_as_the_cpu_does() {
    let dir = TestFolder::new();
    let start = "compress SAMPLE --gaussians 400 --effort fast --certificate none --train fast --scale 0.05";
    let train = |device: &str| {
        let report = dir.says(&format!("{start} --device {device} -o {device}.pgs"));
        report["trained"][0]["scores"][1].as_f64().unwrap_or_else(|| panic!("{report}"))
    };
    let (on_gpu, on_cpu) = (train("0"), train("cpu"));
    assert!((on_gpu - on_cpu).abs() < 0.05, "{on_gpu} {on_cpu}");
    let refused = dir.command("compress SAMPLE --device 0 -q -o no.pgs").output().unwrap();
    let error = said(&refused);
    assert!(refused.status.code() == Some(2) && error.contains("--train"), "{error}");
}

/// The published recipe on the GPU, and fine-tuning of its model.
#[cfg(feature = "gpu")]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_gpu_trains_and_tunes_the_published_law() {
    let dir = TestFolder::new();
    let score = |words: &str| {
        let report = dir.says(&format!("{words} --certificate none --device 0 --scale 0.004"));
        [0, 1].map(|k| report["trained"][0]["scores"][k].as_f64().unwrap_or_else(|| panic!("{report}")))
    };
    let [before, trained] = score("compress SAMPLE --train paper --law alpha-blend --gaussians 1000 -o model.pgs");
    assert!(trained > before + 1.0, "{before} {trained}");
    let [before, tuned] = score("finetune model.pgs SAMPLE -o tuned.pgs");
    assert!(before.is_finite() && tuned.is_finite());
    let model = codec::decode(&dir.bytes("tuned.pgs"), "tuned").unwrap();
    assert_eq!(model.metadata.law, LawKind::AlphaBlend);
}

/// The laboratory on the device: the CPU's scores within 0.02 dB, stored apart from them.
#[cfg(all(feature = "gpu", feature = "lab"))]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_gpu_measures_what_the_cpu_measures() {
    let dir = TestFolder::new();
    let measure = |device: &str| {
        let how = format!("--quick --size 160x90 -q --device {device} -o .");
        dir.runs(&format!("bench generalisation SAMPLE {how}"));
        let masked = |line: &str| line.split(',').nth(2).unwrap().parse::<f64>().unwrap();
        let scores: Vec<f64> = dir.text("figures/generalisation-radius.csv").lines().skip(1).map(masked).collect();
        (scores, dir.text("results.json").contains("Device that drew and trained"))
    };
    let (on_cpu, on_gpu) = (measure("cpu"), measure("0"));
    assert!(!on_cpu.1 && on_gpu.1 && on_cpu.0.len() >= 4 && on_cpu.0 != on_gpu.0);
    assert!(on_gpu.0.iter().zip(&on_cpu.0).all(|(a, b)| (a - b).abs() < 0.02), "{on_gpu:?} {on_cpu:?}");
}

/// Rows of a table of `bench gpu`, by column header.
#[cfg(all(feature = "gpu", feature = "lab"))]
fn rows(report: &serde_json::Value, name: &str) -> Vec<serde_json::Value> {
    let table = report["tables"].as_array().unwrap().iter().find(|t| t["name"] == name);
    let table = table.unwrap_or_else(|| panic!("{name}: {report}"));
    let heads = table["columns"].as_array().unwrap();
    let value = |cell: &serde_json::Value| if cell.is_object() { cell["value"].clone() } else { cell.clone() };
    let row = |cells: &serde_json::Value| -> serde_json::Value {
        let cells = heads.iter().zip(cells.as_array().unwrap());
        cells
            .map(|(head, cell)| (head.as_str().unwrap().to_string(), value(cell)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    table["rows"].as_array().unwrap().iter().map(row).collect()
}

/// `bench gpu` fills every row with plausible numbers, and continues the published recipe with cached rows.
#[cfg(all(feature = "gpu", feature = "lab"))]
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn slow_a_gpu_is_measured_and_trains_in_pieces() {
    let dir = TestFolder::new();
    let piece =
        |minutes: &str| dir.says(&format!("bench gpu --quick -q --device 0 --training --minutes {minutes} -o ."));
    let first = piece("0.0005");
    let positive = |row: &serde_json::Value, names: &[&str]| {
        names.iter().for_each(|name| assert!(row[*name].as_f64().unwrap() > 0.0, "{name}: {row}"));
    };
    positive(&rows(&first, "gpu-rates")[0], &["copies, GB/s", "G atomic adds/s", "G float32 operations/s"]);
    assert!(!first["notes"].to_string().contains("Not measured"), "{first}");
    let of_law = |rows: &[serde_json::Value], law: &str| rows.iter().filter(|r| r["law"] == law).count();
    let (frames, training, particles) =
        (rows(&first, "gpu-frames"), rows(&first, "gpu-steps"), rows(&first, "gpu-particles"));
    assert_eq!([of_law(&frames, "optical-depth"), of_law(&frames, "alpha-blend"), frames.len()], [8, 4, 12]);
    assert_eq!([of_law(&training, "optical-depth"), of_law(&training, "alpha-blend"), training.len()], [2, 1, 3]);
    assert_eq!(particles.len(), 1);
    for row in frames.iter().chain(&training).chain(&particles) {
        positive(row, &["GB", "G ops"]);
        let pixels = row["pixels"].as_str().unwrap().split('x').map(|n| n.parse::<u64>().unwrap()).collect::<Vec<_>>();
        assert!(pixels.len() == 2 && pixels.iter().all(|n| *n > 0), "{row}");
        // The other law has no additions.
        assert_eq!(row["G adds"].as_f64().unwrap() > 0.0, row["law"] != "alpha-blend", "{row}");
    }
    let mut kernels = std::collections::BTreeMap::new();
    for row in rows(&first, "gpu-kernels") {
        *kernels.entry(row["of"].to_string()).or_insert(0) += 1;
    }
    // All rows have them, or none.
    assert!(kernels.is_empty() || kernels.len() == 12 + 3 + 1, "{kernels:?}");
    assert!(kernels.values().all(|n| *n > 2), "{kernels:?}");
    for row in &frames {
        positive(row, &["Gaussians", "frames/s", "frames/s, read back", "footprints", "radius, px"]);
    }
    for row in &training {
        positive(row, &["Gaussians", "steps/s", "footprints"]);
        let loss = |name: &str| row[name].as_f64().unwrap();
        assert!(loss("last loss") > 0.0 && loss("last loss") < loss("first loss"), "{row}");
    }
    positive(&particles[0], &["particles", "s per picture"]);
    // The recipe continues with the same particles; the rows come from the cache.
    let second = piece("5");
    assert_eq!((frames, training), (rows(&second, "gpu-frames"), rows(&second, "gpu-steps")));
    let number = |report: &serde_json::Value, name: &str| {
        rows(report, "gpu-recipe")[0][name].as_f64().unwrap_or_else(|| panic!("{report}"))
    };
    let [before, after] = [&first, &second].map(|report| number(report, "steps"));
    assert!(before < after && after == number(&second, "of"), "{before} {after}");
    let [before, after] = [&first, &second].map(|report| number(report, "s of all runs"));
    assert!(before > 0.0 && after > before);
    let [before, after] = [&first, &second].map(|report| number(report, "held out, masked PSNR, dB"));
    assert!(before > 5.0 && after >= before, "{before} {after}");
    assert_eq!(dir.json("results.json")["experiments"]["gpu"], second);
}

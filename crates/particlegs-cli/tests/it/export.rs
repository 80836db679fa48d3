//! Models for other viewers: what is written, read again by this program's own readers where it has some, and
//! held to the model. Others' readers are in tests/export.

use crate::common::{fails, listing, particlegs, sample, snapshot};
use crate::models::tiny;
use particlegs::camera::Normalisation;
use particlegs::codec::{self, Precision};
use particlegs::math::Sym3;
use particlegs::model::{LawKind, Mixture, Model};
use particlegs::particles::Particles;
use serde_json::Value;
use std::path::{Path, PathBuf};

const KINDS: [&str; 8] = ["ply", "glb", "gltf", "npy", "vti", "fits", "npz", "csv"];

/// A model of 64 Gaussians of the sample.
fn write(dir: &Path, law: LawKind) -> PathBuf {
    let particles = Particles::open_raw(&[sample()]).unwrap();
    let path = dir.join("m.pgs");
    std::fs::write(&path, codec::encode(&tiny(&particles, 0..64, law), &Precision::BALANCED).unwrap()).unwrap();
    path
}

/// A model of two layers with masses.
fn layers(dir: &Path) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-formats/tests/fixtures");
    let path = dir.join("layers.pgs");
    let mut c = particlegs();
    c.arg("compress").arg(fixtures.join("species.hdf5")).arg("-o").arg(&path);
    c.args(["--gaussians", "20", "--certificate", "none", "-q"]).assert().success();
    path
}

fn decode(path: &Path) -> Model {
    codec::decode(&std::fs::read(path).unwrap(), "file").unwrap()
}

fn export(model: &Path, out: &Path, more: &[&str]) -> assert_cmd::Command {
    let mut c = particlegs();
    c.arg("export").arg(model).arg("-o").arg(out).args(more);
    c
}

/// The result as JSON.
fn exported(model: &Path, out: &Path, more: &[&str]) -> Value {
    let mut c = export(model, out, more);
    let done = c.args(["-q", "--json", "-"]).assert().success();
    serde_json::from_slice(&done.get_output().stdout).unwrap()
}

fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

/// Numbers behind the head of a NumPy array.
fn npy(bytes: &[u8]) -> Vec<f32> {
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[head..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

/// The document of a binary glTF, and its data.
fn gltf(bytes: &[u8]) -> (Value, Vec<f32>) {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let document = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let data = bytes[28 + length..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    (document, data)
}

/// R S S R^T of deviations and a quaternion x, y, z, w.
fn covariance(s: &[f32], q: &[f32]) -> Sym3 {
    let [x, y, z, w] = [0, 1, 2, 3].map(|k| f64::from(q[k]));
    let columns = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    (0..3).fold(Sym3::default(), |sum, k| sum.add(&Sym3::outer(columns[k]).scale(f64::from(s[k]).powi(2))))
}

#[test]
fn every_kind_says_what_it_is_and_what_is_lost() {
    let dir = tempfile::tempdir().unwrap();
    let model = write(dir.path(), LawKind::OpticalDepth);
    for kind in KINDS {
        let out = dir.path().join(format!("out.{kind}"));
        let grid: &[&str] = if ["npy", "vti", "fits"].contains(&kind) { &["--grid", "16"] } else { &[] };
        let report = exported(&model, &out, grid);
        assert_eq!((report["kind"].as_str(), report["gaussians"].as_u64()), (Some(kind), Some(64)));
        let written = bytes(&out);
        assert_eq!(report["bytes"].as_u64(), Some(written.len() as u64), "{kind}");
        let lost = report["lost"][0].as_str().unwrap();
        // An array has no room for words: they are beside it.
        let said = if kind == "npy" { bytes(&dir.path().join("out.json")) } else { written.clone() };
        let said = match kind {
            // Codes of letters, and letters of four bytes.
            "vti" => {
                let text = String::from_utf8_lossy(&said).into_owned();
                let notes = text.split("Name=\"notes\"").nth(1).unwrap();
                let codes = notes.split('>').nth(1).unwrap().split('<').next().unwrap();
                codes.split(' ').map(|c| c.parse::<u8>().unwrap() as char).collect()
            }
            "npz" => said.iter().filter(|b| **b != 0).map(|b| *b as char).collect(),
            "fits" => {
                let head = String::from_utf8_lossy(&said[..2880 * 2]).into_owned();
                let cards: Vec<&str> = (0..head.len() / 80).map(|i| head[80 * i..80 * i + 80].trim_end()).collect();
                cards.join("").replace("COMMENT  ", "").replace("COMMENT ", "")
            }
            _ => String::from_utf8_lossy(&said).into_owned(),
        };
        let squeezed = |text: &str| text.split_whitespace().collect::<String>();
        assert!(squeezed(&said).contains(&squeezed(lost)), "{kind}: {lost}");
        assert!(said.contains("nbody64") && said.contains("optical-depth"), "{kind}");
        // To standard output, the same bytes.
        let printed = export(&model, Path::new("-"), &["--kind", kind, "-q"]).args(grid).assert().success();
        assert!(printed.get_output().stdout == written, "{kind}");
        // Whatever the threads and instructions.
        let again = dir.path().join(format!("again.{kind}"));
        export(&model, &again, &["--threads", "1", "-q"]).args(grid).env("PARTICLEGS_SIMD", "off").assert().success();
        assert!(bytes(&again) == written, "{kind}");
    }
    let help = particlegs().args(["export", "--help"]).output().unwrap();
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    for kind in KINDS {
        assert!(help.split("What is lost").nth(1).unwrap().contains(&format!(".{kind}")), "{kind}: {help}");
    }
}

/// Places come back through the readers of snapshots, in the frame that the file states.
#[test]
fn splats_come_back_where_they_were() {
    let dir = tempfile::tempdir().unwrap();
    for law in [LawKind::OpticalDepth, LawKind::AlphaBlend] {
        let path = write(dir.path(), law);
        let model = decode(&path);
        let (g, frame) = (&model.layers[0].content[0].gaussians, Normalisation::of(&model.metadata.bounds));
        for kind in ["ply", "glb"] {
            let (out, points) = (dir.path().join(format!("m.{kind}")), dir.path().join("points"));
            export(&path, &out, &["-q", "--force"]).assert().success();
            let mut convert = particlegs();
            convert.arg("convert").arg(&out).arg("-o").arg(&points).args(["-q", "--force"]).assert().success();
            let points = Particles::open_raw(&[points]).unwrap();
            assert_eq!(points.len(), 64);
            for i in 0..64 {
                let p = points.position(i);
                assert!((0..3).all(|k| (p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-4), "{kind}");
            }
        }
    }
}

/// The published numbers of an alpha-blend model, whichever command writes them.
#[test]
fn an_alpha_blend_model_is_written_as_published() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::AlphaBlend);
    let [a, b] = ["a.ply", "b.ply"].map(|n| dir.path().join(n));
    export(&path, &a, &["-q"]).assert().success();
    particlegs().arg("convert").arg(&path).arg("-o").arg(&b).arg("-q").assert().success();
    let body = |path: &Path| bytes(path)[bytes(path).len() - 64 * 68..].to_vec();
    assert_eq!(body(&a), body(&b));
    assert!(String::from_utf8_lossy(&bytes(&a)).contains("comment lost: the VizMapper"));
    // At another radius and opacity: what the network makes of them.
    let bent = dir.path().join("bent.npz");
    let ply = dir.path().join("bent.ply");
    export(&path, &ply, &["-q", "--radius", "0.05", "--opacity", "0.1"]).assert().success();
    assert_ne!(body(&a), body(&ply));
    fails(&mut export(&path, &bent, &["--radius", "0.05"]), 2, "--radius does nothing here");
    std::fs::remove_file(&ply).unwrap();
    let fixed = dir.path().join("fixed.pgs");
    let mut model = decode(&path);
    model.layers[0].content[0].gaussians.law.alpha_blend_mut().unwrap().vizmapper = None;
    std::fs::write(&fixed, codec::encode(&model, &Precision::BALANCED).unwrap()).unwrap();
    for option in ["--radius", "--opacity"] {
        fails(&mut export(&fixed, &ply, &[option, "0.5"]), 2, "has no VizMapper that follows it");
    }
    std::fs::remove_file(&fixed).unwrap();
    fails(&mut export(&path, &dir.path().join("c.vti"), &[]), 2, "an alpha-blend model has no density");
    assert_eq!(listing(dir.path()), ["a.ply", "b.ply", "m.pgs"]);
    // Opacities and grey levels are columns.
    let table = dir.path().join("t.csv");
    export(&path, &table, &["-q"]).assert().success();
    let text = String::from_utf8(bytes(&table)).unwrap();
    let own = &decode(&path).layers[0].content[0].gaussians.law;
    let rows: Vec<&str> = text.lines().skip_while(|l| l.starts_with('#')).collect();
    assert!(rows[0].ends_with("count,opacity,grey,layer"), "{}", rows[0]);
    for (row, opacity) in rows[1..].iter().zip(&own.alpha_blend().unwrap().opacity) {
        assert_eq!(row.split(',').nth(10).unwrap().parse::<f64>().unwrap(), *opacity);
    }
}

/// Attributes, in the units of the extension: deviations and opacities themselves.
#[test]
fn gltf_has_the_attributes_of_the_extension() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let [glb, text] = ["m.glb", "m.gltf"].map(|n| dir.path().join(n));
    for (out, more) in [(&glb, "0.2"), (&text, "0.2")] {
        export(&path, out, &["-q", "--radius", "0.1", "--opacity", more]).assert().success();
    }
    let (document, data) = gltf(&bytes(&glb));
    let model = decode(&path);
    let (g, frame) = (&model.layers[0].content[0].gaussians, Normalisation::of(&model.metadata.bounds));
    let primitive = &document["meshes"][0]["primitives"][0];
    assert_eq!(document["extensionsUsed"], serde_json::json!(["KHR_gaussian_splatting"]));
    let extension = &primitive["extensions"]["KHR_gaussian_splatting"];
    assert_eq!((&extension["kernel"], &extension["colorSpace"]), (&"ellipse".into(), &"srgb_rec709_display".into()));
    assert_eq!(primitive["mode"], 0);
    let array = |name: &str, width: usize| {
        let accessor = &document["accessors"][primitive["attributes"][name].as_u64().unwrap() as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize / 4;
        assert_eq!(view["byteLength"].as_u64().unwrap() as usize, 4 * 64 * width);
        &data[start..start + 64 * width]
    };
    let [places, turns, scales] =
        [("POSITION", 3), ("KHR_gaussian_splatting:ROTATION", 4), ("KHR_gaussian_splatting:SCALE", 3)]
            .map(|(name, width)| array(name, width));
    let opacities = array("KHR_gaussian_splatting:OPACITY", 1);
    assert!(array("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", 3).iter().all(|v| (v * 0.2820948 - 0.5).abs() < 1e-6));
    for i in 0..64 {
        let tau = -(-f64::from(opacities[i])).ln_1p();
        // Ein(tau) / (1 - exp(-tau)), the integral of (1 - exp(-t)) / t as a sum.
        let ein: f64 = (0..1000).map(|j| (j as f64 + 0.5) / 1000.0).map(|t| -(-tau * t).exp_m1() / (1000.0 * t)).sum();
        let flatter = ein / -(-tau).exp_m1();
        let want = g.cov_of(i).add(&Sym3::scaled_identity(0.01)).scale(flatter * frame.scale * frame.scale);
        let got = covariance(&scales[3 * i..], &turns[4 * i..]);
        assert!((0..6).all(|k| (got.0[k] - want.0[k]).abs() < 1e-5 * want.trace()), "{got:?} {want:?}");
        assert!(
            (0..3).all(|k| (f64::from(places[3 * i + k]) / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-4)
        );
        assert!((opacities[i] > 0.0) && opacities[i] < 1.0);
        // Twice the extremes of the depth over directions hold the mean.
        let wide = g.cov_of(i).add(&Sym3::scaled_identity(0.01)).eigen().values;
        let peak = |a: f64, b: f64| 0.9946 * 0.2 * g.count[i] * 0.01 / (a * b).sqrt();
        let (least, most) = (peak(wide[0], wide[1]), peak(wide[1], wide[2]));
        assert!(tau > 0.999 * least && tau < 1.001 * most, "{tau}: {least} to {most}");
    }
    // As text, the same document and the same numbers.
    let document_of_text: Value = serde_json::from_slice(&bytes(&text)).unwrap();
    assert_eq!(document_of_text["accessors"], document["accessors"]);
    let uri = document_of_text["buffers"][0]["uri"].as_str().unwrap();
    let length = document["buffers"][0]["byteLength"].as_u64().unwrap();
    assert_eq!(uri.len() as u64, "data:application/octet-stream;base64,".len() as u64 + length.div_ceil(3) * 4);
    assert_eq!(document_of_text["asset"]["extras"]["lost"], document["asset"]["extras"]["lost"]);
}

#[test]
fn density_keeps_the_mass_of_a_periodic_box_in_every_format() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let out = |name: &str| dir.path().join(name);
    let report = exported(&path, &out("d.npy"), &["--grid", "20"]);
    for name in ["d.vti", "d.fits"] {
        export(&path, &out(name), &["--grid", "20", "-q"]).assert().success();
    }
    let grid = &report["grid"];
    assert_eq!(
        (&grid["cells"], &grid["periodic"]),
        (&serde_json::json!([20, 20, 20]), &serde_json::json!([true, true, true]))
    );
    assert_eq!((grid["unit"].as_str(), grid["outside"].as_f64()), (Some("particles / (Mpc/h)^3"), Some(0.0)));
    let values = npy(&bytes(&out("d.npy")));
    let volume = 1.25f64.powi(3);
    let total: f64 = values.iter().map(|v| f64::from(*v) * volume).sum();
    assert!((total / 262_144.0 - 1.0).abs() < 1e-6, "{total}");
    assert!((grid["total"].as_f64().unwrap() / 262_144.0 - 1.0).abs() < 1e-6);
    assert!(values.iter().all(|v| v.is_finite() && *v > -1e-3));
    // The others have x as the fastest.
    let turned: Vec<f32> = (0..8000).map(|i| values[(i % 20 * 20 + i / 20 % 20) * 20 + i / 400]).collect();
    let vti = bytes(&out("d.vti"));
    let start = vti.windows(4).position(|w| w == b"raw\"").unwrap() + 6 + 8;
    let raw: Vec<u8> = turned.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert!(vti[start..start + 32_000] == raw[..]);
    let fits = bytes(&out("d.fits"));
    assert!(fits.len().is_multiple_of(2880));
    let raw: Vec<u8> = turned.iter().flat_map(|v| v.to_be_bytes()).collect();
    assert!(fits.windows(32_000).step_by(2880).any(|w| w == raw));
    let described: Value = serde_json::from_slice(&bytes(&out("d.json"))).unwrap();
    assert_eq!(described["density"]["cells"], grid["cells"]);
    assert_eq!(described["quantity"], "density");
    // Cells of a length: as many as fill the box.
    let of_side = exported(&path, &out("e.vti"), &["--cell", "1.2"]);
    assert_eq!(of_side["grid"]["cells"], serde_json::json!([21, 21, 21]));
    assert!((of_side["grid"]["cell"][0].as_f64().unwrap() - 25.0 / 21.0).abs() < 1e-12);
}

/// Without a box, what lies beyond the bounds is told.
#[test]
fn an_open_density_says_what_it_leaves_out() {
    let dir = tempfile::tempdir().unwrap();
    let columns: Vec<Vec<f32>> =
        (0..3u32).map(|k| (0..500).map(|i| (i * (37 + 14 * k) % 101) as f32 * 0.1).collect()).collect();
    let snap = dir.path().join("snap");
    snapshot(&snap, &columns);
    let path = dir.path().join("m.pgs");
    let mut c = particlegs();
    c.arg("compress").arg(&snap).arg("-o").arg(&path).args(["--gaussians", "8", "--certificate", "none", "-q"]);
    c.assert().success();
    let report = exported(&path, &dir.path().join("d.fits"), &["--grid", "16"]);
    let [total, outside] = ["total", "outside"].map(|k| report["grid"][k].as_f64().unwrap());
    assert!((total + outside - 500.0).abs() < 1e-3 && outside > 1.0, "{total} {outside}");
    assert_eq!(report["grid"]["unit"], "particles / length^3");
}

#[test]
fn tables_hold_the_gaussians_to_the_last_digit() {
    let dir = tempfile::tempdir().unwrap();
    let path = layers(dir.path());
    let model = decode(&path);
    let table = dir.path().join("t.csv");
    export(&path, &table, &["-q"]).assert().success();
    let text = String::from_utf8(bytes(&table)).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["x", "y", "z"]);
    assert_eq!(
        rows[0][3..],
        [
            "covariance_xx",
            "covariance_xy",
            "covariance_xz",
            "covariance_yy",
            "covariance_yz",
            "covariance_zz",
            "count",
            "mass",
            "layer"
        ]
    );
    let all: Vec<(&str, &Mixture, usize, f64)> = model
        .layers
        .iter()
        .flat_map(|l| l.content.iter().map(move |b| (l, &b.gaussians)))
        .flat_map(|(l, g)| (0..g.len()).map(move |i| (&l.name[..], g, i, l.mass.unit_or_one())))
        .collect();
    assert_eq!(rows.len() - 1, all.len());
    for (row, (layer, g, i, unit)) in rows[1..].iter().zip(&all) {
        let numbers: Vec<f64> = row[..11].iter().map(|v| v.parse().unwrap()).collect();
        let want = [&g.mean_of(*i)[..], &g.cov_of(*i).0, &[g.count[*i], unit * g.mass_of(*i)]].concat();
        assert_eq!((numbers, row[11]), (want, *layer));
    }
    // This program reads both tables as points.
    let archive = dir.path().join("t.npz");
    export(&path, &archive, &["-q"]).assert().success();
    for (file, more) in [(&table, &[][..]), (&archive, &["--positions", "mean"])] {
        let points = dir.path().join("points");
        let mut convert = particlegs();
        convert.arg("convert").arg(file).arg("-o").arg(&points).args(more).args(["-q", "--force", "--weights", "none"]);
        convert.assert().success();
        let points = Particles::open_raw(&[points]).unwrap();
        assert_eq!(points.len(), all.len());
        for (i, (_, g, own, _)) in all.iter().enumerate() {
            assert!((0..3).all(|k| (points.position(i)[k] - g.mean[k][*own]).abs() < 1e-5));
        }
    }
}

#[test]
fn layers_are_chosen_and_coloured() {
    let dir = tempfile::tempdir().unwrap();
    let path = layers(dir.path());
    let model = decode(&path);
    let names: Vec<&str> = model.layers.iter().map(|l| &l.name[..]).collect();
    assert_eq!(names.len(), 2);
    let glb = dir.path().join("m.glb");
    export(&path, &glb, &["-q", "--color", "layer"]).assert().success();
    let (document, _) = gltf(&bytes(&glb));
    let meshes: Vec<&str> =
        document["meshes"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(meshes, names);
    assert_eq!(document["asset"]["extras"]["colors"][names[0]], "#56b4e9");
    // Masses: gas and dark matter sum to the whole.
    let total = |layer: &str| {
        let out = dir.path().join(format!("{layer}.fits"));
        exported(&path, &out, &["--layer", layer, "--grid", "8"])["grid"]["total"].as_f64().unwrap()
    };
    let (all, parts) = (total("all"), names.iter().map(|n| total(n)).sum::<f64>());
    assert!((all / model.mass().unwrap() - 1.0).abs() < 1e-5 && (all / parts - 1.0).abs() < 1e-5, "{all} {parts}");
    // Colours by density follow the range that is asked for.
    let ply = dir.path().join("m.ply");
    let report = exported(&path, &ply, &["--color", "density", "--range", "1e-3,10", "--colormap", "viridis"]);
    assert_eq!(report["splats"]["color_range"], serde_json::json!([1e-3, 10.0]));
    let head = String::from_utf8_lossy(&bytes(&ply)).into_owned();
    assert!(head.contains("comment colours: viridis, logarithmic, from 0.001 to 10 mass / length^3"), "{head}");
    let out = dir.path().join("no.ply");
    fails(&mut export(&path, &out, &["--layer", "none"]), 2, "no layer `none`");
    fails(&mut export(&path, &out, &["--color", "density", "--range", "10,1"]), 2, "--range takes LO,HI");
    assert!(!out.exists());
}

#[test]
fn what_cannot_be_done_is_refused_before_the_work() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let out = |name: &str| dir.path().join(name);
    let refused = |name: &str, more: &[&str], code: i32, text: &str| {
        fails(&mut export(&path, &out(name), more), code, text);
        assert_eq!(listing(dir.path()), ["m.pgs"], "{name} {more:?}");
    };
    refused("splats", &[], 2, "its ending does not say");
    refused("points.hdf5", &[], 2, "its ending does not say");
    refused("a.ply", &["--kind", "csv"], 2, "its ending means ply");
    refused("a.npy", &["--grid", "0"], 2, "outside 1 to 65536");
    refused("a.npy", &["--grid", "70000"], 2, "outside 1 to 65536");
    refused("a.npy", &["--grid", "65536"], 7, "a density grid needs about");
    refused("a.vti", &["--cell", "1e-9"], 2, "more than 65536");
    for size in ["0", "-1", "nan", "inf"] {
        refused("a.fits", &[&format!("--cell={size}")], 2, "is not a length above 0");
    }
    for (option, values) in [("radius", ["0", "-1", "nan", "inf"]), ("opacity", ["0", "-1", "nan", "1.5"])] {
        for value in values {
            refused("a.ply", &[&format!("--{option}={value}")], 2, &format!("--{option}"));
        }
    }
    // Options that would do nothing.
    refused("a.npz", &["--radius", "1"], 2, "--radius does nothing here: it belongs to splats");
    refused("a.vti", &["--color", "layer"], 2, "--color does nothing here");
    refused("a.ply", &["--grid", "8"], 2, "--grid does nothing here: it belongs to density");
    refused("a.csv", &["--cell", "1"], 2, "--cell does nothing here");
    refused("a.ply", &["--colormap", "viridis"], 2, "--colormap does nothing here");
    // Extremes that are not out of range.
    for more in [["--radius", "1e-300"], ["--radius", "1e100"], ["--opacity", "1e-300"]] {
        let code = export(&path, &out("x.ply"), &["-q", "--force"]).args(more).output().unwrap().status.code();
        assert!(matches!(code, Some(0 | 2)), "{more:?}: {code:?}");
    }
}

/// An array and its description are one: neither is replaced, or written, without the other.
#[test]
fn an_array_and_its_description_stay_together() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let [array, description] = ["d.npy", "d.json"].map(|n| dir.path().join(n));
    std::fs::write(&description, "{\"mine\": 1}").unwrap();
    for force in [&[][..], &["--force"]] {
        fails(export(&path, &array, &["--grid", "8"]).args(force), 8, "is not the description of a density");
        assert!(!array.exists());
    }
    std::fs::remove_file(&description).unwrap();
    export(&path, &array, &["--grid", "8", "-q"]).assert().success();
    let first = [bytes(&array), bytes(&description)];
    export(&path, &array, &["--grid", "8", "-q"]).assert().success();
    fails(&mut export(&path, &array, &["--grid", "9"]), 8, "exists already");
    std::fs::remove_file(&array).unwrap();
    fails(&mut export(&path, &array, &["--grid", "9"]), 8, "exists already");
    assert!(!array.exists() && bytes(&description) == first[1]);
    export(&path, &array, &["--grid", "8", "-q", "--force"]).assert().success();
    assert_eq!([bytes(&array), bytes(&description)], first);
    // Standard output takes the array alone.
    let printed = export(&path, Path::new("-"), &["--kind", "npy", "--grid", "8", "-q"]).assert().success();
    assert_eq!(printed.get_output().stdout, first[0]);
}

/// The page holds the file as it is; it has no use for what changes splats and grids.
#[test]
fn a_page_holds_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let model = write(dir.path(), LawKind::OpticalDepth);
    let out = dir.path().join("page.html");
    export(&model, &out, &[]).assert().success();
    let html = std::fs::read_to_string(&out).unwrap();
    assert!(html.starts_with("<!doctype html>") && html.contains("id=\"model-0\"") && html.contains("m.pgs"));
    for options in [&["--layer", "particles"][..], &["--grid", "8"], &["--color", "density"], &["--radius", "1"]] {
        fails(&mut export(&model, &dir.path().join("other.html"), options), 2, options[0]);
    }
}

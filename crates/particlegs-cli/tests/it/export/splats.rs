//! Splats: PLY and glTF.

use super::{bytes, decode, export, exported, layers, write};
use crate::common::{fails, listing, particlegs};
use particlegs::camera::Normalisation;
use particlegs::codec::{self, Precision};
use particlegs::math::Sym3;
use particlegs::model::LawKind;
use particlegs::particles::Particles;
use serde_json::Value;
use std::path::Path;

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

/// Places come back through the readers of snapshots, in the frame that the file states.
#[test]
fn splats_come_back_where_they_were() {
    let dir = tempfile::tempdir().unwrap();
    for law in [LawKind::OpticalDepth, LawKind::AlphaBlend] {
        let path = write(dir.path(), law);
        let model = decode(&path);
        let (g, frame) = (&model.layers[0].content[0].gaussians, Normalisation::of(&model.metadata.bounds));
        // A PLY has y down, as published ones have.
        for (kind, signs) in [("ply", [-1.0, -1.0, 1.0]), ("glb", [1.0; 3])] {
            let (out, points) = (dir.path().join(format!("m.{kind}")), dir.path().join("points"));
            export(&path, &out, &["-q", "--force"]).assert().success();
            let mut convert = particlegs();
            convert.arg("convert").arg(&out).arg("-o").arg(&points).args(["-q", "--force"]).assert().success();
            let points = Particles::open_raw(&[points]).unwrap();
            assert_eq!(points.len(), 64);
            for i in 0..64 {
                let p = points.position(i);
                assert!(
                    (0..3).all(|k| (signs[k] * p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-4),
                    "{kind}"
                );
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

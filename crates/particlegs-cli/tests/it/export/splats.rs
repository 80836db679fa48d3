//! Splats: PLY and glTF.

use super::{exported, folder, layers};
use particlegs_core::camera::Normalisation;
use particlegs_core::codec;
use particlegs_core::codec::Precision;
use particlegs_core::math::Sym3;
use particlegs_core::model::LawKind;
use particlegs_particles::Particles;
use serde_json::Value;

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

/// The readers of snapshots find the same positions, in the frame that the file states.
#[test]
fn splats_keep_their_positions() {
    for law in [LawKind::OpticalDepth, LawKind::AlphaBlend] {
        let dir = folder(law);
        let model = dir.model("m.pgs");
        let (g, frame) = (&model.layers[0].content[0].gaussians, Normalisation::new(&model.metadata.bounds));
        // In a PLY y points down, as published.
        for (kind, signs) in [("ply", [-1.0, -1.0, 1.0]), ("glb", [1.0; 3])] {
            dir.runs(&format!("export m.pgs -o m.{kind} -q --force"));
            dir.runs(&format!("convert m.{kind} -o points -q --force"));
            let points = Particles::open_raw(&[dir.at("points")]).unwrap();
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

/// `export` and `convert` write the same published numbers of an alpha-blend model.
#[test]
fn an_alpha_blend_model_is_written_as_published() {
    let dir = folder(LawKind::AlphaBlend);
    let body = |bytes: &[u8]| bytes[bytes.len() - 64 * 68..].to_vec();
    let a = dir.makes("export m.pgs -o a.ply -q");
    assert_eq!(body(&a), body(&dir.makes("convert m.pgs -o b.ply -q")));
    assert!(String::from_utf8_lossy(&a).contains("comment lost: the VizMapper"));
    // Another radius and opacity, through the network.
    let bent = dir.makes("export m.pgs -o bent.ply -q --radius 0.05 --opacity 0.1");
    assert_ne!(body(&a), body(&bent));
    dir.fails("export m.pgs -o bent.npz --radius 0.05", 2, "--radius has no effect here");
    std::fs::remove_file(dir.at("bent.ply")).unwrap();
    let mut model = dir.model("m.pgs");
    model.layers[0].content[0].gaussians.law.alpha_blend_mut().unwrap().vizmapper = None;
    dir.write("fixed.pgs", codec::encode(&model, &Precision::BALANCED).unwrap());
    for option in ["--radius", "--opacity"] {
        let words = format!("export fixed.pgs -o bent.ply {option} 0.5");
        dir.fails(&words, 2, "has no VizMapper");
    }
    std::fs::remove_file(dir.at("fixed.pgs")).unwrap();
    dir.fails("export m.pgs -o c.vti", 2, "an alpha-blend model has no density");
    assert_eq!(dir.listing(), ["a.ply", "b.ply", "m.pgs"]);
    // Opacities and grey levels are columns.
    let text = String::from_utf8(dir.makes("export m.pgs -o t.csv -q")).unwrap();
    let law = &dir.model("m.pgs").layers[0].content[0].gaussians.law;
    let rows: Vec<&str> = text.lines().skip_while(|l| l.starts_with('#')).collect();
    assert!(rows[0].ends_with("count,opacity,grey,layer"), "{}", rows[0]);
    for (row, opacity) in rows[1..].iter().zip(&law.alpha_blend().unwrap().opacity) {
        assert_eq!(row.split(',').nth(10).unwrap().parse::<f64>().unwrap(), *opacity);
    }
}

/// Attributes, in the units of the extension: deviations and opacities themselves.
#[test]
fn gltf_has_the_attributes_of_the_extension() {
    let dir = folder(LawKind::OpticalDepth);
    let [glb, text] =
        ["m.glb", "m.gltf"].map(|out| dir.makes(&format!("export m.pgs -o {out} -q --radius 0.1 --opacity 0.2")));
    let (document, data) = gltf(&glb);
    let model = dir.model("m.pgs");
    let (g, frame) = (&model.layers[0].content[0].gaussians, Normalisation::new(&model.metadata.bounds));
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
        // The mean is within twice the extremes of the depth over directions.
        let wide = g.cov_of(i).add(&Sym3::scaled_identity(0.01)).eigen().values;
        let peak = |a: f64, b: f64| 0.9946 * 0.2 * g.count[i] * 0.01 / (a * b).sqrt();
        let (least, most) = (peak(wide[0], wide[1]), peak(wide[1], wide[2]));
        assert!(tau > 0.999 * least && tau < 1.001 * most, "{tau}: {least} to {most}");
    }
    // As text, the same document and the same numbers.
    let document_of_text: Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(document_of_text["accessors"], document["accessors"]);
    let uri = document_of_text["buffers"][0]["uri"].as_str().unwrap();
    let length = document["buffers"][0]["byteLength"].as_u64().unwrap();
    assert_eq!(uri.len() as u64, "data:application/octet-stream;base64,".len() as u64 + length.div_ceil(3) * 4);
    assert_eq!(document_of_text["asset"]["extras"]["lost"], document["asset"]["extras"]["lost"]);
}

#[test]
fn layers_are_chosen_and_coloured() {
    let dir = layers();
    let model = dir.model("layers.pgs");
    let names: Vec<&str> = model.layers.iter().map(|l| &l.name[..]).collect();
    assert_eq!(names.len(), 2);
    let (document, _) = gltf(&dir.makes("export layers.pgs -o m.glb -q --color layer"));
    let meshes: Vec<&str> =
        document["meshes"].as_array().unwrap().iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(meshes, names);
    assert_eq!(document["asset"]["extras"]["colors"][names[0]], "#56b4e9");
    // Masses: gas and dark matter sum to the whole.
    let total = |layer: &str| {
        let words = format!("layers.pgs -o {layer}.fits --layer {layer} --grid 8");
        exported(&dir, &words)["grid"]["total"].as_f64().unwrap()
    };
    let (all, parts) = (total("all"), names.iter().map(|n| total(n)).sum::<f64>());
    assert!((all / model.mass().unwrap() - 1.0).abs() < 1e-5 && (all / parts - 1.0).abs() < 1e-5, "{all} {parts}");
    // Colours by density follow the given range.
    let report = exported(&dir, "layers.pgs -o m.ply --color density --range 1e-3,10 --colormap viridis");
    assert_eq!(report["splats"]["color_range"], serde_json::json!([1e-3, 10.0]));
    let head = String::from_utf8_lossy(&dir.bytes("m.ply")).into_owned();
    assert!(head.contains("comment colours: viridis, logarithmic, from 0.001 to 10 mass / length^3"), "{head}");
    dir.fails("export layers.pgs -o no.ply --layer none", 2, "no layer `none`");
    dir.fails("export layers.pgs -o no.ply --color density --range 10,1", 2, "--range takes LO,HI");
    assert!(!dir.at("no.ply").exists());
}

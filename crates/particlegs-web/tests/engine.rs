//! Compares the engine's answers with the library, and checks the errors for invalid queries.

use particlegs_core::camera::{Camera, DensityView, Projection, View, base_distance, spherical_camera};
use particlegs_core::codec::{self, FieldPrecision, Precision, StoredSection};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::{Block, FieldMoments, Layer, Metadata, Model, Quantity, QuantityKind, Unit};
use particlegs_core::picture::{Gray8, Size, ValueColors, ValueScale, masked_psnr};
use particlegs_core::render::{FieldQuery, Scene, draw, field_map, mean_vector};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::splat::ToneStyle;
use particlegs_web::{Engine, EngineResponse};
use serde_json::{Value, json};

const MODEL: &[u8] = include_bytes!("../../particlegs-compress/tests/fixtures/format-1.0.pgs");
const SIZE: Size = Size { width: 64, height: 48 };

fn ask(engine: &mut Engine, question: &Value) -> EngineResponse {
    engine.ask(question.to_string().as_bytes())
}

fn error(answer: &EngineResponse) -> String {
    let said: Value = serde_json::from_str(&answer.json).unwrap();
    said["error"].as_str().unwrap_or_default().to_string()
}

/// An engine with the fixture, its default view, and the scene of that view.
fn opened() -> (Engine, View, Value) {
    let model = codec::decode(MODEL, "the model").unwrap();
    let m = &model.metadata;
    let camera = spherical_camera(m.bounds.center(), 20.0, 30.0, base_distance(&m.bounds, SIZE));
    let view = View { name: "view".into(), camera, radius: m.default_radius, opacity: m.default_opacity };
    let scene = json!({
        "size": SIZE, "radius": view.radius, "opacity": view.opacity,
        "camera": camera,
    });
    let mut engine = Engine::default();
    assert_eq!(error(&engine.open(MODEL.to_vec())), "");
    (engine, view, scene)
}

#[test]
fn its_picture_is_the_renderers() {
    let (mut engine, view, scene) = opened();
    let model = codec::decode(MODEL, "the model").unwrap();
    for style in ToneStyle::ALL {
        let paint = json!({ "look": style, "white": false });
        let answer = ask(&mut engine, &json!({ "ask": "picture", "scene": scene, "paint": paint }));
        let picture = draw(&Scene::new(&model), &view, SIZE, style, &Context::SILENT).unwrap();
        let greys: Vec<u8> = answer.numbers.chunks_exact(4).map(|p| p[0]).collect();
        assert!(greys == picture.data && greys.iter().any(|v| *v > 0), "{style:?}");
    }
}

#[test]
fn its_base_distance_and_scores_are_the_librarys() {
    let (mut engine, _, _) = opened();
    let bounds = codec::decode(MODEL, "the model").unwrap().metadata.bounds;
    let mut number = |question: Value, numbers: &[u8], key: &str| {
        let answer = engine.ask(&[question.to_string().as_bytes(), numbers].concat());
        assert_eq!(error(&answer), "");
        serde_json::from_str::<Value>(&answer.json).unwrap()[key].as_f64()
    };
    for size in [SIZE, Size { width: 9, height: 16 }] {
        let question = json!({ "ask": "base-distance", "size": size });
        assert_eq!(number(question, &[], "distance"), Some(base_distance(&bounds, size)));
    }
    let size = Size { width: 4, height: 1 };
    let [a, b] = [[0, 0, 3, 2], [255, 0, 0, 2]].map(|levels| Gray8 { size, data: levels.to_vec() });
    let score = |b: &Gray8| json!({ "ask": "score", "size": b.size });
    assert_eq!(number(score(&b), &[&a.data[..], &b.data].concat(), "masked_psnr"), masked_psnr(&a, &b));
    assert_eq!(number(score(&a), &[&a.data[..], &a.data].concat(), "masked_psnr"), None);
    assert_ne!(error(&ask(&mut engine, &score(&a))), "");
}

#[test]
fn a_sphere_and_a_clip_box_hold_all_there_is() {
    let (mut engine, _, mut scene) = opened();
    let count = codec::decode(MODEL, "the model").unwrap().metadata.count as f64;
    let sphere = ask(&mut engine, &json!({ "ask": "sphere", "center": [0, 0, 0], "radius": 1e9 }));
    let held: Value = serde_json::from_str(&sphere.json).unwrap();
    assert!((held["count"].as_f64().unwrap() / count - 1.0).abs() < 1e-9, "{held}");
    let values = |engine: &mut Engine, scene: &Value| {
        let answer = ask(engine, &json!({ "ask": "values", "scene": scene, "style": "depth" }));
        assert_eq!(error(&answer), "");
        answer.numbers.chunks_exact(4).map(|v| f64::from(f32::from_le_bytes(v.try_into().unwrap()))).sum::<f64>()
    };
    let whole = values(&mut engine, &scene);
    scene["clip"] = json!({ "min": [-1e9, -1e9, -1e9], "max": [1e9, 1e9, 1e9] });
    assert!((values(&mut engine, &scene) / whole - 1.0).abs() < 1e-6);
    scene["clip"] = json!({ "min": [1e8, 1e8, 1e8], "max": [1e9, 1e9, 1e9] });
    assert_eq!(values(&mut engine, &scene), 0.0);
}

/// The fixture, moved into a periodic box with these sides: the model and its file.
fn in_box(sides: [f64; 3]) -> (Model, Vec<u8>) {
    let mut model = codec::decode(MODEL, "the model").unwrap();
    let (from, corner) = (model.metadata.bounds, [3.0, -7.0, 0.5]);
    let to = Bounds { min: corner, max: each_axis(|k| corner[k] + sides[k]) };
    let by = each_axis(|k| sides[k] / from.extent()[k]);
    for block in model.layers.iter_mut().flat_map(|l| &mut l.content) {
        block.bounds = to;
        let m = &mut block.gaussians;
        for (k, by) in by.into_iter().enumerate() {
            m.mean[k].iter_mut().for_each(|x| *x = corner[k] + by * (*x - from.min[k]));
        }
        for (c, [i, j]) in [[0, 0], [0, 1], [0, 2], [1, 1], [1, 2], [2, 2]].into_iter().enumerate() {
            m.cov[c].iter_mut().for_each(|v| *v *= by[i] * by[j]);
        }
    }
    model.metadata.bounds = to;
    model.metadata.cell = Some(Cell { origin: corner, ..Cell::orthogonal(sides) });
    let file = codec::encode(&model, &Precision::BALANCED).unwrap();
    (codec::decode(&file, "the model").unwrap(), file)
}

#[test]
fn its_windows_hold_the_mass_of_boxes_of_any_shape() {
    let mut engine = Engine::default();
    let boxes = [[1.0, 1.0, 1.0], [2.0, 1.0, 0.5], [4.0, 2.0, 1.0], [0.3, 0.7, 5.0]];
    let sights =
        [[0.0, 0.0], [180.0, 0.0], [90.0, 0.0], [-90.0, 0.0], [0.0, 90.0], [0.0, -90.0], [30.0, 20.0], [-200.0, 65.0]];
    for (number, sides) in boxes.into_iter().enumerate() {
        let (model, file) = in_box(sides);
        assert_eq!(error(&engine.open(file)), "");
        let of_layer = |l: &Layer<Vec<Block>>| {
            let block_mass = |b: &Block| (0..b.gaussians.len()).map(|i| b.gaussians.mass_of(i)).sum::<f64>();
            l.mass.unit_or_one() * l.content.iter().map(block_mass).sum::<f64>()
        };
        let total: f64 = model.layers.iter().map(of_layer).sum();
        for (azimuth, elevation) in sights.map(Into::into) {
            for size in [[96, 54], [64, 64], [40, 90]] {
                let view = |center: [f64; 3], height: f64| {
                    let projection = Projection::Orthographic { height_world: height };
                    let camera = Camera { projection, ..spherical_camera(center, azimuth, elevation, 20.0) };
                    let size = json!({ "width": size[0], "height": size[1] });
                    json!({ "size": size, "radius": 0.01, "opacity": 0.05, "camera": camera })
                };
                let window_question = json!({ "ask": "window", "model": number, "scene": view([0.0; 3], 1.0) });
                let window: Value = serde_json::from_str(&ask(&mut engine, &window_question).json).unwrap();
                let center = serde_json::from_value(window["center"].clone()).unwrap();
                let height = window["height_world"].as_f64().unwrap();
                let values_question =
                    json!({ "ask": "values", "model": number, "scene": view(center, height), "style": "density" });
                let area = (height / f64::from(size[1])).powi(2);
                let mass = area
                    * ask(&mut engine, &values_question)
                        .numbers
                        .chunks_exact(4)
                        .map(|v| f64::from(f32::from_le_bytes(v.try_into().unwrap())))
                        .sum::<f64>();
                let off = mass / total - 1.0;
                // Pixels of 30 broad Gaussians are a few 1e-5 off in any window.
                assert!(off.abs() < 1e-4, "{sides:?} from {azimuth}, {elevation} in {size:?}: {off}");
            }
        }
    }
}

#[test]
fn what_makes_no_sense_is_an_error_and_the_engine_goes_on() {
    let (mut engine, _, scene) = opened();
    assert!(error(&engine.open(MODEL[..100].to_vec())).contains("the model"));
    assert!(error(&engine.ask(b"no question")).contains("invalid query"));
    let with = |change: &dyn Fn(&mut Value)| {
        let mut scene = scene.clone();
        change(&mut scene);
        json!({ "ask": "values", "scene": scene, "style": "density" })
    };
    let odd = [
        json!({ "ask": "values", "model": 7, "scene": scene, "style": "depth" }),
        json!({ "ask": "gaussian", "index": 1_000_000 }),
        json!({ "ask": "colors", "name": "mud", "white": false }),
        with(&|s| s["size"] = json!({ "width": 1_000_000, "height": 1_000_000 })),
        with(&|s| s["size"] = json!({ "width": 0, "height": 9 })),
        with(&|s| s["radius"] = json!(-1.0)),
        with(&|s| s["camera"]["view_up"] = json!([0, 0, 0])),
        with(&|s| s["camera"]["fov_deg"] = json!(400.0)),
    ];
    for question in odd {
        assert_ne!(error(&ask(&mut engine, &question)), "", "{question}");
    }
    let good = ask(&mut engine, &json!({ "ask": "strokes", "scene": scene, "style": "depth" }));
    assert!(error(&good).is_empty() && !good.numbers.is_empty() && good.numbers.len().is_multiple_of(32));
}

/// Without layers the picture is black in any style.
#[test]
fn a_model_without_a_shown_layer_is_black() {
    let (mut engine, _, mut scene) = opened();
    scene["layers"] = json!([false]);
    for by_layer in [false, true] {
        let paint = json!({ "look": "expected", "by_layer": by_layer });
        let answer = ask(&mut engine, &json!({ "ask": "picture", "scene": scene, "paint": paint }));
        assert_eq!(error(&answer), "");
        assert!(answer.numbers.chunks_exact(4).all(|p| p == [0, 0, 0, 255]));
    }
}

/// A probe returns the index in the file, also for clipped Gaussians and periodic images.
#[test]
fn what_is_seen_is_named_as_in_the_file() {
    let (mut engine, _, scene) = opened();
    let bounds = codec::decode(MODEL, "the model").unwrap().metadata.bounds;
    let middle = bounds.center();
    let mut cut = scene.clone();
    cut["clip"] = json!({ "min": bounds.min, "max": [bounds.max[0], bounds.max[1], middle[2]] });
    let mut named = 0;
    for scene in [&scene, &cut] {
        for (x, y) in (4..60).step_by(8).flat_map(|x| (4..44).step_by(8).map(move |y| (x, y))) {
            let answer = ask(&mut engine, &json!({ "ask": "probe", "scene": scene, "pixel": [x, y] }));
            let seen: Value = serde_json::from_str(&answer.json).unwrap();
            let Some(number) = seen["gaussian"].as_u64() else { continue };
            let answer = ask(&mut engine, &json!({ "ask": "gaussian", "index": number }));
            let gaussian: Value = serde_json::from_str(&answer.json).unwrap();
            let at = |v: &Value, k: usize| v[k].as_f64().unwrap();
            let far =
                (0..3).map(|k| (at(&seen["position"], k) - at(&gaussian["position"], k)).powi(2)).sum::<f64>().sqrt();
            let extent = gaussian["extent"].as_f64().unwrap();
            // A pixel is 0.12 world units wide.
            assert!(far < 8.0 * extent + 0.4, "{x} {y}: {far} from a Gaussian of {extent}");
            named += 1;
        }
    }
    assert!(named > 3, "{named}");
}

/// The fixture with a second layer of other particles, and a velocity that only the first has.
fn with_velocity() -> (Model, Vec<u8>) {
    let mut model = codec::decode(MODEL, "the model").unwrap();
    let mut other = Layer { name: "stars".into(), ..model.layers[0].clone() };
    other.content.truncate(1);
    other.content[0].gaussians.mean[0].iter_mut().for_each(|x| *x += 1.0);
    model.layers.push(other);
    model.metadata.count += model.layers[1].count();
    model.metadata.mass *= 2.0;
    let unit = Some(Unit { text: "km/s".into(), si: None });
    let velocity = Quantity {
        name: "velocity".into(),
        kind: QuantityKind::Vector,
        unit,
        bytes: 12,
        by_mass: false,
        logarithmic: false,
        extensive: false,
    };
    let fields = vec![velocity];
    let file = codec::encode(&model, &Precision::BALANCED).unwrap();
    let mut layers = codec::coded_layers(&file, "the model").unwrap();
    let decoded = codec::decode(&file, "the model").unwrap();
    for (block, stored) in decoded.layers[0].content.iter().zip(&mut layers[0].content) {
        let (m, mut field) = (&block.gaussians, FieldMoments::new(3));
        field.range = vec![[-1e3, 1e3]; 3];
        for i in 0..m.len() {
            let mean = m.mean_of(i);
            let values = [100.0 * mean[1].sin() + 40.0, 50.0 * mean[0].cos(), 80.0 * mean[2].sin()];
            (0..3).for_each(|k| field.mean[k].push(values[k]));
            (0..3).for_each(|k| (0..3).for_each(|a| field.slope[k][a].push(if k == a { 5.0 } else { 0.0 })));
            [900.0, 0.0, 0.0, 400.0, 0.0, 100.0].into_iter().zip(&mut field.spread).for_each(|(v, s)| s.push(v));
        }
        let sum = |k: usize| (0..m.len()).map(|i| m.count[i] * field.mean[k][i]).sum::<f64>();
        let sums = [sum(0), sum(1), sum(2)];
        let bytes = codec::encode_field((0, &fields[0]), &field, m, &sums, &FieldPrecision::default(), None);
        stored.sections.push(StoredSection { tag: codec::FIELD, bytes });
    }
    let file = codec::assemble(&Metadata { fields, ..decoded.metadata }, None, layers).unwrap();
    (codec::decode(&file, "the model").unwrap(), file)
}

#[test]
fn its_maps_of_a_field_are_the_renderers_and_name_layers_without_it() {
    let (model, file) = with_velocity();
    let (mut engine, view, mut scene) = opened();
    let opened: Value = serde_json::from_str(&engine.open(file).json).unwrap();
    assert_eq!(opened["about"]["fields"][0]["maps"][0]["name"], "velocity.los", "{opened}");
    assert_eq!(opened["about"]["fields"][0]["unit"], "km s⁻¹");
    let mut query = FieldQuery::new("velocity.los", &model.metadata.fields).unwrap();
    query.bulk = mean_vector(&model.layers, "velocity");
    let density = DensityView::of_view(&view, &model.metadata.bounds);
    let map = field_map(&Scene::new(&model), &query, &density, SIZE, &Context::SILENT).unwrap();
    let range = ValueScale::Signed.range(&map.values).unwrap();
    let colors = ValueColors { scale: ValueScale::Signed, range, map: None };
    let wanted = colors.image(&map.values, Some(&map.density), true).data;
    let field = json!({ "name": "velocity.los", "bulk": true, "scale": "", "shade": true });
    let paint = json!({ "white": true, "field": field });
    let picture_question = json!({ "ask": "picture", "model": 1, "scene": scene, "paint": paint });
    let answer = ask(&mut engine, &picture_question);
    let said: Value = serde_json::from_str(&answer.json).unwrap();
    assert_eq!(said, json!({ "range": range, "scale": "signed", "without": ["stars"] }));
    assert!(answer.numbers.chunks_exact(4).zip(&wanted).all(|(a, b)| a[..3] == *b));
    let values_question = json!({ "ask": "values", "model": 1, "scene": scene, "style": "density", "field": field });
    let values = |answer: &EngineResponse| -> Vec<f32> {
        answer.numbers.chunks_exact(4).map(|v| f32::from_le_bytes(v.try_into().unwrap())).collect()
    };
    let same = |a: &f32, b: &f64| a.to_bits() == (*b as f32).to_bits();
    assert!(values(&ask(&mut engine, &values_question)).iter().zip(&map.values.data).all(|(a, b)| same(a, b)));
    // A box around all changes nothing; layers without the field are the background.
    scene["clip"] = json!({ "min": [-1e9, -1e9, -1e9], "max": [1e9, 1e9, 1e9] });
    let clipped_question = json!({ "ask": "values", "model": 1, "scene": scene, "style": "density", "field": field });
    assert!(values(&ask(&mut engine, &clipped_question)).iter().zip(&map.values.data).all(|(a, b)| same(a, b)));
    scene["layers"] = json!([false, true]);
    let layer_question = json!({ "ask": "picture", "model": 1, "scene": scene, "paint": paint });
    assert!(ask(&mut engine, &layer_question).numbers.iter().all(|v| *v == 255));
    let unknown = json!({ "white": true, "field": { "name": "heat", "bulk": false, "scale": "", "shade": false } });
    let unknown_question = json!({ "ask": "picture", "model": 1, "scene": scene, "paint": unknown });
    assert!(error(&ask(&mut engine, &unknown_question)).contains("no field `heat`"));
}

/// Against the law at a place (docs/law/fields.md).
#[test]
fn a_probe_gives_the_fields_mean_and_dispersion() {
    let (model, file) = with_velocity();
    let (mut engine, _, mut scene) = opened();
    engine.open(file);
    let mut probe = |scene: &Value| -> Value {
        let seen = |pixel: [u32; 2]| -> Value {
            let question = json!({ "ask": "probe", "model": 1, "scene": scene, "pixel": pixel });
            serde_json::from_str(&ask(&mut engine, &question).json).unwrap()
        };
        (0..64)
            .flat_map(|x| (0..48).map(move |y| [x, y]))
            .map(seen)
            .find(|seen| seen["number_density"].as_f64() > Some(1e-3))
            .unwrap()
    };
    scene["layers"] = json!([true, false]);
    let seen = probe(&scene);
    let at = each_axis(|k| seen["in_box"][k].as_f64().unwrap());
    let (mut total, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for block in &model.layers[0].content {
        let (m, field) = (&block.gaussians, block.gaussians.fields.get("velocity").unwrap());
        for i in 0..m.len() {
            let offset = each_axis(|k| at[k] - m.mean[k][i]);
            let Some(inverse) = m.cov_of(i).inverse() else { continue };
            let weight = m.count[i] * inverse.det().sqrt() * (-0.5 * inverse.quadratic(offset)).exp();
            let value = field.mean_at(0, i, offset);
            total += weight;
            sum += weight * value;
            squares += weight * (value * value + field.spread[0][i]);
        }
    }
    let (mean, field) = (sum / total, &seen["fields"][0]);
    let near = |a: &Value, b: f64| (a.as_f64().unwrap() / b - 1.0).abs() < 1e-6;
    assert!(
        near(&field["mean"][0], mean) && near(&field["dispersion"][0], (squares / total - mean * mean).sqrt()),
        "{field}"
    );
    let length_of = |key: &str| field[key].as_array().unwrap().len();
    assert!(field["name"] == "velocity" && length_of("mean") == 4 && length_of("dispersion") == 4);
    scene["layers"] = json!([false, true]);
    assert_eq!(probe(&scene)["fields"][0]["mean"], json!([]));
}

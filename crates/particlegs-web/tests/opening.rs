//! Models that are decoded in several steps: pictures during decoding, and the final picture.

use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::codec::{self, Encoder, Precision};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{Block, Layer, Mass, Mixture, Model};
use particlegs_core::picture::Size;
use particlegs_core::render::{Scene, draw};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_web::{Engine, EngineResponse};
use serde_json::{Value, json};

const FIXTURE: &[u8] = include_bytes!("../../particlegs-compress/tests/fixtures/format-1.0.pgs");
const SIZE: Size = Size { width: 64, height: 64 };
const GAUSSIANS: u64 = 200_000;
const EDGE: f64 = 10.0;

/// Random Gaussians in a box, in one block with several segments.
fn model() -> Model {
    let mut gaussians = Mixture::new(false);
    for i in 0..GAUSSIANS {
        let mut r = Random::new(3, 0, i);
        let mean = each_axis(|_| EDGE * r.uniform());
        gaussians.push(mean, Sym3::scaled_identity(1e-3 * (0.2 + r.uniform())), 8.0, 8.0);
    }
    let count = 8 * GAUSSIANS;
    let bounds = Bounds { min: [0.0; 3], max: [EDGE; 3] };
    let mut metadata = codec::decode(FIXTURE, "the fixture").unwrap().metadata;
    (metadata.count, metadata.mass, metadata.bounds, metadata.cell) = (count, count as f64, bounds, None);
    metadata.default_radius = 0.02;
    let block = Block { bounds, count, mass: count as f64, gaussians };
    let layers = vec![Layer { name: "all".into(), mass: Mass::Unknown, content: vec![block] }];
    Model { metadata, layers, certificate: None }
}

/// The default view of the model and its scene, complete or during decoding.
fn view(coarse: bool) -> (View, Value) {
    let bounds = Bounds { min: [0.0; 3], max: [EDGE; 3] };
    let camera = spherical_camera(bounds.center(), 0.0, 0.0, base_distance(&bounds, SIZE));
    let view = View { name: "view".into(), camera, radius: 0.02, opacity: 0.05 };
    let scene = json!({
        "size": SIZE, "radius": view.radius, "opacity": view.opacity, "coarse": coarse,
        "camera": camera,
    });
    (view, scene)
}

fn said(answer: &EngineResponse) -> Value {
    serde_json::from_str(&answer.json).unwrap()
}

fn ask(engine: &mut Engine, question: Value) -> EngineResponse {
    engine.ask(question.to_string().as_bytes())
}

fn step(engine: &mut Engine) -> Value {
    said(&ask(engine, json!({ "ask": "decode" })))
}

/// Grey levels of the default view.
fn picture(engine: &mut Engine, coarse: bool) -> Vec<u8> {
    let question = json!({ "ask": "picture", "scene": view(coarse).1, "paint": { "look": "expected" } });
    let answer = ask(engine, question);
    assert_eq!(said(&answer)["error"], Value::Null);
    answer.numbers.chunks_exact(4).map(|p| p[0]).collect()
}

fn mean(levels: impl Iterator<Item = u8> + Clone) -> f64 {
    levels.clone().map(f64::from).sum::<f64>() / levels.count() as f64
}

#[test]
fn a_picture_of_the_whole_box_is_there_before_the_last_step() {
    let file = codec::encode(&model(), &Precision::BALANCED).unwrap();
    let mut engine = Engine::default();
    let opened = said(&engine.open(file.clone()));
    assert_eq!(opened["about"]["gaussians"], GAUSSIANS);
    let mut decoded = vec![opened["decoded"].as_f64().unwrap()];
    let mut pictures = vec![picture(&mut engine, true)];
    while *decoded.last().unwrap() < 1.0 {
        decoded.push(step(&mut engine)["decoded"].as_f64().unwrap());
        pictures.push(picture(&mut engine, true));
    }
    assert!(decoded.len() >= 4 && decoded.is_sorted() && decoded[0] < 0.5, "{decoded:?}");
    assert_eq!(step(&mut engine)["decoded"], 1.0);
    // Each quarter has about its final brightness; boxes extend slightly beyond the whole.
    let full = picture(&mut engine, false);
    for (number, early) in pictures.iter().enumerate() {
        for (right, below) in [(false, false), (false, true), (true, false), (true, true)] {
            let quarter = |levels: &[u8]| {
                let inside = move |i: &usize| (i % 64 >= 32) == right && (i / 64 >= 32) == below;
                mean((0..64 * 64).filter(inside).map(|i| levels[i]).collect::<Vec<_>>().into_iter())
            };
            let (now, then) = (quarter(early), quarter(&full));
            assert!(then > 20.0 && (now / then - 1.0).abs() < 0.2, "step {number}: {now} for {then}");
        }
    }
    // The final picture is the same, bit for bit.
    let whole = codec::decode(&file, "the model").unwrap();
    let expected = draw(&Scene::new(&whole), &view(false).0, SIZE, ToneStyle::Expected, &Context::SILENT).unwrap();
    assert!(full == expected.data);
}

#[test]
fn what_needs_all_of_a_model_decodes_it() {
    let file = codec::encode(&model(), &Precision::BALANCED).unwrap();
    let whole = codec::decode(&file, "the model").unwrap();
    let mut engine = Engine::default();
    assert!(said(&engine.open(file))["decoded"].as_f64().unwrap() < 1.0);
    let held = said(&ask(&mut engine, json!({ "ask": "sphere", "center": [5, 5, 5], "radius": 1e9 })));
    assert!((held["count"].as_f64().unwrap() / whole.metadata.count as f64 - 1.0).abs() < 1e-9, "{held}");
    assert_eq!(step(&mut engine)["decoded"], 1.0);
}

/// A corrupt stream with a valid checksum is found during decoding; every later query reports it.
#[test]
fn a_model_that_turns_out_to_be_corrupt_says_so_once_and_for_all() {
    let model = model();
    let good = Encoder::new(&model.layers[0].content[0]).unwrap().encode(&Precision::BALANCED);
    let bad = (0..good.len()).rev().step_by(999).find_map(|at| {
        let mut bad = good.clone();
        bad[at] ^= 0x55;
        codec::decode_block(&bad, "the block").is_err().then_some(bad)
    });
    let layers = vec![model.layers[0].with(vec![bad.unwrap().into()])];
    let file = codec::assemble(&model.metadata, None, layers).unwrap();
    for at_once in [false, true] {
        let mut engine = Engine::default();
        let opened = said(&engine.open(file.clone()));
        assert!(opened["decoded"].as_f64().unwrap() < 1.0, "{opened}");
        let error = match at_once {
            true => said(&ask(&mut engine, json!({ "ask": "gaussian", "index": 0 }))),
            false => (0..10).map(|_| step(&mut engine)).find(|s| s["error"].is_string()).unwrap(),
        };
        let line = error["error"].as_str().unwrap();
        assert!(line.contains("block at byte") && !line.contains('\n'), "{line}");
        let question = json!({ "ask": "values", "scene": view(true).1, "style": "depth" });
        for again in [step(&mut engine), said(&ask(&mut engine, question))] {
            assert_eq!(again["error"], line);
        }
        assert_eq!(said(&engine.open(FIXTURE.to_vec()))["decoded"], 1.0);
    }
}

//! `verify`: honest models, frames and fields are intact, and forged ones are told.

use crate::common::TestFolder;
use crate::forged::{file_of, sections};
use particlegs_core::codec;
use particlegs_core::codec::{CodedFrame, FieldPrecision, FrameCoding, SeriesClock, SeriesFile};
use particlegs_core::math::Random;
use particlegs_core::model::{FieldMoments, Metadata};
use std::path::Path;

const COUNT: usize = 3000;

fn write(folder: &Path, name: &str, value: impl Fn(u64) -> f64) {
    let bytes: Vec<u8> = (0..COUNT as u64).flat_map(|i| (value(i) as f32).to_le_bytes()).collect();
    std::fs::write(folder.join(name).with_extension("f32"), bytes).unwrap();
}

/// Clouds that drift, with a velocity, a temperature, and a density over decades.
fn snapshot(folder: &Path, frame: usize) {
    std::fs::create_dir_all(folder).unwrap();
    let random = |i: u64, k: u64| Random::new(3 + k, 0, i).normal();
    for (k, axis) in [(0, "x"), (1, "y"), (2, "z")] {
        let centre = move |i: u64| ((i % 6) * (k + 2)) as f64 * 1.3 % 8.0 + 1.0 + 0.05 * frame as f64;
        write(folder, &format!("{axis}{axis}"), |i| centre(i) + 0.3 * random(i, k));
        write(folder, &format!("v{axis}"), |i| 100.0 * (centre(i) - 5.0) + 10.0 * random(i, 5 + k));
    }
    write(folder, "temperature", |i| 1e4 + 1e3 * (i % 6) as f64 + 50.0 * random(i, 9));
    write(folder, "rho", |i| (1.5 * (i % 6) as f64 + 0.3 * random(i, 10)).exp());
    let redshift = 1.0 / (0.5 + 0.05 * frame as f64) - 1.0;
    let about = format!(r#"{{"box": 10, "length_unit": "Mpc/h", "redshift": {redshift}}}"#);
    std::fs::write(folder.join("meta.json"), about).unwrap();
}

/// Frames of four snapshots, with `options`.
fn series(dir: &TestFolder, name: &str, options: &str) -> Vec<u8> {
    (0..4).for_each(|frame| snapshot(&dir.at(&format!("snap-{frame}")), frame));
    let fit = "--gaussians 40 --effort fast --keyframe-interval 2 --radius 0.02 --quiet";
    dir.makes(&format!("series snap-0 snap-1 snap-2 snap-3 -o {name} {fit} {options}"))
}

fn frames_of(file: &[u8]) -> (SeriesClock, String, Vec<Option<CodedFrame>>) {
    let series = SeriesFile::read(file, "run").unwrap();
    let frame = |i: usize| {
        let keyframe = series.frames[i].kind == FrameCoding::Keyframe;
        let bytes = series.frame_bytes(i).ok()?.to_vec();
        Some(CodedFrame { time: series.frames[i].time, keyframe, bytes })
    };
    (series.clock, series.recipe.clone(), (0..series.frames.len()).map(frame).collect())
}

#[test]
fn every_frame_of_a_series_is_intact() {
    let dir = TestFolder::new();
    let file = series(&dir, "run.pgs", "--fields velocity,temperature --certificate quick");
    let [text, said] = dir.runs("verify run.pgs");
    assert!(text.contains("a series of 4 frames, 2 of them keyframes; each was decoded"), "{text}");
    assert!(said.contains("frame 3 of 4 is read"), "{said}");
    for frame in 0..4 {
        let [text, _] = dir.runs(&format!("verify run.pgs snap-{frame} --frame {frame}"));
        assert!(text.contains("measured again") && !text.contains("differs"), "{text}");
    }
    // The snapshot tells its frame.
    let [_, said] = dir.runs("verify run.pgs snap-1");
    assert!(said.contains("frame 1 of 4 is compared with the snapshot"), "{said}");
    assert_eq!(dir.says("verify run.pgs snap-2 --quiet")["frame"], 2);
    dir.fails("verify run.pgs snap-1 --frame 2", 3, "it is not the snapshot that run.pgs, frame 2 of 4 was made from");
    // Where the last is missing, the last that is there is taken.
    let (clock, recipe, mut frames) = frames_of(&file);
    frames[3] = None;
    dir.write("gap.pgs", codec::assemble_series(clock, &recipe, &frames).unwrap());
    for words in ["verify gap.pgs", "extract gap.pgs -o m.pgs", "render gap.pgs -o p.png --size 32x24"] {
        let [_, said] = dir.runs(words);
        assert!(said.contains("frame 2 of 4 is read") && said.contains("missing"), "{words}: {said}");
    }
}

#[test]
fn keyframes_alone_are_measured_unless_a_certificate_is_asked_for() {
    let dir = TestFolder::new();
    let file = series(&dir, "run.pgs", "");
    let measured = |name: &str| {
        let bytes = dir.bytes(name);
        let series = SeriesFile::read(&bytes, "run").unwrap();
        (0..4).map(|i| series.certificate(i).unwrap().is_some()).collect::<Vec<bool>>()
    };
    assert_eq!(measured("run.pgs"), [true, false, true, false]);
    let [text, _] = dir.runs("verify run.pgs");
    assert!(text.contains("each was decoded") && text.contains("certificate: none in the file"), "{text}");
    let [text, _] = dir.runs("verify run.pgs snap-1");
    assert!(text.contains("measured now, not stored in the file"), "{text}");
    let [_, said] = dir.runs("info run.pgs --frame 1");
    assert!(said.contains("frame 1 has no certificate"), "{said}");
    series(&dir, "all.pgs", "--certificate quick");
    series(&dir, "none.pgs", "--certificate none");
    assert_eq!([measured("all.pgs"), measured("none.pgs")], [vec![true; 4], vec![false; 4]]);
    dir.runs("verify all.pgs");
    // A keyframe that lost its certificate is told.
    let (clock, recipe, mut frames) = frames_of(&file);
    frames[2] = frames_of(&dir.bytes("none.pgs")).2[2].clone();
    dir.write("less.pgs", codec::assemble_series(clock, &recipe, &frames).unwrap());
    dir.fails(
        "verify less.pgs",
        4,
        "frame 2 of 4: corrupt model file: it has no certificate, but the series says that it has one",
    );
}

#[test]
fn a_broken_frame_and_an_index_that_contradicts_its_frames_are_named() {
    let dir = TestFolder::new();
    let file = series(&dir, "run.pgs", "--certificate none");
    let other = series(&dir, "other.pgs", "--certificate none --seed 5");
    let (clock, recipe, frames) = frames_of(&file);
    let encode =
        |clock, recipe: &str, frames: &[Option<CodedFrame>]| codec::assemble_series(clock, recipe, frames).unwrap();
    let altered = |alter: &dyn Fn(&mut Vec<Option<CodedFrame>>)| {
        let mut all = frames.clone();
        alter(&mut all);
        encode(clock, &recipe, &all)
    };
    let times: Vec<f64> = frames.iter().flatten().map(|f| f.time).collect();
    let numbered = |all: &mut Vec<Option<CodedFrame>>, times: &[f64]| {
        all.iter_mut().flatten().zip(times).for_each(|(frame, time)| frame.time = *time);
    };
    let by_number = altered(&|all| numbered(all, &[0.0, 1.0, 2.0, 3.0]));
    let mut of_number = sections(&by_number);
    of_number[0].1[0] = 0;
    let mut no_json = sections(&file);
    no_json[1].1 = b"{\"model\": ".to_vec();
    let mut moved_sections = sections(&file);
    let length = no_json[1].1.len() as i64 - moved_sections[1].1.len() as i64;
    for entry in no_json[0].1[5..].chunks_mut(25) {
        let place = i64::from_le_bytes(entry[9..17].try_into().unwrap()) + length;
        entry[9..17].copy_from_slice(&place.to_le_bytes());
    }
    let last = moved_sections[2].1.len() - 1;
    moved_sections[2].1[last] ^= 1;
    let cases = [
        ("a broken frame", file_of(&file, &moved_sections), "frame 0 of 4"),
        ("another time", altered(&|all| all[1].as_mut().unwrap().time += 0.01), "frame 1 of 4"),
        ("another last time", altered(&|all| all[3].as_mut().unwrap().time += 0.01), "frame 3 of 4"),
        ("another clock", file_of(&file, &of_number), "the clock of the index is the frame"),
        ("no recipe", file_of(&file, &no_json), "the recipe of the series"),
        ("another recipe", encode(clock, &recipe.replace("\"seed\":42", "\"seed\":7"), &frames), "but the series says"),
        ("fewer keyframes", encode(clock, &recipe.replace("interval\":2", "interval\":1"), &frames), "one every 1"),
        (
            "exchanged groups",
            altered(&|all| {
                all.rotate_left(2);
                numbered(all, &times);
            }),
            "frame 0 of 4",
        ),
        (
            "exchanged changes",
            altered(&|all| {
                all.swap(1, 3);
                numbered(all, &times);
            }),
            "frame 1 of 4",
        ),
        ("a keyframe of another series", altered(&|all| all[2] = frames_of(&other).2[2].clone()), "frame 2 of 4"),
    ];
    for (name, bytes, message) in cases {
        dir.write("f.pgs", bytes);
        let out = dir.command("verify f.pgs").output().unwrap();
        let stderr = crate::common::said(&out);
        assert!(out.status.code() == Some(4) && stderr.contains(message), "{name}: {stderr}");
    }
}

/// A file whose field `number` is coded of other moments and sums.
fn with_field(file: &[u8], number: u8, alter: impl Fn(&mut FieldMoments, &mut Vec<f64>)) -> Vec<u8> {
    let model = codec::decode(file, "m").unwrap();
    let quantity = &model.metadata.fields[usize::from(number)];
    let mut layers = codec::coded_layers(file, "m").unwrap();
    for (layer, model_layer) in layers.iter_mut().zip(&model.layers) {
        for (stored, block) in layer.content.iter_mut().zip(&model_layer.content) {
            let g = &block.gaussians;
            let mut field = g.fields.get(&quantity.name).unwrap().clone();
            let sum = |c: usize| (0..g.len()).map(|i| g.count[i] * field.overall_value(c, i, &g.cov_of(i))).sum();
            let mut sums = (0..field.components()).map(sum).collect();
            alter(&mut field, &mut sums);
            let bytes = codec::encode_field((number, quantity), &field, g, &sums, &FieldPrecision::default(), None);
            let section = stored.sections.iter_mut().find(|s| s.tag == codec::FIELD && s.bytes[0] == number);
            section.unwrap().bytes = bytes;
        }
    }
    codec::assemble(&model.metadata, model.certificate.as_ref(), layers).unwrap()
}

#[test]
fn forged_fields_are_told() {
    let dir = TestFolder::new();
    snapshot(&dir.at("snap"), 0);
    let fit = "--gaussians 40 --effort fast --blocks 2 --radius 0.02 --fields velocity,temperature,rho -q";
    let file = dir.makes(&format!("compress snap -o m.pgs {fit}"));
    let [text, _] = dir.runs("verify m.pgs snap");
    assert!(!text.contains("differs"), "{text}");
    let model = codec::decode(&file, "m").unwrap();
    let times = |by: f64| {
        move |f: &mut FieldMoments, sums: &mut Vec<f64>| {
            let slopes = f.slope.iter_mut().flatten();
            f.mean.iter_mut().chain(slopes).flatten().for_each(|v| *v *= by);
            f.spread.iter_mut().flatten().for_each(|v| *v *= by * by);
            f.range.iter_mut().flatten().for_each(|v| *v *= by);
            sums.iter_mut().for_each(|v| *v *= by);
        }
    };
    let listed = |alter: &dyn Fn(&mut Metadata)| {
        let mut metadata = model.metadata.clone();
        alter(&mut metadata);
        codec::assemble(&metadata, model.certificate.as_ref(), codec::coded_layers(&file, "m").unwrap()).unwrap()
    };
    let without = |blocks: usize, all: bool| {
        let mut layers = codec::coded_layers(&file, "m").unwrap();
        for block in layers[0].content.iter_mut().take(blocks) {
            block.sections.retain(|s| s.tag == codec::CORRELATION || !all && s.bytes[0] != 1);
            block.sections.retain(|s| s.tag != codec::CORRELATION);
        }
        codec::assemble(&model.metadata, model.certificate.as_ref(), layers).unwrap()
    };
    let exchanged = {
        let mut layers = codec::coded_layers(&file, "m").unwrap();
        let sections: Vec<_> = layers[0].content.iter().map(|b| b.sections.clone()).collect();
        layers[0].content.iter_mut().zip(sections.into_iter().rev()).for_each(|(block, other)| block.sections = other);
        codec::assemble(&model.metadata, model.certificate.as_ref(), layers)
    };
    let cases = [
        ("velocities times 10", with_field(&file, 0, times(10.0))),
        ("velocities a thousandth off", with_field(&file, 0, times(1.001))),
        ("sums a thousandth off", with_field(&file, 1, |_, sums| sums[0] *= 1.001)),
        ("sums of logarithms a thousandth off", with_field(&file, 2, |_, sums| sums[0] *= 1.001)),
        ("wider extremes", with_field(&file, 0, |f, _| f.range[1][1] *= 1.5)),
        ("a larger least value", with_field(&file, 1, |f, _| f.range[0][0] += 1.0)),
        ("colder", with_field(&file, 0, |f, _| f.spread.iter_mut().flatten().for_each(|v| *v *= 0.5))),
        ("turned", with_field(&file, 0, |f, _| f.slope.iter_mut().flatten().flatten().for_each(|v| *v = -*v))),
        ("weighted by mass", listed(&|m| m.fields[0].by_mass = true)),
        ("a sum", listed(&|m| m.fields[1].extensive = true)),
        ("another unit", listed(&|m| m.fields[1].bytes = 8)),
        ("no field", without(2, true)),
        ("without a field", without(2, false)),
        ("without fields in a block", without(1, true)),
        ("without a field in a block", without(1, false)),
    ];
    let cases = cases.into_iter().chain(exchanged.ok().map(|file| ("blocks exchanged", file)));
    for (name, bytes) in cases {
        dir.write("f.pgs", bytes);
        for full in if name.ends_with("times 10") { &["", "--full"][..] } else { &[""] } {
            let out = dir.command(&format!("verify f.pgs snap -q {full}")).output().unwrap();
            let code = out.status.code();
            assert!(
                code == Some(9) || code == Some(4) && name.contains("blocks"),
                "{name}: {}",
                crate::common::said(&out)
            );
        }
        let info = dir.runs("info f.pgs")[0].contains("incomplete");
        assert_eq!(info, name.starts_with("no") || name.starts_with("without"), "{name}");
    }
    // What explains nothing does not hold.
    dir.write("f.pgs", with_field(&file, 0, times(10.0)));
    let _ = dir.command("verify f.pgs snap -q --json f.json").output().unwrap();
    let verdict = dir.json("f.json")["verdict"].clone();
    let velocity = verdict.as_array().unwrap().iter().find(|f| f["why"].as_str().unwrap().starts_with("velocity"));
    assert_eq!(velocity.unwrap()["word"], "poor", "{verdict}");
}

/// A series of gaps takes no more memory than its bytes justify.
#[test]
#[cfg(target_os = "linux")]
fn frames_that_are_missing_take_little() {
    let dir = TestFolder::new();
    series(&dir, "run.pgs", "--certificate none");
    let (clock, recipe, mut frames) = frames_of(&dir.bytes("run.pgs"));
    frames.resize(1 << 18, None);
    dir.write("gaps.pgs", codec::assemble_series(clock, &recipe, &frames).unwrap());
    for words in ["info gaps.pgs", "info gaps.pgs --csv", "info gaps.pgs --json -", "verify gaps.pgs"] {
        let out = crate::common::limited(&dir, 256, words);
        assert_eq!(out.status.code(), Some(0), "{words}: {}", crate::common::said(&out));
    }
}

//! The rows of tests/options/cases.json: what the library refuses, notes and verifies. `python/tests/test_options.py`
//! runs the same rows through the command and the Python package.

use particlegs::evaluation::EvaluationViews;
use particlegs::haloes::{HaloOptions, find_haloes};
use particlegs::job::Job;
use particlegs::metadata::{Bounds, Effort, Goal, GoalKind, Target};
use particlegs::pictures::ViewOptions;
use particlegs::stats::{StatsOptions, Subject, compare};
use particlegs::training::{Config, Preset};
use particlegs::{
    Choice, CompressOptions, Context, ExportOptions, Model, NamedValue, Outputs, ProgressSink, RecoverOptions, Result,
    Selection, SeriesOptions, Size, Snapshot, compress, make_series, merge,
};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

#[derive(Default)]
struct NoteSink(Mutex<Vec<String>>);

impl ProgressSink for NoteSink {
    fn message(&self, text: &str) {
        self.0.lock().unwrap().extend(text.strip_prefix("note: ").map(String::from));
    }
}

/// The options of a row, each taken once: one that nobody takes is unknown.
struct RowOptions(BTreeMap<String, Value>);

impl RowOptions {
    fn number(&mut self, name: &str) -> Option<f64> {
        self.0.remove(name).and_then(|v| v.as_f64())
    }

    fn count(&mut self, name: &str) -> Option<u64> {
        self.0.remove(name).and_then(|v| v.as_u64())
    }

    fn named<T: NamedValue>(&mut self, name: &str) -> Option<T> {
        self.0.remove(name).map(|v| T::from_name(v.as_str().unwrap()).unwrap())
    }

    fn list(&mut self, name: &str) -> Vec<String> {
        self.0.remove(name).map_or_else(Vec::new, |v| serde_json::from_value(v).unwrap())
    }

    fn target(&mut self) -> Target {
        let goal = |kind, asked: Option<f64>, at: Option<f64>| {
            asked.zip(at).map(|(asked, at)| Target::Goal(Goal { kind, asked, at }))
        };
        let targets = [
            self.number("ratio").map(Target::Ratio),
            self.count("size").map(Target::Size),
            self.count("size-total").map(Target::Size),
            self.count("gaussians").map(Target::Gaussians),
            self.number("psnr").map(Target::Psnr),
            goal(GoalKind::PowerSpectrum, self.number("max-pk-error"), self.number("k-max")),
            goal(GoalKind::Correlation, self.number("min-correlation"), self.number("cell")),
            goal(GoalKind::Groups, self.number("groups-within"), self.number("from")),
        ];
        targets.into_iter().flatten().next().unwrap_or(Target::Default)
    }

    /// A record of options, by the names that they have in Python.
    fn record<T: serde::de::DeserializeOwned>(self) -> T {
        let named = self.0.into_iter().map(|(name, value)| (name.replace('-', "_"), value));
        serde_json::from_value(named.collect()).unwrap()
    }

    fn finish(self) {
        assert!(self.0.is_empty(), "no test sets the options {:?}", self.0);
    }
}

fn root(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
}

fn snapshot(input: Option<&str>) -> Snapshot {
    let columns = |names: [&str; 3]| names.map(|name| root("samples/nbody64").join(format!("{name}.f32"))).to_vec();
    let paths = match input {
        Some("another snapshot") => columns(["yy", "xx", "zz"]),
        _ => vec![root("samples/nbody64")],
    };
    let crop = (input == Some("a region")).then_some(Bounds { min: [0.0; 3], max: [12.5, 25.0, 25.0] });
    let selection = Some(Selection { crop, ..Selection::one_in(16) });
    Snapshot::open_with(&paths, Choice { selection, ..Choice::default() }).unwrap()
}

fn small_model() -> Model {
    let options = CompressOptions { effort: Effort::Fast, ..CompressOptions::gaussians(60) };
    compress(&snapshot(None), &options, &Context::default()).unwrap()
}

fn run(verb: &str, row: &Value, model: &Model, folder: &Path, context: &Context<'_>) -> Result<()> {
    let mut given = RowOptions(serde_json::from_value(row["options"].clone()).unwrap());
    let (outputs, input) = (Outputs::new(true), row["input"].as_str());
    match verb {
        "compress" => {
            let options = CompressOptions {
                size_with_fields: given.0.contains_key("size-total"),
                target: given.target(),
                radius: given.number("radius"),
                opacity: given.number("opacity"),
                blocks: given.count("blocks").map(|n| n as u32),
                memory: given.count("memory"),
                fields: given.list("fields"),
                training: given.named::<Preset>("train").map(|preset| Config::preset(preset, Default::default())),
                effort: given.named("effort").unwrap_or_default(),
                certificate: given.named("certificate").unwrap_or(CompressOptions::default().certificate),
                seed: given.count("seed").unwrap_or(42),
                sharing: given
                    .0
                    .remove("share-gaussians")
                    .map(|v| v.as_str().unwrap().parse().unwrap())
                    .unwrap_or_default(),
                ..CompressOptions::default()
            };
            given.finish();
            compress(&snapshot(input), &options, context)?;
        }
        "plan" => {
            let options = CompressOptions {
                target: given.target(),
                opacity: given.number("opacity"),
                blocks: given.count("blocks").map(|n| n as u32),
                fields: given.list("fields"),
                ..CompressOptions::default()
            };
            given.finish();
            Job::plan(&snapshot(input), &folder.join("planned"), &options, &outputs, context)?;
        }
        "scatter" | "block" => {
            let options = CompressOptions { blocks: Some(2), ..CompressOptions::gaussians(50) };
            let job = Job::plan(&snapshot(None), &folder.join("job"), &options, &outputs, &Context::default())?;
            let number = given.count("number").unwrap();
            given.finish();
            match verb {
                "scatter" => _ = job.scatter(number, context)?,
                _ => _ = job.block(number, context)?,
            }
        }
        "render" => {
            let size: [usize; 2] = given.0.remove("size").map_or([32, 32], |v| serde_json::from_value(v).unwrap());
            let size = Size { width: size[0], height: size[1] };
            let width = given.number("width");
            let options = ViewOptions {
                azimuth: given.number("azimuth").unwrap_or(0.0),
                elevation: given.number("elevation").unwrap_or(0.0),
                distance: given.number("distance").unwrap_or(1.0),
                radius: given.number("radius"),
                opacity: given.number("opacity"),
                depth: given.number("depth"),
                orthographic: width.is_some(),
                width,
                size: Some(size),
                ..ViewOptions::default()
            };
            given.finish();
            model.render(&model.view(&options)?, size, context)?;
        }
        "series" => {
            let frames = given.0.remove("frames").map(|text| text.as_str().unwrap().parse()).transpose()?;
            let mut options = SeriesOptions { frames, ..SeriesOptions::default() };
            options.keyframe_interval =
                given.count("keyframe-interval").map_or(options.keyframe_interval, |n| n as usize);
            options.compress = CompressOptions {
                target: given.target(),
                opacity: given.number("opacity"),
                ..CompressOptions::default()
            };
            given.finish();
            let choice = Choice::default();
            make_series(&[root("samples/nbody64")], &choice, &folder.join("run.pgs"), &options, context)?;
        }
        "merge" => {
            let fields = Some(given.list("fields")).filter(|names| !names.is_empty());
            given.finish();
            merge(&[model, model], fields, context)?;
        }
        "convert" => {
            given.finish();
            let out = folder.join(row["output"].as_str().unwrap());
            snapshot(None).convert(&out, (None, None), &outputs, context)?;
        }
        "eval" => {
            let frames = given.count("frames").unwrap() as usize;
            given.finish();
            let views = EvaluationViews::Orbits { frames, size: Size { width: 32, height: 32 }, seed: 42 };
            model.evaluate(&[], &snapshot(None), views, None, context)?;
        }
        "simplify" => {
            let target = given.target();
            given.finish();
            model.simplify(target, context)?;
        }
        "recover" => {
            let layers = given.list("layers");
            let options = RecoverOptions {
                particles: given.count("particles"),
                method: given.named("method").unwrap_or_default(),
                scale: given.number("scale").unwrap_or(1.0),
                seed: given.count("seed").unwrap_or(42),
                ..RecoverOptions::default()
            };
            given.finish();
            model.clone().recover_into(&folder.join("drawn"), (&options, &layers), &outputs, context)?;
        }
        "export" => {
            let (out, layers) = (folder.join(row["output"].as_str().unwrap()), given.list("layers"));
            let mut options = ExportOptions {
                kind: given.named("kind"),
                fields: given.list("fields"),
                color: given.named("color").unwrap_or_default(),
                radius: given.number("radius"),
                opacity: given.number("opacity"),
                layers: layers.clone(),
                ..ExportOptions::default()
            };
            options.opening.layers = layers;
            if let Some(cells) = given.count("cells") {
                options.cells = particlegs::Cells::Along(cells as usize);
            }
            given.finish();
            model.export(&out, &options, &outputs, context)?;
        }
        "verify" => {
            let full = given.0.remove("full").is_some();
            given.finish();
            let altered = Model::open(root("tests/options/altered.pgs"))?;
            let model = if row["model"] == "altered" { &altered } else { model };
            let source = input.map(|input| snapshot(Some(input)));
            let verified = model.verify(source.as_ref(), (full, 42), context)?;
            assert_eq!(row["certificate"], verified.model.certificate, "{row}");
            let (expected, wrong) = (row["wrong"].as_str(), verified.judge().err().map(|e| e.to_string()));
            assert_eq!(expected.is_some(), wrong.is_some(), "{row}: {wrong:?}");
            assert!(expected.is_none_or(|text| wrong.as_ref().unwrap().contains(text)), "{row}: {wrong:?}");
        }
        "haloes" => {
            find_haloes(Subject::Model(model.decoded()), &given.record::<HaloOptions>(), context)?;
        }
        "stats" => {
            let particles = snapshot(None).particles(context)?;
            let sides = [Subject::Particles(&particles), Subject::Model(model.decoded())];
            compare(sides[0], sides[1], &given.record::<StatsOptions>(), context)?;
        }
        other => panic!("no verb {other}"),
    }
    Ok(())
}

#[test]
fn rows_are_refused_and_noted_as_the_table_says() {
    let table = std::fs::read(root("tests/options/cases.json")).unwrap();
    let table: BTreeMap<String, Vec<Value>> = serde_json::from_slice(&table).unwrap();
    let (folder, model, mut differing) = (tempfile::tempdir().unwrap(), small_model(), Vec::new());
    for (verb, row) in table.iter().flat_map(|(verb, rows)| rows.iter().map(move |row| (verb, row))) {
        let notes = NoteSink::default();
        let done = run(verb, row, &model, folder.path(), &Context::default().with_sink(&notes));
        let notes = notes.0.into_inner().unwrap();
        let error = done.err().map(|e| e.to_string());
        let refused = row["error"].as_str().map_or(error.is_none(), |text| error.iter().any(|e| e.contains(text)));
        let noted = row["notes"].as_array().is_none_or(|expected| {
            let same = expected.iter().zip(&notes).all(|(text, note)| note.contains(text.as_str().unwrap()));
            same && expected.len() == notes.len()
        });
        if !(refused && noted) {
            differing.push(format!("{verb} {row}: {error:?}, {notes:?}"));
        }
    }
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}

/// Writes tests/options/altered.pgs: a model whose certificate says another correlation than was measured.
#[test]
#[ignore = "writes a fixture"]
fn write_altered_model() {
    let model = small_model();
    let mut certificate = *model.certificate().unwrap();
    certificate.density.correlation -= 0.1;
    model.with_certificate(Some(&certificate)).unwrap().save(root("tests/options/altered.pgs")).unwrap();
}

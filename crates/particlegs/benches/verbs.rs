//! Speed of the library's verbs on the bundled sample (262 144 particles), and on a file of clumps with a velocity:
//! `cargo bench -p particlegs --bench verbs`.

use divan::Bencher;
use particlegs::camera::DensityView;
use particlegs::haloes::{HaloOptions, find_haloes};
use particlegs::input::FrameChoice;
use particlegs::metadata::{CertificateLevel, Effort};
use particlegs::prelude::*;
use particlegs::stats::Subject;
use particlegs::{Choice, Outputs, Series, SeriesOptions, make_series};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const SIZE: Size = Size { width: 1920, height: 1080 };

fn main() {
    divan::main();
}

fn snapshot() -> Snapshot {
    Snapshot::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")).expect("the sample")
}

fn options(certificate: CertificateLevel) -> CompressOptions {
    CompressOptions { certificate, ..CompressOptions::ratio(300.0) }
}

/// A model of 10 000 Gaussians.
fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    let options = CompressOptions {
        effort: Effort::Fast,
        certificate: CertificateLevel::Quick,
        ..CompressOptions::gaussians(10_000)
    };
    MODEL.get_or_init(|| compress(&snapshot(), &options, &Context::default()).expect("a model"))
}

/// `compress` at its defaults, and without its certificate: the difference is the certificate's.
#[divan::bench(args = ["without certificate", "default"], sample_count = 3)]
fn compress_sample(bencher: Bencher, certificate: &str) {
    let level = if certificate == "default" { CertificateLevel::Quick } else { CertificateLevel::None };
    bencher.bench(|| compress(&snapshot(), &options(level), &Context::default()).expect("a model"));
}

/// What the certificate says, measured again.
#[divan::bench(args = ["quick", "full"], sample_count = 3)]
fn certificate(bencher: Bencher, level: &str) {
    let (model, snapshot, full) = (model(), snapshot(), level == "full");
    bencher.bench(|| model.verify(Some(&snapshot), (full, 42), &Context::default()).expect("a certificate"));
}

/// A picture of 1920x1080 pixels and its PNG.
#[divan::bench(args = ["paraview", "paraview-no-fxaa", "expected", "density"], sample_count = 10)]
fn draw(bencher: Bencher, style: &str) {
    let (model, context) = (model(), Context::default());
    let folder = tempfile::tempdir().expect("a folder");
    let (view, path) = (model.orbit(30.0, 20.0, SIZE), folder.path().join("picture.png"));
    let map = model.whole_view(SIZE).expect("a view");
    let tone = match style {
        "paraview" => ToneStyle::Paraview,
        "paraview-no-fxaa" => ToneStyle::ParaviewNoFxaa,
        _ => ToneStyle::Expected,
    };
    bencher.bench(|| match style {
        "density" => model.density_map(&map, SIZE, &context).expect("a map").save_png(&path),
        _ => model.render_as(tone, &view, SIZE, &context).expect("a picture").save_png(&path),
    });
}

/// An XYZ file of clumps with velocities, in a box of edge 10, at a moment.
fn write_clumps(path: &Path, time: f64) -> PathBuf {
    let wave = |i: u64, k: u64| ((i * k % 9973) as f64 / 9973.0 - 0.5).powi(3) * 4.0;
    let row = |i: u64| {
        let place = [(7, 2.0), (11, 5.0), (13, 8.0)].map(|(k, at)| at + time + wave(i, k) + (i % 3) as f64 * 0.3);
        format!("A {} {} {} {} 0 1\n", place[0], place[1], place[2], wave(i, 17))
    };
    let rows: String = (0..50_000).map(row).collect();
    let head = format!("Lattice=\"10 0 0 0 10 0 0 0 10\" Properties=species:S:1:pos:R:3:velo:R:3 Time={time}");
    std::fs::write(path, format!("50000\n{head}\n{rows}")).expect("a file");
    path.to_path_buf()
}

/// The mean velocity along the lines of sight, of all and of a slab of a tenth of the box.
#[divan::bench(args = ["whole", "slab"], sample_count = 10)]
fn field_map(bencher: Bencher, part: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let clumps = Snapshot::open(write_clumps(&folder.path().join("clumps.xyz"), 0.0)).expect("the file");
    let options = CompressOptions {
        effort: Effort::Fast,
        certificate: CertificateLevel::None,
        fields: vec!["velo".into()],
        ..CompressOptions::gaussians(2000)
    };
    let model = compress(&clumps, &options, &Context::default()).expect("a model");
    let size = Size { width: 512, height: 512 };
    let mut view: DensityView = model.whole_view(size).expect("a view");
    if part == "slab" {
        view.camera.clipping_range = view.camera.clipping_range.map(|[near, far]| {
            let (middle, depth) = (0.5 * (near + far), 0.1 * (far - near));
            [middle - 0.5 * depth, middle + 0.5 * depth]
        });
    }
    bencher.bench(|| model.field_map("velo.los", &view, size, &Context::default()).expect("a map"));
}

/// Two frames made, and the second read: a keyframe and a change.
#[divan::bench(args = ["make two frames", "read a change"], sample_count = 3)]
fn series(bencher: Bencher, step: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let snapshots = [write_clumps(&at("a.xyz"), 0.0), write_clumps(&at("b.xyz"), 0.02)];
    let compress = CompressOptions { certificate: CertificateLevel::None, ..CompressOptions::gaussians(1000) };
    let options = SeriesOptions { compress, replace: true, ..SeriesOptions::default() };
    let make = || {
        make_series(&snapshots, &Choice::default(), &at("run.pgs"), &options, &Context::default()).expect("a series")
    };
    if step == "make two frames" {
        return bencher.bench_local(make);
    }
    make();
    let bytes = std::fs::read(at("run.pgs")).expect("the series");
    bencher.bench(|| {
        let series = Series::from_bytes(bytes.clone(), "run.pgs").expect("a series");
        series.model(&FrameChoice::Number(1), &Context::default()).expect("a frame")
    });
}

/// A catalogue of haloes, of particles and of a model.
#[divan::bench(args = ["particles", "model"], sample_count = 3)]
fn haloes(bencher: Bencher, source: &str) {
    let context = Context::default();
    let particles = snapshot().particles(&context).expect("the sample");
    let subject = if source == "model" { Subject::Model(model().decoded()) } else { Subject::Particles(&particles) };
    bencher.bench(|| find_haloes(subject, &HaloOptions::default(), &context).expect("a catalogue"));
}

/// A model file of 10 000 Gaussians: read, simplified to half, drawn from, exported as a page.
#[divan::bench(args = ["decode", "simplify", "recover", "page"], sample_count = 5)]
fn file(bencher: Bencher, verb: &str) {
    let (model, context) = (model(), Context::default());
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    bencher.bench(|| match verb {
        "decode" => drop(Model::from_bytes(model.bytes().to_vec(), "bench").expect("a model")),
        "simplify" => {
            drop(model.simplify(particlegs::metadata::Target::Gaussians(5000), &context).expect("a model"));
        }
        "recover" => drop(model.recover(&RecoverOptions::default(), &context).expect("particles")),
        _ => drop(model.export(&page, &Default::default(), &Outputs::new(true), &context).expect("a page")),
    });
}

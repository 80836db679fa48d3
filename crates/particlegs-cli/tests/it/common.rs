//! Helpers of the end-to-end tests: commands and their folders, signals, and models made without a fit.

use assert_cmd::Command;
use particlegs_core::codec;
use particlegs_core::codec::Precision;
use particlegs_core::math::Sym3;
use particlegs_core::model::{
    AlphaBlend, Block, Certificate, Law, LawKind, Layer, Mass, Metadata, Mixture, Model, VIZMAPPER_PARAMETERS,
    VizMapper, VizRanges,
};
use particlegs_core::space::Bounds;
use particlegs_particles::Particles;
use serde_json::Value;
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::{Arc, Mutex, OnceLock};

/// The binary under test.
pub fn particlegs() -> Command {
    Command::cargo_bin("particlegs").expect("the binary is built")
}

/// The binary as a background process.
pub fn process(folder: &Path) -> std::process::Command {
    let mut c = std::process::Command::new(assert_cmd::cargo::cargo_bin("particlegs"));
    c.current_dir(folder);
    c
}

/// The bundled snapshot.
pub fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")
}

/// A file of `particlegs-formats/tests`, by default of its `fixtures`.
pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-formats/tests/fixtures").join(name)
}

/// Words of a command line. SAMPLE, FIXTURES and GOLDEN (VTK's pictures of the sample and their views) are replaced by
/// those folders.
pub fn words(text: &str) -> Vec<OsString> {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../particlegs-reference/tests/golden/nbody64");
    let places = [("SAMPLE", sample()), ("FIXTURES", fixture("")), ("GOLDEN", golden)];
    let word = |w: &str| {
        let place = places.iter().find_map(|(name, place)| Some((place, w.strip_prefix(name)?)));
        place.map_or(w.into(), |(place, rest)| place.join(rest.trim_start_matches('/')).into_os_string())
    };
    text.split_whitespace().map(word).collect()
}

/// A temporary folder, and commands that run in it.
pub struct TestFolder(tempfile::TempDir);

impl TestFolder {
    pub fn new() -> Self {
        TestFolder(tempfile::tempdir().unwrap())
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.at(name), content).unwrap();
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        let path = self.at(name);
        std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).unwrap()
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.bytes(name)).unwrap()
    }

    pub fn model(&self, name: &str) -> Model {
        codec::decode(&self.bytes(name), name).unwrap()
    }

    /// Its files, sorted.
    pub fn listing(&self) -> Vec<String> {
        listing(self.path())
    }

    pub fn command(&self, text: &str) -> Command {
        let mut c = particlegs();
        c.current_dir(self.path()).args(words(text));
        c
    }

    /// Runs a command that must succeed; returns standard output and standard error.
    pub fn runs(&self, text: &str) -> [String; 2] {
        success(&mut self.command(text))
    }

    /// Runs a command that must succeed; returns its JSON.
    pub fn says(&self, text: &str) -> Value {
        json(&mut self.command(text))
    }

    /// Runs a command that must succeed; returns the bytes of its `-o` file.
    pub fn makes(&self, text: &str) -> Vec<u8> {
        self.runs(text);
        self.bytes(output(text))
    }

    /// The file that a command makes; it runs once for all tests with this name.
    pub fn once(&self, text: &str) -> Vec<u8> {
        type Made = Mutex<HashMap<String, Arc<OnceLock<Vec<u8>>>>>;
        static MADE: OnceLock<Made> = OnceLock::new();
        let cell = Arc::clone(MADE.get_or_init(Mutex::default).lock().unwrap().entry(text.into()).or_default());
        let bytes = cell.get_or_init(|| self.makes(text));
        self.write(output(text), bytes);
        bytes.clone()
    }

    /// As [`fails`].
    pub fn fails(&self, text: &str, code: i32, error: &str) {
        fails(&mut self.command(text), code, error);
    }
}

/// The argument of `-o`.
fn output(text: &str) -> &str {
    let behind = text.split_once("-o ").expect("an output").1;
    behind.split(' ').next().unwrap()
}

/// Runs a command that must succeed; returns standard output and standard error.
pub fn success(command: &mut Command) -> [String; 2] {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", said(&out));
    [out.stdout, out.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

/// Runs a command that must succeed; returns its JSON.
pub fn json(command: &mut Command) -> Value {
    serde_json::from_str(&success(command.args(["--json", "-"]))[0]).unwrap()
}

/// Standard error of a command.
pub fn said(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

/// Lines of an error.
pub fn errors(text: &str) -> usize {
    text.lines().filter(|l| l.starts_with("error:")).count()
}

/// A model's file with another certificate.
pub fn recertified(file: &[u8], change: impl FnOnce(&mut Certificate)) -> particlegs_core::Result<Vec<u8>> {
    let model = codec::decode(file, "m").unwrap();
    let mut certificate = model.certificate.unwrap();
    change(&mut certificate);
    codec::assemble(&model.metadata, Some(&certificate), codec::coded_layers(file, "m").unwrap())
}

/// Writes raw columns into a new folder.
pub fn snapshot(folder: &Path, columns: &[Vec<f32>]) {
    std::fs::create_dir_all(folder).unwrap();
    for (name, column) in ["xx.f32", "yy.f32", "zz.f32", "ww.f32"].iter().zip(columns) {
        let bytes: Vec<u8> = column.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

/// A folder with a few particles on a spiral, and a model of them.
pub fn spiral() -> TestFolder {
    let dir = TestFolder::new();
    let along = |f: fn(f32) -> f32| (0..3000).map(|i| f(i as f32 / 3000.0)).collect::<Vec<f32>>();
    let columns = [along(|t| (19.0 * t).cos() * t), along(|t| t), along(|t| (19.0 * t).sin() * t)];
    snapshot(&dir.at("spiral"), &columns);
    dir.once("compress spiral -o spiral.pgs --gaussians 40 --effort fast --certificate=none --quiet");
    dir
}

/// Runs a command that must fail with `code`, one `error:` line that contains `text`, and nothing on stdout.
pub fn fails(command: &mut Command, code: i32, text: &str) {
    let out = command.output().unwrap();
    let err = said(&out);
    assert_eq!(out.status.code(), Some(code), "{err}");
    assert_eq!(errors(&err), 1, "{err}");
    assert!(err.lines().any(|l| l.starts_with("error:") && l.contains(text)), "{err}");
    assert!(!err.contains("panicked"), "{err}");
}

/// Waits until a process has a handler for a signal.
#[cfg(target_os = "linux")]
pub fn wait_for_handler(child: &std::process::Child, signal: u32) {
    let status = format!("/proc/{}/status", child.id());
    waited(&format!("a handler of signal {signal}"), || {
        let status = std::fs::read_to_string(&status).unwrap();
        let mask = status
            .lines()
            .find_map(|l| l.strip_prefix("SigCgt:"))
            .map_or(0, |m| u64::from_str_radix(m.trim(), 16).expect("a mask of signals"));
        mask >> (signal - 1) & 1 == 1
    });
}

/// Waits until a process has written this many bytes.
#[cfg(target_os = "linux")]
pub fn wait_for_bytes(child: &std::process::Child, bytes: u64) {
    let io = format!("/proc/{}/io", child.id());
    waited(&format!("{bytes} bytes written"), || {
        let io = std::fs::read_to_string(&io).unwrap();
        let written = io.lines().find_map(|l| l.strip_prefix("wchar:")).expect("what was written");
        written.trim().parse::<u64>().unwrap() >= bytes
    });
}

/// Polls every millisecond, for at most a minute.
pub fn waited(event: &str, mut ready: impl FnMut() -> bool) {
    let start = std::time::Instant::now();
    while !ready() {
        assert!(start.elapsed().as_secs() < 60, "waited a minute for {event}");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// Makes a named pipe.
#[cfg(unix)]
pub fn pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// Sends a signal by name, as `-INT`.
pub fn signal(child: &std::process::Child, name: &str) {
    let sent = std::process::Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(sent.unwrap().success(), "{name}: the process has ended before");
}

/// Files in a folder, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// All files under a folder.
#[cfg(target_os = "linux")]
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.flat_map(|p| if p.is_dir() { files(&p) } else { vec![p] }).collect()
}

/// The bytes of every regular file under a folder.
#[cfg(target_os = "linux")]
pub fn contents(folder: &Path) -> std::collections::BTreeMap<PathBuf, Vec<u8>> {
    let is_file = |p: &PathBuf| std::fs::symlink_metadata(p).is_ok_and(|m| m.is_file());
    files(folder).into_iter().filter(is_file).map(|p| (p.clone(), std::fs::read(&p).unwrap())).collect()
}

/// Runs the command with limited address space.
#[cfg(target_os = "linux")]
pub fn limited(dir: &TestFolder, mebibytes: u64, arguments: &str) -> Output {
    let binary = particlegs().get_program().to_owned();
    let script = format!("ulimit -v {}; exec \"$0\" {arguments} --threads 1 -q", mebibytes * 1024);
    std::process::Command::new("sh").current_dir(dir.path()).args(["-c", &script]).arg(binary).output().unwrap()
}

/// A model of one layer and one block.
fn model(metadata: Metadata, gaussians: Mixture) -> Model {
    let (bounds, count, mass) = (metadata.bounds, metadata.count, metadata.mass);
    let blocks = vec![Block { bounds, count, mass, gaussians }];
    let layers = vec![Layer { name: "particles".into(), mass: Mass::Unknown, content: blocks }];
    Model { metadata, layers, certificate: None }
}

fn encoded(model: &Model) -> Vec<u8> {
    codec::encode(model, &Precision::BALANCED).unwrap()
}

/// The file of a model of `n` equal Gaussians.
pub fn equal_gaussians(n: usize) -> Vec<u8> {
    let mut gaussians = Mixture::default();
    (0..n).for_each(|_| gaussians.push([1.0; 3], Sym3::scaled_identity(0.01), 1.0, 1.0));
    let bounds = Bounds { min: [0.0; 3], max: [2.0; 3] };
    encoded(&model(Metadata::new(LawKind::OpticalDepth, n as u64, bounds), gaussians))
}

/// Runs of the sample's particles, which are compact.
const RUN: usize = 4096;

/// The file of a model: moments of some of the sample's runs, with rising opacities if the law has any.
pub fn tiny(runs: std::ops::Range<usize>, law: LawKind) -> Vec<u8> {
    let particles = Particles::open_raw(&[sample()]).unwrap();
    let mut gaussians = Mixture::default();
    let network = VizMapper {
        parameters: (0..VIZMAPPER_PARAMETERS).map(|i| 0.01 * (i % 13) as f32).collect(),
        ranges: VizRanges::TRAINING,
    };
    let mut columns = AlphaBlend { vizmapper: Some(network.into()), ..AlphaBlend::default() };
    let mut bounds = Bounds::empty();
    for run in runs {
        let all: Vec<[f64; 3]> = (RUN * run..RUN * (run + 1)).map(|i| particles.position(i)).collect();
        let mean: [f64; 3] = std::array::from_fn(|k| all.iter().map(|p| p[k]).sum::<f64>() / RUN as f64);
        let outer = |p: &[f64; 3]| Sym3::outer(std::array::from_fn(|k| p[k] - mean[k]));
        let sum = all.iter().fold(Sym3::default(), |s, p| s.add(&outer(p)));
        all.iter().for_each(|p| bounds.include(*p));
        gaussians.push(mean, sum.scale(1.0 / RUN as f64), RUN as f64, RUN as f64);
        columns.opacity.push(0.02 + 0.01 * run as f64);
        columns.grey.push(0.9);
    }
    let count = (RUN * gaussians.len()) as u64;
    if law == LawKind::AlphaBlend {
        gaussians.law = Law::AlphaBlend(columns);
    }
    let metadata = Metadata {
        cell: particles.meta.cell,
        source: "nbody64".into(),
        units: particles.meta.units.clone(),
        cosmology: particles.meta.cosmology,
        epoch: particles.meta.epoch,
        source_hash: particles.source_hash(),
        ..Metadata::new(law, count, bounds)
    };
    encoded(&model(metadata, gaussians))
}

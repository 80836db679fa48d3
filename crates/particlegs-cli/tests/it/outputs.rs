//! Every command that writes, with every kind of output: written or refused, and no file of the user is changed.
#![cfg(target_os = "linux")]

use crate::common::{contents, errors, fails, files, listing, particlegs, pipe, process, said, snapshot};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Kind of output.
#[derive(Clone, Copy, Debug, PartialEq)]
enum OutputKind {
    /// A model, kept without --force.
    Model,
    /// A snapshot in one file, likewise.
    Particles,
    /// A model for other viewers, likewise.
    Export,
    /// A snapshot in a folder, likewise.
    Columns,
    /// A job's folder, likewise.
    Job,
    /// A folder with this file, which the same kind replaces.
    Within(&'static str),
    /// A result as JSON, likewise; its times differ between runs.
    Json,
}

/// A command line; OUT is the output, and other capitals are input files.
struct OutputCase {
    words: &'static str,
    writes: OutputKind,
    ending: &'static str,
}

const fn case(words: &'static str, writes: OutputKind, ending: &'static str) -> OutputCase {
    OutputCase { words, writes, ending }
}

const CASES: &[OutputCase] = &[
    case("compress snap -o OUT --certificate none --effort fast", OutputKind::Model, "pgs"),
    case(
        "compress snap/xx.f32 snap/yy.f32 snap/zz.f32 -o OUT --certificate none --effort fast",
        OutputKind::Model,
        "pgs",
    ),
    case("merge m.pgs n.pgs -o OUT", OutputKind::Model, "pgs"),
    case("merge job -o OUT --certificate none", OutputKind::Model, "pgs"),
    case("simplify m.pgs -o OUT --gaussians 3", OutputKind::Model, "pgs"),
    case("convert snap -o OUT", OutputKind::Particles, "npy"),
    case("convert snap -o OUT", OutputKind::Particles, "hdf5"),
    case("convert snap -o OUT", OutputKind::Particles, "vtp"),
    case("convert snap -o OUT", OutputKind::Particles, "dump"),
    case("convert snap -o OUT", OutputKind::Columns, ""),
    case("recover m.pgs -o OUT", OutputKind::Columns, ""),
    case("recover m.pgs -o OUT --form npy", OutputKind::Columns, ""),
    case("export m.pgs -o OUT", OutputKind::Export, "ply"),
    case("export m.pgs -o OUT", OutputKind::Export, "glb"),
    case("export m.pgs -o OUT", OutputKind::Export, "gltf"),
    case("export m.pgs -o OUT --grid 8", OutputKind::Export, "npy"),
    case("export m.pgs -o OUT --grid 8", OutputKind::Export, "vti"),
    case("export m.pgs -o OUT --grid 8", OutputKind::Export, "fits"),
    case("export m.pgs -o OUT --grid 8", OutputKind::Export, "dx"),
    case("export m.pgs -o OUT --grid 8", OutputKind::Export, "mrc"),
    case("export m.pgs -o OUT", OutputKind::Export, "npz"),
    case("export m.pgs -o OUT", OutputKind::Export, "csv"),
    case("plan snap -o OUT --blocks 2 --certificate none", OutputKind::Job, ""),
    case("render m.pgs --out OUT --size 64x48", OutputKind::Within("view.png"), ""),
    case("render m.pgs --out OUT --size 64x48 --style density", OutputKind::Within("view.png"), ""),
    case("render m.pgs --out OUT --size 64x48 --style density --raw", OutputKind::Within("view.f32"), ""),
    case("reference snap --out OUT --size 64x48", OutputKind::Within("view.png"), ""),
    case("reference snap --out OUT --size 64x48 --style density", OutputKind::Within("view.png"), ""),
    case("stats snap m.pgs -o OUT --only moments --no-plots", OutputKind::Within("stats.json"), ""),
    case("info m.pgs --json OUT", OutputKind::Json, "json"),
    case("info snap --json OUT", OutputKind::Json, "json"),
    case("verify m.pgs --json OUT", OutputKind::Json, "json"),
    case("verify job --json OUT", OutputKind::Json, "json"),
    case("eval m.pgs snap --frames 1 --size 64x36 --json OUT", OutputKind::Json, "json"),
    case("compare pictures pictures --json OUT", OutputKind::Json, "json"),
    case("status job --json OUT", OutputKind::Json, "json"),
    case("scatter job --json OUT", OutputKind::Json, "json"),
    case("block job 0 --json OUT", OutputKind::Json, "json"),
];

impl OutputCase {
    fn is_file(&self) -> bool {
        matches!(self.writes, OutputKind::Model | OutputKind::Particles | OutputKind::Export | OutputKind::Json)
    }

    fn has_force(&self) -> bool {
        !matches!(self.writes, OutputKind::Json | OutputKind::Within(_))
    }

    fn force(&self) -> &'static [&'static str] {
        if self.has_force() { &["--force"] } else { &[] }
    }

    fn out(&self, folder: &Path) -> PathBuf {
        folder.join(if self.ending.is_empty() { "out".into() } else { format!("out.{}", self.ending) })
    }

    /// The inputs as files.
    fn inputs(&self, w: &OutputFiles) -> Vec<PathBuf> {
        let named = self.words.split(' ').map(|word| w.at(word)).filter(|p| p.exists());
        named.flat_map(|p| if p.is_dir() { files(&p) } else { vec![p] }).collect()
    }
}

/// Files of every kind that commands read.
struct OutputFiles {
    dir: tempfile::TempDir,
    before: BTreeMap<PathBuf, Vec<u8>>,
}

impl OutputFiles {
    fn new() -> OutputFiles {
        let dir = tempfile::tempdir().unwrap();
        let mut w = OutputFiles { dir, before: BTreeMap::new() };
        let columns = |seed: u32| -> Vec<Vec<f32>> {
            let number = |i: u32, k: u32| (i * (37 + 14 * k) + seed) % 101;
            (0..3).map(|k| (0..500).map(|i| number(i, k) as f32 * 0.1).collect()).collect()
        };
        snapshot(&w.at("snap"), &columns(1));
        std::fs::write(w.at("snap/meta.json"), "{\"name\": \"snap\"}").unwrap();
        snapshot(&w.at("other"), &columns(5));
        for words in [
            "compress snap -o m.pgs --certificate none --effort fast --gaussians 8",
            "compress other -o n.pgs --certificate none --effort fast --gaussians 5",
            "plan snap -o job --blocks 2 --certificate none --effort fast",
            "scatter job",
            "block job 0",
            "block job 1",
            "render m.pgs --out pictures --size 64x48",
        ] {
            w.ends(&mut w.command(words, Path::new("")), 0);
        }
        w.before = contents(w.dir.path());
        w
    }

    fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// The command with OUT replaced.
    fn command(&self, words: &str, out: &Path) -> Command {
        let mut c = process(self.dir.path());
        let word = |w: &str| if w == "OUT" { out.as_os_str().to_os_string() } else { OsString::from(w) };
        c.args(words.split(' ').map(word)).stdin(Stdio::null());
        c
    }

    /// Runs a command and checks its exit code.
    fn ends(&self, command: &mut Command, code: i32) -> Output {
        let out = command.output().unwrap();
        assert_eq!(out.status.code(), Some(code), "{command:?}: {}", said(&out));
        out
    }

    /// Checks that no earlier file has changed.
    fn unchanged(&self, label: &str) {
        let now = contents(self.dir.path());
        for (path, bytes) in &self.before {
            assert!(now.get(path) == Some(bytes), "{label}: {} has changed", path.display());
        }
    }

    /// A new folder beside the inputs.
    fn folder(&self) -> tempfile::TempDir {
        tempfile::tempdir_in(self.dir.path()).unwrap()
    }

    /// Runs a case and checks its exit code and unchanged inputs.
    fn demand(&self, case: &OutputCase, description: &str, out: &Path, more: &[&str], code: i32) -> Output {
        let mut c = self.command(case.words, out);
        let label = format!("{} ({}): {description}", case.words, case.ending);
        let out = c.args(more).output().unwrap();
        let err = said(&out);
        assert_eq!(out.status.code(), Some(code), "{label}: {err}");
        assert!(!err.contains("panicked"), "{label}: {err}");
        assert_eq!(errors(&err), usize::from(code != 0), "{label}: {err}");
        self.unchanged(&label);
        out
    }
}

/// A null device that may be replaced, unlike the system's; without root the system's cannot be replaced anyway.
fn null_device(folder: &Path) -> PathBuf {
    let node = folder.join("null");
    let status = Command::new("mknod").arg(&node).args(["c", "1", "3"]).stderr(Stdio::null()).status();
    if status.is_ok_and(|s| s.success()) && std::fs::write(&node, "x").is_ok() { node } else { "/dev/null".into() }
}

#[test]
fn an_input_is_never_an_output() {
    let w = OutputFiles::new();
    for case in CASES.iter().filter(|c| c.is_file()) {
        let folder = w.folder();
        let force = case.force();
        for (i, input) in case.inputs(&w).iter().enumerate() {
            w.demand(case, "an input", input, force, 8);
            let spelled = w.at("snap/..").join(input.strip_prefix(w.dir.path()).unwrap());
            w.demand(case, "an input, spelled otherwise", &spelled, force, 8);
            let (soft, hard) = (folder.path().join(format!("soft{i}")), folder.path().join(format!("hard{i}")));
            symlink(input, &soft).unwrap();
            std::fs::hard_link(input, &hard).unwrap();
            w.demand(case, "a link to an input", &soft, force, 8);
            w.demand(case, "another name of an input", &hard, force, 8);
        }
    }
    for case in CASES.iter().filter(|c| matches!(c.writes, OutputKind::Columns | OutputKind::Job)) {
        let reads_it = !case.words.starts_with("recover");
        for input in ["snap", "snap/../snap"] {
            let force: &[&str] = if reads_it { &["--force"] } else { &[] };
            w.demand(case, "a folder of real particles", &w.at(input), force, 8);
        }
        w.demand(case, "the folder around an input", &w.at("."), &["--force"], 8);
    }
    // An argument that is refused before reading the model.
    let tuned = case("finetune m.pgs snap -o OUT --certificate none --scale 0.01", OutputKind::Model, "pgs");
    for input in ["m.pgs", "snap/xx.f32", "snap/meta.json"] {
        w.demand(&tuned, "an input", &w.at(input), &["--force"], 8);
    }
    w.demand(&tuned, "another model", &w.at("n.pgs"), &[], 8);
}

#[test]
fn only_the_same_kind_is_replaced_and_models_particles_and_jobs_only_by_force() {
    let w = OutputFiles::new();
    for case in CASES {
        let folder = w.folder();
        let out = case.out(folder.path());
        w.demand(case, "a new place", &out, &[], 0);
        let first = contents(folder.path());
        assert!(!first.is_empty());
        let clean = || listing(folder.path()).iter().all(|n| !n.starts_with(".particlegs"));
        assert!(clean(), "{}", case.words);
        // The same again: accepted as done, or replaced.
        w.ends(&mut w.command(case.words, &out), 0);
        if !case.has_force() {
            continue;
        }
        assert_eq!(contents(folder.path()), first);
        // Something else of the same kind.
        let other = match case.writes {
            OutputKind::Model => "simplify n.pgs -o OUT --gaussians 2 --force",
            OutputKind::Particles | OutputKind::Columns => "convert other -o OUT --force",
            OutputKind::Export => "export n.pgs -o OUT --force",
            _ => "plan other -o OUT --blocks 3 --certificate none --force",
        };
        w.ends(&mut w.command(other, &out), 0);
        let other_contents = contents(folder.path());
        assert_ne!(other_contents, first);
        w.demand(case, "another one is there", &out, &[], 8);
        assert_eq!(contents(folder.path()), other_contents, "{}", case.words);
        w.demand(case, "another one is there", &out, &["--force"], 0);
        assert_eq!(contents(folder.path()), first, "{}", case.words);
        assert!(clean(), "{}", case.words);
    }
}

#[test]
fn files_of_other_kinds_stay() {
    let w = OutputFiles::new();
    for case in CASES.iter().filter(|c| c.writes != OutputKind::Particles) {
        let folder = w.folder();
        let (mut place, out) = (case.out(folder.path()), case.out(folder.path()));
        if !case.is_file() {
            std::fs::create_dir(&out).unwrap();
            place = out.join(if let OutputKind::Within(name) = case.writes { name } else { "notes.txt" });
        }
        std::fs::write(&place, "my notes").unwrap();
        for more in [&[][..], case.force()] {
            w.demand(case, "notes are there", &out, more, 8);
            assert_eq!(contents(folder.path()), [(place.clone(), b"my notes".to_vec())].into());
        }
    }
}

#[test]
fn links_are_followed_and_devices_and_pipes_written_through() {
    let w = OutputFiles::new();
    for case in CASES {
        let folder = w.folder();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("far")).unwrap();
        let plain = case.out(&at("far"));
        let link = case.out(folder.path());
        symlink(&plain, &link).unwrap();
        if !case.is_file() {
            std::fs::create_dir(&plain).unwrap();
        }
        w.demand(case, "a link", &link, &[], 0);
        w.demand(case, "a link to one that is there", &link, case.force(), 0);
        assert!(link.is_symlink() && plain.exists(), "{}", case.words);
        let null = null_device(folder.path());
        if !case.is_file() {
            let (description, code) = match case.writes {
                // Pictures follow links, like any file.
                OutputKind::Within("view.png") => ("a device takes one picture", 0),
                OutputKind::Within("view.f32") => ("a device takes no values beside their description", 2),
                OutputKind::Within(_) => ("a device is no folder", 6),
                _ => ("a device is no folder", 8),
            };
            w.demand(case, description, &null, &[], code);
            continue;
        }
        let written = std::fs::read(&plain).unwrap();
        // The extension selects the format, and a device has none.
        let to: &[&str] = match (case.writes, case.ending) {
            (OutputKind::Particles, "dump") => &["--to", "lammps"],
            (OutputKind::Particles, ending) => &["--to", ending],
            (OutputKind::Export, ending) => &["--kind", ending],
            _ => &[],
        };
        w.demand(case, "a device", &null, to, 0);
        assert!(std::fs::metadata(&null).unwrap().file_type().is_char_device(), "{}", case.words);
        let fifo = at("pipe");
        pipe(&fifo);
        let reader = std::thread::spawn({
            let fifo = fifo.clone();
            move || std::fs::read(fifo).unwrap()
        });
        w.demand(case, "a pipe", &fifo, to, 0);
        let pipe_text = reader.join().unwrap();
        assert!(std::fs::metadata(&fifo).unwrap().file_type().is_fifo());
        let printed = w.demand(case, "standard output", Path::new("-"), to, 0).stdout;
        if case.writes == OutputKind::Json {
            assert!([pipe_text, printed].iter().all(|text| serde_json::from_slice::<serde_json::Value>(text).is_ok()));
        } else {
            assert!(pipe_text == written && printed == written, "{}", case.words);
        }
        assert!(listing(folder.path()).iter().all(|n| !n.starts_with(".particlegs")));
    }
}

#[test]
fn full_disks_and_unwritable_folders_leave_nothing() {
    let w = OutputFiles::new();
    for case in CASES {
        let folder = w.folder();
        let out = case.out(folder.path());
        let out = limited(&w, &w.command(case.words, &out), 0);
        assert_eq!(out.status.code(), Some(6), "{}: {}", case.words, said(&out));
        assert!(listing(folder.path()).is_empty(), "{}: {:?}", case.words, listing(folder.path()));
        // Not even root can make files there.
        w.demand(case, "a place that cannot be written", &case.out(Path::new("/proc")), &[], 6);
        w.unchanged(case.words);
    }
}

/// Runs a command with a limit on file sizes, in blocks of 512 bytes.
fn limited(w: &OutputFiles, command: &Command, blocks: u32) -> Output {
    let mut sh = Command::new("sh");
    sh.arg("-c").arg(format!("ulimit -f {blocks}; exec \"$0\" \"$@\""));
    sh.arg(command.get_program()).args(command.get_args()).current_dir(w.dir.path()).output().unwrap()
}

/// If space runs out within a set of files, none of them appears.
#[test]
fn files_of_a_set_appear_together() {
    let w = OutputFiles::new();
    let mut failed = [0, 0];
    for blocks in [1, 4, 16, 40, 80, 1000] {
        let folder = w.folder();
        let words = "stats snap m.pgs -o OUT --only density,moments --grid 8";
        let out = limited(&w, &w.command(words, folder.path()), blocks);
        let file_count = listing(folder.path()).len();
        match out.status.code() {
            Some(0) => assert!(file_count > 5),
            code => assert_eq!((code, file_count), (Some(6), 0), "{blocks}: {:?}", listing(folder.path())),
        }
        failed[0] += usize::from(!out.status.success());
    }
    for blocks in [4, 60, 120, 240, 10_000] {
        let folder = w.folder();
        let words = "compress snap -o OUT --certificate none --effort fast --pictures";
        let mut c = w.command(words, &folder.path().join("m.pgs"));
        let out = limited(&w, c.arg(folder.path()), blocks);
        let names = listing(folder.path());
        match out.status.code() {
            Some(0) => assert_eq!(names, ["comparison.png", "density.png", "m.pgs"]),
            code => {
                assert_eq!((code, &names[..]), (Some(6), &["m.pgs".to_string()][..]), "{blocks}");
                assert!(said(&out).contains("note: wrote the model"), "{blocks}");
            }
        }
        failed[1] += usize::from(!out.status.success());
    }
    assert!((2..6).contains(&failed[0]) && (2..5).contains(&failed[1]), "{failed:?}");
}

/// A concurrent reader of a folder never sees new and old columns together.
#[test]
fn a_failure_leaves_the_old_columns_complete() {
    let w = OutputFiles::new();
    for words in
        ["convert other -o OUT --force", "recover n.pgs -o OUT --force", "recover n.pgs -o OUT --form npy --force"]
    {
        let folder = w.folder();
        let out = folder.path().join("out");
        w.ends(&mut w.command("convert snap -o OUT", &out), 0);
        let before = contents(folder.path());
        let full = limited(&w, &w.command(words, &out), 0);
        assert_eq!(full.status.code(), Some(6), "{words}: {}", said(&full));
        assert_eq!(contents(folder.path()), before, "{words}");
        assert_eq!(listing(folder.path()), ["out"]);
        w.ends(&mut w.command(words, &out), 0);
        assert_eq!(listing(folder.path()), ["out"]);
        let columns = ["meta.json", "xx.f32", "yy.f32", "zz.f32"];
        let form: &[&str] = if words.contains("npy") { &["meta.json", "positions.npy"] } else { &columns };
        assert_eq!(listing(&out), form);
    }
}

#[test]
fn two_outputs_are_never_one() {
    let w = OutputFiles::new();
    let folder = w.folder();
    let out = folder.path().join("out.pgs");
    for words in [
        "compress snap -o OUT --certificate none --effort fast --json OUT",
        "compress snap -o OUT --certificate none --effort fast --train fast --log OUT",
        "merge m.pgs n.pgs -o OUT --json OUT",
        "simplify m.pgs -o OUT --gaussians 3 --json OUT",
        "convert snap -o OUT --to npy --json OUT",
    ] {
        w.ends(&mut w.command(words, &out), 8);
        assert!(w.ends(&mut w.command(words, Path::new("-")), 8).stdout.is_empty());
    }
    // Other outputs of a run are also checked before the work.
    let (log, here, settings) = (folder.path().join("log.jsonl"), folder.path(), w.folder());
    let config = settings.path().join("config.toml");
    std::fs::write(&config, "# as the preset\n").unwrap();
    for (option, path, name) in [
        ("--log", log.as_path(), "log.jsonl"),
        ("--log", &log, "log-psnr.png"),
        ("--config", &config, "out.pgs.checkpoint"),
        ("--pictures", here, "density.png"),
    ] {
        std::fs::write(folder.path().join(name), "my notes").unwrap();
        let mut c = w.command("compress snap -o OUT --effort fast --train fast", &out);
        w.ends(c.arg(option).arg(path), 8);
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    let within = folder.path().join("comparison.png");
    let mut c = w.command("compress snap -o OUT --certificate none --effort fast --pictures", &within);
    w.ends(c.arg(folder.path()), 8);
    w.ends(&mut w.command("compress snap -o OUT --train fast --log snap/xx.f32", &out), 8);
    assert!(listing(folder.path()).is_empty(), "{:?}", listing(folder.path()));
    w.unchanged("two outputs");
}

#[test]
fn empty_new_folders_are_removed() {
    let w = OutputFiles::new();
    let folder = w.folder();
    for words in [
        "compress nowhere -o m.new --pictures OUT",
        "render snap/xx.f32 --out OUT",
        "stats snap nowhere -o OUT",
        "plan nowhere -o OUT",
        "recover snap/xx.f32 -o OUT",
        "reference nowhere --out OUT",
    ] {
        let out = w.command(words, &folder.path().join("made/new")).output().unwrap();
        assert_ne!(out.status.code(), Some(0), "{words}");
        assert!(listing(folder.path()).is_empty(), "{words}: {:?}", listing(folder.path()));
    }
    w.ends(&mut w.command("compress snap -o OUT --memory 1GiB --scratch nowhere", &folder.path().join("m.pgs")), 6);
}

/// The README's first command, twice: the model is accepted as done, and the pictures are drawn again.
#[test]
fn repeating_a_compression_reports_that_it_is_done() {
    let w = OutputFiles::new();
    let folder = w.folder();
    let out = folder.path().join("m.pgs");
    let words = "compress snap -o OUT --certificate none --effort fast";
    let run = |more: &[&str], code| w.ends(w.command(words, &out).args(more), code);
    let modified = || std::fs::metadata(&out).unwrap().modified().unwrap();
    run(&[], 0);
    let written_at = modified();
    let again = run(&["--pictures", folder.path().to_str().unwrap()], 0);
    let text = String::from_utf8_lossy(&again.stdout).into_owned();
    assert!(text.contains("already exists"), "{text}");
    assert_eq!(listing(folder.path()), ["comparison.png", "density.png", "m.pgs"]);
    assert_eq!(modified(), written_at);
    for other in
        [&["--seed", "7"][..], &["--box", "20"], &["--length-unit", "Mpc"], &["--blocks", "2"], &["--ratio", "50"]]
    {
        run(other, 8);
    }
    w.ends(&mut w.command("compress other -o OUT --certificate none --effort fast", &out), 8);
    assert_eq!(modified(), written_at);
}

/// A conversion does not record its options, so its output is compared.
#[test]
fn repeating_a_conversion_reports_that_it_is_done() {
    let w = OutputFiles::new();
    let folder = w.folder();
    for name in ["columns", "a.npy", "a.hdf5", "a.vtp"] {
        let out = folder.path().join(name);
        let run = |more: &[&str], code| w.ends(w.command("convert snap -o OUT", &out).args(more), code);
        let modified = || std::fs::metadata(&out).unwrap().modified().unwrap();
        run(&[], 0);
        let written_at = modified();
        let text = said(&run(&[], 0));
        assert!(text.contains("already exists and is the same"), "{name}: {text}");
        run(&["--every", "2"], 8);
        assert_eq!(modified(), written_at, "{name}");
    }
    assert_eq!(listing(folder.path()), ["a.hdf5", "a.npy", "a.vtp", "columns"]);
}

/// A full standard output is an error in every command; a closed pipe is not.
#[test]
fn standard_output_that_is_full_or_closed() {
    let w = OutputFiles::new();
    for words in ["--help", "--version", "completions bash", "info m.pgs", "info m.pgs --json -", "compress --help"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        w.ends(w.command(words, Path::new("")).stdout(full), 6);
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        w.ends(w.command(words, Path::new("")).stdout(writer), 0);
    }
}

/// With a full standard error only messages are lost.
#[test]
fn standard_error_that_is_full() {
    let w = OutputFiles::new();
    for (words, code) in [("info m.pgs", 0), ("info nowhere", 6), ("convert snap", 2)] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        w.ends(w.command(words, Path::new("")).stderr(full), code);
    }
    // An endless device is not copied for a format that it is not in.
    fails(particlegs().args(["info", "--format", "npy", "/dev/zero"]), 3, "first bytes");
}

/// A killed conversion leaves the old columns; the next run removes its partial files.
#[test]
fn a_killed_conversion_leaves_the_old_columns() {
    let w = OutputFiles::new();
    let folder = w.folder();
    let out = folder.path().join("out");
    w.ends(&mut w.command("convert snap -o OUT", &out), 0);
    let before = contents(&out);
    std::fs::write(w.at("snap/meta.json"), "{\"name\": \"snap\", \"box\": [11, 11, 11]}").unwrap();
    let mut child = w.command("convert snap -o OUT --force --quiet --tile 16,32,32", &out).spawn().unwrap();
    let begun = || listing(folder.path()).len() == 2;
    while !begun() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success(), "it was still writing 8 million particles");
    assert_eq!(contents(&out), before);
    assert!(begun(), "a folder has a name even before it is whole");
    w.ends(&mut w.command("convert snap -o OUT --force", &out), 0);
    assert_eq!(listing(folder.path()), ["out"]);
}

/// A command waits for the reader of a pipe; the wait can be interrupted.
#[test]
fn a_pipe_without_a_reader_is_reported_and_can_be_interrupted() {
    let w = OutputFiles::new();
    let folder = w.folder();
    let fifo = folder.path().join("pipe");
    pipe(&fifo);
    let mut child = w.command("info m.pgs --json OUT", &fifo).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    let mut lines = std::io::BufReader::new(child.stderr.take().unwrap());
    std::io::BufRead::read_line(&mut lines, &mut line).unwrap();
    assert!(line.contains("waiting for a reader"), "{line}");
    assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

/// Batch systems signal more than once: a block still keeps finished work.
#[test]
fn a_second_signal_still_leaves_a_checkpoint() {
    let w = OutputFiles::new();
    let long: Vec<f32> = (0..240_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 12) as f32).collect();
    snapshot(&w.at("long"), &[long.clone(), long.iter().rev().copied().collect(), long]);
    w.ends(&mut w.command("plan long -o OUT --blocks 1 --gaussians 40000 --certificate none", &w.at("task")), 0);
    w.ends(&mut w.command("scatter task -q", Path::new("")), 0);
    let mut child = w.command("block task 0 -q", Path::new("")).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    for _ in 0..3 {
        let _ = Command::new("kill").arg(child.id().to_string()).stderr(Stdio::null()).status();
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let code = child.wait().unwrap().code();
    assert_eq!(code, Some(75), "it is still at work after a second and a half, and then stops");
}
